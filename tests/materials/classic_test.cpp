// SPDX-License-Identifier: Apache-2.0
// The classic lobes: what theory says of them, and how far they are from the lobes of the slab.
#include <gtest/gtest.h>

#include "materials/tables/interface_table_generator.h"
#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

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
        EXPECT_NEAR(projected_area([&](double c) { return library.charlie_distribution(direction(c, 0.0), roughness); }), 1.0, 1e-3);
    for (const double alpha : {0.3, 0.6, 1.0})
        EXPECT_NEAR(projected_area([&](double c) { return library.ashikhmin_distribution(direction(c, 0.0), alpha); }), 1.0, 2e-3)
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
