// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/vulkan/native_vulkan.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace nacre::vulkan::test {
namespace {

void check(VkResult result, const char* what) {
    if (result == VK_SUCCESS) return;
    std::fprintf(stderr, "%s failed: VkResult %d\n", what, static_cast<int>(result));
    std::abort();
}

}  // namespace

std::unique_ptr<NativeVulkan> NativeVulkan::create() {
    auto library = Library::open();
    if (!library || (*library)->version < VK_API_VERSION_1_3) return nullptr;
    std::unique_ptr<NativeVulkan> native(new NativeVulkan);
    native->library_ = *library;
    VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
    application.apiVersion = VK_API_VERSION_1_3;
    VkInstanceCreateInfo instance{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
    instance.pApplicationInfo = &application;
    if (native->library_->vk.CreateInstance(&instance, nullptr, &native->instance_) != VK_SUCCESS) return nullptr;
    native->instance_functions = *InstanceFunctions::load(native->library_->vk, native->instance_);
    const InstanceFunctions& functions = native->instance_functions;
    std::uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    functions.EnumeratePhysicalDevices(native->instance_, &count, &physical);
    if (count == 0) return nullptr;
    VkPhysicalDeviceProperties properties;
    functions.GetPhysicalDeviceProperties(physical, &properties);
    if (properties.apiVersion < VK_API_VERSION_1_3) return nullptr;
    functions.GetPhysicalDeviceMemoryProperties(physical, &native->memory_);

    const float priority = 1;
    VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
    queue.queueCount = 1;  // Family 0 has graphics and compute on every driver that this runs on.
    queue.pQueuePriorities = &priority;
    VkPhysicalDeviceVulkan12Features vulkan12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
    vulkan12.timelineSemaphore = VK_TRUE;
    VkPhysicalDeviceVulkan13Features vulkan13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES, &vulkan12};
    vulkan13.dynamicRendering = VK_TRUE;
    vulkan13.synchronization2 = VK_TRUE;
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &vulkan13};
    features.features.robustBufferAccess = VK_TRUE;
    features.features.fragmentStoresAndAtomics = VK_TRUE;
    VkDeviceCreateInfo device{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &features};
    device.queueCreateInfoCount = 1;
    device.pQueueCreateInfos = &queue;
    check(functions.CreateDevice(physical, &device, nullptr, &native->device), "vkCreateDevice");
    native->vk = *DeviceFunctions::load(functions, native->device);
    const DeviceFunctions& vk = native->vk;
    vk.GetDeviceQueue(native->device, 0, 0, &native->queue_);

    VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
    pool.flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT;
    check(vk.CreateCommandPool(native->device, &pool, nullptr, &native->pool_), "vkCreateCommandPool");
    VkCommandBufferAllocateInfo commands{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    commands.commandPool = native->pool_;
    commands.commandBufferCount = 1;
    check(vk.AllocateCommandBuffers(native->device, &commands, &native->commands_), "vkAllocateCommandBuffers");
    VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
    type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    VkSemaphoreCreateInfo semaphore{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type};
    check(vk.CreateSemaphore(native->device, &semaphore, nullptr, &native->timeline_), "vkCreateSemaphore");
    return native;
}

NativeVulkan::~NativeVulkan() {
    if (device) {
        vk.DeviceWaitIdle(device);
        for (VkDescriptorPool pool : descriptor_pools_) vk.DestroyDescriptorPool(device, pool, nullptr);
        for (VkDescriptorSetLayout layout : set_layouts_) vk.DestroyDescriptorSetLayout(device, layout, nullptr);
        vk.DestroySemaphore(device, timeline_, nullptr);
        vk.DestroyCommandPool(device, pool_, nullptr);
        vk.DestroyDevice(device, nullptr);
    }
    if (instance_) instance_functions.DestroyInstance(instance_, nullptr);
}

VkDeviceMemory NativeVulkan::allocate(const VkMemoryRequirements& requirements, VkMemoryPropertyFlags properties) {
    for (std::uint32_t type = 0; type < memory_.memoryTypeCount; ++type) {
        if (!(requirements.memoryTypeBits & (1u << type)) ||
            (memory_.memoryTypes[type].propertyFlags & properties) != properties)
            continue;
        VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
        info.allocationSize = requirements.size;
        info.memoryTypeIndex = type;
        VkDeviceMemory memory = VK_NULL_HANDLE;
        check(vk.AllocateMemory(device, &info, nullptr, &memory), "vkAllocateMemory");
        return memory;
    }
    check(VK_ERROR_OUT_OF_DEVICE_MEMORY, "finding a memory type");
    return VK_NULL_HANDLE;
}

