// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_SLAB_CLOSURE
#define NACRE_SLAB_CLOSURE
// A plain slab as the closures take it: one without any feature. Its interface's grazing reflectance is bounded, as
// KHR_materials_specular wants it, and goes to prepare_closure_under.
#include "passes/shared/single_slab.glsl"
#include "materials/closures/closure.glsl"

Slab slab_of(SingleSlab plain) {
    Slab slab;
    slab.features = 0u;
    slab.coverage = 1.0;
    slab.f0 = plain.f0;
    slab.roughness = plain.roughness;
    slab.albedo = plain.diffuse;
    return slab;
}

Fresnel interface_of(SingleSlab plain) {
    Fresnel bare = make_plain_fresnel(plain.f0);
    bare.grazing = min(bare.grazing, vec3(plain.f90));
    return bare;
}

#endif
