// SPDX-License-Identifier: Apache-2.0
// A negative test for each message that the validation layer can give; a rule without one fails the suite.
#include "rhi/validation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>

#include "tests/rhi/validation_bench.h"

namespace nacre::test {
namespace {

using namespace rhi;
using enum Format;

/// One way to break a rule.
struct Breach {
    std::string code;                  ///< "N-101"
    std::function<void(Bench&)> act;
    std::function<void(Capabilities&)> weaken{};  ///< What the device lacks.
    std::function<void(DeviceDesc&)> ask{};       ///< How the device is made.
};

constexpr auto storage = BufferUsage::storage;
constexpr auto copies = BufferUsage::copy_source | BufferUsage::copy_destination;
constexpr auto texture_copies = TextureUsage::copy_source | TextureUsage::copy_destination;
const char* const storage_shader = "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer Result { uint result[64]; }; void main() { result[0] = 1u; }";
const char* const sampling_shader =
    "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer Result { vec4 result[1]; }; layout(set = 0, binding = 1) uniform sampler2D image; void main() { result[0] = texelFetch(image, ivec2(0), 0); }";
const char* const push_shader = "layout(local_size_x = 1) in; layout(push_constant) uniform P { vec4 a; }; layout(set = 0, binding = 0) buffer Result { vec4 result[1]; }; void main() { result[0] = a; }";
const char* const input_vertex = "layout(location = 0) in vec4 a; void main() { gl_Position = a; }";

void texture_with(Bench& bench, const std::function<void(TextureDesc&)>& change) {
    TextureDesc desc = Bench::texture_desc(TextureUsage::sampled);
    change(desc);
    (void)bench.device().create_texture(desc);
}
void pipeline_with(Bench& bench, const std::function<void(GraphicsPipelineDesc&)>& change) {
    GraphicsPipelineDesc desc = bench.graphics_desc();
    change(desc);
    (void)bench.device().create_graphics_pipeline(desc);
}
void layout_with(Bench& bench, std::vector<BindingLayout> bindings) {
    (void)bench.device().create_bind_group_layout({.bindings = std::move(bindings), .name = "the layout"});
}
void group_with(Bench& bench, BindingType type, std::vector<BindGroupEntry> entries, std::uint32_t count = 1) {
    (void)bench.device().create_bind_group({.layout = bench.layout(type, ShaderStage::compute, count), .entries = std::move(entries), .name = "the group"});
}
void pass_with(Bench& bench, const RenderPassDesc& desc) {
    CommandList list = bench.list();
    list.begin_render_pass(desc);
}
/// A list inside a pass with a pipeline that reads one attribute of 16 bytes from slot 0.
CommandList pass_with_input(Bench& bench, bool per_instance = false) {
    GraphicsPipelineDesc desc = bench.graphics_desc();
    desc.vertex = bench.shader("vert", input_vertex);
    desc.vertex_buffers = {{.stride = 16, .per_instance = per_instance}};
    desc.vertex_attributes = {{0, 0, 0, rgba32_float}};
    CommandList list = bench.pass();
    list.set_pipeline(*bench.device().create_graphics_pipeline(desc));
    return list;
}

std::vector<Breach> handle_breaches() {
    return {
        {"N-101", [](Bench& b) { const Buffer old = b.buffer(storage); b.device().destroy(old); (void)b.device().describe(old); }},
        {"N-101", [](Bench& b) {
             const Buffer old = b.buffer(copies);
             CommandList list = b.list();
             list.fill_buffer(old, 0);
             b.device().destroy(old);
             (void)b.device().submit(std::move(list));
         }},
        {"N-102", [](Bench& b) { (void)b.device().read_buffer(Buffer{}); }},
        {"N-103", [](Bench& b) { Bench other; (void)b.device().read_buffer(other.buffer(storage)); }},
        {"N-104", [](Bench& b) { const Buffer old = b.buffer(storage); b.device().destroy(old); b.device().destroy(old); }},
        {"N-105", [](Bench& b) {
             const ComputePipeline pipeline = b.compute(storage_shader);
             const Buffer buffer = b.buffer(storage);
             const BindGroup group = b.group(pipeline, {{.binding = 0, .buffer = buffer}});
             b.device().destroy(buffer);
             CommandList list = b.list();
             list.set_pipeline(pipeline);
             list.set_bind_group(0, group);
             list.dispatch({});
             (void)b.device().submit(std::move(list));
         }},
        {"N-106", [](Bench& b) { CommandList list = b.list(); (void)b.device().submit(std::span(&list, 1)); (void)b.device().submit(std::span(&list, 1)); }},
        {"N-107", [](Bench& b) { Bench other; (void)b.device().submit(other.list()); }},
        {"N-108", [](Bench& b) { (void)b.device().wait(Fence{1000}); }},
    };
}

std::vector<Breach> resource_breaches() {
    return {
        {"N-201", [](Bench& b) { (void)b.device().create_buffer({0, storage, MemoryKind::device, "the buffer"}); }},
        {"N-201", [](Bench& b) { (void)b.device().create_buffer({std::uint64_t{1} << 63, storage, MemoryKind::device, "the buffer"}); }},
        {"N-202", [](Bench& b) { (void)b.device().create_buffer({16, BufferUsage::none, MemoryKind::device, "the buffer"}); }},
        {"N-202", [](Bench& b) { (void)b.device().create_buffer({16, storage, MemoryKind::readback, "the buffer"}); }},
        {"N-202", [](Bench& b) { (void)b.device().create_buffer({16, storage, MemoryKind::upload, "the buffer"}); }},
        {"N-210", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.format = undefined; }); }},
        {"N-210", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.format = rgb32_float; }); }},
        {"N-211", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.width = 0; }); }},
        {"N-211", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.width = d.height = 1000000; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.depth = 2; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.dimension = TextureDimension::d1; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.dimension = TextureDimension::cube; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.dimension = TextureDimension::d3; d.layers = 2; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.dimension = TextureDimension::d3; d.format = bc1_rgba_unorm; }); }},
        {"N-213", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.layers = 5000; }); }},
        {"N-213", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.layers = 0; }); }},
        {"N-213", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.dimension = TextureDimension::cube; d.layers = 12; }); }, [](Capabilities& c) { c.cube_arrays = false; }},
        {"N-214", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.mips = 6; }); }},
        {"N-214", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.mips = 0; }); }},
        {"N-215", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.samples = 2; }); }},
        {"N-215", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.samples = 4; d.mips = 2; }); }},
        {"N-215", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.samples = 4; d.format = r32_uint; }); }},
        {"N-215", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.samples = 4; d.usage |= TextureUsage::storage; }); }},
        {"N-216", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.usage = TextureUsage::none; }); }},
        {"N-217", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.format = bc7_rgba_unorm; d.usage = TextureUsage::color_target; }); }},
        {"N-217", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.format = bc7_rgba_unorm; }); },
         [](Capabilities& c) { c.formats[static_cast<std::uint32_t>(bc7_rgba_unorm)] = FormatSupport::none; }},
        {"N-218", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.width = d.height = 16384; d.layers = 2048; d.format = rgba32_float; }); }},
        {"N-230", [](Bench& b) { (void)b.device().create_sampler({.max_anisotropy = 64.0f, .name = "the sampler"}); }},
        {"N-230", [](Bench& b) { (void)b.device().create_sampler({.max_anisotropy = 2.0f, .name = "the sampler"}); }, [](Capabilities& c) { c.anisotropic_filtering = false; }},
        {"N-231", [](Bench& b) { (void)b.device().create_sampler({.address_v = AddressMode::clamp_to_border, .name = "the sampler"}); }, [](Capabilities& c) { c.border_color = false; }},
        {"N-232", [](Bench& b) { (void)b.device().create_sampler({.min_lod = 2.0f, .max_lod = 1.0f, .name = "the sampler"}); }},
        {"N-240", [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.base_mip = 1;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         }},
        {"N-241", [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.dimension = ViewDimension::cube;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         }},
        {"N-241", [](Bench& b) {
             TextureDesc desc = Bench::texture_desc(TextureUsage::sampled);
             desc.layers = 4;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = TextureView::subresource(*b.device().create_texture(desc), 0, 1)}});
         }, [](Capabilities& c) { c.texture_views = false; }},
        {"N-242", [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.format = rgba32_float;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         }},
        {"N-242", [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.format = rgba8_srgb;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         }, [](Capabilities& c) { c.texture_view_formats = false; }},
        {"N-250", [](Bench& b) { (void)b.device().create_query_pool({.count = 0, .name = "the pool"}); }},
        {"N-250", [](Bench& b) { (void)b.device().create_query_pool({.count = 65537, .name = "the pool"}); }},
        {"N-251", [](Bench& b) { (void)b.device().create_query_pool({.count = 1, .name = "the pool"}); }, [](Capabilities& c) { c.timestamps = false; }},
    };
}

