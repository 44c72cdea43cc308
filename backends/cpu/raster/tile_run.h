// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/double_precision.h"
#include "backends/cpu/raster/primitive_setup.h"
#include "backends/cpu/raster/tile_output.h"
#include "backends/cpu/raster/tile_pixels.h"

/// @file
/// One tile: its pixels, what waits for the fragment function, and what becomes of its results. Internal linkage, as in
/// simd.h.

namespace nacre::cpu::raster {
namespace {

/// Depth comparisons as hierarchical depth sees them.
inline bool keeps_nearer(rhi::CompareOperation operation) {
    return operation == rhi::CompareOperation::less || operation == rhi::CompareOperation::less_or_equal;
}
inline bool keeps_farther(rhi::CompareOperation operation) {
    return operation == rhi::CompareOperation::greater || operation == rhi::CompareOperation::greater_or_equal;
}

inline constexpr std::int32_t region_blocks = 4;  ///< A region of hierarchical depth has 4x4 blocks.
inline constexpr std::int32_t region_size = 4 * region_blocks;
inline constexpr std::int32_t regions_across = tile_blocks / region_blocks;
inline constexpr std::int32_t key_lowest = -0x7fffffff - 1, key_highest = 0x7fffffff;

/// Where the blocks right of, below, and right below of another lie.
constexpr std::uint32_t four_blocks[4] = {0, 16, 16 * tile_blocks, 16 * tile_blocks + 16};

/// The places of the quads of some blocks across and down, from the first of them, block by block; then whatever.
template <int columns, int rows>
struct QuadPlaces {
    alignas(64) std::int32_t at[16];
    constexpr QuadPlaces() : at{} {
        for (int block = 0; block < columns * rows; ++block)
            for (int quad = 0; quad < 4; ++quad)
                at[4 * block + quad] =
                    static_cast<std::int32_t>(four_blocks[2 * (block / columns) + block % columns]) + 4 * quad;
    }
};
template <int columns, int rows>
constexpr QuadPlaces<columns, rows> quad_places;

struct TileRun {
    const TileJob& job;
    const TargetSet& targets;
    Workspace& memory;
    std::int32_t tile_x, tile_y, width, height;  ///< Pixels; what of the tile lies in the target.

    const DrawPlan* draw = nullptr;
    std::uint32_t draw_index = ~0u;
    const bool clears;  ///< Targets that are to be cleared are to be cleared here.
    bool depth_loaded = false, depth_changed = false, stencil_loaded = false, stencil_changed = false;
    std::int32_t* depth = nullptr;  ///< Where the draw tests depth.
    std::int32_t* stencil = nullptr;
    float depth_low = 0.0f, depth_high = 1.0f;
    std::int32_t farthest_key = 0;  ///< Of the depths from 0 to 1.
    bool simple_depth = false;      ///< See Coverage::run_simple_blocks.
    alignas(16)
        std::int32_t limits[4] = {};  ///< Pixels that may be drawn: first x and y, last x and y with all bits turned.

    // What write_plain writes: words of 16 lanes in FragmentBatch::colors, or of packed texels, and where in a block
    // they go.
    struct PlainWord {
        std::uint32_t from, to;
    };
    PlainWord plain_words[8 * 4];
    std::uint32_t plain_from_batch = 0, plain_count = 0;

    // The record that is drawn.
    const Record* record = nullptr;
    const std::byte* vertex_memory = nullptr;
    const PrimitiveData* primitive = nullptr;  ///< Of the record; null: no fragment of it so far.
    const PrimitiveData* tested = nullptr;     ///< The same in a slot that the next record may still get.
    std::uint32_t next_slot = 0;
    // Blocks that wait as a whole, in a draw that lets them. What waits there and in the stream are different blocks.
    bool keeps_whole = false;
    bool fills_later = false;  ///< See unfilled_regions.
    std::uint32_t whole_count = 0;
    std::uint32_t whole_primitives = 0;  ///< Primitives whose first block waited as a whole, since nothing waited.
    std::uint32_t appended_beside = 0;   ///< Blocks appended to the stream since the first whole one waits.
    // One bit for each region: colors that are in the tile's memory, those of all targets that the draw writes, and of
    // each.
    std::uint32_t entered_regions = 0, loaded_regions[8] = {};
    // Blocks that are drawn as a whole need not be filled with what the targets are cleared to before: regions that
    // have blocks of which that is not known yet, and those blocks. None where another draw begins.
    std::uint32_t unfilled_regions = 0;
    std::uint16_t unfilled_blocks[regions_across * regions_across] = {};
    bool front = true;

    // Hierarchical depth: for each region a depth that no other is above, or below. Draws that keep the nearer
    // (farther) depth can leave it as it is; it becomes exact again when the region is measured.
    enum class Bound { none, above, below };
    Bound bound = Bound::none;
    bool depth_is_clear = false;  ///< All depths are TargetSet::clear_depth.
    std::int32_t region_bounds[regions_across * regions_across];
    std::uint8_t region_doubts[regions_across * regions_across];  ///< Questions since a region was measured.
    /// Blocks that were written since their region was measured: a row of the tile each. One more than there are.
    std::uint16_t written_blocks[tile_blocks + 1];

    TileRun(const TileJob& of_job, std::uint32_t tile, Workspace& workspace)
        : job(of_job), targets(*of_job.targets), memory(workspace), clears(of_job.uncleared[tile] != 0) {
        tile_x = static_cast<std::int32_t>(tile % targets.tiles_x) * tile_size;
        tile_y = static_cast<std::int32_t>(tile / targets.tiles_x) * tile_size;
        const std::int32_t rest_x = static_cast<std::int32_t>(targets.width) - tile_x;
        const std::int32_t rest_y = static_cast<std::int32_t>(targets.height) - tile_y;
        width = rest_x < tile_size ? rest_x : tile_size;
        height = rest_y < tile_size ? rest_y : tile_size;
        for (std::uint32_t sample = 0; sample < most_samples; ++sample) memory.streams[sample].quads = 0;
        if (targets.samples > 1) return;
        // The same for all batches.
        const std::uint32_t batches = stream_quads / (job.lanes / 4) + (job.lanes == 16 ? most_whole_blocks : 0);
        for (std::uint32_t i = 0; i < batches; ++i) set_samples(memory.batches[i], 1, 0, false);
    }

