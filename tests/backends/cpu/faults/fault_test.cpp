// SPDX-License-Identifier: Apache-2.0
// Faults that are planted one by one, each of which must be reported with object, line and invocation; and nothing must
// be reported of shaders without any.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <ostream>
#include <thread>

#include "backends/cpu/cpu_backend.h"
#include "tests/backends/cpu/faults/fault_bench.h"

namespace nacre::cpu {
namespace {

using ::testing::HasSubstr;

/// A compute or fragment shader with one faulty line.
struct PlantedFault {
    const char* name;
    const char* checks;  ///< Of the device.
    const char* path;    ///< The extension tells the stage.
    const char* text;
    const char* code;        ///< "N-804"
    const char* object;      ///< Part of the message; may be empty.
    const char* invocation;  ///< Part of the message.
    std::uint32_t groups = 1;
};
void PrintTo(const PlantedFault& fault, std::ostream* out) { *out << fault.name; }

const PlantedFault planted[] = {
    {"TrapNotANumber", "traps", "nan.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
void main() {
    float x = float(gl_LocalInvocationIndex) - 5.0;
    result.words[gl_LocalInvocationIndex] = sqrt(x); // FAULT
})",
     "N-801", "", "invocation (0, 0, 0)"},
    {"TrapInfinity", "traps", "infinity.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
void main() {
    float x = exp2(float(gl_LocalInvocationIndex) * 18.0);
    result.words[gl_LocalInvocationIndex] = x * x; // FAULT
})",
     "N-802", "", "invocation (4, 0, 0)"},
    {"TrapIntegerDivision", "traps", "division.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i] = 100u / (numbers.words[i] ^ 3u); // FAULT
})",
     "N-803", "", "invocation (3, 0, 0)"},
    {"TrapFloatDivision", "traps", "quotient.frag", R"(layout(location = 0) out vec4 color;
void main() {
    color = vec4(1.0);
    if (gl_FragCoord.x > 4.0) {
        color.x = 1.0 / (gl_FragCoord.y - 2.5); // FAULT
    }
})",
     "N-803", "", "pixel (4, 2)"},
    {"TrapBufferIndex", "traps", "range.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 1) readonly buffer Input { uint words[]; } numbers;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i] = numbers.words[i * 10u]; // FAULT
})",
     "N-804", "'numbers.words' (buffer 'input')", "invocation (7, 0, 0)"},
    {"TrapLocalIndex", "traps", "local.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint table[6] = uint[6](1u, 2u, 3u, 4u, 5u, 6u);
    table[numbers.words[1]] = gl_GlobalInvocationID.x;
    result.words[gl_GlobalInvocationID.x] = table[numbers.words[gl_GlobalInvocationID.x]]; // FAULT
})",
     "N-804", "table", "invocation (6, 0, 0)"},

    {"SanitizeVariable", "sanitize", "variable.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint chosen;
    uint i = gl_GlobalInvocationID.x;
    if (numbers.words[i] > 2u) chosen = i;
    result.words[i] = chosen + 1u; // FAULT
})",
     "N-805", "chosen", "invocation (0, 0, 0)"},
    {"SanitizeBuffer", "sanitize", "unwritten.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i] = i;
    uint next = result.words[i + (i == 5u ? 100u : 0u)];
    if (next > 100u) result.words[i + 200u] = 1u; // FAULT
})",
     "N-805", "'result.words' (buffer 'output'), read at unwritten.comp:6", "invocation (5, 0, 0)"},
    {"SanitizeImageRange", "sanitize", "image.comp", R"(layout(local_size_x = 4, local_size_y = 4) in;
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2D picture;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy) * 3;
    imageStore(picture, at - ivec2(0, 1), uvec4(1u)); // FAULT
})",
     "N-804", "texture 'picture'", "invocation (0, 0, 0)"},
    {"TrapTexelRange", "traps", "texels.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 7) uniform usamplerBuffer numbers;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    int i = int(gl_GlobalInvocationID.x);
    result.words[i] = texelFetch(numbers, i * 10).x; // FAULT
})",
     "N-804", "'numbers' (buffer 'input')", "invocation (7, 0, 0)"},
    {"SanitizeTexelRange", "sanitize", "texel_image.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 6, r32ui) uniform writeonly uimageBuffer words;
void main() {
    imageStore(words, int(gl_GlobalInvocationID.x) * 64 - 192, uvec4(1u)); // FAULT
})",
     "N-804", "'words' (buffer 'output')", "invocation (0, 0, 0)"},
    {"SanitizeTexelUnwritten", "sanitize", "unwritten_texel.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 6, r32ui) uniform uimageBuffer words;
void main() {
    int i = int(gl_GlobalInvocationID.x);
    imageStore(words, i, uvec4(3u));
    uint next = imageLoad(words, i == 5 ? 100 : i).x;
    if (next > 100u) imageStore(words, i + 200, uvec4(1u)); // FAULT
})",
     "N-805", "'words' (buffer 'output'), read at unwritten_texel.comp:6", "invocation (5, 0, 0)"},
    {"SanitizeTexelRace", "sanitize", "texel_race.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 6, r32ui) uniform uimageBuffer words;
void main() {
    int i = int(gl_GlobalInvocationID.x);
    imageStore(words, i / 2, uvec4(i)); // FAULT
})",
     "N-806", "'words' (buffer 'output')", "invocation (1, 0, 0)"},
    {"SanitizeBufferIndex", "sanitize", "index.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = numbers.words[gl_GlobalInvocationID.x];
    result.words[i - 1u] = 7u; // FAULT
})",
     "N-804", "buffer 'output'", "invocation (0, 0, 0)"},
    {"SanitizeRaceInBuffer", "sanitize", "race.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i / 2u] = i; // FAULT
})",
     "N-806", "buffer 'output'", "invocation (1, 0, 0)"},
    {"SanitizeRaceInWorkgroup", "sanitize", "shared.comp", R"(layout(local_size_x = 32) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
shared uint part[32];
void main() {
    uint i = gl_LocalInvocationIndex;
    part[i] = 0u;
    barrier();
    part[i] = i;
    uint next = part[(i + 1u) % 32u]; // FAULT
    result.words[i] = next;
})",
     "N-806", "part", "invocation ("},
    {"SanitizeDerivative", "sanitize", "derivative.frag", R"(layout(location = 0) out vec4 color;
void main() {
    color = vec4(0.0);
    if (gl_FragCoord.x > 3.0) {
        color.x = dFdx(gl_FragCoord.y * gl_FragCoord.x); // FAULT
    }
})",
     "N-807", "", "pixel (3, 0)"},
    {"SanitizeImplicitLevel", "sanitize", "implicit.frag", R"(layout(location = 0) out vec4 color;
layout(set = 0, binding = 3) uniform utexture2D numbers;
layout(set = 0, binding = 4) uniform sampler nearest;
void main() {
    color = vec4(0.0);
    if (gl_FragCoord.y < 4.0 && gl_FragCoord.x > 5.0) {
        color = vec4(texture(usampler2D(numbers, nearest), gl_FragCoord.xy / 8.0)); // FAULT
    }
})",
     "N-807", "", "pixel (5, 0)"},
    {"SanitizeBirthOfNaN", "sanitize", "birth.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = gl_GlobalInvocationID.x;
    vec3 direction = normalize(vec3(float(numbers.words[i]) - 3.0, 0.0, 0.0)); // FAULT
    result.words[i] = direction.x;
})",
     "N-801", "", "invocation (3, 0, 0)"},
    {"SanitizeBirthInFragment", "sanitize", "birth.frag", R"(layout(location = 0) out vec4 color;
void main() {
    float x = gl_FragCoord.x - 6.0;
    color = vec4(pow(x, 1.5)); // FAULT
})",
     "N-801", "", "pixel (0, 0)"},
    {"SanitizeSubgroupSum", "sanitize", "sum.comp", R"(#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint part;
    if (numbers.words[gl_LocalInvocationIndex] != 2u) part = 1u;
    uint sum = subgroupAdd(part);
    result.words[gl_LocalInvocationIndex] = sum; // FAULT
})",
     "N-805", "'sum'", "invocation ("},
    {"SanitizeSubgroupScan", "sanitize", "scan.comp", R"(#extension GL_KHR_shader_subgroup_arithmetic : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint part;
    uint i = gl_LocalInvocationIndex;
    if (numbers.words[i] != 2u) part = 1u;
    uint before = subgroupExclusiveAdd(part);
    if (i < 3u) result.words[i] = before;
    if (i == 3u) result.words[i] = before; // FAULT
})",
     "N-805", "'before'", "invocation (3, 0, 0)"},
    {"SanitizeSubgroupShuffle", "sanitize", "shuffle.comp", R"(#extension GL_KHR_shader_subgroup_shuffle : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint part;
    uint i = gl_LocalInvocationIndex;
    if (numbers.words[i] != 2u) part = i;
    result.words[i] = subgroupShuffleXor(part, 1u); // FAULT
})",
     "N-805", "part", "invocation (3, 0, 0)"},
    {"SanitizeSubgroupVote", "sanitize", "vote.comp", R"(#extension GL_KHR_shader_subgroup_vote : require
layout(local_size_x = 16) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    bool is_large;
    uint i = gl_LocalInvocationIndex;
    if (numbers.words[i] != 1u) is_large = true;
    bool all_large = subgroupAll(is_large);
    result.words[i] = all_large ? 1u : 0u; // FAULT
})",
     "N-805", "'all_large'", "invocation (0, 0, 0)"},

    {"HostileWorkgroupMemory", "hostile", "workgroup.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
shared uint part[16];
void main() {
    uint i = gl_LocalInvocationIndex;
    part[i] = i;
    barrier();
    result.words[i] = part[i + 2u]; // FAULT
})",
     "N-805", "'part'", "invocation (6, 0, 0)"},
    {"HostileFirstWorkgroup", "hostile", "first.comp", R"(layout(local_size_x = 1) in;
layout(set = 0, binding = 2, r32ui) uniform uimage2D picture;
void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i == 0) imageStore(picture, ivec2(0), uvec4(5u));
    if (i != 0) imageStore(picture, ivec2(i, 1), imageLoad(picture, ivec2(0))); // FAULT
})",
     "N-806", "texture 'picture'", "invocation (", 8},
};

