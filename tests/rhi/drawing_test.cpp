// SPDX-License-Identifier: Apache-2.0
#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Drawing);

TEST_P(Drawing, TriangleCoversItsHalf) {
    const Texture picture = target(Format::rgba8_unorm, 16, 16, "picture");
    GraphicsPipelineDesc desc;
    desc.vertex = shader(ShaderStage::vertex, R"(
        void main() {
            // The upper left half of the picture: row 0 is on top, y points down.
            const vec2 corners[3] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(-1, 1));
            gl_Position = vec4(corners[gl_VertexIndex], 0.0, 1.0);
        }
    )");
    desc.fragment = shader(ShaderStage::fragment, R"(
        layout(location = 0) out vec4 color;
        void main() { color = vec4(gl_FragCoord.xy / 255.0, 1.0, 1.0); }
    )");
    desc.color_targets = {{.format = Format::rgba8_unorm}};
    desc.name = "triangle";
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    CommandList list = device().create_command_list("triangle");
    ClearColor clear;
    clear.floating = {0.2f, 0.4f, 0.6f, 0.8f};
    list.begin_render_pass(
        {.color = {{.view = picture, .load = LoadOperation::clear, .clear = clear}}, .name = "pass"});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    const auto texels = read<std::array<std::uint8_t, 4>>(picture);
    ASSERT_EQ(texels.size(), 256u);
    for (std::uint32_t y = 0; y < 16; ++y)
        for (std::uint32_t x = 0; x < 16; ++x) {
            if (x + y == 15) continue;  // The edge runs through these centers.
            const auto& texel = texels[y * 16 + x];
            const std::array<std::uint8_t, 4> inside{static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), 255,
                                                     255};
            const std::array<std::uint8_t, 4> outside{51, 102, 153, 204};
            if (x + y < 15) {
                // gl_FragCoord is x + 0.5; the half is rounded either way.
                EXPECT_LE(texel[0] - x, 1u) << x << ", " << y;
                EXPECT_LE(texel[1] - y, 1u) << x << ", " << y;
                EXPECT_EQ(texel[2], inside[2]) << x << ", " << y;
            } else {
                EXPECT_EQ(texel, outside) << x << ", " << y;
            }
        }
}

}  // namespace
}  // namespace nacre::test
