// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

namespace nacre {

std::string_view name_of(ErrorCode code) {
    switch (code) {
        case ErrorCode::invalid_argument: return "invalid_argument";
        case ErrorCode::not_found: return "not_found";
        case ErrorCode::unsupported: return "unsupported";
        case ErrorCode::out_of_memory: return "out_of_memory";
        case ErrorCode::device_lost: return "device_lost";
        case ErrorCode::input_output: return "input_output";
        case ErrorCode::parse: return "parse";
        case ErrorCode::shader_compile: return "shader_compile";
        case ErrorCode::validation: return "validation";
        case ErrorCode::timeout: return "timeout";
        case ErrorCode::internal: return "internal";
    }
    return "unknown";
}

std::string Error::message() const {
    std::string text = attempted;
    if (!subject.empty()) text += (text.empty() ? "" : " ") + subject;
    text += (text.empty() ? "" : ": ") + reason;
    if (!text.empty() && text.back() != '.' && text.back() != '\n') text += '.';
    if (!remedy.empty()) text += ' ' + remedy;
    return text;
}

}  // namespace nacre
