// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>

#include "backends/gl/commands.h"

namespace nacre::gl {
namespace {

GLenum index_name(rhi::IndexType type) { return type == rhi::IndexType::uint16 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT; }
std::uint64_t index_bytes(rhi::IndexType type) { return type == rhi::IndexType::uint16 ? 2 : 4; }
const void* as_pointer(std::uint64_t offset) { return reinterpret_cast<const void*>(offset); }
GLenum image_access(const SlotRange& range) {
    return !range.readable ? GL_WRITE_ONLY : !range.writable ? GL_READ_ONLY : GL_READ_WRITE;
}

}  // namespace

void Executor::use_program(GLuint name) {
    if (driver_.bound.program == name) return;
    gl_.UseProgram(name);
    driver_.bound.program = name;
}

bool Executor::prepare_draw() {
    if (!pipeline_) return false;
    use_program(pipeline_->program->name);
    if (driver_.bound.vertex_array != pipeline_->vertex_array) {
        gl_.BindVertexArray(pipeline_->vertex_array);
        driver_.bound.vertex_array = pipeline_->vertex_array;
    }
    if (driver_.bound.raster_state != pipeline_->id) {
        pipeline_->apply(driver_, stencil_reference_);
        // A pass that only tests depth may sample it too; the mask keeps that defined.
        if (pass_.read_only) gl_.DepthMask(GL_FALSE);
    } else if (stencil_changed_) {
        pipeline_->apply_stencil_reference(driver_, stencil_reference_);
    }
    stencil_changed_ = false;
    bind_vertex_buffers();
    bind_resources(*pipeline_->program, pipeline_->id);
    push_constants(*pipeline_->program);
    return true;
}

bool Executor::prepare_dispatch() {
    if (!compute_pipeline_) return false;
    use_program(compute_pipeline_->program->name);
    bind_resources(*compute_pipeline_->program, compute_pipeline_->id);
    push_constants(*compute_pipeline_->program);
    return true;
}

void Executor::push_constants(Program& program) {
    if (!program.push_constants.empty()) program.upload_push_constants(gl_, push_data_);
}

void Executor::bind_vertex_buffers() {
    for (std::size_t slot = 0; slot < pipeline_->bound_vertex_buffers.size(); ++slot) {
        const VertexBuffer& wanted = vertex_buffers_[slot];
        GlGraphicsPipeline::BoundVertexBuffer& bound = pipeline_->bound_vertex_buffers[slot];
        if (!wanted.buffer || (bound.id == wanted.buffer->id && bound.offset == wanted.offset)) continue;
        gl_.BindVertexBuffer(static_cast<GLuint>(slot), wanted.buffer->name, static_cast<GLintptr>(wanted.offset),
                             static_cast<GLsizei>(pipeline_->desc.vertex_buffers[slot].stride));
        bound = {wanted.buffer->id, wanted.offset};
    }
}

void Executor::bind_index_buffer() {
    if (!index_buffer_ || pipeline_->bound_index_buffer == index_buffer_->id) return;
    gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer_->name);
    pipeline_->bound_index_buffer = index_buffer_->id;
}

void Executor::bind_resources(const Program& program, std::uint64_t pipeline_id) {
    if (!groups_changed_ && bound_for_ == pipeline_id) return;
    groups_changed_ = false;
    bound_for_ = pipeline_id;
    for (const Program::Slot& slot : program.slots) bind_slot(slot);
    for (const Program::TextureSlot& slot : program.textures) bind_texture(slot);
}

