// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "backends/cpu/shader_interface.h"

/// @file
/// Compiled shaders, with what the rest of the backend has to know about them. Code lives as long as the program's
/// `code`.

namespace nacre::cpu {

/// Memory of compiled code; freed with the last program that refers to it.
class CompiledCode {
  public:
    virtual ~CompiledCode() = default;
};

/// An instruction that goes through single precision although its device works in double precision.
struct NarrowedOperation {
    std::string line;       ///< "file:line" of the GLSL; empty where the module does not know.
    std::string operation;  ///< "bit cast", "packing", ...
};

struct ComputeProgram {
    ComputeFunction run = nullptr;
    std::array<std::uint32_t, 3> workgroup_size{1, 1, 1};
    std::uint64_t workgroup_bytes = 0;  ///< Of WorkgroupRange::memory.
    std::vector<NarrowedOperation> narrowed;
    std::string name;
    std::shared_ptr<CompiledCode> code;
};

/// One 32-bit word that the vertex shader hands on.
struct VertexOutput {
    std::uint32_t location = 0, component = 0;
    std::uint32_t slot = 0;  ///< In VertexBatch::outputs.
};
struct VertexProgram {
    VertexFunction run = nullptr;
    std::uint32_t output_slots = first_user_slot;  ///< Size of VertexBatch::outputs in slots.
    std::vector<VertexOutput> outputs;             ///< Sorted by location and component.
    bool writes_point_size = false;
    std::uint32_t clip_distances = 0, cull_distances = 0;
    bool has_side_effects = false;  ///< Stores to buffers or images: every vertex runs exactly once an index.
    bool in_double = false;                        ///< Also writes VertexBatch::doubles.
    std::vector<NarrowedOperation> narrowed;
    std::string name;
    std::shared_ptr<CompiledCode> code;
};

enum class Interpolation : std::uint8_t { perspective, linear, flat };

/// One 32-bit word that the fragment shader reads of its primitive, in the order of PrimitiveData::varyings.
struct FragmentInput {
    std::uint32_t location = 0, component = 0;
    Interpolation interpolation = Interpolation::perspective;
};
/// One color output.
struct FragmentOutput {
    std::uint32_t output = 0;      ///< Into FragmentBatch::colors.
    std::uint32_t components = 4;  ///< Those written are 0 to components - 1.
};
struct FragmentProgram {
    FragmentFunction run = nullptr;
    std::vector<FragmentInput> inputs;
    std::vector<FragmentOutput> outputs;
    bool early_tests =
        false;  ///< layout(early_fragment_tests): depth and stencil are tested, and written, before it runs.
    bool discards = false;
    bool writes_depth = false;
    bool writes_sample_mask = false;
    bool has_side_effects =
        false;  ///< Stores to buffers or images: runs after early tests only where `early_tests` says so.
    bool runs_per_sample = false;     ///< Reads gl_SampleID, gl_SamplePosition or an input declared `sample`.
    bool uses_centroid = false;
    bool in_double = false;  ///< Reads the primitive's DoublePrimitive and also writes FragmentBatch::doubles.
    std::vector<NarrowedOperation> narrowed;
    std::string name;
    std::shared_ptr<CompiledCode> code;
};

}  // namespace nacre::cpu
