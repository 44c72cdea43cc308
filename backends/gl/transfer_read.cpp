// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "backends/gl/texels.h"
#include "backends/gl/transfer.h"

/// @file
/// Reading texels in OpenGL ES. glReadPixels guarantees three layouts: 8-bit RGBA for normalized formats, RGBA of
/// 32-bit integers for integer formats, and RGBA of floats for float formats that can be attached. What cannot be
/// attached is drawn into a target of RGBA32UI, as the bits of the floats that a shader reads.

namespace nacre::gl {
namespace {

bool is_8bit_normalized(rhi::Format format) {
    switch (format) {
        case rhi::Format::r8_unorm: case rhi::Format::rg8_unorm: case rhi::Format::rgba8_unorm:
        case rhi::Format::rgba8_srgb: return true;
        default: return false;
    }
}

}  // namespace

void Transfer::attach_read(GlTexture& texture, std::uint32_t mip, std::uint32_t layer, GLenum point) {
    gl_.BindFramebuffer(GL_READ_FRAMEBUFFER, driver_.scratch_framebuffers[0]);
    driver_.attach(GL_READ_FRAMEBUFFER, point, texture.attachment(mip, layer, texture.desc.format));
    gl_.ReadBuffer(GL_COLOR_ATTACHMENT0);
}

void Transfer::read_slice(GlTexture& texture, const Box& box, std::uint32_t slice, std::byte* destination) {
    const rhi::Format format = texture.desc.format;
    const rhi::FormatInfo& facts = rhi::info(format);
    if (facts.is_compressed()) return read_slice_compressed(texture, box, slice, destination);
    const bool renderable =
        has_all(format_support(gl_, driver_.traits, format), rhi::FormatSupport::color_target);
    const bool floating = facts.kind == rhi::FormatKind::floating && renderable;
    if (!renderable || (!facts.is_integer() && !floating && !is_8bit_normalized(format)))
        return read_slice_by_shader(texture, box, slice, destination);

    const std::uint32_t layer = texture.target == GL_TEXTURE_3D ? box.offset.z + slice : box.layer;
    attach_read(texture, box.mip, layer, GL_COLOR_ATTACHMENT0);
    const auto x = static_cast<GLint>(box.offset.x), y = static_cast<GLint>(box.offset.y);
    const auto width = static_cast<GLsizei>(box.extent.width), height = static_cast<GLsizei>(box.extent.height);
    const std::size_t count = std::size_t{box.extent.width} * box.extent.height;
    if (is_8bit_normalized(format)) {
        std::vector<std::byte> rgba(count * 4);
        gl_.ReadPixels(x, y, width, height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
        for (std::size_t i = 0; i < count; ++i)
            std::memcpy(destination + i * facts.channels, rgba.data() + i * 4, facts.channels);
    } else {
        std::vector<ShaderTexel> texels(count);
        if (facts.is_integer())
            gl_.ReadPixels(x, y, width, height, GL_RGBA_INTEGER,
                           facts.kind == rhi::FormatKind::uint ? GL_UNSIGNED_INT : GL_INT, texels.data());
        else
            gl_.ReadPixels(x, y, width, height, GL_RGBA, GL_FLOAT, texels.data());
        for (std::size_t i = 0; i < count; ++i) pack_texel(format, texels[i], destination + i * facts.block_bytes);
    }
    driver_.attach(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, {});
}

GLuint Transfer::fetch_program(GLenum target) {
    for (const FetchProgram& program : fetch_programs_)
        if (program.target == target) return program.name;
    // A cube is sampled in the direction of a texel's center, for want of texelFetch.
    const char* sampler = target == GL_TEXTURE_3D         ? "sampler3D"
                          : target == GL_TEXTURE_2D_ARRAY ? "sampler2DArray"
                          : target == GL_TEXTURE_CUBE_MAP ? "samplerCube"
                                                          : "sampler2D";
    const char* fetch = target == GL_TEXTURE_CUBE_MAP ? "textureLod(source, direction(place.xy), float(place.w))"
                        : target == GL_TEXTURE_2D     ? "texelFetch(source, place.xy, place.w)"
                                                      : "texelFetch(source, place.xyz, place.w)";
    const std::string fragment =
        fmt::format(R"(#version 310 es
precision highp float;
precision highp int;
uniform highp {} source;
uniform ivec4 origin; // x, y, layer, mip
uniform int face;
layout(location = 0) out uvec4 bits;
vec3 direction(ivec2 texel) {{
    {}
}}
void main() {{
    ivec4 place = origin + ivec4(ivec2(gl_FragCoord.xy), 0, 0);
    bits = floatBitsToUint({});
}})",
                    sampler,
                    target == GL_TEXTURE_CUBE_MAP
                        ? R"(vec2 uv = (vec2(texel) + 0.5) / vec2(textureSize(source, origin.w)) * 2.0 - 1.0;
    if (face == 0) return vec3(1.0, -uv.y, -uv.x);
    if (face == 1) return vec3(-1.0, -uv.y, uv.x);
    if (face == 2) return vec3(uv.x, 1.0, uv.y);
    if (face == 3) return vec3(uv.x, -1.0, -uv.y);
    if (face == 4) return vec3(uv.x, -uv.y, 1.0);
    return vec3(-uv.x, -uv.y, -1.0);)"
                        : "return vec3(texel, face);",
                    fetch);
    static constexpr const char* vertex = R"(#version 310 es
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
})";
    const GLuint name = gl_.CreateProgram();
    const std::array<std::pair<GLenum, const char*>, 2> stages{
        {{GL_VERTEX_SHADER, vertex}, {GL_FRAGMENT_SHADER, fragment.c_str()}}};
    for (const auto& [stage, source] : stages) {
        const GLuint shader = gl_.CreateShader(stage);
        gl_.ShaderSource(shader, 1, &source, nullptr);
        gl_.CompileShader(shader);
        gl_.AttachShader(name, shader);
        gl_.DeleteShader(shader);
    }
    gl_.LinkProgram(name);
    GLint linked = 0;
    gl_.GetProgramiv(name, GL_LINK_STATUS, &linked);
    if (!linked) {
        std::array<char, 1024> log{};
        gl_.GetProgramInfoLog(name, static_cast<GLsizei>(log.size()), nullptr, log.data());
        driver_.warn(rhi::MessageSeverity::error, "read-back-shader",
                     fmt::format("the driver refuses the shader that reads textures back: {}", log.data()));
    }
    fetch_programs_.push_back({target, name});
    return name;
}

