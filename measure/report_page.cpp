// SPDX-License-Identifier: Apache-2.0
#include "measure/report_page.h"

#include <fmt/format.h>

#include <algorithm>
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
