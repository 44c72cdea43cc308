// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURE_WORDS
#define NACRE_CLOSURE_WORDS
// What a pixel stores of a surface whose material is a tree. Behind the text of a topology, which says as PLAIN_SLAB
// whether it is the one slab that two words hold.
#include "passes/shared/closure_inputs.glsl"
#include "passes/shared/gbuffer_fields.glsl"

void closure_words(vec3 to_viewer, float footprint, uvec2 pixel, out uint words[stored_words], out uint top_layer,
                   out uint subsurface) {
    SurfaceFrames frames = surface_frames();
#ifdef PLAIN_SLAB
    TreeState state = shade_surface(frames, to_viewer, footprint);
    Slab slab = state.slabs[0];
    words[0] = pack_pixel_class(1u) | pack_occlusion(tree_occlusion()) | pack_diffuse_r(slab.albedo.r) |
               pack_diffuse_g(slab.albedo.g) | pack_diffuse_b(slab.albedo.b);
    float weight = 1.0;
#ifdef NACRE_SLAB_F90
    if ((slab.features & slab_f90) != 0u) weight = slab.specular_weight;
#endif
    words[1] = pack_f0_r(slab.f0.r * weight) | pack_f0_g(slab.f0.g * weight) | pack_f0_b(slab.f0.b * weight) |
               pack_f90(weight);
    top_layer = pack_normal(frames.normals[0]) | pack_roughness(slab.roughness);
    subsurface = 0u;
#else
    uint top_normal = pack_normal(frames.normals[stored_top_frame]);
    frames.normals[stored_top_frame] = unpack_normal(top_normal);
    TreeState state = shade_surface(frames, to_viewer, footprint);
    pack_tree(state, frames.normals, frames.tangents, tree_occlusion(), pixel, words, subsurface);
    top_layer = top_normal | pack_roughness(state.slabs[stored_top_closure].roughness);
#endif
}

#endif
