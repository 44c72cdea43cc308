// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/commands.h"

#include <cstring>
#include <type_traits>

#include "backends/cpu/acceleration_structure.h"

namespace nacre::cpu {
namespace {

using rhi::CommandHeader;
using rhi::CommandType;

void append(FlatPlan& plan, const void* data, std::size_t bytes) {
    const std::size_t at = plan.words.size();
    plan.words.resize(at + bytes / 8);
    std::memcpy(plan.words.data() + at, data, bytes);
}

bool is_executed(CommandType type) {
    switch (type) {
        case CommandType::push_debug_group:
        case CommandType::pop_debug_group:
        case CommandType::begin_statement:
        case CommandType::end_statement: return false;
        default: return true;
    }
}

}  // namespace

FlatPlan flatten(const rhi::ExecutionPlan& plan, bool for_checks) {
    FlatPlan flat;
    flat.serial = plan.serial;
    std::size_t total = 0;
    for (const rhi::CommandStream* stream : plan.streams) {
        total += sizeof(CommandHeader);
        for (const auto& block : stream->blocks) total += block.used;
    }
    flat.words.reserve(total / 8);
    flat.host_buffers.assign(plan.host_buffers.begin(), plan.host_buffers.end());
    for (rhi::CommandStream* stream : plan.streams) {
        const CommandHeader begin{static_cast<CommandType>(begin_list_command), 0, sizeof(CommandHeader)};
        append(flat, &begin, sizeof begin);
        if (for_checks) flat.lists.push_back({stream->name, stream->strings});
        stream->for_each([&](const CommandHeader& header, const std::byte*) {
            if (!for_checks && !is_executed(header.type)) return;
            for (const rhi::UnstatedUse& use : plan.unstated)
                if (use.statement == &header)
                    flat.unstated.push_back({flat.words.size(), static_cast<CpuBuffer*>(use.buffer),
                                             static_cast<CpuTexture*>(use.texture), use.stated, use.found});
            append(flat, &header, header.bytes);
        });
    }
    return flat;
}

Executor::Executor(Scheduler& scheduler, Watchdog& watchdog, std::uint32_t lanes, const ExecutorChecks& checks)
    : scheduler_(scheduler),
      watchdog_(watchdog),
      transfer_(scheduler),
      rasterizer_(scheduler, lanes,
                  {.tile_order = checks.flags & check_hostile ? std::optional(checks.seed) : std::nullopt}),
      checks_(checks),
      workgroup_memory_(scheduler.thread_count()),
      scratch_(std::make_shared<HostMemory>(machine_memory_bytes())) {
    reset_state();
}

std::string Executor::execute(const FlatPlan& plan) {
    plan_ = &plan;
    list_ = 0;
    for (std::size_t at = 0; at < plan.words.size() && stopped_.empty();) {
        const auto& header = *reinterpret_cast<const CommandHeader*>(plan.words.data() + at);
        const std::byte* payload = reinterpret_cast<const std::byte*>(&header) + sizeof(CommandHeader);
        execute(header, payload);
        if (checks_.flags) note_transfer(header, payload);
        at += header.bytes / 8;
    }
    if (in_pass_) {
        // Stopped within a pass: what it has begun is ended while its objects live.
        rasterizer_.end_pass();
        in_pass_ = false;
    }
    reset_state();
    end_statement();
    forget_checks();
    if (checks_.log) checks_.log->send();
    plan_ = nullptr;
    return stopped_;
}

void Executor::reset_state() {
    pipeline_ = nullptr;
    compute_pipeline_ = nullptr;
    groups_.fill(nullptr);
    vertex_buffers_.fill({});
    index_buffer_ = nullptr;
    push_constants_.clear();
    push_constants_.emplace_back();
    push_constants_in_use_ = false;
}

void Executor::execute(const CommandHeader& header, const std::byte* payload) {
    const auto as = [&]<typename T>(std::type_identity<T>) -> const T& { return *reinterpret_cast<const T*>(payload); };
    const auto pool_of = [](const auto& command) -> CpuQueryPool& {
        return *static_cast<CpuQueryPool*>(command.pool.object);
    };
#define NACRE_COMMAND(type) as(std::type_identity<rhi::type>{})
    if (checks_.flags) note_name(header, payload);
    if (static_cast<std::uint16_t>(header.type) == begin_list_command) return reset_state();
    switch (header.type) {
        case CommandType::begin_render_pass: return begin_render_pass(NACRE_COMMAND(BeginRenderPassCommand));
        case CommandType::end_render_pass: return end_render_pass();
        case CommandType::set_graphics_pipeline:
            pipeline_ = static_cast<CpuGraphicsPipeline*>(NACRE_COMMAND(SetGraphicsPipelineCommand).pipeline.object);
            return;
        case CommandType::set_compute_pipeline:
            compute_pipeline_ =
                static_cast<CpuComputePipeline*>(NACRE_COMMAND(SetComputePipelineCommand).pipeline.object);
            return;
        case CommandType::set_bind_group: {
            const auto& command = NACRE_COMMAND(SetBindGroupCommand);
            if (command.index < groups_.size())
                groups_[command.index] = static_cast<CpuBindGroup*>(command.group.object);
            return;
        }
        case CommandType::set_push_constants: return set_push_constants(NACRE_COMMAND(SetPushConstantsCommand));
        case CommandType::set_vertex_buffer: {
            const auto& command = NACRE_COMMAND(SetVertexBufferCommand);
            if (command.slot < vertex_buffers_.size())
                vertex_buffers_[command.slot] = {static_cast<CpuBuffer*>(command.buffer.object), command.offset};
            return;
        }
        case CommandType::set_index_buffer: {
            const auto& command = NACRE_COMMAND(SetIndexBufferCommand);
            index_buffer_ = static_cast<CpuBuffer*>(command.buffer.object);
            index_offset_ = command.offset;
            index_type_ = command.index_type;
            return;
        }
        case CommandType::set_viewport: viewport_ = NACRE_COMMAND(SetViewportCommand).viewport; return;
        case CommandType::set_scissor: scissor_ = NACRE_COMMAND(SetScissorCommand).scissor; return;
        case CommandType::set_stencil_reference:
            stencil_reference_ = static_cast<std::uint8_t>(NACRE_COMMAND(SetStencilReferenceCommand).reference);
            return;
        case CommandType::set_blend_constants:
            blend_constants_ = NACRE_COMMAND(SetBlendConstantsCommand).constants;
            return;
        case CommandType::draw: return draw(NACRE_COMMAND(DrawCommand).arguments, 0);
        case CommandType::draw_indexed: return draw_indexed(NACRE_COMMAND(DrawIndexedCommand).arguments, 0);
        case CommandType::draw_indirect: return draw_indirect(NACRE_COMMAND(DrawIndirectCommand));
        case CommandType::draw_indexed_indirect:
            return draw_indexed_indirect(NACRE_COMMAND(DrawIndexedIndirectCommand));
        case CommandType::dispatch: return dispatch(NACRE_COMMAND(DispatchCommand).groups);
        case CommandType::dispatch_indirect: return dispatch_indirect(NACRE_COMMAND(DispatchIndirectCommand));
        case CommandType::copy_buffer: return transfer_.copy_buffer(NACRE_COMMAND(CopyBufferCommand));
        case CommandType::copy_buffer_to_texture:
            return transfer_.copy_buffer_to_texture(NACRE_COMMAND(CopyBufferToTextureCommand));
        case CommandType::copy_texture_to_buffer:
            return transfer_.copy_texture_to_buffer(NACRE_COMMAND(CopyTextureToBufferCommand));
        case CommandType::copy_texture: return transfer_.copy_texture(NACRE_COMMAND(CopyTextureCommand));
        case CommandType::fill_buffer: return transfer_.fill_buffer(NACRE_COMMAND(FillBufferCommand));
        case CommandType::clear_texture: {
            const auto& command = NACRE_COMMAND(ClearTextureCommand);
            return transfer_.clear_color(texture_of(command.view.texture).make_view(command.view), command.color);
        }
        case CommandType::clear_depth_stencil: {
            const auto& command = NACRE_COMMAND(ClearDepthStencilCommand);
            const ImageView view = texture_of(command.view.texture).make_view(command.view);
            transfer_.clear_depth(view, command.depth);
            return transfer_.clear_stencil(view, command.stencil);
        }
        case CommandType::generate_mips:
            return transfer_.generate_mips(texture_of(NACRE_COMMAND(GenerateMipsCommand).texture).whole());
        case CommandType::build_acceleration_structure: {
            const auto& command = NACRE_COMMAND(BuildAccelerationStructureCommand);
            return static_cast<CpuAccelerationStructure*>(command.structure.object)->build(command);
        }
        case CommandType::write_timestamp: {
            const auto& command = NACRE_COMMAND(WriteTimestampCommand);
            return write_timestamp(pool_of(command), command.index);
        }
        case CommandType::begin_occlusion_query: {
            const auto& command = NACRE_COMMAND(BeginOcclusionQueryCommand);
            return begin_occlusion_query(pool_of(command), command.index);
        }
        case CommandType::end_occlusion_query: return end_occlusion_query();
        case CommandType::begin_statement: return begin_statement(header, payload);
        case CommandType::end_statement: return end_statement();
        case CommandType::push_debug_group:
        case CommandType::pop_debug_group: return;
    }
#undef NACRE_COMMAND
}

}  // namespace nacre::cpu
