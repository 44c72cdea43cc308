// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "rhi/backend.h"

namespace nacre::cpu {

/// Results as they are written by the queue; they are read when the work that writes them is complete.
class CpuQueryPool : public rhi::BackendQueryPool {
  public:
    explicit CpuQueryPool(const rhi::QueryPoolDesc& pool_desc) : values(pool_desc.count) { desc = pool_desc; }
    std::vector<std::uint64_t> values;  ///< Nanoseconds of the steady clock, or samples.
};

}  // namespace nacre::cpu
