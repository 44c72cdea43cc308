// SPDX-License-Identifier: Apache-2.0
#include "measure/closure_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <numbers>

#include "materials/storage.h"
#include "passes/gbuffer_layout.h"

namespace nacre::measure {
namespace {

using materials::StorageCodec;
using materials::StorageField;
using materials::StorageFormat;
using materials::StoredPixel;
using materials::UnpackedMaterial;

std::uint32_t word_at(const TextureData& texture, std::uint64_t index) {
    std::uint32_t word = 0;
    std::memcpy(&word, texture.bytes.data() + 4 * index, 4);
    return word;
}

StoredPixel pixel_at(const MaterialWords& words, std::uint64_t index) {
    StoredPixel pixel{.words = {word_at(words.material_0, index), word_at(words.material_1, index)}};
    for (const TextureData& slice : words.slices) pixel.words.push_back(word_at(slice, index));
    if (!words.slices.empty()) pixel.subsurface = pixel.words.back();
    return pixel;
}

struct Step {
    std::int64_t codes = 0;  // apart
    double distance = 0.0;   // share of the field's range
};

Step part(std::uint32_t a, std::uint32_t b, std::uint32_t shift, std::uint32_t bits) {
    const std::uint32_t mask = (1u << bits) - 1u;
    const auto codes =
        std::abs(static_cast<std::int64_t>(a >> shift & mask) - static_cast<std::int64_t>(b >> shift & mask));
    return {codes, static_cast<double>(codes) / mask};
}

Step largest(std::initializer_list<Step> steps) {
    return std::ranges::max(steps, {}, &Step::codes);
}

Step step_of(const StorageFormat& format, std::uint32_t bits, std::uint32_t a, std::uint32_t b) {
    switch (format.codec) {
        case StorageCodec::color: return largest({part(a, b, 0, 7), part(a, b, 7, 7), part(a, b, 14, 6)});
        case StorageCodec::direction: return largest({part(a, b, 0, bits / 2), part(a, b, bits / 2, bits / 2)});
        case StorageCodec::angle:
        case StorageCodec::fraction: {
            // Both go round.
            const Step straight = part(a, b, 0, bits);
            return {std::min(straight.codes, (std::int64_t{1} << bits) - straight.codes), straight.distance};
        }
        case StorageCodec::integer: {
            const Step apart = part(a, b, 0, bits);
            return {apart.codes == 0 ? 0 : 2, apart.distance};
        }
        default: return part(a, b, 0, bits);
    }
}

Expected<void> check_sizes(const MaterialWords& reference, const MaterialWords& test) {
    const std::uint64_t texels = reference.material_0.texels();
    const auto fits = [&](const MaterialWords& words) {
        const auto holds = [&](const TextureData& texture) { return texture.bytes.size() >= 4 * texels; };
        return holds(words.material_0) && holds(words.material_1) && std::ranges::all_of(words.slices, holds);
    };
    if (fits(reference) && fits(test)) return {};
    return fail(ErrorCode::invalid_argument, "compare closures", "", "the material words are of different sizes",
                "Compare pictures of one size.");
}

bool holds_closures(const MaterialWords& words, std::uint64_t index) {
    static const passes::Field pixel_class =
        *std::ranges::find(passes::gbuffer_fields(), "pixel_class", &passes::Field::name);
    return passes::field_bits(pixel_class, word_at(words.material_0, index)) ==
           static_cast<std::uint32_t>(passes::PixelClass::closures);
}

bool is_same_topology(const UnpackedMaterial& a, const UnpackedMaterial& b) {
    return std::ranges::equal(a.fields, b.fields, [](const StorageField& x, const StorageField& y) {
        return x.value == y.value && x.offset == y.offset;
    });
}

bool has_subsurface(const UnpackedMaterial& material) {
    return std::ranges::any_of(material.closures, [](const materials::UnpackedClosure& closure) {
        return closure.medium == materials::StoredMedium::subsurface;
    });
}

/// The errors of all kinds of fields, in the order in which they come up.
class ErrorSums {
  public:
    void add(const std::string& field, std::uint32_t x, std::uint32_t y, double reference, double value, double error,
             std::uint32_t word) {
        const auto [place, is_new] = places_.try_emplace(field, errors_.size());
        if (is_new) errors_.push_back({.texture = "material.slices", .largest = {.name = field}});
        add_wrong_value(errors_[place->second], {.x = x,
                                                 .y = y,
                                                 .name = field,
                                                 .reference = reference,
                                                 .value = value,
                                                 .stored = static_cast<double>(static_cast<std::int32_t>(word)),
                                                 .error = error});
    }

