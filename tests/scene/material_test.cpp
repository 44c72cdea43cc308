// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/image.h"
#include "tests/scene/gltf_builder.h"
#include "tests/scene/scene_checks.h"

namespace nacre::scene {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string png_uri(std::uint32_t width = 2, std::uint32_t height = 1, std::vector<std::uint8_t> rgba = {}) {
    if (rgba.empty()) rgba.assign(std::size_t{4} * width * height, 200);
    const auto png = encode_png({.width = width, .height = height, .channels = 4, .bytes = rgba});
    EXPECT_TRUE(png);
    return "data:image/png;base64," + encode_base64(*png);
}

/// A triangle with `material`, five textures of five pictures, and texture coordinates 0 to 3.
GltfBuilder file_with(const char* material) {
    GltfBuilder file;
    file.json["materials"] = {nlohmann::json::parse(material)};
    file.primitive()["material"] = 0;
    for (int i = 0; i < 5; ++i) {
        file.json["images"].push_back({{"uri", png_uri()}, {"name", "picture " + std::to_string(i)}});
        file.json["textures"].push_back({{"source", i}});
    }
    for (int set = 0; set < 4; ++set) {
        const auto value = static_cast<float>(set);
        file.primitive()["attributes"]["TEXCOORD_" + std::to_string(set)] =
            file.add_accessor<float>({value, 0, value, 1, value, 0.5f}, "VEC2");
    }
    return file;
}

std::string picture(const Scene& scene, const materials::TextureReference& texture) {
    return texture.present() ? scene.images.at(texture.image).name : "";
}

TEST(Material, CoreValuesAreKept) {
    const Scene scene = load_valid(file_with(R"({
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.6, "roughnessFactor": 0.7,
            "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
        "normalTexture": {"index": 2, "scale": 0.8, "texCoord": 1}, "occlusionTexture": {"index": 1, "strength": 0.9},
        "emissiveTexture": {"index": 3}})"));
    const auto& material = scene.materials.at(0);
    EXPECT_EQ(material.name, "all");
    EXPECT_EQ(material.base_color, glm::vec4(0.1f, 0.2f, 0.3f, 0.4f));
    EXPECT_EQ(material.metallic, 0.6f);
    EXPECT_EQ(material.roughness, 0.7f);
    EXPECT_EQ(material.emissive, glm::vec3(1, 0.5f, 0));
    EXPECT_EQ(material.alpha_mode, materials::AlphaMode::mask);
    EXPECT_EQ(material.alpha_cutoff, 0.25f);
    EXPECT_TRUE(material.double_sided);
    EXPECT_EQ(picture(scene, material.base_color_texture), "picture 0");
    EXPECT_EQ(picture(scene, material.metallic_roughness_texture), "picture 1");
    EXPECT_EQ(picture(scene, material.normal_texture), "picture 2");
    EXPECT_EQ(picture(scene, material.occlusion_texture), "picture 1");
    EXPECT_EQ(picture(scene, material.emissive_texture), "picture 3");
    EXPECT_EQ(material.normal_texture.scale, 0.8f);
    EXPECT_EQ(material.normal_texture.uv_set, 1);
    EXPECT_EQ(material.occlusion_texture.scale, 0.9f);
    EXPECT_EQ(scene.images.size(), 4u) << "picture 4 is used by nothing and not decoded";
}

TEST(Material, EveryExtensionIsKept) {
    const Scene scene = load_valid(file_with(R"({"extensions": {
        "KHR_materials_unlit": {},
        "KHR_materials_emissive_strength": {"emissiveStrength": 5},
        "KHR_materials_ior": {"ior": 1.8},
        "KHR_materials_dispersion": {"dispersion": 0.3},
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.1, "clearcoatTexture": {"index": 0}, "clearcoatRoughnessFactor": 0.2,
            "clearcoatRoughnessTexture": {"index": 1}, "clearcoatNormalTexture": {"index": 2, "scale": 0.4}},
        "KHR_materials_sheen": {"sheenColorFactor": [0.1, 0.2, 0.3], "sheenColorTexture": {"index": 0},
            "sheenRoughnessFactor": 0.5, "sheenRoughnessTexture": {"index": 1}},
        "KHR_materials_anisotropy": {"anisotropyStrength": 0.6, "anisotropyRotation": 1.5, "anisotropyTexture": {"index": 3}},
        "KHR_materials_transmission": {"transmissionFactor": 0.7, "transmissionTexture": {"index": 1}},
        "KHR_materials_volume": {"thicknessFactor": 2, "thicknessTexture": {"index": 2}, "attenuationDistance": 3,
            "attenuationColor": [0.9, 0.8, 0.7]},
        "KHR_materials_specular": {"specularFactor": 0.8, "specularTexture": {"index": 1},
            "specularColorFactor": [2, 1, 0.5], "specularColorTexture": {"index": 4}},
        "KHR_materials_iridescence": {"iridescenceFactor": 0.9, "iridescenceTexture": {"index": 1}, "iridescenceIor": 1.4,
            "iridescenceThicknessMinimum": 200, "iridescenceThicknessMaximum": 500, "iridescenceThicknessTexture": {"index": 2}},
        "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.25, "diffuseTransmissionTexture": {"index": 1},
            "diffuseTransmissionColorFactor": [0.3, 0.2, 0.1], "diffuseTransmissionColorTexture": {"index": 0}},
        "KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.1, 0.2, 0.3, 0.4], "diffuseTexture": {"index": 0},
            "specularFactor": [0.5, 0.6, 0.7], "glossinessFactor": 0.3, "specularGlossinessTexture": {"index": 4}},
        "VENDOR_materials_glitter": {"density": 0.5, "nested": [1, {"a": "b"}]}
    }, "extras": {"note": 1}})"));
    const auto& m = scene.materials.at(0);
    EXPECT_TRUE(m.unlit);
    EXPECT_EQ(m.emissive_strength, 5.0f);
    EXPECT_EQ(m.ior, 1.8f);
    EXPECT_EQ(m.dispersion, 0.3f);
    ASSERT_TRUE(m.clearcoat && m.sheen && m.anisotropy && m.transmission && m.volume && m.specular && m.iridescence &&
                m.diffuse_transmission && m.specular_glossiness);
    EXPECT_EQ(m.clearcoat->factor, 0.1f);
    EXPECT_EQ(m.clearcoat->roughness, 0.2f);
    EXPECT_EQ(picture(scene, m.clearcoat->texture), "picture 0");
    EXPECT_EQ(picture(scene, m.clearcoat->roughness_texture), "picture 1");
    EXPECT_EQ(picture(scene, m.clearcoat->normal_texture), "picture 2");
    EXPECT_EQ(m.clearcoat->normal_texture.scale, 0.4f);
    EXPECT_EQ(m.sheen->color, glm::vec3(0.1f, 0.2f, 0.3f));
    EXPECT_EQ(m.sheen->roughness, 0.5f);
    EXPECT_EQ(picture(scene, m.sheen->color_texture), "picture 0");
    EXPECT_EQ(picture(scene, m.sheen->roughness_texture), "picture 1");
    EXPECT_EQ(m.anisotropy->strength, 0.6f);
    EXPECT_EQ(m.anisotropy->rotation, 1.5f);
    EXPECT_EQ(picture(scene, m.anisotropy->texture), "picture 3");
    EXPECT_EQ(m.transmission->factor, 0.7f);
    EXPECT_EQ(picture(scene, m.transmission->texture), "picture 1");
    EXPECT_EQ(m.volume->thickness, 2.0f);
    EXPECT_EQ(m.volume->attenuation_distance, 3.0f);
    EXPECT_EQ(m.volume->attenuation_color, glm::vec3(0.9f, 0.8f, 0.7f));
    EXPECT_EQ(picture(scene, m.volume->thickness_texture), "picture 2");
    EXPECT_EQ(m.specular->factor, 0.8f);
    EXPECT_EQ(m.specular->color, glm::vec3(2, 1, 0.5f));
    EXPECT_EQ(picture(scene, m.specular->texture), "picture 1");
    EXPECT_EQ(picture(scene, m.specular->color_texture), "picture 4");
    EXPECT_EQ(m.iridescence->factor, 0.9f);
    EXPECT_EQ(m.iridescence->ior, 1.4f);
    EXPECT_NEAR(m.iridescence->thickness_minimum, 200e-9f, 1e-12f);
    EXPECT_NEAR(m.iridescence->thickness_maximum, 500e-9f, 1e-12f);
    EXPECT_EQ(picture(scene, m.iridescence->texture), "picture 1");
    EXPECT_EQ(picture(scene, m.iridescence->thickness_texture), "picture 2");
    EXPECT_EQ(m.diffuse_transmission->factor, 0.25f);
    EXPECT_EQ(m.diffuse_transmission->color, glm::vec3(0.3f, 0.2f, 0.1f));
    EXPECT_EQ(picture(scene, m.diffuse_transmission->texture), "picture 1");
    EXPECT_EQ(picture(scene, m.diffuse_transmission->color_texture), "picture 0");
    EXPECT_EQ(m.specular_glossiness->diffuse, glm::vec4(0.1f, 0.2f, 0.3f, 0.4f));
    EXPECT_EQ(m.specular_glossiness->specular, glm::vec3(0.5f, 0.6f, 0.7f));
    EXPECT_EQ(m.specular_glossiness->glossiness, 0.3f);
    EXPECT_EQ(picture(scene, m.specular_glossiness->diffuse_texture), "picture 0");
    EXPECT_EQ(picture(scene, m.specular_glossiness->specular_glossiness_texture), "picture 4");
    ASSERT_EQ(m.other_extensions.size(), 2u);
    EXPECT_EQ(m.other_extensions[0].name, "VENDOR_materials_glitter");
    EXPECT_EQ(m.other_extensions[0].json, R"({"density":0.5,"nested":[1,{"a":"b"}]})");
    EXPECT_EQ(m.other_extensions[1].name, "extras");
}

