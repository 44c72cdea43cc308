// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "backends/cpu/rays/ray_scene.h"
#include "rhi/backend.h"

namespace nacre::cpu {

/// One of the two levels; built on the queue's thread.
class CpuAccelerationStructure : public rhi::BackendAccelerationStructure {
  public:
    static Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> create(
        const std::shared_ptr<RayDevice>& device, const rhi::AccelerationStructureDesc& desc);
    /// Throws std::bad_alloc.
    void build(const rhi::BuildAccelerationStructureCommand& command);
    /// What shaders see; null for a bottom level.
    [[nodiscard]] RayScene* scene() const { return scene_.get(); }

  private:
    /// Shared with the top levels that were built over it.
    std::shared_ptr<RayMesh> mesh_;
    std::unique_ptr<RayScene> scene_;
};

}  // namespace nacre::cpu
