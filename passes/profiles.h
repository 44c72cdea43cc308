// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

/// @file
/// Budgets: what a picture may cost at most. Profiles are data, all in passes/profiles.json; a profile, a scene
/// and a device's capabilities together give one plan (passes/plan.h).
///
///     const Profile& profile = **find_profile("mobile");
///     if (profile.storage_in_fragment) ...

namespace nacre::passes {

/// What the opaque medium of a slab is lit with (NACRE_DIFFUSE_MODEL): Chan's model over its own albedo, which is what
/// materials mean, or Lambert's, which is cheaper and off by what docs/materials.md says.
enum class DiffuseModel : std::uint32_t { chan, lambert };

/// One row of passes/profiles.json. Budgets are upper bounds; a scene that needs less gets less.
struct Profile {
    std::string name;
    std::string meaning;                      ///< One sentence for people.
    std::uint32_t color_targets = 3;          ///< Color targets of one render pass.
    bool storage_in_fragment = false;         ///< Storage writes in fragment shaders.
    bool float_color_targets = false;         ///< Blending into float color targets.
    std::uint32_t material_bytes = 12;        ///< Of one material in the G-buffer; beyond that it is simplified.
    std::uint32_t material_closures = 1;
    std::uint32_t gbuffer_bytes_per_pixel = 12;  ///< What the renderer's G-buffer holds today.
    std::uint32_t closures_per_pixel = 1;
    bool float32_lit_color = false;           ///< Lit color with 32 instead of 16 bits per channel.
    DiffuseModel diffuse_model = DiffuseModel::chan;
    std::uint32_t lights = 64;                ///< Punctual lights; the weakest beyond are left out, with a warning.
    std::uint32_t shadow_views = 16;  ///< Layers of the shadow map: 1 for directional and spot, 6 for point lights.
    std::uint32_t shadow_map_size = 1024;     ///< Texels along one side of a layer.
    std::uint32_t shadow_filter_width = 3;    ///< PCF: filter_width^2 bilinear taps; 1, 3 or 5.
    std::uint32_t environment_size = 256;     ///< Largest side of a cube face.
    std::uint32_t environment_samples = 32;   ///< Samples for each texel of the prefiltered environment.
    std::uint32_t blend_groups = 8;           ///< Where blending needs a pass for each group of surfaces: how many.
    std::uint32_t texture_anisotropy = 1;
};

/// All profiles from the smallest to the largest: mobile, low, medium, high, epic, reference.
const std::vector<Profile>& profiles();

/// Profile by name. Error: not_found, listing the names there are.
Expected<const Profile*> find_profile(std::string_view name);

}  // namespace nacre::passes
