// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "backends/cpu/raster/rasterizer.h"
#include "rhi/format.h"

/// @file
/// What the tests of the rasterizer share: threads, targets, and shaders written in C++ for every lane count.

namespace nacre::test {

/// Starts its threads anew for each run; tasks are handed out in an order that differs from run to run.
class TestScheduler : public cpu::Scheduler {
  public:
    explicit TestScheduler(std::uint32_t threads) : threads_(threads) {}
    std::uint32_t thread_count() const override { return threads_; }
    void run(std::uint32_t count, const std::function<void(std::uint32_t, std::uint32_t)>& task) override {
        std::atomic<std::uint32_t> next = 0;
        const auto work = [&](std::uint32_t thread) {
            for (std::uint32_t index; (index = next++) < count;) task(index, thread);
        };
        if (threads_ == 1) return work(0);
        std::vector<std::thread> threads;
        for (std::uint32_t thread = 1; thread < threads_; ++thread) threads.emplace_back(work, thread);
        work(0);
        for (std::thread& thread : threads) thread.join();
    }

  private:
    std::uint32_t threads_;
};

/// A texture with one mip and layer; depth-stencil formats with their two planes.
class TestImage {
  public:
    TestImage(rhi::Format format, std::uint32_t width, std::uint32_t height, std::uint32_t samples = 1)
        : width_(width), height_(height), bytes_(rhi::info(format).block_bytes) {
        if (format == rhi::Format::d16_unorm) bytes_ = 2;
        if (rhi::info(format).has_depth && format != rhi::Format::d16_unorm) bytes_ = 4;
        const std::size_t plane = static_cast<std::size_t>(width) * height;
        // A margin on both sides must never change.
        data_.assign(plane * samples * bytes_ + 2 * margin, margin_byte);
        stencil_.assign(plane * samples + 2 * margin, margin_byte);
        std::memset(data_.data() + margin, 0, plane * samples * bytes_);
        std::memset(stencil_.data() + margin, 0, plane * samples);
        view_.format = format;
        view_.mip_count = view_.layer_count = 1;
        view_.samples = samples;
        view_.texel_bytes = bytes_;
        cpu::ImageLevel level;
        level.data = data_.data() + margin;
        level.width = width, level.height = height, level.depth = 1;
        level.row_stride = width * bytes_;
        level.sample_stride = level.layer_stride = level.slice_stride = plane * bytes_;
        view_.levels[0] = level;
        if (rhi::info(format).has_stencil) {
            level.data = stencil_.data() + margin;
            level.row_stride = width;
            level.sample_stride = level.layer_stride = level.slice_stride = plane;
            view_.stencil_levels[0] = level;
        }
    }
    const cpu::ImageView& view() const { return view_; }
    template <typename T>
    T& at(std::uint32_t x, std::uint32_t y, std::uint32_t sample = 0) {
        return *reinterpret_cast<T*>(data_.data() + margin +
                                     ((static_cast<std::size_t>(sample) * height_ + y) * width_ + x) * bytes_);
    }
    std::uint8_t& stencil(std::uint32_t x, std::uint32_t y, std::uint32_t sample = 0) {
        return reinterpret_cast<std::uint8_t&>(
            stencil_[margin + (static_cast<std::size_t>(sample) * height_ + y) * width_ + x]);
    }
    template <typename T>
    void fill(T value) {
        for (std::size_t i = margin; i + margin < data_.size(); i += sizeof(T))
            std::memcpy(data_.data() + i, &value, sizeof(T));
    }
    void fill_stencil(std::uint8_t value) {
        std::fill(stencil_.begin() + margin, stencil_.end() - margin, static_cast<std::byte>(value));
    }
    /// Everything inside, for comparisons.
    std::vector<std::byte> content() const {
        std::vector<std::byte> all(data_.begin() + margin, data_.end() - margin);
        all.insert(all.end(), stencil_.begin() + margin, stencil_.end() - margin);
        return all;
    }
    bool margins_are_whole() const {
        const auto whole = [](const std::vector<std::byte>& bytes) {
            for (std::size_t i = 0; i < margin; ++i)
                if (bytes[i] != margin_byte || bytes[bytes.size() - 1 - i] != margin_byte) return false;
            return true;
        };
        return whole(data_) && whole(stencil_);
    }

