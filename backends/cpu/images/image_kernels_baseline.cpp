// SPDX-License-Identifier: Apache-2.0
// Image operations for any machine.
#define NACRE_KERNEL_NAMESPACE baseline
#include "backends/cpu/images/image_kernels.h"
#include "backends/cpu/images/kernels/image_kernels.h"

namespace nacre::cpu::baseline {

NacreCpuImageFunction image_function(std::uint32_t lanes) {
    if (lanes == 4) return image_function<4, 4>;
    return lanes == 8 ? image_function<8, 4> : image_function<16, 4>;
}

}  // namespace nacre::cpu::baseline
