// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rhi/pipeline.h"

namespace nacre::cpu {

/// Makes a valid module simpler without changing what it does: specialization constants get their values, variables that need
/// no memory become values, dead code goes. Thread-safe.
/// @param keeps_variables  variables stay what they are, so that it can be told whether they were written
Expected<std::vector<std::uint32_t>> legalize(std::span<const std::uint32_t> words,
                                              std::span<const rhi::SpecializationConstant> specialization, std::string_view name,
                                              bool keeps_variables = false);

}  // namespace nacre::cpu
