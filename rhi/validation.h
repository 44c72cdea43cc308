// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace nacre::rhi {

enum class MessageSeverity : std::uint8_t { info, warning, error };
enum class MessageSource : std::uint8_t { validation, driver, verify };

/// One message of the validation layer, of verify mode or of a driver.
struct Message {
    MessageSeverity severity = MessageSeverity::error;
    MessageSource source = MessageSource::validation;
    std::string code;  ///< Stable: "N-524 bind-group-layout-mismatch"; a driver's own id for driver messages.
    std::string text;  ///< With the objects' names, what was expected, what was found, what to change.
};

/// An entry in the list of all validation messages.
struct ValidationRule {
    std::string_view code;     ///< "N-524 bind-group-layout-mismatch"
    std::string_view meaning;  ///< One sentence.
};

/// All messages that the validation layer can give, in the order of their numbers. Each has a test.
std::span<const ValidationRule> validation_rules();

}  // namespace nacre::rhi
