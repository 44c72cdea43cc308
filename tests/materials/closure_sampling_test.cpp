// SPDX-License-Identifier: Apache-2.0
// Samplers draw what their density says: chi-square tests, in double precision.
//
// NACRE_SAMPLES: samples per closure, in 80 x 160 bins; 4000000 is the full test. Without it the samples are fewer, in
// 40 x 80.
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

/// With more than a few samples it pays to look closely.
bool is_full_test() {
    static const bool is_full = std::getenv("NACRE_SAMPLES") != nullptr;
    return is_full;
}

long sample_count(long in_suite) {
    const char* text = std::getenv("NACRE_SAMPLES");
    return text ? std::max(std::atol(text), 1000l) : in_suite;
}

/// Upper tail of the chi-square distribution. Source: Wilson and Hilferty 1931, good for the tails of many degrees.
double chi_square_tail(double statistic, double degrees) {
    const double spread = 2.0 / (9.0 * degrees);
    const double z = (std::cbrt(statistic / degrees) - (1.0 - spread)) / std::sqrt(spread);
    return 0.5 * std::erfc(z / std::numbers::sqrt2);
}

/// Directions in bins around an axis: rings whose angles to it grow exponentially, so that narrow lobes around the
/// mirrored view get as many bins as wide ones.
struct Bins {
    int rings, sectors;
    glm::dvec3 axis, right, up;
    double smallest;  // angle of the first ring

    Bins(int rings_, const glm::dvec3& axis_, double smallest_)
        : rings(rings_), sectors(2 * rings_), axis(axis_), smallest(smallest_) {
        const glm::dvec3 helper = std::abs(axis.z) < 0.9 ? glm::dvec3(0.0, 0.0, 1.0) : glm::dvec3(1.0, 0.0, 0.0);
        right = glm::normalize(glm::cross(helper, axis));
        up = glm::cross(axis, right);
    }
    [[nodiscard]] double angle_at(double ring) const {
        return std::numbers::pi * std::expm1(ring / rings * std::log1p(1.0 / smallest)) * smallest;
    }
    [[nodiscard]] int bin_of(const glm::dvec3& w) const {
        // The angle from the chord: the cosine loses the digits of small angles.
        const double angle = 2.0 * std::asin(std::min(0.5 * glm::length(w - axis), 1.0));
        const double ring = std::log1p(angle / (std::numbers::pi * smallest)) / std::log1p(1.0 / smallest) * rings;
        double phi = std::atan2(glm::dot(w, up), glm::dot(w, right));
        if (phi < 0.0) phi += 2.0 * std::numbers::pi;
        return std::clamp(static_cast<int>(ring), 0, rings - 1) * sectors +
               std::clamp(static_cast<int>(phi / (2.0 * std::numbers::pi) * sectors), 0, sectors - 1);
    }
    [[nodiscard]] glm::dvec3 direction_at(double ring, double sector) const {
        const double angle = angle_at(ring), phi = 2.0 * std::numbers::pi * sector / sectors;
        return std::sin(angle) * (std::cos(phi) * right + std::sin(phi) * up) + std::cos(angle) * axis;
    }
    /// Integral of the density over a part of a bin, halving it until its midpoints agree.
    template <typename Density>
    double integral(const Density& density, double ring, double sector, double ring_size, double sector_size,
                    int depth) const {
        const auto sum = [&](int count) {
            double result = 0.0;
            for (int i = 0; i < count; ++i) {
                const double low = ring + ring_size * i / count, high = ring + ring_size * (i + 1) / count;
                // 1 - cos by half angles.
                const double area =
                    2.0 *
                    (std::pow(std::sin(0.5 * angle_at(high)), 2.0) - std::pow(std::sin(0.5 * angle_at(low)), 2.0)) *
                    2.0 * std::numbers::pi * sector_size / count / sectors;
                for (int j = 0; j < count; ++j)
                    result += area * density(direction_at(ring + ring_size * (i + 0.5) / count,
                                                          sector + sector_size * (j + 0.5) / count));
            }
            return result;
        };
        double lowest = 1.0, highest = -1.0;
        for (int corner = 0; corner < 5; ++corner) {
            const double z =
                corner == 4 ? direction_at(ring + 0.5 * ring_size, sector + 0.5 * sector_size).z
                            : direction_at(ring + ring_size * (corner & 1), sector + sector_size * (corner >> 1)).z;
            lowest = std::min(lowest, z);
            highest = std::max(highest, z);
        }
        // Densities end at the surface, and some lobes lie along it: midpoints may all miss that.
        const bool is_at_surface = lowest < 0.1 && highest > 0.0 && highest - lowest > 0.02 * highest;
        const double coarse = sum(2), fine = sum(4);
        const bool is_fine_enough =
            std::abs(coarse - fine) < (is_full_test() ? 2e-5 * fine + 1e-12 : 1e-3 * fine + 1e-9);
        if (depth == 0 || (!(is_at_surface && depth > (is_full_test() ? 7 : 6)) && is_fine_enough))
            return fine + (fine - coarse) / 3.0;
        double result = 0.0;
        for (int i = 0; i < 2; ++i)
            for (int j = 0; j < 2; ++j)
                result += integral(density, ring + 0.5 * i * ring_size, sector + 0.5 * j * sector_size, 0.5 * ring_size,
                                   0.5 * sector_size, depth - 1);
        return result;
    }
};

