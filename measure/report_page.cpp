// SPDX-License-Identifier: Apache-2.0
#include "measure/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>

#include "core/embedded_file.h"
#include "core/file.h"
#include "measure/base64.h"

namespace nacre::measure {

// Generated from the files named in measure/CMakeLists.txt.
std::span<const EmbeddedFile> embedded_files();

namespace {

std::string escaped(std::string_view text) {
    std::string result;
    for (const char c : text) {
        switch (c) {
            case '&': result += "&amp;"; break;
            case '<': result += "&lt;"; break;
            case '>': result += "&gt;"; break;
            case '"': result += "&quot;"; break;
            case '\'': result += "&#39;"; break;
            default: result += c;
        }
    }
    return result;
}

std::string_view embedded(std::string_view path) {
    for (const EmbeddedFile& file : embedded_files()) {
        if (file.path == path) return file.text;
    }
    return {};
}

std::string_view class_of(ReportTone tone) {
    switch (tone) {
        case ReportTone::good: return "good";
        case ReportTone::bad: return "bad";
        case ReportTone::plain: break;
    }
    return "";
}

std::string cell_html(const ReportCell& cell) {
    std::string classes(class_of(cell.tone));
    if (cell.is_number) classes += " number";
    if (cell.bar > 0.0) classes += " bar";
    const std::string style =
        cell.bar > 0.0 ? fmt::format(" style=\"--share:{:.4f}\"", std::min(cell.bar, 1.0)) : std::string();
    return fmt::format("<td class=\"{}\"{}>{}</td>", classes, style, escaped(cell.text));
}

std::string table_html(const ReportTable& table) {
    std::string html;
    if (table.is_folded) html += fmt::format("<details><summary>{}</summary>", escaped(table.title));
    else html += fmt::format("<h2>{}</h2>", escaped(table.title));
    if (!table.note.empty()) html += fmt::format("<p class=\"note\">{}</p>", escaped(table.note));
    html += "<div class=\"scroll\"><table><thead><tr>";
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
        const bool is_number = !table.rows.empty() && c < table.rows[0].size() && table.rows[0][c].is_number;
        html += fmt::format("<th class=\"{}\">{}</th>", is_number ? "number" : "", escaped(table.columns[c]));
    }
    html += "</tr></thead><tbody>\n";
    for (const auto& row : table.rows) {
        html += "<tr>";
        for (const ReportCell& cell : row) html += cell_html(cell);
        html += "</tr>\n";
    }
    html += "</tbody></table></div>\n";
    if (table.is_folded) html += "</details>\n";
    return html;
}

// Place of a value on a plot's axis, [0, 1].
double place_on(const ReportPlot& plot, double value) {
    double place = plot.is_logarithmic ? std::log(std::max(value, 1e-300) / plot.low) / std::log(plot.high / plot.low)
                                       : (value - plot.low) / (plot.high - plot.low);
    if (std::isnan(place)) place = 1.0;
    return std::clamp(place, 0.0, 1.0);
}

std::string bars_svg(const ReportPlot& plot) {
    constexpr double left = 190.0, width = 760.0, row = 20.0;
    const double height = row * static_cast<double>(plot.bars.size());
    std::string svg = fmt::format("<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\">", left + width + 20.0,
                                  height + 26.0);
    for (const double mark : plot.marks) {
        const double x = left + width * place_on(plot, mark);
        svg += fmt::format("<line class=\"axis\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"0\" y2=\"{1}\"/>"
                           "<text class=\"axis\" x=\"{0:.1f}\" y=\"{2}\" text-anchor=\"middle\">{3:g}</text>",
                           x, height + 4.0, height + 20.0, mark);
    }
    for (std::size_t i = 0; i < plot.bars.size(); ++i) {
        const ReportPlot::Bar& bar = plot.bars[i];
        const double from = left + width * place_on(plot, bar.low), to = left + width * place_on(plot, bar.high);
        const double y = row * static_cast<double>(i);
        svg += fmt::format(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text><rect class=\"{}\" x=\"{:.1f}\" "
            "y=\"{}\" width=\"{:.1f}\" height=\"12\" rx=\"2\"><title>{}: {:.6g} to {:.6g}</title></rect>",
            left - 10.0, y + 14.0, escaped(bar.name), class_of(bar.tone), from, y + 4.0, std::max(to - from, 2.0),
            escaped(bar.name), bar.low, bar.high);
    }
    return svg + "</svg>\n";
}

std::string lines_svg(const ReportPlot& plot) {
    constexpr double left = 60.0, width = 700.0, height = 300.0, top = 10.0;
    constexpr const char* colors[] = {"#7cc4ff", "#ff7b72", "#6bd68c", "#e3b341",
                                      "#d2a8ff", "#79e2d0", "#ffa657", "#f7a8c4"};
    std::string svg = fmt::format("<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\">", left + width + 240.0,
                                  height + top + 30.0);
    for (const double mark : plot.marks) {
        const double y = top + height * (1.0 - place_on(plot, mark));
        svg += fmt::format("<line class=\"axis\" x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/>"
                           "<text class=\"axis\" x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>",
                           left, left + width, y, left - 8.0, y + 4.0, mark);
    }
    const auto x_of = [&](std::size_t column) {
        return left + width * (static_cast<double>(column) + 0.5) / static_cast<double>(plot.columns.size());
    };
    for (std::size_t c = 0; c < plot.columns.size(); ++c)
        svg += fmt::format("<text class=\"axis\" x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}</text>", x_of(c),
                           top + height + 20.0, escaped(plot.columns[c]));
    for (std::size_t l = 0; l < plot.lines.size(); ++l) {
        const char* const color = colors[l % std::size(colors)];
        std::string points;
        for (std::size_t c = 0; c < plot.lines[l].values.size(); ++c)
            points +=
                fmt::format("{:.1f},{:.1f} ", x_of(c), top + height * (1.0 - place_on(plot, plot.lines[l].values[c])));
        svg += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/><text x=\"{}\" "
                           "y=\"{}\" style=\"fill:{}\">{}</text>",
                           points, color, left + width + 12.0, top + 14.0 + 18.0 * static_cast<double>(l), color,
                           escaped(plot.lines[l].name));
    }
    return svg + "</svg>\n";
}

