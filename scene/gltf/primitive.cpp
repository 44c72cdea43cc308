// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/primitive.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "scene/gltf/accessor.h"
#include "scene/gltf/node.h"
#include "scene/gltf/topology.h"
#include "scene/shapes.h"
#include "scene/tangents.h"

namespace nacre::scene::gltf {
namespace {

bool is_finite(const glm::vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Reads and poses one primitive, step by step in the order of the calls in `read`.
class PrimitiveReader {
  public:
    PrimitiveReader(Document& document, const JsonView& json, const std::string& element,
                    const ImportedMaterial& material, const Pose& pose)
        : document_(document), json_(json), element_(element), material_(material), pose_(pose) {}

    std::optional<Primitive> read() {
        read_attributes();
        read_indices();
        apply_morph_targets();
        apply_skin();
        drop_broken_elements();
        if (primitive_.indices.empty()) return std::nullopt;
        drop_unused_vertices();
        mend_attributes();
        complete_normals();
        complete_tangents();
        update_bounds(primitive_);
        return std::move(primitive_);
    }

  private:
    [[nodiscard]] std::optional<std::size_t> attribute(const JsonView& attributes, std::string_view name);
    void read_attributes();
    std::vector<glm::vec4> read_colors(std::size_t accessor);
    void read_indices();
    void apply_morph_targets();
    void apply_skin();
    void drop_broken_elements();
    void drop_unused_vertices();
    void mend_attributes();
    void complete_normals();
    void complete_tangents();
    [[nodiscard]] const materials::TextureReference* tangent_texture() const;

    Document& document_;
    const JsonView& json_;
    const std::string& element_;
    const ImportedMaterial& material_;
    const Pose& pose_;
    Primitive primitive_;
    std::size_t vertex_count_ = 0;
};

/// Accessor of an attribute whose count must be that of the positions.
std::optional<std::size_t> PrimitiveReader::attribute(const JsonView& attributes, std::string_view name) {
    const auto accessor = attributes.find_index(name, document_.list("accessors").size(), "accessor");
    if (!accessor) return std::nullopt;
    const std::uint64_t count = describe_accessor(document_, *accessor).count;
    if (count != vertex_count_) {
        reject(fmt::format("{}, accessor {}: {} has {} elements, but POSITION has {}", element_, *accessor, name,
                           with_commas(count), with_commas(vertex_count_)));
    }
    return accessor;
}

std::vector<glm::vec4> PrimitiveReader::read_colors(std::size_t accessor) {
    const AccessorInfo info = describe_accessor(document_, accessor);
    if (info.columns == 1 && info.rows == 4) return read_vec4(document_, accessor, element_);
    std::vector<glm::vec4> colors;
    for (const glm::vec3& color : read_vec3(document_, accessor, element_)) colors.emplace_back(color, 1.0f);
    return colors;
}

void PrimitiveReader::read_attributes() {
    const JsonView attributes = json_.at("attributes");
    const std::size_t accessor_count = document_.list("accessors").size();
    if (!attributes.has("POSITION")) {
        document_.warnings().add(element_ + ": it has no positions and was left out");
        return;
    }
    const std::size_t positions = attributes.index("POSITION", accessor_count, "accessor");
    vertex_count_ = describe_accessor(document_, positions).count;
    if (vertex_count_ > 0xffffffffu) {
        reject(fmt::format("{}: it has {} vertices; 32-bit indices reach 4,294,967,295", element_,
                           with_commas(vertex_count_)));
    }
    primitive_.positions = read_vec3(document_, positions, element_);
    if (const auto accessor = attribute(attributes, "NORMAL")) {
        primitive_.normals = read_vec3(document_, *accessor, element_);
    }
    if (const auto accessor = attribute(attributes, "TANGENT")) {
        primitive_.tangents = read_vec4(document_, *accessor, element_);
    }
    if (const auto accessor = attribute(attributes, fmt::format("TEXCOORD_{}", material_.uv_sources[0]))) {
        primitive_.uv0 = read_vec2(document_, *accessor, element_);
    }
    if (const auto accessor = attribute(attributes, fmt::format("TEXCOORD_{}", material_.uv_sources[1]))) {
        primitive_.uv1 = read_vec2(document_, *accessor, element_);
    }
    if (const auto accessor = attribute(attributes, "COLOR_0")) primitive_.colors = read_colors(*accessor);
}

void PrimitiveReader::read_indices() {
    if (vertex_count_ == 0) return;
    const std::uint64_t mode = json_.whole("mode", 4);
    if (mode > 6) json_.at("mode").reject_as("a primitive mode (0 to 6)");
    std::vector<std::uint32_t> indices;
    if (const auto accessor = json_.find_index("indices", document_.list("accessors").size(), "accessor")) {
        if (describe_accessor(document_, *accessor).components() != 1) {
            reject(fmt::format("{}, accessor {}: indices must be of type SCALAR", element_, *accessor));
        }
        indices = read_wholes(document_, *accessor, element_);
        for (std::size_t i = 0; i < indices.size(); ++i) {
            if (indices[i] >= vertex_count_) {
                reject(fmt::format("{}, accessor {}: index {} is {}, but the primitive has {} vertices", element_,
                                   *accessor, with_commas(i), with_commas(indices[i]), with_commas(vertex_count_)));
            }
        }
    } else {
        document_.charge_geometry(vertex_count_ * sizeof(std::uint32_t), element_);
        indices.resize(vertex_count_);
        for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = static_cast<std::uint32_t>(i);
    }
    document_.charge_geometry(indices.size() * std::uint64_t{12}, element_);  // strips and fans grow to three times
    primitive_.topology = topology_of(static_cast<PrimitiveMode>(mode));
    primitive_.indices = to_list(static_cast<PrimitiveMode>(mode), std::move(indices), element_);
}

void PrimitiveReader::apply_morph_targets() {
    if (vertex_count_ == 0) return;
    const std::size_t target_count = json_.count("targets");
    for (std::size_t index = 0; index < target_count && index < pose_.weights.size(); ++index) {
        const float weight = pose_.weights[index];
        if (weight == 0.0f) continue;
        const JsonView target = json_.at("targets")[index];
        const std::string outer = fmt::format("{}, morph target {}", element_, index);
        const auto add = [&](std::string_view name, auto& values, auto&& read_deltas) {
            const auto accessor = attribute(target, name);
            if (!accessor || values.empty()) return;
            const auto deltas = read_deltas(*accessor);
            for (std::size_t i = 0; i < values.size(); ++i) values[i] += weight * deltas[i];
        };
        const auto vec2_deltas = [&](std::size_t accessor) { return read_vec2(document_, accessor, outer); };
        const auto vec3_deltas = [&](std::size_t accessor) { return read_vec3(document_, accessor, outer); };
        const auto tangent_deltas = [&](std::size_t accessor) {
            std::vector<glm::vec4> deltas;
            for (const glm::vec3& delta : read_vec3(document_, accessor, outer)) deltas.emplace_back(delta, 0.0f);
            return deltas;
        };
        add("POSITION", primitive_.positions, vec3_deltas);
        add("NORMAL", primitive_.normals, vec3_deltas);
        add("TANGENT", primitive_.tangents, tangent_deltas);
        add(fmt::format("TEXCOORD_{}", material_.uv_sources[0]), primitive_.uv0, vec2_deltas);
        add(fmt::format("TEXCOORD_{}", material_.uv_sources[1]), primitive_.uv1, vec2_deltas);
        add("COLOR_0", primitive_.colors, [&](std::size_t accessor) {
            const bool has_alpha = describe_accessor(document_, accessor).rows == 4;
            std::vector<glm::vec4> deltas = read_colors(accessor);
            if (!has_alpha) {
                for (glm::vec4& delta : deltas) delta.a = 0.0f;
            }
            return deltas;
        });
    }
}

void PrimitiveReader::apply_skin() {
    if (vertex_count_ == 0 || pose_.joint_worlds.empty()) return;
    const JsonView attributes = json_.at("attributes");
    if (!attributes.has("JOINTS_0") || !attributes.has("WEIGHTS_0")) {
        document_.warnings().add(element_ +
                                 ": its node has a skin, but it has no joints and weights; it was not moved");
        return;
    }

    // Sum the weighted joint transforms of each vertex over all sets of four.
    document_.charge_geometry(vertex_count_ * (sizeof(glm::mat4) + sizeof(float)), element_);
    std::vector<glm::mat4> transforms(vertex_count_, glm::mat4(0.0f));
    std::vector<float> weight_sums(vertex_count_, 0.0f);
    for (std::size_t set = 0;; ++set) {
        const auto joint_accessor = attribute(attributes, fmt::format("JOINTS_{}", set));
        const auto weight_accessor = attribute(attributes, fmt::format("WEIGHTS_{}", set));
        if (!joint_accessor || !weight_accessor) break;
        if (describe_accessor(document_, *joint_accessor).components() != 4) {
            reject(fmt::format("{}, accessor {}: JOINTS_{} must be of type VEC4", element_, *joint_accessor, set));
        }
        const std::vector<std::uint32_t> joints = read_wholes(document_, *joint_accessor, element_);
        const std::vector<glm::vec4> weights = read_vec4(document_, *weight_accessor, element_);
        for (std::size_t vertex = 0; vertex < vertex_count_; ++vertex) {
            for (int k = 0; k < 4; ++k) {
                const float weight = weights[vertex][k];
                if (!(weight > 0.0f) || !std::isfinite(weight)) continue;
                const std::uint32_t joint = joints[4 * vertex + static_cast<std::size_t>(k)];
                if (joint >= pose_.joint_worlds.size()) {
                    reject(fmt::format("{}, accessor {}: vertex {} refers to joint {}, but the skin has {}", element_,
                                       *joint_accessor, with_commas(vertex), joint, pose_.joint_worlds.size()));
                }
                transforms[vertex] += weight * pose_.joint_worlds[joint];
                weight_sums[vertex] += weight;
            }
        }
    }

    std::uint64_t without_weight = 0;
    for (std::size_t vertex = 0; vertex < vertex_count_; ++vertex) {
        if (!(weight_sums[vertex] > 0.0f)) {
            ++without_weight;
            transforms[vertex] = pose_.joint_worlds.front();
        } else {
            transforms[vertex] /= weight_sums[vertex];
        }
        const glm::mat4& transform = transforms[vertex];
        const glm::mat3 linear(transform);
        primitive_.positions[vertex] = glm::vec3(transform * glm::vec4(primitive_.positions[vertex], 1.0f));
        if (!primitive_.normals.empty()) {
            // The cofactor matrix turns normals as the inverse transpose does, and exists for every matrix.
            const glm::mat3 cofactors(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                                      glm::cross(linear[0], linear[1]));
            primitive_.normals[vertex] = cofactors * primitive_.normals[vertex];
        }
        if (!primitive_.tangents.empty()) {
            glm::vec4& tangent = primitive_.tangents[vertex];
            tangent = glm::vec4(linear * glm::vec3(tangent), tangent.w);
        }
    }
    document_.warnings().add(element_ + ": a vertex without joint weights follows the first joint", without_weight);
}

/// Points, lines and triangles with a corner that is not finite would poison bounds and rasterizers.
void PrimitiveReader::drop_broken_elements() {
    if (vertex_count_ == 0) return;
    const std::vector<glm::vec3>& positions = primitive_.positions;
    if (std::all_of(positions.begin(), positions.end(), [](const glm::vec3& p) { return is_finite(p); })) return;
    const std::size_t corners = corners_of(primitive_.topology);
    std::vector<std::uint32_t> kept;
    for (std::size_t i = 0; i < primitive_.indices.size(); i += corners) {
        const auto first = primitive_.indices.begin() + static_cast<std::ptrdiff_t>(i);
        const auto last = first + static_cast<std::ptrdiff_t>(corners);
        if (std::all_of(first, last, [&](std::uint32_t index) { return is_finite(positions[index]); })) {
            kept.insert(kept.end(), first, last);
        }
    }
    document_.warnings().add(element_ + ": an element with a position that is not a finite number was left out",
                             (primitive_.indices.size() - kept.size()) / corners);
    primitive_.indices = std::move(kept);
}

/// Many files share one large vertex buffer between primitives; each keeps what it draws.
void PrimitiveReader::drop_unused_vertices() {
    constexpr std::uint32_t unused = 0xffffffffu;
    std::vector<std::uint32_t> new_index(vertex_count_, unused);
    for (const std::uint32_t index : primitive_.indices) new_index[index] = 0;
    std::vector<std::uint32_t> sources;
    for (std::uint32_t vertex = 0; vertex < vertex_count_; ++vertex) {
        if (new_index[vertex] == unused) continue;
        new_index[vertex] = static_cast<std::uint32_t>(sources.size());
        sources.push_back(vertex);
    }
    if (sources.size() == vertex_count_) return;
    for (std::uint32_t& index : primitive_.indices) index = new_index[index];
    gather_vertices(primitive_, sources);
    vertex_count_ = sources.size();
}

/// Replaces texture coordinates and colors that are not finite.
void PrimitiveReader::mend_attributes() {
    std::uint64_t broken = 0;
    for (auto* coordinates : {&primitive_.uv0, &primitive_.uv1}) {
        for (glm::vec2& uv : *coordinates) {
            if (std::isfinite(uv.x) && std::isfinite(uv.y)) continue;
            uv = glm::vec2(0.0f);
            ++broken;
        }
    }
    document_.warnings().add(element_ + ": a texture coordinate that is not a finite number became 0", broken);
    broken = 0;
    for (glm::vec4& color : primitive_.colors) {
        if (!is_finite(glm::vec3(color)) || !std::isfinite(color.a)) {
            color = glm::vec4(1.0f);
            ++broken;
        }
        color = glm::clamp(color, 0.0f, 1.0f);
    }
    document_.warnings().add(element_ + ": a vertex color that is not a finite number became white", broken);
}

void PrimitiveReader::complete_normals() {
    if (primitive_.normals.empty()) {
        if (primitive_.topology != Topology::triangle_list) return;
        // glTF: without normals they are flat, and tangents that are there must be ignored.
        primitive_.tangents.clear();
        document_.charge_geometry(primitive_.indices.size() * std::uint64_t{56}, element_);
        add_flat_normals(primitive_);
        return;
    }
    std::uint64_t broken = 0;
    for (glm::vec3& normal : primitive_.normals) {
        const glm::dvec3 wide(normal);
        const double length = glm::length(wide);
        if (length > 0.0 && std::isfinite(length)) {
            normal = glm::vec3(wide / length);
        } else {
            normal = glm::vec3(0.0f);
            ++broken;
        }
    }
    if (broken == 0) return;
    document_.warnings().add(element_ + ": a normal without direction was replaced by that of its triangles", broken);
    std::vector<glm::dvec3> sums(primitive_.normals.size(), glm::dvec3(0.0));
    if (primitive_.topology == Topology::triangle_list) {
        for (std::size_t i = 0; i < primitive_.indices.size(); i += 3) {
            const std::uint32_t* corner = &primitive_.indices[i];
            const glm::dvec3 a(primitive_.positions[corner[0]]), b(primitive_.positions[corner[1]]),
                c(primitive_.positions[corner[2]]);
            for (int k = 0; k < 3; ++k) sums[corner[k]] += glm::cross(b - a, c - a);
        }
    }
    for (std::size_t i = 0; i < sums.size(); ++i) {
        if (primitive_.normals[i] != glm::vec3(0.0f)) continue;
        const double length = glm::length(sums[i]);
        primitive_.normals[i] =
            length > 0.0 && std::isfinite(length) ? glm::vec3(sums[i] / length) : glm::vec3(0.0f, 0.0f, 1.0f);
    }
}

/// The texture whose coordinates span the tangent space.
const materials::TextureReference* PrimitiveReader::tangent_texture() const {
    const materials::MaterialDescription& material = material_.description;
    if (material.normal_texture.present()) return &material.normal_texture;
    if (material.clearcoat && material.clearcoat->normal_texture.present()) return &material.clearcoat->normal_texture;
    if (material.anisotropy && material.anisotropy->texture.present()) return &material.anisotropy->texture;
    return nullptr;
}

void PrimitiveReader::complete_tangents() {
    if (!primitive_.tangents.empty()) {
        std::uint64_t broken = 0;
        for (std::size_t i = 0; i < primitive_.tangents.size(); ++i) {
            glm::vec4& tangent = primitive_.tangents[i];
            const glm::dvec3 wide{glm::vec3(tangent)};
            const double length = glm::length(wide);
            const bool valid = length > 0.0 && std::isfinite(length);
            if (!valid) ++broken;
            const glm::vec3 direction = valid                        ? glm::vec3(wide / length)
                                        : primitive_.normals.empty() ? glm::vec3(1.0f, 0.0f, 0.0f)
                                                                     : any_perpendicular(primitive_.normals[i]);
            tangent = glm::vec4(direction, tangent.w < 0.0f ? -1.0f : 1.0f);
        }
        document_.warnings().add(element_ + ": a tangent without direction was replaced", broken);
        return;
    }
    if (primitive_.topology != Topology::triangle_list || !materials::needs_tangents(material_.description)) return;

    document_.charge_geometry(primitive_.indices.size() * std::uint64_t{64}, element_);
    const materials::TextureReference* texture = tangent_texture();
    std::vector<glm::vec2> uv = texture && texture->uv_set == 1 ? primitive_.uv1 : primitive_.uv0;
    if (texture && !texture->transform.is_identity()) {
        // The map lies in transformed coordinates, so these span its tangent space.
        const auto& [offset, rotation, scale] = texture->transform;
        const float c = std::cos(rotation), s = std::sin(rotation);
        for (glm::vec2& at : uv) {
            const glm::vec2 scaled = at * scale;
            at = offset + glm::vec2(c * scaled.x + s * scaled.y, c * scaled.y - s * scaled.x);
            if (!std::isfinite(at.x) || !std::isfinite(at.y)) at = glm::vec2(0.0f);
        }
    }
    if (uv.empty() && texture) {
        document_.warnings().add(element_ + ": its material has a normal map, but it has no texture coordinates");
    }
    add_tangents(primitive_, uv);
}

}  // namespace

std::optional<Primitive> read_primitive(Document& document, const JsonView& json, const std::string& element,
                                        const ImportedMaterial& material, const Pose& pose) {
    return PrimitiveReader(document, json, element, material, pose).read();
}

}  // namespace nacre::scene::gltf
