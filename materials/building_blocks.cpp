// SPDX-License-Identifier: Apache-2.0
#include "materials/building_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>

#include "materials/conversions.h"
#include "materials/limited.h"

namespace nacre::materials {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// What coats are thick: only the ratio to their mean free path counts.
constexpr float coat_thickness = 1e-4f;

float largest(const glm::vec3& v) { return std::max({v.x, v.y, v.z}); }

/// A slab that is being put together, with its textures.
class Leaf {
  public:
    /// Sets an input and switches its feature on.
    void set(std::string_view name, const NumberInput& input) {
        set(name, glm::vec3(input.value), input.texture, true);
    }
    void set(std::string_view name, const ColorInput& input) { set(name, input.value, input.texture, false); }

    /// Multiplies an input that was set before.
    void scale(std::string_view name, const NumberInput& input) {
        const SlabField& field = *find_slab_field(name);
        for (std::uint32_t channel = 0; channel < field.channels; ++channel)
            put(field, channel, field.get(slab_, channel) * input.value);
        add_texture(field, input.texture, true);
    }

    NodeIndex add_to(Tree& tree, std::string name, std::uint32_t frame) const {
        const NodeIndex node = tree.add(slab_, std::move(name), frame);
        tree.nodes[node].textures = textures_;
        return node;
    }

  private:
    void set(std::string_view name, const glm::vec3& value, const TextureInput& texture, bool gray) {
        const SlabField& field = *find_slab_field(name);
        slab_.features |= field.feature;
        for (std::uint32_t channel = 0; channel < field.channels; ++channel)
            put(field, channel, value[static_cast<int>(channel)]);
        add_texture(field, texture, gray);
    }

    void put(const SlabField& field, std::uint32_t channel, float value) {
        field.set(slab_, channel, limited(value, field.minimum, field.maximum));
    }

    void add_texture(const SlabField& field, TextureInput texture, bool gray) {
        if (!texture.texture.present()) return;
        texture.field = field.name;
        texture.gray |= gray && field.channels > 1;
        textures_.push_back(std::move(texture));
    }

