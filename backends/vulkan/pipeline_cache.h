// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/vulkan/context.h"
#include "core/disk_cache.h"

namespace nacre::vulkan {

/// The driver's compiled pipelines, kept on disk between runs. What comes from the disk reaches the driver only after
/// the checksum of the disk cache and the header that Vulkan prescribes were found right: drivers trust this data.
class PipelineCache {
  public:
    /// Reads what is there for this device and driver version. Never fails: without a file the cache starts empty.
    PipelineCache(Context& context, const std::filesystem::path& folder);
    ~PipelineCache();
    PipelineCache(const PipelineCache&) = delete;
    PipelineCache& operator=(const PipelineCache&) = delete;

    /// VK_NULL_HANDLE where the driver refused to make one.
    [[nodiscard]] VkPipelineCache handle() const { return handle_; }
    /// Writes the cache, joined with what other devices have written in the meantime; does nothing where nothing is
    /// new.
    Expected<void> save();

    /// Category of the entry in the disk cache.
    static constexpr std::string_view category = "vulkan-pipelines";
    /// Key of the entry for a device: names driver, version and the driver's own cache identity.
    static std::string key_of(const PhysicalDevice& device);
    /// Whether `data` begins with the header that Vulkan prescribes, made for this very device and driver.
    static bool is_usable(const PhysicalDevice& device, std::span<const std::byte> data);

  private:
    [[nodiscard]] VkPipelineCache make(std::span<const std::byte> data) const;

    Context& context_;
    DiskCache disk_;
    std::string key_;
    VkPipelineCache handle_ = VK_NULL_HANDLE;
    Hash128 stored_{};  ///< Of the content that is on disk as far as we know.
};

}  // namespace nacre::vulkan
