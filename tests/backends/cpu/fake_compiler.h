// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "backends/cpu/compiler/compiler.h"

/// @file
/// A compiler that compiles nothing: the program of a shader is the one that was set for the shader's name. What it was
/// asked for is kept.

namespace nacre::cpu {

struct FakePrograms {
    static void set(const std::string& name, ComputeProgram program);
    static void set(const std::string& name, VertexProgram program);
    static void set(const std::string& name, FragmentProgram program);

    /// Of the last compilation.
    static std::vector<BindingSlots> last_slots;
    static CompilerOptions last_options;
};

}  // namespace nacre::cpu
