// SPDX-License-Identifier: Apache-2.0
#include "benchmarks/cpu/lighting.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>

#include "backends/cpu/scheduler.h"
#include "benchmarks/cpu/bench.h"

/// @file
/// Arithmetic: 32 GGX lights for each pixel of a packed G-buffer, against lavapipe and against the same by hand.

namespace nacre::bench {
namespace {

constexpr std::size_t pixel_count = std::size_t{picture_width} * picture_height;

LightingBlock make_block() {
    LightingBlock block{};
    block.size = {picture_width, picture_height, most_lights, 0};
    block.plane = {1.0f, static_cast<float>(picture_height) / picture_width, 0, 0};
    std::mt19937 random(7);
    const auto number = [&](float low, float high) {
        return low + (high - low) * (static_cast<float>(random() >> 8) * 0x1p-24f);
    };
    for (auto& light : block.lights) {
        const float range = number(15.0f, 40.0f);
        light.position = {number(-8, 8), number(-5, 5), number(-12, 0), 1.0f / (range * range)};
        light.color = {number(0, 6), number(0, 6), number(0, 6), 0};
    }
    return block;
}

/// A smooth surface whose materials change every 16 x 16 pixels.
std::vector<glm::uvec4> make_words() {
    std::vector<glm::uvec4> words(pixel_count);
    for (std::uint32_t y = 0; y < picture_height; ++y) {
        for (std::uint32_t x = 0; x < picture_width; ++x) {
            const float u = static_cast<float>(x) * 0.01f, v = static_cast<float>(y) * 0.013f;
            // Octahedral coordinates of a normal that faces the viewer more or less.
            const auto ox = static_cast<std::uint32_t>(32768.0f + 12000.0f * std::sin(u));
            const auto oy = static_cast<std::uint32_t>(32768.0f + 12000.0f * std::cos(v));
            const float distance = 8.0f + 2.0f * std::sin(0.5f * u) * std::cos(0.5f * v);
            const std::uint32_t material = (x / 16 * 0x9e3779b1u) ^ (y / 16 * 0x85ebca6bu);
            words[std::size_t{y} * picture_width + x] = {material | 0xc0000000u, material * 2654435761u, ox | oy << 16,
                                                         std::bit_cast<std::uint32_t>(distance)};
        }
    }
    return words;
}

struct Lighting {
    rhi::Device* device;
    Kernel kernel;
    rhi::Buffer lit;

    [[nodiscard]] Expected<double> run() const {
        return time_submission(*device, [&](rhi::CommandList& list) {
            list.set_pipeline(kernel.pipeline);
            list.set_bind_group(0, kernel.group);
            list.dispatch({.x = picture_width / 64, .y = picture_height});
        });
    }
    [[nodiscard]] Expected<std::vector<float>> picture() const {
        NACRE_TRY(const auto bytes, device->read_buffer(lit));
        std::vector<float> values(bytes.size() / 4);
        std::memcpy(values.data(), bytes.data(), bytes.size());
        return values;
    }
};

Expected<Lighting> make_lighting(Bench& bench, const std::string& spec, const LightingBlock& block,
                                 const std::vector<glm::uvec4>& words) {
    Lighting lighting;
    NACRE_TRY(lighting.device, bench.device(spec));
    rhi::Device& device = *lighting.device;
    NACRE_TRY(const rhi::Buffer lights,
              device.create_buffer({.size = sizeof(block), .usage = rhi::BufferUsage::uniform, .name = "lights"}));
    NACRE_CHECK(device.write_buffer(lights, std::as_bytes(std::span(&block, 1))));
    NACRE_TRY(const rhi::Buffer gbuffer,
              device.create_buffer({.size = 16 * pixel_count, .usage = rhi::BufferUsage::storage, .name = "words"}));
    NACRE_CHECK(device.write_buffer(gbuffer, std::as_bytes(std::span(words))));
    NACRE_TRY(lighting.lit,
              device.create_buffer({.size = 16 * pixel_count, .usage = rhi::BufferUsage::storage, .name = "lit"}));
    NACRE_TRY(lighting.kernel, make_kernel(device, "benchmarks/cpu/lighting.comp",
                                           {{.binding = 0, .buffer = lights},
                                            {.binding = 1, .buffer = gbuffer},
                                            {.binding = 2, .buffer = lighting.lit}}));
    return lighting;
}

/// Memory aligned as the hand-written code wants it.
template <typename T>
std::shared_ptr<T[]> aligned_array(std::size_t count) {
    return {static_cast<T*>(std::aligned_alloc(64, count * sizeof(T))), [](T* memory) { std::free(memory); }};
}

/// Whether two pictures are the same but for roundings.
Expected<void> compare(const char* with, std::span<const float> found, std::span<const float> expected) {
    double worst = 0.0, sum = 0.0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
        const double difference = std::abs(double{found[i]} - expected[i]) / (1e-3 + std::abs(double{expected[i]}));
        if (!(difference <= worst)) worst = difference;
        sum += expected[i];
    }
    if (worst <= 0.01 && sum > 0.0) return {};
    return fail(ErrorCode::internal, "compare lighting with", with,
                fmt::format("pictures differ by up to {} of their values", worst),
                "The sides must do the same work: look at benchmarks/cpu/lighting.comp.");
}

}  // namespace