NativeBuffer NativeVulkan::make_buffer(VkDeviceSize size, VkBufferUsageFlags usage) {
    NativeBuffer buffer;
    VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    info.size = size;
    info.usage = usage;
    check(vk.CreateBuffer(device, &info, nullptr, &buffer.handle), "vkCreateBuffer");
    VkMemoryRequirements2 requirements{VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2};
    VkBufferMemoryRequirementsInfo2 which{VK_STRUCTURE_TYPE_BUFFER_MEMORY_REQUIREMENTS_INFO_2};
    which.buffer = buffer.handle;
    vk.GetBufferMemoryRequirements2(device, &which, &requirements);
    buffer.memory = allocate(requirements.memoryRequirements,
                             VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    check(vk.BindBufferMemory(device, buffer.handle, buffer.memory, 0), "vkBindBufferMemory");
    void* mapped = nullptr;
    check(vk.MapMemory(device, buffer.memory, 0, VK_WHOLE_SIZE, 0, &mapped), "vkMapMemory");
    buffer.mapped = static_cast<std::byte*>(mapped);
    return buffer;
}

NativeImage NativeVulkan::make_target(VkFormat format, std::uint32_t width, std::uint32_t height) {
    NativeImage image;
    VkImageCreateInfo info{VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO};
    info.imageType = VK_IMAGE_TYPE_2D;
    info.format = format;
    info.extent = {width, height, 1};
    info.mipLevels = info.arrayLayers = 1;
    info.samples = VK_SAMPLE_COUNT_1_BIT;
    info.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
    check(vk.CreateImage(device, &info, nullptr, &image.handle), "vkCreateImage");
    VkMemoryRequirements2 requirements{VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2};
    VkImageMemoryRequirementsInfo2 which{VK_STRUCTURE_TYPE_IMAGE_MEMORY_REQUIREMENTS_INFO_2};
    which.image = image.handle;
    vk.GetImageMemoryRequirements2(device, &which, &requirements);
    image.memory = allocate(requirements.memoryRequirements, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    check(vk.BindImageMemory(device, image.handle, image.memory, 0), "vkBindImageMemory");
    VkImageViewCreateInfo view{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO};
    view.image = image.handle;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = format;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    check(vk.CreateImageView(device, &view, nullptr, &image.view), "vkCreateImageView");
    return image;
}

void NativeVulkan::destroy(const NativeBuffer& buffer) {
    vk.DestroyBuffer(device, buffer.handle, nullptr);
    vk.FreeMemory(device, buffer.memory, nullptr);
}

void NativeVulkan::destroy(const NativeImage& image) {
    vk.DestroyImageView(device, image.view, nullptr);
    vk.DestroyImage(device, image.handle, nullptr);
    vk.FreeMemory(device, image.memory, nullptr);
}

void NativeVulkan::destroy(const NativePipeline& pipeline) {
    vk.DestroyPipeline(device, pipeline.handle, nullptr);
    vk.DestroyPipelineLayout(device, pipeline.layout, nullptr);
}

VkDescriptorSetLayout NativeVulkan::make_set_layout(VkDescriptorType type, VkShaderStageFlags stages) {
    VkDescriptorSetLayoutBinding binding{};
    binding.descriptorType = type;
    binding.descriptorCount = 1;
    binding.stageFlags = stages;
    VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
    info.bindingCount = 1;
    info.pBindings = &binding;
    VkDescriptorSetLayout layout = VK_NULL_HANDLE;
    check(vk.CreateDescriptorSetLayout(device, &info, nullptr, &layout), "vkCreateDescriptorSetLayout");
    set_layouts_.push_back(layout);
    return layout;
}

std::vector<VkDescriptorSet> NativeVulkan::make_sets(VkDescriptorSetLayout layout, VkDescriptorType type,
                                                     std::span<const NativeBuffer> buffers) {
    const auto count = static_cast<std::uint32_t>(buffers.size());
    const VkDescriptorPoolSize size{type, count};
    VkDescriptorPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
    pool_info.maxSets = count;
    pool_info.poolSizeCount = 1;
    pool_info.pPoolSizes = &size;
    VkDescriptorPool pool = VK_NULL_HANDLE;
    check(vk.CreateDescriptorPool(device, &pool_info, nullptr, &pool), "vkCreateDescriptorPool");
    descriptor_pools_.push_back(pool);
    const std::vector<VkDescriptorSetLayout> layouts(count, layout);
    VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
    info.descriptorPool = pool;
    info.descriptorSetCount = count;
    info.pSetLayouts = layouts.data();
    std::vector<VkDescriptorSet> sets(count);
    check(vk.AllocateDescriptorSets(device, &info, sets.data()), "vkAllocateDescriptorSets");
    for (std::uint32_t i = 0; i < count; ++i) {
        const VkDescriptorBufferInfo buffer{buffers[i].handle, 0, VK_WHOLE_SIZE};
        VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
        write.dstSet = sets[i];
        write.descriptorCount = 1;
        write.descriptorType = type;
        write.pBufferInfo = &buffer;
        vk.UpdateDescriptorSets(device, 1, &write, 0, nullptr);
    }
    return sets;
}

VkShaderModule NativeVulkan::make_module(std::span<const std::uint32_t> spirv) {
    VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    info.codeSize = spirv.size_bytes();
    info.pCode = spirv.data();
    VkShaderModule module = VK_NULL_HANDLE;
    check(vk.CreateShaderModule(device, &info, nullptr, &module), "vkCreateShaderModule");
    return module;
}

namespace {

VkPipelineLayout make_pipeline_layout(const NativeVulkan& native, VkDescriptorSetLayout layout,
                                      VkShaderStageFlags stages, std::uint32_t push_bytes) {
    const VkPushConstantRange range{stages, 0, push_bytes};
    VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    info.setLayoutCount = layout ? 1 : 0;
    info.pSetLayouts = &layout;
    info.pushConstantRangeCount = push_bytes > 0 ? 1 : 0;
    info.pPushConstantRanges = &range;
    VkPipelineLayout made = VK_NULL_HANDLE;
    check(native.vk.CreatePipelineLayout(native.device, &info, nullptr, &made), "vkCreatePipelineLayout");
    return made;
}

VkPipelineShaderStageCreateInfo stage_of(VkShaderModule module, VkShaderStageFlagBits stage) {
    VkPipelineShaderStageCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO};
    info.stage = stage;
    info.module = module;
    info.pName = "main";
    return info;
}

}  // namespace

NativePipeline NativeVulkan::make_compute_pipeline(std::span<const std::uint32_t> spirv, VkDescriptorSetLayout layout,
                                                   std::uint32_t push_bytes) {
    NativePipeline pipeline;
    pipeline.layout = make_pipeline_layout(*this, layout, VK_SHADER_STAGE_COMPUTE_BIT, push_bytes);
    const VkShaderModule module = make_module(spirv);
    VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    info.stage = stage_of(module, VK_SHADER_STAGE_COMPUTE_BIT);
    info.layout = pipeline.layout;
    check(vk.CreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline.handle),
          "vkCreateComputePipelines");
    vk.DestroyShaderModule(device, module, nullptr);
    return pipeline;
}

