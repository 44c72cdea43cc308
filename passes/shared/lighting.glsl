// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_LIGHTING
#define NACRE_LIGHTING
// Light that leaves a slab towards the viewer: punctual lights with shadows, and the environment. Set 0, bindings 1 to 5;
// the camera is binding 0. The same code serves the tiled lighting and the blend pass.
//
// LIGHTS: number of entries in the light list; undefined: no lights. SHADOW_VIEWS: number of shadow views; undefined: no
// shadows. SHADOW_LAYERS: there are several, and the map has layers. SHADOW_FILTER_WIDTH: 1, 3 or 5.
#include "passes/shared/camera.glsl"
#include "passes/shared/ggx.glsl"
#include "passes/shared/single_slab.glsl"
#include "passes/shared/spherical_harmonics.glsl"

#ifdef LIGHTS
struct Light {
    vec4 position;   // w: 1 / range^2, 0 for none
    vec4 color;      // times intensity; w: kind, 0 directional, 1 point, 2 spot
    vec4 direction;  // in which the light travels; w: first shadow view, or -1
    vec4 cone;       // scale and offset of the cosine; width of a shadow texel (at distance 1 where the light has a
                     // position); 1 where six shadow views surround the light
};
layout(set = 0, binding = 1, std140) uniform LightBlock {
    uvec4 light_count;
    Light lights[LIGHTS];
#ifdef SHADOW_VIEWS
    mat4 shadow_views[SHADOW_VIEWS];
#endif
};
#endif
layout(set = 0, binding = 2, std140) uniform IrradianceBlock {
    vec4 irradiance_coefficients[9];
};
layout(set = 0, binding = 3) uniform sampler2D albedo_table;
layout(set = 0, binding = 4) uniform samplerCube environment;
#ifdef SHADOW_VIEWS
#ifdef SHADOW_LAYERS
layout(set = 0, binding = 5) uniform sampler2DArray shadow_maps;
#define fetch_shadow(at, view) texelFetch(shadow_maps, ivec3(at, view), 0).r
#else
layout(set = 0, binding = 5) uniform sampler2D shadow_maps;
#define fetch_shadow(at, view) texelFetch(shadow_maps, at, 0).r
#endif

int cube_face(vec3 direction) {
    vec3 size = abs(direction);
    if (size.x >= size.y && size.x >= size.z) return direction.x >= 0.0 ? 0 : 1;
    if (size.y >= size.z) return direction.y >= 0.0 ? 2 : 3;
    return direction.z >= 0.0 ? 4 : 5;
}

// Share of a light that arrives. Percentage-closer filtering with explicit fetches and weights, so that the result does not
// depend on a device's filter: SHADOW_FILTER_WIDTH^2 bilinear taps, which is a separable kernel over one texel more.
float shadow(Light light, vec3 position, vec3 normal, vec3 to_light, float distance_to_light) {
    if (light.direction.w < 0.0) return 1.0;
    int view = int(light.direction.w);
    if (light.cone.w != 0.0) view += cube_face(position - light.position.xyz);
    // The receiver moves off its surface by what a texel of the map covers there.
    float texel = light.cone.z * (light.color.w == 0.0 ? 1.0 : distance_to_light);
    float slope = 1.0 - clamp(dot(normal, to_light), 0.0, 1.0);
    vec3 receiver = position + normal * (texel * (0.6 + 1.4 * slope) * float(SHADOW_FILTER_WIDTH + 1) * 0.5) + to_light * texel;
    vec4 clip = shadow_views[view] * vec4(receiver, 1.0);
    if (clip.w <= 0.0) return 1.0;
    vec3 ndc = clip.xyz / clip.w;
    if (ndc.z <= 0.0 || ndc.z >= 1.0) return 1.0;
    ivec2 size = textureSize(shadow_maps, 0).xy;
    vec2 texel_position = (ndc.xy * 0.5 + 0.5) * vec2(size) - 0.5 * float(SHADOW_FILTER_WIDTH);
    vec2 corner = floor(texel_position);
    vec2 part = texel_position - corner;
    float lit = 0.0;
    for (int y = 0; y <= SHADOW_FILTER_WIDTH; ++y) {
        float weight_y = y == 0 ? 1.0 - part.y : (y == SHADOW_FILTER_WIDTH ? part.y : 1.0);
        for (int x = 0; x <= SHADOW_FILTER_WIDTH; ++x) {
            float weight_x = x == 0 ? 1.0 - part.x : (x == SHADOW_FILTER_WIDTH ? part.x : 1.0);
            ivec2 at = clamp(ivec2(corner) + ivec2(x, y), ivec2(0), size - 1);
            float occluder = fetch_shadow(at, view);
            lit += ndc.z >= occluder ? weight_x * weight_y : 0.0;
        }
    }
    return lit / float(SHADOW_FILTER_WIDTH * SHADOW_FILTER_WIDTH);
}
#endif