void Executor::bind_slot(const Program::Slot& slot) {
    if (slot.entry < 0 || slot.range.set >= groups_.size() || !groups_[slot.range.set]) return;
    GlBindGroup& group = *groups_[slot.range.set];
    for (std::uint32_t element = 0; element < slot.range.count; ++element) {
        GlBindGroup::Entry& entry = group.entries[static_cast<std::size_t>(slot.entry) + element];
        const std::uint32_t point = slot.range.first + element;
        if (slot.range.kind == SlotRange::Kind::image) {
            if (entry.texture) bind_image(slot.range, point, entry);
            if (entry.format != rhi::Format::undefined) bind_texel_image(slot.range, point, group, entry);
            continue;
        }
        if (!entry.buffer) continue;
        const bool uniform = slot.range.kind == SlotRange::Kind::uniform_buffer;
        BoundState::BufferRange& bound =
            (uniform ? driver_.bound.uniform_buffers : driver_.bound.storage_buffers)[point];
        const BoundState::BufferRange wanted{entry.buffer->id, entry.offset, entry.size};
        if (bound == wanted) continue;
        bound = wanted;
        gl_.BindBufferRange(uniform ? GL_UNIFORM_BUFFER : GL_SHADER_STORAGE_BUFFER, point, entry.buffer->name,
                            static_cast<GLintptr>(entry.offset), static_cast<GLsizeiptr>(entry.size));
    }
}

void Executor::bind_image_unit(std::uint32_t unit, GLuint name, const BoundState::Image& wanted) {
    BoundState::Image& bound = driver_.bound.images[unit];
    if (bound == wanted) return;
    bound = wanted;
    gl_.BindImageTexture(unit, name, static_cast<GLint>(wanted.level), wanted.layered ? GL_TRUE : GL_FALSE,
                         static_cast<GLint>(wanted.layer), wanted.access, wanted.format);
}

void Executor::bind_texel_image(const SlotRange& range, std::uint32_t unit, GlBindGroup& group,
                                GlBindGroup::Entry& entry) {
    const GlTexture::Name texels = group.texels(entry);
    bind_image_unit(unit, texels.name,
                    {texels.id, 0, 0, false, image_access(range), gl_format(entry.format).internal});
}

void Executor::bind_image(const SlotRange& range, std::uint32_t unit, GlBindGroup::Entry& entry) {
    GlTexture& texture = *entry.texture;
    const rhi::ViewReference& view = entry.view;
    GLuint name = texture.name;
    BoundState::Image wanted{texture.id, view.base_mip, 0, true, image_access(range), gl_format(view.format).internal};
    const GLenum target = view_target(view.dimension, false, driver_.traits);
    const bool all_layers =
        view.base_layer == 0 && (texture.target == GL_TEXTURE_3D || view.layer_count == texture.desc.layers);
    if (target == texture.target && all_layers) {
        wanted.layered = target != GL_TEXTURE_2D && target != GL_TEXTURE_1D;
    } else if (view.layer_count == 1 && (target == GL_TEXTURE_2D || target == GL_TEXTURE_1D)) {
        wanted.layered = false;
        wanted.layer = view.base_layer;
    } else {
        // The view holds the mip as its level 0.
        if (entry.shown.name == 0) entry.shown = texture.view(view);
        name = entry.shown.name;
        wanted.id = entry.shown.id;
        wanted.level = 0;
    }
    bind_image_unit(unit, name, wanted);
}

void Executor::bind_texture(const Program::TextureSlot& slot) {
    if (slot.entry < 0 || slot.range.set >= groups_.size() || !groups_[slot.range.set]) return;
    GlBindGroup& group = *groups_[slot.range.set];
    for (std::uint32_t element = 0; element < slot.range.count; ++element) {
        GlBindGroup::Entry& entry = group.entries[static_cast<std::size_t>(slot.entry) + element];
        const bool is_texel_buffer = entry.format != rhi::Format::undefined;
        if (!entry.texture && !is_texel_buffer) continue;
        const std::uint32_t unit = slot.range.first + element;
        if (is_texel_buffer)
            group.texels(entry);
        // Parameters of the texture stand in for views where there are none, and must be set again each time.
        else if (entry.shown.name == 0 || !driver_.traits.texture_view)
            entry.shown = entry.texture->view(entry.view);
        if (driver_.bound.textures[unit] != entry.shown.id) {
            driver_.select_unit(unit);
            gl_.BindTexture(entry.shown.target, entry.shown.name);
            driver_.bound.textures[unit] = entry.shown.id;
        }
        GLuint sampler_name = driver_.nearest_sampler;
        ObjectId sampler_id = ~ObjectId{0};
        const GlSampler* sampler = nullptr;
        if (slot.range.combined) {
            sampler = entry.sampler;
        } else if (slot.sampler_entry >= 0 && slot.range.sampler_set < groups_.size() &&
                   groups_[slot.range.sampler_set]) {
            sampler = groups_[slot.range.sampler_set]->entries[static_cast<std::size_t>(slot.sampler_entry)].sampler;
        }
        if (sampler) {
            const bool integer = rhi::info(entry.view.format).is_integer();
            sampler_name = integer ? sampler->integer_name : sampler->name;
            sampler_id = integer ? sampler->integer_id : sampler->id;
        }
        if (driver_.bound.samplers[unit] != sampler_id) {
            gl_.BindSampler(unit, sampler_name);
            driver_.bound.samplers[unit] = sampler_id;
        }
    }
}

