// SPDX-License-Identifier: Apache-2.0
#version 460
// Lights the tiles of one list. SLAB, UNLIT: what pixels of these tiles can hold. TILE_LIST: which list.
// EMISSION_TARGET: emission was drawn into an integer target and is added here.
#include "passes/shared/gbuffer_fields.glsl"
#include "passes/shared/half.glsl"
#include "passes/shared/shared_exponent.glsl"
#include "passes/tile_classification/tiles.glsl"
#ifdef SLAB
#include "passes/shared/lighting.glsl"
#endif

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0) uniform usampler2D material_0;
#ifdef SLAB
layout(set = 1, binding = 1) uniform usampler2D material_1;
layout(set = 1, binding = 2) uniform usampler2D top_layer;
layout(set = 1, binding = 3) uniform sampler2D depth;
#endif
layout(set = 1, binding = 4, std430) readonly buffer TileLists { TileList lists[4]; };
layout(set = 1, binding = 5, std430) readonly buffer Tiles { uint tiles[]; };
layout(set = 1, binding = 6, LIT_FORMAT) uniform writeonly image2D lit;
#ifdef EMISSION_TARGET
layout(set = 1, binding = 7) uniform usampler2D emission;
#endif

void main() {
    uint index = gl_WorkGroupID.x + gl_WorkGroupID.y * dispatch_width;
    if (index >= lists[TILE_LIST].count) return;
    ivec2 size = textureSize(material_0, 0);
    uint tile_count = uint((size.x + 7) / 8) * uint((size.y + 7) / 8);
    uint tile = tiles[uint(TILE_LIST) * tile_count + index];
    ivec2 pixel = ivec2(tile & 0xffffu, tile >> 16) * 8 + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(pixel, size))) return;

    uint word_0 = texelFetch(material_0, pixel, 0).r;
    uint pixel_class = unpack_pixel_class(word_0);
    if (pixel_class == 0u) return;
    vec3 diffuse = vec3(unpack_diffuse_r(word_0), unpack_diffuse_g(word_0), unpack_diffuse_b(word_0));
    vec3 color = diffuse;
#ifdef SLAB
    if (pixel_class == 1u) {
        uint word_1 = texelFetch(material_1, pixel, 0).r;
        uint top = texelFetch(top_layer, pixel, 0).r;
        Slab slab;
        slab.diffuse = diffuse;
        slab.f0 = vec3(unpack_f0_r(word_1), unpack_f0_g(word_1), unpack_f0_b(word_1));
        slab.f90 = unpack_f90(word_1);
        slab.roughness = unpack_roughness(top);
        slab.normal = unpack_normal(top);
        slab.occlusion = unpack_occlusion(word_0);
        vec3 position = position_of(pixel, texelFetch(depth, pixel, 0).r);
        color = shade_slab(slab, position, direction_to_viewer(position));
    }
#endif
#ifdef EMISSION_TARGET
    color = min(color + unpack_shared_exponent(texelFetch(emission, pixel, 0).r), vec3(65504.0));
#endif
    imageStore(lit, pixel, vec4(round_to_half(color), 1.0));
}
