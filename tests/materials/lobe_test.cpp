// SPDX-License-Identifier: Apache-2.0
// The lobes by themselves, in double precision, against what the theory demands of them.
#include <gtest/gtest.h>

#include "materials/tables/interface_table_generator.h"
#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

TEST(Lobes, GgxAlbedoOfTheRoughestSurfaceIsTheClosedForm) {
    EXPECT_NEAR(ggx_albedo({0.0, 0.0, 1.0}, {1.0, 1.0}, 512).total, 1.0 - std::log(2.0), 1e-5);
}

TEST(Lobes, MicrofacetsSeenFromAboveCoverTheSurface) {
    // Integral of D(h) cos over the hemisphere is 1; h is drawn by the slope, for which D has a closed inverse.
    Library library;
    for (const glm::dvec2 alpha : {glm::dvec2(1.0), glm::dvec2(0.01), glm::dvec2(0.5, 0.02), glm::dvec2(1e-4, 1.0)}) {
        double sum = 0.0;
        const int strata = 200;
        for (int i = 0; i < strata; ++i) {
            for (int j = 0; j < strata; ++j) {
                // Slope tan = alpha sqrt(u / (1 - u)) has density D cos^4 of the projected plane.
                const double u = (i + 0.5) / strata, phi = 2.0 * std::numbers::pi * (j + 0.5) / strata;
                const double radius = std::sqrt(u / (1.0 - u));
                const glm::dvec2 slope(alpha.x * radius * std::cos(phi), alpha.y * radius * std::sin(phi));
                const glm::dvec3 h = glm::normalize(glm::dvec3(slope, 1.0));
                const double density = (1.0 - u) * (1.0 - u) / (std::numbers::pi * alpha.x * alpha.y);
                sum += library.ggx_distribution(h, alpha) * std::pow(h.z, 4.0) / density;
            }
        }
        EXPECT_NEAR(sum / (strata * strata), 1.0, 1e-5) << alpha.x << " " << alpha.y;
    }
}

TEST(Lobes, SingleScatteringIsReciprocal) {
    Library library;
    Random random(1);
    for (int i = 0; i < 100000; ++i) {
        const glm::dvec3 view = random_direction(random), light = random_light(random, view);
        const glm::dvec2 alpha = library.ggx_alpha(random(), random(-1.0, 1.0));
        const auto f = [&](const glm::dvec3& a, const glm::dvec3& b) {
            return library.ggx_value(a, library.ggx_stretched_length(a, alpha), b, library.half_vector(a, b), alpha) /
                   b.z;
        };
        ASSERT_NEAR(f(view, light) / f(light, view), 1.0, 1e-9);
        const double gloss = random();
        const double there = library.chan_diffuse(view, light, gloss) / light.z;
        const double back = library.chan_diffuse(light, view, gloss) / view.z;
        ASSERT_NEAR(there, back, 1e-9 * there) << gloss;
    }
}

TEST(Lobes, WeightsOfTheGgxSamplerAreAtMostOneAndValueOverDensity) {
    Library library;
    Random random(2);
    for (int i = 0; i < 100000; ++i) {
        const glm::dvec3 view = random_direction(random);
        const glm::dvec2 alpha = library.ggx_alpha(random(), random(-1.0, 1.0));
        const double length = library.ggx_stretched_length(view, alpha);
        const glm::dvec3 light = library.ggx_sample(view, length, alpha, random(), random());
        const double weight = library.ggx_weight(view, length, light, alpha);
        ASSERT_LE(weight, 1.0 + 1e-5);
        if (light.z <= 0.0) continue;
        const glm::dvec3 h = library.half_vector(view, light);
        const double value = library.ggx_value(view, length, light, h, alpha);
        const double pdf = library.ggx_pdf(view, length, light, h, alpha);
        ASSERT_NEAR(value / pdf, weight, 1e-6 * weight);
    }
}

