// SPDX-License-Identifier: Apache-2.0
// The material of a draw: set 1. Every texture is there only where the materials drawn with this shader have it
// (BASE_COLOR_TEXTURE, ...); its value is the number of its texture coordinates, 0 or 1.
#ifndef NACRE_MATERIAL
#define NACRE_MATERIAL
#include "passes/shared/fragment_inputs.glsl"
#include "passes/shared/single_slab.glsl"

layout(set = 1, binding = 0, std140) uniform MaterialBlock {
    vec4 base_color;    // rgb, alpha
    vec4 emission;      // cd/m2; w: metallic
    vec4 f0;            // dielectric; w: f90
    vec4 scales;        // roughness, occlusion strength, normal scale, alpha cutoff
#ifdef TEXTURE_TRANSFORMS
    vec4 uv_rows[14];   // two rows for each texture, in the order of the bindings
#endif
} material;

#ifdef TEXTURE_TRANSFORMS
vec2 moved_uv(int set, int slot) {
    vec3 uv = vec3(uv_of(set), 1.0);
    return vec2(dot(material.uv_rows[2 * slot].xyz, uv), dot(material.uv_rows[2 * slot + 1].xyz, uv));
}
#else
#define moved_uv(set, slot) uv_of(set)
#endif

#ifdef BASE_COLOR_TEXTURE
layout(set = 1, binding = 1) uniform sampler2D base_color_texture;
#endif
#ifdef METALLIC_ROUGHNESS_TEXTURE
layout(set = 1, binding = 2) uniform sampler2D metallic_roughness_texture;
#endif
#ifdef NORMAL_TEXTURE
layout(set = 1, binding = 3) uniform sampler2D normal_texture;
#endif
#ifdef OCCLUSION_TEXTURE
layout(set = 1, binding = 4) uniform sampler2D occlusion_texture;
#endif
#ifdef EMISSION_TEXTURE
layout(set = 1, binding = 5) uniform sampler2D emission_texture;
#endif
#ifdef SPECULAR_TEXTURE
layout(set = 1, binding = 6) uniform sampler2D specular_texture;
#endif
#ifdef SPECULAR_COLOR_TEXTURE
layout(set = 1, binding = 7) uniform sampler2D specular_color_texture;
#endif

vec4 base_color() {
    vec4 color = material.base_color;
#ifdef BASE_COLOR_TEXTURE
    color *= texture(base_color_texture, moved_uv(BASE_COLOR_TEXTURE, 0));
#endif
#ifdef HAS_COLORS
    color *= in_color;
#endif
    return color;
}

vec3 emission() {
    vec3 color = material.emission.rgb;
#ifdef EMISSION_TEXTURE
    color *= texture(emission_texture, moved_uv(EMISSION_TEXTURE, 4)).rgb;
#endif
    // Half floats hold no more.
    return min(color, vec3(65504.0));
}

#ifdef HAS_NORMALS
vec3 shading_normal() {
    vec3 normal = unit_or(in_normal, vec3(0.0, 1.0, 0.0));
#ifdef NORMAL_TEXTURE
    // As MikkTSpace decodes: the interpolated vectors are used as they are, the bitangent is made here.
    vec3 bitangent = in_tangent.w * cross(in_normal, in_tangent.xyz);
    vec3 texel = texture(normal_texture, moved_uv(NORMAL_TEXTURE, 2)).rgb * 2.0 - 1.0;
    texel.xy *= material.scales.z;
    normal = unit_or(texel.x * in_tangent.xyz + texel.y * bitangent + texel.z * in_normal, normal);
#endif
#ifdef DOUBLE_SIDED
    if (!gl_FrontFacing) normal = -normal;
#endif
    return normal;
}

SingleSlab evaluate_slab(vec3 color) {
    SingleSlab slab;
    float metallic = material.emission.w;
    slab.roughness = material.scales.x;
#ifdef METALLIC_ROUGHNESS_TEXTURE
    vec2 texel = texture(metallic_roughness_texture, moved_uv(METALLIC_ROUGHNESS_TEXTURE, 1)).gb;
    slab.roughness *= texel.x;
    metallic *= texel.y;
#endif
    vec3 f0 = material.f0.rgb;
    float f90 = material.f0.w;
#ifdef SPECULAR_TEXTURE
    float specular = texture(specular_texture, moved_uv(SPECULAR_TEXTURE, 5)).a;
    f0 *= specular;
    f90 *= specular;
#endif
#ifdef SPECULAR_COLOR_TEXTURE
    f0 *= texture(specular_color_texture, moved_uv(SPECULAR_COLOR_TEXTURE, 6)).rgb;
#endif
    // A dielectric beside a metal: the albedo of the one slab that scatters as much as the two, of whose light less gets
    // below the common interface. The dielectric's albedo by its share alone would leave a dark halo between them.
    vec3 scattering = (1.0 - metallic) * (vec3(1.0) - f0);
    vec3 entering = scattering + metallic * (vec3(1.0) - color);
    slab.diffuse = min(color * scattering / max(entering, vec3(1e-6)), vec3(1.0));
    slab.f0 = mix(f0, color, metallic);
    slab.f90 = mix(f90, 1.0, metallic);
    slab.normal = shading_normal();
    slab.occlusion = 1.0;
#ifdef OCCLUSION_TEXTURE
    slab.occlusion += material.scales.y * (texture(occlusion_texture, moved_uv(OCCLUSION_TEXTURE, 3)).r - 1.0);
#endif
    return slab;
}
#endif

#endif
