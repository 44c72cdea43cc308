// SPDX-License-Identifier: Apache-2.0
// Shaders that mean harm, each of one kind: all end as docs/cpu.md promises, and the device works afterwards.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "tests/backends/cpu/hostile/module_runner.h"
#include "tests/rhi/assembly.h"

namespace nacre::hostile {
namespace {

using namespace rhi;
using testing::HasSubstr;
using Words = std::vector<std::uint32_t>;

template <typename T>
T ok(Expected<T> value) {
    if (value) return *std::move(value);
    ADD_FAILURE() << value.error().message();
    return T{};
}

struct ShortWatchdog {
    ShortWatchdog() { setenv("NACRE_CPU_WATCHDOG_SECONDS", "0.2", 1); }
    ~ShortWatchdog() { unsetenv("NACRE_CPU_WATCHDOG_SECONDS"); }
};

Words assemble(const std::string& text) { return ok(rhi::test::assemble(text)); }

class HostileInput : public testing::TestWithParam<const char*> {
  public:
    HostileInput() : runner_(ok(ModuleRunner::create(GetParam()))) {}

    /// Runs, and looks whether the device works afterwards (or a new one, where the device was lost).
    Outcome run(const Words& words, ShaderStage stage = ShaderStage::compute) {
        const auto begin = std::chrono::steady_clock::now();
        const Outcome outcome = runner_->run(words, stage, 1);
        EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(60));
        EXPECT_NE(outcome, Outcome::broken) << reason();
        if (outcome == Outcome::refused) {
            EXPECT_FALSE(reason().empty());
        }
        return outcome;
    }
    Outcome run_glsl(const std::string& text, const char* path = "hostile.comp") {
        ShaderCompiler compiler({.debug_information = false});
        const ShaderDesc desc = ok(compiler.compile({.path = path, .text = text}));
        return run(desc.spirv, desc.stage);
    }
    [[nodiscard]] const std::string& reason() const { return runner_->reason(); }

  private:
    const ShortWatchdog watchdog_;
    const std::unique_ptr<ModuleRunner> runner_;
};

/// What is needed around the functions of an assembled module: main is `%main`, one word of a buffer `%out`.
std::string head(const std::string& declarations = {}) {
    return R"(
        OpCapability Shader
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %main "main" %index
        OpExecutionMode %main LocalSize 16 1 1
        OpDecorate %index BuiltIn LocalInvocationIndex
        OpDecorate %out DescriptorSet 0
        OpDecorate %out Binding 0
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        %void = OpTypeVoid
        %bool = OpTypeBool
        %uint = OpTypeInt 32 0
        %block = OpTypeStruct %uint
        %block_pointer = OpTypePointer StorageBuffer %block
        %pointer = OpTypePointer StorageBuffer %uint
        %input_pointer = OpTypePointer Input %uint
        %local_pointer = OpTypePointer Function %uint
        %private_pointer = OpTypePointer Private %uint
        %index = OpVariable %input_pointer Input
        %out = OpVariable %block_pointer StorageBuffer
        %c0 = OpConstant %uint 0
        %c1 = OpConstant %uint 1
        %c7 = OpConstant %uint 7
        %main_type = OpTypeFunction %void
        %number_type = OpTypeFunction %uint %uint
    )" + declarations;
}
std::string main_of(const std::string& body, const std::string& variables = {}) {
    return "%main = OpFunction %void None %main_type\n%entry = OpLabel\n" + variables +
           "%id = OpLoad %uint %index\n%place = OpAccessChain %pointer %out %c0\n" + body + "OpReturn\nOpFunctionEnd\n";
}

// ---- Time

TEST_P(HostileInput, LoopsWithoutEndLoseTheDevice) {
    const std::string result = "layout(local_size_x = 20) in; layout(set = 0, binding = 0) buffer R { uint r[]; };\n";
    const char* const bodies[] = {
        "void main() { while (true) r[0] += 1u; }",
        "void main() { for (uint i = 0u; ; ++i) { r[i & 1u] += 1u; if (gl_LocalInvocationIndex == 3u) continue; if (i "
        "> 10u) break; } }",
        "void main() { uint x = 1u; do { x = x * 5u + gl_LocalInvocationIndex | 1u; } while (x != 0u); r[0] = x; }",
        "shared uint s; void main() { s = 1u; while (true) { barrier(); atomicAdd(s, 2u); barrier(); } }",
        "uint f(uint x) { while ((x & 1u) == (x & 1u)) { switch (x & 3u) { case 0u: continue; default: x += 4u; } } "
        "return x; }"
        "void main() { for (int i = 0; i < 5; ++i) r[i] = f(r[i]); }",
        "void main() { for (uint a = 0u; a < 4000000000u; ++a) for (uint b = 0u; b < 4000000000u; ++b) r[a & 1u] ^= b; "
        "}",
    };
    for (const char* const body : bodies) {
        EXPECT_EQ(run_glsl(result + body), Outcome::lost) << body << "\n" << reason();
        EXPECT_THAT(reason(), HasSubstr("'hostile'"));
        EXPECT_THAT(reason(), HasSubstr("0.2 s"));
    }
    EXPECT_EQ(
        run_glsl(
            "layout(location = 0) out vec4 o; void main() { o = vec4(0); while (true) o += vec4(gl_FragCoord.x); }",
            "endless.frag"),
        Outcome::lost)
        << reason();
    EXPECT_EQ(run_glsl("void main() { gl_Position = vec4(0); while (true) gl_Position += vec4(gl_VertexIndex); }",
                       "endless.vert"),
              Outcome::lost)
        << reason();
}

