// SPDX-License-Identifier: Apache-2.0
// The classic lobes: what theory says of them, and how far they are from the lobes of the slab.
#include <gtest/gtest.h>

#include "materials/tables/interface_table_generator.h"
#include "tests/materials/closure_points.h"

namespace nacre::materials::closures {

/// The closures of a shader that defines NACRE_FUZZ_MODEL as 1, in double precision: Library has the other model.
#undef NACRE_CLOSURES_CLOSURE
#undef NACRE_CLOSURES_PREPARED_CLOSURE
#undef NACRE_CLOSURES_SLAB
#undef NACRE_CLOSURES_TABLES
#undef NACRE_FUZZ_MODEL
#define NACRE_FUZZ_MODEL 1
#define NACRE_SLAB_FUZZ 1
struct CharlieLibrary : closures::Lobes {
    static vec4 interface_table(vec2 at) { return Library::interface_table(at); }
#define float double
#define const static constexpr
#include "materials/closures/closure.glsl"
#undef const
#undef float
};
#undef NACRE_SLAB_FUZZ

}  // namespace nacre::materials::closures

namespace nacre::materials::test {
namespace {

using closures::CharlieLibrary;

/// Integral of D cos over the hemisphere of half vectors.
template <typename Distribution>
double projected_area(Distribution&& distribution) {
    double sum = 0.0;
    const int count = 200000;
    for (int i = 0; i < count; ++i) {
        // Angles crowd at the normal, where narrow distributions are.
        const double s = (i + 0.5) / count, angle = 0.5 * std::numbers::pi * s * s;
        sum += distribution(std::cos(angle)) * std::cos(angle) * std::sin(angle) * std::numbers::pi * s / count;
    }
    return 2.0 * std::numbers::pi * sum;
}

TEST(Classic, DistributionsCoverTheSurface) {
    Library library;
    for (const double roughness : {0.1, 0.3, 0.6, 1.0})
        EXPECT_NEAR(
            projected_area([&](double c) { return library.charlie_distribution(direction(c, 0.0), roughness); }), 1.0,
            1e-3);
    for (const double alpha : {0.3, 0.6, 1.0})
        EXPECT_NEAR(projected_area([&](double c) { return library.ashikhmin_distribution(direction(c, 0.0), alpha); }),
                    1.0, 2e-3)
            << alpha;
}

double fiber_albedo(Library& library, double cosine, double roughness, int visibility) {
    const glm::dvec3 view = direction(cosine, 0.0);
    return hemisphere_integral(256, [&](const glm::dvec3& light) {
        const double v = visibility == 0 ? library.neubelt_visibility(cosine, light.z)
                                         : library.charlie_visibility(cosine, light.z, roughness, visibility == 2);
        return library.charlie_distribution(library.half_vector(view, light), roughness) * v * light.z;
    });
}

TEST(Classic, CharlieReflectsMoreThanItGetsWhereItIsKnownTo) {
    Library library;
    // Measured once by another program: 1.157 and 1.505 at cosine 0.02.
    EXPECT_NEAR(fiber_albedo(library, 0.02, 0.1, 0), 1.157, 0.02);
    EXPECT_NEAR(fiber_albedo(library, 0.02, 0.05, 0), 1.505, 0.03);
    double largest = 0.0, softened = 0.0;
    for (const double roughness : {0.1, 0.3, 1.0}) {
        for (const double cosine : {0.02, 0.1, 0.3, 0.7}) {
            largest = std::max(largest, fiber_albedo(library, cosine, roughness, 1));
            softened = std::max(softened, fiber_albedo(library, cosine, roughness, 2));
        }
    }
    EXPECT_LT(largest, 1.0);
    std::printf("Charlie with its own visibility reflects at most %.3f, softened %.3f\n", largest, softened);
}

// Fuzz of Charlie's shape: as much as the other model reflects, whatever the roughness, so that what lies below gets
// the same.
TEST(Classic, CharlieOverItsAlbedoKeepsEnergy) {
    CharlieLibrary library;
    double smallest = 9.0, largest = 0.0;
    for (const double fuzz_roughness : {0.0, 0.07, 0.1, 0.13, 0.2, 0.35, 0.6, 0.85, 1.0}) {
        for (const double cosine : {1e-7, 1e-3, 0.02, 0.07, 0.15, 0.3, 0.55, 0.8, 1.0}) {
            CharlieLibrary::Slab slab{.features = slab_fuzz,
                                      .coverage = 1.0,
                                      .f0 = glm::dvec3(0.04),
                                      .roughness = 0.5,
                                      .albedo = glm::dvec3(1.0),
                                      .fuzz_amount = 1.0,
                                      .fuzz_roughness = fuzz_roughness,
                                      .fuzz_color = glm::dvec3(1.0)};
            const glm::dvec3 view = direction(cosine, 0.4);
            const auto closure = library.prepare_closure(slab, view, 1e-3);
            const double whole = hemisphere_integral(128, [&](const glm::dvec3& light) {
                const auto value = library.evaluate_closure(closure, light);
                return value.specular.x + value.diffuse.x;
            });
            smallest = std::min(smallest, whole);
            largest = std::max(largest, whole);
            EXPECT_LE(whole, 1.001) << fuzz_roughness << " " << cosine;
            EXPECT_GE(whole, 0.998) << fuzz_roughness << " " << cosine;
        }
    }
    std::printf("white diffuse under Charlie's fuzz: %.4f to %.4f\n", smallest, largest);
}

TEST(Classic, SamplesOfCharlieAgreeWithValueAndDensity) {
    CharlieLibrary library;
    Random random(6);
    double density = 0.0;
    constexpr int count = 20000;
    for (int i = 0; i < count; ++i) {
        CharlieLibrary::Slab slab{.features = slab_fuzz,
                                  .coverage = 1.0,
                                  .f0 = glm::dvec3(random()),
                                  .roughness = random(),
                                  .albedo = glm::dvec3(random(), random(), random()),
                                  .fuzz_amount = random(),
                                  .fuzz_roughness = random(),
                                  .fuzz_color = glm::dvec3(random(), random(), random())};
        const auto closure = library.prepare_closure(slab, random_direction(random), 1e-3);
        const auto sample = library.sample_closure(closure, {random(), random(), random()});
        if (sample.pdf > 0.0 && !sample.is_mirror) {
            ASSERT_NEAR(library.closure_pdf(closure, sample.direction) / sample.pdf, 1.0, 1e-9);
            const auto value = library.evaluate_closure(closure, sample.direction);
            for (int channel = 0; channel < 3; ++channel) {
                const double all = value.specular[channel] + value.diffuse[channel];
                ASSERT_TRUE(std::isfinite(all));
                ASSERT_NEAR(all, sample.weight[channel] * sample.pdf, 1e-9 * all);
            }
        }
        // Fuzz and diffuse alone: a light anywhere, of density 1 / (2 pi), weighs what the sampler makes of it.
        slab.f0 = glm::dvec3(0.0);
        const auto soft = library.prepare_closure(slab, direction(0.6, 0.0), 1e-3);
        density +=
            library.closure_pdf(soft, library.uniform_direction(random(), random())) * 2.0 * std::numbers::pi / count;
    }
    EXPECT_NEAR(density, 1.0, 0.02) << "four standard errors";
}

TEST(Classic, DiffuseModelsAgainstWhite) {
    Library library;
    double disney_low = 9.0, disney_high = 0.0;
    for (const double roughness : {0.0, 0.5, 1.0}) {
        for (const double cosine : {0.02, 0.1, 0.5, 1.0}) {
            const double albedo = hemisphere_integral(64, [&](const glm::dvec3& light) {
                return library.disney_diffuse(direction(cosine, 0.0), light, roughness);
            });
            disney_low = std::min(disney_low, albedo);
            disney_high = std::max(disney_high, albedo);
        }
    }
    EXPECT_LT(disney_high, 1.02);
    EXPECT_GT(disney_low, 0.03);
    std::printf("renormalized Disney reflects %.3f to %.3f\n", disney_low, disney_high);
    // Wrapped light from everywhere, also from below the horizon, adds up to 1.
    double sum = 0.0;
    for (int i = 0; i < 10000; ++i) {
        const double z = -1.0 + 2.0 * (i + 0.5) / 10000.0;
        sum +=
            library.fabric_diffuse({std::sqrt(1.0 - z * z), 0.0, z}, 0.0, 0.5) * 2.0 * std::numbers::pi * 2.0 / 10000.0;
    }
    EXPECT_NEAR(sum, 1.0, 1e-4);
}

TEST(Classic, KelemenIsExactForMirrorsAndTheCoatFitIsClose) {
    Library library;
    // Masking and shadowing of a mirror over 4 cos cos, at the mirrored view, is 1 / (4 cos^2).
    for (const double cosine : {0.1, 0.5, 1.0}) {
        EXPECT_NEAR(library.kelemen_visibility(cosine), 0.25 / (cosine * cosine), 1e-9);
    }
    double largest = 0.0;
    for (int i = 0; i <= 100; ++i)
        largest = std::max(largest, std::abs(library.reflectance_under_coat_fit(i / 100.0) -
                                             library.reflectance_under(std::min(i / 100.0, 0.98), 1.5)));
    EXPECT_LT(largest, 0.1);
    std::printf("coat fit is off by %.3f\n", largest);
}

}  // namespace
}  // namespace nacre::materials::test
