// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "core/image_formats.h"

// Radiance pictures (Ward, "Real Pixels", Graphics Gems II; file format as in the Radiance reference manual): a text
// header, a line with the size, then rows of shared-exponent texels, plain or run-length encoded per component.
// EXPOSURE lines are not applied, as in every common reader.

namespace nacre::image_formats {
namespace {

constexpr ImageFormat format = ImageFormat::radiance;

struct RadianceHeader {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::size_t pixels_at = 0;
};

class Reader {
  public:
    explicit Reader(std::span<const std::byte> data, std::size_t position = 0) : data_(data), position_(position) {}
    [[nodiscard]] std::size_t position() const { return position_; }
    [[nodiscard]] std::size_t left() const { return data_.size() - position_; }
    std::uint8_t byte() { return static_cast<std::uint8_t>(data_[position_++]); }
    [[nodiscard]] std::uint8_t peek(std::size_t offset) const {
        return static_cast<std::uint8_t>(data_[position_ + offset]);
    }
    std::optional<std::string_view> line() {
        const std::size_t start = position_;
        while (position_ < data_.size() && data_[position_] != std::byte{'\n'}) ++position_;
        if (position_ == data_.size()) return std::nullopt;
        ++position_;
        return std::string_view(reinterpret_cast<const char*>(data_.data()) + start, position_ - start - 1);
    }

  private:
    std::span<const std::byte> data_;
    std::size_t position_;
};

std::optional<std::uint32_t> parse_number(std::string_view& text, std::string_view prefix) {
    if (!text.starts_with(prefix)) return std::nullopt;
    text.remove_prefix(prefix.size());
    std::uint32_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{}) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    return value;
}

Expected<RadianceHeader> read_header(std::span<const std::byte> data, const std::string& subject) {
    Reader reader(data);
    for (;;) {
        const std::optional<std::string_view> line = reader.line();
        if (!line) return damaged(format, subject, "the header does not end");
        if (line->empty()) break;
        if (line->starts_with("FORMAT=") && *line != "FORMAT=32-bit_rle_rgbe") {
            return fail(ErrorCode::unsupported, "read picture", subject,
                        fmt::format("its pixels are '{}'; only 32-bit_rle_rgbe is read", line->substr(7)),
                        "Convert it to RGBE.");
        }
    }
    const std::optional<std::string_view> size = reader.line();
    if (!size) return damaged(format, subject, "the line with the size is missing");
    std::string_view text = *size;
    const std::optional<std::uint32_t> height = parse_number(text, "-Y ");
    const std::optional<std::uint32_t> width = height ? parse_number(text, " +X ") : std::nullopt;
    if (!width) {
        return damaged(format, subject,
                       fmt::format("the size line reads '{}'; expected '-Y <height> +X <width>'", size->substr(0, 40)));
    }
    return RadianceHeader{*width, *height, reader.position()};
}

using Rgbe = std::array<std::uint8_t, 4>;

// The run-length form of 1991: 2, 2, width (big-endian), then the four components one after the other.
Expected<void> read_packed_row(Reader& reader, std::span<Rgbe> row, const std::string& subject, std::uint32_t y) {
    for (int i = 0; i < 4; ++i) reader.byte();
    for (std::size_t component = 0; component < 4; ++component) {
        for (std::size_t x = 0; x < row.size();) {
            if (reader.left() < 2) return damaged(format, subject, fmt::format("the file ends inside row {}", y));
            const unsigned code = reader.byte();
            const bool is_run = code > 128;
            const std::size_t count = is_run ? code - 128 : code;
            if (count == 0 || count > row.size() - x) {
                return damaged(format, subject, fmt::format("row {} has a run of {} with {} pixels left", y, count,
                                                            row.size() - x));
            }
            if (!is_run && reader.left() < count) {
                return damaged(format, subject, fmt::format("the file ends inside row {}", y));
            }
            const std::uint8_t run_value = is_run ? reader.byte() : std::uint8_t{0};
            for (std::size_t i = 0; i < count; ++i) row[x++][component] = is_run ? run_value : reader.byte();
        }
    }
    return {};
}

// Plain texels, with the older form of runs: (1, 1, 1, n) repeats the texel before it, shifted for each in sequence.
Expected<void> read_plain_row(Reader& reader, std::span<Rgbe> row, const std::string& subject, std::uint32_t y) {
    unsigned shift = 0;
    for (std::size_t x = 0; x < row.size();) {
        if (reader.left() < 4) return damaged(format, subject, fmt::format("the file ends inside row {}", y));
        const Rgbe texel{reader.byte(), reader.byte(), reader.byte(), reader.byte()};
        if (texel[0] == 1 && texel[1] == 1 && texel[2] == 1) {
            const std::size_t count = shift < 32 ? std::size_t{texel[3]} << shift : 0;
            if (x == 0 || count == 0 || count > row.size() - x) {
                return damaged(format, subject, fmt::format("row {} has a run of {} at pixel {}", y, count, x));
            }
            const Rgbe previous = row[x - 1];
            for (std::size_t i = 0; i < count; ++i) row[x++] = previous;
            shift += 8;
        } else {
            row[x++] = texel;
            shift = 0;
        }
    }
    return {};
}

}  // namespace

Expected<ImageInfo> radiance_info(std::span<const std::byte> data, const std::string& subject) {
    NACRE_TRY(const RadianceHeader header, read_header(data, subject));
    return ImageInfo{format, header.width, header.height, 3, 32};
}

Expected<Image> decode_radiance(std::span<const std::byte> data, const std::string& subject) {
    NACRE_TRY(const RadianceHeader header, read_header(data, subject));
    Reader reader(data, header.pixels_at);
    Image image{header.width, header.height, 3, {}};
    std::vector<Rgbe> row(header.width);
    for (std::uint32_t y = 0; y < header.height; ++y) {
        const bool packed = header.width >= 8 && header.width < 32768 && reader.left() >= 4 && reader.peek(0) == 2 &&
                            reader.peek(1) == 2 && (reader.peek(2) << 8 | reader.peek(3)) == int(header.width);
        NACRE_CHECK(packed ? read_packed_row(reader, row, subject, y) : read_plain_row(reader, row, subject, y));
        // The picture grows row by row, so a short file that claims a huge size takes little memory.
        for (const Rgbe& texel : row) {
            const float scale = texel[3] == 0 ? 0.0f : std::ldexp(1.0f, int(texel[3]) - (128 + 8));
            for (std::size_t c = 0; c < 3; ++c) image.pixels.push_back(static_cast<float>(texel[c]) * scale);
        }
    }
    return image;
}

}  // namespace nacre::image_formats
