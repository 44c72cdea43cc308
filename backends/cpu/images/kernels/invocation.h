// SPDX-License-Identifier: Apache-2.0
// One call of an image operation for W of its lanes, and what all operations make of its arguments.
#pragma once

#include "backends/cpu/images/kernels/texel_codecs.h"
#include "backends/cpu/images/view_axes.h"
#include "backends/cpu/shader_interface.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

struct Invocation {
    const ImageView* image;
    const SamplerState* sampler;
    ImageArguments* arguments;
    std::uint32_t flags;
    std::uint32_t live;  ///< Bit 0 is lane `first_lane`.
    int first_lane;

    template <int W>
    [[nodiscard]] NACRE_INLINE Floats<W> floats(const void* array) const {
        return load_floats<W>(static_cast<const float*>(array) + first_lane);
    }
    template <int W>
    [[nodiscard]] NACRE_INLINE Ints<W> ints(const void* array) const {
        return load_ints<W>(static_cast<const std::int32_t*>(array) + first_lane);
    }
    [[nodiscard]] NACRE_INLINE bool has(ImageFlags flag) const { return (flags & flag) != 0; }
};

template <int W>
NACRE_INLINE void write_result(const Invocation& call, const Floats<W>* channels, Ints<W> live) {
    for (int c = 0; c < 4; ++c)
        store_lanes<W>(call.arguments->result[c] + call.first_lane, (Ints<W>)channels[c] & live);
}
template <int W>
NACRE_INLINE void write_zeros(const Invocation& call) {
    for (int c = 0; c < 4; ++c) store_lanes<W>(call.arguments->result[c] + call.first_lane, splat<W>(0));
}

NACRE_INLINE int first_bit(std::uint32_t bits) { return __builtin_ctz(bits); }

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
