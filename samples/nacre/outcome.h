// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <expected>
#include <utility>

#include "core/error.h"

namespace nacre::command {

/// What the process returns; part of the public interface (docs/command-line.md).
enum class ExitCode : int {
    success = 0,         ///< Done; for comparisons: within the tolerance.
    failure = 1,         ///< Something could not be done: a file, a device, a driver.
    usage = 2,           ///< The command line is wrong.
    over_tolerance = 3,  ///< A comparison or measurement ran, and is beyond what is allowed.
};

/// Why a subcommand stopped. Made from any `Error`, which then counts as a failure.
struct Failure {
    Error error;
    ExitCode code = ExitCode::failure;
    Failure(Error e, ExitCode c = ExitCode::failure) : error(std::move(e)), code(c) {}
};

using Outcome = std::expected<ExitCode, Failure>;

/// A wrong option or argument.
inline std::unexpected<Failure> wrong_usage(Error error) {
    return std::unexpected(Failure(std::move(error), ExitCode::usage));
}

}  // namespace nacre::command