    Slab slab_;
    std::vector<TextureInput> textures_;
};

// Puts a texture that multiplies an amount onto an operator.
NodeIndex with_texture(Tree& tree, NodeIndex node, TextureInput texture) {
    if (texture.texture.present()) {
        texture.field = "amount";
        tree.nodes[node].textures.push_back(std::move(texture));
    }
    return node;
}

NodeIndex mix(Tree& tree, NodeIndex first, NodeIndex second, const NumberInput& amount) {
    return with_texture(tree, tree.mix(first, second, unit(amount.value)), amount.texture);
}

// The node on `amount` of the surface.
NodeIndex covered(Tree& tree, NodeIndex node, const NumberInput& amount) {
    if (amount.value >= 1.0f && !amount.texture.texture.present()) return tree.root = node;
    return with_texture(tree, tree.coverage(node, unit(amount.value)), amount.texture);
}

bool is_whole(const NumberInput& amount) { return amount.value >= 1.0f && !amount.texture.texture.present(); }

/// What all models with an interface have in common.
struct Surface {
    ColorInput base_color;
    NumberInput metallic;
    ColorInput f0;                            ///< Of the dielectric.
    NumberInput dielectric_reflection{1.0f};  ///< Scales F0.
    NumberInput metal_reflection{1.0f};       ///< Scales F0.
    ColorInput metal_edge{glm::vec3(1.0f)};   ///< At 82 degrees.
    NumberInput roughness, anisotropy;        ///< Kulla and Conty's.
    NumberInput film_thickness;
    float film_ior = 1.4f;
    ColorInput emission;
    NumberInput emission_scale{1.0f};
    NumberInput subsurface;
    ColorInput subsurface_color, subsurface_path;
    NumberInput subsurface_path_scale{1.0f};
    float subsurface_phase = 0.0f;
    NumberInput transmission;
    glm::vec3 transmission_path{0.0f}, transmission_albedo{0.0f};
    float transmission_phase = 0.0f;
    NumberInput thickness;
    NumberInput fuzz_amount;
    ColorInput fuzz_color;
    NumberInput fuzz_roughness;
    CoatedLayer coat{.coat = 0.0f};
    NumberInput opacity{1.0f};
    std::uint32_t frame = 0;
};

void set_fuzz(Leaf& leaf, const Surface& surface) {
    leaf.set("fuzz_amount", surface.fuzz_amount);
    leaf.set("fuzz_color", surface.fuzz_color);
    leaf.set("fuzz_roughness", surface.fuzz_roughness);
}

NodeIndex add(Tree& tree, const Surface& surface) {
    const bool has_coat = surface.coat.coat.value > 0.0f, has_fuzz = surface.fuzz_amount.value > 0.0f;
    Leaf common;
    common.set("roughness", surface.roughness);
    if (surface.anisotropy.value != 0.0f) common.set("anisotropy", surface.anisotropy);
    if (surface.film_thickness.value > 0.0f) {
        common.set("film_thickness", surface.film_thickness);
        common.set("film_ior", NumberInput(surface.film_ior));
    }
    if (largest(surface.emission.value) > 0.0f && surface.emission_scale.value > 0.0f) {
        common.set("emission", surface.emission);
        common.scale("emission", surface.emission_scale);
    }
    // Under a coat that does not cover all, fibers would be below it as well: there they are a layer of their own.
    if (has_fuzz && !has_coat) set_fuzz(common, surface);

    const auto dielectric = [&] {
        Leaf leaf = common;
        leaf.set("f0", surface.f0);
        leaf.scale("f0", surface.dielectric_reflection);
        return leaf;
    };
    // What each share leaves nothing of is not added.
    const auto opaque = [&] {
        Leaf leaf = dielectric();
        leaf.set("albedo", surface.base_color);
        return leaf.add_to(tree, "dielectric", surface.frame);
    };
    const auto translucent = [&] {
        Leaf leaf = dielectric();
        leaf.set("albedo", surface.subsurface_color);
        leaf.set("mean_free_path", surface.subsurface_path);
        leaf.scale("mean_free_path", surface.subsurface_path_scale);
        leaf.set("phase_anisotropy", NumberInput(limited(surface.subsurface_phase, -0.999f, 0.999f)));
        leaf.set("thickness", NumberInput(infinity));
        return leaf.add_to(tree, "subsurface", surface.frame);
    };
    const auto clear = [&] {
        Leaf leaf = dielectric();
        leaf.set("albedo", ColorInput(surface.transmission_albedo));
        leaf.set("mean_free_path", ColorInput(surface.transmission_path));
        leaf.set("phase_anisotropy", NumberInput(limited(surface.transmission_phase, -0.999f, 0.999f)));
        leaf.set("thickness", surface.thickness);
        return leaf.add_to(tree, "clear", surface.frame);
    };
    const auto metal = [&] {
        Leaf leaf = common;
        leaf.set("albedo", ColorInput());
        leaf.set("f0", surface.base_color);
        leaf.scale("f0", surface.metal_reflection);
        if (surface.metal_edge.value != glm::vec3(1.0f) || surface.metal_edge.texture.texture.present())
            leaf.set("f82", surface.metal_edge);
        return leaf.add_to(tree, "metal", surface.frame);
    };
    const auto mixed = [&](const NumberInput& amount, auto&& first, auto&& second) {
        if (!(amount.value > 0.0f)) return first();
        if (is_whole(amount)) return second();
        const NodeIndex a = first(), b = second();
        return mix(tree, a, b, amount);
    };
    const bool is_plain = !(surface.subsurface.value > 0.0f) && !(surface.transmission.value > 0.0f);
    NodeIndex root = mixed(
        surface.metallic,
        [&] {
            return mixed(
                surface.transmission, [&] { return mixed(surface.subsurface, opaque, translucent); }, clear);
        },
        metal);
    // Metal and opaque dielectric are one slab together; what has a medium is not.
    if (is_plain && tree.nodes[root].kind == NodeKind::mix) tree.nodes[root].parameter_blend = true;
    if (has_coat) {
        root = add(tree, surface.coat, root);
        if (has_fuzz) {
            Leaf fibers;
            fibers.set("f0", ColorInput());
            fibers.set("albedo", ColorInput());
            fibers.set("mean_free_path", ColorInput(glm::vec3(infinity)));
            fibers.set("thickness", NumberInput(coat_thickness));
            set_fuzz(fibers, surface);
            root = tree.layer(fibers.add_to(tree, "fuzz", surface.frame), root);
        }
    }
    return covered(tree, root, surface.opacity);
}

Surface surface_of(const DefaultLit& block) {
    return {.base_color = block.base_color,
            .metallic = block.metallic,
            .f0 = glm::vec3(0.08f),
            .dielectric_reflection = block.specular,
            .roughness = block.roughness,
            .anisotropy = block.anisotropy,
            .emission = block.emission,
            .opacity = block.opacity,
            .frame = block.frame};
}

// Both widths of the lobe are roughness^2 times a number.
void set_stretched_roughness(Surface& surface, const NumberInput& roughness, float along, float across) {
    surface.roughness = roughness;
    if (along == across) return;
    const float alpha = unit(roughness.value) * unit(roughness.value);
    const StretchedRoughness stretched = alphas_to_roughness(alpha * along, alpha * across);
    surface.roughness = {stretched.roughness, roughness.texture};
    surface.anisotropy = stretched.anisotropy;
}

// The color with its largest channel scaled to 1.
glm::vec3 tint_of(const glm::vec3& color) { return largest(color) > 0.0f ? color / largest(color) : glm::vec3(1.0f); }

glm::vec3 between(const glm::vec3& a, const glm::vec3& b, float t) { return a + (b - a) * unit(t); }


}  // namespace

