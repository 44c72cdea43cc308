// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

/// @file
/// Directional albedos of the lobes of a slab: 64 columns, 96 rows of four 16-bit words (48 KiB), 65535 being 1. Values
/// lie at the ends of both ranges, so that column i stands at i / 63.
///
///     device.write_texture(table, std::as_bytes(interface_table()));   // Format::rgba16_unorm
///
/// Words 0 to 2 are what a GGX lobe with single scattering reflects of white light from everywhere. Rows: perceptual
/// roughness r, 0 to 1; alpha = r^2. Columns: sqrt(mu (1 + 3 alpha) / (mu + 3 alpha)), mu being the cosine to the
/// normal: however smooth the surface is, most happens where mu and alpha are alike. With b = min(sqrt(mu^2 + 10
/// alpha^2), 1):
///
/// word | content
/// 0    | what is missing of all of it, with F = 1: small where the surface is smooth, so that no digits are lost
/// 1    | 2 (mean of (1 - c)^5 over that light - (1 - b)^5) + 1/4: Schlick's Fresnel
/// 2    | 32 (mean of c (1 - c)^6 over that light - (1 - s) s^6) + 3/4, s^5 the mean in word 1: the dip at 82 degrees
/// 3    | 32 times the albedo of the retro-reflective term of Chan's diffuse model, without its amplitude
///
/// Word 3 has its own coordinates. Rows: the term's sharpness, 8.9 to 30.8; columns: sqrt(mu).
///
/// Read by materials/closures/tables.glsl. Written by materials/tables/write_tables.cpp.

namespace nacre::materials {

inline constexpr std::uint32_t interface_table_columns = 64;
inline constexpr std::uint32_t interface_table_rows = 96;

/// 4 * 64 * 96 words, row by row.
[[nodiscard]] std::span<const std::uint16_t> interface_table();

}  // namespace nacre::materials
