// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "measure/comparison_page.h"
#include "measure/cross_backend.h"
#include "samples/nacre/session.h"

/// @file
/// Rendering one scene on several backends, and writing down what came out; shared by `compare` and `demo`.

namespace nacre::command {

/// Opens a session for each backend of the arguments and compares them; the first is the reference.
Attempt<measure::SceneComparison> run_comparison(const SceneSession& scene, const rhi::Instance& instance,
                                                 const std::vector<std::string>& backends,
                                                 const measure::ComparisonOptions& options);

/// Writes each backend's picture, the differences and index.html into `folder`.
Expected<void> write_comparison(const std::filesystem::path& folder, const SceneArguments& arguments,
                                const measure::SceneComparison& comparison,
                                const std::vector<std::string>& violations);

/// The tolerance in the file at `path`; the default for an empty path. A file that cannot be used is wrong usage.
Attempt<measure::Tolerance> read_tolerance(const std::string& path);

}  // namespace nacre::command
