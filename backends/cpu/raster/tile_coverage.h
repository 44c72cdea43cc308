// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/tile_run.h"

/// @file
/// Which pixels and samples of a tile a triangle or line covers. Internal linkage, as in simd.h.
///
/// Edge functions are exact: E(x, y) = A * (x - x0) + B * (y - y0) in 64 bits with 8 subpixel bits on each side, less
/// one for edges whose own pixels belong to the neighbor (top-left rule). Samples lie a whole number of pixels apart,
/// so that the low 8 bits of E, which are the same in all of them, can be cut off (rounding down keeps the sign), and
/// the rest fits 32 bits wherever the edge crosses the tile. Small triangles, which are at most 32 pixels long both
/// ways, need no more than 32 bits for all of it.

namespace nacre::cpu::raster {
namespace {

/// Lanes of a block whose x (y) is at least, or at most, the index.
constexpr std::uint32_t lanes_from_x[4] = {0xffff, 0xfafa, 0xf0f0, 0xa0a0},
                        lanes_to_x[4] = {0x0505, 0x0f0f, 0x5f5f, 0xffff};
constexpr std::uint32_t lanes_from_y[4] = {0xffff, 0xffcc, 0xff00, 0xcc00},
                        lanes_to_y[4] = {0x0033, 0x00ff, 0x33ff, 0xffff};

/// Lanes of block (x, y) inside of the pixels [x0, x1] x [y0, y1] of the tile; the block has some.
NACRE_LANES_INLINE std::uint32_t lanes_inside(std::int32_t block_x, std::int32_t block_y, std::int32_t x0,
                                              std::int32_t x1, std::int32_t y0, std::int32_t y1) {
    const std::int32_t left = x0 - 4 * block_x, right = x1 - 4 * block_x;
    const std::int32_t top = y0 - 4 * block_y, bottom = y1 - 4 * block_y;
    std::uint32_t lanes = 0xffff;
    if (left > 0) lanes &= lanes_from_x[left];
    if (right < 3) lanes &= lanes_to_x[right];
    if (top > 0) lanes &= lanes_from_y[top];
    if (bottom < 3) lanes &= lanes_to_y[bottom];
    return lanes;
}

/// What sixteen records of a draw are in a tile, if they are triangles: bounds, edges, and whether they are small
/// enough for 32 bits to hold all of that.
struct SmallTriangles {
    alignas(64) std::int32_t first_x[16], first_y[16], last_x[16],
        last_y[16];  ///< Pixels of the tile that may be drawn.
    /// Edge functions: what they change by from pixel to pixel, and their values in the first pixel of the tile and of
    /// the block that holds (first_x, first_y).
    alignas(64) std::int32_t along_x[3][16], along_y[3][16], at_tile[3][16], at_block[3][16];
    std::uint32_t small;  ///< One bit for each record. What is said of the others does not hold.
    std::uint32_t drawn;  ///< They have pixels that may be drawn.
    std::uint32_t cut;    ///< Blocks of the tile hold others too.

