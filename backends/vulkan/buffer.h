// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/vulkan/memory.h"

namespace nacre::vulkan {

class Buffer final : public rhi::BackendBuffer {
  public:
    /// @param usage  what the buffer is used for beyond what `desc` says
    static Expected<std::unique_ptr<rhi::BackendBuffer>> create(Context& context, const rhi::BufferDesc& desc,
                                                                VkBufferUsageFlags usage = 0);
    ~Buffer() override;

    /// Where shaders and builds find it; of buffers with VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT.
    [[nodiscard]] VkDeviceAddress address() const;

    VkBuffer handle = VK_NULL_HANDLE;
    Memory memory;

  private:
    explicit Buffer(Context& context) : context_(context) {}
    Context& context_;
};

inline Buffer& native(rhi::BackendBuffer& buffer) { return static_cast<Buffer&>(buffer); }

}  // namespace nacre::vulkan
