// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "backends/cpu/compiler/math/math.h"

namespace nacre::cpu {

enum class Kind { half, single, number64, int8, int16, int32, int64 };

/// How a function is compiled for a test.
struct Variant {
    unsigned lanes = 16;  ///< 1: scalars, not vectors.
    /// Empty: the processor at hand. "x86-64" has SSE2 and nothing more.
    std::string processor;
    MathOptions options;
    /// Runs LLVM's standard optimizations (O2) before code generation.
    bool optimized = false;

    std::string name() const;
};

/// The variants whose accuracy is measured: with and without contraction, and with the instructions that the processor
/// at hand has.
std::vector<Variant> measured_variants();

/// The variants whose results have to agree in every bit: lane counts, targets, with and without optimization.
std::vector<Variant> exact_variants();

/// Emits a function of the given arguments, each a scalar or a vector.
using Emit = std::function<std::vector<llvm::Value*>(Math&, std::span<llvm::Value* const>)>;

/// A loop over arrays around what Math emits, compiled into memory. Compilation errors end the test program with a
/// message.
class CompiledFunction {
  public:
    CompiledFunction(const Variant& variant, std::vector<Kind> inputs, const Emit& emit);
    ~CompiledFunction();
    CompiledFunction(CompiledFunction&&) noexcept;

    /// `count` is a multiple of 16. Arrays are those of the kinds given; outputs are those that `emit` returned.
    void run(std::span<const void* const> inputs, std::span<void* const> outputs, std::size_t count) const;

  private:
    struct Program;
    std::unique_ptr<Program> program_;
};

/// Machine code of the function as assembly, without a loop around it, arguments in registers.
std::string assembly(const Variant& variant, const std::vector<Kind>& inputs, const Emit& emit);

}  // namespace nacre::cpu
