// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace nacre::rhi {

enum class MessageSeverity : std::uint8_t { info, warning, error };
enum class MessageSource : std::uint8_t { validation, driver, verify, shader };

/// One message of the validation layer, of verify mode, of a driver, or about what a shader did while it ran.
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

/// What is found while shaders run, on backends that look for it (see `BackendSpec::checks`); numbers are never used
/// again for something else.
enum class ShaderFault : std::uint16_t {
    not_a_number = 801, infinity, division_by_zero, index_range, uninitialized_read, data_race, nonuniform_derivative,
    host_access = 820, unstated_access,
};

/// "N-804 index-range"
std::string_view code_of(ShaderFault fault);

/// All of them, in the order of their numbers.
std::span<const ValidationRule> shader_faults();

}  // namespace nacre::rhi
