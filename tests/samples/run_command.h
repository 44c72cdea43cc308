// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/core/temporary_folder.h"

/// @file
/// Runs the command as a user does, in a process of its own.

namespace nacre {

struct CommandResult {
    int exit_code = -1;   ///< 128 + signal where a signal ended it.
    std::string output;   ///< Standard output.
    std::string errors;   ///< Standard error.
};

/// A program that runs beside the test, which looks at what it has written so far. Ended when the test is done with it.
class RunningProgram {
  public:
    /// As `run_program`.
    RunningProgram(const std::string& program, const std::vector<std::string>& arguments,
                   const std::vector<std::string>& environment = {});
    ~RunningProgram();
    RunningProgram(const RunningProgram&) = delete;
    RunningProgram& operator=(const RunningProgram&) = delete;

    [[nodiscard]] std::string output() const;
    [[nodiscard]] std::string errors() const;
    /// What Ctrl-C sends.
    void interrupt() const;
    /// Waits for its end.
    CommandResult wait();

  private:
    // Output goes through files: no pipe can fill up and stop the program.
    TemporaryFolder folder_;
    pid_t child_ = -1;
};

/// Runs `nacre` with the arguments; `environment` holds NAME=VALUE entries that replace those of this process.
CommandResult run_nacre(const std::vector<std::string>& arguments, const std::vector<std::string>& environment = {});

/// Runs any program.
CommandResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          const std::vector<std::string>& environment = {});

}  // namespace nacre
