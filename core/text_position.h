// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string_view>

/// @file
/// Where in a text something stands, as people count.

namespace nacre {

/// Line and column, both from 1; columns count bytes.
struct TextPosition {
    std::size_t line = 1;
    std::size_t column = 1;

    bool operator==(const TextPosition&) const = default;
};

/// Of the byte `offset` of `text`; the end of the text for offsets beyond it. Lines end with "\n".
[[nodiscard]] TextPosition text_position(std::string_view text, std::size_t offset);

}  // namespace nacre
