// SPDX-License-Identifier: Apache-2.0
#include "measure/closure_comparison.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>

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
    const auto codes = std::abs(static_cast<std::int64_t>(a >> shift & mask) - static_cast<std::int64_t>(b >> shift & mask));
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

}  // namespace

Expected<ClosureDifference> compare_closures(const MaterialWords& reference, const MaterialWords& test) {
    const std::uint64_t texels = reference.material_0.texels();
    const auto fits = [&](const MaterialWords& words) {
        const auto holds = [&](const TextureData& texture) { return texture.bytes.size() >= 4 * texels; };
        return holds(words.material_0) && holds(words.material_1) && std::ranges::all_of(words.slices, holds);
    };
    if (!fits(reference) || !fits(test)) {
        return fail(ErrorCode::invalid_argument, "compare closures", "", "the material words are of different sizes",
                    "Compare pictures of one size.");
    }
    const passes::Field pixel_class = *std::ranges::find(passes::gbuffer_fields(), "pixel_class", &passes::Field::name);
    const auto closures = static_cast<std::uint32_t>(passes::PixelClass::closures);
    ClosureDifference result{.difference = {.name = "material.slices", .texels = texels},
                             .is_closure = std::vector<bool>(texels)};
    std::map<std::string, FieldDifference> fields;
    for (std::uint64_t i = 0; i < texels; ++i) {
        if (passes::field_bits(pixel_class, word_at(reference.material_0, i)) != closures ||
            passes::field_bits(pixel_class, word_at(test.material_0, i)) != closures) {
            continue;
        }
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
        const auto same_place = [](const StorageField& x, const StorageField& y) {
            return x.value == y.value && x.offset == y.offset;
        };
        if (!material_a || !material_b || !std::ranges::equal(material_a->fields, material_b->fields, same_place)) {
            note("topology", {2, 1.0});
        } else {
            for (std::size_t f = 0; f < material_a->fields.size(); ++f) {
                const StorageFormat& format = materials::storage_format(material_a->fields[f].value);
                note(format.name, step_of(format, material_a->fields[f].bits, material_a->codes[f], material_b->codes[f]));
            }
            const bool has_subsurface = std::ranges::any_of(material_a->closures, [](const auto& closure) {
                return closure.medium == materials::StoredMedium::subsurface;
            });
            if (has_subsurface) {
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
