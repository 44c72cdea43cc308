// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/material.h"

#include <fmt/format.h>

#include <algorithm>

namespace nacre::scene::gltf {
namespace {

using namespace nacre::materials;  // The names of the extensions, all over this file.

/// Reads one material: knows its place, and gathers which texture coordinates it uses.
class MaterialReader {
  public:
    MaterialReader(Document& document, ImageTable& images, std::size_t default_sampler, std::string element)
        : document_(document), images_(images), default_sampler_(default_sampler), element_(std::move(element)) {}

    ImportedMaterial read(const JsonView& json);

  private:
    /// A texture input: `textureInfo` of glTF, or nothing where the key is absent.
    TextureReference texture(const JsonView& parent, std::string_view key, ColorSpace color_space);
    void read_extension(const std::string& name, const JsonView& json, MaterialDescription& material);
    /// Points uv_set at 0 or 1 for at most two sets of the file.
    void assign_uv_sets(ImportedMaterial& material);
    float ranged(const JsonView& json, std::string_view key, float fallback, float low, float high);

    Document& document_;
    ImageTable& images_;
    std::size_t default_sampler_;
    std::string element_;
};

constexpr float unbounded = std::numeric_limits<float>::max();

float MaterialReader::ranged(const JsonView& json, std::string_view key, float fallback, float low, float high) {
    const float value = json.real(key, fallback);
    if (value >= low && value <= high) return value;
    document_.warnings().add(fmt::format("{}: {} is {}, outside its range, and was clamped", element_, key, value));
    return std::clamp(value, low, high);
}

TextureReference MaterialReader::texture(const JsonView& parent, std::string_view key, ColorSpace color_space) {
    TextureReference reference;
    const auto info = parent.find(key);
    if (!info) return reference;
    const auto& textures = document_.list("textures");
    const JsonView& texture = textures[info->index("index", textures.size(), "texture")];
    const auto source = texture.find_index("source", document_.list("images").size(), "image");
    if (!source) {
        document_.warnings().add(fmt::format("{}: {} has no picture that can be read and was left out", element_, key));
        return reference;
    }
    reference.image = images_.use(*source, color_space);
    const auto sampler = texture.find_index("sampler", document_.list("samplers").size(), "sampler");
    reference.sampler = static_cast<int>(sampler.value_or(default_sampler_));
    std::uint64_t uv_set = info->whole("texCoord", 0);
    if (key == "normalTexture" || key == "clearcoatNormalTexture") reference.scale = info->real("scale", 1.0f);
    if (key == "occlusionTexture") reference.scale = ranged(*info, "strength", 1.0f, 0.0f, 1.0f);

    if (const auto extensions = info->find("extensions")) {
        if (const auto transform = extensions->find("KHR_texture_transform")) {
            reference.transform.offset = transform->vector("offset", glm::vec2(0.0f));
            reference.transform.rotation = transform->real("rotation", 0.0f);
            reference.transform.scale = transform->vector("scale", glm::vec2(1.0f));
            uv_set = transform->whole("texCoord", uv_set);
        }
    }
    reference.uv_set = static_cast<int>(std::min<std::uint64_t>(uv_set, 1'000'000));
    return reference;
}

void MaterialReader::read_extension(const std::string& name, const JsonView& json, MaterialDescription& material) {
    const auto linear = ColorSpace::linear;
    const auto srgb = ColorSpace::srgb;
    if (name == "KHR_materials_unlit") {
        material.unlit = true;
    } else if (name == "KHR_materials_emissive_strength") {
        material.emissive_strength = ranged(json, "emissiveStrength", 1.0f, 0.0f, unbounded);
    } else if (name == "KHR_materials_ior") {
        const float ior = json.real("ior", 1.5f);
        material.ior = ior == 0.0f ? ior : ranged(json, "ior", 1.5f, 1.0f, unbounded);
    } else if (name == "KHR_materials_dispersion") {
        material.dispersion = ranged(json, "dispersion", 0.0f, 0.0f, unbounded);
    } else if (name == "KHR_materials_clearcoat") {
        material.clearcoat = Clearcoat{.factor = ranged(json, "clearcoatFactor", 0.0f, 0.0f, 1.0f),
                                       .texture = texture(json, "clearcoatTexture", linear),
                                       .roughness = ranged(json, "clearcoatRoughnessFactor", 0.0f, 0.0f, 1.0f),
                                       .roughness_texture = texture(json, "clearcoatRoughnessTexture", linear),
                                       .normal_texture = texture(json, "clearcoatNormalTexture", linear)};
    } else if (name == "KHR_materials_sheen") {
        material.sheen = Sheen{.color = json.vector("sheenColorFactor", glm::vec3(0.0f)),
                               .color_texture = texture(json, "sheenColorTexture", srgb),
                               .roughness = ranged(json, "sheenRoughnessFactor", 0.0f, 0.0f, 1.0f),
                               .roughness_texture = texture(json, "sheenRoughnessTexture", linear)};
    } else if (name == "KHR_materials_anisotropy") {
        material.anisotropy = Anisotropy{.strength = ranged(json, "anisotropyStrength", 0.0f, 0.0f, 1.0f),
                                         .rotation = json.real("anisotropyRotation", 0.0f),
                                         .texture = texture(json, "anisotropyTexture", linear)};
    } else if (name == "KHR_materials_transmission") {
        material.transmission = Transmission{.factor = ranged(json, "transmissionFactor", 0.0f, 0.0f, 1.0f),
                                             .texture = texture(json, "transmissionTexture", linear)};
    } else if (name == "KHR_materials_volume") {
        material.volume = Volume{.thickness = ranged(json, "thicknessFactor", 0.0f, 0.0f, unbounded),
                                 .thickness_texture = texture(json, "thicknessTexture", linear),
                                 .attenuation_color = json.vector("attenuationColor", glm::vec3(1.0f))};
        if (json.has("attenuationDistance")) {
            material.volume->attenuation_distance = ranged(json, "attenuationDistance", 1.0f, 0.0f, unbounded);
        }
    } else if (name == "KHR_materials_specular") {
        material.specular = Specular{.factor = ranged(json, "specularFactor", 1.0f, 0.0f, 1.0f),
                                     .texture = texture(json, "specularTexture", linear),
                                     .color = json.vector("specularColorFactor", glm::vec3(1.0f)),
                                     .color_texture = texture(json, "specularColorTexture", srgb)};
    } else if (name == "KHR_materials_iridescence") {
        constexpr float meters_per_nanometer = 1e-9f;
        material.iridescence =
            Iridescence{.factor = ranged(json, "iridescenceFactor", 0.0f, 0.0f, 1.0f),
                        .texture = texture(json, "iridescenceTexture", linear),
                        .ior = ranged(json, "iridescenceIor", 1.3f, 1.0f, unbounded),
                        .thickness_minimum = meters_per_nanometer * json.real("iridescenceThicknessMinimum", 100.0f),
                        .thickness_maximum = meters_per_nanometer * json.real("iridescenceThicknessMaximum", 400.0f),
                        .thickness_texture = texture(json, "iridescenceThicknessTexture", linear)};
    } else if (name == "KHR_materials_diffuse_transmission") {
        material.diffuse_transmission =
            DiffuseTransmission{.factor = ranged(json, "diffuseTransmissionFactor", 0.0f, 0.0f, 1.0f),
                                .texture = texture(json, "diffuseTransmissionTexture", linear),
                                .color = json.vector("diffuseTransmissionColorFactor", glm::vec3(1.0f)),
                                .color_texture = texture(json, "diffuseTransmissionColorTexture", srgb)};
    } else if (name == "KHR_materials_pbrSpecularGlossiness") {
        material.specular_glossiness =
            SpecularGlossiness{.diffuse = json.vector("diffuseFactor", glm::vec4(1.0f)),
                               .diffuse_texture = texture(json, "diffuseTexture", srgb),
                               .specular = json.vector("specularFactor", glm::vec3(1.0f)),
                               .glossiness = ranged(json, "glossinessFactor", 1.0f, 0.0f, 1.0f),
                               .specular_glossiness_texture = texture(json, "specularGlossinessTexture", srgb)};
    } else {
        material.other_extensions.push_back({printable(name), json.dump()});
    }
}

void MaterialReader::assign_uv_sets(ImportedMaterial& material) {
    std::vector<std::uint32_t> used;
    for_each_texture(material.description, [&](TextureReference& reference, bool) {
        const auto set = static_cast<std::uint32_t>(reference.uv_set);
        if (std::find(used.begin(), used.end(), set) == used.end()) used.push_back(set);
    });
    std::sort(used.begin(), used.end());
    if (used.empty() || used.back() <= 1) return;
    material.uv_sources = {used[0], used.size() > 1 ? used[1] : used[0] + 1};
    for_each_texture(material.description, [&](TextureReference& reference, bool) {
        const auto set = static_cast<std::uint32_t>(reference.uv_set);
        reference.uv_set = set == material.uv_sources[1] ? 1 : 0;
        if (set != material.uv_sources[0] && set != material.uv_sources[1]) {
            document_.warnings().add(
                fmt::format("{}: it uses more than two sets of texture coordinates; TEXCOORD_{} "
                            "was replaced by TEXCOORD_{}",
                            element_, set, material.uv_sources[0]));
        }
    });
}

ImportedMaterial MaterialReader::read(const JsonView& json) {
    ImportedMaterial imported;
    MaterialDescription& material = imported.description;
    material.name = printable(json.text("name", ""), 200);
    if (const auto core = json.find("pbrMetallicRoughness")) {
        material.base_color = core->vector("baseColorFactor", glm::vec4(1.0f));
        material.base_color_texture = texture(*core, "baseColorTexture", ColorSpace::srgb);
        material.metallic = ranged(*core, "metallicFactor", 1.0f, 0.0f, 1.0f);
        material.roughness = ranged(*core, "roughnessFactor", 1.0f, 0.0f, 1.0f);
        material.metallic_roughness_texture = texture(*core, "metallicRoughnessTexture", ColorSpace::linear);
    }
    material.normal_texture = texture(json, "normalTexture", ColorSpace::linear);
    material.occlusion_texture = texture(json, "occlusionTexture", ColorSpace::linear);
    material.emissive = json.vector("emissiveFactor", glm::vec3(0.0f));
    material.emissive_texture = texture(json, "emissiveTexture", ColorSpace::srgb);

    const std::string alpha_mode = json.text("alphaMode", "OPAQUE");
    if (alpha_mode == "MASK") {
        material.alpha_mode = AlphaMode::mask;
    } else if (alpha_mode == "BLEND") {
        material.alpha_mode = AlphaMode::blend;
    } else if (alpha_mode != "OPAQUE") {
        document_.warnings().add(
            fmt::format("{}: alphaMode '{}' is not known; OPAQUE was used", element_, printable(alpha_mode)));
    }
    material.alpha_cutoff = ranged(json, "alphaCutoff", 0.5f, 0.0f, unbounded);
    material.double_sided = json.flag("doubleSided", false);

    if (const auto extensions = json.find("extensions")) {
        for (const std::string& name : extensions->keys()) {
            const JsonView extension = extensions->at(name);
            read_extension(name, extension, material);
        }
    }
    if (const auto extras = json.find("extras")) material.other_extensions.push_back({"extras", extras->dump()});
    assign_uv_sets(imported);
    return imported;
}

Wrap read_wrap(const JsonView& json, std::string_view key) {
    switch (json.whole(key, 10497)) {
        case 33071: return Wrap::clamp_to_edge;
        case 33648: return Wrap::mirrored_repeat;
        case 10497: return Wrap::repeat;
        default: json.at(key).reject_as("a wrap mode (33071, 33648 or 10497)");
    }
}

}  // namespace

std::vector<Sampler> read_samplers(Document& document) {
    std::vector<Sampler> samplers;
    for (const JsonView& json : document.list("samplers")) {
        Sampler sampler{.wrap_u = read_wrap(json, "wrapS"), .wrap_v = read_wrap(json, "wrapT")};
        switch (json.whole("magFilter", 9729)) {
            case 9728: sampler.magnification = Filter::nearest; break;
            case 9729: break;
            default: json.at("magFilter").reject_as("a filter (9728 or 9729)");
        }
        switch (json.whole("minFilter", 9987)) {
            case 9728: sampler.minification = Filter::nearest, sampler.mip = MipFilter::none; break;
            case 9729: sampler.minification = Filter::linear, sampler.mip = MipFilter::none; break;
            case 9984: sampler.minification = Filter::nearest, sampler.mip = MipFilter::nearest; break;
            case 9985: sampler.minification = Filter::linear, sampler.mip = MipFilter::nearest; break;
            case 9986: sampler.minification = Filter::nearest, sampler.mip = MipFilter::linear; break;
            case 9987: break;
            default: json.at("minFilter").reject_as("a filter (9728, 9729 or 9984 to 9987)");
        }
        samplers.push_back(sampler);
    }
    samplers.emplace_back();
    return samplers;
}

std::vector<ImportedMaterial> read_materials(Document& document, ImageTable& images, std::size_t default_sampler) {
    std::vector<ImportedMaterial> result;
    const auto& list = document.list("materials");
    for (std::size_t index = 0; index < list.size(); ++index) {
        MaterialReader reader(document, images, default_sampler, label("material", index, list[index]));
        result.push_back(reader.read(list[index]));
    }
    return result;
}

}  // namespace nacre::scene::gltf
