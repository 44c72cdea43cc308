// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace nacre::cpu {

/// A million floats: every exponent and sign, edges and their neighbors, denormals, infinities, NaN with several
/// payloads, and denser where functions are steep or turn (up to 100, around 1, around multiples of pi / 2). A multiple
/// of 16 of them.
const std::vector<float>& many_floats();

/// Some hundred floats among which are all edges; for functions of two or three arguments. A multiple of 16.
const std::vector<float>& few_floats();

/// Deterministic noise.
std::uint64_t noise(std::uint64_t index);

/// Distance of a result from what it should be, in units of the last place of single precision at the latter (denormal
/// spacing at least). Equal infinities and two NaN are 0 apart; anything else that is not finite is infinitely far. A
/// result beyond the largest float counts as infinity if it rounds to that.
double ulp_error(float result, double expected);

/// Whether all tests run over every float there is (NACRE_TEST_ALL_FLOATS=1 in the environment): minutes for each
/// function.
bool test_all_floats();

}  // namespace nacre::cpu
