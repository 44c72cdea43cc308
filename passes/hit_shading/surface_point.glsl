// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_SURFACE_POINT
#define NACRE_SURFACE_POINT

// A place on a surface, as passes/shared/fragment_inputs.glsl names its parts.
struct SurfacePoint {
    uvec4 ids;  // number of the material, attributes
    vec4 position, normal, tangent;
    vec4 uv;    // uv0, uv1
    vec4 color;
    vec4 uv0_gradients, uv1_gradients;  // by x, by y
};

#endif
