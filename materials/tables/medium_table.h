// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

/// @file
/// What a plane layer of an isotropically scattering medium does with light, by angle, optical depth and albedo: 16
/// columns, 41 rows, 24 slices of two 16-bit words (62 KiB), 65535 being 1. Values lie at the ends of all ranges.
/// Columns: square root of the cosine inside the medium, 0 to 1; rows: log2 of the optical depth, -8 to 12; slices:
/// fourth root of 1 - the albedo of a single scattering, 0 to 1.
///
/// word | content, of the light that is scattered or absorbed at least once
/// 0    | share of what comes out at all that comes out of the far side
/// 1    | 1 - the share that comes out over the albedo of a single scattering
///
/// Both change slowly, and word 1 is 0 where nothing is absorbed: energy is kept whatever lies between the entries.
/// Both are what is small where digits matter: what comes through a deep medium, and what a bright one absorbs. Read by
/// materials/closures/medium.glsl. Written by materials/tables/write_tables.cpp.

namespace nacre::materials {

inline constexpr std::uint32_t medium_table_columns = 16;
inline constexpr std::uint32_t medium_table_rows = 41;
inline constexpr std::uint32_t medium_table_slices = 24;

/// 2 * 16 * 41 * 24 words, row by row, slice by slice.
[[nodiscard]] std::span<const std::uint16_t> medium_table();

}  // namespace nacre::materials
