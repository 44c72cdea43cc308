// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

/// @file
/// How the importer fails inside: a rejected file is an exception, so that reading code stays free of checks of checks.
/// `load_gltf` catches it and returns its `Error`; it never leaves scene/gltf/. Internal to scene/gltf/.

namespace nacre::scene::gltf {

/// Thrown by `reject`. `reason` does not yet say where; `Location` knows.
struct Rejected {
    ErrorCode code = ErrorCode::parse;
    std::string reason;
    std::string remedy;
};

/// Gives up on the file. `reason` starts with the element: "accessor 17: byteOffset + length is ...".
[[noreturn]] void reject(std::string reason, std::string remedy = "Export the file again.",
                         ErrorCode code = ErrorCode::parse);

/// Text of a file made safe to print: control characters and invalid UTF-8 become '?', long text is cut.
std::string printable(std::string_view text, std::size_t limit = 80);

/// "mesh 3 'wheel'", or "mesh 3" where there is no name.
std::string label(std::string_view kind, std::size_t index, std::string_view name = {});

/// 1234567 -> "1,234,567".
std::string with_commas(std::uint64_t value);

/// What is wrong but survivable. Equal texts are counted, and a flood of different ones is cut.
class Warnings {
  public:
    /// `text` is a sentence without its period; it starts with the element.
    void add(std::string text, std::uint64_t count = 1);

    /// One sentence each, in the order of their first appearance; counts above 1 are appended.
    [[nodiscard]] std::vector<std::string> sentences() const;

  private:
    static constexpr std::size_t most_texts = 100;
    std::vector<std::pair<std::string, std::uint64_t>> texts_;
    std::map<std::string, std::size_t> index_of_;
    std::uint64_t dropped_ = 0;
};

}  // namespace nacre::scene::gltf
