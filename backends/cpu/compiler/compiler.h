// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "backends/cpu/program.h"
#include "backends/cpu/trace.h"
#include "core/error.h"
#include "rhi/pipeline.h"
#include "rhi/reflection.h"

/// @file
/// SPIR-V to native code that runs many invocations at once.
///
///     NACRE_TRY(auto program, compiler.compile_compute({.spirv = words, .reflection = &reflection, ...}));
///     program.run(&context, &range);

namespace nacre::cpu {

/// How the arithmetic of a device behaves; see design.md, "Math".
enum class ExecutionMode : std::uint8_t {
    consistent,  ///< No contraction; results do not depend on lanes or threads.
    fast,        ///< Contraction to fused multiply-add.
    /// The reference: floats of 16 and 32 bits are doubles in registers, and by shadow memory in buffers, images and
    /// between the stages. No contraction.
    double_precision,
};

struct CompilerOptions {
    std::uint32_t lanes = 16;  ///< 4, 8 or 16.
    ExecutionMode mode = ExecutionMode::fast;
    bool use_disk_cache = true;
    std::uint32_t checks = 0;  ///< CheckFlags: faults that the code looks for while it runs.
    /// Shaders end as LLVM modules that were verified, which is a tenth of the work: programs have no code and cannot
    /// run.
    bool only_translates = false;
};

/// Where the descriptors of a binding lie in their group: `first` for element 0.
struct BindingSlots {
    std::uint32_t set = 0, binding = 0;
    std::uint32_t first = 0;
    std::uint32_t count = 1;  ///< 0: unbounded.
};

/// What is compiled. All references are read during the call only.
struct ShaderSource {
    std::span<const std::uint32_t> spirv;  ///< Valid (rhi::spirv::validate).
    std::string_view entry_point = "main";
    std::string_view name;                 ///< For messages.
    const rhi::ShaderReflection* reflection = nullptr;
    std::span<const rhi::SpecializationConstant> specialization;
    std::span<const BindingSlots> slots;
    /// Not null: the program tells what it computes, and this, which it refers to, is filled.
    TraceTable* trace = nullptr;
};

/// Vertex input, known when a pipeline is made.
struct VertexInput {
    std::span<const rhi::VertexAttribute> attributes;
    std::span<const rhi::VertexBufferLayout> buffers;
};

/// Compiles shaders; thread-safe. Errors: unsupported with the instruction or capability and the shader's name.
class Compiler {
  public:
    static Expected<std::unique_ptr<Compiler>> create(const CompilerOptions& options);
    virtual ~Compiler() = default;

    virtual Expected<ComputeProgram> compile_compute(const ShaderSource& source) = 0;
    virtual Expected<VertexProgram> compile_vertex(const ShaderSource& source, const VertexInput& input) = 0;
    virtual Expected<FragmentProgram> compile_fragment(const ShaderSource& source) = 0;
};

/// Widest lane count that this machine runs well: 16 (AVX-512, and AVX2 as two halves), 4 otherwise.
std::uint32_t native_lanes();

}  // namespace nacre::cpu
