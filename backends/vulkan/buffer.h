// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/vulkan/memory.h"

namespace nacre::vulkan {

class Buffer final : public rhi::BackendBuffer {
  public:
    static Expected<std::unique_ptr<rhi::BackendBuffer>> create(Context& context, const rhi::BufferDesc& desc);
    ~Buffer() override;

    VkBuffer handle = VK_NULL_HANDLE;
    Memory memory;

  private:
    explicit Buffer(Context& context) : context_(context) {}
    Context& context_;
};

inline Buffer& native(rhi::BackendBuffer& buffer) { return static_cast<Buffer&>(buffer); }

}  // namespace nacre::vulkan
