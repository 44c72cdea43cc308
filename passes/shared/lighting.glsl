// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_LIGHTING
#define NACRE_LIGHTING
// Light that leaves a plain slab or a closure towards the viewer: punctual lights with shadows, and the environment. Set 0,
// bindings 1 to 5; the camera is binding 0. The same code serves the tiled lighting and the blend pass. Who includes this
// where slabs have features has declared the textures of materials/closures/table_textures.glsl but for the first, or has
// included it.
//
// LIGHTS: number of entries in the light list; undefined: no lights. SHADOW_VIEWS: number of shadow views; undefined: no
// shadows. SHADOW_LAYERS: there are several, and the map has layers. SHADOW_FILTER_WIDTH: 1, 3 or 5.
#include "passes/shared/camera.glsl"
#include "passes/shared/spherical_harmonics.glsl"
#ifndef NACRE_CLOSURES_TABLE_TEXTURES
layout(set = 0, binding = 3) uniform usampler2D interface_texels;
#include "materials/closures/table_textures.glsl"
#endif
#include "materials/closures/closure.glsl"
#include "materials/closures/stored_frame.glsl"
#include "passes/shared/slab_closure.glsl"

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
    int x_face = direction.x >= 0.0 ? 0 : 1;
    int y_face = direction.y >= 0.0 ? 2 : 3;
    int z_face = direction.z >= 0.0 ? 4 : 5;
    return size.x >= size.y && size.x >= size.z ? x_face : (size.y >= size.z ? y_face : z_face);
}

// Of a place in the shadow map of a view.
float filtered_shadow(vec3 ndc, int view) {
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

// Share of a light that arrives. Percentage-closer filtering with explicit fetches and weights, so that the result does not
// depend on a device's filter: SHADOW_FILTER_WIDTH^2 bilinear taps, which is a separable kernel over one texel more.
// Functions here have one way out: what returns early costs more where lanes part.
float shadow(Light light, vec3 position, vec3 normal, vec3 to_light, float distance_to_light) {
    float lit = 1.0;
    if (light.direction.w >= 0.0) {
        int view = int(light.direction.w);
        if (light.cone.w != 0.0) view += cube_face(position - light.position.xyz);
        // The receiver moves off its surface by what a texel of the map covers there.
        float texel = light.cone.z * (light.color.w == 0.0 ? 1.0 : distance_to_light);
        float slope = 1.0 - clamp(dot(normal, to_light), 0.0, 1.0);
        vec3 receiver = position + normal * (texel * (0.6 + 1.4 * slope) * float(SHADOW_FILTER_WIDTH + 1) * 0.5) + to_light * texel;
        vec4 clip = shadow_views[view] * vec4(receiver, 1.0);
        vec3 ndc = clip.xyz / (clip.w > 0.0 ? clip.w : 1.0);
        if (clip.w > 0.0 && ndc.z > 0.0 && ndc.z < 1.0) lit = filtered_shadow(ndc, view);
    }
    return lit;
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
        float inverse_distance = inversesqrt(distance_squared);
        distance_to_light = distance_squared * inverse_distance;
        to_light = offset * inverse_distance;
        // Window of KHR_lights_punctual.
        float in_range = distance_squared * light.position.w;
        incident *= clamp(1.0 - in_range * in_range, 0.0, 1.0) * (inverse_distance * inverse_distance);
        if (light.color.w == 2.0) {
            float cone = clamp(dot(light.direction.xyz, -to_light) * light.cone.x + light.cone.y, 0.0, 1.0);
            incident *= cone * cone;
        }
    }
    return incident;
}
#endif

// Where a surface is lit.
struct LitPoint {
    vec3 position;   // world
    vec3 to_viewer;  // unit
    float footprint; // meters that a pixel covers
    float occlusion; // of the environment
};

// The closure of a slab for all lights and for the environment. bare: as prepare_closure_under has it.
Closure prepare_lit_closure(Slab slab, Fresnel bare, vec3 view, float footprint) {
    slab.roughness = max(slab.roughness, smallest_roughness_for_lights);
    return prepare_closure_under(slab, bare, view, footprint);
}

