// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "materials/custom_material.h"
#include "materials/single_slab.h"
#include "rhi/shader_compiler.h"
#include "scene/scene.h"

/// @file
/// What a shader must be able to do to draw a primitive with a material. Draws with equal features share shaders and
/// pipelines; a feature that is off leaves no trace in the compiled code.
///
///     ShadingFeatures features = features_of(slab, primitive);
///     ShadingFeatures of_pass = restricted(features, texture_bit(TextureSlot::emission));
///     compiler.compile({.path = "passes/emission/emission.frag", .defines = fragment_defines(of_pass)});

namespace nacre::passes {

/// Textures of a slab, in the order of their bindings (passes/scene_closures.h) and of those in its blob.
enum class TextureSlot : std::uint32_t {
    base_color, metallic_roughness, normal, occlusion, emission, specular, specular_color,
};
inline constexpr std::uint32_t texture_slot_count = 7;

/// Vertex attributes. Locations are 0 to 5, and 9 for `corner` (points and lines drawn as rectangles).
enum class Attribute : std::uint32_t { position, normal, tangent, uv0, uv1, color, corner };
inline constexpr std::uint32_t attribute_count = 7;

constexpr std::uint32_t texture_bit(TextureSlot slot) { return 1u << static_cast<std::uint32_t>(slot); }
constexpr std::uint32_t attribute_bit(Attribute attribute) { return 1u << static_cast<std::uint32_t>(attribute); }
inline constexpr std::uint32_t all_textures = (1u << texture_slot_count) - 1;

struct ShadingFeatures {
    std::uint32_t textures = 0;    ///< texture_bit of those that are read.
    std::uint32_t second_uv = 0;   ///< texture_bit of those that are read with uv1.
    std::uint32_t attributes = 0;  ///< attribute_bit of those that are read; position always.
    bool transforms = false;       ///< Some texture has a KHR_texture_transform.
    bool double_sided = false;
    bool unlit = false;
    bool emits = false;
    bool points = false;
    bool thin = false;             ///< Points or lines.
    std::uint32_t kind = 0;             ///< Of a material of the program's own (passes/custom_kinds.h); 0: none.
    std::uint32_t kind_attributes = 0;  ///< Those that the kind reads for itself.
    std::uint32_t sideband = 0;         ///< Rows of the kind's own.

    friend auto operator<=>(const ShadingFeatures&, const ShadingFeatures&) = default;
};

/// The texture of a slot.
[[nodiscard]] const materials::TextureReference& texture_of(const materials::SingleSlab& slab, TextureSlot slot);

/// What drawing this primitive with this slab needs, where it is of a kind of the program's own with `kind`. A texture
/// whose coordinates (or tangents) the primitive lacks is not read; points and lines without normals are unlit, as glTF
/// asks.
[[nodiscard]] ShadingFeatures features_of(const materials::SingleSlab& slab, const scene::Primitive& primitive,
                                          std::uint32_t kind = 0,
                                          const materials::CustomMaterialData* custom = nullptr);
/// Whether some texture of a slab is moved.
[[nodiscard]] bool moves_textures(const materials::SingleSlab& slab);

/// The features that remain when a pass reads only some of the textures, and normals and colors only if it says so.
/// Kinds of the program's own keep all of them: nobody knows which their functions read.
[[nodiscard]] ShadingFeatures restricted(ShadingFeatures features, std::uint32_t textures, bool with_normals,
                                         bool with_colors);

/// Defines for passes/shared/geometry.vert.glsl and passes/shared/material.glsl.
[[nodiscard]] std::vector<rhi::ShaderDefine> vertex_defines(const ShadingFeatures& features);
[[nodiscard]] std::vector<rhi::ShaderDefine> fragment_defines(const ShadingFeatures& features);

}  // namespace nacre::passes