NodeIndex add(Tree& tree, const DefaultLit& block) { return add(tree, surface_of(block)); }

NodeIndex add(Tree& tree, const Unlit& block) {
    Leaf leaf;
    leaf.set("f0", ColorInput());
    leaf.set("albedo", ColorInput());
    leaf.set("emission", block.emission);
    return covered(tree, leaf.add_to(tree, "unlit", 0), block.opacity);
}

NodeIndex add(Tree& tree, const CoatedLayer& block, NodeIndex base) {
    if (!(block.coat.value > 0.0f)) return tree.root = base;
    Leaf leaf;
    leaf.set("f0", ColorInput(glm::vec3(ior_to_f0(block.coat_ior))));
    leaf.set("albedo", ColorInput());
    leaf.set("roughness", block.coat_roughness);
    if (block.coat_anisotropy.value != 0.0f) leaf.set("anisotropy", block.coat_anisotropy);
    glm::vec3 once;
    for (int channel = 0; channel < 3; ++channel) once[channel] = std::sqrt(unit(block.coat_color[channel]));
    leaf.set("mean_free_path", ColorInput(transmittance_to_mean_free_path(once, coat_thickness)));
    leaf.set("thickness", NumberInput(coat_thickness));
    const char* name = block.coat_color == glm::vec3(1.0f) ? "clear coat" : "colored coat";
    const NodeIndex top = covered(tree, leaf.add_to(tree, name, block.coat_frame), block.coat);
    return tree.layer(top, base);
}

NodeIndex add(Tree& tree, const ClearCoat& block) {
    Surface surface = surface_of(block.base);
    surface.coat = {
        .coat = block.clear_coat, .coat_roughness = block.clear_coat_roughness, .coat_frame = block.coat_frame};
    return add(tree, surface);
}

