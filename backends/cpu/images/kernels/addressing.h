// SPDX-License-Identifier: Apache-2.0
// From coordinates to texels and weights. Source: Vulkan specification, "Texel Coordinate Systems", "Wrapping
// Operation", "Texel Filtering".
#pragma once

#include "backends/cpu/images/kernels/invocation.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

/// The texels of one filter footprint. Tap 0 is (i0, j0, k0); bit 0 of the number stands for i1, bit 1 for j1, bit 2
/// for k1.
template <int W>
struct Taps {
    int count = 1;
    bool has_border = false;
    Place<W> places[8];
    Floats<W> weights[8];  ///< Not set where count is 1.
    Ints<W> is_border[8];  ///< Set where has_border.
    /// Cubes: taps at a corner of the cube, where three faces meet and a fourth texel does not exist.
    bool has_corner = false;
    Ints<W> is_corner[4];
};

/// The two texels along one axis (nearest: the first).
template <int W>
struct AxisTaps {
    Ints<W> first, second;
    Floats<W> weight;  ///< Of the second.
    Ints<W> first_is_border, second_is_border;
};

/// i modulo n in [0, n); |i| < 2^23.
template <int W>
NACRE_INLINE Ints<W> modulo(Ints<W> i, std::int32_t n) {
    const Ints<W> quotient = truncate<W>(to_floats<W>(i) / static_cast<float>(n));
    Ints<W> rest = i - quotient * n;
    rest += (rest < 0) & n;
    rest -= (rest >= n) & n;
    return rest;
}

template <int W>
NACRE_INLINE void wrap(Ints<W>& i, Ints<W>& is_border, std::int32_t n, rhi::AddressMode mode, bool has_offset) {
    is_border = splat<W>(0);
    switch (mode) {
        case rhi::AddressMode::repeat:
            if (has_offset) {
                i = modulo<W>(i, n);
            } else {
                i = i < 0 ? i + n : i;
                i = i >= n ? i - n : i;
            }
            break;
        case rhi::AddressMode::mirrored_repeat:
            if (has_offset) i = modulo<W>(i, 2 * n);
            i = i < 0 ? -1 - i : i;
            i = i >= n ? 2 * n - 1 - i : i;
            break;
        case rhi::AddressMode::clamp_to_border: is_border = (i < 0) | (i >= n); break;
        default: break;
    }
    i = clamp<W>(i, 0, n - 1);
}

/// Coordinate in texels, in a range in which whole numbers are exact. Periods are taken off before the multiplication,
/// where no bits are lost by it.
template <int W>
NACRE_INLINE Floats<W> unnormalized(Floats<W> s, std::int32_t n, rhi::AddressMode mode) {
    const auto size = static_cast<float>(n);
    switch (mode) {
        case rhi::AddressMode::repeat: return fraction<W>(s) * size;
        case rhi::AddressMode::mirrored_repeat: return fraction<W>(s * 0.5f) * 2.0f * size;
        default: return clamp<W>(s * size, splat<W>(-4194304.0f), splat<W>(4194304.0f));
    }
}

template <int W>
NACRE_INLINE Ints<W> bounded_offset(Ints<W> offset) {
    return clamp<W>(offset, -2097152, 2097152);
}

template <int W>
NACRE_INLINE AxisTaps<W> linear_axis(Floats<W> s, std::int32_t n, rhi::AddressMode mode, const Ints<W>* offset) {
    AxisTaps<W> taps;
    const Floats<W> u = unnormalized<W>(s, n, mode) - 0.5f, whole = floor_small<W>(u);
    taps.weight = u - whole;
    taps.first = truncate<W>(whole);
    if (offset != nullptr) taps.first += bounded_offset<W>(*offset);
    taps.second = taps.first + 1;
    wrap<W>(taps.first, taps.first_is_border, n, mode, offset != nullptr);
    wrap<W>(taps.second, taps.second_is_border, n, mode, offset != nullptr);
    return taps;
}

template <int W>
NACRE_INLINE AxisTaps<W> nearest_axis(Floats<W> s, std::int32_t n, rhi::AddressMode mode, const Ints<W>* offset) {
    AxisTaps<W> taps;
    Ints<W> i = truncate<W>(floor_small<W>(unnormalized<W>(s, n, mode)));
    if (offset != nullptr)
        i += bounded_offset<W>(*offset);
    else if (mode == rhi::AddressMode::repeat)
        i = minimum<W>(i, splat<W>(n - 1));  // Just below a period rounds up to it.
    taps.first = i;
    wrap<W>(taps.first, taps.first_is_border, n, mode, offset != nullptr);
    return taps;
}

