// SPDX-License-Identifier: Apache-2.0
// Ways to break the rules of recording and submission.
#include <array>

#include "tests/rhi/validation_breaches.h"

namespace nacre::test {

using namespace rhi;
using enum Format;

namespace {

const char* const sampling_shader =
    "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer Result { vec4 result[1]; }; layout(set = 0, "
    "binding = 1) uniform sampler2D image; void main() { result[0] = texelFetch(image, ivec2(0), 0); }";
const char* const push_shader =
    "layout(local_size_x = 1) in; layout(push_constant) uniform P { vec4 a; }; layout(set = 0, binding = 0) buffer "
    "Result { vec4 result[1]; }; void main() { result[0] = a; }";

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

void dispatch_texels(Bench& b, Format fetched, Format stored) {
    constexpr BufferUsage texels = BufferUsage::uniform_texel | BufferUsage::storage_texel;
    const ComputePipeline p = b.compute(texel_shader);
    CommandList l = b.list();
    l.set_pipeline(p);
    l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = b.buffer(texels), .format = fetched},
                                    {.binding = 1, .buffer = b.buffer(texels), .format = stored}}));
    l.dispatch({});
}

}  // namespace

std::vector<Breach> pass_breaches() {
    return {
        {"N-501",
         [](Bench& b) {
             CommandList l = b.list();
             l.draw({.vertex_count = 3});
         }},
        {"N-501",
         [](Bench& b) {
             CommandList l = b.list();
             l.end_render_pass();
         }},
        {"N-501",
         [](Bench& b) {
             CommandList l = b.list();
             l.set_pipeline(b.graphics());
         }},
        {"N-501",
         [](Bench& b) {
             CommandList l = b.list();
             l.set_stencil_reference(1);
         }},
        {"N-502",
         [](Bench& b) {
             CommandList l = b.pass();
             l.dispatch({});
         }},
        {"N-502",
         [](Bench& b) {
             CommandList l = b.pass();
             l.fill_buffer(b.buffer(copies), 0);
         }},
        {"N-502",
         [](Bench& b) {
             CommandList l = b.pass();
             l.begin_render_pass({.color = {{.view = b.target()}}});
         }},
        {"N-503", [](Bench& b) { pass_with(b, {}); }},
        {"N-504",
         [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.mips = 2;
             pass_with(b, {.color = {{.view = *b.device().create_texture(d)}}});
         }},
        {"N-505", [](Bench& b) { pass_with(b, {.color = {{.view = b.texture(TextureUsage::sampled)}}}); }},
        {"N-505",
         [](Bench& b) { pass_with(b, {.depth_stencil = {.view = b.texture(TextureUsage::sampled, d32_float)}}); }},
        {"N-506",
         [](Bench& b) {
             TextureView view(b.texture(TextureUsage::color_target, r32_uint));
             view.format = rgb9e5_float;
             pass_with(b, {.color = {{.view = view}}});
         }},
        {"N-507",
         [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.width = 8;
             pass_with(b, {.color = {{.view = b.target()}, {.view = *b.device().create_texture(d)}}});
         }},
        {"N-508",
         [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.samples = 4;
             pass_with(b, {.color = {{.view = b.target()}, {.view = *b.device().create_texture(d)}}});
         }},
        {"N-509",
         [](Bench& b) {
             const Texture t = b.target();
             pass_with(b, {.color = {{.view = t}, {.view = t}}});
         }},
        {"N-510", [](Bench& b) { pass_with(b, {.color = {{.view = b.target(), .resolve = b.target()}}}); }},
        {"N-510",
         [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.samples = 4;
             pass_with(b, {.color = {{.view = *b.device().create_texture(d), .resolve = b.target(rgba16_float)}}});
         }},
        {"N-511", [](Bench& b) { (void)b.device().submit(b.pass()); }},
        {"N-512",
         [](Bench& b) {
             pass_with(b,
                       {.depth_stencil = {.view = b.depth(), .depth_load = LoadOperation::clear, .read_only = true}});
         }},
        {"N-415",
         [](Bench& b) {
             pass_with(b, {.color = {{.view = b.target()}, {.view = b.target()}}});
         },
         [](Capabilities& c) { c.max_color_targets = 1; }},
    };
}

