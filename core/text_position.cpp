// SPDX-License-Identifier: Apache-2.0
#include "core/text_position.h"

#include <algorithm>

namespace nacre {

TextPosition text_position(std::string_view text, std::size_t offset) {
    const std::string_view before = text.substr(0, std::min(offset, text.size()));
    const std::size_t line_end = before.rfind('\n');
    return {.line = static_cast<std::size_t>(std::ranges::count(before, '\n')) + 1,
            .column = before.size() - (line_end == std::string_view::npos ? 0 : line_end + 1) + 1};
}

}  // namespace nacre
