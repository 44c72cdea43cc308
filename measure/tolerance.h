// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

/// @file
/// What two backends may differ by before a comparison fails.
///
///     NACRE_TRY(Tolerance tolerance, parse_tolerance(R"({"final": {"psnr_db": 60}})", "strict.json"));
///
/// As JSON, with the keys of the comparison's results. What is not named keeps the default; shares are of texels:
///
///     {"fields_differing": 0.0005,
///      "final": {"psnr_db": 50, "flip_mean": 0.005, "share_above_1": 0.001, "max_abs_8bit": 255},
///      "textures": {"depth": {"max_abs": 1e-6, "max_rel": 1e-5, "differing": 0.01}}}

namespace nacre::measure {

/// Bounds on one texture; empty: not judged.
struct TextureTolerance {
    std::optional<double> fields_differing;  ///< Largest share of texels with a field off by more than one step.
    std::optional<double> differing;         ///< Largest share of texels that are not bit-equal.
    std::optional<double> max_abs;
    std::optional<double> max_rel;
};

struct Tolerance {
    double fields_differing = 0.0005;  ///< For every texture, unless `textures` says otherwise.
    double psnr_db = 50.0;             ///< Smallest.
    double flip_mean = 0.005;          ///< Largest, as all that follow.
    double share_above_1 = 0.001;
    std::optional<double> max_abs_8bit;
    std::map<std::string, TextureTolerance> textures;  ///< By texture name.
};

/// Errors name `source` and the member that is wrong: parse (not JSON, wrong types, unknown members, negative or
/// non-finite figures).
Expected<Tolerance> parse_tolerance(std::string_view json, std::string_view source);

}  // namespace nacre::measure
