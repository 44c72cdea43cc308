// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "rhi/command_list.h"

/// @file
/// The recorded form of a command list, for the RHI's front end and for backends; users never see it.
///
/// A stream is a sequence of plain structures, each behind a `CommandHeader`. An `ObjectReference` holds a
/// handle while recording; the front end replaces it by the backend's object when the list is submitted, so a backend
/// walks the stream without a single look-up.

namespace nacre::rhi {

class BackendBuffer;
class BackendTexture;
class BackendBindGroup;
class BackendGraphicsPipeline;
class BackendComputePipeline;
class BackendQueryPool;
class BackendAccelerationStructure;

/// A handle while recording; the backend's object after the front end's `resolve`.
template <typename HandleType, typename ObjectType>
union ObjectReference {
    HandleType handle;
    ObjectType* object;
    ObjectReference() : handle{} {}
    ObjectReference(HandleType value) : handle(value) {}  // NOLINT
};
using BufferReference = ObjectReference<Buffer, BackendBuffer>;
using TextureReference = ObjectReference<Texture, BackendTexture>;
using BindGroupReference = ObjectReference<BindGroup, BackendBindGroup>;
using AccelerationStructureReference = ObjectReference<AccelerationStructure, BackendAccelerationStructure>;

/// A resolved range of a texture: no `all_remaining`, no automatic dimension, no undefined format.
struct ViewReference {
    TextureReference texture;
    ViewDimension dimension = ViewDimension::d2;
    Format format = Format::undefined;
    std::uint32_t base_mip = 0, mip_count = 1, base_layer = 0, layer_count = 1;
};

enum class CommandType : std::uint16_t {
    begin_render_pass, end_render_pass,
    set_graphics_pipeline, set_compute_pipeline, set_bind_group, set_push_constants, set_vertex_buffer,
    set_index_buffer, set_viewport, set_scissor, set_stencil_reference, set_blend_constants,
    draw, draw_indexed, draw_indirect, draw_indexed_indirect, dispatch, dispatch_indirect,
    copy_buffer, copy_buffer_to_texture, copy_texture_to_buffer, copy_texture, fill_buffer, clear_texture,
    clear_depth_stencil, generate_mips, build_acceleration_structure,
    write_timestamp, begin_occlusion_query, end_occlusion_query,
    push_debug_group, pop_debug_group, begin_statement, end_statement,
};

struct alignas(8) CommandHeader {
    CommandType type;
    std::uint16_t reserved;
    std::uint32_t bytes;  ///< Of the whole command with this header, a multiple of 8.
};

struct ColorAttachmentCommand {
    ViewReference view;
    ViewReference resolve;  ///< texture.handle empty / object null: none.
    ClearColor clear;
    LoadOperation load;
    StoreOperation store;
};
/// Followed by `color_count` ColorAttachmentCommand.
struct BeginRenderPassCommand {
    static constexpr CommandType type = CommandType::begin_render_pass;
    std::uint32_t color_count;
    std::uint32_t name;  ///< Index into CommandStream::strings.
    bool has_depth_stencil, read_only;
    LoadOperation depth_load, stencil_load;
    StoreOperation depth_store, stencil_store;
    std::uint8_t clear_stencil;
    float clear_depth;
    ViewReference depth_stencil;
    std::uint32_t width, height, samples;  ///< Filled in by the front end at submission.
    [[nodiscard]] ColorAttachmentCommand* colors() { return reinterpret_cast<ColorAttachmentCommand*>(this + 1); }
    [[nodiscard]] const ColorAttachmentCommand* colors() const {
        return reinterpret_cast<const ColorAttachmentCommand*>(this + 1);
    }
};
struct EndRenderPassCommand { static constexpr CommandType type = CommandType::end_render_pass; };
struct SetGraphicsPipelineCommand {
    static constexpr CommandType type = CommandType::set_graphics_pipeline;
    ObjectReference<GraphicsPipeline, BackendGraphicsPipeline> pipeline;
};
struct SetComputePipelineCommand {
    static constexpr CommandType type = CommandType::set_compute_pipeline;
    ObjectReference<ComputePipeline, BackendComputePipeline> pipeline;
};
struct SetBindGroupCommand {
    static constexpr CommandType type = CommandType::set_bind_group;
    BindGroupReference group;
    std::uint32_t index;
};
/// Followed by `size` bytes.
struct SetPushConstantsCommand {
    static constexpr CommandType type = CommandType::set_push_constants;
    std::uint32_t offset, size;
    [[nodiscard]] const std::byte* data() const { return reinterpret_cast<const std::byte*>(this + 1); }
    [[nodiscard]] std::byte* data() { return reinterpret_cast<std::byte*>(this + 1); }
};
struct SetVertexBufferCommand {
    static constexpr CommandType type = CommandType::set_vertex_buffer;
    BufferReference buffer;
    std::uint64_t offset;
    std::uint32_t slot;
};
struct SetIndexBufferCommand {
    static constexpr CommandType type = CommandType::set_index_buffer;
    BufferReference buffer;
    std::uint64_t offset;
    IndexType index_type;
};
struct SetViewportCommand { static constexpr CommandType type = CommandType::set_viewport; Viewport viewport; };
struct SetScissorCommand { static constexpr CommandType type = CommandType::set_scissor; Rectangle scissor; };
struct SetStencilReferenceCommand {
    static constexpr CommandType type = CommandType::set_stencil_reference;
    std::uint32_t reference;
};
struct SetBlendConstantsCommand {
    static constexpr CommandType type = CommandType::set_blend_constants;
    std::array<float, 4> constants;
};
struct DrawCommand { static constexpr CommandType type = CommandType::draw; DrawArguments arguments; };
struct DrawIndexedCommand {
    static constexpr CommandType type = CommandType::draw_indexed;
    DrawIndexedArguments arguments;
};
struct DrawIndirectCommand {
    static constexpr CommandType type = CommandType::draw_indirect;
    BufferReference arguments;
    std::uint64_t offset;
    std::uint32_t count, stride;
};
struct DrawIndexedIndirectCommand {
    static constexpr CommandType type = CommandType::draw_indexed_indirect;
    BufferReference arguments;
    std::uint64_t offset;
    std::uint32_t count, stride;
};
struct DispatchCommand { static constexpr CommandType type = CommandType::dispatch; DispatchArguments groups; };
struct DispatchIndirectCommand {
    static constexpr CommandType type = CommandType::dispatch_indirect;
    BufferReference arguments;
    std::uint64_t offset;
};
struct CopyBufferCommand {
    static constexpr CommandType type = CommandType::copy_buffer;
    BufferReference source, destination;
    std::uint64_t source_offset, destination_offset, size;
};
/// Copy regions in the stream are complete: no zero that stands for "tight" or "whole".
struct CopyBufferToTextureCommand {
    static constexpr CommandType type = CommandType::copy_buffer_to_texture;
    BufferReference source;
    TextureReference destination;
    BufferTextureCopy region;
};
struct CopyTextureToBufferCommand {
    static constexpr CommandType type = CommandType::copy_texture_to_buffer;
    TextureReference source;
    BufferReference destination;
    BufferTextureCopy region;
};
struct CopyTextureCommand {
    static constexpr CommandType type = CommandType::copy_texture;
    TextureReference source, destination;
    TextureCopy region;
};
struct FillBufferCommand {
    static constexpr CommandType type = CommandType::fill_buffer;
    BufferReference buffer;
    std::uint64_t offset, size;
    std::uint32_t value;
};
struct ClearTextureCommand {
    static constexpr CommandType type = CommandType::clear_texture;
    ViewReference view;
    ClearColor color;
};
struct ClearDepthStencilCommand {
    static constexpr CommandType type = CommandType::clear_depth_stencil;
    ViewReference view;
    float depth;
    std::uint8_t stencil;
};
struct GenerateMipsCommand {
    static constexpr CommandType type = CommandType::generate_mips;
    TextureReference texture;
};
/// A geometry of a bottom level; objects are null where the geometry is empty or has no indices.
struct GeometrySourceCommand {
    BufferReference vertices, indices;
    std::uint64_t vertex_offset, index_offset;
};
/// An instance of a top level; the object is null where it has none.
struct InstanceCommand {
    AccelerationStructureReference bottom_level;
    std::array<float, 12> transform;
    std::uint32_t custom_index, table_offset, mask;
    InstanceFlags flags;
};
/// Followed by `count` GeometrySourceCommand for bottom levels, InstanceCommand for top levels.
struct BuildAccelerationStructureCommand {
    static constexpr CommandType type = CommandType::build_acceleration_structure;
    AccelerationStructureReference structure;
    std::uint32_t count;
    bool is_top, is_update;
    [[nodiscard]] GeometrySourceCommand* sources() { return reinterpret_cast<GeometrySourceCommand*>(this + 1); }
    [[nodiscard]] const GeometrySourceCommand* sources() const {
        return reinterpret_cast<const GeometrySourceCommand*>(this + 1);
    }
    [[nodiscard]] InstanceCommand* instances() { return reinterpret_cast<InstanceCommand*>(this + 1); }
    [[nodiscard]] const InstanceCommand* instances() const {
        return reinterpret_cast<const InstanceCommand*>(this + 1);
    }
};
struct WriteTimestampCommand {
    static constexpr CommandType type = CommandType::write_timestamp;
    ObjectReference<QueryPool, BackendQueryPool> pool;
    std::uint32_t index;
};
struct BeginOcclusionQueryCommand {
    static constexpr CommandType type = CommandType::begin_occlusion_query;
    ObjectReference<QueryPool, BackendQueryPool> pool;
    std::uint32_t index;
};
struct EndOcclusionQueryCommand {
    static constexpr CommandType type = CommandType::end_occlusion_query;
    ObjectReference<QueryPool, BackendQueryPool> pool;
    std::uint32_t index;
};
struct PushDebugGroupCommand {
    static constexpr CommandType type = CommandType::push_debug_group;
    std::uint32_t name;  ///< Index into CommandStream::strings.
};
struct PopDebugGroupCommand { static constexpr CommandType type = CommandType::pop_debug_group; };
/// Followed by `count` StatedAccess. Backends skip both.
struct BeginStatementCommand {
    static constexpr CommandType type = CommandType::begin_statement;
    std::uint32_t name, count;
    [[nodiscard]] const StatedAccess* accesses() const { return reinterpret_cast<const StatedAccess*>(this + 1); }
};
struct EndStatementCommand { static constexpr CommandType type = CommandType::end_statement; };

/// What a command list has recorded. Memory is kept in blocks so that recording never moves a command.
struct CommandStream {
    struct Block {
        std::unique_ptr<std::byte[]> data;
        std::size_t capacity = 0;
        std::size_t used = 0;
    };
    std::vector<Block> blocks;
    std::size_t current_block = 0;  ///< Blocks behind it are empty, kept for reuse.
    std::vector<std::string> strings;
    std::string name;
    Expected<void> status{};
    /// Checks calls while recording; null where validation is off.
    std::shared_ptr<class CommandValidator> validator;
    /// Where the stream came from, and goes back to; null for streams of the front end itself.
    std::shared_ptr<class StreamPool> pool;
    std::uint16_t device = 0;       ///< Number of the device that the list was made by.

