// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_FILMIC
#define NACRE_FILMIC

// An S-shaped curve in the manner of ACES, for each channel: x (a x + b) / (x^2 + d x + e). The constants are the solution
// for three points and a limit: 0.02 becomes 0.012 (toe), 0.18 stays 0.18 (middle gray), 1 becomes 0.74, infinity 1.02, so
// that white is reached about 3.7 stops above middle white. Its slope at middle gray is 1.22 on logarithmic axes.
// tests/passes/tonemap_test.cpp solves for them again.
vec3 filmic(vec3 x) {
    x = clamp(x, vec3(0.0), vec3(1e4));
    return x * (1.02 * x + 0.09966) / (x * (x + 0.31975) + 0.19331);
}

#endif
