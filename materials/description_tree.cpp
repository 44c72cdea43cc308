// SPDX-License-Identifier: Apache-2.0
#include "materials/description_tree.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "materials/building_blocks.h"
#include "materials/conversions.h"
#include "materials/limited.h"

namespace nacre::materials {
namespace {


class Builder {
  public:
    explicit Builder(const MaterialDescription& material) : material_(material) {}

    Tree run() {
        tree_.name = material_.name;
        if (material_.unlit) return unlit();
        TangentFrame frame{.normal_texture = material_.normal_texture};
        if (material_.anisotropy) {
            frame.rotation = material_.anisotropy->rotation;
            frame.rotation_texture = material_.anisotropy->texture;
        }
        tree_.frames = {frame};
        NodeIndex root = base();
        root = with_transmission(root);
        root = with_coat(root);
        // A mask is there or not, which whoever draws it decides.
        if (material_.alpha_mode == AlphaMode::blend) {
            root = tree_.coverage(root, alpha());
            texture_on(root, {.field = "amount", .texture = alpha_texture(), .channel = 3});
            color_by_vertex(root, "amount");
        }
        tree_.root = root;
        for (Node& node : tree_.nodes) node.slab = clamped(node.slab);
        return std::move(tree_);
    }

  private:
    void texture_on(NodeIndex node, TextureInput input) {
        if (input.texture.present()) tree_.nodes[node].textures.push_back(std::move(input));
    }

    // COLOR_0 of a mesh multiplies the base color.
    void color_by_vertex(NodeIndex node, const char* field) { tree_.nodes[node].vertex_colored.emplace_back(field); }

    float alpha() const {
        return unit(material_.specular_glossiness ? material_.specular_glossiness->diffuse.a : material_.base_color.a);
    }
    const TextureReference& alpha_texture() const {
        return material_.specular_glossiness ? material_.specular_glossiness->diffuse_texture
                                             : material_.base_color_texture;
    }
    glm::vec3 base_color() const { return unit(glm::vec3(material_.base_color)); }

    Tree unlit() {
        color_by_vertex(
            materials::add(tree_, Unlit{.emission = {base_color(), {.texture = material_.base_color_texture}}}),
            "emission");
        return std::move(tree_);
    }

    // What dielectric and metal have in common.
    Slab common() const {
        Slab slab;
        slab.roughness = unit(material_.roughness);
        if (material_.anisotropy && material_.anisotropy->strength != 0.0f) {
            const float strength = unit(material_.anisotropy->strength), across = slab.roughness * slab.roughness;
            const StretchedRoughness stretched =
                alphas_to_roughness(across + (1.0f - across) * strength * strength, across);
            slab.features |= slab_anisotropy;
            slab.roughness = stretched.roughness;
            slab.anisotropy = stretched.anisotropy;
        }
        if (material_.sheen) {
            const glm::vec3 color = unit(material_.sheen->color);
            const float amount = std::max({color.r, color.g, color.b});
            if (amount > 0.0f) {
                slab.features |= slab_fuzz;
                slab.fuzz_amount = amount;
                slab.fuzz_color = color / amount;
                slab.fuzz_roughness = unit(material_.sheen->roughness);
            }
        }
        if (material_.iridescence && material_.iridescence->factor > 0.0f) {
            slab.features |= slab_thin_film;
            slab.film_thickness = material_.iridescence->thickness_maximum;
            slab.film_ior = material_.iridescence->ior;
        }
        const glm::vec3 emission = material_.emissive * material_.emissive_strength;
        if (emission != glm::vec3(0.0f)) {
            slab.features |= slab_emission;
            slab.emission = emission;
        }
        return slab;
    }

    NodeIndex add(const Slab& slab, const char* name) {
        const NodeIndex node = tree_.add(slab, name);
        if (material_.specular_glossiness) {
            // roughness = 1 - glossiness * texel
            const float glossiness = unit(material_.specular_glossiness->glossiness);
            if (material_.specular_glossiness->specular_glossiness_texture.present()) {
                tree_.nodes[node].slab.roughness = 1.0f;
                texture_on(node, {.field = "roughness",
                                  .texture = material_.specular_glossiness->specular_glossiness_texture,
                                  .channel = 3,
                                  .scale = -glossiness,
                                  .bias = 1.0f});
            }
        } else {
            texture_on(node, {.field = "roughness", .texture = material_.metallic_roughness_texture, .channel = 1});
        }
        if ((slab.features & slab_anisotropy) != 0)
            texture_on(node, {.field = "anisotropy", .texture = material_.anisotropy->texture, .channel = 2});
        if ((slab.features & slab_fuzz) != 0) {
            texture_on(node, {.field = "fuzz_color", .texture = material_.sheen->color_texture});
            texture_on(node, {.field = "fuzz_roughness", .texture = material_.sheen->roughness_texture, .channel = 3});
        }
        if ((slab.features & slab_thin_film) != 0 && material_.iridescence->thickness_maximum > 0.0f) {
            const float least = material_.iridescence->thickness_minimum / material_.iridescence->thickness_maximum;
            texture_on(node, {.field = "film_thickness",
                              .texture = material_.iridescence->thickness_texture,
                              .channel = 1,
                              .scale = 1.0f - least,
                              .bias = least});
        }
        if ((slab.features & slab_emission) != 0)
            texture_on(node, {.field = "emission", .texture = material_.emissive_texture});
        return node;
    }

