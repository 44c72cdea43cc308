// SPDX-License-Identifier: Apache-2.0
// Depth and stencil tests, blending, write masks and formats, against the formulas of the specification for one pixel.
#include "tests/backends/cpu/raster/raster_bench.h"

namespace nacre::test {
namespace {

using namespace rhi;

constexpr std::uint32_t width = 70, height = 10;  // Two tiles, the second with an odd rest.

std::vector<TestVertex> everything(float z = 0.5f) {
    std::vector<TestVertex> vertices(3);
    const float corners[3][2] = {{-1, -1}, {3, -1}, {-1, 3}};
    for (int i = 0; i < 3; ++i) vertices[i].position[0] = corners[i][0], vertices[i].position[1] = corners[i][1], vertices[i].position[2] = z;
    return vertices;
}

bool passes(CompareOperation operation, std::int64_t a, std::int64_t b) {
    switch (operation) {
        case CompareOperation::never: return false;
        case CompareOperation::less: return a < b;
        case CompareOperation::equal: return a == b;
        case CompareOperation::less_or_equal: return a <= b;
        case CompareOperation::greater: return a > b;
        case CompareOperation::not_equal: return a != b;
        case CompareOperation::greater_or_equal: return a >= b;
        case CompareOperation::always: return true;
    }
    return false;
}
int changed(StencilOperation operation, int value, int reference) {
    switch (operation) {
        case StencilOperation::keep: return value;
        case StencilOperation::zero: return 0;
        case StencilOperation::replace: return reference;
        case StencilOperation::increment_clamp: return std::min(value + 1, 255);
        case StencilOperation::decrement_clamp: return std::max(value - 1, 0);
        case StencilOperation::invert: return ~value & 255;
        case StencilOperation::increment_wrap: return (value + 1) & 255;
        case StencilOperation::decrement_wrap: return (value - 1) & 255;
    }
    return value;
}

TEST(Output, DepthAndStencilFollowTheFormulas) {
    std::mt19937 random(3);
    for (int round = 0; round < 400; ++round) {
        const Format formats[] = {Format::d16_unorm, Format::d24_unorm_s8_uint, Format::d32_float, Format::d32_float_s8_uint};
        const Format format = formats[random() % 4];
        const bool has_stencil = info(format).has_stencil;
        TestImage depth(format, width, height), color(Format::r32_float, width, height);
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const double values[] = {0.25, 0.5, 0.75};
                const double value = values[random() % 3];
                if (format == Format::d16_unorm)
                    depth.at<std::uint16_t>(x, y) = static_cast<std::uint16_t>(std::nearbyint(value * 65535.0));
                else if (format == Format::d24_unorm_s8_uint)
                    depth.at<std::uint32_t>(x, y) = static_cast<std::uint32_t>(std::nearbyint(value * 16777215.0));
                else
                    depth.at<float>(x, y) = static_cast<float>(value);
                depth.stencil(x, y) = static_cast<std::uint8_t>(random() % 3 == 0 ? random() % 256 : random() % 2 * 255);
            }
        const auto depth_of = [&](std::uint32_t x, std::uint32_t y) -> std::int64_t {
            if (format == Format::d16_unorm) return depth.at<std::uint16_t>(x, y);
            return depth.at<std::int32_t>(x, y);
        };
        std::vector<std::int64_t> old_depth;
        std::vector<int> old_stencil;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) old_depth.push_back(depth_of(x, y)), old_stencil.push_back(depth.stencil(x, y));

        Bench bench(width, height, {&color}, &depth, {.lanes = 4u << random() % 3, .options = {.instruction_set = static_cast<std::uint32_t>(random() % 3)}});
        bench.use<TestShader::constant>();
        auto& state = bench.pipeline.depth_stencil;
        state.depth_test = random() % 4 != 0;
        state.depth_write = random() % 2;
        state.depth_compare = static_cast<CompareOperation>(random() % 8);
        state.stencil_test = has_stencil && random() % 4 != 0;
        for (StencilFace* face : {&state.front, &state.back})
            *face = {static_cast<StencilOperation>(random() % 8), static_cast<StencilOperation>(random() % 8),
                     static_cast<StencilOperation>(random() % 8), static_cast<CompareOperation>(random() % 8),
                     static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random())};
        bench.state.stencil_reference = static_cast<std::uint8_t>(random());
        // What a fragment may do that moves the tests behind it.
        const bool late = random() % 2;
        bench.pipeline.fragment.discards = late;
        if (late) bench.constants.discard_modulus = 3;
        const bool shader_depth = late && random() % 2;
        bench.pipeline.fragment.writes_depth = shader_depth;
        bench.constants.depth = 0.25f;
        bench.pipeline.fragment.early_tests = late && random() % 4 == 0;
        bench.pipeline.front_face = random() % 2 ? FrontFace::clockwise : FrontFace::counter_clockwise;
        bench.draw(everything());
        const std::uint64_t passed = bench.passed();
        bench.end();

