// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/error.h"
#include "rhi/device.h"

/// @file
/// Texels as a shader of the device sees them, in doubles: on devices in double precision (Capabilities::float_bits)
/// more than the bits that the texture's format holds.

namespace nacre::passes {

/// Four doubles for each texel of one mip and layer, top row first. The texture was made with TextureUsage::sampled and
/// has channels of floats or fixed-point numbers. Waits for the device. Errors: unsupported (no float64 in shaders),
/// and those of making the pass.
Expected<std::vector<double>> read_exactly(rhi::Device& device, rhi::Texture texture, std::uint32_t mip,
                                           std::uint32_t layer);

}  // namespace nacre::passes