class Planted : public ::testing::TestWithParam<PlantedFault> {};
INSTANTIATE_TEST_SUITE_P(CpuFaults, Planted, ::testing::ValuesIn(planted),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

TEST_P(Planted, IsReported) {
    const PlantedFault& fault = GetParam();
    for (const char* lanes : {"4", "8", "16"}) {
        SCOPED_TRACE(lanes);
        FaultBench bench(std::string("cpu:") + fault.checks + ":lanes=" + lanes);
        const std::string path = fault.path, text = fault.text;
        const auto outcome = path.ends_with(".comp") ? bench.compute(path, text, fault.groups) : bench.draw(path, text);
        const bool stops = std::string(fault.checks).find("traps") != std::string::npos;
        EXPECT_EQ(outcome.has_value(), !stops);
        const std::vector<rhi::Message> messages = bench.messages();
        // What comes of a hostile order may be seen at several places.
        const bool is_hostile = std::string(fault.checks).find("hostile") != std::string::npos;
        if (!is_hostile) {
            ASSERT_EQ(messages.size(), 1u) << (messages.size() > 1 ? messages[0].text + "\n" + messages[1].text : "");
        }
        const auto found = std::ranges::find_if(
            messages, [&](const rhi::Message& candidate) { return candidate.code.starts_with(fault.code); });
        ASSERT_NE(found, messages.end()) << (messages.empty() ? "" : messages[0].text);
        const rhi::Message& message = *found;
        EXPECT_EQ(message.source, rhi::MessageSource::shader);
        // Of a race either side may come first; the other is named behind it.
        EXPECT_THAT(message.text, HasSubstr(faulty_line(path, text)));
        EXPECT_THAT(message.text, HasSubstr(fault.object));
        EXPECT_THAT(message.text, HasSubstr(fault.invocation));
        EXPECT_THAT(message.text, HasSubstr("of list 'once'"));
        if (!stops) continue;
        EXPECT_EQ(outcome.error().code, ErrorCode::device_lost);
        EXPECT_THAT(outcome.error().message(), HasSubstr(faulty_line(path, text)));
    }
}

// ---- Hostile order: faults that lie between commands, and the harm that they do every time. -----------------------

constexpr const char* copy_text = R"(layout(local_size_x = 64) in;
layout(set = 0, binding = 0) writeonly buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    result.words[gl_GlobalInvocationID.x] = numbers.words[gl_GlobalInvocationID.x];
})";

