// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "backends/vulkan/commands.h"
#include "backends/vulkan/result.h"

namespace nacre::vulkan {

bool Commands::prepare_query(QueryPool& pool, std::uint32_t index) {
    const bool is_second = pool.written_in[index] == part_;
    pool.written_in[index] = part_;
    part_has_queries_ = true;
    if (!in_pass_) {
        vk_.CmdResetQueryPool(commands_, pool.handle, index, 1);
        return true;
    }
    if (!is_second) {
        resets_.emplace_back(&pool, index);
        return true;
    }
    if (context_.report)
        context_.report(
            {.severity = rhi::MessageSeverity::error,
             .source = rhi::MessageSource::driver,
             .code = "query-written-twice",
             .text = fmt::format("query {} of query pool {} is written twice in one render pass; Vulkan cannot "
                                 "reset it there. The second one is left out: use another query.",
                                 index, in_quotes(pool.desc.name))});
    return false;
}

void Commands::write_timestamp(const rhi::WriteTimestampCommand& command) {
    QueryPool& pool = native(*command.pool.object);
    if (prepare_query(pool, command.index))
        vk_.CmdWriteTimestamp(commands_, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool.handle, command.index);
}

void Commands::begin_occlusion(const rhi::BeginOcclusionQueryCommand& command) {
    QueryPool& pool = native(*command.pool.object);
    occlusion_is_open_ = prepare_query(pool, command.index);
    if (occlusion_is_open_)
        vk_.CmdBeginQuery(commands_, pool.handle, command.index,
                          context_.capabilities.precise_occlusion ? VK_QUERY_CONTROL_PRECISE_BIT : 0);
}

void Commands::end_occlusion(const rhi::EndOcclusionQueryCommand& command) {
    if (occlusion_is_open_) vk_.CmdEndQuery(commands_, native(*command.pool.object).handle, command.index);
    occlusion_is_open_ = false;
}

Expected<void> Commands::record_resets(VkCommandBuffer commands) const {
    for (const auto& [pool, index] : resets_) vk_.CmdResetQueryPool(commands, pool->handle, index, 1);
    if (VkResult result = vk_.EndCommandBuffer(commands); result != VK_SUCCESS)
        return fail(context_.check(result), "end", "command buffer");
    return {};
}

}  // namespace nacre::vulkan