    void prepare(const TileRun& run, const Record* const* records, std::uint32_t count) {
        Ints words[2][4];
        unrolled<2>([&](auto row) {
            load_rows(
                [&](int lane) {
                    const std::uint32_t from = static_cast<std::uint32_t>(lane) < count ? lane : 0;
                    return reinterpret_cast<const std::byte*>(records[from]) + 16 * row.at;
                },
                words[row.at]);
        });
        static_assert(offsetof(Record, x) == 0 && offsetof(Record, y) == 12);
        // From the center of the tile's first pixel.
        const Ints center_x = ints(run.tile_x * subpixels + subpixels / 2);
        const Ints center_y = ints(run.tile_y * subpixels + subpixels / 2);
        const Ints x[3] = {words[0][0] - center_x, words[0][1] - center_x, words[0][2] - center_x};
        const Ints y[3] = {words[0][3] - center_y, words[1][0] - center_y, words[1][1] - center_y};
        const auto bounds = [&](const Ints(&at)[3], std::int32_t begin, std::int32_t turned_last, Ints& low, Ints& high,
                                Lanes& is_small, Lanes& is_whole) {
            const Ints first =
                shift_right_signed<subpixel_bits>(minimum(minimum(at[0], at[1]), at[2]) + ints(subpixels - 1));
            const Ints last = shift_right_signed<subpixel_bits>(maximum(maximum(at[0], at[1]), at[2]));
            is_small = less(last - first, ints(32));
            low = maximum(first, ints(begin)), high = minimum(last, ints(~turned_last));
            // What lies behind the borders of the tile is in none of its blocks.
            const Lanes all = lanes_of(0xffff);
            is_whole = (begin == 0 ? all : equal(first, low)) &
                       (~turned_last == tile_size - 1 ? all : equal(last, high));
        };
        Ints low_x, high_x, low_y, high_y;
        Lanes small_x, small_y, whole_x, whole_y;
        bounds(x, run.limits[0], run.limits[2], low_x, high_x, small_x, whole_x);
        bounds(y, run.limits[1], run.limits[3], low_y, high_y, small_y, whole_y);
        small = mask_of(small_x & small_y);
        cut = mask_of(~(whole_x & whole_y));
        drawn = mask_of(~(less(high_x, low_x) | less(high_y, low_y)));
        store(first_x, low_x), store(last_x, high_x), store(first_y, low_y), store(last_y, high_y);
        const Ints block_x = low_x & ints(~3), block_y = low_y & ints(~3);
        for (int i = 0; i < 3; ++i) {
            const int next = i == 2 ? 0 : i + 1;
            const Ints edge_a = y[i] - y[next], edge_b = x[next] - x[i];
            const Lanes owns_border = less(ints(0), edge_a) | (equal(edge_a, ints(0)) & less(ints(0), edge_b));
            const Ints value = shift_right_signed<subpixel_bits>(select(owns_border, ints(0), ints(-1)) -
                                                                 edge_a * x[i] - edge_b * y[i]);
            store(along_x[i], edge_a), store(along_y[i], edge_b), store(at_tile[i], value);
            store(at_block[i], value + edge_a * block_x + edge_b * block_y);
        }
    }
};

template <bool multisampled>
struct Coverage {
    static constexpr std::uint32_t samples = multisampled ? 4 : 1;

    TileRun& run;
    // Edges that cross the tile inside of the triangle's bounds; the others are inside everywhere there.
    std::int32_t a[4], b[4], e[samples][4];
    std::uint32_t edges = 0;
    std::int32_t x0, x1, y0, y1;  ///< Pixels of the tile, inclusive.
    bool bounded = false;         ///< Blocks may stick out of these without an edge that says so.

    explicit Coverage(TileRun& of_run) : run(of_run) {}

