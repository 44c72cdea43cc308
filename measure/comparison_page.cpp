// SPDX-License-Identifier: Apache-2.0
#include "measure/comparison_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "measure/flip.h"

namespace nacre::measure {
namespace {

ReportCell text_cell(std::string text, ReportTone tone = ReportTone::plain) { return {std::move(text), tone}; }

ReportCell number_cell(std::string text, ReportTone tone = ReportTone::plain) {
    return {std::move(text), tone, /*is_number=*/true};
}

std::string percent(double share) { return share == 0.0 ? "0 %" : fmt::format("{:.3g} %", 100.0 * share); }

ReportTable backend_table(const SceneComparison& comparison) {
    ReportTable table{
        .title = "Backends",
        .note = fmt::format("Differences are to {}. 200 dB means equal in every bit; FLIP is what a person "
                            "sees when flipping between two pictures, 0 to 1.",
                            comparison.backends.front().backend),
        .columns = {"backend", "device", "ms per frame", "fastest", "slowest", "memory", "PSNR", "FLIP mean",
                    "largest byte difference", "pixels above 1/255"}};
    double slowest = 1e-9;
    for (const BackendResult& result : comparison.backends) slowest = std::max(slowest, result.times.median_ms);
    for (const BackendResult& result : comparison.backends) {
        const bool is_reference = &result == &comparison.backends.front();
        ReportCell time = number_cell(fmt::format("{:.2f}", result.times.median_ms));
        time.bar = result.times.median_ms / slowest;
        std::vector<ReportCell> row = {
            text_cell(result.backend),
            text_cell(result.device),
            time,
            number_cell(fmt::format("{:.2f}", result.times.min_ms)),
            number_cell(fmt::format("{:.2f}", result.times.max_ms)),
            number_cell(fmt::format("{:.1f} MiB", double(result.times.memory_bytes) / 1048576.0))};
        if (is_reference) {
            for (int i = 0; i < 4; ++i) row.push_back(number_cell(i == 0 ? "reference" : ""));
        } else {
            row.push_back(number_cell(fmt::format("{:.1f} dB", result.final.psnr_db)));
            row.push_back(number_cell(fmt::format("{:.2g}", result.final.flip_mean)));
            row.push_back(number_cell(fmt::format("{}", result.final.max_abs_8bit)));
            row.push_back(number_cell(percent(result.final.share_above_1)));
        }
        table.rows.push_back(std::move(row));
    }
    return table;
}

ReportTable pass_table(const SceneComparison& comparison) {
    ReportTable table{.title = "Passes", .note = "Median milliseconds on the device.", .columns = {"pass"}};
    std::vector<std::string> order;
    double slowest = 1e-9;
    for (const BackendResult& result : comparison.backends) {
        table.columns.push_back(result.backend);
        for (const passes::PassTime& pass : result.times.passes) {
            if (std::ranges::find(order, pass.name) == order.end()) order.push_back(pass.name);
            slowest = std::max(slowest, pass.ms);
        }
    }
    for (const std::string& name : order) {
        std::vector<ReportCell> row = {text_cell(name)};
        for (const BackendResult& result : comparison.backends) {
            const auto found = std::ranges::find(result.times.passes, name, &passes::PassTime::name);
            ReportCell cell = number_cell(found == result.times.passes.end() ? "" : fmt::format("{:.3f}", found->ms));
            if (found != result.times.passes.end()) cell.bar = found->ms / slowest;
            row.push_back(std::move(cell));
        }
        table.rows.push_back(std::move(row));
    }
    return table;
}

ReportTable texture_table(const BackendResult& result, const std::string& reference) {
    ReportTable table{
        .title = fmt::format("Textures of {} against {}", result.backend, reference),
        .note = "Fields are the values inside packed words; they differ when they are off by more than one step.",
        .columns = {"texture", "texels", "not bit-equal", "fields differ", "fields", "largest difference", "relative"},
        .is_folded = false};
    for (const TextureDifference& texture : result.textures) {
        const auto share = [&](std::uint64_t count) {
            return fmt::format("{} ({})", count,
                               percent(texture.texels ? double(count) / double(texture.texels) : 0.0));
        };
        std::vector<std::string> fields;
        for (const FieldDifference& field : texture.fields) {
            if (field.differing > 0) fields.push_back(fmt::format("{} {}", field.name, field.differing));
        }
        table.rows.push_back({text_cell(texture.name), number_cell(fmt::format("{}", texture.texels)),
                              number_cell(texture.differing ? share(texture.differing) : "0"),
                              number_cell(texture.fields_differing ? share(texture.fields_differing)
                                          : texture.fields.empty() ? "" : "0"),
                              text_cell(fmt::format("{}", fmt::join(fields, ", "))),
                              number_cell(fmt::format("{:.3g}", texture.max_abs)),
                              number_cell(fmt::format("{:.3g}", texture.max_rel))});
    }
    return table;
}

ReportTable error_table(const BackendResult& result) {
    ReportTable table{.title = fmt::format("Numerical error of {}", result.backend),
                      .note =
                          "Against the reference in double precision. Textures of floats are compared with the "
                          "reference's doubles, packed "
                          "words by their decoded fields.",
                      .columns = {"texture", "largest error", "of the largest value", "relative", "RMS", "pixel",
                                  "field", "double", "single"},
                      .is_folded = false};
    for (const NumericalError& error : result.errors) {
        const WrongValue& at = error.largest;
        table.rows.push_back(
            {text_cell(error.texture), number_cell(fmt::format("{:.3g}", at.error)),
             number_cell(fmt::format("{:.3g}", error.share())), number_cell(fmt::format("{:.3g}", error.max_rel)),
             number_cell(fmt::format("{:.3g}", error.rms)),
             text_cell(fmt::format("{}, {} (layer {}, mip {})", at.x, at.y, at.layer, at.mip)), text_cell(at.name),
             number_cell(fmt::format("{:.9g}", at.reference)), number_cell(fmt::format("{:.9g}", at.value))});
    }
    if (const NumericalError* const largest = SceneComparison::largest_error(result))
        table.note += fmt::format(" The largest is that of {} at pixel {}, {}.", largest->texture, largest->largest.x,
                                  largest->largest.y);
    if (!result.no_origin.empty()) table.note += fmt::format(" Where it begins cannot be told: {}", result.no_origin);
    if (result.origin)
        table.note +=
            fmt::format(" {} begins at {}.", result.no_origin.empty() ? "It" : "The largest of " + result.origin_of,
                        result.origin->text);
    if (result.earlier_origin)
        table.note += fmt::format(" What came in is of {} and begins at {}.", result.earlier_origin_of,
                                  result.earlier_origin->text);
    return table;
}

ReportTable narrowed_table(const SceneComparison& comparison) {
    ReportTable table{.title = "Single precision in the reference",
                      .note = "These instructions go through floats of 32 bits in double precision too.",
                      .columns = {"operation", "line", "shader"}};
    for (const rhi::NarrowedOperation& operation : comparison.narrowed)
        table.rows.push_back({text_cell(operation.operation), text_cell(operation.line), text_cell(operation.shader)});
    return table;
}

ReportGallery difference_gallery(const SceneComparison& comparison, const std::vector<PairDifference>& pairs,
                                 Expected<void>& status) {
    constexpr float gain = 32.0f;
    ReportGallery gallery{
        .title = "Differences",
        .note = fmt::format("For each pair: the difference of the bytes times {}, and the FLIP map (black: "
                            "no difference seen).",
                            gain)};
    for (const PairDifference& pair : pairs) {
        const BackendResult& a = comparison.backends[pair.a];
        const BackendResult& b = comparison.backends[pair.b];
        const auto image = difference_image(linear_from_srgb_bytes(a.picture.tone_mapped),
                                            linear_from_srgb_bytes(b.picture.tone_mapped), gain);
        if (!image) {
            status = std::unexpected(image.error());
            return gallery;
        }
        const std::string name = fmt::format("{} and {}", a.backend, b.backend);
        gallery.pictures.push_back({fmt::format("{}: difference x {}", name, gain),
                                    fmt::format("{:.1f} dB, largest byte difference {}", pair.difference.psnr_db,
                                                pair.difference.max_abs_8bit),
                                    srgb_bytes_from_linear(*image)});
        gallery.pictures.push_back({fmt::format("{}: FLIP", name),
                                    fmt::format("mean {:.2g}", pair.difference.flip_mean),
                                    srgb_bytes_from_linear(colored_flip_map(pair.difference.flip_map))});
    }
    return gallery;
}

std::string unique_name(std::map<std::string, int>& used, const std::string& name) {
    const int count = ++used[name];
    return count == 1 ? name : fmt::format("{} ({})", name, count);
}

}  // namespace

Expected<std::vector<PairDifference>> compare_pairs(const SceneComparison& comparison) {
    std::vector<PairDifference> pairs;
    for (std::size_t a = 0; a < comparison.backends.size(); ++a) {
        for (std::size_t b = a + 1; b < comparison.backends.size(); ++b) {
            if (a == 0) {
                pairs.push_back({a, b, comparison.backends[b].final});
                continue;
            }
            NACRE_TRY(PictureDifference difference,
                      compare_pictures(linear_from_srgb_bytes(comparison.backends[a].picture.tone_mapped),
                                       linear_from_srgb_bytes(comparison.backends[b].picture.tone_mapped)));
            pairs.push_back({a, b, std::move(difference)});
        }
    }
    return pairs;
}

Expected<ReportPage> comparison_page(const SceneComparison& comparison, const std::vector<PairDifference>& pairs,
                                     std::vector<std::string> facts, const std::vector<std::string>& violations) {
    ReportPage page{.title = comparison.scene, .facts = std::move(facts)};
    std::vector<std::string> names;
    for (const BackendResult& result : comparison.backends) names.push_back(result.backend);
    page.subtitle = fmt::format("One scene, {} backend{}: {}", names.size(), names.size() == 1 ? "" : "s",
                                fmt::join(names, ", "));
    if (comparison.backends.size() < 2) {
        page.verdict = "Only one backend works here, so there is nothing to compare it with.";
    } else if (violations.empty()) {
        page.tone = ReportTone::good;
        page.verdict = "The backends agree within the tolerance.";
    } else {
        page.tone = ReportTone::bad;
        page.verdict = fmt::format("The backends do not agree: {} figure{} over the tolerance.", violations.size(),
                                   violations.size() == 1 ? " is" : "s are");
        ReportTable table{.title = "Over the tolerance", .columns = {"what"}};
        for (const std::string& violation : violations) table.rows.push_back({text_cell(violation, ReportTone::bad)});
        page.tables.push_back(std::move(table));
    }
    page.tables.push_back(backend_table(comparison));

    std::map<std::string, int> used;
    for (const BackendResult& result : comparison.backends) {
        page.pictures.push_back({unique_name(used, result.backend),
                                 fmt::format("{}, {:.1f} ms", result.device, result.times.median_ms),
                                 result.picture.tone_mapped});
    }
    if (!pairs.empty()) {
        Expected<void> status;
        page.galleries.push_back(difference_gallery(comparison, pairs, status));
        NACRE_CHECK(status);
    }
    for (const BackendResult& result : comparison.backends) {
        if (result.texture_pictures.empty()) continue;
        ReportGallery gallery{
            .title = fmt::format("Textures of {} that differ", result.backend),
            .note = "Left the texture, right in white the texels that count as different."};
        for (const TexturePictures& pictures : result.texture_pictures) {
            gallery.pictures.push_back({unique_name(used, result.backend + ": " + pictures.name), "as in the reference",
                                        srgb_bytes_from_linear(pictures.reference)});
            gallery.pictures.push_back({unique_name(used, result.backend + ": " + pictures.name + " differs"), "",
                                        srgb_bytes_from_linear(pictures.difference)});
        }
        page.galleries.push_back(std::move(gallery));
    }
    page.details.push_back(pass_table(comparison));
    for (const BackendResult& result : comparison.backends) {
        if (!result.textures.empty()) {
            page.details.push_back(texture_table(result, comparison.backends.front().backend));
        }
        if (!result.errors.empty()) page.tables.push_back(error_table(result));
    }
    if (!comparison.narrowed.empty()) page.details.push_back(narrowed_table(comparison));
    ReportTable warnings{.title = "Warnings", .columns = {"backend", "warning"}};
    for (const BackendResult& result : comparison.backends) {
        for (const std::string& warning : result.warnings) {
            warnings.rows.push_back({text_cell(result.backend), text_cell(warning)});
        }
    }
    if (!warnings.rows.empty()) page.details.push_back(std::move(warnings));
    return page;
}

}  // namespace nacre::measure
