// SPDX-License-Identifier: Apache-2.0
#include "rhi/texture_pages.h"

#include <gmock/gmock.h>

#include "rhi/embedded_shaders.h"
#include "rhi/reflection.h"
#include "rhi/shader_compiler.h"

namespace nacre::rhi {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Capabilities desktop() {
    Capabilities capabilities;
    capabilities.max_texture_layers = 2048;
    capabilities.formats.fill(FormatSupport::sampled | FormatSupport::filtered | FormatSupport::color_target);
    return capabilities;
}

PageKind kind(std::uint32_t size, Format format = Format::rgba8_unorm, std::uint32_t sampler = 0) {
    Sampler handle;
    handle.index = sampler;
    return {format, size, size, full_mip_count(size, size), handle};
}

TEST(TexturePages, EqualKindsShareAPage) {
    const std::vector<PageKind> requests{kind(64), kind(32), kind(64), kind(64, Format::rgba8_srgb), kind(64)};
    const auto pages = plan_pages(requests, 8, desktop());
    ASSERT_TRUE(pages);
    ASSERT_EQ(pages->size(), 3u);
    EXPECT_THAT((*pages)[0].members, ElementsAre(0, 2, 4));
    EXPECT_THAT((*pages)[1].members, ElementsAre(1));
    for (const PlannedPage& page : *pages) EXPECT_FALSE(page.is_merged);
    EXPECT_TRUE(plan_pages({}, 8, desktop())->empty());
}

TEST(TexturePages, TheCheapestMergerIsTaken) {
    // 512 and 64 and 32: the two small ones go together.
    const auto pages = plan_pages(std::vector{kind(512), kind(64), kind(32)}, 2, desktop());
    ASSERT_TRUE(pages);
    ASSERT_EQ(pages->size(), 2u);
    EXPECT_THAT((*pages)[1].members, ElementsAre(1, 2));
    EXPECT_EQ((*pages)[1].kind.width, 64u);
    EXPECT_EQ((*pages)[1].kind.mips, 7u);
    EXPECT_TRUE((*pages)[1].is_merged);
    EXPECT_FALSE((*pages)[0].is_merged);
}

TEST(TexturePages, OtherShapesTakeTheLargerSides) {
    PageKind wide = kind(64), tall = kind(64);
    wide.height = 16, tall.width = 32;
    const auto pages = plan_pages(std::vector{wide, tall}, 1, desktop());
    ASSERT_TRUE(pages);
    EXPECT_EQ((*pages)[0].kind.width, 64u);
    EXPECT_EQ((*pages)[0].kind.height, 64u);
}

TEST(TexturePages, OtherFormatsMeetInHalfFloats) {
    const auto pages = plan_pages(std::vector{kind(64), kind(64, Format::rgba8_srgb)}, 1, desktop());
    ASSERT_TRUE(pages);
    EXPECT_EQ((*pages)[0].kind.format, Format::rgba16_float);

    // Compressed formats cannot be drawn into.
    Capabilities capabilities = desktop();
    capabilities.formats[static_cast<std::size_t>(Format::bc7_rgba_unorm)] = FormatSupport::sampled;
    const auto large = plan_pages(
        std::vector{kind(64, Format::bc7_rgba_unorm), kind(32, Format::bc7_rgba_unorm)}, 1, capabilities);
    ASSERT_TRUE(large);
    EXPECT_EQ((*large)[0].kind.format, Format::rgba16_float);
}

TEST(TexturePages, WhatCannotMergeIsAnError) {
    const auto message = [](const std::vector<PageKind>& requests, const Capabilities& capabilities) {
        const auto pages = plan_pages(requests, 1, capabilities);
        return pages ? "(no error)" : pages.error().message();
    };
    EXPECT_THAT(message({kind(64), kind(64, Format::rgba8_unorm, 7)}, desktop()), HasSubstr("2 kinds of textures"));
    EXPECT_THAT(message({kind(64), kind(64, Format::rgba8_uint)}, desktop()), HasSubstr("rgba8_uint 64x64"));
    PageKind without_mips = kind(32);
    without_mips.mips = 1;
    EXPECT_THAT(message({kind(64), without_mips}, desktop()), HasSubstr("max_pages"));
    // gles31-minimum cannot draw half floats.
    Capabilities mobile = desktop();
    mobile.formats[static_cast<std::size_t>(Format::rgba16_float)] = FormatSupport::sampled | FormatSupport::filtered;
    EXPECT_THAT(message({kind(64), kind(64, Format::rgba8_srgb)}, mobile), HasSubstr("2 kinds"));
    EXPECT_THAT(message({kind(64), kind(32)}, mobile), HasSubstr("(no error)"));
}

TEST(TexturePages, LayersAreLimited) {
    Capabilities capabilities = desktop();
    capabilities.max_texture_layers = 3;
    EXPECT_TRUE(plan_pages(std::vector(3, kind(64)), 8, capabilities));
    const auto pages = plan_pages(std::vector(4, kind(64)), 8, capabilities);
    ASSERT_FALSE(pages);
    EXPECT_THAT(pages.error().message(), HasSubstr("at most 3 layers"));
    // A merger that would have too many layers is none.
    EXPECT_FALSE(plan_pages(std::vector{kind(64), kind(64), kind(32), kind(32)}, 1, capabilities));
}

/// Every kind of table compiles for every stage and declares what the table binds.
TEST(TexturePages, TheIncludeDeclaresWhatTheTableBinds) {
    ShaderCompiler compiler({.embedded = {embedded_files()}});
    const std::string calls = "sample_table_lod(3, vec2(0.5), 0.0) + fetch_table(1, ivec2(0), 0) + "
                              "vec4(table_texture_size(2, 0), 0, 0)";
    for (const char* pages : {"0", "1", "2", "8", "12"}) {
        for (const char* stage : {"vert", "frag", "comp"}) {
            std::string text = "#version 460\n#include \"rhi/shaders/texture_table.glsl\"\n";
            const std::string path = std::string("table_") + pages + "." + stage;
            if (path.ends_with("vert")) text += "void main() { gl_Position = " + calls + "; }";
            if (path.ends_with("frag"))
                text += "layout(location = 0) in vec2 uv; layout(location = 0) out vec4 color;\n"
                        "void main() { color = sample_table(uint(gl_FragCoord.x), uv) + " + calls + "; }";
            if (path.ends_with("comp"))
                text += "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer Result { vec4 result; };\n"
                        "void main() { result = " + calls + "; }";
            const auto shader = compiler.compile({.path = path,
                                                  .defines = {{"NACRE_TEXTURE_TABLE_SET", "2"},
                                                              {"NACRE_TEXTURE_TABLE_PAGES", pages},
                                                              {"NACRE_TEXTURE_TABLE_CAPACITY", "30"}},
                                                  .text = text});
            ASSERT_TRUE(shader) << shader.error().message();
            const auto reflection = reflect(shader->spirv, shader->stage, "main", path);
            ASSERT_TRUE(reflection) << reflection.error().message();
            std::size_t textures = 0;
            for (const ReflectedBinding& binding : reflection->bindings) {
                if (binding.set != 2) continue;
                if (binding.type == BindingType::uniform_buffer) {
                    EXPECT_EQ(binding.block_size, 8u * 16);
                } else {
                    EXPECT_EQ(binding.type, BindingType::combined_texture_sampler);
                    EXPECT_EQ(binding.count, std::stoi(pages) == 0 ? 0u : 1u);
                    ++textures;
                }
            }
            EXPECT_EQ(textures, std::max<std::size_t>(1, std::stoul(pages))) << path;
        }
    }
}

}  // namespace
}  // namespace nacre::rhi