NodeIndex add(Tree& tree, const Cloth& block) {
    return add(tree, Surface{.base_color = block.base_color,
                             .f0 = glm::vec3(0.08f),
                             .dielectric_reflection = block.specular,
                             .roughness = block.roughness,
                             .anisotropy = block.anisotropy,
                             .fuzz_amount = block.fuzz_amount,
                             .fuzz_color = block.fuzz_color,
                             .fuzz_roughness = block.fuzz_roughness,
                             .opacity = block.opacity,
                             .frame = block.frame});
}

NodeIndex add(Tree& tree, const StandardSurface& block) {
    const float thickness = limited(block.geometry_thickness.value, 1e-9f, 1e12f);
    const bool has_depth = block.transmission_depth > 0.0f;
    const glm::vec3 dielectric_f0(ior_to_f0(block.specular_ior));
    Surface surface{.base_color = {unit(block.base_color.value) * unit(block.base_weight), block.base_color.texture},
                    .metallic = block.base_metalness,
                    .f0 = {dielectric_f0 * unit(block.specular_color.value), block.specular_color.texture},
                    .dielectric_reflection = block.specular_weight,
                    .metal_reflection = block.specular_weight,
                    .metal_edge = block.specular_color,
                    .film_thickness = block.thin_film_thickness,
                    .film_ior = block.thin_film_ior,
                    .emission = block.emission_color,
                    .emission_scale = block.emission_luminance,
                    .subsurface = block.subsurface_weight,
                    .subsurface_color = block.subsurface_color,
                    .subsurface_path = unit(block.subsurface_radius_scale),
                    .subsurface_path_scale = block.subsurface_radius,
                    .subsurface_phase = block.subsurface_scatter_anisotropy,
                    .transmission = block.transmission_weight,
                    .transmission_path = transmittance_to_mean_free_path(
                        block.transmission_color, has_depth ? block.transmission_depth : thickness),
                    .transmission_phase = block.transmission_scatter_anisotropy,
                    .thickness = {thickness, block.geometry_thickness.texture},
                    .fuzz_amount = block.fuzz_weight,
                    .fuzz_color = block.fuzz_color,
                    .fuzz_roughness = block.fuzz_roughness,
                    .coat = {.coat = block.coat_weight,
                             .coat_color = block.coat_color,
                             .coat_roughness = block.coat_roughness,
                             .coat_ior = block.coat_ior,
                             .coat_frame = block.coat_frame},
                    .opacity = block.geometry_opacity,
                    .frame = block.frame};
    // OpenPBR: alpha along is roughness^2 sqrt(2 / (1 + (1 - anisotropy)^2)), across it (1 - anisotropy) times that.
    const float narrow = 1.0f - unit(block.specular_roughness_anisotropy);
    const float along = std::sqrt(2.0f / (1.0f + narrow * narrow));
    set_stretched_roughness(surface, block.specular_roughness, along, along * narrow);
    if (has_depth && largest(block.transmission_scatter) > 0.0f) {
        // The color is what extinction leaves, scattering a part of that; all of it where more is asked for.
        glm::vec3 single;
        for (int channel = 0; channel < 3; ++channel) {
            const float scattering = unit(block.transmission_scatter[channel]) / block.transmission_depth;
            const float extinction = std::max(1.0f / surface.transmission_path[channel], scattering);
            surface.transmission_path[channel] = 1.0f / extinction;
            single[channel] = std::isfinite(extinction) && extinction > 0.0f ? scattering / extinction : 0.0f;
        }
        surface.transmission_albedo =
            scattering_to_albedo(single, block.transmission_scatter_anisotropy, surface.f0.value);
    }
    return add(tree, surface);
}

