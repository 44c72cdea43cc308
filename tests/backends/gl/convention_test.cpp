// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <functional>
#include <random>

#include "tests/backends/gl/gl_device.h"

/// @file
/// The same GLSL gives the same picture, texel addresses and built-in values as on Vulkan, bit for bit.

namespace nacre::rhi {
namespace {

/// A picture of integers: what is drawn into it holds the bits of whatever a test looks at.
struct Picture {
    std::uint32_t width = 64, height = 48;
    std::string vertex, fragment;
    GraphicsPipelineDesc pipeline{};
    std::vector<float> vertices{};  ///< Position and one value: vec4 at location 0.
    std::uint32_t vertex_count = 3;
    bool depth = false;
    std::function<void(CommandList&)> before_draw{};
    std::function<void(CommandList&)> draw{};  ///< Empty: one draw of vertex_count.
    std::function<std::vector<BindGroupEntry>(Device&)> resources{};
};

struct Drawn {
    std::vector<std::uint32_t> color;
    std::vector<std::uint32_t> depth;  ///< Bits of floats.
};

Drawn draw(Device& device, const Picture& picture) {
    const Texture target = expect(device.create_texture({.format = Format::rgba32_uint, .width = picture.width,
        .height = picture.height, .usage = TextureUsage::color_target | TextureUsage::copy_source, .name = "target"}));
    Texture depth;
    GraphicsPipelineDesc desc = picture.pipeline;
    if (picture.depth) {
        depth = expect(device.create_texture({.format = Format::d32_float,
                                              .width = picture.width,
                                              .height = picture.height,
                                              .usage = TextureUsage::depth_target | TextureUsage::copy_source,
                                              .name = "depth"}));
        desc.depth_stencil.format = Format::d32_float;
    }
    desc.vertex = make_shader(device, "picture.vert", picture.vertex);
    desc.fragment = make_shader(device, "picture.frag", picture.fragment);
    desc.color_targets = {{.format = Format::rgba32_uint}};
    desc.name = "picture";
    Buffer vertices;
    if (!picture.vertices.empty()) {
        vertices = expect(device.create_buffer(
            {.size = picture.vertices.size() * 4, .usage = BufferUsage::vertex, .name = "vertices"}));
        expect(device.write_buffer(vertices, std::span<const float>(picture.vertices)));
        desc.vertex_buffers = {{.stride = 16}};
        desc.vertex_attributes = {{.location = 0, .buffer = 0, .offset = 0, .format = Format::rgba32_float}};
    }
    const GraphicsPipeline pipeline = expect(device.create_graphics_pipeline(desc));
    BindGroup group;
    if (picture.resources)
        group = expect(device.create_bind_group(
            {.layout = expect(device.bind_group_layout(pipeline, 0)), .entries = picture.resources(device)}));
    CommandList list = device.create_command_list("picture");
    RenderPassDesc pass{.color = {{.view = target, .load = LoadOperation::clear,
                                   .clear = {.uint = {0xffffffffu, 0, 0, 0}}}}, .name = "picture"};
    if (picture.depth) pass.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear};
    list.begin_render_pass(pass);
    list.set_pipeline(pipeline);
    if (group) list.set_bind_group(0, group);
    if (vertices) list.set_vertex_buffer(0, vertices);
    if (picture.before_draw) picture.before_draw(list);
    if (picture.draw)
        picture.draw(list);
    else
        list.draw({.vertex_count = picture.vertex_count});
    list.end_render_pass();
    expect(device.submit(std::move(list)));
    Drawn result;
    result.color = texels<std::uint32_t>(device, target);
    if (picture.depth) result.depth = texels<std::uint32_t>(device, depth);
    return result;
}

class GlConventionTest : public GlTest {
  protected:
    void SetUp() override {
        GlTest::SetUp();
        if (!reference_device()) GTEST_SKIP() << "there is no Vulkan device to compare with";
    }
    /// Draws on both and expects the same bits; returns what was drawn.
    Drawn expect_same(const Picture& picture) {
        const Drawn wanted = draw(*reference_device(), picture);
        Drawn found = draw(*device_, picture);
        EXPECT_EQ(wanted.color.size(), found.color.size());
        std::size_t differing = 0, first = 0;
        for (std::size_t i = 0; i < std::min(wanted.color.size(), found.color.size()); ++i)
            if (wanted.color[i] != found.color[i] && differing++ == 0) first = i;
        EXPECT_EQ(differing, 0u) << "first at x " << first / 4 % picture.width << ", y " << first / 4 / picture.width
                                 << ", channel " << first % 4 << ": expected " << std::hex << wanted.color[first]
                                 << ", found " << found.color[first];
        const bool drawn =
            std::ranges::any_of(found.color, [](std::uint32_t value) { return value != 0 && value != ~0u; });
        EXPECT_TRUE(drawn) << "the picture is empty";
        return found;
    }
};
INSTANTIATE_TEST_SUITE_P(All, GlConventionTest, testing::ValuesIn(device_kinds), name_of);

constexpr const char* position_vertex = R"(
layout(location = 0) in vec4 position_and_value;
layout(location = 0) out float value;
void main() {
    gl_Position = vec4(position_and_value.xyz, 1.0);
    gl_PointSize = 9.0;
    value = position_and_value.w;
}
)";

