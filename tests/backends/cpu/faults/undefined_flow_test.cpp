// SPDX-License-Identifier: Apache-2.0
// Undefined values on their way out of one shader: to the next stage, into blending and tests, and as what a draw reads
// by itself. Each fault is planted; beside each stands the like without a fault, of which nothing is reported.
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "backends/cpu/cpu_backend.h"
#include "tests/backends/cpu/faults/fault_bench.h"

namespace nacre::cpu {
namespace {

using ::testing::HasSubstr;
using rhi::LoadOperation;

constexpr const char* every_kind[] = {"sanitize:lanes=4", "sanitize:lanes=8", "sanitize:lanes=16",
                                      "double:sanitize",  "hostile"};

constexpr const char* white = "layout(location = 0) out vec4 color;\nvoid main() { color = vec4(1.0); }";

void expect_one(const FaultBench& bench, const std::vector<std::string>& parts) {
    const std::vector<rhi::Message> messages = bench.messages();
    ASSERT_EQ(messages.size(), 1u) << (messages.size() > 1 ? messages[0].text + "\n" + messages[1].text : "");
    EXPECT_TRUE(messages[0].code.starts_with("N-805")) << messages[0].text;
    EXPECT_EQ(messages[0].source, rhi::MessageSource::shader);
    for (const std::string& part : parts) EXPECT_THAT(messages[0].text, HasSubstr(part));
}

void expect_none(const FaultBench& bench) {
    for (const rhi::Message& message : bench.messages()) ADD_FAILURE() << message.text;
}

// ---- From stage to stage ----------------------------------------------------------------------------------------

/// A vertex shader that covers the target, with lines for its outputs.
std::string covering(const std::string& declarations, const std::string& body) {
    return declarations + "void main() {\n    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);\n"
           "    gl_Position = vec4(corner * 4.0 - 1.0, 0.5, 1.0);\n" + body + "}\n";
}

struct Varying {
    const char* name;
    const char* vertex_declarations;
    const char* vertex_body;
    const char* fragment;
    const char* object;  ///< Empty: there is no fault.
    const char* place = "pixel (0, 0)";
};

void PrintTo(const Varying& varying, std::ostream* out) { *out << varying.name; }

const Varying varyings[] = {
    {"Never", "layout(location = 0) out vec4 tint;\n", "",
     R"(layout(location = 0) in vec4 tint;
layout(location = 0) out vec4 color;
void main() {
    color = tint * 0.5; // FAULT
})",
     "tint"},
    {"OneComponent", "layout(location = 0) out vec4 tint;\n", "    tint.xyz = vec3(corner, 1.0);\n",
     R"(layout(location = 0) in vec4 tint;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(tint.xyz, 1.0);
    if (tint.w > 0.5) color.x = 0.0; // FAULT
})",
     "tint"},
    {"OtherComponents", "layout(location = 0) out vec4 tint;\n", "    tint.xyz = vec3(corner, 1.0);\n",
     R"(layout(location = 0) in vec4 tint;
layout(location = 0) out vec4 color;
void main() { color = vec4(tint.xyz, 1.0); })",
     ""},
    // One vertex is enough: it has a share in all pixels.
    {"OneVertex", "layout(location = 0) out vec4 tint;\n",
     "    if (gl_VertexIndex != 2) tint = vec4(corner, 1.0, 1.0);\n",
     R"(layout(location = 0) in vec4 tint;
layout(location = 0) out vec4 color;
void main() {
    color = tint; // FAULT
})",
     "tint"},
    {"Linear", "layout(location = 0) noperspective out float part;\n", "",
     R"(layout(location = 0) noperspective in float part;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(part); // FAULT
})",
     "part"},
    {"Flat", "layout(location = 0) flat out uint material;\n", "",
     R"(layout(location = 0) flat in uint material;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(float(material)); // FAULT
})",
     "material"},
    // Flat inputs are those of the first vertex.
    {"FlatOfAnotherVertex", "layout(location = 0) flat out uint material;\n",
     "    if (gl_VertexIndex == 0) material = 3u;\n",
     R"(layout(location = 0) flat in uint material;
layout(location = 0) out vec4 color;
void main() { color = vec4(float(material)); })",
     ""},
    {"AsIndex", "layout(location = 0) flat out uint material;\n", "",
     R"(layout(location = 0) flat in uint material;
layout(location = 0) out vec4 color;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    color = vec4(1.0);
    if (numbers.words[material] > 100u) color = vec4(0.0); // FAULT
})",
     "material"},
    {"Structure", "struct Surface { vec3 normal; vec2 place; };\nlayout(location = 1) out Surface surface;\n",
     "    surface.place = corner;\n",
     R"(struct Surface { vec3 normal; vec2 place; };
layout(location = 1) in Surface surface;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(surface.place, 0.0, 1.0);
    color.z = surface.normal.z; // FAULT
})",
     "surface"},
    {"DynamicElement", "layout(location = 0) out vec2 parts[3];\n", "    parts[0] = parts[1] = corner;\n",
     R"(layout(location = 0) in vec2 parts[3];
layout(location = 0) out vec4 color;
void main() {
    int which = int(gl_FragCoord.x) / 3;
    color = vec4(parts[which], 0.0, 1.0); // FAULT
})",
     "parts", "pixel (6, 0)"},
    {"Derivative", "layout(location = 0) out vec2 place;\n", "    place.x = corner.x;\n",
     R"(layout(location = 0) in vec2 place;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(dFdx(place.y)); // FAULT
})",
     "place"},
    {"AtCentroid", "layout(location = 0) out vec2 place;\n", "    place.x = corner.x;\n",
     R"(layout(location = 0) in vec2 place;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(interpolateAtCentroid(place.x), interpolateAtOffset(place, vec2(0.25)), 1.0); // FAULT
})",
     "place"},
    {"NotUsed", "layout(location = 0) out vec4 tint;\n", "",
     R"(layout(location = 0) in vec4 tint;
layout(location = 0) out vec4 color;
void main() {
    vec4 kept = tint;
    color = gl_FragCoord.x > 100.0 ? kept : vec4(1.0);
})",
     ""},
    {"FromUnwrittenMemory",
     "layout(location = 0) flat out uint material;\n"
     "layout(set = 0, binding = 0) readonly buffer Output { uint words[256]; } unwritten;\n",
     "    material = unwritten.words[7];\n",
     R"(layout(location = 0) flat in uint material;
layout(location = 0) out vec4 color;
void main() {
    color = vec4(1.0);
    if (material == 3u) color.x = 0.0; // FAULT
})",
     "material"},
};