    /// @return whether anything may be covered
    bool set_up() {
        const Record& record = *run.record;
        std::int32_t low_x = record.x[0], high_x = record.x[0], low_y = record.y[0], high_y = record.y[0];
        for (int i = 1; i < 3; ++i) {
            low_x = record.x[i] < low_x ? record.x[i] : low_x, high_x = record.x[i] > high_x ? record.x[i] : high_x;
            low_y = record.y[i] < low_y ? record.y[i] : low_y, high_y = record.y[i] > high_y ? record.y[i] : high_y;
        }
        constexpr std::int32_t first = multisampled ? 32 : 128, last = multisampled ? 224 : 128;
        x0 = ((low_x - last + subpixels - 1) >> subpixel_bits) - run.tile_x;
        x1 = ((high_x - first) >> subpixel_bits) - run.tile_x;
        y0 = ((low_y - last + subpixels - 1) >> subpixel_bits) - run.tile_y;
        y1 = ((high_y - first) >> subpixel_bits) - run.tile_y;
        const DrawPlan& draw = *run.draw;
        const auto cut = [&](std::int32_t& low, std::int32_t& high, std::int32_t begin, std::int32_t end,
                             std::int32_t size) {
            begin = begin > 0 ? begin : 0, end = end < size ? end : size;
            if (low < begin) low = begin, bounded = bounded || begin > 0;
            if (high >= end) high = end - 1, bounded = bounded || end < tile_size;
        };
        cut(x0, x1, draw.x_begin - run.tile_x, draw.x_end - run.tile_x, run.width);
        cut(y0, y1, draw.y_begin - run.tile_y, draw.y_end - run.tile_y, run.height);
        if (x0 > x1 || y0 > y1) return false;

        for (int i = 0; i < 3; ++i) {
            const int next = i == 2 ? 0 : i + 1;
            const std::int32_t edge_a = record.y[i] - record.y[next], edge_b = record.x[next] - record.x[i];
            // Clockwise on the screen: left edges go up, top edges go right.
            const bool owns_border = edge_a > 0 || (edge_a == 0 && edge_b > 0);
            std::int64_t values[samples];
            std::int64_t low = 0, high = 0;
            for (std::uint32_t s = 0; s < samples; ++s) {
                const std::int64_t x = run.tile_x * subpixels + (multisampled ? sample_offset_x[s] : subpixels / 2);
                const std::int64_t y = run.tile_y * subpixels + (multisampled ? sample_offset_y[s] : subpixels / 2);
                values[s] =
                    (edge_a * (x - record.x[i]) + edge_b * (y - record.y[i]) - (owns_border ? 0 : 1)) >> subpixel_bits;
                low = s == 0 || values[s] < low ? values[s] : low;
                high = s == 0 || values[s] > high ? values[s] : high;
            }
            low += static_cast<std::int64_t>(edge_a) * (edge_a < 0 ? x1 : x0) +
                   static_cast<std::int64_t>(edge_b) * (edge_b < 0 ? y1 : y0);
            high += static_cast<std::int64_t>(edge_a) * (edge_a < 0 ? x0 : x1) +
                    static_cast<std::int64_t>(edge_b) * (edge_b < 0 ? y0 : y1);
            if (high < 0) return false;
            if (low >= 0) {
                bounded = true;
                continue;
            }
            a[edges] = edge_a, b[edges] = edge_b;
            for (std::uint32_t s = 0; s < samples; ++s) e[s][edges] = static_cast<std::int32_t>(values[s]);
            ++edges;
        }
        return true;
    }

    /// Edge functions of a row of blocks, block by block.
    template <int edge_count>
    struct Walk {
        Ints values[edge_count > 0 ? edge_count : 1];
        NACRE_LANES_INLINE void next(const Ints* steps) {
            for (int i = 0; i < edge_count; ++i) values[i] = values[i] + steps[i];
        }
        /// Lanes inside of all edges.
        [[nodiscard]] NACRE_LANES_INLINE std::uint32_t covered() const {
            if constexpr (edge_count == 0) return 0xffff;
            Ints inside = values[0];
            for (int i = 1; i < edge_count; ++i) inside = inside | values[i];
            return mask_of(not_negative(inside));
        }
    };
    template <int edge_count>
    [[gnu::always_inline]] Walk<edge_count> walk_from(std::int32_t block_x, std::int32_t block_y,
                                                      std::uint32_t s) const {
        Walk<edge_count> walk;
        for (int i = 0; i < edge_count; ++i)
            walk.values[i] = ints(a[i]) * load(lane_x) + ints(b[i]) * load(lane_y) +
                             ints(e[s][i] + a[i] * (4 * block_x) + b[i] * (4 * block_y));
        return walk;
    }

