// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstring>
#include <new>

#include "core/image_formats.h"

// libpng reports errors by longjmp, which must not skip a destructor. Every function below that calls setjmp therefore
// works on plain pointers only; memory is owned by the C++ functions that call them.

namespace nacre {
namespace image_formats {
namespace {

struct PngStream {
    std::span<const std::byte> input;
    std::size_t position = 0;
    std::vector<std::byte>* output = nullptr;
    char message[160] = "";
};

struct PngHeader {
    png_uint_32 width = 0;
    png_uint_32 height = 0;
    png_byte channels = 0;
    png_byte bit_depth = 0;
    png_size_t row_bytes = 0;
};

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
    auto* stream = static_cast<PngStream*>(png_get_error_ptr(png));
    std::strncpy(stream->message, message, sizeof(stream->message) - 1);
    longjmp(png_jmpbuf(png), 1);
}

void on_warning(png_structp, png_const_charp) {}

void read_input(png_structp png, png_bytep target, png_size_t length) {
    auto* stream = static_cast<PngStream*>(png_get_io_ptr(png));
    if (stream->input.size() - stream->position < length) png_error(png, "the file ends too early");
    std::memcpy(target, stream->input.data() + stream->position, length);
    stream->position += length;
}

void write_output(png_structp png, png_bytep source, png_size_t length) {
    auto* stream = static_cast<PngStream*>(png_get_io_ptr(png));
    bool failed = false;
    try {
        const auto* bytes = reinterpret_cast<const std::byte*>(source);
        stream->output->insert(stream->output->end(), bytes, bytes + length);
    } catch (const std::bad_alloc&) {
        failed = true;
    }
    if (failed) png_error(png, "out of memory");
}

void flush_output(png_structp) {}

class PngReadStructures {
  public:
    explicit PngReadStructures(PngStream& stream)
        : png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, &stream, on_error, on_warning)),
          info_(png_ ? png_create_info_struct(png_) : nullptr) {}
    ~PngReadStructures() { png_destroy_read_struct(&png_, &info_, nullptr); }
    PngReadStructures(const PngReadStructures&) = delete;
    PngReadStructures& operator=(const PngReadStructures&) = delete;
    [[nodiscard]] bool valid() const { return png_ && info_; }
    [[nodiscard]] png_structp png() const { return png_; }
    [[nodiscard]] png_infop info() const { return info_; }

  private:
    png_structp png_;
    png_infop info_;
};

