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
inline constexpr std::int32_t regions_across = tile_blocks / region_blocks;
inline constexpr std::int32_t key_lowest = -0x7fffffff - 1, key_highest = 0x7fffffff;

struct TileRun {
    const TileJob& job;
    const TargetSet& targets;
    Workspace& memory;
    std::int32_t tile_x, tile_y, width, height;  ///< Pixels; what of the tile lies in the target.

    const DrawPlan* draw = nullptr;
    std::uint32_t draw_index = ~0u;
    bool depth_loaded = false, depth_changed = false, stencil_loaded = false, stencil_changed = false;
    std::int32_t* depth = nullptr;  ///< Where the draw tests depth.
    std::int32_t* stencil = nullptr;
    float depth_low = 0.0f, depth_high = 1.0f;
    bool simple_depth = false;                        ///< See Coverage::run_simple_blocks.
    bool lowers_depth = false, raises_depth = false;  ///< What the draw writes may leave the bounds of a region there.

    // The record that is drawn.
    const Record* record = nullptr;
    const std::byte* vertex_memory = nullptr;
    const PrimitiveData* primitive = nullptr;
    std::uint32_t next_slot = 0;
    std::uint32_t entered_regions = 0, fetched_regions = 0;  ///< One bit for each region: see enter_region.
    bool front = true;

    // Hierarchical depth: bounds of the depths of each region, and how many blocks were written since they were exact.
    std::int32_t region_low[regions_across * regions_across], region_high[regions_across * regions_across];
    std::uint32_t region_writes[regions_across * regions_across];

    TileRun(const TileJob& of_job, std::uint32_t tile, Workspace& workspace)
        : job(of_job), targets(*of_job.targets), memory(workspace) {
        tile_x = static_cast<std::int32_t>(tile % targets.tiles_x) * tile_size;
        tile_y = static_cast<std::int32_t>(tile / targets.tiles_x) * tile_size;
        const std::int32_t rest_x = static_cast<std::int32_t>(targets.width) - tile_x;
        const std::int32_t rest_y = static_cast<std::int32_t>(targets.height) - tile_y;
        width = rest_x < tile_size ? rest_x : tile_size;
        height = rest_y < tile_size ? rest_y : tile_size;
        for (std::uint32_t sample = 0; sample < most_samples; ++sample) memory.streams[sample].quads = 0;
    }

    // ---- Targets -------------------------------------------------------------------------------------------------

