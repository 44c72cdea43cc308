// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/accessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <type_traits>

namespace nacre::scene::gltf {
namespace {

constexpr std::string_view truncated_remedy = "The file is truncated; export it again.";

std::uint32_t size_of(ComponentType type) {
    switch (type) {
        case ComponentType::int8:
        case ComponentType::uint8: return 1;
        case ComponentType::int16:
        case ComponentType::uint16: return 2;
        case ComponentType::uint32:
        case ComponentType::float32: return 4;
    }
    return 4;
}

ComponentType component_type(const JsonView& value) {
    switch (value.as_whole()) {
        case 5120: return ComponentType::int8;
        case 5121: return ComponentType::uint8;
        case 5122: return ComponentType::int16;
        case 5123: return ComponentType::uint16;
        case 5125: return ComponentType::uint32;
        case 5126: return ComponentType::float32;
        default: value.reject_as("a component type (5120, 5121, 5122, 5123, 5125 or 5126)");
    }
}

/// Where each component of an element lies: columns of matrices begin at multiples of 4 bytes.
std::uint32_t column_bytes(const AccessorInfo& info) {
    const std::uint32_t bytes = info.rows * size_of(info.component);
    return info.columns == 1 ? bytes : (bytes + 3) / 4 * 4;
}

std::uint32_t element_bytes(const AccessorInfo& info) {
    return (info.columns - 1) * column_bytes(info) + info.rows * size_of(info.component);
}

template <typename Stored>
Stored load(const std::byte* at) {
    Stored value;
    std::memcpy(&value, at, sizeof value);
    return value;
}

/// One component as `Value` (float or std::uint32_t).
template <typename Value>
Value component_at(const std::byte* at, ComponentType type, bool normalized) {
    if constexpr (std::is_same_v<Value, float>) {
        switch (type) {
            case ComponentType::int8: {
                const auto value = static_cast<float>(load<std::int8_t>(at));
                return normalized ? std::max(value / 127.0f, -1.0f) : value;
            }
            case ComponentType::uint8: {
                const auto value = static_cast<float>(load<std::uint8_t>(at));
                return normalized ? value / 255.0f : value;
            }
            case ComponentType::int16: {
                const auto value = static_cast<float>(load<std::int16_t>(at));
                return normalized ? std::max(value / 32767.0f, -1.0f) : value;
            }
            case ComponentType::uint16: {
                const auto value = static_cast<float>(load<std::uint16_t>(at));
                return normalized ? value / 65535.0f : value;
            }
            case ComponentType::uint32: return static_cast<float>(load<std::uint32_t>(at));
            case ComponentType::float32: return load<float>(at);
        }
    } else {
        switch (type) {
            case ComponentType::uint8: return load<std::uint8_t>(at);
            case ComponentType::uint16: return load<std::uint16_t>(at);
            case ComponentType::uint32: return load<std::uint32_t>(at);
            default: break;
        }
    }
    return {};
}

/// Bytes of `count` elements, proven to exist.
struct ElementBytes {
    const std::byte* first = nullptr;
    std::size_t stride = 0;
};

ElementBytes locate(Document& document, std::size_t view_index, std::uint64_t byte_offset, std::uint64_t count,
                    std::uint32_t bytes_per_element, std::uint32_t alignment, bool may_interleave,
                    const std::string& element) {
    const ViewBytes view = document.view(view_index);
    const std::uint64_t stride = may_interleave && view.stride != 0 ? view.stride : bytes_per_element;
    if (stride < bytes_per_element) {
        reject(fmt::format("{}: bufferView {} has byteStride {}, but one element takes {} bytes", element, view_index,
                           stride, bytes_per_element));
    }
    if (byte_offset % alignment != 0 || (view.buffer_offset + byte_offset) % alignment != 0 ||
        stride % alignment != 0) {
        reject(
            fmt::format("{}: its data at byte {} of the buffer, stride {}, is not aligned to its components of {} "
                        "bytes",
                        element, with_commas(view.buffer_offset + byte_offset), stride, alignment));
    }
    const std::uint64_t available = view.bytes.size();
    const bool fits = byte_offset <= available && bytes_per_element <= available - byte_offset &&
                      count - 1 <= (available - byte_offset - bytes_per_element) / stride;
    if (!fits) {
        reject(fmt::format("{}: {} elements of {} bytes (stride {}) from byteOffset {} go beyond bufferView {}, which "
                           "holds {} bytes",
                           element, with_commas(count), bytes_per_element, stride, with_commas(byte_offset), view_index,
                           with_commas(available)),
               std::string(truncated_remedy));
    }
    return {view.bytes.data() + byte_offset, stride};
}

template <typename Value>
void copy_element(const AccessorInfo& info, const std::byte* from, Value* to) {
    const std::uint32_t component_size = size_of(info.component);
    const std::uint32_t column_stride = column_bytes(info);
    for (std::uint32_t column = 0; column < info.columns; ++column) {
        for (std::uint32_t row = 0; row < info.rows; ++row) {
            *to++ = component_at<Value>(from + column * column_stride + row * component_size, info.component,
                                        info.normalized);
        }
    }
}

/// Overwrites the elements that a sparse accessor lists.
template <typename Value>
void apply_sparse(Document& document, const AccessorInfo& info, const JsonView& sparse, const std::string& element,
                  std::vector<Value>& values) {
    const std::uint64_t count = sparse.whole("count");
    if (count == 0 || count > info.count) {
        reject(fmt::format("{}: sparse.count is {}, but must be from 1 to the accessor's count {}", element,
                           with_commas(count), with_commas(info.count)));
    }
    const std::size_t view_count = document.list("bufferViews").size();
    const JsonView indices_json = sparse.at("indices");
    AccessorInfo index_info{.component = component_type(indices_json.at("componentType"))};
    if (index_info.component != ComponentType::uint8 && index_info.component != ComponentType::uint16 &&
        index_info.component != ComponentType::uint32) {
        indices_json.at("componentType").reject_as("an unsigned component type (5121, 5123 or 5125)");
    }
    const std::uint32_t index_size = size_of(index_info.component);
    const ElementBytes indices =
        locate(document, indices_json.index("bufferView", view_count, "bufferView"),
               indices_json.whole("byteOffset", 0), count, index_size, index_size, false, element + ", sparse indices");
    const JsonView values_json = sparse.at("values");
    const ElementBytes replacements =
        locate(document, values_json.index("bufferView", view_count, "bufferView"), values_json.whole("byteOffset", 0),
               count, element_bytes(info), size_of(info.component), false, element + ", sparse values");

    std::uint64_t next_allowed = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
        const std::uint32_t index =
            component_at<std::uint32_t>(indices.first + i * indices.stride, index_info.component, false);
        if (index >= info.count) {
            reject(fmt::format("{}: sparse index {} is {}, but the accessor has {} elements", element, i, index,
                               with_commas(info.count)));
        }
        if (index < next_allowed) reject(fmt::format("{}: its sparse indices do not increase strictly", element));
        next_allowed = std::uint64_t{index} + 1;
        copy_element(info, replacements.first + i * replacements.stride,
                     values.data() + std::size_t{index} * info.components());
    }
}

template <typename Value>
std::vector<Value> read(Document& document, std::size_t accessor, const std::string& user) {
    const AccessorInfo info = describe_accessor(document, accessor);
    const JsonView& json = document.list("accessors")[accessor];
    const std::string element = fmt::format("{}, {}", user, label("accessor", accessor, json));
    if (std::is_same_v<Value, std::uint32_t> &&
        (info.component != ComponentType::uint8 && info.component != ComponentType::uint16 &&
         info.component != ComponentType::uint32)) {
        reject(element + ": expected unsigned integers (component type 5121, 5123 or 5125)");
    }

    ElementBytes source;
    if (info.has_view) {
        const std::size_t view = json.index("bufferView", document.list("bufferViews").size(), "bufferView");
        source = locate(document, view, json.whole("byteOffset", 0), info.count, element_bytes(info),
                        size_of(info.component), true, element);
    }
    // A count near 2^64 must not wrap around in the product.
    constexpr std::uint64_t largest_count = std::uint64_t{1} << 48;
    document.charge_geometry(std::min(info.count, largest_count) * info.components() * sizeof(Value), element);
    std::vector<Value> values(info.count * info.components());
    if (info.has_view) {
        Value* to = values.data();
        for (std::uint64_t i = 0; i < info.count; ++i, to += info.components()) {
            copy_element(info, source.first + i * source.stride, to);
        }
    }
    if (const auto sparse = json.find("sparse")) apply_sparse(document, info, *sparse, element, values);
    return values;
}

template <typename Vector>
std::vector<Vector> read_vectors(Document& document, std::size_t accessor, const std::string& user,
                                 std::uint32_t columns, std::string_view type_name) {
    const AccessorInfo info = describe_accessor(document, accessor);
    const std::uint32_t rows = sizeof(Vector) / sizeof(float) / columns;
    if (info.columns != columns || info.rows != rows) {
        reject(fmt::format("{}, accessor {}: expected type {}, found '{}'", user, accessor, type_name,
                           printable(document.list("accessors")[accessor].text("type"))));
    }
    const std::vector<float> values = read<float>(document, accessor, user);
    std::vector<Vector> result(info.count);
    static_assert(std::is_trivially_copyable_v<Vector>);
    std::memcpy(static_cast<void*>(result.data()), values.data(), values.size() * sizeof(float));
    return result;
}

}  // namespace

