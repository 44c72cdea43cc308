// SPDX-License-Identifier: Apache-2.0
#include "scene/tangents.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace nacre::scene {
namespace {

std::uint32_t bits_of(float value) { return std::bit_cast<std::uint32_t>(value + 0.0f); }  // -0 and 0 are one value

constexpr std::uint32_t none = 0xffffffffu;

/// Numbers distinct keys of `words` words in the order in which they come. A table of its own with open addressing: it
/// is the inner loop of loading large scenes.
template <std::size_t words>
class KeyNumbers {
  public:
    using Key = std::array<std::uint32_t, words>;

    explicit KeyNumbers(std::size_t most_keys) : slots_(std::bit_ceil(2 * most_keys + 1), none) {}

    [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(keys_.size()); }

    std::uint32_t number_of(const Key& key) {
        std::uint64_t hash = 0xcbf29ce484222325ULL;
        for (const std::uint32_t word : key) {
            hash = (hash ^ word) * 0x9e3779b97f4a7c15ULL;
            hash ^= hash >> 29;
        }
        std::size_t slot = hash & (slots_.size() - 1);
        while (slots_[slot] != none && keys_[slots_[slot]] != key) slot = (slot + 1) & (slots_.size() - 1);
        if (slots_[slot] == none) {
            slots_[slot] = size();
            keys_.push_back(key);
        }
        return slots_[slot];
    }

  private:
    std::vector<std::uint32_t> slots_;  ///< Numbers, by hash.
    std::vector<Key> keys_;             ///< By number.
};

/// One run of the algorithm. A corner is 3 * triangle + 0..2.
class TangentBuilder {
  public:
    TangentBuilder(const Primitive& primitive, std::span<const glm::vec2> uv)
        : primitive_(primitive), uv_(uv), corner_count_(static_cast<std::uint32_t>(primitive.indices.size())) {
        weld();
        derive_triangles();
        connect();
        group();
    }

    /// One tangent for each corner.
    [[nodiscard]] std::vector<glm::vec4> corner_tangents() const {
        std::vector<glm::vec4> result(corner_count_);
        std::vector<std::uint32_t> grouped_corner_of(welded_count_, none);
        for (std::uint32_t corner = 0; corner < corner_count_; ++corner) {
            if (group_of_[corner] != none) grouped_corner_of[welded_[corner]] = corner;
        }
        for (std::uint32_t corner = 0; corner < corner_count_; ++corner) {
            // Triangles without area have no group: they take the tangent of any other corner at the same vertex.
            std::uint32_t source = corner;
            if (group_of_[source] == none) source = grouped_corner_of[welded_[corner]];
            result[corner] = source == none ? glm::vec4(any_perpendicular(normal(corner)), 1.0f)
                                            : group_tangents_[group_of_[source]];
        }
        return result;
    }

  private:
    struct Triangle {
        glm::vec3 u_direction{0.0f};  ///< Unit, or 0 where the texture coordinates have no area.
        bool keeps_orientation = true;
        bool joins_any_group = false;  ///< No area in texture coordinates.
        bool degenerate = false;       ///< Two corners at one place: takes no part.
    };

    [[nodiscard]] std::uint32_t vertex(std::uint32_t corner) const { return primitive_.indices[corner]; }
    [[nodiscard]] const glm::vec3& position(std::uint32_t corner) const { return primitive_.positions[vertex(corner)]; }
    [[nodiscard]] const glm::vec3& normal(std::uint32_t corner) const { return primitive_.normals[vertex(corner)]; }
    [[nodiscard]] glm::vec2 uv(std::uint32_t corner) const { return uv_[vertex(corner)]; }
    static std::uint32_t next(std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }
    static std::uint32_t previous(std::uint32_t corner) { return corner % 3 == 0 ? corner + 2 : corner - 1; }

    /// Numbers the distinct (position, normal, uv).
    void weld() {
        KeyNumbers<8> numbers(primitive_.positions.size());
        std::vector<std::uint32_t> number_of_vertex(primitive_.positions.size(), none);
        welded_.resize(corner_count_);
        for (std::uint32_t corner = 0; corner < corner_count_; ++corner) {
            std::uint32_t& number = number_of_vertex[vertex(corner)];
            if (number == none) {
                const glm::vec3 p = position(corner), n = normal(corner);
                const glm::vec2 t = uv(corner);
                number = numbers.number_of({bits_of(p.x), bits_of(p.y), bits_of(p.z), bits_of(n.x), bits_of(n.y),
                                            bits_of(n.z), bits_of(t.x), bits_of(t.y)});
            }
            welded_[corner] = number;
        }
        welded_count_ = numbers.size();
    }