/// Smallest probability, over several sizes of bins, that honest samples look as unlike the density as these.
/// `scale`: what the density is wrong by.
double smallest_probability(Library& library, const Library::Closure& closure, double narrowest, long samples,
                            std::uint64_t seed, double scale = 1.0) {
    const glm::dvec3 view = closure.view;
    const Bins bins(is_full_test() ? 80 : 40, {-view.x, -view.y, view.z}, std::clamp(narrowest, 1e-5, 1.0));
    const auto density = [&](const glm::dvec3& w) { return scale * library.closure_pdf(closure, w); };
    std::vector<double> expected(bins.rings * bins.sectors), observed(expected.size());
    double total = 0.0;
    for (int ring = 0; ring < bins.rings; ++ring)
        for (int sector = 0; sector < bins.sectors; ++sector)
            total += expected[ring * bins.sectors + sector] =
                samples * std::max(bins.integral(density, ring, sector, 1.0, 1.0, is_full_test() ? 13 : 10), 0.0);
    Random random(seed);
    double kept = 0.0;
    for (long i = 0; i < samples; ++i) {
        const auto sample = library.sample_closure(closure, {random(), random(), random()});
        if (sample.pdf <= 0.0 || sample.is_mirror) continue;
        observed[bins.bin_of(sample.direction)] += 1.0;
        kept += 1.0;
    }
    double smallest = 1.0;
    for (const int merged : {1, 4, 8, bins.rings}) {
        double statistic = 0.0, degrees = 0.0, rest_expected = 0.0, rest_observed = 0.0;
        for (int ring = 0; ring < bins.rings; ring += merged) {
            for (int sector = 0; sector < bins.sectors; sector += merged) {
                double e = 0.0, o = 0.0;
                for (int i = 0; i < merged; ++i) {
                    for (int j = 0; j < merged; ++j) {
                        e += expected[(ring + i) * bins.sectors + sector + j];
                        o += observed[(ring + i) * bins.sectors + sector + j];
                    }
                }
                rest_expected += e;
                rest_observed += o;
                if (rest_expected < 5.0) continue;  // bins of few samples are pooled
                statistic += (rest_observed - rest_expected) * (rest_observed - rest_expected) / rest_expected;
                degrees += 1.0;
                rest_expected = rest_observed = 0.0;
            }
        }
        // What goes below the surface or into a mirror is one more bin; where nothing does, the total is no freedom.
        const double lost = samples - total, lost_observed = samples - kept;
        if (lost > 5.0) {
            statistic += (lost_observed - lost) * (lost_observed - lost) / lost;
        } else if (std::abs(lost_observed - lost) > 5.0 + 2e-4 * samples) {
            return 0.0;
        } else {
            degrees -= 1.0;
        }
        if (degrees > 0.0) smallest = std::min(smallest, chi_square_tail(statistic, degrees));
    }
    return smallest;
}

