// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

/// @file
/// Functions to which Vulkan gives a tolerance, with the range of arguments in which they are tried.

namespace nacre::differential {

struct ApproximateFunction {
    const char* glsl;            ///< '$' stands for the argument.
    double low, high;            ///< Of the argument.
    double (*exact)(double);
    /// Largest error that Vulkan allows for an argument and its exact result.
    double (*tolerance)(double argument, double result);
};

/// All of them; the number is that of the pair in the buffer of pairs.
std::span<const ApproximateFunction> approximate_functions();

}  // namespace nacre::differential
