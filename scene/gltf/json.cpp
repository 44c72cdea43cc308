// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/text_position.h"
#include "scene/gltf/failure.h"

namespace nacre::scene::gltf {
namespace {

using nlohmann::json;

std::string escaped_pointer_part(std::string_view key) {
    std::string result;
    for (const char c : printable(key)) {
        if (c == '~') {
            result += "~0";
        } else if (c == '/') {
            result += "~1";
        } else {
            result += c;
        }
    }
    return result;
}

/// Builds the value as the parser goes, so that nesting and duplicate keys are found before they cost anything.
class Builder final : public nlohmann::json_sax<json> {
  public:
    Builder(json& root, std::string_view text, std::uint32_t depth_limit)
        : root_(root), text_(text), depth_limit_(depth_limit) {}

    bool null() override { return put(nullptr); }
    bool boolean(bool value) override { return put(value); }
    bool number_integer(number_integer_t value) override { return put(value); }
    bool number_unsigned(number_unsigned_t value) override { return put(value); }
    bool number_float(number_float_t value, const string_t&) override { return put(value); }
    bool string(string_t& value) override { return put(std::move(value)); }
    bool binary(binary_t&) override { return false; }

    bool start_object(std::size_t) override { return open(json::object()); }
    bool end_object() override { return close(); }
    bool start_array(std::size_t) override { return open(json::array()); }
    bool end_array() override { return close(); }

    bool key(string_t& value) override {
        json& object = *stack_.back();
        if (object.contains(value)) {
            reject(fmt::format("{}: the key '{}' appears twice in one object", here(), printable(value)),
                   "Remove one of the two.");
        }
        keys_.back() = std::move(value);
        return true;
    }

    bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& exception) override {
        // The parser's own texts begin with "[json.exception.NAME.ID] parse error at line L, column C: ".
        std::string reason = exception.what();
        if (const auto end = reason.find("] "); end != std::string::npos) reason.erase(0, end + 2);
        if (reason.starts_with("parse error")) {
            if (const auto end = reason.find(": "); end != std::string::npos) reason.erase(0, end + 2);
        }
        const TextPosition at = text_position(text_, position == 0 ? 0 : position - 1);
        reject(fmt::format("the JSON text is wrong at line {}, column {}: {}", at.line, at.column,
                           printable(reason, 300)));
    }

  private:
    template <typename T>
    json* place(T&& value) {
        if (stack_.empty()) {
            root_ = std::forward<T>(value);
            return &root_;
        }
        json& parent = *stack_.back();
        if (parent.is_array()) {
            parent.push_back(std::forward<T>(value));
            return &parent.back();
        }
        json& member = parent[keys_.back()];
        member = std::forward<T>(value);
        return &member;
    }

    template <typename T>
    bool put(T&& value) {
        place(json(std::forward<T>(value)));
        return true;
    }

    bool open(json container) {
        if (stack_.size() >= depth_limit_) {
            reject(fmt::format("{}: JSON objects and arrays are nested more than {} deep", here(), depth_limit_),
                   "Flatten the file; no part of glTF needs such nesting.");
        }
        stack_.push_back(place(std::move(container)));
        keys_.emplace_back();
        return true;
    }

    bool close() {
        stack_.pop_back();
        keys_.pop_back();
        return true;
    }

    /// JSON pointer of the container that is open now.
    std::string here() const {
        std::string pointer;
        for (std::size_t i = 0; i + 1 < stack_.size(); ++i) {
            pointer += stack_[i]->is_array() ? fmt::format("/{}", stack_[i]->size() - 1)
                                             : "/" + escaped_pointer_part(keys_[i]);
        }
        return pointer.empty() ? "/" : pointer;
    }

    json& root_;
    std::string_view text_;
    std::uint32_t depth_limit_;
    std::vector<json*> stack_;
    std::vector<std::string> keys_;  ///< Per open container: the member being read (objects only).
};

std::string described(const json& value) {
    switch (value.type()) {
        case json::value_t::null: return "null";
        case json::value_t::boolean: return value.get<bool>() ? "true" : "false";
        case json::value_t::string:
            return fmt::format("the text \"{}\"", printable(value.get_ref<const std::string&>(), 40));
        case json::value_t::array: return fmt::format("an array of {}", value.size());
        case json::value_t::object: return "an object";
        default: return fmt::format("the number {}", value.dump());
    }
}

}  // namespace

JsonDocument::JsonDocument() : value_(std::make_unique<json>()) {}
JsonDocument::JsonDocument(JsonDocument&&) noexcept = default;
JsonDocument& JsonDocument::operator=(JsonDocument&&) noexcept = default;
JsonDocument::~JsonDocument() = default;
JsonView JsonDocument::root() const { return {value_.get(), ""}; }

JsonDocument parse_json(std::string_view text, std::uint32_t depth_limit) {
    if (text.starts_with("\xef\xbb\xbf")) {
        reject("the JSON text is wrong at line 1, column 1: it starts with a byte order mark, which glTF forbids",
               "Save the file as UTF-8 without a byte order mark.");
    }
    JsonDocument document;
    Builder builder(*document.value_, text, depth_limit);
    if (!json::sax_parse(text.begin(), text.end(), &builder, json::input_format_t::json, /*strict=*/true)) {
        reject("the JSON text cannot be read");
    }
    return document;
}

void JsonView::reject_as(std::string_view expectation) const {
    reject(fmt::format("{}: expected {}, found {}", pointer_.empty() ? "/" : pointer_, expectation, described(*value_)),
           "Correct the file or export it again.");
}

