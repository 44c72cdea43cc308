// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "measure/stability.h"

namespace nacre::measure {
namespace {

using Json = nlohmann::ordered_json;

// JSON has no infinity: as good as one is the largest number.
double finite(double value) { return std::isfinite(value) ? value : std::numeric_limits<double>::max(); }

Json figures_json(const StabilityFigures& f) {
    return Json{{"backend", f.backend},
                {"points", f.points},
                {"nan", f.nan},
                {"inf", f.inf},
                {"negative", f.negative},
                {"max_rel_error", finite(f.max_rel_error)},
                {"at", f.at},
                {"facets", f.facets},
                {"seconds", f.seconds},
                {"first_seconds", f.first_seconds},
                {"points_per_second", f.seconds > 0.0 ? static_cast<double>(f.points) / f.seconds : 0.0}};
}

ReportCell text_cell(std::string text) { return {.text = std::move(text)}; }
ReportCell number_cell(std::string text, ReportTone tone = ReportTone::plain) {
    return {.text = std::move(text), .tone = tone, .is_number = true};
}
ReportCell count_cell(std::uint64_t count) {
    return number_cell(fmt::format("{}", count), count > 0 ? ReportTone::bad : ReportTone::plain);
}

ReportTable main_table(const StabilityReport& report) {
    ReportTable table{.title = "Closures",
                      .note =
                          "Errors are relative, above a floor of 1e-7 of the lobe's scale. The furnace's minimum is "
                          "that of what absorbs nothing, where the closure has such slabs.",
                      .columns = {"closure", "points", "NaN", "infinite", "negative", "largest error", "closed form",
                                  "furnace", "reciprocity", "chi-square", "largest weight", "variance"}};
    for (const StabilityClosure& c : report.closures) {
        const StabilityFigures& f = c.all;
        table.rows.push_back(
            {text_cell(c.name), number_cell(fmt::format("{}", f.points)), count_cell(f.nan), count_cell(f.inf),
             count_cell(f.negative),
             number_cell(fmt::format("{:.2g}", f.max_rel_error),
                         f.max_rel_error > c.tolerance ? ReportTone::bad : ReportTone::good),
             number_cell(f.closed_error > 0.0 ? fmt::format("{:.2g}", f.closed_error) : "-"),
             number_cell(c.has_furnace ? fmt::format("{:.5f} to {:.5f}", c.furnace_min, c.furnace_max) : "-"),
             number_cell(fmt::format("{:.2g}", f.reciprocity)),
             number_cell(c.has_sampler ? fmt::format("{} of {} fail", c.chi2_failures, c.chi2_tests) : "-",
                         c.chi2_failures > 0 ? ReportTone::bad : ReportTone::plain),
             number_cell(f.weight_max > 0.0 ? fmt::format("{:.6g}", f.weight_max) : "-"),
             number_cell(c.has_sampler ? fmt::format("{:.3g}", c.weight_variance) : "-")});
    }
    return table;
}

ReportTable notes_table(const StabilityReport& report) {
    ReportTable table{.title = "What they are", .columns = {"closure", "what is measured", "to know"}};
    for (const StabilityClosure& c : report.closures)
        table.rows.push_back({text_cell(c.name), text_cell(c.what), text_cell(c.note)});
    return table;
}

ReportTable device_table(const StabilityReport& report) {
    ReportTable table{.title = "By device",
                      .columns = {"closure", "device", "points", "NaN", "infinite", "negative", "largest error",
                                  "facets", "million points per second"}};
    for (const StabilityClosure& c : report.closures) {
        for (const StabilityFigures& f : c.devices)
            table.rows.push_back(
                {text_cell(c.name), text_cell(f.backend), number_cell(fmt::format("{}", f.points)), count_cell(f.nan),
                 count_cell(f.inf), count_cell(f.negative), number_cell(fmt::format("{:.2g}", f.max_rel_error)),
                 number_cell(fmt::format("{}", f.facets)),
                 number_cell(
                     fmt::format("{:.2f}", f.seconds > 0.0 ? 1e-6 * static_cast<double>(f.points) / f.seconds : 0.0))});
    }
    return table;
}

ReportTable places_table(const StabilityReport& report) {
    ReportTable table{.title = "Where",
                      .note = "The point of the largest error, of the largest error against a closed form, of the "
                              "largest defect between two directions, and of the least likely samples.",
                      .columns = {"closure", "what", "where"},
                      .is_folded = true};
    for (const StabilityClosure& c : report.closures) {
        const std::pair<const char*, const std::string*> rows[] = {{"error", &c.all.at},
                                                                   {"closed form", &c.all.closed_at},
                                                                   {"reciprocity", &c.all.reciprocity_at},
                                                                   {"samples", &c.chi2_at}};
        for (const auto& [what, where] : rows)
            if (!where->empty()) table.rows.push_back({text_cell(c.name), text_cell(what), text_cell(*where)});
    }
    return table;
}

ReportTable distribution_table(const StabilityReport& report) {
    ReportTable table{.title = "Distribution of errors",
                      .note = "How many of a million results have a relative error of this decade.",
                      .columns = {"closure", "below 1e-8", "1e-8", "1e-7", "1e-6", "1e-5", "1e-4", "1e-3", "1e-2",
                                  "0.1", "1 and more"}};
    for (const StabilityClosure& c : report.closures) {
        std::uint64_t sum = 0;
        for (const std::uint64_t count : c.all.errors) sum += count;
        if (sum == 0) continue;
        std::vector<ReportCell> row{text_cell(c.name)};
        for (const std::uint64_t count : c.all.errors) {
            const double share = static_cast<double>(count) / static_cast<double>(sum);
            ReportCell cell = number_cell(count == 0 ? "" : fmt::format("{:.3g}", 1e6 * share));
            cell.bar = share;
            row.push_back(std::move(cell));
        }
        table.rows.push_back(std::move(row));
    }
    return table;
}

std::vector<double> decades(int from, int to) {
    std::vector<double> marks;
    for (int e = from; e <= to; ++e) marks.push_back(std::pow(10.0, e));
    return marks;
}

}  // namespace

std::string to_json(const StabilityReport& report) {
    Json closures = Json::array();
    for (const StabilityClosure& c : report.closures) {
        const StabilityFigures& f = c.all;
        const auto where = [](bool is_there, double value) { return is_there ? Json(finite(value)) : Json(nullptr); };
        Json devices = Json::array();
        for (const StabilityFigures& device : c.devices) devices.push_back(figures_json(device));
        closures.push_back(Json{{"name", c.name},
                                {"points", f.points},
                                {"nan", f.nan},
                                {"inf", f.inf},
                                {"negative", f.negative},
                                {"max_rel_error", finite(f.max_rel_error)},
                                {"at", f.at},
                                {"furnace_min", where(c.has_furnace, c.furnace_min)},
                                {"furnace_max", where(c.has_furnace, c.furnace_max)},
                                {"reciprocity", finite(f.reciprocity)},
                                {"chi2_failures", c.chi2_failures},
                                {"weight_max", where(f.weight_max > 0.0, f.weight_max)},
                                {"weight_variance", where(c.has_sampler, c.weight_variance)},
                                {"tolerance", c.tolerance},
                                {"note", c.note},
                                {"closed_form_error", finite(f.closed_error)},
                                {"reference_error", finite(f.host_error)},
                                {"reference_at", f.host_at},
                                {"sample_agreement", finite(f.agreement)},
                                {"facets", f.facets},
                                {"chi2_tests", c.chi2_tests},
                                {"chi2_blind_to_1_percent", c.chi2_blind},
                                {"backends", std::move(devices)}});
    }
    return Json{{"points", report.desc.points},
                {"trees", report.trees},
                {"chi2_samples", report.samples},
                {"devices", report.devices},
                {"seconds", report.seconds},
                {"violations", violations_of(report)},
                {"closures", std::move(closures)}}
        .dump(2);
}

ReportPage stability_page(const StabilityReport& report) {
    const std::vector<std::string> violations = violations_of(report);
    std::uint64_t points = 0;
    for (const StabilityClosure& c : report.closures) points += c.all.points;
    ReportPage page{.title = "Numerical stability of the closures",
                    .subtitle = "Single precision on each device against double precision, at points with the edges "
                                "over-represented.",
                    .facts = report.devices};
    page.facts.push_back(fmt::format("{} points", points));
    page.facts.push_back(fmt::format("{} trees", report.trees));
    page.facts.push_back(fmt::format("{} samples in each chi-square test", report.samples));
    page.facts.push_back(fmt::format("{:.0f} s", report.seconds));
    page.tone = violations.empty() ? ReportTone::good : ReportTone::bad;
    page.verdict = violations.empty()
                       ? "All closures are within what they promise."
                       : fmt::format("{} figures are beyond what the closures promise.", violations.size());
    if (!violations.empty()) {
        ReportTable table{.title = "Beyond", .columns = {"what"}};
        for (const std::string& violation : violations) table.rows.push_back({text_cell(violation)});
        page.tables.push_back(std::move(table));
    }
    page.tables.push_back(main_table(report));
    page.tables.push_back(notes_table(report));

    ReportPlot errors{.title = "Largest relative error",
                      .note = "A closure without a note is allowed 1e-3, others 1e-2.",
                      .low = 1e-7,
                      .high = 1.0,
                      .is_logarithmic = true,
                      .marks = decades(-7, 0)};
    ReportPlot furnace{.title = "Energy under white light",
                       .note = "From the least that what absorbs nothing sends out (else of all) to the most of all.",
                       .low = 0.9,
                       .high = 1.1,
                       .marks = {0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1}};
    ReportPlot angles{.title = "Largest error by the lower cosine of view and light",
                      .note = "The eight closures with the largest errors.",
                      .low = 1e-8,
                      .high = 1.0,
                      .is_logarithmic = true,
                      .marks = decades(-8, 0),
                      .columns = {"1e-8", "1e-7", "1e-6", "1e-5", "1e-4", "1e-3", "0.01", "0.1 to 1"}};
    std::vector<const StabilityClosure*> ranked;
    for (const StabilityClosure& c : report.closures) {
        errors.bars.push_back({c.name, 1e-7, c.all.max_rel_error,
                               c.all.max_rel_error > c.tolerance ? ReportTone::bad : ReportTone::good});
        if (c.has_furnace)
            furnace.bars.push_back({c.name, c.furnace_min, c.furnace_max,
                                    c.furnace_max > c.limits.furnace ? ReportTone::bad : ReportTone::good});
        ranked.push_back(&c);
    }
    std::ranges::stable_sort(ranked, std::greater{}, [](const StabilityClosure* c) { return c->all.max_rel_error; });
    for (std::size_t i = 0; i < std::min<std::size_t>(ranked.size(), 8); ++i) {
        const auto& values = ranked[i]->all.error_by_angle;
        angles.lines.push_back({ranked[i]->name, {values.begin(), values.end()}});
    }
    page.plots = {std::move(errors), std::move(angles), std::move(furnace)};
    page.details = {distribution_table(report), device_table(report), places_table(report)};
    return page;
}

}  // namespace nacre::measure
