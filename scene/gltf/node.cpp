// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/node.h"

#include <fmt/format.h>

#include <cmath>
#include <glm/gtc/type_ptr.hpp>

namespace nacre::scene::gltf {
namespace {

Node read_node(Document& document, std::size_t index, std::size_t node_count) {
    const JsonView& json = document.list("nodes")[index];
    Node node{.element = label("node", index, json), .name = printable(json.text("name", ""), 200)};
    for (const JsonView& child : json.list("children")) {
        const std::uint64_t child_index = child.as_whole();
        if (child_index >= node_count) {
            reject(fmt::format("{}: refers to node {}, but the file has only {}", child.pointer(), child_index,
                               node_count));
        }
        node.children.push_back(child_index);
    }
    if (json.has("matrix")) {
        const std::vector<float> values = json.reals("matrix");
        if (values.size() != 16) json.at("matrix").reject_as("an array of 16 numbers");
        node.matrix = glm::make_mat4(values.data());
    }
    node.translation = json.vector("translation", glm::vec3(0.0f));
    node.rotation = unit_quaternion(json.vector("rotation", glm::vec4(0.0f, 0.0f, 0.0f, 1.0f)));
    node.scale = json.vector("scale", glm::vec3(1.0f));
    node.has_weights = json.has("weights");
    node.weights = json.reals("weights");
    return node;
}

/// Nodes reachable from `roots`, parents before children.
std::vector<std::size_t> walk(const std::vector<Node>& nodes, const std::vector<std::size_t>& roots) {
    std::vector<std::size_t> order;
    std::vector<bool> seen(nodes.size());
    std::vector<std::size_t> pending(roots.rbegin(), roots.rend());
    while (!pending.empty()) {
        const std::size_t index = pending.back();
        pending.pop_back();
        if (seen[index]) continue;
        seen[index] = true;
        order.push_back(index);
        pending.insert(pending.end(), nodes[index].children.rbegin(), nodes[index].children.rend());
    }
    return order;
}

std::vector<std::size_t> roots_of(const std::vector<Node>& nodes) {
    std::vector<std::size_t> roots;
    for (std::size_t index = 0; index < nodes.size(); ++index) {
        if (!nodes[index].parent) roots.push_back(index);
    }
    return roots;
}

}  // namespace

bool is_finite(const glm::mat4& matrix) {
    for (int column = 0; column < 4; ++column) {
        for (int row = 0; row < 4; ++row) {
            if (!std::isfinite(matrix[column][row])) return false;
        }
    }
    return true;
}

glm::quat unit_quaternion(const glm::vec4& xyzw) {
    const double length = std::sqrt(double{xyzw.x} * xyzw.x + double{xyzw.y} * xyzw.y + double{xyzw.z} * xyzw.z +
                                    double{xyzw.w} * xyzw.w);
    if (!(length > 1e-30) || !std::isfinite(length)) return {1.0f, 0.0f, 0.0f, 0.0f};
    return {static_cast<float>(xyzw.w / length), static_cast<float>(xyzw.x / length),
            static_cast<float>(xyzw.y / length), static_cast<float>(xyzw.z / length)};
}

glm::mat4 compose(const glm::vec3& translation, const glm::quat& rotation, const glm::vec3& scale) {
    glm::mat4 result = glm::mat4_cast(rotation);
    result[0] *= scale.x;
    result[1] *= scale.y;
    result[2] *= scale.z;
    result[3] = glm::vec4(translation, 1.0f);
    return result;
}

std::vector<Node> read_nodes(Document& document) {
    const std::size_t count = document.list("nodes").size();
    std::vector<Node> nodes;
    nodes.reserve(count);
    for (std::size_t index = 0; index < count; ++index) nodes.push_back(read_node(document, index, count));

    for (std::size_t index = 0; index < count; ++index) {
        for (const std::size_t child : nodes[index].children) {
            if (nodes[child].parent) {
                reject(fmt::format("{}: it is a child of node {} and of node {}, but the nodes must form a tree",
                                   nodes[child].element, *nodes[child].parent, index));
            }
            nodes[child].parent = index;
        }
    }
    // A node whose chain of parents does not end at a root is part of, or below, a cycle.
    std::vector<bool> below_a_root(count);
    for (const std::size_t index : walk(nodes, roots_of(nodes))) below_a_root[index] = true;
    for (std::size_t index = 0; index < count; ++index) {
        if (!below_a_root[index]) {
            reject(fmt::format("{}: its chain of parents is a cycle, but the nodes must form a tree",
                               nodes[index].element));
        }
    }
    return nodes;
}

void compute_world_transforms(std::vector<Node>& nodes) {
    // In double precision, so that long chains and far places keep their accuracy.
    std::vector<glm::dmat4> world(nodes.size());
    for (const std::size_t index : walk(nodes, roots_of(nodes))) {
        Node& node = nodes[index];
        const glm::dmat4 local(node.matrix ? *node.matrix : compose(node.translation, node.rotation, node.scale));
        world[index] = node.parent ? world[*node.parent] * local : local;
        node.world = glm::mat4(world[index]);
    }
}

std::vector<std::size_t> placed_nodes(Document& document, const std::vector<Node>& nodes) {
    const auto& scenes = document.list("scenes");
    if (scenes.empty()) return walk(nodes, roots_of(nodes));
    const JsonView& scene = scenes[document.root().find_index("scene", scenes.size(), "scene").value_or(0)];
    std::vector<std::size_t> roots;
    for (const JsonView& root : scene.list("nodes")) {
        const std::uint64_t index = root.as_whole();
        if (index >= nodes.size()) {
            reject(fmt::format("{}: refers to node {}, but the file has only {}", root.pointer(), index, nodes.size()));
        }
        roots.push_back(index);
    }
    return walk(nodes, roots);
}

}  // namespace nacre::scene::gltf
