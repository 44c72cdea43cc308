// SPDX-License-Identifier: Apache-2.0
#include "passes/scene_geometry.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <glm/mat4x4.hpp>
#include <memory>
#include <span>

namespace nacre::passes {
namespace {

constexpr std::array<std::uint32_t, attribute_count> attribute_bytes = {12, 12, 16, 8, 8, 16, 16};
constexpr std::array<rhi::Format, attribute_count> attribute_formats = {
    rhi::Format::rgb32_float, rhi::Format::rgb32_float, rhi::Format::rgba32_float,
    rhi::Format::rg32_float,  rhi::Format::rg32_float,  rhi::Format::rgba32_float, rhi::Format::rgba32_float};
constexpr std::array<std::uint32_t, attribute_count> attribute_locations = {0, 1, 2, 3, 4, 5, 9};
constexpr std::array<const char*, attribute_count> attribute_names = {"positions", "normals", "tangents",
                                                                      "uv0",       "uv1",     "colors",  "corners"};
constexpr std::uint32_t instance_bytes = 48;

std::span<const std::byte> attribute_content(const scene::Primitive& primitive, Attribute attribute) {
    switch (attribute) {
        case Attribute::position: return std::as_bytes(std::span(primitive.positions));
        case Attribute::normal: return std::as_bytes(std::span(primitive.normals));
        case Attribute::tangent: return std::as_bytes(std::span(primitive.tangents));
        case Attribute::uv0: return std::as_bytes(std::span(primitive.uv0));
        case Attribute::uv1: return std::as_bytes(std::span(primitive.uv1));
        case Attribute::color: return std::as_bytes(std::span(primitive.colors));
        case Attribute::corner: break;
    }
    return {};
}

/// Points and lines as two triangles each, one pixel wide: each vertex is there once for each corner of its rectangle.
struct Rectangles {
    scene::Primitive primitive;
    std::vector<glm::vec4> corners;
};

Rectangles rectangles_of(const scene::Primitive& thin) {
    Rectangles result;
    scene::Primitive& made = result.primitive;
    made.material = thin.material;
    made.bounds = thin.bounds;
    const auto copy = [](auto& to, const auto& from, std::uint32_t vertex) {
        if (!from.empty()) to.push_back(from[vertex]);
    };
    const auto add = [&](std::uint32_t vertex, const glm::vec3& other, float code) {
        copy(made.positions, thin.positions, vertex);
        copy(made.normals, thin.normals, vertex);
        copy(made.tangents, thin.tangents, vertex);
        copy(made.uv0, thin.uv0, vertex);
        copy(made.uv1, thin.uv1, vertex);
        copy(made.colors, thin.colors, vertex);
        result.corners.emplace_back(other, code);
    };
    const bool points = thin.topology == scene::Topology::point_list;
    for (std::size_t i = 0; i + (points ? 0 : 1) < thin.indices.size(); i += points ? 1 : 2) {
        const auto first = static_cast<std::uint32_t>(made.positions.size());
        const std::uint32_t a = thin.indices[i];
        if (points) {
            for (int corner = 0; corner < 4; ++corner) add(a, thin.positions[a], static_cast<float>(corner));
        } else {
            // Seen from the other end, left and right change places.
            const std::uint32_t b = thin.indices[i + 1];
            add(a, thin.positions[b], 1.0f);
            add(a, thin.positions[b], -1.0f);
            add(b, thin.positions[a], -1.0f);
            add(b, thin.positions[a], 1.0f);
        }
        for (const std::uint32_t corner : {0u, 1u, 2u, 2u, 1u, 3u}) made.indices.push_back(first + corner);
    }
    return result;
}

void append(std::vector<std::byte>& to, std::span<const std::byte> bytes) {
    to.insert(to.end(), bytes.begin(), bytes.end());
}

void append_rows(std::vector<std::byte>& to, const glm::mat4& world) {
    float rows[12];
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 4; ++column) rows[row * 4 + column] = world[column][row];
    }
    append(to, std::as_bytes(std::span(rows)));
}

}  // namespace

