// SPDX-License-Identifier: Apache-2.0
// The medium of a slab: conversions there and back, and its way from opaque to empty without a step.
#include <gtest/gtest.h>

#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

TEST(Medium, AlbedoInversionGoesThereAndBack) {
    Library library;
    for (int i = 0; i <= 1000; ++i) {
        const double albedo = i / 1000.0, similarity = library.medium_similarity(albedo, 1.0 - albedo);
        EXPECT_NEAR(library.medium_albedo(similarity), albedo, 2e-5);
        EXPECT_NEAR(1.0 - library.medium_dissimilarity(albedo), similarity, 1e-6);
        for (const double g : {-0.9, 0.0, 0.9}) {
            const double single = library.scattering_albedo(1.0 - similarity, g);
            EXPECT_GE(single, 0.0);
            EXPECT_LE(single, 1.0);
            EXPECT_NEAR(std::sqrt((1.0 - single) / (1.0 - single * g)), similarity, 1e-9);
        }
    }
    EXPECT_EQ(library.medium_similarity(1.0, 1.0 - 1.0), 0.0) << "the fit passes 0 by 5e-6";
}

TEST(Medium, MeanFreePathAndTransmittanceGoThereAndBack) {
    Library library;
    for (const double path : {1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e9}) {
        for (const double depth : {1e-12, 1e-6, 1e-3, 1.0, 10.0, 60.0}) {
            const double transmittance = library.medium_transmittance(path, path * depth);
            EXPECT_NEAR(transmittance, std::exp(-depth), 1e-12);
            EXPECT_NEAR(library.transmittance_to_mean_free_path(transmittance, path * depth) / path, 1.0,
                        depth < 1e-9 ? 1e-3 : 1e-6);
        }
    }
    EXPECT_EQ(library.medium_transmittance(0.0, 1.0), 0.0);
    EXPECT_EQ(library.medium_transmittance(1.0, 0.0), 1.0);
    EXPECT_EQ(library.medium_transmittance(0.0, 0.0), 1.0) << "nothing is there";
    EXPECT_NEAR(library.medium_transmittance(INFINITY, 1.0), 1.0, 1e-11);
    EXPECT_NEAR(library.medium_transmittance(1.0, INFINITY), 0.0, 0.0);
    EXPECT_TRUE(std::isfinite(library.transmittance_to_mean_free_path(0.0, 1.0)));
    EXPECT_EQ(library.transmittance_to_mean_free_path(1.0, 1.0), 1e12);
}

/// Everything that a slab sends towards a view and lets through, along a line of slabs.
template <typename Change>
double largest_step(Change&& change) {
    Library library;
    double largest = 0.0;
    for (const double cosine : {0.05, 0.4, 1.0}) {
        glm::dvec3 last[5];
        for (int i = 0; i <= 2000; ++i) {
            Slab slab{.features = slab_medium, .f0 = glm::vec3(0.04f), .albedo = {0.9f, 0.5f, 0.1f}};
            double footprint = 1e-3;
            change(slab, footprint, i / 2000.0);
            const auto closure = library.prepare_closure(Library::slab_of(slab), direction(cosine, 0.0), footprint);
            const glm::dvec3 now[5] = {closure.diffuse, closure.thin, closure.subsurface, closure.transmission,
                                       closure.straight};
            for (int k = 0; k < 5; ++k) {
                if (i > 0)
                    for (int channel = 0; channel < 3; ++channel)
                        largest = std::max(largest, std::abs(now[k][channel] - last[k][channel]));
                last[k] = now[k];
            }
        }
    }
    return largest;
}

TEST(Medium, RegimesMeetWithoutAStep) {
    // 24 decades in 2000 steps are 2.8 % each: nothing that depends on their logarithm smoothly moves by more than
    // that.
    EXPECT_LT(largest_step([](Slab& slab, double&, double t) {
                  slab.mean_free_path = glm::vec3(static_cast<float>(std::pow(10.0, -12.0 + 24.0 * t)));
              }),
              0.03);
    EXPECT_LT(largest_step([](Slab& slab, double&, double t) {
                  slab.mean_free_path = glm::vec3(1e-3f);
                  slab.thickness = static_cast<float>(std::pow(10.0, -15.0 + 24.0 * t));
              }),
              0.03);
    EXPECT_LT(largest_step([](Slab& slab, double& footprint, double t) {
                  slab.mean_free_path = glm::vec3(1e-3f);
                  slab.thickness = 1.0f;
                  footprint = std::pow(10.0, -12.0 + 24.0 * t);
              }),
              0.03);
}

TEST(Medium, OpaqueIsTheSlabWithoutAMedium) {
    Library library;
    Random random(9);
    for (int i = 0; i < 1000; ++i) {
        Slab plain = random_slab(random, 0);
        Slab deep = plain;
        deep.features = slab_medium;
        deep.mean_free_path = glm::vec3(1e-9f);
        deep.thickness = 1.0f;
        const glm::dvec3 view = random_direction(random), light = random_light(random, view);
        const auto a = library.evaluate_closure(library.prepare_closure(Library::slab_of(plain), view, 1e-2), light);
        const auto b = library.evaluate_closure(library.prepare_closure(Library::slab_of(deep), view, 1e-2), light);
        for (int channel = 0; channel < 3; ++channel)
            ASSERT_NEAR(a.diffuse[channel], b.diffuse[channel] + b.subsurface[channel],
                        2e-3 * a.diffuse[channel] + 1e-5);
    }
}

TEST(Medium, WithoutScatteringOnlyBeerAndLambertAreLeft) {
    Library library;
    Slab slab{.features = slab_medium,
              .f0 = glm::vec3(0.0f),
              .albedo = glm::vec3(0.0f),
              .mean_free_path = {1e-3f, 2e-3f, 1e9f}};
    for (const double cosine : {0.1, 0.5, 1.0}) {
        const auto closure = library.prepare_closure(Library::slab_of(slab), direction(cosine, 0.0), 1e-3);
        const glm::dvec3 expected(std::exp(-1.0 / cosine), std::exp(-0.5 / cosine), 1.0);
        for (int channel = 0; channel < 3; ++channel) {
            EXPECT_NEAR(library.closure_throughput(closure)[channel], expected[channel], 1e-6);
            EXPECT_NEAR(library.closure_transmittance(closure, cosine)[channel], expected[channel], 1e-6);
        }
        const auto albedo = library.closure_albedo(closure);
        EXPECT_NEAR(glm::length(albedo.diffuse + albedo.transmission), 0.0, 1e-5) << "the inversion is good for 2e-5";
    }
}

TEST(Medium, FarAwayASolidIsOpaqueAndNearItBleeds) {
    Library library;
    Slab slab{
        .features = slab_medium, .f0 = glm::vec3(0.04f), .albedo = glm::vec3(0.5f), .mean_free_path = glm::vec3(1e-3f)};
    slab.thickness = INFINITY;
    const auto far_away = library.prepare_closure(Library::slab_of(slab), direction(0.7, 0.0), 1.0);
    const auto near_by = library.prepare_closure(Library::slab_of(slab), direction(0.7, 0.0), 1e-6);
    EXPECT_LT(far_away.subsurface.x, 1e-3 * far_away.diffuse.x);
    EXPECT_LT(near_by.diffuse.x, 1e-2 * near_by.subsurface.x);
    EXPECT_NEAR(far_away.diffuse.x + far_away.subsurface.x, near_by.diffuse.x + near_by.subsurface.x, 1e-9);
}

}  // namespace
}  // namespace nacre::materials::test
