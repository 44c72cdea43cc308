// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/query_pool.h"

#include <fmt/format.h>

#include <cmath>

#include "backends/vulkan/result.h"

namespace nacre::vulkan {

Expected<std::unique_ptr<rhi::BackendQueryPool>> QueryPool::create(Context& context, const rhi::QueryPoolDesc& desc) {
    std::unique_ptr<QueryPool> pool(new QueryPool(context));
    pool->desc = desc;
    pool->written_in.resize(desc.count);
    VkQueryPoolCreateInfo info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
    info.queryType = desc.type == rhi::QueryType::timestamp ? VK_QUERY_TYPE_TIMESTAMP : VK_QUERY_TYPE_OCCLUSION;
    info.queryCount = desc.count;
    if (VkResult result = context.vk.CreateQueryPool(context.device, &info, nullptr, &pool->handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", "query pool " + in_quotes(desc.name));
    // A query that was never reset may not even be asked whether it has a result.
    context.vk.ResetQueryPool(context.device, pool->handle, 0, desc.count);
    context.set_name(pool->handle, VK_OBJECT_TYPE_QUERY_POOL, desc.name);
    return pool;
}

QueryPool::~QueryPool() {
    if (handle) context_.vk.DestroyQueryPool(context_.device, handle, nullptr);
}

Expected<std::vector<std::uint64_t>> QueryPool::read(std::uint32_t first, std::uint32_t count) {
    struct Raw {
        std::uint64_t value, available;
    };
    std::vector<Raw> raw(count);
    const VkResult result = context_.check(
        context_.vk.GetQueryPoolResults(context_.device, handle, first, count, raw.size() * sizeof(Raw), raw.data(),
                                        sizeof(Raw), VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT));
    if (result != VK_SUCCESS && result != VK_NOT_READY)
        return fail(result, "read queries of", "query pool " + in_quotes(desc.name));
    const std::uint32_t bits = context_.physical->timestamp_valid_bits;
    const std::uint64_t mask = bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
    const double period = context_.physical->properties.limits.timestampPeriod;
    std::vector<std::uint64_t> values(count);
    for (std::uint32_t i = 0; i < count; ++i) {
        if (!raw[i].available)
            return nacre::fail(ErrorCode::invalid_argument, "read queries of", "query pool " + in_quotes(desc.name),
                               fmt::format("query {} was never written", first + i),
                               "Read only queries that submitted work has written.");
        values[i] = raw[i].value;
        if (desc.type != rhi::QueryType::timestamp) continue;
        values[i] &= mask;
        // Exact for a period of 1; a double would lose nanoseconds after 104 days of running.
        if (period != 1.0)
            values[i] =
                static_cast<std::uint64_t>(static_cast<long double>(values[i]) * static_cast<long double>(period));
    }
    return values;
}

}  // namespace nacre::vulkan
