// SPDX-License-Identifier: Apache-2.0
// Filtered reads: sample, gather, query of the level of detail.
#pragma once

#include "backends/cpu/images/kernels/elliptical_filter.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

/// Red (and green, blue), alpha of a border.
NACRE_INLINE void border_values(rhi::BorderColor color, float& rgb, float& alpha) {
    rgb = color == rhi::BorderColor::opaque_white ? 1.0f : 0.0f;
    alpha = color == rhi::BorderColor::transparent_black ? 0.0f : 1.0f;
}

/// Weighted mean of a footprint of two texels or more.
template <int W, Codec C>
[[gnu::noinline]] void filter_taps(const Source& source, const Taps<W>& taps, rhi::BorderColor border, Floats<W>* out) {
    const FormatPlan& plan = *source.plan;
    const int channels = raw_channels<C>(plan);
    Floats<W> sum[4] = {};
    for (int first = 0; first < taps.count; first += 2) {
        Floats<W> texels[2][4];
        bool are_neighbors = false;
        if constexpr (raw_words<C> != 0) {
            const Ints<W> behind = taps.places[first].offset + 4 * raw_words<C>;
            are_neighbors = mask_bits<W>(taps.places[first + 1].offset == behind) == all_lanes<W>;
        }
        load_two_raw<W, C>(source, taps.places[first], taps.places[first + 1], are_neighbors, texels);
        for (int i = 0; i < 2; ++i) {
            const int tap = first + i;
            Floats<W>* const texel = texels[i];
            if (taps.has_border) {
                float rgb, alpha;
                border_values(border, rgb, alpha);
                for (int c = 0; c < channels; ++c) {
                    texel[c] =
                        taps.is_border[tap] ? splat<W>((c == 3 ? alpha : rgb) * raw_scale<C>(plan, c)) : texel[c];
                }
            }
            for (int c = 0; c < channels; ++c) sum[c] = sum[c] + taps.weights[tap] * texel[c];
        }
    }
    for (int c = 0; c < channels; ++c) out[c] = sum[c];
    finish_raw<W, C>(plan, out);
}

/// Texel of one tap, with the border in its place where it lies outside.
template <int W>
[[gnu::noinline]] void load_tap(const Source& source, const Taps<W>& taps, int tap, rhi::BorderColor border,
                                Floats<W>* out) {
    load_texels<W>(source, taps.places[tap], out);
    if (!taps.has_border) return;
    float rgb, alpha;
    border_values(border, rgb, alpha);
    const bool is_integer = source.plan->is_integer;
    for (int c = 0; c < source.plan->channel_count; ++c) {
        const float value = c == 3 ? alpha : rgb;
        const Floats<W> color = is_integer ? (Floats<W>)splat<W>(static_cast<std::int32_t>(value)) : splat<W>(value);
        out[c] = taps.is_border[tap] ? color : out[c];
    }
}

/// 1 where the comparison holds, else 0.
template <int W>
NACRE_INLINE Floats<W> compare(rhi::CompareOperation operation, Floats<W> reference, Floats<W> depth) {
    Ints<W> holds = splat<W>(0);
    switch (operation) {
        case rhi::CompareOperation::never: break;
        case rhi::CompareOperation::less: holds = reference < depth; break;
        case rhi::CompareOperation::equal: holds = reference == depth; break;
        case rhi::CompareOperation::less_or_equal: holds = reference <= depth; break;
        case rhi::CompareOperation::greater: holds = reference > depth; break;
        case rhi::CompareOperation::not_equal: holds = reference != depth; break;
        case rhi::CompareOperation::greater_or_equal: holds = reference >= depth; break;
        case rhi::CompareOperation::always: holds = ~splat<W>(0); break;
    }
    return holds ? splat<W>(1.0f) : splat<W>(0.0f);
}

/// Everything that samples of one call have in common.
template <int W>
struct Sampling {
    const Invocation* call;
    const rhi::SamplerDesc* sampler;
    int spatial;
    bool is_cube;
    Floats<W> coordinates[3];  ///< Cubes: the direction.
    CubeProjection<W> cube;
    Ints<W> slice;  ///< Layer; for cubes the slice of face 0.
    Ints<W> offsets[3];
    const Ints<W>* offset = nullptr;  ///< `offsets` where the call has some.
    Floats<W> reference;
};

