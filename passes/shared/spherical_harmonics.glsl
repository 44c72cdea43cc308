// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_SPHERICAL_HARMONICS
#define NACRE_SPHERICAL_HARMONICS

// Real spherical harmonics of bands 0 to 2 at a unit direction, one by one.
// Source: Ramamoorthi and Hanrahan 2001, "An efficient representation for irradiance environment maps".
float harmonic(int index, vec3 d) {
    switch (index) {
        case 0: return 0.282094792;
        case 1: return 0.488602512 * d.y;
        case 2: return 0.488602512 * d.z;
        case 3: return 0.488602512 * d.x;
        case 4: return 1.092548431 * d.x * d.y;
        case 5: return 1.092548431 * d.y * d.z;
        case 6: return 0.315391565 * (3.0 * d.z * d.z - 1.0);
        case 7: return 1.092548431 * d.x * d.z;
        default: return 0.546274215 * (d.x * d.x - d.y * d.y);
    }
}

// Irradiance for a normal from coefficients that are already convolved with the cosine.
vec3 irradiance(vec3 n, vec4 coefficients[9]) {
    vec3 sum = coefficients[0].rgb * 0.282094792;
    sum += coefficients[1].rgb * (0.488602512 * n.y) + coefficients[2].rgb * (0.488602512 * n.z) + coefficients[3].rgb * (0.488602512 * n.x);
    sum += coefficients[4].rgb * (1.092548431 * n.x * n.y) + coefficients[5].rgb * (1.092548431 * n.y * n.z);
    sum += coefficients[6].rgb * (0.315391565 * (3.0 * n.z * n.z - 1.0)) + coefficients[7].rgb * (1.092548431 * n.x * n.z);
    return sum + coefficients[8].rgb * (0.546274215 * (n.x * n.x - n.y * n.y));
}

#endif
