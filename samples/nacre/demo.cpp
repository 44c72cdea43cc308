// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "samples/nacre/backends.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/comparison_run.h"
#include "samples/nacre/output.h"
#include "samples/nacre/text_table.h"

namespace nacre::command {
namespace {

using Json = nlohmann::ordered_json;

std::string difference_text(const measure::PictureDifference& difference) {
    if (difference.max_abs_8bit == 0) return "equal";
    return fmt::format("{:.1f} dB, {} above 1/255", difference.psnr_db, share_text(difference.share_above_1));
}

// One column for the difference to each other backend.
std::string table_of(const measure::SceneComparison& comparison, const std::vector<measure::PairDifference>& pairs) {
    std::vector<std::string> columns = {"backend", "device", "milliseconds"};
    for (const auto& result : comparison.backends) columns.push_back("to " + result.backend);
    TextTable table(columns);
    for (std::size_t row = 0; row < comparison.backends.size(); ++row) {
        const measure::BackendResult& result = comparison.backends[row];
        std::vector<std::string> cells = {result.backend, result.device, fmt::format("{:.1f}", result.times.median_ms)};
        for (std::size_t column = 0; column < comparison.backends.size(); ++column) {
            std::string cell = "-";
            for (const measure::PairDifference& pair : pairs) {
                if (pair.a == std::min(row, column) && pair.b == std::max(row, column)) {
                    cell = difference_text(pair.difference);
                }
            }
            cells.push_back(std::move(cell));
        }
        table.add(std::move(cells));
    }
    return table.text();
}

std::string json_of(const measure::SceneComparison& comparison, const std::vector<measure::PairDifference>& pairs,
                    const std::string& page) {
    Json backends = Json::array();
    for (const measure::BackendResult& result : comparison.backends) {
        backends.push_back({{"backend", result.backend},
                            {"device", result.device},
                            {"frame_ms",
                             {{"median", result.times.median_ms},
                              {"min", result.times.min_ms},
                              {"max", result.times.max_ms}}}});
    }
    Json differences = Json::array();
    for (const measure::PairDifference& pair : pairs) {
        differences.push_back({{"a", comparison.backends[pair.a].backend},
                               {"b", comparison.backends[pair.b].backend},
                               {"psnr_db", pair.difference.psnr_db},
                               {"flip_mean", pair.difference.flip_mean},
                               {"max_abs_8bit", pair.difference.max_abs_8bit},
                               {"share_above_1", pair.difference.share_above_1}});
    }
    return Json{{"scene", comparison.scene}, {"backends", backends}, {"differences", differences}, {"page", page}}.dump(
               2, ' ', false, Json::error_handler_t::replace) +
           "\n";
}

}  // namespace

Outcome run(const DemoArguments& arguments) {
    const auto instance = make_instance();
    const std::vector<std::string> backends = working_backends(*instance);
    std::string text;
    for (const rhi::UnavailableBackend& backend : instance->unavailable()) {
        text += fmt::format("{} is left out: {}\n", backend.backend, backend.error.message());
    }
    if (backends.empty()) {
        return std::unexpected(Failure({ErrorCode::not_found, "run the demo", "", "no backend works here. " + text,
                                        "Install a driver: on Debian, mesa-vulkan-drivers and libegl1."}));
    }
    NACRE_TRY(const SceneSession scene, SceneSession::open(arguments.scene));
    NACRE_TRY(const measure::SceneComparison comparison,
              run_comparison(scene, *instance, backends, {.frames = arguments.scene.frames, .textures = false}));
    NACRE_TRY(const auto pairs, measure::compare_pairs(comparison));
    const std::vector<std::string> violations = measure::violations_of(comparison, measure::Tolerance{});
    NACRE_CHECK(write_comparison(arguments.output, arguments.scene, comparison, violations));

    const std::filesystem::path page = std::filesystem::absolute(arguments.output) / "index.html";
    text += table_of(comparison, pairs);
    for (const std::string& violation : violations) text += fmt::format("over the tolerance: {}\n", violation);
    text += fmt::format("\nPictures: {}\nPage:     {}\n", std::filesystem::absolute(arguments.output).string(),
                        page.string());
    print_result(arguments.scene.json, text);
    NACRE_CHECK(write_json(arguments.scene.json, json_of(comparison, pairs, page.string())));
    return violations.empty() ? ExitCode::success : ExitCode::over_tolerance;
}

}  // namespace nacre::command
