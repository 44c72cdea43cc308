// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rhi/shader_compiler.h"

/// @file
/// The resolved plan: what a profile, a scene and a device's capabilities come to. It is what `nacre explain` prints.
///
///     std::cout << to_text(renderer->plan());

namespace nacre::passes {

/// A shader as it is compiled for this scene.
struct PlannedShader {
    std::string path;                        ///< "passes/base_pass/base_pass.frag"
    std::vector<rhi::ShaderDefine> defines;  ///< Features that are on.
    std::uint64_t spirv_bytes = 0;
    std::uint64_t spirv_hash = 0;            ///< Equal hashes: equal bytes.
    friend bool operator==(const PlannedShader& a, const PlannedShader& b) {
        return a.path == b.path && a.spirv_bytes == b.spirv_bytes && a.spirv_hash == b.spirv_hash;
    }
};

struct PlannedPass {
    std::string name;
    std::vector<std::string> reads;   ///< Names of resources.
    std::vector<std::string> writes;
    std::vector<PlannedShader> shaders;
    std::uint64_t draws = 0;          ///< Draws per frame; 0 for compute.
    friend bool operator==(const PlannedPass&, const PlannedPass&) = default;
};

struct PlannedResource {
    std::string name;
    std::string format;               ///< Of textures; empty for buffers.
    std::uint32_t width = 0, height = 0, layers = 1, mips = 1;
    std::uint64_t bytes = 0;
    std::string shares_with;          ///< Transient resource whose memory it takes over; empty: its own.
    bool persistent = false;          ///< Lives across frames (tables, shadow maps, environment).
    friend bool operator==(const PlannedResource&, const PlannedResource&) = default;
};

/// Something that was not needed or not possible.
struct LeftOut {
    std::string what;  ///< "pass emission"
    std::string why;   ///< "no material emits light"
    friend bool operator==(const LeftOut&, const LeftOut&) = default;
};

struct Plan {
    std::string scene, profile, backend, device;
    std::uint32_t width = 0, height = 0;
    std::vector<PlannedPass> passes;        ///< In order of execution; preparation passes first.
    std::vector<PlannedResource> resources;
    std::vector<LeftOut> left_out;
    std::uint64_t gbuffer_bytes_per_pixel = 0;
    std::uint64_t transient_bytes = 0;           ///< As allocated.
    std::uint64_t transient_bytes_unshared = 0;  ///< As it would be without sharing.
    std::uint64_t persistent_bytes = 0;
    std::uint64_t geometry_bytes = 0;
    std::uint64_t texture_bytes = 0;             ///< Of the scene's materials.
};

/// For people.
std::string to_text(const Plan& plan);
/// The same as JSON text.
std::string to_json(const Plan& plan);

}  // namespace nacre::passes