struct Case {
    std::string name;
    Slab slab;
};

std::vector<Case> cases() {
    std::vector<Case> result;
    for (const float roughness : {0.02f, 0.3f, 1.0f})
        result.push_back({"metal " + std::to_string(roughness),
                          {.f0 = glm::vec3(0.8f), .roughness = roughness, .albedo = glm::vec3(0.0f)}});
    for (const float anisotropy : {-0.6f, 0.9f})
        result.push_back({"stretched " + std::to_string(anisotropy),
                          {.features = slab_anisotropy,
                           .f0 = glm::vec3(0.8f),
                           .roughness = 0.5f,
                           .albedo = glm::vec3(0.0f),
                           .anisotropy = anisotropy}});
    result.push_back({"diffuse", {.f0 = glm::vec3(0.0f), .roughness = 0.7f}});
    result.push_back({"plastic", {.f0 = glm::vec3(0.04f), .roughness = 0.3f, .albedo = glm::vec3(0.5f)}});
    result.push_back({"mirror over diffuse", {.f0 = glm::vec3(0.3f), .roughness = 0.0f, .albedo = glm::vec3(0.5f)}});
    for (const float roughness : {0.1f, 0.7f})
        result.push_back({"fuzz " + std::to_string(roughness),
                          {.features = slab_fuzz,
                           .f0 = glm::vec3(0.0f),
                           .albedo = glm::vec3(0.0f),
                           .fuzz_amount = 1.0f,
                           .fuzz_roughness = roughness}});
    result.push_back({"thin",
                      {.features = slab_medium,
                       .f0 = glm::vec3(0.04f),
                       .roughness = 0.4f,
                       .albedo = {0.9f, 0.7f, 0.8f},
                       .mean_free_path = glm::vec3(1e-3f),
                       .thickness = 1e-3f}});
    result.push_back({"everything",
                      {.features = slab_anisotropy | slab_second_lobe | slab_fuzz,
                       .f0 = {0.5f, 0.2f, 0.1f},
                       .roughness = 0.3f,
                       .albedo = {0.1f, 0.6f, 0.2f},
                       .anisotropy = 0.5f,
                       .second_roughness = 0.7f,
                       .second_weight = 0.4f,
                       .fuzz_amount = 0.5f,
                       .fuzz_roughness = 0.3f}});
    return result;
}

/// Of the interface's lobe: along the surface it is as thin as the view is low.
double narrowest_angle(const Slab& slab, double cosine) {
    return std::max(slab.roughness * slab.roughness * std::max(cosine, 0.02), 1e-5);
}

constexpr double view_angles[] = {0.6, 0.01};

TEST(ClosureSampling, SamplesFollowTheDensity) {
    Library library;
    const long samples = sample_count(100000);
    const std::vector<Case> all = cases();
    // Significance 0.01 over all tests together (Sidak), four sizes of bins in each.
    const double limit = 1.0 - std::pow(0.99, 1.0 / (4.0 * static_cast<double>(all.size() * std::size(view_angles))));
    std::uint64_t seed = 100;
    for (const Case& test : all) {
        for (const double cosine : view_angles) {
            const auto closure = library.prepare_closure(Library::slab_of(test.slab), direction(cosine, 0.4), 1e-3);
            EXPECT_GT(smallest_probability(library, closure, narrowest_angle(test.slab, cosine), samples, ++seed),
                      limit)
                << test.name << " seen at cosine " << cosine;
        }
    }
}

TEST(ClosureSampling, ADensityThatIsWrongByOnePercentIsFound) {
    Library library;
    for (const Case& test : cases()) {
        if (test.name != "stretched 0.900000" && test.name != "diffuse" && test.name != "everything") continue;
        const auto closure = library.prepare_closure(Library::slab_of(test.slab), direction(0.25, 0.4), 1e-3);
        EXPECT_LT(
            smallest_probability(library, closure, narrowest_angle(test.slab, 0.25), sample_count(500000), 7, 1.01),
            1e-5)
            << test.name;
    }
}

}  // namespace
}  // namespace nacre::materials::test
