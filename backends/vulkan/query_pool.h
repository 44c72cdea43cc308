// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "backends/vulkan/context.h"

namespace nacre::vulkan {

class QueryPool final : public rhi::BackendQueryPool {
  public:
    static Expected<std::unique_ptr<rhi::BackendQueryPool>> create(Context& context, const rhi::QueryPoolDesc& desc);
    ~QueryPool() override;

    /// Results in nanoseconds or samples. Errors: invalid_argument for a query that was never written.
    Expected<std::vector<std::uint64_t>> read(std::uint32_t first, std::uint32_t count);

    VkQueryPool handle = VK_NULL_HANDLE;
    /// For each query, the part of a submission (`Commands`) that wrote it last.
    std::vector<std::uint64_t> written_in;

  private:
    explicit QueryPool(Context& context) : context_(context) {}
    Context& context_;
};

inline QueryPool& native(rhi::BackendQueryPool& pool) { return static_cast<QueryPool&>(pool); }

}  // namespace nacre::vulkan
