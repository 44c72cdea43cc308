// SPDX-License-Identifier: Apache-2.0
// Which mips a sample reads. Source: Vulkan specification, "Scale Factor Operation", "LOD Operation", "Image Level(s)
// Selection".
#pragma once

#include "backends/cpu/images/kernels/cube.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

template <int W>
struct LevelOfDetail {
    Floats<W> unclamped;  ///< lambda' of the specification.
    Floats<W> lambda;     ///< Clamped by sampler and shader.
    /// Anisotropic filtering: number of samples along the longer axis of the footprint (1: isotropic) and that axis in
    /// (s, t).
    bool is_anisotropic = false;
    Floats<W> sample_count;
    Floats<W> axis[2];
    /// Anisotropic filtering over the ellipse of these derivatives, in texels of level 0.
    bool is_elliptical = false;
    Floats<W> dx[2], dy[2];
};

/// @param coordinates  as the shader gave them (for cubes, directions)
/// @param cube         for cubes, else null
template <int W>
NACRE_INLINE void level_of_detail(const Invocation& call, const Floats<W>* coordinates,
                                       const CubeProjection<W>* cube, int spatial, LevelOfDetail<W>& result) {
    const rhi::SamplerDesc& sampler = call.sampler->desc;
    const ImageArguments& arguments = *call.arguments;
    const ImageLevel& base = *reinterpret_cast<const ImageLevel*>(&call.image->levels);
    Floats<W> lambda = splat<W>(0.0f);
    if (call.has(image_lod_explicit)) {
        lambda = call.floats<W>(arguments.lod);
    } else if (call.has(image_lod_implicit) || call.has(image_lod_gradient)) {
        Floats<W> dx[3], dy[3];
        for (int axis = 0; axis < spatial; ++axis) {
            if (call.has(image_lod_gradient)) {
                dx[axis] = call.floats<W>(arguments.gradient_x[axis]);
                dy[axis] = call.floats<W>(arguments.gradient_y[axis]);
            } else {
                dx[axis] = difference_x<W>(coordinates[axis]);
                dy[axis] = difference_y<W>(coordinates[axis]);
            }
        }
        int axes = spatial;
        if (cube != nullptr) {
            Floats<W> projected[2];
            project_derivative<W>(*cube, dx, projected);
            dx[0] = projected[0], dx[1] = projected[1];
            project_derivative<W>(*cube, dy, projected);
            dy[0] = projected[0], dy[1] = projected[1];
            axes = 2;
        }
        const float size[3] = {static_cast<float>(base.width), static_cast<float>(base.height),
                               static_cast<float>(base.depth)};
        Floats<W> length_x = splat<W>(0.0f), length_y = splat<W>(0.0f);  // Squared, in texels.
        for (int axis = 0; axis < axes; ++axis) {
            const Floats<W> x = dx[axis] * size[axis], y = dy[axis] * size[axis];
            length_x = length_x + x * x;
            length_y = length_y + y * y;
        }
        const Floats<W> longest = maximum<W>(length_x, length_y);
        // The specification leaves the precision of the logarithm to the implementation; Mesa's software drivers take
        // this one.
        lambda = 0.5f * linear_log2<W>(longest);
        if (call.sampler->is_elliptical && sampler.max_anisotropy > 1.0f && axes == 2 && spatial == 2 &&
            !call.has(image_compare)) {
            lambda = 0.5f * linear_log2<W>(minimum<W>(length_x, length_y));
            result.is_elliptical = true;
            for (int axis = 0; axis < 2; ++axis)
                result.dx[axis] = dx[axis] * size[axis], result.dy[axis] = dy[axis] * size[axis];
        } else if (sampler.max_anisotropy > 1.0f && axes == 2 && cube == nullptr) {
            const Floats<W> shortest = minimum<W>(length_x, length_y), one = splat<W>(1.0f);
            const float limit = sampler.max_anisotropy < 16.0f ? sampler.max_anisotropy : 16.0f;
            // The ratio of the axes. Where the footprint is a line it is as large as allowed, where it is a point it
            // is 1.
            Floats<W> ratio = square_root<W>(longest) / square_root<W>(shortest);
            ratio = clamp<W>(ratio, one, splat<W>(limit));
            result.sample_count = -floor_small<W>(0.00390625f - ratio);
            lambda = 0.5f * linear_log2<W>(longest / (ratio * ratio));
            const Ints<W> is_x = length_x >= length_y;
            for (int axis = 0; axis < 2; ++axis) result.axis[axis] = is_x ? dx[axis] : dy[axis];
            result.is_anisotropic = (mask_bits<W>(result.sample_count > 1.0f) & call.live) != 0;
        }
    }
    Floats<W> bias = splat<W>(sampler.mip_bias);
    if (call.has(image_lod_implicit)) bias = bias + call.floats<W>(arguments.lod);
    constexpr float most_bias = 16.0f;  // VkPhysicalDeviceLimits::maxSamplerLodBias
    lambda = lambda + clamp<W>(bias, splat<W>(-most_bias), splat<W>(most_bias));
    result.unclamped = lambda;
    Floats<W> lowest = splat<W>(sampler.min_lod);
    if (call.has(image_min_lod)) lowest = maximum<W>(call.floats<W>(arguments.min_lod), lowest);
    result.lambda = clamp<W>(lambda, lowest, splat<W>(sampler.max_lod));
}

/// The first mip of each lane and the weight of the one behind it (0: that one is not read).
template <int W>
NACRE_INLINE void select_levels(Floats<W> lambda, std::uint32_t mip_count, bool is_mip_linear, Ints<W>& level,
                                Floats<W>& weight) {
    const Floats<W> last = splat<W>(static_cast<float>(mip_count - 1)), d = clamp<W>(lambda, splat<W>(0.0f), last);
    if (is_mip_linear) {
        const Floats<W> whole = floor_small<W>(d);
        level = truncate<W>(whole);
        weight = d - whole;
    } else {
        // ceil(d + 1/2) - 1
        level = truncate<W>(-floor_small<W>(-(d + 0.5f)) - 1.0f);
        weight = splat<W>(0.0f);
    }
    level = clamp<W>(level, 0, static_cast<std::int32_t>(mip_count) - 1);
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
