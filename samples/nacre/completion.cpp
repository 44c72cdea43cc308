// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <span>

#include "core/embedded_file.h"
#include "samples/nacre/commands.h"

namespace nacre::command {

// Holds samples/completion/nacre.bash.
std::span<const EmbeddedFile> embedded_files();

Outcome run(const CompletionArguments& arguments) {
    if (arguments.list) {
        for (const std::string& candidate : completion_candidates(arguments.words)) fmt::print("{}\n", candidate);
    } else {
        for (const EmbeddedFile& file : embedded_files()) fmt::print("{}", file.text);
    }
    return ExitCode::success;
}

}  // namespace nacre::command
