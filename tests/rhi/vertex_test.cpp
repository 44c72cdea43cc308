// SPDX-License-Identifier: Apache-2.0
// Vertex input, indices, instances, topologies and indirect draws.
#include <cmath>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

/// Draws points into a row of texels: vertex i of instance k lands on texel (i, k) and writes what it was given.
class Vertices : public BackendTest {
  public:
    static constexpr std::uint32_t width = 8, height = 4;

    void SetUp() override {
        BackendTest::SetUp();
        if (HasFatalFailure() || IsSkipped()) return;
        result_ = target(Format::rgba32_uint, width, height, "vertices");
    }

    GraphicsPipelineDesc desc(const std::string& inputs, const std::string& value) {
        GraphicsPipelineDesc made;
        made.vertex = shader(ShaderStage::vertex, inputs + R"(
            layout(location = 0) flat out uvec4 value;
            void main() {
                value = )" + value + R"(;
                vec2 texel = vec2(float(gl_VertexIndex % 8) + 0.5, float(gl_InstanceIndex) + 0.5);
                gl_Position = vec4(texel / vec2(8.0, 4.0) * 2.0 - 1.0, 0.0, 1.0);
                gl_PointSize = 1.0;
            }
        )");
        made.fragment = shader(ShaderStage::fragment, R"(
            layout(location = 0) flat in uvec4 value;
            layout(location = 0) out uvec4 color;
            void main() { color = value; }
        )");
        made.topology = Topology::point_list;
        made.color_targets = {{.format = Format::rgba32_uint}};
        made.name = "points";
        return made;
    }

