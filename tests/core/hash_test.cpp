// SPDX-License-Identifier: Apache-2.0
#include "core/hash.h"

#include <gtest/gtest.h>

#include <string>
#include <unordered_set>

namespace nacre {
namespace {

TEST(Hash, SameContentSameHashAndEachBitCounts) {
    std::string text(1000, 'a');
    const Hash128 before = hash128(text);
    EXPECT_EQ(before, hash128(std::string(1000, 'a')));
    std::unordered_set<Hash128> seen{before};
    for (std::size_t i = 0; i < text.size(); i += 37) {
        std::string changed = text;
        changed[i] = static_cast<char>(changed[i] ^ 1);
        EXPECT_TRUE(seen.insert(hash128(changed)).second);
        EXPECT_NE(hash64(changed), hash64(text));
    }
}

TEST(Hash, TheHashIsThatOfTheXxh3Specification) {
    // Known answers: XXH3 of the empty input. Guards against a change of algorithm, which would orphan caches.
    EXPECT_EQ(hash64(std::string_view()), 0x2d06800538d394c2ULL);
    EXPECT_EQ(hash128(std::string_view()).to_string(), "99aa06d3014798d86001c324468d497f");
}

TEST(Hasher, PiecesOfTextAreKeptApart) {
    EXPECT_NE(Hasher().add("ab").add("c").finish(), Hasher().add("a").add("bc").finish());
    EXPECT_NE(Hasher().add(1).finish(), Hasher().add(std::int64_t{1}).finish());
    EXPECT_EQ(Hasher().add(std::string("ab")).finish(), Hasher().add("ab").finish());
}

TEST(Hasher, IncrementalBytesEqualTheWhole) {
    const std::string text(5000, 'x');
    const auto bytes = std::as_bytes(std::span(text));
    Hasher hasher;
    for (std::size_t i = 0; i < bytes.size(); i += 13)
        hasher.add_bytes(bytes.subspan(i, std::min<std::size_t>(13, bytes.size() - i)));
    EXPECT_EQ(hasher.finish(), hash128(bytes));
}

TEST(Hasher, ACopyGoesOnByItself) {
    Hasher first;
    first.add("common");
    Hasher second = first;
    EXPECT_EQ(first.finish(), second.finish());
    second.add("more");
    EXPECT_NE(first.finish(), second.finish());
    first.add("more");
    EXPECT_EQ(first.finish(), second.finish());
    first = second;
    EXPECT_EQ(first.finish(), second.finish());
}

}  // namespace
}  // namespace nacre