std::vector<Breach> draw_breaches() {
    return {
        {"N-520",
         [](Bench& b) {
             CommandList l = b.pass();
             l.draw({.vertex_count = 3});
         }},
        {"N-520",
         [](Bench& b) {
             CommandList l = b.list();
             l.dispatch({});
         }},
        {"N-521",
         [](Bench& b) {
             CommandList l = b.list();
             l.begin_render_pass({.color = {{.view = b.target(rgba16_float)}}});
             l.set_pipeline(b.graphics());
         }},
        {"N-521",
         [](Bench& b) {
             CommandList l = b.list();
             l.begin_render_pass({.color = {{.view = b.target()}}, .depth_stencil = {.view = b.depth()}});
             l.set_pipeline(b.graphics());
         }},
        {"N-522",
         [](Bench& b) {
             GraphicsPipelineDesc d = b.graphics_desc();
             d.depth_stencil = {.format = d32_float, .depth_test = true, .depth_write = true};
             CommandList l = b.list();
             l.begin_render_pass(
                 {.color = {{.view = b.target()}}, .depth_stencil = {.view = b.depth(), .read_only = true}});
             l.set_pipeline(*b.device().create_graphics_pipeline(d));
         }},
        {"N-523",
         [](Bench& b) {
             CommandList l = b.list();
             l.set_pipeline(b.compute(storage_shader));
             l.dispatch({});
         }},
        {"N-524",
         [](Bench& b) {
             const BindGroup other =
                 *b.device().create_bind_group({.layout = b.layout(BindingType::uniform_buffer),
                                                .entries = {{.binding = 0, .buffer = b.buffer(BufferUsage::uniform)}},
                                                .name = "the group"});
             CommandList l = b.list();
             l.set_pipeline(b.compute(storage_shader));
             l.set_bind_group(0, other);
             l.dispatch({});
         }},
        {"N-525",
         [](Bench& b) {
             const ComputePipeline p = b.compute(storage_shader);
             CommandList l = b.list();
             l.set_bind_group(4, b.group(p, {{.binding = 0, .buffer = b.buffer(storage)}}));
         }},
        {"N-525", [](Bench& b) { (void)b.device().bind_group_layout(b.compute(storage_shader), 3); }},
        {"N-526",
         [](Bench& b) {
             const ComputePipeline p = b.compute(push_shader);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = b.buffer(storage)}}));
             l.set_push_constants(1.0f);
             l.dispatch({});
         }},
        {"N-527",
         [](Bench& b) {
             CommandList l = b.list();
             l.set_push_constants(1.0f, 128);
         }},
        {"N-527",
         [](Bench& b) {
             CommandList l = b.list();
             l.set_push_constants(std::uint16_t{1});
         }},
        {"N-528",
         [](Bench& b) {
             CommandList l = pass_with_input(b);
             l.draw({.vertex_count = 3});
         }},
        {"N-529",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_vertex_buffer(0, b.buffer(storage));
         }},
        {"N-529",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_vertex_buffer(16, b.buffer(BufferUsage::vertex));
         }},
        {"N-529",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_vertex_buffer(0, b.buffer(BufferUsage::vertex), 256);
         }},
        {"N-530",
         [](Bench& b) {
             CommandList l = pass_with_input(b);
             l.set_vertex_buffer(0, b.buffer(BufferUsage::vertex));
             l.draw({.vertex_count = 17});
         }},
        {"N-530",
         [](Bench& b) {
             CommandList l = pass_with_input(b, true);
             l.set_vertex_buffer(0, b.buffer(BufferUsage::vertex), 16);
             l.draw({.vertex_count = 3, .instance_count = 16});
         }},
        {"N-531",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_pipeline(b.graphics());
             l.draw_indexed({.index_count = 3});
         }},
        {"N-532",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_index_buffer(b.buffer(BufferUsage::vertex), IndexType::uint16);
         }},
        {"N-532",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_index_buffer(b.buffer(BufferUsage::index), IndexType::uint32, 2);
         }},
        {"N-533",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_pipeline(b.graphics());
             l.set_index_buffer(b.buffer(BufferUsage::index), IndexType::uint32);
             l.draw_indexed({.index_count = 64, .first_index = 1});
         }},
        {"N-534",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_pipeline(b.graphics());
             l.draw({.vertex_count = 3, .first_instance = 1});
         },
         [](Capabilities& c) { c.base_instance = false; }},
        {"N-535",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_pipeline(b.graphics());
             l.draw_indirect(b.buffer(storage));
         }},
        {"N-535",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_pipeline(b.graphics());
             l.draw_indirect(b.buffer(BufferUsage::indirect), 2);
         }},
        {"N-535",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_pipeline(b.graphics());
             l.draw_indirect(b.buffer(BufferUsage::indirect), 0, 2, 12);
         }},
        {"N-536",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_pipeline(b.graphics());
             l.draw_indirect(b.buffer(BufferUsage::indirect), 0, 17);
         }},
        {"N-540",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_viewport({.width = 0, .height = 16});
         }},
        {"N-540",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_viewport({.width = 16, .height = 16, .max_depth = 2});
         }},
        {"N-541",
         [](Bench& b) {
             CommandList l = b.pass();
             l.set_scissor({1, 0, 16, 16});
         }},
        {"N-545",
         [](Bench& b) {
             CommandList l = b.list();
             l.set_pipeline(b.compute(storage_shader));
             l.dispatch({70000, 1, 1});
         }},
        {"N-546",
         [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::sampled);
             d.layers = 3;
             const ComputePipeline p = b.compute(sampling_shader);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(0, b.group(p, {{.binding = 0, .buffer = b.buffer(storage)},
                                             {.binding = 1,
                                              .texture = *b.device().create_texture(d),
                                              .sampler = *b.device().create_sampler({})}}));
             l.dispatch({});
         }},
        {"N-546",
         [](Bench& b) {
             const ComputePipeline p = b.compute(sampling_shader);
             CommandList l = b.list();
             l.set_pipeline(p);
             l.set_bind_group(
                 0,
                 b.group(p, {{.binding = 0, .buffer = b.buffer(storage)},
                             {.binding = 1,
                              .texture = b.texture(TextureUsage::sampled, r32_uint),
                              .sampler = *b.device().create_sampler(
                                  {.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest})}}));
             l.dispatch({});
         }},
        {"N-546", [](Bench& b) { dispatch_texels(b, Format::rgba8_unorm, Format::r32_uint); }},
        {"N-546", [](Bench& b) { dispatch_texels(b, Format::rgba8_sint, Format::r32_uint); }},
        {"N-546", [](Bench& b) { dispatch_texels(b, Format::rg16_uint, Format::rg16_uint); }},
        {"N-547",
         [](Bench& b) {
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
        {"N-550",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer(b.buffer(copies), 200, b.buffer(copies), 0, 57);
         }},
        {"N-550",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer(b.buffer(copies), 0, b.buffer(copies), ~0ull - 3, 8);
         }},
        {"N-550",
         [](Bench& b) {
             CommandList l = b.list();
             l.fill_buffer(b.buffer(copies), 0, 8, 256);
         }},
        {"N-550",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer_to_texture(b.buffer(copies), b.texture(texture_copies));
         }},
        {"N-550",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies),
                                      {.offset = {10, 0, 0}, .extent = {8, 8, 1}});
         }},
        {"N-550",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies), {.mip = 40});
         }},
        {"N-550",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_texture(b.texture(texture_copies), b.texture(texture_copies), {.layer_count = 2});
         }},
        {"N-551",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer(b.buffer(storage), 0, b.buffer(copies), 0, 16);
         }},
        {"N-551",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_texture_to_buffer(b.texture(TextureUsage::sampled), b.buffer(copies, 4096));
         }},
        {"N-551",
         [](Bench& b) {
             CommandList l = b.list();
             l.clear_texture(b.texture(TextureUsage::sampled), {});
         }},
        {"N-552",
         [](Bench& b) {
             CommandList l = b.list();
             l.fill_buffer(b.buffer(copies), 0, 2, 8);
         }},
        {"N-552",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies), {.bytes_per_row = 60});
         }},
        {"N-552",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_buffer_to_texture(b.buffer(copies, 4096), b.texture(texture_copies, bc1_rgba_unorm),
                                      {.offset = {2, 0, 0}, .extent = {4, 4, 1}});
         }},
        {"N-553",
         [](Bench& b) {
             CommandList l = b.list();
             l.copy_texture(b.texture(texture_copies), b.texture(texture_copies, r32_float));
         }},
        {"N-553",
         [](Bench& b) {
             CommandList l = b.list();
             l.clear_texture(b.texture(texture_copies, d32_float), {});
         }},
        {"N-554",
         [](Bench& b) {
             const Buffer c = b.buffer(copies);
             CommandList l = b.list();
             l.copy_buffer(c, 0, c, 8, 16);
         }},
        {"N-554",
         [](Bench& b) {
             const Texture t = b.texture(texture_copies);
             CommandList l = b.list();
             l.copy_texture(t, t);
         }},
        {"N-555",
         [](Bench& b) {
             TextureDesc d = Bench::texture_desc(TextureUsage::color_target);
             d.samples = 4;
             CommandList l = b.list();
             l.copy_texture_to_buffer(*b.device().create_texture(d), b.buffer(copies, 4096));
         }},
        {"N-558",
         [](Bench& b) {
             CommandList l = b.list();
             l.generate_mips(b.texture(TextureUsage::sampled));
         }},
        {"N-558",
         [](Bench& b) {
             CommandList l = b.list();
             l.generate_mips(b.texture(texture_copies, r32_uint));
         }},
    };
}

