// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "rhi/device.h"

/// @file
/// Shaders that are measured as functions: an invocation reads the words of a point and writes results.
///
///     NACRE_TRY(PointShader shader, PointShader::make(*device, {.name = "ggx", .text = text, .point_words = 8,
///                                                               .result_words = 4, .capacity = 1 << 16}));
///     NACRE_CHECK(shader.run(points, {}, {}, count, results));

namespace nacre::measure {

struct PointShaderDesc {
    std::string name;
    std::string defines;  ///< Before all else: macros of slabs' features among them.
    /// GLSL with main(), for workgroups of 64. It reads with next(), next2(), next3() from words `points[]` at `place`
    /// and writes with put(index, float) and put3(index, vec3); POINT_WORDS and RESULT_WORDS are defined. With
    /// `has_candidates` there is `float candidates[]`, with `has_parameters` `float parameters[]`; with `has_tables`
    /// there are the functions of materials/closures/tables.glsl.
    std::string text;
    std::uint32_t point_words = 0;
    std::uint32_t result_words = 0;
    std::uint32_t capacity = 0;  ///< Points in one run; a multiple of 64.
    std::uint32_t parameter_words = 0;
    std::uint32_t features = 0;  ///< Of slabs: decides which tables there are.
    bool has_tables = false;
    bool has_candidates = false;
};

/// A pipeline with its buffers. The device must outlive it; used by one thread at a time.
class PointShader {
  public:
    PointShader() = default;
    PointShader(PointShader&& other) noexcept { *this = std::move(other); }
    PointShader& operator=(PointShader&& other) noexcept;
    ~PointShader();

    /// Errors: shader_compile, and those of making buffers and pipelines.
    static Expected<PointShader> make(rhi::Device& device, const PointShaderDesc& desc);

    /// `count` invocations, rounded up to whole workgroups. `candidates` and `parameters` are read where the shader
    /// asks for them. `results` is resized. Waits for the device.
    Expected<void> run(std::span<const std::uint32_t> points, std::span<const float> candidates,
                       std::span<const float> parameters, std::uint32_t count, std::vector<float>& results);

  private:
    rhi::Device* device_ = nullptr;
    PointShaderDesc desc_;
    rhi::Shader module_;
    rhi::ComputePipeline pipeline_;
    std::vector<rhi::Buffer> buffers_;
    rhi::Buffer points_, results_, candidates_, parameters_;  ///< Of `buffers_`.
    rhi::BindGroup group_;
};

}  // namespace nacre::measure
