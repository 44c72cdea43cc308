// SPDX-License-Identifier: Apache-2.0
#version 460
// Shades a list of places from the blobs of their materials, as hits of rays are shaded.
#include "passes/hit_shading/surface_point.glsl"
#include "passes/shared/camera.glsl"
#include "passes/shared/hit_shading.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 1, std430) readonly buffer SurfacePoints { SurfacePoint points[]; };
layout(set = 0, binding = 2) uniform sampler2D depth;
layout(set = 0, binding = 3, r32ui) uniform writeonly uimage2D material_0;
layout(set = 0, binding = 4, r32ui) uniform writeonly uimage2D material_1;
layout(set = 0, binding = 5, r32ui) uniform writeonly uimage2D top_layer;
layout(set = 0, binding = 6, rgba32f) uniform writeonly image2D hit_albedo;    // a: roughness
layout(set = 0, binding = 7, rgba32f) uniform writeonly image2D hit_emission_and_cover;  // a: 1 where the alpha test lets the place be
#ifdef MATERIAL_SLICES
#if MATERIAL_SLICES > 1
layout(set = 0, binding = 8, r32ui) uniform writeonly uimage2DArray material_slices;
#define store_slice(pixel, slice, word) imageStore(material_slices, ivec3(pixel, slice), uvec4(word))
#else
layout(set = 0, binding = 8, r32ui) uniform writeonly uimage2D material_slices;
#define store_slice(pixel, slice, word) imageStore(material_slices, pixel, uvec4(word))
#endif
#endif

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(depth, 0)))) return;
    HitWords hit;
    for (uint i = 0u; i < hit_word_capacity; ++i) hit.words[i] = 0u;
    hit.top_layer = hit.subsurface = 0u;
    hit.has_subsurface = false;
    HitProperties properties = HitProperties(vec3(0.0), vec3(0.0), 0.0);
    bool is_covered = false;
    // Nothing is seen where depth is 0.
    if (texelFetch(depth, pixel, 0).r > 0.0) {
        SurfacePoint point = points[pixel.y * textureSize(depth, 0).x + pixel.x];
        hit_material = point.ids.x;
        in_attributes = point.ids.y;
        in_position = point.position.xyz;
        in_normal = point.normal.xyz;
        in_tangent = point.tangent;
        in_uv0 = point.uv.xy;
        in_uv1 = point.uv.zw;
        in_color = point.color;
        in_uv0_dx = point.uv0_gradients.xy;
        in_uv0_dy = point.uv0_gradients.zw;
        in_uv1_dx = point.uv1_gradients.xy;
        in_uv1_dy = point.uv1_gradients.zw;
        vec3 to_viewer = direction_to_viewer(in_position);
        float footprint = pixel_footprint(in_position);
        hit = hit_words(to_viewer, footprint, uvec2(pixel));
        properties = hit_properties(to_viewer, footprint);
        is_covered = hit_is_covered();
    }
    imageStore(material_0, pixel, uvec4(hit.words[0]));
    imageStore(material_1, pixel, uvec4(hit.words[1]));
    imageStore(top_layer, pixel, uvec4(hit.top_layer));
    imageStore(hit_albedo, pixel, vec4(properties.albedo, properties.roughness));
    imageStore(hit_emission_and_cover, pixel, vec4(properties.emission, is_covered ? 1.0 : 0.0));
#ifdef MATERIAL_SLICES
    for (int i = 0; i < MATERIAL_SLICES; ++i) {
        uint word = uint(i) + 2u < hit_word_capacity ? hit.words[i + 2] : 0u;
#ifdef SUBSURFACE_SLICE
        if (i == SUBSURFACE_SLICE) word = hit.subsurface;
#endif
        store_slice(pixel, i, word);
    }
#endif
}
