// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/vulkan/context.h"

namespace nacre::vulkan {

class Sampler final : public rhi::BackendSampler {
  public:
    static Expected<std::unique_ptr<rhi::BackendSampler>> create(Context& context, const rhi::SamplerDesc& desc);
    ~Sampler() override;

    VkSampler handle = VK_NULL_HANDLE;

  private:
    explicit Sampler(Context& context) : context_(context) {}
    Context& context_;
};

}  // namespace nacre::vulkan
