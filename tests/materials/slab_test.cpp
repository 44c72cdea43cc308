// SPDX-License-Identifier: Apache-2.0
#include "materials/slab.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

constexpr float nan_value = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

TEST(Slab, WhatIsInRangeStaysAsItIs) {
    Random random(21);
    for (int i = 0; i < 1000; ++i) {
        const Slab slab = random_slab(random, ~0u);
        ASSERT_EQ(clamped(slab), slab) << i;
    }
    EXPECT_EQ(clamped(Slab{}), Slab{});
}

TEST(Slab, WhatIsOutOfRangeIsClampedAndNotANumberBecomesTheDefault) {
    Slab slab;
    slab.f0 = {2.0f, -1.0f, nan_value};
    slab.roughness = infinity;
    slab.anisotropy = -3.0f;
    slab.mean_free_path = {infinity, -1.0f, nan_value};
    slab.thickness = infinity;
    slab.phase_anisotropy = 1.0f;
    slab.emission = {-1.0f, infinity, 1e38f};
    slab.glint_position = {nan_value, 1e30f};
    const Slab result = clamped(slab);
    EXPECT_EQ(result.f0, glm::vec3(1.0f, 0.0f, 0.04f));
    EXPECT_EQ(result.roughness, 0.5f);
    EXPECT_EQ(result.anisotropy, -1.0f);
    EXPECT_EQ(result.mean_free_path, glm::vec3(1e12f, 0.0f, 0.0f)) << "infinite lengths are very long ones";
    EXPECT_EQ(result.thickness, 1e12f);
    EXPECT_LT(result.phase_anisotropy, 1.0f);
    EXPECT_EQ(result.emission, glm::vec3(0.0f, 0.0f, 1e30f));
    EXPECT_EQ(result.glint_position, glm::vec2(0.0f, 1e6f));
}

TEST(Slab, EveryFeatureHasItsOwnBitAndMacro) {
    std::uint32_t bits = 0;
    std::set<std::string> macros;
    for (const SlabFeature& feature : slab_features()) {
        EXPECT_EQ(bits & feature.bit, 0u) << feature.name;
        EXPECT_EQ(feature.bit & (feature.bit - 1), 0u) << feature.name;
        bits |= feature.bit;
        macros.insert(feature.macro);
    }
    EXPECT_EQ(macros.size(), slab_features().size());
    // The macros are those that the GLSL asks for.
    std::set<std::string> asked;
    for (const EmbeddedFile& file : embedded_files()) {
        for (std::size_t at = 0; (at = file.text.find("NACRE_SLAB_", at)) != std::string_view::npos;) {
            const std::size_t end = file.text.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_", at);
            asked.insert(std::string(file.text.substr(at, end - at)));
            at = end;
        }
    }
    EXPECT_EQ(asked, macros);
}

TEST(Slab, ThePlainFieldsReachTheClosures) {
    Random random(22);
    const Slab slab = random_slab(random, ~0u);
    const auto copy = Library::slab_of(slab);
    EXPECT_EQ(glm::vec3(copy.f82), slab.f82);
    EXPECT_EQ(glm::vec3(copy.fuzz_color), slab.fuzz_color);
    EXPECT_EQ(glm::vec3(copy.mean_free_path), slab.mean_free_path);
    EXPECT_EQ(glm::vec2(copy.glint_dy), slab.glint_dy);
    EXPECT_EQ(static_cast<float>(copy.edge_exponent), slab.edge_exponent);
}

}  // namespace
}  // namespace nacre::materials::test
