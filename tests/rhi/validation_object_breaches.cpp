// SPDX-License-Identifier: Apache-2.0
// Ways to break the rules of objects.
#include <array>

#include "tests/rhi/validation_breaches.h"

namespace nacre::test {

using namespace rhi;
using enum Format;

namespace {

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
    (void)bench.device().create_bind_group({.layout = bench.layout(type, ShaderStage::compute, count),
                                            .entries = std::move(entries),
                                            .name = "the group"});
}
/// `entry` with a buffer of 256 bytes that has both usages.
void texels_with(Bench& bench, BindingType type, BindGroupEntry entry) {
    entry.buffer = bench.buffer(BufferUsage::uniform_texel | BufferUsage::storage_texel);
    group_with(bench, type, {entry});
}

}  // namespace

std::vector<Breach> handle_breaches() {
    return {
        {"N-101",
         [](Bench& b) {
             const Buffer old = b.buffer(storage);
             b.device().destroy(old);
             (void)b.device().describe(old);
         }},
        {"N-101",
         [](Bench& b) {
             const Buffer old = b.buffer(copies);
             CommandList list = b.list();
             list.fill_buffer(old, 0);
             b.device().destroy(old);
             (void)b.device().submit(std::move(list));
         }},
        {"N-102", [](Bench& b) { (void)b.device().read_buffer(Buffer{}); }},
        {"N-103",
         [](Bench& b) {
             Bench other;
             (void)b.device().read_buffer(other.buffer(storage));
         }},
        {"N-104",
         [](Bench& b) {
             const Buffer old = b.buffer(storage);
             b.device().destroy(old);
             b.device().destroy(old);
         }},
        {"N-105",
         [](Bench& b) {
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
        {"N-106",
         [](Bench& b) {
             CommandList list = b.list();
             (void)b.device().submit(std::span(&list, 1));
             (void)b.device().submit(std::span(&list, 1));
         }},
        {"N-107",
         [](Bench& b) {
             Bench other;
             (void)b.device().submit(other.list());
         }},
        {"N-108", [](Bench& b) { (void)b.device().wait(Fence{1000}); }},
    };
}

std::vector<Breach> resource_breaches() {
    return {
        {"N-201",
         [](Bench& b) {
             (void)b.device().create_buffer({0, storage, MemoryKind::device, "the buffer"});
         }},
        {"N-201",
         [](Bench& b) {
             (void)b.device().create_buffer({std::uint64_t{1} << 63, storage, MemoryKind::device, "the buffer"});
         }},
        {"N-202",
         [](Bench& b) {
             (void)b.device().create_buffer({16, BufferUsage::none, MemoryKind::device, "the buffer"});
         }},
        {"N-202",
         [](Bench& b) {
             (void)b.device().create_buffer({16, storage, MemoryKind::readback, "the buffer"});
         }},
        {"N-202",
         [](Bench& b) {
             (void)b.device().create_buffer({16, storage, MemoryKind::upload, "the buffer"});
         }},
        {"N-202",
         [](Bench& b) {
             (void)b.device().create_buffer({16, BufferUsage::storage_texel, MemoryKind::upload, "the buffer"});
         }},
        {"N-202", [](Bench& b) { (void)b.device().create_buffer({16, BufferUsage::uniform_texel}); },
         [](Capabilities& c) { c.texel_buffers = false; }},
        {"N-210", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.format = undefined; }); }},
        {"N-210", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.format = rgb32_float; }); }},
        {"N-211", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.width = 0; }); }},
        {"N-211", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.width = d.height = 1000000; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.depth = 2; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.dimension = TextureDimension::d1; }); }},
        {"N-212", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.dimension = TextureDimension::cube; }); }},
        {"N-212",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.dimension = TextureDimension::d3;
                 d.layers = 2;
             });
         }},
        {"N-212",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.dimension = TextureDimension::d3;
                 d.format = bc1_rgba_unorm;
             });
         }},
        {"N-213", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.layers = 5000; }); }},
        {"N-213", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.layers = 0; }); }},
        {"N-213",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.dimension = TextureDimension::cube;
                 d.layers = 12;
             });
         },
         [](Capabilities& c) { c.cube_arrays = false; }},
        {"N-214", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.mips = 6; }); }},
        {"N-214", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.mips = 0; }); }},
        {"N-215", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.samples = 2; }); }},
        {"N-215",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.samples = 4;
                 d.mips = 2;
             });
         }},
        {"N-215",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.samples = 4;
                 d.format = r32_uint;
             });
         }},
        {"N-215",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.samples = 4;
                 d.usage |= TextureUsage::storage;
             });
         }},
        {"N-216", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.usage = TextureUsage::none; }); }},
        {"N-217",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.format = bc7_rgba_unorm;
                 d.usage = TextureUsage::color_target;
             });
         }},
        {"N-217", [](Bench& b) { texture_with(b, [](TextureDesc& d) { d.format = bc7_rgba_unorm; }); },
         [](Capabilities& c) { c.formats[static_cast<std::uint32_t>(bc7_rgba_unorm)] = FormatSupport::none; }},
        {"N-218",
         [](Bench& b) {
             texture_with(b, [](TextureDesc& d) {
                 d.width = d.height = 16384;
                 d.layers = 2048;
                 d.format = rgba32_float;
             });
         }},
        {"N-230", [](Bench& b) { (void)b.device().create_sampler({.max_anisotropy = 64.0f, .name = "the sampler"}); }},
        {"N-230", [](Bench& b) { (void)b.device().create_sampler({.max_anisotropy = 2.0f, .name = "the sampler"}); },
         [](Capabilities& c) { c.anisotropic_filtering = false; }},
        {"N-231",
         [](Bench& b) {
             (void)b.device().create_sampler({.address_v = AddressMode::clamp_to_border, .name = "the sampler"});
         },
         [](Capabilities& c) { c.border_color = false; }},
        {"N-232",
         [](Bench& b) { (void)b.device().create_sampler({.min_lod = 2.0f, .max_lod = 1.0f, .name = "the sampler"}); }},
        {"N-240",
         [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.base_mip = 1;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         }},
        {"N-241",
         [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.dimension = ViewDimension::cube;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         }},
        {"N-241",
         [](Bench& b) {
             TextureDesc desc = Bench::texture_desc(TextureUsage::sampled);
             desc.layers = 4;
             group_with(b, BindingType::sampled_texture,
                        {{.binding = 0, .texture = TextureView::subresource(*b.device().create_texture(desc), 0, 1)}});
         },
         [](Capabilities& c) { c.texture_views = false; }},
        {"N-242",
         [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.format = rgba32_float;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         }},
        {"N-242",
         [](Bench& b) {
             TextureView view(b.texture(TextureUsage::sampled));
             view.format = rgba8_srgb;
             group_with(b, BindingType::sampled_texture, {{.binding = 0, .texture = view}});
         },
         [](Capabilities& c) { c.texture_view_formats = false; }},
        {"N-250", [](Bench& b) { (void)b.device().create_query_pool({.count = 0, .name = "the pool"}); }},
        {"N-250", [](Bench& b) { (void)b.device().create_query_pool({.count = 65537, .name = "the pool"}); }},
        {"N-251", [](Bench& b) { (void)b.device().create_query_pool({.count = 1, .name = "the pool"}); },
         [](Capabilities& c) { c.timestamps = false; }},
    };
}