template <int W>
NACRE_INLINE void prepare(const Invocation& call, Sampling<W>& sampling) {
    const ImageArguments& arguments = *call.arguments;
    const Axes axes = axes_of(call.image->dimension);
    sampling.call = &call;
    sampling.sampler = &call.sampler->desc;
    sampling.spatial = axes.spatial;
    sampling.is_cube = axes.is_cube;
    for (int axis = 0; axis < axes.spatial; ++axis)
        sampling.coordinates[axis] = call.floats<W>(arguments.coordinates[axis]);
    sampling.slice = splat<W>(0);
    if (axes.has_layers) {
        const Floats<W> layer = call.floats<W>(arguments.coordinates[axes.spatial]);
        const std::uint32_t count = axes.is_cube ? call.image->layer_count / 6 : call.image->layer_count;
        sampling.slice = array_layer<W>(layer, count) * (axes.is_cube ? 6 : 1);
    }
    if (axes.is_cube) sampling.cube = project_to_cube<W>(sampling.coordinates);
    if (call.has(image_offset) && !axes.is_cube) {
        for (int axis = 0; axis < axes.spatial; ++axis) sampling.offsets[axis] = call.ints<W>(arguments.offset[axis]);
        sampling.offset = sampling.offsets;
    }
    if (call.has(image_compare)) {
        sampling.reference = call.floats<W>(arguments.reference);
        if (format_plan(call.image->format).is_fixed_point_depth) {
            sampling.reference = clamp<W>(sampling.reference, splat<W>(0.0f), splat<W>(1.0f));
        }
    }
}

template <int W>
NACRE_INLINE void footprint(const Sampling<W>& sampling, const Source& source, const Floats<W>* coordinates,
                            bool is_linear, const Ints<W>* offset, Taps<W>& taps) {
    if (sampling.is_cube) return make_cube_taps<W>(source, sampling.cube, sampling.slice, is_linear, taps);
    const rhi::SamplerDesc& sampler = *sampling.sampler;
    make_taps<W>(source, coordinates, sampling.slice, sampling.spatial, is_linear,
                 {sampler.address_u, sampler.address_v, sampler.address_w}, offset, taps);
}

/// Adds two texels to a weighted sum.
template <int W>
NACRE_INLINE void add_weighted(const Floats<W> (&first)[4], const Floats<W> (&second)[4], int channels,
                               Floats<W> first_weight, Floats<W> second_weight, Floats<W>* sum) {
    for (int c = 0; c < channels; ++c) sum[c] = sum[c] + first_weight * first[c];
    for (int c = 0; c < channels; ++c) sum[c] = sum[c] + second_weight * second[c];
}

/// Adds two texels of a footprint, with their weights.
template <int W, Codec C>
NACRE_INLINE void add_two_texels(const Source& source, const Place<W>& first, const Place<W>& second,
                                 bool are_neighbors, Floats<W> first_weight, Floats<W> second_weight, Floats<W>* sum) {
    Floats<W> texels[2][4];
    load_two_raw<W, C>(source, first, second, are_neighbors, texels);
    add_weighted<W>(texels[0], texels[1], raw_channels<C>(*source.plan), first_weight, second_weight, sum);
}

/// A linear sample of a cube whose footprint lies on one face in all lanes. False: it does not, and nothing was done.
template <int W, Codec C>
[[gnu::noinline]] bool sample_face(const Source& source, const CubeProjection<W>& cube, Ints<W> first_slice,
                                   Floats<W>* out) {
    const CubeCorner<W> corner = cube_corner<W>(source.width, cube);
    if (corner.crosses) return false;
    Floats<W> sum[4] = {};
#ifdef __AVX512F__
    if constexpr (W == 16 && C == Codec::half4) {
        Floats<W> texels[4][4];
        if (load_near_footprints(source, corner.x, corner.y, first_slice + cube.face, texels)) {
            const auto add_near_row = [&](int row, Floats<W> weight_y) {
                add_weighted<W>(texels[2 * row], texels[2 * row + 1], 4, (1.0f - corner.fx) * weight_y,
                                corner.fx * weight_y, sum);
            };
            add_near_row(0, 1.0f - corner.fy);
            add_near_row(1, corner.fy);
            for (int c = 0; c < 4; ++c) out[c] = sum[c];
            finish_raw<W, C>(*source.plan, out);
            return true;
        }
    }
#endif
    const Place<W> place = place_texel<W>(source, corner.x, corner.y, first_slice + cube.face);
    const auto add_row = [&](Ints<W> offset, Floats<W> weight_y) {
        Place<W> first, second;
        first.offset = offset, second.offset = offset + 4 * raw_words<C>;
        add_two_texels<W, C>(source, first, second, true, (1.0f - corner.fx) * weight_y, corner.fx * weight_y, sum);
    };
    add_row(place.offset, 1.0f - corner.fy);
    add_row(place.offset + source.row_stride, corner.fy);
    const int channels = raw_channels<C>(*source.plan);
    for (int c = 0; c < channels; ++c) out[c] = sum[c];
    finish_raw<W, C>(*source.plan, out);
    return true;
}

