// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace nacre {

/// A text file compiled into the program. Lives as long as the program.
struct EmbeddedFile {
    std::string_view path;  ///< Path below the source root, e.g. "passes/lighting/lighting.comp".
    std::string_view text;  ///< The whole content, UTF-8.
};

}  // namespace nacre
