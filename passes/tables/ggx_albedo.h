// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

/// @file
/// Directional albedo of a GGX interface, 64 x 64 entries of two half floats (16 KiB): what a surface of F0 = F90 = 1
/// reflects is first + second, of any other F0 * first + F90 * second (Schlick's Fresnel). Columns: square root
/// of the cosine to the normal, 0 to 1 (grazing directions change fastest); rows: perceptual roughness, 0 to 1; values lie at the ends of both ranges.
///
///     device.write_texture(table, std::as_bytes(ggx_albedo_table()));   // Format::rg16_float
///
/// Written by passes/tables/write_ggx_albedo.cpp; tests/passes/tables_test.cpp computes it again.

namespace nacre::passes {

inline constexpr std::uint32_t ggx_albedo_size = 64;

/// 2 * 64 * 64 half floats, row by row.
std::span<const std::uint16_t> ggx_albedo_table();

}  // namespace nacre::passes
