// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <memory>
#include <vector>

#include "core/error.h"
#include "materials/single_slab.h"
#include "passes/scene_closures.h"
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
                                                            const SceneClosures& closures,
                                                            const std::vector<bool>& used,
                                                            std::uint32_t allowed_textures, float anisotropy);
    ~SceneMaterials();
    SceneMaterials(const SceneMaterials&) = delete;
    SceneMaterials& operator=(const SceneMaterials&) = delete;

    [[nodiscard]] rhi::BindGroup group(std::uint32_t material) const { return groups_[material]; }
    [[nodiscard]] rhi::BindGroupLayout layout(std::uint32_t material) const { return layouts_[material]; }
    /// Number of the layout of a material: materials with the same set of textures have the same one.
    [[nodiscard]] std::uint32_t texture_mask(std::uint32_t material) const { return texture_masks_[material]; }

    /// The same for materials that are shaded by closures.
    [[nodiscard]] rhi::BindGroup closure_group(std::uint32_t material) const { return closures_[material].group; }
    [[nodiscard]] rhi::BindGroupLayout closure_layout(std::uint32_t material) const { return closures_[material].layout; }
    [[nodiscard]] const std::vector<std::uint32_t>& closure_textures_of(std::uint32_t material) const {
        return closures_[material].textures;
    }
    /// The tables of the closures, by number (closure_table_count), and their places in textures(); but for the first,
    /// which is always there, those that no material reads are not.
    [[nodiscard]] rhi::Texture table(std::uint32_t number) const { return tables_[number]; }
    [[nodiscard]] std::uint32_t table_place(std::uint32_t number) const { return table_places_[number]; }

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

    Expected<void> upload_tables(const scene::Scene& scene, std::uint32_t tables);
    Expected<void> add_closures(const scene::Scene& scene, std::uint32_t material, const ClosureMaterial& closures,
                                std::uint64_t block_offset, float anisotropy);
    Expected<rhi::Sampler> sampler_of(const scene::Scene& scene, int index, float anisotropy);

    struct Closures {
        rhi::BindGroup group{};
        rhi::BindGroupLayout layout{};
        std::vector<std::uint32_t> textures;
    };
    rhi::Device& device_;
    std::vector<Closures> closures_;
    std::array<rhi::Texture, closure_table_count> tables_{};
    std::array<std::uint32_t, closure_table_count> table_places_{};
    rhi::Sampler table_sampler_{};
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
