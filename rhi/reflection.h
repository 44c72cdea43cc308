// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/pipeline.h"

namespace nacre::rhi {

/// One resource that a shader declares.
struct ReflectedBinding {
    std::uint32_t set = 0;
    std::uint32_t binding = 0;
    BindingType type = BindingType::uniform_buffer;
    std::uint32_t count = 1;            ///< Array length; 0: unbounded.
    ViewDimension dimension = ViewDimension::automatic;  ///< For textures and images.
    bool multisampled = false;
    bool depth_comparison = false;      ///< sampler*Shadow.
    FormatKind sampled_kind = FormatKind::floating;      ///< floating, uint or sint.
    Format image_format = Format::undefined;             ///< Storage images with a format qualifier.
    std::uint64_t block_size = 0;       ///< Bytes of a buffer block without its unbounded tail.
    bool used = false;                  ///< False: declared, but no code that the entry point reaches names it.
    std::string name;                   ///< Of the variable, or of the block where the variable has none.
};

struct ReflectedVariable {
    std::uint32_t location = 0;
    std::uint32_t index = 0;            ///< 1 for the second source of dual-source blending.
    FormatKind kind = FormatKind::floating;              ///< floating, uint or sint.
    std::uint32_t components = 4;       ///< 1 to 4 (of one column).
    std::uint32_t first_component = 0;  ///< layout(component = ...).
    std::uint32_t locations = 1;        ///< Locations taken (matrices, arrays).
    std::string name;
};

struct ReflectedSpecialization {
    std::uint32_t id = 0;
    std::string name;
};

/// What one entry point declares. Variables that GLSL declares and never uses are part of it, so that layouts do not
/// depend on what an optimizer leaves over; in a module of several entry points, each has those that it uses.
struct ShaderReflection {
    ShaderStage stage = ShaderStage::none;
    std::vector<ReflectedBinding> bindings;      ///< Sorted by set, then binding.
    std::vector<ReflectedVariable> inputs;       ///< User inputs; vertex attributes in a vertex shader.
    std::vector<ReflectedVariable> outputs;      ///< User outputs; color targets in a fragment shader.
    std::vector<ReflectedSpecialization> specialization;
    std::uint32_t push_constant_bytes = 0;
    std::array<std::uint32_t, 3> workgroup_size{};
    std::array<std::uint32_t, 3> workgroup_size_ids{~0u, ~0u, ~0u};  ///< constant_id of each, where specialized.
    bool early_fragment_tests = false;
    bool writes_depth = false;
    bool discards = false;
    bool uses_subgroups = false;
    bool uses_ray_query = false;
    std::vector<std::string> capabilities;       ///< SPIR-V capabilities by name ("Shader", "Int64", ...).
};

/// Validates SPIR-V (Vulkan 1.1 rules and later) and reflects one entry point. Any input is safe, from any thread.
///
///     NACRE_TRY(ShaderReflection reflection, reflect(words, ShaderStage::compute, "main", "cull.comp"));
///
/// Errors: shader_compile with the word offset and the validator's text, also where the module has no such entry point
/// or has it for another stage; unsupported for capabilities and kinds of resources that no backend takes.
Expected<ShaderReflection> reflect(std::span<const std::uint32_t> spirv, ShaderStage stage,
                                   const std::string& entry_point = "main", const std::string& name = {});

}  // namespace nacre::rhi
