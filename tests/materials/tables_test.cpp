// SPDX-License-Identifier: Apache-2.0
// The tables hold what their generators compute, and are right between their entries too.
#include <gtest/gtest.h>

#include "materials/tables/anisotropy_table_generator.h"
#include "materials/tables/interface_table.h"
#include "materials/tables/interface_table_generator.h"
#include "materials/tables/medium_table_generator.h"
#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

TEST(InterfaceTable, EntriesAreThoseOfTheGenerator) {
    for (std::uint32_t row = 0; row < interface_table_rows; row += 19) {
        for (std::uint32_t column = 0; column < interface_table_columns; column += 9) {
            // As many strata as the table was written with: what is left is rounding.
            const auto entry = interface_table_entry(row, column, 256);
            for (int word = 0; word < 4; ++word) {
                const double stored = interface_table()[4 * (row * interface_table_columns + column) + word] / 65535.0;
                EXPECT_NEAR(stored, entry[word], 1e-5) << "row " << row << " column " << column << " word " << word;
            }
        }
    }
}

TEST(InterfaceTable, BetweenEntriesTheErrorIsBelowOneIn1000) {
    Library library;
    Random random(3);
    double total = 0.0, schlick = 0.0, dip = 0.0, chan = 0.0;
    for (int i = 0; i < 1000; ++i) {
        const double roughness = random(0.01, 1.0), alpha = roughness * roughness;
        const double cosine = i % 2 == 0 ? random() : std::pow(10.0, random(-7.0, 0.0));
        const GgxAlbedo exact = ggx_albedo(direction(cosine, 0.0), glm::dvec2(alpha), 96);
        const auto table = library.ggx_albedo(cosine, alpha);
        total = std::max(total, std::abs((1.0 - table.missing) / exact.total - 1.0));
        schlick = std::max(schlick, std::abs(table.schlick - exact.schlick / exact.total));
        dip = std::max(dip, std::abs(table.dip - exact.dip / exact.total));
        if (i % 20 != 0) continue;
        const double gloss = library.chan_gloss(roughness);
        const double albedo = hemisphere_integral(
            96, [&](const glm::dvec3& light) { return library.chan_diffuse(direction(cosine, 0.0), light, gloss); });
        chan = std::max(chan, std::abs(library.chan_albedo_by_table(cosine, gloss) / albedo - 1.0));
    }
    EXPECT_LT(total, 5e-4);
    EXPECT_LT(schlick, 4e-4);
    EXPECT_LT(dip, 6e-5);
    EXPECT_LT(chan, 1e-3);
    std::printf("largest errors: total %.1e, schlick %.1e, dip %.1e, diffuse %.1e\n", total, schlick, dip, chan);
}

TEST(AnisotropyTable, EntriesAreThoseOfTheGenerator) {
    const auto sample = [](const AnisotropyIndex& at) { return anisotropy_table_sample(at, 96); };
    for (std::uint32_t i = 0; i < 18 * 15 * 15 * 4; i += 811) {
        const auto entry = anisotropy_table_entry({i % 18, i / 18 % 15, i / 270 % 15, i / 4050}, sample);
        for (int word = 0; word < 2; ++word)
            EXPECT_NEAR(anisotropy_table()[2 * i + word] / 65535.0, entry[word], 1e-5) << i;
    }
}

// The lobe that an entry is computed for has the slopes that the entry stands for.
TEST(AnisotropyTable, AlphasAlongAndAcrossBelongToOneLobe) {
    Library library;
    Random random(9);
    for (int i = 0; i < 1000; ++i) {
        const double along = random(0.01, 1.0), across = random(0.01, 1.0), correlation = random(0.0, 0.99);
        const StretchedLobe lobe = stretched_lobe(along, across, correlation, random());
        const auto back = library.stretched_view(lobe.view, lobe.alpha);
        ASSERT_NEAR(back.along, along, 1e-9);
        ASSERT_NEAR(back.across, across, 1e-9);
        ASSERT_NEAR(back.correlation, correlation, 1e-7);
    }
}

// Furnaces of white metal and of white diffuse under a dielectric, by the albedos alone, at places that are none of the
// table's: all azimuths, those along the grooves more often, where one alpha is up to 10^4 of the other.
TEST(AnisotropyTable, BetweenEntriesTheErrorIsSmall) {
    Library library;
    Random random(10);
    struct Range {
        double low = 9.0, high = 0.0;
        void add(double value) { low = std::min(low, value), high = std::max(high, value); }
    };
    Range metal, dielectric, usual_metal, usual_dielectric;
    for (int i = 0; i < 3000; ++i) {
        const double stretch = i % 4 == 0 ? 1.0 : i % 4 == 1 ? random(0.95, 1.0) : random(0.0, 0.95);
        const glm::dvec2 alpha = library.ggx_alpha(random(0.01, 1.0), stretch);
        const double across = 0.5 * std::numbers::pi - std::pow(10.0, random(-4.0, 0.0));
        const double cosine = random() < 0.5 ? random(1e-6, 1.0) : std::pow(10.0, random(-6.0, 0.0));
        const glm::dvec3 view = direction(cosine, random() < 0.5 ? random(0.0, 6.3) : across);
        const GgxAlbedo exact = ggx_albedo(view, alpha, 96);
        const auto table = library.stretched_ggx_albedo(view, alpha);
        const double white = exact.total / (1.0 - table.missing);
        // F0 of 0.04, compensated by its mean reflectance.
        const double f0 = 0.04, entering = (1.0 - f0) * 20.0 / 21.0;
        const double reflected = f0 * exact.total + (1.0 - f0) * exact.schlick;
        const double single = f0 + (1.0 - f0) * table.schlick;
        const double both = reflected * (1.0 + (1.0 - entering) * table.missing / (1.0 - table.missing)) + 1.0 -
                            single * (1.0 - entering * table.missing);
        metal.add(white);
        dielectric.add(both);
        if (stretch > 0.95) continue;
        usual_metal.add(white);
        usual_dielectric.add(both);
    }
    // What is left between the entries of four dimensions in 63 KiB; 0.987 to 1.075 with azimuths as an axis.
    EXPECT_GT(usual_metal.low, 0.998);
    EXPECT_LT(usual_metal.high, 1.0016);
    EXPECT_GT(usual_dielectric.low, 0.998);
    EXPECT_LT(usual_dielectric.high, 1.001);
    EXPECT_GT(metal.low, 0.9976);
    EXPECT_LT(metal.high, 1.0016);
    EXPECT_GT(dielectric.low, 0.998);
    EXPECT_LT(dielectric.high, 1.001);
    std::printf("stretched up to 0.95: metal %.4f to %.4f, dielectric %.4f to %.4f\n", usual_metal.low,
                usual_metal.high, usual_dielectric.low, usual_dielectric.high);
    std::printf("stretched to the utmost: metal %.4f to %.4f, dielectric %.4f to %.4f\n", metal.low, metal.high,
                dielectric.low, dielectric.high);
}

