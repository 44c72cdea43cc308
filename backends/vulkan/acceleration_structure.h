// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "backends/vulkan/buffer.h"

namespace nacre::vulkan {

class AccelerationStructure final : public rhi::BackendAccelerationStructure {
  public:
    /// Errors: out_of_memory.
    static Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> create(
        Context& context, const rhi::AccelerationStructureDesc& desc);
    ~AccelerationStructure() override;

    /// Records a build or an update. What it needs until the device has finished with it is added to `kept`.
    /// Errors: out_of_memory.
    Expected<void> record_build(VkCommandBuffer commands, const rhi::BuildAccelerationStructureCommand& command,
                                std::vector<std::unique_ptr<rhi::BackendBuffer>>& kept);

    VkAccelerationStructureKHR handle = VK_NULL_HANDLE;

  private:
    /// What a build is given: geometry without its data, and how much of it there is at most.
    struct Shape {
        std::vector<VkAccelerationStructureGeometryKHR> geometries;
        std::vector<std::uint32_t> counts;
        VkAccelerationStructureBuildGeometryInfoKHR info{
            VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
    };

    explicit AccelerationStructure(Context& context) : context_(context) {}
    void describe(const rhi::AccelerationStructureDesc& structure, Shape& shape) const;
    Expected<Buffer*> keep_buffer(const char* purpose, std::uint64_t bytes, rhi::MemoryKind kind,
                                  VkBufferUsageFlags usage,
                                  std::vector<std::unique_ptr<rhi::BackendBuffer>>& kept) const;
    Expected<VkDeviceAddress> write_instances(const rhi::BuildAccelerationStructureCommand& command,
                                              std::vector<std::unique_ptr<rhi::BackendBuffer>>& kept) const;

    Context& context_;
    std::unique_ptr<rhi::BackendBuffer> storage_;
    VkDeviceAddress address_ = 0;
    std::uint64_t build_scratch_bytes_ = 0, update_scratch_bytes_ = 0;
};

inline AccelerationStructure& native(rhi::BackendAccelerationStructure& structure) {
    return static_cast<AccelerationStructure&>(structure);
}

}  // namespace nacre::vulkan