AccessorInfo describe_accessor(Document& document, std::size_t accessor) {
    const JsonView& json = document.list("accessors")[accessor];
    AccessorInfo info;
    info.count = json.whole("count");
    if (info.count == 0) json.at("count").reject_as("at least 1");
    info.component = component_type(json.at("componentType"));
    info.normalized = json.flag("normalized", false);
    info.has_view = json.has("bufferView");
    if (info.normalized && (info.component == ComponentType::float32 || info.component == ComponentType::uint32)) {
        reject(fmt::format("{}: only 8- and 16-bit integers can be normalized", label("accessor", accessor, json)));
    }
    const std::string type = json.text("type");
    if (type == "SCALAR") {
        info.rows = 1;
    } else if (type == "VEC2" || type == "VEC3" || type == "VEC4") {
        info.rows = static_cast<std::uint32_t>(type[3] - '0');
    } else if (type == "MAT2" || type == "MAT3" || type == "MAT4") {
        info.rows = info.columns = static_cast<std::uint32_t>(type[3] - '0');
    } else {
        json.at("type").reject_as("SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4");
    }
    return info;
}

std::vector<float> read_reals(Document& document, std::size_t accessor, const std::string& element) {
    return read<float>(document, accessor, element);
}

std::vector<std::uint32_t> read_wholes(Document& document, std::size_t accessor, const std::string& element) {
    return read<std::uint32_t>(document, accessor, element);
}

std::vector<glm::vec2> read_vec2(Document& document, std::size_t accessor, const std::string& element) {
    return read_vectors<glm::vec2>(document, accessor, element, 1, "VEC2");
}
std::vector<glm::vec3> read_vec3(Document& document, std::size_t accessor, const std::string& element) {
    return read_vectors<glm::vec3>(document, accessor, element, 1, "VEC3");
}
std::vector<glm::vec4> read_vec4(Document& document, std::size_t accessor, const std::string& element) {
    return read_vectors<glm::vec4>(document, accessor, element, 1, "VEC4");
}
std::vector<glm::mat4> read_mat4(Document& document, std::size_t accessor, const std::string& element) {
    return read_vectors<glm::mat4>(document, accessor, element, 4, "MAT4");
}

}  // namespace nacre::scene::gltf
