// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/gltf/document.h"
#include "scene/gltf/material.h"
#include "scene/scene.h"

/// @file
/// Primitives of a file, from accessors to final geometry: posed, as an indexed list, with normals, tangents and
/// bounds, without anything that is not finite. Internal to scene/gltf/; functions may throw `Rejected`.

namespace nacre::scene::gltf {

/// How a mesh is deformed at one node.
struct Pose {
    std::vector<float> weights;  ///< Of morph targets; missing ones are 0.
    std::vector<glm::mat4>
        joint_worlds;  ///< World transform of each joint times its inverse bind matrix; empty: no skin.
};

/// Reads one primitive of a mesh in a pose. `element` is "mesh 3 'wheel', primitive 0"; `material` must be that of
/// the primitive. Nothing where no valid face, line or point is left (a warning says why).
std::optional<Primitive> read_primitive(Document& document, const JsonView& json, const std::string& element,
                                        const ImportedMaterial& material, const Pose& pose);

}  // namespace nacre::scene::gltf