    /// Appends a command of type T with `extra` bytes behind it and returns it, value-initialized.
    template <typename T>
    T& append(std::size_t extra = 0) {
        static_assert(alignof(T) <= 8);
        const std::size_t bytes = (sizeof(CommandHeader) + sizeof(T) + extra + 7) & ~std::size_t{7};
        std::byte* memory = reserve(bytes);
        new (memory) CommandHeader{T::type, 0, static_cast<std::uint32_t>(bytes)};
        return *new (memory + sizeof(CommandHeader)) T{};
    }

    /// Calls `visit(header, payload)` for every command in order.
    template <typename Visitor>
    void for_each(Visitor&& visit) {
        for (Block& block : blocks)
            for (std::size_t at = 0; at < block.used;) {
                auto* header = reinterpret_cast<CommandHeader*>(block.data.get() + at);
                visit(*header, block.data.get() + at + sizeof(CommandHeader));
                at += header->bytes;
            }
    }

    /// Forgets all commands and keeps the memory.
    void clear() {
        for (Block& block : blocks) block.used = 0;
        current_block = 0;
        strings.clear();
        name.clear();
        status = {};
    }

  private:
    std::byte* reserve(std::size_t bytes) {
        if (blocks.empty() || blocks[current_block].used + bytes > blocks[current_block].capacity) add_block(bytes);
        Block& block = blocks[current_block];
        std::byte* memory = block.data.get() + block.used;
        block.used += bytes;
        return memory;
    }
    /// Makes the next block current: an empty one that was kept, or a new one where that is too small.
    void add_block(std::size_t bytes) {
        if (!blocks.empty()) ++current_block;
        if (current_block < blocks.size() && blocks[current_block].capacity >= bytes) return;
        const std::size_t capacity = bytes > 65536 ? bytes : 65536;
        blocks.insert(blocks.begin() + static_cast<std::ptrdiff_t>(current_block),
                      Block{std::make_unique_for_overwrite<std::byte[]>(capacity), capacity, 0});
    }
};

}  // namespace nacre::rhi
