// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string_view>
#include <vector>

#include "passes/hit_materials.h"
#include "passes/geometry_draws.h"

/// @file
/// Shades what the camera sees a second time, as hits of rays are shaded: the rasterizer only writes down places (what
/// it interpolates, and the number of the material), and a compute shader makes of each place and its material's blob
/// what the base pass stores. Both results must be equal; that is what this is for.

namespace nacre::passes {

class HitShading {
  public:
    /// `hits` outlives the object; the graph of the context has its textures. Error: unsupported where fragment shaders
    /// have no storage buffers.
    static Expected<std::unique_ptr<HitShading>> create(RenderContext& context, HitMaterials& hits, rhi::Buffer camera);
    ~HitShading();
    HitShading(const HitShading&) = delete;
    HitShading& operator=(const HitShading&) = delete;

    /// After the frame's passes, in the same command list.
    Expected<void> record(rhi::CommandList& list);

    /// "material.0", "material.1", "top_layer", "material.slices", "albedo" (a: roughness), "emission" (a: whether the
    /// alpha test lets the place be). An empty handle: there is none of that name.
    [[nodiscard]] rhi::Texture texture(std::string_view name) const;

  private:
    struct Output {
        std::string_view name;
        std::uint32_t binding = 0;
        rhi::Texture texture{};
    };
    explicit HitShading(RenderContext& context, HitMaterials& hits) : context_(context), hits_(hits) {}

    RenderContext& context_;
    HitMaterials& hits_;
    rhi::Buffer points_{};
    rhi::Texture depth_{};
    std::vector<Output> outputs_;
    rhi::BindGroupLayout points_layout_{};
    rhi::BindGroup points_group_{};
    GeometryDraws draws_;
    ComputeStep step_;
};

}  // namespace nacre::passes
