// SPDX-License-Identifier: Apache-2.0
// Textures by index, the shader side of rhi/texture_table.h. Compile with the definitions of `TextureTable::defines()`:
//
//     #include "rhi/shaders/texture_table.glsl"
//     vec4 color = sample_table(material.albedo_texture, uv);
//
// The index may differ between neighboring pixels. An index that names no texture reads as 0 in all channels.
// `sample_table` takes derivatives of `uv`: call it in fragment shaders only, and not under a condition that
// differs within a 2x2 quad; the other functions can be called anywhere.

#ifndef NACRE_TEXTURE_TABLE_INCLUDED
#define NACRE_TEXTURE_TABLE_INCLUDED

#if NACRE_TEXTURE_TABLE_PAGES == 0

// Descriptor indexing: one array of textures.
#extension GL_EXT_nonuniform_qualifier : require
layout(set = NACRE_TEXTURE_TABLE_SET, binding = 0) uniform sampler2D nacre_table_textures[];

uint nacre_table_index(uint index) {
    return min(index, uint(NACRE_TEXTURE_TABLE_CAPACITY - 1));
}

vec4 sample_table_grad(uint index, vec2 uv, vec2 uv_dx, vec2 uv_dy) {
    return textureGrad(nacre_table_textures[nonuniformEXT(nacre_table_index(index))], uv, uv_dx, uv_dy);
}
vec4 sample_table_lod(uint index, vec2 uv, float lod) {
    return textureLod(nacre_table_textures[nonuniformEXT(nacre_table_index(index))], uv, lod);
}
vec4 fetch_table(uint index, ivec2 texel, int mip) {
    return texelFetch(nacre_table_textures[nonuniformEXT(nacre_table_index(index))], texel, mip);
}
ivec2 table_texture_size(uint index, int mip) {
    return textureSize(nacre_table_textures[nonuniformEXT(nacre_table_index(index))], mip);
}

#else

// Pages: arrays of textures, chosen by constant indices only, since GLES 3.1 and some Vulkan drivers have no others.
// An entry holds the page in its upper 8 bits and the layer in the others, 4 entries to an element.
layout(set = NACRE_TEXTURE_TABLE_SET, binding = 0, std140) uniform NacreTextureTable {
    uvec4 entries[(NACRE_TEXTURE_TABLE_CAPACITY + 3) / 4];
} nacre_table;

#define NACRE_TABLE_DECLARE(number) \
    layout(set = NACRE_TEXTURE_TABLE_SET, binding = number + 1) uniform sampler2DArray nacre_table_page_##number;
NACRE_TABLE_DECLARE(0)
#if NACRE_TEXTURE_TABLE_PAGES > 1
NACRE_TABLE_DECLARE(1)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 2
NACRE_TABLE_DECLARE(2)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 3
NACRE_TABLE_DECLARE(3)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 4
NACRE_TABLE_DECLARE(4)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 5
NACRE_TABLE_DECLARE(5)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 6
NACRE_TABLE_DECLARE(6)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 7
NACRE_TABLE_DECLARE(7)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 8
NACRE_TABLE_DECLARE(8)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 9
NACRE_TABLE_DECLARE(9)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 10
NACRE_TABLE_DECLARE(10)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 11
NACRE_TABLE_DECLARE(11)
#endif

uint nacre_table_entry(uint index) {
    uint clamped = min(index, uint(NACRE_TEXTURE_TABLE_CAPACITY - 1));
    return nacre_table.entries[clamped >> 2u][clamped & 3u];
}

