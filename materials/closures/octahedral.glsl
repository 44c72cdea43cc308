// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_OCTAHEDRAL
#define NACRE_OCTAHEDRAL

// A unit vector as two coordinates of bits each. Codes run from 0 to 2^bits - 2, so that 0, 1 and -1 are exact.
// Source: Meyer et al. 2010, "On floating-point normal vectors".
uint octahedral_encode(vec3 n, int bits) {
    vec2 p = vec2(n.x, n.y) / max(abs(n.x) + abs(n.y) + abs(n.z), 1e-20);
    if (n.z < 0.0) {
        vec2 folded = vec2(1.0) - abs(vec2(p.y, p.x));
        p = vec2(p.x >= 0.0 ? folded.x : -folded.x, p.y >= 0.0 ? folded.y : -folded.y);
    }
    float half_range = float((1 << (bits - 1)) - 1);
    vec2 code = floor(clamp(p, -1.0, 1.0) * half_range + 0.5) + half_range;
    return uint(code.x) | (uint(code.y) << uint(bits));
}

vec3 octahedral_decode(uint code, int bits) {
    float half_range = float((1 << (bits - 1)) - 1);
    uint mask = (1u << uint(bits)) - 1u;
    vec2 p = (vec2(float(code & mask), float((code >> uint(bits)) & mask)) - half_range) / half_range;
    float z = 1.0 - abs(p.x) - abs(p.y);
    float fold = max(-z, 0.0);
    p -= vec2(p.x >= 0.0 ? fold : -fold, p.y >= 0.0 ? fold : -fold);
    return normalize(vec3(p.x, p.y, z));
}

#endif
