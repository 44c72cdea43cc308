// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/pipeline_cache.h"

#include <fmt/format.h>

#include <cstring>

#include "backends/vulkan/result.h"
#include "core/log.h"

namespace nacre::vulkan {

std::string PipelineCache::key_of(const PhysicalDevice& device) {
    const VkPhysicalDeviceProperties& facts = device.properties;
    std::string key = fmt::format("1 {:x} {:x} {:x} {} ", facts.vendorID, facts.deviceID, facts.driverVersion,
                                  device.vulkan12.driverInfo);
    for (const std::uint8_t byte : facts.pipelineCacheUUID) key += fmt::format("{:02x}", byte);
    return key;
}

bool PipelineCache::is_usable(const PhysicalDevice& device, std::span<const std::byte> data) {
    VkPipelineCacheHeaderVersionOne header{};
    if (data.size() < sizeof(header)) return false;
    std::memcpy(&header, data.data(), sizeof(header));
    return header.headerSize >= sizeof(header) && header.headerSize <= data.size() &&
           header.headerVersion == VK_PIPELINE_CACHE_HEADER_VERSION_ONE &&
           header.vendorID == device.properties.vendorID && header.deviceID == device.properties.deviceID &&
           std::memcmp(header.pipelineCacheUUID, device.properties.pipelineCacheUUID, VK_UUID_SIZE) == 0;
}

PipelineCache::PipelineCache(Context& context, const std::filesystem::path& folder)
    : context_(context), disk_(folder.empty() ? DiskCache() : DiskCache(folder)), key_(key_of(*context.physical)) {
    auto stored = disk_.load(category, key_);
    if (stored && !is_usable(*context.physical, *stored)) {
        log_message(LogLevel::info, "the Vulkan pipeline cache on disk is not of this driver; starting a new one");
        stored.reset();
    }
    if (stored) stored_ = hash128(*stored);
    handle_ = make(stored ? std::span<const std::byte>(*stored) : std::span<const std::byte>());
    if (!handle_ && stored) handle_ = make({});
}

PipelineCache::~PipelineCache() {
    if (handle_) context_.vk.DestroyPipelineCache(context_.device, handle_, nullptr);
}

VkPipelineCache PipelineCache::make(std::span<const std::byte> data) const {
    VkPipelineCacheCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO};
    info.initialDataSize = data.size();
    info.pInitialData = data.data();
    VkPipelineCache cache = VK_NULL_HANDLE;
    return context_.vk.CreatePipelineCache(context_.device, &info, nullptr, &cache) == VK_SUCCESS ? cache
                                                                                                  : VK_NULL_HANDLE;
}

Expected<void> PipelineCache::save() {
    if (!handle_ || !disk_.is_on() || context_.is_lost) return {};
    // Another device may have saved since: keep its pipelines too.
    if (const auto theirs = disk_.load(category, key_);
        theirs && hash128(*theirs) != stored_ && is_usable(*context_.physical, *theirs)) {
        if (VkPipelineCache other = make(*theirs)) {
            context_.vk.MergePipelineCaches(context_.device, handle_, 1, &other);
            context_.vk.DestroyPipelineCache(context_.device, other, nullptr);
        }
    }
    std::size_t size = 0;
    VkResult result = context_.vk.GetPipelineCacheData(context_.device, handle_, &size, nullptr);
    std::vector<std::byte> data(size);
    if (result == VK_SUCCESS) result = context_.vk.GetPipelineCacheData(context_.device, handle_, &size, data.data());
    if (result != VK_SUCCESS) return fail(context_.check(result), "save", "pipeline cache");
    data.resize(size);
    const Hash128 hash = hash128(data);
    if (hash == stored_) return {};
    if (disk_.store(category, key_, data)) stored_ = hash;
    return {};
}

}  // namespace nacre::vulkan
