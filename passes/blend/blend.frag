// SPDX-License-Identifier: Apache-2.0
#version 460
// Surfaces of alpha mode BLEND, lit as the deferred ones are; premultiplied with their coverage. UNLIT: the base color is
// shown as it is. PACKED: into integer targets, which passes/blend/composite.comp lays over the picture.
layout(early_fragment_tests) in;
#ifndef UNLIT
#define READS_POSITION
#endif
#include "passes/shared/material.glsl"
#ifndef UNLIT
#include "passes/shared/lighting.glsl"
#endif
#ifdef PACKED
#include "passes/shared/shared_exponent.glsl"
layout(location = 0) out uint out_color;
layout(location = 1) out uint out_coverage;
#else
layout(location = 0) out vec4 out_color;
#endif

void main() {
    vec4 base = clamp(base_color(), 0.0, 1.0);
    vec3 color = base.rgb;
#ifndef UNLIT
    color = shade_slab(evaluate_slab(base.rgb), in_position, direction_to_viewer(in_position)) ;
#endif
#ifdef HAS_EMISSION
    color = min(color + emission(), vec3(65504.0));
#endif
    color *= base.a;
#ifdef PACKED
    out_color = pack_shared_exponent(color);
    out_coverage = uint(base.a * 65535.0 + 0.5);
#else
    out_color = vec4(color, base.a);
#endif
}
