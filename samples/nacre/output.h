// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "core/error.h"

namespace nacre::command {

/// Writes JSON where `--json` asked for it: a file, standard output for "-", nowhere for "".
Expected<void> write_json(const std::string& destination, std::string_view json);

/// Prints to standard output, unless JSON goes there.
void print_result(const std::string& json_destination, std::string_view text);

/// A file name out of a backend's text or a texture's name: letters, digits, '.', '_' and '-' stay.
std::string file_name_of(std::string_view text);

}  // namespace nacre::command