TEST(Material, ExtensionsThatAreAbsentStayAbsentAndEmptyOnesHaveTheirDefaults) {
    const Scene absent = load_valid(file_with("{}"));
    const auto& a = absent.materials.at(0);
    EXPECT_FALSE(a.clearcoat || a.sheen || a.anisotropy || a.transmission || a.volume || a.specular || a.iridescence ||
                 a.diffuse_transmission || a.specular_glossiness || a.unlit);
    const Scene empty =
        load_valid(file_with(R"({"extensions": {"KHR_materials_specular": {}, "KHR_materials_volume": {},
        "KHR_materials_iridescence": {}}})"));
    const auto& e = empty.materials.at(0);
    EXPECT_EQ(e.specular->factor, 1.0f);
    EXPECT_EQ(e.specular->color, glm::vec3(1));
    EXPECT_TRUE(std::isinf(e.volume->attenuation_distance));
    EXPECT_EQ(e.iridescence->ior, 1.3f);
    EXPECT_NEAR(e.iridescence->thickness_maximum, 400e-9f, 1e-12f);
}

TEST(Material, TextureTransformsAreKeptAndMayChooseTheCoordinates) {
    const Scene scene =
        load_valid(file_with(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 0,
        "extensions": {"KHR_texture_transform": {"offset": [0.1, 0.2], "rotation": 0.3, "scale": [4, 5], "texCoord": 1}}}}})"));
    const auto& texture = scene.materials.at(0).base_color_texture;
    EXPECT_EQ(texture.transform.offset, glm::vec2(0.1f, 0.2f));
    EXPECT_EQ(texture.transform.rotation, 0.3f);
    EXPECT_EQ(texture.transform.scale, glm::vec2(4, 5));
    EXPECT_EQ(texture.uv_set, 1);
}