std::vector<Breach> group_breaches() {
    using enum BindingType;
    return {
        {"N-301", [](Bench& b) { layout_with(b, {{0, sampler, 1, ShaderStage::vertex}, {0, sampler, 1, ShaderStage::fragment}}); }},
        {"N-302", [](Bench& b) { layout_with(b, {{0, sampler, 1, ShaderStage::none}}); }},
        {"N-303", [](Bench& b) { layout_with(b, {{0, uniform_buffer, 17, ShaderStage::vertex}}); }},
        {"N-303", [](Bench& b) { layout_with(b, {{0, combined_texture_sampler, 30, ShaderStage::fragment}, {1, sampled_texture, 3, ShaderStage::fragment}}); }},
        {"N-304", [](Bench& b) { layout_with(b, {{0, sampled_texture, 0, ShaderStage::fragment}}); }, [](Capabilities& c) { c.descriptor_indexing = false; }},
        {"N-304", [](Bench& b) { layout_with(b, {{0, uniform_buffer, 0, ShaderStage::fragment}}); }},
        {"N-305", [](Bench& b) { layout_with(b, {{5000, sampler, 1, ShaderStage::fragment}}); }},
        {"N-310", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 3, .buffer = b.buffer(BufferUsage::uniform)}}); }},
        {"N-311", [](Bench& b) { const Buffer u = b.buffer(BufferUsage::uniform); group_with(b, uniform_buffer, {{.binding = 0, .buffer = u}, {.binding = 0, .buffer = u}}); }},
        {"N-312", [](Bench& b) { group_with(b, uniform_buffer, {}); }},
        {"N-312", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .element = 1}}, 2); }},
        {"N-313", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .texture = b.texture(TextureUsage::sampled)}}); }},
        {"N-313", [](Bench& b) { group_with(b, combined_texture_sampler, {{.binding = 0, .texture = b.texture(TextureUsage::sampled)}}); }},
        {"N-314", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(storage)}}); }},
        {"N-314", [](Bench& b) { group_with(b, readonly_storage_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform)}}); }},
        {"N-315", [](Bench& b) { group_with(b, sampled_texture, {{.binding = 0, .texture = b.texture(TextureUsage::color_target)}}); }},
        {"N-315", [](Bench& b) { group_with(b, writeonly_storage_image, {{.binding = 0, .texture = b.texture(TextureUsage::sampled)}}); }},
        {"N-316", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .offset = 256}}); }},
        {"N-316", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .size = 257}}); }},
        {"N-317", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .offset = 16}}); }},
        {"N-318", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform, 1 << 20)}}); }},
        {"N-319", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .element = 1}}); }},
        {"N-320", [](Bench& b) {
             group_with(b, combined_texture_sampler, {{.binding = 0, .texture = b.texture(TextureUsage::sampled, r32_uint), .sampler = *b.device().create_sampler({.name = "linear"})}});
         }},
        {"N-321", [](Bench& b) {
             TextureDesc desc = Bench::texture_desc(TextureUsage::storage);
             desc.mips = 3;
             TextureView view(*b.device().create_texture(desc));
             view.mip_count = 2;
             group_with(b, storage_image, {{.binding = 0, .texture = view}});
         }},
    };
}

