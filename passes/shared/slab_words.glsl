// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_SLAB_WORDS
#define NACRE_SLAB_WORDS
// What a pixel stores of one plain slab, and of what is unlit.
#include "passes/shared/gbuffer_fields.glsl"
#include "passes/shared/single_slab.glsl"

void slab_words(SingleSlab slab, out uint word_0, out uint word_1, out uint top_layer) {
    word_0 = pack_pixel_class(1u) | pack_occlusion(slab.occlusion) | pack_diffuse_r(slab.diffuse.r) |
             pack_diffuse_g(slab.diffuse.g) | pack_diffuse_b(slab.diffuse.b);
    word_1 = pack_f0_r(slab.f0.r) | pack_f0_g(slab.f0.g) | pack_f0_b(slab.f0.b) | pack_f90(slab.f90);
    top_layer = pack_normal(slab.normal) | pack_roughness(slab.roughness);
}

void unlit_words(vec3 color, out uint word_0, out uint word_1, out uint top_layer) {
    word_0 = pack_pixel_class(2u) | pack_occlusion(1.0) | pack_diffuse_r(color.r) | pack_diffuse_g(color.g) | pack_diffuse_b(color.b);
    word_1 = 0u;
    top_layer = pack_normal(vec3(0.0, 0.0, 1.0)) | pack_roughness(1.0);
}

#endif
