// SPDX-License-Identifier: Apache-2.0
#include "materials/preview.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <thread>
#include <vector>

#include "materials/evaluation.h"
#include "materials/specular_table.h"
#include "materials/turned.h"

namespace nacre::materials {
namespace {

using closures::Library;

constexpr int box_strata = 5;  // squared: samples of the soft box
constexpr double ball_diameter = 0.1;
constexpr double ball_margin = 1.04;  // half the picture's side, by the ball's radius

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

// A number in [0, 1) for each pixel and dimension.
double number_of(std::uint32_t x, std::uint32_t y, std::uint32_t dimension) {
    std::uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ dimension * 0xc2b2ae3du;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return (h ^ h >> 15) * 0x1p-32;
}

// The soft box: a rectangle on the plane one unit away, from the upper left.
struct SoftBox {
    glm::dvec3 center = glm::normalize(glm::dvec3(-0.55, 0.65, 0.6));
    glm::dvec3 right = glm::normalize(glm::cross(glm::dvec3(0, 1, 0), center)), top = glm::cross(center, right);
    static constexpr double half_width = 0.24, half_height = 0.32, edge = 0.04;

    double radiance(const glm::dvec3& direction) const {
        const double z = glm::dot(direction, center);
        if (z <= 0.0) return 0.0;
        const double x = std::abs(glm::dot(direction, right) / z), y = std::abs(glm::dot(direction, top) / z);
        return 12.0 * (1.0 - smooth(half_width - edge / 2, edge, x)) * (1.0 - smooth(half_height - edge / 2, edge, y));
    }
    glm::dvec3 direction(double u, double v) const {
        return glm::normalize(center + (2.0 * u - 1.0) * half_width * right + (2.0 * v - 1.0) * half_height * top);
    }
    // Per solid angle, of directions made of even u and v.
    double density(const glm::dvec3& direction) const {
        const double z = glm::dot(direction, center);
        if (z <= 0.0) return 0.0;
        const double x = std::abs(glm::dot(direction, right) / z), y = std::abs(glm::dot(direction, top) / z);
        return x <= half_width && y <= half_height ? 1.0 / (4.0 * half_width * half_height * z * z * z) : 0.0;
    }
};

const SoftBox soft_box;

const auto tints = tints_of(default_specular_tables());

glm::dvec3 ambient_sky(const glm::dvec3& direction) {
    const double up = direction.y;
    return up < 0.0 ? glm::mix(glm::dvec3(0.45, 0.42, 0.40), glm::dvec3(0.10, 0.09, 0.08), smooth(0.1, 0.4, -up))
                    : glm::mix(glm::dvec3(0.75, 0.78, 0.82), glm::dvec3(0.25, 0.38, 0.65), smooth(0.4, 1.0, up));
}

// What a closure sends to the view. The sky is sampled by the closure, the soft box by both, weighed by their densities
// (Veach 1997, the balance heuristic).
glm::dvec3 radiance_of(const ShadedClosure& c, const Frame& frame, std::uint32_t x, std::uint32_t y, int strata) {
    Library library;
    library.tints = tints;
    const double count = strata * strata;
    constexpr double box_count = box_strata * box_strata;
    glm::dvec3 sum(0.0);
    for (int i = 0; i < strata * strata; ++i) {
        const auto stratified = [&](double at, std::uint32_t dimension) {
            return std::fmod(at + number_of(x, y, dimension), 1.0);
        };
        const glm::dvec3 random(stratified((i + 0.5) * 0.6180339887498949, 0),
                                stratified((i % strata + 0.5) / strata, 1), stratified((i / strata + 0.5) / strata, 2));
        const Library::ClosureSample sample = library.sample_closure(c.closure, random);
        if (sample.pdf <= 0.0 || sample.direction.z <= 0.0) continue;
        const glm::dvec3 direction = frame.to_world(turned(sample.direction, -c.rotation));
        const double own = count * sample.pdf;
        const double share = sample.is_mirror ? 1.0 : own / (own + box_count * soft_box.density(direction));
        sum += sample.weight * library.top_transmittance(c.path, sample.direction.z) *
               (ambient_sky(direction) + share * soft_box.radiance(direction)) / count;
    }
    for (int i = 0; i < box_strata * box_strata; ++i) {
        const glm::dvec3 direction = soft_box.direction((i % box_strata + number_of(x, y, 3 + i)) / box_strata,
                                                        (i / box_strata + number_of(x, y, 40 + i)) / box_strata);
        const glm::dvec3 light = turned(frame.to_local(direction), c.rotation);
        if (light.z <= 0.0) continue;
        const Library::ClosureValue value = library.evaluate_closure(c.closure, light);
        sum += (value.specular + value.diffuse + value.subsurface) * library.top_transmittance(c.path, light.z) *
               soft_box.radiance(direction) /
               (box_count * soft_box.density(direction) + count * library.closure_pdf(c.closure, light));
    }
    return sum;
}

glm::dvec3 radiance(const FlattenedTree& tree, const glm::dvec3& normal, double footprint, std::uint32_t x,
                    std::uint32_t y, int strata) {
    Library library;
    library.tints = tints;
    const Frame frame = frame_at(normal);
    const ShadedTree shaded = shade(tree, frame.to_local({0, 0, 1}), footprint, library);
    glm::dvec3 sum(0.0);
    for (const ShadedClosure& c : shaded.closures) {
        glm::dvec3 sent = radiance_of(c, frame, x, y, strata);
        if ((c.slab.features & slab_emission) != 0) sent += c.slab.emission;
        sum += c.path.weight * c.coverage * sent;
    }
    return sum + library.matter_throughput(shaded.whole) * preview_sky({0, 0, -1});
}

// Calls `work` with 0 to count - 1, on all threads.
template <typename Work>
void for_each_parallel(std::uint32_t count, const Work& work) {
    std::atomic<std::uint32_t> next{0};
    const auto run = [&] {
        for (std::uint32_t i = next++; i < count; i = next++) work(i);
    };
    std::vector<std::jthread> threads;
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i) threads.emplace_back(run);
    run();
}

// A picture of a ball whose points, by normal and place, have the radiance that `radiance` says.
template <typename Radiance>
Image ball_of(std::uint32_t size, const Radiance& radiance) {
    Image image{.width = size, .height = size, .channels = 3};
    image.pixels.resize(std::size_t{3} * size * size);
    for_each_parallel(size, [&](std::uint32_t y) {
        for (std::uint32_t x = 0; x < size; ++x) {
            const double u = ((x + 0.5) / size * 2.0 - 1.0) * ball_margin,
                         v = (1.0 - (y + 0.5) / size * 2.0) * ball_margin;
            const double squared = u * u + v * v;
            glm::dvec3 color(0.18);
            if (squared < 1.0) color = radiance(glm::dvec3(u, v, std::sqrt(1.0 - squared)), x, y);
            for (int channel = 0; channel < 3; ++channel)
                image.texel(x, y)[channel] =
                    static_cast<float>(std::min(color[channel] / (1.0 + color[channel] * 0.25), 1.0));
        }
    });
    return image;
}

}  // namespace

