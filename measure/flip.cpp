// SPDX-License-Identifier: Apache-2.0
#include "measure/flip.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace nacre::measure {
namespace {

// --- Color spaces ---------------------------------------------------------------------------------------------------

struct Triple {
    float x, y, z;
};

// Linear sRGB to XYZ, from the chromaticities of Rec. 709 and the white point D65 (0.3127, 0.3290).
constexpr float to_xyz[3][3] = {{0.41239080f, 0.35758434f, 0.18048079f},
                                {0.21263901f, 0.71516868f, 0.07219232f},
                                {0.01933082f, 0.11919478f, 0.95053215f}};
constexpr float to_rgb[3][3] = {{3.24096994f, -1.53738318f, -0.49861076f},
                                {-0.96924364f, 1.87596750f, 0.04155506f},
                                {0.05563008f, -0.20397696f, 1.05697151f}};
constexpr Triple white{to_xyz[0][0] + to_xyz[0][1] + to_xyz[0][2], 1.0f, to_xyz[2][0] + to_xyz[2][1] + to_xyz[2][2]};

Triple multiply(const float (&m)[3][3], Triple v) {
    return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
            m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
}

// CIELab without its cube root: the opponent space YCxCz in which the eye's blur is linear.
Triple opponent_from_rgb(Triple rgb) {
    const Triple xyz = multiply(to_xyz, rgb);
    const float x = xyz.x / white.x, y = xyz.y / white.y, z = xyz.z / white.z;
    return {116.0f * y - 16.0f, 500.0f * (x - y), 200.0f * (y - z)};
}

Triple rgb_from_opponent(Triple opponent) {
    const float y = (opponent.x + 16.0f) / 116.0f;
    const float x = y + opponent.y / 500.0f;
    const float z = y - opponent.z / 200.0f;
    return multiply(to_rgb, {x * white.x, y * white.y, z * white.z});
}

float lab_curve(float t) {
    constexpr float delta = 6.0f / 29.0f;
    return t > delta * delta * delta ? std::cbrt(t) : t / (3.0f * delta * delta) + 4.0f / 29.0f;
}

// CIELab with the Hunt effect: colorfulness grows with luminance.
Triple hunt_lab_from_rgb(Triple rgb) {
    const Triple xyz = multiply(to_xyz, rgb);
    const float fx = lab_curve(xyz.x / white.x), fy = lab_curve(xyz.y / white.y), fz = lab_curve(xyz.z / white.z);
    const float lightness = 116.0f * fy - 16.0f;
    return {lightness, 0.01f * lightness * 500.0f * (fx - fy), 0.01f * lightness * 200.0f * (fy - fz)};
}

// HyAB distance (Abasi et al. 2020): city block in lightness, Euclidean in chroma; better for large differences.
float hyab(Triple a, Triple b) {
    return std::abs(a.x - b.x) + std::sqrt((a.y - b.y) * (a.y - b.y) + (a.z - b.z) * (a.z - b.z));
}

// --- Separable filters ----------------------------------------------------------------------------------------------

using Kernel = std::vector<float>;

struct Plane {
    std::size_t width, height;
    std::vector<float> values;
    Plane(std::size_t w, std::size_t h) : width(w), height(h), values(w * h) {}
};

// Convolution with `horizontal` along rows and `vertical` along columns; the border is repeated outward. Both kernels
// have the same odd length. Kernels are applied as correlations; the sign of odd ones does not matter here.
Plane filter(const Plane& source, const Kernel& horizontal, const Kernel& vertical) {
    const std::size_t radius = horizontal.size() / 2;
    const std::size_t width = source.width, height = source.height;
    Plane rows(width, height);
    std::vector<float> padded(width + 2 * radius);
    for (std::size_t y = 0; y < height; ++y) {
        const float* row = &source.values[y * width];
        std::fill_n(padded.begin(), radius, row[0]);
        std::copy_n(row, width, padded.begin() + static_cast<std::ptrdiff_t>(radius));
        std::fill_n(padded.end() - static_cast<std::ptrdiff_t>(radius), radius, row[width - 1]);
        float* target = &rows.values[y * width];
        for (std::size_t k = 0; k < horizontal.size(); ++k) {
            const float weight = horizontal[k];
            const float* shifted = padded.data() + k;
            for (std::size_t x = 0; x < width; ++x) target[x] += weight * shifted[x];
        }
    }
    Plane result(width, height);
    for (std::size_t y = 0; y < height; ++y) {
        float* target = &result.values[y * width];
        for (std::size_t k = 0; k < vertical.size(); ++k) {
            const std::size_t from = std::clamp(y + k, radius, height - 1 + radius) - radius;
            const float weight = vertical[k];
            const float* row = &rows.values[from * width];
            for (std::size_t x = 0; x < width; ++x) target[x] += weight * row[x];
        }
    }
    return result;
}

void scale(Kernel& kernel, float factor) {
    for (float& value : kernel) value *= factor;
}

float sum(const Kernel& kernel) {
    double total = 0;
    for (const float value : kernel) total += value;
    return static_cast<float>(total);
}

// --- Contrast sensitivity
// ---------------------------------------------------------------------------------------------

// The eye's response to a frequency, as a sum of Gaussians a * sqrt(pi / b) * exp(-pi^2 x^2 / b), x in degrees
// (table 1 of the paper).
struct Sensitivity {
    float a1, b1, a2, b2;
};
constexpr Sensitivity achromatic{1.0f, 0.0047f, 0.0f, 1e-5f};
constexpr Sensitivity red_green{1.0f, 0.0053f, 0.0f, 1e-5f};
constexpr Sensitivity blue_yellow{34.1f, 0.04f, 13.5f, 0.025f};
constexpr float pi = std::numbers::pi_v<float>;

int sensitivity_radius(float pixels_per_degree) {
    // Three standard deviations of the widest Gaussian.
    return static_cast<int>(std::ceil(3.0f * std::sqrt(blue_yellow.b1 / (2.0f * pi * pi)) * pixels_per_degree));
}

Kernel sensitivity_kernel(float b, int radius, float pixels_per_degree) {
    Kernel kernel;
    for (int i = -radius; i <= radius; ++i) {
        const float x = static_cast<float>(i) / pixels_per_degree;
        kernel.push_back(std::exp(-pi * pi * x * x / b));
    }
    return kernel;
}

Plane filter_sensitivity(const Plane& source, const Sensitivity& s, float pixels_per_degree) {
    const int radius = sensitivity_radius(pixels_per_degree);
    const float weights[2] = {s.a1 * std::sqrt(pi / s.b1), s.a2 * std::sqrt(pi / s.b2)};
    Kernel kernels[2] = {sensitivity_kernel(s.b1, radius, pixels_per_degree),
                         sensitivity_kernel(s.b2, radius, pixels_per_degree)};
    // The two-dimensional kernel, a sum of separable ones, is normalized as a whole.
    float total = 0;
    for (int i = 0; i < 2; ++i) total += weights[i] * sum(kernels[i]) * sum(kernels[i]);
    Plane result(source.width, source.height);
    for (int i = 0; i < 2; ++i) {
        if (weights[i] == 0.0f) continue;
        Kernel vertical = kernels[i];
        scale(vertical, weights[i] / total);
        const Plane part = filter(source, kernels[i], vertical);
        for (std::size_t p = 0; p < part.values.size(); ++p) result.values[p] += part.values[p];
    }
    return result;
}

// --- Features
// ---------------------------------------------------------------------------------------------------------

constexpr float feature_width_degrees = 0.082f;

struct FeatureKernels {
    Kernel blur;   ///< Gaussian, sums to 1.
    Kernel edge;   ///< First derivative; positive weights sum to 1, negative to -1.
    Kernel point;  ///< Second derivative, normalized likewise.
};

void normalize_signs(Kernel& kernel) {
    double positive = 0, negative = 0;
    for (const float value : kernel) (value > 0 ? positive : negative) += value;
    for (float& value : kernel) value = static_cast<float>(value > 0 ? value / positive : value / -negative);
}

FeatureKernels make_feature_kernels(float pixels_per_degree) {
    const float sigma = 0.5f * feature_width_degrees * pixels_per_degree;
    const int radius = static_cast<int>(std::ceil(3.0f * sigma));
    FeatureKernels kernels;
    for (int i = -radius; i <= radius; ++i) {
        const auto x = static_cast<float>(i);
        const float gaussian = std::exp(-x * x / (2.0f * sigma * sigma));
        kernels.blur.push_back(gaussian);
        kernels.edge.push_back(-x * gaussian);
        kernels.point.push_back((x * x / (sigma * sigma) - 1.0f) * gaussian);
    }
    scale(kernels.blur, 1.0f / sum(kernels.blur));
    normalize_signs(kernels.edge);
    normalize_signs(kernels.point);
    return kernels;
}

Plane magnitude(const Plane& luminance, const Kernel& derivative, const Kernel& blur) {
    Plane result = filter(luminance, derivative, blur);
    const Plane vertical = filter(luminance, blur, derivative);
    for (std::size_t p = 0; p < result.values.size(); ++p) {
        result.values[p] = std::hypot(result.values[p], vertical.values[p]);
    }
    return result;
}

// --- The two pipelines --------------------------------------------------------------------------------------------

struct Perceived {
    std::vector<Triple> colors;  ///< Hunt-adjusted Lab after the eye's blur.
    Plane edges, points;
};

float clamp_to_unit(float value) { return value > 0.0f ? std::min(value, 1.0f) : 0.0f; }

Perceived perceive(const Image& image, float pixels_per_degree) {
    Plane planes[3] = {{image.width, image.height}, {image.width, image.height}, {image.width, image.height}};
    Plane luminance(image.width, image.height);
    for (std::size_t p = 0; p < image.texel_count(); ++p) {
        const float* texel = &image.pixels[p * image.channels];
        const Triple opponent =
            opponent_from_rgb({clamp_to_unit(texel[0]), clamp_to_unit(texel[1]), clamp_to_unit(texel[2])});
        planes[0].values[p] = opponent.x;
        planes[1].values[p] = opponent.y;
        planes[2].values[p] = opponent.z;
        luminance.values[p] = (opponent.x + 16.0f) / 116.0f;
    }
    planes[0] = filter_sensitivity(planes[0], achromatic, pixels_per_degree);
    planes[1] = filter_sensitivity(planes[1], red_green, pixels_per_degree);
    planes[2] = filter_sensitivity(planes[2], blue_yellow, pixels_per_degree);

    const FeatureKernels kernels = make_feature_kernels(pixels_per_degree);
    Perceived result{{}, magnitude(luminance, kernels.edge, kernels.blur),
                     magnitude(luminance, kernels.point, kernels.blur)};
    result.colors.resize(image.texel_count());
    for (std::size_t p = 0; p < result.colors.size(); ++p) {
        const Triple rgb = rgb_from_opponent({planes[0].values[p], planes[1].values[p], planes[2].values[p]});
        result.colors[p] = hunt_lab_from_rgb({clamp_to_unit(rgb.x), clamp_to_unit(rgb.y), clamp_to_unit(rgb.z)});
    }
    return result;
}

constexpr float color_exponent = 0.7f;
constexpr float feature_exponent = 0.5f;

// Small and medium color differences, up to 0.4 of the largest possible one, take [0, 0.95]; the rest is compressed.
float redistribute_color_difference(float difference, float largest) {
    constexpr float share_of_largest = 0.4f, target = 0.95f;
    const float knee = share_of_largest * largest;
    if (difference < knee) return difference * target / knee;
    return target + (difference - knee) / (largest - knee) * (1.0f - target);
}

}  // namespace