bool read_header(png_structp png, png_infop info, PngStream* stream, bool keep_16_bit, PngHeader* header) {
    if (setjmp(png_jmpbuf(png))) return false;
    png_set_read_fn(png, stream, read_input);
    // Sizes are judged by ImageLimits, with a better message; ancillary chunks get a bound of their own.
    png_set_user_limits(png, 0x7fffffff, 0x7fffffff);
    png_set_chunk_malloc_max(png, 16u << 20);
    png_set_chunk_cache_max(png, 128);
    png_read_info(png, info);
    png_set_expand(png);
    if (!keep_16_bit) png_set_scale_16(png);
    if (keep_16_bit && std::endian::native == std::endian::little) png_set_swap(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    header->width = png_get_image_width(png, info);
    header->height = png_get_image_height(png, info);
    header->channels = png_get_channels(png, info);
    header->bit_depth = png_get_bit_depth(png, info);
    header->row_bytes = png_get_rowbytes(png, info);
    return true;
}

bool read_rows(png_structp png, png_bytepp rows) {
    if (setjmp(png_jmpbuf(png))) return false;
    png_read_image(png, rows);
    png_read_end(png, nullptr);
    return true;
}

bool write_rows(png_structp png, png_infop info, PngStream* stream, const ImageBytes* image, png_bytepp rows) {
    if (setjmp(png_jmpbuf(png))) return false;
    static constexpr int color_types[5] = {0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                           PNG_COLOR_TYPE_RGB_ALPHA};
    png_set_write_fn(png, stream, write_output, flush_output);
    // Level 4 with the Up and Sub filters halves the time of the default and costs a few percent of size.
    png_set_compression_level(png, 4);
    png_set_user_limits(png, 0x7fffffff, 0x7fffffff);
    png_set_IHDR(png, info, image->width, image->height, static_cast<int>(image->bytes_per_channel * 8),
                 color_types[image->channels], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    if (image->bytes_per_channel == 2 && std::endian::native == std::endian::little) png_set_swap(png);
    png_write_image(png, rows);
    png_write_end(png, info);
    return true;
}

std::unexpected<Error> no_memory(const std::string& subject) {
    return fail(ErrorCode::out_of_memory, "read picture", subject, "libpng cannot be started");
}

std::vector<png_bytep> row_pointers(std::uint8_t* bytes, std::size_t height, std::size_t row_bytes) {
    std::vector<png_bytep> rows(height);
    for (std::size_t y = 0; y < height; ++y) rows[y] = bytes + y * row_bytes;
    return rows;
}

}  // namespace

Expected<ImageInfo> png_info(std::span<const std::byte> data, const std::string& subject) {
    PngStream stream{.input = data};
    const PngReadStructures structures(stream);
    if (!structures.valid()) return no_memory(subject);
    PngHeader header;
    if (!read_header(structures.png(), structures.info(), &stream, true, &header)) {
        return damaged(ImageFormat::png, subject, stream.message);
    }
    return ImageInfo{ImageFormat::png, header.width, header.height, header.channels, header.bit_depth};
}

Expected<ImageBytes> decode_png(std::span<const std::byte> data, const std::string& subject, bool keep_16_bit,
                                const ImageLimits& limits) {
    PngStream stream{.input = data};
    const PngReadStructures structures(stream);
    if (!structures.valid()) return no_memory(subject);
    PngHeader header;
    if (!read_header(structures.png(), structures.info(), &stream, keep_16_bit, &header)) {
        return damaged(ImageFormat::png, subject, stream.message);
    }
    NACRE_CHECK(check_limits({ImageFormat::png, header.width, header.height, header.channels, header.bit_depth}, limits,
                             subject));
    // Deflate shrinks by at most 1032 : 1 (and expansion of 1-bit pixels to 4 bytes by 32), so a small file cannot
    // hold a large picture: refuse it before the memory is taken.
    const std::uint64_t size = std::uint64_t{header.row_bytes} * header.height;
    if (size / 32 / 1032 > data.size()) {
        return damaged(ImageFormat::png, subject,
                       fmt::format("{} bytes cannot hold {} x {} pixels", data.size(), header.width, header.height));
    }
    ImageBytes image{header.width, header.height, header.channels, header.bit_depth / 8u, {}};
    image.bytes.resize(size);
    std::vector<png_bytep> rows = row_pointers(image.bytes.data(), header.height, header.row_bytes);
    if (!read_rows(structures.png(), rows.data())) return damaged(ImageFormat::png, subject, stream.message);
    return image;
}

}  // namespace image_formats

Expected<std::vector<std::byte>> encode_png(const ImageBytes& image) {
    const std::string attempted = "write picture";
    const bool valid_kind = image.channels >= 1 && image.channels <= 4 &&
                            (image.bytes_per_channel == 1 || image.bytes_per_channel == 2);
    const std::size_t row_bytes = std::size_t{image.width} * image.channels * image.bytes_per_channel;
    if (image.width == 0 || image.height == 0 || !valid_kind || image.bytes.size() != row_bytes * image.height) {
        return fail(ErrorCode::invalid_argument, attempted, "",
                    fmt::format("{} x {} pixels, {} channels of {} bytes and {} bytes of data do not make a PNG",
                                image.width, image.height, image.channels, image.bytes_per_channel,
                                image.bytes.size()));
    }
    try {
        std::vector<std::byte> data;
        image_formats::PngStream stream{.output = &data};
        png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &stream, image_formats::on_error,
                                                  image_formats::on_warning);
        png_infop info = png ? png_create_info_struct(png) : nullptr;
        // libpng takes rows to write as pointers to non-const bytes but does not change them.
        std::vector<png_bytep> rows = image_formats::row_pointers(const_cast<std::uint8_t*>(image.bytes.data()),
                                                                  image.height, row_bytes);
        const bool written = info && image_formats::write_rows(png, info, &stream, &image, rows.data());
        png_destroy_write_struct(&png, &info);
        if (!written) return fail(ErrorCode::internal, attempted, "", stream.message);
        return data;
    } catch (const std::bad_alloc&) {
        return fail(ErrorCode::out_of_memory, attempted, "", "the memory for the encoded file cannot be had");
    }
}

}  // namespace nacre