    // ---- Targets -------------------------------------------------------------------------------------------------

    [[nodiscard]] TileArea plane_area(std::int32_t (*plane)[tile_pixels], std::uint32_t sample) const {
        return {plane[sample], 16, 16 * tile_blocks, width, height};
    }
    /// Of a target's sample, all or a part of the tile.
    [[nodiscard]] TileArea color_area(const ColorTarget& target, std::uint32_t sample, std::int32_t x, std::int32_t y,
                                      std::int32_t across, std::int32_t down) const {
        const std::uint32_t block_words = targets.color_planes * 16;
        auto* const blocks = reinterpret_cast<std::int32_t*>(colors_at(block_place(x / 4, y / 4))) +
                             static_cast<std::size_t>(target.first_plane + sample * target.words) * 16;
        return {blocks, block_words, block_words * tile_blocks, width - x < across ? width - x : across,
                height - y < down ? height - y : down};
    }
    [[nodiscard]] std::byte* texels_of(const ColorTarget& target, std::uint32_t sample, std::int32_t x,
                                       std::int32_t y) const {
        return target.data + sample * target.sample_stride + static_cast<std::size_t>(tile_y + y) * target.row_stride +
               static_cast<std::size_t>(tile_x + x) * target.texel_bytes;
    }
    /// Where the words of a pixel begin; those of target's sample lie `color_offset` behind, 16 from one to the next.
    [[nodiscard]] std::uint32_t* colors_at(std::uint32_t place) const {
        return memory.colors + static_cast<std::size_t>(place >> 4) * (targets.color_planes * 16) + (place & 15);
    }
    static std::uint32_t color_offset(const ColorTarget& target, std::uint32_t sample) {
        return (target.first_plane + sample * target.words) * 16;
    }
    [[nodiscard]] std::uint32_t depth_bytes() const { return targets.depth_layout == DepthLayout::unorm16 ? 2 : 4; }
    [[nodiscard]] std::byte* depth_texels(std::uint32_t sample) const {
        return targets.depth + sample * targets.depth_sample_stride +
               static_cast<std::size_t>(tile_y) * targets.depth_row_stride +
               static_cast<std::size_t>(tile_x) * depth_bytes();
    }
    [[nodiscard]] std::byte* stencil_texels(std::uint32_t sample) const {
        return targets.stencil + sample * targets.stencil_sample_stride +
               static_cast<std::size_t>(tile_y) * targets.stencil_row_stride + tile_x;
    }

    void bring_in_depth() {
        depth_loaded = true;
        depth_is_clear = clears && targets.depth_clears;
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample)
            if (depth_is_clear)
                fill_pixels(&targets.clear_depth, 1, plane_area(memory.depth, sample));
            else
                load_pixels(depth_bytes(), depth_texels(sample), targets.depth_row_stride,
                            plane_area(memory.depth, sample));
    }
    void bring_in_stencil() {
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample)
            if (clears && targets.stencil_clears)
                fill_pixels(&targets.clear_stencil, 1, plane_area(memory.stencil, sample));
            else
                load_pixels(1, stencil_texels(sample), targets.stencil_row_stride, plane_area(memory.stencil, sample));
        stencil_loaded = true;
    }

    /// The colors of a region, for all targets that the draw writes; it draws there for the first time.
    /// @param later  its blocks may be filled when something is drawn to them
    [[gnu::noinline]] void enter_region(std::uint32_t region, bool later) {
        entered_regions |= 1u << region;
        const std::int32_t x = static_cast<std::int32_t>(region % regions_across) * region_size;
        const std::int32_t y = static_cast<std::int32_t>(region / regions_across) * region_size;
        if (later && fills_later && x + region_size <= width && y + region_size <= height) {
            for (std::uint32_t i = 0; i < draw->color_count; ++i)
                loaded_regions[draw->colors[i].target] |= 1u << region;
            unfilled_regions |= 1u << region;
            unfilled_blocks[region] = 0xffff;
            return;
        }
        for (std::uint32_t i = 0; i < draw->color_count; ++i) {
            const std::uint32_t index = draw->colors[i].target;
            // Targets with doubles are written where they lie.
            if ((loaded_regions[index] >> region & 1) != 0 || targets.colors[index].shadow) continue;
            loaded_regions[index] |= 1u << region;
            const ColorTarget& target = targets.colors[index];
            for (std::uint32_t sample = 0; sample < targets.samples; ++sample) {
                const TileArea area = color_area(target, sample, x, y, region_size, region_size);
                if (clears && target.clears)
                    fill_pixels(target.clear, target.words, area);
                else
                    load_pixels(target.texel_bytes, texels_of(target, sample, x, y), target.row_stride, area);
            }
        }
    }

    /// @param block  of its region
    void fill_block(std::uint32_t region, std::uint32_t block) {
        unfilled_blocks[region] = static_cast<std::uint16_t>(unfilled_blocks[region] & ~(1u << block));
        std::uint32_t* const pixels = colors_at(
            block_place(static_cast<std::int32_t>(region % regions_across * region_blocks + block % region_blocks),
                        static_cast<std::int32_t>(region / regions_across * region_blocks + block / region_blocks)));
        for (std::uint32_t i = 0; i < draw->color_count; ++i) {
            const ColorTarget& target = targets.colors[draw->colors[i].target];
            for (std::uint32_t word = 0; word < target.words; ++word)
                store(pixels + color_offset(target, 0) + 16 * word,
                      ints(static_cast<std::int32_t>(target.clear[word])));
        }
    }
    /// Fills what is left of a region.
    [[gnu::noinline]] void fill_region(std::uint32_t region) {
        unfilled_regions &= ~(1u << region);
        for (std::uint32_t rest = unfilled_blocks[region]; rest != 0; rest &= rest - 1)
            fill_block(region, static_cast<std::uint32_t>(__builtin_ctz(rest)));
    }
    void fill_regions() {
        while (unfilled_regions != 0) fill_region(static_cast<std::uint32_t>(__builtin_ctz(unfilled_regions)));
    }

