// SPDX-License-Identifier: Apache-2.0
// What the command says to right and wrong command lines; nothing here needs a device.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "core/image.h"
#include "tests/core/temporary_folder.h"
#include "tests/samples/run_command.h"

namespace nacre {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

TEST(CommandLineTest, HelpTeaches) {
    const CommandResult help = run_nacre({"--help"});
    EXPECT_EQ(help.exit_code, 0);
    for (const char* command :
         {"devices", "render", "compare", "diff", "explain", "material", "demo", "cache", "completion"}) {
        EXPECT_THAT(help.output, HasSubstr(command));
        const CommandResult own = run_nacre({command, "--help"});
        EXPECT_EQ(own.exit_code, 0);
        EXPECT_THAT(own.output, AllOf(HasSubstr("Usage: nacre"), HasSubstr("Examples:"))) << command;
        EXPECT_THAT(own.errors, IsEmpty());
    }
    EXPECT_THAT(help.output, HasSubstr("Exit codes:"));
    EXPECT_EQ(run_nacre({"--version"}).output.substr(0, 6), "nacre ");
    const CommandResult nothing = run_nacre({});
    EXPECT_EQ(nothing.exit_code, 2);
    EXPECT_THAT(nothing.errors, HasSubstr("Usage: nacre"));
}

struct WrongLine {
    std::vector<std::string> arguments;
    std::string message;
};

class WrongCommandLineTest : public testing::TestWithParam<WrongLine> {};

TEST_P(WrongCommandLineTest, IsRefusedWithExitCode2) {
    const CommandResult result = run_nacre(GetParam().arguments);
    EXPECT_EQ(result.exit_code, 2) << result.errors;
    EXPECT_THAT(result.errors, HasSubstr(GetParam().message));
    EXPECT_THAT(result.output, IsEmpty());
}

std::vector<std::string> render(std::vector<std::string> more) {
    std::vector<std::string> line = {"render", "builtin:spheres", "-o", "/nonexistent/a.png"};
    line.insert(line.end(), more.begin(), more.end());
    return line;
}

INSTANTIATE_TEST_SUITE_P(
    Lines, WrongCommandLineTest,
    testing::Values(
        WrongLine{{"paint"}, "paint"}, WrongLine{{"--paint"}, "--paint"}, WrongLine{{"render"}, "SCENE is required"},
        WrongLine{{"render", "builtin:spheres"}, "--output is required"}, WrongLine{render({"--paint"}), "--paint"},
        WrongLine{render({"two.gltf"}), "two.gltf"},
        WrongLine{{"render", "a.gltf", "-o", "a.bmp"}, "'a.bmp' does not end in .png or .exr"},
        WrongLine{{"render", "a.gltf", "-o", ".png"}, "does not end in"},
        WrongLine{render({"--size", "0x7"}), "'0x7' is not a size"}, WrongLine{render({"--size", "640"}), "'640'"},
        WrongLine{render({"--size", "640x"}), "'640x'"}, WrongLine{render({"--size", "-1x5"}), "--size"},
        WrongLine{render({"--size", "99999x99999"}), "each from 1 to 16384"},
        WrongLine{render({"--size", "640x480x3"}), "is not a size"},
        WrongLine{render({"--exposure", "nan"}), "'nan' is not a number from -64 to 64"},
        WrongLine{render({"--exposure", "inf"}), "'inf'"}, WrongLine{render({"--exposure", "1e9"}), "'1e9'"},
        WrongLine{render({"--exposure", "bright"}), "'bright'"}, WrongLine{render({"--time", "nan"}), "--time"},
        WrongLine{render({"--time", "later"}), "'later'"}, WrongLine{render({"--frames", "0"}), "'0' is not a whole"},
        WrongLine{render({"--frames", "-3"}), "'-3'"}, WrongLine{render({"--frames", "1.5"}), "'1.5'"},
        WrongLine{render({"--frames", "99999999999"}), "--frames"}, WrongLine{render({"--device", "-1"}), "--device"},
        WrongLine{render({"--device", "first"}), "'first'"},
        WrongLine{render({"--profile", "huge"}), "'huge' is not one of: mobile"},
        WrongLine{render({"--restrict", "wii"}), "gles31-minimum"},
        WrongLine{render({"--tone-mapping", "pretty"}), "'pretty' is not one of: filmic, linear"},
        WrongLine{render({"--camera", "nobody"}), "'nobody'"},
        WrongLine{render({"--dump-graph", "a.txt"}), ".svg or .dot"}, WrongLine{render({"--json"}), "--json"},
        WrongLine{{"render", "builtin:nothing", "-o", "a.png"}, "builtin:spheres"},
        WrongLine{{"compare", "builtin:spheres"}, "--backends is required"},
        WrongLine{{"compare", "builtin:spheres", "--backends", "gl"}, "two or more"},
        WrongLine{{"compare", "builtin:spheres", "--backends", "gl,,vulkan"}, "'gl,,vulkan'"},
        WrongLine{{"compare", "builtin:spheres", "--backends", "gl,vulkan", "--tolerance", "/nonexistent.json"},
                  "/nonexistent.json"},
        WrongLine{{"diff", "a.png"}, "B is required"}, WrongLine{{"explain"}, "SCENE is required"},
        WrongLine{{"stability", "--points", "0"}, "'0' is not a whole number"},
        WrongLine{{"stability", "--points", "nan"}, "'nan'"}, WrongLine{{"stability", "--points", "1e5"}, "'1e5'"},
        WrongLine{{"stability", "--backends", "cpu,"}, "one or more"},
        WrongLine{{"stability", "--backends", "abacus", "--points", "1000"}, "'abacus'"},
        WrongLine{{"stability", "--spread"}, "--spread"}, WrongLine{{"stability", "--only", "glitter"}, "'glitter'"},
        WrongLine{{"cache", "burn"}, "burn"}, WrongLine{{"demo", "--frames", "none"}, "'none'"}));

TEST(CommandLineTest, MissingFilesAreFailures) {
    const CommandResult scene = run_nacre({"render", "/nonexistent/car.gltf", "-o", "/tmp/a.png"});
    EXPECT_EQ(scene.exit_code, 1);
    EXPECT_THAT(scene.errors, HasSubstr("'/nonexistent/car.gltf'"));
    const CommandResult environment =
        run_nacre({"render", "builtin:spheres", "-o", "/tmp/a.png", "--env", "/nonexistent/sky.hdr"});
    EXPECT_EQ(environment.exit_code, 1);
    EXPECT_THAT(environment.errors, HasSubstr("/nonexistent/sky.hdr"));
    const CommandResult folder = run_nacre({"stability", "--points", "1000", "-o", "/dev/null/stability"});
    EXPECT_EQ(folder.exit_code, 1);
    EXPECT_THAT(folder.errors, HasSubstr("'/dev/null/stability'"));
    EXPECT_EQ(run_nacre({"diff", "/nonexistent/a.png", "/nonexistent/b.png"}).exit_code, 1);
}

TEST(CommandLineTest, UnknownCameraListsTheCameras) {
    EXPECT_THAT(run_nacre(render({"--camera", "nobody"})).errors, HasSubstr("Use one of: "));
}

TEST(CompletionTest, ScriptIsPrintedAndIsBash) {
    const CommandResult script = run_nacre({"completion"});
    EXPECT_EQ(script.exit_code, 0);
    EXPECT_THAT(script.output, HasSubstr("complete -F _nacre nacre"));
    const TemporaryFolder folder;
    std::ofstream(folder.path() / "nacre.bash") << script.output;
    EXPECT_EQ(run_program("bash", {"-n", folder.path() / "nacre.bash"}).exit_code, 0);
}

// Bash itself, with the line "nacre <typed>" and the cursor at its end.
std::string completed(const std::string& typed) {
    const std::string line = "nacre " + typed;
    const std::string script = "source <('" NACRE_COMMAND "' completion)\n"
                               "nacre() { '" NACRE_COMMAND "' \"$@\"; }\n"
                               "COMP_LINE='" + line + "' COMP_POINT=" + std::to_string(line.size()) +
                               "\n_nacre 2>/dev/null\nprintf '%s ' \"${COMPREPLY[@]}\"";
    return run_program("bash", {"-c", script}).output;
}

TEST(CompletionTest, CandidatesFitWhatWasTyped) {
    EXPECT_EQ(completed("re"), "render ");
    EXPECT_THAT(completed("render --pro"), HasSubstr("--profile"));
    EXPECT_THAT(completed("render --profile m"), HasSubstr("mobile"));
    EXPECT_THAT(completed("render --tone-mapping "), AllOf(HasSubstr("filmic"), HasSubstr("linear")));
    EXPECT_THAT(completed("cache "), AllOf(HasSubstr("size"), HasSubstr("purge")));
    EXPECT_THAT(completed("render builtin:sph"), HasSubstr("spheres"));
    EXPECT_THAT(completed("paint "), Not(HasSubstr("render")));
}

TEST(CacheTest, SizeAndPurge) {
    const TemporaryFolder folder;
    const std::vector<std::string> environment = {"NACRE_CACHE_DIR=" + folder.path().string()};
    const CommandResult size = run_nacre({"cache"}, environment);
    EXPECT_EQ(size.exit_code, 0);
    EXPECT_THAT(size.output, HasSubstr(folder.path().string()));
    const auto json = nlohmann::json::parse(run_nacre({"cache", "size", "--json", "-"}, environment).output);
    EXPECT_EQ(json["bytes"], 0);
    EXPECT_EQ(json["directory"], folder.path().string());
    std::ofstream(folder.path() / "mine.txt") << "not an entry";
    EXPECT_EQ(run_nacre({"cache", "purge"}, environment).exit_code, 0);
    EXPECT_TRUE(std::filesystem::exists(folder.path() / "mine.txt"));
    EXPECT_THAT(run_nacre({"cache"}, {"NACRE_CACHE_DIR=off"}).output, HasSubstr("off"));
}

class DiffTest : public testing::Test {
  protected:
    DiffTest() {
        ImageBytes a{32, 32, 3, 1, std::vector<std::uint8_t>(32 * 32 * 3, 100)};
        EXPECT_TRUE(write_png(file("a.png"), a));
        a.bytes[0] = 110;
        EXPECT_TRUE(write_png(file("b.png"), a));
        EXPECT_TRUE(write_png(file("small.png"), ImageBytes{8, 8, 3, 1, std::vector<std::uint8_t>(192, 100)}));
    }
    [[nodiscard]] std::string file(const char* name) const { return folder_.path() / name; }