/// One isotropic sample of one level.
template <int W>
[[gnu::noinline]] void sample_once(const Sampling<W>& sampling, const Source& source, const Floats<W>* coordinates,
                                   bool is_linear, Floats<W>* out) {
    if (sampling.is_cube && is_linear && !sampling.call->has(image_compare)) {
        bool is_done = false;
        visit_codec(source.codec, [&]<Codec C>() {
            if constexpr (raw_words<C> != 0) is_done = sample_face<W, C>(source, sampling.cube, sampling.slice, out);
        });
        if (is_done) return;
    }
    Taps<W> taps;
    footprint<W>(sampling, source, coordinates, is_linear, sampling.offset, taps);
    const rhi::BorderColor border = sampling.sampler->border;
    if (sampling.call->has(image_compare)) {
        Floats<W> sum = splat<W>(0.0f);
        for (int tap = 0; tap < taps.count; ++tap) {
            Floats<W> texel[4];
            load_tap<W>(source, taps, tap, border, texel);
            const Floats<W> passed = compare<W>(sampling.sampler->compare, sampling.reference, texel[0]);
            sum = taps.count == 1 ? passed : sum + passed * taps.weights[tap];
        }
        out[0] = sum;
        out[1] = out[2] = splat<W>(0.0f), out[3] = splat<W>(1.0f);
    } else if (taps.count == 1) {
        load_tap<W>(source, taps, 0, border, out);
    } else {
        visit_codec(source.codec, [&]<Codec C>() { filter_taps<W, C>(source, taps, border, out); });
    }
}

/// One level over the whole ellipse.
template <int W>
[[gnu::noinline]] void sample_ellipse(const Sampling<W>& sampling, const LevelOfDetail<W>& detail, const Source& source,
                                      std::uint32_t level, std::uint32_t live, Floats<W>* out) {
    const rhi::SamplerDesc& sampler = *sampling.sampler;
    const auto load = [&](Ints<W> x, Ints<W> y, Floats<W>* texel) {
        if (sampling.offset != nullptr) {
            x += bounded_offset<W>(sampling.offset[0]);
            y += bounded_offset<W>(sampling.offset[1]);
        }
        Taps<W> taps;
        Ints<W> x_is_border, y_is_border;
        wrap<W>(x, x_is_border, source.width, sampler.address_u, true);
        wrap<W>(y, y_is_border, source.height, sampler.address_v, true);
        taps.has_border = sampler.address_u == rhi::AddressMode::clamp_to_border ||
                          sampler.address_v == rhi::AddressMode::clamp_to_border;
        taps.places[0] = place_texel<W>(source, x, y, sampling.slice);
        taps.is_border[0] = x_is_border | y_is_border;
        load_tap<W>(source, taps, 0, sampler.border, texel);
    };
    average_ellipse<W>(source, sampler, detail, sampling.coordinates, 1.0f / static_cast<float>(1u << level), live,
                       load, out);
}

/// Mean of samples along the longer axis of an anisotropic footprint: at i / (N + 1) - 1/2 of it, i = 1 ... N.
template <int W, typename Sample>
NACRE_INLINE void average_along_axis(const LevelOfDetail<W>& detail, std::uint32_t live, Floats<W>* out,
                                     Sample sample) {
    Floats<W> sum[4] = {};
    for (int i = 1; i <= 16; ++i) {
        const Ints<W> takes_part = detail.sample_count >= static_cast<float>(i);
        if ((mask_bits<W>(takes_part) & live) == 0) break;
        Floats<W> once[4];
        sample(static_cast<float>(i) / (detail.sample_count + 1.0f) - 0.5f, once);
        for (int c = 0; c < 4; ++c) sum[c] = takes_part ? sum[c] + once[c] : sum[c];
    }
    for (int c = 0; c < 4; ++c) out[c] = sum[c] / detail.sample_count;
}

