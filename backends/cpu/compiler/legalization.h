// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rhi/pipeline.h"

namespace nacre::cpu {

struct LegalizationOptions {
    bool keeps_variables = false;  ///< Variables stay what they are, so that it can be told whether they were written.
    bool inlines_all = false;      ///< No function stays one, however large the module grows.
};

/// Makes a valid module simpler without changing what it does: specialization constants get their values, variables
/// that need no memory become values, dead code goes, calls are replaced by what they call as long as the module does
/// not grow too large (functions that stay have FunctionControl::DontInline). Errors: unsupported where nothing helps
/// against its size. Thread-safe.
Expected<std::vector<std::uint32_t>> legalize(std::span<const std::uint32_t> words,
                                              std::span<const rhi::SpecializationConstant> specialization,
                                              std::string_view name, const LegalizationOptions& options = {});

}  // namespace nacre::cpu
