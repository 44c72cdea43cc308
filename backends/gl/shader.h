// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "backends/gl/traits.h"
#include "rhi/backend.h"

/// @file
/// SPIR-V to GLSL 4.50 or ESSL 3.10/3.20 with SPIRV-Cross. OpenGL has neither bind groups nor push constants nor
/// separate samplers, so a translation comes with the tables that tell what to bind where.

namespace nacre::gl {

class GlShader : public rhi::BackendShader {};

/// Consecutive OpenGL binding points that take the elements of one RHI binding.
struct SlotRange {
    enum class Kind : std::uint8_t { uniform_buffer, storage_buffer, image } kind = Kind::uniform_buffer;
    std::uint32_t set = 0, binding = 0, count = 1;
    std::uint32_t first = 0;      ///< OpenGL binding point or image unit of element 0.
    bool readable = true, writable = true;
};

/// Consecutive texture units that take a texture (or its elements) with one sampler.
struct TextureRange {
    static constexpr std::uint32_t no_sampler = ~0u;
    std::uint32_t set = 0, binding = 0, count = 1;
    std::uint32_t sampler_set = 0, sampler_binding = no_sampler;  ///< no_sampler: only texelFetch and size queries.
    std::uint32_t first = 0;      ///< Texture unit of element 0.
    bool combined = false;        ///< The sampler lies in the same binding.
};

/// A scalar, vector, matrix or array of those in the push constants: a plain uniform in OpenGL, which frees it of all
/// layout rules (std140 cannot express every push-constant block).
struct PushConstantLeaf {
    enum class Scalar : std::uint8_t { floating, sint, uint } scalar = Scalar::floating;
    std::string name;             ///< Of the uniform: "push_v.lights[2].color".
    std::uint32_t offset = 0;     ///< Bytes.
    std::uint32_t components = 1; ///< Rows of a matrix.
    std::uint32_t columns = 1;
    std::uint32_t count = 1;      ///< Array length.
    std::uint32_t array_stride = 0, matrix_stride = 0;
    bool row_major = false;
};

/// Numbers given to bindings over all stages of one pipeline.
class SlotAllocator {
  public:
    std::uint32_t uniform_buffer(std::uint32_t set, std::uint32_t binding, std::uint32_t count);
    std::uint32_t storage_buffer(std::uint32_t set, std::uint32_t binding, std::uint32_t count);
    std::uint32_t image(std::uint32_t set, std::uint32_t binding, std::uint32_t count);
    std::uint32_t texture(std::uint32_t set, std::uint32_t binding, std::uint32_t sampler_set,
                          std::uint32_t sampler_binding, std::uint32_t count);

  private:
    using Key = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t>;
    struct Space {
        std::map<Key, std::uint32_t> taken;
        std::uint32_t next = 0;
        std::uint32_t take(Key key, std::uint32_t count);
    };
    Space uniform_buffers_, storage_buffers_, images_, textures_;
};

/// One stage in OpenGL's language.
struct Translation {
    std::string source;
    std::vector<SlotRange> slots;
    std::vector<TextureRange> textures;
    std::vector<PushConstantLeaf> push_constants;
    bool flat_inputs = false;     ///< A fragment shader that reads varyings without interpolation.
};

/// Translates `shader` for a pipeline with these specialization constants. Thread-safe.
/// Errors: unsupported (subgroup operations, ray queries, unbounded arrays, formats or types that this OpenGL lacks),
/// each naming the shader and what it is.
Expected<Translation> translate(const rhi::BackendShader& shader,
                                std::span<const rhi::SpecializationConstant> specialization, const Traits& traits,
                                SlotAllocator& slots);

/// Changes whenever `translate` gives other output for the same input; part of every cache key.
inline constexpr std::uint32_t translation_version = 3;

}  // namespace nacre::gl
