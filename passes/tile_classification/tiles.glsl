// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_TILES
#define NACRE_TILES

// Tiles of 8x8 pixels are sorted into lists by what their pixels hold; each list has the arguments of an indirect dispatch.
// A tile is in at most one of the first three lists, and in the last too when the sky is seen in it.
const uint list_slab = 0u;
const uint list_unlit = 1u;
const uint list_mixed = 2u;
const uint list_background = 3u;
// Tiles with materials of several lobes, whatever else is in them; only where the scene has such.
const uint list_closures = 4u;
#ifdef CLOSURES
#define TILE_LISTS 5
#else
#define TILE_LISTS 4
#endif
// Dispatches are wrapped at this width, below the number of groups that every device allows in one direction.
const uint dispatch_width = 32768u;

struct TileList {
    uint groups_x, groups_y, groups_z;
    uint count;
};

#endif