std::vector<Breach> group_breaches() {
    using enum BindingType;
    return {
        {"N-301",
         [](Bench& b) {
             layout_with(b, {{0, sampler, 1, ShaderStage::vertex}, {0, sampler, 1, ShaderStage::fragment}});
         }},
        {"N-302",
         [](Bench& b) {
             layout_with(b, {{0, sampler, 1, ShaderStage::none}});
         }},
        {"N-303",
         [](Bench& b) {
             layout_with(b, {{0, uniform_buffer, 17, ShaderStage::vertex}});
         }},
        {"N-303",
         [](Bench& b) {
             layout_with(b, {{0, combined_texture_sampler, 30, ShaderStage::fragment},
                             {1, sampled_texture, 3, ShaderStage::fragment}});
         }},
        {"N-304",
         [](Bench& b) {
             layout_with(b, {{0, sampled_texture, 0, ShaderStage::fragment}});
         },
         [](Capabilities& c) { c.descriptor_indexing = false; }},
        {"N-304",
         [](Bench& b) {
             layout_with(b, {{0, uniform_buffer, 0, ShaderStage::fragment}});
         }},
        {"N-305",
         [](Bench& b) {
             layout_with(b, {{5000, sampler, 1, ShaderStage::fragment}});
         }},
        {"N-306", [](Bench& b) { layout_with(b, {{0, uniform_texel_buffer, 1, ShaderStage::fragment}}); },
         [](Capabilities& c) { c.texel_buffers = false; }},
        {"N-310",
         [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 3, .buffer = b.buffer(BufferUsage::uniform)}}); }},
        {"N-311",
         [](Bench& b) {
             const Buffer u = b.buffer(BufferUsage::uniform);
             group_with(b, uniform_buffer, {{.binding = 0, .buffer = u}, {.binding = 0, .buffer = u}});
         }},
        {"N-312", [](Bench& b) { group_with(b, uniform_buffer, {}); }},
        {"N-312",
         [](Bench& b) {
             group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .element = 1}}, 2);
         }},
        {"N-313",
         [](Bench& b) {
             group_with(b, uniform_buffer, {{.binding = 0, .texture = b.texture(TextureUsage::sampled)}});
         }},
        {"N-313",
         [](Bench& b) {
             group_with(b, combined_texture_sampler, {{.binding = 0, .texture = b.texture(TextureUsage::sampled)}});
         }},
        {"N-314", [](Bench& b) { group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(storage)}}); }},
        {"N-314",
         [](Bench& b) {
             group_with(b, readonly_storage_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform)}});
         }},
        {"N-315",
         [](Bench& b) {
             group_with(b, sampled_texture, {{.binding = 0, .texture = b.texture(TextureUsage::color_target)}});
         }},
        {"N-315",
         [](Bench& b) {
             group_with(b, writeonly_storage_image, {{.binding = 0, .texture = b.texture(TextureUsage::sampled)}});
         }},
        {"N-316",
         [](Bench& b) {
             group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .offset = 256}});
         }},
        {"N-316",
         [](Bench& b) {
             group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .size = 257}});
         }},
        {"N-317",
         [](Bench& b) {
             group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .offset = 16}});
         }},
        {"N-318",
         [](Bench& b) {
             group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform, 1 << 20)}});
         }},
        {"N-319",
         [](Bench& b) {
             group_with(b, uniform_buffer, {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform), .element = 1}});
         }},
        {"N-320",
         [](Bench& b) {
             group_with(b, combined_texture_sampler,
                        {{.binding = 0,
                          .texture = b.texture(TextureUsage::sampled, r32_uint),
                          .sampler = *b.device().create_sampler({.name = "linear"})}});
         }},
        {"N-321",
         [](Bench& b) {
             TextureDesc desc = Bench::texture_desc(TextureUsage::storage);
             desc.mips = 3;
             TextureView view(*b.device().create_texture(desc));
             view.mip_count = 2;
             group_with(b, storage_image, {{.binding = 0, .texture = view}});
         }},
        {"N-314",
         [](Bench& b) {
             group_with(b, uniform_texel_buffer,
                        {{.binding = 0, .buffer = b.buffer(BufferUsage::storage_texel), .format = r32_uint}});
         }},
        {"N-314",
         [](Bench& b) {
             group_with(b, storage_texel_buffer,
                        {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform_texel | storage), .format = r32_uint}});
         }},
        {"N-317",
         [](Bench& b) {
             texels_with(b, uniform_texel_buffer, {.offset = 4, .format = r32_uint});
         }},
        {"N-318",
         [](Bench& b) {
             const Buffer large = b.buffer(BufferUsage::uniform_texel, 65537);
             group_with(b, uniform_texel_buffer, {{.binding = 0, .buffer = large, .format = r8_uint}});
         }},
        {"N-323", [](Bench& b) { texels_with(b, uniform_texel_buffer, {}); }},
        {"N-323", [](Bench& b) { texels_with(b, storage_texel_buffer, {.format = bc1_rgba_unorm}); }},
        {"N-323",
         [](Bench& b) { texels_with(b, readonly_storage_texel_buffer, {.format = r16_snorm}); },
         [](Capabilities& c) {
             c.formats[static_cast<std::uint32_t>(r16_snorm)] = FormatSupport::uniform_texel_buffer;
         }},
        {"N-324", [](Bench& b) { texels_with(b, writeonly_storage_texel_buffer, {.size = 30, .format = r32_uint}); }},
        {"N-324",
         [](Bench& b) { texels_with(b, uniform_texel_buffer, {.offset = 240, .size = 8, .format = rgba32_float}); }},
    };
}

