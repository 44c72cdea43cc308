// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_SINGLE_SLAB
#define NACRE_SINGLE_SLAB

// What is shaded: a base of diffuse or metal under one GGX interface.
struct SingleSlab {
    vec3 diffuse;     // albedo of the base, [0, 1]
    vec3 f0;          // reflectance of the interface at normal incidence, [0, 1]
    float f90;        // at grazing incidence
    float roughness;  // perceptual; GGX alpha is its square
    vec3 normal;      // unit, world
    float occlusion;  // ambient light that arrives, [0, 1]
};

#endif
