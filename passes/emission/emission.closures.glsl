// SPDX-License-Identifier: Apache-2.0
// Light that a tree of slabs sends out by itself, through the layers above: behind the text of a topology
// (passes/scene_closures.h). PACKED as in passes/emission/emission.frag.
layout(early_fragment_tests) in;
#include "passes/shared/camera.glsl"
#include "passes/shared/closure_inputs.glsl"
#ifdef PACKED
#include "passes/shared/shared_exponent.glsl"
layout(location = 0) out uint out_emission;
#else
layout(location = 0) out vec4 out_emission;
#endif

void main() {
    // Half floats hold no more.
    TreeState state = shade_surface(surface_frames(), direction_to_viewer(in_position), pixel_footprint(in_position));
    vec3 color = min(tree_emission(state), vec3(65504.0));
#ifdef PACKED
    out_emission = pack_shared_exponent(color);
#else
    out_emission = vec4(color, 0.0);
#endif
}
