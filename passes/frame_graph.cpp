// SPDX-License-Identifier: Apache-2.0
#include "passes/frame_graph.h"

#include <algorithm>
#include <fmt/format.h>

namespace nacre::passes {

using rhi::has_any;
using rhi::ResourceUse;

namespace {

rhi::TextureUsage usage_of(ResourceUse use) {
    rhi::TextureUsage usage = rhi::TextureUsage::none;
    if (has_any(use, ResourceUse::sampled)) usage |= rhi::TextureUsage::sampled;
    if (has_any(use, ResourceUse::storage_read | ResourceUse::storage_write)) usage |= rhi::TextureUsage::storage;
    if (has_any(use, ResourceUse::color_target | ResourceUse::resolve_source | ResourceUse::resolve_destination)) {
        usage |= rhi::TextureUsage::color_target;
    }
    if (has_any(use, ResourceUse::depth_stencil_write | ResourceUse::depth_stencil_read)) {
        usage |= rhi::TextureUsage::depth_target;
    }
    if (has_any(use, ResourceUse::copy_source)) usage |= rhi::TextureUsage::copy_source;
    if (has_any(use, ResourceUse::copy_destination)) usage |= rhi::TextureUsage::copy_destination;
    return usage;
}

rhi::BufferUsage buffer_usage_of(ResourceUse use) {
    rhi::BufferUsage usage = rhi::BufferUsage::none;
    if (has_any(use, ResourceUse::vertex_buffer)) usage |= rhi::BufferUsage::vertex;
    if (has_any(use, ResourceUse::index_buffer)) usage |= rhi::BufferUsage::index;
    if (has_any(use, ResourceUse::indirect_argument)) usage |= rhi::BufferUsage::indirect;
    if (has_any(use, ResourceUse::uniform_buffer)) usage |= rhi::BufferUsage::uniform;
    if (has_any(use, ResourceUse::storage_read | ResourceUse::storage_write)) usage |= rhi::BufferUsage::storage;
    if (has_any(use, ResourceUse::copy_source)) usage |= rhi::BufferUsage::copy_source;
    if (has_any(use, ResourceUse::copy_destination)) usage |= rhi::BufferUsage::copy_destination;
    return usage;
}

bool can_share(const rhi::TextureDesc& a, const rhi::TextureDesc& b) {
    return a.dimension == b.dimension && a.format == b.format && a.width == b.width && a.height == b.height &&
           a.depth == b.depth && a.layers == b.layers && a.mips == b.mips && a.samples == b.samples;
}

}  // namespace

std::uint64_t texture_bytes(const rhi::TextureDesc& desc) {
    std::uint64_t bytes = 0;
    for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
        const rhi::FormatInfo& format = rhi::info(desc.format);
        const std::uint64_t width = std::max(desc.width >> mip, 1u), height = std::max(desc.height >> mip, 1u);
        const std::uint64_t blocks = ((width + format.block_width - 1) / format.block_width) *
                                     ((height + format.block_width - 1) / format.block_width);
        bytes += blocks * std::max(desc.depth >> mip, 1u) * format.block_bytes;
    }
    return bytes * desc.layers * desc.samples;
}

rhi::Texture PassContext::texture(TextureId id) const { return graph.texture(id); }
rhi::Buffer PassContext::buffer(BufferId id) const { return graph.buffer(id); }

PassDeclaration& PassDeclaration::uses(TextureId texture, ResourceUse use) {
    if (texture) graph_->passes_[pass_].accesses.push_back({.is_texture = true, .resource = texture.index, .use = use});
    return *this;
}

PassDeclaration& PassDeclaration::uses(BufferId buffer, ResourceUse use) {
    if (buffer) graph_->passes_[pass_].accesses.push_back({.is_texture = false, .resource = buffer.index, .use = use});
    return *this;
}

PassDeclaration& PassDeclaration::only_if(std::size_t count, std::function<bool()> condition) {
    std::vector<FrameGraph::Access>& accesses = graph_->passes_[pass_].accesses;
    for (std::size_t i = accesses.size() - std::min(count, accesses.size()); i < accesses.size(); ++i) {
        accesses[i].condition = condition;
    }
    return *this;
}

PassDeclaration& PassDeclaration::always() {
    graph_->passes_[pass_].always = true;
    return *this;
}

PassDeclaration& PassDeclaration::records(std::function<void(PassContext&)> function) {
    graph_->passes_[pass_].function = std::move(function);
    return *this;
}

