// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "scene/gltf/document.h"

/// @file
/// Accessors: all component types, normalized or not, interleaved, sparse, with or without a bufferView. Sizes are
/// checked against the bytes that exist, and charged to the document, before anything is allocated.
/// Internal to scene/gltf/; functions may throw `Rejected`.

namespace nacre::scene::gltf {

enum class ComponentType { int8, uint8, int16, uint16, uint32, float32 };

/// What an accessor says about itself; checked by `describe_accessor`.
struct AccessorInfo {
    std::uint64_t count = 0;
    ComponentType component = ComponentType::float32;
    std::uint32_t columns = 1;  ///< 1 but for matrices.
    std::uint32_t rows = 1;     ///< Components of a vector, or of a column.
    bool normalized = false;
    bool has_view = false;

    [[nodiscard]] std::uint32_t components() const { return columns * rows; }
};

/// Reads the description of an accessor without its data.
AccessorInfo describe_accessor(Document& document, std::size_t accessor);

/// All components as floats, element after element, normalized integers mapped to [0, 1] or [-1, 1].
/// `element` says who uses it and begins messages: "mesh 3 'wheel', primitive 0".
std::vector<float> read_reals(Document& document, std::size_t accessor, const std::string& element);

/// All components as unsigned integers (u8, u16, u32 accessors only).
std::vector<std::uint32_t> read_wholes(Document& document, std::size_t accessor, const std::string& element);

/// Vectors of exactly that many components.
std::vector<glm::vec2> read_vec2(Document& document, std::size_t accessor, const std::string& element);
std::vector<glm::vec3> read_vec3(Document& document, std::size_t accessor, const std::string& element);
std::vector<glm::vec4> read_vec4(Document& document, std::size_t accessor, const std::string& element);
std::vector<glm::mat4> read_mat4(Document& document, std::size_t accessor, const std::string& element);

}  // namespace nacre::scene::gltf