glm::dvec3 preview_sky(const glm::dvec3& direction) { return ambient_sky(direction) + soft_box.radiance(direction); }

Image preview_ball(const FlattenedTree& tree, std::uint32_t size, int strata) {
    return ball_of(size, [&](const glm::dvec3& normal, std::uint32_t x, std::uint32_t y) {
        // A pixel covers more of the surface where that turns away.
        return radiance(tree, normal, ball_diameter / size / std::max(normal.z, 0.05), x, y, strata);
    });
}

Image walked_ball(const RandomWalk& walk, std::uint32_t size, std::uint32_t paths) {
    const auto walked = [&](const glm::dvec3& view, std::uint32_t count, std::uint64_t seed) {
        RandomWalk::Generator random(seed);
        std::vector<WalkExit> exits(count);
        for (WalkExit& path : exits) path = walk.walk(view, random);
        return exits;
    };
    const auto sent = [](const std::vector<WalkExit>& exits, const Frame& frame) {
        glm::dvec3 sum(0.0);
        for (const WalkExit& path : exits) {
            if (path.direction.z > 0.0)
                sum += path.weight * preview_sky(frame.to_world(path.direction));
            else if (path.direction.z < 0.0)
                sum += path.weight * preview_sky({0, 0, -1});
        }
        return sum / static_cast<double>(exits.size());
    };
    if (!walk.is_isotropic()) {
        return ball_of(size, [&](const glm::dvec3& normal, std::uint32_t x, std::uint32_t y) {
            const Frame frame = frame_at(normal);
            return sent(walked(frame.to_local({0, 0, 1}), std::max(paths / 16, 1u), std::uint64_t{y} * size + x),
                        frame);
        });
    }
    // Rings of equal angle between view and normal, half a pixel wide; the x axis points to the viewer.
    std::vector<std::vector<WalkExit>> rings(size);
    for_each_parallel(size, [&](std::uint32_t ring) {
        const double radius = (ring + 0.5) / size;
        rings[ring] = walked({radius, 0.0, std::sqrt(1.0 - radius * radius)}, std::max(paths, 1u), ring);
    });
    return ball_of(size, [&](const glm::dvec3& normal, std::uint32_t, std::uint32_t) {
        const double radius = std::hypot(normal.x, normal.y);
        Frame frame = frame_at(normal);
        if (radius > 1e-9) {
            frame.tangent = glm::normalize(glm::dvec3(0, 0, 1) - normal * normal.z);
            frame.bitangent = glm::cross(normal, frame.tangent);
        }
        return sent(rings[std::min(static_cast<std::uint32_t>(radius * size), size - 1)], frame);
    });
}

}  // namespace nacre::materials
