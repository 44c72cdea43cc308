// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "measure/closure_points.h"

/// @file
/// The points of measure/closure_points.h by the names that the tests of closures use.

namespace nacre::materials::test {

using closures::Library;
using measure::direction;
using measure::integrate;
using measure::Random;
using measure::random_direction;
using measure::random_light;
using measure::random_slab;
using measure::roughnesses;
using measure::view_cosines;

}  // namespace nacre::materials::test
