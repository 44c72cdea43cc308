// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/image.h"

/// @file
/// One HTML file with everything in it (pictures as data URIs, style and script inline): figures as tables, pictures
/// side by side, difference pictures, and a viewer that lays any two pictures over each other.
///
///     ReportPage page{.title = "builtin:spheres"};
///     page.pictures.push_back({"vulkan", "llvmpipe, 12 ms", picture});
///     NACRE_CHECK(write_report_page("out/index.html", page));

namespace nacre::measure {

/// How a table cell or caption is to be read.
enum class ReportTone { plain, good, bad };

struct ReportCell {
    std::string text;
    ReportTone tone = ReportTone::plain;
    bool is_number = false;  ///< Set flush right, with digits of one width.
    double bar = 0.0;        ///< A bar behind the text, share of the column's width, [0, 1].
};

struct ReportTable {
    std::string title;
    std::string note;  ///< A sentence below the title; may be empty.
    std::vector<std::string> columns;
    std::vector<std::vector<ReportCell>> rows;
    bool is_folded = false;  ///< Shown only when the reader opens it.
};

struct ReportPicture {
    std::string name;     ///< In the viewer's lists; unique on the page.
    std::string caption;  ///< Below the picture.
    ImageBytes picture;   ///< 8 bits, sRGB.
};

/// A headed row of pictures.
struct ReportGallery {
    std::string title;
    std::string note;
    std::vector<ReportPicture> pictures;
};

/// A drawing of figures on a linear or logarithmic axis; stands between tables and pictures.
struct ReportPlot {
    struct Bar {
        std::string name;
        double low = 0.0, high = 0.0;
        ReportTone tone = ReportTone::plain;
    };
    struct Line {
        std::string name;
        std::vector<double> values;  ///< One for each of `columns`.
    };
    std::string title;
    std::string note;
    double low = 0.0, high = 1.0;      ///< Ends of the axis; what is beyond is drawn at the end.
    bool is_logarithmic = false;       ///< Then both are above 0.
    std::vector<double> marks;         ///< Where the axis has a line and a number.
    std::vector<Bar> bars;             ///< One below the other, from low to high: or
    std::vector<std::string> columns;  ///< lines over these.
    std::vector<Line> lines;
};

struct ReportPage {
    std::string title;
    std::string subtitle;
    std::vector<std::string> facts;      ///< Short labels below the title: "1280 x 720", "profile high".
    ReportTone tone = ReportTone::plain; ///< Of the verdict.
    std::string verdict;                 ///< One sentence; empty: none.
    std::vector<ReportTable> tables;     ///< Before the pictures.
    std::vector<ReportPlot> plots;       ///< After the tables.
    std::vector<ReportPicture> pictures; ///< Side by side, and in the viewer.
    std::vector<ReportGallery>
        galleries;  ///< Further pictures; also in the viewer where they have the size of the first.
    std::vector<ReportTable> details;    ///< After the pictures.
};

/// The page as text. All texts are escaped. Errors: those of `encode_png`.
Expected<std::string> report_page_html(const ReportPage& page);

/// Writes it; folders on the way are made. Errors: those of `encode_png`, input_output.
Expected<void> write_report_page(const std::filesystem::path& file, const ReportPage& page);

}  // namespace nacre::measure
