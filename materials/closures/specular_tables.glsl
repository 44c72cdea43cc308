// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_SPECULAR_TABLES
#define NACRE_CLOSURES_SPECULAR_TABLES
// The tints of slab_specular_lut out of a texture that holds their words as they are (materials/specular_table.h): 16 x
// 16 entries of two texels in each table, 128 texels in each row. Who includes this has declared usampler2D
// specular_texels. Places beyond the last table have that.
vec3 specular_entry(int at) {
    ivec2 texel = ivec2((2 * at) & 127, (2 * at) >> 7);
    return vec3(unpackUnorm2x16(texelFetch(specular_texels, texel, 0).r),
                unpackUnorm2x16(texelFetch(specular_texels, ivec2(texel.x + 1, texel.y), 0).r).x);
}

vec3 specular_lut(uint index, vec2 at) {
    // Four rows of texels hold a table.
    int table = min(int(index), textureSize(specular_texels, 0).y / 4 - 1);
    vec2 place = clamp(at, vec2(0.0), vec2(1.0)) * 15.0;
    ivec2 entry = min(ivec2(place), ivec2(14));
    vec2 part = place - vec2(entry);
    int first = (table * 16 + entry.y) * 16 + entry.x;
    return mix(mix(specular_entry(first), specular_entry(first + 1), part.x),
               mix(specular_entry(first + 16), specular_entry(first + 17), part.x), part.y);
}
#endif
