// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>
#include <set>

#include "samples/nacre/backends.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/comparison_run.h"
#include "samples/nacre/output.h"
#include "samples/nacre/text_table.h"

namespace nacre::command {
namespace {

std::string texture_text(const measure::BackendResult& result) {
    TextTable table({"texture", "texels", "not equal", "fields off", "largest", "relative"});
    for (const measure::TextureDifference& texture : result.textures) {
        table.add({texture.name, fmt::format("{}", texture.texels), fmt::format("{}", texture.differing),
                   texture.fields.empty() ? "-" : fmt::format("{}", texture.fields_differing),
                   figure_text(texture.max_abs), figure_text(texture.max_rel)});
    }
    return table.text();
}

// How wrong single precision is, and where the largest error begins.
std::string error_text(const measure::BackendResult& result) {
    TextTable table(
        {"numerical error of", "largest", "of largest value", "relative", "RMS", "at", "field", "double", "single"});
    for (const measure::NumericalError& error : result.errors) {
        const measure::WrongValue& at = error.largest;
        const std::string place = at.layer == 0 && at.mip == 0
                                      ? fmt::format("{}, {}", at.x, at.y)
                                      : fmt::format("{}, {} layer {} mip {}", at.x, at.y, at.layer, at.mip);
        table.add({error.texture, figure_text(at.error), figure_text(error.share()), figure_text(error.max_rel),
                   figure_text(error.rms), at.error > 0 ? place : "-", at.name.empty() ? "-" : at.name,
                   fmt::format("{:.9g}", at.reference), fmt::format("{:.9g}", at.value)});
    }
    std::string text = table.text();
    if (const measure::NumericalError* const largest = measure::SceneComparison::largest_error(result)) {
        text += fmt::format("Largest: {} at pixel {}, {}.\n", largest->texture, largest->largest.x, largest->largest.y);
        if (!result.no_origin.empty()) text += fmt::format("Where it begins cannot be told: {}\n", result.no_origin);
        if (result.origin)
            text += fmt::format("{} begins at {}.\n",
                                result.no_origin.empty() ? "It" : "The largest of " + result.origin_of,
                                result.origin->text);
    }
    if (result.earlier_origin)
        text += fmt::format("What came in is of {} and begins at {}.\n", result.earlier_origin_of,
                            result.earlier_origin->text);
    for (const measure::NumericalError& error : result.errors)
        if (error.flips > 0)
            text += fmt::format("{} texels of {} show another surface and are left out.\n", error.flips, error.texture);
    return text;
}

std::string narrowed_text(const std::vector<rhi::NarrowedOperation>& operations) {
    std::map<std::string, std::set<std::string>> lines;
    for (const rhi::NarrowedOperation& operation : operations)
        lines[operation.operation].insert(operation.line.empty() ? operation.shader : operation.line);
    std::string text;
    for (const auto& [operation, places] : lines)
        text += fmt::format("Through single precision in both, {}: {}\n", operation, fmt::join(places, ", "));
    return text;
}

std::string summary(const measure::SceneComparison& comparison) {
    TextTable table({"backend", "device", "ms", "PSNR dB", "FLIP mean", "max byte", "above 1/255"});
    for (std::size_t b = 0; b < comparison.backends.size(); ++b) {
        const measure::BackendResult& result = comparison.backends[b];
        std::vector<std::string> row = {result.backend, result.device, fmt::format("{:.2f}", result.times.median_ms)};
        if (b == 0) {
            row.insert(row.end(), {"-", "-", "-", "-"});
        } else {
            row.insert(row.end(),
                       {fmt::format("{:.2f}", result.final.psnr_db), figure_text(result.final.flip_mean),
                        fmt::format("{}", result.final.max_abs_8bit), share_text(result.final.share_above_1)});
        }
        table.add(std::move(row));
    }
    return table.text();
}

}  // namespace

Outcome run(const CompareArguments& arguments) {
    NACRE_TRY(const measure::Tolerance tolerance, read_tolerance(arguments.tolerance));
    NACRE_TRY(const SceneSession scene, SceneSession::open(arguments.scene));
    const auto instance = make_instance();
    NACRE_TRY(const measure::SceneComparison comparison,
              run_comparison(scene, *instance, arguments.scene.backends,
                             {.frames = arguments.scene.frames,
                              .only_texture = arguments.scene.dump,
                              .texture_pictures = !arguments.output.empty()}));
    const std::vector<std::string> violations = measure::violations_of(comparison, tolerance);

    std::string text;
    for (const measure::BackendResult& result : comparison.backends) {
        if (result.textures.empty()) continue;
        text += fmt::format("{} against {}\n{}\n", result.backend, comparison.backends.front().backend,
                            texture_text(result));
        if (!result.errors.empty()) text += error_text(result) + "\n";
    }
    text += narrowed_text(comparison.narrowed);
    text += summary(comparison);
    for (const std::string& violation : violations) text += fmt::format("over the tolerance: {}\n", violation);
    if (violations.empty()) text += "The backends agree within the tolerance.\n";
    if (!arguments.output.empty()) {
        NACRE_CHECK(write_comparison(arguments.output, arguments.scene, comparison, violations));
        text += fmt::format("Pictures and page: {}/index.html\n", arguments.output);
    }
    print_result(arguments.scene.json, text);
    NACRE_CHECK(write_json(arguments.scene.json, measure::to_json(comparison)));
    return violations.empty() ? ExitCode::success : ExitCode::over_tolerance;
}

}  // namespace nacre::command
