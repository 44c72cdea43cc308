// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/elliptical_weights.h"

#include <array>
#include <cmath>

namespace nacre::cpu {

const float* elliptical_weights() {
    static const std::array<float, elliptical_weight_count> weights = [] {
        std::array<float, elliptical_weight_count> made{};
        for (int i = 0; i < elliptical_weight_count; ++i)
            made[static_cast<std::size_t>(i)] =
                static_cast<float>(std::exp(-2.0 * i / (elliptical_weight_count - 1)));
        return made;
    }();
    return weights.data();
}

}  // namespace nacre::cpu
