// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_TABLE_TEXTURES
#define NACRE_CLOSURES_TABLE_TEXTURES
// The tables that the closures ask for, out of textures that hold their words as they are: the interface table has an
// entry in each texel, the others two words in each and 128 texels in each row (passes/scene_materials.cpp). For stages
// that have no storage buffers. Who includes this has declared usampler2D interface_texels and, where slabs have the
// features, anisotropy_texels and medium_texels.
#define interface_pair(entry, column, row) texelFetch(interface_texels, (entry) + ivec2(column, row), 0).rg
#define anisotropy_word(at) texelFetch(anisotropy_texels, ivec2((at) & 127, (at) >> 7), 0).r
#define medium_word(at) texelFetch(medium_texels, ivec2((at) & 127, (at) >> 7), 0).r
#include "materials/closures/table_buffers.glsl"
#endif
