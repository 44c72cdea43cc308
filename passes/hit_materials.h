// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "passes/custom_kinds.h"
#include "passes/scene_closures.h"
#include "passes/scene_materials.h"
#include "rhi/device.h"
#include "rhi/texture_table.h"

/// @file
/// The materials of a scene for shaders that draw nothing: compute shaders that trace rays, and whatever else has a
/// place on a surface and wants to know what it looks like. passes/shared/hit_shading.glsl is the shader's side.
///
///     NACRE_TRY(const auto hits, HitMaterials::create(device, materials, closures, kinds));
///     ... compile with hits->defines(TextureDetail::differentials) and the files hits->files() ...
///     NACRE_CHECK(hits->bind(list, pipeline));   // sets 1 and 2
///
/// Textures are found by number in an rhi::TextureTable: one unbounded array where the device has descriptor indexing,
/// pages of equal textures elsewhere.

namespace nacre::passes {

/// How a shader chooses the level of detail of textures; see passes/shared/hit_material.glsl.
enum class TextureDetail : std::uint8_t { differentials, cones, one_level };

class HitMaterials {
  public:
    /// The arguments outlive the object. Errors: unsupported where compute shaders have no storage buffers, or where
    /// textures do not fit into the pages of the table.
    static Expected<std::unique_ptr<HitMaterials>> create(rhi::Device& device, const SceneMaterials& materials,
                                                          const SceneClosures& closures, const CustomKinds& kinds);
    ~HitMaterials();
    HitMaterials(const HitMaterials&) = delete;
    HitMaterials& operator=(const HitMaterials&) = delete;

    /// "passes/shared/hit_kinds.glsl", as long as this object lives.
    [[nodiscard]] EmbeddedFile file() const { return {"passes/shared/hit_kinds.glsl", text_}; }
    [[nodiscard]] std::vector<rhi::ShaderDefine> defines(TextureDetail detail) const;
    /// Sets the pipeline's bind groups 1 and 2. The groups are made at the first call for a pipeline.
    Expected<void> bind(rhi::CommandList& list, rhi::ComputePipeline pipeline);

  private:
    explicit HitMaterials(rhi::Device& device, const SceneMaterials& materials)
        : device_(device), materials_(materials) {}

    rhi::Device& device_;
    const SceneMaterials& materials_;
    std::string text_;
    std::unique_ptr<rhi::TextureTable> table_;
    std::vector<std::uint32_t> tables_;
    rhi::ComputePipeline pipeline_{};
    rhi::BindGroup textures_group_{}, materials_group_{};
};

}  // namespace nacre::passes
