// SPDX-License-Identifier: Apache-2.0
#include "materials/preview.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "materials/evaluation.h"

namespace nacre::materials {
namespace {

using closures::Library;

constexpr int strata = 6;  // squared: samples of each closure and pixel
constexpr double ball_diameter = 0.1;

double smooth(double edge, double width, double x) {
    const double t = std::clamp((x - edge) / width + 0.5, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// Tangent along circles of latitude.
struct Frame {
    glm::dvec3 tangent, bitangent, normal;
    glm::dvec3 to_local(const glm::dvec3& v) const { return {dot(v, tangent), dot(v, bitangent), dot(v, normal)}; }
    glm::dvec3 to_world(const glm::dvec3& v) const { return v.x * tangent + v.y * bitangent + v.z * normal; }
};

Frame frame_at(const glm::dvec3& normal) {
    const glm::dvec3 across = glm::cross(glm::dvec3(0, 1, 0), normal);
    const double length = glm::length(across);
    const glm::dvec3 tangent = length > 1e-6 ? across / length : glm::dvec3(1, 0, 0);
    return {tangent, glm::cross(normal, tangent), normal};
}

glm::dvec3 turned(const glm::dvec3& v, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return {c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

// A low-discrepancy number for each pixel, so that neighbors err differently.
double shift_of(std::uint32_t x, std::uint32_t y) { return std::fmod(x * 0.7548776662466927 + y * 0.5698402909980532, 1.0); }

glm::dvec3 radiance(const FlattenedTree& tree, const glm::dvec3& normal, double footprint, double shift) {
    Library library;
    const Frame frame = frame_at(normal);
    const glm::dvec3 view = frame.to_local({0, 0, 1});
    const ShadedTree shaded = shade(tree, view, footprint);
    glm::dvec3 sum(0.0);
    for (const ShadedClosure& c : shaded.closures) {
        glm::dvec3 mean(0.0);
        for (int i = 0; i < strata * strata; ++i) {
            const glm::dvec3 random(std::fmod((i + 0.5) * 0.6180339887498949 + shift, 1.0), std::fmod((i % strata + 0.5) / strata + shift, 1.0),
                                    std::fmod((i / strata + 0.5) / strata + 7.0 * shift, 1.0));
            const Library::ClosureSample sample = library.sample_closure(c.closure, random);
            if (sample.pdf <= 0.0 || sample.direction.z <= 0.0) continue;
            mean += sample.weight * library.top_transmittance(c.path, sample.direction.z) *
                    preview_sky(frame.to_world(turned(sample.direction, c.rotation)));
        }
        sum += c.path.weight * c.coverage * mean / static_cast<double>(strata * strata);
        if ((c.slab.features & slab_emission) != 0) sum += c.path.weight * c.coverage * c.slab.emission;
    }
    return sum + library.matter_throughput(shaded.whole) * preview_sky({0, 0, -1});
}

}  // namespace

glm::dvec3 preview_sky(const glm::dvec3& direction) {
    const double up = direction.y;
    glm::dvec3 sky = up < 0.0 ? glm::mix(glm::dvec3(0.45, 0.42, 0.40), glm::dvec3(0.10, 0.09, 0.08), smooth(0.1, 0.4, -up))
                              : glm::mix(glm::dvec3(0.75, 0.78, 0.82), glm::dvec3(0.25, 0.38, 0.65), smooth(0.4, 1.0, up));
    // A soft box from the upper left.
    const glm::dvec3 center = glm::normalize(glm::dvec3(-0.55, 0.65, 0.6));
    const glm::dvec3 right = glm::normalize(glm::cross(glm::dvec3(0, 1, 0), center)), top = glm::cross(center, right);
    const double z = glm::dot(direction, center);
    if (z > 0.0) {
        const double x = std::abs(glm::dot(direction, right) / z), y = std::abs(glm::dot(direction, top) / z);
        sky += 12.0 * (1.0 - smooth(0.22, 0.04, x)) * (1.0 - smooth(0.3, 0.04, y));
    }
    return sky;
}

Image preview_ball(const FlattenedTree& tree, std::uint32_t size) {
    Image image{.width = size, .height = size, .channels = 3};
    image.pixels.resize(std::size_t{3} * size * size);
    for (std::uint32_t y = 0; y < size; ++y) {
        for (std::uint32_t x = 0; x < size; ++x) {
            const double u = ((x + 0.5) / size * 2.0 - 1.0) * 1.04, v = (1.0 - (y + 0.5) / size * 2.0) * 1.04;
            const double squared = u * u + v * v;
            glm::dvec3 color(0.18);
            if (squared < 1.0) {
                const glm::dvec3 normal(u, v, std::sqrt(1.0 - squared));
                // A pixel covers more of the surface where that turns away.
                color = radiance(tree, normal, ball_diameter / size / std::max(normal.z, 0.05), shift_of(x, y));
            }
            for (int channel = 0; channel < 3; ++channel)
                image.texel(x, y)[channel] = static_cast<float>(std::min(color[channel] / (1.0 + color[channel] * 0.25), 1.0));
        }
    }
    return image;
}

}  // namespace nacre::materials