TEST(Material, HighSetsOfTextureCoordinatesTakeTheTwoPlaces) {
    const Scene scene =
        load_valid(file_with(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 3}},
        "emissiveTexture": {"index": 1, "texCoord": 1}})"));
    EXPECT_EQ(scene.materials.at(0).base_color_texture.uv_set, 1);
    EXPECT_EQ(scene.materials.at(0).emissive_texture.uv_set, 0);
    EXPECT_EQ(scene.meshes.at(0).primitives.at(0).uv0.at(0).x, 1.0f);
    EXPECT_EQ(scene.meshes.at(0).primitives.at(0).uv1.at(0).x, 3.0f);
    EXPECT_TRUE(scene.warnings.empty());

    const Scene three =
        load_valid(file_with(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 3}},
        "emissiveTexture": {"index": 1, "texCoord": 1}, "normalTexture": {"index": 2}})"));
    EXPECT_THAT(three.warnings, ElementsAre(HasSubstr("TEXCOORD_3")));
}

TEST(Material, APictureUsedAsColorAndAsDataAppearsOncePerColorSpaceAndIsDecodedOnce) {
    const Scene scene = load_valid(file_with(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "normalTexture": {"index": 0}, "emissiveTexture": {"index": 0}})"));
    ASSERT_EQ(scene.images.size(), 2u);
    EXPECT_NE(scene.images[0].color_space, scene.images[1].color_space);
    EXPECT_EQ(scene.images[0].pixels, scene.images[1].pixels);
}

