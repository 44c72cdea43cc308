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

// What the lobes would send towards the view if they reflected everything.
float lobe_scale(Closure closure, vec3 light) {
    vec3 h = half_vector(closure.view, light);
    float scale = 1.0 + specular_lobe_pdf(closure.specular, closure.view, light, h);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u)
        scale += specular_lobe_pdf(closure.second, closure.view, light, h);
#endif
#ifdef NACRE_SLAB_FUZZ
    if ((closure.features & slab_fuzz) != 0u) scale += sheen_density(closure.fuzz_map, light);
#endif
    return scale;
}

// Of two numbers that should be equal, where it counts.
float defect(vec3 a, vec3 b, float scale) {
    vec3 difference = abs(a - b) - vec3(1e-7 * scale);
    return largest(max(difference, vec3(0.0)) / max(max(a, b), vec3(1e-30)));
}

#endif
