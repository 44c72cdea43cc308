// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <memory>
#include <new>
#include <vector>

#include "backends/cpu/raster/rasterizer.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// The first half of the rasterizer: primitives of a chunk to records in bins. Chunks are independent of each other and
/// hold their primitives in the order of the draws.

namespace nacre::cpu::raster {

/// Memory that grows, aligned to 64 bytes and without a value at first.
class AlignedMemory {
  public:
    /// Room for `bytes`; the first `kept` bytes stay.
    /// @return whether the memory is a new one
    bool reserve(std::size_t bytes, std::size_t kept) {
        if (bytes <= capacity_) return false;
        const std::size_t capacity = std::max(bytes, capacity_ + capacity_ / 2);
        std::unique_ptr<std::byte, Free> grown(
            static_cast<std::byte*>(::operator new (capacity, std::align_val_t{64})));
        if (kept) std::memcpy(grown.get(), memory_.get(), kept);
        memory_ = std::move(grown);
        capacity_ = capacity;
        return true;
    }
    [[nodiscard]] std::byte* data() const { return memory_.get(); }

  private:
    struct Free {
        void operator()(std::byte* memory) const { ::operator delete (memory, std::align_val_t{64}); }
    };
    std::unique_ptr<std::byte, Free> memory_;
    std::size_t capacity_ = 0;
};

/// A draw that waits. Holds copies of all that its caller may change after `Rasterizer::draw`.
struct QueuedDraw {
    DrawPlan plan{};
    const RasterPipeline* pipeline = nullptr;
    ShaderContext context{};
    alignas(64) std::byte push_constants[push_constant_capacity]{};
    VertexDraw vertex{};
    DrawCall call{};
    std::vector<std::int32_t> input_masks;  ///< Behind DrawPlan::linear_masks and flat_masks.
    std::uint32_t row_count = 0;            ///< Fragment inputs, padded to a multiple of four.
    std::uint32_t vertex_bytes = 0;         ///< Of a ScreenVertex with them.
    float scale[3]{}, translation[3]{};     ///< Viewport.
    DepthLayout depth_layout = DepthLayout::none;
    std::uint32_t samples = 1;
};

/// Consecutive primitives of one instance of a draw.
struct Segment {
    std::uint32_t draw = 0;
    std::uint32_t instance = 0;  ///< gl_InstanceIndex
    std::uint32_t first_primitive = 0, primitive_count = 0;
};

struct Chunk {
    std::vector<Segment> segments;
    std::uint32_t primitive_count = 0;

    // Results.
    std::vector<Record> records;
    AlignedMemory vertices;
    std::size_t vertex_bytes = 0;
    std::vector<std::uint32_t> bin_offsets, bins, large;
};

/// What one thread needs to build chunks; its content does not matter between two of them.
struct ChunkScratch {
    struct BinEntry {
        std::uint32_t tile, record;
    };
    struct CacheEntry {
        std::uint32_t index, local, generation;
    };
    std::vector<BinEntry> entries;
    std::vector<SetupVertex> setup;
    std::vector<float> point_sizes;
    std::vector<std::uint32_t> indices;  ///< Of each different vertex of the segment.
    std::vector<std::uint32_t> locals;   ///< For each element of the segment its place in `indices`.
    std::vector<std::uint32_t> list;     ///< Those of a strip, as a list of triangles.
    std::vector<std::uint32_t> places;   ///< Into `indices`, for each index from the lowest on.
    std::vector<CacheEntry> cache;
    std::uint32_t generation = 0;
    std::vector<VertexBatch> batches;
    AlignedMemory outputs, double_outputs;
    /// Clip and cull distances of the segment's vertices, 8 each, where the program has any clip distance.
    std::vector<float> clip_distances;
};

/// Vertices, set-up and bins of `chunk`.
void build_chunk(Chunk& chunk, const std::vector<std::unique_ptr<QueuedDraw>>& draws, const TargetSet& targets,
                 const Kernels& kernels, std::uint32_t lanes, ChunkScratch& scratch);

/// Number of primitives of a draw of `count` vertices.
std::uint32_t primitives_of(rhi::Topology topology, std::uint32_t count);

}  // namespace nacre::cpu::raster
