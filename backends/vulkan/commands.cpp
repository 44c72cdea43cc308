// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/commands.h"

#include <atomic>
#include <bit>

#include "backends/vulkan/acceleration_structure.h"
#include "backends/vulkan/buffer.h"
#include "backends/vulkan/result.h"

namespace nacre::vulkan {

Expected<std::unique_ptr<Commands>> Commands::create(Context& context) {
    std::unique_ptr<Commands> commands(new Commands(context));
    VkCommandPoolCreateInfo info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
    info.flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT;
    info.queueFamilyIndex = context.physical->queue_family;
    if (VkResult result = context.vk.CreateCommandPool(context.device, &info, nullptr, &commands->pool_);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", "command pool");
    return commands;
}

Commands::~Commands() {
    if (pool_) vk_.DestroyCommandPool(context_.device, pool_, nullptr);
}

Expected<void> Commands::record(const rhi::ExecutionPlan& plan) {
    if (VkResult result = vk_.ResetCommandPool(context_.device, pool_, 0); result != VK_SUCCESS)
        return fail(context_.check(result), "reset", "command pool");
    used_buffers_ = 0;
    order_.clear();
    kept_.clear();
    open_groups_.clear();
    status_ = {};
    NACRE_CHECK(begin_part());
    const rhi::BarrierBatch* batch = plan.batches.data();
    const rhi::BarrierBatch* const batches_end = batch + plan.batches.size();
    const rhi::CommandHeader* next = batch != batches_end ? batch->before_command : nullptr;
    for (rhi::CommandStream* stream : plan.streams) {
        unset_state();
        stream->for_each([&](const rhi::CommandHeader& header, const std::byte* payload) {
            // A pass that could not begin must not go on, nor end.
            if (!status_) [[unlikely]]
                return;
            if (&header == next) [[unlikely]] {
                barriers_.record(commands_, plan.barriers.subspan(batch->first, batch->count));
                ++batch;
                next = batch != batches_end ? batch->before_command : nullptr;
            }
            visit(header, payload, *stream);
        });
    }
    for (; batch != batches_end; ++batch)
        barriers_.record(commands_, plan.barriers.subspan(batch->first, batch->count));
    NACRE_CHECK(status_);
    return end_part();
}

void Commands::fail_with(std::unexpected<Error> error) {
    if (status_) status_ = std::move(error);
}

Expected<VkCommandBuffer> Commands::next_buffer() {
    if (used_buffers_ == buffers_.size()) {
        VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
        info.commandPool = pool_;
        info.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
        info.commandBufferCount = 1;
        VkCommandBuffer made = VK_NULL_HANDLE;
        if (VkResult result = vk_.AllocateCommandBuffers(context_.device, &info, &made); result != VK_SUCCESS)
            return fail(context_.check(result), "allocate", "command buffer");
        buffers_.push_back(made);
    }
    VkCommandBuffer buffer = buffers_[used_buffers_];
    VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    if (VkResult result = vk_.BeginCommandBuffer(buffer, &begin); result != VK_SUCCESS)
        return fail(context_.check(result), "begin", "command buffer");
    ++used_buffers_;
    return buffer;
}

Expected<void> Commands::begin_part() {
    static std::atomic<std::uint64_t> part_count{0};
    part_ = ++part_count;
    part_has_queries_ = false;
    resets_.clear();
    NACRE_TRY(commands_, next_buffer());
    for (const char* name : open_groups_) begin_label(name);
    return {};
}

Expected<void> Commands::end_part() {
    if (!resets_.empty()) {
        NACRE_TRY(VkCommandBuffer before, next_buffer());
        NACRE_CHECK(record_resets(before));
        order_.push_back(before);
    }
    for (std::size_t i = 0; i < open_groups_.size(); ++i) end_label();
    if (VkResult result = vk_.EndCommandBuffer(commands_); result != VK_SUCCESS)
        return fail(context_.check(result), "end", "command buffer");
    order_.push_back(commands_);
    return {};
}

void Commands::unset_state() {
    pipeline_ = nullptr;
    groups_.fill(nullptr);
    dirty_groups_ = 0;
    vertex_buffers_.fill({});
}

void Commands::set_pipeline(const PipelineCore& pipeline) {
    if (pipeline_ == &pipeline) return;
    vk_.CmdBindPipeline(commands_, in_pass_ ? VK_PIPELINE_BIND_POINT_GRAPHICS : VK_PIPELINE_BIND_POINT_COMPUTE,
                        pipeline.handle);
    if (pipeline_) {
        // Groups stay bound up to the first index whose layout differs (push constants are the same everywhere).
        std::uint32_t same = 0;
        const std::uint32_t common = std::min(pipeline_->group_count, pipeline.group_count);
        while (same < common && pipeline_->group_layouts[same] == pipeline.group_layouts[same]) ++same;
        for (std::uint32_t i = same; i < max_bind_groups; ++i)
            if (groups_[i]) dirty_groups_ |= 1u << i;
    }
    pipeline_ = &pipeline;
}

void Commands::bind_dirty_groups() {
    if (!pipeline_) return;
    std::uint32_t left = dirty_groups_ & ((1u << pipeline_->group_count) - 1);
    while (left != 0) {
        const auto first = static_cast<std::uint32_t>(std::countr_zero(left));
        VkDescriptorSet sets[max_bind_groups];
        std::uint32_t count = 0;
        for (std::uint32_t i = first; i < pipeline_->group_count && (left & (1u << i)); ++i) {
            left &= ~(1u << i);
            // A group that another pipeline left behind: this pipeline does not use the index.
            if (groups_[i]->layout != pipeline_->group_layouts[i]) break;
            dirty_groups_ &= ~(1u << i);
            sets[count++] = groups_[i]->handle;
        }
        if (count > 0)
            vk_.CmdBindDescriptorSets(commands_,
                                      in_pass_ ? VK_PIPELINE_BIND_POINT_GRAPHICS : VK_PIPELINE_BIND_POINT_COMPUTE,
                                      pipeline_->layout, first, count, sets, 0, nullptr);
    }
}

void Commands::visit(const rhi::CommandHeader& header, const std::byte* payload, const rhi::CommandStream& stream) {
    using enum rhi::CommandType;
    const auto as = [&]<typename T>(std::type_identity<T>) -> const T& { return *reinterpret_cast<const T*>(payload); };
#define NACRE_AS(Type) as(std::type_identity<rhi::Type>{})
    switch (header.type) {
        case set_bind_group: {
            const auto& command = NACRE_AS(SetBindGroupCommand);
            const auto* group = static_cast<const BindGroup*>(command.group.object);
            if (groups_[command.index] == group) break;
            groups_[command.index] = group;
            dirty_groups_ |= 1u << command.index;
            break;
        }
        case set_push_constants: {
            const auto& command = NACRE_AS(SetPushConstantsCommand);
            vk_.CmdPushConstants(commands_, context_.push_layout, context_.push_constants.stageFlags, command.offset,
                                 command.size, command.data());
            break;
        }
        case draw: {
            prepare_draw();
            const rhi::DrawArguments& draw_call = NACRE_AS(DrawCommand).arguments;
            vk_.CmdDraw(commands_, draw_call.vertex_count, draw_call.instance_count, draw_call.first_vertex,
                        draw_call.first_instance);
            break;
        }
        case draw_indexed: {
            prepare_draw();
            const rhi::DrawIndexedArguments& draw_call = NACRE_AS(DrawIndexedCommand).arguments;
            vk_.CmdDrawIndexed(commands_, draw_call.index_count, draw_call.instance_count, draw_call.first_index,
                               draw_call.vertex_offset, draw_call.first_instance);
            break;
        }
        case draw_indirect: this->draw_indirect(NACRE_AS(DrawIndirectCommand)); break;
        case draw_indexed_indirect: this->draw_indexed_indirect(NACRE_AS(DrawIndexedIndirectCommand)); break;
        case dispatch: {
            prepare_draw();
            const rhi::DispatchArguments& groups = NACRE_AS(DispatchCommand).groups;
            vk_.CmdDispatch(commands_, groups.x, groups.y, groups.z);
            break;
        }
        case dispatch_indirect: {
            prepare_draw();
            const auto& command = NACRE_AS(DispatchIndirectCommand);
            vk_.CmdDispatchIndirect(commands_, native(*command.arguments.object).handle, command.offset);
            break;
        }
        case set_graphics_pipeline:
            set_pipeline(
                static_cast<const GraphicsPipeline*>(NACRE_AS(SetGraphicsPipelineCommand).pipeline.object)->core);
            break;
        case set_compute_pipeline:
            set_pipeline(
                static_cast<const ComputePipeline*>(NACRE_AS(SetComputePipelineCommand).pipeline.object)->core);
            break;
        case set_vertex_buffer: {
            const auto& command = NACRE_AS(SetVertexBufferCommand);
            VertexBuffer& bound = vertex_buffers_[command.slot];
            if (bound.buffer == command.buffer.object && bound.offset == command.offset) break;
            bound = {command.buffer.object, command.offset};
            const VkDeviceSize offset = command.offset;
            vk_.CmdBindVertexBuffers(commands_, command.slot, 1, &native(*command.buffer.object).handle, &offset);
            break;
        }
        case set_index_buffer: {
            const auto& command = NACRE_AS(SetIndexBufferCommand);
            vk_.CmdBindIndexBuffer(
                commands_, native(*command.buffer.object).handle, command.offset,
                command.index_type == rhi::IndexType::uint16 ? VK_INDEX_TYPE_UINT16 : VK_INDEX_TYPE_UINT32);
            break;
        }
        case set_viewport: {
            const rhi::Viewport& from = NACRE_AS(SetViewportCommand).viewport;
            const VkViewport viewport{from.x, from.y, from.width, from.height, from.min_depth, from.max_depth};
            vk_.CmdSetViewport(commands_, 0, 1, &viewport);
            break;
        }
        case set_scissor: {
            const rhi::Rectangle& from = NACRE_AS(SetScissorCommand).scissor;
            const VkRect2D scissor{{static_cast<std::int32_t>(from.x), static_cast<std::int32_t>(from.y)},
                                   {from.width, from.height}};
            vk_.CmdSetScissor(commands_, 0, 1, &scissor);
            break;
        }
        case set_stencil_reference:
            vk_.CmdSetStencilReference(commands_, VK_STENCIL_FACE_FRONT_AND_BACK,
                                       NACRE_AS(SetStencilReferenceCommand).reference);
            break;
        case set_blend_constants:
            vk_.CmdSetBlendConstants(commands_, NACRE_AS(SetBlendConstantsCommand).constants.data());
            break;
        case begin_render_pass:
            if (part_has_queries_ && status_) {
                status_ = end_part();
                if (status_) status_ = begin_part();
            }
            begin_pass(NACRE_AS(BeginRenderPassCommand), stream);
            break;
        case end_render_pass: end_pass(); break;
        case copy_buffer: {
            const auto& command = NACRE_AS(CopyBufferCommand);
            const VkBufferCopy region{command.source_offset, command.destination_offset, command.size};
            vk_.CmdCopyBuffer(commands_, native(*command.source.object).handle,
                              native(*command.destination.object).handle, 1, &region);
            break;
        }
        case fill_buffer: {
            const auto& command = NACRE_AS(FillBufferCommand);
            if (command.size == 0) break;
            vk_.CmdFillBuffer(commands_, native(*command.buffer.object).handle, command.offset, command.size,
                              command.value);
            break;
        }
        case copy_buffer_to_texture: copy(NACRE_AS(CopyBufferToTextureCommand)); break;
        case copy_texture_to_buffer: copy(NACRE_AS(CopyTextureToBufferCommand)); break;
        case copy_texture: copy(NACRE_AS(CopyTextureCommand)); break;
        case clear_texture: clear(NACRE_AS(ClearTextureCommand)); break;
        case clear_depth_stencil: clear(NACRE_AS(ClearDepthStencilCommand)); break;
        case generate_mips: this->generate_mips(native(*NACRE_AS(GenerateMipsCommand).texture.object)); break;
        case write_timestamp: this->write_timestamp(NACRE_AS(WriteTimestampCommand)); break;
        case begin_occlusion_query: begin_occlusion(NACRE_AS(BeginOcclusionQueryCommand)); break;
        case end_occlusion_query: end_occlusion(NACRE_AS(EndOcclusionQueryCommand)); break;
        case push_debug_group: push_group(stream.strings[NACRE_AS(PushDebugGroupCommand).name].c_str()); break;
        case pop_debug_group: pop_group(); break;
        case build_acceleration_structure: {
            const auto& command = NACRE_AS(BuildAccelerationStructureCommand);
            if (auto built = native(*command.structure.object).record_build(commands_, command, kept_); !built)
                fail_with(std::unexpected(std::move(built).error()));
            break;
        }
        case begin_statement:
        case end_statement: break;
    }
#undef NACRE_AS
}

void Commands::begin_label(const char* name) const {
    if (!context_.debug_names) return;
    VkDebugUtilsLabelEXT label{VK_STRUCTURE_TYPE_DEBUG_UTILS_LABEL_EXT};
    label.pLabelName = name;
    vk_.CmdBeginDebugUtilsLabelEXT(commands_, &label);
}

void Commands::push_group(const char* name) {
    open_groups_.push_back(name);
    begin_label(name);
}

void Commands::pop_group() {
    // lavapipe crashes where more labels end than began.
    if (open_groups_.empty()) return;
    open_groups_.pop_back();
    end_label();
}

void Commands::end_label() const {
    if (context_.debug_names) vk_.CmdEndDebugUtilsLabelEXT(commands_);
}

}  // namespace nacre::vulkan
