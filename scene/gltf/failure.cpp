// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/failure.h"

#include <fmt/format.h>

namespace nacre::scene::gltf {

void reject(std::string reason, std::string remedy, ErrorCode code) {
    throw Rejected{code, std::move(reason), std::move(remedy)};
}

namespace {

/// Length of the valid UTF-8 sequence at the start of `text`, 0 where there is none.
std::size_t utf8_length(std::string_view text) {
    const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
    const auto continues = [&](std::size_t i) { return (byte(i) & 0xc0u) == 0x80u; };
    const unsigned first = byte(0);
    if (first < 0x80u) return 1;
    if (first >= 0xc2u && first <= 0xdfu && continues(1)) return 2;
    if ((first & 0xf0u) == 0xe0u && continues(1) && continues(2)) return 3;
    if (first >= 0xf0u && first <= 0xf4u && continues(1) && continues(2) && continues(3)) return 4;
    return 0;
}

}  // namespace

std::string printable(std::string_view text, std::size_t limit) {
    std::string result;
    while (!text.empty()) {
        if (result.size() >= limit) return result + "...";
        const std::size_t length = utf8_length(text);
        const bool is_control = length == 1 && (static_cast<unsigned char>(text[0]) < 0x20 || text[0] == 0x7f);
        if (length == 0 || is_control) {
            result += '?';
        } else {
            result += text.substr(0, length);
        }
        text.remove_prefix(length == 0 ? 1 : length);
    }
    return result;
}

std::string label(std::string_view kind, std::size_t index, std::string_view name) {
    return name.empty() ? fmt::format("{} {}", kind, index) : fmt::format("{} {} '{}'", kind, index, printable(name));
}

std::string with_commas(std::uint64_t value) {
    std::string digits = std::to_string(value);
    for (std::size_t position = digits.size(); position > 3; position -= 3) digits.insert(position - 3, 1, ',');
    return digits;
}

void Warnings::add(std::string text, std::uint64_t count) {
    if (count == 0) return;
    if (const auto found = index_of_.find(text); found != index_of_.end()) {
        texts_[found->second].second += count;
    } else if (texts_.size() < most_texts) {
        index_of_.emplace(text, texts_.size());
        texts_.emplace_back(std::move(text), count);
    } else {
        ++dropped_;
    }
}

std::vector<std::string> Warnings::sentences() const {
    std::vector<std::string> result;
    for (const auto& [text, count] : texts_) {
        result.push_back(count == 1 ? text + '.' : fmt::format("{} ({} times).", text, with_commas(count)));
    }
    if (dropped_ > 0) result.push_back(fmt::format("{} further warnings were left out.", with_commas(dropped_)));
    return result;
}

}  // namespace nacre::scene::gltf
