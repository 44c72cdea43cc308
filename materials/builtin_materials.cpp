// SPDX-License-Identifier: Apache-2.0
#include "materials/builtin_materials.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "materials/building_blocks.h"
#include "materials/conversions.h"

namespace nacre::materials {
namespace {

constexpr float right_angle = static_cast<float>(std::numbers::pi / 2);
const glm::vec3 black(0.0f);
constexpr glm::vec3 gold(1.00f, 0.77f, 0.34f);
constexpr glm::vec3 aluminum(0.91f, 0.92f, 0.92f);

Slab dielectric(const glm::vec3& albedo, float roughness) {
    Slab slab;
    slab.albedo = albedo;
    slab.roughness = roughness;
    return slab;
}

Slab metal(const glm::vec3& f0, float roughness) {
    Slab slab;
    slab.f0 = f0;
    slab.roughness = roughness;
    slab.albedo = black;
    return slab;
}

/// A coat that takes `transmittance` of the light that crosses one millimeter straight.
Slab coat(const glm::vec3& transmittance, float roughness) {
    Slab slab = dielectric(black, roughness);
    slab.features = slab_medium;
    slab.mean_free_path = transmittance_to_mean_free_path(transmittance, 1e-3f);
    slab.thickness = 1e-3f;
    return slab;
}

/// The rows of storage, each with all that is above it.
Slab row(int rows) {
    Slab slab = dielectric({0.6f, 0.15f, 0.1f}, 0.4f);
    if (rows >= 1) {
        slab.features |= slab_edge_coverage;
        slab.edge_coverage = 1.0f;
    }
    if (rows >= 2) {
        slab.features |= slab_second_lobe | slab_f90;
        slab.second_weight = 0.3f;
        slab.second_roughness = 0.8f;
        slab.f90 = {0.9f, 0.9f, 1.0f};
    }
    if (rows >= 3) {
        slab.features |= slab_fuzz;
        slab.fuzz_amount = 0.5f;
        slab.fuzz_color = {0.8f, 0.6f, 0.6f};
        slab.fuzz_roughness = 0.4f;
    }
    if (rows >= 4) {
        slab.features |= slab_medium;
        slab.mean_free_path = {0.004f, 0.001f, 0.0005f};
        slab.thickness = std::numeric_limits<float>::infinity();
    }
    if (rows >= 5) {
        slab.features |= slab_anisotropy;
        slab.anisotropy = 0.7f;
    }
    if (rows >= 7) slab.features |= slab_specular_lut;
    if (rows >= 8) {
        slab.features |= slab_glints;
        slab.glint_density = 1e5f;
    }
    return slab;
}

Tree lone(const Slab& slab) {
    Tree tree;
    tree.add(slab, "slab");
    return tree;
}

Tree coated(const Slab& slab) {
    Tree tree;
    const NodeIndex base = tree.add(slab, "base"), top = tree.add(coat({0.9f, 0.6f, 0.4f}, 0.1f), "coat");
    tree.layer(top, base, 1e-3f);
    return tree;
}

/// Two colored layers with normals of their own under a coat.
Tree opal() {
    Tree tree;
    const std::uint32_t own = tree.add_frame({.rotation = 0.5f * right_angle});
    Slab lower = row(8);
    lower.albedo = {0.1f, 0.2f, 0.5f};
    Slab upper = metal({0.2f, 0.7f, 0.5f}, 0.25f);
    upper.features = slab_specular_lut;
    const NodeIndex base = tree.add(lower, "lower"), middle = tree.add(upper, "upper", own);
    const NodeIndex top = tree.add(coat(glm::vec3(1.0f), 0.02f), "coat");
    tree.layer(top, tree.mix(base, middle, 0.5f), 1e-3f);
    return tree;
}

Tree silks() {
    Tree tree;
    const std::uint32_t across = tree.add_frame({.rotation = right_angle});
    Slab warp = dielectric({0.5f, 0.04f, 0.1f}, 0.45f);
    warp.features = slab_anisotropy;
    warp.anisotropy = 0.8f;
    warp.f0 = glm::vec3(0.06f);
    Slab weft = warp;
    weft.albedo = {0.08f, 0.05f, 0.4f};
    const NodeIndex first = tree.add(warp, "warp"), second = tree.add(weft, "weft", across);
    const NodeIndex plastic = tree.add(coat(glm::vec3(1.0f), 0.03f), "plastic");
    tree.layer(plastic, tree.mix(first, second, 0.5f), 5e-4f);
    return tree;
}

Slab jade() {
    Slab slab = dielectric({0.35f, 0.75f, 0.45f}, 0.25f);
    slab.features = slab_medium;
    slab.mean_free_path = {0.001f, 0.003f, 0.0015f};
    slab.thickness = std::numeric_limits<float>::infinity();
    return slab;
}

Tree jade_and_gold() {
    Tree tree;
    const NodeIndex first = tree.add(metal(gold, 0.3f), "gold"), second = tree.add(jade(), "jade");
    tree.mix(first, second, 0.5f);
    return tree;
}

Tree coated_skin() {
    Tree tree;
    Slab skin = dielectric({0.85f, 0.6f, 0.5f}, 0.5f);
    skin.features = slab_medium;
    skin.f0 = glm::vec3(0.028f);
    skin.mean_free_path = {0.0037f, 0.0014f, 0.0007f};
    skin.thickness = std::numeric_limits<float>::infinity();
    const NodeIndex base = tree.add(skin, "skin"), top = tree.add(coat(glm::vec3(1.0f), 0.15f), "sweat");
    tree.layer(top, base, 1e-4f);
    return tree;
}

Tree coated_carbon() {
    Tree tree;
    Slab fiber = dielectric(glm::vec3(0.01f), 0.35f);
    fiber.features = slab_anisotropy;
    fiber.anisotropy = 0.9f;
    fiber.f0 = glm::vec3(0.08f);
    const NodeIndex carbon = tree.add(fiber, "carbon fiber"), rough = tree.add(metal(aluminum, 0.5f), "metal");
    const NodeIndex top = tree.add(coat({0.95f, 0.35f, 0.2f}, 0.03f), "colored coat");
    tree.layer(top, tree.mix(carbon, rough, 0.4f), 1e-3f);
    return tree;
}

Tree dusty_car_paint() {
    Tree tree;
    const NodeIndex base = tree.add(metal({0.55f, 0.05f, 0.04f}, 0.45f), "flakes");
    const NodeIndex clear = tree.add(coat(glm::vec3(1.0f), 0.02f), "clear coat");
    const NodeIndex dust = tree.add(dielectric({0.45f, 0.4f, 0.33f}, 1.0f), "dust");
    tree.layer(tree.coverage(dust, 0.25f), tree.layer(clear, base, 1e-4f));
    return tree;
}

// One of each building block (materials/building_blocks.h).
template <typename Block>
Tree block_of(const Block& block) {
    Tree tree;
    add(tree, block);
    return tree;
}

Tree coated_metal() {
    Tree tree;
    const NodeIndex base =
        add(tree, DefaultLit{.base_color = aluminum, .metallic = 1.0f, .roughness = 0.35f, .anisotropy = 0.8f});
    add(tree, CoatedLayer{.coat_color = {0.9f, 0.25f, 0.08f}, .coat_roughness = 0.08f}, base);
    return tree;
}

struct Entry {
    BuiltinMaterial material;
    Tree (*make)();
};

const Entry entries[] = {
    {{"simple", "one slab with reflection and diffuse"}, [] { return lone(row(0)); }},
    {{"single", "and coverage that depends on the view"}, [] { return lone(row(1)); }},
    {{"single-haze-f90", "and a second lobe and a color at grazing angles"}, [] { return lone(row(2)); }},
    {{"single-fuzz", "and fuzz"}, [] { return lone(row(3)); }},
    {{"single-sss", "and subsurface scattering"}, [] { return lone(row(4)); }},
    {{"complex-aniso", "and anisotropy"}, [] { return lone(row(5)); }},
    {{"complex-coat", "and a tinted coat"}, [] { return coated(row(5)); }},
    {{"special-speclut", "and a tint by view and light"}, [] { return coated(row(7)); }},
    {{"special-glints", "and glints"}, [] { return coated(row(8)); }},
    {{"complex-opal", "and a second colored slab with normals of its own"}, opal},
    {{"gold", "a rough metal"}, [] { return lone(metal(gold, 0.3f)); }},
    {{"plastic", "a red dielectric"}, [] { return lone(dielectric({0.6f, 0.05f, 0.05f}, 0.3f)); }},
    {{"silks-under-plastic", "two perpendicular silks, woven, under clear plastic"}, silks},
    {{"jade-in-gold", "subsurface scattering mixed into metal"}, jade_and_gold},
    {{"wet-skin", "subsurface scattering under a coat"}, coated_skin},
    {{"coated-carbon", "carbon fiber and metal under a colored coat"}, coated_carbon},
    {{"dusty-car-paint", "dust over a clear coat over metal"}, dusty_car_paint},
    {{"default-lit", "block: half metal, half dielectric, in one slab"},
     [] { return block_of(DefaultLit{.base_color = {{0.8f, 0.35f, 0.12f}}, .metallic = 0.5f, .roughness = 0.35f}); }},
    {{"unlit", "block: light of its own"},
     [] { return block_of(Unlit{.emission = {{0.9f, 0.5f, 0.1f}}}); }},
    {{"coated-layer", "block: brushed metal under a colored layer"}, coated_metal},
    {{"clear-coat", "block: metallic paint under a clear coat"},
     [] {
         return block_of(ClearCoat{
             .base = {.base_color = {{0.03f, 0.12f, 0.45f}}, .metallic = 0.7f, .roughness = 0.45f},
             .clear_coat_roughness = 0.03f});
     }},
    {{"cloth", "block: blue velvet"},
     [] {
         return block_of(Cloth{.base_color = {{0.02f, 0.03f, 0.2f}},
                               .fuzz_color = {{0.35f, 0.45f, 0.9f}},
                               .fuzz_roughness = 0.35f});
     }},
    {{"standard-surface-opaque", "block: wax, translucent, coated, dusty"},
     [] {
         return block_of(StandardSurface{.base_color = {{0.8f, 0.45f, 0.1f}},
                                         .specular_roughness = 0.4f,
                                         .subsurface_weight = 0.7f,
                                         .subsurface_color = {{0.9f, 0.55f, 0.15f}},
                                         .subsurface_radius = 0.004f,
                                         .coat_weight = 0.6f,
                                         .coat_roughness = 0.1f,
                                         .fuzz_weight = 0.2f});
     }},
    {{"standard-surface-translucent", "block: green glass"},
     [] {
         return block_of(StandardSurface{.specular_roughness = 0.05f,
                                         .transmission_weight = 1.0f,
                                         .transmission_color = {0.3f, 0.8f, 0.45f},
                                         .transmission_depth = 0.01f,
                                         .geometry_thickness = 0.01f});
     }},
    {{"principled", "block: stretched, coated, with sheen"},
     [] {
         return block_of(Principled{.base_color = {{0.05f, 0.4f, 0.35f}},
                                    .metallic = 0.3f,
                                    .roughness = 0.4f,
                                    .anisotropic = 0.7f,
                                    .sheen = 0.4f,
                                    .clearcoat = 0.5f,
                                    .clearcoat_roughness = 0.05f});
     }},
};

const auto listed = [] {
    std::array<BuiltinMaterial, std::size(entries)> result;
    std::ranges::transform(entries, result.begin(), &Entry::material);
    return result;
}();

}  // namespace

std::span<const BuiltinMaterial> builtin_materials() { return listed; }

Expected<Tree> make_builtin_material(std::string_view name) {
    std::vector<std::string_view> names;
    for (const Entry& entry : entries) {
        if (entry.material.name == name) {
            Tree tree = entry.make();
            tree.name = name;
            return tree;
        }
        names.push_back(entry.material.name);
    }
    return fail(ErrorCode::not_found, "make material", fmt::format("'{}'", name),
                "there is no built-in material of this name", fmt::format("The names are {}.", fmt::join(names, ", ")));
}

}  // namespace nacre::materials
