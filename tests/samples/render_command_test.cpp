// SPDX-License-Identifier: Apache-2.0
// The commands that need a device, on every backend that works here.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/file.h"
#include "core/image.h"
#include "tests/core/temporary_folder.h"
#include "tests/samples/run_command.h"

namespace nacre {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::Gt;
using testing::HasSubstr;
using testing::Lt;

// Shared by all tests of this program, so that shaders are compiled once.
const std::vector<std::string>& environment() {
    static const TemporaryFolder cache;
    static const std::vector<std::string> entries = {"NACRE_CACHE_DIR=" + cache.path().string()};
    return entries;
}

CommandResult nacre(const std::vector<std::string>& arguments) { return run_nacre(arguments, environment()); }

json read_json(const std::filesystem::path& path) {
    std::ifstream stream(path);
    return json::parse(stream, nullptr, false);
}

std::vector<std::string> keys_of(const json& object) {
    std::vector<std::string> keys;
    for (const auto& [key, value] : object.items()) keys.push_back(key);
    return keys;
}

// The backends of which a device works here.
const std::vector<std::string>& backends() {
    static const std::vector<std::string> names = [] {
        std::vector<std::string> found;
        const json devices = json::parse(nacre({"devices", "--json", "-"}).output, nullptr, false);
        if (devices.is_discarded()) return found;
        for (const json& device : devices["devices"]) {
            if (device["index"] == 0) found.push_back(device["backend"]);
        }
        return found;
    }();
    return names;
}

class RenderCommandTest : public testing::Test {
  protected:
    void SetUp() override {
        // This backend is in every build and needs no driver.
        ASSERT_NE(std::ranges::find(backends(), "cpu"), backends().end());
    }
    [[nodiscard]] std::string file(const std::string& name) const { return folder_.path() / name; }