    /// The frequent case: one sample, depth tested before the fragment function or not at all, no stencil.
    template <int edge_count>
    void run_simple_blocks(std::int32_t first_x, std::int32_t last_x, std::int32_t first_y, std::int32_t last_y) {
        const Record& record = *run.record;
        const DrawPlan& draw = *run.draw;
        const bool shades = draw.shades, tests = run.depth != nullptr, writes = draw.depth_stencil.depth_write;
        const DepthLayout layout = run.targets.depth_layout;
        const Floats plane_c = floats(record.depth_c), plane_dx = floats(record.depth_dx), from_x = floats(record.x0);
        const Floats center_x = to_floats(load(lane_x)) + floats(static_cast<float>(run.tile_x + 4 * first_x) + 0.5f);
        const Floats center_y = to_floats(load(lane_y)) + floats(static_cast<float>(run.tile_y) + 0.5f);
        Walk<edge_count> row = walk_from<edge_count>(first_x, first_y, 0);
        Ints across[edge_count > 0 ? edge_count : 1], down[edge_count > 0 ? edge_count : 1];
        for (int i = 0; i < edge_count; ++i) across[i] = ints(4 * a[i]), down[i] = ints(4 * b[i]);
        std::uint32_t passed = 0;
        for (std::int32_t block_y = first_y; block_y <= last_y; ++block_y, row.next(down)) {
            // As in TileRun::depth_at; what is the same in a row of blocks is computed once.
            const Floats along_y =
                floats(record.depth_dy) * (center_y + floats(static_cast<float>(4 * block_y)) - floats(record.y0));
            Walk<edge_count> walk = row;
            Floats x = center_x;
            for (std::int32_t block_x = first_x; block_x <= last_x;
                 ++block_x, walk.next(across), x = x + floats(4.0f)) {
                std::uint32_t mask = walk.covered();
                if (bounded) mask &= lanes_inside(block_x, block_y, x0, x1, y0, y1);
                if (mask == 0) continue;
                const std::uint32_t place = block_place(block_x, block_y);
                if (tests) {
                    const Ints key =
                        depth_key(layout, plane_c + plane_dx * (x - from_x) + along_y, run.depth_low, run.depth_high);
                    std::int32_t* const depth = run.memory.depth[0] + place;
                    const Ints old = load(depth);
                    const Lanes passes = lanes_of(mask) & compare(draw.depth_stencil.compare, key, old);
                    mask = mask_of(passes);
                    if (writes) store(depth, select(passes, key, old));
                    if (writes && mask != 0) run.depth_written(place);
                    if (mask == 0) continue;
                }
                passed += static_cast<std::uint32_t>(__builtin_popcount(mask));
                if (shades) run.append_block(0, place, mask, nullptr, nullptr);
            }
        }
        run.memory.passed_samples += passed;
    }

    template <int edge_count>
    void run_blocks(std::int32_t first_x, std::int32_t last_x, std::int32_t first_y, std::int32_t last_y) {
        if constexpr (!multisampled) {
            if (run.simple_depth) {
                run_simple_blocks<edge_count>(first_x, last_x, first_y, last_y);
                return;
            }
        }
        Ints across[edge_count > 0 ? edge_count : 1];
        for (int i = 0; i < edge_count; ++i) across[i] = ints(4 * a[i]);
        for (std::int32_t block_y = first_y; block_y <= last_y; ++block_y) {
            Walk<edge_count> walks[samples];
            for (std::uint32_t s = 0; s < samples; ++s) walks[s] = walk_from<edge_count>(first_x, block_y, s);
            for (std::int32_t block_x = first_x; block_x <= last_x; ++block_x) {
                const std::uint32_t limit = bounded ? lanes_inside(block_x, block_y, x0, x1, y0, y1) : 0xffff;
                std::uint32_t masks[samples];
                std::uint32_t any = 0;
                for (std::uint32_t s = 0; s < samples; ++s) {
                    masks[s] = limit & walks[s].covered();
                    walks[s].next(across);
                    any |= masks[s];
                }
                if (any) shade_block(block_x, block_y, masks);
            }
        }
    }
    void run_blocks(std::uint32_t edge_count, std::int32_t first_x, std::int32_t last_x, std::int32_t first_y,
                    std::int32_t last_y) {
        switch (edge_count) {
            case 0: run_blocks<0>(first_x, last_x, first_y, last_y); break;
            case 1: run_blocks<1>(first_x, last_x, first_y, last_y); break;
            case 2: run_blocks<2>(first_x, last_x, first_y, last_y); break;
            default: run_blocks<3>(first_x, last_x, first_y, last_y); break;
        }
    }

