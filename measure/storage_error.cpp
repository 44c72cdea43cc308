// SPDX-License-Identifier: Apache-2.0
#include "measure/storage_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>

#include "materials/storage.h"
#include "measure/closure_points.h"
#include "passes/gbuffer_layout.h"

namespace nacre::measure {
namespace {

using materials::StorageCodec;
using materials::StorageFormat;
using materials::StorageValue;

constexpr std::uint32_t dithers = 64;

double dither(std::uint32_t place) { return Library{}.ordered_dither(place % 8, place / 8, 0); }

/// How a field goes to bits and back, and what is promised of it.
struct Field {
    std::string name, where;
    StorageErrorKind kind = StorageErrorKind::absolute;
    std::uint32_t stored_bits = 0, fewest_bits = 2, most_bits = 16, step = 1;
    /// Error of a random number at one place of the dither; the second number of the pair is the signed error of what
    /// is stored, in steps.
    std::function<std::pair<double, double>(std::uint32_t bits, double random, double other, double dither)> trip;
    std::function<double(std::uint32_t bits)> bound;
    bool is_dithered = true;
};

double levels(std::uint32_t bits) { return std::ldexp(1.0, static_cast<int>(bits)) - 1.0; }

// [low, high] in even steps.
Field unit_field(std::string name, std::string where, std::uint32_t bits, double low, double high, bool is_dithered) {
    return {.name = std::move(name),
            .where = std::move(where),
            .stored_bits = bits,
            .trip =
                [=](std::uint32_t b, double random, double, double d) {
                    const StorageFormat format{StorageValue::roughness, "", b, StorageCodec::unit, low, high};
                    const double value = std::lerp(low, high, random);
                    const double back =
                        materials::decode_number(format, b, materials::encode_number(format, b, value, d));
                    return std::pair(std::abs(back - value), (back - value) / (high - low) * levels(b));
                },
            .bound = [=](std::uint32_t b) { return (is_dithered ? 1.0 : 0.5) * (high - low) / levels(b); },
            .is_dithered = is_dithered};
}

// One channel of a color: its square root in even steps. Near white, where a step of the root is two of the color.
Field root_field(std::string name, std::string where, std::uint32_t bits, bool is_dithered) {
    return {.name = std::move(name),
            .where = std::move(where),
            .stored_bits = bits,
            .trip =
                [](std::uint32_t b, double random, double, double d) {
                    Library library;
                    const double root = library.unpack_unit(library.pack_unit(std::sqrt(random), b, d), b);
                    return std::pair(std::abs(root * root - random), (root - std::sqrt(random)) * levels(b));
                },
            .bound =
                [=](std::uint32_t b) {
                    const double step = (is_dithered ? 1.0 : 0.5) / levels(b);
                    return step * (2.0 - step);
                },
            .is_dithered = is_dithered};
}

// `low` to `high` in even steps of the logarithm; with a sign, a bit less.
Field logarithm_field(std::string name, std::string where, const StorageFormat& format, bool is_dithered) {
    const bool has_sign = format.codec == StorageCodec::signed_logarithm;
    const double octaves = std::log2(format.high / format.low);
    const auto steps = [=](std::uint32_t b) { return std::ldexp(1.0, static_cast<int>(has_sign ? b - 1 : b)) - 2.0; };
    return {.name = std::move(name),
            .where = std::move(where),
            .kind = StorageErrorKind::relative,
            .stored_bits = format.bits,
            .fewest_bits = 4,
            .most_bits = 20,
            .trip =
                [=](std::uint32_t b, double random, double other, double d) {
                    const double sign = has_sign && other < 0.5 ? -1.0 : 1.0;
                    const double value = sign * format.low * std::exp2(octaves * random);
                    const double back =
                        materials::decode_number(format, b, materials::encode_number(format, b, value, d));
                    return std::pair(std::abs(back / value - 1.0), std::log2(back / value) / octaves * steps(b));
                },
            .bound = [=](std::uint32_t b) { return std::exp2((is_dithered ? 1.0 : 0.5) * octaves / steps(b)) - 1.0; },
            .is_dithered = is_dithered};
}

Field signed_field(const StorageFormat& format) {
    return {.name = format.name,
            .where = "closure",
            .stored_bits = format.bits,
            .fewest_bits = 3,
            .trip =
                [=](std::uint32_t b, double random, double, double d) {
                    const double value = 2.0 * random - 1.0;
                    const double back =
                        materials::decode_number(format, b, materials::encode_number(format, b, value, d));
                    return std::pair(std::abs(back - value), (back - value) * levels(b - 1));
                },
            .bound = [](std::uint32_t b) { return 1.0 / levels(b - 1); }};
}

// What goes round: behind the point, or half a turn. `period` is its length.
Field circular_field(const StorageFormat& format, double period, StorageErrorKind kind) {
    return {.name = format.name,
            .where = "closure",
            .kind = kind,
            .stored_bits = format.bits,
            .fewest_bits = 3,
            .most_bits = 20,
            .trip =
                [=](std::uint32_t b, double random, double, double) {
                    const double value = period * random;
                    const double back =
                        materials::decode_number(format, b, materials::encode_number(format, b, value, 0.5));
                    const double apart = std::abs(back - value);
                    return std::pair(std::min(apart, period - apart), 0.0);
                },
            .bound = [=](std::uint32_t b) { return std::ldexp(period, -static_cast<int>(b) - 1); },
            .is_dithered = false};
}

Field direction_field(std::string name, std::string where, std::uint32_t bits) {
    return {.name = std::move(name),
            .where = std::move(where),
            .kind = StorageErrorKind::angle,
            .stored_bits = bits,
            .fewest_bits = 6,
            .most_bits = 32,
            .step = 2,
            .trip =
                [](std::uint32_t b, double random, double other, double) {
                    Library library;
                    const glm::dvec3 value = direction(2.0 * random - 1.0, 2.0 * std::numbers::pi * other);
                    const glm::dvec3 back = library.octahedral_decode(
                        library.octahedral_encode(value, static_cast<int>(b / 2)), static_cast<int>(b / 2));
                    return std::pair(2.0 * std::asin(std::min(0.5 * glm::length(back - value), 1.0)), 0.0);
                },
            // Half a step along each coordinate moves a place on a face by sqrt(6) halves of a step, and no place of
            // the octahedron is nearer to its center than 1 / sqrt(3).
            .bound =
                [](std::uint32_t b) {
                    return 0.5 * std::sqrt(18.0) / (std::ldexp(1.0, static_cast<int>(b / 2) - 1) - 1.0);
                },
            .is_dithered = false};
}

// Words of subsurface data: materials/closures/stored_frame.glsl.
Field length_field(const char* name, double octaves, bool is_dithered) {
    const double low = Library::shortest_stored_length;
    return logarithm_field(
        name, "subsurface",
        {StorageValue::medium_transmittance, name, 8, StorageCodec::logarithm, low, low * std::exp2(octaves)},
        is_dithered);
}

void add_format(std::vector<Field>& fields, const StorageFormat& format) {
    const std::string name = format.name;
    switch (format.codec) {
        case StorageCodec::integer: return;
        case StorageCodec::unit:
            fields.push_back(unit_field(name, "closure", format.bits, format.low, format.high,
                                        format.value != StorageValue::occlusion));
            return;
        case StorageCodec::signed_unit: fields.push_back(signed_field(format)); return;
        case StorageCodec::color:
            fields.push_back(root_field(name + ", red and green", "closure", 7, true));
            fields.push_back(root_field(name + ", blue", "closure", 6, true));
            return;
        case StorageCodec::logarithm:
        case StorageCodec::signed_logarithm: fields.push_back(logarithm_field(name, "closure", format, true)); return;
        case StorageCodec::fraction: fields.push_back(circular_field(format, 1.0, StorageErrorKind::absolute)); return;
        case StorageCodec::direction: fields.push_back(direction_field(name, "closure", format.bits)); return;
        case StorageCodec::angle:
            fields.push_back(circular_field(format, std::numbers::pi, StorageErrorKind::angle));
            return;
    }
}

std::vector<Field> all_fields() {
    std::vector<Field> fields;
    for (const StorageFormat& format : materials::storage_formats()) add_format(fields, format);
    fields.push_back(length_field("mean free path", Library::stored_path_octaves, true));
    fields.push_back(length_field("thickness", Library::stored_thickness_octaves, false));
    for (const passes::Field& field : passes::gbuffer_fields()) {
        const std::string name(field.name), where(field.word);
        switch (field.kind) {
            case passes::FieldKind::identifier: break;
            case passes::FieldKind::unorm:
                fields.push_back(unit_field(name, where, field.bits, 0.0, 1.0, false));
                break;
            case passes::FieldKind::squared: fields.push_back(root_field(name, where, field.bits, false)); break;
            case passes::FieldKind::octahedral: fields.push_back(direction_field(name, where, field.bits)); break;
        }
    }
    return fields;
}

StorageErrorPoint measured(const Field& field, std::uint32_t bits, std::uint32_t samples) {
    StorageErrorPoint point{.bits = bits, .bound = field.bound(bits)};
    const std::uint32_t places = field.is_dithered ? dithers : 1;
    // The dither has 64 steps: the mean over them is off by half of one at most.
    if (field.is_dithered) point.dithered_bound = 0.5 / dithers;
    Random random(bits + 1);
    double squares = 0.0;
    for (std::uint32_t i = 0; i < samples; ++i) {
        const double value = i < 2 ? static_cast<double>(i) : random(), other = random();
        double mean = 0.0;
        for (std::uint32_t place = 0; place < places; ++place) {
            const auto [error, steps] = field.trip(bits, value, other, field.is_dithered ? dither(place) : 0.5);
            point.largest = std::max(point.largest, error);
            squares += error * error / places;
            mean += steps / places;
        }
        if (field.is_dithered) point.dithered_mean = std::max(point.dithered_mean, std::abs(mean));
    }
    point.rms = std::sqrt(squares / samples);
    return point;
}

ReportCell text_cell(std::string text) { return {.text = std::move(text)}; }
ReportCell number_cell(std::string text, ReportTone tone = ReportTone::plain) {
    return {.text = std::move(text), .tone = tone, .is_number = true};
}

}  // namespace

std::string_view name_of(StorageErrorKind kind) {
    switch (kind) {
        case StorageErrorKind::absolute: return "absolute";
        case StorageErrorKind::relative: return "relative";
        case StorageErrorKind::angle: return "angle";
    }
    return "unknown";
}

const StorageErrorPoint& StorageErrorCurve::stored() const {
    return *std::ranges::find(points, stored_bits, &StorageErrorPoint::bits);
}

std::vector<StorageErrorCurve> storage_error_curves(std::uint32_t samples) {
    std::vector<StorageErrorCurve> curves;
    for (const Field& field : all_fields()) {
        StorageErrorCurve curve{
            .field = field.name, .where = field.where, .kind = field.kind, .stored_bits = field.stored_bits};
        for (std::uint32_t bits = field.fewest_bits; bits <= field.most_bits; bits += field.step)
            curve.points.push_back(measured(field, bits, samples));
        curves.push_back(std::move(curve));
    }
    return curves;
}

std::string to_json(const std::vector<StorageErrorCurve>& curves) {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (const StorageErrorCurve& curve : curves) {
        nlohmann::ordered_json points = nlohmann::ordered_json::array();
        for (const StorageErrorPoint& point : curve.points)
            points.push_back({{"bits", point.bits},
                              {"largest", point.largest},
                              {"rms", point.rms},
                              {"bound", point.bound},
                              {"dithered_mean_steps", point.dithered_mean}});
        rows.push_back({{"field", curve.field},
                        {"where", curve.where},
                        {"kind", name_of(curve.kind)},
                        {"stored_bits", curve.stored_bits},
                        {"points", std::move(points)}});
    }
    return nlohmann::ordered_json{{"curves", std::move(rows)}}.dump(2) + "\n";
}

ReportPage storage_error_page(const std::vector<StorageErrorCurve>& curves) {
    ReportPage page{.title = "Bits against round-trip error",
                    .subtitle = "Fields of the G-buffer, computed in double precision: the bits alone make the error."};
    ReportTable table{.title = "As stored",
                      .note =
                          "Largest and root mean square error, beside what the codec promises. The mean over the 64 "
                          "places of the dither is in steps of what is stored.",
                      .columns = {"field", "where", "bits", "error", "largest", "bound", "RMS", "mean of the dither"}};
    for (const StorageErrorCurve& curve : curves) {
        const StorageErrorPoint& point = curve.stored();
        table.rows.push_back(
            {text_cell(curve.field), text_cell(curve.where), number_cell(fmt::format("{}", curve.stored_bits)),
             text_cell(std::string(name_of(curve.kind))),
             number_cell(fmt::format("{:.3g}", point.largest),
                         point.largest > point.bound * (1.0 + 1e-9) ? ReportTone::bad : ReportTone::good),
             number_cell(fmt::format("{:.3g}", point.bound)), number_cell(fmt::format("{:.3g}", point.rms)),
             number_cell(point.dithered_bound > 0.0 ? fmt::format("{:.4f}", point.dithered_mean) : "-")});
    }
    page.tables.push_back(std::move(table));
    for (const StorageErrorKind kind :
         {StorageErrorKind::absolute, StorageErrorKind::relative, StorageErrorKind::angle}) {
        ReportPlot plot{.title = fmt::format("Largest error by bits: {}", name_of(kind)),
                        .note = "Fields whose codec, range and dither are the same share a curve.",
                        .low = 1e-7,
                        .high = 10.0,
                        .is_logarithmic = true,
                        .marks = {1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0}};
        std::vector<std::uint32_t> columns;
        for (const StorageErrorCurve& curve : curves)
            if (curve.kind == kind)
                for (const StorageErrorPoint& point : curve.points) columns.push_back(point.bits);
        std::ranges::sort(columns);
        columns.erase(std::ranges::unique(columns).begin(), columns.end());
        for (const std::uint32_t bits : columns) plot.columns.push_back(fmt::format("{}", bits));
        for (const StorageErrorCurve& curve : curves) {
            if (curve.kind != kind) continue;
            // Between the bits that a field can have, and beyond them, the line goes on as it was.
            std::vector<double> values;
            for (const std::uint32_t bits : columns) {
                const auto found =
                    std::ranges::find_if(curve.points, [&](const auto& point) { return point.bits >= bits; });
                values.push_back(found == curve.points.end() ? curve.points.back().largest : found->largest);
            }
            const auto same = std::ranges::find_if(plot.lines, [&](const auto& line) {
                return std::ranges::equal(line.values, values,
                                          [](double a, double b) { return std::abs(a - b) <= 0.02 * b; });
            });
            const std::string name = fmt::format("{} ({})", curve.field, curve.stored_bits);
            if (same == plot.lines.end()) {
                plot.lines.push_back({name, std::move(values)});
            } else if (!same->name.ends_with(", ...")) {
                same->name += ", ...";
            }
        }
        page.plots.push_back(std::move(plot));
    }
    return page;
}

}  // namespace nacre::measure
