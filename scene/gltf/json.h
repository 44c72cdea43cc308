// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// @file
/// Strict JSON, and a view of it that knows where it is. Internal to scene/gltf/; everything here may throw `Rejected`.
///
///     JsonDocument document = parse_json(text, {.depth = 64});
///     for (JsonView accessor : document.root().list("accessors"))
///         count = accessor.whole("count");        // "/accessors/17/count: expected a whole number, found ..."

namespace nacre::scene::gltf {

/// A JSON value and its place, as a JSON pointer (RFC 6901). Valid while its document lives.
class JsonView {
  public:
    JsonView(const nlohmann::json* value, std::string pointer) : value_(value), pointer_(std::move(pointer)) {}

    [[nodiscard]] const std::string& pointer() const { return pointer_; }
    [[nodiscard]] const nlohmann::json& value() const { return *value_; }

    /// Members of an object; this must be one (else rejected).
    [[nodiscard]] bool has(std::string_view key) const;
    [[nodiscard]] std::optional<JsonView> find(std::string_view key) const;
    [[nodiscard]] JsonView at(std::string_view key) const;  ///< Rejected where absent.
    [[nodiscard]] std::vector<std::string> keys() const;

    /// Elements of an array; this must be one.
    [[nodiscard]] std::size_t size() const;
    [[nodiscard]] JsonView operator[](std::size_t index) const;
    [[nodiscard]] std::vector<JsonView> elements() const;

    /// This value itself, of the stated type.
    [[nodiscard]] std::string as_text() const;
    [[nodiscard]] std::string_view as_text_view() const;  ///< Valid while the document lives.
    [[nodiscard]] bool as_flag() const;
    [[nodiscard]] float as_real() const;           ///< Finite as a 32-bit float.
    [[nodiscard]] std::uint64_t as_whole() const;  ///< >= 0; "3.0" counts as whole.
    void require_object() const;

    /// Members with a type. Without a fallback, absence is rejected.
    [[nodiscard]] std::string text(std::string_view key) const { return at(key).as_text(); }
    [[nodiscard]] std::string text(std::string_view key, std::string_view fallback) const;
    [[nodiscard]] bool flag(std::string_view key, bool fallback) const;
    [[nodiscard]] float real(std::string_view key) const { return at(key).as_real(); }
    [[nodiscard]] float real(std::string_view key, float fallback) const;
    [[nodiscard]] std::uint64_t whole(std::string_view key) const { return at(key).as_whole(); }
    [[nodiscard]] std::uint64_t whole(std::string_view key, std::uint64_t fallback) const;
    /// An index below `count`; `kind` names what is indexed.
    [[nodiscard]] std::size_t index(std::string_view key, std::size_t count, std::string_view kind) const;
    [[nodiscard]] std::optional<std::size_t> find_index(std::string_view key, std::size_t count,
                                                        std::string_view kind) const;
    [[nodiscard]] glm::vec2 vector(std::string_view key, const glm::vec2& fallback) const;
    [[nodiscard]] glm::vec3 vector(std::string_view key, const glm::vec3& fallback) const;
    [[nodiscard]] glm::vec4 vector(std::string_view key, const glm::vec4& fallback) const;
    /// Number of elements of an array member; 0 where absent.
    [[nodiscard]] std::size_t count(std::string_view key) const;
    /// Elements of an array member; empty where absent.
    [[nodiscard]] std::vector<JsonView> list(std::string_view key) const;
    [[nodiscard]] std::vector<float> reals(std::string_view key) const;

    /// Compact text of the value.
    [[nodiscard]] std::string dump() const;

    /// Gives up: "<pointer>: expected <expectation>, found <this value>".
    [[noreturn]] void reject_as(std::string_view expectation) const;

  private:
    [[nodiscard]] JsonView child(std::string_view key, const nlohmann::json& value) const;
    const nlohmann::json* value_;
    std::string pointer_;
};

/// Owns parsed JSON.
class JsonDocument {
  public:
    JsonDocument();
    JsonDocument(JsonDocument&&) noexcept;
    JsonDocument& operator=(JsonDocument&&) noexcept;
    ~JsonDocument();
    [[nodiscard]] JsonView root() const;

  private:
    friend JsonDocument parse_json(std::string_view text, std::uint32_t depth_limit);
    std::unique_ptr<nlohmann::json> value_;
};

/// Parses a whole text. Rejected, with line and column or JSON pointer: syntax errors, a byte order mark, invalid
/// UTF-8, numbers beyond double, duplicate keys, nesting beyond `depth_limit`, anything after the value.
JsonDocument parse_json(std::string_view text, std::uint32_t depth_limit);

}  // namespace nacre::scene::gltf
