// SPDX-License-Identifier: Apache-2.0
#include "core/hash.h"

#include <fmt/format.h>
#define XXH_STATIC_LINKING_ONLY  // The layout of XXH3_state_t, so that it can be a member.
#include <xxhash.h>

namespace nacre {

struct Hasher::State {
    XXH3_state_t xxh3;
};

std::string Hash128::to_string() const { return fmt::format("{:016x}{:016x}", high, low); }

std::uint64_t hash64(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

std::uint64_t hash64(std::string_view text) { return XXH3_64bits(text.data(), text.size()); }

Hash128 hash128(std::span<const std::byte> bytes) {
    const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
    return {hash.high64, hash.low64};
}

Hash128 hash128(std::string_view text) { return hash128(std::as_bytes(std::span(text))); }

Hasher::Hasher() : state_(std::make_unique<State>()) {
    XXH3_INITSTATE(&state_->xxh3);
    XXH3_128bits_reset(&state_->xxh3);
}

Hasher::Hasher(const Hasher& other) : Hasher() { XXH3_copyState(&state_->xxh3, &other.state_->xxh3); }

Hasher& Hasher::operator=(const Hasher& other) {
    if (this != &other) *this = Hasher(other);
    return *this;
}

Hasher::Hasher(Hasher&&) noexcept = default;
Hasher& Hasher::operator=(Hasher&&) noexcept = default;
Hasher::~Hasher() = default;

Hasher& Hasher::add_bytes(std::span<const std::byte> bytes) {
    XXH3_128bits_update(&state_->xxh3, bytes.data(), bytes.size());
    return *this;
}

Hasher& Hasher::add(std::string_view text) {
    add(static_cast<std::uint64_t>(text.size()));
    return add_bytes(std::as_bytes(std::span(text)));
}

Hash128 Hasher::finish() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(&state_->xxh3);
    return {hash.high64, hash.low64};
}

std::uint64_t Hasher::finish64() const { return finish().low; }

}  // namespace nacre