  private:
    TemporaryFolder folder_;
};

TEST_F(RenderCommandTest, DevicesAreListed) {
    const CommandResult result = nacre({"devices"});
    EXPECT_EQ(result.exit_code, 0);
    for (const std::string& backend : backends()) EXPECT_THAT(result.output, HasSubstr(backend));
    const json devices = json::parse(nacre({"devices", "--capabilities", "--json", "-"}).output);
    for (const json& device : devices["devices"]) {
        EXPECT_FALSE(device["name"].get<std::string>().empty());
        EXPECT_TRUE(device["capabilities"].contains("max_texture_2d")) << device["backend"];
    }
}

TEST_F(RenderCommandTest, WatchedShadersChangeThePicture) {
    const auto wait_for = [](const std::function<bool()>& is_so) {
        for (int tries = 0; tries < 600 && !is_so(); ++tries)
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
        return is_so();
    };
    const std::filesystem::path shader = "passes/tonemap/tonemap.comp";
    const std::string original = *read_text_file(std::filesystem::path(NACRE_SOURCE_DIR) / shader);
    const TemporaryFolder sources;
    const auto write = [&](const std::string& before, const std::string& after) {
        std::string text = original;
        const std::size_t at = text.find(before);
        ASSERT_NE(at, std::string::npos);
        ASSERT_TRUE(write_file_atomically(sources.path() / shader, text.replace(at, before.size(), after)));
    };
    write("", "");
    const std::string picture = file("watched.png");
    RunningProgram program(NACRE_COMMAND,
                           {"render", "builtin:triangle", "-o", picture, "--size", "64x36", "-b", backends().front(),
                            "--watch", sources.path()},
                           environment());
    ASSERT_TRUE(wait_for([&] { return program.errors().find("watching") != std::string::npos; })) << program.errors();
    const auto before = *read_image_bytes(picture);

    write("vec4(srgb_encoded(clamp(color, 0.0, 1.0)), 1.0)", "vec4(0.0, 1.0, 0.0, 1.0)");
    ASSERT_TRUE(wait_for([&] { return (*read_image_bytes(picture)).bytes != before.bytes; })) << program.errors();
    const auto green = *read_image_bytes(picture);
    for (std::size_t i = 0; i < green.bytes.size(); ++i) {
        ASSERT_EQ(green.bytes[i], i % green.channels == 1 || i % green.channels == 3 ? 255 : 0);
    }

    write("imageStore(", "image_store(");
    ASSERT_TRUE(wait_for([&] { return program.errors().find("image_store") != std::string::npos; }))
        << program.errors();
    EXPECT_THAT(program.errors(), HasSubstr("passes/tonemap/tonemap.comp:"));
    EXPECT_EQ((*read_image_bytes(picture)).bytes, green.bytes) << "a shader that does not compile changes nothing";

    write("", "");
    ASSERT_TRUE(wait_for([&] { return (*read_image_bytes(picture)).bytes == before.bytes; })) << program.errors();
    program.interrupt();
    const CommandResult result = program.wait();
    EXPECT_EQ(result.exit_code, 0) << result.errors;

    const CommandResult missing =
        nacre({"render", "builtin:triangle", "-o", picture, "--watch", (sources.path() / "missing").string()});
    EXPECT_EQ(missing.exit_code, 1);
    EXPECT_THAT(missing.errors, HasSubstr("there is no such folder"));
}

// Drivers are found by the process that looks for them, so each absence takes a process of its own.
TEST_F(RenderCommandTest, MissingDriversAreNamedAndTheOthersGoOn) {
    const auto has = [](const std::string& name) { return std::ranges::find(backends(), name) != backends().end(); };
    const auto devices_without = [](std::vector<std::string> variables) {
        variables.insert(variables.end(), environment().begin(), environment().end());
        const CommandResult result = run_nacre({"devices"}, variables);
        EXPECT_EQ(result.exit_code, 0) << result.errors;
        return result.output;
    };
    if (has("vulkan") && backends().size() > 1) {
        const std::string found = devices_without({"VK_ICD_FILENAMES=/nonexistent", "VK_DRIVER_FILES=/nonexistent"});
        EXPECT_THAT(found, AllOf(HasSubstr("vulkan cannot be used: "), HasSubstr("mesa-vulkan-drivers")));
        for (const std::string& name : backends()) {
            if (name != "vulkan") {
                EXPECT_THAT(found, HasSubstr("\n" + name + " "));
            }
        }
    }
    if (has("gles") && has("vulkan")) {
        const std::string found = devices_without({"__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent"});
        EXPECT_THAT(found,
                    AllOf(HasSubstr("gles cannot be used: "), HasSubstr("libegl-mesa0"), HasSubstr("\nvulkan ")));
    }
}

TEST_F(RenderCommandTest, PictureAndJsonOnEveryBackend) {
    for (const std::string& backend : backends()) {
        SCOPED_TRACE(backend);
        const CommandResult result = nacre({"render", "builtin:spheres", "-o", file("a.png"), "--backend", backend,
                                            "--size", "192x108", "--frames", "2", "--json", file("a.json")});
        ASSERT_EQ(result.exit_code, 0) << result.errors;
        const auto picture = read_image_bytes(file("a.png"));
        ASSERT_TRUE(picture) << picture.error().message();
        EXPECT_EQ(picture->width, 192u);
        EXPECT_EQ(picture->height, 108u);
        const json figures = read_json(file("a.json"));
        EXPECT_THAT(keys_of(figures), testing::UnorderedElementsAre("backend", "device", "profile", "size", "frame_ms",
                                                                    "passes", "memory_bytes", "median_luminance",
                                                                    "warnings"));
        EXPECT_EQ(figures["backend"], backend);
        EXPECT_EQ(figures["size"], json({192, 108}));
        EXPECT_THAT(figures["frame_ms"]["median"].get<double>(), Gt(0.0));
        EXPECT_LE(figures["frame_ms"]["min"], figures["frame_ms"]["median"]);
        EXPECT_LE(figures["frame_ms"]["median"], figures["frame_ms"]["max"]);
        EXPECT_THAT(figures["passes"].size(), Gt(2u));
        EXPECT_THAT(figures["memory_bytes"].get<std::uint64_t>(), Gt(192u * 108u * 12u));
        EXPECT_THAT(figures["median_luminance"].get<double>(), AllOf(Gt(0.05), Lt(0.9)));
    }
}

TEST_F(RenderCommandTest, ExposureIsInStops) {
    const auto render = [&](const char* exposure) {
        const CommandResult result =
            nacre({"render", "builtin:spheres", "-o", file("a.png"), "--size", "96x54", "--exposure", exposure,
                   "--tone-mapping", "linear", "--json", file("a.json")});
        EXPECT_EQ(result.exit_code, 0) << result.errors;
        return read_json(file("a.json"))["median_luminance"].get<double>();
    };
    // Far below white, linear tone mapping is proportional.
    EXPECT_NEAR(render("-3") / render("-4"), 2.0, 0.25);
}

TEST_F(RenderCommandTest, OpenExrHoldsThePassesAsLayers) {
    const CommandResult result = nacre({"render", "builtin:spheres", "-o", file("a.exr"), "--size", "96x54"});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    const auto layered = read_exr_layers(file("a.exr"));
    ASSERT_TRUE(layered) << layered.error().message();
    const auto layer = [&](std::string_view name) {
        const auto found = std::ranges::find(layered->layers, name, &ImageLayer::name);
        return found == layered->layers.end() ? nullptr : &*found;
    };
    for (const char* name : {"", "material.0", "material.1", "top_layer"}) {
        ASSERT_NE(layer(name), nullptr) << "'" << name << "'";
    }
    EXPECT_EQ(layer("")->channels.size(), 3u);
    EXPECT_TRUE(std::holds_alternative<std::vector<float>>(layer("")->channels[0].values));
    EXPECT_TRUE(std::holds_alternative<std::vector<std::uint32_t>>(layer("material.0")->channels[0].values));
}

TEST_F(RenderCommandTest, DumpIsWrittenBesideThePicture) {
    CommandResult result =
        nacre({"render", "builtin:spheres", "-o", file("a.png"), "--size", "96x54", "--dump", "top_layer"});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_EQ(read_image_info(file("a.top_layer.png"))->width, 96u);
    result = nacre({"render", "builtin:spheres", "-o", file("a.exr"), "--size", "96x54", "--dump", "top_layer"});
    ASSERT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_TRUE(read_exr_layers(file("a.top_layer.exr")));
    result = nacre({"render", "builtin:spheres", "-o", file("a.png"), "--size", "96x54", "--dump", "nothing"});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.errors, AllOf(HasSubstr("'nothing'"), HasSubstr("top_layer")));
}

