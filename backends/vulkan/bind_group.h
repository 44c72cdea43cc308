// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "backends/vulkan/context.h"

namespace nacre::vulkan {

/// The descriptor sets of one layout. Sets of destroyed bind groups are used again, so a bind group made every frame
/// costs an update and no allocation. Bind groups share the ownership: a layout may go before they do.
class DescriptorSets {
  public:
    static Expected<std::shared_ptr<DescriptorSets>> create(Context& context, const rhi::BindGroupLayoutDesc& desc);
    ~DescriptorSets();
    DescriptorSets(const DescriptorSets&) = delete;
    DescriptorSets& operator=(const DescriptorSets&) = delete;

    struct Set {
        VkDescriptorSet handle = VK_NULL_HANDLE;
        VkDescriptorPool own_pool = VK_NULL_HANDLE;  ///< Unbounded layouts: a pool for this set alone.
    };
    /// `unbounded_count`: descriptors in the unbounded array of the layout, where it has one.
    Expected<Set> allocate(std::uint32_t unbounded_count);
    void release(const Set& set);

    [[nodiscard]] VkDescriptorSetLayout layout() const { return layout_; }
    [[nodiscard]] bool is_unbounded() const { return is_unbounded_; }

  private:
    explicit DescriptorSets(Context& context) : context_(context) {}
    Expected<VkDescriptorPool> make_pool(std::uint32_t sets, std::uint32_t unbounded_count);

    Context& context_;
    VkDescriptorSetLayout layout_ = VK_NULL_HANDLE;
    std::vector<VkDescriptorPoolSize> sizes_;  ///< Of one set, without the unbounded array.
    VkDescriptorType unbounded_type_ = VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE;
    bool is_unbounded_ = false;
    std::vector<VkDescriptorPool> pools_;
    std::uint32_t left_in_pool_ = 0, next_pool_sets_ = 4;
    std::vector<VkDescriptorSet> spare_;
    std::string name_;
};

class BindGroupLayout final : public rhi::BackendBindGroupLayout {
  public:
    static Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> create(Context& context,
                                                                         const rhi::BindGroupLayoutDesc& desc);

    std::shared_ptr<DescriptorSets> sets;
};

class BindGroup final : public rhi::BackendBindGroup {
  public:
    static Expected<std::unique_ptr<rhi::BackendBindGroup>> create(Context& context,
                                                                   rhi::BackendBindGroupLayout& layout,
                                                                   std::span<const rhi::BackendBinding> bindings,
                                                                   const std::string& name);
    ~BindGroup() override;

    VkDescriptorSet handle = VK_NULL_HANDLE;

  private:
    explicit BindGroup(Context& context) : context_(context) {}
    Expected<VkBufferView> view_texels(const rhi::BackendBinding& binding, const std::string& name);

    Context& context_;
    std::vector<VkBufferView> texel_views_;
    std::shared_ptr<DescriptorSets> sets_;
    DescriptorSets::Set set_;
};

}  // namespace nacre::vulkan
