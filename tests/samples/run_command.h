// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

/// @file
/// Runs the command as a user does, in a process of its own.

namespace nacre {

struct CommandResult {
    int exit_code = -1;   ///< 128 + signal where a signal ended it.
    std::string output;   ///< Standard output.
    std::string errors;   ///< Standard error.
};

/// Runs `nacre` with the arguments; `environment` holds NAME=VALUE entries that replace those of this process.
CommandResult run_nacre(const std::vector<std::string>& arguments, const std::vector<std::string>& environment = {});

/// Runs any program.
CommandResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          const std::vector<std::string>& environment = {});

}  // namespace nacre
