// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rhi/acceleration_structure.h"
#include "rhi/pipeline.h"

/// @file
/// Recording of work. A command list belongs to no thread: any thread may record any list, one thread at a
/// time. Nothing reaches the driver before `Device::submit`; barriers and layouts are worked out there.
///
///     CommandList list = device.create_command_list("frame");
///     list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
///     list.set_pipeline(pipeline);
///     list.draw({.vertex_count = 3});
///     list.end_render_pass();
///     Fence fence = *device.submit(std::move(list));

namespace nacre::rhi {

class Device;
struct CommandStream;

enum class LoadOperation : std::uint8_t { load, clear, discard };
enum class StoreOperation : std::uint8_t { store, discard };

/// A clear value; which member counts follows from the format.
union ClearColor {
    std::array<float, 4> floating{0.0f, 0.0f, 0.0f, 0.0f};
    std::array<std::uint32_t, 4> uint;
    std::array<std::int32_t, 4> sint;
};

struct ColorAttachment {
    TextureView view;              ///< One mip, one layer.
    LoadOperation load = LoadOperation::load;
    StoreOperation store = StoreOperation::store;
    ClearColor clear{};
    TextureView resolve{};         ///< Where a 4-sample target is resolved to at the end; may be empty.
};

struct DepthStencilAttachment {
    TextureView view{};            ///< Empty: no depth target.
    LoadOperation depth_load = LoadOperation::load;
    StoreOperation depth_store = StoreOperation::store;
    float clear_depth = 1.0f;
    LoadOperation stencil_load = LoadOperation::load;
    StoreOperation stencil_store = StoreOperation::store;
    std::uint8_t clear_stencil = 0;
    bool read_only = false;        ///< Tested but not written; may be sampled in the same pass.
};

struct RenderPassDesc {
    std::vector<ColorAttachment> color;
    DepthStencilAttachment depth_stencil{};
    std::string name;
};

struct Viewport {
    float x = 0, y = 0, width = 0, height = 0, min_depth = 0, max_depth = 1;  ///< Pixels; row 0 on top.
};
struct Rectangle {
    std::uint32_t x = 0, y = 0, width = 0, height = 0;
};

struct DrawArguments {
    std::uint32_t vertex_count = 0, instance_count = 1, first_vertex = 0, first_instance = 0;
};
struct DrawIndexedArguments {
    std::uint32_t index_count = 0, instance_count = 1, first_index = 0;
    std::int32_t vertex_offset = 0;
    std::uint32_t first_instance = 0;
};
struct DispatchArguments {
    std::uint32_t x = 1, y = 1, z = 1;
};

struct BufferTextureCopy {
    std::uint64_t buffer_offset = 0;    ///< Multiple of the block size and of 4.
    std::uint32_t bytes_per_row = 0;    ///< 0: tight. A multiple of the block size.
    std::uint32_t rows_per_slice = 0;   ///< Rows of blocks; 0: tight.
    std::uint32_t mip = 0;
    std::uint32_t layer = 0;
    Offset3D offset{};                  ///< Texels.
    Extent3D extent{0, 0, 0};           ///< Texels; width 0: the whole mip.
};

struct TextureCopy {
    std::uint32_t source_mip = 0, source_layer = 0;
    Offset3D source_offset{};
    std::uint32_t destination_mip = 0, destination_layer = 0;
    Offset3D destination_offset{};
    Extent3D extent{0, 0, 0};           ///< Texels; width 0: the whole source mip.
    std::uint32_t layer_count = 1;
};

/// How a pass uses a resource; combined where it uses it in several ways.
enum class ResourceUse : std::uint32_t {
    none = 0,
    vertex_buffer = 1, index_buffer = 2, indirect_argument = 4, uniform_buffer = 8,
    sampled = 16,             ///< Read through a sampler or by texelFetch.
    storage_read = 32, storage_write = 64,
    color_target = 128, depth_stencil_write = 256, depth_stencil_read = 512,
    copy_source = 1024, copy_destination = 2048, resolve_source = 4096, resolve_destination = 8192,
    host_read = 16384,
    build_input = 32768,                    ///< Vertices and indices of a build.
    acceleration_structure_read = 65536,    ///< By shaders, and of bottom levels by builds of top levels.
    acceleration_structure_write = 131072,  ///< Built or updated.
};
NACRE_FLAGS(ResourceUse)

/// All uses that change content.
inline constexpr ResourceUse writing_uses =
    ResourceUse::storage_write | ResourceUse::color_target | ResourceUse::depth_stencil_write |
    ResourceUse::copy_destination | ResourceUse::resolve_destination | ResourceUse::acceleration_structure_write;

/// One line of an explicit statement (see `CommandList::begin_statement`).
struct StatedAccess {
    Buffer buffer{};    ///< Either this
    Texture texture{};  ///< or this
    ResourceUse use = ResourceUse::none;
    AccelerationStructure acceleration_structure{};  ///< or this.
};

/// Records commands. Movable. Wrong calls do not stop the recording: the first error is kept, later calls of
/// a failed list do nothing, and `Device::submit` returns it.
class CommandList {
  public:
    CommandList(CommandList&&) noexcept;
    CommandList& operator=(CommandList&&) noexcept;
    ~CommandList();

