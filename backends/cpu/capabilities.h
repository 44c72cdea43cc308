// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "rhi/capabilities.h"

namespace nacre::cpu {

/// Most workgroups of a dispatch along each axis: all together are counted in 63 bits.
inline constexpr std::array<std::uint32_t, 3> most_workgroups{(1u << 31) - 1, 65535, 65535};

/// What devices of this backend can do.
/// @param subgroup_size  invocations of a subgroup
rhi::Capabilities find_capabilities(std::uint32_t subgroup_size);

}  // namespace nacre::cpu
