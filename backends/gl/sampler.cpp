// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/sampler.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "backends/gl/formats.h"

namespace nacre::gl {
namespace {

GLint address_mode(rhi::AddressMode mode) {
    switch (mode) {
        case rhi::AddressMode::repeat: return GL_REPEAT;
        case rhi::AddressMode::mirrored_repeat: return GL_MIRRORED_REPEAT;
        case rhi::AddressMode::clamp_to_edge: return GL_CLAMP_TO_EDGE;
        case rhi::AddressMode::clamp_to_border: return GL_CLAMP_TO_BORDER;
    }
    return GL_REPEAT;
}

GLint minify_filter(const rhi::SamplerDesc& desc) {
    const bool linear = desc.minify == rhi::Filter::linear;
    if (desc.mip == rhi::Filter::linear) return linear ? GL_LINEAR_MIPMAP_LINEAR : GL_NEAREST_MIPMAP_LINEAR;
    return linear ? GL_LINEAR_MIPMAP_NEAREST : GL_NEAREST_MIPMAP_NEAREST;
}

bool uses_border(const rhi::SamplerDesc& desc) {
    return desc.address_u == rhi::AddressMode::clamp_to_border || desc.address_v == rhi::AddressMode::clamp_to_border ||
           desc.address_w == rhi::AddressMode::clamp_to_border;
}

void set_parameters(const Driver& driver, GLuint name, const rhi::SamplerDesc& desc) {
    const Functions& gl = driver.gl;
    gl.SamplerParameteri(name, GL_TEXTURE_MAG_FILTER, desc.magnify == rhi::Filter::linear ? GL_LINEAR : GL_NEAREST);
    gl.SamplerParameteri(name, GL_TEXTURE_MIN_FILTER, minify_filter(desc));
    gl.SamplerParameteri(name, GL_TEXTURE_WRAP_S, address_mode(desc.address_u));
    gl.SamplerParameteri(name, GL_TEXTURE_WRAP_T, address_mode(desc.address_v));
    gl.SamplerParameteri(name, GL_TEXTURE_WRAP_R, address_mode(desc.address_w));
    gl.SamplerParameterf(name, GL_TEXTURE_MIN_LOD, desc.min_lod);
    gl.SamplerParameterf(name, GL_TEXTURE_MAX_LOD, desc.max_lod);
    if (driver.traits.desktop && desc.mip_bias != 0.0f) gl.SamplerParameterf(name, GL_TEXTURE_LOD_BIAS, desc.mip_bias);
    if (driver.traits.anisotropy && desc.max_anisotropy > 1.0f) {
        GLfloat limit = 1.0f;
        gl.GetFloatv(GL_MAX_TEXTURE_MAX_ANISOTROPY, &limit);
        gl.SamplerParameterf(name, GL_TEXTURE_MAX_ANISOTROPY, std::min(desc.max_anisotropy, limit));
    }
    if (desc.comparison) {
        gl.SamplerParameteri(name, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
        gl.SamplerParameteri(name, GL_TEXTURE_COMPARE_FUNC, static_cast<GLint>(gl_compare(desc.compare)));
    }
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendSampler>> GlSampler::create(const DriverPointer& driver,
                                                                 const rhi::SamplerDesc& desc) {
    const bool border = uses_border(desc);
    if (border && !driver->traits.border_clamp)
        return fail(ErrorCode::unsupported, "create sampler", fmt::format("'{}'", desc.name),
                    "this OpenGL ES has no clamp_to_border", "Ask Capabilities::border_color.");
    if (desc.mip_bias != 0.0f && !driver->traits.desktop)
        return fail(ErrorCode::unsupported, "create sampler", fmt::format("'{}'", desc.name),
                    fmt::format("OpenGL ES has no mip_bias in samplers (asked: {})", desc.mip_bias),
                    "Pass the bias to texture() in the shader.");
    auto sampler = std::make_unique<GlSampler>(driver);
    sampler->desc = desc;
    sampler->id = driver->next_id();
    sampler->integer_id = border ? driver->next_id() : sampler->id;
    driver->worker->run([&] {
        const Functions& gl = driver->gl;
        gl.GenSamplers(1, &sampler->name);
        sampler->integer_name = sampler->name;
        set_parameters(*driver, sampler->name, desc);
        driver->label(GL_SAMPLER, sampler->name, desc.name);
        if (!border) return;
        const float color = desc.border == rhi::BorderColor::opaque_white ? 1.0f : 0.0f;
        const float alpha = desc.border == rhi::BorderColor::transparent_black ? 0.0f : 1.0f;
        const std::array<GLfloat, 4> floating{color, color, color, alpha};
        gl.SamplerParameterfv(sampler->name, GL_TEXTURE_BORDER_COLOR, floating.data());
        gl.GenSamplers(1, &sampler->integer_name);
        set_parameters(*driver, sampler->integer_name, desc);
        const std::array<GLint, 4> integer{static_cast<GLint>(color), static_cast<GLint>(color),
                                           static_cast<GLint>(color), static_cast<GLint>(alpha)};
        gl.SamplerParameterIiv(sampler->integer_name, GL_TEXTURE_BORDER_COLOR, integer.data());
    });
    return sampler;
}

GlSampler::~GlSampler() {
    if (!name) return;
    driver_->worker->post([driver = driver_.get(), first = name, second = integer_name] {
        driver->gl.DeleteSamplers(1, &first);
        if (second != first) driver->gl.DeleteSamplers(1, &second);
    });
}

}  // namespace nacre::gl
