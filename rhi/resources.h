// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "rhi/format.h"
#include "rhi/handle.h"

/// @file
/// Descriptions of buffers, textures, views, samplers, bind groups and query pools.
///
///     Buffer vertices = *device.create_buffer({.size = 36, .usage = BufferUsage::vertex, .name = "vertices"});
///     Texture target = *device.create_texture({.format = Format::rgba8_unorm, .width = 640, .height = 480,
///         .usage = TextureUsage::color_target | TextureUsage::copy_source, .name = "target"});

namespace nacre::rhi {

struct Extent3D {
    std::uint32_t width = 1, height = 1, depth = 1;
    friend bool operator==(const Extent3D&, const Extent3D&) = default;
};
struct Offset3D {
    std::uint32_t x = 0, y = 0, z = 0;
};

enum class BufferUsage : std::uint32_t {
    none = 0, vertex = 1, index = 2, uniform = 4, storage = 8, indirect = 16, copy_source = 32, copy_destination = 64,
    acceleration_structure_input = 128,  ///< Vertices and indices that acceleration structures are built from.
    uniform_texel = 256,                 ///< BindingType::uniform_texel_buffer; needs Capabilities::texel_buffers.
    storage_texel = 512,                 ///< BindingType::*storage_texel_buffer; needs Capabilities::texel_buffers.
};
NACRE_FLAGS(BufferUsage)

/// Where a buffer's memory lies and who touches it.
enum class MemoryKind : std::uint8_t {
    device,    ///< Fast for the device; filled by copies or `Device::write_buffer`.
    upload,    ///< Written by the host through `Device::map`, read by the device.
    readback,  ///< Written by copies, read by the host through `Device::map`.
};

struct BufferDesc {
    std::uint64_t size = 0;  ///< Bytes; above 0.
    BufferUsage usage = BufferUsage::none;
    MemoryKind memory = MemoryKind::device;
    std::string name;        ///< For messages and debuggers.
};

enum class TextureDimension : std::uint8_t { d1, d2, d3, cube };

enum class TextureUsage : std::uint32_t {
    none = 0, sampled = 1, storage = 2, color_target = 4, depth_target = 8, copy_source = 16, copy_destination = 32,
};
NACRE_FLAGS(TextureUsage)

struct TextureDesc {
    TextureDimension dimension = TextureDimension::d2;
    Format format = Format::undefined;
    std::uint32_t width = 0;
    std::uint32_t height = 1;
    std::uint32_t depth = 1;    ///< Above 1 for d3 only.
    std::uint32_t layers = 1;   ///< Array layers; a cube has 6, a cube array a multiple of 6.
    std::uint32_t mips = 1;     ///< 1 to `full_mip_count`.
    std::uint32_t samples = 1;  ///< 1 or 4.
    TextureUsage usage = TextureUsage::none;
    std::string name;
};

/// Number of mips down to 1x1x1.
std::uint32_t full_mip_count(std::uint32_t width, std::uint32_t height = 1, std::uint32_t depth = 1);

/// Size of one mip of one layer in texels.
Extent3D mip_extent(const TextureDesc& desc, std::uint32_t mip);

/// Bytes of one mip of one layer in the tight layout that uploads and read-backs use: rows of blocks
/// without padding, then slices. Stencil is not included.
std::uint64_t mip_bytes(const TextureDesc& desc, std::uint32_t mip);

inline constexpr std::uint32_t all_remaining = ~0u;

enum class ViewDimension : std::uint8_t { automatic, d1, d1_array, d2, d2_array, d3, cube, cube_array };

/// A part of a texture as a shader or a render pass sees it. A plain value; the default is the whole texture
/// in its own dimension (array views for textures of more than one layer).
struct TextureView {
    Texture texture;
    ViewDimension dimension = ViewDimension::automatic;
    std::uint32_t base_mip = 0;
    std::uint32_t mip_count = all_remaining;
    std::uint32_t base_layer = 0;
    std::uint32_t layer_count = all_remaining;
    Format format = Format::undefined;  ///< undefined: the texture's own.

