// SPDX-License-Identifier: Apache-2.0
// Where the text of a topology (passes/scene_closures.cpp) finds what it reads when it is drawn: set 1.
// passes/shared/hit_material.glsl offers the same names where nothing is drawn.
#ifndef NACRE_DRAW_TREE
#define NACRE_DRAW_TREE
#include "passes/shared/fragment_inputs.glsl"

layout(set = 1, binding = 0, std140) uniform TreeNumbers { vec4 rows[TREE_NUMBERS]; } tree_numbers;
#define tree_row(row) tree_numbers.rows[row]
// Which texture coordinates a draw has is known when its shader is made.
#define WHERE_UV0
#define WHERE_UV1
#define closure_texel(number, set) texture(closure_texture_##number, in_uv##set)
#define closure_texel_moved(number, set, row_0, row_1) texture(closure_texture_##number, \
    vec2(dot((row_0).xyz, vec3(in_uv##set, 1.0)), dot((row_1).xyz, vec3(in_uv##set, 1.0))))

#endif
