// SPDX-License-Identifier: Apache-2.0
// SPIR-V that is broken in every way we could think of, and in thousands that nobody thought of: an error, never a
// crash.
#include "rhi/spirv.h"

#include <gmock/gmock.h>

#include <random>

#include "tests/rhi/assembly.h"
#include "tests/rhi/shader_text.h"

namespace nacre::rhi {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const ShaderDesc& good_shader() {
    static const ShaderDesc shader = test::compile_text("good.comp", R"(
        layout(local_size_x_id = 2, local_size_y = 4) in;
        struct Light { vec4 position; mat3 rotation; float range[3]; };
        layout(set = 0, binding = 0) uniform Camera { mat4 view; vec3 eye; } camera;
        layout(set = 0, binding = 1, std430) readonly buffer Lights { Light lights[]; };
        layout(set = 1, binding = 0) uniform sampler2DArray pages[2];
        layout(set = 1, binding = 1, rgba16f) uniform writeonly image2D result;
        layout(push_constant) uniform Parameters { uvec2 size; uint count; } parameters;
        layout(constant_id = 1) const float scale = 2.0;
        float weight(uint i) { return lights[i].range[i % 3] * scale; }
        void main() {
            vec3 sum = vec3(0);
            for (uint i = 0; i < parameters.count; ++i) sum += lights[i].rotation * lights[i].position.xyz * weight(i);
            sum += textureLod(pages[1], vec3(0.5), 0.0).xyz + (camera.view * vec4(camera.eye, 1)).xyz;
            imageStore(result, ivec2(gl_GlobalInvocationID.xy), vec4(sum, 1));
        })");
    return shader;
}

Expected<ShaderReflection> try_reflect(const std::vector<std::uint32_t>& words,
                                       ShaderStage stage = ShaderStage::compute) {
    return reflect(words, stage, "main", "test module");
}

std::string message_of(const std::vector<std::uint32_t>& words) {
    const auto result = try_reflect(words);
    return result ? "(no error)" : result.error().message();
}

/// From SPIR-V assembly, so that modules which GLSL cannot say can be made.
std::vector<std::uint32_t> assemble(const std::string& text, spv_target_env environment = SPV_ENV_UNIVERSAL_1_3) {
    auto words = test::assemble(text, environment);
    EXPECT_TRUE(words) << words.error().message();
    return words ? *std::move(words) : std::vector<std::uint32_t>{};
}

TEST(SpirvDamage, TheGoodModuleIsGood) { EXPECT_TRUE(try_reflect(good_shader().spirv)); }

TEST(SpirvDamage, Empty) { EXPECT_THAT(message_of({}), HasSubstr("no words")); }

TEST(SpirvDamage, SizeThatIsNoMultipleOfFour) {
    const std::vector<std::byte> bytes(21);
    const auto words = spirv::words_of(bytes, "test module");
    ASSERT_FALSE(words);
    EXPECT_THAT(words.error().message(), HasSubstr("21 bytes"));
    EXPECT_FALSE(spirv::words_of({}, "test module"));
    const auto whole = spirv::words_of(std::as_bytes(std::span(good_shader().spirv)), "test module");
    ASSERT_TRUE(whole);
    EXPECT_EQ(whole->size(), good_shader().spirv.size());
}

TEST(SpirvDamage, WrongMagicNumber) {
    auto words = good_shader().spirv;
    words[0] = 0xdeadbeef;
    EXPECT_THAT(message_of(words), AllOf(HasSubstr("word 0"), HasSubstr("0xdeadbeef"), HasSubstr("0x07230203")));
}

TEST(SpirvDamage, OtherByteOrder) {
    auto words = good_shader().spirv;
    for (std::uint32_t& word : words) word = __builtin_bswap32(word);
    EXPECT_THAT(message_of(words), HasSubstr("other byte order"));
}

TEST(SpirvDamage, WrongVersionAndSchema) {
    auto words = good_shader().spirv;
    words[1] = 0x00020000;
    EXPECT_THAT(message_of(words), HasSubstr("version"));
    words = good_shader().spirv;
    words[4] = 1;
    EXPECT_THAT(message_of(words), HasSubstr("schema"));
}

TEST(SpirvDamage, TruncatedAnywhere) {
    const auto& whole = good_shader().spirv;
    for (std::size_t length = 0; length < whole.size(); ++length) {
        const std::vector<std::uint32_t> words(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
        EXPECT_FALSE(try_reflect(words)) << length << " of " << whole.size() << " words";
    }
    auto words = whole;
    words.pop_back();
    EXPECT_THAT(message_of(words), HasSubstr("word "));
}

TEST(SpirvDamage, InstructionOfNoWords) {
    auto words = good_shader().spirv;
    words[5] &= 0xffff;
    EXPECT_THAT(message_of(words), HasSubstr("word 5: an instruction of no words"));
}

TEST(SpirvDamage, HugeIdBound) {
    auto words = good_shader().spirv;
    words[3] = 0xffffffff;
    EXPECT_THAT(message_of(words), AllOf(HasSubstr("word 3"), HasSubstr("id bound")));
    words[3] = 0;
    EXPECT_THAT(message_of(words), HasSubstr("id bound"));
    // The largest that is allowed is wasteful and right.
    words[3] = spirv::max_id_bound;
    EXPECT_TRUE(try_reflect(words));
}

TEST(SpirvDamage, IdsBeyondTheBound) {
    auto words = good_shader().spirv;
    words[3] = 5;
    EXPECT_THAT(message_of(words), HasSubstr("word "));
}

TEST(SpirvDamage, ErrorsNameTheLineOfTheSource) {
    auto words = good_shader().spirv;
    // The first function call calls something that is no function.
    for (std::size_t at = 5; at < words.size(); at += words[at] >> 16) {
        if ((words[at] & 0xffff) != 57) continue;
        words[at + 3] = words[at + 1];
        const std::string message = message_of(words);
        EXPECT_THAT(message, HasSubstr("word " + std::to_string(at)));
        EXPECT_THAT(message, HasSubstr("good.comp:13"));
        return;
    }
    FAIL() << "no call in the module";
}

TEST(SpirvDamage, MissingEntryPointAndWrongStage) {
    const auto missing = reflect(good_shader().spirv, ShaderStage::compute, "start", "test module");
    ASSERT_FALSE(missing);
    EXPECT_EQ(missing.error().code, ErrorCode::shader_compile);
    EXPECT_THAT(missing.error().message(), AllOf(HasSubstr("'start'"), HasSubstr("'main' (compute)")));
    const auto wrong = reflect(good_shader().spirv, ShaderStage::fragment, "main", "test module");
    ASSERT_FALSE(wrong);
    EXPECT_THAT(wrong.error().message(), AllOf(HasSubstr("fragment stage"), HasSubstr("'main' (compute)")));
    EXPECT_FALSE(reflect(good_shader().spirv, ShaderStage::none, "main", "test module"));
    EXPECT_FALSE(reflect(good_shader().spirv, ShaderStage::vertex | ShaderStage::compute, "main", "test module"));
}

TEST(SpirvDamage, Recursion) {
    EXPECT_THAT(message_of(assemble(R"(
        OpCapability Shader
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %4 "main"
        OpExecutionMode %4 LocalSize 1 1 1
        %2 = OpTypeVoid
        %3 = OpTypeFunction %2
        %4 = OpFunction %2 None %3
        %5 = OpLabel
        %6 = OpFunctionCall %2 %7
        OpReturn
        OpFunctionEnd
        %7 = OpFunction %2 None %3
        %8 = OpLabel
        %9 = OpFunctionCall %2 %7
        OpReturn
        OpFunctionEnd)")), HasSubstr("call graph"));
}

TEST(SpirvDamage, CapabilitiesThatNoBackendHas) {
    const auto words = assemble(R"(
        OpCapability Kernel
        OpCapability Addresses
        OpCapability Linkage
        OpMemoryModel Physical32 OpenCL)");
    const auto result = try_reflect(words);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::unsupported);
    EXPECT_THAT(result.error().message(), AllOf(HasSubstr("capability Kernel"), HasSubstr("word 5")));

    const auto geometry = assemble(R"(
        OpCapability Geometry
        OpMemoryModel Logical GLSL450)");
    EXPECT_THAT(message_of(geometry), HasSubstr("capability Geometry is not supported"));
    auto unknown = geometry;
    unknown[6] = 6089;
    EXPECT_THAT(message_of(unknown), HasSubstr("capability number 6089"));
}

TEST(SpirvDamage, ResourcesThatCannotBeBound) {
    const ShaderDesc input_attachment = test::compile_text("attachment.frag", R"(
        layout(input_attachment_index = 0, set = 0, binding = 1) uniform subpassInput attachment;
        layout(location = 0) out vec4 color;
        void main() { color = subpassLoad(attachment); })");
    const auto result = try_reflect(input_attachment.spirv, ShaderStage::fragment);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::unsupported);
}

TEST(SpirvDamage, TypesThatWouldTakeAllTimeOrMemory) {
    // Each structure holds the one before twice: 40 types, 2^40 members.
    std::string nested = R"(
        OpCapability Shader
        OpMemoryModel Logical GLSL450
        OpDecorate %100 Block
        %1 = OpTypeFloat 32
        %100 = OpTypeStruct %1 %1
)";
    for (int i = 101; i < 140; ++i)
        nested +=
            "%" + std::to_string(i) + " = OpTypeStruct %" + std::to_string(i - 1) + " %" + std::to_string(i - 1) + "\n";
    EXPECT_THAT(message_of(assemble(nested)), HasSubstr("nested members"));
    EXPECT_THAT(message_of(assemble(R"(
        OpCapability Shader
        OpMemoryModel Logical GLSL450
        %1 = OpTypeFloat 32
        %2 = OpTypeInt 32 0
        %3 = OpConstant %2 4000000000
        %4 = OpTypeArray %1 %3
        %5 = OpTypeArray %4 %3
        %6 = OpTypePointer Input %5)")), HasSubstr("locations"));
}

TEST(SpirvDamage, SeveralEntryPointsEachHaveTheirOwn) {
    const auto words = assemble(R"(
        OpCapability Shader
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %10 "first"
        OpEntryPoint GLCompute %20 "second"
        OpExecutionMode %10 LocalSize 4 1 1
        OpExecutionMode %20 LocalSize 8 2 1
        OpName %30 "numbers"
        OpName %31 "others"
        OpDecorate %4 ArrayStride 4
        OpMemberDecorate %5 0 Offset 0
        OpDecorate %5 Block
        OpDecorate %30 DescriptorSet 0
        OpDecorate %30 Binding 0
        OpDecorate %31 DescriptorSet 0
        OpDecorate %31 Binding 1
        %1 = OpTypeVoid
        %2 = OpTypeFunction %1
        %3 = OpTypeInt 32 0
        %4 = OpTypeRuntimeArray %3
        %5 = OpTypeStruct %4
        %6 = OpTypePointer StorageBuffer %5
        %7 = OpTypePointer StorageBuffer %3
        %8 = OpConstant %3 0
        %30 = OpVariable %6 StorageBuffer
        %31 = OpVariable %6 StorageBuffer
        %10 = OpFunction %1 None %2
        %11 = OpLabel
        %12 = OpAccessChain %7 %30 %8 %8
        OpStore %12 %8
        OpReturn
        OpFunctionEnd
        %20 = OpFunction %1 None %2
        %21 = OpLabel
        %22 = OpAccessChain %7 %31 %8 %8
        OpStore %22 %8
        OpReturn
        OpFunctionEnd)");
    const auto first = reflect(words, ShaderStage::compute, "first", "two");
    const auto second = reflect(words, ShaderStage::compute, "second", "two");
    ASSERT_TRUE(first) << first.error().message();
    ASSERT_TRUE(second) << second.error().message();
    ASSERT_EQ(first->bindings.size(), 1u);
    ASSERT_EQ(second->bindings.size(), 1u);
    EXPECT_EQ(first->bindings[0].name, "numbers");
    EXPECT_EQ(second->bindings[0].name, "others");
    EXPECT_EQ(first->workgroup_size[0], 4u);
    EXPECT_EQ(second->workgroup_size[0], 8u);
}

/// Random damage of the kinds that disks, networks and bugs do. A mutant that still passes must also be reflected.
TEST(SpirvDamage, ThousandsOfMutantsNeverCrash) {
    const std::vector<ShaderDesc> seeds{
        good_shader(),
        test::compile_text("seed.vert", R"(
            layout(location = 0) in vec3 position;
            layout(location = 3) in mat3 m;
            layout(location = 0) out Varyings { vec3 normal; vec2 uvs[2]; } result;
            void main() { gl_Position = vec4(m * position, 1); result.normal = position; })"),
        test::compile_text("seed.frag", R"(
            layout(set = 0, binding = 0) uniform sampler2D albedo;
            layout(set = 0, binding = 3) uniform texture2D other;
            layout(set = 0, binding = 4) uniform sampler nearest;
            layout(location = 0) in vec2 uv;
            layout(location = 0) out vec4 color;
            void main() {
                if (uv.x > 0.5) discard;
                color = texture(albedo, uv) * texture(sampler2D(other, nearest), uv);
            })", {}, false)};
    constexpr int mutants_per_seed = 2500;
    std::mt19937 random(20231);
    int accepted = 0;
    for (const ShaderDesc& seed : seeds) {
        for (int i = 0; i < mutants_per_seed; ++i) {
            auto words = seed.spirv;
            const int changes = 1 + static_cast<int>(random() % 4);
            for (int change = 0; change < changes; ++change) {
                const std::size_t at = random() % words.size();
                switch (random() % 7) {
                    case 0: words[at] = random(); break;
                    case 1: words[at] ^= 1u << random() % 32; break;
                    case 2: words[at] = random() % (seed.spirv[3] + 4); break;  // Another id.
                    case 3: words[at] = words[random() % words.size()]; break;
                    case 4: words[at] += (random() % 5) - 2; break;
                    case 5: words.erase(words.begin() + static_cast<std::ptrdiff_t>(at)); break;
                    case 6: words.insert(words.begin() + static_cast<std::ptrdiff_t>(at), random() % 64); break;
                }
            }
            const auto result = reflect(words, seed.stage, "main", "mutant");
            if (result) ++accepted;
            else EXPECT_FALSE(result.error().message().empty());
        }
    }
    // Changed constants, names and line tables leave a module valid: some pass, most do not.
    EXPECT_GT(accepted, 0);
    EXPECT_LT(accepted, mutants_per_seed * 3 / 2);
}

}  // namespace
}  // namespace nacre::rhi
