// SPDX-License-Identifier: Apache-2.0
// The material of a draw, set 1: its blob, its sideband (MATERIAL_SIDEBAND rows) where it has one, and its textures, each only
// where the materials drawn with this shader have it (BASE_COLOR_TEXTURE, ...); the value is the number of its texture
// coordinates, 0 or 1. passes/shared/hit_material.glsl offers the same names where nothing is drawn.
#ifndef NACRE_DRAW_MATERIAL
#define NACRE_DRAW_MATERIAL
#include "passes/shared/fragment_inputs.glsl"

layout(set = 1, binding = 0, std140) uniform MaterialBlock { uvec4 rows[8]; } material_block;
#define material_row(row) material_block.rows[row]
#ifdef MATERIAL_SIDEBAND
layout(set = 1, binding = 5, std140) uniform MaterialSideband { vec4 rows[MATERIAL_SIDEBAND]; } material_sideband;
#define sideband_row(row) material_sideband.rows[row]
#endif
#include "passes/shared/material_blob.glsl"

#ifdef TEXTURE_TRANSFORMS
vec2 moved_uv(int set, int slot) {
    vec3 uv = vec3(uv_of(set), 1.0);
    return vec2(dot(sideband_row(2 * slot).xyz, uv), dot(sideband_row(2 * slot + 1).xyz, uv));
}
#define CUSTOM_SIDEBAND_START 14u
#else
#define moved_uv(set, slot) uv_of(set)
#define CUSTOM_SIDEBAND_START 0u
#endif
#define custom_sideband(i) sideband_row((i) + CUSTOM_SIDEBAND_START)

// Whether texture `slot` is read is known when a draw's shader is made.
#define WHERE_TEXTURE(slot)
#define DRAW_TEXTURE(slot, name, set_of_uv) \
    layout(set = 1, binding = 6 + slot) uniform sampler2D name##_texture; \
    vec4 name##_texel() { return texture(name##_texture, moved_uv(set_of_uv, slot)); }
#ifdef BASE_COLOR_TEXTURE
DRAW_TEXTURE(0, base_color, BASE_COLOR_TEXTURE)
#endif
#ifdef METALLIC_ROUGHNESS_TEXTURE
DRAW_TEXTURE(1, metallic_roughness, METALLIC_ROUGHNESS_TEXTURE)
#endif
#ifdef NORMAL_TEXTURE
DRAW_TEXTURE(2, normal, NORMAL_TEXTURE)
#endif
#ifdef OCCLUSION_TEXTURE
DRAW_TEXTURE(3, occlusion, OCCLUSION_TEXTURE)
#endif
#ifdef EMISSION_TEXTURE
DRAW_TEXTURE(4, emission, EMISSION_TEXTURE)
#endif
#ifdef SPECULAR_TEXTURE
DRAW_TEXTURE(5, specular, SPECULAR_TEXTURE)
#endif
#ifdef SPECULAR_COLOR_TEXTURE
DRAW_TEXTURE(6, specular_color, SPECULAR_COLOR_TEXTURE)
#endif

#ifdef MATERIAL_KIND
// Texture i, a constant; white where there is none.
vec4 material_texel(int i) {
#ifdef BASE_COLOR_TEXTURE
    if (i == 0) return base_color_texel();
#endif
#ifdef METALLIC_ROUGHNESS_TEXTURE
    if (i == 1) return metallic_roughness_texel();
#endif
#ifdef NORMAL_TEXTURE
    if (i == 2) return normal_texel();
#endif
#ifdef OCCLUSION_TEXTURE
    if (i == 3) return occlusion_texel();
#endif
#ifdef EMISSION_TEXTURE
    if (i == 4) return emission_texel();
#endif
#ifdef SPECULAR_TEXTURE
    if (i == 5) return specular_texel();
#endif
#ifdef SPECULAR_COLOR_TEXTURE
    if (i == 6) return specular_color_texel();
#endif
    return vec4(1.0);
}
#endif

#endif
