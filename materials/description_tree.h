// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "materials/description.h"
#include "materials/tree.h"

/// @file
/// glTF materials as trees of slabs.
///
///     const Tree tree = tree_of(scene.materials[3]);

namespace nacre::materials {

/// The tree that shades what `material` says; it is valid for any input (values out of range are clamped).
///
/// A metal and a dielectric are mixed by metallic, their parameters blended to one slab as glTF's own model does. On
/// it: sheen is fuzz, anisotropy is converted by widths (alpha along the tangent is mix(alpha, 1, strength^2), across
/// it alpha: Kulla-Conty's roughness and anisotropy with the same two widths), iridescence is a thin film, transmission
/// mixes in a slab with a medium (of the volume, or thin and tinted by the base color), the specular factor is a
/// specular weight, emission leaves below the coat, a clear coat lies above with normals of its own, the alpha of
/// blended materials is coverage, vertex colors multiply the base color.
///
/// What glTF has and slabs do not: dispersion, occlusion (the renderer's). Textures of anisotropy strength and of
/// roughness multiply the converted values, which is exact where the strength is 0 or the texture white.
[[nodiscard]] Tree tree_of(const MaterialDescription& material);

}  // namespace nacre::materials