    template <typename Record>
    std::vector<std::array<std::uint32_t, 4>> draw(const GraphicsPipelineDesc& wanted, Record&& record) {
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(wanted));
        CommandList list = device().create_command_list("vertices");
        list.begin_render_pass(
            {.color = {{.view = result_, .load = LoadOperation::clear, .clear = {.uint = {99, 99, 99, 99}}}},
             .name = "vertices"});
        list.set_pipeline(pipeline);
        record(list);
        list.end_render_pass();
        run(std::move(list));
        return read<std::array<std::uint32_t, 4>>(result_);
    }

  private:
    Texture result_;
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Vertices);
INSTANTIATE_TEST_SUITE_P(Rhi, Vertices, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

float number(std::uint32_t value) {
    float result = 0;
    std::memcpy(&result, &value, 4);
    return result;
}

TEST_P(Vertices, AttributeFormats) {
    struct Case {
        Format format;
        std::vector<std::uint8_t> bytes;
        std::array<double, 4> expected;
    };
    const std::vector<Case> cases{
        {Format::r32_float, {0, 0, 0x20, 0x41}, {10, 0, 0, 1}},
        {Format::rg32_float, {0, 0, 0x20, 0x41, 0, 0, 0x80, 0xbf}, {10, -1, 0, 1}},
        {Format::rgb32_float, {0, 0, 0x20, 0x41, 0, 0, 0x80, 0xbf, 0, 0, 0, 0x3f}, {10, -1, 0.5, 1}},
        {Format::rgba32_float, {0, 0, 0x20, 0x41, 0, 0, 0x80, 0xbf, 0, 0, 0, 0x3f, 0, 0, 0, 0x40}, {10, -1, 0.5, 2}},
        {Format::rgba8_unorm, {0, 51, 102, 255}, {0, 0.2, 0.4, 1}},
        {Format::rgba8_snorm, {0x81, 0x7f, 0, 0x80}, {-1, 1, 0, -1}},
        {Format::rg8_unorm, {255, 51}, {1, 0.2, 0, 1}},
        {Format::rgba16_unorm, {0xff, 0xff, 0, 0, 0x33, 0x33, 0xff, 0xff}, {1, 0, 0.2, 1}},
        {Format::rg16_snorm, {0x01, 0x80, 0xff, 0x7f}, {-1, 1, 0, 1}},
        {Format::rg16_float, {0, 0x3c, 0, 0xc0}, {1, -2, 0, 1}},
        {Format::rgba16_float, {0, 0x3c, 0, 0xc0, 0, 0x38, 0, 0x44}, {1, -2, 0.5, 4}},
        {Format::rgb10a2_unorm, {0xff, 0x03, 0x00, 0xc0}, {1, 0, 0, 1}},
    };
    for (const Case& one : cases) {
        if (!supports(one.format, FormatSupport::vertex)) continue;
        std::vector<std::uint8_t> bytes(8, 0);
        bytes.insert(bytes.end(), one.bytes.begin(), one.bytes.end());
        bytes.resize(24, 0);
        const Buffer vertices = buffer_of<std::uint8_t>(bytes, BufferUsage::vertex);
        GraphicsPipelineDesc wanted = desc("layout(location = 3) in vec4 a;", "floatBitsToUint(a)");
        wanted.vertex_buffers = {{.stride = 24}};
        wanted.vertex_attributes = {{.location = 3, .buffer = 0, .offset = 8, .format = one.format}};
        const auto texels = draw(wanted, [&](CommandList& list) {
            list.set_vertex_buffer(0, vertices);
            list.draw({.vertex_count = 1});
        });
        for (std::size_t c = 0; c < 4; ++c)
            EXPECT_NEAR(number(texels[0][c]), one.expected[c], 1e-6) << info(one.format).name << " channel " << c;
    }
}

TEST_P(Vertices, IntegerAttributes) {
    const std::array<std::uint8_t, 16> bytes{1, 0, 0, 0x80, 0xfe, 0xff, 0xff, 0xff, 7, 0, 200, 0, 0x85, 0xff, 0, 0};
    const Buffer vertices = buffer_of<std::uint8_t>(bytes, BufferUsage::vertex);
    GraphicsPipelineDesc wanted = desc(
        "layout(location = 0) in uint a; layout(location = 1) in int b; layout(location = 2) in uvec2 c; "
        "layout(location = 4) in ivec2 d;",
        "uvec4(a, uint(b), c.x * 1000u + c.y, uint(d.x))");
    wanted.vertex_buffers = {{.stride = 16}};
    wanted.vertex_attributes = {{0, 0, 0, Format::r32_uint},
                                {1, 0, 4, Format::r32_sint},
                                {2, 0, 8, Format::rg16_uint},
                                {4, 0, 12, Format::rg8_sint}};
    const auto texels = draw(wanted, [&](CommandList& list) {
        list.set_vertex_buffer(0, vertices);
        list.draw({.vertex_count = 1});
    });
    EXPECT_EQ(texels[0],
              (std::array<std::uint32_t, 4>{0x80000001u, 0xfffffffeu, 7200u, static_cast<std::uint32_t>(-123)}));
}

TEST_P(Vertices, BuffersOffsetsAndInstances) {
    std::vector<float> positions(32), colors(32);
    for (std::size_t i = 0; i < 32; ++i) positions[i] = static_cast<float>(i), colors[i] = static_cast<float>(100 + i);
    const Buffer first = buffer_of<float>(positions, BufferUsage::vertex);
    const Buffer second = buffer_of<float>(colors, BufferUsage::vertex);
    GraphicsPipelineDesc wanted = desc("layout(location = 0) in float a; layout(location = 1) in float b;",
                                       "uvec4(uint(a), uint(b), gl_VertexIndex, gl_InstanceIndex)");
    wanted.vertex_buffers = {{.stride = 8}, {.stride = 4, .per_instance = true}};
    wanted.vertex_attributes = {{0, 0, 4, Format::r32_float}, {1, 1, 0, Format::r32_float}};
    const auto texels = draw(wanted, [&](CommandList& list) {
        list.set_vertex_buffer(0, first, 16);
        list.set_vertex_buffer(1, second, 8);
        list.draw({.vertex_count = 3, .instance_count = 2, .first_vertex = 2});
    });
    for (std::uint32_t instance = 0; instance < 4; ++instance)
        for (std::uint32_t vertex = 0; vertex < 8; ++vertex) {
            const std::array<std::uint32_t, 4> drawn{(16 + vertex * 8 + 4) / 4, 102 + instance, vertex, instance};
            const bool covered = vertex >= 2 && vertex < 5 && instance < 2;
            EXPECT_EQ(texels[instance * 8 + vertex], covered ? drawn : (std::array<std::uint32_t, 4>{99, 99, 99, 99}));
        }
}

TEST_P(Vertices, FirstInstanceCountsFromTheGivenOne) {
    SKIP_WITHOUT(capabilities().base_instance);
    const std::array<float, 4> values{10, 11, 12, 13};
    const Buffer instances = buffer_of<float>(values, BufferUsage::vertex);
    GraphicsPipelineDesc wanted = desc("layout(location = 0) in float a;", "uvec4(uint(a), gl_InstanceIndex, 0u, 0u)");
    wanted.vertex_buffers = {{.stride = 4, .per_instance = true}};
    wanted.vertex_attributes = {{0, 0, 0, Format::r32_float}};
    const auto texels = draw(wanted, [&](CommandList& list) {
        list.set_vertex_buffer(0, instances);
        list.draw({.vertex_count = 1, .instance_count = 2, .first_instance = 2});
    });
    EXPECT_EQ(texels[0][0], 99u);
    EXPECT_EQ(texels[16], (std::array<std::uint32_t, 4>{12, 2, 0, 0}));
    EXPECT_EQ(texels[24], (std::array<std::uint32_t, 4>{13, 3, 0, 0}));
}

TEST_P(Vertices, IndicesOfBothSizesWithOffsets) {
    std::array<float, 16> values{};
    for (std::size_t i = 0; i < 16; ++i) values[i] = static_cast<float>(i) + 50.0f;
    const Buffer vertices = buffer_of<float>(values, BufferUsage::vertex);
    GraphicsPipelineDesc wanted = desc("layout(location = 0) in float a;", "uvec4(uint(a), gl_VertexIndex, 0u, 0u)");
    wanted.vertex_buffers = {{.stride = 4}};
    wanted.vertex_attributes = {{0, 0, 0, Format::r32_float}};
    const std::array<std::uint16_t, 6> small{0, 0, 5, 1, 3, 0};
    const std::array<std::uint32_t, 6> large{0, 0, 5, 1, 3, 0};
    for (const bool wide : {false, true}) {
        const Buffer indices = wide ? buffer_of<std::uint32_t>(large, BufferUsage::index)
                                    : buffer_of<std::uint16_t>(small, BufferUsage::index);
        const auto texels = draw(wanted, [&](CommandList& list) {
            list.set_vertex_buffer(0, vertices);
            list.set_index_buffer(indices, wide ? IndexType::uint32 : IndexType::uint16, wide ? 4 : 2);
            list.draw_indexed({.index_count = 3, .first_index = 1, .vertex_offset = 2});
        });
        // The indices 5, 1, 3, each 2 further.
        for (std::uint32_t i = 0; i < 8; ++i) EXPECT_EQ(texels[i][0], i == 7 || i == 3 || i == 5 ? 50 + i : 99u) << i;
        EXPECT_EQ(texels[7][1], 7u);
    }
}

TEST_P(Vertices, IndirectDraws) {
    std::array<float, 16> values{};
    for (std::size_t i = 0; i < 16; ++i) values[i] = static_cast<float>(i);
    const Buffer vertices = buffer_of<float>(values, BufferUsage::vertex);
    GraphicsPipelineDesc wanted = desc("layout(location = 0) in float a;", "uvec4(uint(a), 0u, 0u, 0u)");
    wanted.vertex_buffers = {{.stride = 4}};
    wanted.vertex_attributes = {{0, 0, 0, Format::r32_float}};
    const std::array<DrawArguments, 2> direct{DrawArguments{2, 1, 1, 0}, DrawArguments{1, 2, 6, 0}};
    const std::array<std::uint32_t, 8> zeros{};
    std::vector<std::uint32_t> words(zeros.begin(), zeros.begin() + 2);
    for (const DrawArguments& arguments : direct) {
        words.insert(words.end(), {arguments.vertex_count, arguments.instance_count, arguments.first_vertex,
                                   arguments.first_instance});
        words.push_back(0);  // The stride is larger than the arguments.
    }
    const Buffer arguments = buffer_of<std::uint32_t>(words, BufferUsage::indirect);
    auto texels = draw(wanted, [&](CommandList& list) {
        list.set_vertex_buffer(0, vertices);
        list.draw_indirect(arguments, 8, 2, 20);
    });
    for (std::uint32_t i = 0; i < 8; ++i) EXPECT_EQ(texels[i][0], i == 1 || i == 2 || i == 6 ? i : 99u) << i;
    for (std::uint32_t i = 0; i < 8; ++i) EXPECT_EQ(texels[8 + i][0], i == 6 ? i : 99u) << i;

    const std::array<DrawIndexedArguments, 2> indexed{DrawIndexedArguments{2, 1, 0, 1, 0},
                                                      DrawIndexedArguments{1, 1, 3, 0, 0}};
    const Buffer indexed_arguments = buffer_of<DrawIndexedArguments>(indexed, BufferUsage::indirect);
    const std::array<std::uint32_t, 4> index_values{4, 2, 0, 7};
    const Buffer indices = buffer_of<std::uint32_t>(index_values, BufferUsage::index);
    texels = draw(wanted, [&](CommandList& list) {
        list.set_vertex_buffer(0, vertices);
        list.set_index_buffer(indices, IndexType::uint32);
        list.draw_indexed_indirect(indexed_arguments, 0, 2);
    });
    for (std::uint32_t i = 0; i < 8; ++i) EXPECT_EQ(texels[i][0], i == 5 || i == 3 || i == 7 ? i : 99u) << i;
}

TEST_P(Vertices, IndirectArgumentsFromACompute) {
    const Buffer arguments = buffer(16, BufferUsage::indirect | BufferUsage::storage);
    const ComputePipeline fill = compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Arguments { uint values[4]; };
        void main() { values[0] = 3u; values[1] = 1u; values[2] = 0u; values[3] = 0u; }
    )");
    const GraphicsPipeline pipeline =
        ok(device().create_graphics_pipeline(desc("", "uvec4(gl_VertexIndex, 0u, 0u, 0u)")));
    const Texture picture = target(Format::rgba32_uint, width, height);
    CommandList list = device().create_command_list("indirect");
    list.set_pipeline(fill);
    list.set_bind_group(0, group(fill, {{.binding = 0, .buffer = arguments}}));
    list.dispatch({});
    list.begin_render_pass(
        {.color = {{.view = picture, .load = LoadOperation::clear, .clear = {.uint = {9, 9, 9, 9}}}}});
    list.set_pipeline(pipeline);
    list.draw_indirect(arguments);
    list.end_render_pass();
    run(std::move(list));
    const auto texels = read<std::array<std::uint32_t, 4>>(picture);
    for (std::uint32_t i = 0; i < 8; ++i) EXPECT_EQ(texels[i][0], i < 3 ? i : 9u);
}

