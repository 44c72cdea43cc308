// SPDX-License-Identifier: Apache-2.0
#include <OpenEXR/Iex.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>

#include "core/image_formats.h"

// The OpenEXR library takes sizes from the header at their word, so the header is walked here first: the window and
// the lengths of all attributes are known to be sane before the library sees the file.

namespace nacre::image_formats {
namespace {

constexpr ImageFormat format = ImageFormat::openexr;

class MemoryInput : public Imf::IStream {
  public:
    MemoryInput(std::span<const std::byte> data, const std::string& name) : Imf::IStream(name.c_str()), data_(data) {}
    bool read(char* target, int count) override {
        if (count < 0 || data_.size() - position_ < static_cast<std::size_t>(count)) {
            throw Iex::InputExc("the file ends too early");
        }
        std::memcpy(target, data_.data() + position_, static_cast<std::size_t>(count));
        position_ += static_cast<std::size_t>(count);
        return position_ < data_.size();
    }
    std::uint64_t tellg() override { return position_; }
    void seekg(std::uint64_t position) override {
        if (position > data_.size()) throw Iex::InputExc("an offset points behind the end of the file");
        position_ = position;
    }

  private:
    std::span<const std::byte> data_;
    std::size_t position_ = 0;
};

class MemoryOutput : public Imf::OStream {
  public:
    MemoryOutput() : Imf::OStream("memory") {}
    void write(const char* source, int count) override {
        const std::size_t end = position_ + static_cast<std::size_t>(count);
        if (end > data_.size()) data_.resize(end);
        std::memcpy(data_.data() + position_, source, static_cast<std::size_t>(count));
        position_ = end;
    }
    std::uint64_t tellp() override { return position_; }
    void seekp(std::uint64_t position) override { position_ = position; }
    std::vector<std::byte> take() { return std::move(data_); }

  private:
    std::vector<std::byte> data_;
    std::size_t position_ = 0;
};

struct HeaderSummary {
    ImageInfo info{.format = format};
    std::uint64_t bytes_per_pixel = 0;  ///< Of all parts together, as decoded.
};

class HeaderWalk {
  public:
    HeaderWalk(std::span<const std::byte> data, const std::string& subject) : data_(data), subject_(subject) {}

    Expected<HeaderSummary> run() {
        NACRE_TRY(const std::uint32_t version, number(4));
        if ((version & 0xff) != 2)
            return damaged(format, subject_, fmt::format("version {} is unknown", version & 0xff));
        if (version & 0x800) {
            return fail(ErrorCode::unsupported, "read picture", subject_, "it is a deep picture",
                        "Flatten it to one sample for each pixel.");
        }
        const bool multi_part = version & 0x1000;
        position_ = 8;
        HeaderSummary summary;
        for (int part = 0;; ++part) {
            if (multi_part && peek_end()) break;
            NACRE_CHECK(read_part(summary, part));
            if (!multi_part) break;
        }
        return summary;
    }

  private:
    Expected<std::uint32_t> number(std::size_t at) const {
        if (at + 4 > data_.size()) return damaged(format, subject_, "the file ends inside the header");
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < 4; ++i) value |= static_cast<std::uint32_t>(data_[at + i]) << (8 * i);
        return value;
    }

    [[nodiscard]] bool peek_end() const { return position_ < data_.size() && data_[position_] == std::byte{0}; }

    Expected<std::string_view> text() {
        const auto begin = data_.begin() + static_cast<std::ptrdiff_t>(std::min(position_, data_.size()));
        const auto end = std::find(begin, data_.end(), std::byte{0});
        if (end == data_.end()) return damaged(format, subject_, "the file ends inside the header");
        const std::string_view value(reinterpret_cast<const char*>(data_.data()) + position_,
                                     static_cast<std::size_t>(end - begin));
        if (value.size() > 255) return damaged(format, subject_, "an attribute has a name of more than 255 bytes");
        position_ += value.size() + 1;
        return value;
    }

    Expected<void> read_part(HeaderSummary& summary, int part) {
        bool has_window = false, has_channels = false;
        for (;;) {
            NACRE_TRY(const std::string_view name, text());
            if (name.empty()) break;
            NACRE_TRY(const std::string_view type, text());
            NACRE_TRY(const std::uint32_t size, number(position_));
            position_ += 4;
            if (size > data_.size() - position_) {
                return damaged(format, subject_, fmt::format("attribute '{}' claims {} bytes", name, size));
            }
            const std::size_t end = position_ + size;
            // Which of two windows or channel lists holds is not defined, so the library may take the other one.
            if ((name == "dataWindow" && has_window) || (name == "channels" && has_channels))
                return damaged(format, subject_, fmt::format("attribute '{}' occurs twice", name));
            if (name == "dataWindow") {
                if (type != "box2i" || size != 16) return damaged(format, subject_, "the data window is malformed");
                NACRE_CHECK(read_window(summary, part));
                has_window = true;
            } else if (name == "channels") {
                NACRE_CHECK(read_channels(summary, part, end));
                has_channels = true;
            }
            position_ = end;
        }
        if (!has_window || !has_channels) {
            return damaged(format, subject_, fmt::format("part {} lacks its data window or channels", part));
        }
        return {};
    }

