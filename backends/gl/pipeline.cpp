// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/pipeline.h"

#include <fmt/format.h>

#include "backends/gl/formats.h"

namespace nacre::gl {
namespace {

constexpr GLenum depth_clamp = GL_DEPTH_CLAMP;  // The same value in GL_EXT_depth_clamp.

void set(const Functions& gl, GLenum capability, bool on) { on ? gl.Enable(capability) : gl.Disable(capability); }

void apply_blending(const Driver& driver, const std::vector<rhi::ColorTargetState>& targets) {
    const Functions& gl = driver.gl;
    if (!driver.traits.independent_blend) {
        const rhi::ColorTargetState state = targets.empty() ? rhi::ColorTargetState{} : targets.front();
        set(gl, GL_BLEND, state.blend.enabled);
        gl.BlendFuncSeparate(gl_blend_factor(state.blend.source_color), gl_blend_factor(state.blend.destination_color),
                             gl_blend_factor(state.blend.source_alpha), gl_blend_factor(state.blend.destination_alpha));
        gl.BlendEquationSeparate(gl_blend_operation(state.blend.color_operation),
                                 gl_blend_operation(state.blend.alpha_operation));
        gl.ColorMask((state.write_mask & 1) != 0, (state.write_mask & 2) != 0, (state.write_mask & 4) != 0,
                     (state.write_mask & 8) != 0);
        return;
    }
    for (std::size_t i = 0; i < targets.size(); ++i) {
        const rhi::ColorTargetState& state = targets[i];
        const auto index = static_cast<GLuint>(i);
        gl.ColorMaski(index, (state.write_mask & 1) != 0, (state.write_mask & 2) != 0, (state.write_mask & 4) != 0,
                      (state.write_mask & 8) != 0);
        if (!state.blend.enabled) {
            gl.Disablei(GL_BLEND, index);
            continue;
        }
        gl.Enablei(GL_BLEND, index);
        gl.BlendFuncSeparatei(index, gl_blend_factor(state.blend.source_color),
                              gl_blend_factor(state.blend.destination_color), gl_blend_factor(state.blend.source_alpha),
                              gl_blend_factor(state.blend.destination_alpha));
        gl.BlendEquationSeparatei(index, gl_blend_operation(state.blend.color_operation),
                                  gl_blend_operation(state.blend.alpha_operation));
    }
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> GlGraphicsPipeline::create(
    const DriverPointer& driver, const DiskCache& cache, const rhi::BackendGraphicsPipelineDesc& desc) {
    auto pipeline = std::make_unique<GlGraphicsPipeline>(driver);
    pipeline->desc = *desc.desc;
    pipeline->id = driver->next_id();
    pipeline->topology = gl_topology(desc.desc->topology);
    std::vector<rhi::BackendShader*> stages{desc.vertex};
    if (desc.fragment) stages.push_back(desc.fragment);
    NACRE_TRY(pipeline->program,
              make_program(driver, cache, stages, desc.desc->specialization, desc.layouts, desc.desc->name));
    driver->worker->run([&] { pipeline->make_vertex_array(); });
    return pipeline;
}

GlGraphicsPipeline::~GlGraphicsPipeline() {
    if (!vertex_array) return;
    driver_->worker->post([driver = driver_.get(), deleted = vertex_array, number = id] {
        if (driver->bound.vertex_array == deleted) driver->gl.BindVertexArray(driver->bound.vertex_array = 0);
        if (driver->bound.raster_state == number) driver->bound.raster_state = 0;
        driver->gl.DeleteVertexArrays(1, &deleted);
    });
}

void GlGraphicsPipeline::make_vertex_array() {
    const Functions& gl = driver_->gl;
    gl.GenVertexArrays(1, &vertex_array);
    gl.BindVertexArray(vertex_array);
    driver_->bound.vertex_array = vertex_array;
    for (const rhi::VertexAttribute& attribute : desc.vertex_attributes) {
        const GlVertexFormat format = vertex_format(attribute.format);
        gl.EnableVertexAttribArray(attribute.location);
        if (format.integer)
            gl.VertexAttribIFormat(attribute.location, format.size, format.type, attribute.offset);
        else
            gl.VertexAttribFormat(attribute.location, format.size, format.type, format.normalized, attribute.offset);
        gl.VertexAttribBinding(attribute.location, attribute.buffer);
    }
    for (std::size_t i = 0; i < desc.vertex_buffers.size(); ++i)
        gl.VertexBindingDivisor(static_cast<GLuint>(i), desc.vertex_buffers[i].per_instance ? 1 : 0);
    bound_vertex_buffers.resize(desc.vertex_buffers.size());
    driver_->label(GL_VERTEX_ARRAY, vertex_array, desc.name);
}

void GlGraphicsPipeline::apply_stencil_reference(const Driver& driver, std::uint32_t reference) const {
    const rhi::DepthStencilState& state = desc.depth_stencil;
    if (!state.stencil_test) return;
    const auto value = static_cast<GLint>(reference);
    driver.gl.StencilFuncSeparate(GL_FRONT, gl_compare(state.front.compare), value, state.front.read_mask);
    driver.gl.StencilFuncSeparate(GL_BACK, gl_compare(state.back.compare), value, state.back.read_mask);
}

void GlGraphicsPipeline::apply(Driver& driver, std::uint32_t stencil_reference) const {
    const Functions& gl = driver.gl;
    const Traits& traits = driver.traits;
    set(gl, GL_CULL_FACE, desc.cull != rhi::CullMode::none);
    if (desc.cull != rhi::CullMode::none) gl.CullFace(desc.cull == rhi::CullMode::front ? GL_FRONT : GL_BACK);
    // The same window coordinates, but OpenGL measures the area with y upwards: its counter-clockwise is Vulkan's
    // clockwise.
    gl.FrontFace(desc.front_face == rhi::FrontFace::counter_clockwise ? GL_CW : GL_CCW);
    if (traits.polygon_mode) gl.PolygonMode(GL_FRONT_AND_BACK, desc.fill == rhi::FillMode::line ? GL_LINE : GL_FILL);

    const rhi::DepthStencilState& state = desc.depth_stencil;
    // Depth is written only by fragments that were tested: a pipeline that writes without a test passes them all.
    set(gl, GL_DEPTH_TEST, state.depth_test || state.depth_write);
    gl.DepthMask(state.depth_write ? GL_TRUE : GL_FALSE);
    gl.DepthFunc(state.depth_test ? gl_compare(state.depth_compare) : GL_ALWAYS);
    set(gl, GL_STENCIL_TEST, state.stencil_test);
    if (state.stencil_test) {
        for (const auto& [face, side] : {std::pair{GL_FRONT, &state.front}, std::pair{GL_BACK, &state.back}}) {
            gl.StencilOpSeparate(static_cast<GLenum>(face), gl_stencil_operation(side->fail),
                                 gl_stencil_operation(side->depth_fail), gl_stencil_operation(side->pass));
            gl.StencilMaskSeparate(static_cast<GLenum>(face), side->write_mask);
        }
        apply_stencil_reference(driver, stencil_reference);
    }
    const bool biased = state.depth_bias != 0.0f || state.depth_bias_slope != 0.0f;
    set(gl, GL_POLYGON_OFFSET_FILL, biased);
    if (traits.polygon_mode) set(gl, GL_POLYGON_OFFSET_LINE, biased);
    if (biased && traits.depth_bias_clamp)
        gl.PolygonOffsetClamp(state.depth_bias_slope, state.depth_bias, state.depth_bias_clamp);
    else if (biased)
        gl.PolygonOffset(state.depth_bias_slope, state.depth_bias);
    if (traits.depth_clamp) set(gl, depth_clamp, state.depth_clamp);
    set(gl, GL_SAMPLE_ALPHA_TO_COVERAGE, desc.alpha_to_coverage);
    apply_blending(driver, desc.color_targets);
    driver.bound.raster_state = id;
}

Expected<std::unique_ptr<rhi::BackendComputePipeline>> GlComputePipeline::create(
    const DriverPointer& driver, const DiskCache& cache, const rhi::BackendComputePipelineDesc& desc) {
    auto pipeline = std::make_unique<GlComputePipeline>();
    pipeline->id = driver->next_id();
    rhi::BackendShader* const stages[]{desc.shader};
    NACRE_TRY(pipeline->program,
              make_program(driver, cache, stages, desc.desc->specialization, desc.layouts, desc.desc->name));
    return pipeline;
}

}  // namespace nacre::gl
