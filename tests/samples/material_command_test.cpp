// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/image.h"
#include "tests/core/temporary_folder.h"
#include "tests/samples/run_command.h"

namespace nacre {
namespace {

using nlohmann::json;
using testing::HasSubstr;

TEST(MaterialCommand, ReportsBytesAndSteps) {
    const CommandResult result = run_nacre({"material", "coated-carbon", "--profile", "mobile", "--json", "-"});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    const json report = json::parse(result.output);
    for (const char* key :
         {"name", "profile", "bytes_requested", "bytes", "closures", "bases", "complexity", "features", "steps"})
        EXPECT_TRUE(report.contains(key)) << key;
    EXPECT_EQ(report["name"], "coated-carbon");
    EXPECT_LE(report["bytes"], 12);
    EXPECT_EQ(report["closures"], 1);
    ASSERT_GE(report["steps"].size(), 3u);
    for (const json& step : report["steps"]) {
        for (const char* key : {"what", "bytes", "closures", "albedo_error", "image_error"})
            EXPECT_TRUE(step.contains(key)) << key;
    }
    EXPECT_EQ(report["steps"][0]["bytes"], report["bytes_requested"]);
    EXPECT_EQ(report["steps"][0]["image_error"], 0.0);
    EXPECT_GT(report["steps"].back()["image_error"], 0.01);
}

TEST(MaterialCommand, BudgetAndFullDecideHowFarItGoes) {
    const auto closures = [](std::vector<std::string> more) {
        std::vector<std::string> line{"material", "wet-skin", "--json", "-"};
        line.insert(line.end(), more.begin(), more.end());
        const CommandResult result = run_nacre(line);
        EXPECT_EQ(result.exit_code, 0) << result.errors;
        return json::parse(result.output);
    };
    EXPECT_EQ(closures({"--profile", "reference"})["steps"].size(), 1u);
    EXPECT_EQ(closures({"--profile", "reference", "--full"})["closures"], 1);
    const json small = closures({"--profile", "reference", "--budget", "20"});
    EXPECT_LE(small["bytes"], 20);
    EXPECT_TRUE(small["fits"]);
    EXPECT_FALSE(closures({"--budget", "4"})["fits"]);
}

TEST(MaterialCommand, ComparesWithARandomWalk) {
    const CommandResult result = run_nacre({"material", "gold", "--reference", "--json", "-"});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    const json reference = json::parse(result.output)["reference"];
    // A slab alone is what the walk ends on: nothing but chance is between the two.
    EXPECT_LT(reference["albedo_error"], 2e-3);
    EXPECT_LT(reference["image_error"], 0.04);
    ASSERT_EQ(reference["albedos"].size(), 6u);
    EXPECT_NEAR(reference["albedos"][0]["walk"][0], 1.0, 0.01) << "gold's red";
    EXPECT_TRUE(json::parse(run_nacre({"material", "gold", "--json", "-"}).output)["reference"].is_null());
}

TEST(MaterialCommand, DrawsAPicture) {
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "m.png").string();
    const CommandResult result = run_nacre({"material", "gold", "-o", file});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    const auto picture = read_image_bytes(file, {.channels = 3});
    ASSERT_TRUE(picture) << picture.error().message();
    // The ball is golden: among the pixels are many with far more red than blue.
    std::size_t golden = 0;
    for (std::size_t i = 0; i < picture->texel_count(); ++i)
        golden += picture->bytes[3 * i] > picture->bytes[3 * i + 2] + 60;
    EXPECT_GT(golden, 500u);
}

TEST(MaterialCommand, ListsBuiltInMaterialsAndReadsFiles) {
    EXPECT_THAT(run_nacre({"material", "--list"}).output, HasSubstr("silks-under-plastic"));
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "m.json").string();
    std::ofstream(file) << R"({"nacre_material": 1, "root": {"slab": {"roughness": 0.5, "fuzz_amount": 0.5}}})";
    const CommandResult result = run_nacre({"material", file, "--profile", "epic"});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_THAT(result.output, HasSubstr("fuzz"));
    EXPECT_THAT(run_nacre({"material", "builtin:spheres#no such"}).errors, HasSubstr("Use one of"));
}

TEST(MaterialCommand, PrintsTheSchemaThatIsInTheTree) {
    std::stringstream in_tree;
    in_tree << std::ifstream(NACRE_SOURCE_DIR "/materials/material.schema.json").rdbuf();
    const CommandResult result = run_nacre({"material", "--schema"});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_EQ(result.output, in_tree.str());
}

// Seen and lit along the normal, GGX reflects F / (4 pi alpha^2), and next to nothing more by multiple scattering.
TEST(MaterialCommand, EvaluatesAClosure) {
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "m.json").string();
    std::ofstream(file) << R"({"nacre_material": 1, "root": {"slab": {"f0": 0.04, "roughness": 0.3, "albedo": 0}}})";
    const CommandResult result = run_nacre({"material", file, "--eval", "0,0,1,0,0,1"});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    const std::size_t at = result.output.rfind("sum: ");
    ASSERT_NE(at, std::string::npos) << result.output;
    const double expected = 0.04 / (4.0 * 3.14159265358979 * 0.0081);
    EXPECT_NEAR(std::stod(result.output.substr(at + 5)), expected, 0.005 * expected);
}

TEST(MaterialCommand, WrongInputIsNamed) {
    const auto errors = [](std::vector<std::string> line) {
        line.insert(line.begin(), "material");
        const CommandResult result = run_nacre(line);
        EXPECT_NE(result.exit_code, 0);
        return result.errors;
    };
    EXPECT_THAT(errors({}), HasSubstr("MATERIAL"));
    EXPECT_THAT(errors({"glitter"}), HasSubstr("coated-carbon"));
    EXPECT_THAT(errors({"nowhere.json"}), HasSubstr("nowhere.json"));
    EXPECT_THAT(errors({"gold", "--eval", "0,0,1"}), HasSubstr("six numbers"));
    EXPECT_THAT(errors({"gold", "--eval", "0,0,0,0,0,1"}), HasSubstr("no length"));
    EXPECT_THAT(errors({"gold", "--eval", "0,0,-1,0,0,1"}), HasSubstr("below the surface"));
    EXPECT_THAT(errors({"gold", "--budget", "0"}), HasSubstr("--budget"));
    EXPECT_THAT(errors({"gold", "-o", "a.txt"}), HasSubstr(".png"));
}

}  // namespace
}  // namespace nacre