std::vector<Breach> pipeline_breaches() {
    return {
        {"N-401", [](Bench& b) { ShaderDesc desc = Bench::compiled("comp", storage_shader); desc.stage = ShaderStage::none; (void)b.device().create_shader(desc); }},
        {"N-402", [](Bench& b) {
             (void)b.device().create_shader(Bench::compiled("comp", "#extension GL_ARB_gpu_shader_fp64 : enable\nlayout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer R { double r; }; void main() { r = r * 2.0lf; }"));
         }},
        {"N-403", [](Bench& b) {
             (void)b.device().create_shader(Bench::compiled("frag", "layout(set = 0, binding = 0) buffer R { uint r; }; void main() { atomicAdd(r, 1u); }"));
         }, [](Capabilities& c) { c.storage_in_fragment = false; }},
        {"N-405", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = d.fragment; }); }},
        {"N-405", [](Bench& b) { (void)b.device().create_compute_pipeline({.shader = b.plain_vertex(), .name = "the pipeline"}); }},
        {"N-406", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.fragment = b.shader("frag", "layout(location = 2) in vec2 uv; layout(location = 0) out vec4 color; void main() { color = vec4(uv, 0, 1); }"); });
         }},
        {"N-407", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.vertex = b.shader("vert", "layout(set = 0, binding = 0) uniform A { vec4 a; }; void main() { gl_Position = a; }");
                 d.fragment = b.shader("frag", "layout(set = 0, binding = 0) uniform sampler2D image; layout(location = 0) out vec4 color; void main() { color = texelFetch(image, ivec2(0), 0); }");
             });
         }},
        {"N-408", [](Bench& b) {
             (void)b.device().create_compute_pipeline({.shader = b.shader("comp", storage_shader), .bind_group_layouts = {b.layout(BindingType::readonly_storage_buffer)}, .name = "the pipeline"});
         }},
        {"N-409", [](Bench& b) {
             (void)b.device().create_shader(Bench::compiled("comp", "layout(local_size_x = 1) in; layout(set = 6, binding = 0) buffer Result { uint result; }; void main() { result = 1u; }"));
         }},
        {"N-410", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = b.shader("vert", input_vertex); }); }},
        {"N-411", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = b.shader("vert", input_vertex); d.vertex_buffers = {{16}}; d.vertex_attributes = {{0, 0, 0, rgba32_uint}}; });
         }},
        {"N-412", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = b.shader("vert", input_vertex); d.vertex_buffers = {{16}}; d.vertex_attributes = {{0, 0, 0, bc1_rgba_unorm}}; });
         }},
        {"N-413", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = b.shader("vert", input_vertex); d.vertex_buffers = {{16}}; d.vertex_attributes = {{0, 0, 4, rgba32_float}}; });
         }},
        {"N-413", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = b.shader("vert", input_vertex); d.vertex_attributes = {{0, 0, 0, rgba32_float}}; });
         }},
        {"N-414", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex_buffers.resize(17); }); }},
        {"N-414", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex_buffers = {{5000}}; }); }},
        {"N-415", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets.resize(5, d.color_targets[0]); }); }, [](Capabilities& c) { c.max_color_targets = 4; }},
        {"N-416", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets[0].format = rgb9e5_float; }); }},
        {"N-417", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets[0].format = r32_uint; }); }},
        {"N-418", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets.resize(2, d.color_targets[0]); }); }},
        {"N-419", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.color_targets[0].format = r32_uint;
                 d.color_targets[0].blend.enabled = true;
                 d.fragment = b.shader("frag", "layout(location = 0) out uvec4 color; void main() { color = uvec4(1); }");
             });
         }},
        {"N-420", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets[0].blend = {.enabled = true, .source_color = BlendFactor::source1_color}; }); }},
        {"N-420", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets[0].blend = {.enabled = true, .source_color = BlendFactor::source1_color}; }); },
         [](Capabilities& c) { c.dual_source_blending = false; }},
        {"N-421", [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.fragment = b.shader("frag", "layout(location = 0) out vec4 a; layout(location = 1) out vec4 b; void main() { a = b = vec4(1); }");
                 d.color_targets.resize(2, d.color_targets[0]);
                 d.color_targets[1].blend.enabled = true;
             });
         }, [](Capabilities& c) { c.independent_blend = false; }},
        {"N-422", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.format = r32_float; }); }},
        {"N-423", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.depth_test = true; }); }},
        {"N-423", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.format = d32_float; d.depth_stencil.stencil_test = true; }); }},
        {"N-424", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.samples = 8; }); }},
        {"N-425", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.depth_clamp = true; }); }, [](Capabilities& c) { c.depth_clamp = false; }},
        {"N-425", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.depth_bias_clamp = 1.0f; }); }, [](Capabilities& c) { c.depth_bias_clamp = false; }},
        {"N-425", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.fill = FillMode::line; }); }, [](Capabilities& c) { c.wireframe = false; }},
        {"N-426", [](Bench& b) {
             (void)b.device().create_shader(Bench::compiled("comp", "layout(local_size_x = 1) in; layout(push_constant) uniform P { vec4 a[9]; }; layout(set = 0, binding = 0) buffer R { vec4 r; }; void main() { r = a[8]; }"));
         }},
        {"N-427", [](Bench& b) { (void)b.device().create_compute_pipeline({.shader = b.shader("comp", storage_shader), .specialization = {{7, 1u}}, .name = "the pipeline"}); }},
        {"N-428", [](Bench& b) { (void)b.device().create_shader(Bench::compiled("comp", "layout(local_size_x = 64, local_size_y = 32) in; void main() {}")); }},
        {"N-428", [](Bench& b) {
             (void)b.device().create_compute_pipeline({.shader = b.shader("comp", "layout(local_size_x_id = 1) in; void main() {}"), .specialization = {{1, 5000u}}, .name = "the pipeline"});
         }},
        {"N-429", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.fragment = {}; }); }},
    };
}

