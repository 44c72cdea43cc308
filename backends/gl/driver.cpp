// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/driver.h"

#include <fmt/format.h>

#include "core/hash.h"

namespace nacre::gl {

Driver::~Driver() {
    if (!worker) return;
    worker->post([this] {
        for (const auto& [key, name] : framebuffers_) gl.DeleteFramebuffers(1, &name);
        context->release();
    });
    worker.reset();
}

void Driver::label(GLenum kind, GLuint name, const std::string& text) const {
    if (debug_names && traits.debug_output && !text.empty() && gl.ObjectLabel)
        gl.ObjectLabel(kind, name, static_cast<GLsizei>(std::min<std::size_t>(text.size(), 200)), text.c_str());
}

void Driver::prepare() {
    GLint units = 0, uniform_buffers = 0, storage_buffers = 0, images = 0;
    gl.GetIntegerv(GL_MAX_COMBINED_TEXTURE_IMAGE_UNITS, &units);
    gl.GetIntegerv(GL_MAX_UNIFORM_BUFFER_BINDINGS, &uniform_buffers);
    gl.GetIntegerv(GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS, &storage_buffers);
    gl.GetIntegerv(GL_MAX_IMAGE_UNITS, &images);
    scratch_unit = static_cast<GLuint>(units) - 1;
    bound.textures.resize(static_cast<std::size_t>(units));
    bound.samplers.resize(static_cast<std::size_t>(units));
    bound.uniform_buffers.resize(static_cast<std::size_t>(uniform_buffers));
    bound.storage_buffers.resize(static_cast<std::size_t>(storage_buffers));
    bound.images.resize(static_cast<std::size_t>(images));
    gl.GenFramebuffers(2, scratch_framebuffers);
    gl.GenSamplers(1, &nearest_sampler);
    gl.SamplerParameteri(nearest_sampler, GL_TEXTURE_MIN_FILTER, GL_NEAREST_MIPMAP_NEAREST);
    gl.SamplerParameteri(nearest_sampler, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
    // Row 0 of memory is both OpenGL's lowest row and the RHI's top row, so no picture is ever turned over: with the
    // origin at the lower left, y of clip space, gl_FragCoord and texel addresses agree with Vulkan's as they are.
    if (traits.clip_control) gl.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    if (traits.desktop) {
        gl.Enable(GL_PROGRAM_POINT_SIZE);
        gl.Enable(GL_FRAMEBUFFER_SRGB);
        gl.Enable(GL_TEXTURE_CUBE_MAP_SEAMLESS);
        gl.ProvokingVertex(GL_FIRST_VERTEX_CONVENTION);
        gl.PointParameteri(GL_POINT_SPRITE_COORD_ORIGIN, GL_LOWER_LEFT);
    }
}

std::size_t Driver::KeyHash::operator()(const FramebufferKey& key) const {
    Hasher hasher;
    const auto add = [&](const FramebufferKey::Attachment& attachment) {
        hasher.add(attachment.texture).add(attachment.name).add(attachment.mip).add(attachment.layer);
    };
    for (std::uint32_t i = 0; i < key.color_count; ++i) add(key.colors[i]);
    add(key.depth_stencil);
    return static_cast<std::size_t>(hasher.finish64());
}

void Driver::attach(GLenum target, GLenum point, const FramebufferKey::Attachment& attachment) const {
    const auto mip = static_cast<GLint>(attachment.mip);
    switch (attachment.target) {
        case GL_TEXTURE_1D:
            gl.FramebufferTexture1D(target, point, attachment.target, attachment.name, mip);
            break;
        case 0:
            gl.FramebufferTexture2D(target, point, GL_TEXTURE_2D, 0, 0);
            break;
        case GL_TEXTURE_2D:
        case GL_TEXTURE_2D_MULTISAMPLE:
            gl.FramebufferTexture2D(target, point, attachment.target, attachment.name, mip);
            break;
        case GL_TEXTURE_CUBE_MAP:
            gl.FramebufferTexture2D(target, point, GL_TEXTURE_CUBE_MAP_POSITIVE_X + attachment.layer, attachment.name,
                                    mip);
            break;
        default:
            gl.FramebufferTextureLayer(target, point, attachment.name, mip, static_cast<GLint>(attachment.layer));
            break;
    }
}

GLuint Driver::framebuffer(const FramebufferKey& key) {
    if (const auto found = framebuffers_.find(key); found != framebuffers_.end()) return found->second;
    GLuint name = 0;
    gl.GenFramebuffers(1, &name);
    bind_draw_framebuffer(name);
    std::array<GLenum, 8> targets{};
    for (std::uint32_t i = 0; i < key.color_count; ++i) {
        targets[i] = key.colors[i].texture ? GL_COLOR_ATTACHMENT0 + i : GL_NONE;
        if (key.colors[i].texture) attach(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0 + i, key.colors[i]);
    }
    if (key.depth_stencil.texture) attach(GL_DRAW_FRAMEBUFFER, key.depth_point, key.depth_stencil);
    gl.DrawBuffers(static_cast<GLsizei>(key.color_count), targets.data());
    if (key.color_count == 0) {
        const GLenum none = GL_NONE;
        gl.DrawBuffers(1, &none);
        gl.BindFramebuffer(GL_READ_FRAMEBUFFER, name);
        gl.ReadBuffer(GL_NONE);
    }
    const GLenum status = gl.CheckFramebufferStatus(GL_DRAW_FRAMEBUFFER);
    if (status != GL_FRAMEBUFFER_COMPLETE)
        warn(rhi::MessageSeverity::error, "framebuffer-incomplete",
             fmt::format("the driver refuses these targets together (status 0x{:04x})", status));
    framebuffers_.emplace(key, name);
    return name;
}

void Driver::open_masks() {
    if (bound.scissor_test) gl.Disable(GL_SCISSOR_TEST);
    bound.scissor_test = false;
    gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    gl.DepthMask(GL_TRUE);
    gl.StencilMaskSeparate(GL_FRONT_AND_BACK, 0xff);
    bound.raster_state = 0;
}

void Driver::clear_color(GLint index, rhi::Format format, const rhi::ClearColor& color) const {
    switch (rhi::info(format).kind) {
        case rhi::FormatKind::uint: gl.ClearBufferuiv(GL_COLOR, index, color.uint.data()); break;
        case rhi::FormatKind::sint: gl.ClearBufferiv(GL_COLOR, index, color.sint.data()); break;
        default: gl.ClearBufferfv(GL_COLOR, index, color.floating.data()); break;
    }
}

void Driver::forget_texture(ObjectId id) {
    std::erase_if(framebuffers_, [&](const auto& entry) {
        bool uses = entry.first.depth_stencil.texture == id;
        for (const auto& color : entry.first.colors) uses |= color.texture == id;
        if (uses) {
            if (bound.draw_framebuffer == entry.second) bound.draw_framebuffer = 0;
            gl.DeleteFramebuffers(1, &entry.second);
        }
        return uses;
    });
}

}  // namespace nacre::gl
