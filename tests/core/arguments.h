// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>

namespace nacre::test {

/// VALUE of the argument "--NAME=VALUE"; nothing where it is another argument.
inline std::optional<std::string> value_of(std::string_view argument, std::string_view name) {
    if (!argument.starts_with("--")) return {};
    argument.remove_prefix(2);
    if (!argument.starts_with(name)) return {};
    argument.remove_prefix(name.size());
    if (!argument.starts_with('=')) return {};
    return std::string(argument.substr(1));
}

/// The same as a number; whether there was one.
inline bool read_number(std::string_view argument, std::string_view name, std::uint64_t& number) {
    const auto value = value_of(argument, name);
    if (value) number = std::strtoull(value->c_str(), nullptr, 10);
    return value.has_value();
}

}  // namespace nacre::test