/// Visits every level that lanes read, once for all of them, from the finest on, so that a lane's sum does not depend
/// on its neighbors: `visit(level, lanes, their weights)`.
template <int W, typename Visit>
NACRE_INLINE void add_levels(const Invocation& call, Ints<W> level, Floats<W> next_weight, Visit visit) {
    const Ints<W> has_next = next_weight > 0.0f;
    std::uint32_t pending = call.live, pending_next = mask_bits<W>(has_next) & call.live;
    for (std::int32_t m = 0; (pending | pending_next) != 0; ++m) {
        const Ints<W> is_first = level == m, is_next = (level == m - 1) & has_next;
        const std::uint32_t here = (mask_bits<W>(is_first) & pending) | (mask_bits<W>(is_next) & pending_next);
        if (here == 0) continue;
        pending &= ~mask_bits<W>(is_first);
        pending_next &= ~mask_bits<W>(is_next);
        visit(m, mask_of_bits<W>(here), is_first ? 1.0f - next_weight : next_weight);
    }
}

/// One level with the filter's full footprint.
template <int W>
NACRE_INLINE void sample_level(const Sampling<W>& sampling, const LevelOfDetail<W>& detail, std::uint32_t level,
                               bool is_linear, Floats<W>* out) {
    Source source;
    if (!make_source(*sampling.call->image, level, source)) {
        for (int c = 0; c < 4; ++c) out[c] = splat<W>(0.0f);
        return;
    }
    if (detail.is_elliptical) return sample_ellipse<W>(sampling, detail, source, level, sampling.call->live, out);
    if (!detail.is_anisotropic) return sample_once<W>(sampling, source, sampling.coordinates, is_linear, out);
    average_along_axis<W>(detail, sampling.call->live, out, [&](Floats<W> along, Floats<W>* once) {
        Floats<W> moved[3];
        for (int axis = 0; axis < 2; ++axis) {
            moved[axis] = detail.sample_count > 1.0f ? sampling.coordinates[axis] + along * detail.axis[axis]
                                                     : sampling.coordinates[axis];
        }
        sample_once<W>(sampling, source, moved, is_linear, once);
    });
}

/// Samples that are most common go a short way, with the same results: 2D images and arrays of them, in layouts whose
/// texels are taken apart without choices, without borders, offsets and comparisons.
template <int W>
struct PlainSampling {
    const Invocation* call;
    Floats<W> s, t;
    Ints<W> slice;
    rhi::AddressMode u, v;
    bool is_linear;
    Ints<W> level;
    Floats<W> next_weight;
    /// All lanes read level `first` and none behind it, or all of them the two from there on.
    bool is_one_level;
    std::int32_t first;
    std::uint32_t next_bits;  ///< Lanes that read the level behind their first.
};

/// The two texels along one axis, without border and offset: as `linear_axis`.
template <int W>
struct PlainAxis {
    Ints<W> first, second;
    Floats<W> weight;    ///< Of the second.
    bool are_neighbors;  ///< The second lies behind the first in all lanes.
};
template <int W>
NACRE_INLINE PlainAxis<W> plain_axis(Floats<W> s, std::int32_t n, rhi::AddressMode mode) {
    PlainAxis<W> axis;
    if (mode == rhi::AddressMode::mirrored_repeat) {
        const AxisTaps<W> taps = linear_axis<W>(s, n, mode, nullptr);
        axis.first = taps.first, axis.second = taps.second, axis.weight = taps.weight;
        axis.are_neighbors = mask_bits<W>(taps.second == taps.first + 1) == all_lanes<W>;
        return axis;
    }
    const Floats<W> u = unnormalized<W>(s, n, mode) - 0.5f, whole = floor_small<W>(u);
    axis.weight = u - whole;
    const Ints<W> first = truncate<W>(whole), second = first + 1;
    const Ints<W> is_out = (first < 0) | (second >= n);
    axis.are_neighbors = mask_bits<W>(is_out) == 0;
    axis.first = first, axis.second = second;
    if (axis.are_neighbors) return axis;
    if (mode == rhi::AddressMode::repeat) {
        // From -1 to n.
        axis.first = first < 0 ? splat<W>(n - 1) : first;
        axis.second = second >= n ? splat<W>(0) : second;
    } else {
        axis.first = clamp<W>(first, 0, n - 1);
        axis.second = clamp<W>(second, 0, n - 1);
    }
    return axis;
}

