// SPDX-License-Identifier: Apache-2.0
// Glints: the mean over the surface is the smooth lobe at every density, and so is the far field everywhere.
#include <gtest/gtest.h>

#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

struct Moments {
    double mean = 0.0, deviation = 0.0;
};

Moments over_the_surface(Library& library, const glm::dvec3& h, double density, double footprint, int samples) {
    Random random(static_cast<std::uint64_t>(1000.0 * density) + 77);
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < samples; ++i) {
        const glm::dvec2 position(random(-1e3, 1e3), random(-1e3, 1e3));
        const double factor =
            library.glint_factor(h, {0.2, 0.2}, density, position, {footprint, 0.0}, {0.0, footprint});
        sum += factor;
        squares += factor * factor;
    }
    const double mean = sum / samples;
    return {mean, std::sqrt(std::max(squares / samples - mean * mean, 0.0))};
}

// Expectation of a count over all 2^32 seeds, of which those with many facets come first.
double expectation(Library& library, double mean) {
    double sum = 0.0;
    for (int count = 1; count <= 64; ++count) {
        std::uint64_t low = 0, high = std::uint64_t{1} << 32;
        while (low < high) {
            const std::uint64_t middle = (low + high) / 2;
            if (library.glint_count(mean, static_cast<std::uint32_t>(middle)) >= count) low = middle + 1;
            else high = middle;
        }
        sum += static_cast<double>(low) * 0x1p-32;
    }
    return sum;
}

// What is seen of a place is a mean of counts with weights whose sum is 1: with seeds as good as random, the mean over
// places is off by as much as this one. Where a pixel has few facets and slopes lie far out, counts have means like
// these.
TEST(Glints, CountsHaveTheirMean) {
    Library library;
    for (const double mean : {1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 5.0, 19.9})
        EXPECT_NEAR(expectation(library, mean) / mean, 1.0, 1e-6 + 0x1p-32 / mean) << mean;
}

// Below 9 facets in a footprint as well; counts of cells repeat after a million of them, not before.
TEST(Glints, TheMeanOverFewFacetsIsTheLobe) {
    Library library;
    const double footprint = 0.3;
    for (const double facets : {1e-3, 0.1, 3.0}) {
        const double density = facets / (footprint * footprint), size = std::max(footprint, 1.0 / std::sqrt(density));
        Random random(17);
        double sum = 0.0, squares = 0.0;
        const int places = 600000;
        for (int i = 0; i < places; ++i) {
            const glm::dvec2 position(random(0.0, 1e6) * size, random(0.0, 1e6) * size);
            const double factor = library.glint_factor(direction(0.99, 0.4), {0.2, 0.2}, density, position,
                                                       {footprint, 0.0}, {0.0, footprint});
            sum += factor;
            squares += factor * factor;
        }
        const double mean = sum / places, error = std::sqrt((squares / places - mean * mean) / places);
        EXPECT_NEAR(mean, 1.0, 4.0 * error) << facets;
        EXPECT_LT(4.0 * error, 0.05) << facets;
    }
}

TEST(Glints, TheMeanOverTheSurfaceIsTheLobeAtEveryDensity) {
    Library library;
    for (const glm::dvec3 h : {direction(1.0, 0.0), direction(0.98, 0.4), direction(0.9, 2.0)}) {
        for (const double density : {1e-2, 1.0, 1e2, 1e4, 1e6, 1e9}) {
            const int samples = 50000;
            const Moments moments = over_the_surface(library, h, density, 0.3, samples);
            // Four standard errors of the mean, or the 1 % that is asked for where that is more.
            EXPECT_NEAR(moments.mean, 1.0, std::max(4.0 * moments.deviation / std::sqrt(samples), 1e-6))
                << density << " " << h.z;
        }
    }
}

TEST(Glints, TheMeanIsWithinOnePercentWithManySamples) {
    Library library;
    for (const double density : {1e3, 1e5})
        EXPECT_NEAR(over_the_surface(library, direction(0.99, 0.4), density, 0.3, 400000).mean, 1.0, 0.01) << density;
}

TEST(Glints, FarAwayTheyAreTheLobe) {
    Library library;
    for (const glm::dvec3 h : {direction(1.0, 0.0), direction(0.97, 0.4)}) {
        const Moments near_by = over_the_surface(library, h, 1e4, 0.01, 20000);
        const Moments far_away = over_the_surface(library, h, 1e4, 100.0, 20000);
        EXPECT_GT(near_by.deviation, 1.0) << "single facets are seen";
        EXPECT_LT(far_away.deviation, 0.01);
        EXPECT_NEAR(far_away.mean, 1.0, 0.01);
    }
}

TEST(Glints, APlaceAlwaysGlitsTheSameAndMovesWithoutAStep) {
    Library library;
    const glm::dvec3 h = direction(0.99, 0.4);
    const auto at = [&](double x, double footprint) {
        return library.glint_factor(h, {0.2, 0.2}, 100.0, {x, 0.3}, {footprint, 0.0}, {0.0, footprint});
    };
    EXPECT_EQ(at(0.7, 0.1), at(0.7, 0.1));
    double largest = 0.0, highest = 0.0;
    for (int i = 1; i <= 10000; ++i) {
        largest = std::max({largest, std::abs(at(i * 1e-4, 0.1) - at((i - 1) * 1e-4, 0.1)),
                            std::abs(at(0.7, 0.1 + i * 1e-4) - at(0.7, 0.1 + (i - 1) * 1e-4))});
        highest = std::max(highest, at(i * 1e-4, 0.1));
    }
    EXPECT_LT(largest, 0.01 * std::max(highest, 10.0));
}

TEST(Glints, AClosureWithGlintsIsTheLobeTimesTheFactor) {
    Library library;
    Slab slab{.features = slab_glints,
              .f0 = glm::vec3(0.8f),
              .roughness = 0.4f,
              .albedo = glm::vec3(0.0f),
              .glint_density = 300.0f};
    slab.glint_dx = {0.1f, 0.0f};
    slab.glint_dy = {0.0f, 0.1f};
    const glm::dvec3 view = direction(0.8, 0.0), light = direction(0.75, 3.0);
    double sum = 0.0;
    const int count = 20000;
    Slab smooth = slab;
    smooth.features = 0;
    const double expected =
        library.evaluate_closure(library.prepare_closure(Library::slab_of(smooth), view, 1e-3), light).specular.x;
    Random random(12);
    for (int i = 0; i < count; ++i) {
        slab.glint_position = {static_cast<float>(random(-100.0, 100.0)), static_cast<float>(random(-100.0, 100.0))};
        sum += library.evaluate_closure(library.prepare_closure(Library::slab_of(slab), view, 1e-3), light).specular.x;
    }
    EXPECT_NEAR(sum / count / expected, 1.0, 0.08);
}

}  // namespace
}  // namespace nacre::materials::test
