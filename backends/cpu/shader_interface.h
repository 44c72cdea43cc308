// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

/// @file
/// The memory that compiled shaders and the rest of the backend share: plain structures whose layout the compiler
/// writes into the code that it makes. Who changes a member here changes `compiler/interface_layout.h` with it; static
/// assertions there hold the two together.
///
/// Compiled code runs `lanes` invocations at once (4, 8 or 16). Arrays over lanes always have `max_lanes` elements,
/// whatever the lane count, so that one layout serves all; code of N lanes touches the first N.

namespace nacre::cpu {

struct ImageView;
struct SamplerState;
struct ShaderTrace;
class CommandChecks;

inline constexpr std::uint32_t max_lanes = 16;
inline constexpr std::uint32_t max_quads = max_lanes / 4;
inline constexpr std::uint32_t max_groups = 8;          ///< rhi::most_bind_groups
inline constexpr std::uint32_t max_color_outputs =
    9;  ///< Locations 0 to 7, and location 0 index 1 (dual source) as the ninth.
inline constexpr std::uint32_t dual_source_output = 8;
inline constexpr std::uint32_t push_constant_capacity = 256;
inline constexpr std::uint32_t most_workgroup_bytes = 65536;  ///< Of the variables of a workgroup.

/// One bound resource. Descriptors of a bind group lie one after another: bindings in rising order, the elements of an
/// arrayed binding together. Everything is zero or null where nothing is bound: reads give zero then, writes vanish.
struct Descriptor {
    std::byte* data;              ///< Buffers: first byte of the bound range, aligned to 16.
    std::uint64_t size;           ///< Buffers: bytes of the bound range.
    const ImageView* image;       ///< Textures, images and texel buffers.
    union {
        const SamplerState* sampler;  ///< Samplers and combined texture samplers.
        /// Buffers of devices in double precision: the double of each 32-bit word of the range, at twice the word's
        /// offset.
        std::byte* shadow;
    };
};
static_assert(sizeof(Descriptor) == 32);

/// What a running dispatch or draw tells its shaders about cancellation, and they about faults.
struct ExecutionState {
    /// Not zero: stop at the next loop iteration; whatever is written afterwards does not matter (watchdog, device
    /// loss).
    std::uint32_t expired;
};

/// What shaders of every stage see. Valid and unchanged for the duration of one call.
struct ShaderContext {
    const Descriptor* groups[max_groups];   ///< Null where no group is bound.
    std::uint32_t group_sizes[max_groups];  ///< Descriptors in each group (bounds unbounded arrays).
    const std::byte* push_constants;        ///< `push_constant_capacity` bytes, aligned to 16.
    ExecutionState* state;
    ShaderTrace* trace;  ///< Of programs that are traced.
    const CommandChecks* checks;            ///< For code that looks for faults (checks/check_interface.h); else null.
};

// ---- Compute
// -------------------------------------------------------------------------------------------------------------

/// A run of workgroups along x; the kernel runs all invocations of each, one workgroup after another.
struct WorkgroupRange {
    std::uint32_t x_begin, x_end;  ///< Workgroup ids.
    std::uint32_t y, z;
    std::uint32_t count[3];        ///< gl_NumWorkGroups.
    std::uint32_t reserved;
    /// `ComputeProgram::workgroup_bytes` bytes, aligned to 64: this thread's workgroup memory and, for kernels with
    /// barriers, the suspended subgroups. Content does not matter.
    std::byte* memory;
};
using ComputeFunction = void (*)(const ShaderContext*, const WorkgroupRange*);

// ---- Vertex
// --------------------------------------------------------------------------------------------------------------

struct VertexBufferBinding {
    const std::byte* data;  ///< Null where nothing is bound.
    std::uint64_t size;     ///< Bytes from `data` to the end of the buffer.
    const std::byte* shadow;  ///< As Descriptor::shadow; null where the device is not in double precision.
};

inline constexpr std::uint32_t max_vertex_buffers = 32;

/// What is the same for all vertices of a draw.
struct VertexDraw {
    VertexBufferBinding buffers[max_vertex_buffers];
    std::int32_t base_vertex;      ///< gl_BaseVertex
    std::uint32_t base_instance;   ///< gl_BaseInstance
    std::uint32_t draw_index;      ///< gl_DrawID
};

/// Up to `lanes` vertices of one instance.
///
/// Outputs are 32-bit words, one array of lanes for each slot: outputs[slot * max_lanes + lane]. Slots 0 to 3 are
/// gl_Position, slot 4 is gl_PointSize (1 where the shader does not write it), slots 5 to 12 are gl_ClipDistance and
/// behind them gl_CullDistance (as many as the program says), then the user's outputs (`VertexProgram::outputs`).
struct VertexBatch {
    std::uint32_t indices[max_lanes];  ///< gl_VertexIndex: vertex offset and first vertex are added already.
    std::uint32_t instance;            ///< gl_InstanceIndex: the first instance is added already.
    std::uint32_t count;               ///< Vertices that count; lanes behind them repeat a valid index.
    float* outputs;                    ///< `VertexProgram::output_slots` * max_lanes words, aligned to 64.
    double* doubles;                   ///< In double precision, else null: slots of floats once more, as doubles.
};
using VertexFunction = void (*)(const ShaderContext*, const VertexDraw*, VertexBatch*, std::uint32_t batch_count);

inline constexpr std::uint32_t slot_position = 0, slot_point_size = 4, slot_clip_distance = 5, first_user_slot = 13;

// ---- Fragment
// ------------------------------------------------------------------------------------------------------------

/// A value that is linear over the screen: c + dx * (x - x0) + dy * (y - y0), (x0, y0) as in PrimitiveData.
struct alignas(16) Plane {
    float c, dx, dy, reserved;
};

/// What fragment code reads of a triangle, line or point.
///
/// For inputs with perspective the plane holds value / w, for noperspective inputs the value, for flat ones the bits of
/// the provoking vertex's value in `c`. `inverse_w` is 1 / w; fragment code gets the value back as plane / inverse_w.
/// These planes are evaluated with fused multiplications, first along x: fma(dy, y, fma(dx, x, c)); `depth` as (c + dx
/// * x) + dy * y, as the depth test does.
struct alignas(16) PrimitiveData {
    float x0, y0;                ///< Window coordinates that `depth` is relative to.
    std::uint32_t primitive_id;  ///< gl_PrimitiveID
    std::uint32_t front_facing;  ///< 0 or 1
    /// Window coordinates that `inverse_w` and the varyings are relative to. Points, whose values are the same
    /// everywhere: the left upper corner, for gl_PointCoord.
    float origin_x, origin_y;
    float inverse_point_size;    ///< Points: 1 / size.
    std::uint32_t layer;         ///< gl_Layer
    Plane depth;                 ///< gl_FragCoord.z, after the viewport transform.
    Plane inverse_w;             ///< gl_FragCoord.w
    // Followed by one Plane for each FragmentProgram::inputs.
    [[nodiscard]] Plane* varyings() { return reinterpret_cast<Plane*>(this + 1); }
    [[nodiscard]] const Plane* varyings() const { return reinterpret_cast<const Plane*>(this + 1); }
};
static_assert(sizeof(PrimitiveData) == 64);

/// Planes in double precision; (x0, y0) as in DoublePrimitive.
struct DoublePlane {
    double c, dx, dy;
};
/// What fragment code of devices in double precision reads besides, at `double_primitive_offset` behind the
/// PrimitiveData.
struct alignas(16) DoublePrimitive {
    double x0, y0;
    double point_x, point_y, inverse_point_size;
    double reserved;
    DoublePlane
        planes[2];  ///< Depth and 1 / w, followed by one for each FragmentProgram::inputs (of flat integers: nothing).
    [[nodiscard]] DoublePlane* varyings() { return planes + 2; }
};
static_assert(sizeof(DoublePrimitive) == 96);
/// Planes of varyings are padded to a multiple of four.
[[gnu::always_inline]] constexpr std::size_t double_primitive_offset(std::size_t inputs) {
    return sizeof(PrimitiveData) + (inputs + 3) / 4 * 4 * sizeof(Plane);
}

/// Results of fragment code in double precision: those of FragmentBatch that are floats.
struct FragmentDoubles {
    alignas(64) double depth[max_lanes];
    alignas(64) double colors[max_color_outputs][4][max_lanes];
};

/// Up to `lanes` / 4 quads of 2x2 pixels, of one primitive or of several. Lane 4 * q + i is pixel (x[q] + (i & 1), y[q]
/// + (i >> 1)). Quads that are not used repeat a valid primitive and have no live lane.
struct FragmentBatch {
    const PrimitiveData* primitives[max_quads];
    std::int32_t x[max_quads], y[max_quads];  ///< Left upper pixel of each quad, even.
    /// In: lanes whose results count, one bit each; the others of a quad are helper invocations. Out: less those that
    /// the shader discarded or demoted.
    std::uint32_t live;
    std::uint32_t sample_index;  ///< gl_SampleID, where the program runs for each sample.
    std::uint32_t samples;       ///< Of the targets: 1 or 4.
    /// Where inside of the pixel the shader runs: (0.5, 0.5), or the sample's place where it runs for each sample.
    float sample_x, sample_y;
    FragmentDoubles* doubles;                              ///< In double precision, else null.
    alignas(64) std::uint32_t sample_mask_in[max_lanes];   ///< gl_SampleMaskIn: covered samples.
    alignas(64) float centroid_x[max_lanes];               ///< Place inside of the pixel for centroid inputs; set where
    alignas(64) float centroid_y[max_lanes];               ///< FragmentProgram::uses_centroid.
    // Results.
    alignas(64) std::uint32_t sample_mask_out[max_lanes];  ///< Set where the program writes gl_SampleMask.
    alignas(64) float depth[max_lanes];                    ///< Set where the program writes gl_FragDepth.
    /// Bits of the color outputs; components that the program does not write are left as they are.
    alignas(64) std::uint32_t colors[max_color_outputs][4][max_lanes];
};
using FragmentFunction = void (*)(const ShaderContext*, FragmentBatch*, std::uint32_t batch_count);

// ---- Images
// --------------------------------------------------------------------------------------------------------------

/// What is asked of an image, as bits; the first four are exclusive.
enum class ImageOperation : std::uint32_t {
    sample,     ///< Filtered read. Level of detail by the `lod_*` flags.
    gather,     ///< textureGather of `component`; with `compare`, of the comparison.
    fetch,      ///< texelFetch: integer coordinates, level in `lod` (as an integer), sample in `sample`.
    load,       ///< imageLoad: integer coordinates of the view's first mip.
    store,      ///< imageStore of `texel`.
    query_lod,  ///< textureQueryLod: result[0] mip that would be used, result[1] level of detail before clamping.
    atomic,     ///< imageAtomic*: see `ImageArguments::atomic`; the old value in result[0].
};
enum ImageFlags : std::uint32_t {
    image_operation_mask = 15,
    image_lod_implicit = 1 << 4,   ///< From differences inside of each quad (lanes 4q to 4q + 3), plus `lod` as a bias.
    image_lod_explicit = 1 << 5,   ///< `lod`
    image_lod_gradient = 1 << 6,   ///< `gradient_x`, `gradient_y`
    image_compare = 1 << 7,        ///< With `reference`; the result is one component.
    image_offset = 1 << 8,         ///< `offset`, in texels.
    image_offsets = 1 << 9,        ///< Gather with an offset for each texel: `gather_offsets`.
    image_integer = 1 << 10,       ///< The shader sees integers (so a format of another kind reads zero).
    image_min_lod = 1 << 11,       ///< `min_lod` (SPIR-V MinLod).
    image_component_shift = 12,    ///< Bits 12, 13: component of a gather.
};
enum class AtomicOperation : std::uint32_t {
    add, minimum_signed, minimum_unsigned, maximum_signed, maximum_unsigned, bit_and, bit_or, bit_xor, exchange,
    compare_exchange, add_float, minimum_float, maximum_float,
};

/// Arguments and result of one image operation for all lanes. Coordinates by the dimension of the view: x, y, z in that
/// order, the layer of an array behind them (rounded by the operation for samples, an integer for fetch, load, store
/// and atomic). Cubes: a direction for sample and gather; for fetch, load and store x, y and the face (plus 6 * layer).
struct ImageArguments {
    alignas(64) std::uint32_t coordinates[4][max_lanes];  ///< Bits of float or int.
    alignas(64) float lod[max_lanes];
    alignas(64) float reference[max_lanes];
    alignas(64) float gradient_x[3][max_lanes];
    alignas(64) float gradient_y[3][max_lanes];
    alignas(64) std::int32_t offset[3][max_lanes];
    alignas(64) std::int32_t sample[max_lanes];
    alignas(64) float min_lod[max_lanes];
    alignas(
        64) std::uint32_t texel[4][max_lanes];  ///< store: bits of float or integer channels. atomic: [0] the value.
    alignas(64) std::uint32_t comparator[max_lanes];      ///< compare_exchange
    std::int32_t gather_offsets[4][2];
    AtomicOperation atomic;
    alignas(64) std::uint32_t result[4][max_lanes];       ///< Zero in lanes that are not live.
};

/// The same for devices in double precision and images of floats. Integer coordinates are given as doubles, which hold
/// them exactly.
struct DoubleImageArguments {
    alignas(64) double coordinates[4][max_lanes];
    double lod[max_lanes];
    double reference[max_lanes];
    double gradient_x[3][max_lanes];
    double gradient_y[3][max_lanes];
    double min_lod[max_lanes];
    double texel[4][max_lanes];
    std::int32_t offset[3][max_lanes];
    std::int32_t sample[max_lanes];
    std::int32_t gather_offsets[4][2];
    alignas(64) double result[4][max_lanes];  ///< Zero in lanes that are not live.
};

/// The four words of a texel, as the shader sees it.
struct TexelWords {
    std::uint64_t first_two, last_two;
};

}  // namespace nacre::cpu

// Functions that compiled code calls. `flags` is an ImageOperation with ImageFlags. `live` has one bit for each lane;
// samples with an implicit level of detail also read coordinates of the other lanes of each quad. `image` and `sampler`
// may be null: nothing is bound; the result is zero.
extern "C" {
using NacreCpuImageFunction = void (*)(const nacre::cpu::ImageView* image, const nacre::cpu::SamplerState* sampler,
                                       nacre::cpu::ImageArguments* arguments, std::uint32_t flags, std::uint32_t live);
using NacreCpuDoubleImageFunction = void (*)(const nacre::cpu::ImageView* image,
                                             const nacre::cpu::SamplerState* sampler,
                                             nacre::cpu::DoubleImageArguments* arguments, std::uint32_t flags,
                                             std::uint32_t live);
// ImageOperation::fetch of one texel, by the coordinates in their order and the level; for all dimensions but cubes.
using NacreCpuTexelFunction = nacre::cpu::TexelWords (*)(const nacre::cpu::ImageView* image, std::uint32_t first,
                                                         std::uint32_t second, std::uint32_t third,
                                                         std::uint32_t level, std::uint32_t flags);
}