TEST_P(HostileInput, MoreThanTwoToThe31WorkgroupsAreRefusedOrStopped) {
    const ShortWatchdog watchdog;
    Instance instance(all_backends());
    const auto device = ok(instance.create_device({.backend = GetParam()}));
    std::vector<std::string> messages;
    device->set_message_callback([&](const Message& message) { messages.push_back(message.text); });
    ShaderCompiler compiler({});
    const Shader shader = ok(device->create_shader(ok(compiler.compile({.path = "many.comp", .text = R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer R { uint r[]; };
        void main() { r[gl_WorkGroupID.x & 3u] += 1u; }
    )"}))));
    const ComputePipeline pipeline = ok(device->create_compute_pipeline({.shader = shader, .name = "many"}));
    const Buffer buffer =
        ok(device->create_buffer({.size = 64, .usage = BufferUsage::storage | BufferUsage::indirect}));
    const BindGroup group = ok(device->create_bind_group({.layout = ok(device->bind_group_layout(pipeline, 0)),
                                                          .entries = {{.binding = 0, .buffer = buffer}},
                                                          .name = "many"}));
    const auto dispatch = [&](const DispatchArguments& arguments) -> Expected<void> {
        CommandList list = device->create_command_list("many");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        list.dispatch(arguments);
        NACRE_TRY(const Fence fence, device->submit(std::move(list)));
        return device->wait(fence);
    };
    const auto too_many = dispatch({.x = 1u << 31});
    ASSERT_FALSE(too_many);
    EXPECT_EQ(too_many.error().code, ErrorCode::validation);
    EXPECT_THAT(too_many.error().message(), HasSubstr("2147483648"));
    EXPECT_TRUE(dispatch({.x = 3}));
    const auto very_many = dispatch({.x = 65535, .y = 65535});
    ASSERT_FALSE(very_many);
    EXPECT_EQ(very_many.error().code, ErrorCode::device_lost);
    EXPECT_THAT(very_many.error().message(), HasSubstr("many"));
    EXPECT_TRUE(device->is_lost());
    EXPECT_TRUE(ModuleRunner::create(GetParam()));
}

// ---- Size

TEST_P(HostileInput, HugeArraysAreErrorsThatNameTheSize) {
    const std::string result = "layout(local_size_x = 8) in; layout(set = 0, binding = 0) buffer R { uint r[]; };\n";
    const std::string use = "[r[0]] = 1u; r[1] = a[r[2]]; }";
    for (const std::string count : {"100000000", "1073741824", "2147483647"}) {
        EXPECT_EQ(run_glsl(result + "void main() { uint a[" + count + "]; a" + use), Outcome::refused) << count;
        EXPECT_THAT(reason(), HasSubstr(count));
        EXPECT_EQ(run_glsl(result + "uint a[" + count + "]; void main() { a" + use), Outcome::refused) << count;
        EXPECT_THAT(reason(), HasSubstr(count));
        EXPECT_EQ(run_glsl(result + "shared uint a[" + count + "]; void main() { a" + use), Outcome::refused) << count;
    }
    // Many of what is allowed by itself.
    std::string variables, uses;
    for (int i = 0; i < 64; ++i) {
        variables += fmt::format("uint a{}[1000000];\n", i);
        uses += fmt::format("a{0}[r[{0}]] = {0}u; r[{0}] += a{0}[r[1]];\n", i);
    }
    EXPECT_EQ(run_glsl(result + variables + "void main() { " + uses + "}"), Outcome::refused);
    // Whole ones are copied; to take long is not to hang.
    const Outcome copied = run_glsl(
        result + "void main() { uint a[20000]; uint b[20000]; a[r[0] % 20000u] = 1u; b = a; r[1] = b[r[2]]; }");
    EXPECT_TRUE(copied == Outcome::ran || copied == Outcome::refused) << reason();
    EXPECT_EQ(run_glsl(result + "shared uint a[16000]; void main() { a" + use), Outcome::ran) << reason();
    EXPECT_EQ(run_glsl(result + "shared uint a[20000]; void main() { a" + use), Outcome::refused);
    // A block that is larger than any buffer is bound as far as there is one.
    EXPECT_EQ(run_glsl("layout(local_size_x = 8) in; layout(set = 0, binding = 0) buffer R { uint a[500000000]; uint "
                       "b[500000000]; };"
                       "void main() { b[gl_LocalInvocationIndex] = a[499999999] + a[3]; a[gl_LocalInvocationIndex * "
                       "100000000u] = 1u; }"),
              Outcome::ran)
        << reason();
    EXPECT_EQ(run_glsl("layout(local_size_x = 8) in; layout(set = 0, binding = 0) uniform U { uvec4 u[4000]; };"
                       "layout(set = 0, binding = 1) buffer R { uint r[]; };"
                       "void main() { r[gl_LocalInvocationIndex] = u[gl_LocalInvocationIndex * 500u].x; }"),
              Outcome::ran) << reason();
}

TEST_P(HostileInput, WholeArraysAreLoadedOrRefused) {
    // As registers they take the stack of a thread, or much time.
    for (const int count : {5000, 60000}) {
        const std::string types = fmt::format(
            "%n = OpConstant %uint {}\n%array = OpTypeArray %uint %n\n%array_pointer = OpTypePointer Private %array\n"
            "%a = OpVariable %array_pointer Private\n%b = OpVariable %array_pointer Private\n",
            count);
        std::string copies =
            "%x = OpAccessChain %private_pointer %a %id\n%y = OpAccessChain %private_pointer %b %id\nOpStore %x %id\n";
        for (int i = 0; i < 4; ++i)
            copies += fmt::format("%v{0} = OpLoad %array %{1}\nOpStore %{2} %v{0}\nOpStore %{3} %id\n", i,
                                  i % 2 ? "b" : "a", i % 2 ? "a" : "b", i % 2 ? "x" : "y");
        const Outcome outcome =
            run(assemble(head(types) + main_of(copies + "%r = OpLoad %uint %y\nOpStore %place %r\n")));
        EXPECT_EQ(outcome, count == 5000 ? Outcome::ran : outcome) << reason();
        EXPECT_TRUE(outcome == Outcome::ran || outcome == Outcome::refused);
    }
}

TEST_P(HostileInput, AConstantArrayOfAQuarterOfAMillion) {
    std::string constants, list;
    for (int i = 0; i < 1000; ++i) constants += fmt::format("%k{} = OpConstant %uint {}\n", i, i * 7 + 3);
    for (int i = 0; i < 500; ++i) list += fmt::format(" %k{}", i);
    // 500 in a row, 500 rows: rows share their constants.
    const std::string declarations =
        constants +
        "%n = OpConstant %uint 500\n%row = OpTypeArray %uint %n\n%rows = OpTypeArray %row %n\n"
        "%row_value = OpConstantComposite %row" +
        list + "\n%table = OpConstantComposite %rows" +
        [] {
            std::string all;
            for (int i = 0; i < 500; ++i) all += " %row_value";
            return all;
        }() +
        "\n%rows_pointer = OpTypePointer Private %rows\n%held = OpVariable %rows_pointer Private %table\n";
    const Outcome outcome = run(assemble(head(declarations) + main_of(
        "%at = OpAccessChain %private_pointer %held %id %id\n%v = OpLoad %uint %at\nOpStore %place %v\n")));
    EXPECT_TRUE(outcome == Outcome::ran || outcome == Outcome::refused);
}

TEST_P(HostileInput, DeeplyNestedSelections) {
    for (const int depth : {500, 1500}) {
        std::string open, close;
        for (int i = 0; i < depth; ++i) {
            open += fmt::format(
                "%b{0} = OpBitwiseAnd %uint %id %c{1}\n%t{0} = OpIEqual %bool %b{0} %c0\nOpSelectionMerge %m{0} None\n"
                "OpBranchConditional %t{0} %then{0} %m{0}\n%then{0} = OpLabel\n",
                i, i % 2 ? 1 : 7);
            close = fmt::format("OpBranch %m{0}\n%m{0} = OpLabel\n", i) + close;
        }
        const Outcome outcome = run(assemble(head() + main_of(open + "OpStore %place %c7\n" + close)));
        EXPECT_TRUE(outcome == Outcome::ran || outcome == Outcome::refused) << depth;
        if (depth == 500) {
            EXPECT_EQ(outcome, Outcome::ran) << reason();
        }
    }
}

TEST_P(HostileInput, DeeplyNestedLoops) {
    for (const int depth : {40, 120}) {
        std::string open, close;
        for (int i = 0; i < depth; ++i) {
            open += fmt::format(
                "OpBranch %h{0}\n%h{0} = OpLabel\nOpLoopMerge %m{0} %n{0} None\nOpBranch %o{0}\n%o{0} = OpLabel\n", i);
            // Some invocations never leave.
            close = fmt::format(
                        "OpBranch %n{0}\n%n{0} = OpLabel\n%t{0} = OpIEqual %bool %id %c{1}\nOpBranchConditional %t{0} "
                        "%h{0} %m{0}\n"
                        "%m{0} = OpLabel\n",
                        i, i % 2) +
                    close;
        }
        const Outcome outcome = run(assemble(head() + main_of(open + "OpStore %place %c7\n" + close)));
        EXPECT_TRUE(outcome == Outcome::ran || outcome == Outcome::refused || outcome == Outcome::lost) << depth;
    }
}

TEST_P(HostileInput, DeeplyNestedTypes) {
    for (const int depth : {100, 1000, 50000}) {
        std::string types = "%s0 = OpTypeStruct %uint\n";
        for (int i = 1; i <= depth; ++i) types += fmt::format("%s{} = OpTypeStruct %s{}\n", i, i - 1);
        types += fmt::format("%deep = OpTypePointer Private %s{}\n%held = OpVariable %deep Private\n", depth);
        std::string chain = "%at = OpAccessChain %private_pointer %held";
        for (int i = 0; i <= depth; ++i) chain += " %c0";
        const Outcome outcome = run(
            assemble(head(types) +
                     main_of(depth > 200 ? "OpStore %place %c7\n"
                                         : chain + "\nOpStore %at %id\n%v = OpLoad %uint %at\nOpStore %place %v\n")));
        EXPECT_TRUE(outcome == Outcome::ran || outcome == Outcome::refused) << depth;
    }
    // Each holds two of the one before: 2^24 scalars in 24 lines.
    std::string types = "%s0 = OpTypeStruct %uint\n";
    for (int i = 1; i <= 24; ++i) types += fmt::format("%s{0} = OpTypeStruct %s{1} %s{1}\n", i, i - 1);
    EXPECT_EQ(run(assemble(head(types + "%deep = OpTypePointer Private %s24\n%held = OpVariable %deep Private\n") +
                           main_of("OpStore %place %c7\n"))),
              Outcome::refused);
    // Arrays of arrays whose sizes multiply beyond 64 bits.
    types = "%n = OpConstant %uint 65536\n%a0 = OpTypeArray %uint %n\n";
    for (int i = 1; i <= 5; ++i) types += fmt::format("%a{} = OpTypeArray %a{} %n\n", i, i - 1);
    EXPECT_EQ(run(assemble(head(types + "%deep = OpTypePointer Private %a5\n%held = OpVariable %deep Private\n") +
                           main_of("%at = OpAccessChain %private_pointer %held %id %id %id %id %id %id\nOpStore %at "
                                   "%id\n%v = OpLoad %uint %at\n"
                                   "OpStore %place %v\n"))),
              Outcome::refused);
}

// A place in a large array, written in loops, is not the whole array as so many values.
TEST_P(HostileInput, PlacesInLargeArraysAreNotWholeArrays) {
    EXPECT_EQ(run_glsl(R"(
        layout(local_size_x = 16) in;
        layout(set = 0, binding = 0) buffer R { uint r[]; };
        uint a[200000];
        void main() {
            for (uint i = 0u; i < 4u; ++i)
                for (uint k = 0u; k < 3u; ++k) {
                    if (((i + gl_LocalInvocationIndex) & 1u) == 0u) a[7] += k;
                    switch (k) { case 0u: a[5] = i; case 1u: a[9] += 1u; break; default: a[11] = a[7]; }
                }
            r[0] = a[5] + a[7] + a[9] + a[11];
        })"),
              Outcome::ran) << reason();
}

TEST_P(HostileInput, EnormousNumbersOfEverything) {
    const auto ends_well = [&](const std::string& text) {
        const Outcome outcome = run(assemble(text));
        EXPECT_TRUE(outcome == Outcome::ran || outcome == Outcome::refused) << reason();
    };
    // Functions that call one another in a row: as deep as a call can be.
    std::string functions;
    constexpr int function_count = 1500;
    for (int i = 0; i < function_count; ++i)
        functions += fmt::format(
            "%f{0} = OpFunction %uint {1} %number_type\n%x{0} = OpFunctionParameter %uint\n%l{0} = OpLabel\n"
            "%y{0} = OpIAdd %uint %x{0} %c7\n{2}OpReturnValue %{3}{0}\nOpFunctionEnd\n",
            i, i % 3 ? "None" : "DontInline",
            i ? fmt::format("%z{0} = OpFunctionCall %uint %f{1} %y{0}\n", i, i - 1) : "", i ? "z" : "y");
    ends_well(head() +
              main_of(fmt::format("%r = OpFunctionCall %uint %f{} %id\nOpStore %place %r\n", function_count - 1)) +
              functions);
    std::string variables, uses;
    for (int i = 0; i < 20000; ++i) {
        variables += fmt::format("%v{} = OpVariable %local_pointer Function\n", i);
        uses += fmt::format("OpStore %v{} %id\n", i);
    }
    ends_well(head() + main_of(uses + "%r = OpLoad %uint %v77\nOpStore %place %r\n", variables));
    std::string globals;
    uses.clear();
    for (int i = 0; i < 20000; ++i)
        globals += fmt::format("%v{} = OpVariable %private_pointer Private\n", i),
            uses += fmt::format("OpStore %v{} %id\n", i);
    ends_well(head(globals) + main_of(uses + "%r = OpLoad %uint %v77\nOpStore %place %r\n"));
    std::string sum = "%s0 = OpIAdd %uint %id %c7\n";
    for (int i = 1; i < 30000; ++i) sum += fmt::format("%s{0} = OpIMul %uint %s{1} %id\n", i, i - 1);
    ends_well(head() + main_of(sum + "OpStore %place %s29999\n"));
    std::string cases = "OpSelectionMerge %merge None\nOpSwitch %id %merge", blocks;
    for (int i = 0; i < 3000; ++i)
        cases += fmt::format(" {} %case{}", i * 3, i),
            blocks += fmt::format("%case{} = OpLabel\nOpStore %place %c1\nOpBranch %merge\n", i);
    ends_well(head() + main_of(cases + "\n" + blocks + "%merge = OpLabel\n"));
}

// What lies behind a loop that is never left cannot be reached, and a pass of SPIRV-Tools against dead code crashes on
// it.
TEST_P(HostileInput, BlocksBehindALoopWithoutEndMayBeUnreachable) {
    EXPECT_EQ(run(assemble(head() + main_of(R"(
        OpBranch %start
        %start = OpLabel
        OpLoopMerge %after %next None
        OpBranch %middle
        %dead = OpLabel
        %more = OpINotEqual %bool %id %c7
        OpBranchConditional %more %live %after
        %live = OpLabel
        %odd = OpULessThan %bool %id %c7
        OpSelectionMerge %join None
        OpBranchConditional %odd %middle %join
        %middle = OpLabel
        OpStore %place %c7
        OpBranch %join
        %join = OpLabel
        OpBranch %next
        %next = OpLabel
        OpBranch %start
        %after = OpLabel
        %last = OpULessThan %bool %id %c1
        OpSelectionMerge %end None
        OpBranchConditional %odd %then %end
        %then = OpLabel
        OpStore %place %c1
        OpBranch %end
        %end = OpLabel
    )"))),
              Outcome::lost) << reason();
}

TEST_P(HostileInput, RecursionIsAnError) {
    const std::string direct = R"(
        %f = OpFunction %uint None %number_type
        %x = OpFunctionParameter %uint
        %l = OpLabel
        %y = OpFunctionCall %uint %f %x
        OpReturnValue %y
        OpFunctionEnd
    )";
    EXPECT_EQ(run(assemble(head() + main_of("%r = OpFunctionCall %uint %f %id\nOpStore %place %r\n") + direct)),
              Outcome::refused);
    EXPECT_THAT(reason(), HasSubstr("call graph with cycles"));
    const std::string mutual = R"(
        %f = OpFunction %uint DontInline %number_type
        %x = OpFunctionParameter %uint
        %l = OpLabel
        %y = OpFunctionCall %uint %g %x
        OpReturnValue %y
        OpFunctionEnd
        %g = OpFunction %uint DontInline %number_type
        %a = OpFunctionParameter %uint
        %b = OpLabel
        %c = OpFunctionCall %uint %f %a
        OpReturnValue %c
        OpFunctionEnd
    )";
    EXPECT_EQ(run(assemble(head() + main_of("%r = OpFunctionCall %uint %f %id\nOpStore %place %r\n") + mutual)),
              Outcome::refused);
    // Also where nothing reaches it.
    EXPECT_NE(run(assemble(head() + main_of("OpStore %place %c7\n") + mutual)), Outcome::lost);
    // And where main calls itself.
    EXPECT_EQ(run(assemble(head() + main_of("%r = OpFunctionCall %void %main\n"))), Outcome::refused);
}

INSTANTIATE_TEST_SUITE_P(Devices, HostileInput,
                         testing::Values("cpu:fast:lanes=16:threads=2", "cpu:consistent:lanes=4:threads=1"),
                         [](const auto& at) { return std::string(at.param).substr(4, 4) + std::to_string(at.index); });

// ---- What the validator lets pass or nobody writes

class OddModule : public testing::TestWithParam<const char*> {};

TEST_P(OddModule, PointersAreUsedBehindTheBlockThatMakesThem) {
    const std::string declarations = R"(
        OpDecorate %floats ArrayStride 4
        OpDecorate %float_block Block
        OpMemberDecorate %float_block 0 Offset 0
        OpDecorate %fout DescriptorSet 0
        OpDecorate %fout Binding 1
    )", types = R"(
        %float = OpTypeFloat 32
        %f2 = OpConstant %float 2
        %floats = OpTypeRuntimeArray %float
        %float_block = OpTypeStruct %floats
        %float_block_pointer = OpTypePointer StorageBuffer %float_block
        %float_pointer = OpTypePointer StorageBuffer %float
        %fout = OpVariable %float_block_pointer StorageBuffer
    )";
    std::string text = head(types) + main_of(R"(
        %bit = OpBitwiseAnd %uint %id %c1
        OpBranch %loop
        %loop = OpLabel
        %i = OpPhi %uint %c0 %entry %next %continue
        OpLoopMerge %behind %continue None
        OpBranch %body
        %body = OpLabel
        %stays = OpULessThan %bool %i %id
        OpBranchConditional %stays %makes %behind
        %makes = OpLabel
        %at = OpAccessChain %float_pointer %fout %c0 %id
        OpBranch %inner
        %inner = OpLabel
        %j = OpPhi %uint %c0 %makes %inner_next %inner_continue
        OpLoopMerge %inner_behind %inner_continue None
        OpBranch %inner_body
        %inner_body = OpLabel
        OpStore %at %f2
        %inner_again = OpULessThan %bool %j %bit
        OpBranchConditional %inner_again %inner_continue %inner_behind
        %inner_continue = OpLabel
        %inner_next = OpIAdd %uint %j %c1
        OpBranch %inner
        %inner_behind = OpLabel
        %v = OpLoad %float %at
        %sum = OpFAdd %float %v %f2
        OpStore %at %sum
        OpBranch %continue
        %continue = OpLabel
        %next = OpIAdd %uint %i %c1
        OpBranch %loop
        %behind = OpLabel
    )");
    text.insert(text.find("%void = OpTypeVoid"), declarations);
    const auto runner = ok(ModuleRunner::create(GetParam()));
    EXPECT_EQ(runner->run(assemble(text), ShaderStage::compute, 1), Outcome::ran) << runner->reason();
}

TEST_P(OddModule, ConditionsOfSubgroupsThatAreNumbersAreRefused) {
    const auto runner = ok(ModuleRunner::create(GetParam()));
    for (const std::string operation :
         {"%r = OpGroupNonUniformBallot %words %c3 %id\n", "%r = OpGroupNonUniformAll %bool %c3 %id\n",
          "%r = OpGroupNonUniformAny %bool %c3 %id\n"}) {
        std::string text = head("%words = OpTypeVector %uint 4\n%c3 = OpConstant %uint 3\n") + main_of(operation);
        text.insert(
            text.find("OpMemoryModel"),
            "OpCapability GroupNonUniform\nOpCapability GroupNonUniformBallot\nOpCapability GroupNonUniformVote\n");
        EXPECT_EQ(runner->run(assemble(text), ShaderStage::compute, 1), Outcome::refused) << operation;
        EXPECT_THAT(runner->reason(), HasSubstr("bool")) << operation;
    }
}

INSTANTIATE_TEST_SUITE_P(Devices, OddModule,
                         testing::Values("cpu:fast", "cpu:consistent:lanes=4", "cpu:double", "cpu:sanitize"),
                         [](const auto& at) { return std::string(at.param).substr(4, 4) + std::to_string(at.index); });

// ---- Indices

/// One of each kind of memory with known content, read and written at indices that are mostly out of range.
class IndexOutOfRange : public testing::TestWithParam<const char*> {
  public:
    static constexpr std::array<std::int32_t, 12> indices{0, 1,   2,     3,       -1,         4,
                                                          5, 100, 65536, 1 << 28, 2147483647, -2147483647 - 1};
    static constexpr std::uint32_t words = 64;

    /// `body` sets `uint got` for the invocation's index `int i`; returns that of each invocation.
    std::vector<std::uint32_t> evaluate(const std::string& declarations, const std::string& body) {
        Instance instance(all_backends());
        // Without validation, which wants all of a block to be bound.
        const auto device = ok(instance.create_device({.backend = GetParam(), .validation = false}));
        device->set_message_callback([](const Message& message) {
            if (message.severity != MessageSeverity::info) ADD_FAILURE() << message.text;
        });
        ShaderCompiler compiler({});
        const Shader shader = ok(device->create_shader(ok(compiler.compile(
            {.path = "index.comp",
             .text = R"(
            #extension GL_EXT_nonuniform_qualifier : require
            layout(local_size_x = 12) in;
            layout(set = 0, binding = 0) buffer Result { uint result[12]; };
            layout(set = 0, binding = 1) readonly buffer Indices { int indices[12]; };
        )" + declarations +
                     "\nvoid main() { uint id = gl_LocalInvocationIndex; int i = indices[id]; uint got = 999u;\n" +
                     body + "\nresult[id] = got; }\n"}))));
        const ComputePipeline pipeline = ok(device->create_compute_pipeline({.shader = shader, .name = "index"}));
        const auto usage =
            BufferUsage::storage | BufferUsage::uniform | BufferUsage::copy_source | BufferUsage::copy_destination;
        const auto buffer = [&](std::vector<std::uint32_t> content) {
            const Buffer made = ok(device->create_buffer({.size = content.size() * 4, .usage = usage}));
            EXPECT_TRUE(device->write_buffer(made, std::span<const std::uint32_t>(content)));
            return made;
        };
        // Words 1000, 1001, ...; of the middle 256 bytes at most a part is bound.
        std::vector<std::uint32_t> content(words * 3);
        for (std::uint32_t w = 0; w < content.size(); ++w) content[w] = 1000 + w - words;
        const Buffer result = buffer(Words(12)), storage = buffer(content), uniform = buffer(content);
        Words numbers(12);
        std::memcpy(numbers.data(), indices.data(), sizeof(indices));
        const Buffer index_buffer = buffer(numbers);
        std::vector<Texture> textures;
        const auto texture = [&](TextureUsage texture_usage) {
            textures.push_back(ok(device->create_texture(
                {.format = Format::r32_uint,
                 .width = 4,
                 .height = 4,
                 .layers = 4,
                 .usage = texture_usage | TextureUsage::copy_source | TextureUsage::copy_destination})));
            for (std::uint32_t layer = 0; layer < 4; ++layer) {
                Words texels(16);
                for (std::uint32_t t = 0; t < 16; ++t) texels[t] = 1000 + t + 100 * (layer - 1);
                EXPECT_TRUE(device->write_texture(textures.back(), std::as_bytes(std::span(texels)), 0, layer));
            }
            TextureView view(textures.back());
            view.base_layer = 1;
            return view;
        };
        const Sampler sampler =
            ok(device->create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest}));
        std::vector<BindGroupEntry> entries;
        const BindGroupLayout layout = ok(device->bind_group_layout(pipeline, 0));
        for (const BindingLayout& binding : ok(device->describe(layout)).bindings)
            for (std::uint32_t element = 0; element < binding.count; ++element) {
                BindGroupEntry entry{.binding = binding.binding, .element = element};
                switch (binding.binding) {
                    case 0: entry.buffer = result; break;
                    case 1: entry.buffer = index_buffer; break;
                    // Four words are bound of each; in front and behind lies what may be neither read nor written.
                    case 2: entry.buffer = storage, entry.offset = words * 4, entry.size = 16; break;
                    case 3: entry.buffer = uniform, entry.offset = words * 4, entry.size = 16; break;
                    case 4:
                        entry.texture = texture(TextureUsage::storage), entry.texture.dimension = ViewDimension::d2,
                        entry.texture.layer_count = 1;
                        break;
                    case 5:
                        entry.texture = texture(TextureUsage::storage),
                        entry.texture.dimension = ViewDimension::d2_array, entry.texture.layer_count = 2;
                        break;
                    case 6:
                        entry.texture = texture(TextureUsage::sampled),
                        entry.texture.dimension = ViewDimension::d2_array, entry.texture.layer_count = 2,
                        entry.sampler = sampler;
                        break;
                    case 7: entry.buffer = buffer(Words(4, 50 + element)); break;
                    default:
                        entry.texture = texture(TextureUsage::sampled), entry.texture.dimension = ViewDimension::d2,
                        entry.texture.layer_count = 1, entry.sampler = sampler;
                        break;
                }
                entries.push_back(entry);
            }
        const BindGroup group = ok(device->create_bind_group({.layout = layout, .entries = entries, .name = "index"}));
        CommandList list = device->create_command_list("index");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        if (declarations.find("push_constant") != std::string::npos)
            list.set_push_constants(std::array<std::uint32_t, 4>{1000, 1001, 1002, 1003});
        list.dispatch({});
        EXPECT_TRUE(device->wait(ok(device->submit(std::move(list)))));
        const auto read = [&](Buffer from) {
            const auto bytes = ok(device->read_buffer(from));
            Words got(bytes.size() / 4);
            std::memcpy(got.data(), bytes.data(), bytes.size());
            return got;
        };
        const Words stored = read(storage);
        for (std::uint32_t w = 0; w < content.size(); ++w)
            if (w < words || w >= words + 4) {
                EXPECT_EQ(stored[w], content[w]) << "word " << w << " beside what is bound";
            }
        EXPECT_EQ(read(uniform), content);
        for (const Texture at : textures)
            for (const std::uint32_t layer : {0u, 3u}) {
                const auto bytes = ok(device->read_texture(at, 0, layer));
                Words texels(16);
                std::memcpy(texels.data(), bytes.data(), std::min<std::size_t>(bytes.size(), 64));
                for (std::uint32_t t = 0; t < 16; ++t)
                    EXPECT_EQ(texels[t], 1000 + t + 100 * (layer - 1)) << "layer " << layer;
            }
        return read(result);
    }
    /// 1000 + i where i is below the count, 0 elsewhere.
    void expect_zero_beyond(std::uint32_t count, const std::string& declarations, const std::string& body) {
        const Words got = evaluate(declarations, body);
        for (std::size_t at = 0; at < indices.size(); ++at) {
            const bool is_inside = indices[at] >= 0 && static_cast<std::uint32_t>(indices[at]) < count;
            EXPECT_EQ(got[at], is_inside ? 1000u + static_cast<std::uint32_t>(indices[at]) : 0u)
                << "index " << indices[at] << " of " << body;
        }
    }
};

