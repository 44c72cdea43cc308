// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <memory>
#include <string>
#include <vector>

#include "rhi/command_list.h"
#include "rhi/device_state.h"
#include "rhi/object_checks.h"

namespace nacre::rhi {

/// Checks the calls of one command list as they are made, so that an error is told where the mistake is. One for each
/// list of a device with validation on; the list calls it before it records a command.
///
/// It knows the objects by the device's tables, which it looks into under a shared lock.
class CommandValidator {
  public:
    CommandValidator(std::shared_ptr<DeviceShared> device, std::string list)
        : device_(std::move(device)), list_(std::move(list)) {}

    Check begin_render_pass(const RenderPassDesc& desc);
    Check end_render_pass();
    Check set_pipeline(GraphicsPipeline pipeline);
    Check set_pipeline(ComputePipeline pipeline);
    Check set_bind_group(std::uint32_t index, BindGroup group);
    Check set_push_constants(std::size_t size, std::uint32_t offset);
    Check set_vertex_buffer(std::uint32_t slot, Buffer buffer, std::uint64_t offset);
    Check set_index_buffer(Buffer buffer, IndexType type, std::uint64_t offset);
    Check set_viewport(const Viewport& viewport);
    Check set_scissor(const Rectangle& scissor);
    Check set_pass_state(const char* attempted);
    Check draw(const DrawArguments& arguments);
    Check draw_indexed(const DrawIndexedArguments& arguments);
    Check draw_indirect(Buffer arguments, std::uint64_t offset, std::uint32_t count, std::uint32_t stride,
                        bool indexed);
    Check dispatch(const DispatchArguments& groups);
    Check dispatch_indirect(Buffer arguments, std::uint64_t offset);
    Check copy_buffer(Buffer source, std::uint64_t source_offset, Buffer destination, std::uint64_t destination_offset,
                      std::uint64_t size);
    Check copy_buffer_and_texture(Buffer buffer, Texture texture, const BufferTextureCopy& region, bool to_texture);
    Check copy_texture(Texture source, Texture destination, const TextureCopy& region);
    Check fill_buffer(Buffer buffer, std::uint64_t offset, std::uint64_t size);
    Check clear(const TextureView& view, bool depth);
    Check generate_mips(Texture texture);
    /// The command with its handles.
    Check build_acceleration_structure(const BuildAccelerationStructureCommand& command);
    Check write_timestamp(QueryPool pool, std::uint32_t index);
    Check begin_occlusion_query(QueryPool pool, std::uint32_t index);
    Check end_occlusion_query(QueryPool pool, std::uint32_t index);
    Check push_debug_group();
    Check pop_debug_group();
    Check begin_statement();
    Check end_statement();
    /// Tells a problem that a check has found, and makes it the list's error.
    std::unexpected<Error> reject(Problem problem) { return device_->messages.reject(std::move(problem)); }
    /// What is left open when the list is submitted.
    Check finish();

  private:
    struct BoundBuffer {
        Buffer buffer{};
        std::uint64_t offset = 0;
    };

    [[nodiscard]] const Capabilities& capabilities() const { return device_->capabilities; }
    [[nodiscard]] std::string place() const;
    [[nodiscard]] Problem problem(Rule rule, const char* attempted, std::string reason, std::string remedy,
                                  const std::string& subject = {}) const;
    Check inside(const char* attempted) const;
    Check outside(const char* attempted) const;
    void unset_state();

    /// Looks an object up; null and a problem in `failed` where it is not there.
    template <typename HandleType>
    auto* look_up(HandleType handle, const char* attempted, const char* kind, Check& failed) {
        auto& table = device_->tables.table(handle);
        auto* object = table.find(handle);
        if (!object) {
            failed = handle_problem(table, handle, attempted, kind);
            failed->subject = place() + ", " + failed->subject;
        }
        return object;
    }

    Check check_attachment(const TextureView& view, bool depth, std::size_t index, TextureUsage usage);
    Check check_resolve(const ColorAttachment& color, std::size_t index);
    Check check_groups(const PipelineCommon& pipeline, const char* attempted);
    Check check_group_content(const PipelineCommon& pipeline, const BindGroupObject& group, std::uint32_t index,
                              const char* attempted);
    Check check_push_constants(const PipelineCommon& pipeline, const char* attempted);
    Check check_draw(const char* attempted, const GraphicsPipelineObject*& pipeline);
    Check check_vertices(const GraphicsPipelineObject& pipeline, const char* attempted, const DrawArguments& arguments,
                         bool per_vertex, bool per_instance);
    Check check_index_buffer(const char* attempted, std::uint64_t& indices);
    Check check_indirect(const char* attempted, Buffer arguments, std::uint64_t offset, std::uint32_t count,
                         std::uint32_t stride, std::uint32_t bytes);
    Check check_query(const char* attempted, QueryPool pool, std::uint32_t index, QueryType type);
    Check check_geometry_source(const char* attempted, const AccelerationStructureDesc& structure, std::size_t index,
                                const GeometrySourceCommand& source);
    Check check_texture_box(const char* attempted, const TextureDesc& desc, std::uint32_t mip, std::uint32_t layer,
                            std::uint32_t layer_count, const Offset3D& offset, const Extent3D& extent) const;

    std::shared_ptr<DeviceShared> device_;
    std::string list_;

    // The open render pass.
    bool in_pass_ = false;
    std::string pass_name_;
    std::vector<Format> color_formats_;
    Format depth_format_ = Format::undefined;
    std::uint32_t width_ = 0, height_ = 0, samples_ = 0;
    bool read_only_depth_ = false;
    bool has_size_ = false;
    std::vector<std::array<std::uint64_t, 3>> attachments_;  ///< Texture, mip, layer.

    // State of draws and dispatches.
    GraphicsPipeline graphics_{};
    ComputePipeline compute_{};
    std::array<BindGroup, most_bind_groups> groups_{};
    std::uint32_t checked_groups_ = 0;  ///< Bit for each group that was checked against the current pipeline.
    std::bitset<1024> push_constants_;  ///< For each 4 bytes, whether they were set.
    std::array<BoundBuffer, most_vertex_buffers> vertex_buffers_{};
    BoundBuffer index_buffer_{};
    IndexType index_type_ = IndexType::uint16;

    bool query_open_ = false;
    QueryPool open_pool_{};
    std::uint32_t open_query_ = 0;
    std::uint32_t debug_groups_ = 0;
    bool statement_open_ = false;
};

}  // namespace nacre::rhi
