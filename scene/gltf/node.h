// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>
#include <vector>

#include "scene/gltf/document.h"

/// @file
/// The nodes of a file: their tree, their animation and their world transforms. Nothing here recurses, so that the
/// depth of the tree does not matter. Internal to scene/gltf/; functions may throw `Rejected`.

namespace nacre::scene::gltf {

struct Node {
    std::string element;  ///< "node 3 'wheel'", for messages.
    std::string name;
    std::vector<std::size_t> children;
    std::optional<std::size_t> parent;
    std::optional<glm::mat4> matrix;  ///< Instead of the following three.
    glm::vec3 translation{0.0f};
    glm::quat rotation{1.0f, 0.0f, 0.0f, 0.0f};  ///< w, x, y, z.
    glm::vec3 scale{1.0f};
    std::vector<float> weights;  ///< Of morph targets; empty: those of the mesh.
    bool has_weights = false;
    glm::mat4 world{1.0f};
};

/// Reads all nodes and checks that they form trees.
std::vector<Node> read_nodes(Document& document);

/// Moves the nodes to where one animation of the file has them at `time` (seconds), clamped to the range of each
/// channel. A file without that animation is left as it is.
void apply_animation(Document& document, std::vector<Node>& nodes, std::size_t animation, float time);

/// Sets `world` of all nodes.
void compute_world_transforms(std::vector<Node>& nodes);

/// The nodes of the file's default scene (or of its first, or all where it has none), parents before children.
std::vector<std::size_t> placed_nodes(Document& document, const std::vector<Node>& nodes);

/// translate * rotate * scale.
glm::mat4 compose(const glm::vec3& translation, const glm::quat& rotation, const glm::vec3& scale);

/// Unit quaternion from x, y, z, w; identity where it has no length.
glm::quat unit_quaternion(const glm::vec4& xyzw);

bool is_finite(const glm::mat4& matrix);

}  // namespace nacre::scene::gltf