TEST_F(RenderCommandTest, GraphIsDrawn) {
    for (const char* name : {"graph.svg", "graph.dot"}) {
        const CommandResult result = nacre({"render", "builtin:triangle", "-o", file("a.png"), "--size", "32x32",
                                            "--dump-graph", file(name)});
        ASSERT_EQ(result.exit_code, 0) << result.errors;
        std::ifstream stream(file(name));
        const std::string text((std::istreambuf_iterator<char>(stream)), {});
        EXPECT_THAT(text, HasSubstr("material.0"));
    }
}

TEST_F(RenderCommandTest, BackendsThatAreWrongAreNamed) {
    const auto wrong = [&](const std::string& backend) {
        return nacre({"render", "builtin:triangle", "-o", file("a.png"), "--backend", backend});
    };
    EXPECT_EQ(wrong("direct3d").exit_code, 2);
    EXPECT_THAT(wrong("direct3d").errors, AllOf(HasSubstr("'direct3d'"), HasSubstr("vulkan")));
    for (const std::string& backend : backends()) {
        for (const char* options : {":lanes=0x", ":threads=many", ":fastest", ":lanes=7", ":"}) {
            const CommandResult result = wrong(backend + options);
            EXPECT_EQ(result.exit_code, 2) << backend << options << ": " << result.errors;
        }
        const CommandResult device = nacre({"render", "builtin:triangle", "-o", file("a.png"), "--backend", backend,
                                            "--device", "1000"});
        EXPECT_NE(device.exit_code, 0);
        EXPECT_THAT(device.errors, HasSubstr("1000"));
    }
}

TEST_F(RenderCommandTest, WhatCannotBeWrittenIsAFailure) {
    const CommandResult result = nacre({"render", "builtin:triangle", "-o", "/dev/null/a.png", "--size", "16x16"});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.errors, HasSubstr("/dev/null"));
}

TEST_F(RenderCommandTest, ExplainShowsThePlan) {
    const CommandResult text = nacre({"explain", "builtin:spheres", "--profile", "low"});
    ASSERT_EQ(text.exit_code, 0) << text.errors;
    EXPECT_THAT(text.output, AllOf(HasSubstr("material.0"), HasSubstr("base_pass.frag")));
    const CommandResult result = nacre({"explain", "builtin:spheres", "--json", "-"});
    EXPECT_FALSE(json::parse(result.output, nullptr, false).is_discarded()) << result.output;
}

