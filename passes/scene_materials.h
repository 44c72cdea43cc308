// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/error.h"
#include "materials/material_blob.h"
#include "materials/single_slab.h"
#include "passes/custom_kinds.h"
#include "passes/scene_closures.h"
#include "passes/shading_features.h"
#include "rhi/device.h"
#include "scene/scene.h"

/// @file
/// The materials of a scene on a device, and their textures. Every material is a blob of 128 bytes
/// (materials/material_blob.h) in one buffer, followed by what does not fit into blobs. A draw has a bind group with
/// its material's blob and textures; hits of rays read any blob by number, and textures by their number in a table
/// (passes/hit_materials.h). With passes/shared/ this is all that knows how a material reaches a shader.
///
///     list.set_bind_group(1, materials.group(draw.material));

namespace nacre::passes {

class SceneMaterials {
  public:
    /// Uploads the materials' numbers and those textures that are in `allowed_textures` (texture_bit).
    static Expected<std::unique_ptr<SceneMaterials>> create(rhi::Device& device, const scene::Scene& scene,
                                                            const std::vector<materials::SingleSlab>& slabs,
                                                            const SceneClosures& closures, const CustomKinds& kinds,
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
    [[nodiscard]] rhi::BindGroupLayout closure_layout(std::uint32_t material) const {
        return closures_[material].layout;
    }
    [[nodiscard]] const std::vector<std::uint32_t>& closure_textures_of(std::uint32_t material) const {
        return closures_[material].textures;
    }
    /// The tables of the closures, by number (closure_table_count), and their places in textures(); but for the first,
    /// which is always there, those that no material reads are not.
    [[nodiscard]] rhi::Texture table(std::uint32_t number) const { return tables_[number]; }
    [[nodiscard]] std::uint32_t table_place(std::uint32_t number) const { return table_places_[number]; }

    /// Asks the materials of the program's own kinds what changed, and uploads that. Called before a frame is recorded.
    /// Returns how many changed. Error: invalid_argument where a sideband changed its size.
    Expected<std::uint32_t> update();

    [[nodiscard]] rhi::Buffer block() const { return block_; }
    /// Rows of four words from one blob to the next in block().
    [[nodiscard]] std::uint32_t blob_stride() const { return blob_stride_; }
    [[nodiscard]] const materials::MaterialBlob& blob(std::uint32_t material) const { return blobs_[material]; }
    /// A texture with its sampler, and the number by which blobs name it.
    struct BoundTexture {
        rhi::Texture texture{};
        rhi::Sampler sampler{};
        std::uint32_t number = 0;
    };
    /// By number.
    [[nodiscard]] const std::vector<BoundTexture>& table() const { return table_; }
    [[nodiscard]] rhi::Sampler table_sampler() const { return table_sampler_; }
    [[nodiscard]] std::uint32_t material_count() const { return static_cast<std::uint32_t>(blobs_.size()); }
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
    Expected<BoundTexture> texture_for(const scene::Scene& scene, const materials::TextureReference& reference,
                                       float anisotropy);
    std::uint32_t place_of(rhi::Texture texture) const;
    /// Puts rows behind the blobs; returns the number of the first.
    std::uint32_t add_rows(std::span<const glm::uvec4> rows);
    // Textures and rows first, bind groups when the buffer is there.
    Expected<void> add_slab(const scene::Scene& scene, std::uint32_t material, const materials::SingleSlab& slab,
                            const materials::CustomMaterialData* custom, std::uint32_t allowed_textures,
                            float anisotropy);
    Expected<void> add_closures(const scene::Scene& scene, std::uint32_t material, const ClosureMaterial& closures,
                                float anisotropy);
    Expected<void> bind_slab(std::uint32_t material);
    Expected<void> bind_closures(std::uint32_t material, const ClosureMaterial& closures);
    Expected<rhi::Sampler> sampler_of(const scene::Scene& scene, int index, float anisotropy);

    struct Closures {
        rhi::BindGroup group{};
        rhi::BindGroupLayout layout{};
        std::vector<std::uint32_t> textures;
        std::vector<BoundTexture> bound;
        std::uint32_t first_row = 0, row_count = 0;  ///< Of the tree's numbers.
    };
    struct Slab {
        std::vector<std::pair<std::uint32_t, BoundTexture>> bound;  ///< By slot.
        std::uint32_t row_count = 0;   ///< Of the sideband.
        std::uint32_t custom_row = 0;  ///< First of those that are a custom material's own.
    };
    struct Custom {
        std::uint32_t material;
        std::shared_ptr<materials::CustomMaterial> object;
    };
    static constexpr std::size_t max_materials = 65536;  // numbers have 16 bits
    rhi::Device& device_;
    std::vector<materials::MaterialBlob> blobs_;
    std::vector<Slab> slabs_;
    std::vector<Custom> customs_;
    std::vector<BoundTexture> table_;
    std::vector<glm::uvec4> rows_;  ///< Of the whole buffer, as first uploaded.
    std::uint32_t row_alignment_ = 1, blob_stride_ = materials::blob_rows;
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
