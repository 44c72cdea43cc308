// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

/// @file
/// A material as its author wrote it: plain data that holds everything a glTF 2.0 material can say, every
/// ratified `KHR_materials_*` extension as typed fields and every other extension as JSON text. Nothing is
/// interpreted or simplified here; `single_slab()` (materials/single_slab.h) maps it to what is shaded.
///
///     MaterialDescription paint{.name = "red paint"};
///     paint.base_color = {0.8f, 0.05f, 0.04f, 1.0f};
///     paint.metallic = 0.0f;
///     paint.roughness = 0.35f;
///     paint.clearcoat = Clearcoat{.factor = 1.0f, .roughness = 0.03f};
///
/// Colors are linear with sRGB primaries and a D65 white point. Lengths are meters, angles radians.

namespace nacre::materials {

struct Tree;
class CustomMaterial;

/// Moves texture coordinates before the lookup (KHR_texture_transform):
/// uv' = translate(offset) * rotate(rotation) * scale(scale) * uv, angles counter-clockwise as that extension draws it.
struct TextureTransform {
    glm::vec2 offset{0.0f};
    float rotation = 0.0f;  ///< Radians.
    glm::vec2 scale{1.0f};

    bool operator==(const TextureTransform&) const = default;
    /// True when the transform changes nothing.
    [[nodiscard]] bool is_identity() const { return *this == TextureTransform{}; }
};

/// A texture as one input of a material: which picture, how it is sampled, with which coordinates.
struct TextureReference {
    int image = -1;    ///< Index into Scene::images; -1: no texture. The image says its color space.
    int sampler = -1;  ///< Index into Scene::samplers; valid whenever `image` is.
    int uv_set = 0;    ///< 0 or 1: which texture coordinates of the primitive.
    TextureTransform transform;
    float scale = 1.0f;  ///< Normal maps: scale of x and y. Occlusion maps: strength, [0, 1]. Otherwise 1.

    /// True when there is a texture.
    [[nodiscard]] bool present() const { return image >= 0; }
    bool operator==(const TextureReference&) const = default;
};

/// What the alpha of the base color means.
enum class AlphaMode {
    opaque,  ///< Alpha is ignored.
    mask,    ///< Present where alpha >= alpha_cutoff, absent elsewhere.
    blend,   ///< Alpha is coverage; drawn sorted over what is behind.
};

/// KHR_materials_clearcoat: a thin dielectric coat (ior 1.5) over everything.
struct Clearcoat {
    float factor = 0.0f;                 ///< Coverage, [0, 1].
    TextureReference texture;            ///< Channel r scales factor.
    float roughness = 0.0f;              ///< Perceptual, [0, 1].
    TextureReference roughness_texture;  ///< Channel g scales roughness.
    TextureReference normal_texture;     ///< The coat's own normals; without it, the geometric ones.
};

/// KHR_materials_sheen: retro-reflective fibers on top.
struct Sheen {
    glm::vec3 color{0.0f};
    TextureReference color_texture;  ///< rgb, sRGB encoded.
    float roughness = 0.0f;
    TextureReference roughness_texture;  ///< Channel a scales roughness.
};

/// KHR_materials_anisotropy: highlights stretched along the tangent.
struct Anisotropy {
    float strength = 0.0f;     ///< [0, 1].
    float rotation = 0.0f;     ///< Radians, counter-clockwise from the tangent.
    TextureReference texture;  ///< rg: direction in [-1, 1] mapped to [0, 1], b: scales strength.
};

/// KHR_materials_transmission: light passes through the (thin) surface.
struct Transmission {
    float factor = 0.0f;       ///< [0, 1].
    TextureReference texture;  ///< Channel r scales factor.
};

/// KHR_materials_volume: what lies below a transmissive surface.
struct Volume {
    float thickness = 0.0f;              ///< Meters in the world; 0: thin-walled.
    TextureReference thickness_texture;  ///< Channel g scales thickness.
    float attenuation_distance = std::numeric_limits<float>::infinity();  ///< Meters; see attenuation_color.
    glm::vec3 attenuation_color{1.0f};  ///< Color of white light after attenuation_distance.
};

/// KHR_materials_specular: strength and tint of the dielectric reflection.
struct Specular {
    float factor = 1.0f;             ///< [0, 1].
    TextureReference texture;        ///< Channel a scales factor.
    glm::vec3 color{1.0f};           ///< F0 tint; may exceed 1, the product with F0 is clamped.
    TextureReference color_texture;  ///< rgb, sRGB encoded.
};

/// KHR_materials_iridescence: a thin film on the surface.
struct Iridescence {
    float factor = 0.0f;
    TextureReference texture;  ///< Channel r scales factor.
    float ior = 1.3f;
    float thickness_minimum = 100e-9f;   ///< Meters (the file says nanometers).
    float thickness_maximum = 400e-9f;   ///< Meters (the file says nanometers).
    TextureReference thickness_texture;  ///< Channel g moves from minimum to maximum.
};

/// KHR_materials_diffuse_transmission: light scattered through a thin surface.
struct DiffuseTransmission {
    float factor = 0.0f;
    TextureReference texture;  ///< Channel a scales factor.
    glm::vec3 color{1.0f};
    TextureReference color_texture;  ///< rgb, sRGB encoded.
};

/// KHR_materials_pbrSpecularGlossiness: the older model, in place of base color, metallic and roughness.
struct SpecularGlossiness {
    glm::vec4 diffuse{1.0f};
    TextureReference diffuse_texture;              ///< rgba, rgb sRGB encoded.
    glm::vec3 specular{1.0f};                      ///< F0.
    float glossiness = 1.0f;                       ///< 1 - perceptual roughness.
    TextureReference specular_glossiness_texture;  ///< rgb sRGB encoded: specular, a: glossiness.
};

/// An extension (or extras) that has no fields above, kept as it was written.
struct UnknownExtension {
    std::string name;  ///< As in the file: "VENDOR_materials_glitter".
    std::string json;  ///< Its value as compact JSON text, UTF-8.
};

/// See the top of this file. Textures multiply the factor beside them.
struct MaterialDescription {
    std::string name;