    TextureView() = default;
    TextureView(Texture whole) : texture(whole) {}  // NOLINT: a texture is its own default view.
    /// One mip of one layer, as render passes and storage images need it.
    static TextureView subresource(Texture texture, std::uint32_t mip, std::uint32_t layer = 0) {
        TextureView view(texture);
        view.dimension = ViewDimension::d2;
        view.base_mip = mip, view.mip_count = 1, view.base_layer = layer, view.layer_count = 1;
        return view;
    }
};

enum class Filter : std::uint8_t { nearest, linear };
enum class AddressMode : std::uint8_t { repeat, mirrored_repeat, clamp_to_edge, clamp_to_border };
enum class BorderColor : std::uint8_t { transparent_black, opaque_black, opaque_white };
enum class CompareOperation : std::uint8_t {
    never, less, equal, less_or_equal, greater, not_equal, greater_or_equal, always,
};

struct SamplerDesc {
    Filter magnify = Filter::linear;
    Filter minify = Filter::linear;
    Filter mip = Filter::linear;
    AddressMode address_u = AddressMode::repeat;
    AddressMode address_v = AddressMode::repeat;
    AddressMode address_w = AddressMode::repeat;
    float mip_bias = 0.0f;
    float max_anisotropy = 1.0f;  ///< 1: off.
    float min_lod = 0.0f;
    float max_lod = 1000.0f;
    bool comparison = false;      ///< For sampler2DShadow and its kin.
    CompareOperation compare = CompareOperation::less_or_equal;
    BorderColor border = BorderColor::opaque_black;
    std::string name;
};

enum class BindingType : std::uint8_t {
    uniform_buffer,
    storage_buffer,            ///< Read and write.
    readonly_storage_buffer,   ///< Declared `readonly` in every shader that uses it.
    sampled_texture,           ///< texture2D: without a sampler.
    sampler,
    combined_texture_sampler,  ///< sampler2D.
    storage_image,             ///< Read and write.
    readonly_storage_image,
    writeonly_storage_image,
    acceleration_structure,    ///< accelerationStructureEXT; a top level.
    /// samplerBuffer, textureBuffer and those of integers: elements of a format, read by texelFetch.
    uniform_texel_buffer,
    storage_texel_buffer,      ///< imageBuffer, iimageBuffer, uimageBuffer: read, written and changed by atomics.
    readonly_storage_texel_buffer,
    writeonly_storage_texel_buffer,
};

struct BindingLayout {
    std::uint32_t binding = 0;
    BindingType type = BindingType::uniform_buffer;
    std::uint32_t count = 1;  ///< Array length; 0: unbounded (needs Capabilities::descriptor_indexing).
    ShaderStage stages = ShaderStage::none;
    friend bool operator==(const BindingLayout&, const BindingLayout&) = default;
};

/// Layouts of equal content are the same object, whoever made them. A pipeline makes its layouts by
/// reflection unless it is given explicit ones, which may hold more than its shaders use.
struct BindGroupLayoutDesc {
    std::vector<BindingLayout> bindings;  ///< Any order; no binding twice.
    std::string name;
};

/// What is bound at one binding (or one element of an arrayed binding). Set the members that the type needs.
struct BindGroupEntry {
    std::uint32_t binding = 0;
    Buffer buffer{};
    std::uint64_t offset = 0;
    /// Bytes; default: to the end of the buffer, of texel buffers to the last whole element in it.
    std::uint64_t size = ~0ull;
    TextureView texture{};
    Sampler sampler{};
    AccelerationStructure acceleration_structure{};
    std::uint32_t element = 0;   ///< Index into an arrayed binding.
    /// Texel buffers: what each element is. The shader sees the range's bytes as size / info(format).block_bytes
    /// elements, the first at `offset`; reads behind them give zero in all channels, writes there vanish.
    Format format = Format::undefined;
};

/// An immutable set of resources; cheap enough to be made every frame.
struct BindGroupDesc {
    BindGroupLayout layout;
    std::vector<BindGroupEntry> entries;  ///< All bindings of the layout (unbounded arrays may be partial).
    std::string name;
};

enum class QueryType : std::uint8_t { timestamp, occlusion };

struct QueryPoolDesc {
    QueryType type = QueryType::timestamp;
    std::uint32_t count = 0;  ///< 1 to 65,536.
    std::string name;
};

/// Memory that a device holds.
struct MemoryStatistics {
    std::uint64_t buffer_bytes = 0;
    std::uint64_t texture_bytes = 0;
    std::uint64_t acceleration_structure_bytes = 0;  ///< With what their last builds took and kept.
    std::uint64_t reserved_bytes = 0;     ///< Taken from the driver, including free parts of blocks.
    std::uint64_t staging_bytes = 0;      ///< Held by the RHI itself for uploads and read-backs.
    std::uint32_t buffer_count = 0;
    std::uint32_t texture_count = 0;
    std::uint32_t acceleration_structure_count = 0;
    std::uint32_t driver_allocations = 0; ///< Blocks taken from the driver.
};

}  // namespace nacre::rhi
