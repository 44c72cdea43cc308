// SPDX-License-Identifier: Apache-2.0
// What each command of a list uses.
#include <fmt/format.h>

#include <type_traits>

#include "rhi/command_validator.h"
#include "rhi/submission_walk.h"

namespace nacre::rhi {
SubmissionWalk::Step SubmissionWalk::copy_scope(CommandHeader& header) {
    tracker_.end_scope(&header);
    note_statement();
    return {};
}

/// Copies that nobody has checked while they were recorded. They are few, and a driver does not check them either.
SubmissionWalk::Step SubmissionWalk::check_copy(const CommandHeader& header, std::byte* payload) {
    CommandValidator validator(device_.shared, stream_->name);
    switch (header.type) {
        case CommandType::copy_buffer: {
            const auto& copy = *reinterpret_cast<CopyBufferCommand*>(payload);
            return validator.copy_buffer(copy.source.handle, copy.source_offset, copy.destination.handle,
                                         copy.destination_offset, copy.size);
        }
        case CommandType::copy_buffer_to_texture: {
            const auto& copy = *reinterpret_cast<CopyBufferToTextureCommand*>(payload);
            return validator.copy_buffer_and_texture(copy.source.handle, copy.destination.handle, copy.region, true);
        }
        case CommandType::copy_texture_to_buffer: {
            const auto& copy = *reinterpret_cast<CopyTextureToBufferCommand*>(payload);
            return validator.copy_buffer_and_texture(copy.destination.handle, copy.source.handle, copy.region, false);
        }
        case CommandType::copy_texture: {
            const auto& copy = *reinterpret_cast<CopyTextureCommand*>(payload);
            return validator.copy_texture(copy.source.handle, copy.destination.handle, copy.region);
        }
        case CommandType::fill_buffer: {
            const auto& fill = *reinterpret_cast<FillBufferCommand*>(payload);
            return validator.fill_buffer(fill.buffer.handle, fill.offset, fill.size);
        }
        default: return {};
    }
}

SubmissionWalk::Step SubmissionWalk::visit(CommandHeader& header, std::byte* payload) {
    const auto as = [&]<typename T>(std::type_identity<T>) -> T& { return *reinterpret_cast<T*>(payload); };
    const auto outside = [&](const char* attempted) -> Step {
        if (!pass_) return {};
        return misuse(Rule::inside_render_pass, attempted, "expected no open render pass, found one",
                      "Move it before begin_render_pass or after end_render_pass.");
    };
    const auto buffer_of = [&](BufferReference& reference, const char* attempted) -> BufferObject* {
        BufferObject* buffer = look_up(reference.handle, attempted, "buffer");
        if (buffer) reference.object = buffer->backend.get();
        return buffer;
    };
    const auto texture_of = [&](TextureReference& reference, const char* attempted) -> TextureObject* {
        TextureObject* texture = look_up(reference.handle, attempted, "texture");
        if (texture) reference.object = texture->backend.get();
        return texture;
    };
    constexpr ResourceState source{ResourceUse::copy_source, ShaderStage::none};
    constexpr ResourceState destination{ResourceUse::copy_destination, ShaderStage::none};

    if (!stream_->validator && header.type >= CommandType::copy_buffer && header.type <= CommandType::fill_buffer)
        if (auto failed = check_copy(header, payload)) return failed;
    switch (header.type) {
        case CommandType::begin_render_pass:
            return begin_pass(header, as(std::type_identity<BeginRenderPassCommand>{}));
        case CommandType::end_render_pass: return end_pass();

        case CommandType::set_graphics_pipeline: {
            auto& command = as(std::type_identity<SetGraphicsPipelineCommand>{});
            GraphicsPipelineObject* pipeline = look_up(command.pipeline.handle, "set pipeline", "graphics pipeline");
            if (!pipeline) return std::move(problem_);
            if (!pass_)
                return misuse(Rule::outside_render_pass, "set pipeline",
                              "expected an open render pass for a graphics pipeline, found none",
                              "Set graphics pipelines after begin_render_pass.");
            command.pipeline.object = pipeline->backend.get();
            // Groups that were merged for another pipeline are checked against the layouts of this one.
            if (graphics_ != pipeline) fresh_ = bound_;
            graphics_ = pipeline;
            return {};
        }
        case CommandType::set_compute_pipeline: {
            auto& command = as(std::type_identity<SetComputePipelineCommand>{});
            ComputePipelineObject* pipeline = look_up(command.pipeline.handle, "set pipeline", "compute pipeline");
            if (!pipeline) return std::move(problem_);
            if (auto failed = outside("set pipeline")) return failed;
            command.pipeline.object = pipeline->backend.get();
            compute_ = pipeline;
            return {};
        }
        case CommandType::set_bind_group: {
            auto& command = as(std::type_identity<SetBindGroupCommand>{});
            BindGroupObject* group = look_up(command.group.handle, "set bind group", "bind group");
            if (!group) return std::move(problem_);
            if (command.index >= most_bind_groups || command.index >= device_.capabilities().max_bind_groups)
                return misuse(Rule::bind_group_index, "set bind group",
                              fmt::format("expected an index below {} (max_bind_groups), found {}",
                                          device_.capabilities().max_bind_groups, command.index),
                              "Use a lower bind-group index.");
            if (group->checked_epoch != device_.destructions)
                if (auto failed = check_group(*group, "set bind group")) return failed;
            command.group.object = group->backend.get();
            groups_[command.index] = group;
            bound_ |= 1u << command.index;
            fresh_ |= 1u << command.index;
            return {};
        }
        case CommandType::set_vertex_buffer: {
            auto& command = as(std::type_identity<SetVertexBufferCommand>{});
            BufferObject* buffer = buffer_of(command.buffer, "set vertex buffer");
            if (!buffer) return std::move(problem_);
            if (!pass_)
                return misuse(Rule::outside_render_pass, "set vertex buffer",
                              "expected an open render pass, found none",
                              "Set vertex buffers after begin_render_pass.");
            if (command.slot >= most_vertex_buffers || command.slot >= device_.capabilities().max_vertex_buffers)
                return misuse(Rule::vertex_buffer_use, "set vertex buffer",
                              fmt::format("expected a slot below {} (max_vertex_buffers), found {}",
                                          device_.capabilities().max_vertex_buffers, command.slot),
                              "Use a lower slot.");
            vertex_buffers_ |= 1u << command.slot;
            return use("set vertex buffer", *buffer, {ResourceUse::vertex_buffer, ShaderStage::none});
        }
        case CommandType::set_index_buffer: {
            auto& command = as(std::type_identity<SetIndexBufferCommand>{});
            BufferObject* buffer = buffer_of(command.buffer, "set index buffer");
            if (!buffer) return std::move(problem_);
            if (!pass_)
                return misuse(Rule::outside_render_pass, "set index buffer", "expected an open render pass, found none",
                              "Set index buffers after begin_render_pass.");
            has_index_buffer_ = true;
            return use("set index buffer", *buffer, {ResourceUse::index_buffer, ShaderStage::none});
        }
        case CommandType::set_push_constants:
        case CommandType::push_debug_group:
        case CommandType::pop_debug_group: return {};
        case CommandType::set_viewport:
        case CommandType::set_scissor:
        case CommandType::set_stencil_reference:
        case CommandType::set_blend_constants:
            if (pass_) return {};
            return misuse(Rule::outside_render_pass, "set dynamic state", "expected an open render pass, found none",
                          "Set viewport, scissor, stencil reference and blend constants after begin_render_pass.");

        case CommandType::draw: return draw("draw", false);
        case CommandType::draw_indexed: return draw("draw indexed", true);
        case CommandType::draw_indirect: {
            auto& command = as(std::type_identity<DrawIndirectCommand>{});
            if (auto failed = draw("draw indirect", false)) return failed;
            BufferObject* buffer = buffer_of(command.arguments, "draw indirect");
            if (!buffer) return std::move(problem_);
            return use("draw indirect", *buffer, {ResourceUse::indirect_argument, ShaderStage::none});
        }
        case CommandType::draw_indexed_indirect: {
            auto& command = as(std::type_identity<DrawIndexedIndirectCommand>{});
            if (auto failed = draw("draw indexed indirect", true)) return failed;
            BufferObject* buffer = buffer_of(command.arguments, "draw indexed indirect");
            if (!buffer) return std::move(problem_);
            return use("draw indexed indirect", *buffer, {ResourceUse::indirect_argument, ShaderStage::none});
        }
        case CommandType::dispatch: return dispatch(header, nullptr);
        case CommandType::dispatch_indirect:
            return dispatch(header, &as(std::type_identity<DispatchIndirectCommand>{}));

        case CommandType::copy_buffer: {
            auto& command = as(std::type_identity<CopyBufferCommand>{});
            if (auto failed = outside("copy buffer")) return failed;
            BufferObject* from = buffer_of(command.source, "copy buffer");
            if (!from) return std::move(problem_);
            BufferObject* to = buffer_of(command.destination, "copy buffer");
            if (!to) return std::move(problem_);
            tracker_.begin_scope();
            if (auto failed = use("copy buffer", *from, source)) return failed;
            if (auto failed = use("copy buffer", *to, destination)) return failed;
            return copy_scope(header);
        }
        case CommandType::copy_buffer_to_texture: {
            auto& command = as(std::type_identity<CopyBufferToTextureCommand>{});
            if (auto failed = outside("copy buffer to texture")) return failed;
            BufferObject* from = buffer_of(command.source, "copy buffer to texture");
            if (!from) return std::move(problem_);
            TextureObject* to = texture_of(command.destination, "copy buffer to texture");
            if (!to) return std::move(problem_);
            command.region = complete_region(command.region, to->desc);
            const BufferTextureCopy& region = command.region;
            const bool whole = region.extent == mip_extent(to->desc, region.mip) && !info(to->desc.format).has_stencil;
            tracker_.begin_scope();
            if (auto failed = use("copy buffer to texture", *from, source)) return failed;
            if (auto failed = use("copy buffer to texture", *to, {region.mip, 1, region.layer, 1}, destination, whole))
                return failed;
            return copy_scope(header);
        }
        case CommandType::copy_texture_to_buffer: {
            auto& command = as(std::type_identity<CopyTextureToBufferCommand>{});
            if (auto failed = outside("copy texture to buffer")) return failed;
            TextureObject* from = texture_of(command.source, "copy texture to buffer");
            if (!from) return std::move(problem_);
            BufferObject* to = buffer_of(command.destination, "copy texture to buffer");
            if (!to) return std::move(problem_);
            command.region = complete_region(command.region, from->desc);
            tracker_.begin_scope();
            if (auto failed =
                    use("copy texture to buffer", *from, {command.region.mip, 1, command.region.layer, 1}, source))
                return failed;
            if (auto failed = use("copy texture to buffer", *to, destination)) return failed;
            return copy_scope(header);
        }
        case CommandType::copy_texture: {
            auto& command = as(std::type_identity<CopyTextureCommand>{});
            if (auto failed = outside("copy texture")) return failed;
            TextureObject* from = texture_of(command.source, "copy texture");
            if (!from) return std::move(problem_);
            TextureObject* to = texture_of(command.destination, "copy texture");
            if (!to) return std::move(problem_);
            command.region = complete_region(command.region, from->desc);
            const TextureCopy& region = command.region;
            tracker_.begin_scope();
            if (auto failed =
                    use("copy texture", *from, {region.source_mip, 1, region.source_layer, region.layer_count}, source))
                return failed;
            const bool whole = region.extent == mip_extent(to->desc, region.destination_mip);
            if (auto failed =
                    use("copy texture", *to, {region.destination_mip, 1, region.destination_layer, region.layer_count},
                        destination, whole))
                return failed;
            return copy_scope(header);
        }
        case CommandType::fill_buffer: {
            auto& command = as(std::type_identity<FillBufferCommand>{});
            if (auto failed = outside("fill buffer")) return failed;
            BufferObject* buffer = buffer_of(command.buffer, "fill buffer");
            if (!buffer) return std::move(problem_);
            if (command.size == ~0ull)
                command.size = buffer->desc.size > command.offset ? (buffer->desc.size - command.offset) / 4 * 4 : 0;
            tracker_.begin_scope();
            if (auto failed = use("fill buffer", *buffer, destination)) return failed;
            return copy_scope(header);
        }
        case CommandType::clear_texture:
        case CommandType::clear_depth_stencil: {
            const bool depth = header.type == CommandType::clear_depth_stencil;
            const char* attempted = depth ? "clear depth and stencil" : "clear texture";
            if (auto failed = outside(attempted)) return failed;
            ViewReference& view = depth ? as(std::type_identity<ClearDepthStencilCommand>{}).view
                                        : as(std::type_identity<ClearTextureCommand>{}).view;
            TextureObject* texture = nullptr;
            if (auto failed = resolve_view(view, attempted, texture, false)) return failed;
            tracker_.begin_scope();
            if (auto failed = use(attempted, *texture, range_of(view), destination, true)) return failed;
            return copy_scope(header);
        }
        case CommandType::generate_mips: {
            auto& command = as(std::type_identity<GenerateMipsCommand>{});
            if (auto failed = outside("generate mips")) return failed;
            TextureObject* texture = texture_of(command.texture, "generate mips");
            if (!texture) return std::move(problem_);
            tracker_.begin_scope();
            if (auto failed =
                    use("generate mips", *texture, {0, texture->desc.mips, 0, layers_of(texture->desc)}, destination))
                return failed;
            return copy_scope(header);
        }

        case CommandType::build_acceleration_structure:
            return build(header, as(std::type_identity<BuildAccelerationStructureCommand>{}));

        case CommandType::write_timestamp:
        case CommandType::begin_occlusion_query:
        case CommandType::end_occlusion_query: {
            // The three commands have one layout.
            auto& command = as(std::type_identity<WriteTimestampCommand>{});
            const char* attempted = header.type == CommandType::write_timestamp         ? "write timestamp"
                                    : header.type == CommandType::begin_occlusion_query ? "begin occlusion query"
                                                                                        : "end occlusion query";
            QueryPoolObject* pool = look_up(command.pool.handle, attempted, "query pool");
            if (!pool) return std::move(problem_);
            if (command.index >= pool->desc.count)
                return misuse(Rule::query_range, attempted,
                              fmt::format("expected an index below {} for pool '{}', found {}", pool->desc.count,
                                          pool->desc.name, command.index),
                              "Make the pool larger or use a lower index.");
            if (header.type != CommandType::write_timestamp && !pass_)
                return misuse(Rule::outside_render_pass, attempted, "expected an open render pass, found none",
                              "Begin and end occlusion queries within one render pass.");
            command.pool.object = pool->backend.get();
            if (header.type != CommandType::begin_occlusion_query) written_queries_.emplace_back(pool, command.index);
            return {};
        }

        case CommandType::begin_statement: {
            auto& command = as(std::type_identity<BeginStatementCommand>{});
            if (pass_ || in_statement_)
                return misuse(Rule::statement_unbalanced, "begin statement",
                              pass_ ? "expected no open render pass, found one"
                                    : "expected no open statement, found '" + statement_name_ + "'",
                              "Statements stand around render passes and are not nested.");
            in_statement_ = true;
            statement_name_ = stream_->strings[command.name];
            stated_.assign(command.accesses(), command.accesses() + command.count);
            actual_.clear();
            used_objects_.clear();
            statement_ = &header;
            return {};
        }
        case CommandType::end_statement:
            if (pass_ || !in_statement_)
                return misuse(
                    Rule::statement_unbalanced, "end statement",
                    pass_ ? "expected no open render pass, found one" : "expected an open statement, found none",
                    "Pair begin_statement and end_statement outside of render passes.");
            end_statement();
            in_statement_ = false;
            return {};
    }
    return {};
}

}  // namespace nacre::rhi