    glm::vec4 base_color{1.0f};                   ///< rgb: albedo or metal color, a: alpha.
    TextureReference base_color_texture;          ///< rgba, rgb sRGB encoded.
    float metallic = 1.0f;                        ///< [0, 1].
    float roughness = 1.0f;                       ///< Perceptual (GGX alpha is its square), [0, 1].
    TextureReference metallic_roughness_texture;  ///< g: roughness, b: metallic.

    TextureReference normal_texture;     ///< Tangent space, rgb in [0, 1] to [-1, 1]; scale applies to x and y.
    TextureReference occlusion_texture;  ///< Channel r; scale is the strength.
    glm::vec3 emissive{0.0f};            ///< cd/m2, before emissive_strength.
    TextureReference emissive_texture;   ///< rgb, sRGB encoded.

    AlphaMode alpha_mode = AlphaMode::opaque;
    float alpha_cutoff = 0.5f;
    bool double_sided = false;

    bool unlit = false;              ///< KHR_materials_unlit: base color is shown as it is.
    float emissive_strength = 1.0f;  ///< KHR_materials_emissive_strength, >= 0.
    float ior = 1.5f;                ///< KHR_materials_ior; 0 or >= 1. 0 means F0 = 1 (for specular-glossiness).
    float dispersion = 0.0f;         ///< KHR_materials_dispersion: 20 / Abbe number.
    std::optional<Clearcoat> clearcoat;
    std::optional<Sheen> sheen;
    std::optional<Anisotropy> anisotropy;
    std::optional<Transmission> transmission;
    std::optional<Volume> volume;
    std::optional<Specular> specular;
    std::optional<Iridescence> iridescence;
    std::optional<DiffuseTransmission> diffuse_transmission;
    std::optional<SpecularGlossiness> specular_glossiness;
    /// A tree of slabs (materials/tree.h) in place of all that shades above; emission, alpha, normals of plain slabs
    /// and the like stay for whoever does without trees. Null: none.
    std::shared_ptr<const Tree> tree;
    /// A material of the program's own kind (materials/custom_material.h) in place of all above. Null: none.
    std::shared_ptr<CustomMaterial> custom;
    std::vector<UnknownExtension> other_extensions;  ///< By name; "extras" last, under that name.
};

/// Calls `visit(TextureReference&, bool srgb)` for every texture input of `material` that is present; `srgb` says
/// whether its color channels are sRGB encoded. `Material` is `MaterialDescription`, const or not.
template <typename Material, typename Visit>
void for_each_texture(Material& material, Visit&& visit) {
    auto texture = [&](auto& reference, bool srgb) {
        if (reference.present()) visit(reference, srgb);
    };
    texture(material.base_color_texture, true);
    texture(material.metallic_roughness_texture, false);
    texture(material.normal_texture, false);
    texture(material.occlusion_texture, false);
    texture(material.emissive_texture, true);
    if (material.clearcoat) {
        texture(material.clearcoat->texture, false);
        texture(material.clearcoat->roughness_texture, false);
        texture(material.clearcoat->normal_texture, false);
    }
    if (material.sheen) {
        texture(material.sheen->color_texture, true);
        texture(material.sheen->roughness_texture, false);
    }
    if (material.anisotropy) texture(material.anisotropy->texture, false);
    if (material.transmission) texture(material.transmission->texture, false);
    if (material.volume) texture(material.volume->thickness_texture, false);
    if (material.specular) {
        texture(material.specular->texture, false);
        texture(material.specular->color_texture, true);
    }
    if (material.iridescence) {
        texture(material.iridescence->texture, false);
        texture(material.iridescence->thickness_texture, false);
    }
    if (material.diffuse_transmission) {
        texture(material.diffuse_transmission->texture, false);
        texture(material.diffuse_transmission->color_texture, true);
    }
    if (material.specular_glossiness) {
        texture(material.specular_glossiness->diffuse_texture, true);
        texture(material.specular_glossiness->specular_glossiness_texture, true);
    }
}

/// True when shading the material needs tangents: it has a normal map, a coat normal map or anisotropy.
[[nodiscard]] bool needs_tangents(const MaterialDescription& material);

}  // namespace nacre::materials
