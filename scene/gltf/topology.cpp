// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/topology.h"

#include <fmt/format.h>

#include <array>
#include <string_view>

#include "scene/gltf/failure.h"

namespace nacre::scene::gltf {
namespace {

struct ModeRule {
    std::string_view name;
    std::size_t least = 1;
    std::size_t multiple = 1;
};

constexpr std::array<ModeRule, 7> rules = {{
    {"POINTS", 1, 1},
    {"LINES", 2, 2},
    {"LINE_LOOP", 2, 1},
    {"LINE_STRIP", 2, 1},
    {"TRIANGLES", 3, 3},
    {"TRIANGLE_STRIP", 3, 1},
    {"TRIANGLE_FAN", 3, 1},
}};

void add_triangle(std::vector<std::uint32_t>& list, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (a != b && b != c && c != a) list.insert(list.end(), {a, b, c});
}

}  // namespace

Topology topology_of(PrimitiveMode mode) {
    switch (mode) {
        case PrimitiveMode::points: return Topology::point_list;
        case PrimitiveMode::lines:
        case PrimitiveMode::line_loop:
        case PrimitiveMode::line_strip: return Topology::line_list;
        case PrimitiveMode::triangles:
        case PrimitiveMode::triangle_strip:
        case PrimitiveMode::triangle_fan: break;
    }
    return Topology::triangle_list;
}

std::size_t corners_of(Topology topology) {
    return topology == Topology::point_list ? 1 : topology == Topology::line_list ? 2 : 3;
}

std::vector<std::uint32_t> to_list(PrimitiveMode mode, std::vector<std::uint32_t> indices, const std::string& element) {
    const ModeRule& rule = rules[static_cast<std::size_t>(mode)];
    const std::size_t count = indices.size();
    if (count < rule.least || count % rule.multiple != 0) {
        reject(fmt::format("{}: it has {} indices, but {} takes {}", element, with_commas(count), rule.name,
                           rule.multiple > 1 ? fmt::format("a multiple of {}", rule.multiple)
                                             : fmt::format("at least {}", rule.least)));
    }
    std::vector<std::uint32_t> list;
    switch (mode) {
        case PrimitiveMode::points:
        case PrimitiveMode::lines:
        case PrimitiveMode::triangles: return indices;
        case PrimitiveMode::line_loop:
        case PrimitiveMode::line_strip:
            list.reserve(2 * count);
            for (std::size_t i = 0; i + 1 < count; ++i) list.insert(list.end(), {indices[i], indices[i + 1]});
            if (mode == PrimitiveMode::line_loop) list.insert(list.end(), {indices[count - 1], indices[0]});
            break;
        case PrimitiveMode::triangle_strip:
            list.reserve(3 * (count - 2));
            for (std::size_t i = 0; i + 2 < count; ++i) {
                // Every other triangle winds the other way around in the strip.
                const std::size_t odd = i % 2;
                add_triangle(list, indices[i], indices[i + 1 + odd], indices[i + 2 - odd]);
            }
            break;
        case PrimitiveMode::triangle_fan:
            list.reserve(3 * (count - 2));
            for (std::size_t i = 1; i + 1 < count; ++i) add_triangle(list, indices[i], indices[i + 1], indices[0]);
            break;
    }
    return list;
}

}  // namespace nacre::scene::gltf