    /// Small triangles with one sample: nothing is asked about them that a few blocks would not answer as fast.
    [[gnu::always_inline]] void draw_small(const SmallTriangles& from, std::uint32_t lane) {
        x0 = from.first_x[lane], x1 = from.last_x[lane], y0 = from.first_y[lane], y1 = from.last_y[lane];
        const DrawPlan& draw = *run.draw;
        const std::int32_t region_x = x0 / 16, region_y = y0 / 16;
        // What lies in one region is hard to guess, whether anything may be hidden is not: it is asked first.
        if (draw.hierarchical && run.depth && run.may_hide(region_x, region_y, true) && region_x == x1 / 16 &&
            region_y == y1 / 16 && run.hidden(run.region_bounds[region_y * regions_across + region_x], x0, x1, y0, y1))
            return;
        bounded = (from.cut >> lane & 1) != 0;
        const std::int32_t left = x0 / 4, right = x1 / 4, top = y0 / 4, bottom = y1 / 4;
        if (run.simple_depth && run.depth && !bounded && right - left <= 1 && bottom - top <= 1) {
            switch (right - left + 2 * (bottom - top)) {
                case 0: run_few_blocks<1, 1>(from, lane, left, top); break;
                case 1: run_few_blocks<2, 1>(from, lane, left, top); break;
                case 2: run_few_blocks<1, 2>(from, lane, left, top); break;
                default: run_few_blocks<2, 2>(from, lane, left, top); break;
            }
            return;
        }
        for (int i = 0; i < 3; ++i)
            a[i] = from.along_x[i][lane], b[i] = from.along_y[i][lane], e[0][i] = from.at_tile[i][lane];
        run_blocks<3>(left, right, top, bottom);
    }

    /// As run_simple_blocks, for one or two blocks across and down and with a depth test: without loops, and with
    /// hardly a branch that the processor could guess wrong.
    template <int columns, int rows>
    [[gnu::always_inline]] void run_few_blocks(const SmallTriangles& from, std::uint32_t lane, std::int32_t first_x,
                                               std::int32_t first_y) {
        constexpr int count = columns * rows;
        const Record& record = *run.record;
        const DrawPlan& draw = *run.draw;
        Ints edges_at[count];
        unrolled<3>([&](auto edge) {
            const Ints along_x = ints(from.along_x[edge.at][lane]), along_y = ints(from.along_y[edge.at][lane]);
            const Ints right = shift_left<2>(along_x), down = shift_left<2>(along_y);
            Ints at[count];
            at[0] = along_x * load(lane_x) + along_y * load(lane_y) + ints(from.at_block[edge.at][lane]);
            if constexpr (columns == 2) at[1] = at[0] + right;
            if constexpr (rows == 2) at[columns] = at[0] + down;
            if constexpr (count == 4) at[3] = at[1] + down;
            unrolled<count>([&](auto block) {
                edges_at[block.at] = edge.at == 0 ? at[block.at] : edges_at[block.at] | at[block.at];
            });
        });
        // As in TileRun::depth_at.
        const Floats x = to_floats(load(lane_x)) + floats(static_cast<float>(run.tile_x + 4 * first_x) + 0.5f);
        const Floats y = to_floats(load(lane_y)) + floats(static_cast<float>(run.tile_y + 4 * first_y) + 0.5f);
        const Floats c = floats(record.depth_c), dx = floats(record.depth_dx), dy = floats(record.depth_dy);
        const Floats from_x = floats(record.x0), from_y = floats(record.y0);
        Floats in_x[columns], in_y[rows];
        in_x[0] = c + dx * (x - from_x), in_y[0] = dy * (y - from_y);
        if constexpr (columns == 2) in_x[1] = c + dx * (x + floats(4.0f) - from_x);
        if constexpr (rows == 2) in_y[1] = dy * (y + floats(4.0f) - from_y);
        const std::uint32_t place = block_place(first_x, first_y);
        std::int32_t* const depth = run.memory.depth[0] + place;
        const DepthLayout layout = run.targets.depth_layout;
        Ints keys[count], old[count];
        unrolled<count>([&](auto block) {
            constexpr int column = block.at % columns, row = block.at / columns;
            keys[block.at] = depth_key(layout, in_x[column] + in_y[row], run.depth_low, run.depth_high);
            old[block.at] = load(depth + four_blocks[2 * row + column]);
        });
        Lanes passes[count];
        const auto test = [&](auto&& comparison) {
            unrolled<count>([&](auto block) {
                passes[block.at] = not_negative(edges_at[block.at]) & comparison(keys[block.at], old[block.at]);
            });
        };
        switch (draw.depth_stencil.compare) {
            case rhi::CompareOperation::less: test([](Ints key, Ints at) { return less(key, at); }); break;
            case rhi::CompareOperation::less_or_equal: test([](Ints key, Ints at) { return ~less(at, key); }); break;
            case rhi::CompareOperation::greater: test([](Ints key, Ints at) { return less(at, key); }); break;
            case rhi::CompareOperation::greater_or_equal: test([](Ints key, Ints at) { return ~less(key, at); }); break;
            case rhi::CompareOperation::equal: test([](Ints key, Ints at) { return equal(key, at); }); break;
            default: test([&](Ints key, Ints at) { return compare(draw.depth_stencil.compare, key, at); }); break;
        }
        std::uint64_t all = 0;
        unrolled<count>(
            [&](auto block) { all |= static_cast<std::uint64_t>(mask_of(passes[block.at])) << (16 * block.at); });
        if (all == 0) return;
        if (draw.depth_stencil.depth_write) {
            unrolled<count>([&](auto block) {
                constexpr int column = block.at % columns, row = block.at / columns;
                store(depth + four_blocks[2 * row + column], select(passes[block.at], keys[block.at], old[block.at]));
            });
            // Of some of them perhaps nothing was, which does no harm.
            for (int row = 0; row < rows; ++row) {
                std::uint16_t& written = run.written_blocks[first_y + row];
                written = static_cast<std::uint16_t>(written | (columns == 2 ? 3u : 1u) << first_x);
            }
        }
        run.memory.passed_samples += static_cast<std::uint32_t>(__builtin_popcountll(all));
        if (!draw.shades) return;
        const auto region_of = [](std::int32_t block) { return block / region_blocks; };
        const std::uint32_t across = 1u << region_of(first_x) | 1u << region_of(first_x + columns - 1);
        const std::uint32_t regions =
            across << regions_across * region_of(first_y) | across << regions_across * region_of(first_y + rows - 1);
        run.append_blocks<columns, rows>(place, all, regions);
    }