    /// The first error of the recording so far.
    [[nodiscard]] Expected<void> status() const;

    // Render passes. Viewport and scissor cover the whole target at the begin of each pass; pipeline, bind
    // groups, push constants and vertex buffers are unset.
    void begin_render_pass(const RenderPassDesc& desc);
    void end_render_pass();

    // State. Bind groups of one pipeline stay bound across pipelines whose layouts for that index are equal.
    void set_pipeline(GraphicsPipeline pipeline);
    void set_pipeline(ComputePipeline pipeline);
    void set_bind_group(std::uint32_t index, BindGroup group);
    /// Copies `data` into the push constants at `offset`; both multiples of 4 bytes.
    void set_push_constants(std::span<const std::byte> data, std::uint32_t offset = 0);
    /// The same for a trivially copyable value: `list.set_push_constants(Parameters{...})`.
    template <typename T>
        requires(!std::is_convertible_v<const T&, std::span<const std::byte>>)
    void set_push_constants(const T& value, std::uint32_t offset = 0) {
        static_assert(std::is_trivially_copyable_v<T>);
        set_push_constants(std::as_bytes(std::span(&value, 1)), offset);
    }
    void set_vertex_buffer(std::uint32_t slot, Buffer buffer, std::uint64_t offset = 0);
    void set_index_buffer(Buffer buffer, IndexType type, std::uint64_t offset = 0);
    void set_viewport(const Viewport& viewport);
    void set_scissor(const Rectangle& scissor);
    void set_stencil_reference(std::uint8_t reference);
    void set_blend_constants(std::array<float, 4> constants);

    // Work inside a render pass. Indirect arguments lie in a buffer as DrawArguments or DrawIndexedArguments.
    void draw(const DrawArguments& arguments);
    void draw_indexed(const DrawIndexedArguments& arguments);
    void draw_indirect(Buffer arguments, std::uint64_t offset = 0, std::uint32_t count = 1,
                       std::uint32_t stride = sizeof(DrawArguments));
    void draw_indexed_indirect(Buffer arguments, std::uint64_t offset = 0, std::uint32_t count = 1,
                               std::uint32_t stride = sizeof(DrawIndexedArguments));

    // Work outside render passes.
    void dispatch(const DispatchArguments& groups);
    void dispatch_indirect(Buffer arguments, std::uint64_t offset = 0);
    void copy_buffer(Buffer source, std::uint64_t source_offset, Buffer destination,
                     std::uint64_t destination_offset, std::uint64_t size);
    void copy_buffer_to_texture(Buffer source, Texture destination, const BufferTextureCopy& region = {});
    void copy_texture_to_buffer(Texture source, Buffer destination, const BufferTextureCopy& region = {});
    void copy_texture(Texture source, Texture destination, const TextureCopy& region = {});
    /// Repeats a 32-bit value; offset and size are multiples of 4.
    void fill_buffer(Buffer buffer, std::uint32_t value, std::uint64_t offset = 0, std::uint64_t size = ~0ull);
    void clear_texture(const TextureView& view, ClearColor color);
    void clear_depth_stencil(const TextureView& view, float depth, std::uint8_t stencil = 0);
    /// Fills mips 1 and up of every layer from mip 0 with a 2x2 box filter (linear light for srgb formats).
    void generate_mips(Texture texture);

    /// Builds a bottom level: one source for each of its geometries. Vertices that are not finite, and indices beyond
    /// the vertices, make triangles that are never hit.
    void build_acceleration_structure(AccelerationStructure bottom_level, std::span<const GeometrySource> sources);
    /// Builds a top level; the position of an instance is what shaders read as instance id. Every bottom level must be
    /// built before. A top level is built again after any of its bottom levels was built or updated.
    void build_acceleration_structure(AccelerationStructure top_level,
                                      std::span<const AccelerationStructureInstance> instances);
    /// The same for a structure that was built and made with `allow_update`: faster, for content that has moved a
    /// little. Counts and indices must be those of the last build.
    void update_acceleration_structure(AccelerationStructure bottom_level, std::span<const GeometrySource> sources);
    void update_acceleration_structure(AccelerationStructure top_level,
                                       std::span<const AccelerationStructureInstance> instances);

    // Queries. A pool's entry is reset when it is written; read it with `Device::read_queries`.
    void write_timestamp(QueryPool pool, std::uint32_t index);
    void begin_occlusion_query(QueryPool pool, std::uint32_t index);
    void end_occlusion_query(QueryPool pool, std::uint32_t index);

    // Names that debuggers show.
    void push_debug_group(std::string_view name);
    void pop_debug_group();

    /// States what the commands up to `end_statement` read and write. Nothing depends on it: barriers come from
    /// what the commands really do. In a device with `verify` on, a difference between the two is reported.
    void begin_statement(std::string_view pass, std::span<const StatedAccess> accesses);
    void end_statement();

  private:
    friend class Device;
    template <typename Source>
    void record_build(AccelerationStructure structure, std::span<const Source> sources, bool is_update);
    explicit CommandList(std::unique_ptr<CommandStream> stream);
    std::unique_ptr<CommandStream> stream_;
};

}  // namespace nacre::rhi