Expected<FlipResult> compute_flip(const Image& reference, const Image& test, float pixels_per_degree) {
    const auto wrong = [](std::string reason) {
        return fail(ErrorCode::invalid_argument, "compute FLIP", "", std::move(reason),
                    "Pass two color pictures of one size.");
    };
    if (reference.width != test.width || reference.height != test.height || reference.texel_count() == 0) {
        return wrong(fmt::format("the pictures have {} x {} and {} x {} pixels", reference.width, reference.height,
                                 test.width, test.height));
    }
    if (reference.channels < 3 || test.channels < 3) return wrong("a picture has fewer than 3 channels");
    if (!(pixels_per_degree >= 1.0f && pixels_per_degree <= 1000.0f)) {
        return wrong(fmt::format("{} pixels per degree are outside [1, 1000]", pixels_per_degree));
    }

    // The most different colors of sRGB by this distance are green and blue.
    const float largest =
        std::pow(hyab(hunt_lab_from_rgb({0, 1, 0}), hunt_lab_from_rgb({0, 0, 1})), color_exponent);
    const Perceived a = perceive(reference, pixels_per_degree);
    const Perceived b = perceive(test, pixels_per_degree);
    FlipResult result{{reference.width, reference.height, 1, {}}, 0.0};
    result.map.pixels.resize(reference.texel_count());
    for (std::size_t p = 0; p < result.map.pixels.size(); ++p) {
        const float color =
            redistribute_color_difference(std::pow(hyab(a.colors[p], b.colors[p]), color_exponent), largest);
        const float edge = std::abs(a.edges.values[p] - b.edges.values[p]);
        const float point = std::abs(a.points.values[p] - b.points.values[p]);
        const float feature =
            std::min(std::pow(std::max(edge, point) / std::numbers::sqrt2_v<float>, feature_exponent), 1.0f);
        const float flip = color > 0.0f ? std::pow(color, 1.0f - feature) : 0.0f;
        result.map.pixels[p] = std::min(flip, 1.0f);
        result.mean += static_cast<double>(result.map.pixels[p]);
    }
    result.mean /= static_cast<double>(result.map.pixels.size());
    return result;
}

Image colored_flip_map(const Image& map) {
    // Lightness rises evenly from 0 to 96 along these colors (given in sRGB bytes).
    static constexpr float stops[7][3] = {{0, 0, 4},     {40, 11, 84},   {101, 21, 110}, {159, 42, 99},
                                          {212, 72, 66}, {245, 125, 21}, {252, 255, 164}};
    Image result{map.width, map.height, 3, {}};
    result.pixels.resize(map.texel_count() * 3);
    for (std::size_t p = 0; p < map.texel_count(); ++p) {
        const float position = clamp_to_unit(map.pixels[p * map.channels]) * 6.0f;
        const auto stop = std::min(static_cast<std::size_t>(position), std::size_t{5});
        const float fraction = position - static_cast<float>(stop);
        for (std::size_t c = 0; c < 3; ++c) {
            const float encoded = (stops[stop][c] + (stops[stop + 1][c] - stops[stop][c]) * fraction) / 255.0f;
            result.pixels[p * 3 + c] =
                encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
        }
    }
    return result;
}

}  // namespace nacre::measure