std::vector<Breach> pass_breaches() {
    return {
        {"N-501", [](Bench& b) { CommandList l = b.list(); l.draw({.vertex_count = 3}); }},
        {"N-501", [](Bench& b) { CommandList l = b.list(); l.end_render_pass(); }},
        {"N-501", [](Bench& b) { CommandList l = b.list(); l.set_pipeline(b.graphics()); }},
        {"N-501", [](Bench& b) { CommandList l = b.list(); l.set_stencil_reference(1); }},
        {"N-502", [](Bench& b) { CommandList l = b.pass(); l.dispatch({}); }},
        {"N-502", [](Bench& b) { CommandList l = b.pass(); l.fill_buffer(b.buffer(copies), 0); }},
        {"N-502", [](Bench& b) { CommandList l = b.pass(); l.begin_render_pass({.color = {{.view = b.target()}}}); }},
        {"N-503", [](Bench& b) { pass_with(b, {}); }},
        {"N-504", [](Bench& b) { TextureDesc d = Bench::texture_desc(TextureUsage::color_target); d.mips = 2; pass_with(b, {.color = {{.view = *b.device().create_texture(d)}}}); }},
        {"N-505", [](Bench& b) { pass_with(b, {.color = {{.view = b.texture(TextureUsage::sampled)}}}); }},
        {"N-505", [](Bench& b) { pass_with(b, {.depth_stencil = {.view = b.texture(TextureUsage::sampled, d32_float)}}); }},
        {"N-506", [](Bench& b) {
             TextureView view(b.texture(TextureUsage::color_target, r32_uint));
             view.format = rgb9e5_float;
             pass_with(b, {.color = {{.view = view}}});
         }},
        {"N-507", [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.width = 8;
             pass_with(b, {.color = {{.view = b.target()}, {.view = *b.device().create_texture(d)}}});
         }},
        {"N-508", [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.samples = 4;
             pass_with(b, {.color = {{.view = b.target()}, {.view = *b.device().create_texture(d)}}});
         }},
        {"N-509", [](Bench& b) { const Texture t = b.target(); pass_with(b, {.color = {{.view = t}, {.view = t}}}); }},
        {"N-510", [](Bench& b) { pass_with(b, {.color = {{.view = b.target(), .resolve = b.target()}}}); }},
        {"N-510", [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.samples = 4;
             pass_with(b, {.color = {{.view = *b.device().create_texture(d), .resolve = b.target(rgba16_float)}}});
         }},
        {"N-511", [](Bench& b) { (void)b.device().submit(b.pass()); }},
        {"N-512", [](Bench& b) { pass_with(b, {.depth_stencil = {.view = b.depth(), .depth_load = LoadOperation::clear, .read_only = true}}); }},
        {"N-415", [](Bench& b) { pass_with(b, {.color = {{.view = b.target()}, {.view = b.target()}}}); }, [](Capabilities& c) { c.max_color_targets = 1; }},
    };
}

