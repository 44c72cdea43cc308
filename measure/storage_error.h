// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "measure/report_page.h"

/// @file
/// What the G-buffer's bits do to numbers: the error of a round trip of each stored field by how many bits it has, as
/// measured and as its codec promises.
///
///     for (const StorageErrorCurve& curve : storage_error_curves(10000))
///         fmt::print("{}: {} in {} bits\n", curve.field, curve.stored().largest, curve.stored_bits);
///
/// Fields are those of materials/storage.h (closures), of its word of subsurface data and of passes/gbuffer_layout.h
/// (plain slabs). Numbers are computed in double precision, so that the bits alone make the error.

namespace nacre::measure {

/// How the error of a field is measured.
enum class StorageErrorKind : std::uint8_t {
    absolute,  ///< |back - value|, in the field's unit.
    relative,  ///< |back - value| / value: fields that are stored as logarithms.
    angle,     ///< Radians, of directions and tangents.
};

/// "absolute", "relative", "angle".
std::string_view name_of(StorageErrorKind kind);

struct StorageErrorPoint {
    std::uint32_t bits = 0;  ///< Of colors, for each channel; of directions, of both coordinates together.
    double largest = 0.0, rms = 0.0;
    double bound = 0.0;  ///< What the codec promises for so many bits: derived, not measured.
    /// Largest error of the mean over the 64 places of the dither, in steps of what is stored (square roots of colors,
    /// logarithms); 0 for fields that are not dithered.
    double dithered_mean = 0.0;
    double dithered_bound = 0.0;
};

struct StorageErrorCurve {
    std::string field;  ///< "fuzz color, red and green"
    std::string where;  ///< "closure", "subsurface", or a texture of the plain slab: "material.0".
    StorageErrorKind kind = StorageErrorKind::absolute;
    std::uint32_t stored_bits = 0;          ///< That it has in the G-buffer.
    std::vector<StorageErrorPoint> points;  ///< From the fewest bits on; `stored_bits` is among them.

    [[nodiscard]] const StorageErrorPoint& stored() const;
};

/// @param samples  random numbers for each point, the ends of the range among them. The same in every run.
[[nodiscard]] std::vector<StorageErrorCurve> storage_error_curves(std::uint32_t samples);

/// JSON: "curves", each with "field", "where", "kind", "stored_bits" and "points".
[[nodiscard]] std::string to_json(const std::vector<StorageErrorCurve>& curves);

/// A table of the stored bits, and the curves drawn for each kind of error.
[[nodiscard]] ReportPage storage_error_page(const std::vector<StorageErrorCurve>& curves);

}  // namespace nacre::measure
