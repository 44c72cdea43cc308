// SPDX-License-Identifier: Apache-2.0
#include "materials/specular_table.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <numbers>

#include "materials/conversions.h"

namespace nacre::materials {
namespace {

constexpr std::uint32_t size = SpecularTable::size;

template <typename Color>
SpecularTable table_of(std::string name, const Color& color) {
    SpecularTable table;
    table.name = std::move(name);
    for (std::uint32_t row = 0; row < size; ++row) {
        for (std::uint32_t column = 0; column < size; ++column) {
            const float view = static_cast<float>(column) / (size - 1), light = static_cast<float>(row) / (size - 1);
            table.entries[row * size + column] = glm::clamp(color(view, light), glm::vec3(0.0f), glm::vec3(1.0f));
        }
    }
    return table;
}

// Bands that follow one another as the path through a film does, which both angles shorten.
glm::vec3 bands(float view, float light) {
    const float path = 2.6f * 0.5f * (view + light);
    const auto channel = [&](float shift) {
        return 0.55f + 0.45f * std::cos(2.0f * std::numbers::pi_v<float> * (path - shift));
    };
    return {channel(0.0f), channel(0.33f), channel(0.67f)};
}

}  // namespace

SpecularTable flip_flop_table(const glm::vec3& facing, const glm::vec3& grazing, float exponent) {
    return table_of("flip-flop", [&](float view, float) { return flip_flop(facing, grazing, exponent, view); });
}

std::span<const SpecularTable> default_specular_tables() {
    static const std::vector<SpecularTable> tables = [] {
        std::vector<SpecularTable> result;
        result.push_back(flip_flop_table({1.0f, 0.85f, 0.7f}, {0.45f, 0.6f, 1.0f}, 2.0f));
        result.back().name = "pearl";
        result.push_back(flip_flop_table({0.2f, 0.9f, 0.35f}, {0.7f, 0.15f, 0.8f}, 1.5f));
        result.back().name = "beetle";
        result.push_back(table_of("oil", bands));
        result.emplace_back().name = "white";
        return result;
    }();
    return tables;
}

glm::dvec3 look_up(const SpecularTable& table, const glm::dvec2& at) {
    const glm::dvec2 place = glm::clamp(at, 0.0, 1.0) * (size - 1.0);
    const glm::dvec2 entry = glm::min(glm::floor(place), glm::dvec2(size - 2.0)), part = place - entry;
    const auto row = [&](std::size_t first) {
        return glm::mix(glm::dvec3(table.entries[first]), glm::dvec3(table.entries[first + 1]), part.x);
    };
    const auto first = static_cast<std::size_t>(entry.y) * size + static_cast<std::size_t>(entry.x);
    return glm::mix(row(first), row(first + size), part.y);
}

std::function<glm::dvec3(std::uint32_t, glm::dvec2)> tints_of(std::span<const SpecularTable> tables) {
    return [tables](std::uint32_t index, const glm::dvec2& at) {
        if (tables.empty()) return glm::dvec3(1.0);
        return look_up(tables[std::min<std::size_t>(index, tables.size() - 1)], at);
    };
}

std::vector<std::uint16_t> specular_table_words(std::span<const SpecularTable> tables) {
    std::vector<std::uint16_t> words;
    words.reserve(4 * size * size * tables.size());
    const auto word = [](float unit) {
        return static_cast<std::uint16_t>(std::lround(std::clamp(unit, 0.0f, 1.0f) * 65535.0f));
    };
    for (const SpecularTable& table : tables) {
        for (const glm::vec3& entry : table.entries) {
            for (const float unit : {entry.x, entry.y, entry.z, 1.0f}) words.push_back(word(unit));
        }
    }
    return words;
}

}  // namespace nacre::materials
