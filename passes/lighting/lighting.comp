// SPDX-License-Identifier: Apache-2.0
#version 460
// Lights the tiles of one list. SLAB, UNLIT: what pixels of these tiles can hold. TILE_LIST: which list.
// EMISSION_TARGET: emission was drawn into an integer target and is added here.
// CLOSURES: pixels may hold materials of several lobes, whose features' macros are defined; MATERIAL_SLICES: slices with
// the words beyond the second, SUBSURFACE_SLICE: which of them holds subsurface data.
#include "passes/shared/gbuffer_fields.glsl"
#include "passes/shared/half.glsl"
#include "passes/shared/shared_exponent.glsl"
#include "passes/tile_classification/tiles.glsl"
#ifdef CLOSURES
#ifdef NACRE_SLAB_MEDIUM
layout(set = 1, binding = 9) uniform usampler2D medium_texels;
#endif
#ifdef NACRE_SLAB_ANISOTROPY
layout(set = 1, binding = 10) uniform usampler2D anisotropy_texels;
#endif
#ifdef NACRE_SLAB_SPECULAR_LUT
layout(set = 1, binding = 11) uniform usampler2D specular_texels;
#include "materials/closures/specular_tables.glsl"
#endif
#include "passes/shared/closure_lighting.glsl"
#elif defined(SLAB)
#include "passes/shared/lighting.glsl"
#endif

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 0) uniform usampler2D material_0;
#ifdef SLAB
layout(set = 1, binding = 1) uniform usampler2D material_1;
layout(set = 1, binding = 2) uniform usampler2D top_layer;
layout(set = 1, binding = 3) uniform sampler2D depth;
#endif
layout(set = 1, binding = 4, std430) readonly buffer TileLists { TileList lists[TILE_LISTS]; };
layout(set = 1, binding = 5, std430) readonly buffer Tiles { uint tiles[]; };
layout(set = 1, binding = 6, LIT_FORMAT) uniform writeonly image2D lit;
#ifdef EMISSION_TARGET
layout(set = 1, binding = 7) uniform usampler2D emission;
#endif
#ifdef CLOSURES
#ifdef MATERIAL_SLICES
#if MATERIAL_SLICES > 1
layout(set = 1, binding = 12) uniform usampler2DArray material_slices;
#define fetch_slice(pixel, slice) texelFetch(material_slices, ivec3(pixel, slice), 0).r
#else
layout(set = 1, binding = 12) uniform usampler2D material_slices;
#define fetch_slice(pixel, slice) texelFetch(material_slices, pixel, 0).r
#endif
#endif

ivec2 stored_pixel;
uint first_words[2];
uint material_word(uint index) {
#ifdef MATERIAL_SLICES
    if (index >= 2u) return fetch_slice(stored_pixel, int(min(index - 2u, uint(MATERIAL_SLICES - 1))));
#endif
    return index == 0u ? first_words[0] : first_words[1];
}
#include "materials/closures/stored_closures.glsl"

vec3 shade_closures(ivec2 pixel, uint word_0, uint word_1, uint top, vec3 position) {
    stored_pixel = pixel;
    first_words[0] = word_0;
    first_words[1] = word_1;
    vec3 normal = unpack_normal(top);
    float roughness = unpack_roughness(top);
    uint subsurface = 0u;
#ifdef SUBSURFACE_SLICE
    subsurface = fetch_slice(pixel, SUBSURFACE_SLICE);
#endif
    StoredHeader header = read_stored_header(normal);
    LitPoint point;
    point.position = position;
    point.to_viewer = direction_to_viewer(position);
    point.footprint = pixel_footprint(position);
    point.occlusion = header.occlusion;
#ifdef LIGHTS
    LightVisibility visibility = light_visibility(position, normal);
#endif
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < header.closure_count; ++i) {
        StoredClosure closure = read_stored_closure(header, i, roughness, subsurface);
        sum += closure_radiance(closure.slab, closure.path, header.frames[closure.frame], point
#ifdef LIGHTS
                                , visibility
#endif
        );
    }
    return min(sum, vec3(65504.0));
}
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
        SingleSlab slab;
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
#ifdef CLOSURES
    if (pixel_class == 3u) {
        vec3 position = position_of(pixel, texelFetch(depth, pixel, 0).r);
        color = shade_closures(pixel, word_0, texelFetch(material_1, pixel, 0).r, texelFetch(top_layer, pixel, 0).r, position);
    }
#endif
#ifdef EMISSION_TARGET
    color = min(color + unpack_shared_exponent(texelFetch(emission, pixel, 0).r), vec3(65504.0));
#endif
    imageStore(lit, pixel, vec4(round_to_half(color), 1.0));
}
