// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "core/embedded_file.h"
#include "materials/storage.h"

/// @file
/// Stored materials in GLSL: writing one of a known topology, and reading any.
///
///     text = shader.defines + ... + shader.glsl + storage_writer(flat, layout);      // base pass
///     text = defines + "#include \"materials/closures/stored_closures.glsl\"" + ...;   // lighting
///
/// materials/storage.h does the same on the host, from the same tables.

namespace nacre::materials {

/// GLSL that follows tree_shader()'s of the same tree and offers
///
///     const uint stored_words, stored_top_closure, stored_top_frame;
///     void pack_tree(TreeState state, vec3 normals[tree_frame_count], vec3 tangents[tree_frame_count], float
///     occlusion,
///                    uvec2 pixel, out uint words[stored_words], out uint subsurface);
///
/// normals and tangents: unit, in any common space, in the order of Topology::frames; the normal of stored_top_frame is
/// the one that the reader will have, decoded. The layout must be of a class above StorageClass::simple.
[[nodiscard]] std::string storage_writer(const FlattenedTree& tree, const StorageLayout& layout);

/// One file for `ShaderCompilerDesc::embedded`, "materials/closures/stored_closures.glsl":
///
///     StoredHeader read_stored_header(vec3 top_normal);
///     StoredClosure read_stored_closure(inout StoredHeader header, uint index, float top_roughness, uint subsurface);
///
/// Closures are read in order. Who includes it has defined uint material_word(uint index), the features' macros,
/// NACRE_STORED_FRAMES (the most that a pixel has), and NACRE_STORED_LAYERS where closures lie below others.
[[nodiscard]] std::span<const EmbeddedFile> storage_reader_files();

}  // namespace nacre::materials
