// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>

#include "scene/environment.h"
#include "scene/gltf/accessor.h"
#include "scene/gltf/document.h"
#include "scene/gltf/image.h"
#include "scene/gltf/material.h"
#include "scene/gltf/node.h"
#include "scene/gltf/primitive.h"
#include "scene/gltf/volume_scale.h"
#include "scene/load.h"

namespace nacre::scene {
namespace gltf {
namespace {

/// Puts a scene together from the parts of a document.
class Importer {
  public:
    explicit Importer(Document& document) : document_(document) {}

    Scene import() {
        scene_.samplers = read_samplers(document_);
        materials_ = read_materials(document_, images_, scene_.samplers.size() - 1);

        std::vector<Node> nodes = read_nodes(document_);
        if (document_.options().time) {
            apply_animation(document_, nodes, document_.options().animation, *document_.options().time);
            scene_.time = *document_.options().time;
        }
        compute_world_transforms(nodes);
        for (const std::size_t index : placed_nodes(document_, nodes)) {
            const Node& node = nodes[index];
            if (!is_finite(node.world)) {
                document_.warnings().add(node.element +
                                         ": its transform is not finite, and what it holds was left out");
                continue;
            }
            const JsonView& json = document_.list("nodes")[index];
            place_mesh(json, node, nodes);
            place_camera(json, node);
            place_light(json, node);
        }

        for (ImportedMaterial& material : materials_) scene_.materials.push_back(std::move(material.description));
        scale_volumes(scene_);
        scene_.images = images_.load(document_);
        scene_.environment = studio_environment();
        if (scene_.cameras.empty()) scene_.cameras.push_back(framing_camera(world_bounds(scene_)));
        scene_.warnings = document_.warnings().sentences();
        return std::move(scene_);
    }

  private:
    void place_mesh(const JsonView& json, const Node& node, const std::vector<Node>& nodes);
    std::vector<glm::mat4> instance_transforms(const JsonView& json, const Node& node);
    std::vector<glm::mat4> joint_worlds(std::size_t skin, const std::vector<Node>& nodes);
    const std::vector<float>& weights_of_mesh(std::size_t mesh);
    std::uint32_t mesh_in_pose(std::size_t mesh, const Pose& pose);
    std::uint32_t default_material();
    void place_camera(const JsonView& json, const Node& node);
    void place_light(const JsonView& json, const Node& node);