std::vector<Breach> draw_breaches() {
    return {
        {"N-520", [](Bench& b) { CommandList l = b.pass(); l.draw({.vertex_count = 3}); }},
        {"N-520", [](Bench& b) { CommandList l = b.list(); l.dispatch({}); }},
        {"N-521", [](Bench& b) { CommandList l = b.list(); l.begin_render_pass({.color = {{.view = b.target(rgba16_float)}}}); l.set_pipeline(b.graphics()); }},
        {"N-521", [](Bench& b) { CommandList l = b.list(); l.begin_render_pass({.color = {{.view = b.target()}}, .depth_stencil = {.view = b.depth()}}); l.set_pipeline(b.graphics()); }},
        {"N-522", [](Bench& b) {
             GraphicsPipelineDesc d = b.graphics_desc();
             d.depth_stencil = {.format = d32_float, .depth_test = true, .depth_write = true};
             CommandList l = b.list();
             l.begin_render_pass({.color = {{.view = b.target()}}, .depth_stencil = {.view = b.depth(), .read_only = true}});
             l.set_pipeline(*b.device().create_graphics_pipeline(d));
         }},
        {"N-523", [](Bench& b) { CommandList l = b.list(); l.set_pipeline(b.compute(storage_shader)); l.dispatch({}); }},
        {"N-524", [](Bench& b) {
             const BindGroup other = *b.device().create_bind_group({.layout = b.layout(BindingType::uniform_buffer), .entries = {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform)}}, .name = "the group"});
             CommandList l = b.list();
             l.set_pipeline(b.compute(storage_shader));
             l.set_bind_group(0, other);
             l.dispatch({});
         }},
        {"N-525", [](Bench& b) { const ComputePipeline p = b.compute(storage_shader); CommandList l = b.list(); l.set_bind_group(4, b.group(p, {{.binding = 0, .buffer = b.buffer(storage)}})); }},
        {"N-525", [](Bench& b) { (void)b.device().bind_group_layout(b.compute(storage_shader), 3); }},
        {"N-526", [](Bench& b) {
             const ComputePipeline p = b.compute(push_shader);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = b.buffer(storage)}}));
             l.set_push_constants(1.0f);
             l.dispatch({});
         }},
        {"N-527", [](Bench& b) { CommandList l = b.list(); l.set_push_constants(1.0f, 128); }},
        {"N-527", [](Bench& b) { CommandList l = b.list(); l.set_push_constants(std::uint16_t{1}); }},
        {"N-528", [](Bench& b) { CommandList l = pass_with_input(b); l.draw({.vertex_count = 3}); }},
        {"N-529", [](Bench& b) { CommandList l = b.pass(); l.set_vertex_buffer(0, b.buffer(storage)); }},
        {"N-529", [](Bench& b) { CommandList l = b.pass(); l.set_vertex_buffer(16, b.buffer(BufferUsage::vertex)); }},
        {"N-529", [](Bench& b) { CommandList l = b.pass(); l.set_vertex_buffer(0, b.buffer(BufferUsage::vertex), 256); }},
        {"N-530", [](Bench& b) { CommandList l = pass_with_input(b); l.set_vertex_buffer(0, b.buffer(BufferUsage::vertex)); l.draw({.vertex_count = 17}); }},
        {"N-530", [](Bench& b) { CommandList l = pass_with_input(b, true); l.set_vertex_buffer(0, b.buffer(BufferUsage::vertex), 16); l.draw({.vertex_count = 3, .instance_count = 16}); }},
        {"N-531", [](Bench& b) { CommandList l = b.pass(); l.set_pipeline(b.graphics()); l.draw_indexed({.index_count = 3}); }},
        {"N-532", [](Bench& b) { CommandList l = b.pass(); l.set_index_buffer(b.buffer(BufferUsage::vertex), IndexType::uint16); }},
        {"N-532", [](Bench& b) { CommandList l = b.pass(); l.set_index_buffer(b.buffer(BufferUsage::index), IndexType::uint32, 2); }},
        {"N-533", [](Bench& b) { CommandList l = b.pass(); l.set_pipeline(b.graphics()); l.set_index_buffer(b.buffer(BufferUsage::index), IndexType::uint32); l.draw_indexed({.index_count = 64, .first_index = 1}); }},
        {"N-534", [](Bench& b) { CommandList l = b.pass(); l.set_pipeline(b.graphics()); l.draw({.vertex_count = 3, .first_instance = 1}); }, [](Capabilities& c) { c.base_instance = false; }},
        {"N-535", [](Bench& b) { CommandList l = b.pass(); l.set_pipeline(b.graphics()); l.draw_indirect(b.buffer(storage)); }},
        {"N-535", [](Bench& b) { CommandList l = b.pass(); l.set_pipeline(b.graphics()); l.draw_indirect(b.buffer(BufferUsage::indirect), 2); }},
        {"N-535", [](Bench& b) { CommandList l = b.pass(); l.set_pipeline(b.graphics()); l.draw_indirect(b.buffer(BufferUsage::indirect), 0, 2, 12); }},
        {"N-536", [](Bench& b) { CommandList l = b.pass(); l.set_pipeline(b.graphics()); l.draw_indirect(b.buffer(BufferUsage::indirect), 0, 17); }},
        {"N-540", [](Bench& b) { CommandList l = b.pass(); l.set_viewport({.width = 0, .height = 16}); }},
        {"N-540", [](Bench& b) { CommandList l = b.pass(); l.set_viewport({.width = 16, .height = 16, .max_depth = 2}); }},
        {"N-541", [](Bench& b) { CommandList l = b.pass(); l.set_scissor({1, 0, 16, 16}); }},
        {"N-545", [](Bench& b) { CommandList l = b.list(); l.set_pipeline(b.compute(storage_shader)); l.dispatch({70000, 1, 1}); }},
        {"N-546", [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::sampled);
             d.layers = 3;
             const ComputePipeline p = b.compute(sampling_shader);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = b.buffer(storage)}, {.binding = 1, .texture = *b.device().create_texture(d), .sampler = *b.device().create_sampler({})}}));
             l.dispatch({});
         }},
        {"N-546", [](Bench& b) {
             const ComputePipeline p = b.compute(sampling_shader);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = b.buffer(storage)},
                                             {.binding = 1, .texture = b.texture(TextureUsage::sampled, r32_uint),
                                              .sampler = *b.device().create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest})}}));
             l.dispatch({});
         }},
        {"N-547", [](Bench& b) {
             const ComputePipeline p = b.compute(storage_shader);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = b.buffer(storage, 128)}}));
             l.dispatch({});
         }},
    };
}