template <int W, Codec C>
[[gnu::noinline]] void sample_plain_once(const PlainSampling<W>& sampling, const Source& source, Floats<W> s,
                                         Floats<W> t, Floats<W>* out) {
    const FormatPlan& plan = *source.plan;
    constexpr int bytes = 4 * raw_words<C>;
    const Ints<W> slice = sampling.slice * static_cast<std::int32_t>(source.slice_stride);
    if (!sampling.is_linear) {
        const AxisTaps<W> x = nearest_axis<W>(s, source.width, sampling.u, nullptr);
        const AxisTaps<W> y = nearest_axis<W>(t, source.height, sampling.v, nullptr);
        Place<W> place;
        place.offset = x.first * bytes + y.first * source.row_stride + slice;
        load_raw<W, C>(source, place, out);
    } else {
        const PlainAxis<W> x = plain_axis<W>(s, source.width, sampling.u);
        const PlainAxis<W> y = plain_axis<W>(t, source.height, sampling.v);
        const Ints<W> left = x.first * bytes, right = x.second * bytes;
        Floats<W> sum[4] = {};
        const auto add_row = [&](Ints<W> row, Floats<W> weight_y) {
            const Ints<W> above = row * source.row_stride + slice;
            Place<W> first, second;
            first.offset = left + above, second.offset = right + above;
            add_two_texels<W, C>(source, first, second, x.are_neighbors, (1.0f - x.weight) * weight_y,
                                 x.weight * weight_y, sum);
        };
        add_row(y.first, 1.0f - y.weight);
        add_row(y.second, y.weight);
        const int channels = raw_channels<C>(plan);
        for (int c = 0; c < channels; ++c) out[c] = sum[c];
    }
    finish_raw<W, C>(plan, out);
}

template <int W, Codec C>
NACRE_INLINE void sample_plain_level(const PlainSampling<W>& sampling, const LevelOfDetail<W>& detail,
                                     std::uint32_t level, Floats<W>* out) {
    Source source;
    if (!make_source(*sampling.call->image, level, source)) {
        for (int c = 0; c < 4; ++c) out[c] = splat<W>(0.0f);
        return;
    }
    if (!detail.is_anisotropic) return sample_plain_once<W, C>(sampling, source, sampling.s, sampling.t, out);
    average_along_axis<W>(detail, sampling.call->live, out, [&](Floats<W> along, Floats<W>* once) {
        const Ints<W> is_moved = detail.sample_count > 1.0f;
        sample_plain_once<W, C>(sampling, source, is_moved ? sampling.s + along * detail.axis[0] : sampling.s,
                                is_moved ? sampling.t + along * detail.axis[1] : sampling.t, once);
    });
}

/// False: not all lanes are filtered in the same way.
template <int W>
NACRE_INLINE bool choose_levels(PlainSampling<W>& sampling, LevelOfDetail<W>& detail) {
    const Invocation& call = *sampling.call;
    const ImageView& image = *call.image;
    const rhi::SamplerDesc& sampler = call.sampler->desc;
    sampling.level = splat<W>(0);
    sampling.next_weight = splat<W>(0.0f);
    sampling.is_linear = sampler.magnify == rhi::Filter::linear;
    if (image.mip_count > 1 || sampler.magnify != sampler.minify || sampler.max_anisotropy > 1.0f) {
        const Floats<W> coordinates[2] = {sampling.s, sampling.t};
        level_of_detail<W>(call, coordinates, nullptr, 2, detail);
        select_levels<W>(detail.lambda, image.mip_count, sampler.mip == rhi::Filter::linear, sampling.level,
                         sampling.next_weight);
        if (sampler.magnify != sampler.minify) {
            const std::uint32_t magnified = mask_bits<W>(detail.lambda <= 0.0f) & call.live;
            if (magnified != 0 && magnified != call.live) return false;
            if (magnified == 0) sampling.is_linear = !sampling.is_linear;
        }
    }
    sampling.next_bits = mask_bits<W>(sampling.next_weight > 0.0f) & call.live;
    sampling.first = sampling.level[first_bit(call.live)];
    sampling.is_one_level = (mask_bits<W>(sampling.level == sampling.first) & call.live) == call.live;
    return true;
}

