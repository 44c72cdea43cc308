// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "materials/topology.h"

/// @file
/// The steps of a topology as GLSL, specialized to it: straight code without loops over the tree, with the features of
/// each closure as constants. Numbers and textures stay inputs, so that materials of one topology share a shader.
///
///     NACRE_TRY(const FlattenedTree flat, flatten(tree));
///     const TreeShader shader = tree_shader(flat);
///     text = shader.defines + what_it_asks_for + shader.glsl + main_function;

namespace nacre::materials {

/// A texture that the shader reads: `tree_texture(i)` is the i-th.
struct TreeTexture {
    NodeIndex node;  ///< Of the visible tree.
    TextureInput input;
};

/// GLSL and what it reads. `glsl` includes "materials/closures/..." (see embedded_files()) and expects before it
///
///     float tree_parameter(uint index);   // parameters[index]
///     vec4 tree_texture(uint index);      // textures[index], filtered as the includer wants
///     and what materials/closures/tables.glsl asks for
///     NACRE_TREE_GLINT_POSITION, _DX and _DY, macros: vec2 (materials/slab.h), where glints have a place
///     NACRE_TREE_VERTEX_COLOR, macro: vec4, where the mesh has colors
///
/// and offers
///
///     const uint tree_closure_count, tree_frame_count;
///     struct TreeState { Slab slabs[]; Path paths[]; float coverages[]; Matter whole; Matter top; };
///     TreeState shade_tree(vec3 views[tree_frame_count], float footprint);  views: in each tangent frame
///     vec3 tree_reflected(TreeState, vec3 views[], vec3 lights[], float footprint);
///
/// where closures count as in Topology::closures and frames as in Topology::frames.
struct TreeShader {
    std::string defines;  ///< The features' macros (slab_features()); they stand before all else.
    std::string glsl;
    std::vector<float> parameters;
    std::vector<TreeTexture> textures;
};

/// Equal topologies with textures on the same inputs give equal text, whatever their numbers.
[[nodiscard]] TreeShader tree_shader(const FlattenedTree& tree);

}  // namespace nacre::materials
