// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "backends/vulkan/barriers.h"
#include "backends/vulkan/bind_group.h"
#include "backends/vulkan/pipeline.h"
#include "backends/vulkan/query_pool.h"

namespace nacre::vulkan {

/// Translates one submission into command buffers. Used again once the device has finished with it, so that its
/// command pool keeps its memory.
///
/// A submission is recorded in one or more parts. Queries must be reset outside of render passes, but only inside it is
/// known which a pass writes: the resets of a part go into a command buffer of their own that runs before it, and a
/// render pass that follows queries begins a new part.
class Commands {
  public:
    static Expected<std::unique_ptr<Commands>> create(Context& context);
    ~Commands();
    Commands(const Commands&) = delete;
    Commands& operator=(const Commands&) = delete;

    Expected<void> record(const rhi::ExecutionPlan& plan);
    /// What `record` made, in the order in which it must run.
    [[nodiscard]] std::span<const VkCommandBuffer> buffers() const { return order_; }

    std::uint64_t serial = 0;  ///< Of the submission that it was recorded for.

  private:
    explicit Commands(Context& context) : context_(context), vk_(context.vk), barriers_(context) {}

    // Parts (commands.cpp).
    Expected<VkCommandBuffer> next_buffer();
    Expected<void> begin_part();
    Expected<void> end_part();
    void visit(const rhi::CommandHeader& header, const std::byte* payload, const rhi::CommandStream& stream);
    void fail_with(std::unexpected<Error> error);

    // State (commands.cpp).
    void unset_state();
    void set_pipeline(const PipelineCore& pipeline);
    void bind_dirty_groups();
    void prepare_draw() {
        if (dirty_groups_ != 0) bind_dirty_groups();
    }

    // Render passes (pass_commands.cpp).
    void begin_pass(const rhi::BeginRenderPassCommand& command, const rhi::CommandStream& stream);
    void begin_dynamic_rendering(const rhi::BeginRenderPassCommand& command);
    void begin_render_pass(const rhi::BeginRenderPassCommand& command);
    void end_pass();
    void draw_indirect(const rhi::DrawIndirectCommand& command);
    void draw_indexed_indirect(const rhi::DrawIndexedIndirectCommand& command);

    // Copies (copy_commands.cpp).
    void copy(const rhi::CopyBufferToTextureCommand& command);
    void copy(const rhi::CopyTextureToBufferCommand& command);
    void copy(const rhi::CopyTextureCommand& command);
    void clear(const rhi::ClearTextureCommand& command);
    void clear(const rhi::ClearDepthStencilCommand& command);
    void generate_mips(Texture& texture);

    // Queries (query_commands.cpp).
    /// Sees to it that a query is reset before it is written here. False where that cannot be.
    bool prepare_query(QueryPool& pool, std::uint32_t index);
    void write_timestamp(const rhi::WriteTimestampCommand& command);
    void begin_occlusion(const rhi::BeginOcclusionQueryCommand& command);
    void end_occlusion(const rhi::EndOcclusionQueryCommand& command);
    Expected<void> record_resets(VkCommandBuffer commands) const;

    void begin_label(const char* name) const;
    void end_label() const;
    void push_group(const char* name);
    void pop_group();

    Context& context_;
    const DeviceFunctions& vk_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    std::vector<VkCommandBuffer> buffers_;  ///< All that were ever allocated;
    std::size_t used_buffers_ = 0;          ///< as many as this are in use.
    std::vector<VkCommandBuffer> order_;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;  ///< Of the current part.
    BarrierRecorder barriers_;
    std::vector<std::unique_ptr<rhi::BackendBuffer>> kept_;  ///< Until the device has finished with them.
    Expected<void> status_{};

    std::uint64_t part_ = 0;
    bool part_has_queries_ = false;
    std::vector<std::pair<QueryPool*, std::uint32_t>> resets_;
    bool occlusion_is_open_ = false;

    /// Debug groups that are open: a label may not reach from one command buffer into the next, so each part opens its
    /// own.
    std::vector<const char*> open_groups_;

    bool in_pass_ = false, pass_has_label_ = false;
    const PipelineCore* pipeline_ = nullptr;
    std::array<const BindGroup*, max_bind_groups> groups_{};
    std::uint32_t dirty_groups_ = 0;  ///< Bit for each index whose group has to be bound for the current pipeline.
    struct VertexBuffer {
        const rhi::BackendBuffer* buffer = nullptr;
        std::uint64_t offset = 0;
    };
    std::array<VertexBuffer, 16> vertex_buffers_{};
};

}  // namespace nacre::vulkan
