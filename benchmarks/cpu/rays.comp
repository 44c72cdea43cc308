// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_query : require
// Closest hits: how far, and which triangle.
layout(local_size_x = 64) in;

struct Ray {
    vec4 origin_t_min, direction_t_max;
};
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) readonly buffer Rays { Ray rays[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Hits { uvec2 hits[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= rays.length()) return;
    Ray ray = rays[i];
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xffu, ray.origin_t_min.xyz, ray.origin_t_min.w,
                          ray.direction_t_max.xyz, ray.direction_t_max.w);
    while (rayQueryProceedEXT(query)) {}
    uvec2 hit = uvec2(floatBitsToUint(ray.direction_t_max.w), ~0u);
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT)
        hit = uvec2(floatBitsToUint(rayQueryGetIntersectionTEXT(query, true)),
                    uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true)));
    hits[i] = hit;
}
