// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/document.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "core/file.h"
#include "scene/gltf/uri.h"

namespace nacre::scene::gltf {
namespace {

constexpr std::array<std::string_view, 21> supported_extensions = {
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    // The following change nothing that is drawn.
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic",
};

constexpr std::string_view truncated_remedy = "The file is truncated; export it again.";

std::uint32_t little_endian_word(std::span<const std::byte> bytes, std::size_t offset) {
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 4; ++i) word |= std::to_integer<std::uint32_t>(bytes[offset + i]) << (8 * i);
    return word;
}

std::string_view as_text(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::string label(std::string_view kind, std::size_t index, const JsonView& element) {
    element.require_object();
    return label(kind, index, std::string_view(element.text("name", "")));
}

Document::Document(std::span<const std::byte> bytes, std::filesystem::path folder, const LoadOptions& options)
    : folder_(std::move(folder)), options_(options), source_bytes_(bytes.size()) {
    read_container(bytes);
    root().require_object();
    check_asset();
    check_extensions();
    buffers_.resize(list("buffers").size());
}

void Document::read_container(std::span<const std::byte> bytes) {
    std::string_view json_text = as_text(bytes);
    if (json_text.starts_with("glTF")) {
        constexpr std::uint32_t json_chunk = 0x4e4f534a, binary_chunk = 0x004e4942;
        if (bytes.size() < 20) {
            reject(fmt::format("the header of a .glb takes 20 bytes, but the file holds {}", bytes.size()),
                   std::string(truncated_remedy));
        }
        if (const std::uint32_t version = little_endian_word(bytes, 4); version != 2) {
            reject(fmt::format("the .glb container has version {}, and only 2 is read", version),
                   "Export the file as glTF 2.0.", ErrorCode::unsupported);
        }
        const std::uint64_t length = little_endian_word(bytes, 8);
        if (length > bytes.size() || length < 20) {
            reject(fmt::format("the .glb header says {} bytes, but the file holds {}", with_commas(length),
                               with_commas(bytes.size())),
                   std::string(truncated_remedy));
        }
        if (length < bytes.size()) {
            warnings_.add(
                fmt::format("{} bytes after the end of the .glb were ignored", with_commas(bytes.size() - length)));
        }
        json_text = {};
        bool has_json = false;
        std::size_t chunk = 0;
        for (std::size_t offset = 12; offset + 8 <= length; ++chunk) {
            const std::uint64_t size = little_endian_word(bytes, offset);
            const std::uint32_t type = little_endian_word(bytes, offset + 4);
            offset += 8;
            if (size > length - offset) {
                reject(fmt::format(".glb chunk {}: it says {} bytes, but {} are left in the file", chunk,
                                   with_commas(size), with_commas(length - offset)),
                       std::string(truncated_remedy));
            }
            const auto content = bytes.subspan(offset, size);
            if (chunk == 0 && type != json_chunk) {
                reject(fmt::format(".glb chunk 0: its type is 0x{:08x}, but the first chunk must be JSON", type));
            }
            if (chunk == 0) {
                json_text = as_text(content);
                has_json = true;
            } else if (type == binary_chunk && !has_binary_chunk_) {
                binary_chunk_ = content;
                has_binary_chunk_ = true;
            }
            offset += size;
        }
        if (!has_json) reject("the .glb has no JSON chunk");
    }
    if (json_text.size() > options_.limits.json_bytes) {
        reject(fmt::format("the JSON text has {} bytes; the limit is {}", with_commas(json_text.size()),
                           with_commas(options_.limits.json_bytes)),
               "Move geometry and pictures out of data URIs into a .glb or files of their own.",
               ErrorCode::out_of_memory);
    }
    json_ = parse_json(json_text, options_.limits.json_depth);
}

void Document::check_asset() const {
    const JsonView asset = root().at("asset");
    const std::string version = asset.text("minVersion", asset.text("version"));
    if (!version.starts_with("2.") || (asset.has("minVersion") && version != "2.0")) {
        reject(fmt::format("/asset: the file needs glTF version '{}', and only 2.0 is read", printable(version)),
               "Export the file as glTF 2.0.", ErrorCode::unsupported);
    }
}

void Document::check_extensions() {
    const auto is_supported = [](const std::string& name) {
        return std::find(supported_extensions.begin(), supported_extensions.end(), name) != supported_extensions.end();
    };
    std::string unknown;
    for (const JsonView& entry : root().list("extensionsRequired")) {
        if (const std::string name = entry.as_text(); !is_supported(name)) {
            unknown += (unknown.empty() ? "'" : ", '") + printable(name) + "'";
        }
    }
    if (!unknown.empty()) {
        reject(
            fmt::format("/extensionsRequired: the file cannot be read without {}, which Nacre does not know", unknown),
            "Export the file without it.", ErrorCode::unsupported);
    }
    for (const JsonView& entry : root().list("extensionsUsed")) {
        if (const std::string name = entry.as_text(); !is_supported(name)) {
            warnings_.add(fmt::format("the extension '{}' is not known and was ignored", printable(name)));
        }
    }
}

const std::vector<JsonView>& Document::list(std::string_view name) {
    if (const auto found = lists_.find(name); found != lists_.end()) return found->second;
    return lists_.emplace(std::string(name), root().list(name)).first->second;
}

std::optional<JsonView> Document::extension(std::string_view name) const {
    const auto extensions = root().find("extensions");
    return extensions ? extensions->find(name) : std::nullopt;
}

std::vector<std::byte> Document::read_file(std::string_view uri, const std::string& element) const {
    const std::filesystem::path path = path_of_uri(uri, folder_, element);
    std::error_code ignored;
    if (std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored)) {
        reject(fmt::format("{}: '{}' is not a regular file", element, printable(uri)), "Name a file.",
               ErrorCode::input_output);
    }
    auto bytes = read_binary_file(path, options_.limits.file_bytes);
    if (!bytes) {
        reject(fmt::format("{}: its file '{}' cannot be read ({})", element, printable(uri), bytes.error().reason),
               "Put the file back into the scene's folder.", bytes.error().code);
    }
    return *std::move(bytes);
}

const Document::Buffer& Document::buffer(std::size_t index) {
    Buffer& buffer = buffers_[index];
    if (buffer.loaded) return buffer;

    const JsonView& json = list("buffers")[index];
    const std::string element = label("buffer", index, json);
    const std::uint64_t length = json.whole("byteLength");
    if (const auto uri_member = json.find("uri")) {
        const std::string_view uri = uri_member->as_text_view();
        if (const auto data = parse_data_uri(uri, element)) {
            auto decoded = decode_base64(data->payload);
            if (!decoded) reject(element + ": its data URI is not valid base64");
            buffer.owned = *std::move(decoded);
        } else {
            buffer.owned = read_file(uri, element);
        }
        buffer.bytes = buffer.owned;
    } else if (index == 0 && has_binary_chunk_) {
        buffer.bytes = binary_chunk_;
    } else {
        reject(element + ": it has neither a URI nor a binary chunk");
    }
    if (length > buffer.bytes.size()) {
        reject(fmt::format("{}: byteLength is {}, but its data holds {} bytes", element, with_commas(length),
                           with_commas(buffer.bytes.size())),
               std::string(truncated_remedy));
    }
    source_bytes_ += length;
    buffer.bytes = buffer.bytes.first(length);
    buffer.loaded = true;
    return buffer;
}

ViewBytes Document::view(std::size_t index) {
    const auto& views = list("bufferViews");
    const JsonView& json = views[index];
    const std::string element = label("bufferView", index, json);
    const std::size_t buffer_index = json.index("buffer", buffers_.size(), "buffer");
    const std::uint64_t offset = json.whole("byteOffset", 0);
    const std::uint64_t length = json.whole("byteLength");
    const std::uint64_t stride = json.whole("byteStride", 0);
    if (json.has("byteStride") && (stride < 4 || stride > 252 || stride % 4 != 0)) {
        reject(fmt::format("{}: byteStride is {}, but must be a multiple of 4 from 4 to 252", element, stride));
    }
    const Buffer& source = buffer(buffer_index);
    if (offset > source.bytes.size() || length > source.bytes.size() - offset) {
        reject(fmt::format("{}: byteOffset {} + byteLength {} goes beyond buffer {}, which holds {} bytes", element,
                           with_commas(offset), with_commas(length), buffer_index, with_commas(source.bytes.size())),
               std::string(truncated_remedy));
    }
    return {source.bytes.subspan(offset, length), stride, offset};
}

void Document::charge_geometry(std::uint64_t bytes, std::string_view element) {
    // A small file must not be able to ask for much memory: elements without data, and one accessor used by a
    // thousand meshes, cost a file almost nothing. No honest scene multiplies its own size a thousandfold.
    constexpr std::uint64_t free_bytes = std::uint64_t{256} << 20;
    constexpr std::uint64_t largest_factor = 1024;
    const std::uint64_t justified = free_bytes + largest_factor * std::min(source_bytes_, std::uint64_t{1} << 40);
    const std::uint64_t limit = std::min(options_.limits.geometry_bytes, justified);
    geometry_bytes_ = bytes > limit - std::min(limit, geometry_bytes_) ? limit + 1 : geometry_bytes_ + bytes;
    if (geometry_bytes_ > limit) {
        reject(fmt::format("{}: the geometry of the scene needs more than {} bytes, which is the limit for a scene of "
                           "{} bytes",
                           element, with_commas(limit), with_commas(source_bytes_)),
               "Split the scene, or raise LoadLimits::geometry_bytes.", ErrorCode::out_of_memory);
    }
}

void Document::charge_image(std::uint64_t bytes, std::string_view element) {
    const std::uint64_t limit = options_.limits.image_bytes;
    if (bytes > limit - std::min(limit, image_bytes_)) {
        reject(fmt::format("{}: the pictures of the scene need more than {} bytes when decoded", element,
                           with_commas(limit)),
               "Use smaller pictures, or raise LoadLimits::image_bytes.", ErrorCode::out_of_memory);
    }
    image_bytes_ += bytes;
}

}  // namespace nacre::scene::gltf