// Of the prefiltered environment, around the direction into which a lobe mirrors. Lobes that are stretched mirror at a
// normal that leans along the stretched direction's complement, as hair-like grooves do.
vec3 environment_lobe(StoredFrame frame, vec3 to_viewer, float roughness, float anisotropy) {
    vec3 normal = frame.normal;
    if (anisotropy != 0.0) {
        vec3 along = anisotropy >= 0.0 ? frame.bitangent : frame.tangent;
        vec3 grooved = cross(cross(along, to_viewer), along);
        normal = normalize(mix(normal, grooved, 0.5 * abs(anisotropy)));
    }
    return textureLod(environment, reflect(-to_viewer, normal), roughness * float(ENVIRONMENT_MIPS - 1)).rgb;
}

// What a closure sends to the viewer of the environment's light: each lobe's share, from where the lobe looks. `diffuse`
// holds that of fuzz as well, `subsurface` what comes through from behind.
ClosureValue environment_value(Slab slab, Closure closure, StoredFrame frame, LitPoint point) {
    ClosureAlbedo albedo = closure_albedo(closure);
    float anisotropy = 0.0;
#ifdef NACRE_SLAB_ANISOTROPY
    if ((slab.features & slab_anisotropy) != 0u) anisotropy = slab.anisotropy;
#endif
    float roughness = slab.roughness;
#ifdef NACRE_CLOSURE_COVERED
    // What leaves a denser medium is wider outside; one look serves what was thrown back as well.
    if (closure.ior_excess > 0.0) {
        float share = largest(closure.again.albedo) / max(largest(albedo.specular), 1e-30);
        roughness = min(sqrt((1.0 + closure.ior_excess) * sqrt(mix(closure.specular.area, closure.again.area, share))), 1.0);
    }
#endif
    vec3 specular_light = environment_lobe(frame, point.to_viewer, roughness, anisotropy);
    ClosureValue value;
    value.specular = point.occlusion * albedo.specular * specular_light;
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((slab.features & slab_second_lobe) != 0u) {
        value.specular += point.occlusion * closure.second.albedo *
                          (environment_lobe(frame, point.to_viewer, slab.second_roughness, anisotropy) - specular_light);
    }
#endif
    vec3 diffuse_light = max(irradiance(frame.normal, irradiance_coefficients), vec3(0.0)) * inverse_pi;
    value.diffuse = point.occlusion * (albedo.diffuse + albedo.fuzz) * diffuse_light;
    value.subsurface = vec3(0.0);
#ifdef NACRE_SLAB_MEDIUM
    if ((slab.features & slab_medium) != 0u) {
        value.subsurface = point.occlusion * albedo.transmission *
                           max(irradiance(-frame.normal, irradiance_coefficients), vec3(0.0)) * inverse_pi;
    }
#endif
    return value;
}

vec3 shade_slab(SingleSlab plain, vec3 position, vec3 to_viewer) {
    Slab slab = slab_of(plain);
    StoredFrame frame = frame_of_normal(plain.normal);
    Closure closure = prepare_lit_closure(slab, interface_of(plain), view_in_frame(frame, to_viewer), 0.0);
    LitPoint point;
    point.position = position;
    point.to_viewer = to_viewer;
    point.footprint = 0.0;
    point.occlusion = plain.occlusion;
    ClosureValue surroundings = environment_value(slab, closure, frame, point);
    vec3 result = surroundings.specular + surroundings.diffuse;
#ifdef LIGHTS
    for (uint i = 0u; i < light_count.x; ++i) {
        vec3 to_light;
        float distance_to_light;
        vec3 incident = incident_light(lights[i], position, to_light, distance_to_light);
        vec3 light = to_frame(frame, to_light);
        if (light.z <= 0.0 || largest(incident) <= 0.0) continue;
#ifdef SHADOW_VIEWS
        incident *= shadow(lights[i], position, plain.normal, to_light, distance_to_light);
#endif
        ClosureValue value = evaluate_closure_above(closure, light);
        result += incident * (value.specular + value.diffuse);
    }
#endif
    return min(result, vec3(65504.0));
}

#endif
