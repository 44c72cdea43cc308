// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/error.h"
#include "measure/numerical_error.h"
#include "measure/texture_comparison.h"

/// @file
/// Compares pictures of stored closures (materials/storage.h) by what their words mean: words are streams of bits whose
/// fields lie elsewhere in each pixel.
///
///     NACRE_TRY(const ClosureDifference closures, compare_closures(words_a, words_b));
///     // closures.is_closure tells which pixels the fixed fields of material.0 and material.1 say nothing about.

namespace nacre::measure {

/// The G-buffer's material words of one device, each a texture of format r32_uint and of one size.
struct MaterialWords {
    TextureData material_0, material_1;
    std::vector<TextureData> slices;  ///< Subsurface data are in the last, where there are some.
};

struct ClosureDifference {
    TextureDifference difference;   ///< Named "material.slices"; one field for each kind of field that occurs.
    std::vector<bool> is_closure;   ///< For each pixel: both devices hold closures there.
};

/// Fields differ where their codes are more than one step apart; topologies where any place differs. Error:
/// invalid_argument (sizes differ).
Expected<ClosureDifference> compare_closures(const MaterialWords& reference, const MaterialWords& test);

/// What single precision does to stored closures: for each kind of field that holds numbers one NumericalError of
/// texture "material.slices", whose largest error has the name of the field ("f0.g"), the decoded values, and for
/// `stored` the word in which the field begins. Pixels whose topologies differ show another surface: they count as
/// flips of the first of the errors. Errors are in the field's unit, radians for normals and tangents, and of what goes
/// round the shorter way. Error: invalid_argument (sizes differ).
Expected<std::vector<NumericalError>> closure_errors(const MaterialWords& reference, const MaterialWords& test);

}  // namespace nacre::measure
