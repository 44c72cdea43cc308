// SPDX-License-Identifier: Apache-2.0
#version 460
// The environment where no surface is seen.
#include "passes/shared/camera.glsl"
#include "passes/shared/gbuffer_fields.glsl"
#include "passes/shared/half.glsl"
#include "passes/tile_classification/tiles.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 4) uniform samplerCube environment;
layout(set = 1, binding = 0) uniform usampler2D material_0;
layout(set = 1, binding = 4, std430) readonly buffer TileLists { TileList lists[4]; };
layout(set = 1, binding = 5, std430) readonly buffer Tiles { uint tiles[]; };
layout(set = 1, binding = 6, LIT_FORMAT) uniform writeonly image2D lit;

void main() {
    uint index = gl_WorkGroupID.x + gl_WorkGroupID.y * dispatch_width;
    if (index >= lists[list_background].count) return;
    ivec2 size = textureSize(material_0, 0);
    uint tile_count = uint((size.x + 7) / 8) * uint((size.y + 7) / 8);
    uint tile = tiles[list_background * tile_count + index];
    ivec2 pixel = ivec2(tile & 0xffffu, tile >> 16) * 8 + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(pixel, size))) return;
    if (unpack_pixel_class(texelFetch(material_0, pixel, 0).r) != 0u) return;
    imageStore(lit, pixel, vec4(round_to_half(textureLod(environment, view_ray(pixel), 0.0).rgb), 1.0));
}
