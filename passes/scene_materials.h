// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "core/error.h"
#include "materials/single_slab.h"
#include "passes/shading_features.h"
#include "rhi/device.h"
#include "scene/scene.h"

/// @file
/// The materials of a scene on a device: one bind group for each, with a block of numbers and the textures that it has.
/// Together with passes/shared/material.glsl this is all that knows how a material reaches a shader.
///
///     list.set_bind_group(1, materials.group(draw.material));

namespace nacre::passes {

class SceneMaterials {
  public:
    /// Uploads the slabs' numbers and those textures that are in `allowed_textures` (texture_bit).
    static Expected<std::unique_ptr<SceneMaterials>> create(rhi::Device& device, const scene::Scene& scene,
                                                            const std::vector<materials::SingleSlab>& slabs,
                                                            const std::vector<bool>& used,
                                                            std::uint32_t allowed_textures, float anisotropy);
    ~SceneMaterials();
    SceneMaterials(const SceneMaterials&) = delete;
    SceneMaterials& operator=(const SceneMaterials&) = delete;

    [[nodiscard]] rhi::BindGroup group(std::uint32_t material) const { return groups_[material]; }
    [[nodiscard]] rhi::BindGroupLayout layout(std::uint32_t material) const { return layouts_[material]; }
    /// Number of the layout of a material: materials with the same set of textures have the same one.
    [[nodiscard]] std::uint32_t texture_mask(std::uint32_t material) const { return texture_masks_[material]; }

    [[nodiscard]] rhi::Buffer block() const { return block_; }
    /// All textures, and which of them (by position) a material reads; for the statements of passes.
    [[nodiscard]] const std::vector<rhi::Texture>& textures() const { return all_textures_; }
    [[nodiscard]] const std::vector<std::uint32_t>& textures_of(std::uint32_t material) const {
        return textures_of_[material];
    }
    [[nodiscard]] std::uint64_t texture_bytes() const { return texture_bytes_; }

  private:
    explicit SceneMaterials(rhi::Device& device) : device_(device) {}
    Expected<rhi::Texture> upload_image(const scene::Scene& scene, int image, bool with_mips);
    Expected<rhi::Sampler> make_sampler(const scene::Sampler& sampler, float anisotropy);

    rhi::Device& device_;
    rhi::Buffer block_{};
    std::map<std::pair<int, bool>, rhi::Texture> textures_;
    std::map<int, rhi::Sampler> samplers_;
    std::vector<rhi::Texture> all_textures_;
    std::vector<rhi::BindGroup> groups_;
    std::vector<rhi::BindGroupLayout> layouts_;
    std::vector<std::uint32_t> texture_masks_;
    std::vector<std::vector<std::uint32_t>> textures_of_;
    std::uint64_t texture_bytes_ = 0;
    std::vector<rhi::Texture> without_mips_yet_;
};

}  // namespace nacre::passes