    Expected<void> read_window(HeaderSummary& summary, int part) {
        std::int64_t edges[4] = {};
        for (std::size_t i = 0; i < 4; ++i) {
            NACRE_TRY(const std::uint32_t value, number(position_ + 4 * i));
            edges[i] = static_cast<std::int32_t>(value);
        }
        const std::int64_t width = edges[2] - edges[0] + 1;
        const std::int64_t height = edges[3] - edges[1] + 1;
        constexpr std::int64_t largest = std::numeric_limits<std::int32_t>::max();
        if (width <= 0 || height <= 0 || width > largest || height > largest) {
            return damaged(format, subject_, fmt::format("the data window has size {} x {}", width, height));
        }
        // Parts of other sizes than the first are not read, but the library sizes tables by all of them.
        if (part == 0 || std::uint64_t(width) * std::uint64_t(height) >
                             std::uint64_t{summary.info.width} * summary.info.height) {
            summary.info.width = static_cast<std::uint32_t>(width);
            summary.info.height = static_cast<std::uint32_t>(height);
        }
        return {};
    }

    Expected<void> read_channels(HeaderSummary& summary, int part, std::size_t end) {
        std::uint32_t count = 0;
        while (position_ < end) {
            NACRE_TRY(const std::string_view name, text());
            if (name.empty()) break;
            NACRE_TRY(const std::uint32_t type, number(position_));
            position_ += 16;
            if (part == 0)
                summary.info.bits_per_channel = std::max(summary.info.bits_per_channel, type == 1 ? 16u : 32u);
            ++count;
        }
        if (part == 0) summary.info.channels = count;
        summary.bytes_per_pixel += std::uint64_t{4} * count;
        return {};
    }

    std::span<const std::byte> data_;
    const std::string& subject_;
    std::size_t position_ = 0;
};

struct ChannelName {
    std::string layer;
    std::string channel;
};

ChannelName split_name(const std::string& name) {
    const std::size_t dot = name.rfind('.');
    if (dot == std::string::npos) return {"", name};
    return {name.substr(0, dot), name.substr(dot + 1)};
}

ImageLayer& layer_named(std::vector<ImageLayer>& layers, const std::string& name) {
    const auto found = std::ranges::find(layers, name, &ImageLayer::name);
    if (found != layers.end()) return *found;
    return layers.emplace_back(ImageLayer{name, {}});
}

// Channels of one part; parts after the first put their own name before channels that have no layer.
void read_part(Imf::MultiPartInputFile& file, int part_index, LayeredImage& image) {
    const Imf::Header& header = file.header(part_index);
    const Imath::Box2i window = header.dataWindow();
    struct Target {
        ChannelName name;
        std::variant<std::vector<float>, std::vector<std::uint32_t>> values;
    };
    std::vector<Target> targets;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
        // Subsampled chroma has no texel of its own at each pixel.
        if (channel.channel().xSampling != 1 || channel.channel().ySampling != 1) continue;
        Target target{split_name(channel.name()), {}};
        if (part_index > 0 && target.name.layer.empty()) target.name.layer = header.name();
        const std::size_t count = std::size_t{image.width} * image.height;
        if (channel.channel().type == Imf::UINT) target.values = std::vector<std::uint32_t>(count);
        else target.values = std::vector<float>(count);
        targets.push_back(std::move(target));
    }
    Imf::FrameBuffer frame;
    std::size_t index = 0;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
        if (channel.channel().xSampling != 1 || channel.channel().ySampling != 1) continue;
        void* values = std::visit([](auto& v) { return static_cast<void*>(v.data()); }, targets[index++].values);
        frame.insert(channel.name(), Imf::Slice::Make(channel.channel().type == Imf::UINT ? Imf::UINT : Imf::FLOAT,
                                                      values, window, sizeof(float), sizeof(float) * image.width));
    }
    Imf::InputPart part(file, part_index);
    part.setFrameBuffer(frame);
    part.readPixels(window.min.y, window.max.y);
    for (Target& target : targets) {
        layer_named(image.layers, target.name.layer)
            .channels.push_back({std::move(target.name.channel), std::move(target.values)});
    }
}

