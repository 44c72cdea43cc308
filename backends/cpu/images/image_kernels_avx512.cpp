// SPDX-License-Identifier: Apache-2.0
// Image operations for AVX-512.
#define NACRE_KERNEL_NAMESPACE avx512
#include "backends/cpu/images/image_kernels.h"
#include "backends/cpu/images/kernels/image_kernels.h"

namespace nacre::cpu::avx512 {

NacreCpuImageFunction image_function(std::uint32_t lanes) {
    if (lanes == 4) return image_function<4, 4>;
    return lanes == 8 ? image_function<8, 8> : image_function<16, 16>;
}

}  // namespace nacre::cpu::avx512
