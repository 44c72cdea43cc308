// SPDX-License-Identifier: Apache-2.0
#include "measure/texture_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "measure/texel_decoding.h"

namespace nacre::measure {
namespace {

std::uint32_t mask_of(std::uint32_t bits) { return bits >= 32 ? 0xffffffffu : (1u << bits) - 1; }

std::uint32_t code_of(const BitField& field, std::uint32_t word) { return word >> field.shift & mask_of(field.bits); }

std::int64_t sign_extend(std::uint32_t code, std::uint32_t bits) {
    const std::int64_t half = std::int64_t{1} << (bits - 1);
    return code >= half ? std::int64_t{code} - 2 * half : std::int64_t{code};
}

// Unit direction of octahedral coordinates in [-1, 1] (Cigolle et al. 2014, "A Survey of Efficient Representations for
// Independent Unit Vectors").
void direction_of(double u, double v, double (&direction)[3]) {
    double x = u, y = v;
    const double z = 1.0 - std::abs(u) - std::abs(v);
    if (z < 0.0) {
        x = (1.0 - std::abs(v)) * (u >= 0.0 ? 1.0 : -1.0);
        y = (1.0 - std::abs(u)) * (v >= 0.0 ? 1.0 : -1.0);
    }
    const double length = std::sqrt(x * x + y * y + z * z);
    direction[0] = x / length;
    direction[1] = y / length;
    direction[2] = z / length;
}

// Largest magnitude of an octahedral coordinate's code once its offset is taken away.
std::int64_t half_range_of(const BitField& field) { return (std::int64_t{1} << (field.bits / 2 - 1)) - 1; }

void direction_of_codes(const BitField& field, std::int64_t x, std::int64_t y, double (&direction)[3]) {
    const auto half_range = static_cast<double>(half_range_of(field));
    direction_of(double(x) / half_range - 1.0, double(y) / half_range - 1.0, direction);
}

double angle_between(const double (&a)[3], const double (&b)[3]) {
    // The chord keeps its precision for the tiny angles that matter here; acos of the cosine does not.
    const double chord = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    return 2.0 * std::asin(std::min(1.0, chord / 2.0));
}

struct FieldStep {
    bool differs = false;   ///< By more than one quantization step.
    double distance = 0.0;  ///< Of the decoded values.
    double relative = 0.0;
};

// Across the fold of the octahedral map (the lower hemisphere's border) neighbors on the sphere have far codes. There
// the angle decides: it may be as large as the largest to one of the eight neighboring codes.
FieldStep compare_octahedral(const BitField& field, std::uint32_t word_a, std::uint32_t word_b) {
    const std::uint32_t half = field.bits / 2;
    const std::int64_t largest = 2 * half_range_of(field);
    const std::uint32_t code_a = code_of(field, word_a), code_b = code_of(field, word_b);
    const auto xa = static_cast<std::int64_t>(code_a & mask_of(half)), ya = static_cast<std::int64_t>(code_a >> half);
    const auto xb = static_cast<std::int64_t>(code_b & mask_of(half)), yb = static_cast<std::int64_t>(code_b >> half);
    double a[3], b[3];
    decode_octahedral(field, word_a, a);
    decode_octahedral(field, word_b, b);
    const double angle = angle_between(a, b);
    if (std::abs(xa - xb) <= 1 && std::abs(ya - yb) <= 1) return {false, angle, angle / std::numbers::pi};
    double step = 0.0;
    for (std::int64_t dy = -1; dy <= 1; ++dy) {
        for (std::int64_t dx = -1; dx <= 1; ++dx) {
            const std::int64_t x = xa + dx, y = ya + dy;
            if (x < 0 || y < 0 || x > largest || y > largest) continue;
            double neighbor[3];
            direction_of_codes(field, x, y, neighbor);
            step = std::max(step, angle_between(a, neighbor));
        }
    }
    return {angle > step * 1.001, angle, angle / std::numbers::pi};
}

FieldStep compare_field(const BitField& field, std::uint32_t word_a, std::uint32_t word_b) {
    if (field.kind == FieldKind::octahedral) return compare_octahedral(field, word_a, word_b);
    const std::uint32_t code_a = code_of(field, word_a), code_b = code_of(field, word_b);
    const double a = decode_field(field, word_a), b = decode_field(field, word_b);
    FieldStep step;
    step.distance = std::abs(a - b);
    std::int64_t codes = std::abs(std::int64_t{code_a} - std::int64_t{code_b});
    switch (field.kind) {
        case FieldKind::uint: step.differs = codes != 0; break;
        case FieldKind::unorm:
        case FieldKind::squared:
        case FieldKind::ufloat: step.differs = codes > 1; break;
        case FieldKind::snorm:
            step.differs = std::abs(sign_extend(code_a, field.bits) - sign_extend(code_b, field.bits)) > 1;
            break;
        case FieldKind::circular: {
            const std::int64_t around = (std::int64_t{1} << field.bits) - codes;
            step.differs = std::min(codes, around) > 1;
            step.distance = std::min(step.distance, 1.0 - step.distance);
            break;
        }
        case FieldKind::octahedral: break;
    }
    const double scale = std::max(std::abs(a), std::abs(b));
    step.relative = scale > 0.0 ? step.distance / scale : 0.0;
    return step;
}

Expected<void> check_texture(const TextureData& texture) {
    const auto wrong = [&](ErrorCode code, std::string reason) {
        return fail(code, "compare textures", fmt::format("'{}'", texture.name), std::move(reason));
    };
    const rhi::FormatInfo& format = rhi::info(texture.format);
    if (texture.format == rhi::Format::undefined) return wrong(ErrorCode::invalid_argument, "its format is undefined");
    if (format.is_compressed()) {
        return wrong(ErrorCode::unsupported, fmt::format("format {} is block-compressed", format.name));
    }
    if (texture.bytes.size() != texture.texels() * format.block_bytes) {
        return wrong(ErrorCode::invalid_argument,
                     fmt::format("{} x {} x {} texels of {} need {} bytes; there are {}", texture.width,
                                 texture.height, texture.layers, format.name, texture.texels() * format.block_bytes,
                                 texture.bytes.size()));
    }
    for (const BitField& field : texture.fields) {
        const bool fits = field.bits >= 1 && field.bits <= 32 && field.shift < 32 && field.shift + field.bits <= 32 &&
                          field.channel < format.channels && format.block_bytes == 4 * format.channels;
        const bool even = field.kind != FieldKind::octahedral || (field.bits % 2 == 0 && field.bits >= 4);
        if (!fits || !even || (field.kind == FieldKind::snorm && field.bits < 2)) {
            return wrong(ErrorCode::invalid_argument,
                         fmt::format("field '{}' ({} bits at bit {} of channel {}) does not fit format {}", field.name,
                                     field.bits, field.shift, field.channel, format.name));
        }
    }
    return {};
}

Expected<void> check_pair(const TextureData& a, const TextureData& b) {
    NACRE_CHECK(check_texture(a));
    NACRE_CHECK(check_texture(b));
    if (a.format == b.format && a.width == b.width && a.height == b.height && a.layers == b.layers &&
        a.fields.size() == b.fields.size()) {
        return {};
    }
    return fail(ErrorCode::invalid_argument, "compare textures", fmt::format("'{}'", a.name),
                fmt::format("one is {} x {} x {} of {}, the other {} x {} x {} of {}", a.width, a.height, a.layers,
                            rhi::info(a.format).name, b.width, b.height, b.layers, rhi::info(b.format).name));
}

std::uint32_t word_of(const TextureData& texture, std::uint64_t index, std::uint32_t channel) {
    std::uint32_t word = 0;
    const std::size_t stride = rhi::info(texture.format).block_bytes;
    std::memcpy(&word, texture.bytes.data() + index * stride + std::size_t{4} * channel, 4);
    return word;
}

bool bits_equal(const TextureData& a, const TextureData& b, std::uint64_t index) {
    const std::size_t stride = rhi::info(a.format).block_bytes;
    return std::memcmp(a.bytes.data() + index * stride, b.bytes.data() + index * stride, stride) == 0;
}

void compare_channels(const TextureData& a, const TextureData& b, std::uint64_t index, TextureDifference& result) {
    double va[4], vb[4];
    decode_texel(a, index, va);
    decode_texel(b, index, vb);
    for (int c = 0; c < 4; ++c) {
        if (va[c] == vb[c] || (std::isnan(va[c]) && std::isnan(vb[c]))) continue;
        if (!std::isfinite(va[c]) || !std::isfinite(vb[c])) {
            result.max_abs = result.max_rel = std::numeric_limits<double>::infinity();
            continue;
        }
        const double distance = std::abs(va[c] - vb[c]);
        result.max_abs = std::max(result.max_abs, distance);
        result.max_rel = std::max(result.max_rel, distance / std::max(std::abs(va[c]), std::abs(vb[c])));
    }
}

bool compare_fields(const TextureData& a, const TextureData& b, std::uint64_t index, TextureDifference& result) {
    bool any = false;
    for (std::size_t f = 0; f < a.fields.size(); ++f) {
        const BitField& field = a.fields[f];
        const FieldStep step =
            compare_field(field, word_of(a, index, field.channel), word_of(b, index, field.channel));
        result.fields[f].differing += step.differs;
        result.fields[f].max_abs = std::max(result.fields[f].max_abs, step.distance);
        result.max_abs = std::max(result.max_abs, step.distance);
        result.max_rel = std::max(result.max_rel, step.relative);
        any |= step.differs;
    }
    return any;
}

}  // namespace

std::string_view name_of(FieldKind kind) {
    switch (kind) {
        case FieldKind::uint: return "uint";
        case FieldKind::unorm: return "unorm";
        case FieldKind::squared: return "squared";
        case FieldKind::snorm: return "snorm";
        case FieldKind::ufloat: return "ufloat";
        case FieldKind::circular: return "circular";
        case FieldKind::octahedral: return "octahedral";
    }
    return "unknown";
}

double decode_field(const BitField& field, std::uint32_t word) {
    const std::uint32_t code = code_of(field, word);
    switch (field.kind) {
        case FieldKind::uint:
        case FieldKind::ufloat: return code;
        case FieldKind::unorm: return double(code) / double(mask_of(field.bits));
        case FieldKind::squared: {
            const double root = double(code) / double(mask_of(field.bits));
            return root * root;
        }
        case FieldKind::snorm:
            return std::max(-1.0, double(sign_extend(code, field.bits)) / double(mask_of(field.bits - 1)));
        case FieldKind::circular: return std::ldexp(double(code), -static_cast<int>(field.bits));
        case FieldKind::octahedral: return 0.0;
    }
    return 0.0;
}

void decode_octahedral(const BitField& field, std::uint32_t word, double (&direction)[3]) {
    const std::uint32_t half = field.bits / 2;
    const std::uint32_t code = code_of(field, word);
    direction_of_codes(field, code & mask_of(half), code >> half, direction);
}

Expected<TextureDifference> compare_textures(const TextureData& reference, const TextureData& test) {
    NACRE_CHECK(check_pair(reference, test));
    TextureDifference result{.name = reference.name, .texels = reference.texels()};
    for (const BitField& field : reference.fields) result.fields.push_back({.name = field.name});
    for (std::uint64_t index = 0; index < result.texels; ++index) {
        if (bits_equal(reference, test, index)) continue;
        ++result.differing;
        if (reference.fields.empty()) compare_channels(reference, test, index, result);
        else result.fields_differing += compare_fields(reference, test, index, result);
    }
    return result;
}

void decode_texel(const TextureData& texture, std::uint64_t index, double (&channels)[4]) {
    decode_format(texture.format, texture.bytes.data() + index * rhi::info(texture.format).block_bytes, channels);
}

Expected<Image> picture_of(const TextureData& texture) {
    NACRE_CHECK(check_texture(texture));
    Image image{texture.width, texture.height, 3, {}};
    image.pixels.resize(image.texel_count() * 3);
    const rhi::FormatInfo& format = rhi::info(texture.format);
    const bool is_range = texture.fields.empty() && (format.is_integer() || format.has_depth || format.channels == 1);
    double smallest = std::numeric_limits<double>::infinity(), largest = -smallest;
    for (std::size_t p = 0; p < image.texel_count(); ++p) {
        double values[4] = {};
        if (texture.fields.empty()) {
            decode_texel(texture, p, values);
            // Depth with stencil shows the depth; one channel is gray.
            if (format.has_depth || format.channels == 1) values[1] = values[2] = values[0];
        } else {
            for (std::size_t f = 0; f < std::min<std::size_t>(texture.fields.size(), 3); ++f) {
                const BitField& field = texture.fields[f];
                const std::uint32_t word = word_of(texture, p, field.channel);
                if (field.kind == FieldKind::octahedral && f == 0) {
                    double direction[3];
                    decode_octahedral(field, word, direction);
                    for (int c = 0; c < 3; ++c) values[c] = 0.5 + 0.5 * direction[c];
                    break;
                }
                const bool is_code = field.kind == FieldKind::uint || field.kind == FieldKind::ufloat;
                values[f] = decode_field(field, word) / (is_code ? double(mask_of(field.bits)) : 1.0);
            }
        }
        for (std::size_t c = 0; c < 3; ++c) {
            image.pixels[p * 3 + c] = static_cast<float>(values[c]);
            if (is_range && std::isfinite(values[c])) {
                smallest = std::min(smallest, values[c]);
                largest = std::max(largest, values[c]);
            }
        }
    }
    if (is_range && largest > smallest) {
        for (float& value : image.pixels) value = static_cast<float>((double(value) - smallest) / (largest - smallest));
    }
    return image;
}

Expected<Image> difference_mask(const TextureData& reference, const TextureData& test) {
    NACRE_CHECK(check_pair(reference, test));
    Image image{reference.width, reference.height, 1, {}};
    image.pixels.resize(image.texel_count());
    TextureDifference scratch;
    scratch.fields.resize(reference.fields.size());
    for (std::size_t p = 0; p < image.texel_count(); ++p) {
        if (bits_equal(reference, test, p)) continue;
        image.pixels[p] = reference.fields.empty() || compare_fields(reference, test, p, scratch) ? 1.0f : 0.0f;
    }
    return image;
}

Expected<ImageLayer> exr_layer_of(const TextureData& texture) {
    NACRE_CHECK(check_texture(texture));
    static constexpr const char* color_names[4] = {"R", "G", "B", "A"};
    const rhi::FormatInfo& format = rhi::info(texture.format);
    const bool is_word = format.kind == rhi::FormatKind::uint && format.block_bytes == 4 * format.channels;
    const std::size_t count = std::size_t{texture.width} * texture.height;
    ImageLayer layer{texture.name, {}};
    for (std::uint32_t c = 0; c < format.channels; ++c) {
        const std::string name = format.has_depth       ? (c == 0 ? "Z" : "stencil")
                                 : format.channels == 1 ? "Y"
                                                        : color_names[c];
        if (is_word) {
            std::vector<std::uint32_t> values(count);
            for (std::size_t p = 0; p < count; ++p) values[p] = word_of(texture, p, c);
            layer.channels.push_back({name, std::move(values)});
        } else {
            std::vector<float> values(count);
            for (std::size_t p = 0; p < count; ++p) {
                double texel[4];
                decode_texel(texture, p, texel);
                values[p] = static_cast<float>(texel[c]);
            }
            layer.channels.push_back({name, std::move(values)});
        }
    }
    return layer;
}

}  // namespace nacre::measure
