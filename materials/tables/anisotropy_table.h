// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

/// @file
/// Directional albedo of stretched GGX lobes: 18 x 15 x 15 x 4 entries of two 16-bit words (63 KiB), 65535 being 1.
/// Values lie at the ends of all ranges. Let p be the alpha of the lobe's slopes in the plane of view and normal, o the
/// alpha of those across it, r their correlation: the view's azimuth against the lobe's axes is in these three, and no
/// function of them has to turn sharply where one axis is much smoother than the other. From the fastest axis on:
///
/// axis | coordinate, 0 to 1
/// 0    | 0.8 x^(5/8) + 0.2 mu, mu the cosine to the normal, x = sqrt(mu (1 + 3 p) / (mu + 3 p))
/// 1    | (p^0.45 - a) / (1 - a), a = 10^-1.8: p is at least 10^-4
/// 2    | 1/2 log(1 + 0.7 o / p) / log(1 + 0.7 / p) + 1/2 (sqrt(1 + 4 o^2) - 1) / (sqrt(5) - 1)
/// 3    | r^2 (1 + 0.85 r) / 1.85; a cubic goes through the four entries
///
/// word | content
/// 0    | 2 (1.2 - (what is reflected with F = 1) / E)
/// 1    | 4/5 (1 - (mean of (1 - c)^5 over the reflected light)^(1/5)) / s
///
/// E and s stand for the fits of these that materials/closures/tables.glsl makes of the round lobe of alpha p. Entries
/// are moved by a part of their second differences, so that what lies between them is off to both sides.
///
/// Read by materials/closures/tables.glsl. Written by materials/tables/write_tables.cpp.

namespace nacre::materials {

inline constexpr std::uint32_t anisotropy_table_size[4] = {18, 15, 15, 4};

/// 2 * 18 * 15 * 15 * 4 words.
[[nodiscard]] std::span<const std::uint16_t> anisotropy_table();

}  // namespace nacre::materials
