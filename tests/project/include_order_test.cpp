// SPDX-License-Identifier: Apache-2.0
// The parts stand on floors: a part includes itself and what is below it, and no backend is seen above rhi/ except by
// executables. Checked on the text of the sources, so that a mistake is named with its line.
#include "tests/project/source_tree.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <sstream>

namespace nacre {
namespace {

struct Include {
    std::string file;
    int line = 0;
    std::string target;
    bool is_quoted = false;

    [[nodiscard]] std::string place() const { return fmt::format("{}:{} includes '{}'", file, line, target); }
};

std::vector<Include> all_includes() {
    std::vector<Include> includes;
    for (const std::string& file : source_files({".h", ".cpp", ".glsl", ".vert", ".frag", ".comp"})) {
        std::istringstream text(text_of(file));
        std::string line;
        for (int number = 1; std::getline(text, line); ++number) {
            const std::size_t directive = line.find_first_not_of(" \t");
            if (directive == std::string::npos || !line.substr(directive).starts_with("#include")) continue;
            const std::size_t begin = line.find_first_of("\"<");
            const std::size_t end = begin == std::string::npos ? begin : line.find_first_of("\">", begin + 1);
            if (end != std::string::npos)
                includes.push_back({file, number, line.substr(begin + 1, end - begin - 1), line[begin] == '"'});
        }
    }
    return includes;
}

/// "backends/vulkan" for a backend, else the first folder; nothing for what is no part (a library's header).
std::optional<std::string> part_of(const std::string& path) {
    const std::size_t slash = path.find('/');
    if (slash == std::string::npos) return {};
    std::string part = path.substr(0, slash);
    if (std::ranges::find(source_folders, part) == std::end(source_folders)) return {};
    if (part == "backends") part = path.substr(0, path.find('/', slash + 1));
    return part;
}

/// What each part may include besides itself.
const std::map<std::string, std::vector<std::string>> parts_below = {
    {"core", {}},
    {"rhi", {"core"}},
    {"materials", {"core", "rhi"}},
    {"scene", {"core", "rhi", "materials"}},
    {"raytracing", {"core", "rhi", "materials", "scene"}},
    {"passes", {"core", "rhi", "materials", "scene", "raytracing"}},
    {"measure", {"core", "rhi", "materials", "scene", "raytracing", "passes"}},
};

bool may_include(const std::string& part, const std::string& target) {
    if (part == target || part == "samples" || part == "tests") return target != "tests" || part == "tests";
    if (part.starts_with("backends/")) return target == "rhi" || target == "core";
    const auto below = parts_below.find(part);
    return below != parts_below.end() && std::ranges::find(below->second, target) != below->second.end();
}

TEST(IncludeOrder, NothingIncludesUpwardAndNothingAboveTheRhiIncludesABackend) {
    const std::vector<Include> includes = all_includes();
    EXPECT_GT(includes.size(), 100U) << "the scan finds nothing";
    for (const Include& include : includes) {
        const auto part = part_of(include.file);
        const auto target = part_of(include.target);
        if (!include.is_quoted || !part || !target) continue;
        EXPECT_TRUE(may_include(*part, *target)) << include.place() << ", but " << *part << " may not use " << *target;
    }
}

TEST(IncludeOrder, TheRuleRejectsWhatItShould) {
    EXPECT_FALSE(may_include("core", "rhi"));
    EXPECT_FALSE(may_include("passes", "backends/gl"));
    EXPECT_FALSE(may_include("backends/gl", "backends/vulkan"));
    EXPECT_FALSE(may_include("samples", "tests"));
    EXPECT_TRUE(may_include("samples", "backends/gl"));
    EXPECT_EQ(part_of("backends/gl/device.h"), "backends/gl");
    EXPECT_EQ(part_of("gtest/gtest.h"), std::nullopt);
}

TEST(IncludeOrder, GraphicsInterfacesAreIncludedByTheirBackendAlone) {
    for (const Include& include : all_includes()) {
        const bool is_vulkan = include.target.starts_with("vulkan/") || include.target.starts_with("vk_");
        const bool is_gl = include.target.starts_with("GL/") || include.target.starts_with("EGL/") ||
                           include.target.starts_with("GLES");
        if (!is_vulkan && !is_gl) continue;
        const std::string folder = is_vulkan ? "backends/vulkan/" : "backends/gl/";
        EXPECT_TRUE(include.file.starts_with(folder) || include.file.starts_with("tests/")) << include.place();
    }
}

TEST(IncludeOrder, HeavyLibrariesStayInTheFolderThatUsesThem) {
    const std::vector<Include> includes = all_includes();
    std::map<std::string, std::string> heavy_headers;
    for (const Include& include : includes) {
        if (!include.file.ends_with(".h") || include.file.starts_with("tests/") || include.is_quoted) continue;
        for (const char* library : {"nlohmann/json.hpp", "glslang/", "spirv_cross", "spirv-tools/", "png.h",
                                    "jpeglib.h", "OpenEXR/", "CLI/", "spdlog/", "tbb/", "tiny_gltf"})
            if (include.target.starts_with(library)) heavy_headers[include.file] = include.target;
    }
    const auto folder_of = [](const std::string& path) { return path.substr(0, path.rfind('/')); };
    for (const Include& include : includes) {
        const auto heavy = heavy_headers.find(include.target);
        if (heavy == heavy_headers.end() || include.file.starts_with("tests/")) continue;
        EXPECT_EQ(folder_of(include.file), folder_of(include.target))
            << include.place() << " and with it <" << heavy->second << ">, which is costly to compile";
    }
}

}  // namespace
}  // namespace nacre
