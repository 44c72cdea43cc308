// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/rhi/validation_bench.h"

namespace nacre::test {

inline constexpr auto storage = rhi::BufferUsage::storage;
inline constexpr auto copies = rhi::BufferUsage::copy_source | rhi::BufferUsage::copy_destination;
inline constexpr auto texture_copies = rhi::TextureUsage::copy_source | rhi::TextureUsage::copy_destination;
/// Writes a storage buffer of 256 bytes at binding 0.
inline const char* const storage_shader =
    "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer Result { uint result[64]; }; void main() { "
    "result[0] = 1u; }";

/// Has an input at location 0.
inline const char* const input_vertex = "layout(location = 0) in vec4 a; void main() { gl_Position = a; }";

/// Reads a texel buffer of integers without a format at binding 0, and writes one of r32ui at binding 1.
inline const char* const texel_shader =
    "layout(local_size_x = 1) in; layout(set = 0, binding = 0) uniform usamplerBuffer a; layout(set = 0, binding = 1, "
    "r32ui) "
    "uniform uimageBuffer b; void main() { imageStore(b, 0, texelFetch(a, 0)); }";

/// One way to break a rule.
struct Breach {
    std::string code;  ///< "N-101"
    std::function<void(Bench&)> act;
    std::function<void(rhi::Capabilities&)> weaken{};  ///< What the device lacks.
    std::function<void(rhi::DeviceDesc&)> ask{};       ///< How the device is made.
};

// Every rule at least once, in parts.
std::vector<Breach> handle_breaches();
std::vector<Breach> resource_breaches();
std::vector<Breach> group_breaches();
std::vector<Breach> pipeline_breaches();
std::vector<Breach> pass_breaches();
std::vector<Breach> draw_breaches();
std::vector<Breach> copy_breaches();
std::vector<Breach> structure_breaches();
std::vector<Breach> other_breaches();

}  // namespace nacre::test
