// SPDX-License-Identifier: Apache-2.0
// The base pass of materials with several lobes: behind the text of a topology (passes/scene_closures.h). Words beyond
// the color targets go into the slices of a storage image, subsurface data into the last where the scene has some.
#include "passes/shared/camera.glsl"
#include "passes/shared/closure_words.glsl"

layout(early_fragment_tests) in;
layout(location = 0) out uint material_0;
layout(location = 1) out uint material_1;
layout(location = 2) out uint top_layer;
#ifdef WRITES_SLICES
#if MATERIAL_SLICES > 1
layout(set = 2, binding = 0, r32ui) uniform writeonly uimage2DArray material_slices;
#define store_slice(pixel, slice, word) imageStore(material_slices, ivec3(pixel, slice), uvec4(word))
#else
layout(set = 2, binding = 0, r32ui) uniform writeonly uimage2D material_slices;
#define store_slice(pixel, slice, word) imageStore(material_slices, pixel, uvec4(word))
#endif
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint words[stored_words];
    uint subsurface;
    closure_words(direction_to_viewer(in_position), pixel_footprint(in_position), uvec2(pixel), words, top_layer, subsurface);
    material_0 = words[0];
    material_1 = words[1];
#ifdef WRITES_SLICES
#ifdef SUBSURFACE_SLICE
    if (stored_has_subsurface) store_slice(pixel, SUBSURFACE_SLICE, subsurface);
#endif
    for (uint i = 2u; i < stored_words; ++i) store_slice(pixel, int(i - 2u), words[i]);
#endif
}
