// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace nacre::command {

/// Rows of text with columns as wide as their content; numbers are set flush right.
///
///     TextTable table({"backend", "ms"});
///     table.add({"vulkan", "12.3"});
///     fmt::print("{}", table.text());
class TextTable {
  public:
    explicit TextTable(std::vector<std::string> columns) : rows_{std::move(columns)} {}
    void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
    [[nodiscard]] std::string text() const;

  private:
    std::vector<std::vector<std::string>> rows_;
};

/// "1.5 MiB", "12 bytes".
std::string bytes_text(std::uint64_t bytes);

/// Share as percent with as many digits as it takes: "0", "0.0012 %", "12 %".
std::string share_text(double share);

/// A figure with 4 significant digits: "0.002131", "inf".
std::string figure_text(double value);

}  // namespace nacre::command
