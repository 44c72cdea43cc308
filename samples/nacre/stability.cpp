// SPDX-License-Identifier: Apache-2.0
#include "measure/stability.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <tuple>

#include "core/file.h"
#include "samples/nacre/backends.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/output.h"
#include "samples/nacre/text_table.h"

namespace nacre::command {

Outcome run(const StabilityArguments& arguments) {
    // Mesa's software drivers compile many large shaders here, each for few points: without optimization, and beside
    // that as everywhere (backends/gl/quirks.cpp). What is computed stays the same.
    ::setenv("GALLIVM_PERF", "nopt,no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx", /*overwrite=*/0);
    // Points go to a device by tens of thousands: of the largest tree they take longer than any shader of a frame may.
    ::setenv("NACRE_CPU_WATCHDOG_SECONDS", "600", /*overwrite=*/0);
    const auto instance = make_instance();
    if (!arguments.output.empty()) {
        // Before the work of half an hour, not after it.
        std::error_code error;
        std::filesystem::create_directories(arguments.output, error);
        if (error || !std::filesystem::is_directory(arguments.output, error)) {
            return std::unexpected(Failure({ErrorCode::input_output, "make folder",
                                            fmt::format("'{}'", arguments.output),
                                            error ? error.message() : "a file has this name",
                                            "Give a folder that can be written to after -o."}));
        }
    }
    measure::StabilityDesc desc{.backends = arguments.backends, .points = arguments.points, .only = arguments.only};
    if (desc.backends.empty()) {
        for (const char* name : {"cpu", "vulkan", "gl"}) {
            const std::vector<std::string> working = working_backends(*instance);
            if (std::ranges::find(working, name) != working.end()) desc.backends.emplace_back(name);
        }
    }
    if (!arguments.output.empty()) {
        // What is known so far; whether it can be written is said at the end.
        desc.on_progress = [&](const measure::StabilityReport& report) {
            std::ignore = write_file_atomically(std::filesystem::path(arguments.output) / "report.json",
                                                measure::to_json(report));
        };
    }
    auto measured = measure::measure_stability(*instance, desc);
    if (!measured) {
        const ErrorCode code = measured.error().code;
        if (code == ErrorCode::not_found || code == ErrorCode::invalid_argument) return wrong_usage(measured.error());
        return std::unexpected(Failure(measured.error()));
    }
    const measure::StabilityReport& report = *measured;
    const std::string json = measure::to_json(report);

    TextTable table({"closure", "points", "NaN", "inf", "negative", "max error", "furnace", "reciprocity", "chi-square",
                     "max weight"});
    for (const measure::StabilityClosure& c : report.closures) {
        table.add({c.name, fmt::format("{}", c.all.points), fmt::format("{}", c.all.nan), fmt::format("{}", c.all.inf),
                   fmt::format("{}", c.all.negative), fmt::format("{:.2g}", c.all.max_rel_error),
                   c.has_furnace ? fmt::format("{:.4f} to {:.4f}", c.furnace_min, c.furnace_max) : "-",
                   fmt::format("{:.2g}", c.all.reciprocity),
                   c.has_sampler ? fmt::format("{} of {} fail", c.chi2_failures, c.chi2_tests) : "-",
                   c.all.weight_max > 0.0 ? fmt::format("{:.5g}", c.all.weight_max) : "-"});
    }
    std::string text = table.text();
    const std::vector<std::string> violations = measure::violations_of(report);
    for (const std::string& violation : violations) text += fmt::format("beyond: {}\n", violation);
    if (violations.empty()) text += "All closures are within what they promise.\n";
    if (!arguments.output.empty()) {
        const std::filesystem::path folder = arguments.output;
        NACRE_CHECK(write_file_atomically(folder / "report.json", json));
        NACRE_CHECK(measure::write_report_page(folder / "index.html", measure::stability_page(report)));
        text += fmt::format("Page: {}\n", (folder / "index.html").string());
    }
    print_result(arguments.json, text);
    NACRE_CHECK(write_json(arguments.json, json));
    return violations.empty() ? ExitCode::success : ExitCode::over_tolerance;
}

}  // namespace nacre::command
