// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/vulkan/context.h"

namespace nacre::vulkan {

class Shader final : public rhi::BackendShader {
  public:
    static Expected<std::unique_ptr<rhi::BackendShader>> create(Context& context, const rhi::ShaderDesc& desc,
                                                                const rhi::ShaderReflection& reflection);
    ~Shader() override;

    VkShaderModule handle = VK_NULL_HANDLE;

  private:
    explicit Shader(Context& context) : context_(context) {}
    Context& context_;
};

}  // namespace nacre::vulkan
