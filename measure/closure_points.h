// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "materials/closures/library.h"

/// @file
/// Where closures are measured and tested: slabs and directions with the edges over-represented, and the integral of a
/// closure. The same points in every run and on all machines.

namespace nacre::measure {

using materials::closures::Library;

/// Numbers in [0, 1) from a counter (SplitMix64): the same in every run.
class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed) {}
    double operator()() {
        std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
        return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
    }
    double operator()(double low, double high) { return low + (high - low) * (*this)(); }
    std::uint32_t below(std::uint32_t count) { return static_cast<std::uint32_t>((*this)() * count); }

  private:
    std::uint64_t state_;
};

inline glm::dvec3 direction(double cosine, double phi) {
    const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0));
    return {sine * std::cos(phi), sine * std::sin(phi), cosine};
}

/// Cosines to the normal of the views that furnaces are seen from; the first is 1e-7 rad above the surface.
inline const std::vector<double>& view_cosines() {
    static const std::vector<double> cosines = {1e-7, 1e-5, 1e-3, 0.01, 0.03, 0.1, 0.2, 0.35, 0.5, 0.75, 0.95, 1.0};
    return cosines;
}

inline const std::vector<double>& roughnesses() {
    static const std::vector<double> values = {0.0, 0.012, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0};
    return values;
}

/// What a closure sends towards its view under white light from everywhere, also from below: lobe by lobe, each by its
/// own sampler over a stratified grid. `strata` squared samples per lobe; 64 are good for 1e-4.
inline glm::dvec3 integrate(Library& library, const Library::Closure& closure, int strata) {
    Library::Closure none = closure;
    none.diffuse = none.fuzz = none.thin = none.subsurface = none.transmission = glm::dvec3(0.0);
    none.specular = library.scaled_lobe(closure.specular, glm::dvec3(0.0));
    none.second = library.scaled_lobe(closure.second, glm::dvec3(0.0));
    none.diffuse_probability = none.fuzz_probability = none.specular_probability = none.second_probability = 0.0;
    none.transmission_probability = 0.0;
    std::array<Library::Closure, 5> lobes = {none, none, none, none, none};
    lobes[0].diffuse = closure.diffuse;
    lobes[0].thin = closure.thin;
    lobes[0].subsurface = closure.subsurface;
    lobes[0].diffuse_probability = 1.0;
    lobes[1].specular = closure.specular;
    lobes[1].specular_probability = 1.0;
    lobes[2].fuzz = closure.fuzz;
    lobes[2].fuzz_probability = 1.0;
    lobes[3].second = closure.second;
    lobes[3].second_probability = 1.0;
    lobes[4].transmission = closure.transmission;
    lobes[4].transmission_probability = 1.0;
    const bool present[] = {true, true, (closure.features & materials::slab_fuzz) != 0,
                            (closure.features & materials::slab_second_lobe) != 0,
                            (closure.features & materials::slab_medium) != 0};
    glm::dvec3 sum(0.0);
    for (std::size_t lobe = 0; lobe < lobes.size(); ++lobe) {
        if (!present[lobe]) continue;
        for (int i = 0; i < strata; ++i) {
            // Strata crowd at both ends of both axes, where the lobes are steep.
            const auto crowd = [](double s) { return s * s * s * (s * (6.0 * s - 15.0) + 10.0); };
            const auto density = [](double s) { return 30.0 * s * s * (s - 1.0) * (s - 1.0); };
            const double s = (i + 0.5) / strata;
            for (int j = 0; j < strata; ++j) {
                const double t = (j + 0.5) / strata;
                const auto sample = library.sample_closure(lobes[lobe], {0.5, crowd(s), crowd(t)});
                sum += sample.weight * (density(s) * density(t) / (static_cast<double>(strata) * strata));
            }
        }
    }
    return sum;
}

/// A slab with random features and values; a third of the values lie at the ends of their ranges.
inline materials::Slab random_slab(Random& random, std::uint32_t allowed_features) {
    const auto unit = [&] {
        const double kind = random();
        if (kind < 0.15) return 0.0f;
        if (kind < 0.3) return 1.0f;
        if (kind < 0.4) return static_cast<float>(std::pow(10.0, random(-7.0, -1.0)));
        return static_cast<float>(random());
    };
    const auto color = [&] {
        const float all = unit();
        return random() < 0.5 ? glm::vec3(all) : glm::vec3(unit(), unit(), unit());
    };
    materials::Slab slab;
    for (const materials::SlabFeature& feature : materials::slab_features())
        if ((allowed_features & feature.bit) != 0 && random() < 0.5) slab.features |= feature.bit;
    slab.f0 = color();
    slab.roughness = unit();
    slab.albedo = color();
    slab.anisotropy = unit() * (random() < 0.5 ? -1.0f : 1.0f);
    slab.f90 = color();
    slab.specular_weight = unit();
    slab.f82 = color();
    slab.second_roughness = unit();
    slab.second_weight = unit();
    slab.fuzz_amount = unit();
    slab.fuzz_roughness = unit();
    slab.fuzz_color = color();
    slab.film_thickness = unit() * 1e-6f;
    slab.film_ior = 1.0f + unit();
    const auto decades = [&](double low, double high) {
        return static_cast<float>(std::pow(10.0, std::floor(random(low, high + 1.0))));
    };
    slab.mean_free_path = random() < 0.1 ? glm::vec3(0.0f) : glm::vec3(decades(-9, 9), decades(-9, 9), decades(-9, 9));
    slab.phase_anisotropy = 0.99f * unit() * (random() < 0.5 ? -1.0f : 1.0f);
    slab.thickness = random() < 0.1 ? 0.0f : decades(-9, 9);
    slab.edge_coverage = unit();
    slab.glint_density = static_cast<float>(std::pow(10.0, random(-2.0, 8.0)));
    slab.glint_position = {static_cast<float>(random(-10.0, 10.0)), static_cast<float>(random(-10.0, 10.0))};
    const auto pixel = static_cast<float>(std::pow(10.0, random(-5.0, 1.0)));
    slab.glint_dx = {pixel, 0.3f * pixel};
    slab.glint_dy = {-0.2f * pixel, pixel};
    return slab;
}

/// A direction above the surface; half of them lie along it, down to 1e-7 rad.
inline glm::dvec3 random_direction(Random& random) {
    const double cosine = random() < 0.5 ? random() : std::pow(10.0, random(-7.0, 0.0));
    return direction(cosine, 2.0 * std::numbers::pi * random());
}

/// A light: anywhere, near the mirrored view, or near the view.
inline glm::dvec3 random_light(Random& random, const glm::dvec3& view) {
    const double kind = random();
    if (kind < 0.4) return random_direction(random);
    const double spread = std::pow(10.0, random(-6.0, 0.0));
    const glm::dvec3 center = kind < 0.8 ? glm::dvec3(-view.x, -view.y, view.z) : view;
    glm::dvec3 light = center + spread * glm::dvec3(random(-1.0, 1.0), random(-1.0, 1.0), random(-1.0, 1.0));
    light.z = std::max(std::abs(light.z), 1e-7);
    return glm::normalize(light);
}

}  // namespace nacre::measure