void Executor::set_base_instance(std::uint32_t first_instance) {
    const GLint location = pipeline_->program->base_instance_location;
    if (location >= 0) gl_.Uniform1i(location, static_cast<GLint>(first_instance));
}

bool Executor::turns_corners() const {
    return pipeline_ && driver_.traits.es && pipeline_->program->flat_inputs &&
           (pipeline_->desc.topology == rhi::Topology::triangle_list ||
            pipeline_->desc.topology == rhi::Topology::triangle_strip);
}

void Executor::draw_turned(const ProvokingVertex::Draw& draw, std::uint32_t instances, std::uint32_t first_instance) {
    const auto count = static_cast<GLsizei>(provoking_vertex_.turn(draw));
    groups_changed_ = true;  // Two storage buffers are bound to others now.
    if (count == 0 || !prepare_draw()) return;
    gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, provoking_vertex_.indices());
    pipeline_->bound_index_buffer = 0;
    set_base_instance(first_instance);
    if (first_instance != 0)
        gl_.DrawElementsInstancedBaseVertexBaseInstance(GL_TRIANGLES, count, GL_UNSIGNED_INT, nullptr,
                                                        static_cast<GLsizei>(instances), 0, first_instance);
    else
        gl_.DrawElementsInstanced(GL_TRIANGLES, count, GL_UNSIGNED_INT, nullptr, static_cast<GLsizei>(instances));
}

void Executor::draw(const rhi::DrawArguments& arguments) {
    if (arguments.vertex_count == 0 || arguments.instance_count == 0) return;
    if (turns_corners())
        return draw_turned({.strip = pipeline_->desc.topology == rhi::Topology::triangle_strip,
                            .count = arguments.vertex_count, .first = arguments.first_vertex},
                           arguments.instance_count, arguments.first_instance);
    if (!prepare_draw()) return;
    set_base_instance(arguments.first_instance);
    const auto first = static_cast<GLint>(arguments.first_vertex);
    const auto vertices = static_cast<GLsizei>(arguments.vertex_count);
    const auto instances = static_cast<GLsizei>(arguments.instance_count);
    if (arguments.first_instance != 0)
        gl_.DrawArraysInstancedBaseInstance(pipeline_->topology, first, vertices, instances, arguments.first_instance);
    else
        gl_.DrawArraysInstanced(pipeline_->topology, first, vertices, instances);
}