TEST(Material, PicturesAreReadFromBufferViewsAndAlphaIsFound) {
    GltfBuilder file = file_with(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})");
    const auto png = encode_png({.width = 1, .height = 2, .channels = 4, .bytes = {1, 2, 3, 255, 5, 6, 7, 8}});
    ASSERT_TRUE(png);
    file.json["images"][0] = {{"bufferView", file.add_view(*png)}, {"mimeType", "image/png"}};
    const Scene scene = load_valid(file);
    const Image& image = scene.images.at(0);
    EXPECT_EQ(image.width, 1u);
    EXPECT_EQ(image.height, 2u);
    EXPECT_THAT(*image.pixels, ElementsAre(1, 2, 3, 255, 5, 6, 7, 8));
    EXPECT_TRUE(image.has_alpha);
    EXPECT_EQ(image.color_space, ColorSpace::srgb);
    EXPECT_THAT(image.origin, HasSubstr("bufferView"));
    EXPECT_EQ(image.mime_type, "image/png");
}

TEST(Material, SamplersAreTranslated) {
    GltfBuilder file =
        file_with(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "emissiveTexture": {"index": 1}})");
    file.json["samplers"] = {{{"magFilter", 9728}, {"minFilter", 9985}, {"wrapS", 33071}, {"wrapT", 33648}}};
    file.json["textures"][0]["sampler"] = 0;
    const Scene scene = load_valid(file);
    const Sampler expected{.magnification = Filter::nearest,
                           .minification = Filter::linear,
                           .mip = MipFilter::nearest,
                           .wrap_u = Wrap::clamp_to_edge,
                           .wrap_v = Wrap::mirrored_repeat};
    EXPECT_EQ(scene.samplers.at(scene.materials[0].base_color_texture.sampler), expected);
    EXPECT_EQ(scene.samplers.at(scene.materials[0].emissive_texture.sampler), Sampler{});
}

TEST(Material, ValuesOutOfRangeAreClampedWithAWarning) {
    const Scene scene = load_valid(file_with(R"({"pbrMetallicRoughness": {"metallicFactor": 7, "roughnessFactor": -1},
        "alphaMode": "DITHER", "extensions": {"KHR_materials_ior": {"ior": 0.5}}})"));
    EXPECT_EQ(scene.materials[0].metallic, 1.0f);
    EXPECT_EQ(scene.materials[0].roughness, 0.0f);
    EXPECT_EQ(scene.materials[0].ior, 1.0f);
    EXPECT_EQ(scene.warnings.size(), 4u);
}

