// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/texture.h"

#include <fmt/format.h>

#include <algorithm>

namespace nacre::gl {
namespace {

std::uint64_t texture_bytes(const rhi::TextureDesc& desc) {
    const rhi::FormatInfo& facts = rhi::info(desc.format);
    // 24-bit depth with stencil packs into 4 bytes, 32-bit depth with stencil takes 8.
    const std::uint64_t block = desc.format == rhi::Format::d32_float_s8_uint ? 8 : facts.block_bytes;
    std::uint64_t total = 0;
    for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
        const std::uint64_t width = std::max(1u, desc.width >> mip), height = std::max(1u, desc.height >> mip);
        const std::uint64_t depth = std::max(1u, desc.depth >> mip), edge = facts.block_width;
        total += ((width + edge - 1) / edge) * ((height + edge - 1) / edge) * depth * block;
    }
    return total * desc.layers * desc.samples;
}

std::unexpected<Error> out_of_memory(const rhi::TextureDesc& desc) {
    return fail(ErrorCode::out_of_memory, "create texture", fmt::format("'{}'", desc.name),
                fmt::format("the driver could not allocate {} bytes for {}x{}x{} texels, {} layers, {} mips of {}",
                            texture_bytes(desc), desc.width, desc.height, desc.depth, desc.layers, desc.mips,
                            rhi::info(desc.format).name),
                "Free other resources or use a smaller texture.");
}

void allocate(const Functions& gl, GLenum target, GLenum internal, const rhi::TextureDesc& desc) {
    const auto mips = static_cast<GLsizei>(desc.mips), width = static_cast<GLsizei>(desc.width);
    const auto height = static_cast<GLsizei>(desc.height), depth = static_cast<GLsizei>(desc.depth);
    const auto layers = static_cast<GLsizei>(desc.layers), samples = static_cast<GLsizei>(desc.samples);
    switch (target) {
        case GL_TEXTURE_1D: gl.TexStorage1D(target, mips, internal, width); break;
        case GL_TEXTURE_1D_ARRAY: gl.TexStorage2D(target, mips, internal, width, layers); break;
        case GL_TEXTURE_2D:
        case GL_TEXTURE_CUBE_MAP: gl.TexStorage2D(target, mips, internal, width, height); break;
        case GL_TEXTURE_2D_ARRAY:
        case GL_TEXTURE_CUBE_MAP_ARRAY: gl.TexStorage3D(target, mips, internal, width, height, layers); break;
        case GL_TEXTURE_3D: gl.TexStorage3D(target, mips, internal, width, height, depth); break;
        case GL_TEXTURE_2D_MULTISAMPLE:
            gl.TexStorage2DMultisample(target, samples, internal, width, height, GL_TRUE);
            break;
        case GL_TEXTURE_2D_MULTISAMPLE_ARRAY:
            gl.TexStorage3DMultisample(target, samples, internal, width, height, layers, GL_TRUE);
            break;
        default: break;
    }
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendTexture>> GlTexture::create(const DriverPointer& driver,
                                                                 const rhi::TextureDesc& desc) {
    if (driver->allocation_fails()) return out_of_memory(desc);
    auto texture = std::make_unique<GlTexture>(driver);
    texture->desc = desc;
    texture->target = texture_target(desc, driver->traits);
    if (texture->target == GL_TEXTURE_2D_MULTISAMPLE_ARRAY && !driver->traits.multisample_arrays)
        return fail(ErrorCode::unsupported, "create texture", fmt::format("'{}'", desc.name),
                    "this OpenGL ES has no arrays of multisampled textures", "Use one texture for each layer.");
    texture->id = driver->next_id();
    const GLenum error = driver->worker->run([&] {
        const Functions& gl = driver->gl;
        gl.GenTextures(1, &texture->name);
        driver->bind_scratch_texture(texture->target, texture->name);
        const GLenum result =
            driver->error_of([&] { allocate(gl, texture->target, gl_format(desc.format).internal, desc); });
        if (result == GL_NO_ERROR) driver->label(GL_TEXTURE, texture->name, desc.name);
        return result;
    });
    if (error == GL_OUT_OF_MEMORY) return out_of_memory(desc);
    if (error != GL_NO_ERROR)
        return fail(
            ErrorCode::unsupported, "create texture", fmt::format("'{}'", desc.name),
            fmt::format("the driver refuses {}x{}x{} texels, {} layers, {} mips, {} samples of {} (error 0x{:04x})",
                        desc.width, desc.height, desc.depth, desc.layers, desc.mips, desc.samples,
                        rhi::info(desc.format).name, error),
            "Choose another format or size; see the device's capabilities.");
    texture->memory_bytes = texture_bytes(desc);
    driver->reserved_bytes += texture->memory_bytes;
    ++driver->allocations;
    return texture;
}

GlTexture::~GlTexture() {
    if (memory_bytes) {
        driver_->reserved_bytes -= memory_bytes;
        --driver_->allocations;
    }
    if (!name) return;
    driver_->worker->post([driver = driver_.get(), deleted = name, number = id, views = std::move(views_)] {
        driver->forget_texture(number);
        for (const auto& [key, view] : views) driver->gl.DeleteTextures(1, &view.name);
        driver->gl.DeleteTextures(1, &deleted);
    });
}

GLenum GlTexture::target_of(const rhi::ViewReference& reference) const {
    if (reference.dimension == rhi::ViewDimension::d1 && target == GL_TEXTURE_2D) return target;
    return view_target(reference.dimension, desc.samples > 1, driver_->traits);
}

bool GlTexture::can_view(const rhi::ViewReference& reference) const {
    if (driver_->traits.texture_view) return true;
    return target_of(reference) == target && reference.format == desc.format && reference.base_layer == 0 &&
           (reference.layer_count == desc.layers || target == GL_TEXTURE_3D);
}

GlTexture::Name GlTexture::view(const rhi::ViewReference& reference) {
    ViewKey key{target_of(reference), reference.format,      reference.base_mip,
                reference.mip_count,  reference.base_layer, reference.layer_count};
    if (target == GL_TEXTURE_3D) key.base_layer = 0, key.layer_count = 1;
    const std::uint32_t layers = target == GL_TEXTURE_3D ? 1 : desc.layers;
    const bool whole_layers = key.target == target && key.format == desc.format && key.base_layer == 0 &&
                              key.layer_count == layers;
    if (whole_layers && key.base_mip == 0 && key.mip_count == desc.mips) {
        if (!driver_->traits.texture_view) show_all_mips();
        return {name, target, id};
    }
    if (driver_->traits.texture_view) return make_view(key);
    if (shown_base_ != key.base_mip || shown_count_ != key.mip_count) {
        driver_->bind_scratch_texture(target, name);
        driver_->gl.TexParameteri(target, GL_TEXTURE_BASE_LEVEL, static_cast<GLint>(key.base_mip));
        driver_->gl.TexParameteri(target, GL_TEXTURE_MAX_LEVEL, static_cast<GLint>(key.base_mip + key.mip_count - 1));
        shown_base_ = key.base_mip, shown_count_ = key.mip_count;
    }
    return {name, target, id};
}

void GlTexture::show_all_mips() {
    if (shown_count_ == 0) return;
    driver_->bind_scratch_texture(target, name);
    driver_->gl.TexParameteri(target, GL_TEXTURE_BASE_LEVEL, 0);
    driver_->gl.TexParameteri(target, GL_TEXTURE_MAX_LEVEL, 1000);
    shown_base_ = shown_count_ = 0;
}

GlTexture::Name GlTexture::reinterpret(rhi::Format format) {
    if (format == desc.format || !driver_->traits.texture_view) return {name, target, id};
    return make_view({target, format, 0, desc.mips, 0, target == GL_TEXTURE_3D ? 1 : desc.layers});
}

GlTexture::Name GlTexture::make_view(const ViewKey& key) {
    const auto [found, is_new] = views_.try_emplace(key);
    Name& view = found->second;
    if (is_new) {
        const Functions& gl = driver_->gl;
        gl.GenTextures(1, &view.name);
        view.target = key.target;
        view.id = driver_->next_id();
        const GLenum error = driver_->error_of([&] {
            gl.TextureView(view.name, key.target, name, gl_format(key.format).internal, key.base_mip, key.mip_count,
                           key.base_layer, key.layer_count);
        });
        if (error != GL_NO_ERROR)
            driver_->warn(rhi::MessageSeverity::error, "texture-view",
                          fmt::format("texture '{}': the driver refuses a view of mips {}+{}, layers {}+{} as {} "
                                      "(error 0x{:04x})",
                                      desc.name, key.base_mip, key.mip_count, key.base_layer, key.layer_count,
                                      rhi::info(key.format).name, error));
    }
    return view;
}

Driver::FramebufferKey::Attachment GlTexture::attachment(std::uint32_t mip, std::uint32_t layer, rhi::Format format) {
    const Name shown = reinterpret(format);
    return {id, shown.name, target, mip, layer};
}

}  // namespace nacre::gl
