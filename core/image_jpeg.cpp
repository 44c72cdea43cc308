// SPDX-License-Identifier: Apache-2.0
#include <csetjmp>
#include <cstddef>
#include <cstdio>

#include "core/image_formats.h"

// The library's headers do not include what they need: the order matters.
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

namespace nacre::image_formats {
namespace {

/// A progressive file of a few kilobytes can ask for thousands of passes over the whole picture. Encoders use ten.
constexpr int scan_limit = 100;

/// libjpeg's decoder with what it reports to. `jmp_buf` is the only way out of its errors, so no function between
/// `setjmp` and the library owns anything.
struct Decoder {
    jpeg_decompress_struct info{};
    jpeg_error_mgr errors{};
    jpeg_progress_mgr progress{};
    std::jmp_buf failed;
    char reason[JMSG_LENGTH_MAX] = {};
    J_COLOR_SPACE color_space = JCS_UNKNOWN;  // Of the file.
    bool has_inverted_inks = false;

    static Decoder& of(j_common_ptr info) { return *static_cast<Decoder*>(info->client_data); }

    [[noreturn]] static void fail(j_common_ptr info) {
        Decoder& decoder = of(info);
        info->err->format_message(info, decoder.reason);
        std::longjmp(decoder.failed, 1);
    }

    /// The library goes on after damage, with gray or garbage; a picture that is not whole is an error here.
    static void take_message(j_common_ptr info, int level) {
        if (level >= 0) return;
        switch (info->err->msg_code) {
            case JWRN_JPEG_EOF:
            case JWRN_HIT_MARKER:
            case JWRN_HUFF_BAD_CODE:
            case JWRN_MUST_RESYNC: fail(info);
            default: break;  // Unusual but readable, such as extra bytes between two segments.
        }
    }

    static void check_scans(j_common_ptr info) {
        if (!info->is_decompressor || reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= scan_limit) return;
        Decoder& decoder = of(info);
        std::snprintf(decoder.reason, sizeof(decoder.reason), "it has more than %d scans", scan_limit);
        std::longjmp(decoder.failed, 1);
    }

    Decoder() {
        info.err = jpeg_std_error(&errors);
        info.client_data = this;
        errors.error_exit = fail;
        errors.emit_message = take_message;
        errors.output_message = [](j_common_ptr) {};
        progress.progress_monitor = check_scans;
    }
    Decoder(const Decoder&) = delete;
    Decoder& operator=(const Decoder&) = delete;
    ~Decoder() { jpeg_destroy_decompress(&info); }

    bool read_header(std::span<const std::byte> data) {
        if (setjmp(failed) != 0) return false;
        jpeg_create_decompress(&info);  // Clears all fields but err and client_data.
        info.progress = &progress;
        jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(data.data()),
                     static_cast<unsigned long>(data.size()));
        jpeg_read_header(&info, TRUE);
        color_space = info.jpeg_color_space;
        has_inverted_inks = info.saw_Adobe_marker;
        // Inks are decoded as they are and turned into red, green and blue below.
        if (color_space == JCS_CMYK || color_space == JCS_YCCK)
            info.out_color_space = JCS_CMYK;
        else
            info.out_color_space = color_space == JCS_GRAYSCALE ? JCS_GRAYSCALE : JCS_RGB;
        return true;
    }

    /// Decodes into rows of `row_bytes` bytes each.
    bool read_rows(unsigned char* pixels, std::size_t row_bytes) {
        if (setjmp(failed) != 0) return false;
        info.dct_method = JDCT_ISLOW;  // The same result on every machine.
        jpeg_start_decompress(&info);
        while (info.output_scanline < info.output_height) {
            JSAMPROW row = pixels + info.output_scanline * row_bytes;
            jpeg_read_scanlines(&info, &row, 1);
        }
        jpeg_finish_decompress(&info);
        return true;
    }
};

/// Why the decoder failed; a size that the format allows and the library does not is no damage.
std::unexpected<Error> failure(const Decoder& decoder, const std::string& subject) {
    if (decoder.errors.msg_code == JERR_IMAGE_TOO_BIG)
        return fail(ErrorCode::out_of_memory, "read picture", subject, decoder.reason, "Use a smaller picture.");
    return damaged(ImageFormat::jpeg, subject, decoder.reason);
}

/// Channels of the picture that is handed out: gray or red, green, blue.
std::uint32_t channels_of(const Decoder& decoder) { return decoder.color_space == JCS_GRAYSCALE ? 1 : 3; }

}  // namespace

Expected<ImageInfo> jpeg_info(std::span<const std::byte> data, const std::string& subject) {
    Decoder decoder;
    if (!decoder.read_header(data)) return failure(decoder, subject);
    return ImageInfo{ImageFormat::jpeg, decoder.info.image_width, decoder.info.image_height, channels_of(decoder), 8};
}

Expected<ImageBytes> decode_jpeg(std::span<const std::byte> data, const std::string& subject) {
    Decoder decoder;
    if (!decoder.read_header(data)) return failure(decoder, subject);
    const bool is_inks = decoder.info.out_color_space == JCS_CMYK;
    const std::uint32_t decoded_channels = is_inks ? 4 : channels_of(decoder);
    ImageBytes image{decoder.info.image_width, decoder.info.image_height, channels_of(decoder), 1, {}};
    const std::size_t row_bytes = std::size_t{image.width} * decoded_channels;
    image.bytes.resize(row_bytes * image.height);
    if (!decoder.read_rows(reinterpret_cast<unsigned char*>(image.bytes.data()), row_bytes))
        return failure(decoder, subject);
    if (is_inks) {
        // Adobe's files hold 255 minus the ink. Without a color profile, light is what each ink and black let through.
        auto* bytes = reinterpret_cast<unsigned char*>(image.bytes.data());
        const unsigned flip = decoder.has_inverted_inks ? 0 : 255;
        for (std::size_t texel = 0; texel < image.texel_count(); ++texel) {
            const unsigned char* inks = bytes + texel * 4;
            const unsigned light[3] = {inks[0] ^ flip, inks[1] ^ flip, inks[2] ^ flip};
            const unsigned black_light = inks[3] ^ flip;
            for (int channel = 0; channel < 3; ++channel)
                bytes[texel * 3 + channel] = static_cast<unsigned char>((light[channel] * black_light + 127) / 255);
        }
        image.bytes.resize(image.texel_count() * 3);
    }
    return image;
}

}  // namespace nacre::image_formats
