// SPDX-License-Identifier: Apache-2.0
// The 128 bytes of a material (materials/material_blob.h). Who includes this has defined uvec4 material_row(uint row).
#ifndef NACRE_MATERIAL_BLOB
#define NACRE_MATERIAL_BLOB

const uint blob_tree_type = 1u, blob_custom_type = 0x8000u;

// Four numbers of a row.
#define material_numbers(row) uintBitsToFloat(material_row(row))
// The rows of numbers of a kind of the program's own, 0 to 4. The last row holds the scale of the normal map.
#define custom_numbers(i) material_numbers((i) + 2u)

uint material_type() { return material_row(0u).x & 0xffffu; }
uint material_alpha_mode() { return (material_row(0u).x >> 16u) & 3u; }  // 0 opaque, 1 mask, 2 blend
bool material_is_double_sided() { return (material_row(0u).x & 0x40000u) != 0u; }
bool material_is_unlit() { return (material_row(0u).x & 0x80000u) != 0u; }
bool material_emits() { return (material_row(0u).x & 0x100000u) != 0u; }
float material_alpha_cutoff() { return uintBitsToFloat(material_row(0u).y); }
uint material_sideband_row() { return material_row(0u).z; }
bool material_has_texture(uint i) { return ((material_row(0u).w >> i) & 1u) != 0u; }
bool material_reads_uv1(uint i) { return ((material_row(0u).w >> (i + 7u)) & 1u) != 0u; }
bool material_moves_uv() { return (material_row(0u).w & 0x4000u) != 0u; }
uint material_number() { return material_row(0u).w >> 16u; }
uint half_word(uvec4 row, uint i) { return (row[(i >> 1u) & 3u] >> ((i & 1u) * 16u)) & 0xffffu; }
uint material_texture(uint i) { return half_word(material_row(1u), i); }

#endif
