// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_PASSES_SHARED_HALF_GLSL
#define NACRE_PASSES_SHARED_HALF_GLSL

// The nearest numbers that half precision holds (ties to even), for what goes into 16-bit float images. Devices may round
// either way when they store, and do; a number that needs no rounding is stored as it is on all of them.
// Range: [0, 65504]; below 2^-14 the device still rounds.
vec3 round_to_half(vec3 value) {
    uvec3 bits = floatBitsToUint(value);
    bits += 0xfffu + ((bits >> 13) & 1u);
    return uintBitsToFloat(bits & 0xffffe000u);
}

#endif
