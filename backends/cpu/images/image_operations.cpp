// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/image_operations.h"

#include <bit>
#include <cstring>

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

namespace {

TexelWords fetch_texel(const ImageView* image, std::uint32_t first, std::uint32_t second, std::uint32_t third,
                       std::uint32_t level, std::uint32_t flags) {
    const bool is_integer = (flags & image_integer) != 0;
    const auto joined = [](std::uint32_t low, std::uint32_t high) { return low | std::uint64_t{high} << 32; };
    const DirectTexels words = is_integer ? DirectTexels::integer_word : DirectTexels::float_word;
    const bool is_pair = is_integer && image->direct_texels == DirectTexels::integer_pair;
    if ((image->direct_texels == words || is_pair) && image->dimension == rhi::ViewDimension::d2 &&
        level < image->mip_count) {
        const ImageLevel& from = image->levels[level];
        if (first >= from.width || second >= from.height) return {};
        const std::size_t bytes = is_pair ? 8 : 4;
        std::uint64_t first_two = 0;
        std::memcpy(&first_two, from.data + std::size_t{second} * from.row_stride + first * bytes, bytes);
        return {first_two, joined(0, is_integer ? 1 : std::bit_cast<std::uint32_t>(1.0f))};
    }
    static const NacreCpuImageFunction run = image_function(4);
    ImageArguments arguments;
    for (std::uint32_t lane = 0; lane < 4; ++lane) {
        arguments.coordinates[0][lane] = first, arguments.coordinates[1][lane] = second;
        arguments.coordinates[2][lane] = third, arguments.lod[lane] = std::bit_cast<float>(level);
        arguments.sample[lane] = 0;
    }
    run(image, nullptr, &arguments, flags, 1);
    const auto& result = arguments.result;
    return {joined(result[0][0], result[1][0]), joined(result[2][0], result[3][0])};
}

}  // namespace

NacreCpuTexelFunction texel_function() { return fetch_texel; }

NacreCpuImageFunction image_function(std::uint32_t lanes) { return image_function(lanes, best_instruction_set()); }

}  // namespace nacre::cpu
