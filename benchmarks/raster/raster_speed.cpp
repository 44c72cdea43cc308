// SPDX-License-Identifier: Apache-2.0
// Time of the rasterizer alone at 1920x1080, with shaders written in C++: a position and eight values for each vertex,
// three words of 32 bits for each pixel.
//
//     raster_speed_benchmark [threads [runs [instruction set: 0 baseline, 1 AVX2, 2 AVX-512]]]
#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <thread>

#if defined(__AVX512F__)
#include <immintrin.h>
#endif

#include "backends/cpu/raster/rasterizer.h"

namespace {

using namespace nacre;

/// Threads that wait actively for a while, as oneTBB's do.
class Pool : public cpu::Scheduler {
  public:
    explicit Pool(std::uint32_t threads) : threads_(threads) {
        for (std::uint32_t i = 1; i < threads; ++i) workers_.emplace_back([this, i] { work(i); });
    }
    ~Pool() override {
        stop_ = true;
        ++round_;
        for (std::thread& worker : workers_) worker.join();
    }
    std::uint32_t thread_count() const override { return threads_; }
    void run(std::uint32_t count, const std::function<void(std::uint32_t, std::uint32_t)>& task) override {
        task_ = &task, count_ = count, next_ = 0, busy_ = threads_ - 1;
        ++round_;
        take(0);
        while (busy_ != 0) std::this_thread::yield();
    }

