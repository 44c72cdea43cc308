// SPDX-License-Identifier: Apache-2.0
// Faults that are planted one by one, each of which must be reported with object, line and invocation; and nothing must
// be reported of shaders without any.
#include <gmock/gmock.h>

#include <ostream>

#include "tests/backends/cpu/faults/fault_bench.h"

namespace nacre::cpu {
namespace {

using ::testing::HasSubstr;

/// A compute or fragment shader with one faulty line.
struct PlantedFault {
    const char* name;
    const char* checks;      ///< Of the device.
    const char* path;        ///< The extension tells the stage.
    const char* text;
    const char* code;        ///< "N-804"
    const char* object;      ///< Part of the message; may be empty.
    const char* invocation;  ///< Part of the message.
    std::uint32_t groups = 1;
};
void PrintTo(const PlantedFault& fault, std::ostream* out) { *out << fault.name; }

constexpr const char* output_block = "layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;\n";

const PlantedFault planted[] = {
    {"TrapNotANumber", "traps", "nan.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
void main() {
    float x = float(gl_LocalInvocationIndex) - 5.0;
    result.words[gl_LocalInvocationIndex] = sqrt(x); // FAULT
})", "N-801", "", "invocation (0, 0, 0)"},
    {"TrapInfinity", "traps", "infinity.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
void main() {
    float x = exp2(float(gl_LocalInvocationIndex) * 18.0);
    result.words[gl_LocalInvocationIndex] = x * x; // FAULT
})", "N-802", "", "invocation (4, 0, 0)"},
    {"TrapIntegerDivision", "traps", "division.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i] = 100u / (numbers.words[i] ^ 3u); // FAULT
})", "N-803", "", "invocation (3, 0, 0)"},
    {"TrapFloatDivision", "traps", "quotient.frag", R"(layout(location = 0) out vec4 color;
void main() {
    color = vec4(1.0);
    if (gl_FragCoord.x > 4.0) {
        color.x = 1.0 / (gl_FragCoord.y - 2.5); // FAULT
    }
})", "N-803", "", "pixel (4, 2)"},
    {"TrapBufferIndex", "traps", "range.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 1) readonly buffer Input { uint words[]; } numbers;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i] = numbers.words[i * 10u]; // FAULT
})", "N-804", "'numbers.words' (buffer 'input')", "invocation (7, 0, 0)"},
    {"TrapLocalIndex", "traps", "local.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint table[6] = uint[6](1u, 2u, 3u, 4u, 5u, 6u);
    table[numbers.words[1]] = gl_GlobalInvocationID.x;
    result.words[gl_GlobalInvocationID.x] = table[numbers.words[gl_GlobalInvocationID.x]]; // FAULT
})", "N-804", "table", "invocation (6, 0, 0)"},

    {"SanitizeVariable", "sanitize", "variable.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint chosen;
    uint i = gl_GlobalInvocationID.x;
    if (numbers.words[i] > 2u) chosen = i;
    result.words[i] = chosen + 1u; // FAULT
})", "N-805", "chosen", "invocation (0, 0, 0)"},
    {"SanitizeBuffer", "sanitize", "unwritten.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i] = i;
    uint next = result.words[i + (i == 5u ? 100u : 0u)];
    if (next > 100u) result.words[i + 200u] = 1u; // FAULT
})", "N-805", "'result.words' (buffer 'output'), read at unwritten.comp:6", "invocation (5, 0, 0)"},
    {"SanitizeImageRange", "sanitize", "image.comp", R"(layout(local_size_x = 4, local_size_y = 4) in;
layout(set = 0, binding = 2, r32ui) uniform writeonly uimage2D picture;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy) * 3;
    imageStore(picture, at - ivec2(0, 1), uvec4(1u)); // FAULT
})", "N-804", "texture 'picture'", "invocation (0, 0, 0)"},
    {"SanitizeBufferIndex", "sanitize", "index.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = numbers.words[gl_GlobalInvocationID.x];
    result.words[i - 1u] = 7u; // FAULT
})", "N-804", "buffer 'output'", "invocation (0, 0, 0)"},
    {"SanitizeRaceInBuffer", "sanitize", "race.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() {
    uint i = gl_GlobalInvocationID.x;
    result.words[i / 2u] = i; // FAULT
})", "N-806", "buffer 'output'", "invocation (1, 0, 0)"},
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
})", "N-806", "part", "invocation ("},
    {"SanitizeDerivative", "sanitize", "derivative.frag", R"(layout(location = 0) out vec4 color;
void main() {
    color = vec4(0.0);
    if (gl_FragCoord.x > 3.0) {
        color.x = dFdx(gl_FragCoord.y * gl_FragCoord.x); // FAULT
    }
})", "N-807", "", "pixel (3, 0)"},
    {"SanitizeImplicitLevel", "sanitize", "implicit.frag", R"(layout(location = 0) out vec4 color;
layout(set = 0, binding = 3) uniform utexture2D numbers;
layout(set = 0, binding = 4) uniform sampler nearest;
void main() {
    color = vec4(0.0);
    if (gl_FragCoord.y < 4.0 && gl_FragCoord.x > 5.0) {
        color = vec4(texture(usampler2D(numbers, nearest), gl_FragCoord.xy / 8.0)); // FAULT
    }
})", "N-807", "", "pixel (5, 0)"},
    {"SanitizeBirthOfNaN", "sanitize", "birth.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = gl_GlobalInvocationID.x;
    vec3 direction = normalize(vec3(float(numbers.words[i]) - 3.0, 0.0, 0.0)); // FAULT
    result.words[i] = direction.x;
})", "N-801", "", "invocation (3, 0, 0)"},
    {"SanitizeBirthInFragment", "sanitize", "birth.frag", R"(layout(location = 0) out vec4 color;
void main() {
    float x = gl_FragCoord.x - 6.0;
    color = vec4(pow(x, 1.5)); // FAULT
})", "N-801", "", "pixel (0, 0)"},
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
        const auto outcome =
            path.ends_with(".comp") ? bench.compute(path, text, fault.groups) : bench.draw(path, text);
        const bool stops = std::string(fault.checks).find("traps") != std::string::npos;
        EXPECT_EQ(outcome.has_value(), !stops);
        const std::vector<rhi::Message> messages = bench.messages();
        ASSERT_EQ(messages.size(), 1u) << (messages.size() > 1 ? messages[0].text + "\n" + messages[1].text : "");
        const rhi::Message& message = messages[0];
        EXPECT_TRUE(message.code.starts_with(fault.code)) << message.text;
        EXPECT_EQ(message.source, rhi::MessageSource::shader);
        EXPECT_THAT(message.text, HasSubstr(faulty_line(path, text)));
        EXPECT_THAT(message.text, HasSubstr(fault.object));
        EXPECT_THAT(message.text, HasSubstr(fault.invocation));
        EXPECT_THAT(message.text, HasSubstr("of list 'once'"));
        if (!stops) continue;
        EXPECT_EQ(outcome.error().code, ErrorCode::device_lost);
        EXPECT_THAT(outcome.error().message(), HasSubstr(faulty_line(path, text)));
    }
}

}  // namespace
}  // namespace nacre::cpu
