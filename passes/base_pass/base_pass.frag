// SPDX-License-Identifier: Apache-2.0
#version 460
// Writes what is seen into the words of the G-buffer. The depth prepass has decided what is seen: depth must be equal.
// UNLIT: the base color is shown as it is.
layout(early_fragment_tests) in;
#include "passes/shared/material.glsl"
#include "passes/shared/slab_words.glsl"

layout(location = 0) out uint material_0;
layout(location = 1) out uint material_1;
layout(location = 2) out uint top_layer;

void main() {
    vec3 color = clamp(base_color().rgb, 0.0, 1.0);
#ifdef UNLIT
    unlit_words(color, material_0, material_1, top_layer);
#else
    slab_words(evaluate_slab(color), material_0, material_1, top_layer);
#endif
}