std::vector<float> random_triangles(std::uint32_t count, std::uint32_t width, std::uint32_t height, float step) {
    std::mt19937 random(7);
    std::vector<float> vertices;
    std::uniform_int_distribution<int> x(-2, static_cast<int>(static_cast<float>(width) / step) + 2);
    std::uniform_int_distribution<int> y(-2, static_cast<int>(static_cast<float>(height) / step) + 2);
    for (std::uint32_t i = 0; i < count * 3; ++i) {
        // Multiples of `step` pixels: edges and corners go through the centers of pixels.
        vertices.push_back(static_cast<float>(x(random)) * step / static_cast<float>(width) * 2.0f - 1.0f);
        vertices.push_back(static_cast<float>(y(random)) * step / static_cast<float>(height) * 2.0f - 1.0f);
        vertices.push_back(0.25f + 0.001f * static_cast<float>(i));
        vertices.push_back(static_cast<float>(i));
    }
    return vertices;
}

TEST_P(GlConventionTest, CoversTheSamePixelsOnExactTies) {
    if (!has_device()) return;
    Picture picture{.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(uint(value / 3.0 + 0.01), 1, 2, 3); }
)"};
    for (float step : {0.5f, 1.0f, 0.25f}) {
        picture.vertices = random_triangles(40, picture.width, picture.height, step);
        picture.vertex_count = 120;
        expect_same(picture);
    }
}

TEST_P(GlConventionTest, GivesTheSameFragmentCoordinates) {
    if (!has_device()) return;
    const Drawn drawn = expect_same({.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(floatBitsToUint(gl_FragCoord.xy), uint(gl_FrontFacing), floatBitsToUint(gl_FragCoord.w)); }
)",
                                    .vertices = {-1, -1, 0.5f, 0, 1, -1, 0.5f, 0, -1, 1, 0.5f, 0}});
    EXPECT_EQ(drawn.color[0], 0x3f000000u);  // 0.5: x of the first texel of row 0, the top row.
    EXPECT_EQ(drawn.color[1], 0x3f000000u);
}

TEST_P(GlConventionTest, TurnsAndCullsTheSameFaces) {
    if (!has_device()) return;
    for (FrontFace front : {FrontFace::clockwise, FrontFace::counter_clockwise})
        for (CullMode cull : {CullMode::none, CullMode::front, CullMode::back}) {
            Picture picture{.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(uint(gl_FrontFacing), uint(value / 3.0 + 0.01), 7, 7); }
)"};
            picture.pipeline.front_face = front;
            picture.pipeline.cull = cull;
            picture.vertices = random_triangles(12, picture.width, picture.height, 1.7f);
            picture.vertex_count = 36;
            expect_same(picture);
        }
}

TEST_P(GlConventionTest, TakesDerivativesInTheSameDirection) {
    if (!has_device()) return;
    expect_same({.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() {
    vec2 along = gl_FragCoord.xy * vec2(3.0, 5.0);
    result = uvec4(ivec4(dFdx(along.x), dFdy(along.y), dFdx(along.y), fwidth(along.x)));
}
)",
                 .vertices = {-1, -1, 0.5f, 0, 3, -1, 0.5f, 0, -1, 3, 0.5f, 0}});
}

TEST_P(GlConventionTest, CountsPointCoordinatesFromTheTop) {
    if (!has_device()) return;
    Picture picture{.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(uvec2(gl_PointCoord * 9.0 + 0.3), uint(value), 1); }
)",
                    .vertices = {-0.5f, -0.5f, 0.5f, 1, 0.25f, 0.5f, 0.5f, 2, 0.9f, 0.1f, 0.5f, 3}};
    picture.pipeline.topology = Topology::point_list;
    expect_same(picture);
}

