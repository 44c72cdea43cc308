// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "rhi/backend.h"

namespace nacre {

/// All backends that this build holds, in the order in which "auto" tries them: the one explicit list, used by the
/// command, the samples and the tests. Nothing is opened before devices are asked for.
///
///     rhi::Instance instance(nacre::all_backends());
std::vector<std::unique_ptr<rhi::Backend>> all_backends();

}  // namespace nacre
