// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURE_LIGHTING
#define NACRE_CLOSURE_LIGHTING
// Light that leaves a closure below others towards the viewer.
#define NACRE_CLOSURE_COVERED
#include "passes/shared/lighting.glsl"
#include "materials/closures/operators.glsl"

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

vec3 closure_radiance(Slab slab, Path path, StoredFrame frame, LitPoint point
#ifdef LIGHTS
                      , LightVisibility visibility
#endif
) {
    vec3 result = vec3(0.0);
    if (largest(path.weight) > 0.0) {
        vec3 view = view_in_frame(frame, point.to_viewer);
        vec3 inside = refracted_direction(view, path.ior_excess);
        Closure closure = closure_below_path(prepare_lit_closure(slab, slab_fresnel(slab), inside, point.footprint), slab,
                                             path, view.z);
        ClosureValue surroundings = environment_value(slab, closure, frame, point);
        result = surroundings.specular * top_transmittance(path, view.z) +
                 (surroundings.diffuse + surroundings.subsurface) * top_transmittance(path, mean_cosine);
#ifdef LIGHTS
        bool is_covered = min(path.uncovered.x, min(path.uncovered.y, path.uncovered.z)) < 1.0;
        for (uint i = 0u; i < light_count.x; ++i) {
            vec3 to_light;
            float distance_to_light;
            vec3 incident =
                incident_light(lights[i], point.position, to_light, distance_to_light) * visibility.share[i];
            if (largest(incident) <= 0.0) continue;
            vec3 light = to_frame(frame, to_light);
            if (is_covered) incident *= top_transmittance(path, max(light.z, 0.0));
            ClosureValue value = evaluate_closure(closure, light);
            result += incident * (value.specular + value.diffuse + value.subsurface);
        }
#endif
    }
    return result * path.weight;
}

#endif
