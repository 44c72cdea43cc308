// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "backends/gl/shader.h"
#include "rhi/shader_compiler.h"

/// @file
/// SPIR-V to GLSL, without a device.

namespace nacre::gl {
namespace {

using testing::HasSubstr;
using testing::Not;

Traits es_minimum() {
    Traits traits;
    traits.es = traits.minimum = true;
    traits.version = 31;
    return traits;
}
Traits desktop() {
    Traits traits;
    traits.desktop = traits.clip_control = traits.shader_base_instance = true;
    traits.version = 45;
    return traits;
}

rhi::BackendShader make_shader(const std::string& path, const std::string& text, rhi::ShaderStage stage) {
    rhi::ShaderCompiler compiler({.embedded = {}, .debug_information = false});
    auto desc = compiler.compile({.path = path, .text = text});
    if (!desc) throw std::runtime_error(desc.error().message());
    rhi::BackendShader shader;
    shader.spirv = desc->spirv;
    shader.entry_point = "main";
    shader.name = path;
    auto reflection = rhi::reflect(shader.spirv, stage, "main", path);
    if (!reflection) throw std::runtime_error(reflection.error().message());
    shader.reflection = *reflection;
    return shader;
}

TEST(GlTranslation, UsesNothingBeyondEs31WhereHeldToIt) {
    SlotAllocator slots;
    const auto vertex = translate(make_shader("a.vert", R"(
layout(set = 2, binding = 5) uniform Camera { mat4 view; } camera;
layout(location = 0) in vec3 position;
layout(location = 0) out vec2 uv;
void main() { gl_Position = camera.view * vec4(position, 1.0); uv = position.xy * fma(position.x, 2.0, float(gl_InstanceIndex)); }
)",
                                              rhi::ShaderStage::vertex),
                                  {}, es_minimum(), slots);
    ASSERT_TRUE(vertex) << vertex.error().message();
    EXPECT_THAT(vertex->source, testing::StartsWith("#version 310 es\n"));
    EXPECT_THAT(vertex->source, Not(HasSubstr(": require")));
    // Depth from 0 to 1 is brought to OpenGL's -1 to 1 in the shader.
    EXPECT_THAT(vertex->source, HasSubstr("gl_Position.z = 2.0 * gl_Position.z - gl_Position.w"));
    const auto fragment = translate(make_shader("a.frag", R"(
layout(set = 0, binding = 1) uniform texture2D color;
layout(set = 0, binding = 2) uniform sampler smooth_;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 result;
void main() { result = texture(sampler2D(color, smooth_), uv) + vec4(gl_PointCoord, 0.0, 0.0); }
)", rhi::ShaderStage::fragment), {}, es_minimum(), slots);
    ASSERT_TRUE(fragment) << fragment.error().message();
    EXPECT_THAT(fragment->source, Not(HasSubstr(": require")));
    EXPECT_THAT(fragment->source, HasSubstr("1.0 - gl_PointCoord.y"));
    EXPECT_THAT(fragment->source, Not(HasSubstr("precision mediump float")));
}

TEST(GlTranslation, LeavesDepthAloneWithClipControl) {
    SlotAllocator slots;
    const auto vertex =
        translate(make_shader("a.vert", "void main() { gl_Position = vec4(0.5); }", rhi::ShaderStage::vertex), {},
                  desktop(), slots);
    ASSERT_TRUE(vertex) << vertex.error().message();
    EXPECT_THAT(vertex->source, testing::StartsWith("#version 450\n"));
    EXPECT_THAT(vertex->source, Not(HasSubstr("gl_Position.z =")));
}

TEST(GlTranslation, GivesEachKindOfResourceItsOwnNumbers) {
    SlotAllocator slots;
    const auto compute = translate(make_shader("a.comp", R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 3) uniform A { vec4 a; };
layout(set = 3, binding = 0) uniform B { vec4 b; } many[2];
layout(set = 1, binding = 3) buffer C { vec4 c; };
layout(set = 1, binding = 4, r32ui) uniform uimage2D image;
layout(set = 2, binding = 0) uniform texture2D color[3];
layout(set = 2, binding = 1) uniform sampler first;
layout(set = 2, binding = 2) uniform sampler second;
layout(set = 2, binding = 7) uniform sampler2D both;
void main() {
    c = a + many[1].b + textureLod(sampler2D(color[2], first), a.xy, 0.0) +
        textureLod(sampler2D(color[1], second), a.xy, 0.0) + textureLod(both, a.xy, 0.0);
    imageStore(image, ivec2(0), uvec4(1));
}
)", rhi::ShaderStage::compute), {}, desktop(), slots);
    ASSERT_TRUE(compute) << compute.error().message();
    std::uint32_t uniforms = 0, storages = 0, images = 0, units = 0;
    for (const SlotRange& range : compute->slots) {
        std::uint32_t& count = range.kind == SlotRange::Kind::uniform_buffer   ? uniforms
                               : range.kind == SlotRange::Kind::storage_buffer ? storages
                                                                               : images;
        count += range.count;
        EXPECT_LT(range.first, 3u);
    }
    for (const TextureRange& range : compute->textures) units += range.count;
    EXPECT_EQ(uniforms, 3u);
    EXPECT_EQ(storages, 1u);
    EXPECT_EQ(images, 1u);
    EXPECT_EQ(units, 7u);  // Three textures with each of two samplers, and one that has its own.
    EXPECT_EQ(compute->textures.size(), 3u);
}

TEST(GlTranslation, NamesWhatOpenGlLacks) {
    SlotAllocator slots;
    const auto subgroups = translate(make_shader("sum.comp", R"(
#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
void main() { result[gl_LocalInvocationID.x] = subgroupAdd(gl_LocalInvocationID.x); }
)", rhi::ShaderStage::compute), {}, desktop(), slots);
    ASSERT_FALSE(subgroups);
    EXPECT_EQ(subgroups.error().code, ErrorCode::unsupported);
    EXPECT_THAT(subgroups.error().message(), testing::AllOf(HasSubstr("subgroup"), HasSubstr("sum.comp")));

    const auto format = translate(make_shader("image.comp", R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 0, rg32ui) writeonly uniform uimage2D image;
void main() { imageStore(image, ivec2(0), uvec4(1)); }
)", rhi::ShaderStage::compute), {}, es_minimum(), slots);
    ASSERT_FALSE(format);
    EXPECT_EQ(format.error().code, ErrorCode::unsupported);
    EXPECT_THAT(format.error().message(), testing::AllOf(HasSubstr("image.comp"), HasSubstr("rg32_uint")));
}

}  // namespace
}  // namespace nacre::gl
