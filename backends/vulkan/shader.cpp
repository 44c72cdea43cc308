// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/shader.h"

#include "backends/vulkan/result.h"

namespace nacre::vulkan {

Expected<std::unique_ptr<rhi::BackendShader>> Shader::create(Context& context, const rhi::ShaderDesc& desc,
                                                             const rhi::ShaderReflection& reflection) {
    std::unique_ptr<Shader> shader(new Shader(context));
    // The driver keeps its own copy; `spirv` stays empty.
    shader->reflection = reflection;
    shader->entry_point = desc.entry_point;
    shader->name = desc.name;
    VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    info.codeSize = desc.spirv.size() * sizeof(std::uint32_t);
    info.pCode = desc.spirv.data();
    if (VkResult result = context.vk.CreateShaderModule(context.device, &info, nullptr, &shader->handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", "shader " + in_quotes(desc.name));
    context.set_name(shader->handle, VK_OBJECT_TYPE_SHADER_MODULE, desc.name);
    return shader;
}

Shader::~Shader() {
    if (handle) context_.vk.DestroyShaderModule(context_.device, handle, nullptr);
}

}  // namespace nacre::vulkan
