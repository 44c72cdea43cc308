// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <llvm/IR/Module.h>

#include "backends/cpu/compiler/math/math.h"
#include "backends/cpu/program.h"
#include "core/error.h"

/// @file
/// LLVM modules to code in memory, by LLVM's ORC JIT. One CodeGenerator serves a device; its calls are thread-safe.

namespace nacre::cpu {

/// Symbols of one compiled module.
class LoadedCode : public CompiledCode {
  public:
    /// Address of a function; null where the module has none of that name.
    [[nodiscard]] virtual void* find(const char* symbol) = 0;
};

class CodeGenerator {
  public:
    /// @param lanes  for which the image functions are taken
    static Expected<std::unique_ptr<CodeGenerator>> create(std::uint32_t lanes, bool contract);
    virtual ~CodeGenerator() = default;

    /// Gives a new module the data layout and target of this machine.
    virtual void prepare(llvm::Module& module) = 0;
    /// What became of a module.
    struct Object {
        std::vector<std::byte> bytes;  ///< An object file for `load`.
        /// Of the frames of all its functions. Nothing calls itself, so it is the most.
        std::uint64_t stack_bytes = 0;
    };
    /// Optimizes and translates.
    virtual Expected<Object> compile(llvm::Module& module, const std::string& name, bool has_coroutines) = 0;
    /// Puts an object file that `compile` made, in this run or an earlier one on an equal machine, into memory.
    virtual Expected<std::shared_ptr<LoadedCode>> load(std::vector<std::byte> object, const std::string& name) = 0;
    /// Whatever the translation depends on besides the module: processor, features, versions.
    [[nodiscard]] virtual const std::string& fingerprint() const = 0;
    /// What the processor does by instructions, and what the generator was made for.
    [[nodiscard]] virtual const MathOptions& math_options() const = 0;
};

}  // namespace nacre::cpu
