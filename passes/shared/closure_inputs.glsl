// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURE_INPUTS
#define NACRE_CLOSURE_INPUTS
// A point of a surface whose material is a tree: its tangent frames, and the tree seen from somewhere. Behind the text
// of a topology (passes/scene_closures.h), which has made TreeState, tree_frame_count and the functions tree_*.
#include "materials/closures/stored_frame.glsl"

struct SurfaceFrames {
    vec3 normals[tree_frame_count];
    vec3 tangents[tree_frame_count];
};

// Comes first: it also reads the texels that several fields share.
SurfaceFrames surface_frames() {
    read_shared_texels();
    SurfaceFrames frames;
    for (uint i = 0u; i < tree_frame_count; ++i) {
        vec3 normal = unit_or(in_normal, vec3(0.0, 1.0, 0.0));
        vec3 tangent;
#ifdef HAS_TANGENTS
        if (surface_has_tangents) {
            // As MikkTSpace decodes: the interpolated vectors are used as they are, the bitangent is made here.
            tangent = in_tangent.xyz;
            vec3 bitangent = in_tangent.w * cross(in_normal, tangent);
            vec3 direction = tree_normal(i);
            normal = unit_or(direction.x * tangent + direction.y * bitangent + direction.z * in_normal, normal);
            vec2 turn = tree_rotation(i);
            tangent = turn.x * tangent + turn.y * bitangent;
            tangent = unit_or(tangent - normal * dot(normal, tangent), frame_of_normal(normal).tangent);
        } else
#endif
        {
            tangent = frame_of_normal(normal).tangent;
        }
#ifdef DOUBLE_SIDED
        if (surface_faces_away) normal = -normal;
#endif
        frames.normals[i] = normal;
        frames.tangents[i] = tangent;
    }
    return frames;
}

StoredFrame stored_frame(SurfaceFrames frames, uint i) {
    StoredFrame frame;
    frame.normal = frames.normals[i];
    frame.tangent = frames.tangents[i];
    frame.bitangent = cross(frame.normal, frame.tangent);
    return frame;
}

TreeState shade_surface(SurfaceFrames frames, vec3 to_viewer, float footprint) {
    vec3 views[tree_frame_count];
    for (uint i = 0u; i < tree_frame_count; ++i) {
        views[i] = view_in_frame(stored_frame(frames, i), to_viewer);
    }
    return shade_tree(views, footprint);
}

#endif