TEST(Material, TexturesWithoutAReadablePictureAreLeftOutWithAWarning) {
    GltfBuilder file = file_with(R"({"emissiveTexture": {"index": 1}})");
    file.json["textures"][1] = {{"extensions", {{"KHR_texture_basisu", {{"source", 1}}}}}};
    const Scene scene = load_valid(file);
    EXPECT_FALSE(scene.materials[0].emissive_texture.present());
    EXPECT_EQ(scene.warnings.size(), 1u);
}

TEST(Material, TangentsAppearWhereTheMaterialNeedsThem) {
    EXPECT_TRUE(load_valid(file_with("{}")).meshes.at(0).primitives.at(0).tangents.empty());
    for (const char* material :
         {R"({"normalTexture": {"index": 0}})", R"({"extensions": {"KHR_materials_anisotropy": {}}})",
          R"({"extensions": {"KHR_materials_clearcoat": {"clearcoatNormalTexture": {"index": 0}}}})"}) {
        EXPECT_FALSE(load_valid(file_with(material)).meshes.at(0).primitives.at(0).tangents.empty()) << material;
    }
}

TEST(Material, PicturesCanBeLeftUndecoded) {
    const auto scene = file_with(R"({"emissiveTexture": {"index": 1}})").load({.load_images = false});
    ASSERT_TRUE(scene) << scene.error().message();
    expect_valid_scene(*scene);
    EXPECT_EQ(scene->images.at(0).width, 1u);
}

// The thickness of a volume is in the space of its mesh: placed twice as large, it is twice as thick.
TEST(Material, VolumesGrowWithTheirNodes) {
    GltfBuilder file;
    file.json["materials"] = nlohmann::json::parse(
        R"([{"extensions": {"KHR_materials_volume": {"thicknessFactor": 0.5, "attenuationDistance": 3}}}, {}])");
    file.json["extensionsUsed"] = {"KHR_materials_volume"};
    file.primitive()["material"] = 0;
    file.json["meshes"].push_back(file.json["meshes"][0]);
    file.json["meshes"][1]["primitives"][0]["material"] = 1;
    file.json["nodes"] =
        nlohmann::json::parse(R"([{"mesh": 0}, {"mesh": 0, "scale": [2, 2, 2]}, {"mesh": 0, "scale": [-2, 2, 2]},
        {"mesh": 0, "scale": [1, 3, 9]}, {"mesh": 1, "scale": [5, 5, 5]}])");
    file.json["scenes"][0]["nodes"] = {0, 1, 2, 3, 4};
    const auto scene = file.load();
    ASSERT_TRUE(scene) << scene.error().message();
    ASSERT_EQ(scene->instances.size(), 5u);
    const auto volume_of = [&](std::size_t instance) {
        return scene->materials[scene->meshes[scene->instances[instance].mesh].primitives[0].material].volume;
    };
    EXPECT_EQ(volume_of(0)->thickness, 0.5f);
    EXPECT_NEAR(volume_of(1)->thickness, 1.0f, 1e-6f);
    EXPECT_NEAR(volume_of(2)->thickness, 1.0f, 1e-6f) << "mirrored";
    EXPECT_NEAR(volume_of(3)->thickness, 1.5f, 1e-6f) << "the cube root of 27";
    EXPECT_EQ(volume_of(1)->attenuation_distance, 3.0f) << "that one is in the world";
    EXPECT_EQ(scene->instances[1].mesh, scene->instances[2].mesh);
    EXPECT_FALSE(volume_of(4));
    EXPECT_EQ(scene->materials.size(), 4u) << "two scales more of the one with a volume";
}

}  // namespace
}  // namespace nacre::scene
