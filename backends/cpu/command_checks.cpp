// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <functional>

#include "backends/cpu/commands.h"
#include "rhi/state_tracker.h"

/// @file
/// What checks must know of commands: their names, and which content they have defined.

namespace nacre::cpu {
namespace {

using rhi::CommandType;

/// Calls `visit(first byte, bytes)` for each row of a box of one mip of one plane; all layers and samples of the view.
void for_each_row(const ImageLevel& level, const ImageView& view, std::uint32_t texel_bytes,
                  const std::function<void(std::byte*, std::uint64_t)>& visit) {
    if (!level.data) return;
    const std::uint32_t edge = rhi::info(view.format).block_width;
    const std::uint32_t rows = (level.height + edge - 1) / edge;
    for (std::uint32_t layer = 0; layer < view.layer_count; ++layer)
        for (std::uint32_t sample = 0; sample < view.samples; ++sample)
            for (std::uint32_t slice = 0; slice < level.depth; ++slice)
                for (std::uint32_t row = 0; row < rows; ++row)
                    visit(level.data + layer * level.layer_stride + sample * level.sample_stride +
                              slice * level.slice_stride + std::uint64_t{row} * level.row_stride,
                          std::uint64_t{(level.width + edge - 1) / edge} * texel_bytes);
}

void define_view(CheckedMemory& memory, const ImageView& view, bool stencil, bool is_defined) {
    for (std::uint32_t mip = 0; mip < view.mip_count; ++mip)
        for_each_row(stencil ? view.stencil_levels[mip] : view.levels[mip], view, stencil ? 1 : view.texel_bytes,
                     [&](std::byte* row, std::uint64_t bytes) {
                         const auto offset = memory.offset_of(row);
                         if (offset) memory.define(*offset, bytes, is_defined);
                     });
}

/// Whether anything of the view was ever written.
bool has_defined(const CheckedMemory& memory, const ImageView& view, bool stencil) {
    if (!memory.has_undefined()) return true;
    bool found = false;
    for_each_row(stencil ? view.stencil_levels[0] : view.levels[0], view, stencil ? 1 : view.texel_bytes,
                 [&](std::byte* row, std::uint64_t bytes) {
                     const auto offset = memory.offset_of(row);
                     found = found || !offset || memory.has_defined(*offset, bytes);
                 });
    return found;
}

/// Makes the content of a view undefined, and as harmful as undefined content can be.
void discard_view(CheckedMemory& memory, const ImageView& view, bool stencil) {
    define_view(memory, view, stencil, false);
    for (std::uint32_t mip = 0; mip < view.mip_count; ++mip)
        for_each_row(stencil ? view.stencil_levels[mip] : view.levels[mip], view, stencil ? 1 : view.texel_bytes,
                     [&](std::byte* row, std::uint64_t bytes) {
                         const auto offset = memory.offset_of(row);
                         // Each byte as when the texture was made, so that what was written since can be told.
                         for (std::uint64_t i = 0; offset && i < bytes; ++i) {
                             const std::uint32_t word = poison_word((*offset + i) / 4);
                             std::memcpy(row + i, reinterpret_cast<const char*>(&word) + (*offset + i) % 4, 1);
                         }
                     });
}

/// Takes for written what is no poison any more.
void define_written(CheckedMemory& memory, const ImageView& view) {
    for_each_row(view.levels[0], view, view.texel_bytes, [&](std::byte* row, std::uint64_t bytes) {
        const auto offset = memory.offset_of(row);
        if (!offset || !memory.is_undefined(*offset, bytes)) return;
        // Small texels may be written with what poison looks like.
        if (view.texel_bytes < 4) return memory.define(*offset, bytes);
        for (std::uint64_t at = 0; at < bytes; at += view.texel_bytes) {
            bool is_poison = true;
            for (std::uint64_t i = at; i < at + view.texel_bytes && is_poison; i += 4) {
                std::uint32_t word = 0;
                std::memcpy(&word, row + i, 4);
                is_poison = word == poison_word((*offset + i) / 4);
            }
            if (!is_poison) memory.define(*offset + at, view.texel_bytes);
        }
    });
}

}  // namespace

std::string Executor::place() const {
    std::string text = fmt::format("list '{}'", plan_->lists.at(list_ - 1).name);
    if (in_pass_ && !pass_name_.empty())
        text += fmt::format(", pass '{}'", pass_name_);
    else if (!debug_groups_.empty())
        text += fmt::format(", '{}'", debug_groups_.back());
    return text;
}

const CommandChecks* Executor::make_checks(const char* what, std::uint32_t number) {
    CommandChecks& checks = command_checks_.emplace_back();
    checks.flags = checks_.flags;
    checks.scope = scope_;
    checks.command = fmt::format("{} {} of {}", what, number, place());
    for (std::size_t i = 0; i < groups_.size(); ++i)
        if (groups_[i]) checks.objects[i] = &groups_[i]->checked;
    for (std::size_t i = 0; i < vertex_buffers_.size(); ++i)
        if (vertex_buffers_[i].buffer) checks.vertex_buffers[i] = vertex_buffers_[i].buffer->checked.get();
    for (std::size_t i = 0; in_pass_ && i < std::min(targets_.colors.size(), checks.targets.size()); ++i) {
        const ImageView& view = targets_.colors[i];
        const auto known = std::ranges::find_if(attachments_, [&](const Attachment& attachment) {
            return !attachment.is_depth && attachment.view.levels[0].data == view.levels[0].data;
        });
        if (view.levels[0].data && known != attachments_.end())
            checks.targets[i] = {known->checked, view.levels[0], view.texel_bytes};
    }
    checks.workgroup_memories = workgroup_check_pointers_;
    checks.batches = &batches_;
    checks.state = &watchdog_.state();
    checks.log = checks_.log;
    return &checks;
}

void Executor::add_undefined(const std::string& attempted, const std::string& subject, const std::string& expected,
                             const std::string& found) {
    checks_.log->add(rhi::ShaderFault::uninitialized_read, nullptr, attempted + subject, 1, false, [&] {
        FoundFault fault;
        fault.attempted = attempted;
        fault.subject = subject;
        fault.reason = fmt::format("expected {}, found {} that nothing has written", expected, found);
        return fault;
    });
}

bool Executor::are_undefined(const rhi::BufferReference& reference, std::uint64_t offset, std::uint64_t bytes,
                             const char* what) {
    const auto* const buffer = static_cast<const CpuBuffer*>(reference.object);
    if (!(checks_.flags & (check_sanitize | check_hostile)) || !buffer->checked ||
        !buffer->checked->is_undefined(offset, bytes))
        return false;
    add_undefined(fmt::format("{} indirectly", what), fmt::format("in {}", place()), "arguments that were written",
                  fmt::format("some at byte {} of {}", offset, buffer->checked->name()));
    return true;
}

void Executor::check_draw(const DrawCall& call, const CommandChecks& checks) {
    if (call.indexed && index_buffer_->checked && index_buffer_->checked->has_undefined()) {
        const std::uint64_t bytes = call.index_type == rhi::IndexType::uint16 ? 2 : 4;
        const std::uint64_t end = std::min(std::uint64_t{call.first} + call.count, call.index_bytes / bytes);
        for (std::uint64_t index = call.first; index < end; ++index) {
            if (!index_buffer_->checked->is_undefined(index_offset_ + index * bytes, bytes)) continue;
            add_undefined("run", checks.command, "indices that were written",
                          fmt::format("index {} of {}", index, index_buffer_->checked->name()));
            break;
        }
    }
    const rhi::DepthStencilState& state = pipeline_->raster.depth_stencil;
    const auto asks = [](rhi::CompareOperation operation) {
        return operation != rhi::CompareOperation::always && operation != rhi::CompareOperation::never;
    };
    for (const Attachment& attachment : attachments_) {
        if (attachment.loads_nothing && state.depth_test && asks(state.depth_compare))
            add_undefined("test depth", fmt::format("in {}", place()), "depths that were written",
                          fmt::format("some of {}", attachment.checked->name()));
        const bool asks_stencil = state.stencil_test && (asks(state.front.compare) || asks(state.back.compare));
        if (attachment.loads_no_stencil && asks_stencil)
            add_undefined("test stencil", fmt::format("in {}", place()), "values that were written",
                          fmt::format("some of {}", attachment.checked->name()));
    }
}

void Executor::prepare_workgroup_checks() {
    if (!(checks_.flags & (check_sanitize | check_hostile))) return;
    workgroup_checks_.resize(workgroup_memory_.size());
    workgroup_check_pointers_.resize(workgroup_memory_.size());
    for (std::size_t i = 0; i < workgroup_memory_.size(); ++i) {
        const MemoryBlock& memory = workgroup_memory_[i];
        std::unique_ptr<CheckedMemory>& checked = workgroup_checks_[i];
        if (!checked || checked->data() != memory.data() || checked->size() != memory.size())
            checked = std::make_unique<CheckedMemory>("", memory.data(), memory.size(), false);
        workgroup_check_pointers_[i] = checked.get();
    }
}

void Executor::note_name(const rhi::CommandHeader& header, const std::byte* payload) {
    if (static_cast<std::uint16_t>(header.type) == begin_list_command) {
        ++list_;
        draws_ = dispatches_ = 0;
        debug_groups_.clear();
        pass_name_.clear();
        return;
    }
    const auto string_at = [&](std::uint32_t index) {
        const std::vector<std::string>& strings = plan_->lists.at(list_ - 1).strings;
        return index < strings.size() ? strings[index] : std::string();
    };
    if (header.type == CommandType::push_debug_group)
        debug_groups_.push_back(string_at(reinterpret_cast<const rhi::PushDebugGroupCommand*>(payload)->name));
    if (header.type == CommandType::pop_debug_group && !debug_groups_.empty()) debug_groups_.pop_back();
    if (header.type == CommandType::begin_render_pass)
        pass_name_ = string_at(reinterpret_cast<const rhi::BeginRenderPassCommand*>(payload)->name);
}

void Executor::begin_statement(const rhi::CommandHeader& header, const std::byte* payload) {
    const auto at = static_cast<std::size_t>(reinterpret_cast<const std::uint64_t*>(&header) - plan_->words.data());
    const FlatPlan::ListNames& list = plan_->lists.at(list_ - 1);
    const std::string name = list.strings.at(reinterpret_cast<const rhi::BeginStatementCommand*>(payload)->name);
    for (const FlatPlan::Unstated& use : plan_->unstated) {
        CheckedMemory* memory = use.buffer    ? use.buffer->checked.get()
                                : use.texture ? use.texture->checked.get()
                                              : nullptr;
        if (use.statement != at || !memory || !(checks_.flags & check_hostile)) continue;
        checks_.log->add(rhi::ShaderFault::unstated_access, nullptr, name + memory->name(), 1, false, [&] {
            FoundFault fault;
            fault.attempted = "run pass";
            fault.subject = fmt::format("'{}' of list '{}', {}", name, list.name, memory->name());
            fault.reason = fmt::format("expected uses that its statement names ({}), found {}",
                                       rhi::text_of(use.stated), rhi::text_of(use.found & ~use.stated));
            return fault;
        });
        Withheld& withheld = withheld_.emplace_back();
        withheld.memory = memory;
        withheld.content.assign(memory->data(), memory->data() + memory->size());
        withheld.undefined = memory->undefined_bytes();
        withheld.is_poisoned = rhi::has_any(use.found & ~use.stated, ~rhi::writing_uses);
        withheld.keeps_writes = rhi::has_any(use.stated, rhi::writing_uses);
        if (!withheld.is_poisoned) continue;
        poison(memory->data(), memory->size());
        memory->define(0, memory->size(), false);
    }
}

void Executor::end_statement() {
    for (Withheld& withheld : withheld_) {
        CheckedMemory& memory = *withheld.memory;
        if (!withheld.keeps_writes) {
            std::memcpy(memory.data(), withheld.content.data(), withheld.content.size());
            memory.restore(std::move(withheld.undefined));
            continue;
        }
        // What the commands have not written is as before.
        std::vector<std::uint64_t> undefined = memory.undefined_bytes();
        for (std::uint64_t at = 0; at < memory.size(); at += 4) {
            const std::uint64_t count = std::min<std::uint64_t>(4, memory.size() - at);
            const std::uint32_t word = poison_word(at / 4);
            if (!withheld.is_poisoned || std::memcmp(memory.data() + at, &word, count) != 0) continue;
            std::memcpy(memory.data() + at, withheld.content.data() + at, count);
            const std::uint64_t bits = std::uint64_t{15} << at % 64;
            undefined[at / 64] = (undefined[at / 64] & ~bits) | (withheld.undefined[at / 64] & bits);
        }
        memory.restore(std::move(undefined));
    }
    withheld_.clear();
}

void Executor::note_transfer(const rhi::CommandHeader& header, const std::byte* payload) {
    const auto as = [&]<typename T>(std::type_identity<T>) -> const T& { return *reinterpret_cast<const T*>(payload); };
    const auto checked_buffer = [](const rhi::BufferReference& reference) {
        return static_cast<CpuBuffer*>(reference.object)->checked.get();
    };
#define NACRE_COMMAND(type) as(std::type_identity<rhi::type>{})
    switch (header.type) {
        case CommandType::copy_buffer: {
            const auto& command = NACRE_COMMAND(CopyBufferCommand);
            CheckedMemory *from = checked_buffer(command.source), *to = checked_buffer(command.destination);
            if (from && to)
                to->copy_definedness(command.destination_offset, *from, command.source_offset, command.size);
            return;
        }
        case CommandType::fill_buffer: {
            const auto& command = NACRE_COMMAND(FillBufferCommand);
            if (CheckedMemory* to = checked_buffer(command.buffer)) to->define(command.offset, command.size);
            return;
        }
        case CommandType::copy_buffer_to_texture:
        case CommandType::copy_texture_to_buffer: {
            const bool to_texture = header.type == CommandType::copy_buffer_to_texture;
            const auto& up = NACRE_COMMAND(CopyBufferToTextureCommand);
            const auto& down = NACRE_COMMAND(CopyTextureToBufferCommand);
            const CpuTexture& texture = texture_of(to_texture ? up.destination : down.source);
            CheckedMemory* buffer = checked_buffer(to_texture ? up.source : down.destination);
            const rhi::BufferTextureCopy& region = to_texture ? up.region : down.region;
            if (!buffer || !texture.checked) return;
            const ImageView& view = texture.whole();
            const ImageLevel& level = view.levels[region.mip];
            const std::uint32_t edge = rhi::info(view.format).block_width;
            const std::uint64_t row_bytes = std::uint64_t{(region.extent.width + edge - 1) / edge} * view.texel_bytes;
            for (std::uint32_t slice = 0; slice < region.extent.depth; ++slice)
                for (std::uint32_t row = 0; row < (region.extent.height + edge - 1) / edge; ++row) {
                    const std::byte* texels = level.data + region.layer * level.layer_stride +
                                              (region.offset.z + slice) * level.slice_stride +
                                              std::uint64_t{region.offset.y / edge + row} * level.row_stride +
                                              std::uint64_t{region.offset.x / edge} * view.texel_bytes;
                    const std::uint64_t in_buffer =
                        region.buffer_offset +
                        (std::uint64_t{slice} * region.rows_per_slice + row) * region.bytes_per_row;
                    const auto in_texture = texture.checked->offset_of(texels);
                    if (!in_texture) continue;
                    if (to_texture)
                        texture.checked->copy_definedness(*in_texture, *buffer, in_buffer, row_bytes);
                    else
                        buffer->copy_definedness(in_buffer, *texture.checked, *in_texture, row_bytes);
                }
            return;
        }
        case CommandType::copy_texture: {
            const auto& command = NACRE_COMMAND(CopyTextureCommand);
            const CpuTexture &from = texture_of(command.source), &to = texture_of(command.destination);
            const rhi::TextureCopy& region = command.region;
            if (!from.checked || !to.checked) return;
            const std::uint32_t edge = rhi::info(from.desc.format).block_width;
            const auto copy_plane = [&](const ImageLevel& source, const ImageLevel& destination,
                                        std::uint32_t texel_bytes) {
                if (!source.data || !destination.data) return;
                const std::uint64_t row_bytes = std::uint64_t{(region.extent.width + edge - 1) / edge} * texel_bytes;
                const auto place = [&](const ImageLevel& level, std::uint32_t first_layer, const rhi::Offset3D& offset,
                                       std::uint32_t layer, std::uint32_t slice, std::uint32_t row) {
                    return level.data + (first_layer + layer) * level.layer_stride +
                           (offset.z + slice) * level.slice_stride +
                           std::uint64_t{offset.y / edge + row} * level.row_stride +
                           std::uint64_t{offset.x / edge} * texel_bytes;
                };
                for (std::uint32_t layer = 0; layer < region.layer_count; ++layer)
                    for (std::uint32_t slice = 0; slice < region.extent.depth; ++slice)
                        for (std::uint32_t row = 0; row < (region.extent.height + edge - 1) / edge; ++row) {
                            const auto at = from.checked->offset_of(
                                place(source, region.source_layer, region.source_offset, layer, slice, row));
                            const auto into = to.checked->offset_of(place(
                                destination, region.destination_layer, region.destination_offset, layer, slice, row));
                            if (at && into) to.checked->copy_definedness(*into, *from.checked, *at, row_bytes);
                        }
            };
            const ImageView &source = from.whole(), &destination = to.whole();
            copy_plane(source.levels[region.source_mip], destination.levels[region.destination_mip],
                       source.texel_bytes);
            copy_plane(source.stencil_levels[region.source_mip], destination.stencil_levels[region.destination_mip], 1);
            return;
        }
        case CommandType::clear_texture:
        case CommandType::clear_depth_stencil: {
            const rhi::ViewReference& reference = header.type == CommandType::clear_texture
                                                      ? NACRE_COMMAND(ClearTextureCommand).view
                                                      : NACRE_COMMAND(ClearDepthStencilCommand).view;
            const CpuTexture& texture = texture_of(reference.texture);
            if (!texture.checked) return;
            const ImageView view = texture.make_view(reference);
            define_view(*texture.checked, view, false, true);
            define_view(*texture.checked, view, true, true);
            return;
        }
        case CommandType::generate_mips: {
            const CpuTexture& texture = texture_of(NACRE_COMMAND(GenerateMipsCommand).texture);
            if (texture.checked) define_view(*texture.checked, texture.whole(), false, true);
            return;
        }
        default: return;
    }
#undef NACRE_COMMAND
}

void Executor::note_pass_begin(const rhi::BeginRenderPassCommand& command) {
    begin_scope();
    attachments_.clear();
    const bool follows_content = (checks_.flags & (check_sanitize | check_hostile)) != 0;
    const auto is_unwritten = [](const Attachment& attachment, bool stencil) {
        return !has_defined(*attachment.checked, attachment.view, stencil);
    };
    for (std::uint32_t i = 0; i < command.color_count; ++i) {
        const rhi::ColorAttachmentCommand& color = command.colors()[i];
        if (!color.view.texture.object) continue;
        Attachment attachment;
        attachment.view = targets_.colors[i];
        attachment.checked = texture_of(color.view.texture).checked.get();
        attachment.is_discarded = color.store == rhi::StoreOperation::discard;
        if (!attachment.checked) continue;
        if (color.load == rhi::LoadOperation::clear) define_view(*attachment.checked, attachment.view, false, true);
        if (color.load == rhi::LoadOperation::discard) discard_view(*attachment.checked, attachment.view, false);
        if (color.load == rhi::LoadOperation::load && follows_content && is_unwritten(attachment, false))
            add_undefined("begin render pass", fmt::format("in {}", place()), "content to load",
                          fmt::format("all of {}", attachment.checked->name()));
        attachments_.push_back(attachment);
        if (!color.resolve.texture.object) continue;
        // All of a resolve target is written, whatever the samples hold.
        Attachment resolve;
        resolve.view = texture_of(color.resolve.texture).make_view(color.resolve);
        resolve.checked = texture_of(color.resolve.texture).checked.get();
        if (resolve.checked) define_view(*resolve.checked, resolve.view, false, true);
    }
    if (!command.has_depth_stencil) return;
    Attachment attachment;
    attachment.view = targets_.depth_stencil;
    attachment.checked = texture_of(command.depth_stencil.texture).checked.get();
    attachment.is_depth = true;
    attachment.is_discarded = command.depth_store == rhi::StoreOperation::discard && !command.read_only;
    attachment.is_stencil_discarded = command.stencil_store == rhi::StoreOperation::discard && !command.read_only;
    if (!attachment.checked) return;
    const auto begin_plane = [&](rhi::LoadOperation load, bool stencil) {
        if (command.read_only) return;
        if (load == rhi::LoadOperation::clear) define_view(*attachment.checked, attachment.view, stencil, true);
        if (load == rhi::LoadOperation::discard) discard_view(*attachment.checked, attachment.view, stencil);
    };
    const auto loads_nothing = [&](rhi::LoadOperation load, bool stencil) {
        return follows_content && (load == rhi::LoadOperation::load || command.read_only) &&
               is_unwritten(attachment, stencil);
    };
    const rhi::FormatInfo& format = rhi::info(attachment.view.format);
    attachment.loads_nothing = format.has_depth && loads_nothing(command.depth_load, false);
    attachment.loads_no_stencil = format.has_stencil && loads_nothing(command.stencil_load, true);
    begin_plane(command.depth_load, false);
    begin_plane(command.stencil_load, true);
    attachments_.push_back(attachment);
}

void Executor::note_pass_end() {
    for (const Attachment& attachment : attachments_) {
        if (attachment.checked->has_undefined()) {
            define_written(*attachment.checked, attachment.view);
            if (attachment.is_depth) define_view(*attachment.checked, attachment.view, true, true);
        }
        if (attachment.is_discarded) discard_view(*attachment.checked, attachment.view, false);
        if (attachment.is_stencil_discarded) discard_view(*attachment.checked, attachment.view, true);
    }
    attachments_.clear();
    forget_checks();
}

}  // namespace nacre::cpu