/// Layer of an array: rounded to nearest even, clamped.
template <int W>
NACRE_INLINE Ints<W> array_layer(Floats<W> layer, std::uint32_t count) {
    // Counts beyond 2^22 do not exist.
    const Floats<W> bounded = clamp<W>(layer, splat<W>(0.0f), splat<W>(4194303.0f));
    return clamp<W>(truncate<W>(round_small<W>(bounded)), 0, static_cast<std::int32_t>(count) - 1);
}

struct AddressModes {
    rhi::AddressMode u, v, w;
};

/// Footprint in an image that is no cube. `spatial` is 1 to 3; `slice` the layer where it is below 3.
template <int W>
[[gnu::noinline]] void make_taps(const Source& source, const Floats<W>* coordinates, Ints<W> slice, int spatial,
                                 bool is_linear, AddressModes modes, const Ints<W>* offsets, Taps<W>& taps) {
    const Ints<W>* offset_y = offsets != nullptr ? offsets + 1 : nullptr;
    const Ints<W>* offset_z = offsets != nullptr ? offsets + 2 : nullptr;
    const auto is_border = [](rhi::AddressMode mode) { return mode == rhi::AddressMode::clamp_to_border; };
    taps.has_border = is_border(modes.u) || (spatial > 1 && is_border(modes.v)) || (spatial > 2 && is_border(modes.w));
    if (!is_linear) {
        taps.count = 1;
        const AxisTaps<W> x = nearest_axis<W>(coordinates[0], source.width, modes.u, offsets);
        AxisTaps<W> y, z;
        y.first = splat<W>(0), y.first_is_border = splat<W>(0);
        z.first = slice, z.first_is_border = splat<W>(0);
        if (spatial > 1) y = nearest_axis<W>(coordinates[1], source.height, modes.v, offset_y);
        if (spatial > 2) z = nearest_axis<W>(coordinates[2], source.depth, modes.w, offset_z);
        taps.places[0] = place_texel<W>(source, x.first, y.first, z.first);
        taps.is_border[0] = x.first_is_border | y.first_is_border | z.first_is_border;
        return;
    }
    taps.count = 1 << spatial;
    const AxisTaps<W> x = linear_axis<W>(coordinates[0], source.width, modes.u, offsets);
    if (spatial == 1) {
        const Ints<W> zero = splat<W>(0);
        taps.places[0] = place_texel<W>(source, x.first, zero, slice);
        taps.places[1] = place_texel<W>(source, x.second, zero, slice);
        taps.weights[0] = 1.0f - x.weight, taps.weights[1] = x.weight;
        taps.is_border[0] = x.first_is_border, taps.is_border[1] = x.second_is_border;
        return;
    }
    const AxisTaps<W> y = linear_axis<W>(coordinates[1], source.height, modes.v, offset_y);
    AxisTaps<W> z;
    if (spatial == 3) z = linear_axis<W>(coordinates[2], source.depth, modes.w, offset_z);
    for (int tap = 0; tap < taps.count; ++tap) {
        const bool second_x = (tap & 1) != 0, second_y = (tap & 2) != 0, second_z = (tap & 4) != 0;
        Ints<W> k = slice;
        if (spatial == 3) k = second_z ? z.second : z.first;
        taps.places[tap] = place_texel<W>(source, second_x ? x.second : x.first, second_y ? y.second : y.first, k);
        Floats<W> weight = (second_x ? x.weight : 1.0f - x.weight) * (second_y ? y.weight : 1.0f - y.weight);
        if (spatial == 3) weight = weight * (second_z ? z.weight : 1.0f - z.weight);
        taps.weights[tap] = weight;
        if (taps.has_border) {
            Ints<W> border = (second_x ? x.second_is_border : x.first_is_border) |
                             (second_y ? y.second_is_border : y.first_is_border);
            if (spatial == 3) border |= second_z ? z.second_is_border : z.first_is_border;
            taps.is_border[tap] = border;
        }
    }
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
