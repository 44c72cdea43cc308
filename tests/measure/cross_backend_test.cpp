// SPDX-License-Identifier: Apache-2.0
#include "measure/cross_backend.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "measure/comparison_page.h"

namespace nacre::measure {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

ImageBytes gray_picture(std::uint8_t value) {
    ImageBytes image{16, 16, 4, 1, {}};
    for (int p = 0; p < 256; ++p) image.bytes.insert(image.bytes.end(), {value, value, value, 255});
    return image;
}

// A reference and a backend that agrees with it.
SceneComparison agreeing() {
    SceneComparison comparison{.scene = "builtin:spheres"};
    comparison.backends.push_back({.backend = "vulkan", .device = "a"});
    comparison.backends.push_back({.backend = "gl", .device = "b"});
    for (BackendResult& result : comparison.backends) result.picture.tone_mapped = gray_picture(100);
    comparison.backends[1].textures.push_back({.name = "material.0", .texels = 10000, .differing = 70,
                                               .fields_differing = 5, .max_abs = 0.25, .max_rel = 0.5,
                                               .fields = {{"roughness", 5, 0.25}}});
    return comparison;
}

TEST(CrossBackendTest, AgreementHasNoViolations) { EXPECT_THAT(violations_of(agreeing(), {}), IsEmpty()); }

TEST(CrossBackendTest, EachFigureIsJudged) {
    const auto first = [](auto change, const Tolerance& tolerance = {}) {
        SceneComparison comparison = agreeing();
        change(comparison.backends[1]);
        const auto violations = violations_of(comparison, tolerance);
        return violations.size() == 1 ? violations[0] : std::to_string(violations.size()) + " violations";
    };
    EXPECT_THAT(first([](BackendResult& r) { r.textures[0].fields_differing = 6; }),
                HasSubstr("gl: texture 'material.0': the share of texels whose fields differ is 0.0006"));
    EXPECT_THAT(first([](BackendResult& r) { r.final.psnr_db = 49.9; }), HasSubstr("PSNR in dB is 49.9"));
    EXPECT_THAT(first([](BackendResult& r) { r.final.psnr_db = std::nan(""); }), HasSubstr("PSNR"));
    EXPECT_THAT(first([](BackendResult& r) { r.final.flip_mean = 0.0051; }), HasSubstr("FLIP"));
    EXPECT_THAT(first([](BackendResult& r) { r.final.share_above_1 = 0.0011; }), HasSubstr("1/255"));
    EXPECT_THAT(first([](BackendResult& r) { r.missing = {"depth"}; }),
                HasSubstr("'depth' of the reference is missing"));
    EXPECT_THAT(first([](BackendResult& r) { r.added = {"extra"}; }), HasSubstr("'extra' is not in the reference"));
    EXPECT_THAT(first([](BackendResult& r) { r.radiance_scan.nan = 3; }), HasSubstr("3 NaN"));
    EXPECT_THAT(first([](BackendResult& r) { r.final.max_abs_8bit = 5; }, {.max_abs_8bit = 4}), HasSubstr("byte"));
    Tolerance strict;
    strict.textures["material.0"].max_abs = 0.2;
    EXPECT_THAT(first([](BackendResult&) {}, strict), HasSubstr("largest absolute difference is 0.25"));
}

TEST(CrossBackendTest, JsonHasTheDocumentedMembers) {
    SceneComparison comparison = agreeing();
    comparison.backends[1].final = {.psnr_db = 61.5, .flip_mean = 0.001, .max_abs_8bit = 3, .share_above_1 = 0.0002};
    comparison.backends[1].textures[0].max_abs = INFINITY;
    const auto json = nlohmann::ordered_json::parse(to_json(comparison));
    EXPECT_EQ(json.size(), 3u);
    EXPECT_EQ(json["scene"], "builtin:spheres");
    EXPECT_EQ(json["reference"], "vulkan");
    ASSERT_EQ(json["results"].size(), 1u);
    const auto& result = json["results"][0];
    std::vector<std::string> keys;
    for (const auto& [key, value] : result["textures"][0].items()) keys.push_back(key);
    EXPECT_THAT(keys, ElementsAre("name", "texels", "differing", "fields_differing", "max_abs", "max_rel"));
    EXPECT_EQ(result["textures"][0]["max_abs"], std::numeric_limits<double>::max());
    keys.clear();
    for (const auto& [key, value] : result["final"].items()) keys.push_back(key);
    EXPECT_THAT(keys, ElementsAre("psnr_db", "flip_mean", "max_abs_8bit", "share_above_1"));
    EXPECT_EQ(result["final"]["psnr_db"], 61.5);
}

TEST(CrossBackendTest, PageTellsWhatDiffers) {
    SceneComparison comparison = agreeing();
    comparison.backends[1].picture.tone_mapped = gray_picture(103);
    comparison.backends[1].final = *compare_pictures(linear_from_srgb_bytes(gray_picture(100)),
                                                     linear_from_srgb_bytes(gray_picture(103)));
    const auto pairs = compare_pairs(comparison);
    ASSERT_TRUE(pairs);
    ASSERT_EQ(pairs->size(), 1u);
    const auto page = comparison_page(comparison, *pairs, {"16 x 16"}, {"gl: too far"});
    ASSERT_TRUE(page);
    const auto html = report_page_html(*page);
    ASSERT_TRUE(html);
    EXPECT_THAT(*html, HasSubstr("gl: too far"));
    EXPECT_THAT(*html, HasSubstr("roughness 5"));
    EXPECT_THAT(*html, HasSubstr("vulkan and gl: FLIP"));
    EXPECT_THAT(*html, HasSubstr("do not agree"));
}

TEST(CrossBackendTest, NoContestantIsAnError) { EXPECT_FALSE(compare_backends("scene", {})); }

// Two implementations decide whether packed words differ: the one beside the packing and the general one here.
TEST(CrossBackendTest, FieldsAreJudgedAsThePackingSays) {
    const std::map<passes::FieldKind, FieldKind> kinds = {{passes::FieldKind::identifier, FieldKind::uint},
                                                          {passes::FieldKind::unorm, FieldKind::unorm},
                                                          {passes::FieldKind::squared, FieldKind::squared}};
    std::mt19937 random(7);
    for (const passes::Field& field : passes::gbuffer_fields()) {
        for (int round = 0; round < 2000; ++round) {
            const std::uint32_t a = random();
            // Mostly near neighbors, so that both answers occur.
            const std::uint32_t offset = (random() % 5) << field.shift;
            const std::uint32_t b = round % 4 == 0 ? random() : a + offset;
            passes::IntermediateContent content;
            content.description = {.name = std::string(field.word), .format = rhi::Format::r32_uint, .width = 1,
                                   .height = 1, .fields = std::span(&field, 1)};
            content.width = content.height = 1;
            const auto texture = [&](std::uint32_t word) {
                content.bytes.resize(4);
                std::memcpy(content.bytes.data(), &word, 4);
                return texture_data_of(content);
            };
            const auto result = compare_textures(texture(a), texture(b));
            ASSERT_TRUE(result) << result.error().message();
            const bool differs = result->fields_differing != 0;
            // For directions the packing allows the largest step of the whole sphere, the comparison that at the place.
            const bool is_direction = field.kind == passes::FieldKind::octahedral;
            if (passes::field_differs(field, a, b) || !is_direction) {
                EXPECT_EQ(differs, passes::field_differs(field, a, b))
                    << field.name << " of " << std::hex << a << " and " << b;
            }
            if (is_direction) {
                double direction[3];
                decode_octahedral({"", 0, field.shift, field.bits, FieldKind::octahedral}, a, direction);
                for (int c = 0; c < 3; ++c) EXPECT_NEAR(direction[c], passes::decode_field(field, a)[c], 1e-6);
            } else {
                EXPECT_NEAR(decode_field({"", 0, field.shift, field.bits, kinds.at(field.kind)}, a),
                            passes::decode_field(field, a)[0], 1e-6);
            }
        }
    }
}

}  // namespace
}  // namespace nacre::measure