TEST_P(IndexOutOfRange, ReadsZeroOfEveryMemory) {
    expect_zero_beyond(4, "layout(set = 0, binding = 2) buffer S { uint s[]; };", "got = s[i];");
    expect_zero_beyond(4, "layout(set = 0, binding = 2) buffer S { uint s[1000000]; };", "got = s[i];");
    expect_zero_beyond(4, "layout(set = 0, binding = 2) buffer S { uvec2 pairs[]; };",
                       "got = i >= 0 && i < 4 ? pairs[i >> 1][i & 1] : pairs[i][1] + pairs[i | 2].x;");
    expect_zero_beyond(4,
                       "struct T { uint a; }; struct U { T t[2]; }; layout(set = 0, binding = 2) buffer S { U u[]; };",
                       "got = i >= 0 && i < 4 ? u[i >> 1].t[i & 1].a : u[i].t[0].a + u[0].t[i].a;");
    expect_zero_beyond(1, "layout(set = 0, binding = 3) uniform U { uvec4 u[8]; };", "got = u[i].x;");
    expect_zero_beyond(4, "layout(push_constant) uniform P { uint p[4]; };", "got = p[i];");
    expect_zero_beyond(4, "",
                       "uint a[4] = uint[4](1000u, 1001u, 1002u, 1003u); a[id & 3u] = 1000u + (id & 3u); got = a[i];");
    expect_zero_beyond(4, "uint a[4];", "for (uint j = 0u; j < 4u; ++j) a[j] = 1000u + j + id - id; got = a[i];");
    expect_zero_beyond(4, "const uint a[4] = uint[4](1000u, 1001u, 1002u, 1003u);", "got = a[i];");
    expect_zero_beyond(4, "shared uint a[4];", "if (id < 4u) a[id] = 1000u + id; barrier(); got = a[i];");
    expect_zero_beyond(3, "", "uvec3 v = uvec3(1000u, 1001u, 1002u) + id - id; got = v[i];");
    expect_zero_beyond(
        4, "", "mat4 m = mat4(0.0); for (int j = 0; j < 4; ++j) m[j][2] = 1000.0 + float(j); got = uint(m[i][2]);");
    expect_zero_beyond(
        4, "", "mat4 m = mat4(0.0); for (int j = 0; j < 4; ++j) m[1][j] = 1000.0 + float(j); got = uint(m[1][i]);");
    expect_zero_beyond(2, "layout(set = 0, binding = 2, row_major) buffer S { mat2 m[]; };",
                       "got = floatBitsToUint(m[0][0][i]) - (i == 1 ? 1u : 0u);");
    expect_zero_beyond(4, "layout(set = 0, binding = 4, r32ui) uniform uimage2D image;",
                       "got = imageLoad(image, ivec2(i, 0)).x;");
    expect_zero_beyond(2, "layout(set = 0, binding = 5, r32ui) uniform uimage2DArray image;",
                       "got = imageLoad(image, ivec3(0, 0, i)).x; if (i == 1) got -= 99u;");
    expect_zero_beyond(4, "layout(set = 0, binding = 6) uniform usampler2DArray image;",
                       "got = texelFetch(image, ivec3(0, 0, 0) + ivec3(i, 0, 0), 0).x;");
    expect_zero_beyond(2, "layout(set = 0, binding = 6) uniform usampler2DArray image;",
                       "got = texelFetch(image, ivec3(0, 0, i), 0).x; if (i == 1) got -= 99u;");
    // Levels that do not exist.
    expect_zero_beyond(1, "layout(set = 0, binding = 6) uniform usampler2DArray image;",
                       "got = texelFetch(image, ivec3(0), i).x;");
}

