// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/images/reference_sampler.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace nacre::cpu::test {
namespace {

using rhi::AddressMode;
using rhi::ViewDimension;

int axes_of(ViewDimension dimension) {
    using enum ViewDimension;
    switch (dimension) {
        case d1:
        case d1_array: return 1;
        case d2:
        case d2_array: return 2;
        default: return 3;
    }
}

double coordinate(const Point& point, int axis) {
    return std::bit_cast<float>(point.coordinates[static_cast<std::size_t>(axis)]);
}

// Wrapping operation; -1 or n stand for the border.
int wrapped(int i, int n, AddressMode mode) {
    const auto modulo = [](int a, int b) { return ((a % b) + b) % b; };
    switch (mode) {
        case AddressMode::repeat: return modulo(i, n);
        case AddressMode::mirrored_repeat: {
            const int m = modulo(i, 2 * n) - n;
            return (n - 1) - (m >= 0 ? m : -(1 + m));
        }
        case AddressMode::clamp_to_edge: return std::clamp(i, 0, n - 1);
        default: return std::clamp(i, -1, n);
    }
}

bool passes(rhi::CompareOperation operation, double reference, double depth) {
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

// The point of the cube's surface (or of the plane of a face beyond its edges) at s, t in [-1, 1] of a face: the table
// of the specification read backwards.
std::array<double, 3> cube_point(int face, double s, double t) {
    switch (face) {
        case 0: return {1, -t, -s};
        case 1: return {-1, -t, s};
        case 2: return {s, 1, t};
        case 3: return {s, -1, -t};
        case 4: return {s, -t, 1};
        default: return {-s, -t, -1};
    }
}

// Linear between the powers of two, in double: what samples of images take for the logarithm.
double linear_log2(double x) {
    if (x <= 0) return -127;
    int exponent = 0;
    const double mantissa = std::frexp(x, &exponent);
    return exponent + 2 * mantissa - 2;
}

}  // namespace

int ReferenceSampler::decide(double value) {
    if (std::abs(value - std::nearbyint(value)) < 2e-4) is_ambiguous_ = true;
    return static_cast<int>(std::floor(value));
}

ReferenceSampler::FaceCoordinates ReferenceSampler::project(const Vector& r) {
    const double ax = std::abs(r[0]), ay = std::abs(r[1]), az = std::abs(r[2]);
    std::array<double, 3> sorted{ax, ay, az};
    std::sort(sorted.begin(), sorted.end());
    if (sorted[2] - sorted[1] < 1e-5 * sorted[2]) is_ambiguous_ = true;
    FaceCoordinates result;
    double sc, tc;
    if (az >= ax && az >= ay) {
        result.face = r[2] >= 0 ? 4 : 5;
        sc = r[2] >= 0 ? r[0] : -r[0], tc = -r[1];
    } else if (ay >= ax) {
        result.face = r[1] >= 0 ? 2 : 3;
        sc = r[0], tc = r[1] >= 0 ? r[2] : -r[2];
    } else {
        result.face = r[0] >= 0 ? 0 : 1;
        sc = r[0] >= 0 ? -r[2] : r[2], tc = -r[1];
    }
    result.s = 0.5 * sc / sorted[2] + 0.5;
    result.t = 0.5 * tc / sorted[2] + 0.5;
    return result;
}

ReferenceSampler::Detail ReferenceSampler::detail(std::uint32_t flags, std::span<const Point, 4> quad,
                                                  std::size_t index) {
    Detail result;
    const Point& point = quad[index];
    const ViewDimension dimension = image_.shape.dimension;
    const int axes = axes_of(dimension);
    double lambda = 0.0;
    if ((flags & image_lod_explicit) != 0) {
        lambda = point.lod;
    } else if ((flags & (image_lod_implicit | image_lod_gradient)) != 0) {
        Vector dx{}, dy{};
        for (int axis = 0; axis < axes; ++axis) {
            if ((flags & image_lod_gradient) != 0) {
                dx[axis] = point.gradient_x[axis], dy[axis] = point.gradient_y[axis];
            } else {
                dx[axis] = coordinate(quad[1], axis) - coordinate(quad[0], axis);
                dy[axis] = coordinate(quad[2], axis) - coordinate(quad[0], axis);
            }
        }
        int texel_axes = axes;
        if (is_cube(dimension)) {
            // The projection's derivative as a limit of differences.
            const Vector r{coordinate(point, 0), coordinate(point, 1), coordinate(point, 2)};
            const FaceCoordinates here = project(r);
            const auto along = [&](const Vector& d) {
                constexpr double step = 1e-6;
                double sc[2], tc[2];
                for (int side = 0; side < 2; ++side) {
                    Vector moved;
                    for (int i = 0; i < 3; ++i) moved[i] = r[i] + (side == 0 ? -step : step) * d[i];
                    // On the plane of the same face.
                    const Vector normal = cube_point(here.face, 0, 0), s_axis = cube_point(here.face, 1, 0),
                                 t_axis = cube_point(here.face, 0, 1);
                    double n = 0, s = 0, t = 0;
                    for (int i = 0; i < 3; ++i) {
                        n += normal[i] * moved[i];
                        s += (s_axis[i] - normal[i]) * moved[i];
                        t += (t_axis[i] - normal[i]) * moved[i];
                    }
                    sc[side] = 0.5 * s / n, tc[side] = 0.5 * t / n;
                }
                return Vector{(sc[1] - sc[0]) / (2 * step), (tc[1] - tc[0]) / (2 * step), 0.0};
            };
            dx = along(dx), dy = along(dy);
            texel_axes = 2;
        }
        const ImageLevel& base = image_.view.levels[0];
        const double size[3] = {static_cast<double>(base.width), static_cast<double>(base.height),
                                static_cast<double>(base.depth)};
        double length_x = 0.0, length_y = 0.0;
        for (int axis = 0; axis < texel_axes; ++axis) {
            length_x += std::pow(dx[axis] * size[axis], 2);
            length_y += std::pow(dy[axis] * size[axis], 2);
        }
        length_x = std::sqrt(length_x), length_y = std::sqrt(length_y);
        const double longest = std::max(length_x, length_y), shortest = std::min(length_x, length_y);
        lambda = 0.5 * linear_log2(longest * longest);
        if (sampler_.max_anisotropy > 1.0f && axes == 2) {
            const double ratio = std::min<double>(longest / shortest, sampler_.max_anisotropy);
            result.samples = static_cast<int>(std::ceil(ratio));
            // Close above a whole number one sample less is allowed to do.
            if (ratio - std::floor(ratio) < 0.005) is_ambiguous_ = true;
            lambda = 0.5 * linear_log2(longest / ratio * (longest / ratio));
            const Vector& major = length_x >= length_y ? dx : dy;
            result.axis = {major[0], major[1]};
        }
    }
    double bias = sampler_.mip_bias;
    if ((flags & image_lod_implicit) != 0) bias += point.lod;
    result.unclamped = lambda + bias;
    double lowest = sampler_.min_lod;
    if ((flags & image_min_lod) != 0) lowest = std::max<double>(lowest, point.min_lod);
    result.lambda = std::min<double>(std::max(result.unclamped, lowest), sampler_.max_lod);
    return result;
}

std::array<double, 4> ReferenceSampler::texel(std::uint32_t flags, const Point& point, int mip, int layer,
                                              std::array<int, 3> at) {
    const ImageLevel& level = image_.view.levels[static_cast<std::size_t>(mip)];
    const rhi::FormatInfo& facts = rhi::info(image_.shape.format);
    const bool is_inside = at[0] >= 0 && at[1] >= 0 && at[2] >= 0 && at[0] < static_cast<int>(level.width) &&
                           at[1] < static_cast<int>(level.height) && at[2] < static_cast<int>(level.depth);
    std::array<double, 4> value{0, 0, 0, 1};
    if (is_inside) {
        const auto x = static_cast<std::uint64_t>(at[0]), y = static_cast<std::uint64_t>(at[1]),
                   z = static_cast<std::uint64_t>(at[2]);
        const std::uint64_t block = facts.block_width;
        const std::byte* address = level.data + static_cast<std::uint64_t>(layer) * level.layer_stride +
                                   z * level.slice_stride + y / block * level.row_stride +
                                   x / block * image_.view.texel_bytes;
        const Texel decoded = decode_texel(image_.shape.format, address, static_cast<std::uint32_t>(x % block),
                                           static_cast<std::uint32_t>(y % block));
        for (int c = 0; c < 4; ++c) {
            value[c] = decoded.f[c];
            if (facts.kind == rhi::FormatKind::uint) value[c] = decoded.u[c];
            if (facts.kind == rhi::FormatKind::sint) value[c] = decoded.i[c];
        }
    } else {
        const int channels = facts.is_depth_stencil() ? 1 : facts.channels;
        for (int c = 0; c < channels; ++c) {
            value[c] = c == 3 ? (sampler_.border != rhi::BorderColor::transparent_black)
                              : (sampler_.border == rhi::BorderColor::opaque_white);
        }
    }
    if ((flags & image_compare) != 0) {
        double reference = point.reference;
        if (facts.kind == rhi::FormatKind::unorm) reference = std::clamp(reference, 0.0, 1.0);
        if (std::abs(reference - value[0]) < 1e-6) is_ambiguous_ = true;
        return {passes(sampler_.compare, reference, value[0]) ? 1.0 : 0.0, 0, 0, 1};
    }
    return value;
}

std::array<double, 4> ReferenceSampler::cube_texel(std::uint32_t flags, const Point& point, int mip, int first_layer,
                                                   int face, int i, int j, bool& exists) {
    const int n = static_cast<int>(image_.view.levels[static_cast<std::size_t>(mip)].width);
    const bool outside_i = i < 0 || i >= n, outside_j = j < 0 || j >= n;
    exists = !(outside_i && outside_j);
    if (!exists) return {};
    if (outside_i || outside_j) {
        // Fold the plane of the face over the edge: go to the edge, then down the neighboring face by half a texel.
        const auto to_unit = [&](int k) { return (2.0 * k + 1.0) / n - 1.0; };
        const double s = std::clamp(to_unit(i), -1.0, 1.0), t = std::clamp(to_unit(j), -1.0, 1.0);
        Vector on_edge = cube_point(face, s, t);
        const Vector normal = cube_point(face, 0, 0);
        for (int c = 0; c < 3; ++c) on_edge[c] -= normal[c] / n;
        // Now the component that points to the neighbor is the largest.
        const bool was_ambiguous = is_ambiguous_;
        const FaceCoordinates there = project(on_edge);
        is_ambiguous_ = was_ambiguous;
        face = there.face;
        i = std::clamp(static_cast<int>(std::floor(there.s * n)), 0, n - 1);
        j = std::clamp(static_cast<int>(std::floor(there.t * n)), 0, n - 1);
    }
    return texel(flags, point, mip, first_layer + face, {i, j, 0});
}

std::array<double, 4> ReferenceSampler::once(std::uint32_t flags, const Point& point, const Vector& at, int mip,
                                             bool is_linear) {
    const ViewDimension dimension = image_.shape.dimension;
    const ImageLevel& level = image_.view.levels[static_cast<std::size_t>(mip)];
    const int axes = axes_of(dimension);
    int layer = 0;
    if (dimension == ViewDimension::d1_array || dimension == ViewDimension::d2_array ||
        dimension == ViewDimension::cube_array) {
        const double wanted = coordinate(point, axes);
        const int count = static_cast<int>(image_.shape.layers) / (is_cube(dimension) ? 6 : 1);
        if (std::abs(wanted - std::floor(wanted) - 0.5) < 1e-4) is_ambiguous_ = true;
        layer = std::clamp(static_cast<int>(std::nearbyint(std::clamp(wanted, -1e6, 1e6))), 0, count - 1) *
                (is_cube(dimension) ? 6 : 1);
    }
    std::array<double, 4> sum{};
    if (is_cube(dimension)) {
        const FaceCoordinates where = project(at);
        const int n = static_cast<int>(level.width);
        bool exists = true;
        if (!is_linear) {
            const int i = std::clamp(decide(where.s * n), 0, n - 1), j = std::clamp(decide(where.t * n), 0, n - 1);
            return cube_texel(flags, point, mip, layer, where.face, i, j, exists);
        }
        const double u = where.s * n - 0.5, v = where.t * n - 0.5;
        const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
        std::array<std::array<double, 4>, 4> texels;
        bool present[4];
        std::array<double, 4> mean{};
        int count = 0;
        for (int tap = 0; tap < 4; ++tap) {
            texels[tap] = cube_texel(flags, point, mip, layer, where.face, i + (tap & 1), j + (tap >> 1), present[tap]);
            if (!present[tap]) continue;
            ++count;
            for (int c = 0; c < 4; ++c) mean[c] += texels[tap][c];
        }
        for (int tap = 0; tap < 4; ++tap) {
            const double weight = ((tap & 1) != 0 ? u - i : 1 - (u - i)) * ((tap >> 1) != 0 ? v - j : 1 - (v - j));
            for (int c = 0; c < 4; ++c) sum[c] += weight * (present[tap] ? texels[tap][c] : mean[c] / count);
        }
        return sum;
    }
    const int size[3] = {static_cast<int>(level.width), static_cast<int>(level.height), static_cast<int>(level.depth)};
    const AddressMode modes[3] = {sampler_.address_u, sampler_.address_v, sampler_.address_w};
    int first[3] = {0, 0, 0};
    double weight[3] = {0, 0, 0};
    for (int axis = 0; axis < axes; ++axis) {
        const double u = at[axis] * size[axis];
        if (is_linear) {
            first[axis] = static_cast<int>(std::floor(u - 0.5));
            weight[axis] = u - 0.5 - first[axis];
        } else {
            first[axis] = decide(u);
        }
        if ((flags & image_offset) != 0) first[axis] += point.offset[axis];
    }
    const int taps = is_linear ? 1 << axes : 1;
    for (int tap = 0; tap < taps; ++tap) {
        double w = 1.0;
        std::array<int, 3> where{0, 0, 0};
        for (int axis = 0; axis < axes; ++axis) {
            const int second = (tap >> axis) & 1;
            where[axis] = wrapped(first[axis] + second, size[axis], modes[axis]);
            if (is_linear) w *= second != 0 ? weight[axis] : 1.0 - weight[axis];
        }
        const auto value = texel(flags, point, mip, layer, where);
        for (int c = 0; c < 4; ++c) sum[c] += w * value[c];
    }
    return sum;
}

std::array<double, 4> ReferenceSampler::level(std::uint32_t flags, const Point& point, const Detail& found, int mip,
                                              bool is_linear) {
    const Vector at{coordinate(point, 0), coordinate(point, 1), coordinate(point, 2)};
    if (found.samples == 1) return once(flags, point, at, mip, is_linear);
    std::array<double, 4> sum{};
    for (int i = 1; i <= found.samples; ++i) {
        const double along = static_cast<double>(i) / (found.samples + 1) - 0.5;
        const auto value =
            once(flags, point, {at[0] + along * found.axis[0], at[1] + along * found.axis[1], 0.0}, mip, is_linear);
        for (int c = 0; c < 4; ++c) sum[c] += value[c] / found.samples;
    }
    return sum;
}

ReferenceResult ReferenceSampler::sample(std::uint32_t flags, std::span<const Point, 4> quad, std::size_t index) {
    is_ambiguous_ = false;
    const Point& point = quad[index];
    const Detail found = detail(flags, quad, index);
    const bool is_integer = rhi::info(image_.shape.format).is_integer();
    if (sampler_.magnify != sampler_.minify && std::abs(found.unclamped) < 1e-4) is_ambiguous_ = true;
    const bool is_linear =
        !is_integer && (found.lambda <= 0.0 ? sampler_.magnify : sampler_.minify) == rhi::Filter::linear;
    const double last = image_.shape.mips - 1.0, d = std::clamp(found.lambda, 0.0, last);
    ReferenceResult result;
    if (is_integer || sampler_.mip == rhi::Filter::nearest) {
        if (std::abs(d - std::floor(d) - 0.5) < 1e-4) is_ambiguous_ = true;
        result.value = level(flags, point, found, static_cast<int>(std::ceil(d + 0.5) - 1.0), is_linear);
    } else {
        const int high = static_cast<int>(std::floor(d)), low = std::min(high + 1, static_cast<int>(last));
        const auto a = level(flags, point, found, high, is_linear), b = level(flags, point, found, low, is_linear);
        for (int c = 0; c < 4; ++c) result.value[c] = (1.0 - (d - high)) * a[c] + (d - high) * b[c];
    }
    result.is_ambiguous = is_ambiguous_;
    return result;
}

ReferenceResult ReferenceSampler::query(std::uint32_t flags, std::span<const Point, 4> quad, std::size_t index) {
    is_ambiguous_ = false;
    const Detail found = detail(flags, quad, index);
    double d = std::clamp(found.lambda, 0.0, image_.shape.mips - 1.0);
    if (sampler_.mip == rhi::Filter::nearest) {
        if (std::abs(d - std::floor(d) - 0.5) < 1e-4) is_ambiguous_ = true;
        d = std::ceil(d + 0.5) - 1.0;
    }
    return {{d, found.unclamped, 0.0, 0.0}, is_ambiguous_};
}

}  // namespace nacre::cpu::test