  private:
    static constexpr std::size_t margin = 4096;
    static constexpr std::byte margin_byte{0xa5};
    std::uint32_t width_, height_, bytes_;
    std::vector<std::byte> data_, stencil_;
    cpu::ImageView view_;
};

/// What the vertex function of the tests reads from buffer 0.
struct TestVertex {
    float position[4]{0, 0, 0, 1};
    float values[8]{};  ///< User outputs.
    float point_size = 1.0f;
    float clip_distances[2]{};
    float cull_distance = 0.0f;
};
inline constexpr std::uint32_t test_output_slots = cpu::first_user_slot + 8;

/// What the fragment functions of the tests read as push constants.
struct TestConstants {
    float color[4]{1, 1, 1, 1};
    float second_color[4]{};
    std::uint32_t discard_modulus = 0;  ///< Pixels with (x + y) % modulus == 0 are discarded.
    float depth = 0.0f;
    std::uint32_t sample_mask = 15;
    /// Counts invocations with a live lane, by pixel, where not null.
    std::uint32_t* counters = nullptr;
    std::uint32_t counter_width = 0;
};

template <int lanes>
void vertex_function(const cpu::ShaderContext*, const cpu::VertexDraw* draw, cpu::VertexBatch* batches,
                     std::uint32_t count) {
    for (std::uint32_t b = 0; b < count; ++b)
        for (int lane = 0; lane < lanes; ++lane) {
            cpu::VertexBatch& batch = batches[b];
            TestVertex vertex;
            const std::uint64_t offset = std::uint64_t{batch.indices[lane]} * sizeof(TestVertex);
            if (offset + sizeof(TestVertex) <= draw->buffers[0].size)
                std::memcpy(&vertex, draw->buffers[0].data + offset, sizeof(vertex));
            // Instances lie beside each other.
            vertex.position[0] += 2.0f * static_cast<float>(batch.instance) * vertex.position[3];
            const auto put = [&](std::uint32_t slot, float value) {
                batch.outputs[slot * cpu::max_lanes + lane] = value;
            };
            for (std::uint32_t i = 0; i < 4; ++i) put(cpu::slot_position + i, vertex.position[i]);
            put(cpu::slot_point_size, vertex.point_size);
            // Whoever asks for one clip distance and one cull distance finds them one behind the other.
            put(cpu::slot_clip_distance, vertex.clip_distances[0]);
            put(cpu::slot_clip_distance + 1, vertex.clip_distances[1]);
            put(cpu::slot_clip_distance + 2, vertex.cull_distance);
            for (std::uint32_t i = 0; i < 8; ++i) put(cpu::first_user_slot + i, vertex.values[i]);
        }
}

/// As compiled fragment code evaluates planes: of the depth, and of everything else.
inline float depth_at(const cpu::PrimitiveData& primitive, float x, float y) {
    const cpu::Plane& plane = primitive.depth;
    return plane.c + plane.dx * (x - primitive.x0) + plane.dy * (y - primitive.y0);
}
inline float plane_at(const cpu::Plane& plane, const cpu::PrimitiveData& primitive, float x, float y) {
    return std::fma(plane.dy, y - primitive.origin_y, std::fma(plane.dx, x - primitive.origin_x, plane.c));
}
inline std::uint32_t bits_of(float value) { return std::bit_cast<std::uint32_t>(value); }

enum class TestShader { constant, primitive_id, values, raw_planes, position, point, coverage };

template <int lanes, TestShader shader>
void fragment_function(const cpu::ShaderContext* context, cpu::FragmentBatch* batches, std::uint32_t count) {
    TestConstants constants;
    std::memcpy(&constants, context->push_constants, sizeof(constants));
    for (std::uint32_t b = 0; b < count; ++b) {
        cpu::FragmentBatch& batch = batches[b];
        for (int lane = 0; lane < lanes; ++lane) {
            const cpu::PrimitiveData& primitive = *batch.primitives[lane / 4];
            const std::int32_t pixel_x = batch.x[lane / 4] + (lane & 1), pixel_y = batch.y[lane / 4] + (lane >> 1 & 1);
            const float x = static_cast<float>(pixel_x) + batch.sample_x,
                        y = static_cast<float>(pixel_y) + batch.sample_y;
            const bool live = batch.live >> lane & 1;
            if (live && constants.counters)
                ++reinterpret_cast<std::atomic<std::uint32_t>&>(
                    constants.counters[static_cast<std::size_t>(pixel_y) * constants.counter_width + pixel_x]);
            auto* const colors = batch.colors;
            const auto color = [&](float r, float g, float bl, float a) {
                colors[0][0][lane] = bits_of(r), colors[0][1][lane] = bits_of(g);
                colors[0][2][lane] = bits_of(bl), colors[0][3][lane] = bits_of(a);
            };
            if constexpr (shader == TestShader::constant) {
                color(constants.color[0], constants.color[1], constants.color[2], constants.color[3]);
                for (int i = 0; i < 4; ++i)
                    colors[cpu::dual_source_output][i][lane] = bits_of(constants.second_color[i]);
            } else if constexpr (shader == TestShader::primitive_id) {
                colors[0][0][lane] = primitive.primitive_id + 1;
                colors[0][1][lane] = primitive.front_facing;
            } else if constexpr (shader == TestShader::values) {
                const float w = 1.0f / plane_at(primitive.inverse_w, primitive, x, y);
                float v[4];
                // Inputs of the tests: two with perspective, one without, one flat.
                for (int i = 0; i < 4; ++i) v[i] = plane_at(primitive.varyings()[i], primitive, x, y);
                color(v[0] * w, v[1] * w, v[2], v[3]);
            } else if constexpr (shader == TestShader::position) {
                color(x, y, depth_at(primitive, x, y), plane_at(primitive.inverse_w, primitive, x, y));
            } else if constexpr (shader == TestShader::point) {
                color((x - primitive.origin_x) * primitive.inverse_point_size,
                      (y - primitive.origin_y) * primitive.inverse_point_size, 0, 1);
            } else if constexpr (shader == TestShader::coverage) {
                colors[0][0][lane] = batch.sample_mask_in[lane];
                colors[0][1][lane] = batch.sample_index;
                colors[0][2][lane] = bits_of(batch.centroid_x[lane]),
                colors[0][3][lane] = bits_of(batch.centroid_y[lane]);
            }
            if (constants.discard_modulus &&
                (pixel_x + pixel_y) % static_cast<std::int32_t>(constants.discard_modulus) == 0)
                batch.live &= ~(1u << lane);
            batch.depth[lane] = constants.depth;
            batch.sample_mask_out[lane] = constants.sample_mask;
        }
    }
}

template <TestShader shader>
cpu::FragmentFunction fragment_for(std::uint32_t lanes) {
    return lanes == 4   ? fragment_function<4, shader>
           : lanes == 8 ? fragment_function<8, shader>
                        : fragment_function<16, shader>;
}
inline cpu::VertexFunction vertex_for(std::uint32_t lanes) {
    return lanes == 4 ? vertex_function<4> : lanes == 8 ? vertex_function<8> : vertex_function<16>;
}

/// A rasterizer with targets, a pipeline that can be changed, and vertices.
struct BenchSetup {
    std::uint32_t lanes = 16, threads = 1;
    cpu::RasterizerOptions options{};
};
class Bench {
  public:
    Bench(std::uint32_t width, std::uint32_t height, std::vector<TestImage*> colors, TestImage* depth = nullptr,
          BenchSetup setup = {}, std::uint32_t samples = 1)
        : scheduler_(setup.threads), rasterizer_(scheduler_, setup.lanes, setup.options), lanes_(setup.lanes) {
        for (TestImage* image : colors) targets_.colors.push_back(image->view());
        if (depth) targets_.depth_stencil = depth->view();
        targets_.width = width, targets_.height = height, targets_.samples = samples;
        state.viewport = {0, 0, static_cast<float>(width), static_cast<float>(height), 0, 1};
        state.scissor = {0, 0, width, height};
        pipeline.samples = samples;
        pipeline.vertex.run = vertex_for(lanes_);
        pipeline.vertex.output_slots = test_output_slots;
        for (const TestImage* image : colors) pipeline.color_targets.push_back({.format = image->view().format});
        if (depth) pipeline.depth_stencil.format = depth->view().format;
        begin();
    }
    void begin() { rasterizer_.begin_pass(targets_); }