class Varyings : public ::testing::TestWithParam<Varying> {};
INSTANTIATE_TEST_SUITE_P(CpuFaults, Varyings, ::testing::ValuesIn(varyings),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

TEST_P(Varyings, AreFollowedIntoFragments) {
    const Varying& varying = GetParam();
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        ASSERT_TRUE(bench.draw("varying.frag", varying.fragment,
                               covering(varying.vertex_declarations, varying.vertex_body)));
        if (std::string(varying.object).empty()) {
            expect_none(bench);
            continue;
        }
        std::vector<std::string> parts{faulty_line("varying.frag", varying.fragment), varying.object};
        // Tiles and their pixels come in another order under `hostile`, one tile here.
        parts.emplace_back(varying.place);
        expect_one(bench, parts);
    }
}

// ---- Targets ----------------------------------------------------------------------------------------------------

rhi::BlendState added() {
    return {.enabled = true,
            .source_color = rhi::BlendFactor::one,
            .destination_color = rhi::BlendFactor::one,
            .source_alpha = rhi::BlendFactor::one,
            .destination_alpha = rhi::BlendFactor::one};
}

void draw_in_pass(FaultBench& bench, const std::vector<rhi::GraphicsPipeline>& pipelines, LoadOperation load) {
    rhi::CommandList list = bench.device().create_command_list("once");
    list.begin_render_pass({.color = {{.view = rhi::TextureView{bench.target}, .load = load}}, .name = "only"});
    for (const rhi::GraphicsPipeline pipeline : pipelines) {
        list.set_pipeline(pipeline);
        list.draw({.vertex_count = 3});
    }
    list.end_render_pass();
    ASSERT_TRUE(bench.submit(std::move(list)));
}

rhi::GraphicsPipeline make(FaultBench& bench, const std::string& path, const std::string& text,
                           const rhi::BlendState& blend) {
    rhi::GraphicsPipelineDesc desc = bench.describe_graphics(path, text);
    desc.color_targets[0].blend = blend;
    const auto made = bench.device().create_graphics_pipeline(desc);
    EXPECT_TRUE(made);
    return made ? *made : rhi::GraphicsPipeline{};
}

TEST(CpuFaults, BlendingWithUndefinedTexelsIsReported) {
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        draw_in_pass(bench, {make(bench, "white.frag", white, added())}, LoadOperation::discard);
        expect_one(bench,
                   {"texture 'target'", "draw 1 of list 'once', pass 'only'", "pixel (0, 0)", "(and 63 more here)"});
    }
}

