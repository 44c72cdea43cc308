// SPDX-License-Identifier: Apache-2.0
#include "rhi/reflection.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "tests/rhi/shader_text.h"

namespace nacre::rhi {
namespace {

using test::compile_text;
using test::reflect_text;
using ::testing::Contains;
using ::testing::HasSubstr;

const ReflectedBinding* find(const ShaderReflection& reflection, std::uint32_t set, std::uint32_t binding) {
    const auto found = std::ranges::find_if(
        reflection.bindings, [&](const ReflectedBinding& b) { return b.set == set && b.binding == binding; });
    return found == reflection.bindings.end() ? nullptr : &*found;
}

TEST(Reflection, ListsEveryKindOfBinding) {
    const ShaderReflection reflection = reflect_text("all.comp", R"(
        layout(local_size_x = 8, local_size_y = 4) in;
        layout(set = 0, binding = 0) uniform Camera { mat4 view; vec3 eye; float time; } camera;
        layout(set = 0, binding = 1, std430) readonly buffer Lights { uint count; vec4 lights[]; } lights;
        layout(set = 0, binding = 2, std430) buffer Counters { uint counters[4]; };
        layout(set = 1, binding = 0) uniform sampler2D albedo;
        layout(set = 1, binding = 1) uniform texture2DArray pages;
        layout(set = 1, binding = 2) uniform sampler nearest;
        layout(set = 1, binding = 3) uniform samplerCubeShadow shadow;
        layout(set = 1, binding = 4) uniform usampler3D words;
        layout(set = 1, binding = 5) uniform sampler2D many[3];
        layout(set = 1, binding = 6) uniform isampler2DMS samples;
        layout(set = 2, binding = 0, r32ui) uniform uimage2D both;
        layout(set = 2, binding = 1, rgba16f) uniform readonly image2D input_image;
        layout(set = 2, binding = 2, rgba8) uniform writeonly image2DArray output_image;
        void main() {
            counters[0] = lights.count + texelFetch(words, ivec3(0), 0).x;
            imageStore(both, ivec2(0), uvec4(camera.time));
        })");
    ASSERT_EQ(reflection.bindings.size(), 13u);
    EXPECT_EQ(reflection.stage, ShaderStage::compute);
    EXPECT_THAT(reflection.workgroup_size, ::testing::ElementsAre(8, 4, 1));

    const ReflectedBinding& camera = *find(reflection, 0, 0);
    EXPECT_EQ(camera.type, BindingType::uniform_buffer);
    EXPECT_EQ(camera.block_size, 80u);
    EXPECT_EQ(camera.name, "camera");
    EXPECT_TRUE(camera.used);
    EXPECT_EQ(find(reflection, 0, 1)->type, BindingType::readonly_storage_buffer);
    EXPECT_EQ(find(reflection, 0, 1)->block_size, 16u);
    EXPECT_EQ(find(reflection, 0, 2)->type, BindingType::storage_buffer);
    EXPECT_EQ(find(reflection, 0, 2)->block_size, 16u);
    EXPECT_EQ(find(reflection, 0, 2)->name, "Counters");
    const ReflectedBinding& albedo = *find(reflection, 1, 0);
    EXPECT_EQ(albedo.type, BindingType::combined_texture_sampler);
    EXPECT_EQ(albedo.dimension, ViewDimension::d2);
    EXPECT_EQ(albedo.sampled_kind, FormatKind::floating);
    EXPECT_FALSE(albedo.depth_comparison);
    EXPECT_FALSE(albedo.used);
    EXPECT_EQ(find(reflection, 1, 1)->type, BindingType::sampled_texture);
    EXPECT_EQ(find(reflection, 1, 1)->dimension, ViewDimension::d2_array);
    EXPECT_EQ(find(reflection, 1, 2)->type, BindingType::sampler);
    EXPECT_TRUE(find(reflection, 1, 3)->depth_comparison);
    EXPECT_EQ(find(reflection, 1, 3)->dimension, ViewDimension::cube);
    EXPECT_EQ(find(reflection, 1, 4)->sampled_kind, FormatKind::uint);
    EXPECT_EQ(find(reflection, 1, 4)->dimension, ViewDimension::d3);
    EXPECT_EQ(find(reflection, 1, 5)->count, 3u);
    EXPECT_TRUE(find(reflection, 1, 6)->multisampled);
    EXPECT_EQ(find(reflection, 1, 6)->sampled_kind, FormatKind::sint);
    EXPECT_EQ(find(reflection, 2, 0)->type, BindingType::storage_image);
    EXPECT_EQ(find(reflection, 2, 0)->image_format, Format::r32_uint);
    EXPECT_EQ(find(reflection, 2, 1)->type, BindingType::readonly_storage_image);
    EXPECT_EQ(find(reflection, 2, 1)->image_format, Format::rgba16_float);
    EXPECT_EQ(find(reflection, 2, 2)->type, BindingType::writeonly_storage_image);
    EXPECT_EQ(find(reflection, 2, 2)->dimension, ViewDimension::d2_array);
}

TEST(Reflection, KnowsTexelBuffers) {
    const ShaderReflection reflection = reflect_text("texels.comp", R"(
        #extension GL_EXT_samplerless_texture_functions : require
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) uniform samplerBuffer floats;
        layout(set = 0, binding = 1) uniform usamplerBuffer words[3];
        layout(set = 0, binding = 2) uniform itextureBuffer whole_numbers;
        layout(set = 1, binding = 0, r32ui) uniform uimageBuffer both;
        layout(set = 1, binding = 1, rgba16f) uniform readonly imageBuffer read;
        layout(set = 1, binding = 2) uniform writeonly iimageBuffer written;
        void main() {
            imageStore(written, 0, texelFetch(whole_numbers, 1) + ivec4(texelFetch(floats, 2) + imageLoad(read, 3)));
            imageAtomicAdd(both, 4, 5u);
        })");
    const ReflectedBinding& floats = *find(reflection, 0, 0);
    EXPECT_EQ(floats.type, BindingType::uniform_texel_buffer);
    EXPECT_EQ(floats.sampled_kind, FormatKind::floating);
    EXPECT_EQ(floats.dimension, ViewDimension::automatic);
    EXPECT_EQ(floats.image_format, Format::undefined);
    EXPECT_TRUE(floats.used);
    EXPECT_EQ(find(reflection, 0, 1)->type, BindingType::uniform_texel_buffer);
    EXPECT_EQ(find(reflection, 0, 1)->sampled_kind, FormatKind::uint);
    EXPECT_EQ(find(reflection, 0, 1)->count, 3u);
    EXPECT_FALSE(find(reflection, 0, 1)->used);
    EXPECT_EQ(find(reflection, 0, 2)->type, BindingType::uniform_texel_buffer);
    EXPECT_EQ(find(reflection, 0, 2)->sampled_kind, FormatKind::sint);
    EXPECT_EQ(find(reflection, 1, 0)->type, BindingType::storage_texel_buffer);
    EXPECT_EQ(find(reflection, 1, 0)->image_format, Format::r32_uint);
    EXPECT_EQ(find(reflection, 1, 1)->type, BindingType::readonly_storage_texel_buffer);
    EXPECT_EQ(find(reflection, 1, 1)->image_format, Format::rgba16_float);
    EXPECT_EQ(find(reflection, 1, 2)->type, BindingType::writeonly_storage_texel_buffer);
    EXPECT_EQ(find(reflection, 1, 2)->image_format, Format::undefined);
    EXPECT_THAT(reflection.capabilities, Contains("SampledBuffer"));
    EXPECT_THAT(reflection.capabilities, Contains("ImageBuffer"));
}

TEST(Reflection, KnowsUnboundedArrays) {
    const ShaderReflection reflection = reflect_text("bindless.frag", R"(
        #extension GL_EXT_nonuniform_qualifier : require
        layout(set = 1, binding = 0) uniform sampler2D textures[];
        layout(location = 0) flat in uint index;
        layout(location = 0) out vec4 color;
        void main() { color = texture(textures[nonuniformEXT(index)], vec2(0)); })");
    ASSERT_EQ(reflection.bindings.size(), 1u);
    EXPECT_EQ(reflection.bindings[0].count, 0u);
    EXPECT_THAT(reflection.capabilities, Contains("RuntimeDescriptorArray"));
    EXPECT_THAT(reflection.capabilities, Contains("SampledImageArrayNonUniformIndexing"));
}

TEST(Reflection, ListsInputsAndOutputs) {
    const ShaderReflection vertex = reflect_text("all.vert", R"(
        layout(location = 0) in vec3 position;
        layout(location = 1) in uvec2 words;
        layout(location = 2) in mat4x3 transform;
        layout(location = 6) in int id;
        layout(location = 0) out Varyings { vec3 normal; flat uint material; vec2 uvs[2]; } result;
        layout(location = 7, component = 2) out vec2 packed;
        void main() { gl_Position = vec4(position, 1); result.normal = vec3(0); packed = vec2(0); })");
    ASSERT_EQ(vertex.inputs.size(), 4u);
    EXPECT_EQ(vertex.inputs[0].components, 3u);
    EXPECT_EQ(vertex.inputs[0].kind, FormatKind::floating);
    EXPECT_EQ(vertex.inputs[0].name, "position");
    EXPECT_EQ(vertex.inputs[1].kind, FormatKind::uint);
    EXPECT_EQ(vertex.inputs[1].components, 2u);
    EXPECT_EQ(vertex.inputs[2].locations, 4u);
    EXPECT_EQ(vertex.inputs[2].components, 3u);
    EXPECT_EQ(vertex.inputs[3].location, 6u);
    EXPECT_EQ(vertex.inputs[3].kind, FormatKind::sint);
    EXPECT_EQ(vertex.inputs[3].components, 1u);
    ASSERT_EQ(vertex.outputs.size(), 4u) << "gl_PerVertex is none of ours";
    EXPECT_EQ(vertex.outputs[1].location, 1u);
    EXPECT_EQ(vertex.outputs[1].kind, FormatKind::uint);
    EXPECT_EQ(vertex.outputs[2].location, 2u);
    EXPECT_EQ(vertex.outputs[2].locations, 2u);
    EXPECT_EQ(vertex.outputs[3].first_component, 2u);

    const ShaderReflection fragment = reflect_text("dual.frag", R"(
        layout(early_fragment_tests) in;
        layout(location = 0, index = 0) out vec4 color;
        layout(location = 0, index = 1) out vec4 factor;
        void main() { color = vec4(1); factor = vec4(0.5); })");
    ASSERT_EQ(fragment.outputs.size(), 2u);
    EXPECT_EQ(fragment.outputs[0].index, 0u);
    EXPECT_EQ(fragment.outputs[1].index, 1u);
    EXPECT_TRUE(fragment.early_fragment_tests);
    EXPECT_FALSE(fragment.writes_depth);
    EXPECT_FALSE(fragment.discards);
}

TEST(Reflection, SeesWhatFragmentsDo) {
    const ShaderReflection reflection = reflect_text("holes.frag", R"(
        void hole() { if (gl_FragCoord.x > 3.0) discard; }
        void main() { hole(); gl_FragDepth = 0.5; })");
    EXPECT_TRUE(reflection.discards);
    EXPECT_TRUE(reflection.writes_depth);
    EXPECT_FALSE(reflection.early_fragment_tests);
}

TEST(Reflection, KnowsSpecializationAndPushConstants) {
    const ShaderReflection reflection = reflect_text("constants.comp", R"(
        layout(local_size_x_id = 7, local_size_y = 2) in;
        layout(constant_id = 3) const uint light_count = 4;
        layout(constant_id = 1) const bool has_shadows = true;
        layout(push_constant) uniform Parameters { layout(offset = 16) mat3x2 m; uvec3 size; } parameters;
        layout(set = 0, binding = 0) buffer Words { uint words[]; };
        void main() { words[0] = has_shadows ? light_count * parameters.size.x : 0; })");
    ASSERT_EQ(reflection.specialization.size(), 3u);
    EXPECT_EQ(reflection.specialization[0].id, 1u);
    EXPECT_EQ(reflection.specialization[0].name, "has_shadows");
    EXPECT_EQ(reflection.specialization[1].id, 3u);
    EXPECT_EQ(reflection.specialization[2].id, 7u);
    EXPECT_THAT(reflection.workgroup_size, ::testing::ElementsAre(1, 2, 1));
    EXPECT_EQ(reflection.workgroup_size_ids[0], 7u);
    EXPECT_EQ(reflection.workgroup_size_ids[1], ~0u);
    // mat3x2 at 16: three columns of 8 bytes; uvec3 at 48.
    EXPECT_EQ(reflection.push_constant_bytes, 60u);
}

TEST(Reflection, SubgroupsAreSeen) {
    EXPECT_TRUE(reflect_text("wave.comp", R"(
        #extension GL_KHR_shader_subgroup_arithmetic : require
        layout(local_size_x = 32) in;
        layout(set = 0, binding = 0) buffer Words { uint words[]; };
        void main() { words[0] = subgroupAdd(words[gl_LocalInvocationIndex]); })").uses_subgroups);
}

TEST(Reflection, SharedBindingsTakeTheWiderAccess) {
    const ShaderReflection reflection = reflect_text("shared.comp", R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) readonly buffer Words { uint words[]; };
        layout(set = 0, binding = 0) buffer Floats { float floats[]; };
        void main() { floats[0] = float(words[1]); })");
    ASSERT_EQ(reflection.bindings.size(), 1u);
    EXPECT_EQ(reflection.bindings[0].type, BindingType::storage_buffer);

    const ShaderDesc clash = compile_text("clash.comp", R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Words { uint words[]; };
        layout(set = 0, binding = 0) uniform sampler2D albedo;
        void main() { words[0] = uint(texelFetch(albedo, ivec2(0), 0).x); })");
    const auto error = reflect(clash.spirv, clash.stage, "main", "clash.comp");
    ASSERT_FALSE(error);
    EXPECT_THAT(error.error().message(), HasSubstr("share set 0, binding 0"));
}

TEST(Reflection, NestedStructuresHaveTheirSize) {
    std::string text = "struct S0 { float a; };\n";
    for (int i = 1; i <= 10; ++i) {
        const std::string inner = "S" + std::to_string(i - 1);
        text += "struct S" + std::to_string(i) + " { " + inner + " a; " + inner + " b; };\n";
    }
    const ShaderReflection reflection = reflect_text("nested.comp", text + R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0, std430) buffer Words { S10 a; S10 b; float tail[]; };
        void main() { tail[0] = b.a.a.a.a.a.a.a.a.a.a.a; })");
    ASSERT_EQ(reflection.bindings.size(), 1u);
    EXPECT_EQ(reflection.bindings[0].block_size, 2u * 1024 * 4);
}

}  // namespace
}  // namespace nacre::rhi
