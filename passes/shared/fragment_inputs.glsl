// SPDX-License-Identifier: Apache-2.0
// What the vertex stage hands to fragment shaders of surfaces, as far as a draw has it.
#ifndef NACRE_FRAGMENT_INPUTS
#define NACRE_FRAGMENT_INPUTS

#ifdef HAS_NORMALS
layout(location = 0) in vec3 in_normal;
#endif
#ifdef HAS_TANGENTS
layout(location = 1) in vec4 in_tangent;
#endif
#ifdef HAS_UV0
layout(location = 2) in vec2 in_uv0;
#endif
#ifdef HAS_UV1
layout(location = 3) in vec2 in_uv1;
#endif
#ifdef HAS_COLORS
layout(location = 4) in vec4 in_color;
#endif

#if defined(HAS_UV0) && defined(HAS_UV1)
vec2 uv_of(int set) { return set == 0 ? in_uv0 : in_uv1; }
#elif defined(HAS_UV0)
vec2 uv_of(int set) { return in_uv0; }
#elif defined(HAS_UV1)
vec2 uv_of(int set) { return in_uv1; }
#endif

// v scaled to length 1, or the fallback where it is too short to have a direction.
vec3 unit_or(vec3 v, vec3 fallback) {
    float length_squared = dot(v, v);
    return length_squared > 1e-12 ? v * inversesqrt(length_squared) : fallback;
}

#endif