  private:
    void take(std::uint32_t thread) {
        for (std::uint32_t index; (index = next_++) < count_;) (*task_)(index, thread);
    }
    void work(std::uint32_t thread) {
        for (std::uint32_t seen = 0;;) {
            while (round_ == seen) std::this_thread::yield();
            ++seen;
            if (stop_) return;
            take(thread);
            --busy_;
        }
    }
    std::uint32_t threads_;
    std::vector<std::thread> workers_;
    std::atomic<std::uint32_t> round_ = 0, next_ = 0, busy_ = 0;
    std::atomic<bool> stop_ = false;
    const std::function<void(std::uint32_t, std::uint32_t)>* task_ = nullptr;
    std::uint32_t count_ = 0;
};

constexpr std::uint32_t width = 1920, height = 1080, lanes = 16, value_count = 8;
using Floats [[gnu::vector_size(64)]] = float;
using Integers [[gnu::vector_size(64)]] = std::int32_t;
using Words [[gnu::vector_size(64)]] = std::uint32_t;

struct Vertex {
    float position[4], values[value_count];
};

void vertex_function(const cpu::ShaderContext*, const cpu::VertexDraw* draw, cpu::VertexBatch* batches,
                     std::uint32_t count) {
    const auto* const vertices = reinterpret_cast<const Vertex*>(draw->buffers[0].data);
    for (std::uint32_t b = 0; b < count; ++b)
        for (std::uint32_t lane = 0; lane < lanes; ++lane) {
            const Vertex& vertex = vertices[batches[b].indices[lane]];
            float* const out = batches[b].outputs + lane;
            for (std::uint32_t i = 0; i < 4; ++i) out[i * cpu::max_lanes] = vertex.position[i];
            for (std::uint32_t i = 0; i < value_count; ++i)
                out[(cpu::first_user_slot + i) * cpu::max_lanes] = vertex.values[i];
        }
}

/// Interpolates all values and packs them, as a pass that fills a G-buffer does at the least.
void fragment_function(const cpu::ShaderContext*, cpu::FragmentBatch* batches, std::uint32_t count) {
    for (std::uint32_t b = 0; b < count; ++b) {
        cpu::FragmentBatch& batch = batches[b];
        const cpu::PrimitiveData* const from[4] = {batch.primitives[0], batch.primitives[1], batch.primitives[2],
                                                   batch.primitives[3]};
        alignas(64) float places[2][16];
        for (int lane = 0; lane < 16; ++lane) {
            places[0][lane] = static_cast<float>(batch.x[lane / 4] + (lane & 1)) + 0.5f - from[lane / 4]->origin_x;
            places[1][lane] = static_cast<float>(batch.y[lane / 4] + (lane >> 1 & 1)) + 0.5f - from[lane / 4]->origin_y;
        }
        Floats x, y;
        std::memcpy(&x, places[0], sizeof(x)), std::memcpy(&y, places[1], sizeof(y));
        const auto spread = [&](auto&& get) {
#if defined(__AVX512F__)
            Floats result = Floats{} + get(*from[0]);
            result = _mm512_mask_broadcastss_ps(result, 0x00f0, _mm_load_ss(&get(*from[1])));
            result = _mm512_mask_broadcastss_ps(result, 0x0f00, _mm_load_ss(&get(*from[2])));
            return static_cast<Floats>(_mm512_mask_broadcastss_ps(result, 0xf000, _mm_load_ss(&get(*from[3]))));
#else
            Floats result;
            for (int quad = 0; quad < 4; ++quad)
                for (int i = 0; i < 4; ++i) result[4 * quad + i] = get(*from[quad]);
            return result;
#endif
        };
        const auto plane = [&](auto&& get) {
            const Floats c = spread([&](const cpu::PrimitiveData& p) -> const float& { return get(p).c; });
            const Floats dx = spread([&](const cpu::PrimitiveData& p) -> const float& { return get(p).dx; });
            const Floats dy = spread([&](const cpu::PrimitiveData& p) -> const float& { return get(p).dy; });
            return c + dx * x + dy * y;
        };
        const Floats w = 1.0f / plane([](const cpu::PrimitiveData& p) -> const cpu::Plane& { return p.inverse_w; });
        Words words[value_count];
        for (std::uint32_t i = 0; i < value_count; ++i) {
            const Floats value =
                w * plane([&](const cpu::PrimitiveData& p) -> const cpu::Plane& { return p.varyings()[i]; });
            words[i] = (Words) __builtin_convertvector(value * 1000.0f, Integers);
        }
        const Words packed[3] = {words[0] | words[1] << 16, words[2] | words[3] << 10 | words[4] << 20,
                                 words[5] | words[6] << 10 | words[7] << 20};
        for (int i = 0; i < 3; ++i) std::memcpy(batch.colors[i][0], &packed[i], sizeof(Words));
    }
}

/// A wavy sheet of about `triangles` triangles over the part of the picture that `scale` says.
void make_sheet(std::uint32_t triangles, float scale, float z, std::vector<Vertex>& vertices,
                std::vector<std::uint32_t>& indices) {
    const auto columns = static_cast<std::uint32_t>(std::max(1.0, std::sqrt(triangles / 2.0 * 16 / 9)));
    const std::uint32_t rows = std::max(1u, triangles / 2 / columns);
    const auto first = static_cast<std::uint32_t>(vertices.size());
    for (std::uint32_t j = 0; j <= rows; ++j)
        for (std::uint32_t i = 0; i <= columns; ++i) {
            const float u = static_cast<float>(i) / static_cast<float>(columns),
                        v = static_cast<float>(j) / static_cast<float>(rows);
            const float w = 1.0f + 0.3f * v;
            vertices.push_back(
                {{(2 * u - 1) * scale * w, (2 * v - 1) * scale * w, (z + 0.02f * std::sin(20 * u)) * w, w},
                 {u, v, u * v, 1 - u, 1 - v, u, v, u}});
        }
    for (std::uint32_t j = 0; j < rows; ++j)
        for (std::uint32_t i = 0; i < columns; ++i) {
            const std::uint32_t a = first + j * (columns + 1) + i, b = a + 1, c = a + columns + 1, d = c + 1;
            indices.insert(indices.end(), {a, b, c, b, d, c});
        }
}

struct Target {
    std::vector<std::byte> data;
    cpu::ImageView view;
    explicit Target(rhi::Format format) : data(std::size_t{width} * height * 4) {
        view.format = format;
        view.mip_count = view.layer_count = 1;
        view.texel_bytes = 4;
        view.levels[0].data = data.data();
        view.levels[0].row_stride = width * 4;
    }
};

struct Case {
    const char* name;
    std::uint32_t triangles;
    std::vector<float> depths;
    float scale;
    bool depth_only;
};

}  // namespace