    /// The direction in which u grows on each triangle, and whether its texture is mirrored.
    void derive_triangles() {
        triangles_.resize(corner_count_ / 3);
        for (std::uint32_t index = 0; index < triangles_.size(); ++index) {
            Triangle& triangle = triangles_[index];
            const std::uint32_t a = 3 * index, b = a + 1, c = a + 2;
            triangle.degenerate =
                position(a) == position(b) || position(b) == position(c) || position(c) == position(a);
            const glm::dvec3 edge1 = glm::dvec3(position(b)) - glm::dvec3(position(a));
            const glm::dvec3 edge2 = glm::dvec3(position(c)) - glm::dvec3(position(a));
            // v grows downwards, the algorithm expects it to grow upwards.
            const glm::dvec2 st1 = (glm::dvec2(uv(b)) - glm::dvec2(uv(a))) * glm::dvec2(1.0, -1.0);
            const glm::dvec2 st2 = (glm::dvec2(uv(c)) - glm::dvec2(uv(a))) * glm::dvec2(1.0, -1.0);
            const double signed_area = st1.x * st2.y - st1.y * st2.x;
            triangle.keeps_orientation = signed_area > 0.0;
            const glm::dvec3 direction = (st2.y * edge1 - st1.y * edge2) * (signed_area > 0.0 ? 1.0 : -1.0);
            const double length = glm::length(direction);
            constexpr double smallest = std::numeric_limits<float>::min();
            if (std::abs(signed_area) > smallest && length > smallest && std::isfinite(length)) {
                triangle.u_direction = glm::vec3(direction / length);
            } else {
                triangle.joins_any_group = true;
            }
        }
    }

    /// Finds for each edge (from its corner to the next) the triangle on its other side. Where more than two
    /// triangles meet at an edge, those that come first in the list are joined.
    void connect() {
        struct Edge {
            std::uint64_t ends;  ///< The same for both directions.
            std::uint32_t corner;
        };
        std::vector<Edge> edges;
        edges.reserve(corner_count_);
        for (std::uint32_t corner = 0; corner < corner_count_; ++corner) {
            if (triangles_[corner / 3].degenerate) continue;
            const auto [low, high] = std::minmax({welded_[corner], welded_[next(corner)]});
            edges.push_back({(std::uint64_t{low} << 32) | high, corner});
        }
        std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
            return a.ends != b.ends ? a.ends < b.ends : a.corner < b.corner;
        });

        opposite_.assign(corner_count_, none);
        std::vector<std::uint32_t> forward, backward;
        for (std::size_t first = 0; first < edges.size();) {
            std::size_t last = first;
            forward.clear();
            backward.clear();
            for (; last < edges.size() && edges[last].ends == edges[first].ends; ++last) {
                const std::uint32_t corner = edges[last].corner;
                (welded_[corner] <= welded_[next(corner)] ? forward : backward).push_back(corner);
            }
            for (std::size_t i = 0; i < std::min(forward.size(), backward.size()); ++i) {
                opposite_[forward[i]] = backward[i];
                opposite_[backward[i]] = forward[i];
            }
            first = last;
        }
    }

    /// Joins the corners around a vertex that are connected by edges and agree in orientation.
    void group() {
        group_of_.assign(corner_count_, none);
        std::vector<std::uint32_t> pending;
        for (std::uint32_t seed = 0; seed < corner_count_; ++seed) {
            const Triangle& first = triangles_[seed / 3];
            if (first.degenerate || first.joins_any_group || group_of_[seed] != none) continue;
            const auto group = static_cast<std::uint32_t>(group_tangents_.size());
            glm::dvec3 sum(0.0);
            pending.assign(1, seed);
            group_of_[seed] = group;
            while (!pending.empty()) {
                const std::uint32_t corner = pending.back();
                pending.pop_back();
                sum += weighted_direction(corner);
                visit_neighbors(corner, [&](std::uint32_t neighbor) {
                    Triangle& triangle = triangles_[neighbor / 3];
                    if (group_of_[neighbor] != none) return;
                    if (triangle.joins_any_group && !has_group(neighbor / 3)) {
                        triangle.keeps_orientation = first.keeps_orientation;
                    }
                    if (triangle.keeps_orientation != first.keeps_orientation) return;
                    group_of_[neighbor] = group;
                    pending.push_back(neighbor);
                });
            }
            // Directions that cancel out leave only rounding, which would not even be perpendicular.
            const double length = glm::length(sum);
            const glm::vec3 tangent = length > 1e-9 ? glm::vec3(sum / length) : any_perpendicular(normal(seed));
            group_tangents_.emplace_back(tangent, first.keeps_orientation ? 1.0f : -1.0f);
        }
    }

    [[nodiscard]] bool has_group(std::uint32_t triangle) const {
        return group_of_[3 * triangle] != none || group_of_[3 * triangle + 1] != none ||
               group_of_[3 * triangle + 2] != none;
    }

    /// The corners at the same vertex in the triangles across the two edges that meet there.
    template <typename Visit>
    void visit_neighbors(std::uint32_t corner, Visit&& visit) const {
        // The edge that leaves the corner arrives at it in the other triangle, and the reverse.
        if (const std::uint32_t other = opposite_[corner]; other != none) visit(next(other));
        if (const std::uint32_t other = opposite_[previous(corner)]; other != none) visit(other);
    }

    /// The triangle's u direction in the plane of the vertex normal, times the triangle's angle in that plane. In
    /// double precision, so that neither tiny nor huge triangles lose their squares.
    [[nodiscard]] glm::dvec3 weighted_direction(std::uint32_t corner) const {
        const Triangle& triangle = triangles_[corner / 3];
        if (triangle.joins_any_group) return glm::dvec3(0.0);
        const glm::dvec3 n(normal(corner));
        const auto in_plane = [&](const glm::dvec3& v) {
            const glm::dvec3 projected = v - n * glm::dot(n, v);
            const double length = glm::length(projected);
            return length > std::numeric_limits<float>::min() ? projected / length : glm::dvec3(0.0);
        };
        const glm::dvec3 here(position(corner));
        const glm::dvec3 to_next = in_plane(glm::dvec3(position(next(corner))) - here);
        const glm::dvec3 to_previous = in_plane(glm::dvec3(position(previous(corner))) - here);
        const double angle = std::acos(std::clamp(glm::dot(to_next, to_previous), -1.0, 1.0));
        return angle * in_plane(glm::dvec3(triangle.u_direction));
    }

    const Primitive& primitive_;
    std::span<const glm::vec2> uv_;
    std::uint32_t corner_count_;
    std::uint32_t welded_count_ = 0;
    std::vector<std::uint32_t> welded_;  ///< Per corner: number of its vertex.
    std::vector<Triangle> triangles_;
    std::vector<std::uint32_t> opposite_;  ///< Per corner: the corner that starts the same edge from its other end.
    std::vector<std::uint32_t> group_of_;  ///< Per corner.
    std::vector<glm::vec4> group_tangents_;
};

