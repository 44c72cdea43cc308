// SPDX-License-Identifier: Apache-2.0
// The material of a point that no rasterizer found: a hit of a ray, a texel, a point that is given. Includes what shades it
// with the text of the draws; who includes this sets `hit_material` to the number of the material and the variables of
// passes/shared/fragment_inputs.glsl, and asks (passes/shared/hit_shading.glsl).
//
// TEXTURE_DETAIL says how the level of detail of textures is chosen:
//   0 differentials: in_uv0_dx, in_uv0_dy, ... what texture coordinates change by to the neighbors in the picture
//   1 ray cones: in_uv0_cone, in_uv1_cone, texture coordinates that the cone covers on the surface (uv_cone() below)
//   2 one level: in_texture_level
#ifndef NACRE_HIT_MATERIAL
#define NACRE_HIT_MATERIAL
#define NACRE_HITS
#include "rhi/shaders/texture_table.glsl"
#include "passes/shared/fragment_inputs.glsl"

layout(set = 2, binding = 0, std430) readonly buffer MaterialRows { uvec4 material_rows[]; };

uint hit_material = 0u;
uvec4 material_row(uint row) { return material_rows[hit_material * MATERIAL_STRIDE + row]; }
#include "passes/shared/material_blob.glsl"
vec4 sideband_row(uint row) { return uintBitsToFloat(material_rows[material_sideband_row() + row]); }
vec4 custom_sideband(uint i) { return sideband_row(i + (material_moves_uv() ? 14u : 0u)); }

// What textures need to know of a place.
struct HitUv {
    vec2 uv, dx, dy;
    float cone;
};

HitUv hit_uv(uint set) {
#if TEXTURE_DETAIL == 0
    return set == 0u ? HitUv(in_uv0, in_uv0_dx, in_uv0_dy, 0.0) : HitUv(in_uv1, in_uv1_dx, in_uv1_dy, 0.0);
#elif TEXTURE_DETAIL == 1
    return set == 0u ? HitUv(in_uv0, vec2(0.0), vec2(0.0), in_uv0_cone) : HitUv(in_uv1, vec2(0.0), vec2(0.0), in_uv1_cone);
#else
    return HitUv(set == 0u ? in_uv0 : in_uv1, vec2(0.0), vec2(0.0), 0.0);
#endif
}

HitUv hit_uv_moved(HitUv place, vec3 row_0, vec3 row_1) {
    HitUv moved;
    moved.uv = vec2(dot(row_0, vec3(place.uv, 1.0)), dot(row_1, vec3(place.uv, 1.0)));
    moved.dx = vec2(dot(row_0.xy, place.dx), dot(row_1.xy, place.dx));
    moved.dy = vec2(dot(row_0.xy, place.dy), dot(row_1.xy, place.dy));
    moved.cone = place.cone * sqrt(abs(row_0.x * row_1.y - row_0.y * row_1.x));
    return moved;
}

vec4 sample_hit(uint texture_index, HitUv place) {
#if TEXTURE_DETAIL == 0
    return sample_table_grad(texture_index, place.uv, place.dx, place.dy);
#elif TEXTURE_DETAIL == 1
    vec2 size = vec2(table_texture_size(texture_index, 0));
    return sample_table_lod(texture_index, place.uv, log2(max(place.cone * sqrt(size.x * size.y), 1e-6)));
#else
    return sample_table_lod(texture_index, place.uv, in_texture_level);
#endif
}

// Texture coordinates that a cone of this width (meters) covers where it meets a surface at this cosine. uv_density: root of
// the area of a triangle in texture coordinates over its area in square meters (Akenine-Moller 2021, ray cones).
float uv_cone(float width, float cosine, float uv_density) { return width * uv_density / max(abs(cosine), 1e-3); }

// A texture is read where the material has it and the surface the coordinates for it.
bool hit_reads_texture(uint i) {
    uint needed = material_reads_uv1(i) ? attribute_uv1 : attribute_uv0;
    if (i == 2u) needed |= attribute_tangents;
    return material_has_texture(i) && (in_attributes & needed) == needed;
}

// Texture i; white where there is none.
vec4 material_texel(uint i) {
    if (!hit_reads_texture(i)) return vec4(1.0);
    HitUv place = hit_uv(material_reads_uv1(i) ? 1u : 0u);
    if (material_moves_uv()) place = hit_uv_moved(place, sideband_row(2u * i).xyz, sideband_row(2u * i + 1u).xyz);
    return sample_hit(material_texture(i), place);
}
vec4 material_texel(int i) { return material_texel(uint(i)); }

// What the text of plain slabs knows as macros of its draws.
#define WHERE_TEXTURE(slot) if (hit_reads_texture(slot))
#define BASE_COLOR_TEXTURE
#define METALLIC_ROUGHNESS_TEXTURE
#define NORMAL_TEXTURE
#define OCCLUSION_TEXTURE
#define EMISSION_TEXTURE
#define SPECULAR_TEXTURE
#define SPECULAR_COLOR_TEXTURE
#define HAS_COLORS
#define HAS_NORMALS
#define HAS_TANGENTS
#define HAS_UV0
#define HAS_UV1
#define DOUBLE_SIDED
#define base_color_texel() material_texel(0u)
#define metallic_roughness_texel() material_texel(1u)
#define normal_texel() material_texel(2u)
#define occlusion_texel() material_texel(3u)
#define emission_texel() material_texel(4u)
#define specular_texel() material_texel(5u)
#define specular_color_texel() material_texel(6u)

// And of trees (passes/scene_closures.cpp).
#define WHERE_UV0 if ((in_attributes & attribute_uv0) != 0u)
#define WHERE_UV1 if ((in_attributes & attribute_uv1) != 0u)
vec4 tree_row(uint row) { return uintBitsToFloat(material_rows[material_row(6u).x + row]); }
uint tree_texture_number(uint i) { return half_word(material_rows[material_row(6u).y + (i >> 3u)], i & 7u); }
#define closure_texel(number, set) sample_hit(tree_texture_number(uint(number)), hit_uv(uint(set)))
#define closure_texel_moved(number, set, row_0, row_1) \
    sample_hit(tree_texture_number(uint(number)), hit_uv_moved(hit_uv(uint(set)), (row_0).xyz, (row_1).xyz))

#endif
