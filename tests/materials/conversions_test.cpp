// SPDX-License-Identifier: Apache-2.0
#include "materials/conversions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "materials/evaluation.h"

namespace nacre::materials {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

TEST(Conversions, IndexAndReflectance) {
    EXPECT_NEAR(ior_to_f0(1.5f), 0.04f, 1e-8f);
    EXPECT_NEAR(ior_to_f0(2.42f), std::pow(1.42 / 3.42, 2.0), 1e-7);
    EXPECT_EQ(ior_to_f0(1.0f), 0.0f);
    EXPECT_EQ(ior_to_f0(0.0f), 1.0f) << "infinity, as in glTF";
    EXPECT_EQ(ior_to_f0(infinity), 1.0f);
    for (float ior = 1.0f; ior < 150.0f; ior *= 1.3f) EXPECT_NEAR(f0_to_ior(ior_to_f0(ior)), ior, 1e-5f * ior * ior);
    for (float f0 = 0.0f; f0 <= 0.98f; f0 += 0.01f) EXPECT_NEAR(ior_to_f0(f0_to_ior(f0)), f0, 2e-6f);
    EXPECT_TRUE(std::isfinite(f0_to_ior(1.0f)));
}

TEST(Conversions, TransmittanceAndMeanFreePath) {
    const glm::vec3 path = transmittance_to_mean_free_path({std::exp(-1.0f), 0.0f, 1.0f}, 0.25f);
    EXPECT_NEAR(path.x, 0.25f, 1e-7f) << "one mean free path leaves 1 / e";
    EXPECT_EQ(path.y, 0.0f);
    EXPECT_EQ(path.z, infinity);
    for (const float distance : {1e-6f, 1e-3f, 1.0f, 1e4f}) {
        for (float t = 0.001f; t <= 1.0f; t += 0.037f) {
            const glm::vec3 there = transmittance_to_mean_free_path(glm::vec3(t), distance);
            EXPECT_NEAR(mean_free_path_to_transmittance(there, distance).x, t, 1e-6f);
            // Twice as far, the square is left.
            EXPECT_NEAR(mean_free_path_to_transmittance(there, 2.0f * distance).x, t * t, 1e-6f);
        }
    }
    EXPECT_EQ(mean_free_path_to_transmittance(glm::vec3(0.0f, infinity, infinity), 1.0f), glm::vec3(0.0f, 1.0f, 1.0f));
    EXPECT_EQ(transmittance_to_mean_free_path(glm::vec3(0.1f), infinity), glm::vec3(infinity));
}

// The medium that the closures make of the albedo scatters as it was asked for.
TEST(Conversions, ScatteringComesBackFromTheAlbedo) {
    closures::Library library;
    for (const float phase : {-0.5f, 0.0f, 0.8f}) {
        for (const float single : {0.0f, 0.3f, 0.9f, 0.999f, 1.0f}) {
            for (const float f0 : {0.02f, 0.04f, 0.2f}) {
                const double albedo = scattering_to_albedo(glm::vec3(single), phase, glm::vec3(f0)).x;
                auto slab = closures::Library::slab_of({});
                slab.f0 = glm::dvec3(f0);
                const double leaving = library.internal_transmittance(slab).x;
                const double own = albedo / (leaving + (1.0 - leaving) * albedo);
                EXPECT_NEAR(library.scattering_albedo(library.medium_dissimilarity(own), phase), single, 2e-4)
                    << phase << ", " << f0;
            }
        }
    }
    // Darker than without the interface, which throws light back to be absorbed.
    EXPECT_LT(scattering_to_albedo(glm::vec3(0.9f), 0.0f).x,
              scattering_to_albedo(glm::vec3(0.9f), 0.0f, glm::vec3(0.0f)).x);
}

// One slab reflects what the metal and the dielectric beside it do, towards every view.
TEST(Conversions, MetalnessLeavesNoHalo) {
    const auto albedo_of = [](const Slab& slab, double cosine) {
        Tree tree{.name = "metalness"};
        tree.add(slab);
        return directional_albedo(shade(*flatten(tree), {std::sqrt(1.0 - cosine * cosine), 0.0, cosine}));
    };
    double usual_error = 0.0;
    for (const float roughness : {0.1f, 0.5f, 0.9f}) {
        for (const float metalness : {0.0f, 0.2f, 0.5f, 0.8f, 0.99f, 1.0f}) {
            const glm::vec3 color(0.95f, 0.5f, 0.02f);
            const AlbedoAndF0 both = metalness_to_albedo_f0(color, metalness);
            const Slab one{.f0 = both.f0, .roughness = roughness, .albedo = both.albedo};
            const Slab usual{.f0 = both.f0, .roughness = roughness, .albedo = color * (1.0f - metalness)};
            const Slab metal{.f0 = color, .roughness = roughness, .albedo = glm::vec3(0.0f)};
            const Slab dielectric{.roughness = roughness, .albedo = color};
            for (const double cosine : {1.0, 0.6, 0.2}) {
                const glm::dvec3 beside = double(metalness) * albedo_of(metal, cosine) +
                                          (1.0 - double(metalness)) * albedo_of(dielectric, cosine);
                const glm::dvec3 got = albedo_of(one, cosine), other = albedo_of(usual, cosine);
                for (int channel = 0; channel < 3; ++channel) {
                    // What is left is the compensation of multiple scattering, which is not linear in F0.
                    EXPECT_NEAR(got[channel], beside[channel], 2e-3) << metalness << " at " << cosine;
                    usual_error = std::max(usual_error, beside[channel] - other[channel]);
                }
            }
        }
    }
    EXPECT_GT(usual_error, 0.2) << "the halo of the usual way";
    const AlbedoAndF0 dielectric = metalness_to_albedo_f0(glm::vec3(0.5f), 0.0f);
    EXPECT_EQ(dielectric.f0, glm::vec3(0.04f));
    EXPECT_NEAR(dielectric.albedo.x, 0.5f, 1e-7f);
    const AlbedoAndF0 metal = metalness_to_albedo_f0(glm::vec3(1.0f, 0.5f, 0.0f), 1.0f);
    EXPECT_EQ(metal.f0, glm::vec3(1.0f, 0.5f, 0.0f));
    EXPECT_EQ(metal.albedo, glm::vec3(0.0f));
}

// The peak of the lobe, seen and lit along the normal, is what it was.
TEST(Conversions, HazeKeepsThePeak) {
    const auto peak = [](const Slab& slab) {
        Tree tree{.name = "haze"};
        tree.add(slab);
        return reflected(shade(*flatten(tree), {0.0, 0.0, 1.0}), {0.0, 0.0, 1.0}).x;
    };
    Slab slab{.f0 = {0.3f, 0.2f, 0.1f}, .roughness = 0.15f, .albedo = glm::vec3(0.0f)};
    const Slab before = slab;
    add_haze(slab, 0.5f, 3.0f);
    EXPECT_EQ(slab.features, slab_second_lobe);
    EXPECT_GT(slab.f0.x, before.f0.x);
    EXPECT_NEAR(slab.f0.y / slab.f0.x, 2.0f / 3.0f, 1e-6f) << "the hue stays";
    EXPECT_NEAR(slab.second_roughness, std::sqrt(4.0f * 0.0225f), 1e-6f);
    EXPECT_NEAR(peak(slab) / peak(before), 1.0, 0.01);
    Slab none = before;
    add_haze(none, 0.0f, 3.0f);
    EXPECT_EQ(none.second_weight, 0.0f);
    EXPECT_EQ(none.f0, before.f0);
}

TEST(Conversions, WidthsBecomeRoughnessAndAnisotropy) {
    closures::Library library;
    for (const float along : {0.01f, 0.3f, 1.0f}) {
        for (const float across : {0.01f, 0.2f, 1.0f}) {
            const StretchedRoughness stretched = alphas_to_roughness(along, across);
            const glm::dvec2 alpha = library.ggx_alpha(stretched.roughness, stretched.anisotropy);
            EXPECT_NEAR(alpha.x, along, 1e-6);
            EXPECT_NEAR(alpha.y, across, 1e-6);
        }
    }
    EXPECT_EQ(alphas_to_roughness(0.0f, 0.0f).anisotropy, 0.0f);
}

TEST(Conversions, RotationAndTangent) {
    for (float angle = -3.0f; angle <= 3.0f; angle += 0.25f) {
        const glm::vec3 tangent = rotation_to_tangent(angle);
        EXPECT_NEAR(tangent.x * tangent.x + tangent.y * tangent.y, 1.0f, 1e-6f);
        EXPECT_NEAR(tangent_to_rotation(tangent), angle, 1e-6f);
        EXPECT_NEAR(tangent_to_rotation(3.0f * tangent), angle, 1e-6f);
    }
    EXPECT_NEAR(rotation_to_tangent(0.5f * std::numbers::pi_v<float>).y, 1.0f, 1e-6f) << "counter-clockwise";
    EXPECT_EQ(tangent_to_rotation({0.0f, 0.0f, 1.0f}), 0.0f);
}

TEST(Conversions, ColorAndCoverageFollowTheView) {
    const glm::vec3 facing(1.0f, 0.5f, 0.0f), grazing(0.0f, 0.25f, 1.0f);
    EXPECT_EQ(flip_flop(facing, grazing, 5.0f, 1.0f), facing);
    EXPECT_EQ(flip_flop(facing, grazing, 5.0f, 0.0f), grazing);
    for (const float exponent : {0.5f, 1.0f, 5.0f, 40.0f}) {
        for (float cosine = 0.0f; cosine <= 1.0f; cosine += 0.0625f) {
            const double share = std::pow(1.0 - double(cosine), double(exponent));
            const glm::vec3 color = flip_flop(facing, grazing, exponent, cosine);
            EXPECT_NEAR(color.x, 1.0 - share, 1e-6);
            EXPECT_NEAR(color.y, 0.5 - 0.25 * share, 1e-6);
            EXPECT_NEAR(color.z, share, 1e-6);
            EXPECT_NEAR(view_dependent_coverage(0.2f, 0.9f, exponent, cosine), 0.2 + 0.7 * share, 1e-6);
        }
    }
    // The slab's own feature is the same function.
    Slab slab;
    slab.features = slab_edge_coverage;
    slab.coverage = 0.2f;
    slab.edge_coverage = 0.9f;
    slab.edge_exponent = 3.0f;
    closures::Library library;
    EXPECT_NEAR(library.slab_coverage(closures::Library::slab_of(slab), 0.3),
                view_dependent_coverage(0.2f, 0.9f, 3.0f, 0.3f), 1e-6);
}

// A film a quarter of a wave thick whose index is the root of the glass's reflects nothing of that wave.
TEST(Conversions, AFilmMayBeAnAntiReflectionCoating) {
    const glm::vec3 glass(ior_to_f0(1.9f));
    const float film_ior = std::sqrt(1.9f);
    const FilmColors coated = thin_film_colors(glass, 550e-9f / (4.0f * film_ior), film_ior);
    EXPECT_LT(coated.f0.y, 0.15f * glass.y) << "green";
    EXPECT_EQ(thin_film_colors(glass, 0.0f, film_ior).f0, glass);
    // Half a wave: both reflections add up as if there were no film.
    const FilmColors half = thin_film_colors(glass, 550e-9f / (2.0f * film_ior), film_ior);
    EXPECT_GT(half.f0.y, 0.6f * glass.y);
    for (const float f90 : {coated.f90.x, coated.f90.y, coated.f90.z}) EXPECT_NEAR(f90, 1.0f, 1e-6f);
}

TEST(Conversions, NothingBreaksThem) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const float bad : {nan, infinity, -infinity, -1.0f, 1e38f}) {
        EXPECT_TRUE(std::isfinite(ior_to_f0(bad)));
        EXPECT_TRUE(std::isfinite(f0_to_ior(bad)));
        EXPECT_FALSE(std::isnan(transmittance_to_mean_free_path(glm::vec3(bad), bad).x));
        EXPECT_FALSE(std::isnan(mean_free_path_to_transmittance(glm::vec3(bad), bad).x));
        EXPECT_TRUE(std::isfinite(scattering_to_albedo(glm::vec3(bad), bad, glm::vec3(bad)).x));
        EXPECT_TRUE(std::isfinite(metalness_to_albedo_f0(glm::vec3(bad), bad, glm::vec3(bad)).albedo.x));
        EXPECT_TRUE(std::isfinite(alphas_to_roughness(bad, bad).anisotropy));
        EXPECT_TRUE(std::isfinite(rotation_to_tangent(bad).x));
        EXPECT_TRUE(std::isfinite(view_dependent_coverage(bad, bad, bad, bad)));
        EXPECT_TRUE(std::isfinite(thin_film_colors(glm::vec3(bad), bad, bad, bad).f0.x));
        Slab slab;
        slab.f0 = glm::vec3(0.04f);
        add_haze(slab, bad, bad);
        EXPECT_TRUE(std::isfinite(slab.second_weight) && std::isfinite(slab.f0.x));
    }
}

}  // namespace
}  // namespace nacre::materials