template <typename T>
void gather(std::vector<T>& values, std::span<const std::uint32_t> sources) {
    if (values.empty()) return;
    std::vector<T> result;
    result.reserve(sources.size());
    for (const std::uint32_t source : sources) result.push_back(values[source]);
    values = std::move(result);
}

}  // namespace

void gather_vertices(Primitive& primitive, std::span<const std::uint32_t> sources) {
    gather(primitive.positions, sources);
    gather(primitive.normals, sources);
    gather(primitive.tangents, sources);
    gather(primitive.uv0, sources);
    gather(primitive.uv1, sources);
    gather(primitive.colors, sources);
}

glm::vec3 any_perpendicular(const glm::vec3& normal) {
    const glm::vec3 axis = std::abs(normal.x) < 0.7f ? glm::vec3(1.0f, 0.0f, 0.0f) : glm::vec3(0.0f, 1.0f, 0.0f);
    return glm::normalize(axis - normal * glm::dot(normal, axis));
}

void add_flat_normals(Primitive& primitive) {
    const std::vector<std::uint32_t> sources = primitive.indices;
    primitive.normals.clear();
    gather_vertices(primitive, sources);
    primitive.normals.reserve(sources.size());
    for (std::size_t i = 0; i + 2 < sources.size(); i += 3) {
        // In double precision: coordinates up to the largest float must not overflow when squared.
        const glm::dvec3 a(primitive.positions[i]), b(primitive.positions[i + 1]), c(primitive.positions[i + 2]);
        const glm::dvec3 cross = glm::cross(b - a, c - a);
        const double length = glm::length(cross);
        const glm::vec3 normal = length > 0.0 && std::isfinite(length) ? glm::vec3(cross / length) : glm::vec3(0, 0, 1);
        primitive.normals.insert(primitive.normals.end(), 3, normal);
    }
    for (std::size_t i = 0; i < primitive.indices.size(); ++i) primitive.indices[i] = static_cast<std::uint32_t>(i);
}

void add_tangents(Primitive& primitive, std::span<const glm::vec2> uv) {
    if (uv.empty()) {
        primitive.tangents.clear();
        for (const glm::vec3& normal : primitive.normals) {
            primitive.tangents.emplace_back(any_perpendicular(normal), 1.0f);
        }
        return;
    }
    const std::vector<glm::vec4> corner_tangents = TangentBuilder(primitive, uv).corner_tangents();

    // Corners of one vertex with the same tangent stay one vertex; the others become new ones.
    KeyNumbers<5> numbers(corner_tangents.size());
    std::vector<std::uint32_t> sources;
    std::vector<glm::vec4> tangents;
    for (std::size_t corner = 0; corner < corner_tangents.size(); ++corner) {
        const glm::vec4& tangent = corner_tangents[corner];
        std::uint32_t& index = primitive.indices[corner];
        const std::uint32_t number =
            numbers.number_of({index, bits_of(tangent.x), bits_of(tangent.y), bits_of(tangent.z), bits_of(tangent.w)});
        if (number == sources.size()) {
            sources.push_back(index);
            tangents.push_back(tangent);
        }
        index = number;
    }
    primitive.tangents.clear();
    gather_vertices(primitive, sources);
    primitive.tangents = std::move(tangents);
}

}  // namespace nacre::scene
