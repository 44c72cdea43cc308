// SPDX-License-Identifier: Apache-2.0
// Runs the tests of all backends, makes sure that each backend present ran some, and keeps docs/support.md true.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "tests/rhi/backend_test.h"
#include "tests/rhi/expected_failures.h"

namespace nacre::test {
namespace {

enum class Outcome { passed, failed, expected_failure, skipped };

/// Outcome of each test on each variant, in the order in which tests are registered.
class Results : public ::testing::EmptyTestEventListener {
  public:
    void OnTestEnd(const ::testing::TestInfo& info) override {
        std::string suite = info.test_suite_name();
        const std::string full = info.name();
        const std::size_t slash = full.find('/');
        if (slash == std::string::npos || suite.find('/') == std::string::npos) return;
        suite = suite.substr(suite.find('/') + 1);
        const std::string test = full.substr(0, slash);
        const std::string variant = full.substr(slash + 1);
        Outcome outcome = Outcome::passed;
        if (info.result()->Failed())
            outcome = Outcome::failed;
        else if (info.result()->Skipped())
            outcome = Outcome::skipped;
        else
            for (const ExpectedFailure& failure : expected_failures())
                if (failure.test == suite + "." + test && failure.variant == variant)
                    outcome = Outcome::expected_failure;
        if (outcomes_.find({suite, test}) == outcomes_.end()) order_.push_back({suite, test});
        outcomes_[{suite, test}][variant] = outcome;
        if (outcome != Outcome::skipped) ++executed_[variant];
    }

    [[nodiscard]] int executed(const std::string& variant) const {
        const auto at = executed_.find(variant);
        return at == executed_.end() ? 0 : at->second;
    }

    /// Text of docs/support.md; columns of variants that are not here are taken from `old`.
    [[nodiscard]] std::string support(const std::string& old) const {
        std::map<std::string, std::map<std::string, std::string>> before;  // row -> column -> cell
        std::vector<std::string> columns;
        std::istringstream lines(old);
        for (std::string line; std::getline(lines, line);) {
            if (!line.starts_with("|")) continue;
            std::vector<std::string> cells;
            std::istringstream parts(line.substr(1));
            for (std::string cell; std::getline(parts, cell, '|');) {
                const std::size_t from = cell.find_first_not_of(' ');
                const std::size_t to = cell.find_last_not_of(' ');
                cells.push_back(from == std::string::npos ? "" : cell.substr(from, to - from + 1));
            }
            if (cells.empty()) continue;
            if (cells[0].starts_with("---")) continue;
            if (columns.empty())
                columns.assign(cells.begin() + 1, cells.end());
            else
                for (std::size_t i = 1; i < cells.size() && i <= columns.size(); ++i)
                    before[cells[0]][columns[i - 1]] = cells[i];
        }
        std::ostringstream text;
        text << "# What works where\n\n"
                "Generated from the tests of the render-hardware interface (`rhi_backend_test --update-support`): a "
                "row is a\n"
                "test, a column a device that it ran on. \"yes\": the test passed. \"-\": the device lacks the "
                "feature, and says\n"
                "so in its capabilities. \"no\": a known failure, with its reason in "
                "`tests/rhi/expected_failures.cpp`.\n\n";
        text << "| method or feature |";
        for (const Variant& variant : all_variants()) text << " " << variant.title << " |";
        text << "\n|---|";
        for (std::size_t i = 0; i < all_variants().size(); ++i) text << "---|";
        text << "\n";
        // Suites by name: in which order they are registered differs between builds.
        std::vector<std::pair<std::string, std::string>> rows = order_;
        std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
        for (const auto& key : rows) {
            const std::string row = key.first + ": " + words(key.second);
            text << "| " << row << " |";
            for (const Variant& variant : all_variants()) {
                const auto& found = outcomes_.at(key);
                const auto at = found.find(variant.name);
                std::string cell = "?";
                if (at == found.end()) {
                    if (const auto kept = before.find(row);
                        kept != before.end() && kept->second.contains(variant.title))
                        cell = kept->second.at(variant.title);
                } else {
                    cell = at->second == Outcome::passed    ? "yes"
                           : at->second == Outcome::skipped ? "-"
                           : at->second == Outcome::failed  ? "failed"
                                                            : "no";
                }
                text << " " << cell << " |";
            }
            text << "\n";
        }
        return text.str();
    }

  private:
    /// "WriteAndRead" as "write and read".
    static std::string words(const std::string& name) {
        std::string text;
        for (std::size_t i = 0; i < name.size(); ++i) {
            const bool upper = name[i] >= 'A' && name[i] <= 'Z';
            if (upper && i > 0) text += ' ';
            text += upper ? static_cast<char>(name[i] - 'A' + 'a') : name[i];
        }
        return text;
    }

    std::vector<std::pair<std::string, std::string>> order_;
    std::map<std::pair<std::string, std::string>, std::map<std::string, Outcome>> outcomes_;
    std::map<std::string, int> executed_;
};

std::string read_text(const std::string& path) {
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

int run(int argc, char** argv) {
    // llvmpipe's default filter is not conformant; this has to be known before it is loaded.
    setenv("GALLIVM_PERF", "no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx", 1);
    ::testing::InitGoogleTest(&argc, argv);
    bool update = false;
    for (int i = 1; i < argc; ++i) update |= std::string(argv[i]) == "--update-support";
    auto* results = new Results;
    ::testing::UnitTest::GetInstance()->listeners().Append(results);
    int status = RUN_ALL_TESTS();

    const bool whole = ::testing::GTEST_FLAG(filter) == "*" && ::testing::GTEST_FLAG(repeat) == 1 &&
                       !::testing::GTEST_FLAG(list_tests);
    if (!whole) return status;
    if (available_variants().empty()) {
        std::cerr << "no backend is here: nothing was tested\n";
        return 1;
    }
    for (const Variant& variant : available_variants())
        if (results->executed(variant.name) == 0) {
            std::cerr << "backend " << variant.name << " is here and ran no test\n";
            status = 1;
        }
    const std::string path = std::string(NACRE_SOURCE_DIR) + "/docs/support.md";
    const std::string old = read_text(path);
    const std::string now = results->support(old);
    if (update) {
        std::ofstream(path) << now;
        std::cout << "wrote " << path << "\n";
    } else if (status == 0 && old != now) {
        // The table tells of the software drivers, which are the same everywhere; a graphics card may do more or less.
        const auto adapters = instance().adapters();
        const bool is_reference = std::all_of(adapters.begin(), adapters.end(),
                                              [](const rhi::AdapterInfo& adapter) { return adapter.is_software; });
        std::cerr << "docs/support.md is not what the tests found; run rhi_backend_test --update-support\n";
        if (is_reference) status = 1;
    }
    return status;
}

}  // namespace
}  // namespace nacre::test

int main(int argc, char** argv) { return nacre::test::run(argc, argv); }
