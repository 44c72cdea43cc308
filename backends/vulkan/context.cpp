// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/context.h"

#include "backends/vulkan/memory.h"
#include "backends/vulkan/pipeline_cache.h"
#include "backends/vulkan/render_pass.h"

namespace nacre::vulkan {

Context::Context() = default;

Context::~Context() {
    if (!device) return;
    pipelines.reset();
    render_passes.reset();
    memory.reset();
    if (push_layout) vk.DestroyPipelineLayout(device, push_layout, nullptr);
    if (timeline) vk.DestroySemaphore(device, timeline, nullptr);
    if (vk.DestroyDevice) vk.DestroyDevice(device, nullptr);
}

void Context::set_name_of(std::uint64_t object, VkObjectType type, const std::string& name) const {
    VkDebugUtilsObjectNameInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT};
    info.objectType = type;
    info.objectHandle = object;
    info.pObjectName = name.c_str();
    vk.SetDebugUtilsObjectNameEXT(device, &info);
}

}  // namespace nacre::vulkan
