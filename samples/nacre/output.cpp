// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/output.h"

#include <cctype>
#include <cstdio>

#include "core/file.h"

namespace nacre::command {

Expected<void> write_json(const std::string& destination, std::string_view json) {
    if (destination.empty()) return {};
    if (destination == "-") {
        std::fwrite(json.data(), 1, json.size(), stdout);
        std::fflush(stdout);
        return {};
    }
    return write_file_atomically(destination, json);
}

void print_result(const std::string& json_destination, std::string_view text) {
    if (json_destination == "-") return;
    std::fwrite(text.data(), 1, text.size(), stdout);
    std::fflush(stdout);
}

std::string file_name_of(std::string_view text) {
    std::string name(text);
    for (char& c : name) {
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_' && c != '-') c = '-';
    }
    return name;
}

}  // namespace nacre::command
