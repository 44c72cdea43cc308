// SPDX-License-Identifier: Apache-2.0
// A tree at many points (measure/stability.h); before it stand the functions of materials/tree_shader.h, and with
// DEFERRED_CALLS measure/stability_deferred.glsl before these. A workgroup shares one set of parameters. REFERENCE and
// CANDIDATE: as in measure/stability_closure.glsl.

#include "measure/stability_functions.glsl"

void main() {
    place = gl_GlobalInvocationID.x * POINT_WORDS;
    vec3 view = next3();
    vec3 light = next3();
    float footprint = next();
    vec3 views[tree_frame_count];
    vec3 lights[tree_frame_count];
    for (uint i = 0u; i < tree_frame_count; ++i) {
        views[i] = view;
        lights[i] = light;
    }
    uint closure_count = tree_closure_count;
#ifdef DEFERRED_CALLS
    begin_rounds();
    closure_count = unknown(closure_count);
    uint rounds = unknown(DEFERRED_CALLS);
    TreeState state;
    bool is_last = false;
    while (!is_last) {
        deferred_call = 0u;
        state = shade_tree(views, footprint);
        is_last = deferred_turn >= rounds;
        if (!is_last) take_turn();
        ++deferred_turn;
    }
#else
    TreeState state = shade_tree(views, footprint);
#endif
    float scale = 1.0;
#if defined(DEFERRED_CALLS) || defined(REFERENCE)
    // As tree_reflected(), but as a loop.
    vec3 reflected = vec3(0.0);
    for (uint i = 0u; i < closure_count; ++i) {
        vec3 weight = state.paths[i].weight * state.coverages[i];
        if (largest(weight) > 0.0) {
            Closure closure = closure_below(state.slabs[i], state.paths[i], view, footprint);
            reflected += whole_value(closure, light) * weight * top_transmittance(state.paths[i], light.z);
            scale += largest(weight) * (lobe_scale(closure, light) - 1.0);
        }
    }
#else
    vec3 reflected = tree_reflected(state, views, lights, footprint);
#endif
    uint at = gl_GlobalInvocationID.x * RESULT_WORDS;
    put3(at, reflected);
    put3(at + 3u, matter_throughput(state.whole));
    put(at + 6u, state.whole.coverage);
    put(at + 7u, state.top.coverage);
    put(at + 8u, scale);
}