TEST(CpuFaults, BlendingBesideWhatWasWrittenIsReported) {
    const std::string left = R"(layout(location = 0) out vec4 color;
void main() {
    if (gl_FragCoord.x > 4.0) discard;
    color = vec4(0.5);
})";
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        draw_in_pass(bench, {make(bench, "left.frag", left, {}), make(bench, "white.frag", white, added())},
                     LoadOperation::discard);
        expect_one(bench, {"draw 2 of list 'once'", "pixel (4, 0)", "(and 31 more here)"});
    }
}

TEST(CpuFaults, BlendingWithWhatWasWrittenIsSilent) {
    rhi::BlendState replacing = added();
    replacing.destination_color = replacing.destination_alpha = rhi::BlendFactor::zero;
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        const rhi::GraphicsPipeline adds = make(bench, "white.frag", white, added());
        draw_in_pass(bench, {make(bench, "plain.frag", white, {}), adds}, LoadOperation::discard);
        draw_in_pass(bench, {adds}, LoadOperation::load);
        draw_in_pass(bench, {adds}, LoadOperation::clear);
        draw_in_pass(bench, {make(bench, "replace.frag", white, replacing), adds}, LoadOperation::discard);
        expect_none(bench);
    }
}

TEST(CpuFaults, LoadingATargetThatNothingHasWrittenIsReported) {
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        draw_in_pass(bench, {make(bench, "white.frag", white, {})}, LoadOperation::load);
        expect_one(bench, {"begin render pass", "texture 'target'", "list 'once', pass 'only'"});
        draw_in_pass(bench, {}, LoadOperation::load);
        EXPECT_EQ(bench.messages().size(), 1u) << "now it is written";
    }
}

TEST(CpuFaults, TestsOfUndefinedDepthAndStencilAreReported) {
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        for (const bool of_stencil : {false, true}) {
            SCOPED_TRACE(of_stencil);
            FaultBench bench(std::string("cpu:") + kind);
            rhi::Device& device = bench.device();
            const auto depth = device.create_texture({.format = rhi::Format::d32_float_s8_uint,
                                                      .width = 8,
                                                      .height = 8,
                                                      .usage = rhi::TextureUsage::depth_target,
                                                      .name = "depth"});
            ASSERT_TRUE(depth);
            rhi::GraphicsPipelineDesc desc = bench.describe_graphics("white.frag", white);
            desc.depth_stencil.format = rhi::Format::d32_float_s8_uint;
            desc.depth_stencil.depth_test = !of_stencil, desc.depth_stencil.stencil_test = of_stencil;
            desc.depth_stencil.front.compare = desc.depth_stencil.back.compare = rhi::CompareOperation::equal;
            const auto pipeline = device.create_graphics_pipeline(desc);
            ASSERT_TRUE(pipeline);
            const auto draw = [&](LoadOperation load) {
                rhi::CommandList list = device.create_command_list("once");
                rhi::RenderPassDesc pass;
                pass.color = {{.view = rhi::TextureView{bench.target}, .load = LoadOperation::clear}};
                pass.depth_stencil.view = rhi::TextureView{*depth};
                pass.depth_stencil.depth_load = pass.depth_stencil.stencil_load = load;
                pass.name = "only";
                list.begin_render_pass(pass);
                list.set_pipeline(*pipeline);
                list.draw({.vertex_count = 3});
                list.end_render_pass();
                ASSERT_TRUE(bench.submit(std::move(list)));
            };
            draw(LoadOperation::load);
            expect_one(bench, {of_stencil ? "test stencil" : "test depth", "texture 'depth'", "pass 'only'"});
            draw(LoadOperation::clear);
            draw(LoadOperation::load);
            expect_one(bench, {});
        }
    }
}

// ---- What commands read -----------------------------------------------------------------------------------------

TEST(CpuFaults, UndefinedIndicesAreReported) {
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        rhi::Device& device = bench.device();
        const auto indices = device.create_buffer(
            {.size = 32, .usage = rhi::BufferUsage::index | rhi::BufferUsage::copy_destination, .name = "corners"});
        ASSERT_TRUE(indices);
        constexpr std::array<std::uint16_t, 4> three{0, 1, 2, 0};
        ASSERT_TRUE(device.write_buffer(*indices, std::span<const std::uint16_t>(three), 4));
        const rhi::GraphicsPipeline pipeline = bench.make_graphics("white.frag", white);
        const auto draw = [&](std::uint32_t first) {
            rhi::CommandList list = device.create_command_list("once");
            list.begin_render_pass(
                {.color = {{.view = rhi::TextureView{bench.target}, .load = LoadOperation::clear}}, .name = "only"});
            list.set_pipeline(pipeline);
            list.set_index_buffer(*indices, rhi::IndexType::uint16, 4);
            list.draw_indexed({.index_count = 3, .first_index = first});
            list.end_render_pass();
            ASSERT_TRUE(bench.submit(std::move(list)));
        };
        draw(0);
        expect_none(bench);
        draw(2);
        expect_one(bench, {"draw 1 of list 'once'", "index 4 of buffer 'corners'"});
    }
}

