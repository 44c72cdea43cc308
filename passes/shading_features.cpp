// SPDX-License-Identifier: Apache-2.0
#include "passes/shading_features.h"

#include <array>
#include <string>

namespace nacre::passes {
namespace {

constexpr std::array<const char*, texture_slot_count> slot_defines = {
    "BASE_COLOR_TEXTURE", "METALLIC_ROUGHNESS_TEXTURE", "NORMAL_TEXTURE",        "OCCLUSION_TEXTURE",
    "EMISSION_TEXTURE",   "SPECULAR_TEXTURE",           "SPECULAR_COLOR_TEXTURE"};
constexpr std::array<const char*, attribute_count> attribute_defines = {"",        "HAS_NORMALS", "HAS_TANGENTS",
                                                                        "HAS_UV0", "HAS_UV1",     "HAS_COLORS",
                                                                        ""};

bool any_component(const glm::vec3& v) { return v.x != 0.0f || v.y != 0.0f || v.z != 0.0f; }

void add_attribute_defines(std::vector<rhi::ShaderDefine>& defines, std::uint32_t attributes) {
    for (std::uint32_t i = 1; i < attribute_count; ++i) {
        if ((attributes & (1u << i)) != 0 && attribute_defines[i][0] != 0) defines.push_back({attribute_defines[i]});
    }
}

/// Texture coordinates and tangents follow from the textures that are read.
void derive_attributes(ShadingFeatures& features) {
    const std::uint32_t derived =
        attribute_bit(Attribute::uv0) | attribute_bit(Attribute::uv1) | attribute_bit(Attribute::tangent);
    features.attributes &= ~derived;
    features.second_uv &= features.textures;
    if ((features.textures & ~features.second_uv) != 0) features.attributes |= attribute_bit(Attribute::uv0);
    if (features.second_uv != 0) features.attributes |= attribute_bit(Attribute::uv1);
    if ((features.textures & texture_bit(TextureSlot::normal)) != 0)
        features.attributes |= attribute_bit(Attribute::tangent);
    features.attributes |= features.kind_attributes;
    // A kind's own rows lie behind those that move textures.
    if (features.textures == 0 && features.sideband == 0) features.transforms = false;
}

}  // namespace

const materials::TextureReference& texture_of(const materials::SingleSlab& slab, TextureSlot slot) {
    switch (slot) {
        case TextureSlot::base_color: return slab.base_color_texture;
        case TextureSlot::metallic_roughness: return slab.metallic_roughness_texture;
        case TextureSlot::normal: return slab.normal_texture;
        case TextureSlot::occlusion: return slab.occlusion_texture;
        case TextureSlot::emission: return slab.emission_texture;
        case TextureSlot::specular: return slab.specular_texture;
        case TextureSlot::specular_color: break;
    }
    return slab.specular_color_texture;
}

bool moves_textures(const materials::SingleSlab& slab) {
    for (std::uint32_t i = 0; i < texture_slot_count; ++i) {
        const materials::TextureReference& texture = texture_of(slab, static_cast<TextureSlot>(i));
        if (texture.present() && !texture.transform.is_identity()) return true;
    }
    return false;
}

ShadingFeatures features_of(const materials::SingleSlab& slab, const scene::Primitive& primitive, std::uint32_t kind,
                            const materials::CustomMaterialData* custom) {
    ShadingFeatures features;
    features.attributes = attribute_bit(Attribute::position);
    features.unlit = slab.unlit || primitive.normals.empty();
    features.double_sided = slab.double_sided && !features.unlit;
    features.points = primitive.topology == scene::Topology::point_list;
    features.thin = primitive.topology != scene::Topology::triangle_list;
    features.emits = any_component(slab.emission) && !slab.unlit;
    if (!features.unlit) features.attributes |= attribute_bit(Attribute::normal);
    if (features.thin) features.attributes |= attribute_bit(Attribute::corner);
    if (!primitive.colors.empty()) features.attributes |= attribute_bit(Attribute::color);

    for (std::uint32_t i = 0; i < texture_slot_count; ++i) {
        const auto slot = static_cast<TextureSlot>(i);
        const materials::TextureReference& texture = texture_of(slab, slot);
        if (!texture.present()) continue;
        if (texture.uv_set == 0 ? primitive.uv0.empty() : primitive.uv1.empty()) continue;
        if (slot == TextureSlot::normal && (primitive.tangents.empty() || features.unlit)) continue;
        if (slot == TextureSlot::emission && !features.emits) continue;
        if (features.unlit && slot != TextureSlot::base_color && slot != TextureSlot::emission) continue;
        features.textures |= texture_bit(slot);
        if (texture.uv_set == 1) features.second_uv |= texture_bit(slot);
        if (!texture.transform.is_identity()) features.transforms = true;
    }
    if (kind != 0) {
        features.kind = kind;
        features.sideband = static_cast<std::uint32_t>(custom->sideband.size());
        if (features.sideband > 0) features.transforms = moves_textures(slab);
        const auto reads = [&](std::uint32_t bit, bool has, Attribute attribute) {
            if ((custom->reads & bit) != 0 && has) features.kind_attributes |= attribute_bit(attribute);
        };
        reads(materials::reads_uv0, !primitive.uv0.empty(), Attribute::uv0);
        reads(materials::reads_uv1, !primitive.uv1.empty(), Attribute::uv1);
        reads(materials::reads_tangents, !primitive.tangents.empty(), Attribute::tangent);
        if ((custom->reads & materials::reads_colors) == 0) features.attributes &= ~attribute_bit(Attribute::color);
    }
    derive_attributes(features);
    return features;
}

ShadingFeatures restricted(ShadingFeatures features, std::uint32_t textures, bool with_normals, bool with_colors) {
    const bool is_emission_read = (textures & texture_bit(TextureSlot::emission)) != 0;
    if (features.kind != 0) textures = all_textures, with_normals = with_colors = true;
    features.textures &= textures;
    if (!is_emission_read) features.emits = false;
    if (!with_normals) {
        features.attributes &= ~attribute_bit(Attribute::normal);
        features.double_sided = false;
        features.textures &= ~texture_bit(TextureSlot::normal);
    }
    if (!with_colors) features.attributes &= ~attribute_bit(Attribute::color);
    derive_attributes(features);
    return features;
}

std::vector<rhi::ShaderDefine> vertex_defines(const ShadingFeatures& features) {
    std::vector<rhi::ShaderDefine> defines;
    add_attribute_defines(defines, features.attributes);
    if (features.points) defines.push_back({"POINTS"});
    if (features.thin) defines.push_back({"THIN"});
    if (features.kind != 0) defines.push_back({"HAS_POSITIONS"});
    return defines;
}

std::vector<rhi::ShaderDefine> fragment_defines(const ShadingFeatures& features) {
    std::vector<rhi::ShaderDefine> defines;
    add_attribute_defines(defines, features.attributes);
    for (std::uint32_t i = 0; i < texture_slot_count; ++i) {
        if ((features.textures & (1u << i)) == 0) continue;
        defines.push_back({slot_defines[i], (features.second_uv & (1u << i)) != 0 ? "1" : "0"});
    }
    if (features.transforms) defines.push_back({"TEXTURE_TRANSFORMS"});
    const std::uint32_t sideband = features.sideband + (features.transforms ? 2 * texture_slot_count : 0);
    if (sideband > 0) defines.push_back({"MATERIAL_SIDEBAND", std::to_string(sideband)});
    if (features.kind != 0) defines.push_back({"MATERIAL_KIND", std::to_string(features.kind)});
    if (features.double_sided) defines.push_back({"DOUBLE_SIDED"});
    if (features.unlit) defines.push_back({"UNLIT"});
    if (features.emits) defines.push_back({"HAS_EMISSION"});
    return defines;
}

}  // namespace nacre::passes
