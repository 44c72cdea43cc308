// SPDX-License-Identifier: Apache-2.0
#include "rhi/capabilities.h"

#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "tests/rhi/null_backend.h"

namespace nacre::test {
namespace {

using namespace rhi;

TEST(Capabilities, ListHoldsEveryMemberOfTheStructure) {
    std::ifstream file(std::string(NACRE_SOURCE_DIR) + "/rhi/capabilities.h");
    std::ostringstream text;
    text << file.rdbuf();
    std::string declarations = text.str();
    declarations = declarations.substr(declarations.find("struct Capabilities {"));
    declarations = declarations.substr(0, declarations.find("std::array<FormatSupport, format_count> formats"));
    std::set<std::string> members, listed;
    const std::regex member(R"(^    (?:bool|float|double|std::uint\d+_t|std::array<std::uint32_t, 3>) (\w+)(?: =|\{))",
                            std::regex::multiline);
    for (std::sregex_iterator at(declarations.begin(), declarations.end(), member), end; at != end; ++at)
        members.insert((*at)[1]);
    for (const CapabilityEntry& entry : list_capabilities({}))
        if (!entry.name.starts_with("format ")) {
            EXPECT_TRUE(listed.insert(entry.name).second) << entry.name;
        }
    EXPECT_GT(members.size(), 50u);
    EXPECT_EQ(listed, members);
}

TEST(Capabilities, ListTellsValuesAndFormats) {
    std::map<std::string, std::string> values;
    for (const CapabilityEntry& entry : list_capabilities(full_capabilities())) values[entry.name] = entry.value;
    EXPECT_EQ(values["dual_source_blending"], "yes");
    EXPECT_EQ(values["shader_float64"], "no");
    EXPECT_EQ(values["max_texture_2d"], "16384");
    EXPECT_EQ(values["max_workgroup_size"], "1024, 1024, 64");
    EXPECT_EQ(values["format rgb9e5_float"], "sampled filtered");
}

TEST(Capabilities, RestrictionTakesTheSmallerOfEach) {
    Capabilities strong = full_capabilities();
    strong.uniform_offset_alignment = 16;
    strong.max_texture_3d = 128;  // Weaker than the minimum asks for: stays.
    const Capabilities weak = *restrict_capabilities(strong, "gles31-minimum");
    EXPECT_EQ(weak.max_texture_3d, 128u);
    EXPECT_EQ(weak.max_texture_2d, 2048u);
    EXPECT_EQ(weak.uniform_offset_alignment, 256u);  // A larger alignment is the weaker one.
    EXPECT_EQ(weak.max_workgroup_size, (std::array<std::uint32_t, 3>{128, 128, 64}));
    EXPECT_FALSE(weak.independent_blend);
    EXPECT_FALSE(weak.supports(Format::bc1_rgba_unorm, FormatSupport::sampled));
    EXPECT_TRUE(weak.supports(Format::rgba16_float, FormatSupport::filtered | FormatSupport::storage_image));
    // What is restricted once is not changed by doing it again.
    const Capabilities again = *restrict_capabilities(weak, "gles31-minimum");
    const auto first = list_capabilities(weak), second = list_capabilities(again);
    for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i].value, second[i].value) << first[i].name;
}

TEST(Capabilities, UnknownRestrictionNamesTheKnownOnes) {
    const auto result = restrict_capabilities({}, "phone");
    ASSERT_FALSE(result);
    EXPECT_NE(result.error().message().find("gles31-minimum"), std::string::npos);
    for (const std::string& name : restriction_names()) EXPECT_TRUE(restrict_capabilities({}, name)) << name;
}

}  // namespace
}  // namespace nacre::test
