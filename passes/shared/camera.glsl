// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CAMERA
#define NACRE_CAMERA

// Set 0, binding 0 of every pass that sees the scene. Depth is reversed: 1 at the near plane, 0 at the far plane or
// infinity, which keeps 32-bit depth precise at any distance.
layout(set = 0, binding = 0, std140) uniform CameraBlock {
    mat4 view_projection;
    mat4 world;           // camera to world
    vec4 position;        // world; w: 1 for an orthographic camera, else 0
    vec4 projection;      // half extents of the picture at distance 1 (orthographic: anywhere), depth = x + y / distance
                          // (orthographic: x * distance + y) with x, y in zw
    vec4 size;            // pixels, and their inverse
} camera;

bool camera_is_orthographic() { return camera.position.w != 0.0; }

// Distance along the view axis, meters.
float view_distance(float depth) {
    return camera_is_orthographic() ? (depth - camera.projection.w) / camera.projection.z
                                    : camera.projection.w / max(depth - camera.projection.z, 1e-20);
}

vec2 pixel_to_plane(vec2 pixel) {
    vec2 ndc = pixel * camera.size.zw * 2.0 - 1.0;
    return vec2(ndc.x, -ndc.y) * camera.projection.xy;
}

// World position of what is seen at the middle of a pixel.
vec3 position_of(ivec2 pixel, float depth) {
    float distance_along_axis = view_distance(depth);
    vec2 plane = pixel_to_plane(vec2(pixel) + 0.5);
    if (!camera_is_orthographic()) plane *= distance_along_axis;
    return camera.position.xyz + mat3(camera.world) * vec3(plane, -distance_along_axis);
}

// Unit vector from a surface point to the viewer.
vec3 direction_to_viewer(vec3 position) {
    if (camera_is_orthographic()) return camera.world[2].xyz;
    vec3 to_viewer = camera.position.xyz - position;
    return to_viewer * inversesqrt(max(dot(to_viewer, to_viewer), 1e-20));
}

// Meters that a pixel covers at a distance, on a surface that faces the viewer.
float pixel_footprint(vec3 position) {
    float distance_to_viewer = camera_is_orthographic() ? 1.0 : length(camera.position.xyz - position);
    return 2.0 * camera.projection.y * camera.size.w * distance_to_viewer;
}

// Unit direction in which a pixel looks.
vec3 view_ray(ivec2 pixel) {
    if (camera_is_orthographic()) return -camera.world[2].xyz;
    return normalize(mat3(camera.world) * vec3(pixel_to_plane(vec2(pixel) + 0.5), -1.0));
}

#endif