TEST(Lobes, FuzzIsADensityAndItsAlbedoStaysBelowThree4ths) {
    Library library;
    for (const double roughness : {0.0, 0.1, 0.3, 0.6, 1.0}) {
        for (const double cosine : {1e-4, 0.1, 0.5, 1.0}) {
            const auto map = library.sheen_map(direction(cosine, 0.3), roughness);
            const auto crowd = [](double s) { return s * s * (3.0 - 2.0 * s); };
            // The lobe is a cosine lobe under a map, which crowds where the map squeezes: integrate over its own
            // samples.
            double sum = 0.0;
            const int strata = 100;
            for (int i = 0; i < strata; ++i) {
                for (int j = 0; j < strata; ++j) {
                    const double s = (i + 0.5) / strata;
                    const glm::dvec3 light = library.sheen_sample(map, crowd(s), (j + 0.5) / strata);
                    EXPECT_GE(light.z, 0.0);
                    // Density of the sampled point in the original cosine lobe, carried over by the Jacobian of the
                    // map.
                    const double x = map.axis.x * light.x + map.axis.y * light.y,
                                 y = map.axis.x * light.y - map.axis.y * light.x;
                    const glm::dvec3 original(map.scale * x + map.shear * light.z, map.scale * y, light.z);
                    const double length = glm::length(original);
                    const double carried =
                        original.z / length / std::numbers::pi * map.scale * map.scale / std::pow(length, 3.0);
                    sum += 6.0 * s * (1.0 - s) * library.sheen_density(map, light) / carried;
                }
            }
            EXPECT_NEAR(sum / (strata * strata), 1.0, 1e-3) << roughness << " " << cosine;
        }
    }
    double largest = 0.0;
    for (int i = 0; i <= 1000; ++i)
        for (int j = 0; j <= 100; ++j) largest = std::max(largest, library.sheen_albedo(i / 1000.0, j / 100.0));
    EXPECT_LT(largest, 0.75);
    EXPECT_GT(largest, 0.7);
}

TEST(Lobes, FresnelKeepsItsThreeColorsAndFadesWhereNoMatterReflectsSoLittle) {
    Library library;
    const auto fresnel = library.make_fresnel({0.5, 0.2, 0.1}, {0.5, 0.25, 0.0}, {0.9, 0.5, 1.0});
    const glm::dvec3 normal = library.fresnel_reflectance(fresnel, 1.0),
                     grazing = library.fresnel_reflectance(fresnel, 0.0);
    EXPECT_NEAR(glm::distance(normal, glm::dvec3(0.5, 0.2, 0.1)), 0.0, 1e-12);
    EXPECT_NEAR(glm::distance(grazing, glm::dvec3(1.0, 0.5, 0.0)), 0.0, 1e-12) << "F90 has only a color";
    const auto plain = library.make_fresnel({0.5, 0.2, 0.1}, {0.5, 0.25, 0.0}, glm::dvec3(1.0));
    const glm::dvec3 ratio =
        library.fresnel_reflectance(fresnel, 1.0 / 7.0) / library.fresnel_reflectance(plain, 1.0 / 7.0);
    EXPECT_NEAR(glm::distance(ratio, glm::dvec3(0.9, 0.5, 1.0)), 0.0, 1e-6)
        << "F82 is relative to Schlick's at 82 degrees";
    const auto none = library.make_fresnel(glm::dvec3(0.0), glm::dvec3(1.0), glm::dvec3(1.0));
    for (const double cosine : {0.0, 0.1, 1.0}) EXPECT_EQ(library.fresnel_reflectance(none, cosine), glm::dvec3(0.0));
    // Mean over the hemisphere against quadrature.
    glm::dvec3 sum(0.0);
    for (int i = 0; i < 10000; ++i) {
        const double cosine = (i + 0.5) / 10000.0;
        sum += 2.0 * cosine * library.fresnel_reflectance(fresnel, cosine) / 10000.0;
    }
    EXPECT_NEAR(glm::distance(sum, library.fresnel_mean(fresnel)), 0.0, 1e-6);
}

/// Linear sRGB of a film on a dielectric by the whole Airy series, integrated over frequencies with the color matching
/// functions as Gaussians; Schlick's formula at both sides, as the lobe has it.
glm::dvec3 spectral_film(Library& library, double f0, double thickness, double ior, double cosine) {
    const double outer_f0 = library.ior_to_reflectance(ior);
    const double inside = std::sqrt(1.0 - (1.0 - cosine * cosine) / (ior * ior));
    const double r12 = std::sqrt(outer_f0 + (1.0 - outer_f0) * std::pow(1.0 - cosine, 5.0));
    const double below = library.reflectance_under(f0, ior);
    double r23 = std::sqrt(below + (1.0 - below) * std::pow(1.0 - inside, 5.0));
    if (f0 < outer_f0) r23 = -r23;
    const auto reflectance = [&](double frequency) {
        const double phase = 2.0 * std::numbers::pi * frequency * 2.0 * ior * thickness * inside;
        // |(r12 + r23 e^(i phase)) / (1 + r12 r23 e^(i phase))|^2
        const double c = std::cos(phase);
        return (r12 * r12 + r23 * r23 + 2.0 * r12 * r23 * c) / (1.0 + r12 * r12 * r23 * r23 + 2.0 * r12 * r23 * c);
    };
    const auto band = [&](double position, double variance) {
        const double sigma = std::sqrt(2.0 * variance);
        double sum = 0.0, weights = 0.0;
        for (int i = -400; i <= 400; ++i) {
            const double weight = std::exp(-0.5 * std::pow(i / 80.0, 2.0));
            sum += weight * reflectance(position + sigma * i / 80.0);
            weights += weight;
        }
        return sum / weights;
    };
    const double x = 0.846202 * band(1.6810e6, 4.3278e9) + 0.153798 * band(2.2399e6, 4.5282e9);
    const double y = band(1.7953e6, 9.3046e9), z = band(2.2084e6, 6.6121e9);
    return {2.6897 * x - 1.2759 * y - 0.4138 * z, -1.0221 * x + 1.9783 * y + 0.0438 * z,
            0.0612 * x - 0.2245 * y + 1.1633 * z};
}

