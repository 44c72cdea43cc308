// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

#include <gtest/gtest.h>

namespace nacre {
namespace {

Expected<int> parse_digit(char c) {
    if (c < '0' || c > '9') return fail(ErrorCode::parse, "read digit", "'x'", "it is not in 0..9", "Write a digit.");
    return c - '0';
}

Expected<int> parse_two(char a, char b) {
    NACRE_TRY(const int first, parse_digit(a));
    NACRE_TRY(const int second, parse_digit(b));
    return first * 10 + second;
}

Expected<void> check_digit(char c) {
    NACRE_CHECK(parse_digit(c));
    return {};
}

TEST(Error, MessageTellsAttemptSubjectReasonAndRemedyInOneLine) {
    EXPECT_EQ(parse_digit('x').error().message(), "read digit 'x': it is not in 0..9. Write a digit.");
    EXPECT_EQ((Error{ErrorCode::internal, "", "", "broken", ""}.message()), "broken.");
    EXPECT_EQ((Error{ErrorCode::internal, "compile", "", "log:\n", ""}.message()), "compile: log:\n");
}

TEST(Error, TryPassesTheFirstErrorOn) {
    EXPECT_EQ(parse_two('4', '2').value(), 42);
    EXPECT_EQ(parse_two('4', 'x').error().code, ErrorCode::parse);
    EXPECT_TRUE(check_digit('1'));
    EXPECT_FALSE(check_digit('x'));
}

TEST(Error, EveryCodeHasItsOwnName) {
    for (int a = 0; a <= static_cast<int>(ErrorCode::internal); ++a) {
        EXPECT_NE(name_of(static_cast<ErrorCode>(a)), "unknown");
        for (int b = 0; b < a; ++b) EXPECT_NE(name_of(static_cast<ErrorCode>(a)), name_of(static_cast<ErrorCode>(b)));
    }
}

}  // namespace
}  // namespace nacre