NativePipeline NativeVulkan::make_graphics_pipeline(std::span<const std::uint32_t> vertex,
                                                    std::span<const std::uint32_t> fragment, VkFormat format,
                                                    VkDescriptorSetLayout layout, std::uint32_t push_bytes) {
    NativePipeline pipeline;
    pipeline.layout =
        make_pipeline_layout(*this, layout, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, push_bytes);
    const VkShaderModule modules[] = {make_module(vertex), make_module(fragment)};
    const VkPipelineShaderStageCreateInfo stages[] = {stage_of(modules[0], VK_SHADER_STAGE_VERTEX_BIT),
                                                      stage_of(modules[1], VK_SHADER_STAGE_FRAGMENT_BIT)};
    const VkPipelineVertexInputStateCreateInfo input{VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO};
    VkPipelineInputAssemblyStateCreateInfo assembly{VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO};
    assembly.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
    VkPipelineViewportStateCreateInfo viewport{VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO};
    viewport.viewportCount = viewport.scissorCount = 1;
    VkPipelineRasterizationStateCreateInfo raster{VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO};
    raster.lineWidth = 1;
    VkPipelineMultisampleStateCreateInfo multisample{VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO};
    multisample.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
    VkPipelineColorBlendAttachmentState attachment{};
    attachment.colorWriteMask = 0xf;
    VkPipelineColorBlendStateCreateInfo blend{VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO};
    blend.attachmentCount = 1;
    blend.pAttachments = &attachment;
    const VkDynamicState states[] = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
    VkPipelineDynamicStateCreateInfo dynamic{VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO};
    dynamic.dynamicStateCount = 2;
    dynamic.pDynamicStates = states;
    VkPipelineRenderingCreateInfo rendering{VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO};
    rendering.colorAttachmentCount = 1;
    rendering.pColorAttachmentFormats = &format;
    VkGraphicsPipelineCreateInfo info{VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO, &rendering};
    info.stageCount = 2;
    info.pStages = stages;
    info.pVertexInputState = &input;
    info.pInputAssemblyState = &assembly;
    info.pViewportState = &viewport;
    info.pRasterizationState = &raster;
    info.pMultisampleState = &multisample;
    info.pColorBlendState = &blend;
    info.pDynamicState = &dynamic;
    info.layout = pipeline.layout;
    check(vk.CreateGraphicsPipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline.handle),
          "vkCreateGraphicsPipelines");
    for (VkShaderModule module : modules) vk.DestroyShaderModule(device, module, nullptr);
    return pipeline;
}