FrameGraph::~FrameGraph() {
    if (device_ == nullptr) return;
    for (const TextureNode& node : textures_) {
        if (!node.imported && node.shares_with == ~0u && node.handle) device_->destroy(node.handle);
    }
    for (const BufferNode& node : buffers_) {
        if (!node.imported && node.handle) device_->destroy(node.handle);
    }
}

TextureId FrameGraph::add_texture(const rhi::TextureDesc& desc) {
    textures_.push_back({.desc = desc, .bytes = texture_bytes(desc)});
    return {static_cast<std::uint32_t>(textures_.size() - 1)};
}

TextureId FrameGraph::import_texture(rhi::Texture texture, const rhi::TextureDesc& desc, bool is_detail) {
    textures_.push_back(
        {.desc = desc, .handle = texture, .imported = true, .is_detail = is_detail, .bytes = texture_bytes(desc)});
    return {static_cast<std::uint32_t>(textures_.size() - 1)};
}

BufferId FrameGraph::add_buffer(const rhi::BufferDesc& desc) {
    buffers_.push_back({.desc = desc});
    return {static_cast<std::uint32_t>(buffers_.size() - 1)};
}

BufferId FrameGraph::import_buffer(rhi::Buffer buffer, const rhi::BufferDesc& desc, bool is_detail) {
    buffers_.push_back({.desc = desc, .handle = buffer, .imported = true, .is_detail = is_detail});
    return {static_cast<std::uint32_t>(buffers_.size() - 1)};
}

PassDeclaration FrameGraph::add_pass(std::string name) {
    passes_.push_back({.name = std::move(name)});
    return {*this, static_cast<std::uint32_t>(passes_.size() - 1)};
}

void FrameGraph::keep(TextureId texture) {
    if (texture) textures_[texture.index].kept = true;
}

void FrameGraph::keep(BufferId buffer) {
    if (buffer) buffers_[buffer.index].kept = true;
}

void FrameGraph::do_not_share(TextureId texture) {
    if (texture) textures_[texture.index].unshared = true;
}

Expected<void> FrameGraph::compile() {
    find_live_passes();

    // Lives, usages, and whether everything is written before it is read.
    std::vector<bool> texture_written(textures_.size()), buffer_written(buffers_.size());
    for (std::uint32_t index = 0; index < passes_.size(); ++index) {
        const Pass& pass = passes_[index];
        if (!pass.is_live) continue;
        for (const bool writes : {false, true}) {
            for (const Access& access : pass.accesses) {
                if (has_any(access.use, rhi::writing_uses) != writes) continue;
                if (access.is_texture) {
                    TextureNode& node = textures_[access.resource];
                    node.first_pass = std::min(node.first_pass, index);
                    node.last_pass = std::max(node.last_pass, index);
                    if (!node.imported) node.desc.usage |= usage_of(access.use);
                    if (writes) texture_written[access.resource] = true;
                } else {
                    BufferNode& node = buffers_[access.resource];
                    node.first_pass = std::min(node.first_pass, index);
                    node.last_pass = std::max(node.last_pass, index);
                    if (!node.imported) node.desc.usage |= buffer_usage_of(access.use);
                    if (writes) buffer_written[access.resource] = true;
                }
            }
        }
        for (const Access& access : pass.accesses) {
            const bool ready = access.is_texture
                                   ? textures_[access.resource].imported || texture_written[access.resource]
                                   : buffers_[access.resource].imported || buffer_written[access.resource];
            if (ready) continue;
            const std::string& name =
                access.is_texture ? textures_[access.resource].desc.name : buffers_[access.resource].desc.name;
            return fail(ErrorCode::invalid_argument, "compile frame graph", fmt::format("pass '{}'", pass.name),
                        fmt::format("it reads '{}', which no earlier pass writes", name),
                        "Declare the pass that writes it before, or import it.");
        }
    }
    for (TextureNode& node : textures_) {
        if (node.kept || node.unshared) node.desc.usage |= rhi::TextureUsage::copy_source;
    }
    share_memory();
    return {};
}