    Document& document_;
    Scene scene_;
    ImageTable images_;
    std::vector<ImportedMaterial> materials_;
    std::optional<std::uint32_t> default_material_;
    std::map<std::size_t, std::vector<float>> mesh_weights_;
    std::map<std::pair<std::size_t, std::vector<float>>, std::uint32_t> shared_meshes_;  ///< By mesh and weights.
};

std::uint32_t Importer::default_material() {
    if (!default_material_) {
        default_material_ = static_cast<std::uint32_t>(materials_.size());
        materials_.emplace_back().description.name = "default";
    }
    return *default_material_;
}

void Importer::place_mesh(const JsonView& json, const Node& node, const std::vector<Node>& nodes) {
    const auto& meshes = document_.list("meshes");
    const auto mesh = json.find_index("mesh", meshes.size(), "mesh");
    if (!mesh) return;
    Pose pose{.weights = node.has_weights ? node.weights : weights_of_mesh(*mesh)};
    if (const auto skin = json.find_index("skin", document_.list("skins").size(), "skin")) {
        pose.joint_worlds = joint_worlds(*skin, nodes);
    }

    Instance instance{.name = node.name};
    if (!pose.joint_worlds.empty()) {
        // The joints say where a skinned mesh is; its own node does not.
        instance.mesh = mesh_in_pose(*mesh, pose);
        instance.transforms.emplace_back(1.0f);
    } else {
        const auto [entry, is_new] = shared_meshes_.try_emplace({*mesh, pose.weights}, 0u);
        if (is_new) entry->second = mesh_in_pose(*mesh, pose);
        instance.mesh = entry->second;
        instance.transforms = instance_transforms(json, node);
    }
    if (instance.name.empty()) instance.name = scene_.meshes[instance.mesh].name;
    if (!instance.transforms.empty() && !scene_.meshes[instance.mesh].primitives.empty()) {
        scene_.instances.push_back(std::move(instance));
    }
}

const std::vector<float>& Importer::weights_of_mesh(std::size_t mesh) {
    const auto [entry, is_new] = mesh_weights_.try_emplace(mesh);
    if (is_new) entry->second = document_.list("meshes")[mesh].reals("weights");
    return entry->second;
}

std::uint32_t Importer::mesh_in_pose(std::size_t mesh_index, const Pose& pose) {
    const JsonView& json = document_.list("meshes")[mesh_index];
    const std::string element = label("mesh", mesh_index, json);
    Mesh mesh{.name = printable(json.text("name", ""), 200)};
    const std::vector<JsonView> primitives = json.list("primitives");
    for (std::size_t index = 0; index < primitives.size(); ++index) {
        const auto file_material =
            primitives[index].find_index("material", document_.list("materials").size(), "material");
        const std::uint32_t material = file_material ? static_cast<std::uint32_t>(*file_material) : default_material();
        auto primitive = read_primitive(document_, primitives[index], fmt::format("{}, primitive {}", element, index),
                                        materials_[material], pose);
        if (!primitive) continue;
        primitive->material = material;
        mesh.primitives.push_back(*std::move(primitive));
    }
    scene_.meshes.push_back(std::move(mesh));
    return static_cast<std::uint32_t>(scene_.meshes.size() - 1);
}

/// EXT_mesh_gpu_instancing, or the one place of the node.
std::vector<glm::mat4> Importer::instance_transforms(const JsonView& json, const Node& node) {
    const auto extensions = json.find("extensions");
    const auto instancing = extensions ? extensions->find("EXT_mesh_gpu_instancing") : std::nullopt;
    if (!instancing) return {node.world};

    const JsonView attributes = instancing->at("attributes");
    const std::size_t accessor_count = document_.list("accessors").size();
    const std::string element = node.element + ", EXT_mesh_gpu_instancing";
    std::optional<std::uint64_t> count;
    const auto accessor = [&](std::string_view name) {
        const auto found = attributes.find_index(name, accessor_count, "accessor");
        if (!found) return found;
        const std::uint64_t this_count = describe_accessor(document_, *found).count;
        if (count && *count != this_count) {
            reject(fmt::format("{}: {} has {} elements, but the attribute before it has {}", element, name,
                               with_commas(this_count), with_commas(*count)));
        }
        count = this_count;
        return found;
    };
    std::vector<glm::vec3> translations, scales;
    std::vector<glm::vec4> rotations;
    if (const auto found = accessor("TRANSLATION")) translations = read_vec3(document_, *found, element);
    if (const auto found = accessor("ROTATION")) rotations = read_vec4(document_, *found, element);
    if (const auto found = accessor("SCALE")) scales = read_vec3(document_, *found, element);
    if (!count) return {node.world};

    document_.charge_geometry(*count * sizeof(glm::mat4), element);
    std::vector<glm::mat4> transforms;
    for (std::size_t i = 0; i < *count; ++i) {
        const glm::mat4 transform =
            node.world * compose(translations.empty() ? glm::vec3(0.0f) : translations[i],
                                 rotations.empty() ? glm::quat(1.0f, 0.0f, 0.0f, 0.0f) : unit_quaternion(rotations[i]),
                                 scales.empty() ? glm::vec3(1.0f) : scales[i]);
        if (is_finite(transform)) transforms.push_back(transform);
    }
    document_.warnings().add(element + ": an instance whose transform is not finite was left out",
                             *count - transforms.size());
    return transforms;
}

std::vector<glm::mat4> Importer::joint_worlds(std::size_t skin, const std::vector<Node>& nodes) {
    const JsonView& json = document_.list("skins")[skin];
    const std::string element = label("skin", skin, json);
    std::vector<glm::mat4> result;
    document_.charge_geometry(json.count("joints") * sizeof(glm::mat4), element);
    for (const JsonView& joint : json.list("joints")) {
        const std::uint64_t index = joint.as_whole();
        if (index >= nodes.size()) {
            reject(
                fmt::format("{}: refers to node {}, but the file has only {}", joint.pointer(), index, nodes.size()));
        }
        result.push_back(nodes[index].world);
    }
    if (result.empty()) reject(element + ": it has no joints");
    const auto accessor = json.find_index("inverseBindMatrices", document_.list("accessors").size(), "accessor");
    if (accessor) {
        const std::vector<glm::mat4> inverse_binds = read_mat4(document_, *accessor, element);
        if (inverse_binds.size() < result.size()) {
            reject(fmt::format("{}: it has {} joints, but {} inverse bind matrices", element, result.size(),
                               inverse_binds.size()));
        }
        for (std::size_t i = 0; i < result.size(); ++i) result[i] *= inverse_binds[i];
    }
    return result;
}

/// The rotation and translation of a transform; nothing where an axis has no length.
std::optional<glm::mat4> without_scale(const glm::mat4& transform) {
    const glm::dvec3 z(transform[2]);
    const glm::dvec3 y(transform[1]);
    const glm::dvec3 backward = z / glm::length(z);
    const glm::dvec3 right_unscaled = glm::cross(y, backward);
    const glm::dvec3 right = right_unscaled / glm::length(right_unscaled);
    const glm::mat4 result(glm::vec4(glm::vec3(right), 0.0f), glm::vec4(glm::vec3(glm::cross(backward, right)), 0.0f),
                           glm::vec4(glm::vec3(backward), 0.0f), transform[3]);
    return is_finite(result) ? std::optional(result) : std::nullopt;
}

void Importer::place_camera(const JsonView& json, const Node& node) {
    const auto& cameras = document_.list("cameras");
    const auto index = json.find_index("camera", cameras.size(), "camera");
    if (!index) return;
    const JsonView& camera_json = cameras[*index];
    const std::string element = label("camera", *index, camera_json);
    const auto world = without_scale(node.world);
    Camera camera{.name = printable(camera_json.text("name", ""), 200)};
    if (camera.name.empty()) camera.name = node.name;
    if (camera.name.empty()) camera.name = fmt::format("camera {}", *index);

    const std::string type = camera_json.text("type");
    bool valid = world.has_value();
    if (type == "perspective") {
        const JsonView perspective = camera_json.at("perspective");
        camera.vertical_field_of_view = perspective.real("yfov");
        camera.aspect_ratio = perspective.real("aspectRatio", 0.0f);
        camera.near_distance = perspective.real("znear");
        camera.far_distance = perspective.real("zfar", std::numeric_limits<float>::infinity());
        valid = valid && camera.vertical_field_of_view > 1e-4f &&
                camera.vertical_field_of_view < std::numbers::pi_v<float> - 1e-4f && camera.aspect_ratio >= 0.0f &&
                camera.near_distance > 0.0f && camera.far_distance > camera.near_distance;
    } else if (type == "orthographic") {
        const JsonView orthographic = camera_json.at("orthographic");
        camera.projection = Projection::orthographic;
        camera.half_width = std::abs(orthographic.real("xmag"));
        camera.half_height = std::abs(orthographic.real("ymag"));
        camera.near_distance = orthographic.real("znear");
        camera.far_distance = orthographic.real("zfar");
        valid = valid && camera.half_width > 0.0f && camera.half_height > 0.0f && camera.near_distance >= 0.0f &&
                camera.far_distance > camera.near_distance;
    } else {
        camera_json.at("type").reject_as("perspective or orthographic");
    }
    if (!valid) {
        document_.warnings().add(element +
                                 ": its numbers make no picture (angle, distances or transform), and it was left out");
        return;
    }
    camera.world = *world;
    scene_.cameras.push_back(std::move(camera));
}

void Importer::place_light(const JsonView& json, const Node& node) {
    const auto extensions = json.find("extensions");
    const auto reference = extensions ? extensions->find("KHR_lights_punctual") : std::nullopt;
    if (!reference) return;
    const auto extension = document_.extension("KHR_lights_punctual");
    const std::size_t index = reference->index("light", extension ? extension->count("lights") : 0, "light");
    const JsonView light_json = extension->at("lights")[index];
    const std::string element = label("light", index, light_json);

    Light light{.name = printable(light_json.text("name", ""), 200)};
    if (light.name.empty()) light.name = node.name;
    const std::string type = light_json.text("type");
    if (type == "directional") {
        light.kind = LightKind::directional;
    } else if (type == "point") {
        light.kind = LightKind::point;
    } else if (type == "spot") {
        light.kind = LightKind::spot;
    } else {
        light_json.at("type").reject_as("directional, point or spot");
    }
    light.color = glm::max(light_json.vector("color", glm::vec3(1.0f)), glm::vec3(0.0f));
    light.intensity = light_json.real("intensity", 1.0f);
    if (light.intensity < 0.0f) {
        document_.warnings().add(element + ": its intensity is negative and became 0");
        light.intensity = 0.0f;
    }
    light.range = light_json.real("range", std::numeric_limits<float>::infinity());
    if (!(light.range > 0.0f)) {
        document_.warnings().add(element + ": its range is not above 0 and became unlimited");
        light.range = std::numeric_limits<float>::infinity();
    }
    light.position = glm::vec3(node.world[3]);
    const glm::dvec3 backward(node.world[2]);
    const double length = glm::length(backward);
    if (length > 0.0 && std::isfinite(length)) light.direction = -glm::vec3(backward / length);

    if (const auto spot = light_json.find("spot")) {
        light.inner_cone_angle = spot->real("innerConeAngle", 0.0f);
        light.outer_cone_angle = spot->real("outerConeAngle", std::numbers::pi_v<float> / 4.0f);
    }
    const bool cone_is_valid = light.inner_cone_angle >= 0.0f && light.inner_cone_angle < light.outer_cone_angle &&
                               light.outer_cone_angle <= std::numbers::pi_v<float> / 2.0f + 1e-4f;
    if (!cone_is_valid) {
        document_.warnings().add(element + ": its cone angles are not 0 <= inner < outer <= pi / 2 and were clamped");
        light.outer_cone_angle = std::clamp(light.outer_cone_angle, 1e-3f, std::numbers::pi_v<float> / 2.0f);
        light.inner_cone_angle = std::clamp(light.inner_cone_angle, 0.0f, 0.999f * light.outer_cone_angle);
    }
    scene_.lights.push_back(std::move(light));
}

}  // namespace
}  // namespace gltf

Expected<Scene> load_gltf(std::span<const std::byte> bytes, const std::string& name, const std::string& folder,
                          const LoadOptions& options) {
    const std::string subject = "'" + gltf::printable(name, 400) + "'";
    try {
        gltf::Document document(bytes, folder, options);
        Scene scene = gltf::Importer(document).import();
        scene.name = name;
        return scene;
    } catch (gltf::Rejected& rejected) {
        return fail(rejected.code, "load scene", subject, std::move(rejected.reason), std::move(rejected.remedy));
    } catch (const std::bad_alloc&) {
        return fail(ErrorCode::out_of_memory, "load scene", subject, "the memory of this machine is not enough for it",
                    "Use a smaller scene.");
    } catch (const std::exception& exception) {
        return fail(ErrorCode::internal, "load scene", subject, exception.what(), "Please report this file.");
    }
}

}  // namespace nacre::scene