std::vector<Breach> other_breaches() {
    const auto pool = [](Bench& b, QueryType type) { return *b.device().create_query_pool({type, 4, "the pool"}); };
    return {
        {"N-560",
         [=](Bench& b) {
             CommandList l = b.list();
             l.write_timestamp(pool(b, QueryType::occlusion), 0);
         }},
        {"N-561",
         [=](Bench& b) {
             CommandList l = b.list();
             l.write_timestamp(pool(b, QueryType::timestamp), 4);
         }},
        {"N-561", [=](Bench& b) { (void)b.device().read_queries(pool(b, QueryType::timestamp), 3, 2); }},
        {"N-562",
         [=](Bench& b) {
             const QueryPool p = pool(b, QueryType::occlusion);
             CommandList l = b.pass();
             l.begin_occlusion_query(p, 0);
             l.begin_occlusion_query(p, 1);
         }},
        {"N-562",
         [=](Bench& b) {
             CommandList l = b.pass();
             l.end_occlusion_query(pool(b, QueryType::occlusion), 0);
         }},
        {"N-562",
         [=](Bench& b) {
             CommandList l = b.pass();
             l.begin_occlusion_query(pool(b, QueryType::occlusion), 0);
             l.end_render_pass();
         }},
        {"N-563", [=](Bench& b) { (void)b.device().read_queries(pool(b, QueryType::timestamp), 0, 1); }},
        {"N-565",
         [](Bench& b) {
             CommandList l = b.list();
             l.pop_debug_group();
         }},
        {"N-565",
         [](Bench& b) {
             CommandList l = b.list();
             l.push_debug_group("open");
             (void)b.device().submit(std::move(l));
         }},
        {"N-566",
         [](Bench& b) {
             CommandList l = b.list();
             l.end_statement();
         }},
        {"N-566",
         [](Bench& b) {
             CommandList l = b.pass();
             l.begin_statement("inside", {});
         }},
        {"N-566",
         [](Bench& b) {
             CommandList l = b.list();
             l.begin_statement("open", {});
             (void)b.device().submit(std::move(l));
         }},
        {"N-570",
         [](Bench& b) {
             // A texture that is sampled and drawn to in one pass.
             GraphicsPipelineDesc d = b.graphics_desc();
             d.fragment = b.shader("frag",
                                   "layout(set = 0, binding = 0) uniform sampler2D image; layout(location = 0) out "
                                   "vec4 color; void main() { color = texelFetch(image, ivec2(0), 0); }");
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
        {"N-571",
         [](Bench& b) {
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
        {"N-602",
         [](Bench& b) {
             const Buffer u = b.buffer(BufferUsage::copy_source, 256, "the buffer", MemoryKind::upload);
             (void)b.device().map(u);
             (void)b.device().map(u);
         }},
        {"N-602",
         [](Bench& b) {
             (void)b.device().unmap(b.buffer(BufferUsage::copy_source, 256, "the buffer", MemoryKind::upload));
         }},
        {"N-603",
         [](Bench& b) {
             const Buffer u = b.buffer(BufferUsage::copy_source, 256, "the buffer", MemoryKind::upload);
             (void)b.device().map(u);
             CommandList l = b.list();
             l.copy_buffer(u, 0, b.buffer(copies), 0, 256);
             (void)b.device().submit(std::move(l));
         }},
        {"N-604", [](Bench& b) { (void)b.device().write_buffer(b.buffer(storage), std::vector<std::byte>(16), 250); }},
        {"N-604", [](Bench& b) { (void)b.device().read_texture(b.texture(texture_copies), 1); }},
        {"N-605",
         [](Bench& b) {
             (void)b.device().write_texture(b.texture(TextureUsage::sampled), std::vector<std::byte>(1024));
         }},
        {"N-606",
         [](Bench& b) { (void)b.device().write_texture(b.texture(texture_copies), std::vector<std::byte>(1000)); }},
        {"N-701",
         [](Bench& b) {
             CommandList l = b.list();
             l.begin_statement("the pass", {});
             l.fill_buffer(b.buffer(copies), 0);
             l.end_statement();
             (void)b.device().submit(std::move(l));
         },
         {},
         [](DeviceDesc& d) { d.verify_statements = true; }},
        {"N-702",
         [](Bench& b) {
             const StatedAccess access{.buffer = b.buffer(copies), .use = ResourceUse::copy_source};
             CommandList l = b.list();
             l.begin_statement("the pass", std::span(&access, 1));
             l.end_statement();
             (void)b.device().submit(std::move(l));
         },
         {},
         [](DeviceDesc& d) { d.verify_statements = true; }},
    };
}

}  // namespace nacre::test