std::vector<Breach> copy_breaches() {
    return {
        {"N-550", [](Bench& b) { CommandList l = b.list(); l.copy_buffer(b.buffer(copies), 200, b.buffer(copies), 0, 57); }},
        {"N-550", [](Bench& b) { CommandList l = b.list(); l.copy_buffer(b.buffer(copies), 0, b.buffer(copies), ~0ull - 3, 8); }},
        {"N-550", [](Bench& b) { CommandList l = b.list(); l.fill_buffer(b.buffer(copies), 0, 8, 256); }},
        {"N-550", [](Bench& b) { CommandList l = b.list(); l.copy_buffer_to_texture(b.buffer(copies), b.texture(texture_copies)); }},
        {"N-550", [](Bench& b) { CommandList l = b.list(); l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies), {.offset = {10, 0, 0}, .extent = {8, 8, 1}}); }},
        {"N-550", [](Bench& b) { CommandList l = b.list(); l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies), {.mip = 40}); }},
        {"N-550", [](Bench& b) { CommandList l = b.list(); l.copy_texture(b.texture(texture_copies), b.texture(texture_copies), {.layer_count = 2}); }},
        {"N-551", [](Bench& b) { CommandList l = b.list(); l.copy_buffer(b.buffer(storage), 0, b.buffer(copies), 0, 16); }},
        {"N-551", [](Bench& b) { CommandList l = b.list(); l.copy_texture_to_buffer(b.texture(TextureUsage::sampled), b.buffer(copies, 4096)); }},
        {"N-551", [](Bench& b) { CommandList l = b.list(); l.clear_texture(b.texture(TextureUsage::sampled), {}); }},
        {"N-552", [](Bench& b) { CommandList l = b.list(); l.fill_buffer(b.buffer(copies), 0, 2, 8); }},
        {"N-552", [](Bench& b) { CommandList l = b.list(); l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies), {.bytes_per_row = 60}); }},
        {"N-552", [](Bench& b) { CommandList l = b.list(); l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies, bc1_rgba_unorm), {.offset = {2, 0, 0}, .extent = {4, 4, 1}}); }},
        {"N-553", [](Bench& b) { CommandList l = b.list(); l.copy_texture(b.texture(texture_copies), b.texture(texture_copies, r32_float)); }},
        {"N-553", [](Bench& b) { CommandList l = b.list(); l.clear_texture(b.texture(texture_copies, d32_float), {}); }},
        {"N-554", [](Bench& b) { const Buffer c = b.buffer(copies); CommandList l = b.list(); l.copy_buffer(c, 0, c, 8, 16); }},
        {"N-554", [](Bench& b) { const Texture t = b.texture(texture_copies); CommandList l = b.list(); l.copy_texture(t, t); }},
        {"N-555", [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.samples = 4;
             CommandList l = b.list();
             l.copy_texture_to_buffer(*b.device().create_texture(d), b.buffer(copies, 4096));
         }},
        {"N-558", [](Bench& b) { CommandList l = b.list(); l.generate_mips(b.texture(TextureUsage::sampled)); }},
        {"N-558", [](Bench& b) { CommandList l = b.list(); l.generate_mips(b.texture(texture_copies, r32_uint)); }},
    };
}

