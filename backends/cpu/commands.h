// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "backends/cpu/bind_group.h"
#include "backends/cpu/pipeline.h"
#include "backends/cpu/query_pool.h"
#include "backends/cpu/transfer.h"
#include "backends/cpu/watchdog.h"

/// @file
/// Commands: a submission is copied on the caller's thread (streams belong to the caller) and executed on the queue's.
/// Commands are carried out one after another, each on all threads, so barriers cost nothing.

namespace nacre::cpu {

/// A submission of its own.
struct FlatPlan {
    /// Commands as in rhi::CommandStream, in one piece; `begin_list_command` begins each list.
    std::vector<std::uint64_t> words;
    std::uint64_t serial = 0;
};
inline constexpr std::uint16_t begin_list_command = 0xffff;

FlatPlan flatten(const rhi::ExecutionPlan& plan);

/// Executes plans; queue thread only.
class Executor {
  public:
    Executor(Scheduler& scheduler, Watchdog& watchdog, std::uint32_t lanes);

    /// Returns an empty text, or why the device must be given up. May throw std::bad_alloc.
    std::string execute(const FlatPlan& plan);

    /// From here on the shaders of `shader` tell what they compute; null: no more. Called while nothing is executed.
    void set_trace(ShaderTrace* trace, std::string shader, Compiler* compiler);

  private:
    [[nodiscard]] bool is_traced(const std::string& name) const;

    void execute(const rhi::CommandHeader& header, const std::byte* payload);
    void reset_state();

    // Render passes (render_passes.cpp).
    void begin_render_pass(const rhi::BeginRenderPassCommand& command);
    void end_render_pass();
    void begin_occlusion_query(CpuQueryPool& pool, std::uint32_t index);
    void end_occlusion_query();
    void write_timestamp(CpuQueryPool& pool, std::uint32_t index);

    // Draws and dispatches (shader_work.cpp).
    [[nodiscard]] ShaderContext make_context();
    void draw(const DrawCall& call, std::uint32_t draw_index);
    void draw(const rhi::DrawArguments& arguments, std::uint32_t draw_index);
    void draw_indexed(const rhi::DrawIndexedArguments& arguments, std::uint32_t draw_index);
    void draw_indirect(const rhi::DrawIndirectCommand& command);
    void draw_indexed_indirect(const rhi::DrawIndexedIndirectCommand& command);
    void dispatch(rhi::DispatchArguments groups);
    void dispatch_indirect(const rhi::DispatchIndirectCommand& command);
    void set_push_constants(const rhi::SetPushConstantsCommand& command);

    /// Notes which shader ran when the watchdog's limit passed.
    void look_at_watchdog(const std::string& shader);

    Scheduler& scheduler_;
    Watchdog& watchdog_;
    Transfer transfer_;
    Rasterizer rasterizer_;
    std::string stopped_;  ///< Why nothing more is executed.

    // What the list has set.
    CpuGraphicsPipeline* pipeline_ = nullptr;
    CpuComputePipeline* compute_pipeline_ = nullptr;
    std::array<CpuBindGroup*, max_groups> groups_{};
    struct alignas(16) PushConstants {
        std::array<std::byte, push_constant_capacity> bytes{};
    };
    /// The values in use are the last ones. Those before them belong to draws that the rasterizer has not finished.
    std::deque<PushConstants> push_constants_;
    bool push_constants_in_use_ = false;
    struct VertexBuffer {
        const CpuBuffer* buffer = nullptr;
        std::uint64_t offset = 0;
    };
    std::array<VertexBuffer, 32> vertex_buffers_{};
    const CpuBuffer* index_buffer_ = nullptr;
    std::uint64_t index_offset_ = 0;
    rhi::IndexType index_type_ = rhi::IndexType::uint16;

    // The open render pass.
    bool in_pass_ = false;
    RenderTargets targets_{};
    struct Resolve {
        std::size_t color = 0;
        ImageView destination{};
    };
    std::vector<Resolve> resolves_;
    rhi::Viewport viewport_{};
    rhi::Rectangle scissor_{};
    std::uint8_t stencil_reference_ = 0;
    std::array<float, 4> blend_constants_{};
    std::string pass_shaders_;  ///< Of the last draws, for messages.
    CpuQueryPool* occlusion_ = nullptr;
    std::uint32_t occlusion_index_ = 0;
    std::uint64_t passed_before_ = 0;

    ShaderTrace* trace_ = nullptr;
    std::string traced_shader_;
    Compiler* compiler_ = nullptr;
    std::vector<MemoryBlock> workgroup_memory_;  ///< One for each thread.
    std::shared_ptr<HostMemory> scratch_;
};

}  // namespace nacre::cpu
