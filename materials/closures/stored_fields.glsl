// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_STORED_FIELDS
#define NACRE_CLOSURES_STORED_FIELDS
// How numbers become the bits of a stored material, and back. Codes are rounded by a dither in (0, 1) instead of one
// half, so that what lies between two codes is right in the mean over neighboring pixels; a number that has a code of
// its own gets that code whatever the dither is. Which number is stored how: materials/storage.h.

// 8 x 8 ordered dither, in 64 steps between 1/128 and 127/128. `which` tells the numbers of one pixel apart, so that
// their errors do not add up to a visible pattern.
float ordered_dither(uint x, uint y, uint which) {
    uint column = x + 3u * which;
    uint across = column ^ (y + 5u * which);
    uint code = ((across & 1u) << 5u) | ((column & 1u) << 4u) | ((across & 2u) << 2u) | ((column & 2u) << 1u) |
                ((across & 4u) >> 1u) | ((column & 4u) >> 2u);
    return (float(code) + 0.5) / 64.0;
}

uint quantized(float unit, uint levels, float dither) {
    return uint(min(floor(clamp(unit, 0.0, 1.0) * float(levels) + dither), float(levels)));
}

uint pack_unit(float unit, uint bits, float dither) { return quantized(unit, (1u << bits) - 1u, dither); }
float unpack_unit(uint code, uint bits) { return float(code) / float((1u << bits) - 1u); }

// [-1, 1]; both ends and 0 have codes of their own.
uint pack_signed(float value, uint bits, float dither) {
    float half_range = float((1u << (bits - 1u)) - 1u);
    return uint(floor(clamp(value, -1.0, 1.0) * half_range + dither) + half_range);
}
float unpack_signed(uint code, uint bits) {
    float half_range = float((1u << (bits - 1u)) - 1u);
    return (float(code) - half_range) / half_range;
}

// A color in [0, 1] in 20 bits: 7 each of red and green, 6 of blue, where the eye sees steps least. Square roots are
// stored: steps are about even to the eye, and reading back is one exact product.
uint pack_color(vec3 color, vec3 dither) {
    vec3 root = sqrt(clamp(color, vec3(0.0), vec3(1.0)));
    return quantized(root.x, 127u, dither.x) | (quantized(root.y, 127u, dither.y) << 7u) |
           (quantized(root.z, 63u, dither.z) << 14u);
}
vec3 unpack_color(uint code) {
    vec3 root = vec3(float(code & 127u) / 127.0, float((code >> 7u) & 127u) / 127.0, float((code >> 14u) & 63u) / 63.0);
    return root * root;
}

// Numbers over many orders of magnitude: 0 is exact, the smallest other one is `lowest`, and `octaves` above lies the
// largest, which stands for all that is larger.
uint pack_logarithm(float value, uint bits, float lowest, float octaves, float dither) {
    if (!(value > 0.0)) return 0u;
    return 1u + quantized(log2(max(value / lowest, 1.0)) / octaves, (1u << bits) - 2u, dither);
}
float unpack_logarithm(uint code, uint bits, float lowest, float octaves) {
    return code == 0u ? 0.0 : lowest * exp2(octaves * float(code - 1u) / float((1u << bits) - 2u));
}

// The same with a sign in the highest bit.
uint pack_signed_logarithm(float value, uint bits, float lowest, float octaves, float dither) {
    return pack_logarithm(abs(value), bits - 1u, lowest, octaves, dither) | (value < 0.0 ? 1u << (bits - 1u) : 0u);
}
float unpack_signed_logarithm(uint code, uint bits, float lowest, float octaves) {
    uint magnitude = code & ((1u << (bits - 1u)) - 1u);
    float value = unpack_logarithm(magnitude, bits - 1u, lowest, octaves);
    return magnitude == code ? value : -value;
}

// Of a number only what is behind the point.
uint pack_fraction(float value, uint bits) {
    float range = float(1u << bits);
    return uint(min(floor((value - floor(value)) * range), range - 1.0));
}
float unpack_fraction(uint code, uint bits) { return (float(code) + 0.5) / float(1u << bits); }

#endif