NodeIndex add(Tree& tree, const Principled& block) {
    const glm::vec3 color = unit(block.base_color.value), tint = tint_of(color);
    const float thickness = limited(block.thickness.value, 1e-9f, 1e12f);
    Surface surface{
        .base_color = block.base_color,
        .metallic = block.metallic,
        .f0 = 0.08f * between(glm::vec3(1.0f), tint, block.specular_tint),
        .dielectric_reflection = block.specular,
        .emission = block.emission,
        .subsurface = block.subsurface,
        .subsurface_color = block.base_color,
        .subsurface_path = block.subsurface_radius,
        .transmission = block.transmission,
        .transmission_path = transmittance_to_mean_free_path(color, thickness),
        .thickness = {thickness, block.thickness.texture},
        .fuzz_amount = block.sheen,
        .fuzz_color = between(glm::vec3(1.0f), tint, block.sheen_tint),
        .fuzz_roughness = block.sheen_roughness,
        .coat = {.coat = block.clearcoat, .coat_roughness = block.clearcoat_roughness, .coat_frame = block.coat_frame},
        .opacity = block.opacity,
        .frame = block.frame};
    // Burley 2012: aspect = sqrt(1 - 0.9 anisotropic), alpha along is roughness^2 / aspect, across it times aspect.
    const float aspect = std::sqrt(1.0f - 0.9f * unit(block.anisotropic));
    set_stretched_roughness(surface, block.roughness, 1.0f / aspect, aspect);
    return add(tree, surface);
}

