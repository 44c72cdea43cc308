// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "backends/cpu/checks/check_interface.h"
#include "backends/cpu/image_view.h"
#include "backends/cpu/program.h"
#include "backends/cpu/scheduler.h"
#include "rhi/command_list.h"
#include "rhi/pipeline.h"

/// @file
/// Draws triangles, lines and points with compiled shaders, by the rules of the Vulkan specification.

namespace nacre::cpu {

/// What a graphics pipeline fixes. `fragment.run` is null for depth-only pipelines.
struct RasterPipeline {
    VertexProgram vertex;
    FragmentProgram fragment;
    /// For each of fragment.inputs the slot of VertexBatch::outputs that it reads; ~0u reads zero.
    std::vector<std::uint32_t> input_slots;
    rhi::Topology topology = rhi::Topology::triangle_list;
    rhi::CullMode cull = rhi::CullMode::none;
    rhi::FrontFace front_face = rhi::FrontFace::counter_clockwise;
    rhi::FillMode fill = rhi::FillMode::fill;
    std::uint32_t samples = 1;
    bool alpha_to_coverage = false;
    rhi::DepthStencilState depth_stencil{};
    std::vector<rhi::ColorTargetState> color_targets;
};

/// Targets of a render pass. Views have one mip and one layer.
struct RenderTargets {
    std::vector<ImageView> colors;
    ImageView depth_stencil{};  ///< format undefined: none.
    std::uint32_t width = 0, height = 0, samples = 1;
    // Bytes of a texel that a target is filled with before the first draw; the fill is finished when the pass ends.
    // Nothing: it keeps what it holds. `color_clears` may be shorter than `colors`.
    std::vector<std::optional<std::array<std::byte, 16>>> color_clears;
    std::optional<std::array<std::byte, 4>> depth_clear;
    std::optional<std::uint8_t> stencil_clear;
};

struct DrawState {
    const RasterPipeline* pipeline = nullptr;
    ShaderContext context{};
    VertexDraw vertex{};
    rhi::Viewport viewport{};
    rhi::Rectangle scissor{};
    std::uint8_t stencil_reference = 0;
    std::array<float, 4> blend_constants{};
    BlendCheck check_blend = nullptr;  ///< Told of what blending reads; null: nobody asks.
};

struct DrawCall {
    bool indexed = false;
    rhi::IndexType index_type = rhi::IndexType::uint32;
    const std::byte* indices = nullptr;  ///< First byte of the index buffer's bound range.
    std::uint64_t index_bytes = 0;       ///< Of that range; indices behind it read as 0.
    std::uint32_t first = 0;             ///< First vertex, or first index.
    std::uint32_t count = 0;             ///< Vertices or indices.
    std::uint32_t first_instance = 0, instance_count = 1;
    std::int32_t vertex_offset = 0;
};

/// gl_PointSize is kept between 1 and this.
inline constexpr float largest_point_size = 255.0f;

/// For tests and hostile order; the results are the same whatever is chosen.
struct RasterizerOptions {
    std::uint32_t instruction_set = 2;  ///< At most: 0 the baseline of the processor family, 1 AVX2, 2 AVX-512.
    bool hierarchical_depth = true;
    std::optional<std::uint32_t> tile_order;  ///< Seed: tiles are drawn in another order, one for each seed.
};

/// Carries out the draws of render passes, one after another, on the threads of a scheduler. Not thread-safe.
///
/// Draws are collected and run together, in their order. DrawState and DrawCall are copied with the push constants;
/// what they point to beyond that (pipelines, descriptors, buffers, the execution state) stays as it is until
/// `end_pass` or `passed_samples` returns.
class Rasterizer {
  public:
    Rasterizer(Scheduler& scheduler, std::uint32_t lanes, const RasterizerOptions& options = {});
    ~Rasterizer();

    void begin_pass(const RenderTargets& targets);
    void draw(const DrawState& state, const DrawCall& call);
    /// All draws and fills of the pass are finished, and their writes in the targets, when this returns.
    void end_pass();
    /// Samples that passed depth and stencil tests since the begin of the pass, all draws so far finished.
    std::uint64_t passed_samples();

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace nacre::cpu
