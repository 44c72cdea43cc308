// SPDX-License-Identifier: Apache-2.0
// Compiled once for each instruction set, with NACRE_RASTER_KERNELS as the name of the result. Nothing here may have
// external linkage but that name, and nothing from the standard library may be called that is not inlined for certain.
#include "backends/cpu/raster/tile_coverage.h"
#include "backends/cpu/raster/triangle_lanes.h"
#include "backends/cpu/raster/vertex_lanes.h"

namespace nacre::cpu::raster {
namespace {

/// What is no small triangle.
[[gnu::noinline]] void draw_record(TileRun& run) {
    if (run.record->bits & Record::thin_line)
        ThinLine{Coverage<false>(run)}.draw();
    else if (run.targets.samples > 1)
        Coverage<true>(run).draw_triangle();
    else
        Coverage<false>(run).draw_triangle();
}

/// Records of the tile in their order, some at a time: their memory is asked for before it is needed.
struct Queue {
    static constexpr std::uint32_t capacity = 64, ahead = 4;
    const Record* records[capacity];
    const std::byte* vertices[capacity];
    std::uint32_t count = 0;

    void push(TileRun& run, const Record& record, const std::byte* vertex_memory) {
        __builtin_prefetch(&record);
        records[count] = &record, vertices[count] = vertex_memory;
        if (++count == capacity) drain(run);
    }
    void drain(TileRun& run) {
        SmallTriangles small;
        small.small = small.drawn = 0;
        for (std::uint32_t first = 0; first < count;) {
            // Up to sixteen of a draw.
            const std::uint32_t draw = records[first]->draw();
            std::uint32_t end = first + 1;
            while (end < count && end < first + 16 && records[end]->draw() == draw) ++end;
            run.begin_draw(draw);
            if (run.targets.samples == 1) small.prepare(run, records + first, end - first);
            for (std::uint32_t i = first; i < end; ++i) {
                if (i + ahead < count && run.draw->shades)
                    for (int corner = 0; corner < 3; ++corner)
                        __builtin_prefetch(vertices[i + ahead] +
                                           static_cast<std::size_t>(records[i + ahead]->vertex[corner]) * 16);
                const std::uint32_t lane = i - first;
                run.begin_record(*records[i], vertices[i]);
                if ((small.small >> lane & 1) == 0 || (records[i]->bits & Record::thin_line) != 0)
                    draw_record(run);
                else if (small.drawn >> lane & 1)
                    Coverage<false>(run).draw_small(small, lane);
            }
            first = end;
        }
        count = 0;
    }
};

void draw_tile(const TileJob& job, std::uint32_t tile, Workspace& workspace) {
    TileRun run(job, tile, workspace);
    Queue queue;
    const std::uint64_t* const words = job.tile_chunks + std::size_t{tile} * job.chunk_words;
    for (std::uint32_t word = 0; word < job.chunk_words; ++word)
        for (std::uint64_t rest = words[word]; rest != 0; rest &= rest - 1) {
            const ChunkView& chunk = job.chunks[64 * word + static_cast<std::uint32_t>(__builtin_ctzll(rest))];
            const std::uint32_t* bin = nullptr;
            const std::uint32_t* bin_end = nullptr;
            if (chunk.bin_offsets)
                bin = chunk.bins + chunk.bin_offsets[tile], bin_end = chunk.bins + chunk.bin_offsets[tile + 1];
            const std::uint32_t* large = chunk.large;
            const std::uint32_t* const large_end = large + chunk.large_count;
            while (bin != bin_end || large != large_end) {
                const bool from_bin = large == large_end || (bin != bin_end && *bin < *large);
                queue.push(run, chunk.records[from_bin ? *bin++ : *large++], chunk.vertices);
            }
        }
    queue.drain(run);
    run.finish();
}

}  // namespace

extern const Kernels NACRE_RASTER_KERNELS;
const Kernels NACRE_RASTER_KERNELS = {NACRE_RASTER_NAME, finish_vertices, set_up_triangles, draw_tile};

}  // namespace nacre::cpu::raster
