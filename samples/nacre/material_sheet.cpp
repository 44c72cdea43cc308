// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/material_sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_easy_font.h>
#pragma GCC diagnostic pop

#include "materials/evaluation.h"

namespace nacre::command {
namespace {

using materials::FlattenedTree;
using materials::NodeIndex;
using materials::NodeKind;

using Color = glm::vec3;

const Color paper(0.86f), ink(0.02f), faint(0.55f);
constexpr int margin = 16, line_height = 14, cell = 176, plot = 150;

class Canvas {
  public:
    Canvas(std::uint32_t width, std::uint32_t height) {
        image_ = {.width = width, .height = height, .channels = 3};
        image_.pixels.resize(std::size_t{3} * width * height);
        for (std::size_t i = 0; i < image_.pixels.size(); ++i) image_.pixels[i] = paper[static_cast<int>(i % 3)];
    }

    void fill(int x, int y, int width, int height, const Color& color) {
        for (int row = std::max(y, 0); row < std::min(y + height, static_cast<int>(image_.height)); ++row) {
            for (int column = std::max(x, 0); column < std::min(x + width, static_cast<int>(image_.width)); ++column)
                std::copy_n(&color.x, 3,
                            image_.texel(static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row)));
        }
    }

    void line(double x0, double y0, double x1, double y1, const Color& color) {
        const int steps =
            std::max(1, static_cast<int>(std::ceil(2.0 * std::max(std::abs(x1 - x0), std::abs(y1 - y0)))));
        for (int i = 0; i <= steps; ++i) {
            const double t = static_cast<double>(i) / steps;
            fill(static_cast<int>(std::lround(x0 + t * (x1 - x0))), static_cast<int>(std::lround(y0 + t * (y1 - y0))),
                 1, 1, color);
        }
    }

    void box(int x, int y, int width, int height, const Color& border, const Color& inside) {
        fill(x, y, width, height, border);
        fill(x + 1, y + 1, width - 2, height - 2, inside);
    }

    void text(int x, int y, std::string text, const Color& color = ink) {
        struct Vertex {
            float x, y, z;
            unsigned char color[4];
        };
        std::vector<Vertex> vertices(text.size() * 64 + 64);
        const int quads = stb_easy_font_print(0.0f, 0.0f, text.data(), nullptr, vertices.data(),
                                              static_cast<int>(vertices.size() * sizeof(Vertex)));
        for (int quad = 0; quad < quads; ++quad) {
            const Vertex& low = vertices[static_cast<std::size_t>(4 * quad)];
            const Vertex& high = vertices[static_cast<std::size_t>(4 * quad + 2)];
            fill(x + static_cast<int>(low.x), y + static_cast<int>(low.y), static_cast<int>(high.x - low.x),
                 static_cast<int>(high.y - low.y), color);
        }
    }

    void picture(int x, int y, const Image& picture) {
        for (std::uint32_t row = 0; row < picture.height; ++row) {
            for (std::uint32_t column = 0; column < picture.width; ++column) {
                const float* texel = picture.texel(column, row);
                fill(x + static_cast<int>(column), y + static_cast<int>(row), 1, 1, {texel[0], texel[1], texel[2]});
            }
        }
    }

    Image take() { return std::move(image_); }

