// SPDX-License-Identifier: Apache-2.0
// Ways to break the rules of acceleration structures.
#include <array>
#include <limits>

#include "tests/rhi/validation_breaches.h"

namespace nacre::test {

using namespace rhi;

namespace {

constexpr auto input = BufferUsage::acceleration_structure_input;

AccelerationStructureDesc bottom_desc() {
    return {.level = AccelerationStructureLevel::bottom,
            .geometries = {{.primitive_count = 1, .vertex_count = 3, .index_type = IndexType::uint32}},
            .name = "the bottom"};
}
AccelerationStructure bottom(Bench& b) { return *b.device().create_acceleration_structure(bottom_desc()); }
AccelerationStructure top(Bench& b) {
    return *b.device().create_acceleration_structure(
        {.level = AccelerationStructureLevel::top, .max_instances = 1, .name = "the top"});
}
void bottom_with(Bench& b, const std::function<void(AccelerationStructureDesc&)>& change) {
    AccelerationStructureDesc desc = bottom_desc();
    change(desc);
    (void)b.device().create_acceleration_structure(desc);
}
GeometrySource source(Bench& b) { return {.vertices = b.buffer(input), .indices = b.buffer(input)}; }
void build_with(Bench& b, const std::function<void(GeometrySource&)>& change) {
    GeometrySource changed = source(b);
    change(changed);
    CommandList list = b.list();
    list.build_acceleration_structure(bottom(b), std::array{changed});
}
void instance_with(Bench& b, const std::function<void(AccelerationStructureInstance&)>& change) {
    AccelerationStructureInstance changed{.bottom_level = bottom(b)};
    change(changed);
    CommandList list = b.list();
    list.build_acceleration_structure(top(b), std::array{changed});
}
/// Both levels, built.
struct Built {
    AccelerationStructure below, above;
};
Built built(Bench& b) {
    const Built made{bottom(b), top(b)};
    CommandList list = b.list();
    list.build_acceleration_structure(made.below, std::array{source(b)});
    list.build_acceleration_structure(made.above,
                                      std::array{AccelerationStructureInstance{.bottom_level = made.below}});
    (void)b.device().submit(std::move(list));
    return made;
}
void dispatch_with(Bench& b, AccelerationStructure structure, const std::function<void()>& before = {}) {
    const ComputePipeline p = b.compute(
        "#extension GL_EXT_ray_query : require\nlayout(local_size_x = 1) in; layout(set = 0, binding = 0) uniform "
        "accelerationStructureEXT scene; void main() { rayQueryEXT query; rayQueryInitializeEXT(query, scene, 0, 255, "
        "vec3(0), "
        "0, vec3(1), 1); rayQueryProceedEXT(query); }");
    const BindGroup group = b.group(p, {{.binding = 0, .acceleration_structure = structure}});
    if (before) before();
    CommandList list = b.list();
    list.set_pipeline(p);
    list.set_bind_group(0, group);
    list.dispatch({});
    (void)b.device().submit(std::move(list));
}

}  // namespace

std::vector<Breach> structure_breaches() {
    const auto without = [](Capabilities& c) { c.ray_query = false; };
    return {
        {"N-202", [](Bench& b) { (void)b.device().create_buffer({.size = 16, .usage = input}); }, without},
        {"N-260", [](Bench& b) { (void)b.device().create_acceleration_structure(bottom_desc()); }, without},
        {"N-260", [](Bench& b) { bottom_with(b, [](auto& d) { d.geometries[0].type = GeometryType::curves; }); }},
        // Boxes with the stride of vertices, with indices, and beside triangles.
        {"N-262",
         [](Bench& b) {
             bottom_with(b,
                         [](auto& d) { d.geometries.push_back({.type = GeometryType::boxes, .vertex_stride = 24}); });
         }},
        {"N-262",
         [](Bench& b) {
             bottom_with(b, [](auto& d) { d.geometries = {{.type = GeometryType::boxes, .primitive_count = 1}}; });
         }},
        {"N-262",
         [](Bench& b) {
             bottom_with(b, [](auto& d) {
                 d.geometries = {{.type = GeometryType::boxes, .vertex_stride = 24, .index_type = IndexType::uint16}};
             });
         }},
        {"N-260",
         [](Bench& b) {
             (void)b.device().create_bind_group_layout(
                 {.bindings = {{0, BindingType::acceleration_structure, 1, ShaderStage::compute}}});
         },
         without},
        {"N-261", [](Bench& b) { bottom_with(b, [](auto& d) { d.max_instances = 1; }); }},
        {"N-261", [](Bench& b) { bottom_with(b, [](auto& d) { d.level = AccelerationStructureLevel::top; }); }},
        {"N-262", [](Bench& b) { bottom_with(b, [](auto& d) { d.geometries[0].vertex_stride = 10; }); }},
        {"N-262", [](Bench& b) { bottom_with(b, [](auto& d) { d.geometries[0].primitive_count = 1u << 30; }); }},
        {"N-262",
         [](Bench& b) {
             bottom_with(b, [](auto& d) { d.geometries[0].index_type = {}, d.geometries[0].vertex_count = 2; });
         }},
        {"N-322",
         [](Bench& b) {
             (void)b.device().create_bind_group({.layout = b.layout(BindingType::acceleration_structure),
                                                 .entries = {{.binding = 0, .acceleration_structure = bottom(b)}}});
         }},
        {"N-313",
         [](Bench& b) {
             (void)b.device().create_bind_group({.layout = b.layout(BindingType::storage_buffer),
                                                 .entries = {{.binding = 0, .acceleration_structure = top(b)}}});
         }},
        {"N-580",
         [](Bench& b) {
             CommandList list = b.list();
             list.build_acceleration_structure(bottom(b), std::array{source(b), source(b)});
         }},
        {"N-580",
         [](Bench& b) {
             CommandList list = b.list();
             list.build_acceleration_structure(top(b), std::array{source(b)});
         }},
        {"N-581", [](Bench& b) { build_with(b, [&](auto& s) { s.vertices = b.buffer(storage); }); }},
        {"N-582", [](Bench& b) { build_with(b, [](auto& s) { s.index_offset = 2; }); }},
        {"N-583", [](Bench& b) { build_with(b, [](auto& s) { s.vertex_offset = 224; }); }},
        {"N-584", [](Bench& b) { instance_with(b, [](auto& i) { i.custom_index = 1u << 24; }); }},
        {"N-584",
         [](Bench& b) { instance_with(b, [](auto& i) { i.transform[5] = std::numeric_limits<float>::infinity(); }); }},
        {"N-584", [](Bench& b) { instance_with(b, [&](auto& i) { i.bottom_level = top(b); }); }},
        {"N-585",
         [](Bench& b) {
             CommandList list = b.list();
             list.update_acceleration_structure(bottom(b), std::array{source(b)});
         }},
        {"N-585",
         [](Bench& b) {
             AccelerationStructureDesc desc = bottom_desc();
             desc.allow_update = true;
             CommandList list = b.list();
             list.update_acceleration_structure(*b.device().create_acceleration_structure(desc), std::array{source(b)});
             (void)b.device().submit(std::move(list));
         }},
        {"N-586", [](Bench& b) { dispatch_with(b, top(b)); }},
        {"N-587",
         [](Bench& b) {
             const Built made = built(b);
             dispatch_with(b, made.above, [&] { b.device().destroy(made.below); });
         }},
        {"N-588",
         [](Bench& b) {
             const Built made = built(b);
             dispatch_with(b, made.above, [&] {
                 CommandList list = b.list();
                 list.build_acceleration_structure(made.below, std::array{source(b)});
                 (void)b.device().submit(std::move(list));
             });
         }},
    };
}

}  // namespace nacre::test