VkCommandBuffer NativeVulkan::begin_commands() {
    check(vk.ResetCommandPool(device, pool_, 0), "vkResetCommandPool");
    VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    check(vk.BeginCommandBuffer(commands_, &info), "vkBeginCommandBuffer");
    return commands_;
}

void NativeVulkan::begin_rendering(VkCommandBuffer commands, const NativeImage& target, std::uint32_t width,
                                   std::uint32_t height) {
    VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
    barrier.srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    barrier.dstStageMask = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
    barrier.dstAccessMask = VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT;
    barrier.newLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    barrier.image = target.handle;
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    dependency.imageMemoryBarrierCount = 1;
    dependency.pImageMemoryBarriers = &barrier;
    vk.CmdPipelineBarrier2(commands, &dependency);
    VkRenderingAttachmentInfo color{VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO};
    color.imageView = target.view;
    color.imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    color.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    color.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    VkRenderingInfo info{VK_STRUCTURE_TYPE_RENDERING_INFO};
    info.renderArea = {{0, 0}, {width, height}};
    info.layerCount = 1;
    info.colorAttachmentCount = 1;
    info.pColorAttachments = &color;
    vk.CmdBeginRendering(commands, &info);
    const VkViewport viewport{0, 0, static_cast<float>(width), static_cast<float>(height), 0, 1};
    vk.CmdSetViewport(commands, 0, 1, &viewport);
    vk.CmdSetScissor(commands, 0, 1, &info.renderArea);
}

void NativeVulkan::submit(VkCommandBuffer commands) {
    check(vk.EndCommandBuffer(commands), "vkEndCommandBuffer");
    ++serial_;
    VkTimelineSemaphoreSubmitInfo timeline{VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO};
    timeline.signalSemaphoreValueCount = 1;
    timeline.pSignalSemaphoreValues = &serial_;
    VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO, &timeline};
    info.commandBufferCount = 1;
    info.pCommandBuffers = &commands;
    info.signalSemaphoreCount = 1;
    info.pSignalSemaphores = &timeline_;
    check(vk.QueueSubmit(queue_, 1, &info, VK_NULL_HANDLE), "vkQueueSubmit");
}

void NativeVulkan::wait() {
    VkSemaphoreWaitInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO};
    info.semaphoreCount = 1;
    info.pSemaphores = &timeline_;
    info.pValues = &serial_;
    check(vk.WaitSemaphores(device, &info, ~std::uint64_t{0}), "vkWaitSemaphores");
}

std::vector<std::byte> NativeVulkan::read(const NativeImage& image, std::uint32_t width, std::uint32_t height,
                                          std::uint32_t texel_bytes) {
    std::vector<std::byte> bytes(std::size_t{width} * height * texel_bytes);
    const NativeBuffer buffer = make_buffer(bytes.size(), VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const VkCommandBuffer commands = begin_commands();
    VkImageMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
    barrier.srcStageMask = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
    barrier.srcAccessMask = VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT;
    barrier.dstStageMask = VK_PIPELINE_STAGE_2_COPY_BIT;
    barrier.dstAccessMask = VK_ACCESS_2_TRANSFER_READ_BIT;
    barrier.oldLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    barrier.image = image.handle;
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    dependency.imageMemoryBarrierCount = 1;
    dependency.pImageMemoryBarriers = &barrier;
    vk.CmdPipelineBarrier2(commands, &dependency);
    VkBufferImageCopy region{};
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = {width, height, 1};
    vk.CmdCopyImageToBuffer(commands, image.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, buffer.handle, 1, &region);
    VkMemoryBarrier2 host{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
    host.srcStageMask = VK_PIPELINE_STAGE_2_COPY_BIT;
    host.srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
    host.dstStageMask = VK_PIPELINE_STAGE_2_HOST_BIT;
    host.dstAccessMask = VK_ACCESS_2_HOST_READ_BIT;
    VkDependencyInfo to_host{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    to_host.memoryBarrierCount = 1;
    to_host.pMemoryBarriers = &host;
    vk.CmdPipelineBarrier2(commands, &to_host);
    submit(commands);
    wait();
    std::memcpy(bytes.data(), buffer.mapped, bytes.size());
    destroy(buffer);
    return bytes;
}

}  // namespace nacre::vulkan::test
