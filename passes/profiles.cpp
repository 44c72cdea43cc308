// SPDX-License-Identifier: Apache-2.0
#include "passes/profiles.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <nlohmann/json.hpp>

#include "core/embedded_file.h"
#include "passes/renderer.h"

namespace nacre::passes {
namespace {

/// The file is part of the program: a fault in it is a bug, found by tests/passes/profiles_test.cpp.
std::vector<Profile> parse_profiles() {
    const std::map<std::string, DiffuseModel> diffuse_models = {{"chan", DiffuseModel::chan},
                                                                {"lambert", DiffuseModel::lambert}};
    std::vector<Profile> result;
    for (const EmbeddedFile& file : embedded_files()) {
        if (file.path != "passes/profiles.json") continue;
        const nlohmann::json document = nlohmann::json::parse(file.text);
        for (const nlohmann::json& row : document.at("profiles")) {
            Profile profile;
            profile.name = row.at("name");
            profile.meaning = row.at("meaning");
            profile.color_targets = row.at("color_targets");
            profile.storage_in_fragment = row.at("storage_in_fragment");
            profile.float_color_targets = row.at("float_color_targets");
            profile.material_bytes = row.at("material_bytes");
            profile.material_closures = row.at("material_closures");
            profile.gbuffer_bytes_per_pixel = row.at("gbuffer_bytes_per_pixel");
            profile.closures_per_pixel = row.at("closures_per_pixel");
            profile.float32_lit_color = row.at("float32_lit_color");
            profile.diffuse_model = diffuse_models.at(row.at("diffuse_model"));
            profile.lights = row.at("lights");
            profile.shadow_views = row.at("shadow_views");
            profile.shadow_map_size = row.at("shadow_map_size");
            profile.shadow_filter_width = row.at("shadow_filter_width");
            profile.environment_size = row.at("environment_size");
            profile.environment_samples = row.at("environment_samples");
            profile.blend_groups = row.at("blend_groups");
            profile.texture_anisotropy = row.at("texture_anisotropy");
            result.push_back(std::move(profile));
        }
    }
    return result;
}

}  // namespace

const std::vector<Profile>& profiles() {
    static const std::vector<Profile> all = parse_profiles();
    return all;
}

Expected<const Profile*> find_profile(std::string_view name) {
    const auto found = std::ranges::find(profiles(), name, &Profile::name);
    if (found != profiles().end()) return &*found;
    std::vector<std::string_view> names;
    for (const Profile& profile : profiles()) names.push_back(profile.name);
    return fail(ErrorCode::not_found, "find profile", fmt::format("'{}'", name), "there is no profile of that name",
                fmt::format("The profiles are {}.", fmt::join(names, ", ")));
}

}  // namespace nacre::passes
