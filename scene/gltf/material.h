// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "materials/description.h"
#include "scene/gltf/document.h"
#include "scene/gltf/image.h"
#include "scene/scene.h"

/// @file
/// Materials and samplers of a file. Internal to scene/gltf/; functions may throw `Rejected`.

namespace nacre::scene::gltf {

/// A material, and which TEXCOORD_n of the file its uv sets 0 and 1 stand for.
struct ImportedMaterial {
    materials::MaterialDescription description;
    std::array<std::uint32_t, 2> uv_sources{0, 1};
};

/// All samplers of the file and, last, the default one.
std::vector<Sampler> read_samplers(Document& document);

/// All materials of the file; their pictures are registered with `images`.
std::vector<ImportedMaterial> read_materials(Document& document, ImageTable& images, std::size_t default_sampler);

}  // namespace nacre::scene::gltf
