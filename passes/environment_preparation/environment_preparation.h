// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "core/error.h"
#include "passes/frame_graph.h"
#include "passes/shader_library.h"
#include "scene/scene.h"

/// @file
/// Makes what lighting needs of an environment: a cube whose mips are prefiltered for rising roughness (mip 0 is the
/// environment itself, the last is roughness 1), and nine spherical-harmonic coefficients of its irradiance. Runs once.
///
///     NACRE_TRY(auto environment, PreparedEnvironment::create(device, shaders, scene.environment, 256, 32));
///     bind(environment->cube(), environment->irradiance());

namespace nacre::passes {

class PreparedEnvironment {
  public:
    /// `largest_size`: of a cube face; the picture's own resolution where that is smaller. A missing environment is
    /// black.
    static Expected<std::unique_ptr<PreparedEnvironment>> create(rhi::Device& device, ShaderLibrary& shaders,
                                                                 const scene::Environment& environment,
                                                                 std::uint32_t largest_size, std::uint32_t samples);
    ~PreparedEnvironment();
    PreparedEnvironment(const PreparedEnvironment&) = delete;
    PreparedEnvironment& operator=(const PreparedEnvironment&) = delete;

    [[nodiscard]] rhi::Texture cube() const { return cube_; }
    [[nodiscard]] const rhi::TextureDesc& cube_desc() const { return cube_desc_; }
    [[nodiscard]] rhi::Buffer irradiance() const { return irradiance_; }
    [[nodiscard]] const rhi::BufferDesc& irradiance_desc() const { return irradiance_desc_; }
    /// The passes that made it, for the plan.
    [[nodiscard]] const FrameGraph& graph() const { return graph_; }

    /// Side of the cube's faces for a picture of this width.
    static std::uint32_t face_size(std::uint32_t picture_width, std::uint32_t largest_size);
    /// Mips of a cube of this size: down to 4 x 4.
    static std::uint32_t mip_count(std::uint32_t face_size);

  private:
    explicit PreparedEnvironment(rhi::Device& device) : device_(device) {}

    rhi::Device& device_;
    FrameGraph graph_;
    rhi::Texture cube_{};
    rhi::Buffer irradiance_{};
    rhi::TextureDesc cube_desc_;
    rhi::BufferDesc irradiance_desc_;
};

}  // namespace nacre::passes
