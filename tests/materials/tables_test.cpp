// SPDX-License-Identifier: Apache-2.0
// The tables hold what their generators compute, and are right between their entries too.
#include <gtest/gtest.h>

#include "materials/tables/interface_table.h"
#include "materials/tables/interface_table_generator.h"
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
        const double albedo = hemisphere_integral(96, [&](const glm::dvec3& light) {
            return library.chan_diffuse(direction(cosine, 0.0), light, gloss);
        });
        chan = std::max(chan, std::abs(library.chan_albedo_by_table(cosine, gloss) / albedo - 1.0));
    }
    EXPECT_LT(total, 5e-4);
    EXPECT_LT(schlick, 4e-4);
    EXPECT_LT(dip, 6e-5);
    EXPECT_LT(chan, 1e-3);
    std::printf("largest errors: total %.1e, schlick %.1e, dip %.1e, diffuse %.1e\n", total, schlick, dip, chan);
}

}  // namespace
}  // namespace nacre::materials::test
