// SPDX-License-Identifier: Apache-2.0
// Every blend factor and operation against the formula, two sources, different blending of several targets, write
// masks.
#include "tests/rhi/backend_test.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace nacre::test {
namespace {

using namespace rhi;
using Color = std::array<float, 4>;
using Texel = std::array<std::uint8_t, 4>;

// Exact in 8 bits, since a device may blend with the precision of the target: what is left is the rounding of two
// products.
constexpr Color source{180 / 255.0f, 75 / 255.0f, 130 / 255.0f, 153 / 255.0f};
constexpr Color second_source{100 / 255.0f, 230 / 255.0f, 51 / 255.0f, 204 / 255.0f};
constexpr Color destination{51 / 255.0f, 153 / 255.0f, 229 / 255.0f, 102 / 255.0f};
constexpr Color constants{77 / 255.0f, 128 / 255.0f, 25 / 255.0f, 178 / 255.0f};
constexpr float tolerance = 1.01f;

float factor(BlendFactor which, std::size_t channel) {
    const Color& d = destination;
    switch (which) {
        case BlendFactor::zero: return 0;
        case BlendFactor::one: return 1;
        case BlendFactor::source_color: return source[channel];
        case BlendFactor::one_minus_source_color: return 1 - source[channel];
        case BlendFactor::source_alpha: return source[3];
        case BlendFactor::one_minus_source_alpha: return 1 - source[3];
        case BlendFactor::destination_color: return d[channel];
        case BlendFactor::one_minus_destination_color: return 1 - d[channel];
        case BlendFactor::destination_alpha: return d[3];
        case BlendFactor::one_minus_destination_alpha: return 1 - d[3];
        case BlendFactor::constant_color: return constants[channel];
        case BlendFactor::one_minus_constant_color: return 1 - constants[channel];
        case BlendFactor::source_alpha_saturated: return channel == 3 ? 1 : std::min(source[3], 1 - d[3]);
        case BlendFactor::source1_color: return second_source[channel];
        case BlendFactor::one_minus_source1_color: return 1 - second_source[channel];
        case BlendFactor::source1_alpha: return second_source[3];
        case BlendFactor::one_minus_source1_alpha: return 1 - second_source[3];
    }
    return 0;
}

float blended(BlendOperation operation, BlendFactor source_factor, BlendFactor destination_factor,
              std::size_t channel) {
    const float d = destination[channel], s = source[channel];
    const float a = s * factor(source_factor, channel), b = d * factor(destination_factor, channel);
    switch (operation) {
        case BlendOperation::add: return std::clamp(a + b, 0.0f, 1.0f);
        case BlendOperation::subtract: return std::clamp(a - b, 0.0f, 1.0f);
        case BlendOperation::reverse_subtract: return std::clamp(b - a, 0.0f, 1.0f);
        case BlendOperation::minimum: return std::min(s, d);
        case BlendOperation::maximum: return std::max(s, d);
    }
    return 0;
}

std::string literal(const Color& c) {
    return "vec4(" + std::to_string(c[0]) + ", " + std::to_string(c[1]) + ", " + std::to_string(c[2]) + ", " +
           std::to_string(c[3]) + ")";
}

class Blending : public BackendTest {
  public:
    GraphicsPipeline pipeline(std::vector<ColorTargetState> targets, bool two_sources) {
        std::string body;
        for (std::size_t i = 0; i < targets.size(); ++i)
            body += "layout(location = " + std::to_string(i) + (two_sources ? ", index = 0" : "") + ") out vec4 color" +
                    std::to_string(i) + ";\n";
        if (two_sources) body += "layout(location = 0, index = 1) out vec4 second;\n";
        body += "void main() {\n";
        for (std::size_t i = 0; i < targets.size(); ++i)
            body += "color" + std::to_string(i) + " = " + literal(source) + ";\n";
        if (two_sources) body += "second = " + literal(second_source) + ";\n";
        return ok(device().create_graphics_pipeline({.vertex = shader(ShaderStage::vertex, fullscreen_vertex),
                                                     .fragment = shader(ShaderStage::fragment, body + "}"),
                                                     .color_targets = std::move(targets), .name = "blend"}));
    }

