// SPDX-License-Identifier: Apache-2.0
#include "core/text_position.h"

#include <gtest/gtest.h>

namespace nacre {
namespace {

TEST(TextPosition, CountsFromOne) {
    const std::string_view text = "ab\n\ncd";
    EXPECT_EQ(text_position(text, 0), (TextPosition{1, 1}));
    EXPECT_EQ(text_position(text, 2), (TextPosition{1, 3})) << "the line's end belongs to it";
    EXPECT_EQ(text_position(text, 3), (TextPosition{2, 1}));
    EXPECT_EQ(text_position(text, 4), (TextPosition{3, 1}));
    EXPECT_EQ(text_position(text, 5), (TextPosition{3, 2}));
    EXPECT_EQ(text_position(text, 100), (TextPosition{3, 3}));
    EXPECT_EQ(text_position("", 0), (TextPosition{1, 1}));
}

}  // namespace
}  // namespace nacre
