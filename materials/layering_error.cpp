// SPDX-License-Identifier: Apache-2.0
#include "materials/layering_error.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "materials/evaluation.h"

namespace nacre::materials {

LayeringError layering_error(const FlattenedTree& tree, const RandomWalk& walk, std::uint32_t paths) {
    LayeringError error;
    for (std::size_t i = 0; i < LayeringError::cosines.size(); ++i) {
        const double cosine = LayeringError::cosines[i];
        const glm::dvec3 view(std::sqrt(1.0 - cosine * cosine), 0.0, cosine);
        error.closures[i] = directional_albedo(shade(tree, view));
        error.walk[i] = walk.albedo(view, paths, i + 1);
        const glm::dvec3 difference = glm::abs(error.closures[i] - error.walk[i].reflected);
        for (int channel = 0; channel < 3; ++channel) {
            error.mean += difference[channel] / (3.0 * LayeringError::cosines.size());
            error.uncertainty = std::max(error.uncertainty, error.walk[i].uncertainty[channel]);
            if (difference[channel] <= error.largest) continue;
            error.largest = difference[channel];
            error.largest_at = cosine;
        }
    }
    return error;
}

}  // namespace nacre::materials