template <int W, Codec C>
[[gnu::noinline]] void sample_plain_levels(const PlainSampling<W>& sampling, const LevelOfDetail<W>& detail) {
    const Invocation& call = *sampling.call;
    const Ints<W> live = mask_of_bits<W>(call.live), level = sampling.level;
    const Floats<W> next_weight = sampling.next_weight;
    const Ints<W> has_next = next_weight > 0.0f;
    Floats<W> out[4];
    if (sampling.is_one_level) {
        sample_plain_level<W, C>(sampling, detail, static_cast<std::uint32_t>(sampling.first), out);
        if (sampling.next_bits == 0) return write_result<W>(call, out, live);
        Floats<W> next[4];
        sample_plain_level<W, C>(sampling, detail, static_cast<std::uint32_t>(sampling.first) + 1, next);
        for (int c = 0; c < 4; ++c) {
            const Floats<W> sum = (splat<W>(0.0f) + out[c] * (1.0f - next_weight)) + next[c] * next_weight;
            out[c] = has_next ? sum : out[c];
        }
        return write_result<W>(call, out, live);
    }
    for (int c = 0; c < 4; ++c) out[c] = splat<W>(0.0f);
    add_levels<W>(call, level, next_weight, [&](std::int32_t m, Ints<W> mask, Floats<W> weight) {
        Floats<W> value[4];
        sample_plain_level<W, C>(sampling, detail, static_cast<std::uint32_t>(m), value);
        for (int c = 0; c < 4; ++c) {
            const Floats<W> sum = has_next ? out[c] + value[c] * weight : value[c];
            out[c] = mask ? sum : out[c];
        }
    });
    write_result<W>(call, out, live);
}

/// False: the sample is not plain, and nothing was done.
template <int W>
NACRE_INLINE bool sample_plain(const Invocation& call) {
    const ImageView& image = *call.image;
    const rhi::SamplerDesc& sampler = call.sampler->desc;
    const bool is_array = image.dimension == rhi::ViewDimension::d2_array;
    if (!is_array && image.dimension != rhi::ViewDimension::d2) return false;
    if (call.has(image_offset) || call.has(image_compare) || call.has(image_integer)) return false;
    if (call.sampler->is_elliptical && sampler.max_anisotropy > 1.0f) return false;
    if (sampler.address_u == rhi::AddressMode::clamp_to_border ||
        sampler.address_v == rhi::AddressMode::clamp_to_border)
        return false;
    // The finest level reaches farthest.
    Source source;
    if (!make_source(image, 0, source) || source.codec > Codec::float4) return false;
    PlainSampling<W> sampling;
    sampling.call = &call;
    sampling.s = call.floats<W>(call.arguments->coordinates[0]);
    sampling.t = call.floats<W>(call.arguments->coordinates[1]);
    sampling.slice = splat<W>(0);
    if (is_array) sampling.slice = array_layer<W>(call.floats<W>(call.arguments->coordinates[2]), image.layer_count);
    sampling.u = sampler.address_u, sampling.v = sampler.address_v;
    LevelOfDetail<W> detail;
    if (!choose_levels<W>(sampling, detail)) return false;
    visit_codec(source.codec, [&]<Codec C>() {
        if constexpr (raw_words<C> != 0) sample_plain_levels<W, C>(sampling, detail);
    });
    return true;
}

