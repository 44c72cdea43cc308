// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "passes/renderer_state.h"

/// @file
/// What a scene, a profile and a device come to: which passes there are, in which formats, and what is left out.

namespace nacre::passes {

using rhi::FormatSupport;

namespace {

/// Features of slabs that were made not to exist are taken off before anything looks at them.
std::vector<materials::SingleSlab> make_slabs(const scene::Scene& scene, const CustomKinds& kinds, Feature without) {
    std::vector<materials::SingleSlab> slabs;
    slabs.reserve(scene.materials.size());
    for (std::uint32_t i = 0; i < scene.materials.size(); ++i) {
        materials::SingleSlab slab =
            kinds.kind_of(i) != 0 ? kinds.slab_of(i) : materials::single_slab(scene.materials[i]);
        if (has(without, Feature::emission)) slab.emission = glm::vec3(0.0f), slab.emission_texture = {};
        if (has(without, Feature::alpha_test) && slab.alpha_mode == materials::AlphaMode::mask) {
            slab.alpha_mode = materials::AlphaMode::opaque;
        }
        if (has(without, Feature::blend) && slab.alpha_mode == materials::AlphaMode::blend) {
            slab.alpha_mode = materials::AlphaMode::opaque;
        }
        if (has(without, Feature::unlit)) slab.unlit = false;
        if (has(without, Feature::normal_maps)) slab.normal_texture = {};
        if (has(without, Feature::occlusion)) slab.occlusion_texture = {};
        if (has(without, Feature::specular_textures)) slab.specular_texture = slab.specular_color_texture = {};
        if (has(without, Feature::texture_transforms)) {
            for (materials::TextureReference* texture :
                 {&slab.base_color_texture, &slab.metallic_roughness_texture, &slab.normal_texture,
                  &slab.occlusion_texture, &slab.emission_texture, &slab.specular_texture,
                  &slab.specular_color_texture}) {
                texture->transform = {};
            }
        }
        // A texture of what does not emit would never be read.
        if (slab.emission == glm::vec3(0.0f) || slab.unlit) slab.emission_texture = {};
        slabs.push_back(std::move(slab));
    }
    return slabs;
}

}  // namespace

Expected<void> Renderer::State::decide(const scene::Scene& scene) {
    const rhi::Capabilities& capabilities = device.capabilities();
    NACRE_TRY(profile, find_profile(options.profile));
    const auto unsupported = [&](std::string reason, std::string remedy) {
        return fail(ErrorCode::unsupported, "render with profile", fmt::format("'{}'", profile->name),
                    std::move(reason), std::move(remedy));
    };
    if (options.width == 0 || options.height == 0 || options.width > capabilities.max_texture_2d ||
        options.height > capabilities.max_texture_2d || options.width > 65535 * 8 || options.height > 65535 * 8) {
        return fail(ErrorCode::invalid_argument, "render",
                    fmt::format("a picture of {} x {}", options.width, options.height),
                    fmt::format("both sides must be 1 to {} pixels on this device", capabilities.max_texture_2d),
                    "Choose another size.");
    }
    if (capabilities.max_color_targets < 3) {
        return unsupported(
            fmt::format("the G-buffer needs 3 color targets, the device has {}", capabilities.max_color_targets),
            "Use another device.");
    }
    if (capabilities.max_storage_buffers[2] < 2 || capabilities.max_storage_images[2] < 1) {
        return unsupported(
            "tiled lighting needs 2 storage buffers and 1 storage image in compute shaders, which the device "
            "does not have",
            "Use another device.");
    }

    NACRE_TRY(kinds, CustomKinds::choose(scene));
    const auto slabs = make_slabs(scene, kinds, options.without);
    const bool colors = !has(options.without, Feature::vertex_colors);
    if (!has(options.without, Feature::closures)) {
        NACRE_TRY(closures,
                  SceneClosures::choose(scene, *profile,
                                        profile->storage_in_fragment && capabilities.storage_in_fragment, warnings));
    }
    NACRE_TRY(geometry, SceneGeometry::create(device, scene, slabs, closures, kinds, all_textures, colors));
    std::vector<bool> used(slabs.size());
    std::uint32_t textures = 0;
    std::uint32_t blended = 0;
    bool transforms = false, vertex_colors = false;
    for (const Draw& draw : geometry->draws()) {
        used[draw.material] = true;
        textures |= draw.features.textures;
        transforms |= draw.features.transforms;
        vertex_colors |= (draw.features.attributes & attribute_bit(Attribute::color)) != 0;
        if (draw.alpha_mode == materials::AlphaMode::blend) {
            decisions.blend = true;
            ++blended;
            continue;
        }
        decisions.alpha_test |= draw.alpha_mode == materials::AlphaMode::mask;
        decisions.draws_opaque = true;
        decisions.emission |= draw.emits;
        decisions.closures |= draw.has_closures && closures.find(draw.material)->layout.storage_class !=
                                                       materials::StorageClass::simple;
        (draw.features.unlit ? decisions.unlit : decisions.slab) = true;
    }
    const float anisotropy =
        capabilities.anisotropic_filtering
            ? std::min(static_cast<float>(profile->texture_anisotropy), capabilities.max_anisotropy)
            : 1.0f;
    NACRE_TRY(materials, SceneMaterials::create(device, scene, slabs, closures, kinds, used, all_textures, anisotropy));

    // Float targets, where the profile wants them and the device has them.
    const bool wants_32 = profile->float32_lit_color;
    decisions.lit_format = rhi::Format::rgba16_float;
    if (wants_32 &&
        capabilities.supports(rhi::Format::rgba32_float, FormatSupport::storage_image | FormatSupport::blended)) {
        decisions.lit_format = rhi::Format::rgba32_float;
    } else if (wants_32) {
        warnings.push_back("the device cannot blend into 32-bit float targets: the lit color has 16 bits");
    }
    if (!capabilities.supports(decisions.lit_format, FormatSupport::storage_image | FormatSupport::sampled)) {
        return unsupported("the device cannot write rgba16_float images in compute shaders", "Use another device.");
    }
    decisions.packed_targets =
        !profile->float_color_targets || !capabilities.float_color_targets ||
        !capabilities.supports(decisions.lit_format, FormatSupport::color_target | FormatSupport::blended);
    if (decisions.emission) {
        decisions.depth_format = capabilities.supports(rhi::Format::d32_float_s8_uint, FormatSupport::depth_target)
                                     ? rhi::Format::d32_float_s8_uint
                                     : rhi::Format::d24_unorm_s8_uint;
    }
    decisions.automatic_exposure = !options.exposure_ev && !has(options.without, Feature::automatic_exposure);
    decisions.filmic = options.tone_mapping == ToneMapping::filmic;

    // Lights matter to lit surfaces only.
    const bool lit_surfaces =
        std::ranges::any_of(geometry->draws(), [](const Draw& draw) { return !draw.features.unlit; });
    if (lit_surfaces && !has(options.without, Feature::lights)) {
        light_setup =
            set_up_lights(scene.lights, geometry->bounds(), *profile, !has(options.without, Feature::shadows));
        warnings.insert(warnings.end(), light_setup.warnings.begin(), light_setup.warnings.end());
    }
    decisions.light_capacity = list_capacity(light_setup.lights.size());
    decisions.shadow_view_count = static_cast<std::uint32_t>(light_setup.shadow_views.size());
    decisions.shadow_capacity = list_capacity(light_setup.shadow_views.size());
    decisions.shadow_map_size = light_setup.shadow_map_size;
    decisions.shadow_filter_width = profile->shadow_filter_width;
    decisions.diffuse_model = profile->diffuse_model;

    const auto leave_out = [&](bool needed, const char* what, const char* why) {
        if (!needed) left_out.push_back({what, why});
    };
    leave_out(decisions.alpha_test, "alpha test prepass", "no material has alpha mode MASK");
    leave_out(decisions.emission, "stencil prepass, emission pass, stencil part of the depth target",
              "no surface emits light");
    leave_out(decisions.blend, "blend pass", "no material has alpha mode BLEND");
    leave_out(decisions.unlit, "lighting shaders for unlit and mixed tiles", "no surface is unlit");
    leave_out(decisions.closures, "lighting shader for closures, slices of material words",
              "no deferred surface has more than one plain slab");
    leave_out(decisions.slab, "lighting shader for slabs", "no deferred surface is lit");
    leave_out(decisions.light_capacity > 0, "light list", "no light reaches a lit surface");
    leave_out(decisions.shadow_view_count > 0, "shadow maps", "no light casts shadows on a lit surface");
    leave_out(decisions.automatic_exposure, "exposure metering", "the exposure is given");
    leave_out(vertex_colors, "vertex colors", "no primitive has them");
    leave_out(transforms, "texture transforms", "no texture is moved");
    leave_out((textures & texture_bit(TextureSlot::normal)) != 0, "normal maps, tangents",
              "no material has a normal map");
    leave_out((textures & texture_bit(TextureSlot::occlusion)) != 0, "occlusion maps", "no material has one");
    leave_out((textures & (texture_bit(TextureSlot::specular) | texture_bit(TextureSlot::specular_color))) != 0,
              "specular maps", "no material has one");
    leave_out(!decisions.packed_targets, "blending into float targets",
              profile->float_color_targets
                  ? "the device cannot: integer targets and compute shaders do its work"
                  : "the profile does without: integer targets and compute shaders do its work");
    if (decisions.blend && decisions.packed_targets && blended > profile->blend_groups) {
        warnings.push_back(
            fmt::format("{} blended surfaces share {} groups: where two of a group overlap, only the nearer one shows",
                        blended, profile->blend_groups));
    }
    return {};
}

}  // namespace nacre::passes
