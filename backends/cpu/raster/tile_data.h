// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "backends/cpu/checks/check_interface.h"
#include "backends/cpu/raster/srgb_tables.h"
#include "backends/cpu/shader_interface.h"
#include "rhi/pipeline.h"

/// @file
/// What the stages of the rasterizer hand to each other, as plain structures: the tile kernels are compiled once for
/// each instruction set and must share no inline function with the rest of the program, or the linker could pick the
/// copy that a smaller processor cannot run.
///
///     draws -> chunks of primitives (vertices, set-up, bins; in parallel) -> tiles (in parallel, primitives in order)

namespace nacre::cpu::raster {

inline constexpr int tile_bits = 6;
inline constexpr std::int32_t tile_size = 1 << tile_bits;  ///< Pixels, both ways.
inline constexpr std::int32_t tile_blocks = 16;            ///< Blocks of 4x4 pixels in a row of a tile.
inline constexpr std::int32_t tile_pixels = tile_size * tile_size;
inline constexpr std::int32_t subpixel_bits = 8;
inline constexpr std::int32_t subpixels = 1 << subpixel_bits;
inline constexpr std::uint32_t most_samples = 4;
/// Window coordinates of vertices stay inside of +-this many pixels, so that edge functions inside of a tile fit 32
/// bits: an edge that crosses a tile changes by at most 63 * (|A| + |B|) <= 63 * 2^25 < 2^31 over it.
inline constexpr float guard_band = 32767.0f;
/// Primitives whose bounds touch more tiles than this are sorted into bins only as long as the bins of their chunk hold
/// no more than this for each of its primitives, or of `least_bin_room` if it has less; every tile looks at the others.
/// It bounds the bins.
inline constexpr std::uint32_t most_binned_tiles = 16, least_bin_room = 512;

/// Where the standard sample positions lie in a pixel, in 1/256 (Vulkan specification, "Standard sample locations").
inline constexpr std::int32_t sample_offset_x[most_samples] = {96, 224, 32, 160};
inline constexpr std::int32_t sample_offset_y[most_samples] = {32, 96, 160, 224};

/// A vertex behind the viewport transform; its fragment inputs follow as 32-bit words, padded to a multiple of four.
struct alignas(16) ScreenVertex {
    float x, y, z, inverse_w;  ///< Window coordinates.
    float clip[4];             ///< gl_Position
    [[nodiscard]] const float* inputs() const { return reinterpret_cast<const float*>(this + 1); }
};
static_assert(sizeof(ScreenVertex) == 32);

/// In double precision: gl_Position and the inputs as doubles, behind the words of a ScreenVertex.
[[gnu::always_inline]] inline double* vertex_doubles(ScreenVertex& vertex, std::uint32_t row_count) {
    return reinterpret_cast<double*>(reinterpret_cast<float*>(&vertex + 1) + row_count);
}
[[gnu::always_inline]] inline const double* vertex_doubles(const ScreenVertex& vertex, std::uint32_t row_count) {
    return reinterpret_cast<const double*>(reinterpret_cast<const float*>(&vertex + 1) + row_count);
}

/// What set-up needs of a vertex, and only set-up.
struct SetupVertex {
    std::int32_t x, y;  ///< Window coordinates with `subpixel_bits` bits behind the point; valid without `needs_clip`.
    std::uint32_t codes;   ///< VertexCodes
    std::uint32_t offset;  ///< Of the ScreenVertex in its chunk, in units of 16 bytes.
};
enum VertexCodes : std::uint32_t {
    outside_left = 1,
    outside_right = 2,
    outside_top = 4,
    outside_bottom = 8,
    outside_near = 16,
    outside_far = 32,
    outside_view = 63,
    outside_guard = 64,  ///< Beyond the guard band, or w <= 0.
    not_finite = 128,
    first_clip_distance = 1 << 8,  ///< One bit for each of 8 clip distances below zero,
    clip_distances_mask = 0xff00,
    first_cull_distance = 1 << 16,
    cull_distances_mask = 0xff0000,  ///< and for each of 8 cull distances.
};

/// How the planes of a primitive come from its vertices.
enum class PlaneSource : std::uint32_t {
    window,       ///< Triangle; differences of window coordinates.
    snapped,      ///< Triangle so thin that rounding turned it around: those of the rounded coordinates.
    homogeneous,  ///< Triangle with vertices behind the eye or far away: from clip coordinates.
    line,         ///< Constant across the line.
    point,        ///< Constant.
};

/// One triangle, line or point that may cover pixels. What it covers is the triangle of (x, y); its planes belong to
/// the vertices, which differ from (x, y) where it was clipped.
struct alignas(64) Record {
    std::int32_t x[3], y[3];  ///< With `subpixel_bits` bits behind the point; clockwise as seen (y down). Lines: two.
    std::uint32_t vertex[3];  ///< As SetupVertex::offset, provoking vertex first. Lines: [2] is the provoking vertex.
    std::uint32_t primitive_id;
    std::uint32_t bits;  ///< See below.
    float depth_c, depth_dx, depth_dy;
    float x0, y0;  ///< What the planes are relative to.