const rhi::Message* find_message(const std::vector<rhi::Message>& messages, const std::string& code) {
    for (const rhi::Message& message : messages)
        if (message.code.starts_with(code)) return &message;
    return nullptr;
}

std::vector<std::uint32_t> read_words(FaultBench& bench, rhi::Buffer buffer) {
    const auto bytes = bench.device().read_buffer(buffer);
    std::vector<std::uint32_t> words(bytes ? bytes->size() / 4 : 0);
    if (bytes) std::memcpy(words.data(), bytes->data(), words.size() * 4);
    return words;
}

/// Runs the copy under a statement.
std::vector<std::uint32_t> copy_with_statement(FaultBench& bench, const std::vector<rhi::StatedAccess>& accesses) {
    const rhi::ComputePipeline pipeline = bench.make_compute("copy.comp", copy_text);
    rhi::CommandList list = bench.device().create_command_list("frame");
    list.fill_buffer(bench.output, 7u);
    list.begin_statement("copy", accesses);
    list.set_pipeline(pipeline);
    list.set_bind_group(0, bench.bind(pipeline));
    list.dispatch({});
    list.end_statement();
    EXPECT_TRUE(bench.submit(std::move(list)));
    return read_words(bench, bench.output);
}

// Of three vertices the last one's y is never written, and w never, which no format asks for.
TEST(CpuFaults, AnUndefinedVertexAttributeIsReported) {
    for (const char* lanes : {"4", "8", "16"}) {
        SCOPED_TRACE(lanes);
        FaultBench bench(std::string("cpu:sanitize:lanes=") + lanes);
        rhi::Device& device = bench.device();
        const auto vertices =
            device.create_buffer({.size = 3 * 16,
                                  .usage = rhi::BufferUsage::vertex | rhi::BufferUsage::copy_destination,
                                  .name = "corners"});
        ASSERT_TRUE(vertices);
        constexpr std::array<std::array<float, 3>, 3> corners{{{-1, -1, 0}, {3, -1, 0}, {-1, 3, 0}}};
        for (std::uint32_t i = 0; i < 3; ++i)
            ASSERT_TRUE(device.write_buffer(*vertices, std::span(corners[i]).first(i == 2 ? 1 : 3), i * 16));
        const rhi::GraphicsPipeline pipeline = bench.make_graphics(
            "corner.frag", "layout(location = 0) out vec4 color;\nvoid main() { color = vec4(1.0); }", R"(
layout(location = 0) in vec3 corner;
void main() {
    gl_Position = vec4(corner.xy, 0.5, 1.0); // FAULT
})",
            {.stride = 16}, {{.location = 0, .format = rhi::Format::rgb32_float}});
        rhi::CommandList list = device.create_command_list("once");
        list.begin_render_pass(
            {.color = {{.view = rhi::TextureView{bench.target}, .load = rhi::LoadOperation::clear}}, .name = "only"});
        list.set_pipeline(pipeline);
        list.set_vertex_buffer(0, *vertices);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        ASSERT_TRUE(bench.submit(std::move(list)));
        const std::vector<rhi::Message> messages = bench.messages();
        ASSERT_EQ(messages.size(), 1u);
        EXPECT_TRUE(messages[0].code.starts_with("N-805"));
        EXPECT_THAT(messages[0].text, HasSubstr("corner.frag.vert:4"));
        EXPECT_THAT(messages[0].text, HasSubstr("'corner' (buffer 'corners')"));
        EXPECT_THAT(messages[0].text, HasSubstr("vertex 2"));
    }
}

