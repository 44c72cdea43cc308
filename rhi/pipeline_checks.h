// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rhi/object_checks.h"

namespace nacre::rhi {

/// A binding that the shaders of a pipeline declare, merged over its stages.
struct MergedBinding {
    ReflectedBinding declared;
    ShaderStage stages = ShaderStage::none;
};

/// What all stages of a pipeline declare together, sorted by set and binding.
struct MergedInterface {
    std::vector<MergedBinding> bindings;
    std::uint32_t push_constant_bytes = 0;
    ShaderStage push_constant_stages = ShaderStage::none;
};

Check merge_stages(std::span<const BackendShader* const> shaders, const std::string& name, MergedInterface& merged);
/// Whether a given layout holds what the shaders use at a bind-group index.
Check check_explicit_layout(const BindGroupLayoutDesc& layout, std::uint32_t set, const MergedInterface& merged,
                            const std::string& name);
Check check_specialization(std::span<const SpecializationConstant> constants,
                           std::span<const BackendShader* const> shaders, const std::string& name);
Check check_graphics(const GraphicsPipelineDesc& desc, const BackendShader& vertex, const BackendShader* fragment,
                     const Capabilities& capabilities);
Check check_compute(const ComputePipelineDesc& desc, const BackendShader& shader, const Capabilities& capabilities);

}  // namespace nacre::rhi