/// The same for cubes in one level that is filtered linearly, where the footprints of all lanes lie on one face each.
/// False: they do not, and nothing was done.
template <int W>
NACRE_INLINE bool sample_plain_cube(const Invocation& call) {
    const ImageView& image = *call.image;
    const rhi::SamplerDesc& sampler = call.sampler->desc;
    if (image.dimension != rhi::ViewDimension::cube || call.has(image_compare) || call.has(image_integer) ||
        sampler.magnify != rhi::Filter::linear || sampler.minify != rhi::Filter::linear)
        return false;
    std::uint32_t level = 0;
    if (image.mip_count > 1) {
        // Levels that are computed from derivatives mostly lie between two.
        if (!call.has(image_lod_explicit) || call.has(image_min_lod)) return false;
        const Floats<W> lod = call.floats<W>(call.arguments->lod), bias = splat<W>(sampler.mip_bias);
        const float first = lod[first_bit(call.live)];
        if ((mask_bits<W>((lod == first) & (bias == 0.0f)) & call.live) != call.live) return false;
        const float last = static_cast<float>(image.mip_count - 1);
        float lambda = first > sampler.min_lod ? first : sampler.min_lod;
        lambda = lambda < sampler.max_lod ? lambda : sampler.max_lod;
        lambda = lambda > 0.0f ? lambda : 0.0f;
        lambda = lambda < last ? lambda : last;
        level = static_cast<std::uint32_t>(lambda);
        if (static_cast<float>(level) != lambda) return false;
    }
    Source source;
    if (!make_source(image, level, source)) return false;
    const Floats<W> direction[3] = {call.floats<W>(call.arguments->coordinates[0]),
                                    call.floats<W>(call.arguments->coordinates[1]),
                                    call.floats<W>(call.arguments->coordinates[2])};
    const CubeProjection<W> cube = project_to_cube<W>(direction);
    bool is_done = false;
    Floats<W> out[4];
    visit_codec(source.codec, [&]<Codec C>() {
        if constexpr (raw_words<C> != 0) is_done = sample_face<W, C>(source, cube, splat<W>(0), out);
    });
    if (is_done) write_result<W>(call, out, mask_of_bits<W>(call.live));
    return is_done;
}

/// False where the result of every lane is zero.
NACRE_INLINE bool can_sample(const Invocation& call) {
    const ImageView& image = *call.image;
    if (call.sampler == nullptr || image.mip_count == 0 || image.samples > 1 || image.layer_count == 0) return false;
    const FormatPlan& plan = format_plan(image.format);
    const Axes axes = axes_of(image.dimension);
    if (axes.is_cube && image.layer_count < 6) return false;
    return plan.codec != Codec::none && plan.is_integer == call.has(image_integer) &&
           !(plan.is_integer && call.has(image_compare));
}

template <int W>
[[gnu::noinline]] void sample_image(const Invocation& call) {
    if (!can_sample(call)) return write_zeros<W>(call);
    if (sample_plain<W>(call) || sample_plain_cube<W>(call)) return;
    const ImageView& image = *call.image;
    const rhi::SamplerDesc& sampler = call.sampler->desc;
    const bool is_integer = call.has(image_integer);
    Sampling<W> sampling;
    prepare<W>(call, sampling);

    LevelOfDetail<W> detail;
    const bool magnifies_linearly = !is_integer && sampler.magnify == rhi::Filter::linear;
    const bool minifies_linearly = !is_integer && sampler.minify == rhi::Filter::linear;
    Ints<W> level = splat<W>(0), linear = magnifies_linearly ? ~splat<W>(0) : splat<W>(0);
    Floats<W> next_weight = splat<W>(0.0f);
    if (image.mip_count > 1 || magnifies_linearly != minifies_linearly || sampler.max_anisotropy > 1.0f) {
        level_of_detail<W>(call, sampling.coordinates, sampling.is_cube ? &sampling.cube : nullptr, sampling.spatial,
                           detail);
        if (is_integer) detail.is_anisotropic = detail.is_elliptical = false;
        // The ellipse reads the finer one of two levels.
        if (detail.is_elliptical) detail.lambda = floor_small<W>(detail.lambda);
        select_levels<W>(detail.lambda, image.mip_count, !is_integer && sampler.mip == rhi::Filter::linear, level,
                         next_weight);
        if (magnifies_linearly != minifies_linearly) {
            const Ints<W> magnified = detail.lambda <= 0.0f;
            linear = magnifies_linearly ? magnified : ~magnified;
        }
    }

    const std::uint32_t linear_bits = mask_bits<W>(linear) & call.live, nearest_bits = call.live & ~linear_bits;
    const Ints<W> has_next = next_weight > 0.0f;
    const std::uint32_t next_bits = mask_bits<W>(has_next) & call.live;
    Floats<W> out[4];
    const std::int32_t first = level[first_bit(call.live)];
    if ((mask_bits<W>(level == first) & call.live) == call.live && next_bits == 0 &&
        (linear_bits == 0 || nearest_bits == 0)) {
        // All lanes read one level in the same way.
        sample_level<W>(sampling, detail, static_cast<std::uint32_t>(first), linear_bits != 0, out);
        return write_result<W>(call, out, mask_of_bits<W>(call.live));
    }
    for (int c = 0; c < 4; ++c) out[c] = splat<W>(0.0f);
    add_levels<W>(call, level, next_weight, [&](std::int32_t m, Ints<W> here, Floats<W> weight) {
        for (int filter = 0; filter < 2; ++filter) {
            const std::uint32_t lanes = mask_bits<W>(here) & (filter == 0 ? nearest_bits : linear_bits);
            if (lanes == 0) continue;
            const Ints<W> mask = mask_of_bits<W>(lanes);
            Floats<W> value[4];
            sample_level<W>(sampling, detail, static_cast<std::uint32_t>(m), filter == 1, value);
            for (int c = 0; c < 4; ++c) {
                // Lanes that read one level only keep its bits as they are (integers too).
                const Floats<W> sum = has_next ? out[c] + value[c] * weight : value[c];
                out[c] = mask ? sum : out[c];
            }
        }
    });
    write_result<W>(call, out, mask_of_bits<W>(call.live));
}

