// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "measure/random_tree.h"

/// @file
/// The trees of measure/random_tree.h by the names that the tests of materials use.

namespace nacre::materials {

using measure::random_tree;
using measure::RandomTreeDesc;

}  // namespace nacre::materials