void Transfer::read_slice_by_shader(GlTexture& texture, const Box& box, std::uint32_t slice, std::byte* destination) {
    const auto width = static_cast<GLsizei>(box.extent.width), height = static_cast<GLsizei>(box.extent.height);
    GLuint target_texture = 0;
    gl_.GenTextures(1, &target_texture);
    driver_.bind_scratch_texture(GL_TEXTURE_2D, target_texture);
    gl_.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA32UI, width, height);
    driver_.bind_draw_framebuffer(driver_.scratch_framebuffers[1]);
    gl_.FramebufferTexture2D(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target_texture, 0);

    texture.show_all_mips();
    const GLuint program = fetch_program(texture.target);
    gl_.UseProgram(program);
    driver_.bound.program = program;
    const std::uint32_t layer = texture.target == GL_TEXTURE_3D ? box.offset.z + slice : box.layer;
    const std::array<GLint, 4> origin{static_cast<GLint>(box.offset.x), static_cast<GLint>(box.offset.y),
                                      static_cast<GLint>(layer), static_cast<GLint>(box.mip)};
    gl_.Uniform4iv(gl_.GetUniformLocation(program, "origin"), 1, origin.data());
    gl_.Uniform1i(gl_.GetUniformLocation(program, "face"), static_cast<GLint>(box.layer));
    gl_.Uniform1i(gl_.GetUniformLocation(program, "source"), static_cast<GLint>(driver_.scratch_unit));
    driver_.bind_scratch_texture(texture.target, texture.name);
    gl_.BindSampler(driver_.scratch_unit, driver_.nearest_sampler);
    if (!empty_vertex_array_) gl_.GenVertexArrays(1, &empty_vertex_array_);
    gl_.BindVertexArray(empty_vertex_array_);
    driver_.bound.vertex_array = empty_vertex_array_;
    driver_.open_masks();
    for (GLenum capability : {GL_CULL_FACE, GL_DEPTH_TEST, GL_STENCIL_TEST, GL_BLEND, GL_SAMPLE_ALPHA_TO_COVERAGE})
        gl_.Disable(static_cast<GLenum>(capability));
    gl_.Viewport(0, 0, width, height);
    gl_.DrawArrays(GL_TRIANGLES, 0, 3);
    gl_.BindSampler(driver_.scratch_unit, 0);

    gl_.BindFramebuffer(GL_READ_FRAMEBUFFER, driver_.scratch_framebuffers[1]);
    gl_.ReadBuffer(GL_COLOR_ATTACHMENT0);
    const std::size_t count = std::size_t{box.extent.width} * box.extent.height;
    std::vector<ShaderTexel> texels(count);
    gl_.ReadPixels(0, 0, width, height, GL_RGBA_INTEGER, GL_UNSIGNED_INT, texels.data());
    gl_.FramebufferTexture2D(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, 0, 0);
    gl_.DeleteTextures(1, &target_texture);
    const std::size_t texel_bytes = rhi::info(texture.desc.format).block_bytes;
    for (std::size_t i = 0; i < count; ++i)
        pack_texel(texture.desc.format, texels[i], destination + i * texel_bytes);
}

