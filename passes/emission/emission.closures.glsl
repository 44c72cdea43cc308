// SPDX-License-Identifier: Apache-2.0
// Light that a tree of slabs sends out by itself, through the layers above: behind the text of a topology
// (passes/scene_closures.h). PACKED as in passes/emission/emission.frag.
layout(early_fragment_tests) in;
#include "passes/shared/closure_inputs.glsl"
#ifdef PACKED
#include "passes/shared/shared_exponent.glsl"
layout(location = 0) out uint out_emission;
#else
layout(location = 0) out vec4 out_emission;
#endif

void main() {
    // Half floats hold no more.
    vec3 color = min(tree_emission(shade_surface(surface_frames())), vec3(65504.0));
#ifdef PACKED
    out_emission = pack_shared_exponent(color);
#else
    out_emission = vec4(color, 0.0);
#endif
}