    Slab dielectric() const {
        Slab slab = common();
        slab.albedo = base_color();
        slab.f0 = glm::vec3(ior_to_f0(std::isfinite(material_.ior) ? material_.ior : 1.5f));
        if (material_.specular) {
            slab.f0 = unit(slab.f0 * material_.specular->color);
            slab.specular_weight = unit(material_.specular->factor);
            if (slab.specular_weight < 1.0f || material_.specular->texture.present()) slab.features |= slab_f90;
        }
        return slab;
    }

    NodeIndex add_dielectric(const Slab& slab, const char* name) {
        const NodeIndex node = add(slab, name);
        texture_on(node, {.field = "albedo", .texture = material_.base_color_texture});
        if (slab.albedo != glm::vec3(0.0f)) color_by_vertex(node, "albedo");
        specular_on(node);
        return node;
    }

    // Of a dielectric's interface.
    void specular_on(NodeIndex node) {
        if (!material_.specular) return;
        texture_on(node, {.field = "f0", .texture = material_.specular->color_texture});
        texture_on(node, {.field = "specular_weight", .texture = material_.specular->texture, .channel = 3});
    }

    NodeIndex base() {
        if (material_.specular_glossiness) {
            Slab slab = common();
            slab.f0 = unit(material_.specular_glossiness->specular);
            slab.albedo = unit(glm::vec3(material_.specular_glossiness->diffuse)) *
                          (1.0f - std::max({slab.f0.r, slab.f0.g, slab.f0.b}));
            slab.roughness = 1.0f - unit(material_.specular_glossiness->glossiness);
            const NodeIndex node = add(slab, "specular-glossiness");
            texture_on(node, {.field = "albedo", .texture = material_.specular_glossiness->diffuse_texture});
            color_by_vertex(node, "albedo");
            texture_on(node, {.field = "f0", .texture = material_.specular_glossiness->specular_glossiness_texture});
            return node;
        }
        Slab metal = common();
        metal.f0 = base_color();
        metal.albedo = glm::vec3(0.0f);
        const bool has_texture = material_.metallic_roughness_texture.present();
        const float metallic = unit(material_.metallic);
        if (metallic <= 0.0f) return add_dielectric(dielectric(), "dielectric");
        const auto add_metal = [&] {
            const NodeIndex node = add(metal, "metal");
            texture_on(node, {.field = "f0", .texture = material_.base_color_texture});
            color_by_vertex(node, "f0");
            return node;
        };
        if (metallic >= 1.0f && !has_texture) return add_metal();
        const NodeIndex first = add_dielectric(dielectric(), "dielectric"), second = add_metal();
        const NodeIndex mix = tree_.mix(first, second, metallic);
        tree_.nodes[mix].parameter_blend = true;
        texture_on(mix, {.field = "amount", .texture = material_.metallic_roughness_texture, .channel = 2});
        return mix;
    }

    NodeIndex with_transmission(NodeIndex root) {
        const float through = material_.transmission ? unit(material_.transmission->factor) : 0.0f;
        const float scattered = material_.diffuse_transmission ? unit(material_.diffuse_transmission->factor) : 0.0f;
        if (through > 0.0f) {
            Slab glass = dielectric();
            glass.features |= slab_medium;
            glass.albedo = glm::vec3(0.0f);
            if (material_.volume && material_.volume->thickness > 0.0f) {
                glass.thickness = material_.volume->thickness;
                glass.mean_free_path = transmittance_to_mean_free_path(unit(material_.volume->attenuation_color),
                                                                       material_.volume->attenuation_distance);
            } else {
                tree_.thin = true;
                glass.thickness = tree_.surface_thickness;
                glass.mean_free_path = transmittance_to_mean_free_path(base_color(), tree_.surface_thickness);
            }
            const NodeIndex node = add(glass, "transmissive");
            specular_on(node);
            if (material_.volume && material_.volume->thickness > 0.0f) {
                texture_on(node, {.field = "thickness", .texture = material_.volume->thickness_texture, .channel = 1});
            }
            root = tree_.mix(root, node, through);
            texture_on(root, {.field = "amount", .texture = material_.transmission->texture});
        } else if (scattered > 0.0f) {
            // A sheet of about one mean free path: half of the light comes out on either side.
            Slab sheet = dielectric();
            sheet.features |= slab_medium;
            sheet.albedo = unit(material_.diffuse_transmission->color);
            tree_.thin = true;
            sheet.thickness = tree_.surface_thickness;
            sheet.mean_free_path = glm::vec3(tree_.surface_thickness);
            const NodeIndex node = add(sheet, "sheet");
            specular_on(node);
            texture_on(node, {.field = "albedo", .texture = material_.diffuse_transmission->color_texture});
            root = tree_.mix(root, node, scattered);
            texture_on(root, {.field = "amount", .texture = material_.diffuse_transmission->texture, .channel = 3});
        }
        return root;
    }

    NodeIndex with_coat(NodeIndex root) {
        if (!material_.clearcoat || !(material_.clearcoat->factor > 0.0f)) return root;
        const Clearcoat& coat = *material_.clearcoat;
        return materials::add(
            tree_,
            CoatedLayer{.coat = {unit(coat.factor), {.texture = coat.texture}},
                        .coat_roughness = {unit(coat.roughness), {.texture = coat.roughness_texture, .channel = 1}},
                        .coat_frame = tree_.add_frame({.normal_texture = coat.normal_texture})},
            root);
    }

    const MaterialDescription& material_;
    Tree tree_;
};

}  // namespace

Tree tree_of(const MaterialDescription& material) { return Builder(material).run(); }

}  // namespace nacre::materials