        // The triangle goes right, then down to the left: clockwise as seen.
        const StencilFace& face = bench.pipeline.front_face == FrontFace::clockwise ? state.front : state.back;
        const double z = shader_depth && !bench.pipeline.fragment.early_tests ? 0.25 : 0.5;
        const std::int64_t key = format == Format::d16_unorm           ? static_cast<std::int64_t>(std::nearbyint(z * 65535.0))
                                 : format == Format::d24_unorm_s8_uint ? static_cast<std::int64_t>(std::nearbyint(z * 16777215.0))
                                                                       : std::bit_cast<std::int32_t>(static_cast<float>(z));
        std::uint64_t expected_passed = 0;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const std::size_t i = y * width + x;
                std::int64_t new_depth = old_depth[i];
                int new_stencil = old_stencil[i];
                const bool discarded = late && (x + y) % 3 == 0;
                bool lives = false;
                if (!discarded || bench.pipeline.fragment.early_tests) {
                    const int reference = bench.state.stencil_reference;
                    const bool stencil_passes = !state.stencil_test || passes(face.compare, reference & face.read_mask, old_stencil[i] & face.read_mask);
                    const bool depth_passes = !state.depth_test || passes(state.depth_compare, key, old_depth[i]);
                    if (state.stencil_test) {
                        const StencilOperation operation = !stencil_passes ? face.fail : !depth_passes ? face.depth_fail : face.pass;
                        new_stencil = (changed(operation, old_stencil[i], reference) & face.write_mask) | (old_stencil[i] & ~face.write_mask);
                    }
                    lives = stencil_passes && depth_passes;
                    if (lives && state.depth_test && state.depth_write) new_depth = key;
                    expected_passed += lives;
                }
                ASSERT_EQ(depth_of(x, y), new_depth) << round << ": " << x << ", " << y;
                if (has_stencil) {
                    ASSERT_EQ(depth.stencil(x, y), new_stencil) << round << ": " << x << ", " << y;
                }
                ASSERT_EQ(color.at<float>(x, y), lives && !discarded ? 1.0f : 0.0f) << round << ": " << x << ", " << y;
            }
        EXPECT_EQ(passed, expected_passed) << round;
        EXPECT_TRUE(depth.margins_are_whole() && color.margins_are_whole());
    }
}

double factor(BlendFactor which, int channel, const double* source, const double* second, const double* destination, const double* constant) {
    switch (which) {
        case BlendFactor::zero: return 0;
        case BlendFactor::one: return 1;
        case BlendFactor::source_color: return source[channel];
        case BlendFactor::one_minus_source_color: return 1 - source[channel];
        case BlendFactor::source_alpha: return source[3];
        case BlendFactor::one_minus_source_alpha: return 1 - source[3];
        case BlendFactor::destination_color: return destination[channel];
        case BlendFactor::one_minus_destination_color: return 1 - destination[channel];
        case BlendFactor::destination_alpha: return destination[3];
        case BlendFactor::one_minus_destination_alpha: return 1 - destination[3];
        case BlendFactor::constant_color: return constant[channel];
        case BlendFactor::one_minus_constant_color: return 1 - constant[channel];
        case BlendFactor::source_alpha_saturated: return channel == 3 ? 1 : std::min(source[3], 1 - destination[3]);
        case BlendFactor::source1_color: return second[channel];
        case BlendFactor::one_minus_source1_color: return 1 - second[channel];
        case BlendFactor::source1_alpha: return second[3];
        case BlendFactor::one_minus_source1_alpha: return 1 - second[3];
    }
    return 0;
}
double to_srgb(double linear) { return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055; }
double from_srgb(double code) { return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4); }

