// SPDX-License-Identifier: Apache-2.0
#include "measure/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace nacre::measure {
namespace {

using testing::HasSubstr;

std::string error_of(std::string_view json) {
    const auto result = parse_tolerance(json, "t.json");
    return result ? std::string("no error") : result.error().message();
}

TEST(ToleranceTest, EmptyFileKeepsTheDefaults) {
    const auto result = parse_tolerance("{}", "t.json");
    ASSERT_TRUE(result);
    EXPECT_EQ(result->fields_differing, 0.0005);
    EXPECT_EQ(result->psnr_db, 50.0);
    EXPECT_EQ(result->flip_mean, 0.005);
    EXPECT_EQ(result->share_above_1, 0.001);
    EXPECT_FALSE(result->max_abs_8bit);
}

TEST(ToleranceTest, MembersAreRead) {
    const auto result = parse_tolerance(R"({"fields_differing": 0.1, "final": {"psnr_db": 60, "flip_mean": 0.2,
        "share_above_1": 0.3, "max_abs_8bit": 4}, "textures": {"depth": {"max_abs": 1e-3, "differing": 1}}})",
                                        "t.json");
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_EQ(result->fields_differing, 0.1);
    EXPECT_EQ(result->psnr_db, 60.0);
    EXPECT_EQ(result->flip_mean, 0.2);
    EXPECT_EQ(result->share_above_1, 0.3);
    EXPECT_EQ(result->max_abs_8bit, 4.0);
    EXPECT_EQ(result->textures.at("depth").max_abs, 1e-3);
    EXPECT_EQ(result->textures.at("depth").differing, 1.0);
    EXPECT_FALSE(result->textures.at("depth").max_rel);
}

TEST(ToleranceTest, ErrorsNameTheFileAndTheMember) {
    EXPECT_THAT(error_of("{"), HasSubstr("'t.json'"));
    EXPECT_THAT(error_of("{\n  ,\n}"), HasSubstr("line 2, column 3"));
    EXPECT_THAT(error_of("[]"), HasSubstr("not an object"));
    EXPECT_THAT(error_of(R"({"psnr": 1})"), HasSubstr("psnr is unknown; known here: fields_differing"));
    EXPECT_THAT(error_of(R"({"final": {"psnr": 1}})"), HasSubstr("final.psnr is unknown"));
    EXPECT_THAT(error_of(R"({"final": {"psnr_db": "high"}})"), HasSubstr("final.psnr_db is string"));
    EXPECT_THAT(error_of(R"({"final": 3})"), HasSubstr("final is number"));
    EXPECT_THAT(error_of(R"({"fields_differing": -1})"), HasSubstr("fields_differing is -1"));
    EXPECT_THAT(error_of(R"({"fields_differing": 1e999})"), HasSubstr("t.json"));
    EXPECT_THAT(error_of(R"({"textures": {"depth": {"x": 1}}})"), HasSubstr("textures.depth.x"));
}

}  // namespace
}  // namespace nacre::measure
