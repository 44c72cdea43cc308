// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fmt/format.h>
#include <iterator>
#include <map>

#include "passes/frame_graph.h"

namespace nacre::passes {

using rhi::has_any;
using rhi::ResourceUse;

namespace {

std::string escaped(std::string_view text) {
    std::string result;
    for (const char c : text) {
        switch (c) {
            case '<': result += "&lt;"; break;
            case '>': result += "&gt;"; break;
            case '&': result += "&amp;"; break;
            case '"': result += "&quot;"; break;
            default: result += c;
        }
    }
    return result;
}

std::string size_text(std::uint64_t bytes) {
    if (bytes >= 1u << 20) return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / (1u << 20));
    if (bytes >= 1u << 10) return fmt::format("{:.1f} KiB", static_cast<double>(bytes) / (1u << 10));
    return fmt::format("{} B", bytes);
}

}  // namespace

bool FrameGraph::is_drawn(const Access& access) const {
    return access.is_texture ? textures_[access.resource].is_drawn() : buffers_[access.resource].is_drawn();
}

std::string FrameGraph::to_dot() const {
    std::string text = "digraph frame {\n  rankdir=LR;\n  node [fontname=\"sans-serif\"];\n";
    auto out = std::back_inserter(text);
    for (std::size_t i = 0; i < passes_.size(); ++i) {
        fmt::format_to(out, "  p{} [shape=box, style=\"filled{}\", fillcolor=\"{}\", label=\"{}\"];\n", i,
                       passes_[i].is_live ? "" : ",dashed", passes_[i].is_live ? "#ffd9a0" : "#eeeeee",
                       passes_[i].name);
    }
    for (std::size_t i = 0; i < textures_.size(); ++i) {
        const TextureNode& node = textures_[i];
        if (!node.is_drawn()) continue;
        fmt::format_to(out, "  t{} [shape=ellipse, label=\"{}\\n{} {}x{}{}\"];\n", i, node.desc.name,
                       rhi::info(node.desc.format).name, node.desc.width, node.desc.height,
                       node.shares_with != ~0u ? "\\nin the memory of " + textures_[node.shares_with].desc.name : "");
    }
    for (std::size_t i = 0; i < buffers_.size(); ++i) {
        if (!buffers_[i].is_drawn()) continue;
        fmt::format_to(out, "  b{} [shape=ellipse, style=dotted, label=\"{}\\n{}\"];\n", i, buffers_[i].desc.name,
                       size_text(buffers_[i].desc.size));
    }
    for (std::size_t i = 0; i < passes_.size(); ++i) {
        if (!passes_[i].is_live) continue;
        for (const Access& access : passes_[i].accesses) {
            if (!is_drawn(access)) continue;
            const char kind = access.is_texture ? 't' : 'b';
            if (has_any(access.use, rhi::writing_uses)) {
                fmt::format_to(out, "  p{} -> {}{} [color=\"#c03020\"];\n", i, kind, access.resource);
            } else {
                fmt::format_to(out, "  {}{} -> p{} [color=\"#2060a0\"];\n", kind, access.resource, i);
            }
        }
    }
    return text + "}\n";
}

