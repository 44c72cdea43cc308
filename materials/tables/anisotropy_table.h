// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

/// @file
/// Directional albedo of stretched GGX lobes: 20 x 18 x 15 x 3 entries of two 16-bit words (63 KiB), 65535 being 1.
/// Values lie at the ends of all ranges. Let p be the alpha of the lobe's slopes in the plane of view and normal, o the
/// alpha of those across it, r their correlation: the view's azimuth against the lobe's axes is in these three, and no
/// function of them has to turn sharply where one axis is much smoother than the other. From the fastest axis on:
///
/// axis | coordinate, 0 to 1
/// 0    | 0.85 x^(3/4) + 0.15 mu, mu the cosine to the normal, x = sqrt(mu (1 + 3 p) / (mu + 3 p))
/// 1    | p^(5/8)
/// 2    | (sqrt(1 + 4 o^2) - 1) / (sqrt(5) - 1)
/// 3    | r^2 (1 + r) / 2; a parabola goes through the three entries
///
/// Let E and s be what the round lobe of alpha p reflects, and its mean of (1 - c)^5 over the reflected light.
///
/// word | content
/// 0    | (1 - (what is reflected with F = 1) / E + 3/4) 4/5
/// 1    | 2/3 (1 - (mean of (1 - c)^5)^(1/5)) / (1 - s^(1/5)) over the fit of it in materials/closures/tables.glsl
///
/// Read by materials/closures/tables.glsl. Written by materials/tables/write_tables.cpp.

namespace nacre::materials {

inline constexpr std::uint32_t anisotropy_table_size[4] = {20, 18, 15, 3};

/// 2 * 20 * 18 * 15 * 3 words.
[[nodiscard]] std::span<const std::uint16_t> anisotropy_table();

}  // namespace nacre::materials