TEST_P(GlConventionTest, InterpolatesFlatValuesFromTheFirstVertex) {
    if (!has_device()) return;
    Picture picture{.vertex = R"(
layout(location = 0) in vec4 position_and_value;
layout(location = 0) flat out uint value;
void main() {
    gl_Position = vec4(position_and_value.xyz, 1.0);
    value = uint(position_and_value.w);
}
)",
                    .fragment = R"(
layout(location = 0) flat in uint value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(value, 1, 2, 3); }
)"};
    picture.vertices = random_triangles(20, picture.width, picture.height, 0.7f);
    picture.vertex_count = 60;
    expect_same(picture);
    picture.pipeline.topology = Topology::triangle_strip;
    picture.pipeline.cull = CullMode::back;
    expect_same(picture);

    const std::array devices{reference_device(), device_.get()};
    for (IndexType type : {IndexType::uint16, IndexType::uint32}) {
        std::array<Buffer, 2> indices;
        for (std::size_t i = 0; i < 2; ++i) {
            indices[i] =
                expect(devices[i]->create_buffer({.size = 256, .usage = BufferUsage::index, .name = "indices"}));
            std::array<std::uint16_t, 128> narrow{};
            std::array<std::uint32_t, 64> wide{};
            for (std::uint32_t k = 0; k < 64; ++k) narrow[k] = wide[k] = k * 7 % 59;
            expect(devices[i]->write_buffer(indices[i], type == IndexType::uint16 ? std::as_bytes(std::span(narrow))
                                                                                   : std::as_bytes(std::span(wide))));
        }
        std::size_t next = 0;
        picture.draw = [&](CommandList& list) {
            list.set_index_buffer(indices[next++], type, 8);
            list.draw_indexed({.index_count = 45, .first_index = 3, .vertex_offset = 1});
        };
        expect_same(picture);
    }
}

TEST_P(GlConventionTest, PlacesViewportAndScissorFromTheTop) {
    if (!has_device()) return;
    Picture picture{.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(uvec2(gl_FragCoord.xy), 1, 1); }
)",
                    .vertices = {-1, -1, 0.5f, 0, 3, -1, 0.5f, 0, -1, 3, 0.5f, 0}};
    picture.before_draw = [](CommandList& list) {
        list.set_viewport({.x = 3, .y = 5, .width = 40, .height = 20});
        list.set_scissor({.x = 8, .y = 7, .width = 50, .height = 10});
    };
    expect_same(picture);
}

TEST_P(GlConventionTest, WritesTheSameDepth) {
    if (!has_device()) return;
    Picture picture{.vertex = R"(
layout(location = 0) in vec4 position_and_value;
void main() { gl_Position = vec4(position_and_value.xyz * position_and_value.w, position_and_value.w); }
)",
                    .fragment = R"(
layout(location = 0) out uvec4 result;
void main() { result = uvec4(1, 2, 3, 4); }
)",
                    .vertices = {-1, -1, 0.1f, 1, 3, -1, 0.9f, 2, -1, 3, 0.4f, 1.5f},
                    .depth = true};
    picture.pipeline.depth_stencil = {.depth_test = true, .depth_write = true};
    for (const auto& [nearest, farthest] : {std::pair{0.0f, 1.0f}, std::pair{0.25f, 0.5f}, std::pair{1.0f, 0.0f}}) {
        picture.before_draw = [&](CommandList& list) {
            list.set_viewport({.width = 64, .height = 48, .min_depth = nearest, .max_depth = farthest});
        };
        const Drawn wanted = draw(*reference_device(), picture);
        const Drawn found = draw(*device_, picture);
        ASSERT_EQ(wanted.depth.size(), found.depth.size());
        // OpenGL ES starts the interpolation at another vertex, and without clip control depth takes a detour from -1
        // to 1: both cost a few of its last bits.
        const bool exact = std::string_view(GetParam().backend) != "gles";
        float largest = 0.0f;
        for (std::size_t i = 0; i < wanted.depth.size(); ++i)
            largest = std::max(largest,
                               std::abs(std::bit_cast<float>(wanted.depth[i]) - std::bit_cast<float>(found.depth[i])));
        if (exact)
            EXPECT_EQ(wanted.depth, found.depth) << "largest difference " << largest;
        else
            EXPECT_LE(largest, 3e-7f);
    }
}