void Executor::draw_indexed(const rhi::DrawIndexedArguments& arguments) {
    if (arguments.index_count == 0 || arguments.instance_count == 0 || !index_buffer_) return;
    if (turns_corners())
        return draw_turned(
            {.strip = pipeline_->desc.topology == rhi::Topology::triangle_strip,
             .count = arguments.index_count,
             .first = static_cast<std::uint32_t>(index_offset_ / index_bytes(index_type_)) + arguments.first_index,
             .vertex_offset = arguments.vertex_offset,
             .indices = index_buffer_,
             .wide_indices = index_type_ == rhi::IndexType::uint32},
            arguments.instance_count, arguments.first_instance);
    if (!prepare_draw()) return;
    bind_index_buffer();
    set_base_instance(arguments.first_instance);
    const GLenum type = index_name(index_type_);
    const std::uint64_t size = index_bytes(index_type_);
    const auto indices = static_cast<GLsizei>(arguments.index_count);
    const auto instances = static_cast<GLsizei>(arguments.instance_count);
    const void* start = as_pointer(index_offset_ + arguments.first_index * size);
    if (arguments.first_instance != 0) {
        gl_.DrawElementsInstancedBaseVertexBaseInstance(pipeline_->topology, indices, type, start, instances,
                                                        arguments.vertex_offset, arguments.first_instance);
    } else if (arguments.vertex_offset == 0) {
        gl_.DrawElementsInstanced(pipeline_->topology, indices, type, start, instances);
    } else if (driver_.traits.base_vertex) {
        gl_.DrawElementsInstancedBaseVertex(pipeline_->topology, indices, type, start, instances,
                                            arguments.vertex_offset);
    } else {
        // OpenGL ES 3.1 knows a vertex offset in indirect draws only.
        const std::uint32_t command[5]{arguments.index_count, arguments.instance_count,
                                       static_cast<std::uint32_t>(index_offset_ / size) + arguments.first_index,
                                       static_cast<std::uint32_t>(arguments.vertex_offset), 0};
        if (!small_indirect_) gl_.GenBuffers(1, &small_indirect_);
        gl_.BindBuffer(GL_DRAW_INDIRECT_BUFFER, small_indirect_);
        gl_.BufferData(GL_DRAW_INDIRECT_BUFFER, sizeof command, command, GL_STREAM_DRAW);
        driver_.bound.indirect_buffer = 0;
        gl_.DrawElementsIndirect(pipeline_->topology, type, nullptr);
    }
}

void Executor::bind_indirect(const GlBuffer& buffer) {
    if (driver_.bound.indirect_buffer == buffer.id) return;
    gl_.BindBuffer(GL_DRAW_INDIRECT_BUFFER, buffer.name);
    driver_.bound.indirect_buffer = buffer.id;
}

void Executor::draw_indirect(const rhi::DrawIndirectCommand& command) {
    if (command.count == 0 || !prepare_draw()) return;
    bind_indirect(*static_cast<GlBuffer*>(command.arguments.object));
    set_base_instance(0);
    if (command.count > 1 && driver_.traits.multi_draw_indirect) {
        gl_.MultiDrawArraysIndirect(pipeline_->topology, as_pointer(command.offset),
                                    static_cast<GLsizei>(command.count), static_cast<GLsizei>(command.stride));
        return;
    }
    for (std::uint32_t i = 0; i < command.count; ++i)
        gl_.DrawArraysIndirect(pipeline_->topology, as_pointer(command.offset + std::uint64_t{i} * command.stride));
}

void Executor::draw_indexed_indirect(const rhi::DrawIndexedIndirectCommand& command) {
    if (command.count == 0 || !index_buffer_ || !prepare_draw()) return;
    bind_index_buffer();
    if (index_offset_ != 0) {
        // Indirect arguments count from the begin of the buffer; a start inside it needs a copy.
        const std::uint64_t size = index_buffer_->desc.size - index_offset_;
        if (!shifted_indices_) gl_.GenBuffers(1, &shifted_indices_);
        gl_.BindBuffer(GL_COPY_READ_BUFFER, index_buffer_->name);
        gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, shifted_indices_);
        gl_.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(size), nullptr, GL_STREAM_COPY);
        gl_.CopyBufferSubData(GL_COPY_READ_BUFFER, GL_ELEMENT_ARRAY_BUFFER, static_cast<GLintptr>(index_offset_), 0,
                              static_cast<GLsizeiptr>(size));
        pipeline_->bound_index_buffer = 0;
    }
    bind_indirect(*static_cast<GlBuffer*>(command.arguments.object));
    set_base_instance(0);
    const GLenum type = index_name(index_type_);
    if (command.count > 1 && driver_.traits.multi_draw_indirect) {
        gl_.MultiDrawElementsIndirect(pipeline_->topology, type, as_pointer(command.offset),
                                      static_cast<GLsizei>(command.count), static_cast<GLsizei>(command.stride));
        return;
    }
    for (std::uint32_t i = 0; i < command.count; ++i)
        gl_.DrawElementsIndirect(pipeline_->topology, type,
                                 as_pointer(command.offset + std::uint64_t{i} * command.stride));
}

}  // namespace nacre::gl