std::string plot_html(const ReportPlot& plot) {
    std::string html = fmt::format("<h2>{}</h2>", escaped(plot.title));
    if (!plot.note.empty()) html += fmt::format("<p class=\"note\">{}</p>", escaped(plot.note));
    return html + (plot.bars.empty() ? lines_svg(plot) : bars_svg(plot));
}

Expected<std::string> pictures_html(const std::vector<ReportPicture>& pictures, const ImageBytes& first) {
    std::string html = "<div class=\"gallery\">\n";
    for (const ReportPicture& picture : pictures) {
        NACRE_TRY(const std::vector<std::byte> png, encode_png(picture.picture));
        const bool in_viewer = picture.picture.width == first.width && picture.picture.height == first.height;
        html += fmt::format(
            "<figure><img data-name=\"{0}\" data-viewer=\"{1}\" alt=\"{0}\" width=\"{2}\" height=\"{3}\" "
            "src=\"data:image/png;base64,{4}\"><figcaption><b>{0}</b>{5}</figcaption></figure>\n",
            escaped(picture.name), in_viewer ? 1 : 0, picture.picture.width, picture.picture.height, base64(png),
            escaped(picture.caption));
    }
    html += "</div>\n";
    return html;
}

constexpr std::string_view viewer_html = R"(<h2>Compare</h2>
<p class="note">Drag to move the border (or use the arrow keys), turn the wheel to zoom, hold Shift and drag to pan, press F to swap the
two. Click a picture below to see it on the right.</p>
<div class="viewer"><div class="controls"><label>left <select></select></label><label>right <select></select></label>
<button class="flip">swap (F)</button><button class="reset">reset</button></div>
<div class="stage" style="--at:50%" tabindex="0" role="slider" aria-label="border between the two pictures, percent"
aria-valuemin="0" aria-valuemax="100" aria-valuenow="50"><img alt="left picture"><div class="over"><img alt="right picture"></div>
<div class="handle"></div><div class="tag a"></div><div class="tag b"></div></div></div>
)";

}  // namespace

Expected<std::string> report_page_html(const ReportPage& page) {
    std::string html = fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<title>{}</title>\n<style>\n{}</style></head>\n<body><main>\n<h1>{}</h1>\n",
        escaped(page.title), embedded("measure/report_page.css"), escaped(page.title));
    if (!page.subtitle.empty()) html += fmt::format("<p class=\"subtitle\">{}</p>\n", escaped(page.subtitle));
    html += "<ul class=\"facts\">";
    for (const std::string& fact : page.facts) html += fmt::format("<li>{}</li>", escaped(fact));
    html += "</ul>\n";
    if (!page.verdict.empty()) {
        html += fmt::format("<p class=\"verdict {}\">{}</p>\n", class_of(page.tone), escaped(page.verdict));
    }
    for (const ReportTable& table : page.tables) html += table_html(table);
    for (const ReportPlot& plot : page.plots) html += plot_html(plot);
    const ImageBytes none;
    const ImageBytes& first = page.pictures.empty() ? none : page.pictures[0].picture;
    if (!page.pictures.empty()) {
        html += viewer_html;
        html += "<h2>Pictures</h2>\n";
        NACRE_TRY(const std::string pictures, pictures_html(page.pictures, first));
        html += pictures;
    }
    for (const ReportGallery& gallery : page.galleries) {
        html += fmt::format("<h2>{}</h2>\n", escaped(gallery.title));
        if (!gallery.note.empty()) html += fmt::format("<p class=\"note\">{}</p>\n", escaped(gallery.note));
        NACRE_TRY(const std::string pictures, pictures_html(gallery.pictures, first));
        html += pictures;
    }
    for (const ReportTable& table : page.details) html += table_html(table);
    html += fmt::format("</main>\n<script>\n{}</script>\n</body></html>\n", embedded("measure/report_page.js"));
    return html;
}

Expected<void> write_report_page(const std::filesystem::path& file, const ReportPage& page) {
    NACRE_TRY(const std::string html, report_page_html(page));
    return write_file_atomically(file, html);
}

}  // namespace nacre::measure
