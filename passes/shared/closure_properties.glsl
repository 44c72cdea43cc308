// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURE_PROPERTIES
#define NACRE_CLOSURE_PROPERTIES
// What can be asked of a surface whose material is a tree without lighting it. Behind the text of a topology.
#include "passes/shared/closure_inputs.glsl"

void closure_properties(vec3 to_viewer, float footprint, out vec3 albedo, out vec3 emission, out float roughness) {
    SurfaceFrames frames = surface_frames();
    TreeState state = shade_surface(frames, to_viewer, footprint);
    albedo = vec3(0.0);
    for (uint i = 0u; i < tree_closure_count; ++i) {
        Path path = state.paths[i];
        vec3 weight = path.weight * state.coverages[i];
        if (largest(weight) <= 0.0) continue;
        vec3 view = view_in_frame(stored_frame(frames, tree_closure_frame(i)), to_viewer);
        ClosureAlbedo own = closure_albedo(closure_below(state.slabs[i], path, view, footprint));
        albedo += weight * (own.specular * top_transmittance(path, view.z) +
                            (own.fuzz + own.diffuse) * top_transmittance(path, mean_cosine));
    }
    emission = tree_emission(state);
    roughness = state.slabs[0].roughness;
}

#endif