TEST(Lobes, ThinFilmIsTheSpectrumOfAirysSeries) {
    Library library;
    double largest = 0.0;
    for (const double f0 : {0.02, 0.04, 0.2}) {
        for (const double ior : {1.3, 1.8}) {
            for (const double thickness : {1e-7, 3e-7, 6e-7, 1e-6}) {
                for (const double cosine : {1.0, 0.7, 0.3}) {
                    const glm::dvec3 film = library.film_shares(glm::dvec3(f0), thickness, ior, cosine).reflected;
                    const glm::dvec3 exact = glm::clamp(spectral_film(library, f0, thickness, ior, cosine), 0.0, 1.0);
                    for (int channel = 0; channel < 3; ++channel)
                        largest = std::max(largest, std::abs(film[channel] - exact[channel]));
                }
            }
        }
    }
    // Two orders of a series whose ratio is at most 0.3 here: what is left out is below 0.01.
    EXPECT_LT(largest, 0.01);
    std::printf("largest error of two orders: %.1e\n", largest);
}

TEST(Lobes, AFilmFadesInAndItsCurvePassesThroughItsReflectance) {
    Library library;
    const auto bare = library.make_fresnel({0.04, 0.3, 0.9}, glm::dvec3(1.0), glm::dvec3(1.0));
    EXPECT_NEAR(glm::distance(library.make_film_fresnel(bare, 0.0, 1.5, 0.6).normal, bare.normal), 0.0, 1e-12);
    for (const double cosine : {1.0, 0.8, 0.5}) {
        const auto fresnel = library.make_film_fresnel(bare, 4e-7, 1.5, cosine);
        const glm::dvec3 film = library.film_shares(bare.normal, 4e-7, 1.5, cosine).reflected;
        EXPECT_NEAR(glm::distance(library.fresnel_reflectance(fresnel, cosine), film), 0.0, 1e-9);
    }
}

TEST(Lobes, HazeLeavesThePeakOfTheCoreWhereItIs) {
    Library library;
    for (const double f0 : {0.0, 0.02, 0.2, 0.9, 1.0}) {
        for (const double roughness : {0.1, 0.5, 0.9}) {
            for (const double extent : {0.0, 0.5, 4.0, 100.0}) {
                for (const double haziness : {0.0, 0.3, 1.0}) {
                    const auto haze = library.make_haze(f0, roughness, haziness, extent);
                    EXPECT_LE(haze.f0, 1.0);
                    EXPECT_GE(haze.f0, f0 - 1e-12);
                    EXPECT_TRUE(haze.second_weight >= 0.0 && haze.second_weight <= 1.0);
                    const auto peak = [&](double r) {
                        return library.ggx_distribution({0.0, 0.0, 1.0}, glm::dvec2(r * r));
                    };
                    const double whole = haze.f0 * ((1.0 - haze.second_weight) * peak(roughness) +
                                                    haze.second_weight * peak(haze.second_roughness));
                    EXPECT_NEAR(whole, f0 * peak(roughness), 1e-9 * peak(roughness));
                }
            }
        }
    }
}

TEST(Lobes, IndexAndReflectanceAreInverse) {
    Library library;
    for (const double ior : {1.0, 1.01, 1.33, 1.5, 2.4, 10.0})
        EXPECT_NEAR(library.reflectance_to_ior(library.ior_to_reflectance(ior)), ior, 1e-9 * ior);
    EXPECT_TRUE(std::isfinite(library.reflectance_to_ior(1.0)));
    // ((5 s - 1) / (5 - s))^2 under an index of 1.5, s the root of the reflectance.
    for (const double f0 : {0.05, 0.2, 0.7, 0.95}) {
        const double s = std::sqrt(f0);
        EXPECT_NEAR(library.reflectance_under(f0, 1.5), std::pow((5.0 * s - 1.0) / (5.0 - s), 2.0), 1e-12);
    }
}

}  // namespace
}  // namespace nacre::materials::test
