// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/image.h"
#include "measure/flip.h"
#include "measure/image_metrics.h"
#include "measure/report_page.h"
#include "measure/texture_comparison.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/comparison_run.h"
#include "samples/nacre/output.h"
#include "samples/nacre/text_table.h"

namespace nacre::command {
namespace {

using Json = nlohmann::ordered_json;

measure::TextureData texture_of(const LayeredImage& image, const std::string& name, const ImageChannel& channel) {
    const bool is_word = std::holds_alternative<std::vector<std::uint32_t>>(channel.values);
    measure::TextureData texture{.name = name,
                                 .format = is_word ? rhi::Format::r32_uint : rhi::Format::r32_float,
                                 .width = image.width,
                                 .height = image.height};
    std::visit(
        [&](const auto& values) {
            texture.bytes.resize(values.size() * 4);
            std::memcpy(texture.bytes.data(), values.data(), texture.bytes.size());
        },
        channel.values);
    return texture;
}

// Channels of the same name in both files, as textures of one channel each.
Expected<std::vector<measure::TextureDifference>> compare_layers(const std::string& a, const std::string& b) {
    std::vector<measure::TextureDifference> differences;
    NACRE_TRY(const ImageInfo info_a, read_image_info(a));
    NACRE_TRY(const ImageInfo info_b, read_image_info(b));
    if (info_a.format != ImageFormat::openexr || info_b.format != ImageFormat::openexr) return differences;
    NACRE_TRY(const LayeredImage layers_a, read_exr_layers(a));
    NACRE_TRY(const LayeredImage layers_b, read_exr_layers(b));
    for (const ImageLayer& layer : layers_a.layers) {
        const auto other = std::ranges::find(layers_b.layers, layer.name, &ImageLayer::name);
        if (other == layers_b.layers.end()) continue;
        for (const ImageChannel& channel : layer.channels) {
            const auto match = std::ranges::find(other->channels, channel.name, &ImageChannel::name);
            if (match == other->channels.end() || match->values.index() != channel.values.index()) continue;
            const std::string name = layer.name.empty() ? channel.name : layer.name + "." + channel.name;
            NACRE_TRY(auto difference, measure::compare_textures(texture_of(layers_a, name, channel),
                                                                 texture_of(layers_b, name, *match)));
            differences.push_back(std::move(difference));
        }
    }
    return differences;
}

double finite(double value) { return std::isinf(value) ? std::numeric_limits<double>::max() : value; }

std::string json_of(const DiffArguments& arguments, const Image& a, const measure::PictureDifference& difference,
                    const std::vector<measure::TextureDifference>& layers) {
    Json textures = Json::array();
    for (const measure::TextureDifference& layer : layers) {
        textures.push_back({{"name", layer.name},
                            {"texels", layer.texels},
                            {"differing", layer.differing},
                            {"max_abs", finite(layer.max_abs)},
                            {"max_rel", finite(layer.max_rel)}});
    }
    return Json{{"a", arguments.a},
                {"b", arguments.b},
                {"size", {a.width, a.height}},
                {"textures", std::move(textures)},
                {"final",
                 {{"psnr_db", difference.psnr_db},
                  {"flip_mean", difference.flip_mean},
                  {"max_abs_8bit", difference.max_abs_8bit},
                  {"share_above_1", difference.share_above_1},
                  {"max_abs_linear", finite(difference.max_abs_linear)},
                  {"max_rel_linear", finite(difference.max_rel_linear)}}}}
               .dump(2, ' ', false, Json::error_handler_t::replace) +
           "\n";
}

Expected<void> write_page(const DiffArguments& arguments, const Image& a, const Image& b,
                          const measure::PictureDifference& difference) {
    const std::filesystem::path folder = arguments.output;
    NACRE_TRY(const Image amplified, measure::difference_image(a, b, 32.0f));
    const Image flip = measure::colored_flip_map(difference.flip_map);
    NACRE_CHECK(write_png(folder / "difference.png", amplified));
    NACRE_CHECK(write_png(folder / "flip.png", flip));
    measure::ReportPage page{.title = "Two pictures"};
    page.subtitle = fmt::format("{} and {}", arguments.a, arguments.b);
    page.facts = {fmt::format("{} x {}", a.width, a.height)};
    measure::ReportTable table{.title = "Difference", .columns = {"figure", "value"}};
    const auto add = [&](const char* name, std::string value) {
        table.rows.push_back({{name}, {std::move(value), measure::ReportTone::plain, true}});
    };
    add("PSNR (200 dB: equal)", fmt::format("{:.2f} dB", difference.psnr_db));
    add("FLIP mean", figure_text(difference.flip_mean));
    add("largest difference of a byte", fmt::format("{}", difference.max_abs_8bit));
    add("pixels above 1/255", share_text(difference.share_above_1));
    add("largest linear difference", figure_text(difference.max_abs_linear));
    page.tables.push_back(std::move(table));
    page.pictures = {{"A", arguments.a, srgb_bytes_from_linear(a)}, {"B", arguments.b, srgb_bytes_from_linear(b)}};
    page.galleries.push_back({"Differences", "The difference of the bytes times 32, and the FLIP map.",
                              {{"difference x 32", "", srgb_bytes_from_linear(amplified)},
                               {"FLIP", "", srgb_bytes_from_linear(flip)}}});
    return measure::write_report_page(folder / "index.html", page);
}

std::vector<std::string> judge(const measure::PictureDifference& difference, const measure::Tolerance& tolerance) {
    std::vector<std::string> violations;
    const auto check = [&](const char* what, double found, bool is_within, double bound) {
        if (!is_within) violations.push_back(fmt::format("{} is {:.6g}; the bound is {:.6g}", what, found, bound));
    };
    check("PSNR in dB", difference.psnr_db, difference.psnr_db >= tolerance.psnr_db, tolerance.psnr_db);
    check("FLIP mean", difference.flip_mean, difference.flip_mean <= tolerance.flip_mean, tolerance.flip_mean);
    check("the share of pixels above 1/255", difference.share_above_1,
          difference.share_above_1 <= tolerance.share_above_1, tolerance.share_above_1);
    if (tolerance.max_abs_8bit) {
        check("the largest difference of a byte", difference.max_abs_8bit,
              difference.max_abs_8bit <= *tolerance.max_abs_8bit, *tolerance.max_abs_8bit);
    }
    return violations;
}

}  // namespace

Outcome run(const DiffArguments& arguments) {
    NACRE_TRY(const measure::Tolerance tolerance, read_tolerance(arguments.tolerance));
    NACRE_TRY(const Image a, read_image(arguments.a));
    NACRE_TRY(const Image b, read_image(arguments.b));
    if (a.width != b.width || a.height != b.height) {
        return std::unexpected(Failure({ErrorCode::invalid_argument, "compare",
                                        fmt::format("'{}' and '{}'", arguments.a, arguments.b),
                                        fmt::format("they have {} x {} and {} x {} pixels", a.width, a.height, b.width,
                                                    b.height),
                                        "Compare pictures of one size."}));
    }
    NACRE_TRY(const measure::PictureDifference difference, measure::compare_pictures(a, b));
    NACRE_TRY(const auto layers, compare_layers(arguments.a, arguments.b));
    std::string text;
    if (!layers.empty()) {
        TextTable table({"channel", "texels", "not equal", "largest", "relative"});
        for (const measure::TextureDifference& layer : layers) {
            table.add({layer.name, fmt::format("{}", layer.texels), fmt::format("{}", layer.differing),
                       figure_text(layer.max_abs), figure_text(layer.max_rel)});
        }
        text += table.text() + "\n";
    }
    text += fmt::format("PSNR               {:.2f} dB{}\n", difference.psnr_db,
                        difference.psnr_db >= measure::largest_psnr_db ? " (equal)" : "");
    text += fmt::format("FLIP mean          {}\n", figure_text(difference.flip_mean));
    text += fmt::format("largest byte       {}\n", difference.max_abs_8bit);
    text += fmt::format("above 1/255        {}\n", share_text(difference.share_above_1));
    text += fmt::format("largest linear     {} (relative {})\n", figure_text(difference.max_abs_linear),
                        figure_text(difference.max_rel_linear));
    const std::vector<std::string> violations =
        arguments.tolerance.empty() ? std::vector<std::string>{} : judge(difference, tolerance);
    for (const std::string& violation : violations) text += fmt::format("over the tolerance: {}\n", violation);
    if (!arguments.output.empty()) {
        NACRE_CHECK(write_page(arguments, a, b, difference));
        text += fmt::format("Pictures and page: {}/index.html\n", arguments.output);
    }
    print_result(arguments.json, text);
    NACRE_CHECK(write_json(arguments.json, json_of(arguments, a, difference, layers)));
    return violations.empty() ? ExitCode::success : ExitCode::over_tolerance;
}

}  // namespace nacre::command
