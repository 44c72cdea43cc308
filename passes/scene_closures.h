// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/embedded_file.h"
#include "core/error.h"
#include "materials/material_blob.h"
#include "materials/storage_shader.h"
#include "materials/tree_shader.h"
#include "passes/profiles.h"
#include "passes/shading_features.h"
#include "scene/scene.h"

/// @file
/// Which materials of a scene are more than one plain slab, simplified to what the profile allows, and the GLSL that
/// writes and shades them: one text for each topology.
///
///     NACRE_TRY(const SceneClosures closures, SceneClosures::choose(scene, *profile, warnings));
///     if (const ClosureMaterial* material = closures.find(draw.material)) ... material->topology ...

namespace nacre::passes {

/// A material that is shaded by closures.
struct ClosureMaterial {
    materials::FlattenedTree flat;
    materials::StorageLayout layout;
    std::uint32_t topology = 0;             ///< Number of its text; materials of one topology share shaders.
    std::vector<glm::vec4> numbers;         ///< What its text reads as tree_row().
    std::vector<materials::TextureReference> textures;  ///< Binding first_material_texture and on of set 1.
    std::uint32_t features = 0;             ///< Of all slabs that the base pass evaluates.
    bool is_translucent = false;            ///< What lies behind shows through.
    bool needs_tangents = false;

    /// Material words beyond the color targets.
    [[nodiscard]] bool writes_slices() const { return layout.material_words() > 2 || layout.has_subsurface; }
};

/// Bindings of set 1: the blob, four tables for closures, the sideband, then textures; of trees first their numbers,
/// and the blob where the sideband of others is.
inline constexpr std::uint32_t closure_table_count = 4;  ///< Interface, medium, anisotropy, specular tints.
/// Whether closures with these features read a table.
[[nodiscard]] constexpr bool reads_table(std::uint32_t features, std::uint32_t table) {
    constexpr std::uint32_t needed_by[closure_table_count] = {0, materials::slab_medium, materials::slab_anisotropy,
                                                            materials::slab_specular_lut};
    return table == 0 || (features & needed_by[table]) != 0;
}
inline constexpr std::uint32_t sideband_binding = 1 + closure_table_count;
inline constexpr std::uint32_t first_material_texture = sideband_binding + 1;
/// translate * rotate * scale of KHR_texture_transform, as two rows.
void write_uv_rows(const materials::TextureTransform& transform, glm::vec4* rows);

class SceneClosures {
  public:
    /// Looks at the materials that the scene's meshes use. What a profile or the device cannot hold is simplified;
    /// `warnings` tells of materials that lose something that is not the profile's choice.
    static Expected<SceneClosures> choose(const scene::Scene& scene, const Profile& profile, bool storage_in_fragment,
                                          std::vector<std::string>& warnings);
    /// None.
    SceneClosures() = default;

    [[nodiscard]] const ClosureMaterial* find(std::uint32_t material) const {
        return material < materials_.size() && materials_[material] ? &*materials_[material] : nullptr;
    }
    [[nodiscard]] bool empty() const { return texts_.empty(); }

    /// What the lighting of stored closures must know of all opaque ones.
    struct Lighting {
        std::uint32_t features = 0;       ///< As stored.
        std::uint32_t frames = 1;
        bool has_layers = false;          ///< Closures lie below others.
        bool has_subsurface = false;
        std::uint32_t slices = 0;         ///< Of the storage image: words beyond the second; last, subsurface data.
    };
    [[nodiscard]] const Lighting& lighting() const { return lighting_; }
    /// Which tables the materials' shaders read: bits as closure_table_count tells.
    [[nodiscard]] std::uint32_t tables() const { return tables_; }

    /// What drawing a primitive with a material of this scene needs; `material` is one that find() knows.
    [[nodiscard]] static ShadingFeatures features_of(const ClosureMaterial& material, const scene::Primitive& primitive,
                                                     bool double_sided);

    /// GLSL files of all topologies: "passes/closures/base_pass_N.frag", "passes/closures/blend_N.frag" and
    /// "passes/closures/emission_N.frag". They live
    /// as long as this object.
    [[nodiscard]] std::vector<EmbeddedFile> files() const;
    /// GLSL for hits of rays (passes/shared/hit_shading.glsl): the closures' library with the features of all
    /// materials, the text of every topology, and functions that choose among them.
    [[nodiscard]] std::string hit_text() const;
    /// Defines for a shader that reads stored closures.
    [[nodiscard]] std::vector<rhi::ShaderDefine> lighting_defines() const;

  private:
    struct Text {
        std::string topology, topology_path;
        std::string base_pass, base_pass_path;
        std::string blend, blend_path;
        std::string emission, emission_path;
        std::string points_path;
        std::uint32_t first_material = 0;        ///< One that has it.
        materials::TextureReference occlusion;   ///< Of that one.
    };
    std::vector<std::optional<ClosureMaterial>> materials_;
    std::vector<std::unique_ptr<Text>> texts_;
    Lighting lighting_;
    std::uint32_t tables_ = 0;
};

}  // namespace nacre::passes