void FrameGraph::find_live_passes() {
    // Backwards: a pass is needed when it writes what is needed; then all that it reads is needed. Writes never end a
    // need, since a pass may cover a resource only in part.
    std::vector<bool> texture_needed(textures_.size()), buffer_needed(buffers_.size());
    for (std::size_t i = 0; i < textures_.size(); ++i) texture_needed[i] = textures_[i].kept;
    for (std::size_t i = 0; i < buffers_.size(); ++i) buffer_needed[i] = buffers_[i].kept;
    for (auto pass = passes_.rbegin(); pass != passes_.rend(); ++pass) {
        pass->is_live =
            pass->always || std::ranges::any_of(pass->accesses, [&](const Access& access) {
                return has_any(access.use, rhi::writing_uses) &&
                       (access.is_texture ? texture_needed[access.resource] : buffer_needed[access.resource]);
            });
        if (!pass->is_live) continue;
        for (const Access& access : pass->accesses) {
            if (access.is_texture) {
                texture_needed[access.resource] = true;
            } else {
                buffer_needed[access.resource] = true;
            }
        }
    }
}

void FrameGraph::share_memory() {
    // First fit in the order of first use; `owners` are textures with memory, and when it becomes free.
    struct Owner {
        std::uint32_t texture, free_after;
    };
    std::vector<Owner> owners;
    std::vector<std::uint32_t> order;
    for (std::uint32_t i = 0; i < textures_.size(); ++i) {
        if (textures_[i].is_live() && !textures_[i].imported) order.push_back(i);
    }
    std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return textures_[i].first_pass; });
    for (const std::uint32_t index : order) {
        TextureNode& node = textures_[index];
        const bool alone = node.kept || node.unshared;
        const auto owner = std::ranges::find_if(owners, [&](const Owner& candidate) {
            return candidate.free_after < node.first_pass && can_share(textures_[candidate.texture].desc, node.desc);
        });
        if (!alone && owner != owners.end()) {
            node.shares_with = owner->texture;
            owner->free_after = node.last_pass;
            textures_[owner->texture].desc.usage |= node.desc.usage;
        } else {
            owners.push_back({index, alone ? ~0u : node.last_pass});
        }
    }
}

Expected<void> FrameGraph::realize(rhi::Device& device) {
    device_ = &device;
    for (TextureNode& node : textures_) {
        if (node.imported || !node.is_live() || node.shares_with != ~0u) continue;
        NACRE_TRY(node.handle, device.create_texture(node.desc));
    }
    for (TextureNode& node : textures_) {
        if (node.shares_with != ~0u) node.handle = textures_[node.shares_with].handle;
    }
    for (BufferNode& node : buffers_) {
        if (node.imported || !node.is_live()) continue;
        NACRE_TRY(node.handle, device.create_buffer(node.desc));
    }
    return {};
}

void FrameGraph::record(rhi::CommandList& list, rhi::QueryPool timestamps) const {
    PassContext context{list, *this};
    std::vector<rhi::StatedAccess> statement;
    std::uint32_t live_index = 0;
    for (const Pass& pass : passes_) {
        if (!pass.is_live) continue;
        statement.clear();
        for (const Access& access : pass.accesses) {
            if (access.condition && !access.condition()) continue;
            rhi::StatedAccess stated{.use = access.use};
            if (access.is_texture) {
                stated.texture = textures_[access.resource].handle;
            } else {
                stated.buffer = buffers_[access.resource].handle;
            }
            statement.push_back(stated);
        }
        list.push_debug_group(pass.name);
        if (timestamps) list.write_timestamp(timestamps, 2 * live_index);
        list.begin_statement(pass.name, statement);
        if (pass.function) pass.function(context);
        list.end_statement();
        if (timestamps) list.write_timestamp(timestamps, 2 * live_index + 1);
        list.pop_debug_group();
        ++live_index;
    }
}

std::string FrameGraph::writers_of(TextureId id) const {
    std::string names;
    for (const Pass& pass : passes_) {
        if (!pass.is_live) continue;
        for (const Access& access : pass.accesses) {
            if (!access.is_texture || access.resource != id.index || !has_any(access.use, rhi::writing_uses)) continue;
            names += (names.empty() ? "" : ", ") + pass.name;
            break;
        }
    }
    return names;
}

std::uint64_t FrameGraph::transient_bytes() const {
    std::uint64_t bytes = 0;
    for (const TextureNode& node : textures_) {
        if (!node.imported && node.is_live() && node.shares_with == ~0u) bytes += node.bytes;
    }
    for (const BufferNode& node : buffers_) {
        if (!node.imported && node.is_live()) bytes += node.desc.size;
    }
    return bytes;
}

std::uint64_t FrameGraph::transient_bytes_unshared() const {
    std::uint64_t bytes = transient_bytes();
    for (const TextureNode& node : textures_) {
        if (!node.imported && node.is_live() && node.shares_with != ~0u) bytes += node.bytes;
    }
    return bytes;
}

}  // namespace nacre::passes