TEST(CpuFaults, UnknownChecksAreRefused) {
    std::vector<std::unique_ptr<rhi::Backend>> backends;
    backends.push_back(make_backend());
    const rhi::Instance instance(std::move(backends));
    const auto device = instance.create_device({.backend = "cpu:fast:sanitise"});
    ASSERT_FALSE(device);
    EXPECT_EQ(device.error().code, ErrorCode::invalid_argument);
    EXPECT_THAT(device.error().message(), HasSubstr("'sanitize'"));
    EXPECT_THAT(device.error().message(), HasSubstr("'sanitise'"));
}

TEST(CpuFaults, TrapsStopAtTheFirstOfSeveral) {
    FaultBench bench("cpu:traps:threads=1");
    const auto outcome = bench.compute("two.comp", R"(layout(local_size_x = 1) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
void main() {
    float x = float(gl_GlobalInvocationID.x);
    float root = sqrt(x - 1.0);
    result.words[gl_GlobalInvocationID.x] = root + 1.0 / (x - 3.0);
})",
                                       64);
    ASSERT_FALSE(outcome);
    EXPECT_EQ(outcome.error().code, ErrorCode::device_lost);
    EXPECT_THAT(outcome.error().message(), HasSubstr("two.comp:5"));
    EXPECT_THAT(outcome.error().message(), HasSubstr("invocation (0, 0, 0)"));
    EXPECT_EQ(bench.messages().size(), 1u);
    FaultBench again("cpu:traps");
    EXPECT_TRUE(again.compute("none.comp", "layout(local_size_x = 1) in;\nvoid main() {}")) << "a new device works";
}

