// SPDX-License-Identifier: Apache-2.0
#include "passes/custom_kinds.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace nacre::passes {
namespace {

bool is_name(const std::string& name) {
    const auto is_letter_or_digit = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; };
    return !name.empty() && std::isalpha(static_cast<unsigned char>(name[0])) != 0 &&
           std::ranges::all_of(name, is_letter_or_digit) && !name.starts_with("gl") && !name.starts_with("nacre");
}

}  // namespace

Expected<CustomKinds> CustomKinds::choose(const scene::Scene& scene) {
    CustomKinds result;
    result.materials_.resize(scene.materials.size());
    std::vector<std::size_t> sidebands;
    for (std::uint32_t i = 0; i < scene.materials.size(); ++i) {
        const auto& custom = scene.materials[i].custom;
        if (custom == nullptr) continue;
        const materials::MaterialModule module = custom->module();
        const auto wrong = [&](std::string reason, std::string remedy) {
            return fail(ErrorCode::invalid_argument, "use material", fmt::format("'{}'", scene.materials[i].name),
                        std::move(reason), std::move(remedy));
        };
        if (!is_name(module.name)) {
            return wrong(
                fmt::format("the name '{}' of its module cannot begin the names of GLSL functions", module.name),
                "Use letters and digits, a letter first; not 'gl' or 'nacre'.");
        }
        materials::CustomMaterialData data = custom->data();
        if (data.sideband.size() > materials::CustomMaterialData::max_sideband) {
            return wrong(fmt::format("its sideband has {} rows, more than {}", data.sideband.size(),
                                     materials::CustomMaterialData::max_sideband),
                         "Put large tables into textures.");
        }
        const auto known = std::ranges::find(result.names_, module.name);
        const auto kind = static_cast<std::size_t>(known - result.names_.begin());
        if (known == result.names_.end()) {
            result.names_.push_back(module.name);
            result.paths_.push_back(std::make_unique<std::string>(fmt::format("passes/kinds/{}.glsl", module.name)));
            result.texts_.push_back(std::make_unique<std::string>(module.glsl));
            sidebands.push_back(data.sideband.size());
        } else if (*result.texts_[kind] != module.glsl || sidebands[kind] != data.sideband.size()) {
            return wrong(
                fmt::format(
                    "its module '{}' has another text, or another size of the sideband, in a material before it",
                    module.name),
                "Give another kind another name.");
        }
        result.materials_[i] = Material{static_cast<std::uint32_t>(kind) + 1, custom, std::move(data)};
    }
    std::string& text = *result.draw_text_;
    for (std::size_t k = 0; k < result.names_.size(); ++k) {
        text += fmt::format(
            "#{0} MATERIAL_KIND == {1}\n#include \"{2}\"\nvec4 base_color() {{ return {3}_base_color(); }}\n"
            "vec3 emission() {{ return clamp({3}_emission(), vec3(0.0), vec3(65504.0)); }}\n"
            "SingleSlab evaluate_slab(vec3 color) {{ return {3}_slab(color); }}\n",
            k == 0 ? "if" : "elif", k + 1, *result.paths_[k], result.names_[k]);
    }
    if (!result.names_.empty()) text += "#endif\n";
    return result;
}

materials::SingleSlab CustomKinds::slab_of(std::uint32_t material) const {
    const materials::CustomMaterialData& data = materials_[material]->data;
    materials::SingleSlab slab;
    slab.base_color_texture = data.textures[0];
    slab.metallic_roughness_texture = data.textures[1];
    slab.normal_texture = data.textures[2];
    slab.normal_scale = data.textures[2].scale;
    slab.occlusion_texture = data.textures[3];
    slab.emission_texture = data.textures[4];
    slab.specular_texture = data.textures[5];
    slab.specular_color_texture = data.textures[6];
    slab.emission = glm::vec3(data.emits ? 1.0f : 0.0f);
    slab.alpha_mode = data.alpha_mode;
    slab.alpha_cutoff = data.alpha_cutoff;
    slab.double_sided = data.double_sided;
    return slab;
}

std::vector<EmbeddedFile> CustomKinds::files() const {
    std::vector<EmbeddedFile> result = {{"passes/shared/material_kinds.glsl", *draw_text_}};
    for (std::size_t k = 0; k < names_.size(); ++k) result.push_back({*paths_[k], *texts_[k]});
    return result;
}

std::string CustomKinds::dispatch() const {
    std::string text;
    for (const auto& path : paths_) text += fmt::format("#include \"{}\"\n", *path);
    const auto function = [&](const char* head, const char* call, const char* otherwise) {
        text += head;
        for (std::size_t k = 0; k < names_.size(); ++k) {
            text += fmt::format("    if (kind == {}u) return ", k + 1);
            text += fmt::format(fmt::runtime(call), names_[k]);
        }
        text += otherwise;
    };
    function("vec4 custom_base_color(uint kind) {\n", "{}_base_color();\n", "    return vec4(1.0);\n}\n");
    function("vec3 custom_emission(uint kind) {\n", "clamp({}_emission(), vec3(0.0), vec3(65504.0));\n",
             "    return vec3(0.0);\n}\n");
    function("SingleSlab custom_slab(uint kind, vec3 color) {\n", "{}_slab(color);\n",
             "    return SingleSlab(color, vec3(0.04), 1.0, 1.0, shading_normal(), 1.0);\n}\n");
    return text;
}

}  // namespace nacre::passes
