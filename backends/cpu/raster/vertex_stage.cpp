// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/raster/vertex_stage.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <span>

#include "backends/cpu/raster/simd.h"

namespace nacre::cpu::raster {
namespace {

/// Elements of primitives [first, first + count).
std::pair<std::uint32_t, std::uint32_t> elements_of(rhi::Topology topology, std::uint32_t first, std::uint32_t count) {
    switch (topology) {
        case rhi::Topology::point_list: return {first, count};
        case rhi::Topology::line_list: return {2 * first, 2 * count};
        case rhi::Topology::line_strip: return {first, count + 1};
        case rhi::Topology::triangle_list: return {3 * first, 3 * count};
        case rhi::Topology::triangle_strip: break;
    }
    return {first, count + 2};
}

template <typename Index>
void fetch_indices(const DrawCall& call, std::uint32_t first_element, std::uint32_t count, std::uint32_t* out) {
    const std::uint64_t first = static_cast<std::uint64_t>(call.first) + first_element;
    const std::uint64_t available = call.indices ? call.index_bytes / sizeof(Index) : 0;
    const auto offset = static_cast<std::uint32_t>(call.vertex_offset);
    const auto readable =
        static_cast<std::uint32_t>(first < available ? std::min<std::uint64_t>(count, available - first) : 0);
    std::uint32_t i = 0;
    if (sizeof(Index) == sizeof(*out) && offset == 0 && readable != 0) {
        std::memcpy(out, call.indices + first * sizeof(Index), readable * sizeof(Index));
        i = readable;
    }
    for (; i < readable; ++i) {
        Index index;
        std::memcpy(&index, call.indices + (first + i) * sizeof(Index), sizeof(index));
        out[i] = index + offset;
    }
    for (; i < count; ++i) out[i] = offset;
}

struct IndexRange {
    std::uint32_t lowest, highest;
};
IndexRange range_of(std::span<const std::uint32_t> indices) {
    std::uint32_t lowest = ~0u, highest = 0;
    std::size_t i = 0;
    if (indices.size() >= 16) {
        // Signed numbers keep the order of unsigned ones where the uppermost bit is turned.
        constexpr std::uint32_t turned = 0x80000000;
        const Ints turn = ints(static_cast<std::int32_t>(turned));
        Ints low = load(indices.data()) ^ turn, high = low;
        for (i = 16; i + 16 <= indices.size(); i += 16) {
            const Ints next = load(indices.data() + i) ^ turn;
            low = minimum(low, next), high = maximum(high, next);
        }
        std::uint32_t lows[16], highs[16];
        store(lows, low ^ turn), store(highs, high ^ turn);
        lowest = *std::ranges::min_element(lows), highest = *std::ranges::max_element(highs);
    }
    for (; i < indices.size(); ++i) lowest = std::min(lowest, indices[i]), highest = std::max(highest, indices[i]);
    return {lowest, highest};
}

/// Turns the indices in `scratch.locals` into places of `scratch.indices`, which gets each different one once.
void find_unique(ChunkScratch& scratch) {
    const auto [lowest, highest] = range_of(scratch.locals);
    // Those that lie close together have a place for each that there could be.
    if (const std::size_t range = std::size_t{highest} - lowest + 1; range <= scratch.locals.size()) {
        constexpr std::uint32_t none = ~0u;
        scratch.places.assign(range, none);
        scratch.indices.resize(std::min(range, scratch.locals.size()));
        std::uint32_t* const places = scratch.places.data();
        std::uint32_t* const indices = scratch.indices.data();
        std::uint32_t count = 0;
        for (std::uint32_t& local : scratch.locals) {
            std::uint32_t& place = places[local - lowest];
            if (place == none) indices[count] = local, place = count++;
            local = place;
        }
        scratch.indices.resize(count);
        return;
    }
    const std::size_t size = std::bit_ceil(std::max<std::size_t>(64, 4 * scratch.locals.size()));
    if (scratch.cache.size() < size) scratch.cache.assign(size, {}), scratch.generation = 0;
    if (++scratch.generation == 0) {
        std::fill(scratch.cache.begin(), scratch.cache.end(), ChunkScratch::CacheEntry{});
        scratch.generation = 1;
    }
    const auto mask = static_cast<std::uint32_t>(scratch.cache.size() - 1);
    for (std::uint32_t& local : scratch.locals) {
        const std::uint32_t index = local;
        // Neighbors stay neighbors, which keeps the table in the cache of the processor.
        std::uint32_t place = (index + (index >> 13) * 0x9e3779b1u) & mask;
        while (true) {
            ChunkScratch::CacheEntry& entry = scratch.cache[place];
            if (entry.generation != scratch.generation) {
                entry = {index, static_cast<std::uint32_t>(scratch.indices.size()), scratch.generation};
                scratch.indices.push_back(index);
            } else if (entry.index != index) {
                // Away by a step of its own (odd, so that it comes everywhere): meshes that take turns between several
                // runs of neighbors would go along one run for every vertex of another.
                place = (place + ((index * 0x9e3779b1u >> 15) | 1)) & mask;
                continue;
            }
            local = entry.local;
            break;
        }
    }
}

constexpr std::uint32_t batches_at_once = 8;
alignas(64) constexpr float zero_row[max_lanes]{};

}  // namespace

void run_vertices(const Segment& segment, const QueuedDraw& draw, const Kernels& kernels, std::uint32_t lanes,
                  Chunk& chunk, ChunkScratch& scratch) {
    const RasterPipeline& pipeline = *draw.pipeline;
    const VertexProgram& program = pipeline.vertex;
    const auto [first, count] = elements_of(pipeline.topology, segment.first_primitive, segment.primitive_count);
    scratch.locals.resize(count);
    scratch.indices.clear();
    if (!draw.call.indexed) {
        std::iota(scratch.locals.begin(), scratch.locals.end(), 0u);
        scratch.indices.resize(count);
        std::iota(scratch.indices.begin(), scratch.indices.end(), draw.call.first + first);
    } else {
        if (draw.call.index_type == rhi::IndexType::uint16)
            fetch_indices<std::uint16_t>(draw.call, first, count, scratch.locals.data());
        else
            fetch_indices<std::uint32_t>(draw.call, first, count, scratch.locals.data());
        find_unique(scratch);
    }

    const std::size_t vertex_count = scratch.indices.size();
    const std::size_t first_byte = chunk.vertex_bytes;
    chunk.vertices.reserve(first_byte + vertex_count * draw.vertex_bytes, first_byte);
    chunk.vertex_bytes = first_byte + vertex_count * draw.vertex_bytes;
    scratch.setup.resize(vertex_count);
    const bool is_points = pipeline.topology == rhi::Topology::point_list;
    if (is_points) scratch.point_sizes.assign(vertex_count, 1.0f);
    if (program.clip_distances) scratch.clip_distances.resize(vertex_count * 8);

    const std::uint32_t output_slots = std::max(program.output_slots, first_user_slot);
    const std::size_t batch_words = static_cast<std::size_t>(output_slots) * max_lanes;
    // Lanes that the vertex function does not write are read, though nothing follows from them: they hold some number
    // at least.
    if (scratch.outputs.reserve(batches_at_once * batch_words * sizeof(float), 0))
        std::memset(scratch.outputs.data(), 0, batches_at_once * batch_words * sizeof(float));
    auto* const outputs = reinterpret_cast<float*>(scratch.outputs.data());
    auto* doubles = static_cast<double*>(nullptr);
    if (draw.plan.in_double) {
        if (scratch.double_outputs.reserve(batches_at_once * batch_words * sizeof(double), 0))
            std::memset(scratch.double_outputs.data(), 0, batches_at_once * batch_words * sizeof(double));
        doubles = reinterpret_cast<double*>(scratch.double_outputs.data());
    }
    scratch.batches.resize(batches_at_once);
    std::vector<const float*> rows(draw.row_count, zero_row);

    for (std::size_t done = 0; done < vertex_count;) {
        std::uint32_t batch_count = 0;
        for (std::size_t next = done; next < vertex_count && batch_count < batches_at_once; ++batch_count) {
            VertexBatch& batch = scratch.batches[batch_count];
            batch.count = static_cast<std::uint32_t>(std::min<std::size_t>(lanes, vertex_count - next));
            for (std::uint32_t lane = 0; lane < max_lanes; ++lane)
                batch.indices[lane] = scratch.indices[next + (lane < batch.count ? lane : 0)];
            batch.instance = segment.instance;
            batch.outputs = outputs + batch_count * batch_words;
            batch.doubles = doubles ? doubles + batch_count * batch_words : nullptr;
            next += batch.count;
        }
        program.run(&draw.context, &draw.vertex, scratch.batches.data(), batch_count);
        for (std::uint32_t i = 0; i < batch_count; ++i) {
            const VertexBatch& batch = scratch.batches[i];
            for (std::size_t input = 0; input < pipeline.input_slots.size(); ++input) {
                const std::uint32_t slot = pipeline.input_slots[input];
                if (slot < output_slots) rows[input] = batch.outputs + static_cast<std::size_t>(slot) * max_lanes;
            }
            const std::size_t byte = first_byte + done * draw.vertex_bytes;
            VertexFinish finish{};
            finish.rows = rows.data();
            finish.row_count = draw.row_count;
            finish.count = batch.count;
            finish.outputs = batch.outputs;
            finish.clip_distances = program.clip_distances;
            finish.cull_distances = program.cull_distances;
            finish.depth_clamp = pipeline.depth_stencil.depth_clamp;
            for (int axis = 0; axis < 3; ++axis) {
                finish.scale[axis] = draw.scale[axis];
                finish.translation[axis] = draw.translation[axis];
            }
            finish.vertices = chunk.vertices.data() + byte;
            finish.vertex_bytes = draw.vertex_bytes;
            finish.first_offset = static_cast<std::uint32_t>(byte / 16);
            finish.setup = scratch.setup.data() + done;
            kernels.finish_vertices(finish);
            for (std::uint32_t lane = 0; batch.doubles && lane < batch.count; ++lane) {
                auto& vertex =
                    *reinterpret_cast<ScreenVertex*>(finish.vertices + std::size_t{lane} * draw.vertex_bytes);
                double* const to = vertex_doubles(vertex, draw.row_count);
                for (std::size_t axis = 0; axis < 4; ++axis)
                    to[axis] = batch.doubles[(slot_position + axis) * max_lanes + lane];
                for (std::size_t input = 0; input < draw.row_count; ++input) {
                    const std::uint32_t slot = input < pipeline.input_slots.size() ? pipeline.input_slots[input] : ~0u;
                    to[4 + input] = slot < output_slots ? batch.doubles[std::size_t{slot} * max_lanes + lane] : 0.0;
                }
            }
            if (is_points && program.writes_point_size)
                std::copy_n(batch.outputs + slot_point_size * max_lanes, batch.count,
                            scratch.point_sizes.begin() + done);
            for (std::uint32_t distance = 0; distance < program.clip_distances; ++distance)
                for (std::uint32_t lane = 0; lane < batch.count; ++lane)
                    scratch.clip_distances[(done + lane) * 8 + distance] =
                        batch.outputs[(slot_clip_distance + distance) * max_lanes + lane];
            done += batch.count;
        }
    }
}

}  // namespace nacre::cpu::raster
