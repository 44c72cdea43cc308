// SPDX-License-Identifier: Apache-2.0
// The vertex stage of every pass that draws geometry. All of them must compute the same position to the last bit, since
// later passes test for equal depth: the position is precise and invariant, and computed here only.
//
// HAS_NORMALS, HAS_TANGENTS, HAS_UV0, HAS_UV1, HAS_COLORS: attributes that the pass hands on.
// THIN: points (POINTS) and lines, one pixel wide, which come as two triangles each: what points and lines of the
// devices cover differs between them.
#include "passes/shared/camera.glsl"

layout(location = 0) in vec3 in_position;
#ifdef HAS_NORMALS
layout(location = 1) in vec3 in_normal;
layout(location = 0) out vec3 out_normal;
#endif
#ifdef HAS_TANGENTS
layout(location = 2) in vec4 in_tangent;
layout(location = 1) out vec4 out_tangent;
#endif
#ifdef HAS_UV0
layout(location = 3) in vec2 in_uv0;
layout(location = 2) out vec2 out_uv0;
#endif
#ifdef HAS_UV1
layout(location = 4) in vec2 in_uv1;
layout(location = 3) out vec2 out_uv1;
#endif
#ifdef HAS_COLORS
layout(location = 5) in vec4 in_color;
layout(location = 4) out vec4 out_color;
#endif
#ifdef HAS_POSITIONS
layout(location = 5) out vec3 out_position;
#endif
// Rows of the mesh-to-world matrix, one set for each instance.
layout(location = 6) in vec4 in_world_row_0;
layout(location = 7) in vec4 in_world_row_1;
layout(location = 8) in vec4 in_world_row_2;

#ifdef THIN
layout(location = 9) in vec4 in_corner;  // lines: the other end and the side; points: w is 0 to 3
#endif

invariant gl_Position;

vec3 world_position(vec3 position) {
    precise vec3 world;
    world.x = in_world_row_0.x * position.x + (in_world_row_0.y * position.y + (in_world_row_0.z * position.z + in_world_row_0.w));
    world.y = in_world_row_1.x * position.x + (in_world_row_1.y * position.y + (in_world_row_1.z * position.z + in_world_row_1.w));
    world.z = in_world_row_2.x * position.x + (in_world_row_2.y * position.y + (in_world_row_2.z * position.z + in_world_row_2.w));
    return world;
}

vec4 clip_position(vec3 world) {
    precise vec4 clip = camera.view_projection[0] * world.x +
                        (camera.view_projection[1] * world.y + (camera.view_projection[2] * world.z + camera.view_projection[3]));
    return clip;
}

#ifdef THIN
// Moves a point or the end of a line to a corner of the rectangle that shows it.
vec4 corner_of_thin(vec4 clip) {
    precise vec4 corner = clip;
#ifdef POINTS
    vec2 offset = vec2((int(in_corner.w) & 1) == 0 ? -1.0 : 1.0, (int(in_corner.w) & 2) == 0 ? -1.0 : 1.0);
#else
    // Ends behind the near plane (where depth is 1) move onto it: there is no direction on the picture behind the viewer.
    precise vec4 other = clip_position(world_position(in_corner.xyz));
    float inside = clip.w - clip.z, other_inside = other.w - other.z;
    if (inside < 0.0 && other_inside > 0.0) corner = mix(clip, other, inside / (inside - other_inside));
    if (inside > 0.0 && other_inside < 0.0) other = mix(other, clip, other_inside / (other_inside - inside));
    vec2 along = other.xy / max(other.w, 1e-9) - corner.xy / max(corner.w, 1e-9);
    along *= camera.size.xy;
    float length_squared = dot(along, along);
    precise vec2 offset = length_squared > 0.0 ? along.yx * vec2(-1.0, 1.0) * (in_corner.w * inversesqrt(length_squared)) : vec2(0.0);
#endif
    // Half a pixel, which is one part in size of clip space.
    corner.xy += corner.w * camera.size.zw * offset;
    return corner;
}
#endif

vec3 scaled_to_unit(vec3 v) {
    // Large or tiny scales must not overflow the squares below.
    float largest = max(max(abs(v.x), abs(v.y)), max(abs(v.z), 1e-30));
    v /= largest;
    return v * inversesqrt(max(dot(v, v), 1e-12));
}

void main() {
    precise vec3 world = world_position(in_position);
    precise vec4 clip = clip_position(world);
#ifdef THIN
    clip = corner_of_thin(clip);
#endif
    gl_Position = clip;
#ifdef HAS_POSITIONS
    out_position = world;
#endif
#if defined(HAS_NORMALS) || defined(HAS_TANGENTS)
    vec3 row_0 = in_world_row_0.xyz, row_1 = in_world_row_1.xyz, row_2 = in_world_row_2.xyz;
#endif
#ifdef HAS_NORMALS
    // Normals move by the matrix of cofactors: the inverse transpose up to a scale, without a division. Its sign is that
    // of the determinant.
    vec3 cofactor_0 = cross(row_1, row_2), cofactor_1 = cross(row_2, row_0), cofactor_2 = cross(row_0, row_1);
    float mirror = dot(row_0, cofactor_0) < 0.0 ? -1.0 : 1.0;
    out_normal = scaled_to_unit(mirror * vec3(dot(cofactor_0, in_normal), dot(cofactor_1, in_normal), dot(cofactor_2, in_normal)));
#endif
#ifdef HAS_TANGENTS
    float handedness = dot(row_0, cross(row_1, row_2)) < 0.0 ? -in_tangent.w : in_tangent.w;
    out_tangent = vec4(scaled_to_unit(vec3(dot(row_0, in_tangent.xyz), dot(row_1, in_tangent.xyz), dot(row_2, in_tangent.xyz))), handedness);
#endif
#ifdef HAS_UV0
    out_uv0 = in_uv0;
#endif
#ifdef HAS_UV1
    out_uv1 = in_uv1;
#endif
#ifdef HAS_COLORS
    out_color = in_color;
#endif
}