// One `if` for each page: `body` is an expression of `page`.
#define NACRE_TABLE_CASE(number, body) \
    if (entry_page == uint(number)) {  \
        result = body(nacre_table_page_##number);  \
    } else
#if NACRE_TEXTURE_TABLE_PAGES > 1
#define NACRE_TABLE_CASE_1(body) NACRE_TABLE_CASE(1, body)
#else
#define NACRE_TABLE_CASE_1(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 2
#define NACRE_TABLE_CASE_2(body) NACRE_TABLE_CASE(2, body)
#else
#define NACRE_TABLE_CASE_2(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 3
#define NACRE_TABLE_CASE_3(body) NACRE_TABLE_CASE(3, body)
#else
#define NACRE_TABLE_CASE_3(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 4
#define NACRE_TABLE_CASE_4(body) NACRE_TABLE_CASE(4, body)
#else
#define NACRE_TABLE_CASE_4(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 5
#define NACRE_TABLE_CASE_5(body) NACRE_TABLE_CASE(5, body)
#else
#define NACRE_TABLE_CASE_5(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 6
#define NACRE_TABLE_CASE_6(body) NACRE_TABLE_CASE(6, body)
#else
#define NACRE_TABLE_CASE_6(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 7
#define NACRE_TABLE_CASE_7(body) NACRE_TABLE_CASE(7, body)
#else
#define NACRE_TABLE_CASE_7(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 8
#define NACRE_TABLE_CASE_8(body) NACRE_TABLE_CASE(8, body)
#else
#define NACRE_TABLE_CASE_8(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 9
#define NACRE_TABLE_CASE_9(body) NACRE_TABLE_CASE(9, body)
#else
#define NACRE_TABLE_CASE_9(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 10
#define NACRE_TABLE_CASE_10(body) NACRE_TABLE_CASE(10, body)
#else
#define NACRE_TABLE_CASE_10(body)
#endif
#if NACRE_TEXTURE_TABLE_PAGES > 11
#define NACRE_TABLE_CASE_11(body) NACRE_TABLE_CASE(11, body)
#else
#define NACRE_TABLE_CASE_11(body)
#endif
#define NACRE_TABLE_CHOOSE(body)                                                                       \
    uint entry = nacre_table_entry(index);                                                             \
    uint entry_page = entry >> 24u;                                                                    \
    uint layer = entry & 0xffffffu;                                                                    \
    NACRE_TABLE_CASE(0, body) NACRE_TABLE_CASE_1(body) NACRE_TABLE_CASE_2(body) NACRE_TABLE_CASE_3(body)   \
    NACRE_TABLE_CASE_4(body) NACRE_TABLE_CASE_5(body) NACRE_TABLE_CASE_6(body) NACRE_TABLE_CASE_7(body)    \
    NACRE_TABLE_CASE_8(body) NACRE_TABLE_CASE_9(body) NACRE_TABLE_CASE_10(body) NACRE_TABLE_CASE_11(body) {}

vec4 sample_table_grad(uint index, vec2 uv, vec2 uv_dx, vec2 uv_dy) {
    vec4 result = vec4(0.0);
#define NACRE_TABLE_BODY_GRAD(page) textureGrad(page, vec3(uv, float(layer)), uv_dx, uv_dy)
    NACRE_TABLE_CHOOSE(NACRE_TABLE_BODY_GRAD)
    return result;
}
vec4 sample_table_lod(uint index, vec2 uv, float lod) {
    vec4 result = vec4(0.0);
#define NACRE_TABLE_BODY_LOD(page) textureLod(page, vec3(uv, float(layer)), lod)
    NACRE_TABLE_CHOOSE(NACRE_TABLE_BODY_LOD)
    return result;
}
vec4 fetch_table(uint index, ivec2 texel, int mip) {
    vec4 result = vec4(0.0);
#define NACRE_TABLE_BODY_FETCH(page) texelFetch(page, ivec3(texel, int(layer)), mip)
    NACRE_TABLE_CHOOSE(NACRE_TABLE_BODY_FETCH)
    return result;
}
// The size of the page: a texture that had to share a page with larger ones was enlarged.
ivec2 table_texture_size(uint index, int mip) {
    ivec2 result = ivec2(1);
#define NACRE_TABLE_BODY_SIZE(page) textureSize(page, mip).xy
    NACRE_TABLE_CHOOSE(NACRE_TABLE_BODY_SIZE)
    return result;
}

#endif

#ifdef NACRE_FRAGMENT_STAGE
vec4 sample_table(uint index, vec2 uv) {
#if NACRE_TEXTURE_TABLE_PAGES == 0
    return texture(nacre_table_textures[nonuniformEXT(nacre_table_index(index))], uv);
#else
    // Derivatives are taken before the page is chosen: after it, the neighbors in a quad may be elsewhere.
    return sample_table_grad(index, uv, dFdx(uv), dFdy(uv));
#endif
}
#endif

#endif