// OpenEXR keeps channels in alphabetical order; people expect R, G, B, A.
void sort_color_channels(ImageLayer& layer) {
    const auto rank = [](const ImageChannel& channel) {
        static constexpr std::string_view order = "RGBYA";
        const std::size_t at = channel.name.size() == 1 ? order.find(channel.name[0]) : std::string_view::npos;
        return at == std::string_view::npos ? order.size() : at;
    };
    std::ranges::stable_sort(layer.channels, {}, rank);
}

}  // namespace

Expected<ImageInfo> exr_info(std::span<const std::byte> data, const std::string& subject) {
    NACRE_TRY(const HeaderSummary summary, HeaderWalk(data, subject).run());
    return summary.info;
}

Expected<LayeredImage> decode_exr(std::span<const std::byte> data, const std::string& subject) {
    NACRE_TRY(const HeaderSummary summary, HeaderWalk(data, subject).run());
    // A small file with a big claim. Pictures of one color compress by up to 65,536 (by PIZ), those that hold anything
    // by less than 1,024 (the bound of deflate): beyond a gigabyte, a picture has to hold something.
    const std::uint64_t pixels = std::uint64_t{summary.info.width} * summary.info.height;
    const double claimed_bytes = static_cast<double>(pixels) * static_cast<double>(summary.bytes_per_pixel);
    const double file_bytes = static_cast<double>(data.size());
    if (summary.bytes_per_pixel == 0 ||
        claimed_bytes > std::min(file_bytes * 65536, std::max(0x1p30, file_bytes * 1024))) {
        return damaged(format, subject, fmt::format("{} bytes cannot hold {} x {} pixels of {} bytes", data.size(),
                                                    summary.info.width, summary.info.height, summary.bytes_per_pixel));
    }
    try {
        MemoryInput input(data, subject);
        Imf::MultiPartInputFile file(input);
        const Imath::Box2i window = file.header(0).dataWindow();
        LayeredImage image{static_cast<std::uint32_t>(window.max.x - window.min.x + 1),
                           static_cast<std::uint32_t>(window.max.y - window.min.y + 1),
                           {}};
        std::uint64_t bytes_per_pixel = 0;
        for (int part = 0; part < file.parts(); ++part)
            for (auto c = file.header(part).channels().begin(); c != file.header(part).channels().end(); ++c)
                bytes_per_pixel += 4;
        // What was checked against the limits must be what the library read.
        if (std::uint64_t{image.width} * image.height > pixels || bytes_per_pixel > summary.bytes_per_pixel)
            return damaged(format, subject, "the header is ambiguous");
        for (int part = 0; part < file.parts(); ++part) {
            const Imf::Header& header = file.header(part);
            const bool flat =
                !header.hasType() || header.type() == Imf::SCANLINEIMAGE || header.type() == Imf::TILEDIMAGE;
            if (flat && header.dataWindow() == window) read_part(file, part, image);
        }
        for (ImageLayer& layer : image.layers) sort_color_channels(layer);
        if (image.layers.empty()) {
            return fail(ErrorCode::unsupported, "read picture", subject, "it has no channel that can be read",
                        "Write it with channels R, G and B at full resolution.");
        }
        return image;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& error) {
        return damaged(format, subject, error.what());
    }
}

Expected<std::vector<std::byte>> encode_exr(const LayeredImage& image, const std::string& subject) {
    try {
        Imf::Header header(static_cast<int>(image.width), static_cast<int>(image.height));
        header.compression() = Imf::ZIP_COMPRESSION;
        Imf::FrameBuffer frame;
        for (const ImageLayer& layer : image.layers) {
            for (const ImageChannel& channel : layer.channels) {
                const std::string name = layer.name.empty() ? channel.name : layer.name + "." + channel.name;
                const bool integer = std::holds_alternative<std::vector<std::uint32_t>>(channel.values);
                const Imf::PixelType type = integer ? Imf::UINT : Imf::FLOAT;
                // The library takes writable pointers for output, too, and does not write to them.
                void* values = std::visit(
                    [](const auto& v) { return const_cast<void*>(static_cast<const void*>(v.data())); },
                    channel.values);
                header.channels().insert(name, Imf::Channel(type));
                frame.insert(name, Imf::Slice(type, static_cast<char*>(values), sizeof(float),
                                              sizeof(float) * image.width));
            }
        }
        MemoryOutput output;
        {
            Imf::OutputFile file(output, header);
            file.setFrameBuffer(frame);
            file.writePixels(static_cast<int>(image.height));
        }
        return output.take();
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& error) {
        return fail(ErrorCode::input_output, "write picture", subject, error.what());
    }
}

}  // namespace nacre::image_formats
