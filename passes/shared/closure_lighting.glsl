// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURE_LIGHTING
#define NACRE_CLOSURE_LIGHTING
// Light that leaves a closure towards the viewer, by the same lights and environment as passes/shared/lighting.glsl. Who
// includes this has included materials/closures/operators.glsl and what it asks for.
#include "materials/closures/stored_frame.glsl"
#include "passes/shared/lighting.glsl"

// Where a surface is lit.
struct LitPoint {
    vec3 position;   // world
    vec3 to_viewer;  // unit
    float footprint; // meters that a pixel covers
    float occlusion; // of the environment
};

#ifdef LIGHTS
// Shares of the lights that arrive: the same for all closures of a pixel.
struct LightVisibility {
    float share[LIGHTS];
};
LightVisibility light_visibility(vec3 position, vec3 normal) {
    LightVisibility visibility;
    for (uint i = 0u; i < light_count.x; ++i) {
        visibility.share[i] = 1.0;
#ifdef SHADOW_VIEWS
        vec3 to_light;
        float distance_to_light;
        incident_light(lights[i], position, to_light, distance_to_light);
        visibility.share[i] = shadow(lights[i], position, normal, to_light, distance_to_light);
#endif
    }
    return visibility;
}
#endif

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

vec3 closure_radiance(Slab slab, Path path, StoredFrame frame, LitPoint point
#ifdef LIGHTS
                      , LightVisibility visibility
#endif
) {
    if (largest(path.weight) <= 0.0) return vec3(0.0);
    vec3 view = view_in_frame(frame, point.to_viewer);
    float roughness = slab.roughness;
    slab.roughness = max(slab.roughness, smallest_roughness_for_lights);
    Closure closure = cover_closure(prepare_closure(slab, view, point.footprint), path.spread, path.under_interface);
    ClosureAlbedo albedo = closure_albedo(closure);

    // Environment: each lobe's share of the light, from where the lobe looks.
    float anisotropy = 0.0;
#ifdef NACRE_SLAB_ANISOTROPY
    if ((slab.features & slab_anisotropy) != 0u) anisotropy = slab.anisotropy;
#endif
    vec3 diffuse_light = max(irradiance(frame.normal, irradiance_coefficients), vec3(0.0)) / pi;
    vec3 specular_light = environment_lobe(frame, point.to_viewer, roughness, anisotropy);
    vec3 reflected = albedo.specular * specular_light;
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((slab.features & slab_second_lobe) != 0u) {
        reflected += closure.second.albedo *
                     (environment_lobe(frame, point.to_viewer, slab.second_roughness, anisotropy) - specular_light);
    }
#endif
    vec3 result = point.occlusion * (reflected * top_transmittance(path, view.z) +
                                     (albedo.diffuse + albedo.fuzz) * diffuse_light * top_transmittance(path, mean_cosine));
#ifdef NACRE_SLAB_MEDIUM
    if ((slab.features & slab_medium) != 0u) {
        result += point.occlusion * albedo.transmission * top_transmittance(path, mean_cosine) *
                  max(irradiance(-frame.normal, irradiance_coefficients), vec3(0.0)) / pi;
    }
#endif
#ifdef LIGHTS
    for (uint i = 0u; i < light_count.x; ++i) {
        vec3 to_light;
        float distance_to_light;
        vec3 incident = incident_light(lights[i], point.position, to_light, distance_to_light) * visibility.share[i];
        if (largest(incident) <= 0.0) continue;
        vec3 light = to_frame(frame, to_light);
        ClosureValue value = evaluate_closure(closure, light);
        result += incident * top_transmittance(path, max(light.z, 0.0)) *
                  (value.specular + value.diffuse + value.subsurface);
    }
#endif
    return result * path.weight;
}

#endif
