// SPDX-License-Identifier: Apache-2.0
#version 460
// Writes what is seen into the words of the G-buffer. The depth prepass has decided what is seen: depth must be equal.
// UNLIT: the base color is shown as it is.
layout(early_fragment_tests) in;
#include "passes/shared/gbuffer_fields.glsl"
#include "passes/shared/material.glsl"

layout(location = 0) out uint material_0;
layout(location = 1) out uint material_1;
layout(location = 2) out uint top_layer;

void main() {
    vec3 color = clamp(base_color().rgb, 0.0, 1.0);
#ifdef UNLIT
    material_0 = pack_pixel_class(2u) | pack_occlusion(1.0) | pack_diffuse_r(color.r) | pack_diffuse_g(color.g) | pack_diffuse_b(color.b);
    material_1 = 0u;
    top_layer = pack_normal(vec3(0.0, 0.0, 1.0)) | pack_roughness(1.0);
#else
    SingleSlab slab = evaluate_slab(color);
    material_0 = pack_pixel_class(1u) | pack_occlusion(slab.occlusion) | pack_diffuse_r(slab.diffuse.r) |
                 pack_diffuse_g(slab.diffuse.g) | pack_diffuse_b(slab.diffuse.b);
    material_1 = pack_f0_r(slab.f0.r) | pack_f0_g(slab.f0.g) | pack_f0_b(slab.f0.b) | pack_f90(slab.f90);
    top_layer = pack_normal(slab.normal) | pack_roughness(slab.roughness);
#endif
}
