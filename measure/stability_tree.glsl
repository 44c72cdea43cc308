// SPDX-License-Identifier: Apache-2.0
// A tree at many points (measure/stability.h); before it stand the functions of materials/tree_shader.h. A workgroup
// shares one set of parameters.

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
    TreeState state = shade_tree(views, footprint);
    uint at = gl_GlobalInvocationID.x * RESULT_WORDS;
    put3(at, tree_reflected(state, views, lights, footprint));
    put3(at + 3u, matter_throughput(state.whole));
    put(at + 6u, state.whole.coverage);
    put(at + 7u, state.top.coverage);
    put(at + 8u, 0.0);
}