std::vector<Breach> other_breaches() {
    const auto pool = [](Bench& b, QueryType type) { return *b.device().create_query_pool({type, 4, "the pool"}); };
    return {
        {"N-560", [=](Bench& b) { CommandList l = b.list(); l.write_timestamp(pool(b, QueryType::occlusion), 0); }},
        {"N-561", [=](Bench& b) { CommandList l = b.list(); l.write_timestamp(pool(b, QueryType::timestamp), 4); }},
        {"N-561", [=](Bench& b) { (void)b.device().read_queries(pool(b, QueryType::timestamp), 3, 2); }},
        {"N-562", [=](Bench& b) { const QueryPool p = pool(b, QueryType::occlusion); CommandList l = b.pass(); l.begin_occlusion_query(p, 0); l.begin_occlusion_query(p, 1); }},
        {"N-562", [=](Bench& b) { CommandList l = b.pass(); l.end_occlusion_query(pool(b, QueryType::occlusion), 0); }},
        {"N-562", [=](Bench& b) { CommandList l = b.pass(); l.begin_occlusion_query(pool(b, QueryType::occlusion), 0); l.end_render_pass(); }},
        {"N-563", [=](Bench& b) { (void)b.device().read_queries(pool(b, QueryType::timestamp), 0, 1); }},
        {"N-565", [](Bench& b) { CommandList l = b.list(); l.pop_debug_group(); }},
        {"N-565", [](Bench& b) { CommandList l = b.list(); l.push_debug_group("open"); (void)b.device().submit(std::move(l)); }},
        {"N-566", [](Bench& b) { CommandList l = b.list(); l.end_statement(); }},
        {"N-566", [](Bench& b) { CommandList l = b.pass(); l.begin_statement("inside", {}); }},
        {"N-566", [](Bench& b) { CommandList l = b.list(); l.begin_statement("open", {}); (void)b.device().submit(std::move(l)); }},
        {"N-570", [](Bench& b) {
             // A texture that is sampled and drawn to in one pass.
             GraphicsPipelineDesc d = b.graphics_desc();
             d.fragment = b.shader("frag", "layout(set = 0, binding = 0) uniform sampler2D image; layout(location = 0) out vec4 color; void main() { color = texelFetch(image, ivec2(0), 0); }");
             const GraphicsPipeline p = *b.device().create_graphics_pipeline(d);
             const Texture t = b.target();
             CommandList l = b.list();
             l.begin_render_pass({.color = {{.view = t}}, .name = "the pass"});
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .texture = t, .sampler = *b.device().create_sampler({})}}));
             l.draw({.vertex_count = 3});
             l.end_render_pass();
             (void)b.device().submit(std::move(l));
         }},
        {"N-571", [](Bench& b) {
             // A buffer that a dispatch writes and reads its own arguments from.
             const ComputePipeline p = b.compute(storage_shader);
             const Buffer buffer = b.buffer(storage | BufferUsage::indirect);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = buffer}}));
             l.dispatch_indirect(buffer);
             (void)b.device().submit(std::move(l));
         }},
        {"N-601", [](Bench& b) { (void)b.device().map(b.buffer(storage)); }},
        {"N-602", [](Bench& b) { const Buffer u = b.buffer(BufferUsage::copy_source, 256, "the buffer", MemoryKind::upload); (void)b.device().map(u); (void)b.device().map(u); }},
        {"N-602", [](Bench& b) { (void)b.device().unmap(b.buffer(BufferUsage::copy_source, 256, "the buffer", MemoryKind::upload)); }},
        {"N-603", [](Bench& b) {
             const Buffer u = b.buffer(BufferUsage::copy_source, 256, "the buffer", MemoryKind::upload);
             (void)b.device().map(u);
             CommandList l = b.list();
             l.copy_buffer(u, 0, b.buffer(copies), 0, 256);
             (void)b.device().submit(std::move(l));
         }},
        {"N-604", [](Bench& b) { (void)b.device().write_buffer(b.buffer(storage), std::vector<std::byte>(16), 250); }},
        {"N-604", [](Bench& b) { (void)b.device().read_texture(b.texture(texture_copies), 1); }},
        {"N-605", [](Bench& b) { (void)b.device().write_texture(b.texture(TextureUsage::sampled), std::vector<std::byte>(1024)); }},
        {"N-606", [](Bench& b) { (void)b.device().write_texture(b.texture(texture_copies), std::vector<std::byte>(1000)); }},
        {"N-701", [](Bench& b) {
             CommandList l = b.list();
             l.begin_statement("the pass", {});
             l.fill_buffer(b.buffer(copies), 0);
             l.end_statement();
             (void)b.device().submit(std::move(l));
         }, {}, [](DeviceDesc& d) { d.verify_statements = true; }},
        {"N-702", [](Bench& b) {
             const StatedAccess access{.buffer = b.buffer(copies), .use = ResourceUse::copy_source};
             CommandList l = b.list();
             l.begin_statement("the pass", std::span(&access, 1));
             l.end_statement();
             (void)b.device().submit(std::move(l));
         }, {}, [](DeviceDesc& d) { d.verify_statements = true; }},
    };
}

std::vector<Breach> all_breaches() {
    std::vector<Breach> all;
    for (auto& part : {handle_breaches(), resource_breaches(), group_breaches(), pipeline_breaches(), pass_breaches(), draw_breaches(), copy_breaches(), other_breaches()})
        all.insert(all.end(), part.begin(), part.end());
    return all;
}

TEST(Validation, EachRuleIsToldWithNamesExpectationFindingAndMend) {
    for (const Breach& breach : all_breaches()) {
        SCOPED_TRACE(breach.code);
        Capabilities capabilities = full_capabilities();
        DeviceDesc desc;
        if (breach.weaken) breach.weaken(capabilities);
        if (breach.ask) breach.ask(desc);
        Bench bench(desc, capabilities);
        breach.act(bench);
        ASSERT_EQ(bench.messages().size(), 1u) << (bench.messages().empty() ? "" : bench.messages().back().text);
        const Message& message = bench.messages().front();
        EXPECT_TRUE(message.code.starts_with(breach.code + " ")) << message.code << ": " << message.text;
        EXPECT_NE(message.text.find(message.code), std::string::npos) << message.text;
        EXPECT_EQ(message.severity, MessageSeverity::error);
        const bool verify = message.source == MessageSource::verify;
        EXPECT_TRUE(verify || (message.text.find("expected") != std::string::npos && message.text.find("found") != std::string::npos)) << message.text;
        // The mend is the last sentence, behind the code.
        EXPECT_GT(message.text.size(), message.text.find("]") + 10) << message.text;
    }
}