    std::vector<Texel> draw(GraphicsPipeline with, std::span<const Texture> targets) {
        RenderPassDesc pass{.name = "blend"};
        for (const Texture texture : targets)
            pass.color.push_back({.view = texture, .load = LoadOperation::clear, .clear = {.floating = destination}});
        CommandList list = device().create_command_list("blend");
        list.begin_render_pass(pass);
        list.set_pipeline(with);
        list.set_blend_constants(constants);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        std::vector<Texel> results;
        for (const Texture texture : targets) results.push_back(read<Texel>(texture)[0]);
        return results;
    }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Blending);
INSTANTIATE_TEST_SUITE_P(Rhi, Blending, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST_P(Blending, EveryFactorAndOperation) {
    const Texture picture = target(Format::rgba8_unorm, 1, 1);
    const auto last = capabilities().dual_source_blending ? BlendFactor::one_minus_source1_alpha
                                                          : BlendFactor::source_alpha_saturated;
    const auto check = [&](const BlendState& blend) {
        const bool two_sources = std::max({blend.source_color, blend.destination_color, blend.source_alpha,
                                           blend.destination_alpha}) >= BlendFactor::source1_color;
        const GraphicsPipeline with = pipeline({{.format = Format::rgba8_unorm, .blend = blend}}, two_sources);
        const Texel found = draw(with, std::span(&picture, 1))[0];
        for (std::size_t c = 0; c < 4; ++c) {
            const float expected = c == 3
                                       ? blended(blend.alpha_operation, blend.source_alpha, blend.destination_alpha, 3)
                                       : blended(blend.color_operation, blend.source_color, blend.destination_color, c);
            EXPECT_NEAR(found[c], expected * 255.0f, tolerance)
                << "channel " << c << ", color " << static_cast<int>(blend.color_operation) << ": "
                << static_cast<int>(blend.source_color) << ", " << static_cast<int>(blend.destination_color)
                << ", alpha " << static_cast<int>(blend.alpha_operation) << ": " << static_cast<int>(blend.source_alpha)
                << ", " << static_cast<int>(blend.destination_alpha);
        }
        device().destroy(with);
    };
    // Each factor in each of its four places; the others are ones that show a mix-up.
    for (int i = 0; i <= static_cast<int>(last); ++i) {
        const auto which = static_cast<BlendFactor>(i);
        check({.enabled = true, .source_color = which, .destination_color = BlendFactor::one_minus_source_alpha,
               .source_alpha = BlendFactor::zero, .destination_alpha = which});
        if (which == BlendFactor::source_alpha_saturated) continue;  // As a source only, everywhere.
        check({.enabled = true, .source_color = BlendFactor::zero, .destination_color = which, .source_alpha = which,
               .destination_alpha = BlendFactor::zero});
    }
    for (const BlendOperation operation : {BlendOperation::add, BlendOperation::subtract,
                                           BlendOperation::reverse_subtract, BlendOperation::minimum,
                                           BlendOperation::maximum})
        for (const BlendOperation alpha :
             {BlendOperation::add, BlendOperation::reverse_subtract, BlendOperation::maximum})
            check({.enabled = true, .source_color = BlendFactor::source_alpha, .destination_color = BlendFactor::one,
                   .color_operation = operation, .source_alpha = BlendFactor::one,
                   .destination_alpha = BlendFactor::one, .alpha_operation = alpha});
}

TEST_P(Blending, DualSourceFiltersWhatIsBehind) {
    SKIP_WITHOUT(capabilities().dual_source_blending);
    // Colored glass: what is behind is multiplied by the second source, channel by channel.
    const Texture picture = target(Format::rgba8_unorm, 4, 4);
    const GraphicsPipeline glass = pipeline(
        {{.format = Format::rgba8_unorm,
          .blend = {.enabled = true, .source_color = BlendFactor::one, .destination_color = BlendFactor::source1_color,
                    .source_alpha = BlendFactor::one, .destination_alpha = BlendFactor::source1_alpha}}}, true);
    const Texel found = draw(glass, std::span(&picture, 1))[0];
    for (std::size_t c = 0; c < 4; ++c)
        EXPECT_NEAR(found[c], std::min(source[c] + destination[c] * second_source[c], 1.0f) * 255.0f, tolerance) << c;
}

TEST_P(Blending, TargetsBlendAndMaskEachInTheirOwnWay) {
    SKIP_WITHOUT(capabilities().independent_blend);
    const Texture targets[] = {target(Format::rgba8_unorm, 2, 2), target(Format::rgba8_unorm, 2, 2),
                               target(Format::rgba8_unorm, 2, 2)};
    const BlendState add{.enabled = true, .source_color = BlendFactor::one, .destination_color = BlendFactor::one,
                         .source_alpha = BlendFactor::one, .destination_alpha = BlendFactor::one};
    const GraphicsPipeline with = pipeline({{.format = Format::rgba8_unorm},
                                            {.format = Format::rgba8_unorm, .blend = add},
                                            {.format = Format::rgba8_unorm, .write_mask = 0x5}}, false);
    const auto found = draw(with, targets);
    for (std::size_t c = 0; c < 4; ++c) {
        EXPECT_NEAR(found[0][c], source[c] * 255.0f, tolerance);
        EXPECT_NEAR(found[1][c], std::min(source[c] + destination[c], 1.0f) * 255.0f, tolerance);
        EXPECT_NEAR(found[2][c], (c % 2 == 0 ? source[c] : destination[c]) * 255.0f, tolerance);
    }
}

TEST_P(Blending, AllTargetsInOneWay) {
    const Texture targets[] = {target(Format::rgba8_unorm, 2, 2), target(Format::rgba8_unorm, 2, 2),
                               target(Format::rgba8_unorm, 2, 2)};
    const BlendState over{.enabled = true, .source_color = BlendFactor::source_alpha,
                          .destination_color = BlendFactor::one_minus_source_alpha,
                          .source_alpha = BlendFactor::one, .destination_alpha = BlendFactor::one_minus_source_alpha};
    const ColorTargetState state{.format = Format::rgba8_unorm, .blend = over, .write_mask = 0xb};
    for (const Texel& found : draw(pipeline({state, state, state}, false), targets))
        for (std::size_t c = 0; c < 4; ++c) {
            const float result = c == 2   ? destination[c]
                                 : c == 3 ? source[3] + destination[3] * (1 - source[3])
                                          : source[c] * source[3] + destination[c] * (1 - source[3]);
            EXPECT_NEAR(found[c], result * 255.0f, tolerance) << c;
        }
}

TEST_P(Blending, SrgbTargetsBlendInLinearLight) {
    SKIP_WITHOUT(supports(Format::rgba8_srgb, FormatSupport::blended));
    const Texture picture = target(Format::rgba8_srgb, 2, 2);
    const BlendState half{.enabled = true, .source_color = BlendFactor::constant_color,
                          .destination_color = BlendFactor::one_minus_constant_color};
    const Texel found =
        draw(pipeline({{.format = Format::rgba8_srgb, .blend = half}}, false), std::span(&picture, 1))[0];
    for (std::size_t c = 0; c < 3; ++c) {
        const float linear = source[c] * constants[c] + destination[c] * (1 - constants[c]);
        const float encoded = linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
        EXPECT_NEAR(found[c], encoded * 255.0f, 2.0f) << c;
    }
}

TEST_P(Blending, FloatTargetsKeepWhatIsBeyondOne) {
    SKIP_WITHOUT(supports(Format::rgba16_float, FormatSupport::blended));
    const Texture picture = target(Format::rgba16_float, 2, 2);
    const BlendState add{.enabled = true, .source_color = BlendFactor::one, .destination_color = BlendFactor::one};
    const GraphicsPipeline with = pipeline({{.format = Format::rgba16_float, .blend = add}}, false);
    CommandList list = device().create_command_list("add");
    list.begin_render_pass(
        {.color = {{.view = picture, .load = LoadOperation::clear, .clear = {.floating = {8, 4, -2, 1}}}}});
    list.set_pipeline(with);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    const auto half = [](std::uint16_t bits) {
        const float value = std::ldexp(1.0f + static_cast<float>(bits & 1023) / 1024.0f, (bits >> 10 & 31) - 15);
        return bits & 0x8000 ? -value : value;
    };
    const auto found = read<std::array<std::uint16_t, 4>>(picture)[0];
    EXPECT_NEAR(half(found[0]), 8 + source[0], 0.01f);
    EXPECT_NEAR(half(found[1]), 4 + source[1], 0.01f);
    EXPECT_NEAR(half(found[2]), -2 + source[2], 0.01f);
}

}  // namespace
}  // namespace nacre::test