int main(int argc, char** argv) {
    const auto number = [&](int index, int otherwise) {
        const int value = argc > index ? std::atoi(argv[index]) : otherwise;
        return value > 0 || (value == 0 && argc > index && argv[index][0] == '0') ? value : otherwise;
    };
    const auto threads = static_cast<std::uint32_t>(std::max(1, number(1, 2)));
    const int runs = std::max(1, number(2, 30));
    const auto instruction_set = static_cast<std::uint32_t>(number(3, 2));
    Pool pool(threads);
    cpu::Rasterizer rasterizer(pool, lanes, {.instruction_set = instruction_set});
    Target colors[3] = {Target(rhi::Format::r32_uint), Target(rhi::Format::r32_uint), Target(rhi::Format::r32_uint)};
    Target depth(rhi::Format::d32_float);
    cpu::RenderTargets targets;
    targets.depth_stencil = depth.view;
    targets.width = width, targets.height = height;
    const Case cases[] = {
        {"250k triangles, once", 250'000, {0.5f}, 1, false},
        {"250k triangles, three layers back to front", 83'333, {0.8f, 0.5f, 0.2f}, 1, false},
        {"250k triangles, three layers front to back", 83'333, {0.2f, 0.5f, 0.8f}, 1, false},
        {"250k triangles in 1/16 of the picture", 250'000, {0.5f}, 0.25f, false},
        {"2.5k triangles, once", 2'500, {0.5f}, 1, false},
        {"2 triangles, once", 2, {0.5f}, 1, false},
        {"250k triangles, depth only", 250'000, {0.5f}, 1, true},
        {"2 triangles, depth only", 2, {0.5f}, 1, true},
    };
    for (const Case& entry : cases) {
        if (argc > 4 && !std::strstr(entry.name, argv[4])) continue;
        std::vector<Vertex> vertices;
        std::vector<std::uint32_t> indices;
        for (const float z : entry.depths) make_sheet(entry.triangles, entry.scale, z, vertices, indices);
        cpu::RasterPipeline pipeline;
        pipeline.vertex.run = vertex_function;
        pipeline.vertex.output_slots = cpu::first_user_slot + value_count;
        pipeline.depth_stencil = {.format = rhi::Format::d32_float,
                                  .depth_test = true,
                                  .depth_write = true,
                                  .depth_compare = rhi::CompareOperation::less};
        targets.colors.clear();
        if (!entry.depth_only) {
            pipeline.fragment.run = fragment_function;
            for (std::uint32_t i = 0; i < value_count; ++i) {
                pipeline.fragment.inputs.push_back({i / 4, i % 4, cpu::Interpolation::perspective});
                pipeline.input_slots.push_back(cpu::first_user_slot + i);
            }
            for (std::uint32_t i = 0; i < 3; ++i) {
                targets.colors.push_back(colors[i].view);
                pipeline.fragment.outputs.push_back({i, 1});
                pipeline.color_targets.push_back({.format = rhi::Format::r32_uint});
            }
        }
        cpu::DrawState state;
        state.pipeline = &pipeline;
        state.vertex.buffers[0] = {reinterpret_cast<const std::byte*>(vertices.data()),
                                   vertices.size() * sizeof(Vertex)};
        state.viewport = {0, 0, width, height, 0, 1};
        state.scissor = {0, 0, width, height};
        cpu::DrawCall call;
        call.indexed = true;
        call.indices = reinterpret_cast<const std::byte*>(indices.data());
        call.index_bytes = indices.size() * 4;
        call.count = static_cast<std::uint32_t>(indices.size());
        std::vector<double> times, work_times;
        std::uint64_t passed = 0;
        for (int run = 0; run < runs; ++run) {
            std::fill_n(reinterpret_cast<float*>(depth.data.data()), std::size_t{width} * height, 1.0f);
            const std::clock_t work_begin = std::clock();
            const auto begin = std::chrono::steady_clock::now();
            rasterizer.begin_pass(targets);
            rasterizer.draw(state, call);
            rasterizer.end_pass();
            times.push_back(
                std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
            work_times.push_back(static_cast<double>(std::clock() - work_begin) * 1000.0 / CLOCKS_PER_SEC);
            passed = rasterizer.passed_samples();
        }
        std::sort(times.begin(), times.end());
        // Processor time counts on a busy machine, with one thread (several wait actively).
        std::sort(work_times.begin(), work_times.end());
        fmt::print("{:44} least {:6.2f} ms, median {:6.2f} ms, processor {:6.2f} ms, {} samples\n", entry.name,
                   times.front(), times[times.size() / 2], work_times.front(), passed);
    }
    return EXIT_SUCCESS;
}
