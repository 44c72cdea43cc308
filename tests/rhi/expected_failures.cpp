// SPDX-License-Identifier: Apache-2.0
#include "tests/rhi/expected_failures.h"

namespace nacre::test {

std::span<const ExpectedFailure> expected_failures() { return {}; }

}  // namespace nacre::test
