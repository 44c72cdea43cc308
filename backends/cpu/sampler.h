// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/image_view.h"
#include "rhi/backend.h"

namespace nacre::cpu {

class CpuSampler : public rhi::BackendSampler {
  public:
    CpuSampler(const rhi::SamplerDesc& sampler_desc, bool is_elliptical) {
        desc = sampler_desc;
        state = {sampler_desc, is_elliptical};
    }
    SamplerState state;
};

}  // namespace nacre::cpu
