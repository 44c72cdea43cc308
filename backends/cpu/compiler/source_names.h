// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "backends/cpu/compiler/module.h"

namespace nacre::cpu {

/// What a module's debug information says: names of ids, and the line of each instruction.
class SourceNames {
  public:
    explicit SourceNames(std::span<const std::uint32_t> words);
    /// Empty where it has none.
    [[nodiscard]] const std::string& name(Id id) const;
    [[nodiscard]] const std::string& member_name(Id structure, std::uint32_t member) const;
    /// "shaders/a.comp:41" of the instruction at a word; empty where nothing is known.
    [[nodiscard]] std::string line(std::uint32_t offset) const;

  private:
    struct Line {
        std::uint32_t offset = 0, file = 0, number = 0;
    };
    std::unordered_map<std::uint64_t, std::string> names_;
    std::unordered_map<Id, std::string> strings_;
    std::vector<Line> lines_;  ///< By offset; each holds until the next.
};

}  // namespace nacre::cpu
