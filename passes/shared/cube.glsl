// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CUBE
#define NACRE_CUBE

// Direction (not unit) of a point of a cube face; uv in [0, 1], (0, 0) in the corner of texel (0, 0).
vec3 cube_direction(int face, vec2 uv) {
    float s = uv.x * 2.0 - 1.0, t = uv.y * 2.0 - 1.0;
    switch (face) {
        case 0: return vec3(1.0, -t, -s);
        case 1: return vec3(-1.0, -t, s);
        case 2: return vec3(s, 1.0, t);
        case 3: return vec3(s, -1.0, -t);
        case 4: return vec3(s, -t, 1.0);
        default: return vec3(-s, -t, -1.0);
    }
}

#endif