TEST_P(Vertices, ZeroStrideRepeatsOneValue) {
    const std::array<float, 1> value{42};
    const Buffer vertices = buffer_of<float>(value, BufferUsage::vertex);
    GraphicsPipelineDesc wanted = desc("layout(location = 0) in float a;", "uvec4(uint(a), 0u, 0u, 0u)");
    wanted.vertex_buffers = {{.stride = 0}};
    wanted.vertex_attributes = {{0, 0, 0, Format::r32_float}};
    const auto texels = draw(wanted, [&](CommandList& list) {
        list.set_vertex_buffer(0, vertices);
        list.draw({.vertex_count = 4});
    });
    for (std::uint32_t i = 0; i < 8; ++i) EXPECT_EQ(texels[i][0], i < 4 ? 42u : 99u) << i;
}

TEST_P(Vertices, StorageBuffersInVertexShaders) {
    SKIP_WITHOUT(capabilities().storage_in_vertex);
    const std::array<std::uint32_t, 4> values{5, 6, 7, 8};
    const Buffer storage = buffer_of<std::uint32_t>(values, BufferUsage::storage);
    GraphicsPipelineDesc wanted = desc("layout(set = 0, binding = 0) readonly buffer Values { uint values[]; };",
                                       "uvec4(values[gl_VertexIndex], 0u, 0u, 0u)");
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(wanted));
    const BindGroup bound = group(pipeline, {{.binding = 0, .buffer = storage}});
    const auto texels = draw(wanted, [&](CommandList& list) {
        list.set_bind_group(0, bound);
        list.draw({.vertex_count = 4});
    });
    for (std::uint32_t i = 0; i < 4; ++i) EXPECT_EQ(texels[i][0], values[i]);
}

