// SPDX-License-Identifier: Apache-2.0
// Blended materials with several lobes: behind the text of a topology (passes/scene_closures.h). What they let through is
// what is left of the picture behind them: for each channel with DUAL_SOURCE, else in the mean of the channels.
layout(early_fragment_tests) in;
#include "passes/shared/camera.glsl"
#include "passes/shared/closure_inputs.glsl"
#include "passes/shared/closure_lighting.glsl"
#ifdef PACKED
#include "passes/shared/shared_exponent.glsl"
layout(location = 0) out uint out_color;
layout(location = 1) out uint out_coverage;
#elif defined(DUAL_SOURCE)
layout(location = 0, index = 0) out vec4 out_color;
layout(location = 0, index = 1) out vec4 out_through;
#else
layout(location = 0) out vec4 out_color;
#endif

void main() {
    SurfaceFrames frames = surface_frames();
    LitPoint point;
    point.position = in_position;
    point.to_viewer = direction_to_viewer(in_position);
    point.footprint = pixel_footprint(in_position);
    TreeState state = shade_surface(frames, point.to_viewer, point.footprint);
    point.occlusion = tree_occlusion();
#ifdef LIGHTS
    LightVisibility visibility = light_visibility(in_position, frames.normals[0]);
#endif
    vec3 color = vec3(0.0);
    for (uint i = 0u; i < tree_closure_count; ++i) {
        Path path = state.paths[i];
        path.weight *= state.coverages[i];
        color += closure_radiance(state.slabs[i], path, stored_frame(frames, tree_closure_frame(i)), point
#ifdef LIGHTS
                                  , visibility
#endif
        );
    }
    color += tree_emission(state);
    vec3 colored = clamp(matter_throughput(state.whole), vec3(0.0), vec3(1.0));
    float through = dot(colored, vec3(1.0 / 3.0));
    color = min(color, vec3(65504.0));
#ifdef PACKED
    out_color = pack_shared_exponent(color);
    out_coverage = uint((1.0 - through) * 65535.0 + 0.5);
#else
    out_color = vec4(color, 1.0 - through);
#ifdef DUAL_SOURCE
    out_through = vec4(colored, 1.0);
#endif
#endif
}
