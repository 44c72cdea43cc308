// SPDX-License-Identifier: Apache-2.0
// Samplers draw what their density says: chi-square tests, in double precision.
//
// NACRE_SAMPLES: samples per closure, in 80 x 160 bins; 4000000 is the full test. Without it the samples are fewer, in
// 40 x 80.
#include <gtest/gtest.h>

#include <cstdlib>

#include "measure/chi_square.h"
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

/// Smallest probability that honest samples look as unlike the density as these. `scale`: what the density is wrong by.
double smallest_probability(Library& library, const Library::Closure& closure, double narrowest, long samples,
                            std::uint64_t seed, double scale = 1.0) {
    const glm::dvec3 view = closure.view;
    measure::ChiSquareTest test({.rings = is_full_test() ? 80 : 40,
                                 .axis = {-view.x, -view.y, view.z},
                                 .smallest_angle = std::clamp(narrowest, 1e-5, 1.0)},
                                [&](const glm::dvec3& w) { return library.closure_pdf(closure, w); });
    Random random(seed);
    for (long i = 0; i < samples; ++i) {
        const auto sample = library.sample_closure(closure, {random(), random(), random()});
        if (sample.pdf <= 0.0 || sample.is_mirror) test.add_lost();
        else test.add(sample.direction);
    }
    return test.smallest_probability(scale);
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

// Under a layer of index 1.5, in directions that are refracted: what is reflected totally is lost, never sent.
TEST(ClosureSampling, SamplesBelowALayerFollowTheDensity) {
    Library library;
    const long samples = sample_count(100000);
    const std::vector<Case> all = cases();
    const double limit = 1.0 - std::pow(0.99, 1.0 / (4.0 * static_cast<double>(all.size() * std::size(view_angles))));
    std::uint64_t seed = 200;
    for (const Case& test : all) {
        for (const double cosine : view_angles) {
            const glm::dvec3 view = direction(cosine, 0.4);
            const auto inside = library.prepare_closure(Library::slab_of(test.slab),
                                                        library.refracted_direction(view, 0.5), 1e-3);
            const auto closure = library.cover_closure(inside, {.spread_up = glm::dvec3(0.1),
                                                                .spread_down = glm::dvec3(0.12),
                                                                .mean = glm::dvec3(0.5),
                                                                .kept = glm::dvec3(1.0),
                                                                .bend = 0.0,
                                                                .ior_excess = 0.5,
                                                                .view_cosine = cosine});
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
