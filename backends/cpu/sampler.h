// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/image_view.h"
#include "rhi/backend.h"

namespace nacre::cpu {

class CpuSampler : public rhi::BackendSampler {
  public:
    explicit CpuSampler(const rhi::SamplerDesc& sampler_desc) {
        desc = sampler_desc;
        state.desc = sampler_desc;
    }
    SamplerState state;
};

}  // namespace nacre::cpu
