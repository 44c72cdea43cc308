// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhi/device.h"
#include "tests/backends/cpu/images/test_image.h"

/// @file
/// The same operations on the Vulkan device of this machine, in a compute shader.

namespace nacre::cpu::test {

class Oracle {
  public:
    /// A device whose driver filters as the specification says (Mesa's software driver approximates by default).
    Oracle();
    ~Oracle();
    /// Null where none could be made; `error` tells why (not_found: this machine has none).
    [[nodiscard]] rhi::Device* device() const { return device_.get(); }
    [[nodiscard]] const Error& error() const { return error_; }

    /// Evaluates a GLSL expression of type vec4, ivec4 or uvec4 for all points. The expression sees `image` (of the
    /// fitting sampler type), and of each point `p` (vec4 of coordinates), `ip` (the same bits as ivec4), `lod`,
    /// `reference`, `gx`, `gy` (vec3), `offset` (ivec3).
    std::vector<Result> evaluate(const TestImage& image, const rhi::SamplerDesc& sampler, const std::string& expression,
                                 std::span<const Point> points);

  private:
    std::unique_ptr<rhi::Instance> instance_;
    std::unique_ptr<rhi::Device> device_;
    Error error_;
};

/// GLSL name of a sampler type, e.g. "isamplerCubeArray".
std::string sampler_type(rhi::Format format, rhi::ViewDimension dimension, bool is_comparison,
                         bool is_multisampled = false);

}  // namespace nacre::cpu::test
