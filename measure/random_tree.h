// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "materials/tree.h"

namespace nacre::measure {

/// What random trees are made of.
struct RandomTreeDesc {
    std::uint32_t slabs = 4;
    std::uint32_t features = 0;  ///< Of which each slab has some.
    bool is_lossless = false;    ///< White albedo, no tint and no absorption anywhere; everything below is opaque.
};

/// A valid tree of any topology that the operators can make of so many slabs; the same for the same state of `random`
/// on all machines. Layers have a medium on top where `features` has one.
[[nodiscard]] materials::Tree random_tree(std::mt19937& random, const RandomTreeDesc& desc);

}  // namespace nacre::measure