    /// Writes regions of a target back, or fills them where nothing was drawn and they are to be cleared.
    void store_colors(const ColorTarget& target, std::uint32_t loaded) {
        constexpr std::uint32_t whole_row = (1u << regions_across) - 1;
        for (std::int32_t y = 0; y < height; y += region_size, loaded >>= regions_across)
            for (std::int32_t x = 0; x < width; x += region_size) {
                const bool is_loaded = (loaded >> (x / region_size) & 1) != 0;
                if (!is_loaded && !(clears && target.clears)) continue;
                // A row of the tile at once, where it can be.
                const bool is_whole = (loaded & whole_row) == (is_loaded ? whole_row : 0);
                for (std::uint32_t sample = 0; sample < targets.samples; ++sample) {
                    std::byte* const to = texels_of(target, sample, x, y);
                    const TileArea area =
                        color_area(target, sample, x, y, is_whole ? tile_size : region_size, region_size);
                    if (is_loaded)
                        store_pixels(target.texel_bytes, to, target.row_stride, area, targets.streams_colors);
                    else
                        fill_texels(target.clear, target.texel_bytes, to, target.row_stride, area.width, area.height,
                                    targets.streams_colors);
                }
                if (is_whole) break;
            }
    }

    void finish() {
        flush();
        fill_regions();
        for (std::uint32_t i = 0; i < targets.color_count; ++i)
            if (targets.colors[i].data) store_colors(targets.colors[i], loaded_regions[i]);
        const bool depth_clears = clears && targets.depth_clears, stencil_clears = clears && targets.stencil_clears;
        // Depth goes the way of the colors: what is too large to stay in the caches need not be read into them.
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample) {
            if (depth_changed || (depth_clears && depth_loaded))
                store_pixels(depth_bytes(), depth_texels(sample), targets.depth_row_stride,
                             plane_area(memory.depth, sample), targets.streams_colors);
            else if (depth_clears)
                fill_texels(&targets.clear_depth, depth_bytes(), depth_texels(sample), targets.depth_row_stride, width,
                            height, targets.streams_colors);
            if (stencil_changed || (stencil_clears && stencil_loaded))
                store_pixels(1, stencil_texels(sample), targets.stencil_row_stride, plane_area(memory.stencil, sample),
                             false);
            else if (stencil_clears)
                fill_texels(&targets.clear_stencil, 1, stencil_texels(sample), targets.stencil_row_stride, width,
                            height, false);
        }
        if (targets.streams_colors) end_streams();
    }

    void begin_draw(std::uint32_t index) {
        if (index == draw_index) return;
        flush();
        fill_regions();
        draw_index = index;
        draw = job.draws[index];
        const DepthStencilPlan& plan = draw->depth_stencil;
        depth = stencil = nullptr;
        if (plan.depth_test && targets.depth_layout != DepthLayout::none) {
            if (!depth_loaded) bring_in_depth();
            depth = memory.depth[0];
            if (plan.depth_write) depth_changed = true;
        }
        if (plan.stencil_test && targets.stencil) {
            if (!stencil_loaded) bring_in_stencil();
            stencil = memory.stencil[0];
            stencil_changed = true;
        }
        entered_regions = ~0u;
        for (std::uint32_t i = 0; i < draw->color_count; ++i) entered_regions &= loaded_regions[draw->colors[i].target];
        keeps_whole = draw->plain_results && job.lanes == 16;
        fills_later = keeps_whole && clears;
        for (std::uint32_t i = 0; i < draw->color_count; ++i) {
            const std::uint32_t target = draw->colors[i].target;
            // Some of its regions may be drawn to already.
            fills_later = fills_later && targets.colors[target].clears && loaded_regions[target] == 0;
        }
        if (draw->plain_results) list_plain_words();
        if (depth) note_bounds(plan);
        const auto larger = [](std::int32_t a, std::int32_t b) { return a > b ? a : b; };
        limits[0] = larger(draw->x_begin - tile_x, 0), limits[1] = larger(draw->y_begin - tile_y, 0);
        limits[2] = larger(~(draw->x_end - tile_x - 1), ~(width - 1));
        limits[3] = larger(~(draw->y_end - tile_y - 1), ~(height - 1));
        simple_depth = targets.samples == 1 && !draw->late_tests && !stencil && !draw->in_double;
        depth_low = plan.clamps && plan.clamp_low > 0.0f ? plan.clamp_low : 0.0f;
        depth_high = plan.clamps ? plan.clamp_high : 1.0f;
        farthest_key = depth_key(targets.depth_layout, 1.0f, 0.0f, 1.0f);
    }

    // ---- Depth ---------------------------------------------------------------------------------------------------

    /// The one formula of depth. Its sums are in this order everywhere: depths of one triangle must be equal whatever
    /// draws it.
    [[gnu::always_inline]] Floats depth_at(const Floats& x, const Floats& y) const {
        return floats(record->depth_c) + floats(record->depth_dx) * (x - floats(record->x0)) +
               floats(record->depth_dy) * (y - floats(record->y0));
    }
    [[nodiscard]] float depth_at(float x, float y) const {
        return record->depth_c + record->depth_dx * (x - record->x0) + record->depth_dy * (y - record->y0);
    }
    [[gnu::always_inline]] Ints key_at(const Floats& x, const Floats& y) const {
        return depth_key(targets.depth_layout, depth_at(x, y), depth_low, depth_high);
    }

    /// In double precision: depths of a sample of the pixels of the block at (x, y), clamped, and their keys.
    Ints double_keys(std::int32_t x, std::int32_t y, float offset_x, float offset_y, double (&depths)[16]) {
        const DoublePrimitive& planes = double_primitive(tested_primitive(), *draw);
        alignas(64) float rounded[16];
        for (std::uint32_t lane = 0; lane < 16; ++lane) {
            const double z = raster::depth_at(planes, x + lane_x[lane] + static_cast<double>(offset_x),
                                              y + lane_y[lane] + static_cast<double>(offset_y));
            keep_depth(z, depths[lane], rounded[lane]);
        }
        return depth_key(targets.depth_layout, load(rounded), depth_low, depth_high);
    }
    void keep_depth(double z, double& kept, float& rounded) const {
        kept = z > static_cast<double>(depth_low) ? z : static_cast<double>(depth_low);
        if (kept > static_cast<double>(depth_high)) kept = static_cast<double>(depth_high);
        rounded = static_cast<float>(z);
    }

    /// @param place  of a block, or of a quad in it
    void depth_written(std::uint32_t place) {
        written_blocks[place >> 8] = static_cast<std::uint16_t>(written_blocks[place >> 8] | 1u << (place >> 4 & 15));
    }

    /// What the depths that a draw begins to write mean for the bounds.
    void note_bounds(const DepthStencilPlan& plan) {
        const Bound kept = keeps_nearer(plan.compare)    ? Bound::above
                           : keeps_farther(plan.compare) ? Bound::below
                                                         : Bound::none;
        const bool changes_nothing = !plan.depth_write || plan.compare == rhi::CompareOperation::equal ||
                                     plan.compare == rhi::CompareOperation::never;
        if (kept != bound && (!changes_nothing || draw->hierarchical)) {
            bound = kept;
            for (std::int32_t& at : region_bounds)
                at = depth_is_clear          ? static_cast<std::int32_t>(targets.clear_depth)
                     : bound == Bound::above ? key_highest
                                             : key_lowest;
            for (std::uint16_t& row : written_blocks) row = depth_is_clear ? 0 : 0xffff;
            for (std::uint8_t& doubts : region_doubts) doubts = 0;
        }
        if (!changes_nothing) depth_is_clear = false;
    }

    void measure_region(std::int32_t region_x, std::int32_t region_y) {
        Ints low = ints(key_highest), high = ints(key_lowest);
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample)
            for (std::int32_t y = 0; y < region_blocks; ++y)
                for (std::int32_t x = 0; x < region_blocks; ++x) {
                    // Blocks that stick out of the target hold zeros there; they only make the bounds wider.
                    const Ints keys = load(memory.depth[sample] +
                                           block_place(region_x * region_blocks + x, region_y * region_blocks + y));
                    low = minimum(low, keys), high = maximum(high, keys);
                }
        std::int32_t keys[16];
        store(keys, bound == Bound::above ? high : low);
        std::int32_t extreme = keys[0];
        for (const std::int32_t key : keys)
            extreme = bound == Bound::above ? (key > extreme ? key : extreme) : (key < extreme ? key : extreme);
        const std::int32_t region = region_y * regions_across + region_x;
        region_bounds[region] = extreme, region_doubts[region] = 0;
        for (std::int32_t y = 0; y < region_blocks; ++y)
            written_blocks[region_y * region_blocks + y] &= static_cast<std::uint16_t>(~(15u << (4 * region_x)));
    }

    /// Whether something of a record in a region may be hidden: there is a bound that says anything.
    /// @param is_small  one of many triangles in the region: it is not measured for each of them
    [[gnu::always_inline]] bool may_hide(std::int32_t region_x, std::int32_t region_y, bool is_small) {
        const std::int32_t region = region_y * regions_across + region_x;
        const std::uint32_t doubts = ++region_doubts[region];
        if (!is_small || doubts % 32 == 0) {
            std::uint64_t rows;
            std::memcpy(&rows, written_blocks + region_y * region_blocks, sizeof(rows));
            const int blocks = __builtin_popcountll(rows & 0x000f000f000f000full << (4 * region_x));
            // When all of it is new, or when something is and it is asked about often.
            if (blocks == 16 || (blocks != 0 && doubts % 32 == 0)) measure_region(region_x, region_y);
        }
        // Nothing lies before the nearest depth that there is, or behind the farthest.
        const std::int32_t bound_key = region_bounds[region];
        return bound == Bound::above ? bound_key < farthest_key : bound_key > 0;
    }
    /// Whether no sample of the record in pixels [x0, x1] x [y0, y1] of the tile, all in one region, passes the depth
    /// test. Floating-point addition and multiplication keep order, so the formula of depth is largest and smallest in
    /// the corners, bit for bit.
    [[gnu::always_inline]] bool hidden(std::int32_t region_x, std::int32_t region_y, std::int32_t x0, std::int32_t x1,
                                       std::int32_t y0, std::int32_t y1) {
        return may_hide(region_x, region_y, false) &&
               hidden(region_bounds[region_y * regions_across + region_x], x0, x1, y0, y1);
    }
    [[gnu::noinline]] bool hidden(std::int32_t bound_key, std::int32_t x0, std::int32_t x1, std::int32_t y0,
                                  std::int32_t y1) const {
        const rhi::CompareOperation operation = draw->depth_stencil.compare;
        const bool nearer = keeps_nearer(operation);
        const float inset = targets.samples == 1 ? 0.5f : 0.125f;
        const bool right = (record->depth_dx < 0.0f) == nearer, lower = (record->depth_dy < 0.0f) == nearer;
        const float x = static_cast<float>(tile_x + (right ? x1 : x0)) + (right ? 1.0f - inset : inset);
        const float y = static_cast<float>(tile_y + (lower ? y1 : y0)) + (lower ? 1.0f - inset : inset);
        const std::int32_t key = depth_key(targets.depth_layout, depth_at(x, y), depth_low, depth_high);
        switch (operation) {
            case rhi::CompareOperation::less: return key >= bound_key;
            case rhi::CompareOperation::less_or_equal: return key > bound_key;
            case rhi::CompareOperation::greater: return key <= bound_key;
            default: return key < bound_key;
        }
    }

    // ---- Fragments -----------------------------------------------------------------------------------------------

    /// @param next  of the draw that has begun
    void begin_record(const Record& next, const std::byte* vertices) {
        record = &next;
        vertex_memory = vertices;
        primitive = tested = nullptr;
        front = (next.bits & Record::front_facing) != 0;
    }

    /// Of the record: what fragments of it refer to. Has a slot from then on, for as long as they wait.
    const PrimitiveData& current_primitive() {
        if (!primitive) {
            primitive = &tested_primitive();
            next_slot = (next_slot + 1) % primitive_slots;
        }
        return *primitive;
    }

    /// The same for those who only look: what comes to nothing leaves the slot to the next, else a long run of hidden
    /// primitives would write over those whose fragments wait.
    const PrimitiveData& tested_primitive() {
        if (primitive) return *primitive;
        if (!tested) {
            auto* const slot = reinterpret_cast<PrimitiveData*>(
                memory.primitives + static_cast<std::size_t>(next_slot) * draw->primitive_bytes);
            set_up_primitive(*draw, *record, vertex_memory, *slot);
            if (draw->in_double) set_up_double_primitive(*draw, targets.depth_layout, *record, vertex_memory, *slot);
            tested = slot;
        }
        return *tested;
    }

    /// The quads of a block of 4x4 pixels.
    /// @param place    of the block
    /// @param live     pixels, 16 bits
    /// @param covered  for each pixel the samples that the primitive covers; null with one sample
    /// @param alive    and those that passed the tests so far
    [[gnu::always_inline]] void append_block(std::uint32_t stream_index, std::uint32_t place, std::uint32_t live,
                                             const std::uint8_t* covered, const std::uint8_t* alive) {
        const std::uint32_t region = (place >> 10) * regions_across + (place >> 6 & 3);
        if ((entered_regions >> region & 1) == 0) enter_region(region, true);
        const std::uint32_t block = (place >> 6 & 12) + (place >> 4 & 3);
        if (live == 0xffff && keeps_whole && !waits_in_stream(place)) {
            unfilled_blocks[region] = static_cast<std::uint16_t>(unfilled_blocks[region] & ~(1u << block));
            return append_whole(place);
        }
        if ((unfilled_blocks[region] >> block & 1) != 0) fill_block(region, block);
        if (whole_count != 0 && (waits_as_whole(place) || ++appended_beside == most_primitives_beside)) flush_whole();
        Stream& stream = memory.streams[stream_index];
        const PrimitiveData* const from = &current_primitive();
        const std::uint32_t first = stream.quads;
        repeat_pointer<4>(stream.primitives + first, from);
        const std::uint32_t used = append_quads<1, 1>(stream, place, live);
        if (covered) {
            std::uint32_t next = first;
            for (std::uint32_t quad = 0; quad < 4; ++quad) {
                std::memcpy(stream.covered[next], covered + 4 * quad, 4);
                std::memcpy(stream.alive[next], alive + 4 * quad, 4);
                next += used >> quad & 1;
            }
        }
        if (stream.quads >= stream_quads) flush_stream(stream_index, stream_quads);
    }
    /// The same for one or two blocks across and down, with one sample.
    /// @param live     pixels, 16 bits for each block, which may be zero for some
    /// @param regions  one bit for each that they lie in
    template <int columns, int rows>
    [[gnu::always_inline]] void append_blocks(std::uint32_t place, std::uint64_t live, std::uint32_t regions) {
        for (std::uint32_t fresh = regions & (~entered_regions | unfilled_regions); fresh != 0; fresh &= fresh - 1) {
            const auto region = static_cast<std::uint32_t>(__builtin_ctz(fresh));
            if ((unfilled_regions >> region & 1) != 0)
                fill_region(region);
            else
                enter_region(region, false);
        }
        if (whole_count != 0) flush_whole();
        Stream& stream = memory.streams[0];
        const PrimitiveData* const from = &current_primitive();
        repeat_pointer<4 * columns * rows>(stream.primitives + stream.quads, from);
        append_quads<columns, rows>(stream, place, live);
        if (stream.quads >= stream_quads) flush_stream(0, stream_quads);
    }
    template <int count>
    NACRE_LANES_INLINE static void repeat_pointer(const PrimitiveData** to, const PrimitiveData* from) {
        using Pointers [[gnu::vector_size(32)]] = std::uint64_t;
        static_assert(sizeof(from) == 8);
        const Pointers four = Pointers{} + reinterpret_cast<std::uint64_t>(from);
        for (int i = 0; i < count; i += 4) std::memcpy(to + i, &four, sizeof(four));
    }
    /// @return the quads that have a pixel, one bit for each
    template <int columns, int rows>
    NACRE_LANES_INLINE static std::uint32_t append_quads(Stream& stream, std::uint32_t place, std::uint64_t live) {
        const Ints pixels = groups_of_four_bits(live);
        const std::uint32_t used = mask_of(~equal(pixels, ints(0)));
        store_packed(stream.places + stream.quads, used,
                     shift_left<Stream::live_shift>(pixels) +
                         (load(quad_places<columns, rows>.at) + ints(static_cast<std::int32_t>(place))));
        stream.quads += static_cast<std::uint32_t>(__builtin_popcount(used));
        return used;
    }

    // Of draws with one sample whose results are written as they come: which of two different blocks is written first
    // does not matter, and what is drawn to one block keeps its order.

    [[nodiscard]] NACRE_LANES_INLINE bool waits_as_whole(std::uint32_t place) const {
        return (mask_of(equal(load(memory.whole_places), ints(static_cast<std::int32_t>(place)))) &
                ((1u << whole_count) - 1)) != 0;
    }
    [[nodiscard]] NACRE_LANES_INLINE bool waits_in_stream(std::uint32_t place) const {
        const Stream& stream = memory.streams[0];
        const Ints block = ints(static_cast<std::int32_t>(place)), bits = ints(Stream::place_mask & ~15u);
        static_assert(stream_quads == 32);
        const std::uint32_t found = mask_of(equal(load(stream.places) & bits, block)) |
                                    mask_of(equal(load(stream.places + 16) & bits, block)) << 16;
        return (found & ((1u << stream.quads) - 1)) != 0;
    }
    /// A block all of whose pixels are drawn.
    void append_whole(std::uint32_t place) {
        if (whole_count == 0) appended_beside = 0;
        if (!primitive && ++whole_primitives == most_whole_primitives) flush();
        const PrimitiveData* const from = &current_primitive();
        FragmentBatch& batch = memory.batches[stream_quads / max_quads + whole_count];
        for (const PrimitiveData*& of_quad : batch.primitives) of_quad = from;
        const auto quad = static_cast<std::int32_t>(place >> 2);
        store4(batch.x, Int4{0, 2, 0, 2} + ((quad & 60) + tile_x));
        store4(batch.y, Int4{0, 0, 2, 2} + ((quad >> 4 & 60) + tile_y));
        batch.live = 0xffff;
        memory.whole_places[whole_count] = place;
        if (++whole_count == most_whole_blocks) flush_whole();
    }
    [[gnu::noinline]] void flush_whole() {
        FragmentBatch* const batches = memory.batches + stream_quads / max_quads;
        draw->fragment(draw->context, batches, whole_count);
        for (std::uint32_t i = 0; i < whole_count; ++i) {
            std::uint32_t* const pixels = colors_at(memory.whole_places[i]);
            for_plain_words(batches[i],
                            [&](const std::uint32_t* from, std::uint32_t to) { store(pixels + to, load(from)); });
        }
        whole_count = 0;
    }

    void flush() {
        if (whole_count != 0) flush_whole();
        whole_primitives = 0;
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample)
            if (memory.streams[sample].quads != 0) flush_stream(sample, memory.streams[sample].quads);
    }

    /// Runs the fragment function for the first quads: all, or `stream_quads`.
    void flush_stream(std::uint32_t stream_index, std::uint32_t quads) {
        Stream& stream = memory.streams[stream_index];
        const std::uint32_t quads_in_batch = job.lanes / 4;
        const std::uint32_t count = (quads + quads_in_batch - 1) / quads_in_batch;
        for (std::uint32_t quad = quads; quad % quads_in_batch != 0; ++quad) {
            stream.primitives[quad] = stream.primitives[0];
            stream.places[quad] = stream.places[0] & Stream::place_mask;
            std::memset(stream.covered[quad], 0, 4), std::memset(stream.alive[quad], 0, 4);
        }
        alignas(16) std::uint32_t places[stream_quads + 4];
        for (std::uint32_t i = 0; i < count; ++i)
            fill_batch(memory.batches[i], stream, stream_index, i * quads_in_batch, quads_in_batch,
                       places + i * quads_in_batch);
        draw->fragment(draw->context, memory.batches, count);
        for (std::uint32_t i = 0; i < count; ++i) {
            const std::uint32_t first = i * quads_in_batch;
            if (draw->plain_results)
                write_plain(memory.batches[i], places + first, quads_in_batch);
            else
                resolve(memory.batches[i], stream, stream_index, first, places + first, quads_in_batch);
        }
        stream.quads -= quads;
        if (stream.quads == 0) return;
        std::memcpy(stream.primitives, stream.primitives + quads, 16 * sizeof(stream.primitives[0]));
        std::memcpy(stream.places, stream.places + quads, 16 * sizeof(stream.places[0]));
        if (targets.samples == 1) return;
        std::memcpy(stream.covered, stream.covered + quads, 16 * sizeof(stream.covered[0]));
        std::memcpy(stream.alive, stream.alive + quads, 16 * sizeof(stream.alive[0]));
    }

    [[gnu::always_inline]] void fill_batch(FragmentBatch& batch, const Stream& stream, std::uint32_t stream_index,
                                           std::uint32_t first, std::uint32_t quads, std::uint32_t* places) {
        std::memcpy(batch.primitives, stream.primitives + first, sizeof(batch.primitives));
        const Int4 entries = load4(stream.places + first), place = entries & static_cast<int>(Stream::place_mask);
        store4(places, place);
        store4(batch.x, ((place >> 2) & 60) + ((place >> 1) & 2) + tile_x);
        store4(batch.y, ((place >> 6) & 60) + ((place >> 2) & 2) + tile_y);
        const Int4 pixels = (entries >> static_cast<int>(Stream::live_shift)) << Int4{0, 4, 8, 12};
        batch.live = static_cast<std::uint32_t>(pixels[0]);
        for (std::uint32_t quad = 1; quad < quads; ++quad) batch.live |= static_cast<std::uint32_t>(pixels[quad]);
        batch.doubles = memory.doubles ? memory.doubles + (&batch - memory.batches) : nullptr;
        if (targets.samples == 1) return;
        const bool single = draw->runs_per_sample;
        set_samples(batch, targets.samples, stream_index, single);
        if (single) return;
        for (std::uint32_t lane = 0; lane < 4 * quads; ++lane) {
            const std::uint32_t bits = stream.covered[first + lane / 4][lane & 3];
            batch.sample_mask_in[lane] = bits;
            if (draw->uses_centroid && bits != 15 && bits != 0) {
                // The first covered sample stands for the centroid, as the specification allows.
                const int sample = __builtin_ctz(bits);
                batch.centroid_x[lane] = static_cast<float>(sample_offset_x[sample]) / subpixels;
                batch.centroid_y[lane] = static_cast<float>(sample_offset_y[sample]) / subpixels;
            }
        }
    }
    /// Where the invocations of a batch run.
    /// @param single  at the place of that sample
    static void set_samples(FragmentBatch& batch, std::uint32_t samples, std::uint32_t sample, bool single) {
        batch.samples = samples, batch.sample_index = sample;
        batch.sample_x = single ? static_cast<float>(sample_offset_x[sample]) / subpixels : 0.5f;
        batch.sample_y = single ? static_cast<float>(sample_offset_y[sample]) / subpixels : 0.5f;
        store(batch.sample_mask_in, ints(single ? 1 << sample : 1));
        store(batch.centroid_x, floats(batch.sample_x)), store(batch.centroid_y, floats(batch.sample_y));
    }

    /// Calls `copy(from, to)` for each word of a target that the results of a batch go to where nothing is blended: the
    /// words of sixteen lanes, and how many words behind the first one of a pixel they lie.
    template <typename Copy>
    NACRE_LANES_INLINE void for_plain_words(const FragmentBatch& batch, const Copy& copy) {
        alignas(64) std::uint32_t packed[8][4][16];
        if (plain_from_batch != plain_count)
            for (std::uint32_t i = 0; i < draw->color_count; ++i)
                if (const ColorPlan& plan = draw->colors[i]; !plan.as_it_is)
                    pack_colors(plan, targets.colors[plan.target], *job.srgb, batch, packed[i]);
        // What the fragment function has written as it is comes first.
        std::uint32_t i = 0;
        for (; i < plain_from_batch; ++i) copy(&batch.colors[0][0][0] + plain_words[i].from, plain_words[i].to);
        for (; i < plain_count; ++i) copy(&packed[0][0][0] + plain_words[i].from, plain_words[i].to);
    }
    /// The frequent case of `resolve`: one sample, tested before, nothing blended.
    template <int quads>
    void write_plain(const FragmentBatch& batch, const std::uint32_t* places) {
        std::uint32_t* pixels[quads];
        unrolled<quads>([&](auto quad) { pixels[quad.at] = colors_at(places[quad.at]); });
        const std::uint32_t live = batch.live;
        for_plain_words(batch, [&](const std::uint32_t* from, std::uint32_t to) {
            // Quads of unfilled batches repeat others, without a live pixel.
            unrolled<quads>([&](auto quad) {
                store_some4(pixels[quad.at] + to, load4(from + 4 * quad.at), live >> (4 * quad.at) & 15);
            });
        });
    }
    void write_plain(const FragmentBatch& batch, const std::uint32_t* places, std::uint32_t quads) {
        switch (quads) {
            case 1: write_plain<1>(batch, places); break;
            case 2: write_plain<2>(batch, places); break;
            default: write_plain<4>(batch, places); break;
        }
    }
    /// Lists the words that write_plain writes.
    void list_plain_words() {
        plain_count = plain_from_batch = 0;
        for (int part = 0; part < 2; ++part) {
            const bool as_it_is = part == 0;
            for (std::uint32_t i = 0; i < draw->color_count; ++i) {
                const ColorPlan& plan = draw->colors[i];
                if (plan.as_it_is != as_it_is) continue;
                const ColorTarget& target = targets.colors[plan.target];
                for (std::uint32_t word = 0; word < target.words; ++word)
                    plain_words[plain_count++] = {((as_it_is ? plan.output : i) * 4 + word) * 16,
                                                  color_offset(target, 0) + 16 * word};
            }
            if (as_it_is) plain_from_batch = plain_count;
        }
    }

    /// Tests and writes the results of one batch.
    void resolve(const FragmentBatch& batch, const Stream& stream, std::uint32_t stream_index, std::uint32_t first_quad,
                 const std::uint32_t* places, std::uint32_t quads) {
        const std::uint32_t used = quads == 4 ? 0xffffu : (1u << (4 * quads)) - 1;
        const std::uint32_t live = batch.live & used;
        if (live == 0) return;
        const bool several = targets.samples > 1 && !draw->runs_per_sample;
        const std::uint32_t first = several ? 0 : stream_index, end = several ? targets.samples : stream_index + 1;
        bool conflict = false;
        for (std::uint32_t a = 1; a < quads; ++a)
            for (std::uint32_t b = 0; b < a; ++b) conflict |= places[a] == places[b];
        std::uint32_t masks[most_samples] = {};
        std::uint32_t any = 0;
        for (std::uint32_t sample = first; sample < end; ++sample) {
            std::uint32_t mask = live;
            if (several) {
                mask = 0;
                for (std::uint32_t lane = 0; lane < 4 * quads; ++lane)
                    mask |= (stream.alive[first_quad + lane / 4][lane & 3] >> sample & 1u) << lane;
                mask &= live;
            }
            if (draw->writes_sample_mask)
                mask &= ~mask_of(equal(load(batch.sample_mask_out) & ints(1 << sample), ints(0)));
            if (draw->alpha_to_coverage) {
                const float limit = (static_cast<float>(sample) + 0.5f) / static_cast<float>(targets.samples);
                mask &= mask_of(less(floats(limit), floats_of_bits(load(batch.colors[0][3]))));
            }
            if (draw->late_tests && mask) {
                mask = late_test(batch, places, sample, mask, conflict || stencil, quads);
                memory.passed_samples += static_cast<std::uint32_t>(__builtin_popcount(mask));
            }
            masks[sample] = mask;
            any |= mask;
        }
        if (any == 0) return;
        for (std::uint32_t i = 0; i < draw->color_count; ++i)
            write_color(draw->colors[i], batch, places, quads, masks, first, end, conflict);
    }

    std::uint32_t late_test(const FragmentBatch& batch, const std::uint32_t* places, std::uint32_t sample,
                            std::uint32_t mask, bool one_by_one, std::uint32_t quads) {
        if (!depth && !stencil) return mask;
        Ints key = ints(0);
        double exact_depths[16];
        if (depth) {
            alignas(64) float z[16];
            if (draw->in_double) {
                const float offset_x =
                    targets.samples == 1 ? 0.5f : static_cast<float>(sample_offset_x[sample]) / subpixels;
                const float offset_y =
                    targets.samples == 1 ? 0.5f : static_cast<float>(sample_offset_y[sample]) / subpixels;
                for (std::uint32_t lane = 0; lane < 16; ++lane) {
                    const std::uint32_t quad = lane / 4 < quads ? lane / 4 : 0;
                    const double x =
                        batch.x[quad] + static_cast<std::int32_t>(lane & 1) + static_cast<double>(offset_x);
                    const double y =
                        batch.y[quad] + static_cast<std::int32_t>(lane >> 1 & 1) + static_cast<double>(offset_y);
                    const double exact = draw->writes_depth
                                             ? batch.doubles->depth[lane]
                                             : raster::depth_at(double_primitive(*batch.primitives[quad], *draw), x, y);
                    keep_depth(exact, exact_depths[lane], z[lane]);
                }
            } else if (draw->writes_depth) {
                std::memcpy(z, batch.depth, sizeof(z));
            } else {
                const float offset_x =
                    targets.samples == 1 ? 0.5f : static_cast<float>(sample_offset_x[sample]) / subpixels;
                const float offset_y =
                    targets.samples == 1 ? 0.5f : static_cast<float>(sample_offset_y[sample]) / subpixels;
                for (std::uint32_t lane = 0; lane < 16; ++lane) {
                    const PrimitiveData& from = *batch.primitives[lane / 4 < quads ? lane / 4 : 0];
                    const std::uint32_t quad = lane / 4 < quads ? lane / 4 : 0;
                    const float x = static_cast<float>(batch.x[quad] + static_cast<std::int32_t>(lane & 1)) + offset_x;
                    const float y =
                        static_cast<float>(batch.y[quad] + static_cast<std::int32_t>(lane >> 1 & 1)) + offset_y;
                    z[lane] = from.depth.c + from.depth.dx * (x - from.x0) + from.depth.dy * (y - from.y0);
                }
            }
            key = depth_key(targets.depth_layout, load(z), depth_low, depth_high);
        }
        alignas(64) std::int32_t depths[16] = {}, stencils[16] = {};
        const auto test = [&](std::uint32_t first, std::uint32_t end, std::uint32_t asked) -> std::uint32_t {
            for (std::uint32_t quad = first; quad < end && quad < max_quads; ++quad) {
                if (depth) std::memcpy(depths + 4 * quad, memory.depth[sample] + places[quad], 16);
                if (stencil) std::memcpy(stencils + 4 * quad, memory.stencil[sample] + places[quad], 16);
            }
            const bool faces_front = batch.primitives[first]->front_facing != 0;
            const std::uint32_t passed = test_lanes(draw->depth_stencil, faces_front, key, asked,
                                                    depth ? depths : nullptr, stencil ? stencils : nullptr);
            for (std::uint32_t quad = first; quad < end && quad < max_quads; ++quad) {
                if (depth && draw->depth_stencil.depth_write && (passed >> (4 * quad) & 15) != 0) {
                    std::memcpy(memory.depth[sample] + places[quad], depths + 4 * quad, 16);
                    depth_written(places[quad]);
                    for (std::uint32_t i = 0; draw->in_double && i < 4; ++i)
                        if (passed >> (4 * quad + i) & 1)
                            store_depth(targets, sample, batch.x[quad] + static_cast<std::int32_t>(i & 1),
                                        batch.y[quad] + static_cast<std::int32_t>(i >> 1), exact_depths[4 * quad + i]);
                }
                if (stencil) std::memcpy(memory.stencil[sample] + places[quad], stencils + 4 * quad, 16);
            }
            return passed;
        };
        if (!one_by_one) return test(0, quads, mask);
        std::uint32_t passed = 0;
        for (std::uint32_t quad = 0; quad < quads; ++quad)
            if (const std::uint32_t asked = mask & (15u << (4 * quad))) passed |= test(quad, quad + 1, asked);
        return passed;
    }

    /// Shows what the target holds of lanes, before it is blended with, to those who look for faults.
    void check_destinations(const ColorPlan& plan, const FragmentBatch& batch, const std::uint32_t* places,
                            std::uint32_t quads, std::uint32_t sample, std::uint32_t mask) const {
        const ColorTarget& target = targets.colors[plan.target];
        std::uint32_t old[4][max_lanes] = {};
        for (std::uint32_t lane = 0; lane < 4 * quads; ++lane) {
            if ((mask >> lane & 1) == 0) continue;
            const std::uint32_t* const words = colors_at(places[lane / 4] + (lane & 3)) + color_offset(target, sample);
            for (std::uint32_t word = 0; word < target.words; ++word) old[word][lane] = words[16 * word];
            // Texels with doubles are never brought into the tile.
            if (!draw->in_double || !target.shadow) continue;
            const std::int32_t x = batch.x[lane / 4] + static_cast<std::int32_t>(lane & 1) - tile_x;
            const std::int32_t y = batch.y[lane / 4] + static_cast<std::int32_t>(lane >> 1 & 1) - tile_y;
            for (std::uint32_t word = 0; word < target.words; ++word)
                std::memcpy(&old[word][lane], texels_of(target, sample, x, y) + 4 * word,
                            target.texel_bytes < 4 ? target.texel_bytes : 4);
        }
        draw->check_blend(draw->context->checks, {plan.target, sample, batch.x, batch.y, old, mask});
    }

    void write_color(const ColorPlan& plan, const FragmentBatch& batch, const std::uint32_t* places,
                     std::uint32_t quads, const std::uint32_t (&masks)[most_samples], std::uint32_t first,
                     std::uint32_t end, bool conflict) {
        const ColorTarget& target = targets.colors[plan.target];
        if (plan.reads_destination && draw->check_blend)
            for (std::uint32_t sample = first; sample < end; ++sample)
                if (masks[sample] != 0) check_destinations(plan, batch, places, quads, sample, masks[sample]);
        if (draw->in_double && target.shadow) {
            for (std::uint32_t sample = first; sample < end; ++sample)
                if (masks[sample] != 0) write_double_colors(*draw, plan, target, batch, sample, masks[sample]);
            return;
        }
        alignas(64) std::uint32_t words[4][16];
        const bool reads = plan.blends || plan.partial;
        if (!reads) pack_colors(plan, target, *job.srgb, batch, words);
        for (std::uint32_t sample = first; sample < end; ++sample) {
            const std::uint32_t mask = masks[sample];
            if (mask == 0) continue;
            const std::uint32_t offset = color_offset(target, sample);
            const auto write = [&](std::uint32_t first_quad, std::uint32_t end_quad) {
                if (reads) {
                    alignas(64) std::uint32_t old[4][16] = {};
                    for (std::uint32_t quad = first_quad; quad < end_quad; ++quad)
                        for (std::uint32_t word = 0; word < target.words; ++word)
                            store4(old[word] + 4 * quad, load4(colors_at(places[quad]) + offset + 16 * word));
                    blend_colors(*draw, plan, target, *job.srgb, batch, old, words);
                }
                for (std::uint32_t quad = first_quad; quad < end_quad; ++quad)
                    for (std::uint32_t word = 0; word < target.words; ++word)
                        store_some4(colors_at(places[quad]) + offset + 16 * word, load4(words[word] + 4 * quad),
                                    mask >> (4 * quad) & 15);
            };
            if (!reads || !conflict) {
                write(0, quads);
                continue;
            }
            // Several triangles in one pixel of the batch: each must see what the one before left.
            for (std::uint32_t quad = 0; quad < quads; ++quad)
                if (mask >> (4 * quad) & 15) write(quad, quad + 1);
        }
    }
};

}  // namespace
}  // namespace nacre::cpu::raster