    template <TestShader shader>
    void use(std::uint32_t components = 4) {
        pipeline.fragment.run = fragment_for<shader>(lanes_);
        pipeline.fragment.outputs = {{0, components}};
        if (shader == TestShader::values) {
            using enum cpu::Interpolation;
            pipeline.fragment.inputs = {{0, 0, perspective}, {0, 1, perspective}, {1, 0, linear}, {2, 0, flat}};
            pipeline.input_slots = {13, 14, 15, 16};
        }
    }

    /// Draws all vertices. Pipeline, constants and vertices are kept until the pass ends.
    void draw(const std::vector<TestVertex>& vertices, cpu::DrawCall call = {}) {
        auto& kept = kept_.emplace_back(std::make_unique<Kept>());
        kept->vertices = vertices;
        kept->pipeline = pipeline;
        alignas(16) std::byte block[cpu::push_constant_capacity]{};
        std::memcpy(block, &constants, sizeof(constants));
        state.pipeline = &kept->pipeline;
        state.context.push_constants = block;
        state.vertex.buffers[0] = {reinterpret_cast<const std::byte*>(kept->vertices.data()),
                                   kept->vertices.size() * sizeof(TestVertex)};
        if (call.count == 0) call.count = static_cast<std::uint32_t>(vertices.size());
        rasterizer_.draw(state, call);
    }
    void end() {
        rasterizer_.end_pass();
        kept_.clear();
    }
    std::uint64_t passed() { return rasterizer_.passed_samples(); }

    cpu::RasterPipeline pipeline;
    cpu::DrawState state;
    TestConstants constants;

  private:
    struct Kept {
        std::vector<TestVertex> vertices;
        cpu::RasterPipeline pipeline;
    };
    TestScheduler scheduler_;
    cpu::Rasterizer rasterizer_;
    cpu::RenderTargets targets_;
    std::uint32_t lanes_;
    std::vector<std::unique_ptr<Kept>> kept_;
};

/// A vertex at window coordinates of a target of that size; exact for multiples of 1/256 and sizes that are powers of
/// two.
inline TestVertex at_window(double x, double y, std::uint32_t width, std::uint32_t height, float z = 0.5f) {
    TestVertex vertex;
    vertex.position[0] = static_cast<float>(x / (width * 0.5) - 1.0);
    vertex.position[1] = static_cast<float>(y / (height * 0.5) - 1.0);
    vertex.position[2] = z;
    return vertex;
}

}  // namespace nacre::test