// Punctual lights are infinitely small: below this roughness their highlights are smaller than a pixel.
const float smallest_roughness_for_lights = 0.045;

#ifdef LIGHTS
// Illuminance on a surface that faces the light, without shadows.
vec3 incident_light(Light light, vec3 position, out vec3 to_light, out float distance_to_light) {
    to_light = -light.direction.xyz;
    vec3 incident = light.color.rgb;
    distance_to_light = 0.0;
    if (light.color.w != 0.0) {
        vec3 offset = light.position.xyz - position;
        float distance_squared = max(dot(offset, offset), 1e-8);
        distance_to_light = sqrt(distance_squared);
        to_light = offset / distance_to_light;
        // Window of KHR_lights_punctual.
        float in_range = distance_squared * light.position.w;
        incident *= clamp(1.0 - in_range * in_range, 0.0, 1.0) / distance_squared;
        if (light.color.w == 2.0) {
            float cone = clamp(dot(light.direction.xyz, -to_light) * light.cone.x + light.cone.y, 0.0, 1.0);
            incident *= cone * cone;
        }
    }
    return incident;
}
#endif

vec3 shade_slab(SingleSlab slab, vec3 position, vec3 to_viewer) {
    // Shading normals may point away from the viewer; the cosine is kept off 0 so that nothing divides by it.
    float cos_o = max(dot(slab.normal, to_viewer), 1e-4);
    vec2 table_size = vec2(textureSize(albedo_table, 0));
    vec2 table = textureLod(albedo_table, (vec2(sqrt(min(cos_o, 1.0)), slab.roughness) * (table_size - 1.0) + 0.5) / table_size, 0.0).rg;
    SpecularAlbedo specular = specular_albedo(slab.f0, slab.f90, table);
    // What the interface does not reflect towards the viewer is left to the base. One number for all channels: a tinted
    // interface must not give the base the complementary color.
    float base_weight = 1.0 - max(specular.albedo.r, max(specular.albedo.g, specular.albedo.b));

    // Environment.
    vec3 diffuse_light = max(irradiance(slab.normal, irradiance_coefficients), vec3(0.0)) / pi;
    vec3 mirrored = reflect(-to_viewer, slab.normal);
    float last_mip = float(ENVIRONMENT_MIPS - 1);
    vec3 specular_light = textureLod(environment, mirrored, slab.roughness * last_mip).rgb;
    vec3 result = slab.occlusion * (diffuse_light * slab.diffuse * base_weight + specular_light * specular.albedo);

#ifdef LIGHTS
    float lights_roughness = max(slab.roughness, smallest_roughness_for_lights);
    float alpha = lights_roughness * lights_roughness;
    for (uint i = 0u; i < light_count.x; ++i) {
        Light light = lights[i];
        vec3 to_light;
        float distance_to_light;
        vec3 incident = incident_light(light, position, to_light, distance_to_light);
        float cos_i = dot(slab.normal, to_light);
        if (cos_i <= 0.0 || max(incident.r, max(incident.g, incident.b)) <= 0.0) continue;
#ifdef SHADOW_VIEWS
        incident *= shadow(light, position, slab.normal, to_light, distance_to_light);
#endif
        vec3 half_vector = to_light + to_viewer;
        half_vector *= inversesqrt(max(dot(half_vector, half_vector), 1e-12));
        vec3 fresnel = slab.f0 + (vec3(slab.f90) - slab.f0) * schlick_weight(clamp(dot(to_viewer, half_vector), 0.0, 1.0));
        vec3 reflected = fresnel * specular.compensation *
                         (ggx_distribution(slab.normal, half_vector, alpha) * ggx_visibility(cos_o, cos_i, alpha));
        result += incident * cos_i * (slab.diffuse * (base_weight / pi) + reflected);
    }
#endif
    return min(result, vec3(65504.0));
}

#endif
