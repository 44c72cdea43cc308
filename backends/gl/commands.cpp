// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/commands.h"

#include <algorithm>
#include <cstring>

namespace nacre::gl {
namespace {

using rhi::CommandHeader;
using rhi::CommandType;
using rhi::ResourceUse;

constexpr GLbitfield client_mapped_barrier = GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT;

GLbitfield barrier_bits(ResourceUse use, bool is_buffer) {
    GLbitfield bits = 0;
    const auto add = [&](ResourceUse which, GLbitfield flags) {
        if (has_any(use, which)) bits |= flags;
    };
    add(ResourceUse::vertex_buffer, GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
    add(ResourceUse::index_buffer, GL_ELEMENT_ARRAY_BARRIER_BIT);
    add(ResourceUse::indirect_argument, GL_COMMAND_BARRIER_BIT);
    add(ResourceUse::uniform_buffer, GL_UNIFORM_BARRIER_BIT);
    add(ResourceUse::sampled, GL_TEXTURE_FETCH_BARRIER_BIT);
    // Texel buffers are images of a buffer.
    add(ResourceUse::storage_read | ResourceUse::storage_write,
        is_buffer ? GL_SHADER_STORAGE_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT
                  : GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
    add(ResourceUse::color_target | ResourceUse::depth_stencil_read | ResourceUse::depth_stencil_write |
            ResourceUse::resolve_source | ResourceUse::resolve_destination,
        GL_FRAMEBUFFER_BARRIER_BIT);
    add(ResourceUse::copy_source | ResourceUse::copy_destination,
        is_buffer ? GL_BUFFER_UPDATE_BARRIER_BIT | GL_PIXEL_BUFFER_BARRIER_BIT
                  : GL_TEXTURE_UPDATE_BARRIER_BIT | GL_FRAMEBUFFER_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
    add(ResourceUse::host_read, GL_BUFFER_UPDATE_BARRIER_BIT | client_mapped_barrier);
    return bits;
}

constexpr GLbitfield everything = ~GLbitfield{0};

// OpenGL orders everything by itself except writes by shaders; those are told to each kind of access once.
GLbitfield note(const rhi::Barrier& barrier) {
    GLbitfield& stale = barrier.buffer ? static_cast<GlBuffer*>(barrier.buffer)->stale_for
                                       : static_cast<GlTexture*>(barrier.texture)->stale_for;
    if (has_any(barrier.before.use, ResourceUse::storage_write)) stale = everything;
    const GLbitfield bits = barrier_bits(barrier.after.use, barrier.buffer != nullptr) & stale;
    stale &= ~bits;
    return bits;
}

void append(FlatPlan& plan, const void* data, std::size_t bytes) {
    const std::size_t at = plan.words.size();
    plan.words.resize(at + bytes / 8);
    std::memcpy(plan.words.data() + at, data, bytes);
}

struct BarrierPayload {
    GLbitfield bits;
    std::uint32_t padding;
};

void append_barrier(FlatPlan& plan, GLbitfield bits) {
    if (bits == 0) return;
    const CommandHeader header{static_cast<CommandType>(barrier_command), 0,
                               sizeof(CommandHeader) + sizeof(BarrierPayload)};
    append(plan, &header, sizeof header);
    const BarrierPayload payload{bits, 0};
    append(plan, &payload, sizeof payload);
}

}  // namespace

FlatPlan flatten(const rhi::ExecutionPlan& plan) {
    FlatPlan flat;
    flat.serial = plan.serial;
    std::size_t total = 0;
    for (const rhi::CommandStream* stream : plan.streams)
        for (const auto& block : stream->blocks) total += block.used + 16;
    flat.words.reserve(total / 8 + plan.batches.size() * 2);
    std::size_t next_batch = 0;
    const auto batch_bits = [&](const rhi::BarrierBatch& batch) {
        GLbitfield bits = 0;
        for (const rhi::Barrier& barrier : plan.barriers.subspan(batch.first, batch.count)) bits |= note(barrier);
        return bits;
    };
    for (rhi::CommandStream* stream : plan.streams) {
        const auto string_base = static_cast<std::uint32_t>(flat.strings.size());
        flat.strings.insert(flat.strings.end(), stream->strings.begin(), stream->strings.end());
        const CommandHeader begin{static_cast<CommandType>(begin_list_command), 0, sizeof(CommandHeader)};
        append(flat, &begin, sizeof begin);
        stream->for_each([&](CommandHeader& header, std::byte* payload) {
            while (next_batch < plan.batches.size() && plan.batches[next_batch].before_command == &header)
                append_barrier(flat, batch_bits(plan.batches[next_batch++]));
            if (header.type == CommandType::begin_statement || header.type == CommandType::end_statement) return;
            const std::size_t at = flat.words.size();
            append(flat, &header, header.bytes);
            (void)payload;
            auto* copied = reinterpret_cast<std::byte*>(flat.words.data() + at) + sizeof(CommandHeader);
            if (header.type == CommandType::begin_render_pass)
                reinterpret_cast<rhi::BeginRenderPassCommand*>(copied)->name += string_base;
            if (header.type == CommandType::push_debug_group)
                reinterpret_cast<rhi::PushDebugGroupCommand*>(copied)->name += string_base;
        });
    }
    while (next_batch < plan.batches.size()) append_barrier(flat, batch_bits(plan.batches[next_batch++]));
    return flat;
}

void Executor::execute(const FlatPlan& plan) {
    driver_.serial = plan.serial;
    for (std::size_t at = 0; at < plan.words.size();) {
        const auto& header = *reinterpret_cast<const CommandHeader*>(plan.words.data() + at);
        execute(header, reinterpret_cast<const std::byte*>(&header) + sizeof(CommandHeader), plan);
        at += header.bytes / 8;
    }
    reset_state();
}

void Executor::destroy() {
    if (small_indirect_) gl_.DeleteBuffers(1, &small_indirect_);
    if (shifted_indices_) gl_.DeleteBuffers(1, &shifted_indices_);
    transfer_.destroy();
    provoking_vertex_.destroy();
}

void Executor::execute(const CommandHeader& header, const std::byte* payload, const FlatPlan& plan) {
    const auto as = [&]<typename T>() -> const T& { return *reinterpret_cast<const T*>(payload); };
    switch (static_cast<std::uint16_t>(header.type)) {
        case barrier_command: {
            GLbitfield bits = as.operator()<BarrierPayload>().bits;
            if (!driver_.traits.buffer_storage) bits &= ~client_mapped_barrier;
            gl_.MemoryBarrier(bits);
            return;
        }
        case begin_list_command: reset_state(); return;
        default: break;
    }
    // Transfers may change which mips of a texture are seen where parameters stand in for views.
    if (!driver_.traits.texture_view && header.type >= CommandType::copy_buffer &&
        header.type <= CommandType::generate_mips)
        groups_changed_ = true;
    switch (header.type) {
        case CommandType::begin_render_pass: {
            const auto& command = as.operator()<rhi::BeginRenderPassCommand>();
            if (driver_.debug_names && driver_.traits.debug_output)
                gl_.PushDebugGroup(
                    GL_DEBUG_SOURCE_APPLICATION, 0, -1,
                    plan.strings[command.name].empty() ? "render pass" : plan.strings[command.name].c_str());
            begin_render_pass(command);
            break;
        }
        case CommandType::end_render_pass:
            end_render_pass();
            if (driver_.debug_names && driver_.traits.debug_output) gl_.PopDebugGroup();
            break;
        case CommandType::set_graphics_pipeline:
            pipeline_ =
                static_cast<GlGraphicsPipeline*>(as.operator()<rhi::SetGraphicsPipelineCommand>().pipeline.object);
            break;
        case CommandType::set_compute_pipeline:
            compute_pipeline_ =
                static_cast<GlComputePipeline*>(as.operator()<rhi::SetComputePipelineCommand>().pipeline.object);
            break;
        case CommandType::set_bind_group: {
            const auto& command = as.operator()<rhi::SetBindGroupCommand>();
            if (command.index < groups_.size())
                groups_[command.index] = static_cast<GlBindGroup*>(command.group.object);
            groups_changed_ = true;
            break;
        }
        case CommandType::set_push_constants: {
            const auto& command = as.operator()<rhi::SetPushConstantsCommand>();
            if (command.offset + command.size <= push_data_.size())
                std::memcpy(push_data_.data() + command.offset, command.data(), command.size);
            break;
        }
        case CommandType::set_vertex_buffer: {
            const auto& command = as.operator()<rhi::SetVertexBufferCommand>();
            if (command.slot < vertex_buffers_.size())
                vertex_buffers_[command.slot] = {static_cast<GlBuffer*>(command.buffer.object), command.offset};
            break;
        }
        case CommandType::set_index_buffer: {
            const auto& command = as.operator()<rhi::SetIndexBufferCommand>();
            index_buffer_ = static_cast<GlBuffer*>(command.buffer.object);
            index_offset_ = command.offset;
            index_type_ = command.index_type;
            break;
        }
        case CommandType::set_viewport: {
            const rhi::Viewport& viewport = as.operator()<rhi::SetViewportCommand>().viewport;
            if (driver_.traits.desktop)
                gl_.ViewportIndexedf(0, viewport.x, viewport.y, viewport.width, viewport.height);
            else
                gl_.Viewport(static_cast<GLint>(viewport.x), static_cast<GLint>(viewport.y),
                             static_cast<GLsizei>(viewport.width), static_cast<GLsizei>(viewport.height));
            gl_.DepthRangef(viewport.min_depth, viewport.max_depth);
            break;
        }
        case CommandType::set_scissor: {
            const rhi::Rectangle& scissor = as.operator()<rhi::SetScissorCommand>().scissor;
            if (!driver_.bound.scissor_test) gl_.Enable(GL_SCISSOR_TEST);
            driver_.bound.scissor_test = true;
            gl_.Scissor(static_cast<GLint>(scissor.x), static_cast<GLint>(scissor.y),
                        static_cast<GLsizei>(scissor.width), static_cast<GLsizei>(scissor.height));
            break;
        }
        case CommandType::set_stencil_reference:
            stencil_reference_ = as.operator()<rhi::SetStencilReferenceCommand>().reference;
            stencil_changed_ = true;
            break;
        case CommandType::set_blend_constants: {
            const auto& constants = as.operator()<rhi::SetBlendConstantsCommand>().constants;
            gl_.BlendColor(constants[0], constants[1], constants[2], constants[3]);
            break;
        }
        case CommandType::draw: draw(as.operator()<rhi::DrawCommand>().arguments); break;
        case CommandType::draw_indexed: draw_indexed(as.operator()<rhi::DrawIndexedCommand>().arguments); break;
        case CommandType::draw_indirect: draw_indirect(as.operator()<rhi::DrawIndirectCommand>()); break;
        case CommandType::draw_indexed_indirect:
            draw_indexed_indirect(as.operator()<rhi::DrawIndexedIndirectCommand>());
            break;
        case CommandType::dispatch: {
            const rhi::DispatchArguments& groups = as.operator()<rhi::DispatchCommand>().groups;
            if (prepare_dispatch()) gl_.DispatchCompute(groups.x, groups.y, groups.z);
            break;
        }
        case CommandType::dispatch_indirect: {
            const auto& command = as.operator()<rhi::DispatchIndirectCommand>();
            if (!prepare_dispatch()) break;
            gl_.BindBuffer(GL_DISPATCH_INDIRECT_BUFFER, static_cast<GlBuffer*>(command.arguments.object)->name);
            gl_.DispatchComputeIndirect(static_cast<GLintptr>(command.offset));
            break;
        }
        case CommandType::copy_buffer: transfer_.copy_buffer(as.operator()<rhi::CopyBufferCommand>()); break;
        case CommandType::copy_buffer_to_texture:
            transfer_.copy_buffer_to_texture(as.operator()<rhi::CopyBufferToTextureCommand>());
            break;
        case CommandType::copy_texture_to_buffer:
            transfer_.copy_texture_to_buffer(as.operator()<rhi::CopyTextureToBufferCommand>());
            break;
        case CommandType::copy_texture: transfer_.copy_texture(as.operator()<rhi::CopyTextureCommand>()); break;
        case CommandType::fill_buffer: transfer_.fill_buffer(as.operator()<rhi::FillBufferCommand>()); break;
        case CommandType::clear_texture: transfer_.clear_texture(as.operator()<rhi::ClearTextureCommand>()); break;
        case CommandType::clear_depth_stencil:
            transfer_.clear_depth_stencil(as.operator()<rhi::ClearDepthStencilCommand>());
            break;
        case CommandType::generate_mips:
            transfer_.generate_mips(
                *static_cast<GlTexture*>(as.operator()<rhi::GenerateMipsCommand>().texture.object));
            break;
        case CommandType::write_timestamp: {
            const auto& command = as.operator()<rhi::WriteTimestampCommand>();
            static_cast<GlQueryPool*>(command.pool.object)->write_timestamp(command.index);
            break;
        }
        case CommandType::begin_occlusion_query: {
            const auto& command = as.operator()<rhi::BeginOcclusionQueryCommand>();
            occlusion_ = static_cast<GlQueryPool*>(command.pool.object);
            occlusion_->begin(command.index);
            break;
        }
        case CommandType::end_occlusion_query:
            if (occlusion_) occlusion_->end();
            occlusion_ = nullptr;
            break;
        case CommandType::push_debug_group:
            if (driver_.debug_names && driver_.traits.debug_output) {
                const std::string& name = plan.strings[as.operator()<rhi::PushDebugGroupCommand>().name];
                gl_.PushDebugGroup(GL_DEBUG_SOURCE_APPLICATION, 0, -1, name.empty() ? "group" : name.c_str());
            }
            break;
        case CommandType::pop_debug_group:
            if (driver_.debug_names && driver_.traits.debug_output) gl_.PopDebugGroup();
            break;
        case CommandType::build_acceleration_structure:  // OpenGL has none.
        case CommandType::begin_statement:
        case CommandType::end_statement: break;
    }
}

void Executor::reset_state() {
    pipeline_ = nullptr;
    compute_pipeline_ = nullptr;
    groups_.fill(nullptr);
    groups_changed_ = true;
    bound_for_ = 0;
    vertex_buffers_.fill({});
    index_buffer_ = nullptr;
    std::ranges::fill(push_data_, std::byte{0});
}

void Executor::begin_render_pass(const rhi::BeginRenderPassCommand& command) {
    reset_state();
    pass_ = command;
    pass_colors_.assign(command.colors(), command.colors() + command.color_count);
    Driver::FramebufferKey key;
    key.color_count = command.color_count;
    for (std::uint32_t i = 0; i < command.color_count && i < key.colors.size(); ++i) {
        const rhi::ViewReference& view = pass_colors_[i].view;
        if (auto* texture = static_cast<GlTexture*>(view.texture.object))
            key.colors[i] = texture->attachment(view.base_mip, view.base_layer, view.format);
    }
    if (command.has_depth_stencil) {
        const rhi::ViewReference& view = command.depth_stencil;
        auto* texture = static_cast<GlTexture*>(view.texture.object);
        key.depth_stencil = texture->attachment(view.base_mip, view.base_layer, texture->desc.format);
        key.depth_point =
            rhi::info(texture->desc.format).has_stencil ? GL_DEPTH_STENCIL_ATTACHMENT : GL_DEPTH_ATTACHMENT;
    }
    pass_framebuffer_ = driver_.framebuffer(key);
    driver_.bind_draw_framebuffer(pass_framebuffer_);
    if (driver_.bound.scissor_test) gl_.Disable(GL_SCISSOR_TEST);
    driver_.bound.scissor_test = false;
    clear_targets(command);
    // Whether depth may be written depends on the pass too.
    driver_.bound.raster_state = 0;
    gl_.Viewport(0, 0, static_cast<GLsizei>(command.width), static_cast<GLsizei>(command.height));
    gl_.DepthRangef(0.0f, 1.0f);
    gl_.BlendColor(0.0f, 0.0f, 0.0f, 0.0f);
    stencil_reference_ = 0;
    stencil_changed_ = true;
}

void Executor::clear_targets(const rhi::BeginRenderPassCommand& command) {
    bool clears = false;
    std::vector<GLenum> discarded;
    for (std::size_t i = 0; i < pass_colors_.size(); ++i) {
        if (!pass_colors_[i].view.texture.object) continue;
        clears |= pass_colors_[i].load == rhi::LoadOperation::clear;
        if (pass_colors_[i].load == rhi::LoadOperation::discard)
            discarded.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(i));
    }
    const rhi::FormatInfo* depth_format =
        command.has_depth_stencil
            ? &rhi::info(static_cast<GlTexture*>(command.depth_stencil.texture.object)->desc.format)
            : nullptr;
    const bool clear_depth = depth_format && command.depth_load == rhi::LoadOperation::clear;
    const bool clear_stencil =
        depth_format && depth_format->has_stencil && command.stencil_load == rhi::LoadOperation::clear;
    if (depth_format && command.depth_load == rhi::LoadOperation::discard) discarded.push_back(GL_DEPTH_ATTACHMENT);
    if (depth_format && depth_format->has_stencil && command.stencil_load == rhi::LoadOperation::discard)
        discarded.push_back(GL_STENCIL_ATTACHMENT);
    if (!discarded.empty())
        gl_.InvalidateFramebuffer(GL_DRAW_FRAMEBUFFER, static_cast<GLsizei>(discarded.size()), discarded.data());
    if (!clears && !clear_depth && !clear_stencil) return;
    driver_.open_masks();
    for (std::size_t i = 0; i < pass_colors_.size(); ++i) {
        const rhi::ColorAttachmentCommand& color = pass_colors_[i];
        if (!color.view.texture.object || color.load != rhi::LoadOperation::clear) continue;
        driver_.clear_color(static_cast<GLint>(i), color.view.format, color.clear);
    }
    if (clear_depth && clear_stencil)
        gl_.ClearBufferfi(GL_DEPTH_STENCIL, 0, command.clear_depth, command.clear_stencil);
    else if (clear_depth)
        gl_.ClearBufferfv(GL_DEPTH, 0, &command.clear_depth);
    else if (clear_stencil) {
        const GLint value = command.clear_stencil;
        gl_.ClearBufferiv(GL_STENCIL, 0, &value);
    }
}

void Executor::end_render_pass() {
    std::vector<GLenum> discarded;
    for (std::size_t i = 0; i < pass_colors_.size(); ++i) {
        const rhi::ColorAttachmentCommand& color = pass_colors_[i];
        if (!color.view.texture.object) continue;
        if (color.resolve.texture.object) transfer_.resolve(color.view, color.resolve, pass_.width, pass_.height);
        if (color.store == rhi::StoreOperation::discard)
            discarded.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(i));
    }
    if (pass_.has_depth_stencil && !pass_.read_only) {
        const bool has_stencil =
            rhi::info(static_cast<GlTexture*>(pass_.depth_stencil.texture.object)->desc.format).has_stencil;
        if (pass_.depth_store == rhi::StoreOperation::discard) discarded.push_back(GL_DEPTH_ATTACHMENT);
        if (has_stencil && pass_.stencil_store == rhi::StoreOperation::discard)
            discarded.push_back(GL_STENCIL_ATTACHMENT);
    }
    if (!discarded.empty()) {
        driver_.bind_draw_framebuffer(pass_framebuffer_);
        gl_.InvalidateFramebuffer(GL_DRAW_FRAMEBUFFER, static_cast<GLsizei>(discarded.size()), discarded.data());
    }
    reset_state();
}

}  // namespace nacre::gl
