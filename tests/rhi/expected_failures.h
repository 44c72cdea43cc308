// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace nacre::test {

/// A test that is known to fail on a backend. A listed test that passes fails the run, so the table stays true.
struct ExpectedFailure {
    std::string_view test;     ///< "Suite.Name" without the variant.
    std::string_view variant;  ///< As in `Variant::name`.
    std::string_view reason;   ///< What is wrong, and where.
};

/// The one table; empty where everything works.
std::span<const ExpectedFailure> expected_failures();

}  // namespace nacre::test
