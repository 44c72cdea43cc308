// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "rhi/format.h"

/// @file
/// The numbers behind the bytes of a texel, for every format that is not block-compressed. Internal to measure/.

namespace nacre::measure {

/// Decodes one texel (`info(format).block_bytes` bytes) as a shader would see it, srgb formats to linear; missing
/// channels are 0. Depth with stencil gives depth, stencil.
void decode_format(rhi::Format format, const std::byte* texel, double (&channels)[4]);

/// A half-precision float's value.
double decode_half(unsigned bits);

}  // namespace nacre::measure
