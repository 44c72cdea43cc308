// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rhi/backend.h"

namespace nacre::cpu {

/// SPIR-V as it came: it is compiled with its pipeline, which gives the specialization constants and the vertex layout.
class CpuShader : public rhi::BackendShader {
  public:
    CpuShader(const rhi::ShaderDesc& desc, const rhi::ShaderReflection& reflected) {
        spirv = desc.spirv;
        reflection = reflected;
        entry_point = desc.entry_point;
        name = desc.name;
    }
};

}  // namespace nacre::cpu
