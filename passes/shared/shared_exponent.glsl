// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_SHARED_EXPONENT
#define NACRE_SHARED_EXPONENT

// Non-negative color in 32 bits: 9 bits for each channel and a common exponent of 5 bits, as the format RGB9E5 has it.
// For targets on devices that cannot draw into float formats. Largest value 65,408.
// Source: EXT_texture_shared_exponent.
uint pack_shared_exponent(vec3 color) {
    color = clamp(color, vec3(0.0), vec3(65408.0));
    float largest = max(color.r, max(color.g, color.b));
    // The exponent comes from the bits of the float: log2 is not exact enough next to powers of two.
    int exponent = max(-16, int((floatBitsToUint(largest) >> 23) & 0xffu) - 127) + 16;
    float scale = exp2(float(24 - exponent));
    if (floor(largest * scale + 0.5) >= 512.0) {
        scale *= 0.5;
        exponent += 1;
    }
    uvec3 mantissa = uvec3(floor(color * scale + 0.5));
    return mantissa.r | (mantissa.g << 9) | (mantissa.b << 18) | (uint(exponent) << 27);
}

vec3 unpack_shared_exponent(uint word) {
    float scale = exp2(float(word >> 27) - 24.0);
    return vec3(float(word & 0x1ffu), float((word >> 9) & 0x1ffu), float((word >> 18) & 0x1ffu)) * scale;
}

#endif