TEST(CpuHostile, StatedUsesAreSilent) {
    FaultBench bench("cpu:hostile");
    const auto words = copy_with_statement(
        bench, {{.buffer = bench.input, .use = rhi::ResourceUse::storage_read},
                {.buffer = bench.output, .use = rhi::ResourceUse::storage_read | rhi::ResourceUse::storage_write}});
    EXPECT_TRUE(bench.messages().empty());
    EXPECT_EQ(words[5], 5u);
    EXPECT_EQ(words[100], 7u);
}

TEST(CpuHostile, AReadThatIsNotStatedFindsUndefinedContent) {
    FaultBench bench("cpu:hostile");
    const auto words = copy_with_statement(
        bench, {{.buffer = bench.output, .use = rhi::ResourceUse::storage_read | rhi::ResourceUse::storage_write}});
    const auto messages = bench.messages();
    const rhi::Message* unstated = find_message(messages, "N-821");
    ASSERT_TRUE(unstated);
    EXPECT_THAT(unstated->text, HasSubstr("buffer 'input'"));
    EXPECT_THAT(unstated->text, HasSubstr("'copy' of list 'frame'"));
    EXPECT_THAT(unstated->text, HasSubstr("storage_read"));
    // The line that reads it is named too, and what it read is not what a lucky order gives.
    const rhi::Message* read = find_message(messages, "N-805");
    ASSERT_TRUE(read);
    EXPECT_THAT(read->text, HasSubstr("copy.comp:5"));
    EXPECT_THAT(read->text, HasSubstr("buffer 'input'"));
    EXPECT_NE(words[5], 5u);
    EXPECT_EQ(words[100], 7u);
}