std::vector<Breach> pipeline_breaches() {
    return {
        {"N-401",
         [](Bench& b) {
             ShaderDesc desc = Bench::compiled("comp", storage_shader);
             desc.stage = ShaderStage::none;
             (void)b.device().create_shader(desc);
         }},
        {"N-402",
         [](Bench& b) {
             (void)b.device().create_shader(
                 Bench::compiled("comp",
                                 "#extension GL_ARB_gpu_shader_fp64 : enable\nlayout(local_size_x = 1) in; layout(set "
                                 "= 0, binding = 0) buffer R { double r; }; void main() { r = r * 2.0lf; }"));
         }},
        {"N-402",
         [](Bench& b) { (void)b.device().create_shader(Bench::compiled("comp", texel_shader)); },
         [](Capabilities& c) { c.texel_buffers = false; }},
        {"N-403",
         [](Bench& b) {
             (void)b.device().create_shader(Bench::compiled(
                 "frag", "layout(set = 0, binding = 0, r32ui) uniform uimageBuffer r; void main() { imageStore(r, 0, "
                         "uvec4(1)); }"));
         },
         [](Capabilities& c) { c.storage_in_fragment = false; }},
        {"N-403",
         [](Bench& b) {
             (void)b.device().create_shader(Bench::compiled(
                 "frag", "layout(set = 0, binding = 0) buffer R { uint r; }; void main() { atomicAdd(r, 1u); }"));
         },
         [](Capabilities& c) { c.storage_in_fragment = false; }},
        {"N-405", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = d.fragment; }); }},
        {"N-405",
         [](Bench& b) {
             (void)b.device().create_compute_pipeline({.shader = b.plain_vertex(), .name = "the pipeline"});
         }},
        {"N-406",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.fragment = b.shader("frag",
                                       "layout(location = 2) in vec2 uv; layout(location = 0) out vec4 color; void "
                                       "main() { color = vec4(uv, 0, 1); }");
             });
         }},
        {"N-407",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.vertex = b.shader(
                     "vert", "layout(set = 0, binding = 0) uniform A { vec4 a; }; void main() { gl_Position = a; }");
                 d.fragment = b.shader("frag",
                                       "layout(set = 0, binding = 0) uniform sampler2D image; layout(location = 0) out "
                                       "vec4 color; void main() { color = texelFetch(image, ivec2(0), 0); }");
             });
         }},
        {"N-408",
         [](Bench& b) {
             (void)b.device().create_compute_pipeline(
                 {.shader = b.shader("comp", storage_shader),
                  .bind_group_layouts = {b.layout(BindingType::readonly_storage_buffer)},
                  .name = "the pipeline"});
         }},
        {"N-409",
         [](Bench& b) {
             (void)b.device().create_shader(
                 Bench::compiled("comp",
                                 "layout(local_size_x = 1) in; layout(set = 6, binding = 0) buffer Result { uint "
                                 "result; }; void main() { result = 1u; }"));
         }},
        {"N-410",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex = b.shader("vert", input_vertex); });
         }},
        {"N-411",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.vertex = b.shader("vert", input_vertex);
                 d.vertex_buffers = {{16}};
                 d.vertex_attributes = {{0, 0, 0, rgba32_uint}};
             });
         }},
        {"N-412",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.vertex = b.shader("vert", input_vertex);
                 d.vertex_buffers = {{16}};
                 d.vertex_attributes = {{0, 0, 0, bc1_rgba_unorm}};
             });
         }},
        {"N-413",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.vertex = b.shader("vert", input_vertex);
                 d.vertex_buffers = {{16}};
                 d.vertex_attributes = {{0, 0, 4, rgba32_float}};
             });
         }},
        {"N-413",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.vertex = b.shader("vert", input_vertex);
                 d.vertex_attributes = {{0, 0, 0, rgba32_float}};
             });
         }},
        {"N-414", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex_buffers.resize(17); }); }},
        {"N-414", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.vertex_buffers = {{5000}}; }); }},
        {"N-415",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets.resize(5, d.color_targets[0]); });
         },
         [](Capabilities& c) { c.max_color_targets = 4; }},
        {"N-416",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets[0].format = rgb9e5_float; });
         }},
        {"N-417",
         [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets[0].format = r32_uint; }); }},
        {"N-418",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.color_targets.resize(2, d.color_targets[0]); });
         }},
        {"N-419",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.color_targets[0].format = r32_uint;
                 d.color_targets[0].blend.enabled = true;
                 d.fragment =
                     b.shader("frag", "layout(location = 0) out uvec4 color; void main() { color = uvec4(1); }");
             });
         }},
        {"N-420",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.color_targets[0].blend = {.enabled = true, .source_color = BlendFactor::source1_color};
             });
         }},
        {"N-420",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.color_targets[0].blend = {.enabled = true, .source_color = BlendFactor::source1_color};
             });
         },
         [](Capabilities& c) { c.dual_source_blending = false; }},
        {"N-421",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.fragment = b.shader("frag",
                                       "layout(location = 0) out vec4 a; layout(location = 1) out vec4 b; void main() "
                                       "{ a = b = vec4(1); }");
                 d.color_targets.resize(2, d.color_targets[0]);
                 d.color_targets[1].blend.enabled = true;
             });
         },
         [](Capabilities& c) { c.independent_blend = false; }},
        {"N-422",
         [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.format = r32_float; }); }},
        {"N-423",
         [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.depth_test = true; }); }},
        {"N-423",
         [](Bench& b) {
             pipeline_with(b, [&](GraphicsPipelineDesc& d) {
                 d.depth_stencil.format = d32_float;
                 d.depth_stencil.stencil_test = true;
             });
         }},
        {"N-424", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.samples = 8; }); }},
        {"N-425",
         [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.depth_clamp = true; }); },
         [](Capabilities& c) { c.depth_clamp = false; }},
        {"N-425",
         [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.depth_stencil.depth_bias_clamp = 1.0f; }); },
         [](Capabilities& c) { c.depth_bias_clamp = false; }},
        {"N-425", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.fill = FillMode::line; }); },
         [](Capabilities& c) { c.wireframe = false; }},
        {"N-426",
         [](Bench& b) {
             (void)b.device().create_shader(
                 Bench::compiled("comp",
                                 "layout(local_size_x = 1) in; layout(push_constant) uniform P { vec4 a[9]; }; "
                                 "layout(set = 0, binding = 0) buffer R { vec4 r; }; void main() { r = a[8]; }"));
         }},
        {"N-427",
         [](Bench& b) {
             (void)b.device().create_compute_pipeline(
                 {.shader = b.shader("comp", storage_shader), .specialization = {{7, 1u}}, .name = "the pipeline"});
         }},
        {"N-428",
         [](Bench& b) {
             (void)b.device().create_shader(
                 Bench::compiled("comp", "layout(local_size_x = 64, local_size_y = 32) in; void main() {}"));
         }},
        {"N-428",
         [](Bench& b) {
             (void)b.device().create_compute_pipeline(
                 {.shader = b.shader("comp", "layout(local_size_x_id = 1) in; void main() {}"),
                  .specialization = {{1, 5000u}},
                  .name = "the pipeline"});
         }},
        {"N-429", [](Bench& b) { pipeline_with(b, [&](GraphicsPipelineDesc& d) { d.fragment = {}; }); }},
    };
}

}  // namespace nacre::test
