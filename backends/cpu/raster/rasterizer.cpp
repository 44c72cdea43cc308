// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/raster/rasterizer.h"

#include <algorithm>
#include <random>

#include "backends/cpu/raster/draw_plan.h"

namespace nacre::cpu {
namespace raster {

const Kernels& choose_kernels(std::uint32_t limit) {
#if defined(__x86_64__)
    if (limit >= 2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return kernels_avx512;
    if (limit >= 1 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return kernels_avx2;
#endif
    static_cast<void>(limit);
    return kernels_baseline;
}

namespace {

/// A chunk is what one task takes through the first half: small enough that all threads get some, large enough that
/// vertices are shared and bins pay: each tile looks at the bins of each chunk.
constexpr std::uint32_t least_chunk_primitives = 512, most_chunk_primitives = 2048;
/// A slab goes through both halves together, which bounds memory. Tiles take part in each slab anew.
constexpr std::uint32_t slab_primitives = 64 * 1024;
constexpr std::uint32_t slab_draws = 16 * 1024;
static_assert(slab_draws <= most_draws);
/// Vertex functions with side effects run once for each index as long as an instance is not larger than this.
constexpr std::uint32_t largest_whole_instance = 1 << 20;

}  // namespace
}  // namespace raster

using namespace raster;

struct Rasterizer::State {
    Scheduler& scheduler;
    std::uint32_t lanes;
    RasterizerOptions options;
    const Kernels& kernels;
    TargetSet targets{};

    std::vector<std::unique_ptr<QueuedDraw>> draws;  ///< The first `draw_count` are used.
    std::uint32_t draw_count = 0;
    std::vector<std::unique_ptr<Chunk>> chunks;  ///< The first `chunk_count` are used.
    std::uint32_t chunk_count = 0;
    std::uint32_t primitives = 0;

    std::vector<ChunkScratch> scratch;
    std::vector<AlignedMemory> workspaces;
    std::vector<AlignedMemory> primitive_memory, color_memory, double_memory;
    std::vector<ChunkView> views;
    std::vector<const DrawPlan*> plans;
    std::vector<std::uint32_t> busy_tiles;
    std::vector<std::uint64_t> tile_chunks;  ///< TileJob::tile_chunks
    std::vector<std::uint8_t> uncleared;  ///< For each tile: whether what is to be cleared there still is to be.

    State(Scheduler& of_scheduler, std::uint32_t lane_count, const RasterizerOptions& of_options)
        : scheduler(of_scheduler),
          lanes(std::clamp(lane_count / 4 * 4, 4u, max_lanes)),
          options(of_options),
          kernels(choose_kernels(of_options.instruction_set)),
          scratch(of_scheduler.thread_count()),
          workspaces(of_scheduler.thread_count()),
          primitive_memory(of_scheduler.thread_count()),
          color_memory(of_scheduler.thread_count()),
          double_memory(of_scheduler.thread_count()) {
        for (AlignedMemory& memory : workspaces) {
            memory.reserve(sizeof(Workspace), 0);
            std::memset(memory.data(), 0, sizeof(Workspace));
        }
    }

    Workspace& workspace(std::uint32_t thread) { return *reinterpret_cast<Workspace*>(workspaces[thread].data()); }

    Chunk& open_chunk(std::uint32_t chunk_primitives) {
        if (chunk_count == 0 || chunks[chunk_count - 1]->primitive_count >= chunk_primitives) {
            if (chunk_count == chunks.size()) chunks.push_back(std::make_unique<Chunk>());
            Chunk& chunk = *chunks[chunk_count++];
            chunk.segments.clear();
            chunk.primitive_count = 0;
        }
        return *chunks[chunk_count - 1];
    }

    /// A copy of the draw in the queue.
    std::uint32_t enqueue(const DrawState& state, const DrawCall& call) {
        if (draw_count == draws.size()) draws.push_back(std::make_unique<QueuedDraw>());
        plan_draw(state, call, targets, options.hierarchical_depth, *draws[draw_count]);
        return draw_count++;
    }

    void draw(const DrawState& state, const DrawCall& call) {
        const RasterPipeline& pipeline = *state.pipeline;
        const std::uint32_t count = primitives_of(pipeline.topology, call.count);
        if (count == 0 || call.instance_count == 0 || !pipeline.vertex.run || targets.tiles_x == 0 ||
            targets.tiles_y == 0)
            return;
        if (draw_count == slab_draws) flush(false);
        std::uint32_t index = enqueue(state, call);
        const std::uint32_t chunk_primitives =
            std::clamp(count / (8 * scheduler.thread_count()), least_chunk_primitives, most_chunk_primitives);
        const bool whole = pipeline.vertex.has_side_effects && count <= largest_whole_instance;
        for (std::uint32_t instance = 0; instance < call.instance_count; ++instance) {
            for (std::uint32_t first = 0; first < count;) {
                if (primitives >= slab_primitives) {
                    if (state.context.state && __atomic_load_n(&state.context.state->expired, __ATOMIC_RELAXED) != 0) {
                        discard_queue();
                        return;
                    }
                    flush(false);
                    index = enqueue(state, call);
                }
                Chunk& chunk = open_chunk(chunk_primitives);
                const std::uint32_t room = whole ? count : chunk_primitives - chunk.primitive_count;
                const std::uint32_t part = std::min(count - first, room);
                chunk.segments.push_back({index, call.first_instance + instance, first, part});
                chunk.primitive_count += part;
                primitives += part;
                first += part;
            }
        }
    }

    void discard_queue() { draw_count = chunk_count = primitives = 0; }

    /// `scheduler.run`, without waking threads for a single task.
    void run(std::uint32_t count, const std::function<void(std::uint32_t, std::uint32_t)>& task) {
        if (count == 1)
            task(0, 0);
        else if (count != 0)
            scheduler.run(count, task);
    }

    /// Carries out what is queued; at the end of the pass also the clears of tiles that nothing was drawn to.
    void flush(bool ends_pass) {
        const bool clears = ends_pass && std::ranges::find(uncleared, 1) != uncleared.end();
        if (chunk_count == 0 && !clears) {
            draw_count = 0;
            return;
        }
        run(chunk_count, [&](std::uint32_t index, std::uint32_t thread) {
            build_chunk(*chunks[index], draws, targets, kernels, lanes, scratch[thread]);
        });
        const std::uint32_t tile_count = targets.tiles_x * targets.tiles_y;
        const std::uint32_t chunk_words = (chunk_count + 63) / 64;
        tile_chunks.assign(std::size_t{tile_count} * chunk_words, 0);
        views.clear();
        for (std::uint32_t i = 0; i < chunk_count; ++i) {
            const Chunk& chunk = *chunks[i];
            if (chunk.records.empty()) continue;
            std::uint64_t* const words = tile_chunks.data() + views.size() / 64;
            const std::uint32_t bit = views.size() % 64;
            views.push_back({chunk.records.data(), chunk.vertices.data(),
                             chunk.bin_offsets.empty() ? nullptr : chunk.bin_offsets.data(), chunk.bins.data(),
                             chunk.large.data(), static_cast<std::uint32_t>(chunk.large.size())});
            const std::uint32_t* const offsets = views.back().bin_offsets;
            for (std::uint32_t tile = 0; tile < tile_count; ++tile) {
                const bool has_any = !chunk.large.empty() || (offsets && offsets[tile] != offsets[tile + 1]);
                words[std::size_t{tile} * chunk_words] |= std::uint64_t{has_any} << bit;
            }
        }
        busy_tiles.clear();
        for (std::uint32_t tile = 0; tile < tile_count; ++tile) {
            const std::uint64_t* const words = tile_chunks.data() + std::size_t{tile} * chunk_words;
            if (std::any_of(words, words + chunk_words, [](std::uint64_t word) { return word != 0; }) ||
                (clears && uncleared[tile]))
                busy_tiles.push_back(tile);
        }
        if (options.tile_order) std::ranges::shuffle(busy_tiles, std::minstd_rand(*options.tile_order + 1));

        std::size_t primitive_bytes = sizeof(PrimitiveData);
        plans.clear();
        for (std::uint32_t i = 0; i < draw_count; ++i) {
            plans.push_back(&draws[i]->plan);
            primitive_bytes = std::max<std::size_t>(primitive_bytes, draws[i]->plan.primitive_bytes);
        }
        for (std::uint32_t thread = 0; thread < primitive_memory.size(); ++thread) {
            primitive_memory[thread].reserve(primitive_bytes * primitive_slots, 0);
            workspace(thread).primitives = primitive_memory[thread].data();
            color_memory[thread].reserve(std::size_t{targets.color_planes} * tile_pixels * sizeof(std::uint32_t), 0);
            workspace(thread).colors = reinterpret_cast<std::uint32_t*>(color_memory[thread].data());
            workspace(thread).doubles = nullptr;
            // There may be nothing but targets to clear.
            if (draw_count == 0 || !draws[0]->plan.in_double) continue;
            constexpr std::size_t bytes = stream_batches * sizeof(FragmentDoubles);
            if (double_memory[thread].reserve(bytes, 0)) std::memset(double_memory[thread].data(), 0, bytes);
            workspace(thread).doubles = reinterpret_cast<FragmentDoubles*>(double_memory[thread].data());
        }
        const TileJob job{&targets,       views.data(),     plans.data(),       lanes,
                          &srgb_tables(), uncleared.data(), tile_chunks.data(), chunk_words};
        run(static_cast<std::uint32_t>(busy_tiles.size()), [&](std::uint32_t index, std::uint32_t thread) {
            kernels.draw_tile(job, busy_tiles[index], workspace(thread));
        });
        for (const std::uint32_t tile : busy_tiles) uncleared[tile] = 0;
        discard_queue();
    }
};

Rasterizer::Rasterizer(Scheduler& scheduler, std::uint32_t lanes, const RasterizerOptions& options)
    : state_(std::make_unique<State>(scheduler, lanes, options)) {}
Rasterizer::~Rasterizer() = default;

void Rasterizer::begin_pass(const RenderTargets& targets) {
    state_->discard_queue();
    const TargetSet& set = state_->targets = target_set(targets);
    const bool clears = set.depth_clears || set.stencil_clears ||
                        std::any_of(set.colors, set.colors + set.color_count, [](const auto& at) { return at.clears; });
    state_->uncleared.assign(std::size_t{set.tiles_x} * set.tiles_y, clears ? 1 : 0);
    for (std::uint32_t thread = 0; thread < state_->workspaces.size(); ++thread)
        state_->workspace(thread).passed_samples = 0;
}

void Rasterizer::draw(const DrawState& state, const DrawCall& call) { state_->draw(state, call); }

void Rasterizer::end_pass() { state_->flush(true); }

std::uint64_t Rasterizer::passed_samples() {
    state_->flush(false);
    std::uint64_t sum = 0;
    for (std::uint32_t thread = 0; thread < state_->workspaces.size(); ++thread)
        sum += state_->workspace(thread).passed_samples;
    return sum;
}

}  // namespace nacre::cpu
