// SPDX-License-Identifier: Apache-2.0
#include "rhi/command_list.h"

#include <algorithm>
#include <cstring>

#include "rhi/backend.h"
#include "rhi/command_validator.h"
#include "rhi/device_state.h"

namespace nacre::rhi {
namespace {

ViewReference record(const TextureView& view) {
    ViewReference reference;
    reference.texture.handle = view.texture;
    reference.dimension = view.dimension;
    reference.format = view.format;
    reference.base_mip = view.base_mip;
    reference.mip_count = view.mip_count;
    reference.base_layer = view.base_layer;
    reference.layer_count = view.layer_count;
    return reference;
}

std::uint32_t add_string(CommandStream& stream, std::string_view text) {
    stream.strings.emplace_back(text);
    return static_cast<std::uint32_t>(stream.strings.size() - 1);
}

}  // namespace

CommandList::CommandList(std::unique_ptr<CommandStream> stream) : stream_(std::move(stream)) {}
CommandList::CommandList(CommandList&&) noexcept = default;

CommandList& CommandList::operator=(CommandList&& other) noexcept {
    std::swap(stream_, other.stream_);
    return *this;
}

CommandList::~CommandList() {
    if (!stream_ || !stream_->pool) return;
    const std::shared_ptr<StreamPool> pool = stream_->pool;
    pool->give_back(std::move(stream_));
}

Expected<void> CommandList::status() const {
    if (!stream_)
        return fail(ErrorCode::validation, "record", "command list",
                    "expected a list that is being recorded, found one that was submitted or moved from [" +
                        std::string(code_of(Rule::list_already_submitted)) + "].",
                    "Make a new list with Device::create_command_list.");
    return stream_->status;
}

// Every call but the destructor does nothing on a failed list, and on one that was submitted.
#define NACRE_RECORD \
    if (!stream_ || !stream_->status) return
// The same, and the validator has to agree where there is one.
#define NACRE_RECORD_IF_VALID(check)                                \
    NACRE_RECORD;                                                   \
    if (stream_->validator)                                         \
        if (Check problem = stream_->validator->check) {            \
            stream_->status = stream_->validator->reject(*problem); \
            return;                                                 \
        }                                                           \
    static_assert(true)

void CommandList::begin_render_pass(const RenderPassDesc& desc) {
    NACRE_RECORD_IF_VALID(begin_render_pass(desc));
    const std::uint32_t name = add_string(*stream_, desc.name);
    auto& command = stream_->append<BeginRenderPassCommand>(desc.color.size() * sizeof(ColorAttachmentCommand));
    command.color_count = static_cast<std::uint32_t>(desc.color.size());
    command.name = name;
    const DepthStencilAttachment& depth = desc.depth_stencil;
    command.has_depth_stencil = static_cast<bool>(depth.view.texture);
    command.read_only = depth.read_only;
    command.depth_load = depth.depth_load;
    command.stencil_load = depth.stencil_load;
    command.depth_store = depth.depth_store;
    command.stencil_store = depth.stencil_store;
    command.clear_stencil = depth.clear_stencil;
    command.clear_depth = depth.clear_depth;
    command.depth_stencil = record(depth.view);
    for (std::size_t i = 0; i < desc.color.size(); ++i) {
        const ColorAttachment& color = desc.color[i];
        auto* attachment = new (command.colors() + i) ColorAttachmentCommand{};
        attachment->view = record(color.view);
        attachment->resolve = record(color.resolve);
        attachment->clear = color.clear;
        attachment->load = color.load;
        attachment->store = color.store;
    }
}

void CommandList::end_render_pass() {
    NACRE_RECORD_IF_VALID(end_render_pass());
    stream_->append<EndRenderPassCommand>();
}

void CommandList::set_pipeline(GraphicsPipeline pipeline) {
    NACRE_RECORD_IF_VALID(set_pipeline(pipeline));
    stream_->append<SetGraphicsPipelineCommand>().pipeline.handle = pipeline;
}

void CommandList::set_pipeline(ComputePipeline pipeline) {
    NACRE_RECORD_IF_VALID(set_pipeline(pipeline));
    stream_->append<SetComputePipelineCommand>().pipeline.handle = pipeline;
}

void CommandList::set_bind_group(std::uint32_t index, BindGroup group) {
    NACRE_RECORD_IF_VALID(set_bind_group(index, group));
    auto& command = stream_->append<SetBindGroupCommand>();
    command.group.handle = group;
    command.index = index;
}

void CommandList::set_push_constants(std::span<const std::byte> data, std::uint32_t offset) {
    NACRE_RECORD_IF_VALID(set_push_constants(data.size(), offset));
    auto& command = stream_->append<SetPushConstantsCommand>(data.size());
    command.offset = offset;
    command.size = static_cast<std::uint32_t>(data.size());
    if (!data.empty()) std::memcpy(command.data(), data.data(), data.size());
}

void CommandList::set_vertex_buffer(std::uint32_t slot, Buffer buffer, std::uint64_t offset) {
    NACRE_RECORD_IF_VALID(set_vertex_buffer(slot, buffer, offset));
    auto& command = stream_->append<SetVertexBufferCommand>();
    command.buffer.handle = buffer;
    command.offset = offset;
    command.slot = slot;
}

void CommandList::set_index_buffer(Buffer buffer, IndexType type, std::uint64_t offset) {
    NACRE_RECORD_IF_VALID(set_index_buffer(buffer, type, offset));
    auto& command = stream_->append<SetIndexBufferCommand>();
    command.buffer.handle = buffer;
    command.offset = offset;
    command.index_type = type;
}

void CommandList::set_viewport(const Viewport& viewport) {
    NACRE_RECORD_IF_VALID(set_viewport(viewport));
    stream_->append<SetViewportCommand>().viewport = viewport;
}

void CommandList::set_scissor(const Rectangle& scissor) {
    NACRE_RECORD_IF_VALID(set_scissor(scissor));
    stream_->append<SetScissorCommand>().scissor = scissor;
}

void CommandList::set_stencil_reference(std::uint8_t reference) {
    NACRE_RECORD_IF_VALID(set_pass_state("set stencil reference"));
    stream_->append<SetStencilReferenceCommand>().reference = reference;
}

void CommandList::set_blend_constants(std::array<float, 4> constants) {
    NACRE_RECORD_IF_VALID(set_pass_state("set blend constants"));
    stream_->append<SetBlendConstantsCommand>().constants = constants;
}

void CommandList::draw(const DrawArguments& arguments) {
    NACRE_RECORD_IF_VALID(draw(arguments));
    stream_->append<DrawCommand>().arguments = arguments;
}

void CommandList::draw_indexed(const DrawIndexedArguments& arguments) {
    NACRE_RECORD_IF_VALID(draw_indexed(arguments));
    stream_->append<DrawIndexedCommand>().arguments = arguments;
}

void CommandList::draw_indirect(Buffer arguments, std::uint64_t offset, std::uint32_t count, std::uint32_t stride) {
    NACRE_RECORD_IF_VALID(draw_indirect(arguments, offset, count, stride, false));
    auto& command = stream_->append<DrawIndirectCommand>();
    command.arguments.handle = arguments;
    command.offset = offset;
    command.count = count;
    command.stride = stride;
}

void CommandList::draw_indexed_indirect(Buffer arguments, std::uint64_t offset, std::uint32_t count,
                                        std::uint32_t stride) {
    NACRE_RECORD_IF_VALID(draw_indirect(arguments, offset, count, stride, true));
    auto& command = stream_->append<DrawIndexedIndirectCommand>();
    command.arguments.handle = arguments;
    command.offset = offset;
    command.count = count;
    command.stride = stride;
}

void CommandList::dispatch(const DispatchArguments& groups) {
    NACRE_RECORD_IF_VALID(dispatch(groups));
    stream_->append<DispatchCommand>().groups = groups;
}

void CommandList::dispatch_indirect(Buffer arguments, std::uint64_t offset) {
    NACRE_RECORD_IF_VALID(dispatch_indirect(arguments, offset));
    auto& command = stream_->append<DispatchIndirectCommand>();
    command.arguments.handle = arguments;
    command.offset = offset;
}

void CommandList::copy_buffer(Buffer source, std::uint64_t source_offset, Buffer destination,
                              std::uint64_t destination_offset, std::uint64_t size) {
    NACRE_RECORD_IF_VALID(copy_buffer(source, source_offset, destination, destination_offset, size));
    if (size == 0) return;
    auto& command = stream_->append<CopyBufferCommand>();
    command.source.handle = source;
    command.destination.handle = destination;
    command.source_offset = source_offset;
    command.destination_offset = destination_offset;
    command.size = size;
}

void CommandList::copy_buffer_to_texture(Buffer source, Texture destination, const BufferTextureCopy& region) {
    NACRE_RECORD_IF_VALID(copy_buffer_and_texture(source, destination, region, true));
    auto& command = stream_->append<CopyBufferToTextureCommand>();
    command.source.handle = source;
    command.destination.handle = destination;
    command.region = region;
}

void CommandList::copy_texture_to_buffer(Texture source, Buffer destination, const BufferTextureCopy& region) {
    NACRE_RECORD_IF_VALID(copy_buffer_and_texture(destination, source, region, false));
    auto& command = stream_->append<CopyTextureToBufferCommand>();
    command.source.handle = source;
    command.destination.handle = destination;
    command.region = region;
}

void CommandList::copy_texture(Texture source, Texture destination, const TextureCopy& region) {
    NACRE_RECORD_IF_VALID(copy_texture(source, destination, region));
    auto& command = stream_->append<CopyTextureCommand>();
    command.source.handle = source;
    command.destination.handle = destination;
    command.region = region;
}

void CommandList::fill_buffer(Buffer buffer, std::uint32_t value, std::uint64_t offset, std::uint64_t size) {
    NACRE_RECORD_IF_VALID(fill_buffer(buffer, offset, size));
    if (size == 0) return;
    auto& command = stream_->append<FillBufferCommand>();
    command.buffer.handle = buffer;
    command.offset = offset;
    command.size = size;
    command.value = value;
}

void CommandList::clear_texture(const TextureView& view, ClearColor color) {
    NACRE_RECORD_IF_VALID(clear(view, false));
    auto& command = stream_->append<ClearTextureCommand>();
    command.view = record(view);
    command.color = color;
}

void CommandList::clear_depth_stencil(const TextureView& view, float depth, std::uint8_t stencil) {
    NACRE_RECORD_IF_VALID(clear(view, true));
    auto& command = stream_->append<ClearDepthStencilCommand>();
    command.view = record(view);
    command.depth = depth;
    command.stencil = stencil;
}

void CommandList::generate_mips(Texture texture) {
    NACRE_RECORD_IF_VALID(generate_mips(texture));
    stream_->append<GenerateMipsCommand>().texture.handle = texture;
}

namespace {

BuildAccelerationStructureCommand& record(CommandStream& stream, AccelerationStructure structure,
                                          std::span<const GeometrySource> sources, bool is_update) {
    auto& command = stream.append<BuildAccelerationStructureCommand>(sources.size() * sizeof(GeometrySourceCommand));
    command.structure.handle = structure;
    command.count = static_cast<std::uint32_t>(sources.size());
    command.is_update = is_update;
    for (std::size_t i = 0; i < sources.size(); ++i) {
        auto* source = new (command.sources() + i) GeometrySourceCommand{};
        source->vertices.handle = sources[i].vertices;
        source->indices.handle = sources[i].indices;
        source->vertex_offset = sources[i].vertex_offset;
        source->index_offset = sources[i].index_offset;
    }
    return command;
}

BuildAccelerationStructureCommand& record(CommandStream& stream, AccelerationStructure structure,
            std::span<const AccelerationStructureInstance> instances, bool is_update) {
    auto& command = stream.append<BuildAccelerationStructureCommand>(instances.size() * sizeof(InstanceCommand));
    command.structure.handle = structure;
    command.count = static_cast<std::uint32_t>(instances.size());
    command.is_top = true;
    command.is_update = is_update;
    for (std::size_t i = 0; i < instances.size(); ++i) {
        auto* instance = new (command.instances() + i) InstanceCommand{};
        instance->bottom_level.handle = instances[i].bottom_level;
        instance->transform = instances[i].transform;
        instance->custom_index = instances[i].custom_index;
        instance->table_offset = instances[i].table_offset;
        instance->mask = instances[i].mask;
        instance->flags = instances[i].flags;
    }
    return command;
}

/// Bytes of a command are counted in 32 bits; more sources than any structure takes are not recorded in full.
template <typename Source>
std::span<const Source> recordable(std::span<const Source> sources) {
    return sources.first(std::min<std::size_t>(sources.size(), max_structure_instances + std::size_t{1}));
}

}  // namespace

void CommandList::build_acceleration_structure(AccelerationStructure bottom_level,
                                               std::span<const GeometrySource> sources) {
    record_build(bottom_level, sources, false);
}
void CommandList::build_acceleration_structure(AccelerationStructure top_level,
                                               std::span<const AccelerationStructureInstance> instances) {
    record_build(top_level, instances, false);
}
void CommandList::update_acceleration_structure(AccelerationStructure bottom_level,
                                                std::span<const GeometrySource> sources) {
    record_build(bottom_level, sources, true);
}
void CommandList::update_acceleration_structure(AccelerationStructure top_level,
                                                std::span<const AccelerationStructureInstance> instances) {
    record_build(top_level, instances, true);
}

template <typename Source>
void CommandList::record_build(AccelerationStructure structure, std::span<const Source> sources, bool is_update) {
    NACRE_RECORD;
    BuildAccelerationStructureCommand& command = record(*stream_, structure, recordable(sources), is_update);
    // Checked where it lies: a failed list is not submitted.
    if (stream_->validator)
        if (Check problem = stream_->validator->build_acceleration_structure(command))
            stream_->status = stream_->validator->reject(*problem);
}

void CommandList::write_timestamp(QueryPool pool, std::uint32_t index) {
    NACRE_RECORD_IF_VALID(write_timestamp(pool, index));
    auto& command = stream_->append<WriteTimestampCommand>();
    command.pool.handle = pool;
    command.index = index;
}

void CommandList::begin_occlusion_query(QueryPool pool, std::uint32_t index) {
    NACRE_RECORD_IF_VALID(begin_occlusion_query(pool, index));
    auto& command = stream_->append<BeginOcclusionQueryCommand>();
    command.pool.handle = pool;
    command.index = index;
}

void CommandList::end_occlusion_query(QueryPool pool, std::uint32_t index) {
    NACRE_RECORD_IF_VALID(end_occlusion_query(pool, index));
    auto& command = stream_->append<EndOcclusionQueryCommand>();
    command.pool.handle = pool;
    command.index = index;
}

void CommandList::push_debug_group(std::string_view name) {
    NACRE_RECORD_IF_VALID(push_debug_group());
    const std::uint32_t index = add_string(*stream_, name);
    stream_->append<PushDebugGroupCommand>().name = index;
}

void CommandList::pop_debug_group() {
    NACRE_RECORD_IF_VALID(pop_debug_group());
    stream_->append<PopDebugGroupCommand>();
}

void CommandList::begin_statement(std::string_view pass, std::span<const StatedAccess> accesses) {
    NACRE_RECORD_IF_VALID(begin_statement());
    const std::uint32_t name = add_string(*stream_, pass);
    auto& command = stream_->append<BeginStatementCommand>(accesses.size_bytes());
    command.name = name;
    command.count = static_cast<std::uint32_t>(accesses.size());
    if (!accesses.empty())
        std::memcpy(reinterpret_cast<std::byte*>(&command + 1), accesses.data(), accesses.size_bytes());
}

void CommandList::end_statement() {
    NACRE_RECORD_IF_VALID(end_statement());
    stream_->append<EndStatementCommand>();
}

#undef NACRE_RECORD_IF_VALID
#undef NACRE_RECORD

}  // namespace nacre::rhi