TEST_F(RenderCommandTest, BackendAgreesWithItself) {
    const std::string& backend = backends().front();
    const CommandResult result = nacre({"compare", "builtin:spheres", "--backends", backend + "," + backend, "--size",
                                        "160x90", "--json", file("c.json")});
    ASSERT_EQ(result.exit_code, 0) << result.output << result.errors;
    const json comparison = read_json(file("c.json"));
    EXPECT_THAT(keys_of(comparison), testing::UnorderedElementsAre("scene", "reference", "results"));
    ASSERT_EQ(comparison["results"].size(), 1u);
    EXPECT_THAT(comparison["results"][0]["textures"].size(), Gt(3u));
    for (const json& texture : comparison["results"][0]["textures"]) {
        EXPECT_THAT(keys_of(texture), testing::UnorderedElementsAre("name", "texels", "differing", "fields_differing",
                                                                    "max_abs", "max_rel"));
        EXPECT_EQ(texture["differing"], 0) << texture["name"];
    }
    EXPECT_EQ(comparison["results"][0]["final"]["psnr_db"], 200.0);
}

// Lane counts and threads must not show in the consistent mode: every texture of the frame has the same bits.
TEST_F(RenderCommandTest, LanesAndThreadsLeaveConsistentPicturesAlone) {
    for (const char* scene : {"builtin:spheres", "builtin:alpha"}) {
        const CommandResult result =
            nacre({"compare", scene, "--backends",
                   "cpu:consistent:lanes=16:threads=2,cpu:consistent:lanes=16:threads=1,cpu:consistent:lanes=8,"
                   "cpu:consistent:lanes=4",
                   "--size", "320x180", "--json", file("c.json")});
        ASSERT_EQ(result.exit_code, 0) << result.output << result.errors;
        const json comparison = read_json(file("c.json"));
        ASSERT_EQ(comparison["results"].size(), 3u);
        for (const json& backend : comparison["results"]) {
            EXPECT_THAT(backend["textures"].size(), Gt(3u));
            for (const json& texture : backend["textures"])
                EXPECT_EQ(texture["differing"], 0) << scene << " " << backend["backend"] << " " << texture["name"];
            EXPECT_EQ(backend["final"]["psnr_db"], 200.0);
        }
    }
}

TEST_F(RenderCommandTest, BackendsAgreeWithEachOther) {
    if (backends().size() < 2) GTEST_SKIP() << "only one backend works here";
    std::string list;
    for (const std::string& backend : backends()) list += (list.empty() ? "" : ",") + backend;
    const CommandResult result =
        nacre({"compare", "builtin:spheres", "--backends", list, "--size", "320x180", "-o", file("page")});
    EXPECT_EQ(result.exit_code, 0) << result.output << result.errors;
    EXPECT_TRUE(std::filesystem::exists(file("page/index.html")));
    for (const std::string& backend : backends())
        EXPECT_TRUE(std::filesystem::exists(file("page/" + backend + ".png")));
}

TEST_F(RenderCommandTest, ToleranceDecidesTheExitCode) {
    if (backends().size() < 2) GTEST_SKIP() << "only one backend works here";
    std::ofstream(file("impossible.json")) << R"({"final": {"psnr_db": 201}})";
    const CommandResult result =
        nacre({"compare", "builtin:triangle", "--backends", backends()[0] + "," + backends()[1], "--size", "64x64",
               "--tolerance", file("impossible.json")});
    EXPECT_EQ(result.exit_code, 3) << result.output << result.errors;
    EXPECT_THAT(result.output, HasSubstr("over the tolerance"));
}

TEST_F(RenderCommandTest, DemoWritesItsPage) {
    const CommandResult result = nacre({"demo", "-o", file("demo"), "--size", "160x90", "--frames", "1"});
    EXPECT_EQ(result.exit_code, 0) << result.output << result.errors;
    EXPECT_THAT(result.output, AllOf(HasSubstr("milliseconds"), HasSubstr(file("demo/index.html"))));
    EXPECT_TRUE(std::filesystem::exists(file("demo/index.html")));
}

}  // namespace
}  // namespace nacre