  private:
    Image image_;
};

int text_width(const std::string& text) {
    std::string copy = text;
    return stb_easy_font_width(copy.data());
}

// Places of the nodes: leaves side by side, operators above the middle of theirs.
struct TreeLayout {
    std::map<NodeIndex, glm::ivec2> centers;
    int width = 0, height = 0;
};

std::string label_of(const FlattenedTree& tree, NodeIndex index) {
    const materials::Node& node = tree.visible_tree.nodes[index];
    std::string label = node.name.empty() ? node.kind == NodeKind::slab ? fmt::format("slab {}", index)
                                                                        : std::string(name_of(node.kind))
                                          : node.name;
    if (node.kind == NodeKind::mix || node.kind == NodeKind::coverage) label += fmt::format(" {:.2g}", node.amount);
    if (label.size() > 22) label = label.substr(0, 20) + "..";
    return label;
}

int place(const FlattenedTree& tree, NodeIndex index, int depth, TreeLayout& layout) {
    const materials::Node& node = tree.visible_tree.nodes[index];
    const int y = depth * 44 + 12;
    layout.height = std::max(layout.height, y + 14);
    int x = 0;
    if (node.kind == NodeKind::slab) {
        const int width = text_width(label_of(tree, index)) + 24;
        x = layout.width + width / 2;
        layout.width += width;
    } else {
        x = place(tree, node.first, depth + 1, layout);
        if (node.kind != NodeKind::coverage) x = (x + place(tree, node.second, depth + 1, layout)) / 2;
    }
    layout.centers[index] = {x, y};
    return x;
}

void draw_tree(Canvas& canvas, int left, int top, const FlattenedTree& tree, const TreeLayout& layout) {
    for (const auto& [index, center] : layout.centers) {
        const materials::Node& node = tree.visible_tree.nodes[index];
        if (node.kind == NodeKind::slab) continue;
        const auto edge = [&](NodeIndex child) {
            const glm::ivec2 to = layout.centers.at(child);
            canvas.line(left + center.x, top + center.y, left + to.x, top + to.y, faint);
        };
        edge(node.first);
        if (node.kind != NodeKind::coverage) edge(node.second);
    }
    for (const auto& [index, center] : layout.centers) {
        const std::string label = label_of(tree, index);
        const int width = text_width(label) + 12;
        const bool is_slab = tree.visible_tree.nodes[index].kind == NodeKind::slab;
        canvas.box(left + center.x - width / 2, top + center.y - 9, width, 18, ink,
                   is_slab ? Color(1.0f) : Color(0.7f, 0.8f, 0.9f));
        canvas.text(left + center.x - width / 2 + 6, top + center.y - 4, label);
    }
}

void draw_lobe(Canvas& canvas, int left, int top, const materials::ShadedTree& shaded, std::size_t index) {
    const materials::ShadedClosure& c = shaded.closures[index];
    const double radius = plot / 2.0, x = left + radius, y = top + radius;
    canvas.line(left, y, left + plot, y, faint);
    canvas.line(x, y, x - radius * std::sqrt(0.5), y - radius * std::sqrt(0.5), faint);
    materials::closures::Library library;
    double last_x = x, last_y = y;
    for (int i = 0; i <= 360; ++i) {
        const double angle = std::numbers::pi * (i - 180) / 361.0;
        const glm::dvec3 light(std::sin(angle), 0.0, std::cos(angle));
        const auto value = library.evaluate_closure(c.closure, light);
        const glm::dvec3 sum = value.specular + value.diffuse + value.subsurface;
        const double mean = (sum.x + sum.y + sum.z) / 3.0;
        // From 0.001 at the center to 100 at the rim.
        const double length = radius * std::clamp((std::log10(std::max(mean, 1e-3)) + 3.0) / 5.0, 0.0, 1.0);
        const double to_x = x + length * std::sin(angle), to_y = y - length * std::cos(angle);
        if (i > 0) canvas.line(last_x, last_y, to_x, to_y, {0.6f, 0.1f, 0.05f});
        last_x = to_x;
        last_y = to_y;
    }
}

}  // namespace

Image material_sheet(const std::string& title, const FlattenedTree& tree, const std::vector<MaterialSheetStep>& steps) {
    TreeLayout layout;
    place(tree, tree.visible_tree.root, 0, layout);
    const auto shaded = materials::shade(tree, glm::dvec3(-std::sqrt(0.5), 0.0, std::sqrt(0.5)));
    const int plots = static_cast<int>(shaded.closures.size());
    const int columns = std::max({static_cast<int>(steps.size()), plots, 1});
    const int caption_lines = 5;
    const int width = 2 * margin + std::max({columns * cell, layout.width, text_width(title)});
    const int balls_top = margin + 2 * line_height + layout.height + margin;
    const int plots_top = balls_top + cell + caption_lines * line_height;
    const int height = plots_top + plot / 2 + 3 * line_height + margin;
    Canvas canvas(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height));
    canvas.text(margin, margin, title);
    draw_tree(canvas, margin, margin + 2 * line_height, tree, layout);
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const int left = margin + static_cast<int>(i) * cell;
        canvas.picture(left, balls_top, steps[i].ball);
        for (std::size_t line = 0; line < steps[i].captions.size(); ++line)
            canvas.text(left,
                        balls_top + static_cast<int>(steps[i].ball.height) + 6 + static_cast<int>(line) * line_height,
                        steps[i].captions[line]);
    }
    for (int i = 0; i < plots; ++i) {
        const int left = margin + i * cell;
        draw_lobe(canvas, left, plots_top, shaded, static_cast<std::size_t>(i));
        canvas.text(left, plots_top + plot / 2 + 8,
                    label_of(tree, tree.topology.closures[static_cast<std::size_t>(i)].node));
        const glm::dvec3 weight = shaded.closures[static_cast<std::size_t>(i)].path.weight;
        canvas.text(left, plots_top + plot / 2 + 8 + line_height,
                    fmt::format("weight {:.2f} {:.2f} {:.2f}", weight.x, weight.y, weight.z), faint);
    }
    return canvas.take();
}

}  // namespace nacre::command
