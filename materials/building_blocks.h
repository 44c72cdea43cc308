// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "materials/tree.h"

/// @file
/// Building blocks: models that people know, as slabs and operators. A block is added to a tree as a slab is, so that
/// blocks can be mixed, layered and covered; files have them as nodes of their own ("principled": {...}, see
/// materials/tree_json.h).
///
///     Tree tree{.name = "car paint"};
///     add(tree, ClearCoat{.base = {.base_color = {{0.5f, 0.02f, 0.02f}}, .roughness = 0.4f}});
///
/// Inputs are numbers or linear colors with a texture that multiplies them, where the tree can have one. Where it
/// cannot (the input becomes several of a slab's, or not in proportion), the input is a plain `float` or `glm::vec3`.
/// Values out of the ranges stated are clamped. Lengths are meters. Two textured inputs that end in one input of a slab
/// (`specular_weight` and `specular_color`) make a tree that validate() refuses by its name: bake them into one
/// texture.
///
/// Slabs of a block share the tangent frame `frame` (index into Tree::frames), coats have `coat_frame`. Emission is
/// seen through a coat.

namespace nacre::materials {

/// An input of a block: `value` times the texture (TextureInput::field is not used).
template <typename Value>
struct Textured {
    Value value;
    TextureInput texture;

    Textured(const Value& constant = Value(0.0f), TextureInput image = {})
        : value(constant), texture(std::move(image)) {}
};
using NumberInput = Textured<float>;
using ColorInput = Textured<glm::vec3>;

/// What renderers with metalness shade by default: metal and dielectric side by side, blended to one slab without the
/// halo of interpolated metalness (materials/conversions.h).
struct DefaultLit {
    ColorInput base_color{glm::vec3(0.5f)};  ///< [0, 1]: albedo of the dielectric, F0 of the metal.
    NumberInput metallic;                    ///< [0, 1].
    NumberInput specular{0.5f};              ///< [0, 1]: F0 of the dielectric is 0.08 times this.
    NumberInput roughness{0.5f};             ///< [0, 1], perceptual.
    NumberInput anisotropy;                  ///< [-1, 1], Kulla and Conty's.
    ColorInput emission;                     ///< cd/m2.
    NumberInput opacity{1.0f};               ///< [0, 1]: coverage.
    std::uint32_t frame = 0;
};

/// Only light of its own.
struct Unlit {
    ColorInput emission{glm::vec3(1.0f)};  ///< cd/m2.
    NumberInput opacity{1.0f};             ///< [0, 1]: coverage.
};

/// A clear or colored dielectric layer over whatever there is.
struct CoatedLayer {
    NumberInput coat{1.0f};  ///< [0, 1]: share of the surface that is coated.
    glm::vec3 coat_color{
        1.0f};  ///< [0, 1]: tint of what lies below, seen and lit straight: light crosses the coat twice.
    NumberInput coat_roughness{0.05f};  ///< [0, 1], perceptual.
    float coat_ior = 1.5f;              ///< At least 1.
    NumberInput coat_anisotropy;        ///< [-1, 1], Kulla and Conty's.
    std::uint32_t coat_frame = 0;
};

/// The default under a clear coat.
struct ClearCoat {
    DefaultLit base;
    NumberInput clear_coat{1.0f};             ///< [0, 1]: share of the surface that is coated.
    NumberInput clear_coat_roughness{0.05f};  ///< [0, 1], perceptual.
    std::uint32_t coat_frame = 0;
};

/// A woven dielectric with fibers that stand on it.
struct Cloth {
    ColorInput base_color{glm::vec3(0.5f)};  ///< [0, 1]: albedo of the weave.
    NumberInput roughness{0.8f};             ///< [0, 1], perceptual, of the weave.
    NumberInput specular{0.5f};              ///< [0, 1]: F0 is 0.08 times this.
    ColorInput fuzz_color{glm::vec3(0.5f)};  ///< [0, 1]: of the fibers.
    NumberInput fuzz_amount{1.0f};           ///< [0, 1].
    NumberInput fuzz_roughness{0.5f};        ///< [0, 1]; less is velvet, 1 is dust-like.
    NumberInput anisotropy;                  ///< [-1, 1], Kulla and Conty's, along the threads.
    NumberInput opacity{1.0f};               ///< [0, 1]: coverage.
    std::uint32_t frame = 0;
};

/// The standard surface, with the names and meanings of OpenPBR 1.1 (Autodesk's Standard Surface has the same model
/// under names like `metalness` and `specular_IOR`). Lengths are meters in place of the scene's units and of
/// micrometers.
///
/// What it has and slabs do not: `base_diffuse_roughness` (the diffuse reflection follows the specular roughness),
/// `transmission_dispersion`, `thin_film_weight` (thickness 0 is no film), `coat_darkening` (always as much as light is
/// thrown back), rotations (a frame's), `geometry_thin_walled` (Tree::thin, of the whole material).
struct StandardSurface {
    float base_weight = 1.0f;                    ///< [0, 1].
    ColorInput base_color{glm::vec3(0.8f)};      ///< [0, 1].
    NumberInput base_metalness;                  ///< [0, 1].
    NumberInput specular_weight{1.0f};           ///< [0, 1]: scales the reflection of both metal and dielectric.
    ColorInput specular_color{glm::vec3(1.0f)};  ///< [0, 1]: tints F0 of the dielectric, and metal at 82 degrees.
    NumberInput specular_roughness{0.3f};        ///< [0, 1], perceptual.
    float specular_roughness_anisotropy = 0.0f;  ///< [0, 1], OpenPBR's: widths are converted.
    float specular_ior = 1.5f;                   ///< At least 1.
    NumberInput transmission_weight;             ///< [0, 1]: share of the dielectric that is clear.
    glm::vec3 transmission_color{1.0f};          ///< [0, 1]: of white light after `transmission_depth`.
    /// Meters after which light has the color; 0: after the thickness.
    float transmission_depth = 0.0f;
    glm::vec3 transmission_scatter{0.0f};          ///< [0, 1]: scattering coefficient times `transmission_depth`.
    float transmission_scatter_anisotropy = 0;     ///< (-1, 1).
    NumberInput geometry_thickness{0.01f};         ///< Meters of the clear medium below the surface, > 0.
    NumberInput subsurface_weight;                 ///< [0, 1]: share of the diffuse dielectric that is translucent.
    ColorInput subsurface_color{glm::vec3(0.8f)};  ///< [0, 1].
    NumberInput subsurface_radius{0.01f};          ///< Meters: mean free path, before its scale.
    glm::vec3 subsurface_radius_scale{1.0f, 0.5f, 0.25f};  ///< [0, 1].
    float subsurface_scatter_anisotropy = 0.0f;            ///< (-1, 1).
    NumberInput coat_weight;                               ///< [0, 1]: share that is coated.
    glm::vec3 coat_color{1.0f};                            ///< [0, 1]: as CoatedLayer's.
    NumberInput coat_roughness;                            ///< [0, 1], perceptual.
    float coat_ior = 1.6f;                                 ///< At least 1.
    NumberInput fuzz_weight;                               ///< [0, 1]: coverage of the fibers, above a coat.
    ColorInput fuzz_color{glm::vec3(1.0f)};                ///< [0, 1].
    NumberInput fuzz_roughness{0.5f};                      ///< [0, 1].
    NumberInput thin_film_thickness;                       ///< Meters, below a coat; 0: none.
    float thin_film_ior = 1.4f;                            ///< At least 1.
    NumberInput emission_luminance;                        ///< cd/m2.
    ColorInput emission_color{glm::vec3(1.0f)};            ///< [0, 1].
    NumberInput geometry_opacity{1.0f};                    ///< [0, 1]: coverage.
    std::uint32_t frame = 0;
    std::uint32_t coat_frame = 0;
};

/// Disney's principled model, by the names of Burley 2012 and 2015, on slabs: with all of `anisotropic` and below at 0
/// it is DefaultLit. Tints take the base color with its largest channel scaled to 1 (without its texture).
struct Principled {
    ColorInput base_color{glm::vec3(0.5f)};  ///< [0, 1].
    NumberInput metallic;                    ///< [0, 1].
    NumberInput specular{0.5f};              ///< [0, 1]: F0 of the dielectric is 0.08 times this.
    float specular_tint = 0.0f;              ///< [0, 1]: of F0 of the dielectric, towards the base color.
    NumberInput roughness{0.5f};             ///< [0, 1], perceptual.
    float anisotropic = 0.0f;                ///< [0, 1], Disney's: widths are converted.
    NumberInput subsurface;                  ///< [0, 1]: share of the dielectric that is translucent.
    ColorInput subsurface_radius{glm::vec3(0.01f, 0.005f, 0.0025f)};  ///< Meters: mean free path.
    NumberInput sheen;                                                ///< [0, 1]: coverage of fibers, above a coat.
    float sheen_tint = 0.5f;                                          ///< [0, 1]: of the fibers.
    NumberInput sheen_roughness{0.5f};                                ///< [0, 1].
    NumberInput clearcoat;                                            ///< [0, 1]: share that is coated (index 1.5).
    NumberInput clearcoat_roughness{0.1f};                            ///< [0, 1], perceptual.
    NumberInput transmission;      ///< [0, 1]: share of the dielectric that is clear.
    NumberInput thickness{0.01f};  ///< Meters of the clear medium, > 0; it has the base color after its constant value.
    ColorInput emission;           ///< cd/m2.
    NumberInput opacity{1.0f};     ///< [0, 1]: coverage.
    std::uint32_t frame = 0;
    std::uint32_t coat_frame = 0;
};

/// Adds a block to `tree` and makes it the root. Only slabs that can be seen are added.
NodeIndex add(Tree& tree, const DefaultLit& block);
NodeIndex add(Tree& tree, const Unlit& block);
NodeIndex add(Tree& tree, const ClearCoat& block);
NodeIndex add(Tree& tree, const Cloth& block);
NodeIndex add(Tree& tree, const StandardSurface& block);
NodeIndex add(Tree& tree, const Principled& block);
/// Adds a layer over `base`, a node of the tree.
NodeIndex add(Tree& tree, const CoatedLayer& block, NodeIndex base);

/// What kind of thing an input of a block is.
enum class BlockInputKind : std::uint8_t { number, color, frame };

/// An input of a block as files name it.
struct BlockInput {
    std::string_view name;     ///< "base_color"
    std::string_view meaning;  ///< "albedo of the dielectric, F0 of the metal"
    BlockInputKind kind = BlockInputKind::number;
    bool takes_texture = false;
    float minimum = 0.0f, maximum = 0.0f;  ///< Of numbers and of each channel; infinity where there is no bound.
};

/// Its value.
struct BlockValue {
    glm::vec3 value{0.0f};  ///< Numbers: x.
    TextureInput texture;
    std::uint32_t frame = 0;
};

/// A block for whoever has its inputs by name: files, tools.
struct BuildingBlock {
    std::string_view name;     ///< "clear_coat"
    std::string_view meaning;  ///< "the default under a clear coat"
    bool has_base = false;     ///< It lies over a node, which files call "base".
    std::vector<BlockInput> inputs;
    std::vector<BlockValue> defaults;  ///< One for each of `inputs`.
    /// Adds the block with one value for each of `inputs`; `base` counts where has_base is.
    NodeIndex (*add)(Tree& tree, std::span<const BlockValue> values, NodeIndex base);
};

/// All blocks: default_lit, unlit, coated_layer, clear_coat, cloth, standard_surface_opaque,
/// standard_surface_translucent, principled. The two standard surfaces are one block: the opaque one has no inputs of
/// transmission, the translucent one is clear unless it says otherwise.
[[nodiscard]] std::span<const BuildingBlock> building_blocks();

/// By name; null where there is none.
[[nodiscard]] const BuildingBlock* find_building_block(std::string_view name);

}  // namespace nacre::materials