TEST(Output, BlendingFollowsTheFormulas) {
    std::mt19937 random(4);
    std::uniform_real_distribution<float> unit(-0.3f, 1.3f);
    for (int round = 0; round < 1500; ++round) {
        const Format formats[] = {Format::rgba8_unorm, Format::rgba8_srgb, Format::rgba32_float, Format::bgra8_unorm};
        const Format format = formats[random() % 4];
        TestImage color(format, width, height);
        const bool is_float = format == Format::rgba32_float, is_srgb = format == Format::rgba8_srgb;
        std::array<std::uint8_t, 4> old_bytes{};
        double old[4];
        for (int i = 0; i < 4; ++i) {
            old_bytes[i] = static_cast<std::uint8_t>(random());
            old[i] = is_float ? unit(random) : old_bytes[i] / 255.0;
        }
        if (is_float)
            for (std::uint32_t y = 0; y < height; ++y)
                for (std::uint32_t x = 0; x < width; ++x)
                    color.at<std::array<float, 4>>(x, y) = {static_cast<float>(old[0]), static_cast<float>(old[1]), static_cast<float>(old[2]), static_cast<float>(old[3])};
        else
            color.fill(old_bytes);
        if (format == Format::bgra8_unorm) std::swap(old[0], old[2]);
        if (is_srgb)
            for (int i = 0; i < 3; ++i) old[i] = from_srgb(old[i]);
        Bench bench(width, height, {&color}, nullptr, {.lanes = 4u << random() % 3, .options = {.instruction_set = static_cast<std::uint32_t>(random() % 3)}});
        bench.use<TestShader::constant>();
        bench.pipeline.fragment.outputs.push_back({cpu::dual_source_output, 4});
        for (int i = 0; i < 4; ++i) bench.constants.color[i] = unit(random), bench.constants.second_color[i] = unit(random), bench.state.blend_constants[i] = unit(random);
        ColorTargetState& target = bench.pipeline.color_targets[0];
        target.write_mask = random() % 4 ? 15 : static_cast<std::uint8_t>(random() % 16);
        BlendState& blend = target.blend;
        blend = {random() % 8 != 0,
                 static_cast<BlendFactor>(random() % 17), static_cast<BlendFactor>(random() % 17), static_cast<BlendOperation>(random() % 5),
                 static_cast<BlendFactor>(random() % 17), static_cast<BlendFactor>(random() % 17), static_cast<BlendOperation>(random() % 5)};
        bench.draw(everything());
        bench.end();

        double source[4], second[4], constant[4], result[4];
        for (int i = 0; i < 4; ++i) {
            const auto ranged = [&](double value) { return is_float ? value : std::clamp(value, 0.0, 1.0); };
            source[i] = ranged(bench.constants.color[i]), second[i] = ranged(bench.constants.second_color[i]);
            constant[i] = ranged(bench.state.blend_constants[i]);
        }
        for (int i = 0; i < 4; ++i) {
            const BlendOperation operation = i == 3 ? blend.alpha_operation : blend.color_operation;
            const double s = source[i] * factor(i == 3 ? blend.source_alpha : blend.source_color, i, source, second, old, constant);
            const double d = old[i] * factor(i == 3 ? blend.destination_alpha : blend.destination_color, i, source, second, old, constant);
            result[i] = operation == BlendOperation::add                ? s + d
                        : operation == BlendOperation::subtract         ? s - d
                        : operation == BlendOperation::reverse_subtract ? d - s
                        : operation == BlendOperation::minimum          ? std::min(source[i], old[i])
                                                                        : std::max(source[i], old[i]);
            if (!blend.enabled) result[i] = source[i];
            if ((target.write_mask >> i & 1) == 0) result[i] = old[i];
        }
        for (const auto& [x, y] : {std::pair{0u, 0u}, {63u, 9u}, {64u, 5u}, {69u, 9u}})
            for (int i = 0; i < 4; ++i) {
                if (is_float) {
                    ASSERT_NEAR((color.at<std::array<float, 4>>(x, y)[i]), result[i], 1e-6) << round;
                    continue;
                }
                const int place = format == Format::bgra8_unorm && i < 3 ? 2 - i : i;
                const int got = color.at<std::array<std::uint8_t, 4>>(x, y)[place];
                const double bounded = std::clamp(result[i], 0.0, 1.0);
                const double exact = (is_srgb && i < 3 ? to_srgb(bounded) : bounded) * 255.0;
                // Rounded to the nearest; within float's own rounding of a half either neighbor is.
                ASSERT_LE(std::abs(got - exact), 0.5 + 2e-4) << round << " channel " << i;
                if ((target.write_mask >> i & 1) == 0) {
                    ASSERT_EQ(got, old_bytes[place]);
                }
            }
        EXPECT_TRUE(color.margins_are_whole());
    }
}

