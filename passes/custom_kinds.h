// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/embedded_file.h"
#include "core/error.h"
#include "materials/custom_material.h"
#include "materials/single_slab.h"
#include "scene/scene.h"

/// @file
/// The kinds of material of the program's own (materials/custom_material.h) that a scene has, by number, and their
/// GLSL.
///
///     NACRE_TRY(const CustomKinds kinds, CustomKinds::choose(scene));
///     kinds.kind_of(draw.material);   // 0: it is not of such a kind

namespace nacre::passes {

class CustomKinds {
  public:
    /// Error: invalid_argument where a module's name is no identifier, two modules of one name differ, or a sideband is
    /// too large or not as large as that of others of its kind.
    static Expected<CustomKinds> choose(const scene::Scene& scene);

    [[nodiscard]] std::uint32_t kind_of(std::uint32_t material) const {
        return material < materials_.size() && materials_[material] ? materials_[material]->kind : 0;
    }
    [[nodiscard]] std::uint32_t kind_count() const { return static_cast<std::uint32_t>(names_.size()); }
    /// What a material of a kind said when the scene was read.
    [[nodiscard]] const materials::CustomMaterialData* data_of(std::uint32_t material) const {
        return kind_of(material) != 0 ? &materials_[material]->data : nullptr;
    }
    [[nodiscard]] const std::shared_ptr<materials::CustomMaterial>& material(std::uint32_t material) const {
        return materials_[material]->material;
    }
    /// The material as far as a plain slab tells: its textures, how it is covered, and whether it emits.
    [[nodiscard]] materials::SingleSlab slab_of(std::uint32_t material) const;

    /// The modules, and "passes/shared/material_kinds.glsl", which includes them. They live as long as this object.
    [[nodiscard]] std::vector<EmbeddedFile> files() const;
    /// GLSL for hits of rays: functions of all kinds that call the module of one. Kinds count from 1.
    ///
    ///     vec4 custom_base_color(uint kind); vec3 custom_emission(uint kind); SingleSlab custom_slab(uint kind, vec3
    ///     color);
    [[nodiscard]] std::string dispatch() const;

  private:
    struct Material {
        std::uint32_t kind = 0;
        std::shared_ptr<materials::CustomMaterial> material;
        materials::CustomMaterialData data;
    };
    std::vector<std::optional<Material>> materials_;
    std::vector<std::string> names_;
    std::vector<std::unique_ptr<std::string>> paths_, texts_;
    std::unique_ptr<std::string> draw_text_ = std::make_unique<std::string>();
};

}  // namespace nacre::passes