Expected<std::unique_ptr<SceneGeometry>> SceneGeometry::create(rhi::Device& device, const scene::Scene& scene,
                                                               const std::vector<materials::SingleSlab>& slabs,
                                                               const SceneClosures& closures, const CustomKinds& kinds,
                                                               std::uint32_t allowed_textures, bool with_colors) {
    auto result = std::unique_ptr<SceneGeometry>(new SceneGeometry(device));
    std::array<std::vector<std::byte>, attribute_count> attributes;
    std::vector<std::byte> indices, instances;

    // Primitives that are placed several times are uploaded once.
    struct Uploaded {
        bool done = false;
        Draw draw;
    };
    std::vector<std::vector<Uploaded>> uploaded(scene.meshes.size());
    for (const scene::Instance& instance : scene.instances) {
        const scene::Mesh& mesh = scene.meshes[instance.mesh];
        uploaded[instance.mesh].resize(mesh.primitives.size());
        for (std::size_t p = 0; p < mesh.primitives.size(); ++p) {
            const scene::Primitive& primitive = mesh.primitives[p];
            Uploaded& shared = uploaded[instance.mesh][p];
            if (!shared.done) {
                shared.done = true;
                const materials::SingleSlab& slab = slabs[primitive.material];
                Draw& draw = shared.draw;
                draw.material = primitive.material;
                draw.features = restricted(
                    features_of(slab, primitive, kinds.kind_of(primitive.material), kinds.data_of(primitive.material)),
                    allowed_textures, true, with_colors);
                draw.topology = primitive.topology;
                draw.two_faces = slab.double_sided || primitive.topology != scene::Topology::triangle_list;
                draw.alpha_mode = slab.alpha_mode;
                const ClosureMaterial* closure_material = closures.find(primitive.material);
                draw.emits = draw.features.emits;
                if (closure_material != nullptr && !primitive.normals.empty()) {
                    draw.has_closures = true;
                    draw.emits = (closure_material->features & materials::slab_emission) != 0;
                    draw.closure_features = SceneClosures::features_of(*closure_material, primitive, slab.double_sided);
                    if (!with_colors) draw.closure_features.attributes &= ~attribute_bit(Attribute::color);
                    if (closure_material->is_translucent) draw.alpha_mode = materials::AlphaMode::blend;
                }
                draw.index_offset = indices.size();
                Rectangles rectangles;
                if (draw.features.thin) rectangles = rectangles_of(primitive);
                const scene::Primitive& drawn = draw.features.thin ? rectangles.primitive : primitive;
                draw.index_count = static_cast<std::uint32_t>(drawn.indices.size());
                append(indices, std::as_bytes(std::span(drawn.indices)));
                for (std::uint32_t a = 0; a < attribute_count; ++a) {
                    if (((draw.features.attributes | draw.closure_features.attributes) & (1u << a)) == 0) continue;
                    draw.attribute_offsets[a] = attributes[a].size();
                    append(attributes[a], static_cast<Attribute>(a) == Attribute::corner
                                              ? std::as_bytes(std::span(rectangles.corners))
                                              : attribute_content(drawn, static_cast<Attribute>(a)));
                }
            }
            if (shared.draw.index_count == 0) continue;
            // Mirrored places need the other winding; blended ones are sorted one by one.
            for (const bool mirrored : {false, true}) {
                Draw draw = shared.draw;
                draw.mirrored = mirrored;
                draw.instance_offset = instances.size();
                for (const glm::mat4& transform : instance.transforms) {
                    if (scene::is_mirrored(transform) != mirrored) continue;
                    append_rows(instances, transform);
                    draw.bounds.add(primitive.bounds.transformed(transform));
                    ++draw.instance_count;
                    if (draw.alpha_mode == materials::AlphaMode::blend) {
                        result->draws_.push_back(draw);
                        draw.bounds = {};
                        draw.instance_count = 0;
                        draw.instance_offset = instances.size();
                    }
                }
                result->bounds_.add(draw.bounds);
                if (draw.instance_count > 0) result->draws_.push_back(draw);
            }
        }
    }
    for (const Draw& draw : result->draws_) result->bounds_.add(draw.bounds);

    const auto upload = [&](rhi::Buffer& buffer, const std::vector<std::byte>& content, rhi::BufferUsage usage,
                            const char* name, std::uint32_t attribute = ~0u) -> Expected<void> {
        if (content.empty()) return {};
        const rhi::BufferDesc desc{
            .size = content.size(), .usage = usage | rhi::BufferUsage::copy_destination, .name = name};
        NACRE_TRY(buffer, device.create_buffer(desc));
        result->all_buffers_.push_back({buffer, desc,
                                        rhi::has_any(usage, rhi::BufferUsage::index) ? rhi::ResourceUse::index_buffer
                                                                                     : rhi::ResourceUse::vertex_buffer,
                                        attribute});
        result->bytes_ += content.size();
        return device.write_buffer(buffer, std::span<const std::byte>(content));
    };
    for (std::uint32_t a = 0; a < attribute_count; ++a) {
        NACRE_CHECK(upload(result->attributes_[a], attributes[a], rhi::BufferUsage::vertex, attribute_names[a], a));
    }
    NACRE_CHECK(upload(result->indices_, indices, rhi::BufferUsage::index, "indices"));
    NACRE_CHECK(upload(result->instances_, instances, rhi::BufferUsage::vertex, "instances"));
    return result;
}

