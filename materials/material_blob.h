// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec4.hpp>
#include <span>

#include "materials/single_slab.h"

/// @file
/// A material as shaders read it: 128 bytes that say all of it. A header, the numbers of textures in a table, and what
/// the material's own GLSL reads; only what does not fit lies in a second buffer, its sideband. Whoever has a blob (a
/// draw, a ray that hit something) can shade with it.
///
///     MaterialBlob blob = plain_slab_blob(single_slab(description));
///     MaterialHeader header = blob.header();
///     header.textures = 1;                  // the first texture is there,
///     blob.set_header(header);
///     blob.set_texture(0, table_index);     // under this number
///
/// passes/shared/material_blob.glsl reads the same rows. Rows are four words of 32 bits:
///
///     row 0      header
///     row 1      numbers of 7 textures, 16 bits each
///     rows 2-6   numbers: of a plain slab, or of a material of a program's own
///     row 7      scale of the normal map
///
/// A material that is a tree has the plain slab that stands for it (for alpha, emission, and whoever does without
/// trees) in rows 1 to 5, and in row 6 where the numbers and textures of its topology lie in the sideband.
///
/// Everything here is a value type without shared state.

namespace nacre::materials {

inline constexpr std::uint32_t blob_rows = 8;
/// Textures beside those of a tree.
inline constexpr std::uint32_t blob_textures = 7;
inline constexpr std::uint32_t blob_texture_row = 1;
inline constexpr std::uint32_t blob_payload_row = 2;  ///< First row of numbers.
inline constexpr std::uint32_t blob_tree_row =
    6;  ///< x: first row of the tree's numbers; y: of its textures, 8 to a row.
inline constexpr std::uint32_t blob_normal_scale_row = 7;  ///< x: for texture 2.

/// Which GLSL shades a blob.
enum class BlobType : std::uint16_t {
    plain_slab = 0,
    first_tree = 1,         ///< And on: topologies (materials/topology.h) by number.
    first_custom = 0x8000,  ///< And on: kinds of material of the program's own (materials/custom_material.h).
};

/// Row 0 of a blob.
struct MaterialHeader {
    static constexpr std::uint32_t no_sideband = ~0u;

    std::uint16_t type = 0;    ///< BlobType, or a number behind one of its firsts.
    std::uint16_t number = 0;  ///< Of the material among those that were packed together.
    AlphaMode alpha_mode = AlphaMode::opaque;
    bool double_sided = false;  ///< Normals turn to the viewer.
    bool unlit = false;
    bool emits = false;
    float alpha_cutoff = 0.5f;
    std::uint32_t sideband = no_sideband;  ///< First row in the buffer that holds what did not fit.
    std::uint8_t textures = 0;             ///< Bit i: texture i is there.
    std::uint8_t second_uv = 0;            ///< Bit i: texture i is read with the second texture coordinates.
    bool transformed = false;  ///< The sideband begins with two rows for each of 7 textures, which move coordinates.

    bool operator==(const MaterialHeader&) const = default;
};

/// See the top of this file.
struct MaterialBlob {
    std::array<glm::uvec4, blob_rows> rows{};

    bool operator==(const MaterialBlob&) const = default;

    void set_header(const MaterialHeader& header);
    [[nodiscard]] MaterialHeader header() const;
    /// Number of a texture, 0 to 65535; `index` is below blob_textures.
    void set_texture(std::uint32_t index, std::uint32_t texture);
    [[nodiscard]] std::uint32_t texture(std::uint32_t index) const;
    /// Four floats, kept bit by bit.
    void set_numbers(std::uint32_t row, const glm::vec4& numbers);
    [[nodiscard]] glm::vec4 numbers(std::uint32_t row) const;
};
/// A row of the sideband that holds the numbers of up to 8 textures.
[[nodiscard]] glm::uvec4 texture_row(std::span<const std::uint32_t> textures);
static_assert(sizeof(MaterialBlob) == 128);

/// The numbers of a plain slab and the header as far as the slab knows it; what textures there are is for whoever has
/// them.
[[nodiscard]] MaterialBlob plain_slab_blob(const SingleSlab& slab);
/// The slab of such a blob again, without its textures.
[[nodiscard]] SingleSlab plain_slab_of(const MaterialBlob& blob);

}  // namespace nacre::materials