  private:
    TemporaryFolder folder_;
};

TEST_F(DiffTest, EqualPictures) {
    const CommandResult result = run_nacre({"diff", file("a.png"), file("a.png"), "--json", file("d.json")});
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.output, HasSubstr("200.00 dB (equal)"));
    std::ifstream stream(file("d.json"));
    const auto json = nlohmann::json::parse(stream);
    EXPECT_EQ(json["final"]["psnr_db"], 200.0);
    EXPECT_EQ(json["final"]["max_abs_8bit"], 0);
}

TEST_F(DiffTest, DifferentPicturesAreMeasured) {
    const auto json = nlohmann::json::parse(run_nacre({"diff", file("a.png"), file("b.png"), "--json", "-"}).output);
    // One of 3072 bytes is off by 10.
    EXPECT_NEAR(json["final"]["psnr_db"].get<double>(), 10 * std::log10(3072 * 25.5 * 25.5), 1e-3);
    EXPECT_EQ(json["final"]["max_abs_8bit"], 10);
    EXPECT_DOUBLE_EQ(json["final"]["share_above_1"].get<double>(), 1.0 / 1024);
    EXPECT_GT(json["final"]["flip_mean"].get<double>(), 0.0);
}

TEST_F(DiffTest, ToleranceDecidesTheExitCode) {
    std::ofstream(file("loose.json")) << R"({"final": {"psnr_db": 40, "flip_mean": 1, "share_above_1": 1}})";
    std::ofstream(file("strict.json")) << R"({"final": {"max_abs_8bit": 9}})";
    std::ofstream(file("broken.json")) << R"({"final": {"psnr": 40}})";
    const auto exit_code = [&](const char* tolerance) {
        return run_nacre({"diff", file("a.png"), file("b.png"), "--tolerance", file(tolerance)}).exit_code;
    };
    EXPECT_EQ(exit_code("loose.json"), 0);
    EXPECT_EQ(exit_code("strict.json"), 3);
    EXPECT_EQ(exit_code("broken.json"), 2);
    EXPECT_EQ(exit_code("missing.json"), 2);
}

