// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_STABILITY_FUNCTIONS
#define NACRE_STABILITY_FUNCTIONS
#include "materials/closures/closure.glsl"
// What the sweep of closures and of trees asks of a closure.

vec3 whole_value(Closure closure, vec3 light) {
    ClosureValue value = evaluate_closure(closure, light);
    return value.specular + value.diffuse + value.subsurface;
}

// All that the closure reflects and scatters through: what its densities are shares of.
float whole_albedo(Closure closure) {
    ClosureAlbedo albedo = closure_albedo(closure);
    return largest(albedo.specular + albedo.fuzz + albedo.diffuse + albedo.transmission);
}

// What the lobes would send towards the view if they reflected everything, and 1.
float lobe_scale(Closure closure, vec3 light) {
#ifdef NACRE_CLOSURE_COVERED
    // Below a layer the lobes are in refracted directions.
    vec3 inner = refracted_direction(light, closure.ior_excess);
#else
    vec3 inner = light;
#endif
    vec3 h = half_vector(closure.view, inner);
    float scale = specular_lobe_pdf(closure.specular, closure.view, inner, h);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u)
        scale += specular_lobe_pdf(closure.second, closure.view, inner, h);
#endif
#ifdef NACRE_CLOSURE_COVERED
    if (closure.ior_excess > 0.0) {
        scale += specular_lobe_pdf(closure.again, closure.again_view, inner, half_vector(closure.again_view, inner));
        scale *= max(light.z, 0.0) / (square(1.0 + closure.ior_excess) * inner.z);
    }
#endif
#ifdef NACRE_SLAB_FUZZ
    if ((closure.features & slab_fuzz) != 0u) scale += sheen_density(closure.fuzz_map, light);
#endif
    return 1.0 + scale;
}

// Of two numbers that should be equal, where it counts.
float defect(vec3 a, vec3 b, float scale) {
    vec3 difference = abs(a - b) - vec3(1e-7 * scale);
    return largest(max(difference, vec3(0.0)) / max(max(a, b), vec3(1e-30)));
}

#endif
