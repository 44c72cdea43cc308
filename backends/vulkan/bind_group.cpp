// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/bind_group.h"

#include <algorithm>

#include "backends/vulkan/acceleration_structure.h"
#include "backends/vulkan/buffer.h"
#include "backends/vulkan/formats.h"
#include "backends/vulkan/result.h"
#include "backends/vulkan/sampler.h"
#include "backends/vulkan/texture.h"
#include "rhi/binding_type.h"

namespace nacre::vulkan {

Expected<std::shared_ptr<DescriptorSets>> DescriptorSets::create(Context& context,
                                                                 const rhi::BindGroupLayoutDesc& desc) {
    std::shared_ptr<DescriptorSets> sets(new DescriptorSets(context));
    sets->name_ = desc.name;
    std::vector<VkDescriptorSetLayoutBinding> bindings;
    std::vector<VkDescriptorBindingFlags> flags;
    for (const rhi::BindingLayout& each : desc.bindings) {
        VkDescriptorSetLayoutBinding binding{};
        binding.binding = each.binding;
        binding.descriptorType = to_vulkan(each.type);
        binding.stageFlags = to_vulkan(each.stages);
        if (binding.stageFlags == 0) binding.stageFlags = context.push_constants.stageFlags;
        binding.descriptorCount = each.count > 0 ? each.count : context.capabilities.max_bindless_textures;
        bindings.push_back(binding);
        if (each.count == 0) {
            sets->is_unbounded_ = true;
            sets->unbounded_type_ = binding.descriptorType;
            flags.push_back(VK_DESCRIPTOR_BINDING_PARTIALLY_BOUND_BIT |
                            VK_DESCRIPTOR_BINDING_VARIABLE_DESCRIPTOR_COUNT_BIT |
                            // For the larger limits that come with it; the sets themselves never change.
                            (context.update_after_bind ? VK_DESCRIPTOR_BINDING_UPDATE_AFTER_BIND_BIT : 0));
            continue;
        }
        flags.push_back(0);
        const auto same = std::ranges::find(sets->sizes_, binding.descriptorType, &VkDescriptorPoolSize::type);
        if (same == sets->sizes_.end())
            sets->sizes_.push_back({binding.descriptorType, binding.descriptorCount});
        else
            same->descriptorCount += binding.descriptorCount;
    }
    VkDescriptorSetLayoutBindingFlagsCreateInfo binding_flags{
        VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO};
    binding_flags.bindingCount = static_cast<std::uint32_t>(flags.size());
    binding_flags.pBindingFlags = flags.data();
    VkDescriptorSetLayoutCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
    if (sets->is_unbounded_) {
        info.pNext = &binding_flags;
        if (context.update_after_bind) info.flags = VK_DESCRIPTOR_SET_LAYOUT_CREATE_UPDATE_AFTER_BIND_POOL_BIT;
    }
    info.bindingCount = static_cast<std::uint32_t>(bindings.size());
    info.pBindings = bindings.data();
    if (VkResult result = context.vk.CreateDescriptorSetLayout(context.device, &info, nullptr, &sets->layout_);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", "bind-group layout " + in_quotes(desc.name));
    context.set_name(sets->layout_, VK_OBJECT_TYPE_DESCRIPTOR_SET_LAYOUT, desc.name);
    return sets;
}

DescriptorSets::~DescriptorSets() {
    for (VkDescriptorPool pool : pools_) context_.vk.DestroyDescriptorPool(context_.device, pool, nullptr);
    if (layout_) context_.vk.DestroyDescriptorSetLayout(context_.device, layout_, nullptr);
}

Expected<VkDescriptorPool> DescriptorSets::make_pool(std::uint32_t sets, std::uint32_t unbounded_count) {
    std::vector<VkDescriptorPoolSize> sizes = sizes_;
    for (VkDescriptorPoolSize& size : sizes) size.descriptorCount *= sets;
    if (unbounded_count > 0) sizes.push_back({unbounded_type_, unbounded_count});
    if (sizes.empty()) sizes.push_back({VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1});  // A pool cannot be of nothing.
    VkDescriptorPoolCreateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
    if (is_unbounded_ && context_.update_after_bind) info.flags = VK_DESCRIPTOR_POOL_CREATE_UPDATE_AFTER_BIND_BIT;
    info.maxSets = sets;
    info.poolSizeCount = static_cast<std::uint32_t>(sizes.size());
    info.pPoolSizes = sizes.data();
    VkDescriptorPool pool = VK_NULL_HANDLE;
    if (VkResult result = context_.vk.CreateDescriptorPool(context_.device, &info, nullptr, &pool);
        result != VK_SUCCESS)
        return fail(context_.check(result), "create descriptor pool for", "bind-group layout " + in_quotes(name_));
    return pool;
}

Expected<DescriptorSets::Set> DescriptorSets::allocate(std::uint32_t unbounded_count) {
    Set set;
    if (!spare_.empty()) {
        set.handle = spare_.back();
        spare_.pop_back();
        return set;
    }
    VkDescriptorSetVariableDescriptorCountAllocateInfo variable{
        VK_STRUCTURE_TYPE_DESCRIPTOR_SET_VARIABLE_DESCRIPTOR_COUNT_ALLOCATE_INFO};
    variable.descriptorSetCount = 1;
    variable.pDescriptorCounts = &unbounded_count;
    VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
    info.descriptorSetCount = 1;
    info.pSetLayouts = &layout_;
    if (is_unbounded_) {
        NACRE_TRY(set.own_pool, make_pool(1, std::max(unbounded_count, 1u)));
        info.pNext = &variable;
        info.descriptorPool = set.own_pool;
    } else {
        if (left_in_pool_ == 0) {
            NACRE_TRY(const VkDescriptorPool pool, make_pool(next_pool_sets_, 0));
            pools_.push_back(pool);
            left_in_pool_ = next_pool_sets_;
            next_pool_sets_ = std::min(next_pool_sets_ * 2, 1024u);
        }
        info.descriptorPool = pools_.back();
    }
    if (VkResult result = context_.vk.AllocateDescriptorSets(context_.device, &info, &set.handle);
        result != VK_SUCCESS) {
        if (set.own_pool) context_.vk.DestroyDescriptorPool(context_.device, set.own_pool, nullptr);
        return fail(context_.check(result), "allocate descriptor set of", "bind-group layout " + in_quotes(name_));
    }
    if (!is_unbounded_) --left_in_pool_;
    return set;
}

void DescriptorSets::release(const Set& set) {
    if (set.own_pool)
        context_.vk.DestroyDescriptorPool(context_.device, set.own_pool, nullptr);
    else if (set.handle)
        spare_.push_back(set.handle);
}

Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> BindGroupLayout::create(Context& context,
                                                                               const rhi::BindGroupLayoutDesc& desc) {
    auto layout = std::make_unique<BindGroupLayout>();
    layout->desc = desc;
    NACRE_TRY(layout->sets, DescriptorSets::create(context, desc));
    return layout;
}

Expected<std::unique_ptr<rhi::BackendBindGroup>> BindGroup::create(Context& context,
                                                                   rhi::BackendBindGroupLayout& layout,
                                                                   std::span<const rhi::BackendBinding> bindings,
                                                                   const std::string& name) {
    std::unique_ptr<BindGroup> group(new BindGroup(context));
    group->layout = &layout;
    group->sets_ = static_cast<BindGroupLayout&>(layout).sets;
    std::uint32_t unbounded_count = 0;
    if (group->sets_->is_unbounded()) {
        const auto unbounded = std::ranges::find(layout.desc.bindings, 0u, &rhi::BindingLayout::count);
        for (const rhi::BackendBinding& each : bindings)
            if (each.binding == unbounded->binding) unbounded_count = std::max(unbounded_count, each.element + 1);
    }
    NACRE_TRY(group->set_, group->sets_->allocate(unbounded_count));
    group->handle = group->set_.handle;

    // Filled to their final size first: the writes hold addresses of their elements.
    std::vector<VkDescriptorBufferInfo> buffers(bindings.size());
    std::vector<VkDescriptorImageInfo> images(bindings.size());
    std::vector<VkBufferView> texels(bindings.size());
    std::vector<VkWriteDescriptorSetAccelerationStructureKHR> structures(
        bindings.size(), {VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR});
    std::vector<VkWriteDescriptorSet> writes(bindings.size(), {VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET});
    for (std::size_t i = 0; i < bindings.size(); ++i) {
        const rhi::BackendBinding& from = bindings[i];
        VkWriteDescriptorSet& write = writes[i];
        write.dstSet = group->handle;
        write.dstBinding = from.binding;
        write.dstArrayElement = from.element;
        write.descriptorCount = 1;
        write.descriptorType = to_vulkan(from.type);
        if (rhi::is_texel_buffer(from.type)) {
            NACRE_TRY(texels[i], group->view_texels(from, name));
            write.pTexelBufferView = &texels[i];
            continue;
        }
        if (from.buffer) {
            buffers[i] = {native(*from.buffer).handle, from.offset, from.size};
            write.pBufferInfo = &buffers[i];
            continue;
        }
        if (from.acceleration_structure) {
            structures[i].accelerationStructureCount = 1;
            structures[i].pAccelerationStructures = &native(*from.acceleration_structure).handle;
            write.pNext = &structures[i];
            continue;
        }
        if (from.sampler) images[i].sampler = static_cast<Sampler&>(*from.sampler).handle;
        if (write.descriptorType != VK_DESCRIPTOR_TYPE_SAMPLER) {
            Texture& texture = native(*from.view.texture.object);
            const bool is_storage = write.descriptorType == VK_DESCRIPTOR_TYPE_STORAGE_IMAGE;
            NACRE_TRY(images[i].imageView,
                      texture.view(from.view, is_storage ? ViewPurpose::storage : ViewPurpose::sampled));
            images[i].imageLayout = is_storage ? VK_IMAGE_LAYOUT_GENERAL : texture.sampled_layout();
        }
        write.pImageInfo = &images[i];
    }
    if (!writes.empty())
        context.vk.UpdateDescriptorSets(context.device, static_cast<std::uint32_t>(writes.size()), writes.data(), 0,
                                        nullptr);
    context.set_name(group->handle, VK_OBJECT_TYPE_DESCRIPTOR_SET, name);
    return group;
}

Expected<VkBufferView> BindGroup::view_texels(const rhi::BackendBinding& binding, const std::string& name) {
    VkBufferViewCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO};
    info.buffer = native(*binding.buffer).handle;
    info.format = to_vulkan(binding.format);
    info.offset = binding.offset;
    info.range = binding.size;
    VkBufferView view = VK_NULL_HANDLE;
    if (VkResult result = context_.vk.CreateBufferView(context_.device, &info, nullptr, &view); result != VK_SUCCESS)
        return fail(context_.check(result), "create view of",
                    "buffer " + in_quotes(binding.buffer->desc.name) + " for bind group " + in_quotes(name));
    texel_views_.push_back(view);
    context_.set_name(view, VK_OBJECT_TYPE_BUFFER_VIEW, binding.buffer->desc.name);
    return view;
}

BindGroup::~BindGroup() {
    for (VkBufferView view : texel_views_) context_.vk.DestroyBufferView(context_.device, view, nullptr);
    if (sets_) sets_->release(set_);
}

}  // namespace nacre::vulkan