TEST_P(Vertices, Topologies) {
    const auto covered = [&](Topology topology, std::uint32_t count) {
        GraphicsPipelineDesc wanted;
        // Points and lines run through centers of texels, edges of triangles between them.
        const bool triangles = topology == Topology::triangle_list || topology == Topology::triangle_strip;
        wanted.vertex =
            shader(ShaderStage::vertex, std::string("const float start = ") + (triangles ? "2.0" : "2.5") + ";" + R"(
            void main() {
                // A zigzag over a picture of 16x16 texels.
                vec2 at = vec2(float(gl_VertexIndex / 2) * 6.0 + start, start + (gl_VertexIndex % 2 == 0 ? 0.0 : 10.0));
                gl_Position = vec4(at / 16.0 * 2.0 - 1.0, 0.0, 1.0);
                gl_PointSize = 1.0;
            }
        )");
        wanted.fragment =
            shader(ShaderStage::fragment, "layout(location = 0) out vec4 color; void main() { color = vec4(1); }");
        wanted.topology = topology;
        wanted.color_targets = {{.format = Format::r8_unorm}};
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(wanted));
        const Texture picture = target(Format::r8_unorm, 16, 16);
        CommandList list = device().create_command_list("topology");
        list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
        list.set_pipeline(pipeline);
        list.draw({.vertex_count = count});
        list.end_render_pass();
        run(std::move(list));
        std::uint32_t texels = 0;
        for (const std::uint8_t texel : read<std::uint8_t>(picture)) texels += texel == 255;
        return texels;
    };
    EXPECT_EQ(covered(Topology::point_list, 5), 5u);
    // Two vertical lines of 10 texels; whether an end counts differs by a texel.
    EXPECT_NEAR(covered(Topology::line_list, 4), 20, 2);
    // The same and the diagonal between them.
    EXPECT_NEAR(covered(Topology::line_strip, 4), 30, 4);
    // Half of 6x10, and the whole of 6x10, by the centers of texels.
    EXPECT_NEAR(covered(Topology::triangle_list, 3), 30, 2);
    EXPECT_EQ(covered(Topology::triangle_strip, 4), 60u);
    EXPECT_NEAR(covered(Topology::triangle_strip, 5), 90, 2);
}

