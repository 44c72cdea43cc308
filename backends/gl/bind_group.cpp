// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/bind_group.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "rhi/binding_type.h"

namespace nacre::gl {

GlBindGroupLayout::GlBindGroupLayout(const rhi::BindGroupLayoutDesc& layout_desc) {
    desc = layout_desc;
    std::ranges::sort(desc.bindings, {}, &rhi::BindingLayout::binding);
}

std::int32_t GlBindGroupLayout::position(const rhi::BindGroupLayoutDesc& desc, std::uint32_t binding) {
    std::uint32_t next = 0;
    for (const rhi::BindingLayout& layout : desc.bindings) {
        if (layout.binding == binding) return static_cast<std::int32_t>(next);
        next += layout.count;
    }
    return -1;
}

Expected<std::unique_ptr<rhi::BackendBindGroup>> GlBindGroup::create(const DriverPointer& driver,
                                                                     rhi::BackendBindGroupLayout& layout,
                                                                     std::span<const rhi::BackendBinding> bindings,
                                                                     const std::string& name) {
    auto group = std::make_unique<GlBindGroup>(driver);
    group->layout = &layout;
    std::uint32_t total = 0;
    for (const rhi::BindingLayout& binding : layout.desc.bindings) total += binding.count;
    group->entries.resize(total);
    for (const rhi::BackendBinding& binding : bindings) {
        const std::int32_t position = GlBindGroupLayout::position(layout.desc, binding.binding);
        const std::size_t at = static_cast<std::size_t>(position) + binding.element;
        if (position < 0 || at >= group->entries.size()) continue;
        Entry& entry = group->entries[at];
        entry.buffer = static_cast<GlBuffer*>(binding.buffer);
        entry.offset = binding.offset;
        entry.size = binding.size;
        entry.format = binding.format;
        entry.sampler = static_cast<GlSampler*>(binding.sampler);
        if (!rhi::has_texture(binding.type)) continue;
        entry.texture = static_cast<GlTexture*>(binding.view.texture.object);
        entry.view = binding.view;
        const bool sampled = rhi::is_sampled(binding.type);
        if (sampled && entry.texture && !entry.texture->can_view(binding.view))
            return fail(
                ErrorCode::unsupported, "create bind group",
                fmt::format("'{}', binding {}, texture '{}'", name, binding.binding, entry.texture->desc.name),
                "this OpenGL ES has no texture views: only all layers, in the texture's own dimension and format, "
                "can be sampled",
                "Bind the whole texture and choose the layer in the shader.");
        // Parameters of the texture itself stand in for views there, so only one range of mips can be seen at a time.
        if (sampled && entry.texture && !entry.texture->can_show_ranges())
            for (const Entry& other : group->entries)
                if (&other != &entry && other.texture == entry.texture &&
                    (other.view.base_mip != entry.view.base_mip || other.view.mip_count != entry.view.mip_count))
                    return fail(
                        ErrorCode::unsupported, "create bind group",
                        fmt::format("'{}', binding {}, texture '{}'", name, binding.binding, entry.texture->desc.name),
                        "this OpenGL ES has no texture views: two different ranges of mips of one texture cannot be "
                        "sampled at the same time",
                        "Bind one range, and choose the mip in the shader.");
    }
    return group;
}

GlTexture::Name GlBindGroup::texels(Entry& entry) {
    if (entry.shown.name != 0) return entry.shown;
    const Functions& gl = driver_->gl;
    entry.shown.target = GL_TEXTURE_BUFFER;
    entry.shown.id = driver_->next_id();
    gl.GenTextures(1, &entry.shown.name);
    driver_->bind_scratch_texture(GL_TEXTURE_BUFFER, entry.shown.name);
    const GLenum error = driver_->error_of([&] {
        gl.TexBufferRange(GL_TEXTURE_BUFFER, gl_format(entry.format).internal, entry.buffer->name,
                          static_cast<GLintptr>(entry.offset), static_cast<GLsizeiptr>(entry.size));
    });
    if (error != GL_NO_ERROR)
        driver_->warn(rhi::MessageSeverity::error, "texel-buffer",
                      fmt::format("buffer '{}': the driver refuses {} bytes from offset {} as elements of {} (error "
                                  "0x{:04x})",
                                  entry.buffer->desc.name, entry.size, entry.offset, rhi::info(entry.format).name,
                                  error));
    return entry.shown;
}

GlBindGroup::~GlBindGroup() {
    std::vector<GLuint> names;
    for (const Entry& entry : entries)
        if (entry.format != rhi::Format::undefined && entry.shown.name != 0) names.push_back(entry.shown.name);
    if (names.empty()) return;
    driver_->worker->post([driver = driver_.get(), deleted = std::move(names)] {
        driver->gl.DeleteTextures(static_cast<GLsizei>(deleted.size()), deleted.data());
    });
}

}  // namespace nacre::gl
