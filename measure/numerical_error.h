// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "measure/texture_comparison.h"
#include "rhi/trace.h"

/// @file
/// How wrong single precision is: textures of a device in single precision against those of one in double precision,
/// and the line of GLSL at which the largest error begins.

namespace nacre::measure {

/// A number of a texture that was computed wrong.
struct WrongValue {
    std::uint32_t x = 0, y = 0, layer = 0, mip = 0;
    std::string name;        ///< Field of a packed word, or channel: "r".
    double reference = 0.0;  ///< In double precision.
    double value = 0.0;
    double stored = 0.0;  ///< What the shader stored: `value`, or of packed words the word as a signed integer.
    double error = 0.0;   ///< |value - reference| (radians for octahedral fields, turns for circular ones).
};

/// The error of all numbers of a texture. Identifiers and flags are no numbers and left out.
struct NumericalError {
    std::string texture;
    bool is_exact = false;  ///< The reference was read in doubles; otherwise its values were rounded by their format.
    std::uint64_t values = 0;  ///< Compared.
    /// Texels of depth textures that show another surface: the value is that of a neighboring texel of the reference,
    /// as where the edge of a triangle falls on the other side of a pixel. They are no errors of the value, and left
    /// out.
    std::uint64_t flips = 0;
    double largest_value = 0.0;  ///< Magnitude, of the reference.
    double rms = 0.0;
    double max_rel = 0.0;  ///< Largest |value - reference| / max(|value|, |reference|).
    WrongValue largest;    ///< By its absolute error; all zero where there is no error.
    /// The largest error as a part of the largest value: what textures are ranked by.
    [[nodiscard]] double share() const { return largest_value > 0.0 ? largest.error / largest_value : 0.0; }
};

/// Adds the texels of one mip and layer (`test.layers` is 1) to `sum`.
/// @param exact  four doubles for each texel of the reference, or empty: what its bits stand for
/// Errors: those of `compare_textures`.
Expected<void> add_numerical_error(const TextureData& reference, const TextureData& test, std::span<const double> exact,
                                   std::uint32_t layer, std::uint32_t mip, NumericalError& sum);

/// Adds one number to `sum`; what is finite in neither precision says nothing.
void add_wrong_value(NumericalError& sum, WrongValue value);

/// Where an error begins.
struct ErrorOrigin {
    std::string shader, line;             ///< "file:line"; empty where the module does not know it.
    std::string operation;                ///< "FSub", "ImageFetch", ...
    double reference = 0.0, value = 0.0;  ///< The instruction's result in double and in single precision.
    double growth = 0.0;                  ///< Relative error of the result less the largest of its operands.
    bool came_in = false;                 ///< The instruction reads a texture, a buffer or an input of the shader.
    std::string text;                     ///< One sentence for people.
};

/// Follows an error from what an invocation stored last back to what came in, from each result to the operand that
/// brings most of it (sums and differences take over absolute errors, all others relative ones), and gives the
/// instruction on this way at which the relative error grows most: from the largest of its operands to its result.
/// Nothing where both computed the same. Both traces are of one invocation of one shader.
/// @param stored  which of several stores of `test` is meant: that of the nearest number; default: the last
std::optional<ErrorOrigin> find_error_origin(const rhi::InvocationTrace& reference, const rhi::InvocationTrace& test,
                                             std::optional<double> stored = {});

}  // namespace nacre::measure