    void bring_in_depth() {
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample) {
            const std::byte* const from = targets.depth + sample * targets.depth_sample_stride +
                                          static_cast<std::size_t>(tile_y) * targets.depth_row_stride;
            if (targets.depth_layout == DepthLayout::unorm16)
                load_pixels<std::uint16_t>(from + static_cast<std::size_t>(tile_x) * 2, targets.depth_row_stride, width,
                                           height, memory.depth[sample]);
            else
                load_pixels<std::uint32_t>(from + static_cast<std::size_t>(tile_x) * 4, targets.depth_row_stride, width,
                                           height, memory.depth[sample]);
        }
        depth_loaded = true;
        for (int region = 0; region < regions_across * regions_across; ++region) {
            region_low[region] = key_lowest, region_high[region] = key_highest;
            region_writes[region] = 255;
        }
    }
    void bring_in_stencil() {
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample)
            load_pixels<std::uint8_t>(targets.stencil + sample * targets.stencil_sample_stride +
                                          static_cast<std::size_t>(tile_y) * targets.stencil_row_stride + tile_x,
                                      targets.stencil_row_stride, width, height, memory.stencil[sample]);
        stencil_loaded = true;
    }

    void finish() {
        flush();
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample) {
            if (depth_changed) {
                std::byte* const to = targets.depth + sample * targets.depth_sample_stride +
                                      static_cast<std::size_t>(tile_y) * targets.depth_row_stride;
                if (targets.depth_layout == DepthLayout::unorm16)
                    store_pixels<std::uint16_t>(to + static_cast<std::size_t>(tile_x) * 2, targets.depth_row_stride,
                                                width, height, memory.depth[sample]);
                else
                    store_pixels<std::uint32_t>(to + static_cast<std::size_t>(tile_x) * 4, targets.depth_row_stride,
                                                width, height, memory.depth[sample]);
            }
            if (stencil_changed)
                store_pixels<std::uint8_t>(targets.stencil + sample * targets.stencil_sample_stride +
                                               static_cast<std::size_t>(tile_y) * targets.stencil_row_stride + tile_x,
                                           targets.stencil_row_stride, width, height, memory.stencil[sample]);
        }
    }

    void begin_draw(std::uint32_t index) {
        flush();
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
        lowers_depth = !keeps_farther(plan.compare), raises_depth = !keeps_nearer(plan.compare);
        simple_depth = targets.samples == 1 && !draw->late_tests && !stencil && !draw->in_double;
        depth_low = plan.clamps ? plan.clamp_low : 0.0f;
        depth_high = plan.clamps ? plan.clamp_high : 1.0f;
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
        const DoublePrimitive& planes = double_primitive(current_primitive(), *draw);
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
        const std::uint32_t region = (place >> 10) * regions_across + (place >> 6 & 3);
        ++region_writes[region];
        if (lowers_depth) region_low[region] = key_lowest;
        if (raises_depth) region_high[region] = key_highest;
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
        std::int32_t lows[16], highs[16];
        store(lows, low), store(highs, high);
        std::int32_t least = lows[0], most = highs[0];
        for (int lane = 1; lane < 16; ++lane) {
            least = lows[lane] < least ? lows[lane] : least;
            most = highs[lane] > most ? highs[lane] : most;
        }
        const std::int32_t region = region_y * regions_across + region_x;
        region_low[region] = least, region_high[region] = most, region_writes[region] = 0;
    }

    /// Whether no sample of the record in pixels [x0, x1] x [y0, y1] of the tile, all in one region, passes the depth
    /// test. Floating-point addition and multiplication keep order, so the formula of depth is largest and smallest in
    /// the corners, bit for bit.
    bool hidden(std::int32_t region_x, std::int32_t region_y, std::int32_t x0, std::int32_t x1, std::int32_t y0,
                std::int32_t y1) {
        const std::int32_t region = region_y * regions_across + region_x;
        if (region_writes[region] > 16) measure_region(region_x, region_y);
        const rhi::CompareOperation operation = draw->depth_stencil.compare;
        const bool nearer = keeps_nearer(operation);
        const float inset = targets.samples == 1 ? 0.5f : 0.125f;
        const bool right = (record->depth_dx < 0.0f) == nearer, lower = (record->depth_dy < 0.0f) == nearer;
        const float x = static_cast<float>(tile_x + (right ? x1 : x0)) + (right ? 1.0f - inset : inset);
        const float y = static_cast<float>(tile_y + (lower ? y1 : y0)) + (lower ? 1.0f - inset : inset);
        const std::int32_t key = depth_key(targets.depth_layout, depth_at(x, y), depth_low, depth_high);
        switch (operation) {
            case rhi::CompareOperation::less: return key >= region_high[region];
            case rhi::CompareOperation::less_or_equal: return key > region_high[region];
            case rhi::CompareOperation::greater: return key <= region_low[region];
            default: return key < region_low[region];
        }
    }

    // ---- Fragments -----------------------------------------------------------------------------------------------

    void begin_record(const Record& next, const std::byte* vertices) {
        if (next.draw() != draw_index) begin_draw(next.draw());
        record = &next;
        vertex_memory = vertices;
        primitive = nullptr;
        front = (next.bits & Record::front_facing) != 0;
    }

    const PrimitiveData& current_primitive() {
        if (!primitive) {
            auto* const slot = reinterpret_cast<PrimitiveData*>(
                memory.primitives + static_cast<std::size_t>(next_slot) * draw->primitive_bytes);
            next_slot = (next_slot + 1) % primitive_slots;
            set_up_primitive(*draw, *record, vertex_memory, *slot);
            if (draw->in_double) set_up_double_primitive(*draw, targets.depth_layout, *record, vertex_memory, *slot);
            primitive = slot;
        }
        return *primitive;
    }

    /// Asks for the lines of the color targets in a region that is drawn to for the first time, and in the one behind
    /// it, which is likely to follow: stores would wait for them one after another otherwise.
    [[gnu::noinline]] void enter_region(std::uint32_t region) {
        entered_regions |= 1u << region;
        if (targets.samples > 1) return;
        for (std::uint32_t next = region; next < region + 2 && next < regions_across * regions_across; ++next) {
            if (fetched_regions >> next & 1) continue;
            fetched_regions |= 1u << next;
            const std::int32_t x = static_cast<std::int32_t>(next % regions_across) * 16;
            const std::int32_t y = static_cast<std::int32_t>(next / regions_across) * 16;
            if (x >= width) continue;
            const std::int32_t rows = height - y < 16 ? height - y : 16;
            for (std::uint32_t i = 0; i < draw->color_count; ++i) {
                const ColorTarget& target = targets.colors[draw->colors[i].target];
                const std::byte* line = target.data + static_cast<std::size_t>(tile_y + y) * target.row_stride +
                                        static_cast<std::size_t>(tile_x + x) * target.texel_bytes;
                for (std::int32_t row = 0; row < rows; ++row, line += target.row_stride)
                    for (std::uint32_t byte = 0; byte < 16 * target.texel_bytes; byte += 64)
                        __builtin_prefetch(line + byte, 1);
            }
        }
    }

    /// The quads of a block of 4x4 pixels.
    /// @param live     pixels, 16 bits
    /// @param covered  for each pixel the samples that the primitive covers; null with one sample
    /// @param alive    and those that passed the tests so far
    [[gnu::always_inline]] void append_block(std::uint32_t stream_index, std::int32_t x, std::int32_t y,
                                             std::uint32_t place, std::uint32_t live, const std::uint8_t* covered,
                                             const std::uint8_t* alive) {
        Stream& stream = memory.streams[stream_index];
        if (stream.quads + 4 > stream_quads) flush_stream(stream_index);
        const std::uint32_t region = (place >> 10) * regions_across + (place >> 6 & 3);
        if ((entered_regions >> region & 1) == 0) enter_region(region);
        const PrimitiveData* const from = &current_primitive();
        std::uint32_t next = stream.quads;
        for (std::uint32_t quad = 0; quad < 4; ++quad) {
            const std::uint32_t pixels = live >> (4 * quad) & 15;
            stream.primitives[next] = from;
            stream.x[next] = x + 2 * static_cast<std::int32_t>(quad & 1);
            stream.y[next] = y + 2 * static_cast<std::int32_t>(quad >> 1);
            stream.live[next] = pixels;
            stream.places[next] = place + 4 * quad;
            if (covered) {
                std::memcpy(stream.covered[next], covered + 4 * quad, 4);
                std::memcpy(stream.alive[next], alive + 4 * quad, 4);
            }
            next += pixels != 0;
        }
        stream.quads = next;
    }

    void flush() {
        for (std::uint32_t sample = 0; sample < targets.samples; ++sample)
            if (memory.streams[sample].quads != 0) flush_stream(sample);
    }

    void flush_stream(std::uint32_t stream_index) {
        Stream& stream = memory.streams[stream_index];
        const std::uint32_t quads_in_batch = job.lanes / 4;
        const std::uint32_t count = (stream.quads + quads_in_batch - 1) / quads_in_batch;
        for (std::uint32_t quad = stream.quads; quad % quads_in_batch != 0; ++quad) {
            stream.primitives[quad] = stream.primitives[0];
            stream.x[quad] = stream.x[0], stream.y[quad] = stream.y[0];
            stream.places[quad] = stream.places[0];
            stream.live[quad] = 0;
            std::memset(stream.covered[quad], 0, 4), std::memset(stream.alive[quad], 0, 4);
        }
        for (std::uint32_t i = 0; i < count; ++i)
            fill_batch(memory.batches[i], stream, stream_index, i * quads_in_batch, quads_in_batch);
        draw->fragment(draw->context, memory.batches, count);
        for (std::uint32_t i = 0; i < count; ++i) {
            if (draw->plain_results)
                write_plain(memory.batches[i], stream.places + i * quads_in_batch, quads_in_batch);
            else
                resolve(memory.batches[i], stream, stream_index, i * quads_in_batch, quads_in_batch);
        }
        stream.quads = 0;
    }

    [[gnu::always_inline]] void fill_batch(FragmentBatch& batch, const Stream& stream, std::uint32_t stream_index,
                                           std::uint32_t first, std::uint32_t quads) {
        std::memcpy(batch.primitives, stream.primitives + first, sizeof(batch.primitives));
        std::memcpy(batch.x, stream.x + first, sizeof(batch.x));
        std::memcpy(batch.y, stream.y + first, sizeof(batch.y));
        batch.live = 0;
        for (std::uint32_t quad = 0; quad < max_quads; ++quad)
            batch.live |= quad < quads ? stream.live[first + quad] << (4 * quad) : 0;
        batch.sample_index = stream_index;
        batch.doubles = memory.doubles ? memory.doubles + (&batch - memory.batches) : nullptr;
        const bool single = draw->runs_per_sample;
        batch.sample_x = single ? static_cast<float>(sample_offset_x[stream_index]) / subpixels : 0.5f;
        batch.sample_y = single ? static_cast<float>(sample_offset_y[stream_index]) / subpixels : 0.5f;
        store(batch.sample_mask_in, ints(single ? 1 << stream_index : 1));
        if (draw->uses_centroid)
            store(batch.centroid_x, floats(batch.sample_x)), store(batch.centroid_y, floats(batch.sample_y));
        if (targets.samples == 1 || single) return;
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

    /// The frequent case of `resolve`: one sample, tested before, nothing blended.
    void write_plain(const FragmentBatch& batch, const std::uint32_t* places, std::uint32_t quads) {
        const std::uint32_t live = batch.live;
        // Quads of unfilled batches repeat others, without a live pixel.
        bool inside = width % 2 == 0 && height % 2 == 0, block = quads == 4 && live == 0xffff && places[0] % 16 == 0;
        for (std::uint32_t quad = 0; quad < quads; ++quad) block = block && places[quad] == places[0] + 4 * quad;
        alignas(64) std::uint32_t keep[16];
        store(keep, select(lanes_of(live), ints(0), ints(-1)));
        std::size_t offsets[4] = {};
        std::uint32_t row_stride = 0, texel_bytes = 0;
        for (std::uint32_t i = 0; i < draw->color_count; ++i) {
            const ColorPlan& plan = draw->colors[i];
            const ColorTarget& target = targets.colors[plan.target];
            alignas(64) std::uint32_t packed[4][16];
            const std::uint32_t(*words)[16] = batch.colors[plan.output];
            if (!plan.as_it_is) {
                pack_colors(plan, target, *job.srgb, batch, packed);
                words = packed;
            }
            // Most targets of a pass have rows of the same size.
            if (target.row_stride != row_stride || target.texel_bytes != texel_bytes) {
                row_stride = target.row_stride, texel_bytes = target.texel_bytes;
                for (std::uint32_t quad = 0; quad < 4; ++quad)
                    offsets[quad] = static_cast<std::size_t>(batch.y[quad]) * row_stride +
                                    static_cast<std::size_t>(batch.x[quad]) * texel_bytes;
            }
            QuadRows rows;
            for (std::uint32_t quad = 0; quad < 4; ++quad) rows.top[quad] = target.data + offsets[quad];
            if (target.texel_bytes == 4 && inside) {
                if (block)
                    store_block_words(rows.top[0], target.row_stride, words[0]);
                else
                    store_words(rows, target.row_stride, quads, words[0], keep);
                continue;
            }
            for (std::uint32_t quad = 0; quad < quads; ++quad)
                if (const std::uint32_t pixels = live >> (4 * quad) & 15)
                    store_quad(rows.top[quad], target.row_stride, target.texel_bytes, pixels, words, 4 * quad);
        }
    }

    /// Tests and writes the results of one batch.
    void resolve(const FragmentBatch& batch, const Stream& stream, std::uint32_t stream_index, std::uint32_t first_quad,
                 std::uint32_t quads) {
        const std::uint32_t used = quads == 4 ? 0xffffu : (1u << (4 * quads)) - 1;
        const std::uint32_t live = batch.live & used;
        if (live == 0) return;
        const std::uint32_t* const places = stream.places + first_quad;
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
            write_color(draw->colors[i], batch, masks, first, end, conflict);
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

    void write_color(const ColorPlan& plan, const FragmentBatch& batch, const std::uint32_t (&masks)[most_samples],
                     std::uint32_t first, std::uint32_t end, bool conflict) {
        const ColorTarget& target = targets.colors[plan.target];
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
            QuadRows rows;
            for (std::uint32_t quad = 0; quad < 4; ++quad)
                if (mask >> (4 * quad) & 15)
                    rows.top[quad] = target.data + sample * target.sample_stride +
                                     static_cast<std::size_t>(batch.y[quad]) * target.row_stride +
                                     static_cast<std::size_t>(batch.x[quad]) * target.texel_bytes;
            const auto store_all = [&](std::uint32_t lanes) {
                for (std::uint32_t quad = 0; quad < 4; ++quad)
                    if (const std::uint32_t pixels = lanes >> (4 * quad) & 15)
                        store_quad(rows.top[quad], target.row_stride, target.texel_bytes, pixels, words, 4 * quad);
            };
            if (!reads) {
                store_all(mask);
            } else if (!conflict) {
                blend_colors(*draw, plan, target, *job.srgb, batch, rows, mask, words);
                store_all(mask);
            } else {
                // Several triangles in one pixel of the batch: each must see what the one before left.
                for (std::uint32_t quad = 0; quad < 4; ++quad)
                    if (const std::uint32_t lanes = mask & (15u << (4 * quad))) {
                        blend_colors(*draw, plan, target, *job.srgb, batch, rows, lanes, words);
                        store_all(lanes);
                    }
            }
        }
    }
};

}  // namespace
}  // namespace nacre::cpu::raster