namespace {

/// An input of a block by name. Plain numbers and colors are those without textures.
template <typename Block>
struct Field {
    const char* name;
    float minimum, maximum;
    std::variant<NumberInput& (*)(Block&), ColorInput& (*)(Block&), float& (*)(Block&), glm::vec3& (*)(Block&),
                 std::uint32_t& (*)(Block&)>
        at;
    const char* meaning;
};

#define NACRE_INPUT(Block, field, minimum, maximum, meaning)                 \
    Field<Block> {                                                           \
#field, minimum, maximum, [](Block & b) -> auto& { return b.field; } \
        , meaning                                                            \
    }

#define NACRE_DEFAULT_LIT_INPUTS(INPUT)                                                                         \
    INPUT(base_color, 0, 1, "albedo of the dielectric, F0 of the metal"),                                       \
        INPUT(metallic, 0, 1, "share of the surface that is metal"),                                            \
        INPUT(specular, 0, 1, "F0 of the dielectric is 0.08 times this"), INPUT(roughness, 0, 1, "perceptual"), \
        INPUT(anisotropy, -1, 1, "along the tangent"), INPUT(emission, 0, infinity, "cd/m2"),                   \
        INPUT(opacity, 0, 1, "coverage"), INPUT(frame, 0, infinity, "which of the file's tangent frames")

#define NACRE_LIT(field, minimum, maximum, meaning) NACRE_INPUT(DefaultLit, field, minimum, maximum, meaning)
const Field<DefaultLit> default_lit[] = {NACRE_DEFAULT_LIT_INPUTS(NACRE_LIT)};
#undef NACRE_LIT

const Field<Unlit> unlit[] = {
    NACRE_INPUT(Unlit, emission, 0, infinity, "cd/m2"),
    NACRE_INPUT(Unlit, opacity, 0, 1, "coverage"),
};

const Field<CoatedLayer> coated_layer[] = {
    NACRE_INPUT(CoatedLayer, coat, 0, 1, "share of the surface that is coated"),
    NACRE_INPUT(CoatedLayer, coat_color, 0, 1, "tint of what lies below, seen and lit straight"),
    NACRE_INPUT(CoatedLayer, coat_roughness, 0, 1, "perceptual"),
    NACRE_INPUT(CoatedLayer, coat_ior, 1, infinity, "index of refraction"),
    NACRE_INPUT(CoatedLayer, coat_anisotropy, -1, 1, "along the tangent"),
    NACRE_INPUT(CoatedLayer, coat_frame, 0, infinity, "which of the file's tangent frames"),
};

#define NACRE_LIT(field, minimum, maximum, meaning)                                   \
    Field<ClearCoat> {                                                                \
#field, minimum, maximum, [](ClearCoat & b) -> auto& { return b.base.field; } \
        , meaning                                                                     \
    }
const Field<ClearCoat> clear_coat[] = {
    NACRE_DEFAULT_LIT_INPUTS(NACRE_LIT),
    NACRE_INPUT(ClearCoat, clear_coat, 0, 1, "share of the surface that is coated"),
    NACRE_INPUT(ClearCoat, clear_coat_roughness, 0, 1, "perceptual"),
    NACRE_INPUT(ClearCoat, coat_frame, 0, infinity, "the coat's tangent frame"),
};
#undef NACRE_LIT
#undef NACRE_DEFAULT_LIT_INPUTS

const Field<Cloth> cloth[] = {
    NACRE_INPUT(Cloth, base_color, 0, 1, "albedo of the weave"),
    NACRE_INPUT(Cloth, roughness, 0, 1, "perceptual, of the weave"),
    NACRE_INPUT(Cloth, specular, 0, 1, "F0 is 0.08 times this"),
    NACRE_INPUT(Cloth, fuzz_color, 0, 1, "reflectance of the fibers"),
    NACRE_INPUT(Cloth, fuzz_amount, 0, 1, "coverage of the fibers"),
    NACRE_INPUT(Cloth, fuzz_roughness, 0, 1, "less is velvet, 1 is dust-like"),
    NACRE_INPUT(Cloth, anisotropy, -1, 1, "along the threads"),
    NACRE_INPUT(Cloth, opacity, 0, 1, "coverage"),
    NACRE_INPUT(Cloth, frame, 0, infinity, "which of the file's tangent frames"),
};

#define NACRE_STANDARD_INPUTS                                                                                   \
    NACRE_INPUT(StandardSurface, base_weight, 0, 1, "scales base_color"),                                       \
        NACRE_INPUT(StandardSurface, base_color, 0, 1, "albedo of the dielectric, F0 of the metal"),            \
        NACRE_INPUT(StandardSurface, base_metalness, 0, 1, "share of the surface that is metal"),               \
        NACRE_INPUT(StandardSurface, specular_weight, 0, 1, "scales the reflection of both"),                   \
        NACRE_INPUT(StandardSurface, specular_color, 0, 1, "tint of the dielectric's F0, of the metal's edge"), \
        NACRE_INPUT(StandardSurface, specular_roughness, 0, 1, "perceptual"),                                   \
        NACRE_INPUT(StandardSurface, specular_roughness_anisotropy, 0, 1, "along the tangent"),                 \
        NACRE_INPUT(StandardSurface, specular_ior, 1, infinity, "index of refraction"),                         \
        NACRE_INPUT(StandardSurface, subsurface_weight, 0, 1, "share of the dielectric that is translucent"),   \
        NACRE_INPUT(StandardSurface, subsurface_color, 0, 1, "its albedo"),                                     \
        NACRE_INPUT(StandardSurface, subsurface_radius, 0, infinity, "its mean free path, meters"),             \
        NACRE_INPUT(StandardSurface, subsurface_radius_scale, 0, 1, "for each channel"),                        \
        NACRE_INPUT(StandardSurface, subsurface_scatter_anisotropy, -1, 1, "mean cosine of scattering"),        \
        NACRE_INPUT(StandardSurface, coat_weight, 0, 1, "share of the surface that is coated"),                 \
        NACRE_INPUT(StandardSurface, coat_color, 0, 1, "tint of what lies below, seen and lit straight"),       \
        NACRE_INPUT(StandardSurface, coat_roughness, 0, 1, "perceptual"),                                       \
        NACRE_INPUT(StandardSurface, coat_ior, 1, infinity, "index of refraction"),                             \
        NACRE_INPUT(StandardSurface, fuzz_weight, 0, 1, "coverage of fibers on top"),                           \
        NACRE_INPUT(StandardSurface, fuzz_color, 0, 1, "reflectance of the fibers"),                            \
        NACRE_INPUT(StandardSurface, fuzz_roughness, 0, 1, "less is velvet, 1 is dust-like"),                   \
        NACRE_INPUT(StandardSurface, thin_film_thickness, 0, infinity, "meters; 0: none"),                      \
        NACRE_INPUT(StandardSurface, thin_film_ior, 1, infinity, "index of refraction"),                        \
        NACRE_INPUT(StandardSurface, emission_luminance, 0, infinity, "cd/m2"),                                 \
        NACRE_INPUT(StandardSurface, emission_color, 0, 1, "scales emission_luminance"),                        \
        NACRE_INPUT(StandardSurface, geometry_opacity, 0, 1, "coverage"),                                       \
        NACRE_INPUT(StandardSurface, frame, 0, infinity, "which of the file's tangent frames"),                 \
        NACRE_INPUT(StandardSurface, coat_frame, 0, infinity, "the coat's tangent frame")

const Field<StandardSurface> standard_surface_opaque[] = {NACRE_STANDARD_INPUTS};
const Field<StandardSurface> standard_surface_translucent[] = {
    NACRE_STANDARD_INPUTS,
    NACRE_INPUT(StandardSurface, transmission_weight, 0, 1, "share of the dielectric that is clear"),
    NACRE_INPUT(StandardSurface, transmission_color, 0, 1, "of white light after transmission_depth"),
    NACRE_INPUT(StandardSurface, transmission_depth, 0, infinity, "meters; 0: geometry_thickness"),
    NACRE_INPUT(StandardSurface, transmission_scatter, 0, 1, "scattering coefficient times transmission_depth"),
    NACRE_INPUT(StandardSurface, transmission_scatter_anisotropy, -1, 1, "mean cosine of scattering"),
    NACRE_INPUT(StandardSurface, geometry_thickness, 0, infinity, "meters of the clear medium"),
};
#undef NACRE_STANDARD_INPUTS

const Field<Principled> principled[] = {
    NACRE_INPUT(Principled, base_color, 0, 1, "albedo of the dielectric, F0 of the metal"),
    NACRE_INPUT(Principled, metallic, 0, 1, "share of the surface that is metal"),
    NACRE_INPUT(Principled, specular, 0, 1, "F0 of the dielectric is 0.08 times this"),
    NACRE_INPUT(Principled, specular_tint, 0, 1, "of that, towards the base color"),
    NACRE_INPUT(Principled, roughness, 0, 1, "perceptual"),
    NACRE_INPUT(Principled, anisotropic, 0, 1, "along the tangent"),
    NACRE_INPUT(Principled, subsurface, 0, 1, "share of the dielectric that is translucent"),
    NACRE_INPUT(Principled, subsurface_radius, 0, infinity, "its mean free path, meters"),
    NACRE_INPUT(Principled, sheen, 0, 1, "coverage of fibers on top"),
    NACRE_INPUT(Principled, sheen_tint, 0, 1, "of the fibers, towards the base color"),
    NACRE_INPUT(Principled, sheen_roughness, 0, 1, "less is velvet, 1 is dust-like"),
    NACRE_INPUT(Principled, clearcoat, 0, 1, "share of the surface that is coated"),
    NACRE_INPUT(Principled, clearcoat_roughness, 0, 1, "perceptual"),
    NACRE_INPUT(Principled, transmission, 0, 1, "share of the dielectric that is clear"),
    NACRE_INPUT(Principled, thickness, 0, infinity, "meters of the clear medium"),
    NACRE_INPUT(Principled, emission, 0, infinity, "cd/m2"),
    NACRE_INPUT(Principled, opacity, 0, 1, "coverage"),
    NACRE_INPUT(Principled, frame, 0, infinity, "which of the file's tangent frames"),
    NACRE_INPUT(Principled, coat_frame, 0, infinity, "the coat's tangent frame"),
};
#undef NACRE_INPUT

template <typename Block>
BlockInput input_of(const Field<Block>& field) {
    const std::size_t kind = field.at.index();
    return {.name = field.name,
            .meaning = field.meaning,
            .kind = kind == 4                ? BlockInputKind::frame
                    : kind == 1 || kind == 3 ? BlockInputKind::color
                                             : BlockInputKind::number,
            .takes_texture = kind < 2,
            .minimum = field.minimum,
            .maximum = field.maximum};
}

void read(const NumberInput& input, BlockValue& value) {
    value = {.value = glm::vec3(input.value), .texture = input.texture};
}
void read(const ColorInput& input, BlockValue& value) { value = {.value = input.value, .texture = input.texture}; }
void read(float input, BlockValue& value) { value.value = glm::vec3(input); }
void read(const glm::vec3& input, BlockValue& value) { value.value = input; }
void read(std::uint32_t input, BlockValue& value) { value.frame = input; }

void write(NumberInput& input, const BlockValue& value) { input = {value.value.x, value.texture}; }
void write(ColorInput& input, const BlockValue& value) { input = {value.value, value.texture}; }
void write(float& input, const BlockValue& value) { input = value.value.x; }
void write(glm::vec3& input, const BlockValue& value) { input = value.value; }
void write(std::uint32_t& input, const BlockValue& value) { input = value.frame; }

template <const auto& fields, typename Block>
NodeIndex add_by_name(Tree& tree, std::span<const BlockValue> values, NodeIndex base) {
    Block block;
    for (std::size_t i = 0; i < std::size(fields); ++i)
        std::visit([&](const auto& at) { write(at(block), values[i]); }, fields[i].at);
    if constexpr (std::is_same_v<Block, CoatedLayer>)
        return add(tree, block, base);
    else
        return add(tree, block);
}

template <const auto& fields, typename Block>
BuildingBlock block_of(std::string_view name, std::string_view meaning, Block block) {
    BuildingBlock result{.name = name,
                         .meaning = meaning,
                         .has_base = std::is_same_v<Block, CoatedLayer>,
                         .add = add_by_name<fields, Block>};
    for (const auto& field : fields) {
        result.inputs.push_back(input_of(field));
        BlockValue value;
        std::visit([&](const auto& at) { read(at(block), value); }, field.at);
        result.defaults.push_back(value);
    }
    return result;
}

}  // namespace

std::span<const BuildingBlock> building_blocks() {
    static const std::vector<BuildingBlock> blocks{
        block_of<default_lit>("default_lit", "metal and dielectric by metallic, specular and roughness", DefaultLit{}),
        block_of<unlit>("unlit", "only light of its own", Unlit{}),
        block_of<coated_layer>("coated_layer", "a clear or colored dielectric layer over a node", CoatedLayer{}),
        block_of<clear_coat>("clear_coat", "default_lit under a clear coat", ClearCoat{}),
        block_of<cloth>("cloth", "a woven dielectric with fibers that stand on it", Cloth{}),
        block_of<standard_surface_opaque>("standard_surface_opaque", "OpenPBR without transmission", StandardSurface{}),
        block_of<standard_surface_translucent>("standard_surface_translucent",
                                               "OpenPBR, clear unless it says otherwise",
                                               StandardSurface{.transmission_weight = 1.0f}),
        block_of<principled>("principled", "Disney's principled model", Principled{}),
    };
    return blocks;
}

const BuildingBlock* find_building_block(std::string_view name) {
    const auto found = std::ranges::find(building_blocks(), name, &BuildingBlock::name);
    return found == building_blocks().end() ? nullptr : &*found;
}

}  // namespace nacre::materials