TEST(Output, BlendingKeepsTheOrderOfTriangles) {
    // 2 x + 1 after each triangle does not commute with its neighbors' values: destination * 1/2 + source.
    std::mt19937 random(5);
    for (const std::uint32_t lanes : {4u, 8u, 16u})
        for (const bool late : {false, true}) {
            TestImage color(Format::r32_float, width, height);
            Bench bench(width, height, {&color}, nullptr, {.lanes = lanes});
            bench.use<TestShader::values>();
            bench.pipeline.fragment.discards = late;
            bench.constants.discard_modulus = 0;
            bench.pipeline.color_targets[0].blend = {.enabled = true, .source_color = BlendFactor::one, .destination_color = BlendFactor::constant_color};
            bench.state.blend_constants = {0.5f, 0.5f, 0.5f, 0.5f};
            // Many triangles in few pixels, as packing likes them.
            std::vector<TestVertex> vertices;
            std::vector<float> values;
            for (int i = 0; i < 40; ++i) {
                const float value = static_cast<float>(random() % 16);
                values.push_back(value);
                for (const auto& [x, y] : {std::pair{62.0, 4.0}, {66.0, 4.0}, {62.0, 8.0}}) {
                    TestVertex vertex;
                    vertex.position[0] = static_cast<float>(x / (width * 0.5) - 1), vertex.position[1] = static_cast<float>(y / (height * 0.5) - 1);
                    vertex.values[0] = value;
                    vertices.push_back(vertex);
                }
            }
            bench.draw(vertices);
            bench.end();
            double expected = 0;
            for (const float value : values) expected = expected * 0.5 + value;
            EXPECT_NEAR(color.at<float>(62, 4), expected, 1e-4);
            EXPECT_NEAR(color.at<float>(63, 5), expected, 1e-4);
            EXPECT_NEAR(color.at<float>(64, 4), expected, 1e-4);
        }
}

TEST(Output, EveryFormatHoldsItsColor) {
    struct Case {
        Format format;
        std::vector<std::uint8_t> bytes;
    };
    // Color (0.5, 1, 0, 0.25); bytes by hand from the definitions of the formats.
    const std::vector<Case> cases = {
        {Format::r8_unorm, {128}},  // 127.5 rounds to the even one.
        {Format::rg8_unorm, {128, 255}},
        {Format::rgba8_unorm, {128, 255, 0, 64}},
        {Format::bgra8_unorm, {0, 255, 128, 64}},
        {Format::rgba8_snorm, {64, 127, 0, 32}},
        {Format::rgba8_srgb, {188, 255, 0, 64}},
        {Format::r16_unorm, {0, 0x80}},
        {Format::rg16_snorm, {0, 0x40, 0xff, 0x7f}},
        {Format::rgba16_float, {0, 0x38, 0, 0x3c, 0, 0, 0, 0x34}},
        {Format::r16_float, {0, 0x38}},
        {Format::r32_float, {0, 0, 0, 0x3f}},
        {Format::rg32_float, {0, 0, 0, 0x3f, 0, 0, 0x80, 0x3f}},
        // 511.5 -> 512, 1023, 0, 0.75 -> 1
        {Format::rgb10a2_unorm, {0x00, 0xfe, 0x0f, 0x40}},
        // 0.5 is exponent 14, 1 is exponent 15: 0x380, 0x3c0 << 11, 0.
        {Format::rg11b10_float, {0x80, 0x03, 0x1e, 0x00}},
    };
    for (const Case& entry : cases) {
        TestImage color(entry.format, width, height);
        Bench bench(width, height, {&color});
        bench.use<TestShader::constant>();
        const float values[4] = {0.5f, 1.0f, 0.0f, 0.25f};
        std::memcpy(bench.constants.color, values, sizeof(values));
        bench.draw(everything());
        bench.end();
        for (const auto& [x, y] : {std::pair{0u, 0u}, {69u, 9u}}) {
            const auto* const bytes = &color.at<std::uint8_t>(x, y);
            EXPECT_EQ(std::vector<std::uint8_t>(bytes, bytes + entry.bytes.size()), entry.bytes) << info(entry.format).name;
        }
    }
}

TEST(Output, IntegerTargetsHoldBitsAndMask) {
    for (const Format format : {Format::r8_uint, Format::r16_uint, Format::r32_uint, Format::rg32_uint, Format::rgba32_uint, Format::rgba16_uint, Format::rgb10a2_uint}) {
        TestImage color(format, width, height);
        color.fill(std::uint8_t{0xff});
        Bench bench(width, height, {&color});
        bench.use<TestShader::primitive_id>();
        bench.pipeline.color_targets[0].write_mask = 1;
        // Blending does not touch integers.
        bench.pipeline.color_targets[0].blend = {.enabled = true};
        bench.draw(everything());
        bench.end();
        const auto* const bytes = &color.at<std::uint8_t>(65, 9);
        EXPECT_EQ(bytes[0], 1) << info(format).name;
        if (format == Format::rg32_uint || format == Format::rgba32_uint) {
            EXPECT_EQ(bytes[1], 0);
            EXPECT_EQ(bytes[4], 0xff);
        }
        if (format == Format::rgb10a2_uint) {
            EXPECT_EQ(bytes[1], 0xfc);
        }
        EXPECT_TRUE(color.margins_are_whole());
    }
}

}  // namespace
}  // namespace nacre::test