    // One field of a closure, by the codes of both devices.
    void add(const StorageField& field, std::uint32_t x, std::uint32_t y, std::uint32_t a, std::uint32_t b,
             std::uint32_t word) {
        const StorageFormat& format = materials::storage_format(field.value);
        materials::closures::Library library;
        switch (format.codec) {
            case StorageCodec::integer: return;
            case StorageCodec::color: {
                const glm::dvec3 from = library.unpack_color(a), to = library.unpack_color(b);
                for (int channel = 0; channel < 3; ++channel) {
                    add(fmt::format("{}.{}", format.name, "rgb"[channel]), x, y, from[channel], to[channel],
                        std::abs(to[channel] - from[channel]), word);
                }
                return;
            }
            case StorageCodec::direction: {
                const auto bits = static_cast<int>(field.bits / 2);
                const glm::dvec3 from = library.octahedral_decode(a, bits), to = library.octahedral_decode(b, bits);
                add(format.name, x, y, 1.0, 1.0, 2.0 * std::asin(std::min(0.5 * glm::length(to - from), 1.0)), word);
                return;
            }
            default: break;
        }
        const double from = materials::decode_number(format, field.bits, a),
                     to = materials::decode_number(format, field.bits, b);
        double error = std::abs(to - from);
        if (format.codec == StorageCodec::angle) error = std::min(error, std::numbers::pi - error);
        if (format.codec == StorageCodec::fraction) error = std::min(error, 1.0 - error);
        add(format.name, x, y, from, to, error, word);
    }

    void add_flip() { ++flips_; }

    std::vector<NumericalError> take() {
        if (!errors_.empty()) errors_.front().flips = flips_;
        return std::move(errors_);
    }

  private:
    std::vector<NumericalError> errors_;
    std::map<std::string, std::size_t> places_;
    std::uint64_t flips_ = 0;
};

}  // namespace

Expected<std::vector<NumericalError>> closure_errors(const MaterialWords& reference, const MaterialWords& test) {
    NACRE_CHECK(check_sizes(reference, test));
    ErrorSums sums;
    for (std::uint64_t i = 0; i < reference.material_0.texels(); ++i) {
        if (!holds_closures(reference, i) || !holds_closures(test, i)) continue;
        const auto x = static_cast<std::uint32_t>(i % reference.material_0.width),
                   y = static_cast<std::uint32_t>(i / reference.material_0.width);
        const StoredPixel a = pixel_at(reference, i), b = pixel_at(test, i);
        const auto from = materials::unpack_pixel(a), to = materials::unpack_pixel(b);
        if (!from || !to || !is_same_topology(*from, *to)) {
            sums.add_flip();
            continue;
        }
        for (std::size_t f = 0; f < from->fields.size(); ++f)
            sums.add(from->fields[f], x, y, from->codes[f], to->codes[f], b.words[from->fields[f].offset / 32]);
        if (!has_subsurface(*from)) continue;
        materials::closures::Library library;
        const glm::dvec3 path_a = library.unpack_mean_free_path(a.subsurface),
                         path_b = library.unpack_mean_free_path(b.subsurface);
        for (int channel = 0; channel < 3; ++channel) {
            sums.add(fmt::format("mean free path.{}", "rgb"[channel]), x, y, path_a[channel], path_b[channel],
                     std::abs(path_b[channel] - path_a[channel]), b.subsurface);
        }
        const double thickness_a = library.unpack_thickness(a.subsurface),
                     thickness_b = library.unpack_thickness(b.subsurface);
        sums.add("thickness", x, y, thickness_a, thickness_b, std::abs(thickness_b - thickness_a), b.subsurface);
    }
    return sums.take();
}

Expected<ClosureDifference> compare_closures(const MaterialWords& reference, const MaterialWords& test) {
    NACRE_CHECK(check_sizes(reference, test));
    const std::uint64_t texels = reference.material_0.texels();
    ClosureDifference result{.difference = {.name = "material.slices", .texels = texels},
                             .is_closure = std::vector<bool>(texels)};
    std::map<std::string, FieldDifference> fields;
    for (std::uint64_t i = 0; i < texels; ++i) {
        if (!holds_closures(reference, i) || !holds_closures(test, i)) continue;
        result.is_closure[i] = true;
        const StoredPixel a = pixel_at(reference, i), b = pixel_at(test, i);
        const auto material_a = materials::unpack_pixel(a), material_b = materials::unpack_pixel(b);
        bool differs = false, is_equal = true;
        const auto note = [&](const char* name, const Step& step) {
            FieldDifference& field = fields.try_emplace(name, FieldDifference{.name = name}).first->second;
            is_equal &= step.codes == 0;
            differs |= step.codes > 1;
            field.differing += step.codes > 1;
            field.max_abs = std::max(field.max_abs, step.distance);
            result.difference.max_abs = std::max(result.difference.max_abs, step.distance);
        };
        if (!material_a || !material_b || !is_same_topology(*material_a, *material_b)) {
            note("topology", {2, 1.0});
        } else {
            for (std::size_t f = 0; f < material_a->fields.size(); ++f) {
                const StorageFormat& format = materials::storage_format(material_a->fields[f].value);
                note(format.name,
                     step_of(format, material_a->fields[f].bits, material_a->codes[f], material_b->codes[f]));
            }
            if (has_subsurface(*material_a)) {
                for (std::uint32_t shift = 0; shift < 32; shift += 8) {
                    note("subsurface", part(a.subsurface, b.subsurface, shift, 8));
                }
            }
        }
        result.difference.differing += !is_equal;
        result.difference.fields_differing += differs;
    }
    result.difference.max_rel = result.difference.max_abs;
    for (auto& [name, field] : fields) result.difference.fields.push_back(std::move(field));
    return result;
}

}  // namespace nacre::measure
