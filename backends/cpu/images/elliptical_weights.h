// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace nacre::cpu {

inline constexpr int elliptical_weight_count = 1024;

/// Weights of the texels of an anisotropic footprint by their squared distance from its center, 1 at the rim, in
/// `elliptical_weight_count` equal steps: the Gaussian exp(-2 r^2). Source: Heckbert, "Fundamentals of Texture Mapping
/// and Image Warping", 1989, section 3.5.3. Thread-safe.
const float* elliptical_weights();

}  // namespace nacre::cpu
