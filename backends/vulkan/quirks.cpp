// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/quirks.h"

#include <algorithm>

namespace nacre::vulkan {
namespace {

constexpr QuirkEntry list[] = {
    {VK_DRIVER_ID_MESA_LLVMPIPE, 0, ~0u, Quirk::no_pipeline_cache,
     "its VkPipelineCache holds nothing (Mesa 22.3 and 25.0 return a bare header): Mesa keeps its own cache of "
     "compiled "
     "code on disk, so ours would be files without content"},
};

}  // namespace

std::span<const QuirkEntry> quirks() { return list; }

bool has_quirk(VkDriverId driver, std::uint32_t driver_version, Quirk quirk) {
    return std::ranges::any_of(list, [&](const QuirkEntry& entry) {
        return entry.driver == driver && entry.quirk == quirk && driver_version >= entry.first_version &&
               driver_version <= entry.last_version;
    });
}

}  // namespace nacre::vulkan