TEST(CpuHostile, AWriteThatIsNotStatedIsLost) {
    FaultBench bench("cpu:hostile");
    const auto words = copy_with_statement(bench, {{.buffer = bench.input, .use = rhi::ResourceUse::storage_read},
                                                   {.buffer = bench.output, .use = rhi::ResourceUse::storage_read}});
    const auto messages = bench.messages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_TRUE(messages[0].code.starts_with("N-821"));
    EXPECT_THAT(messages[0].text, HasSubstr("buffer 'output'"));
    EXPECT_EQ(words[5], 7u);
}

TEST(CpuHostile, TexelBuffersAreUsesOfTheirBuffer) {
    const std::string text = R"(layout(local_size_x = 64) in;
layout(set = 0, binding = 6, r32ui) uniform writeonly uimageBuffer words;
layout(set = 0, binding = 7) uniform usamplerBuffer numbers;
void main() {
    int i = int(gl_GlobalInvocationID.x);
    imageStore(words, i, texelFetch(numbers, i));
})";
    const auto copy = [&](FaultBench& bench, const std::vector<rhi::StatedAccess>& accesses) {
        const rhi::ComputePipeline pipeline = bench.make_compute("texels.comp", text);
        rhi::CommandList list = bench.device().create_command_list("frame");
        list.fill_buffer(bench.output, 7u);
        list.begin_statement("copy", accesses);
        list.set_pipeline(pipeline);
        list.set_bind_group(0, bench.bind(pipeline));
        list.dispatch({});
        list.end_statement();
        EXPECT_TRUE(bench.submit(std::move(list)));
        return read_words(bench, bench.output);
    };
    const rhi::StatedAccess write{.buffer = {}, .use = rhi::ResourceUse::storage_write};
    FaultBench stated("cpu:hostile");
    rhi::StatedAccess to = write;
    to.buffer = stated.output;
    auto words = copy(stated, {{.buffer = stated.input, .use = rhi::ResourceUse::sampled}, to});
    EXPECT_TRUE(stated.messages().empty());
    EXPECT_EQ(words[5], 5u);
    FaultBench unstated("cpu:hostile");
    to.buffer = unstated.output;
    words = copy(unstated, {to});
    const auto messages = unstated.messages();
    const rhi::Message* message = find_message(messages, "N-821");
    ASSERT_TRUE(message);
    EXPECT_THAT(message->text, HasSubstr("buffer 'input'"));
    EXPECT_THAT(message->text, HasSubstr("sampled"));
    EXPECT_NE(words[5], 5u);
}

TEST(CpuHostile, NoOrderOfWorkgroupsIsReliedOn) {
    // Each workgroup takes over from the one before it: right only where they run one after another.
    const std::string text = R"(layout(local_size_x = 1) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i + 1u] = result.words[i] + 1u; // FAULT
})";
    for (const char* spec : {"cpu:hostile:threads=1", "cpu:hostile=7", "cpu:hostile:lanes=4"}) {
        FaultBench bench(spec);
        const rhi::ComputePipeline pipeline = bench.make_compute("chain.comp", text);
        rhi::CommandList list = bench.device().create_command_list("once");
        list.fill_buffer(bench.output, 0u);
        list.set_pipeline(pipeline);
        list.set_bind_group(0, bench.bind(pipeline));
        list.dispatch({.x = 64});
        ASSERT_TRUE(bench.submit(std::move(list)));
        const auto messages = bench.messages();
        ASSERT_FALSE(messages.empty());
        EXPECT_TRUE(messages[0].code.starts_with("N-806"));
        EXPECT_THAT(messages[0].text, HasSubstr(faulty_line("chain.comp", text)));
        EXPECT_THAT(messages[0].text, HasSubstr("buffer 'output'"));
        EXPECT_NE(read_words(bench, bench.output)[64], 64u);
    }
}