TEST(CpuFaults, UndefinedIndirectArgumentsAreReportedAndLeftOut) {
    const std::string text = R"(layout(local_size_x = 1) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result;
void main() { result.words[gl_GlobalInvocationID.x] = 1u; })";
    for (const char* kind : every_kind) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        rhi::Device& device = bench.device();
        const auto arguments = device.create_buffer(
            {.size = 32, .usage = rhi::BufferUsage::indirect | rhi::BufferUsage::copy_destination, .name = "counts"});
        ASSERT_TRUE(arguments);
        constexpr std::array<std::uint32_t, 3> two{2, 1, 1};
        ASSERT_TRUE(device.write_buffer(*arguments, std::span<const std::uint32_t>(two), 0));
        const rhi::ComputePipeline pipeline = bench.make_compute("count.comp", text);
        const auto dispatch = [&](std::uint64_t offset) {
            rhi::CommandList list = device.create_command_list("once");
            list.set_pipeline(pipeline);
            list.set_bind_group(0, bench.bind(pipeline));
            list.dispatch_indirect(*arguments, offset);
            ASSERT_TRUE(bench.submit(std::move(list)));
        };
        dispatch(0);
        expect_none(bench);
        dispatch(4);
        expect_one(bench, {"dispatch indirectly", "list 'once'", "buffer 'counts'"});
    }
}

// ---- Indices ----------------------------------------------------------------------------------------------------

struct UndefinedIndex {
    const char* name;
    const char* text;
};

void PrintTo(const UndefinedIndex& index, std::ostream* out) { *out << index.name; }

const UndefinedIndex undefined_indices[] = {
    {"OfAVector", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = gl_GlobalInvocationID.x;
    uint chosen;
    if (numbers.words[i] != 2u) chosen = 1u;
    vec4 steps = vec4(float(i), 1.0, 2.0, 3.0);
    float step = (steps * 2.0)[chosen]; // FAULT
    if (step > 7.0) result.words[0] = 1.0;
})"},
    {"OfAnArrayOfBuffers", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { uint words[256]; } result[1];
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = gl_GlobalInvocationID.x;
    uint chosen;
    if (numbers.words[i] != 2u) chosen = 0u;
    result[chosen].words[i] = 1u; // FAULT
})"},
};

class UndefinedIndices : public ::testing::TestWithParam<UndefinedIndex> {};
INSTANTIATE_TEST_SUITE_P(CpuFaults, UndefinedIndices, ::testing::ValuesIn(undefined_indices),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

TEST_P(UndefinedIndices, AreReported) {
    const std::string text = GetParam().text;
    for (const char* kind : {"sanitize:lanes=4", "sanitize:lanes=16"}) {
        SCOPED_TRACE(kind);
        FaultBench bench(std::string("cpu:") + kind);
        ASSERT_TRUE(bench.compute("index.comp", text));
        // What lies there may be out of range as well.
        const std::vector<rhi::Message> messages = bench.messages();
        const auto found = std::ranges::find_if(
            messages, [](const rhi::Message& message) { return message.code.starts_with("N-805"); });
        ASSERT_NE(found, messages.end());
        EXPECT_THAT(found->text, HasSubstr(faulty_line("index.comp", text)));
        EXPECT_THAT(found->text, HasSubstr("chosen"));
        EXPECT_THAT(found->text, HasSubstr("invocation (2, 0, 0)"));
    }
}

// Of a vector with an undefined element another may be taken.
TEST(CpuFaults, DefinedElementsOfAVectorAreDefined) {
    FaultBench bench("cpu:sanitize");
    ASSERT_TRUE(bench.compute("element.comp", R"(layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Output { float words[256]; } result;
layout(set = 0, binding = 1) readonly buffer Input { uint words[64]; } numbers;
void main() {
    uint i = gl_GlobalInvocationID.x;
    vec4 steps;
    steps.xy = vec2(3.0, float(i));
    result.words[i] = (steps * 2.0)[numbers.words[i] & 1u];
})"));
    expect_none(bench);
}

}  // namespace
}  // namespace nacre::cpu