TEST_F(DiffTest, PageIsWritten) {
    EXPECT_EQ(run_nacre({"diff", file("a.png"), file("b.png"), "-o", file("page")}).exit_code, 0);
    for (const char* name : {"page/index.html", "page/difference.png", "page/flip.png"}) {
        EXPECT_TRUE(std::filesystem::exists(file(name))) << name;
    }
}

TEST_F(DiffTest, SizesMustAgree) {
    const CommandResult result = run_nacre({"diff", file("a.png"), file("small.png")});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.errors, HasSubstr("32 x 32 and 8 x 8"));
}

TEST_F(DiffTest, LayersOfOpenExrAreCompared) {
    LayeredImage a = make_layered_image(Image{2, 1, 3, {1, 2, 3, 4, 5, 6}});
    a.layers.push_back({"depth", {{"Z", std::vector<float>{0.5f, 0.25f}}}});
    a.layers.push_back({"material.0", {{"Y", std::vector<std::uint32_t>{7, 8}}}});
    LayeredImage b = a;
    std::get<std::vector<float>>(b.layers[1].channels[0].values)[0] = 0.75f;
    std::get<std::vector<std::uint32_t>>(b.layers[2].channels[0].values)[1] = 9;
    ASSERT_TRUE(write_exr(file("a.exr"), a));
    ASSERT_TRUE(write_exr(file("b.exr"), b));
    const auto json = nlohmann::json::parse(run_nacre({"diff", file("a.exr"), file("b.exr"), "--json", "-"}).output);
    EXPECT_EQ(json["final"]["psnr_db"], 200.0);
    std::map<std::string, int> differing;
    for (const auto& texture : json["textures"]) differing[texture["name"]] = texture["differing"];
    EXPECT_EQ(differing["depth.Z"], 1);
    EXPECT_EQ(differing["material.0.Y"], 1);
    EXPECT_EQ(differing["R"], 0);
}

}  // namespace
}  // namespace nacre
