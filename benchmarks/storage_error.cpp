// SPDX-License-Identifier: Apache-2.0
/// @file
/// Bits against round-trip error of each field of the G-buffer (measure/storage_error.h):
///
///     storage_error_benchmark [--samples N] [--json FILE] [--page FILE.html]
///
/// Prints a table of the fields as they are stored. Exit status 1 where an error is larger than the field's codec
/// promises for its bits.

#include "measure/storage_error.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "core/file.h"

int main(int count, char** arguments) {
    using namespace nacre;
    std::uint32_t samples = 10000;
    std::string json, page;
    CLI::App app("Bits against round-trip error of each field of the G-buffer.");
    app.add_option("--samples", samples, "Random numbers for each point")->check(CLI::PositiveNumber);
    app.add_option("--json", json, "File for all figures");
    app.add_option("--page", page, "HTML file with the curves");
    CLI11_PARSE(app, count, arguments);

    const auto curves = measure::storage_error_curves(samples);
    std::printf("%-32s %-11s %4s  %-8s %10s %10s %10s\n", "field", "where", "bits", "error", "largest", "bound", "RMS");
    bool is_kept = true;
    for (const measure::StorageErrorCurve& curve : curves) {
        const measure::StorageErrorPoint& point = curve.stored();
        std::printf("%-32s %-11s %4u  %-8s %10.3g %10.3g %10.3g\n", curve.field.c_str(), curve.where.c_str(),
                    curve.stored_bits, std::string(name_of(curve.kind)).c_str(), point.largest, point.bound, point.rms);
        for (const measure::StorageErrorPoint& at : curve.points) is_kept &= at.largest <= at.bound * (1.0 + 1e-9);
    }
    const auto written = [](const Expected<void>& result) {
        if (!result) std::fprintf(stderr, "%s\n", result.error().message().c_str());
        return result.has_value();
    };
    if (!json.empty()) is_kept &= written(write_file_atomically(json, measure::to_json(curves)));
    if (!page.empty()) is_kept &= written(measure::write_report_page(page, measure::storage_error_page(curves)));
    return is_kept ? 0 : 1;
}