    void draw_triangle() {
        if (!set_up()) return;
        const std::int32_t first_x = x0 / 4, last_x = x1 / 4, first_y = y0 / 4, last_y = y1 / 4;
        const bool rejects = run.draw->hierarchical && run.depth;
        const std::int32_t region_x = x0 / 16, region_y = y0 / 16;
        if (region_x == x1 / 16 && region_y == y1 / 16) {
            if (rejects && run.hidden(region_x, region_y, x0, x1, y0, y1)) return;
            run_blocks(edges, first_x, last_x, first_y, last_y);
            return;
        }
        for (std::int32_t y = region_y; y <= y1 / 16; ++y)
            for (std::int32_t x = region_x; x <= x1 / 16; ++x) {
                const std::int32_t left = x * 16 > x0 ? x * 16 : x0, right = x * 16 + 15 < x1 ? x * 16 + 15 : x1;
                const std::int32_t top = y * 16 > y0 ? y * 16 : y0, bottom = y * 16 + 15 < y1 ? y * 16 + 15 : y1;
                // The edges that cross this region, in front of all others.
                Coverage part = *this;
                part.edges = 0;
                bool outside = false;
                for (std::uint32_t i = 0; i < edges; ++i) {
                    std::int32_t low = e[0][i], high = e[0][i];
                    for (std::uint32_t s = 1; s < samples; ++s) {
                        low = e[s][i] < low ? e[s][i] : low, high = e[s][i] > high ? e[s][i] : high;
                    }
                    low += a[i] * (a[i] < 0 ? right : left) + b[i] * (b[i] < 0 ? bottom : top);
                    high += a[i] * (a[i] < 0 ? left : right) + b[i] * (b[i] < 0 ? top : bottom);
                    outside |= high < 0;
                    if (low >= 0) continue;
                    part.a[part.edges] = a[i], part.b[part.edges] = b[i];
                    for (std::uint32_t s = 0; s < samples; ++s) part.e[s][part.edges] = e[s][i];
                    ++part.edges;
                }
                if (outside || (rejects && run.hidden(x, y, left, right, top, bottom))) continue;
                // Not where they are all of their blocks.
                const bool cuts_blocks = ((left | top) & 3) != 0 || (right & bottom & 3) != 3;
                part.bounded = cuts_blocks && (bounded || part.edges < edges);
                part.run_blocks(part.edges, left / 4, right / 4, top / 4, bottom / 4);
            }
    }

