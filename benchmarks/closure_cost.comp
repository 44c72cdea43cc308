// SPDX-License-Identifier: Apache-2.0
#version 460
// Sums what slabs without features send to the viewer under lights at uniform addresses. BY_HAND: by
// benchmarks/closure_cost_by_hand.glsl, else by the closures' library.
layout(local_size_x = 64) in;

struct Point {
    vec4 f0_and_roughness;
    vec4 albedo;
    vec4 view;
};
layout(set = 0, binding = 0, std430) readonly buffer Points { Point points[]; };
layout(set = 0, binding = 1, std140) uniform Lights { vec4 lights[64]; };  // w: weight
layout(set = 0, binding = 2, std430) writeonly buffer Results { vec4 results[]; };
layout(set = 0, binding = 3, std430) readonly buffer Table { uint interface_words[]; };

#ifdef BY_HAND
#include "benchmarks/closure_cost_by_hand.glsl"
#else
#include "materials/closures/table_buffers.glsl"
#include "materials/closures/closure.glsl"
#endif

void main() {
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < POINTS_PER_INVOCATION; ++i) {
        uint index = (gl_GlobalInvocationID.x * POINTS_PER_INVOCATION + i) & 0xffffu;
        vec3 f0 = points[index].f0_and_roughness.rgb;
        float roughness = points[index].f0_and_roughness.a;
        vec3 albedo = points[index].albedo.rgb;
        vec3 view = points[index].view.xyz;
#ifdef BY_HAND
        Prepared prepared = prepare(f0, roughness, albedo, view);
#else
        Slab slab;
        slab.features = 0u;
        slab.coverage = 1.0;
        slab.f0 = f0;
        slab.roughness = roughness;
        slab.albedo = albedo;
        Closure closure = prepare_closure(slab, view, 0.0);
#endif
        for (uint k = 0u; k < LIGHTS_PER_POINT; ++k) {
            // With one light for each slab they take turns.
            vec4 light = lights[LIGHTS_PER_POINT > 1u ? k : i];
            if (light.z <= 0.0) continue;
#ifdef BY_HAND
            sum += light.w * evaluate(prepared, light.xyz);
#else
            ClosureValue value = evaluate_closure_above(closure, light.xyz);
            sum += light.w * (value.specular + value.diffuse);
#endif
        }
    }
    results[gl_GlobalInvocationID.x] = vec4(sum, 1.0);
}
