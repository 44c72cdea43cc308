// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

/// @file
/// Directional albedo of stretched GGX lobes: 12 x 10 x 12 x 11 entries of two 16-bit words (62 KiB), 65535 being 1.
/// Values lie at the ends of all ranges. Let A be the larger of the two alphas, q the smaller one over it, phi the
/// azimuth of the view from the axis of A, p = sqrt(A^2 cos^2 phi + (q A)^2 sin^2 phi) the alpha that the view sees.
/// From the fastest axis on:
///
/// axis | coordinate, 0 to 1
/// 0    | sqrt(mu (1 + 3 p) / (mu + 3 p)), mu the cosine to the normal
/// 1    | azimuth of the direction (cos phi, q^(1/4) sin phi), over a right angle
/// 2    | q^(1/3), from its least (of a smaller alpha of 1e-4) to 1
/// 3    | sqrt(A)
///
/// word | content
/// 0    | what is missing of all light with F = 1, as in materials/tables/interface_table.h
/// 1    | 2 (mean of (1 - c)^5 over the reflected light - the same by interface_table() for alpha = p) + 1/4
///
/// Read by materials/closures/tables.glsl. Written by materials/tables/write_tables.cpp.

namespace nacre::materials {

inline constexpr std::uint32_t anisotropy_table_size[4] = {12, 10, 12, 11};

/// 2 * 12 * 10 * 12 * 11 words.
[[nodiscard]] std::span<const std::uint16_t> anisotropy_table();

}  // namespace nacre::materials