    /// @param masks  for each sample the pixels of the block that it covers
    void shade_block(std::int32_t block_x, std::int32_t block_y, std::uint32_t (&masks)[samples]) {
        const DrawPlan& draw = *run.draw;
        const std::uint32_t place = block_place(block_x, block_y);
        const std::int32_t x = run.tile_x + 4 * block_x, y = run.tile_y + 4 * block_y;
        std::uint32_t alive[samples];
        std::uint32_t any = 0;
        const bool tests = !draw.late_tests && (run.depth || run.stencil);
        for (std::uint32_t s = 0; s < samples; ++s) {
            alive[s] = masks[s];
            if (tests || (draw.early_rejection && run.depth)) {
                Ints key = ints(0);
                double exact_depths[16];
                if (run.depth) {
                    const float offset_x = multisampled ? static_cast<float>(sample_offset_x[s]) / subpixels : 0.5f;
                    const float offset_y = multisampled ? static_cast<float>(sample_offset_y[s]) / subpixels : 0.5f;
                    if (draw.in_double)
                        key = run.double_keys(x, y, offset_x, offset_y, exact_depths);
                    else
                        key = run.key_at(floats(static_cast<float>(x) + offset_x) + to_floats(load(lane_x)),
                                         floats(static_cast<float>(y) + offset_y) + to_floats(load(lane_y)));
                }
                std::int32_t* const depth = run.depth ? run.memory.depth[s] + place : nullptr;
                if (tests) {
                    alive[s] = test_lanes(draw.depth_stencil, run.front, key, masks[s], depth,
                                          run.stencil ? run.memory.stencil[s] + place : nullptr);
                    if (alive[s] && draw.depth_stencil.depth_write && run.depth) {
                        run.depth_written(place);
                        for (std::uint32_t lane = 0; draw.in_double && lane < 16; ++lane)
                            if (alive[s] >> lane & 1)
                                store_depth(run.targets, s, x + lane_x[lane], y + lane_y[lane], exact_depths[lane]);
                    }
                } else {
                    alive[s] &= mask_of(compare(draw.depth_stencil.compare, key, load(depth)));
                }
            }
            if (!draw.late_tests) run.memory.passed_samples += static_cast<std::uint32_t>(__builtin_popcount(alive[s]));
            any |= alive[s];
        }
        if (any == 0 || !draw.shades) return;
        if constexpr (!multisampled) {
            run.append_block(0, place, any, nullptr, nullptr);
        } else {
            std::uint8_t covered_samples[16] = {}, alive_samples[16] = {};
            for (std::uint32_t s = 0; s < samples; ++s)
                for (std::uint32_t lane = 0; lane < 16; ++lane) {
                    covered_samples[lane] =
                        static_cast<std::uint8_t>(covered_samples[lane] | (masks[s] >> lane & 1) << s);
                    alive_samples[lane] = static_cast<std::uint8_t>(alive_samples[lane] | (alive[s] >> lane & 1) << s);
                }
            if (!draw.runs_per_sample) {
                run.append_block(0, place, any, covered_samples, alive_samples);
            } else {
                for (std::uint32_t s = 0; s < samples; ++s)
                    if (alive[s]) run.append_block(s, place, alive[s], nullptr, nullptr);
            }
        }
    }
};

/// Lines of one sample: the pixels whose diamond the line leaves (Vulkan specification, "Bresenham Line Segment
/// Rasterization").
struct ThinLine {
    Coverage<false> coverage;
    std::int32_t block_x = -1, block_y = -1;
    std::uint32_t lanes = 0;

    void flush() {
        if (lanes == 0) return;
        std::uint32_t masks[1] = {lanes};
        coverage.shade_block(block_x, block_y, masks);
        lanes = 0;
    }
    void pixel(std::int32_t x, std::int32_t y) {
        if (x / 4 != block_x || y / 4 != block_y) {
            flush();
            block_x = x / 4, block_y = y / 4;
        }
        lanes |= 1u << ((x & 1) | (y & 1) << 1 | (x & 2) << 1 | (y & 2) << 2);
    }

