// SPDX-License-Identifier: Apache-2.0
#include "rhi/acceleration_structure.h"

#include <cmath>

namespace nacre::rhi {

std::optional<std::array<float, 12>> inverse_of(const std::array<float, 12>& transform) {
    const auto m = [&](int row, int column) {
        return static_cast<double>(transform[static_cast<std::size_t>(row * 4 + column)]);
    };
    double cofactors[3][3];
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) {
            const int r1 = (row + 1) % 3, r2 = (row + 2) % 3, c1 = (column + 1) % 3, c2 = (column + 2) % 3;
            cofactors[row][column] = m(r1, c1) * m(r2, c2) - m(r1, c2) * m(r2, c1);
        }
    const double determinant = m(0, 0) * cofactors[0][0] + m(0, 1) * cofactors[0][1] + m(0, 2) * cofactors[0][2];
    if (!std::isfinite(determinant) || determinant == 0.0) return {};
    std::array<float, 12> inverse;
    for (int row = 0; row < 3; ++row) {
        double offset = 0;
        for (int column = 0; column < 3; ++column) {
            const double element = cofactors[column][row] / determinant;
            if (!(std::abs(element) <= largest_inverse_element)) return {};
            inverse[static_cast<std::size_t>(row * 4 + column)] = static_cast<float>(element);
            offset -= element * m(column, 3);
        }
        if (!(std::abs(offset) <= largest_inverse_offset)) return {};
        inverse[static_cast<std::size_t>(row * 4 + 3)] = static_cast<float>(offset);
    }
    return inverse;
}

}  // namespace nacre::rhi