TEST(Validation, EachRuleHasATest) {
    std::set<std::string> tested, known;
    for (const Breach& breach : all_breaches()) tested.insert(breach.code);
    for (const ValidationRule& rule : validation_rules()) {
        known.insert(std::string(rule.code.substr(0, 5)));
        EXPECT_FALSE(rule.meaning.empty());
    }
    EXPECT_EQ(tested, known);
}

TEST(Validation, NumbersRiseAndNamesAreUnique) {
    std::set<std::string_view> names;
    std::string_view last;
    for (const ValidationRule& rule : validation_rules()) {
        EXPECT_LT(last, rule.code);
        last = rule.code;
        EXPECT_TRUE(names.insert(rule.code.substr(6)).second) << rule.code;
    }
}

/// Text of docs/validation.md.
std::string document() {
    std::string text =
        "# Messages of the validation layer\n\n"
        "Generated from the rules (`NACRE_UPDATE_DOCS=1 rhi_front_end_test`). Every message names its code, the objects by the\n"
        "names that they were given, what was expected, what was found, and what to change:\n\n"
        "```text\n"
        "draw list 'frame', pass 'lighting', pipeline 'tone': expected a bind group at index 0, found none\n"
        "[N-523 bind-group-missing]. Call set_bind_group before; the begin and the end of a render pass unset all of them.\n"
        "```\n\n"
        "The text is the same on every backend, because a backend sees valid calls only. Codes never change their meaning.\n"
        "Descriptions and handles are checked on every device; what is recorded is checked in full where `DeviceDesc::validation` is on\n"
        "(the default), and for the order of passes, missing pipelines, missing bindings and the range of copies always. A call that\n"
        "breaks a rule does nothing, returns an `Error` with the same text, and reports a `Message` to\n"
        "`Device::set_message_callback`.\n\n"
        "| code | meaning |\n|---|---|\n";
    for (const ValidationRule& rule : validation_rules()) text += "| `" + std::string(rule.code) + "` | " + std::string(rule.meaning) + " |\n";
    return text;
}

TEST(Validation, DocumentListsEveryRule) {
    const std::string path = std::string(NACRE_SOURCE_DIR) + "/docs/validation.md";
    if (std::getenv("NACRE_UPDATE_DOCS")) std::ofstream(path) << document();
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    EXPECT_EQ(text.str(), document()) << "run NACRE_UPDATE_DOCS=1 rhi_front_end_test";
}

TEST(Validation, FirstErrorOfAListIsKeptAndReturned) {
    Bench bench;
    CommandList list = bench.list();
    list.dispatch({});
    list.draw({.vertex_count = 3});
    ASSERT_FALSE(list.status());
    EXPECT_EQ(bench.messages().size(), 1u);
    const auto submitted = bench.device().submit(std::move(list));
    ASSERT_FALSE(submitted);
    EXPECT_NE(submitted.error().message().find("N-520"), std::string::npos);
    EXPECT_EQ(bench.messages().size(), 1u);
    EXPECT_TRUE(bench.log().submissions.empty());
    EXPECT_TRUE(bench.device().submit(bench.list()));
}

TEST(Validation, WhatMustNeverReachADriverIsFoundWithoutIt) {
    DeviceDesc desc;
    desc.validation = false;
    // Codes that hold in every build, with validation off as well.
    const std::set<std::string> always{"N-101", "N-105", "N-106", "N-107", "N-501", "N-502", "N-511", "N-520", "N-523", "N-524", "N-525", "N-528", "N-531", "N-570", "N-571"};
    int tried = 0;
    for (const Breach& breach : all_breaches()) {
        if (!always.contains(breach.code) || breach.weaken) continue;
        Bench bench(desc);
        // The acts that only record are submitted by nobody; those that submit must fail.
        breach.act(bench);
        for (const Message& message : bench.messages()) EXPECT_TRUE(message.code.starts_with(breach.code)) << message.text;
        tried += bench.messages().empty() ? 0 : 1;
    }
    EXPECT_GE(tried, 7);

    const auto refused = [&](const std::function<void(Bench&, CommandList&)>& record) {
        Bench bench(desc);
        CommandList list = bench.list();
        record(bench, list);
        return !bench.device().submit(std::move(list));
    };
    EXPECT_TRUE(refused([](Bench&, CommandList& l) { l.draw({.vertex_count = 3}); }));
    EXPECT_TRUE(refused([](Bench&, CommandList& l) { l.dispatch({}); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.set_pipeline(b.compute(storage_shader)); l.dispatch({}); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.begin_render_pass({.color = {{.view = b.target()}}}); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.begin_render_pass({.color = {{.view = b.target()}}}); l.draw({.vertex_count = 3}); l.end_render_pass(); }));
    EXPECT_TRUE(refused([](Bench&, CommandList& l) { l.end_render_pass(); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.copy_buffer(b.buffer(copies), 200, b.buffer(copies), 0, 57); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.copy_buffer_to_texture(b.buffer(copies), b.texture(texture_copies)); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.copy_texture_to_buffer(b.texture(texture_copies), b.buffer(copies)); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.copy_texture(b.texture(texture_copies), b.texture(texture_copies), {.source_layer = 7}); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.fill_buffer(b.buffer(copies), 0, 0, 1024); }));
    EXPECT_FALSE(refused([](Bench& b, CommandList& l) { l.begin_render_pass({.color = {{.view = b.target()}}}); l.set_pipeline(b.graphics()); l.draw({.vertex_count = 3}); l.end_render_pass(); }));
}

}  // namespace
}  // namespace nacre::test
