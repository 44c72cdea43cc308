// SPDX-License-Identifier: Apache-2.0
// The base pass of materials with several lobes: behind the text of a topology (passes/scene_closures.h). Words beyond
// the color targets go into the slices of a storage image, subsurface data into the last where the scene has some.
#include "passes/shared/closure_inputs.glsl"
#include "passes/shared/gbuffer_fields.glsl"

layout(early_fragment_tests) in;
layout(location = 0) out uint material_0;
layout(location = 1) out uint material_1;
layout(location = 2) out uint top_layer;
#ifdef WRITES_SLICES
#if MATERIAL_SLICES > 1
layout(set = 2, binding = 0, r32ui) uniform writeonly uimage2DArray material_slices;
#define store_slice(pixel, slice, word) imageStore(material_slices, ivec3(pixel, slice), uvec4(word))
#else
layout(set = 2, binding = 0, r32ui) uniform writeonly uimage2D material_slices;
#define store_slice(pixel, slice, word) imageStore(material_slices, pixel, uvec4(word))
#endif
#endif

void main() {
    SurfaceFrames frames = surface_frames();
#ifdef PLAIN_SLAB
    TreeState state = shade_surface(frames);
    Slab slab = state.slabs[0];
    material_0 = pack_pixel_class(1u) | pack_occlusion(tree_occlusion()) | pack_diffuse_r(slab.albedo.r) |
                 pack_diffuse_g(slab.albedo.g) | pack_diffuse_b(slab.albedo.b);
    material_1 = pack_f0_r(slab.f0.r) | pack_f0_g(slab.f0.g) | pack_f0_b(slab.f0.b) | pack_f90(1.0);
    top_layer = pack_normal(frames.normals[0]) | pack_roughness(slab.roughness);
#else
    uint top_normal = pack_normal(frames.normals[stored_top_frame]);
    frames.normals[stored_top_frame] = unpack_normal(top_normal);
    TreeState state = shade_surface(frames);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint words[stored_words];
    uint subsurface;
    pack_tree(state, frames.normals, frames.tangents, tree_occlusion(), uvec2(pixel), words, subsurface);
    material_0 = words[0];
    material_1 = words[1];
    top_layer = top_normal | pack_roughness(state.slabs[stored_top_closure].roughness);
#ifdef WRITES_SLICES
#ifdef SUBSURFACE_SLICE
    if (stored_has_subsurface) store_slice(pixel, SUBSURFACE_SLICE, subsurface);
#endif
    for (uint i = 2u; i < stored_words; ++i) store_slice(pixel, int(i - 2u), words[i]);
#endif
#endif
}
