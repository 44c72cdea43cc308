// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "materials/description.h"
#include "materials/material_blob.h"

/// @file
/// A kind of material of the program's own: one class here, and one piece of GLSL that turns the material's numbers,
/// its textures and the place on the surface into a slab. The rest (storing, lighting, shadows, alpha test, hits of
/// rays) is done as for every other material.
///
///     class Checker : public CustomMaterial {
///         MaterialModule module() const override { return {"checker", checker_glsl}; }
///         CustomMaterialData data() const override { ... data.numbers[0] = {4.0f, 0.0f, 0.0f, 0.0f}; ... }
///     };
///     MaterialDescription description{.name = "floor", .custom = std::make_shared<Checker>()};
///
/// The GLSL defines, where `checker` is the module's name,
///
///     vec4 checker_base_color();             // rgb: [0, 1]; a: coverage, or what is compared to alpha_cutoff
///     SingleSlab checker_slab(vec3 color);   // passes/shared/single_slab.glsl; color: the above, clamped
///     vec3 checker_emission();               // cd/m2
///
/// and reads
///
///     vec4 custom_numbers(uint i)      // CustomMaterialData::numbers, 0 to 4
///     vec4 custom_sideband(uint i)     // CustomMaterialData::sideband
///     vec4 material_texel(int i)       // texture i at this place, white where there is none; i is a constant
///     vec3 shading_normal()            // world, with texture 2 as normal map, turned to the viewer where double-sided
///     in_position, in_normal, in_tangent, in_uv0, in_uv1, in_color   // as CustomMaterialData::reads says; world
///
/// It is compiled for several stages and into one shader with other kinds: names of its own functions begin with the
/// module's name, and it neither discards nor takes derivatives.

namespace nacre::materials {

/// The GLSL of a kind. Materials with equal names are of one kind, and have equal text.
struct MaterialModule {
    std::string name;  ///< A GLSL identifier of letters and digits, without "gl", "nacre" or a digit at its beginning.
    std::string glsl;
};

/// What changed since the last frame.
enum class MaterialUpdate : std::uint8_t {
    none,
    numbers,  ///< `numbers` or the content of `sideband`. Nothing else may change during the life of a renderer.
};

/// Attributes of the surface that a kind reads beside those that its textures need. What a primitive lacks reads as 0
/// (colors as 1).
enum CustomReads : std::uint32_t {
    reads_uv0 = 1u << 0,
    reads_uv1 = 1u << 1,
    reads_tangents = 1u << 2,
    reads_colors = 1u << 3,
};

struct CustomMaterialData {
    static constexpr std::uint32_t max_sideband = 512;

    std::array<glm::vec4, blob_normal_scale_row - blob_payload_row> numbers{};  ///< Part of the blob.
    std::vector<glm::vec4> sideband;  ///< What does not fit; at most max_sideband, as many in all materials of a kind.
    std::array<TextureReference, blob_textures> textures{};  ///< 2: normal map. 4: read only where `emits`.
    AlphaMode alpha_mode = AlphaMode::opaque;
    float alpha_cutoff = 0.5f;
    bool double_sided = false;
    bool emits = false;       ///< Otherwise the kind's emission is not asked for.
    std::uint32_t reads = 0;  ///< CustomReads.
};

/// See the top of this file. Objects are asked by the thread that uses the renderer.
class CustomMaterial {
  public:
    CustomMaterial() = default;
    CustomMaterial(const CustomMaterial&) = delete;
    CustomMaterial& operator=(const CustomMaterial&) = delete;
    virtual ~CustomMaterial() = default;

    [[nodiscard]] virtual MaterialModule module() const = 0;
    [[nodiscard]] virtual CustomMaterialData data() const = 0;
    /// Called before each frame; `data` is asked again where it returns something other than `none`.
    virtual MaterialUpdate update() { return MaterialUpdate::none; }
};

}  // namespace nacre::materials