TEST_P(IndexOutOfRange, DescriptorsOfArraysReadZero) {
    const Words got =
        evaluate("layout(set = 0, binding = 7) buffer S { uint s[]; } all[3];", "got = all[nonuniformEXT(i)].s[1];");
    for (std::size_t at = 0; at < indices.size(); ++at)
        EXPECT_EQ(got[at], indices[at] >= 0 && indices[at] < 3 ? 50u + static_cast<std::uint32_t>(indices[at]) : 0u)
            << indices[at];
    const Words texels = evaluate("layout(set = 0, binding = 8) uniform usampler2D all[3];",
                                  "got = texelFetch(all[nonuniformEXT(i)], ivec2(1, 0), 0).x + "
                                  "texelFetch(all[nonuniformEXT(i)], ivec2(i, 0), 0).x;");
    for (std::size_t at = 0; at < indices.size(); ++at)
        EXPECT_EQ(texels[at],
                  indices[at] >= 0 && indices[at] < 3 ? 2001u + static_cast<std::uint32_t>(indices[at]) : 0u)
            << indices[at];
}

TEST_P(IndexOutOfRange, WritesAreDropped) {
    // Whatever is around is looked at by `evaluate`; here what is inside.
    const auto expect_all = [&](const std::string& declarations, const std::string& body, std::uint32_t expected) {
        for (const std::uint32_t word : evaluate(declarations, body)) EXPECT_EQ(word, expected) << body;
    };
    const std::string outside = "if (i < 0 || i > 3) ";
    expect_all("layout(set = 0, binding = 2) buffer S { uint s[]; };",
               outside +
                   "{ s[i] = 7u; atomicAdd(s[i], 5u); atomicExchange(s[i ^ 0x40000000], 3u); } barrier(); got = s[0] + "
                   "s[1] + s[2] + s[3];",
               4006);
    expect_all("layout(set = 0, binding = 2) buffer S { uvec4 s[]; };",
               outside + "s[i] = uvec4(7u); barrier(); got = s[0].x + s[0].w;", 2003);
    expect_all("layout(set = 0, binding = 2) buffer S { uvec4 s; };",
               outside + "s[i] = 7u; barrier(); got = s.x + s.w;", 2003);
    expect_all("shared uint before[8]; shared uint a[4]; shared uint behind[8];",
               "if (id < 8u) before[id] = 1u, behind[id] = 1u, a[id & 3u] = 1u; barrier();" + outside +
                   "{ a[i] = 7u; atomicAdd(a[i], 3u); } barrier(); got = 0u; for (int j = 0; j < 8; ++j) got += "
                   "before[j] + behind[j] + a[j & 3];",
               24);
    expect_all("uint before[8]; uint a[4]; uint behind[8];",
               "for (int j = 0; j < 8; ++j) before[j] = 1u, behind[j] = 1u, a[j & 3] = 1u;" + outside +
                   "a[i] = 7u; got = 0u; for (int j = 0; j < 8; ++j) got += before[j] + behind[j] + a[j & 3];", 24);
    expect_all(
        "",
        "uint before[8], a[4], behind[8]; for (int j = 0; j < 8; ++j) before[j] = 1u, behind[j] = 1u, a[j & 3] = 1u;" +
            outside + "a[i] = 7u; got = 0u; for (int j = 0; j < 8; ++j) got += before[j] + behind[j] + a[j & 3];",
        24);
    expect_all("", "uvec4 v = uvec4(1u); " + outside + "v[i] = 7u; got = v.x + v.y + v.z + v.w;", 4);
    expect_all("",
               "mat3 m = mat3(1.0); if (i < 0 || i > 2) { m[i] = vec3(7.0); m[1][i] = 7.0; m[i][i] = 7.0; } got = "
               "uint(m[0][0] + m[1][1] + m[2][2]);",
               3);
    expect_all("layout(set = 0, binding = 4, r32ui) uniform uimage2D image;",
               outside +
                   "{ imageStore(image, ivec2(i, 1), uvec4(7u)); imageStore(image, ivec2(0, i), uvec4(7u)); "
                   "imageAtomicAdd(image, ivec2(i, i), 1u); }"
                   "barrier(); got = imageLoad(image, ivec2(0, 1)).x + imageLoad(image, ivec2(3, 3)).x;",
               2019);
    expect_all("layout(set = 0, binding = 5, r32ui) uniform uimage2DArray image;",
               "if (i < 0 || i > 1) { imageStore(image, ivec3(0, 0, i), uvec4(7u)); imageAtomicMax(image, ivec3(0, 0, "
               "i), 5000u); }"
               "barrier(); got = imageLoad(image, ivec3(0)).x + imageLoad(image, ivec3(0, 0, 1)).x;",
               2100);
    expect_all("layout(set = 0, binding = 7) buffer S { uint s[]; } all[3];",
               outside + "all[nonuniformEXT(i)].s[0] = 7u; barrier(); got = all[0].s[0] + all[1].s[0] + all[2].s[0];",
               153);
}

INSTANTIATE_TEST_SUITE_P(Devices, IndexOutOfRange,
                         testing::Values("cpu:fast:lanes=16:threads=1", "cpu:consistent:lanes=4:threads=1",
                                         "cpu:fast:lanes=8:threads=1"),
                         [](const auto& at) { return std::string(at.param).substr(4, 4) + std::to_string(at.index); });

}  // namespace
}  // namespace nacre::hostile