void Transfer::read_slice_compressed(GlTexture& texture, const Box& box, std::uint32_t slice, std::byte* destination) {
    // Blocks become texels of a format of their size.
    const rhi::FormatInfo& facts = rhi::info(texture.desc.format);
    const auto columns = static_cast<GLsizei>((box.extent.width + 3) / 4);
    const auto rows = static_cast<GLsizei>((box.extent.height + 3) / 4);
    GLuint blocks = 0;
    gl_.GenTextures(1, &blocks);
    driver_.bind_scratch_texture(GL_TEXTURE_2D, blocks);
    gl_.TexStorage2D(GL_TEXTURE_2D, 1, facts.block_bytes == 8 ? GL_RG32UI : GL_RGBA32UI, columns, rows);
    const std::uint32_t z = texture.target == GL_TEXTURE_3D ? box.offset.z + slice : box.layer;
    gl_.CopyImageSubData(texture.name, texture.target, static_cast<GLint>(box.mip), static_cast<GLint>(box.offset.x),
                         static_cast<GLint>(box.offset.y), static_cast<GLint>(z), blocks, GL_TEXTURE_2D, 0, 0, 0, 0,
                         static_cast<GLsizei>(box.extent.width), static_cast<GLsizei>(box.extent.height), 1);
    gl_.BindFramebuffer(GL_READ_FRAMEBUFFER, driver_.scratch_framebuffers[0]);
    gl_.FramebufferTexture2D(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, blocks, 0);
    gl_.ReadBuffer(GL_COLOR_ATTACHMENT0);
    const std::size_t count = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    std::vector<ShaderTexel> texels(count);
    gl_.ReadPixels(0, 0, columns, rows, GL_RGBA_INTEGER, GL_UNSIGNED_INT, texels.data());
    for (std::size_t i = 0; i < count; ++i)
        std::memcpy(destination + i * facts.block_bytes, texels[i].data(), facts.block_bytes);
    gl_.FramebufferTexture2D(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, 0, 0);
    gl_.DeleteTextures(1, &blocks);
}

}  // namespace nacre::gl