    static constexpr std::uint32_t front_facing = 1, swapped = 2, thin_line = 4, source_shift = 4, draw_shift = 8;
    [[nodiscard]] PlaneSource source() const { return static_cast<PlaneSource>(bits >> source_shift & 7); }
    [[nodiscard]] std::uint32_t draw() const { return bits >> draw_shift; }
};
static_assert(sizeof(Record) == 64);
inline constexpr std::uint32_t most_draws = 1 << 16;  ///< In one slab; fits Record::bits.

/// The result of one chunk, for the tiles.
struct ChunkView {
    const Record* records;
    const std::byte* vertices;
    const std::uint32_t* bin_offsets;  ///< Tiles + 1; null where no bin holds anything.
    const std::uint32_t* bins;         ///< Indices of records, rising inside of each bin.
    const std::uint32_t* large;        ///< Indices of records that all tiles look at, rising.
    std::uint32_t large_count;
};

enum class DepthLayout : std::uint32_t { none, unorm16, unorm24, float32 };

struct ColorTarget {
    std::byte* data;
    std::uint64_t sample_stride;
    std::uint32_t row_stride, texel_bytes;
    rhi::Format format;
    std::uint32_t words;        ///< Of a texel in Workspace::colors: one for each 32 bits, one for less.
    std::uint32_t first_plane;  ///< There: of the first sample; the others follow.
    bool clears;                ///< Filled with `clear` before the first draw.
    std::uint32_t clear[4];
    double* shadow;  ///< ImageLevel::shadow
};
struct TargetSet {
    ColorTarget colors[8];
    std::uint32_t color_count;
    std::uint32_t color_planes;  ///< Words of all targets and samples.
    bool streams_colors;         ///< They are larger than what caches keep for whoever reads them.
    DepthLayout depth_layout;
    std::byte* depth;
    std::uint64_t depth_sample_stride;
    std::uint32_t depth_row_stride;
    double* depth_shadow;  ///< ImageLevel::shadow
    std::byte* stencil;  ///< Null where there is none.
    std::uint64_t stencil_sample_stride;
    std::uint32_t stencil_row_stride;
    bool depth_clears, stencil_clears;  ///< As ColorTarget::clears.
    std::uint32_t clear_depth, clear_stencil;
    std::uint32_t width, height, samples, tiles_x, tiles_y;
};

struct DepthStencilPlan {
    bool depth_test, depth_write, stencil_test, clamps;
    rhi::CompareOperation compare;
    std::uint8_t reference;
    float clamp_low, clamp_high;  ///< Where `clamps`.
    rhi::StencilFace front, back;
};

struct ColorPlan {
    std::uint32_t target;  ///< Into TargetSet::colors.
    std::uint32_t output;  ///< Into FragmentBatch::colors.
    std::uint32_t components;
    bool blends, partial;  ///< `partial`: the write mask leaves channels of the format out.
    bool reads_destination;  ///< Blends, and what comes of it depends on what the target holds.
    bool as_it_is;         ///< Texels are the words of the output, without any conversion.
    std::uint8_t write_mask;  ///< One bit for each channel.
    rhi::BlendState blend;
    std::uint32_t word_masks[4];  ///< Bits of a texel that are written.
};

/// What the tiles need of a draw.
struct DrawPlan {
    FragmentFunction fragment;
    const ShaderContext* context;
    std::uint32_t input_count;
    /// For each input all bits or none, padded to a multiple of four: not divided by w; not interpolated.
    const std::int32_t* linear_masks;
    const std::int32_t* flat_masks;
    std::uint32_t primitive_bytes;  ///< PrimitiveData with its varyings.
    bool shades;                    ///< The fragment function runs at all.
    bool plain_results;             ///< Nothing but its colors comes out of it, and they overwrite what was there.
    bool late_tests;                ///< Depth and stencil are tested after it.
    bool early_rejection;           ///< Depth is also tested before it, without writing.
    bool hierarchical;              ///< Whole regions may be rejected by depth.
    bool discards, runs_per_sample, uses_centroid, writes_depth, writes_sample_mask, alpha_to_coverage;
    DepthStencilPlan depth_stencil;
    std::uint32_t color_count;
    ColorPlan colors[8];
    bool dual_source;
    float blend_constants[4];
    BlendCheck check_blend;  ///< Told of what blending reads; null: nobody asks.
    std::int32_t x_begin, x_end, y_begin, y_end;  ///< Pixels that may be drawn.
    // Clip coordinates to window coordinates: for planes from clip coordinates.
    double scale[3], translation[3];
    /// Interpolates, tests and writes doubles (rhi spec "cpu:double").
    bool in_double;
    float depth_bias, depth_bias_slope, depth_bias_clamp;
};

/// Vulkan specification, "Depth Bias Computation".
double depth_bias(DepthLayout layout, float constant, float slope_factor, float clamp, double slope,
                  double largest_depth);

/// As many quads go to the fragment function at once.
inline constexpr std::uint32_t stream_quads = 32;
inline constexpr std::uint32_t stream_batches = stream_quads;  ///< Of one quad each, with four lanes.
/// A stream is emptied when it holds `stream_quads`, which four blocks that are appended together may pass by; they are
/// appended without branches, which takes another block.
inline constexpr std::uint32_t stream_capacity = stream_quads + 16 + 4;
/// With sixteen lanes, blocks that are covered as a whole wait by themselves, a batch for each: nothing of them is
/// sorted or masked. As many wait at most, behind the batches of the stream.
inline constexpr std::uint32_t most_whole_blocks = 8;
static_assert(stream_quads / max_quads + most_whole_blocks <= stream_batches);
/// How many primitives may be drawn as long as a quad or a whole block waits, beyond those with a quad that waits.
inline constexpr std::uint32_t most_whole_primitives = 32, most_primitives_beside = 32;
/// One slot for each quad that waits, the primitive that is drawn, and some so that none is used again too early.
inline constexpr std::uint32_t primitive_slots = 4 * stream_quads;
static_assert(primitive_slots > stream_capacity + most_whole_primitives + most_primitives_beside + 1);

/// Quads that wait for the fragment function.
struct Stream {
    const PrimitiveData* primitives[stream_capacity];
    /// First lane of the quad in the tile, and above its pixels.
    std::uint32_t places[stream_capacity];
    static constexpr std::uint32_t place_mask = 0xffff, live_shift = 16;
    /// With several samples, for each pixel one bit for each: samples that the primitive covers, and those of them that
    /// passed the tests so far.
    std::uint8_t covered[stream_capacity][4], alive[stream_capacity][4];
    std::uint32_t quads;
};

/// Memory of one thread. The pixels of a tile lie here in blocks of 4x4 that consist of four quads: pixel (x, y) of
/// quad (i, j) is lane 4 * (2 * j + i) + 2 * y + x. Depth and stencil are 32-bit integers that compare like the depths.
/// Colors are the words of the texels: those of a block together, TargetSet::color_planes times 16 lanes.
struct alignas(64) Workspace {
    std::int32_t depth[most_samples][tile_pixels];
    std::int32_t stencil[most_samples][tile_pixels];
    Stream streams[most_samples];
    FragmentBatch batches[stream_batches];
    FragmentDoubles* doubles;      ///< `stream_batches`; null where no draw is in double precision.
    std::uint32_t* colors;         ///< For the whole tile; aligned to 64 bytes.
    std::byte* primitives;         ///< `primitive_slots` of the largest DrawPlan::primitive_bytes.
    std::uint64_t passed_samples;  ///< Counts up.
    /// First lanes of the blocks that wait as a whole.
    alignas(64) std::uint32_t whole_places[16];
};

struct TileJob {
    const TargetSet* targets;
    const ChunkView* chunks;
    const DrawPlan* const* draws;
    std::uint32_t lanes;
    const SrgbTables* srgb;
    const std::uint8_t* uncleared;  ///< For each tile: whether targets that are to be cleared still are to be.
    /// For each tile a bit for each chunk: whether it has something there. So many words for a tile.
    const std::uint64_t* tile_chunks;
    std::uint32_t chunk_words;
};

/// Vertices of a segment that come from one call of the vertex function.
struct VertexFinish {
    const float* const* rows;  ///< Sources of the words behind the ScreenVertex: arrays of max_lanes; a multiple of 4.
    std::uint32_t row_count;
    std::uint32_t count;   ///< Vertices, at most max_lanes.
    const float* outputs;  ///< VertexBatch::outputs
    std::uint32_t clip_distances, cull_distances;
    bool depth_clamp;
    float scale[3], translation[3];
    std::byte* vertices;  ///< Where the first ScreenVertex goes.
    std::uint32_t vertex_bytes;
    std::uint32_t first_offset;  ///< SetupVertex::offset of the first.
    SetupVertex* setup;
};

/// Slopes beyond this come from triangles without area; flat is the best that can be said of them.
inline constexpr double steepest_slope = 1e30;
/// Twice the area, in pixels: below, the rounding of coordinates decides about the triangle.
inline constexpr double thin_area = 1.0 / 4096.0;

/// Up to sixteen triangles of a draw with one sample, filled.
struct TriangleSetup {
    const SetupVertex* vertices;
    const std::byte* screen;  ///< What SetupVertex::offset counts from.
    rhi::CullMode cull;
    bool front_is_clockwise;
    std::int32_t x_begin, x_end, y_begin, y_end;  ///< As in DrawPlan.
    float bias, bias_slope, bias_clamp;
    double bias_unit;         ///< What `bias` counts; 0: that of the depth itself, which is a float.
    std::uint32_t draw_bits;  ///< Record::bits of the draw.
    std::uint32_t first_primitive;
    std::uint32_t count;           ///< At least one.
    const std::uint32_t* corners;  ///< Three for each, into `vertices`.

    // Results, one bit for each triangle.
    std::uint32_t drawn;    ///< Its record and tiles are made.
    std::uint32_t special;  ///< Must be clipped, or rounding decides about it: not done here. All others cover nothing.
    alignas(64) Record records[16];
    alignas(64) std::int32_t left[16], right[16], top[16], bottom[16];  ///< Tiles, inclusive.
};

/// The functions that exist once for each instruction set. All sets give the same bits.
struct Kernels {
    const char* name;
    void (*finish_vertices)(const VertexFinish& finish);
    void (*set_up_triangles)(TriangleSetup& work);
    void (*draw_tile)(const TileJob& job, std::uint32_t tile, Workspace& workspace);
};
extern const Kernels kernels_baseline;
#if defined(__x86_64__)
extern const Kernels kernels_avx2;
extern const Kernels kernels_avx512;
#endif

/// The best set that this processor has; `limit` 0 allows the baseline only, 1 also AVX2, 2 all.
const Kernels& choose_kernels(std::uint32_t limit);

}  // namespace nacre::cpu::raster
