// SPDX-License-Identifier: Apache-2.0
#version 460
// Light that a surface sends out by itself, where it is seen. PACKED: into an integer target, for devices that cannot
// blend into float targets; the lighting pass adds it.
layout(early_fragment_tests) in;
#include "passes/shared/material.glsl"
#ifdef PACKED
#include "passes/shared/shared_exponent.glsl"
layout(location = 0) out uint out_emission;
#else
layout(location = 0) out vec4 out_emission;
#endif

void main() {
#ifdef PACKED
    out_emission = pack_shared_exponent(emission());
#else
    out_emission = vec4(emission(), 0.0);
#endif
}