    static bool in_diamond(std::int32_t x, std::int32_t y) {
        const std::int32_t from_x = (x & (subpixels - 1)) - subpixels / 2,
                           from_y = (y & (subpixels - 1)) - subpixels / 2;
        return (from_x < 0 ? -from_x : from_x) + (from_y < 0 ? -from_y : from_y) < subpixels / 2;
    }

    void draw() {
        TileRun& run = coverage.run;
        const Record& record = *run.record;
        // Along the larger extent: one pixel for each column (or row) whose center the line passes.
        const std::int64_t extent_x = static_cast<std::int64_t>(record.x[1]) - record.x[0];
        const std::int64_t extent_y = static_cast<std::int64_t>(record.y[1]) - record.y[0];
        const bool along_y = (extent_y < 0 ? -extent_y : extent_y) > (extent_x < 0 ? -extent_x : extent_x);
        const std::int32_t* const major = along_y ? record.y : record.x;
        const std::int32_t* const minor = along_y ? record.x : record.y;
        const std::int32_t length = major[1] - major[0];
        if (length == 0) return;
        const std::int64_t rise = minor[1] - minor[0];
        const bool forward = length > 0;
        const std::int32_t start = major[0] >> subpixel_bits, end = major[1] >> subpixel_bits;
        const auto center = [](std::int32_t column) { return column * subpixels + subpixels / 2; };
        // The first column also counts where the line starts behind its center but inside of the diamond; the last only
        // where the line comes out of the diamond.
        const bool start_inside = in_diamond(record.x[0], record.y[0]),
                   end_inside = in_diamond(record.x[1], record.y[1]);
        const bool start_behind = forward ? major[0] > center(start) : major[0] < center(start);
        const bool end_behind = forward ? major[1] > center(end) : major[1] < center(end);
        const std::int32_t step = forward ? 1 : -1;
        const std::int32_t first = start_behind && !start_inside ? start + step : start;
        const std::int32_t last = end_behind && !end_inside ? end : end - step;

        const DrawPlan& plan = *run.draw;
        const auto cut = [](std::int32_t value, std::int32_t low, std::int32_t high) {
            return value < low ? low : value > high ? high : value;
        };
        const std::int32_t x_begin = cut(plan.x_begin - run.tile_x, 0, run.width),
                           x_end = cut(plan.x_end - run.tile_x, 0, run.width);
        const std::int32_t y_begin = cut(plan.y_begin - run.tile_y, 0, run.height),
                           y_end = cut(plan.y_end - run.tile_y, 0, run.height);
        const std::int32_t major_tile = along_y ? run.tile_y : run.tile_x,
                           minor_tile = along_y ? run.tile_x : run.tile_y;
        const std::int32_t begin = major_tile + (along_y ? y_begin : x_begin),
                           limit = major_tile + (along_y ? y_end : x_end) - 1;
        const std::int32_t from = forward ? (first > begin ? first : begin) : (first < limit ? first : limit);
        const std::int32_t to = forward ? (last < limit ? last : limit) : (last > begin ? last : begin);
        for (std::int32_t column = from; forward ? column <= to : column >= to; column += step) {
            std::int32_t row;
            if (column == start && start_behind) {
                row = minor[0] >> subpixel_bits;
            } else {
                std::int64_t numerator =
                    static_cast<std::int64_t>(minor[0]) * length + (center(column) - major[0]) * rise;
                std::int64_t denominator = static_cast<std::int64_t>(length) * subpixels;
                if (denominator < 0) numerator = -numerator, denominator = -denominator;
                std::int64_t quotient = numerator / denominator;
                if (quotient * denominator > numerator) --quotient;
                row = static_cast<std::int32_t>(quotient);
            }
            const std::int32_t x = (along_y ? row - minor_tile : column - major_tile);
            const std::int32_t y = (along_y ? column - major_tile : row - minor_tile);
            if (x >= x_begin && x < x_end && y >= y_begin && y < y_end) pixel(x, y);
        }
        flush();
    }
};

}  // namespace
}  // namespace nacre::cpu::raster