TEST_P(GlConventionTest, ClipsAtTheSameNearPlane) {
    if (!has_device()) return;
    // From z = -0.5 to z = 1.5: Vulkan shows what lies between 0 and 1.
    expect_same({.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(uvec2(gl_FragCoord.xy), 1, 1); }
)",
                 .vertices = {-1, -1, -0.5f, 0, 3, -1, 3.5f, 0, -1, 3, -0.5f, 0}});
}

TEST_P(GlConventionTest, DrawsTheSameLines) {
    if (!has_device()) return;
    Picture picture{.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(uvec2(gl_FragCoord.xy), 1, 1); }
)"};
    for (float step : {0.5f, 0.37f}) {
        picture.vertices = random_triangles(8, picture.width, picture.height, step);
        picture.vertex_count = 24;
        picture.pipeline.topology = Topology::line_list;
        expect_same(picture);
        picture.pipeline.topology = Topology::line_strip;
        expect_same(picture);
    }
}

constexpr const char* index_vertex = R"(
layout(location = 0) flat out uvec2 ids;
void main() {
    // A column for each instance, a row for each vertex, as points.
    gl_Position = vec4((vec2(gl_InstanceIndex, gl_VertexIndex) + 0.5) / vec2(32.0, 24.0) - 1.0 + vec2(0.01), 0.5, 1.0);
    gl_PointSize = 1.0;
    ids = uvec2(gl_InstanceIndex, gl_VertexIndex);
}
)";
constexpr const char* index_fragment = R"(
layout(location = 0) flat in uvec2 ids;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(ids, 1, 1); }
)";

TEST_P(GlConventionTest, NumbersVerticesAndInstancesWithTheirBase) {
    if (!has_device()) return;
    Picture picture{.vertex = index_vertex, .fragment = index_fragment};
    picture.pipeline.topology = Topology::point_list;
    const bool has_base = device_->capabilities().base_instance;
    picture.draw = [&](CommandList& list) {
        list.draw({.vertex_count = 5, .instance_count = 3, .first_vertex = 7, .first_instance = has_base ? 11u : 0u});
    };
    expect_same(picture);
}

TEST_P(GlConventionTest, NumbersIndexedVerticesWithTheirOffset) {
    if (!has_device()) return;
    Picture picture{.vertex = index_vertex, .fragment = index_fragment};
    picture.pipeline.topology = Topology::point_list;
    const bool has_base = device_->capabilities().base_instance;
    std::array<Buffer, 2> indices;
    const std::array devices{reference_device(), device_.get()};
    for (std::size_t i = 0; i < 2; ++i) {
        indices[i] = expect(devices[i]->create_buffer({.size = 32, .usage = BufferUsage::index, .name = "indices"}));
        const std::array<std::uint16_t, 16> values{9, 9, 9, 9, 3, 1, 4, 1, 5, 9, 2, 6, 5, 3, 5, 8};
        expect(devices[i]->write_buffer(indices[i], std::as_bytes(std::span(values))));
    }
    std::size_t next = 0;
    picture.draw = [&](CommandList& list) {
        list.set_index_buffer(indices[next++], IndexType::uint16, 4);
        list.draw_indexed({.index_count = 6, .instance_count = 2, .first_index = 3, .vertex_offset = 4,
                           .first_instance = has_base ? 5u : 0u});
    };
    expect_same(picture);
}

TEST_P(GlConventionTest, DrawsIndirectlyWhatItDrawsDirectly) {
    if (!has_device()) return;
    Picture picture{.vertex = index_vertex, .fragment = index_fragment};
    picture.pipeline.topology = Topology::point_list;
    const std::uint32_t first_instance = device_->capabilities().indirect_first_instance ? 4u : 0u;
    const std::array devices{reference_device(), device_.get()};
    std::array<Buffer, 2> arguments, indexed, indices;
    for (std::size_t i = 0; i < 2; ++i) {
        const std::array<DrawArguments, 2> draws{{{3, 2, 1, first_instance}, {2, 1, 9, 0}}};
        const std::array<DrawIndexedArguments, 2> indexed_draws{{{3, 2, 1, 2, first_instance}, {2, 3, 0, 10, 0}}};
        // lavapipe drops the last index of each draw from a buffer that is bound with an offset.
        const bool has_offset = i == 1;
        std::vector<std::uint32_t> index_values{1, 2, 4, 8, 5};
        if (has_offset) index_values.insert(index_values.begin(), 77);
        arguments[i] = expect(devices[i]->create_buffer({.size = sizeof draws, .usage = BufferUsage::indirect}));
        indexed[i] = expect(devices[i]->create_buffer({.size = sizeof indexed_draws, .usage = BufferUsage::indirect}));
        indices[i] = expect(devices[i]->create_buffer({.size = index_values.size() * 4, .usage = BufferUsage::index}));
        expect(devices[i]->write_buffer(arguments[i], std::as_bytes(std::span(draws))));
        expect(devices[i]->write_buffer(indexed[i], std::as_bytes(std::span(indexed_draws))));
        expect(devices[i]->write_buffer(indices[i], std::as_bytes(std::span(index_values))));
    }
    std::size_t next = 0;
    picture.draw = [&](CommandList& list) {
        list.draw_indirect(arguments[next], 0, 2);
        list.set_index_buffer(indices[next], IndexType::uint32, next == 0 ? 0 : 4);
        list.draw_indexed_indirect(indexed[next], 0, 2);
        ++next;
    };
    expect_same(picture);
}

