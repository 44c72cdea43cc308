// SPDX-License-Identifier: Apache-2.0
// Anisotropic filtering by an elliptical weighted average: all texels of one level inside of an ellipse that the
// derivatives span, weighted by a Gaussian. Source: Heckbert, "Fundamentals of Texture Mapping and Image Warping",
// 1989, section 3.5 (the ellipse with a unit reconstruction filter added to it). The level is the one of the shorter
// axis, and the sampler's limit of the ratio does not count: Mesa's software drivers choose the same, so that pictures
// can be compared with theirs.
#pragma once

#include "backends/cpu/images/elliptical_weights.h"
#include "backends/cpu/images/kernels/addressing.h"
#include "backends/cpu/images/kernels/level_of_detail.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

template <int W>
struct Ellipse {
    Floats<W> a, b, c, f;  ///< a x^2 + b x y + c y^2 < f
    Floats<W> half_width, half_height;
};

/// @param scale  of the level: texels of it for one texel of level 0
template <int W>
NACRE_INLINE Ellipse<W> make_ellipse(const LevelOfDetail<W>& detail, float scale) {
    const Floats<W> ux = detail.dx[0] * scale, vx = detail.dx[1] * scale, uy = detail.dy[0] * scale,
                    vy = detail.dy[1] * scale;
    Ellipse<W> ellipse;
    ellipse.a = vx * vx + vy * vy + 1.0f;
    ellipse.b = -2.0f * (ux * vx + uy * vy);
    ellipse.c = ux * ux + uy * uy + 1.0f;
    ellipse.f = ellipse.a * ellipse.c - ellipse.b * ellipse.b * 0.25f;
    const Floats<W> d = 4.0f * ellipse.a * ellipse.c - ellipse.b * ellipse.b;
    ellipse.half_width = 2.0f / d * square_root<W>(d * ellipse.c * ellipse.f);
    ellipse.half_height = 2.0f / d * square_root<W>(d * ellipse.a * ellipse.f);
    return ellipse;
}

/// Bounds what a lane visits: derivatives that are not finite get one texel, long ones two periods of the texture.
template <int W>
NACRE_INLINE Floats<W> bounded_extent(Floats<W> extent, std::int32_t size) {
    const Floats<W> limit = splat<W>(2.0f * static_cast<float>(size));
    return extent >= 0.0f ? minimum<W>(extent, limit) : splat<W>(0.0f);
}

/// `load` gives the texels at whole coordinates (x, y) of the level.
template <int W, typename Load>
NACRE_INLINE void average_ellipse(const Source& source, const rhi::SamplerDesc& sampler, const LevelOfDetail<W>& detail,
                                  const Floats<W>* coordinates, float scale, std::uint32_t live, const Load& load,
                                  Floats<W>* out) {
    const Ellipse<W> ellipse = make_ellipse<W>(detail, scale);
    const Floats<W> u = unnormalized<W>(coordinates[0], source.width, sampler.address_u) - 0.5f,
                    v = unnormalized<W>(coordinates[1], source.height, sampler.address_v) - 0.5f;
    const Floats<W> half_width = bounded_extent<W>(ellipse.half_width, source.width),
                    half_height = bounded_extent<W>(ellipse.half_height, source.height);
    const Floats<W> first_u = floor_small<W>(u - half_width), last_u = -floor_small<W>(-(u + half_width)),
                    first_v = floor_small<W>(v - half_height), last_v = -floor_small<W>(-(v + half_height));
    const Floats<W> to_index = splat<W>(static_cast<float>(elliptical_weight_count - 1)) / ellipse.f;
    const Floats<W> a = ellipse.a * to_index, b = ellipse.b * to_index, c = ellipse.c * to_index;
    const auto* weight_bytes = reinterpret_cast<const std::byte*>(elliptical_weights());
    Floats<W> sum[4] = {}, weights = splat<W>(0.0f);
    for (Floats<W> y = first_v;; y = y + 1.0f) {
        const Ints<W> in_rows = y <= last_v;
        if ((mask_bits<W>(in_rows) & live) == 0) break;
        const Floats<W> dy = y - v;
        for (Floats<W> x = first_u;; x = x + 1.0f) {
            const Ints<W> in_box = in_rows & (x <= last_u);
            if ((mask_bits<W>(in_box) & live) == 0) break;
            const Floats<W> dx = x - u;
            const Floats<W> q = (c * dy + b * dx) * dy + a * dx * dx;
            const Ints<W> inside = in_box & (q < static_cast<float>(elliptical_weight_count));
            if ((mask_bits<W>(inside) & live) == 0) continue;
            const Ints<W> index = clamp<W>(truncate<W>(inside ? q : splat<W>(0.0f)), 0, elliptical_weight_count - 1);
            const Floats<W> weight = inside ? (Floats<W>)gather_words<W>(weight_bytes, index * 4) : splat<W>(0.0f);
            Floats<W> texel[4];
            load(truncate<W>(x), truncate<W>(y), texel);
            for (int i = 0; i < 4; ++i) sum[i] = inside ? sum[i] + weight * texel[i] : sum[i];
            weights = weights + weight;
        }
    }
    for (int i = 0; i < 4; ++i) out[i] = sum[i] / weights;
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