/// The four texels of a linear footprint in the order (i0, j1), (i1, j1), (i1, j0), (i0, j0).
template <int W>
[[gnu::noinline]] void gather_image(const Invocation& call) {
    Source source;
    if (!can_sample(call) || !make_source(*call.image, 0, source)) return write_zeros<W>(call);
    Sampling<W> sampling;
    prepare<W>(call, sampling);
    const std::uint32_t component = (call.flags >> image_component_shift) & 3;
    const auto value_of = [&](const Taps<W>& taps, int tap) {
        Floats<W> texel[4];
        load_tap<W>(source, taps, tap, sampling.sampler->border, texel);
        if (call.has(image_compare)) return compare<W>(sampling.sampler->compare, sampling.reference, texel[0]);
        return texel[component];
    };
    constexpr int order[4] = {2, 3, 1, 0};
    Floats<W> out[4];
    Taps<W> taps;
    if (call.has(image_offsets) && !sampling.is_cube) {
        for (int i = 0; i < 4; ++i) {
            for (int axis = 0; axis < 2; ++axis)
                sampling.offsets[axis] = splat<W>(call.arguments->gather_offsets[i][axis]);
            sampling.offsets[2] = splat<W>(0);
            footprint<W>(sampling, source, sampling.coordinates, true, sampling.offsets, taps);
            out[i] = value_of(taps, 0);
        }
    } else {
        footprint<W>(sampling, source, sampling.coordinates, true, sampling.offset, taps);
        // 1D images have two texels: both rows are the same.
        const int rows = taps.count > 2 ? 3 : 1;
        for (int i = 0; i < 4; ++i) out[i] = value_of(taps, order[i] & rows);
        if (sampling.is_cube && taps.has_corner && !call.has(image_integer)) {
            Floats<W> sum = splat<W>(0.0f), count = splat<W>(0.0f);
            for (int i = 0; i < 4; ++i) {
                const Ints<W> exists = ~taps.is_corner[order[i]];
                sum = exists ? sum + out[i] : sum;
                count = exists ? count + 1.0f : count;
            }
            const Floats<W> mean = sum / maximum<W>(count, splat<W>(1.0f));
            for (int i = 0; i < 4; ++i) out[i] = taps.is_corner[order[i]] ? mean : out[i];
        }
    }
    write_result<W>(call, out, mask_of_bits<W>(call.live));
}

template <int W>
[[gnu::noinline]] void query_level_of_detail(const Invocation& call) {
    // The kind of channels does not matter here.
    if (call.sampler == nullptr || call.image->mip_count == 0) return write_zeros<W>(call);
    Sampling<W> sampling;
    prepare<W>(call, sampling);
    LevelOfDetail<W> detail;
    level_of_detail<W>(call, sampling.coordinates, sampling.is_cube ? &sampling.cube : nullptr, sampling.spatial,
                       detail);
    Ints<W> level;
    Floats<W> weight;
    select_levels<W>(detail.lambda, call.image->mip_count, call.sampler->desc.mip == rhi::Filter::linear, level,
                     weight);
    const Floats<W> out[4] = {to_floats<W>(level) + weight, detail.unclamped, splat<W>(0.0f), splat<W>(0.0f)};
    write_result<W>(call, out, mask_of_bits<W>(call.live));
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
