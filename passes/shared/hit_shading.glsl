// SPDX-License-Identifier: Apache-2.0
// Shades any place of a scene from the blob of its material: whoever has a place (the hit of a ray) sets `hit_material` and
// the variables of passes/shared/fragment_inputs.glsl, and asks. The text behind it is that of the draws.
//
//     bool hit_is_covered()                                     alpha test
//     HitWords hit_words(to_viewer, footprint, pixel)           what a pixel of the G-buffer stores of it
//     HitProperties hit_properties(to_viewer, footprint)        albedo, emission, roughness
#ifndef NACRE_HIT_SHADING
#define NACRE_HIT_SHADING
#include "passes/shared/hit_material.glsl"
#include "passes/shared/material.glsl"
#include "passes/shared/slab_words.glsl"
// Made for a scene (passes/hit_materials.h): the closures' library with the features that it has, its topologies and kinds.
#include "passes/shared/hit_kinds.glsl"
#include "passes/shared/slab_closure.glsl"

struct HitWords {
    uint words[hit_word_capacity];
    uint top_layer;
    uint subsurface;
    bool has_subsurface;
};

struct HitProperties {
    vec3 albedo;      // towards the viewer, under white light from everywhere
    vec3 emission;    // cd/m2
    float roughness;  // perceptual, of the topmost lobe
};

// Unlit surfaces have no normals.
bool hit_is_unlit() { return material_is_unlit() || (in_attributes & attribute_normals) == 0u; }
bool hit_is_custom() { return material_type() >= blob_custom_type; }
bool hit_is_tree() { return material_type() >= blob_tree_type && !hit_is_custom() && !hit_is_unlit(); }

vec4 hit_base_color() { return hit_is_custom() ? custom_base_color(material_type() - blob_custom_type) : base_color(); }
vec3 hit_emission() {
    if (!material_emits()) return vec3(0.0);
    return hit_is_custom() ? custom_emission(material_type() - blob_custom_type) : emission();
}
SingleSlab hit_slab(vec3 color) {
    if (hit_is_custom()) return custom_slab(material_type() - blob_custom_type, color);
    return evaluate_slab(color);
}

bool hit_is_covered() { return material_alpha_mode() != 1u || !(hit_base_color().a < material_alpha_cutoff()); }

HitWords hit_words(vec3 to_viewer, float footprint, uvec2 pixel) {
    HitWords hit;
    for (uint i = 0u; i < hit_word_capacity; ++i) hit.words[i] = 0u;
    hit.subsurface = 0u;
    hit.has_subsurface = false;
    if (hit_is_tree()) {
        tree_hit_words(material_type() - blob_tree_type, to_viewer, footprint, pixel, hit.words, hit.top_layer, hit.subsurface,
                       hit.has_subsurface);
        return hit;
    }
    vec3 color = clamp(hit_base_color().rgb, 0.0, 1.0);
    if (hit_is_unlit()) {
        unlit_words(color, hit.words[0], hit.words[1], hit.top_layer);
    } else {
        slab_words(hit_slab(color), hit.words[0], hit.words[1], hit.top_layer);
    }
    return hit;
}

HitProperties hit_properties(vec3 to_viewer, float footprint) {
    HitProperties properties;
    if (hit_is_tree()) {
        tree_hit_properties(material_type() - blob_tree_type, to_viewer, footprint, properties.albedo, properties.emission,
                            properties.roughness);
        return properties;
    }
    properties.emission = hit_emission();
    vec3 color = clamp(hit_base_color().rgb, 0.0, 1.0);
    properties.albedo = color;
    properties.roughness = 1.0;
    if (hit_is_unlit()) return properties;
    SingleSlab slab = hit_slab(color);
    properties.roughness = slab.roughness;
    vec3 view = view_in_frame(frame_of_normal(slab.normal), to_viewer);
    ClosureAlbedo albedo = closure_albedo(prepare_closure_under(slab_of(slab), interface_of(slab), view, footprint));
    properties.albedo = albedo.specular + albedo.diffuse;
    return properties;
}

#endif
