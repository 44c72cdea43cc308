// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/image_operations.h"

#include "backends/cpu/images/image_kernels.h"

namespace nacre::cpu {

bool is_supported(InstructionSet set) {
    if (set == InstructionSet::baseline) return true;
#ifdef NACRE_X86_KERNELS
    if (set == InstructionSet::avx2) {
        return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("f16c");
    }
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512vbmi");
#else
    return false;
#endif
}

InstructionSet best_instruction_set() {
    static const InstructionSet best = is_supported(InstructionSet::avx512) ? InstructionSet::avx512
                                       : is_supported(InstructionSet::avx2) ? InstructionSet::avx2
                                                                            : InstructionSet::baseline;
    return best;
}

NacreCpuImageFunction image_function(std::uint32_t lanes, InstructionSet set) {
    if ((lanes != 4 && lanes != 8 && lanes != 16) || !is_supported(set)) return nullptr;
#ifdef NACRE_X86_KERNELS
    if (set == InstructionSet::avx512) return avx512::image_function(lanes);
    if (set == InstructionSet::avx2) return avx2::image_function(lanes);
#endif
    return baseline::image_function(lanes);
}

NacreCpuImageFunction image_function(std::uint32_t lanes) { return image_function(lanes, best_instruction_set()); }

}  // namespace nacre::cpu