Expected<void> run_lighting(Bench& bench) {
    const LightingBlock block = make_block();
    const std::vector<glm::uvec4> words = make_words();
    std::vector<Lighting> ours;
    std::vector<Side> sides;
    for (const std::uint32_t lanes : bench.lane_counts()) {
        NACRE_TRY(const Lighting lighting, make_lighting(bench, cpu_spec(lanes), block, words));
        ours.push_back(lighting);
        sides.push_back({.name = "cpu", .lanes = lanes, .run = [lighting] { return lighting.run(); }});
    }
    NACRE_CHECK(ours.front().run());
    NACRE_TRY(const std::vector<float> picture, ours.front().picture());

    if (bench.has_device("vulkan")) {
        NACRE_TRY(const Lighting driver, make_lighting(bench, "vulkan", block, words));
        NACRE_CHECK(driver.run());
        NACRE_TRY(const std::vector<float> expected, driver.picture());
        NACRE_CHECK(compare("vulkan", picture, expected));
        NACRE_CHECK(bench.measure({.name = "lighting",
                                   .target = 6.0,
                                   .cpu = sides,
                                   .references = {{.name = "vulkan", .run = [driver] { return driver.run(); }}}}));
    }

    if (!can_light_by_hand()) {
        bench.skip("lighting_intrinsics", "this processor has no AVX-512");
        return {};
    }
    const auto input = aligned_array<glm::uvec4>(pixel_count);
    const auto output = aligned_array<glm::vec4>(pixel_count);
    std::memcpy(input.get(), words.data(), sizeof(glm::uvec4) * pixel_count);
    const std::shared_ptr<cpu::Scheduler> scheduler = cpu::Scheduler::create(0);
    const auto by_hand = [=] {
        return time_ms([&]() -> Expected<void> {
            constexpr std::uint32_t rows = 8;
            scheduler->run(picture_height / rows, [&](std::uint32_t index, std::uint32_t) {
                light_rows_by_hand(block, input.get(), output.get(), index * rows, (index + 1) * rows);
            });
            return {};
        });
    };
    NACRE_CHECK(by_hand());
    NACRE_CHECK(compare("intrinsics", picture, std::span(&output[0].x, 4 * pixel_count)));
    return bench.measure({.name = "lighting_intrinsics",
                          .target = 0.77,
                          .cpu = sides,
                          .references = {{.name = "intrinsics", .run = by_hand}}});
}

}  // namespace nacre::bench
