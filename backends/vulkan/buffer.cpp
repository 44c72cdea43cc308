// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/buffer.h"

#include "backends/vulkan/result.h"

namespace nacre::vulkan {

Expected<std::unique_ptr<rhi::BackendBuffer>> Buffer::create(Context& context, const rhi::BufferDesc& desc,
                                                             VkBufferUsageFlags usage) {
    std::unique_ptr<Buffer> buffer(new Buffer(context));
    buffer->desc = desc;
    VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    info.size = desc.size;
    // Copies cost nothing to allow, and the front end uses them for its own uploads, read-backs and fills.
    info.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT | usage;
    if (has_any(desc.usage, rhi::BufferUsage::vertex)) info.usage |= VK_BUFFER_USAGE_VERTEX_BUFFER_BIT;
    if (has_any(desc.usage, rhi::BufferUsage::index)) info.usage |= VK_BUFFER_USAGE_INDEX_BUFFER_BIT;
    if (has_any(desc.usage, rhi::BufferUsage::uniform)) info.usage |= VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT;
    if (has_any(desc.usage, rhi::BufferUsage::storage)) info.usage |= VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    if (has_any(desc.usage, rhi::BufferUsage::uniform_texel)) info.usage |= VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT;
    if (has_any(desc.usage, rhi::BufferUsage::storage_texel)) info.usage |= VK_BUFFER_USAGE_STORAGE_TEXEL_BUFFER_BIT;
    if (has_any(desc.usage, rhi::BufferUsage::indirect)) info.usage |= VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
    if (has_any(desc.usage, rhi::BufferUsage::acceleration_structure_input))
        info.usage |= VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                      VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    const std::string subject = "buffer " + in_quotes(desc.name);
    // Before the driver: some drivers overflow on sizes near the end of the 64-bit range.
    if (desc.size > context.capabilities.max_buffer_size)
        return nacre::fail(ErrorCode::out_of_memory, "create", subject,
                           std::to_string(desc.size) + " bytes exceed the largest buffer of this device, " +
                               std::to_string(context.capabilities.max_buffer_size) + " bytes (heap of " +
                               std::to_string(context.capabilities.device_memory_bytes) + " bytes)",
                           "Use several smaller buffers.");
    if (VkResult result = context.vk.CreateBuffer(context.device, &info, nullptr, &buffer->handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", subject);

    VkMemoryDedicatedRequirements dedicated{VK_STRUCTURE_TYPE_MEMORY_DEDICATED_REQUIREMENTS};
    VkMemoryRequirements2 requirements{VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2, &dedicated};
    VkBufferMemoryRequirementsInfo2 which{VK_STRUCTURE_TYPE_BUFFER_MEMORY_REQUIREMENTS_INFO_2};
    which.buffer = buffer->handle;
    context.vk.GetBufferMemoryRequirements2(context.device, &which, &requirements);
    NACRE_TRY(buffer->memory,
              context.memory->allocate({.requirements = requirements.memoryRequirements,
                                        .kind = desc.memory,
                                        .prefers_dedicated = dedicated.prefersDedicatedAllocation != VK_FALSE ||
                                                             dedicated.requiresDedicatedAllocation != VK_FALSE,
                                        .dedicated_buffer = buffer->handle,
                                        .subject = subject}));
    if (VkResult result = context.vk.BindBufferMemory(context.device, buffer->handle, buffer->memory.handle(),
                                                      buffer->memory.offset());
        result != VK_SUCCESS)
        return fail(context.check(result), "bind memory of", subject);
    if (desc.memory != rhi::MemoryKind::device) buffer->mapped = buffer->memory.mapped();
    buffer->memory_bytes = buffer->memory.size();
    context.set_name(buffer->handle, VK_OBJECT_TYPE_BUFFER, desc.name);
    return buffer;
}

VkDeviceAddress Buffer::address() const {
    VkBufferDeviceAddressInfo info{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO};
    info.buffer = handle;
    return context_.vk.GetBufferDeviceAddress(context_.device, &info);
}

Buffer::~Buffer() {
    if (handle) context_.vk.DestroyBuffer(context_.device, handle, nullptr);
}

}  // namespace nacre::vulkan
