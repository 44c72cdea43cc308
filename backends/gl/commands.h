// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "backends/gl/bind_group.h"
#include "backends/gl/pipeline.h"
#include "backends/gl/provoking_vertex.h"
#include "backends/gl/query_pool.h"
#include "backends/gl/transfer.h"

/// @file
/// Commands: a submission is copied into a flat list on the caller's thread (streams belong to the caller), with the
/// memory barriers in their places, and is executed on the worker thread.

namespace nacre::gl {

/// A submission of its own.
struct FlatPlan {
    /// Commands as in rhi::CommandStream, in one piece; `barrier_command` stands for a glMemoryBarrier.
    std::vector<std::uint64_t> words;
    std::vector<std::string> strings;
    std::uint64_t serial = 0;
};
inline constexpr std::uint16_t barrier_command = 0xffff;
/// Begins each list: what was bound is unbound.
inline constexpr std::uint16_t begin_list_command = 0xfffe;

FlatPlan flatten(const rhi::ExecutionPlan& plan);

/// Executes plans; worker thread only.
class Executor {
  public:
    explicit Executor(Driver& driver) : driver_(driver), gl_(driver.gl), transfer_(driver), provoking_vertex_(driver) {}
    void execute(const FlatPlan& plan);
    void destroy();

  private:
    void execute(const rhi::CommandHeader& header, const std::byte* payload, const FlatPlan& plan);

    // Render passes (commands.cpp).
    void reset_state();
    void begin_render_pass(const rhi::BeginRenderPassCommand& command);
    void end_render_pass();
    void clear_targets(const rhi::BeginRenderPassCommand& command);

    // Draws and dispatches (draws.cpp).
    bool prepare_draw();
    bool prepare_dispatch();
    void bind_resources(const Program& program, std::uint64_t pipeline_id);
    void bind_slot(const Program::Slot& slot);
    void bind_texture(const Program::TextureSlot& slot);
    void bind_image(const SlotRange& range, std::uint32_t unit, GlBindGroup::Entry& entry);
    void bind_texel_image(const SlotRange& range, std::uint32_t unit, GlBindGroup& group, GlBindGroup::Entry& entry);
    void bind_image_unit(std::uint32_t unit, GLuint name, const BoundState::Image& wanted);
    void push_constants(Program& program);
    void bind_vertex_buffers();
    void bind_index_buffer();
    void use_program(GLuint name);
    void set_base_instance(std::uint32_t first_instance);
    /// True where flat values need the corners of triangles turned.
    [[nodiscard]] bool turns_corners() const;
    void draw_turned(const ProvokingVertex::Draw& draw, std::uint32_t instances, std::uint32_t first_instance);
    void draw(const rhi::DrawArguments& arguments);
    void draw_indexed(const rhi::DrawIndexedArguments& arguments);
    void draw_indirect(const rhi::DrawIndirectCommand& command);
    void draw_indexed_indirect(const rhi::DrawIndexedIndirectCommand& command);
    void bind_indirect(const GlBuffer& buffer);

    Driver& driver_;
    const Functions& gl_;
    Transfer transfer_;
    ProvokingVertex provoking_vertex_;

    // What the list has set.
    GlGraphicsPipeline* pipeline_ = nullptr;
    GlComputePipeline* compute_pipeline_ = nullptr;
    std::array<GlBindGroup*, 8> groups_{};
    bool groups_changed_ = true;
    std::uint64_t bound_for_ = 0;  ///< Pipeline that the groups were last bound for.
    std::vector<std::byte> push_data_ = std::vector<std::byte>(256);
    struct VertexBuffer {
        GlBuffer* buffer = nullptr;
        std::uint64_t offset = 0;
    };
    std::array<VertexBuffer, 32> vertex_buffers_{};
    GlBuffer* index_buffer_ = nullptr;
    std::uint64_t index_offset_ = 0;
    rhi::IndexType index_type_ = rhi::IndexType::uint16;
    std::uint32_t stencil_reference_ = 0;
    bool stencil_changed_ = false;
    rhi::BeginRenderPassCommand pass_{};
    std::vector<rhi::ColorAttachmentCommand> pass_colors_;
    GLuint pass_framebuffer_ = 0;
    GlQueryPool* occlusion_ = nullptr;
    GLuint small_indirect_ = 0;    ///< Holds the arguments of draws that only an indirect draw can express.
    GLuint shifted_indices_ = 0;   ///< Copy of an index buffer for indirect draws that start inside it.
};

}  // namespace nacre::gl