TEST(CpuHostile, DiscardedContentIsPoison) {
    FaultBench bench("cpu:hostile");
    // Only a part of the target is written, and the rest was never cleared.
    const std::string half = R"(layout(location = 0) out vec4 color;
void main() {
    if (gl_FragCoord.x > 4.0) discard;
    color = vec4(0.5);
})";
    ASSERT_TRUE(bench.draw("half.frag", half, {}, rhi::LoadOperation::discard));
    EXPECT_TRUE(bench.messages().empty());
    const std::string text = R"(layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 5) uniform sampler2D target;
void main() {
    vec4 color = texelFetch(target, ivec2(gl_GlobalInvocationID.xy), 0);
    result.words[gl_LocalInvocationIndex] = color.x > 0.25 ? 1u : 0u; // FAULT
})";
    ASSERT_TRUE(bench.compute("look.comp", text));
    const auto messages = bench.messages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_TRUE(messages[0].code.starts_with("N-805"));
    EXPECT_THAT(messages[0].text, HasSubstr(faulty_line("look.comp", text)));
    EXPECT_THAT(messages[0].text, HasSubstr("texture 'target'"));
    EXPECT_THAT(messages[0].text, HasSubstr("invocation (4, 0, 0)"));
}

TEST(CpuHostile, ResultsAreThereOnlyForThoseWhoWait) {
    FaultBench bench("cpu:hostile");
    rhi::Device& device = bench.device();
    const auto read_back = *device.create_buffer({.size = 256,
                                                  .usage = rhi::BufferUsage::copy_destination,
                                                  .memory = rhi::MemoryKind::readback,
                                                  .name = "result"});
    const auto copy = [&] {
        rhi::CommandList list = device.create_command_list("copy");
        list.copy_buffer(bench.input, 0, read_back, 0, 256);
        return *device.submit(std::move(list));
    };
    const auto second_word = [&] {
        const auto bytes = device.map(read_back);
        std::uint32_t word = 0;
        std::memcpy(&word, bytes->data() + 4, 4);
        EXPECT_TRUE(device.unmap(read_back));
        return word;
    };
    const rhi::Fence fence = copy();
    EXPECT_NE(second_word(), 1u);
    const auto messages = bench.messages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_TRUE(messages[0].code.starts_with("N-820"));
    EXPECT_THAT(messages[0].text, HasSubstr("'result'"));
    ASSERT_TRUE(device.wait(fence));
    EXPECT_EQ(second_word(), 1u);
    EXPECT_EQ(bench.messages().size(), 1u);
}

TEST(CpuHostile, UploadMemoryIsNotWrittenWhileItIsRead) {
    FaultBench bench("cpu:hostile");
    rhi::Device& device = bench.device();
    const auto upload = *device.create_buffer(
        {.size = 256, .usage = rhi::BufferUsage::copy_source, .memory = rhi::MemoryKind::upload, .name = "stream"});
    const auto write = [&](std::uint32_t value) {
        const auto bytes = device.map(upload);
        for (std::size_t i = 0; i < 64; ++i) std::memcpy(bytes->data() + i * 4, &value, 4);
        ASSERT_TRUE(device.unmap(upload));
    };
    write(11);
    rhi::CommandList list = device.create_command_list("copy");
    list.copy_buffer(upload, 0, bench.output, 0, 256);
    const rhi::Fence fence = *device.submit(std::move(list));
    write(22);
    const auto messages = bench.messages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_TRUE(messages[0].code.starts_with("N-820"));
    EXPECT_THAT(messages[0].text, HasSubstr("'stream'"));
    ASSERT_TRUE(device.wait(fence));
    EXPECT_EQ(read_words(bench, bench.output)[0], 22u) << "the worst order lets the second write win";
}

TEST(CpuHostile, AskingAgainAndAgainIsAWayToWait) {
    FaultBench bench("cpu:hostile");
    const rhi::Fence fence = *bench.device().submit(bench.device().create_command_list("empty"));
    for (int i = 0; i < 10000 && !bench.device().is_complete(fence); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_TRUE(bench.device().is_complete(fence));
}

}  // namespace
}  // namespace nacre::cpu
