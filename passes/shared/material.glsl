// SPDX-License-Identifier: Apache-2.0
// Pattern generation: from a material's blob, its textures and a place on a surface to a slab. Draws and hits share this
// text; where they get those from stands in draw_material.glsl and hit_material.glsl (which a shader of hits includes
// before).
#ifndef NACRE_MATERIAL
#define NACRE_MATERIAL
#ifndef NACRE_HIT_MATERIAL
#if defined(MATERIAL_KIND) && !defined(READS_POSITION)
#define READS_POSITION
#endif
#include "passes/shared/draw_material.glsl"
#endif
#include "materials/closures/conversions.glsl"
#include "passes/shared/single_slab.glsl"

#if defined(HAS_NORMALS) || defined(MATERIAL_KIND)
// World; normal map and side applied.
vec3 shading_normal() {
    vec3 normal = unit_or(in_normal, vec3(0.0, 1.0, 0.0));
#ifdef NORMAL_TEXTURE
    WHERE_TEXTURE(2u) {
        // As MikkTSpace decodes: the interpolated vectors are used as they are, the bitangent is made here.
        vec3 bitangent = in_tangent.w * cross(in_normal, in_tangent.xyz);
        vec3 texel = normal_texel().rgb * 2.0 - 1.0;
        texel.xy *= material_numbers(7u).x;
        normal = unit_or(texel.x * in_tangent.xyz + texel.y * bitangent + texel.z * in_normal, normal);
    }
#endif
#ifdef DOUBLE_SIDED
    if (surface_faces_away) normal = -normal;
#endif
    return normal;
}
#endif

#ifdef MATERIAL_KIND
// Made for the kinds of a scene: base_color(), emission() and evaluate_slab() of number MATERIAL_KIND.
#include "passes/shared/material_kinds.glsl"
#else

// Rows of a plain slab's blob.
#define plain_base_color material_numbers(2u)  // rgb, alpha
#define plain_emission material_numbers(3u)    // cd/m2; w: metallic
#define plain_f0 material_numbers(4u)          // dielectric; w: f90
#define plain_scales material_numbers(5u)      // roughness, occlusion strength

vec4 base_color() {
    vec4 color = plain_base_color;
#ifdef BASE_COLOR_TEXTURE
    color *= base_color_texel();
#endif
#ifdef HAS_COLORS
    color *= in_color;
#endif
    return color;
}

vec3 emission() {
    vec3 color = plain_emission.rgb;
#ifdef EMISSION_TEXTURE
    color *= emission_texel().rgb;
#endif
    // Half floats hold no more.
    return min(color, vec3(65504.0));
}

#ifdef HAS_NORMALS
SingleSlab evaluate_slab(vec3 color) {
    SingleSlab slab;
    float metallic = plain_emission.w;
    slab.roughness = plain_scales.x;
#ifdef METALLIC_ROUGHNESS_TEXTURE
    vec2 texel = metallic_roughness_texel().gb;
    slab.roughness *= texel.x;
    metallic *= texel.y;
#endif
    vec3 f0 = plain_f0.rgb;
    float f90 = plain_f0.w;
#ifdef SPECULAR_TEXTURE
    float specular = specular_texel().a;
    f0 *= specular;
    f90 *= specular;
#endif
#ifdef SPECULAR_COLOR_TEXTURE
    f0 *= specular_color_texel().rgb;
#endif
    AlbedoAndF0 both = metalness_to_albedo_f0(color, metallic, f0);
    slab.diffuse = both.albedo;
    slab.f0 = both.f0;
    slab.f90 = mix(f90, 1.0, metallic);
    slab.normal = shading_normal();
    slab.occlusion = 1.0;
#ifdef OCCLUSION_TEXTURE
    slab.occlusion += plain_scales.y * (occlusion_texel().r - 1.0);
#endif
    return slab;
}
#endif

#endif

#endif
