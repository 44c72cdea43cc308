// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

/// @file
/// Content hashes (XXH3): the same bytes give the same hash on every machine of the same byte order. Fast and well
/// mixed, not cryptographic.
///
///     Hasher hasher;
///     hasher.add("lighting.comp").add(std::uint32_t{3}).add_bytes(std::as_bytes(std::span(words)));
///     cache.store("spirv", hasher.finish(), bytes);

namespace nacre {

/// 128 bits: two different contents may be taken as having different hashes.
struct Hash128 {
    std::uint64_t high = 0;
    std::uint64_t low = 0;

    auto operator<=>(const Hash128&) const = default;

    /// 32 lower-case hexadecimal digits.
    [[nodiscard]] std::string to_string() const;
};

/// 64 bits, for hash tables and quick comparisons; keys of caches on disk use 128.
std::uint64_t hash64(std::span<const std::byte> bytes);
std::uint64_t hash64(std::string_view text);
Hash128 hash128(std::span<const std::byte> bytes);
Hash128 hash128(std::string_view text);

/// Hash of several values one after the other. Not thread-safe.
class Hasher {
  public:
    Hasher();
    Hasher(const Hasher& other);
    Hasher& operator=(const Hasher& other);
    Hasher(Hasher&&) noexcept;
    Hasher& operator=(Hasher&&) noexcept;
    ~Hasher();

    /// Bytes as they are, without their count.
    Hasher& add_bytes(std::span<const std::byte> bytes);

    /// A text with its length, so that ("ab", "c") and ("a", "bc") differ.
    Hasher& add(std::string_view text);
    Hasher& add(const char* text) { return add(std::string_view(text)); }
    Hasher& add(const std::string& text) { return add(std::string_view(text)); }

    /// A number, an enumerator or a bool, by its bytes: -0.0 and 0.0 differ.
    template <typename T>
    requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) Hasher& add(T value) {
        return add_bytes(std::as_bytes(std::span<const T, 1>(&value, 1)));
    }
    Hasher& add(const Hash128& hash) { return add(hash.high).add(hash.low); }

    /// The hash of all that was added so far; more can be added afterwards.
    [[nodiscard]] Hash128 finish() const;
    [[nodiscard]] std::uint64_t finish64() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace nacre

template <>
struct std::hash<nacre::Hash128> {
    std::size_t operator()(const nacre::Hash128& value) const noexcept {
        return static_cast<std::size_t>(value.low ^ (value.high * 0x9e3779b97f4a7c15ULL));
    }
};
