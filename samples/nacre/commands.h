// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "samples/nacre/command_line.h"
#include "samples/nacre/outcome.h"

/// @file
/// The subcommands, one .cpp each.

namespace nacre::command {

Outcome run(const DevicesArguments& arguments);
Outcome run(const RenderArguments& arguments);
Outcome run(const CompareArguments& arguments);
Outcome run(const DiffArguments& arguments);
Outcome run(const ExplainArguments& arguments);
Outcome run(const MaterialArguments& arguments);
Outcome run(const StabilityArguments& arguments);
Outcome run(const DemoArguments& arguments);
Outcome run(const CacheArguments& arguments);
Outcome run(const CompletionArguments& arguments);

}  // namespace nacre::command
