// SPDX-License-Identifier: Apache-2.0
// Image operations for AVX2.
#define NACRE_KERNEL_NAMESPACE avx2
#include "backends/cpu/images/image_kernels.h"
#include "backends/cpu/images/kernels/image_kernels.h"

namespace nacre::cpu::avx2 {

NacreCpuImageFunction image_function(std::uint32_t lanes) {
    if (lanes == 4) return image_function<4, 4>;
    return lanes == 8 ? image_function<8, 8> : image_function<16, 8>;
}

}  // namespace nacre::cpu::avx2
