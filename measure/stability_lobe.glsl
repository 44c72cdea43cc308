// SPDX-License-Identifier: Apache-2.0
// Single lobes and formulae at many points (measure/stability.h). Before it stand the includes and the function
// evaluate(); see measure/stability_closure.glsl for CANDIDATE and REFERENCE.

void main() {
    place = gl_GlobalInvocationID.x * POINT_WORDS;
    LobePoint point;
    point.view = next3();
    point.light = next3();
    point.roughness = next();
    point.anisotropy = next();
    point.color = next3();
    point.random = next2();
    point.mean_free_path = next();
    point.distance = next();
    point.at = gl_GlobalInvocationID.x * RESULT_WORDS;
    evaluate(point);
}
