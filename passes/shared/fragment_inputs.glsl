// SPDX-License-Identifier: Apache-2.0
// A place on a surface: in fragment shaders what the vertex stage hands on, as far as a draw has it; elsewhere variables that
// are set by who shades the place.
#ifndef NACRE_FRAGMENT_INPUTS
#define NACRE_FRAGMENT_INPUTS

#ifdef NACRE_FRAGMENT_STAGE

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
#ifdef READS_POSITION
layout(location = 5) in vec3 in_position;
#endif
#define surface_faces_away (!gl_FrontFacing)
#define surface_has_tangents true

#ifdef MATERIAL_KIND
// Kinds of the program's own may read all of them.
#ifndef HAS_NORMALS
const vec3 in_normal = vec3(0.0, 0.0, 1.0);
#endif
#ifndef HAS_TANGENTS
const vec4 in_tangent = vec4(0.0);
#endif
#ifndef HAS_UV0
const vec2 in_uv0 = vec2(0.0);
#endif
#ifndef HAS_UV1
const vec2 in_uv1 = vec2(0.0);
#endif
#ifndef HAS_COLORS
const vec4 in_color = vec4(1.0);
#endif
#endif

#else

// Bits of in_attributes: what the surface has.
const uint attribute_normals = 1u, attribute_tangents = 2u, attribute_uv0 = 4u, attribute_uv1 = 8u, attribute_colors = 16u;
const uint attribute_back_face = 32u;  // seen from behind

uint in_attributes = 0u;
vec3 in_position = vec3(0.0);            // world
vec3 in_normal = vec3(0.0, 0.0, 1.0);    // world, as interpolated
vec4 in_tangent = vec4(0.0);             // world, as interpolated; w: handedness
vec2 in_uv0 = vec2(0.0), in_uv1 = vec2(0.0);
vec4 in_color = vec4(1.0);
#if TEXTURE_DETAIL == 0
vec2 in_uv0_dx = vec2(0.0), in_uv0_dy = vec2(0.0), in_uv1_dx = vec2(0.0), in_uv1_dy = vec2(0.0);
#elif TEXTURE_DETAIL == 1
float in_uv0_cone = 0.0, in_uv1_cone = 0.0;
#else
float in_texture_level = 0.0;
#endif
#define surface_faces_away (material_is_double_sided() && (in_attributes & attribute_back_face) != 0u)
#define surface_has_tangents ((in_attributes & attribute_tangents) != 0u)

#endif

#if (defined(HAS_UV0) && defined(HAS_UV1)) || defined(MATERIAL_KIND)
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
