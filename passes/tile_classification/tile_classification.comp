// SPDX-License-Identifier: Apache-2.0
#version 460
// One workgroup looks at the pixels of one tile and adds the tile to the lists of what it found.
#include "passes/shared/gbuffer_fields.glsl"
#include "passes/tile_classification/tiles.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform usampler2D material_0;
layout(set = 0, binding = 1, std430) buffer TileLists { TileList lists[TILE_LISTS]; };
layout(set = 0, binding = 2, std430) writeonly buffer Tiles { uint tiles[]; };
#ifdef WRITE_CLASSES
layout(set = 0, binding = 3, r32ui) uniform writeonly uimage2D tile_classes;
#endif

shared uint classes;

void append(uint list, uint tile, uint tile_count) {
    uint index = atomicAdd(lists[list].count, 1u);
    // A row of groups is opened when the last one is full.
    if (index < dispatch_width) atomicAdd(lists[list].groups_x, 1u);
    if (index % dispatch_width == 0u) atomicAdd(lists[list].groups_y, 1u);
    tiles[list * tile_count + index] = tile;
}

void main() {
    if (gl_LocalInvocationIndex == 0u) classes = 0u;
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, textureSize(material_0, 0)))) {
        atomicOr(classes, 1u << unpack_pixel_class(texelFetch(material_0, pixel, 0).r));
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        uint tile = gl_WorkGroupID.x | (gl_WorkGroupID.y << 16);
        uint tile_count = gl_NumWorkGroups.x * gl_NumWorkGroups.y;
        bool has_slab = (classes & 2u) != 0u, has_unlit = (classes & 4u) != 0u;
#ifdef CLOSURES
        if ((classes & 8u) != 0u) append(list_closures, tile, tile_count);
        else
#endif
        if (has_slab && has_unlit) append(list_mixed, tile, tile_count);
        else if (has_slab) append(list_slab, tile, tile_count);
        else if (has_unlit) append(list_unlit, tile, tile_count);
        if ((classes & 1u) != 0u) append(list_background, tile, tile_count);
#ifdef WRITE_CLASSES
        imageStore(tile_classes, ivec2(gl_WorkGroupID.xy), uvec4(classes));
#endif
    }
}
