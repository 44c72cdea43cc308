// SPDX-License-Identifier: Apache-2.0
// One call of an image operation for W of its lanes, and what all operations make of its arguments.
#pragma once

#include "backends/cpu/images/kernels/texel_codecs.h"
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

/// Shape of the coordinates of a view.
struct Axes {
    int spatial = 2;  ///< Coordinates besides the layer; cubes: 3.
    bool is_cube = false;
    bool has_layers = false;  ///< A layer follows.
};
NACRE_INLINE Axes axes_of(rhi::ViewDimension dimension) {
    using enum rhi::ViewDimension;
    switch (dimension) {
        case d1: return {1, false, false};
        case d1_array: return {1, false, true};
        case d2_array: return {2, false, true};
        case d3: return {3, false, false};
        case cube: return {3, true, false};
        case cube_array: return {3, true, true};
        default: return {2, false, false};
    }
}

NACRE_INLINE int first_bit(std::uint32_t bits) { return __builtin_ctz(bits); }

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
