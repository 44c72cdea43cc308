// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/double_operations.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "backends/cpu/images/double_texels.h"
#include "backends/cpu/images/elliptical_weights.h"
#include "backends/cpu/images/format_plan.h"
#include "backends/cpu/images/view_axes.h"

namespace nacre::cpu {
namespace {

constexpr double farthest_texel = 4194304.0;

/// Whole numbers from coordinates of any kind: NaN counts as 0, and nothing is farther away than texels can be.
std::int64_t whole(double value) {
    return std::isnan(value)
               ? 0
               : static_cast<std::int64_t>(std::clamp(std::floor(value), -farthest_texel, farthest_texel));
}

/// The logarithm to base 2 that the level of detail is defined by: linear between the powers of two, -127 at zero.
double linear_log2(double x) {
    if (!(x >= 0x1p-126)) return -127.0;
    int exponent = 0;
    const double half = std::frexp(x, &exponent);
    return std::isinf(x) ? 128.0 : exponent - 1 + (2.0 * half - 1.0);
}

std::int64_t modulo(std::int64_t value, std::int64_t period) {
    const std::int64_t rest = value % period;
    return rest < 0 ? rest + period : rest;
}

using Vector = std::array<double, 3>;

/// The axes of the faces of a cube: s, t, and outward (Vulkan specification, "Cube Map Face Selection").
constexpr std::array<std::array<Vector, 3>, 6> face_axes{{
    {{{0, 0, -1}, {0, -1, 0}, {1, 0, 0}}},
    {{{0, 0, 1}, {0, -1, 0}, {-1, 0, 0}}},
    {{{1, 0, 0}, {0, 0, 1}, {0, 1, 0}}},
    {{{1, 0, 0}, {0, 0, -1}, {0, -1, 0}}},
    {{{1, 0, 0}, {0, -1, 0}, {0, 0, 1}}},
    {{{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}},
}};

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

struct CubePlace {
    int face = 0;
    double sc = 0, tc = 0, major = 1;
    [[nodiscard]] double s() const { return 0.5 * (sc / major) + 0.5; }
    [[nodiscard]] double t() const { return 0.5 * (tc / major) + 0.5; }
};

CubePlace place_on_cube(const Vector& direction) {
    const double x = std::abs(direction[0]), y = std::abs(direction[1]), z = std::abs(direction[2]);
    const int axis = z >= x && z >= y ? 2 : y >= x ? 1 : 0;
    CubePlace place;
    place.face = 2 * axis + (direction[static_cast<std::size_t>(axis)] < 0 ? 1 : 0);
    const auto& axes = face_axes[static_cast<std::size_t>(place.face)];
    place.sc = dot(direction, axes[0]), place.tc = dot(direction, axes[1]), place.major = dot(direction, axes[2]);
    return place;
}

/// The same direction's coordinates change by this much where it changes by `change`.
std::array<double, 2> derivative_on_face(const CubePlace& place, const Vector& change) {
    const auto& axes = face_axes[static_cast<std::size_t>(place.face)];
    const double inverse = 0.5 / (place.major * place.major), along = dot(change, axes[2]);
    return {(place.major * dot(change, axes[0]) - place.sc * along) * inverse,
            (place.major * dot(change, axes[1]) - place.tc * along) * inverse};
}

bool holds(rhi::CompareOperation operation, double reference, double depth) {
    switch (operation) {
        case rhi::CompareOperation::never: return false;
        case rhi::CompareOperation::less: return reference < depth;
        case rhi::CompareOperation::equal: return reference == depth;
        case rhi::CompareOperation::less_or_equal: return reference <= depth;
        case rhi::CompareOperation::greater: return reference > depth;
        case rhi::CompareOperation::not_equal: return reference != depth;
        case rhi::CompareOperation::greater_or_equal: return reference >= depth;
        default: return true;
    }
}

/// One operation of one lane.
class Lane {
  public:
    Lane(const ImageView& image, const SamplerState* sampler, const DoubleImageArguments& arguments,
         std::uint32_t flags, std::uint32_t number)
        : image_(image),
          sampler_(sampler ? &sampler->desc : nullptr),
          is_elliptical_(sampler && sampler->is_elliptical),
          arguments_(arguments),
          flags_(flags),
          lane_(number),
          axes_(axes_of(image.dimension)),
          plan_(format_plan(image.format)) {}

    [[nodiscard]] DoubleTexel fetch() const {
        const std::int64_t level = has(ImageOperation::fetch) && image_.samples == 1 ? whole(arguments_.lod[lane_]) : 0;
        std::array<std::int64_t, 4> at;
        if (level < 0 || level >= image_.mip_count || !texel_place(level, at)) return {};
        return texel(static_cast<std::uint32_t>(level), at[0], at[1], at[2], at[3]);
    }

    void store() const {
        std::array<std::int64_t, 4> at;
        if (image_.mip_count == 0 || plan_.codec > Codec::shared_exponent || !texel_place(0, at)) return;
        DoubleTexel values;
        for (std::size_t c = 0; c < 4; ++c) values[c] = arguments_.texel[c][lane_];
        const std::uint64_t offset = offset_of(image_.levels[0], at[0], at[1], at[2], at[3]);
        store_double(image_.format, values, image_.levels[0].data + offset, shadow_at(image_.levels[0], offset));
    }

    /// Whether the result can be anything but zeros.
    [[nodiscard]] bool can_sample() const {
        if (!sampler_ || image_.mip_count == 0 || image_.samples > 1 || image_.layer_count == 0) return false;
        if (axes_.is_cube && image_.layer_count < 6) return false;
        return plan_.codec != Codec::none && !plan_.is_integer && image_.levels[0].data;
    }

    [[nodiscard]] DoubleTexel sample() {
        prepare();
        Detail detail = level_of_detail();
        // The ellipse reads the finer one of two levels.
        if (detail.is_elliptical) detail.lambda = std::floor(detail.lambda);
        const bool is_linear = (detail.lambda <= 0 ? sampler_->magnify : sampler_->minify) == rhi::Filter::linear;
        const auto [first, weight] = levels_of(detail.lambda);
        DoubleTexel result = sample_level(detail, first, is_linear);
        if (weight > 0) {
            const DoubleTexel next = sample_level(detail, first + 1, is_linear);
            for (std::size_t c = 0; c < 4; ++c) result[c] = result[c] * (1 - weight) + next[c] * weight;
        }
        return result;
    }

    [[nodiscard]] DoubleTexel gather() {
        prepare();
        const std::uint32_t component = (flags_ >> image_component_shift) & 3;
        const auto value = [&](const Tap& tap) {
            return flag(image_compare) ? compared(tap.texel[0]) : tap.texel[component];
        };
        // In the order (i0, j1), (i1, j1), (i1, j0), (i0, j0).
        constexpr std::array<std::size_t, 4> order{2, 3, 1, 0};
        DoubleTexel result{};
        if (flag(image_offsets) && !axes_.is_cube) {
            for (std::size_t i = 0; i < 4; ++i) {
                offset_ = {arguments_.gather_offsets[i][0], arguments_.gather_offsets[i][1], 0};
                has_offset_ = true;
                result[i] = value(footprint(0, coordinates_, true).taps[0]);
            }
            return result;
        }
        const Footprint found = footprint(0, coordinates_, true);
        // 1D images have two texels: both rows are the same.
        const std::size_t rows = found.count > 2 ? 3 : 1;
        for (std::size_t i = 0; i < 4; ++i) result[i] = value(found.taps[order[i] & rows]);
        double sum = 0;
        int existing = 0;
        for (std::size_t i = 0; i < 4; ++i)
            if (!found.taps[order[i] & rows].is_corner) sum += result[i], ++existing;
        for (std::size_t i = 0; i < 4; ++i)
            if (found.taps[order[i] & rows].is_corner) result[i] = sum / std::max(existing, 1);
        return result;
    }

    [[nodiscard]] DoubleTexel query_level_of_detail() {
        prepare();
        const Detail detail = level_of_detail();
        const auto [level, weight] = levels_of(detail.lambda);
        return {level + weight, detail.unclamped, 0, 0};
    }

  private:
    struct Detail {
        double unclamped = 0, lambda = 0;
        double sample_count = 1;  ///< Along the longer axis of the footprint.
        std::array<double, 2> axis{};
        /// Filtering over the ellipse of these derivatives instead, in texels of level 0.
        bool is_elliptical = false;
        std::array<double, 2> dx{}, dy{};
    };
    struct Tap {
        DoubleTexel texel{};
        double weight = 1;
        bool is_corner = false;  ///< Where three faces of a cube meet: there is no such texel.
    };
    struct Footprint {
        std::array<Tap, 8> taps;
        std::size_t count = 1;
    };

    [[nodiscard]] bool has(ImageOperation operation) const {
        return static_cast<ImageOperation>(flags_ & image_operation_mask) == operation;
    }
    [[nodiscard]] bool flag(ImageFlags bit) const { return (flags_ & bit) != 0; }

    [[nodiscard]] std::uint64_t offset_of(const ImageLevel& level, std::int64_t x, std::int64_t y, std::int64_t slice,
                                          std::int64_t sample) const {
        const auto edge = static_cast<std::int64_t>(rhi::info(image_.format).block_width);
        const std::uint64_t stride =
            image_.dimension == rhi::ViewDimension::d3 ? level.slice_stride : level.layer_stride;
        return static_cast<std::uint64_t>(slice) * stride + static_cast<std::uint64_t>(sample) * level.sample_stride +
               static_cast<std::uint64_t>(y / edge) * level.row_stride +
               static_cast<std::uint64_t>(x / edge) * plan_.texel_bytes;
    }
    [[nodiscard]] double* shadow_at(const ImageLevel& level, std::uint64_t offset) const {
        return level.shadow ? level.shadow + offset / plan_.texel_bytes * image_.shadow_doubles : nullptr;
    }
    [[nodiscard]] DoubleTexel texel(std::uint32_t number, std::int64_t x, std::int64_t y, std::int64_t slice,
                                    std::int64_t sample = 0) const {
        const ImageLevel& level = image_.levels[number];
        if (!level.data) return {};
        const std::uint64_t offset = offset_of(level, x, y, slice, sample);
        if (rhi::info(image_.format).is_compressed())
            return decode_double(image_.format, level.data + offset, static_cast<std::uint32_t>(x & 3),
                                 static_cast<std::uint32_t>(y & 3));
        return load_double(image_.format, level.data + offset, shadow_at(level, offset));
    }

    /// x, y, slice and sample of integer coordinates; false outside of the image.
    bool texel_place(std::int64_t number, std::array<std::int64_t, 4>& at) const {
        const ImageLevel& level = image_.levels[static_cast<std::size_t>(number)];
        const auto coordinate = [&](std::size_t axis) {
            const double value = arguments_.coordinates[axis][lane_] +
                                 (flag(image_offset) && axis < 3 ? arguments_.offset[axis][lane_] : 0);
            return static_cast<std::int64_t>(value);
        };
        const auto inside = [](std::int64_t value, std::uint32_t size) { return value >= 0 && value < size; };
        at = {coordinate(0), 0, 0, 0};
        bool is_inside = level.data && inside(at[0], level.width);
        if (axes_.spatial > 1) at[1] = coordinate(1), is_inside = is_inside && inside(at[1], level.height);
        if (axes_.spatial == 3 && !axes_.is_cube) {
            at[2] = coordinate(2), is_inside = is_inside && inside(at[2], level.depth);
        } else if (axes_.is_cube || axes_.has_layers) {
            at[2] = static_cast<std::int64_t>(arguments_.coordinates[axes_.spatial == 1 ? 1 : 2][lane_]);
            is_inside = is_inside && inside(at[2], image_.layer_count);
        }
        if (image_.samples > 1)
            at[3] = arguments_.sample[lane_], is_inside = is_inside && inside(at[3], image_.samples);
        return is_inside;
    }

    void prepare() {
        for (std::size_t axis = 0; axis < static_cast<std::size_t>(axes_.spatial); ++axis)
            coordinates_[axis] = arguments_.coordinates[axis][lane_];
        if (axes_.has_layers) {
            const std::uint32_t count = axes_.is_cube ? image_.layer_count / 6 : image_.layer_count;
            const double asked = std::nearbyint(arguments_.coordinates[axes_.spatial][lane_]);
            slice_ = std::clamp<std::int64_t>(whole(asked), 0, count - 1) * (axes_.is_cube ? 6 : 1);
        }
        if (axes_.is_cube) cube_ = place_on_cube(coordinates_);
        has_offset_ = flag(image_offset) && !axes_.is_cube;
        if (has_offset_)
            for (std::size_t axis = 0; axis < static_cast<std::size_t>(axes_.spatial); ++axis)
                offset_[axis] = arguments_.offset[axis][lane_];
        reference_ = arguments_.reference[lane_];
        if (flag(image_compare) && plan_.is_fixed_point_depth)
            reference_ = reference_ > 0 ? std::min(reference_, 1.0) : 0.0;
    }

    [[nodiscard]] double compared(double depth) const {
        return holds(sampler_->compare, reference_, depth) ? 1.0 : 0.0;
    }

    /// Vulkan specification, "Scale Factor Operation", "LOD Operation".
    [[nodiscard]] Detail level_of_detail() const {
        Detail detail;
        double lambda = 0;
        if (flag(image_lod_explicit)) {
            lambda = arguments_.lod[lane_];
        } else if (flag(image_lod_implicit) || flag(image_lod_gradient)) {
            Vector dx{}, dy{};
            for (std::size_t axis = 0; axis < static_cast<std::size_t>(axes_.spatial); ++axis) {
                // Implicit derivatives are those of the upper left corner of the quad.
                const double* const quad = arguments_.coordinates[axis] + (lane_ & ~3u);
                dx[axis] = flag(image_lod_gradient) ? arguments_.gradient_x[axis][lane_] : quad[1] - quad[0];
                dy[axis] = flag(image_lod_gradient) ? arguments_.gradient_y[axis][lane_] : quad[2] - quad[0];
            }
            std::size_t count = static_cast<std::size_t>(axes_.spatial);
            if (axes_.is_cube) {
                const auto on_x = derivative_on_face(cube_, dx), on_y = derivative_on_face(cube_, dy);
                dx = {on_x[0], on_x[1], 0}, dy = {on_y[0], on_y[1], 0};
                count = 2;
            }
            const ImageLevel& base = image_.levels[0];
            const std::array<double, 3> size{double(base.width), double(base.height), double(base.depth)};
            double length_x = 0, length_y = 0;
            for (std::size_t axis = 0; axis < count; ++axis) {
                length_x += dx[axis] * size[axis] * dx[axis] * size[axis];
                length_y += dy[axis] * size[axis] * dy[axis] * size[axis];
            }
            const double longest = std::max(length_x, length_y), shortest = std::min(length_x, length_y);
            lambda = 0.5 * linear_log2(longest);
            if (is_elliptical_ && sampler_->max_anisotropy > 1.0f && count == 2 && !axes_.is_cube &&
                !flag(image_compare)) {
                lambda = 0.5 * linear_log2(shortest);
                detail.is_elliptical = true;
                for (std::size_t axis = 0; axis < 2; ++axis)
                    detail.dx[axis] = dx[axis] * size[axis], detail.dy[axis] = dy[axis] * size[axis];
            } else if (sampler_->max_anisotropy > 1.0f && count == 2 && !axes_.is_cube) {
                const double limit = std::min(sampler_->max_anisotropy, 16.0f);
                double ratio = std::sqrt(longest) / std::sqrt(shortest);
                ratio = ratio > 1 ? std::min(ratio, limit) : 1.0;
                // A footprint that is round but for rounding takes one sample.
                detail.sample_count = std::ceil(ratio - 1.0 / 256);
                lambda = 0.5 * linear_log2(longest / (ratio * ratio));
                detail.axis = length_x >= length_y ? std::array{dx[0], dx[1]} : std::array{dy[0], dy[1]};
            }
        }
        double bias = sampler_->mip_bias;
        if (flag(image_lod_implicit)) bias += arguments_.lod[lane_];
        lambda += std::clamp(bias, -16.0, 16.0);  // VkPhysicalDeviceLimits::maxSamplerLodBias
        detail.unclamped = lambda;
        double lowest = sampler_->min_lod;
        if (flag(image_min_lod)) lowest = std::max(lowest, arguments_.min_lod[lane_]);
        detail.lambda = lambda > lowest ? std::min<double>(lambda, sampler_->max_lod) : lowest;
        return detail;
    }

    /// The first mip, and the weight of the one behind it.
    [[nodiscard]] std::pair<std::uint32_t, double> levels_of(double lambda) const {
        const double last = image_.mip_count - 1, d = lambda > 0 ? std::min(lambda, last) : 0.0;
        if (sampler_->mip == rhi::Filter::linear) return {static_cast<std::uint32_t>(std::floor(d)), d - std::floor(d)};
        return {static_cast<std::uint32_t>(std::clamp(std::ceil(d + 0.5) - 1, 0.0, last)), 0.0};
    }

    [[nodiscard]] DoubleTexel sample_level(const Detail& detail, std::uint32_t level, bool is_linear) {
        if (detail.is_elliptical) return average_ellipse(detail, level);
        if (detail.sample_count <= 1) return sample_once(level, coordinates_, is_linear);
        // Samples at i / (N + 1) - 1/2 of the longer axis, i = 1 ... N.
        DoubleTexel sum{};
        for (int i = 1; i <= static_cast<int>(detail.sample_count); ++i) {
            const double along = i / (detail.sample_count + 1) - 0.5;
            Vector moved = coordinates_;
            for (std::size_t axis = 0; axis < 2; ++axis) moved[axis] += along * detail.axis[axis];
            const DoubleTexel once = sample_once(level, moved, is_linear);
            for (std::size_t c = 0; c < 4; ++c) sum[c] += once[c];
        }
        for (double& channel : sum) channel /= detail.sample_count;
        return sum;
    }

    /// The filter of kernels/elliptical_filter.h.
    [[nodiscard]] DoubleTexel average_ellipse(const Detail& detail, std::uint32_t number) const {
        const ImageLevel& level = image_.levels[number];
        const double scale = std::ldexp(1.0, -static_cast<int>(number));
        const double ux = detail.dx[0] * scale, vx = detail.dx[1] * scale, uy = detail.dy[0] * scale,
                     vy = detail.dy[1] * scale;
        const double a = vx * vx + vy * vy + 1.0, b = -2.0 * (ux * vx + uy * vy), c = ux * ux + uy * uy + 1.0;
        const double f = a * c - 0.25 * b * b, d = 4.0 * f;
        const auto bounded = [](double extent, std::uint32_t size) {
            return extent >= 0.0 ? std::min(extent, 2.0 * size) : 0.0;
        };
        const auto center = [&](std::size_t axis, std::uint32_t size, rhi::AddressMode mode) {
            const double at = in_texels(coordinates_[axis], size, mode);
            return (std::isnan(at) ? 0.0 : std::clamp(at, -farthest_texel, farthest_texel)) - 0.5;
        };
        const double u = center(0, level.width, sampler_->address_u), v = center(1, level.height, sampler_->address_v);
        const double half_width = bounded(2.0 / d * std::sqrt(d * c * f), level.width),
                     half_height = bounded(2.0 / d * std::sqrt(d * a * f), level.height);
        const double to_index = (elliptical_weight_count - 1) / f;
        DoubleTexel sum{};
        double weights = 0.0;
        for (double y = std::floor(v - half_height); y <= std::ceil(v + half_height); y += 1.0)
            for (double x = std::floor(u - half_width); x <= std::ceil(u + half_width); x += 1.0) {
                const double dx = x - u, dy = y - v, q = (a * dx * dx + b * dx * dy + c * dy * dy) * to_index;
                if (!(q < elliptical_weight_count)) continue;
                const double weight =
                    static_cast<double>(elliptical_weights()[static_cast<std::size_t>(std::max(q, 0.0))]);
                bool is_border = false;
                const std::int64_t at_x = wrapped(static_cast<std::int64_t>(x) + (has_offset_ ? offset_[0] : 0),
                                                  level.width, sampler_->address_u, is_border);
                const std::int64_t at_y = wrapped(static_cast<std::int64_t>(y) + (has_offset_ ? offset_[1] : 0),
                                                  level.height, sampler_->address_v, is_border);
                const DoubleTexel found = is_border ? border() : texel(number, at_x, at_y, slice_);
                for (std::size_t channel = 0; channel < 4; ++channel) sum[channel] += weight * found[channel];
                weights += weight;
            }
        for (double& channel : sum) channel /= weights;
        return sum;
    }

    [[nodiscard]] DoubleTexel sample_once(std::uint32_t level, const Vector& coordinates, bool is_linear) {
        Footprint found = footprint(level, coordinates, is_linear);
        if (flag(image_compare))
            for (std::size_t tap = 0; tap < found.count; ++tap)
                found.taps[tap].texel = {compared(found.taps[tap].texel[0]), 0, 0, 1};
        // The texel that is missing in the corner of a cube is the mean of the other three.
        for (std::size_t tap = 0; tap < found.count; ++tap) {
            if (!found.taps[tap].is_corner) continue;
            for (std::size_t c = 0; c < 4; ++c) {
                double sum = 0;
                for (std::size_t other = 0; other < found.count; ++other)
                    if (other != tap) sum += found.taps[other].texel[c];
                found.taps[tap].texel[c] = sum / 3;
            }
        }
        if (found.count == 1) return found.taps[0].texel;
        DoubleTexel sum{};
        for (std::size_t tap = 0; tap < found.count; ++tap)
            for (std::size_t c = 0; c < 4; ++c) sum[c] += found.taps[tap].weight * found.taps[tap].texel[c];
        if (flag(image_compare)) sum[1] = sum[2] = 0, sum[3] = 1;
        return sum;
    }

    /// Vulkan specification, "Wrapping Operation". `is_border` is set where the texel is of the border.
    [[nodiscard]] static std::int64_t wrapped(std::int64_t i, std::int64_t n, rhi::AddressMode mode, bool& is_border) {
        switch (mode) {
            case rhi::AddressMode::repeat: return modulo(i, n);
            case rhi::AddressMode::mirrored_repeat: {
                const std::int64_t rest = modulo(i, 2 * n);
                return rest < n ? rest : 2 * n - 1 - rest;
            }
            case rhi::AddressMode::clamp_to_border: is_border = is_border || i < 0 || i >= n; break;
            default: break;
        }
        return std::clamp<std::int64_t>(i, 0, n - 1);
    }

    [[nodiscard]] static double in_texels(double s, std::uint32_t size, rhi::AddressMode mode) {
        switch (mode) {
            case rhi::AddressMode::repeat: return (s - std::floor(s)) * size;
            case rhi::AddressMode::mirrored_repeat: return (s * 0.5 - std::floor(s * 0.5)) * 2 * size;
            default: return s * size;
        }
    }

    [[nodiscard]] DoubleTexel border() const {
        const double rgb = sampler_->border == rhi::BorderColor::opaque_white ? 1 : 0;
        const double alpha = sampler_->border == rhi::BorderColor::transparent_black ? 0 : 1;
        DoubleTexel color{0, 0, 0, 1};
        for (std::size_t c = 0; c < plan_.channel_count && c < 4; ++c) color[c] = c == 3 ? alpha : rgb;
        return color;
    }

    [[nodiscard]] Footprint footprint(std::uint32_t number, const Vector& coordinates, bool is_linear) const {
        if (axes_.is_cube) return cube_footprint(number, is_linear);
        const ImageLevel& level = image_.levels[number];
        const std::array<std::uint32_t, 3> size{level.width, level.height, level.depth};
        const std::array<rhi::AddressMode, 3> modes{sampler_->address_u, sampler_->address_v, sampler_->address_w};
        std::array<std::int64_t, 3> first{};
        std::array<double, 3> weights{};
        for (std::size_t axis = 0; axis < static_cast<std::size_t>(axes_.spatial); ++axis) {
            double u = in_texels(coordinates[axis], size[axis], modes[axis]) - (is_linear ? 0.5 : 0.0);
            u = std::isnan(u) ? 0.0 : std::clamp(u, -farthest_texel, farthest_texel);
            first[axis] = whole(u);
            // Just below a period rounds up to it.
            if (!is_linear && modes[axis] == rhi::AddressMode::repeat)
                first[axis] = std::min<std::int64_t>(first[axis], size[axis] - 1);
            weights[axis] = u - std::floor(u);
            if (has_offset_) first[axis] += offset_[axis];
        }
        Footprint result;
        result.count = is_linear ? std::size_t{1} << axes_.spatial : 1;
        for (std::size_t tap = 0; tap < result.count; ++tap) {
            std::array<std::int64_t, 3> at{0, 0, slice_};
            double weight = 1;
            bool is_border = false;
            for (std::size_t axis = 0; axis < static_cast<std::size_t>(axes_.spatial); ++axis) {
                const bool is_second = (tap >> axis & 1) != 0;
                at[axis] = wrapped(first[axis] + (is_second ? 1 : 0), size[axis], modes[axis], is_border);
                weight *= is_second ? weights[axis] : 1 - weights[axis];
            }
            result.taps[tap] = {is_border ? border() : texel(number, at[0], at[1], at[2]), weight, false};
        }
        return result;
    }

    /// Vulkan specification, "Cube Map Edge Handling": a texel beyond an edge is the one that lies there on the cube.
    [[nodiscard]] Footprint cube_footprint(std::uint32_t number, bool is_linear) const {
        const auto n = static_cast<std::int64_t>(image_.levels[number].width);
        const auto in_face = [&](double s) {
            return std::isnan(s) ? 0.0 : std::clamp(s * static_cast<double>(n), 0.0, double(n));
        };
        const double u = in_face(cube_.s()) - (is_linear ? 0.5 : 0.0), v = in_face(cube_.t()) - (is_linear ? 0.5 : 0.0);
        Footprint result;
        if (!is_linear) {
            result.taps[0].texel = texel(number, std::clamp<std::int64_t>(whole(u), 0, n - 1),
                                         std::clamp<std::int64_t>(whole(v), 0, n - 1), slice_ + cube_.face);
            return result;
        }
        result.count = 4;
        const double weight_u = u - std::floor(u), weight_v = v - std::floor(v);
        for (std::size_t tap = 0; tap < 4; ++tap) {
            std::int64_t x = whole(u) + static_cast<std::int64_t>(tap & 1),
                         y = whole(v) + static_cast<std::int64_t>(tap >> 1);
            int face = cube_.face;
            const bool outside_x = x < 0 || x >= n, outside_y = y < 0 || y >= n;
            Tap& found = result.taps[tap];
            found.weight = (tap & 1 ? weight_u : 1 - weight_u) * (tap & 2 ? weight_v : 1 - weight_v);
            found.is_corner = outside_x && outside_y;
            if (outside_x != outside_y) {
                // The center of the texel, as far outside of the face as half a texel: seen from the middle of the cube
                // it lies on its neighbor, in the row at the edge and in the column that goes on.
                const auto& axes = face_axes[static_cast<std::size_t>(face)];
                const double s = (2.0 * static_cast<double>(x) + 1) / static_cast<double>(n) - 1;
                const double t = (2.0 * static_cast<double>(y) + 1) / static_cast<double>(n) - 1;
                Vector direction;
                for (std::size_t c = 0; c < 3; ++c) direction[c] = axes[2][c] + s * axes[0][c] + t * axes[1][c];
                const CubePlace there = place_on_cube(direction);
                face = there.face;
                x = std::clamp<std::int64_t>(whole(there.s() * static_cast<double>(n)), 0, n - 1);
                y = std::clamp<std::int64_t>(whole(there.t() * static_cast<double>(n)), 0, n - 1);
            }
            found.texel = texel(number, std::clamp<std::int64_t>(x, 0, n - 1), std::clamp<std::int64_t>(y, 0, n - 1),
                                slice_ + face);
        }
        return result;
    }

    const ImageView& image_;
    const rhi::SamplerDesc* sampler_;
    const bool is_elliptical_;
    const DoubleImageArguments& arguments_;
    const std::uint32_t flags_, lane_;
    const Axes axes_;
    const FormatPlan& plan_;
    Vector coordinates_{};
    std::int64_t slice_ = 0;
    CubePlace cube_;
    bool has_offset_ = false;
    std::array<std::int64_t, 3> offset_{};
    double reference_ = 0;
};

void run(const ImageView* image, const SamplerState* sampler, DoubleImageArguments* arguments, std::uint32_t flags,
         std::uint32_t live) {
    const auto operation = static_cast<ImageOperation>(flags & image_operation_mask);
    for (std::uint32_t number = 0; number < max_lanes; ++number) {
        DoubleTexel result{};
        if (image && (live >> number & 1) != 0) {
            Lane lane(*image, sampler, *arguments, flags, number);
            const bool is_float = !format_plan(image->format).is_integer;
            switch (operation) {
                case ImageOperation::fetch:
                case ImageOperation::load:
                    if (is_float) result = lane.fetch();
                    break;
                case ImageOperation::store:
                    if (is_float) lane.store();
                    break;
                case ImageOperation::sample:
                    if (lane.can_sample()) result = lane.sample();
                    break;
                case ImageOperation::gather:
                    if (lane.can_sample()) result = lane.gather();
                    break;
                case ImageOperation::query_lod:
                    if (sampler && image->mip_count != 0) result = lane.query_level_of_detail();
                    break;
                default: break;
            }
        }
        for (std::size_t c = 0; c < 4; ++c) arguments->result[c][number] = result[c];
    }
}

}  // namespace

NacreCpuDoubleImageFunction double_image_function() { return &run; }

}  // namespace nacre::cpu