SceneGeometry::~SceneGeometry() {
    for (const NamedBuffer& named : all_buffers_) device_.destroy(named.buffer);
}

void SceneGeometry::record(rhi::CommandList& list, const Draw& draw, std::uint32_t attributes) const {
    std::uint32_t slot = 0;
    for (std::uint32_t a = 0; a < attribute_count; ++a) {
        if ((attributes & (1u << a)) != 0) list.set_vertex_buffer(slot++, attributes_[a], draw.attribute_offsets[a]);
    }
    list.set_vertex_buffer(slot, instances_, draw.instance_offset);
    list.set_index_buffer(indices_, rhi::IndexType::uint32, draw.index_offset);
    list.draw_indexed({.index_count = draw.index_count, .instance_count = draw.instance_count});
}

std::vector<bool> SceneGeometry::visible_in(const glm::mat4& view_projection) const {
    std::vector<bool> visible;
    visible.reserve(draws_.size());
    for (const Draw& draw : draws_) {
        // Outside when all corners are on the wrong side of one plane: -w <= x, y <= w, 0 <= z <= w.
        bool beyond[6] = {true, true, true, true, true, true};
        for (int corner = 0; corner < 8; ++corner) {
            const glm::vec3 point((corner & 1) != 0 ? draw.bounds.maximum.x : draw.bounds.minimum.x,
                                  (corner & 2) != 0 ? draw.bounds.maximum.y : draw.bounds.minimum.y,
                                  (corner & 4) != 0 ? draw.bounds.maximum.z : draw.bounds.minimum.z);
            const glm::vec4 clip = view_projection * glm::vec4(point, 1.0f);
            // A little room for rounding: what the device draws must never be left out.
            const float w = clip.w + 1e-4f * std::abs(clip.w);
            beyond[0] &= clip.x < -w, beyond[1] &= clip.x > w;
            beyond[2] &= clip.y < -w, beyond[3] &= clip.y > w;
            beyond[4] &= clip.z < -1e-4f * std::abs(clip.w), beyond[5] &= clip.z > w;
        }
        visible.push_back(!(beyond[0] || beyond[1] || beyond[2] || beyond[3] || beyond[4] || beyond[5]));
    }
    return visible;
}

void SceneGeometry::describe_vertices(std::uint32_t attributes, rhi::GraphicsPipelineDesc& pipeline) {
    std::uint32_t slot = 0;
    for (std::uint32_t a = 0; a < attribute_count; ++a) {
        if ((attributes & (1u << a)) == 0) continue;
        pipeline.vertex_buffers.push_back({.stride = attribute_bytes[a]});
        pipeline.vertex_attributes.push_back(
            {.location = attribute_locations[a], .buffer = slot++, .offset = 0, .format = attribute_formats[a]});
    }
    pipeline.vertex_buffers.push_back({.stride = instance_bytes, .per_instance = true});
    for (std::uint32_t row = 0; row < 3; ++row) {
        pipeline.vertex_attributes.push_back(
            {.location = 6 + row, .buffer = slot, .offset = row * 16, .format = rhi::Format::rgba32_float});
    }
}

}  // namespace nacre::passes
