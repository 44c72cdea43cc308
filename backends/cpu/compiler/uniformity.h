// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "backends/cpu/compiler/module.h"

/// @file
/// Which values are equal in all lanes, so that one scalar does for all of them; and where control flow takes lanes
/// apart.
///
/// A value is *uniform* if all lanes that execute its definition together get the same. That holds inside of a loop
/// from which lanes leave one by one too (all lanes that are left have gone round equally often); used behind such a
/// loop the value differs (`differs_outside`). Sources: "whole-function vectorization" (Karrenberg and Hack 2011) and
/// divergence analysis with sync dependence (Coutinho et al. 2011; Rosemann et al. 2021), in the form that structured
/// control flow allows.

namespace nacre::cpu {

class Uniformity {
  public:
    explicit Uniformity(const Module& module);

    /// The value, or for pointers the address, can differ between lanes.
    [[nodiscard]] bool is_divergent(Id id) const { return id < divergent_.size() && divergent_[id]; }
    /// The content of a Function, Private or Output variable can differ between lanes.
    [[nodiscard]] bool has_divergent_content(Id variable) const {
        return variable < content_.size() && content_[variable];
    }
    /// The branch or switch at the end of the block can send lanes different ways.
    [[nodiscard]] bool has_divergent_branch(const Function& function, std::uint32_t block) const;
    /// Lanes can leave the loop with this header in different iterations.
    [[nodiscard]] bool has_divergent_exit(Id loop_header) const {
        return loop_header < divergent_exit_.size() && divergent_exit_[loop_header];
    }
    /// The block can run while some lanes wait for it to end (they were sent another way and come back later).
    [[nodiscard]] bool is_partial(Id block) const { return block < partial_.size() && partial_[block]; }

  private:
    void analyze(const Function& function);
    void mark(std::vector<char>& flags, Id id) {
        if (id < flags.size() && !flags[id]) flags[id] = 1, changed_ = true;
    }
    void spread(const Function& function, std::uint32_t block);
    [[nodiscard]] bool is_divergent_builtin(spv::BuiltIn builtin) const;
    /// The variable behind a chain of accesses; 0 where it cannot be told.
    [[nodiscard]] Id root_of(Id pointer) const;
    void visit(const Instruction& instruction, Id block);

    const Module& module_;
    std::vector<char> divergent_, content_, divergent_exit_, partial_, divergent_join_;
    std::vector<char> divergent_return_;
    std::vector<Id> pointer_base_;  ///< Of access chains and copies.
    bool changed_ = false;
};

/// Index of the first block behind a loop or selection construct with this header, in structured order.
std::uint32_t end_of_construct(const Function& function, std::uint32_t header);

}  // namespace nacre::cpu