TEST_P(Vertices, CullingSeesThePictureFromTheTop) {
    for (const bool clockwise : {false, true})
        for (const CullMode cull : {CullMode::none, CullMode::front, CullMode::back})
            for (const FrontFace front : {FrontFace::counter_clockwise, FrontFace::clockwise}) {
                GraphicsPipelineDesc wanted;
                // On the picture (y down) the corners (-1,-1), (3,-1), (-1,3) run clockwise.
                wanted.vertex = shader(
                    ShaderStage::vertex,
                    std::string("void main() { int i = ") + (clockwise ? "gl_VertexIndex" : "2 - gl_VertexIndex") +
                        "; gl_Position = vec4(i == 1 ? 3.0 : -1.0, i == 2 ? 3.0 : -1.0, 0.0, 1.0); }");
                wanted.fragment = shader(
                    ShaderStage::fragment,
                    "layout(location = 0) out vec4 color; void main() { color = vec4(gl_FrontFacing ? 1.0 : 0.2); }");
                wanted.cull = cull;
                wanted.front_face = front;
                wanted.color_targets = {{.format = Format::r8_unorm}};
                const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(wanted));
                const Texture picture = target(Format::r8_unorm, 1, 1);
                CommandList list = device().create_command_list("cull");
                list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
                list.set_pipeline(pipeline);
                list.draw({.vertex_count = 3});
                list.end_render_pass();
                run(std::move(list));
                const bool is_front = clockwise == (front == FrontFace::clockwise);
                const bool culled = (cull == CullMode::front && is_front) || (cull == CullMode::back && !is_front);
                EXPECT_EQ(read<std::uint8_t>(picture)[0], culled     ? 0
                                                          : is_front ? 255
                                                                     : 51)
                    << clockwise << " " << static_cast<int>(cull) << " " << static_cast<int>(front);
            }
}

}  // namespace
}  // namespace nacre::test
