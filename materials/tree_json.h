// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "materials/tree.h"

/// @file
/// Trees as JSON: a format for people. docs/materials.md shows it, materials/material.schema.json describes it to
/// editors.
///
///     {"nacre_material": 1, "name": "lacquered gold",
///      "root": {"layer": {"top": {"slab": {"roughness": 0.05, "albedo": 0}},
///                         "base": {"slab": {"f0": [1.0, 0.77, 0.34], "roughness": 0.3, "albedo": 0}},
///                         "thickness": 1e-4}}}
///
///     NACRE_TRY(const MaterialFile file, load_material("gold.json"));

namespace nacre::materials {

/// A tree and the pictures that its textures show: TextureReference::image counts in `images`.
struct MaterialFile {
    Tree tree;
    std::vector<std::filesystem::path>
        images;  ///< As written; load_material() makes them absolute to the file's folder.
};

/// Reads the format above. `source` names the text in errors. A field of a slab that belongs to a feature switches the
/// feature on; unknown members are errors. Error: parse, with line and column, or the place as
/// "root.layer.top.slab.f0"; invalid_argument as validate().
[[nodiscard]] Expected<MaterialFile> parse_material(std::string_view text, std::string_view source);

/// The same from a file of at most 16 MiB. Error: as parse_material(), not_found or input_output.
[[nodiscard]] Expected<MaterialFile> load_material(const std::filesystem::path& path);

/// The text that parse_material() reads back to an equal tree; fields that have their defaults are left out.
[[nodiscard]] std::string material_text(const MaterialFile& file);

/// The JSON schema of the format (draft 2020-12), made from slab_fields().
[[nodiscard]] std::string material_schema();

}  // namespace nacre::materials