std::string FrameGraph::to_svg() const {
    // A column for each piece of memory: owners in the order of first use, then buffers.
    std::vector<std::uint32_t> row_of(passes_.size(), ~0u);
    std::vector<std::uint32_t> rows;
    for (const bool live : {true, false}) {
        for (std::uint32_t i = 0; i < passes_.size(); ++i) {
            if (passes_[i].is_live != live) continue;
            row_of[i] = static_cast<std::uint32_t>(rows.size());
            rows.push_back(i);
        }
    }
    std::map<std::uint32_t, int> texture_column, buffer_column;
    int columns = 0;
    for (std::uint32_t i = 0; i < textures_.size(); ++i) {
        if (textures_[i].is_drawn() && textures_[i].shares_with == ~0u) texture_column[i] = columns++;
    }
    for (std::uint32_t i = 0; i < textures_.size(); ++i) {
        if (textures_[i].is_drawn() && textures_[i].shares_with != ~0u) {
            texture_column[i] = texture_column[textures_[i].shares_with];
        }
    }
    for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
        if (buffers_[i].is_drawn()) buffer_column[i] = columns++;
    }

    // A column is as wide as the names of all that takes turns in its memory need.
    constexpr int left = 230, top = 190, label_width = 17, row_height = 34;
    std::vector<int> labels_in_column(static_cast<std::size_t>(columns));
    for (const auto& [texture, column] : texture_column) ++labels_in_column[column];
    for (const auto& [buffer, column] : buffer_column) ++labels_in_column[column];
    std::vector<int> column_center;
    int right = left;
    for (const int labels : labels_in_column) {
        column_center.push_back(right + label_width);
        right += label_width * (std::max(labels, 1) + 1);
    }
    const int width = std::max(right + 110, 420);
    const int height = top + static_cast<int>(rows.size()) * row_height + 60;
    const auto column_x = [&](int column) { return column_center[column]; };
    const auto row_y = [](std::uint32_t row) { return top + static_cast<int>(row) * row_height + row_height / 2; };

    std::string text = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
        "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        width, height);
    auto out = std::back_inserter(text);
    for (std::size_t row = 0; row < rows.size(); ++row) {
        const Pass& pass = passes_[rows[row]];
        const int y = row_y(static_cast<std::uint32_t>(row));
        fmt::format_to(out, "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"#e4e4e4\"/>\n", left - 8, y, right,
                       y);
        fmt::format_to(out, "<rect x=\"12\" y=\"{}\" width=\"{}\" height=\"24\" rx=\"5\" fill=\"{}\" stroke=\"{}\"/>\n",
                       y - 12, left - 24, pass.is_live ? "#ffe3b8" : "#f3f3f3", pass.is_live ? "#c98a2b" : "#bbbbbb");
        fmt::format_to(out, "<text x=\"22\" y=\"{}\" fill=\"{}\">{}{}</text>\n", y + 4,
                       pass.is_live ? "#222222" : "#999999", escaped(pass.name), pass.is_live ? "" : " (left out)");
    }
    constexpr const char* colors[] = {"#4c78a8", "#72b7b2", "#54a24b", "#b279a2", "#e45756", "#9d755d"};
    const auto draw_life = [&](std::string_view name, int column, std::uint32_t first, std::uint32_t last,
                               bool from_before, bool to_after, const char* color, std::string_view title) {
        const int y1 = from_before ? top : row_y(row_of[first]) - 9;
        const int y2 = to_after ? top + static_cast<int>(rows.size()) * row_height : row_y(row_of[last]) + 9;
        fmt::format_to(out,
                       "<rect x=\"{}\" y=\"{}\" width=\"12\" height=\"{}\" rx=\"6\" fill=\"{}\" fill-opacity=\"0.35\">"
                       "<title>{}: {}</title></rect>\n",
                       column_x(column) - 6, y1, y2 - y1, color, escaped(name), escaped(title));
    };
    std::vector<int> labels_drawn(static_cast<std::size_t>(columns));
    const auto draw_label = [&](std::string_view name, int column, const char* color) {
        fmt::format_to(out, "<g transform=\"translate({},{}) rotate(-60)\">",
                       column_x(column) + 4 + labels_drawn[column]++ * label_width, top - 10);
        // Which of several names belongs to which bar.
        const bool has_mark = labels_in_column[column] > 1;
        if (has_mark)
            fmt::format_to(out, "<rect y=\"-8\" width=\"8\" height=\"8\" fill=\"{}\" fill-opacity=\"0.6\"/>", color);
        fmt::format_to(out, "<text x=\"{}\" fill=\"#333333\">{}</text></g>\n", has_mark ? 12 : 0, escaped(name));
    };
    for (std::uint32_t i = 0; i < textures_.size(); ++i) {
        const TextureNode& node = textures_[i];
        if (!node.is_drawn()) continue;
        const int column = texture_column[i];
        const char* color = colors[i % std::size(colors)];
        draw_life(node.desc.name, column, node.first_pass, node.last_pass, node.imported, node.kept || node.imported,
                  color,
                  fmt::format("{} {}x{}, {}{}", rhi::info(node.desc.format).name, node.desc.width, node.desc.height,
                              size_text(node.bytes), node.imported ? ", persistent" : ""));
        draw_label(node.desc.name, column, color);
    }
    for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
        const BufferNode& node = buffers_[i];
        if (!node.is_drawn()) continue;
        draw_life(node.desc.name, buffer_column[i], node.first_pass, node.last_pass, node.imported, node.imported,
                  "#888888", size_text(node.desc.size));
        draw_label(node.desc.name, buffer_column[i], "#888888");
    }
    for (std::uint32_t i = 0; i < passes_.size(); ++i) {
        if (!passes_[i].is_live) continue;
        for (const Access& access : passes_[i].accesses) {
            if (!is_drawn(access)) continue;
            const int x =
                column_x(access.is_texture ? texture_column[access.resource] : buffer_column[access.resource]);
            const bool writes = has_any(access.use, rhi::writing_uses);
            fmt::format_to(out, "<circle cx=\"{}\" cy=\"{}\" r=\"5\" fill=\"{}\" stroke=\"{}\" stroke-width=\"2\"/>\n",
                           x, row_y(row_of[i]), writes ? "#c03020" : "#ffffff", writes ? "#c03020" : "#2060a0");
        }
    }
    fmt::format_to(
        out,
        "<text x=\"12\" y=\"22\" font-size=\"15\">Frame graph</text>\n"
        "<text x=\"12\" y=\"42\" fill=\"#555555\">transient: {} ({} without sharing)</text>\n"
        "<circle cx=\"18\" cy=\"{}\" r=\"5\" fill=\"#c03020\"/><text x=\"28\" y=\"{}\">writes</text>\n"
        "<circle cx=\"88\" cy=\"{}\" r=\"5\" fill=\"#ffffff\" stroke=\"#2060a0\" stroke-width=\"2\"/>"
        "<text x=\"98\" y=\"{}\">reads; one column is one piece of memory, one bar what it holds</text>\n</svg>\n",
        size_text(transient_bytes()), size_text(transient_bytes_unshared()), height - 24, height - 20, height - 24,
        height - 20);
    return text;
}

}  // namespace nacre::passes