TEST(MediumTable, EntriesAreThoseOfTheGenerator) {
    for (std::uint32_t slice = 0; slice < medium_table_slices; ++slice) {
        const std::vector<double> values = medium_table_slice(slice);
        for (std::size_t i = 0; i < values.size(); ++i) {
            const double stored = medium_table()[slice * values.size() + i] / 65535.0;
            ASSERT_NEAR(stored, values[i], 1e-5) << "slice " << slice << " number " << i;
        }
    }
}

/// Reflection of an infinitely thick medium by Chandrasekhar's H function, 1 - sqrt(1 - albedo) H(cosine), which is
/// found as the fixed point of 1 / H = sqrt(1 - albedo) + albedo / 2 integral of m H(m) / (cosine + m).
double chandrasekhar(double albedo, double cosine) {
    constexpr int count = 800;
    const auto node = [](int i) { return (i + 0.5) / count; };
    std::vector<double> h(count, 1.0);
    const double root = std::sqrt(1.0 - albedo);
    const auto inverse = [&](double mu) {
        double sum = 0.0;
        for (int i = 0; i < count; ++i) sum += node(i) * h[i] / (mu + node(i)) / count;
        return root + 0.5 * albedo * sum;
    };
    // Steps are few: the fixed point is approached by a factor of the albedo at least.
    for (int step = 0; step < 30; ++step) {
        std::vector<double> next(count);
        for (int i = 0; i < count; ++i) next[i] = 1.0 / inverse(node(i));
        h = std::move(next);
    }
    return 1.0 - root / inverse(cosine);
}

TEST(MediumTable, InfiniteDepthIsChandrasekhars) {
    const std::vector<double> cosines = {0.1, 0.5, 1.0};
    for (const double albedo : {0.3, 0.7}) {
        ScatteringLayer layer(albedo, cosines);
        layer.start(0x1p-20);
        while (layer.depth() < 100.0) layer.twice();
        for (std::size_t i = 0; i < cosines.size(); ++i)
            EXPECT_NEAR(layer.reflected(i), chandrasekhar(albedo, cosines[i]), 1e-5) << albedo << " " << cosines[i];
    }
}

TEST(MediumTable, AThinLayerScattersHalfOfItsLightBack) {
    ScatteringLayer layer(1.0, {0.3, 1.0});
    layer.start(0x1p-20);
    for (int i = 0; i < 10; ++i) layer.twice();
    EXPECT_NEAR(layer.reflected(0) / (0.5 * layer.depth() / 0.3), 1.0, 2e-2);
    EXPECT_NEAR(layer.reflected(0) + layer.through(0), layer.interacting(0), 1e-7);
}

TEST(MediumTable, BetweenEntriesTheErrorIsSmall) {
    Library library;
    Random random(8);
    double reflected = 0.0, through = 0.0;
    for (int i = 0; i < 150; ++i) {
        const double albedo = i % 3 == 0 ? 1.0 : random(), cosine = std::max(random(), 0.02);
        const double similarity = library.medium_similarity(albedo, 1.0 - albedo);
        ScatteringLayer layer(1.0 - similarity * similarity, {cosine});
        layer.start(std::exp2(random(-31.0, -30.0)));
        const double depth = std::exp2(random(-8.0, 8.0));
        while (layer.depth() < depth) layer.twice();
        const auto scattering = library.medium_scattering(albedo, 1.0 - albedo, layer.depth(), 0.0, cosine);
        // The table's own share, without the turn towards the authored albedo that opaque media take.
        const auto infinite = library.medium_table({std::sqrt(cosine), 1.0, std::sqrt(similarity)});
        const double turn =
            similarity > 0.0
                ? std::lerp(1.0, albedo / ((1.0 - similarity * similarity) * (1.0 - infinite.y) + 1e-30),
                            scattering.opaque)
                : 1.0;
        reflected = std::max(reflected, std::abs(scattering.reflected / turn - layer.reflected(0)));
        through = std::max(through, std::abs(scattering.through - layer.through(0)));
    }
    EXPECT_LT(reflected, 0.003);
    EXPECT_LT(through, 0.003);
    std::printf("largest errors: reflected %.1e, through %.1e\n", reflected, through);
}

}  // namespace
}  // namespace nacre::materials::test
