// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_MATH
#define NACRE_CLOSURES_MATH
// The files of this folder are GLSL and C++ at once (materials/closures/library.h compiles them in double precision):
// no swizzles beyond .x .y .z .w, no out parameters, no constructors of structs and arrays, no textures.

const float pi = 3.14159265358979323846;
const float inverse_pi = 0.31830988618379067154;

// Views nearer to the surface than this are moved here.
const float smallest_cosine = 1e-8;

float square(float x) { return x * x; }
float power5(float x) { return square(square(x)) * x; }
float power6(float x) { return square(square(x) * x); }

// 1 - (1 - c)^5 by c and m = 1 - c, without the loss of digits near 0.
float schlick_rest(float c, float m) { return c * (1.0 + m * (1.0 + m * (1.0 + m * (1.0 + m)))); }

// 1 - exp(-x), with all digits where x is small.
float exponential_rest(float x) { return x < 0.01 ? x * (1.0 - x * (0.5 - x / 6.0)) : 1.0 - exp(-x); }

// -log(1 - x) for x in [0, 1], with all digits where x is small; finite at 1.
float minus_log_rest(float x) {
    return x < 0.05 ? x * (1.0 + x * (0.5 + x * (1.0 / 3.0 + x * (0.25 + x * 0.2)))) : -log(max(1.0 - x, 1e-37));
}

// 1 - (1 - a)(1 - b), for what happens here or there, with all digits where both are small.
float either(float a, float b) { return a + b * (1.0 - a); }
vec3 either(vec3 a, vec3 b) { return a + b * (vec3(1.0) - a); }

float largest(vec3 v) { return max(v.x, max(v.y, v.z)); }
float saturated(float x) { return clamp(x, 0.0, 1.0); }

// Unit vector between two; their common axis where they are opposite.
vec3 half_vector(vec3 a, vec3 b) {
    vec3 sum = a + b;
    float length_squared = dot(sum, sum);
    if (length_squared < 1e-30) return vec3(0.0, 0.0, 1.0);
    return sum * inversesqrt(length_squared);
}

// Cosine between either of two unit vectors and their half vector. The length of the sum has the digits that the scalar
// product loses where the two are nearly opposite.
float half_vector_cosine(vec3 a, vec3 b) { return min(0.5 * length(a + b), 1.0); }

// Density cos / pi.
vec3 cosine_direction(float random_x, float random_y) {
    float radius = sqrt(random_x);
    float phi = 2.0 * pi * random_y;
    return vec3(radius * cos(phi), radius * sin(phi), sqrt(1.0 - random_x));
}

// Density 1 / (2 pi).
vec3 uniform_direction(float random_x, float random_y) {
    float radius = sqrt(random_x * (2.0 - random_x));
    float phi = 2.0 * pi * random_y;
    return vec3(radius * cos(phi), radius * sin(phi), 1.0 - random_x);
}

#endif