void JsonView::require_object() const {
    if (!value_->is_object()) reject_as("an object");
}

JsonView JsonView::child(std::string_view key, const json& value) const {
    return {&value, pointer_ + "/" + escaped_pointer_part(key)};
}

bool JsonView::has(std::string_view key) const {
    require_object();
    return value_->find(key) != value_->end();
}

std::optional<JsonView> JsonView::find(std::string_view key) const {
    require_object();
    const auto found = value_->find(key);
    if (found == value_->end()) return std::nullopt;
    return child(key, *found);
}

JsonView JsonView::at(std::string_view key) const {
    if (auto found = find(key)) return *std::move(found);
    reject(fmt::format("{}: the required member '{}' is missing", pointer_.empty() ? "/" : pointer_, key),
           "Correct the file or export it again.");
}

std::vector<std::string> JsonView::keys() const {
    require_object();
    std::vector<std::string> result;
    for (const auto& item : value_->items()) result.push_back(item.key());
    return result;
}

std::size_t JsonView::size() const {
    if (!value_->is_array()) reject_as("an array");
    return value_->size();
}

JsonView JsonView::operator[](std::size_t index) const {
    return {&(*value_)[index], fmt::format("{}/{}", pointer_, index)};
}

std::vector<JsonView> JsonView::elements() const {
    std::vector<JsonView> result;
    const std::size_t count = size();
    result.reserve(count);
    for (std::size_t index = 0; index < count; ++index) result.push_back((*this)[index]);
    return result;
}

std::string_view JsonView::as_text_view() const {
    if (!value_->is_string()) reject_as("a text");
    return value_->get_ref<const std::string&>();
}

std::string JsonView::as_text() const { return std::string(as_text_view()); }

bool JsonView::as_flag() const {
    if (!value_->is_boolean()) reject_as("true or false");
    return value_->get<bool>();
}

float JsonView::as_real() const {
    if (!value_->is_number()) reject_as("a number");
    const double number = value_->get<double>();
    if (!(std::abs(number) <= static_cast<double>(std::numeric_limits<float>::max()))) {
        reject_as("a number that a 32-bit float can hold");
    }
    return static_cast<float>(number);
}

std::uint64_t JsonView::as_whole() const {
    if (value_->is_number_unsigned()) return value_->get<std::uint64_t>();
    if (value_->is_number_float()) {
        const double number = value_->get<double>();
        if (number >= 0.0 && number <= 9007199254740992.0 && number == std::floor(number)) {
            return static_cast<std::uint64_t>(number);
        }
    }
    reject_as("a whole number that is not negative");
}

std::string JsonView::text(std::string_view key, std::string_view fallback) const {
    const auto member = find(key);
    return member ? member->as_text() : std::string(fallback);
}

bool JsonView::flag(std::string_view key, bool fallback) const {
    const auto member = find(key);
    return member ? member->as_flag() : fallback;
}

float JsonView::real(std::string_view key, float fallback) const {
    const auto member = find(key);
    return member ? member->as_real() : fallback;
}

std::uint64_t JsonView::whole(std::string_view key, std::uint64_t fallback) const {
    const auto member = find(key);
    return member ? member->as_whole() : fallback;
}

std::size_t JsonView::index(std::string_view key, std::size_t count, std::string_view kind) const {
    const JsonView member = at(key);
    const std::uint64_t index = member.as_whole();
    if (index >= count) {
        reject(fmt::format("{}: refers to {} {}, but the file has {}", member.pointer(), kind, index,
                           count == 0 ? std::string("none") : fmt::format("only {}", count)),
               "Correct the file or export it again.");
    }
    return index;
}

std::optional<std::size_t> JsonView::find_index(std::string_view key, std::size_t count, std::string_view kind) const {
    if (!has(key)) return std::nullopt;
    return index(key, count, kind);
}

namespace {

template <typename Vector>
Vector read_vector(const JsonView& object, std::string_view key, const Vector& fallback) {
    const auto member = object.find(key);
    if (!member) return fallback;
    constexpr auto length = static_cast<std::size_t>(Vector::length());
    if (!member->value().is_array() || member->size() != length) {
        member->reject_as(fmt::format("an array of {} numbers", length));
    }
    Vector result;
    for (std::size_t i = 0; i < length; ++i) result[static_cast<glm::length_t>(i)] = (*member)[i].as_real();
    return result;
}

}  // namespace

glm::vec2 JsonView::vector(std::string_view key, const glm::vec2& fallback) const {
    return read_vector(*this, key, fallback);
}
glm::vec3 JsonView::vector(std::string_view key, const glm::vec3& fallback) const {
    return read_vector(*this, key, fallback);
}
glm::vec4 JsonView::vector(std::string_view key, const glm::vec4& fallback) const {
    return read_vector(*this, key, fallback);
}

std::size_t JsonView::count(std::string_view key) const {
    const auto member = find(key);
    return member ? member->size() : 0;
}

std::vector<JsonView> JsonView::list(std::string_view key) const {
    const auto member = find(key);
    return member ? member->elements() : std::vector<JsonView>{};
}

std::vector<float> JsonView::reals(std::string_view key) const {
    std::vector<float> result;
    const auto member = find(key);
    const std::size_t count = member ? member->size() : 0;
    for (std::size_t index = 0; index < count; ++index) result.push_back((*member)[index].as_real());
    return result;
}

std::string JsonView::dump() const { return value_->dump(-1, ' ', false, json::error_handler_t::replace); }

}  // namespace nacre::scene::gltf