TEST_P(GlConventionTest, AddressesTexelsFromTheFirstRow) {
    if (!has_device()) return;
    Picture picture{.vertex = position_vertex, .fragment = R"(
#extension GL_EXT_samplerless_texture_functions : require
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
layout(set = 0, binding = 0) uniform utexture2D source;
layout(set = 0, binding = 1) uniform sampler nearest;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) / 4;
    uvec4 fetched = texelFetch(source, at, 0);
    uvec4 sampled = texture(usampler2D(source, nearest), gl_FragCoord.xy / vec2(64.0, 48.0));
    result = uvec4(fetched.x, sampled.x, uvec2(textureSize(source, 0)));
}
)",
                    .vertices = {-1, -1, 0.5f, 0, 3, -1, 0.5f, 0, -1, 3, 0.5f, 0}};
    picture.resources = [](Device& device) {
        const Texture source = expect(device.create_texture({.format = Format::r32_uint, .width = 16, .height = 12,
            .usage = TextureUsage::sampled | TextureUsage::copy_destination, .name = "source"}));
        std::vector<std::uint32_t> values(16 * 12);
        for (std::uint32_t i = 0; i < values.size(); ++i) values[i] = 1000 + i;
        expect(device.write_texture(source, std::as_bytes(std::span(values))));
        const Sampler nearest = expect(device.create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest,
            .mip = Filter::nearest, .address_u = AddressMode::clamp_to_edge, .address_v = AddressMode::clamp_to_edge}));
        return std::vector<BindGroupEntry>{{.binding = 0, .texture = source}, {.binding = 1, .sampler = nearest}};
    };
    expect_same(picture);
}

TEST_P(GlConventionTest, FindsTheSameFacesOfACube) {
    if (!has_device()) return;
    Picture picture{.vertex = position_vertex, .fragment = R"(
layout(location = 0) in float value;
layout(location = 0) out uvec4 result;
layout(set = 0, binding = 0) uniform samplerCube source;
void main() {
    // Directions all over the sphere, away from the edges of texels.
    vec2 angle = gl_FragCoord.xy / vec2(64.0, 48.0) * vec2(6.2831, 3.1415);
    vec3 direction = vec3(cos(angle.x) * sin(angle.y), cos(angle.y), sin(angle.x) * sin(angle.y));
    result = uvec4(textureLod(source, direction, 0.0) * 255.0 + 0.5);
}
)",
                    .vertices = {-1, -1, 0.5f, 0, 3, -1, 0.5f, 0, -1, 3, 0.5f, 0}};
    picture.resources = [](Device& device) {
        const Texture source = expect(device.create_texture({.dimension = TextureDimension::cube,
            .format = Format::rgba8_unorm, .width = 4, .height = 4, .layers = 6,
            .usage = TextureUsage::sampled | TextureUsage::copy_destination, .name = "cube"}));
        for (std::uint32_t face = 0; face < 6; ++face) {
            std::vector<std::uint32_t> values(16);
            for (std::uint32_t i = 0; i < 16; ++i)
                values[i] = face * 40 | (i % 4 * 60) << 8 | (i / 4 * 60) << 16 | 0xff000000;
            expect(device.write_texture(source, std::as_bytes(std::span(values)), 0, face));
        }
        const Sampler nearest = expect(device.create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest,
            .mip = Filter::nearest, .address_u = AddressMode::clamp_to_edge, .address_v = AddressMode::clamp_to_edge}));
        return std::vector<BindGroupEntry>{{.binding = 0, .texture = source, .sampler = nearest}};
    };
    expect_same(picture);
}

}  // namespace
}  // namespace nacre::rhi
