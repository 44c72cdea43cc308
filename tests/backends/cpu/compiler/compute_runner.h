// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"

namespace nacre::cpu {

/// Runs a compute shader on a device made for it: 64 invocations in one workgroup. Binding 0 of set 0 is a buffer for
/// results, of `result_words` words that are 12345 before; binding 1, if the shader has it, one with 0, 1, 2, ... 255.
struct ComputeRunner {
    std::string spec;  ///< Of the backend.
    std::uint32_t result_words = 64;

    [[nodiscard]] Expected<std::vector<std::uint32_t>> run(std::vector<std::uint32_t> spirv) const;
    [[nodiscard]] Expected<std::vector<std::uint32_t>> run_glsl(const std::string& text) const;
    /// @param version  of SPIR-V: 0x10300
    [[nodiscard]] Expected<std::vector<std::uint32_t>> run_assembly(const std::string& text,
                                                                    std::uint32_t version) const;
};

/// "Lanes4" of "cpu:consistent:lanes=4", "Double" of "cpu:double": names of tests.
inline std::string name_of_lanes(const std::string& spec) {
    return spec == "cpu:double" ? "Double" : "Lanes" + spec.substr(spec.find('=') + 1);
}

}  // namespace nacre::cpu
