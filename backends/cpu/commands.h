// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "backends/cpu/bind_group.h"
#include "backends/cpu/checks/check_functions.h"
#include "backends/cpu/pipeline.h"
#include "backends/cpu/query_pool.h"
#include "backends/cpu/transfer.h"
#include "backends/cpu/watchdog.h"

/// @file
/// Commands: a submission is copied on the caller's thread (streams belong to the caller) and executed on the queue's.
/// Commands are carried out one after another, each on all threads, so barriers cost nothing.

namespace nacre::cpu {

/// A submission of its own.
struct FlatPlan {
    /// Commands as in rhi::CommandStream, in one piece; `begin_list_command` begins each list.
    std::vector<std::uint64_t> words;
    std::uint64_t serial = 0;
    /// For checks: names of the lists and of what is in them.
    struct ListNames {
        std::string name;
        std::vector<std::string> strings;
    };
    std::vector<ListNames> lists;
    /// Uses that a statement does not name (see rhi::UnstatedUse).
    struct Unstated {
        std::size_t statement = 0;  ///< Where the command that begins it lies in `words`.
        CpuBuffer* buffer = nullptr;
        CpuTexture* texture = nullptr;
        rhi::ResourceUse stated{}, found{};
    };
    std::vector<Unstated> unstated;
    std::vector<const rhi::BackendBuffer*> host_buffers;  ///< In use that the host can map.
};
inline constexpr std::uint16_t begin_list_command = 0xffff;

/// @param for_checks  with names, and with the commands that only names and checks need
FlatPlan flatten(const rhi::ExecutionPlan& plan, bool for_checks = false);

/// What is looked for while commands are executed.
struct ExecutorChecks {
    std::uint32_t flags = 0;  ///< CheckFlags
    std::uint32_t seed = 0;
    FaultLog* log = nullptr;  ///< Set where flags are.
};

/// Executes plans; queue thread only.
class Executor {
  public:
    Executor(Scheduler& scheduler, Watchdog& watchdog, std::uint32_t lanes, const ExecutorChecks& checks = {});

    /// Returns an empty text, or why the device must be given up. May throw std::bad_alloc.
    std::string execute(const FlatPlan& plan);

    /// From here on the shaders of `shader` tell what they compute; null: no more. Called while nothing is executed.
    void set_trace(ShaderTrace* trace, std::string shader, Compiler* compiler);

  private:
    [[nodiscard]] bool is_traced(const std::string& name) const;

    void execute(const rhi::CommandHeader& header, const std::byte* payload);
    void reset_state();

    // Render passes (render_passes.cpp).
    void begin_render_pass(const rhi::BeginRenderPassCommand& command);
    void end_render_pass();
    void begin_occlusion_query(CpuQueryPool& pool, std::uint32_t index);
    void end_occlusion_query();
    void write_timestamp(CpuQueryPool& pool, std::uint32_t index);

    // Draws and dispatches (shader_work.cpp).
    [[nodiscard]] ShaderContext make_context();
    void draw(const DrawCall& call, std::uint32_t draw_index);
    void draw(const rhi::DrawArguments& arguments, std::uint32_t draw_index);
    void draw_indexed(const rhi::DrawIndexedArguments& arguments, std::uint32_t draw_index);
    void draw_indirect(const rhi::DrawIndirectCommand& command);
    void draw_indexed_indirect(const rhi::DrawIndexedIndirectCommand& command);
    void dispatch(rhi::DispatchArguments groups);
    void dispatch_indirect(const rhi::DispatchIndirectCommand& command);
    void set_push_constants(const rhi::SetPushConstantsCommand& command);

    // Checks (command_checks.cpp).
    /// What the shaders of a dispatch or draw are told; lives until `forget_checks`.
    const CommandChecks* make_checks(const char* what, std::uint32_t number);
    /// Where the command stands: "list 'frame', pass 'lighting'".
    [[nodiscard]] std::string place() const;
    /// What a draw reads besides what its shaders do: indices, and the targets that its tests ask.
    void check_draw(const DrawCall& call, const CommandChecks& checks);
    /// Reports indirect arguments that nothing has written. What they would start could take any time: it is left out.
    bool are_undefined(const rhi::BufferReference& reference, std::uint64_t offset, std::uint64_t bytes,
                       const char* what);
    void add_undefined(const std::string& attempted, const std::string& subject, const std::string& expected,
                       const std::string& found);
    void begin_scope() { ++scope_, forget_checks(); }
    void forget_checks() { command_checks_.clear(); }
    void note_name(const rhi::CommandHeader& header, const std::byte* payload);
    /// Content that a command outside of render passes has defined.
    void note_transfer(const rhi::CommandHeader& header, const std::byte* payload);
    void note_pass_begin(const rhi::BeginRenderPassCommand& command);
    void note_pass_end();
    void prepare_workgroup_checks();
    /// What a statement does not name is kept from its commands: nothing makes them wait for it, so in the worst order
    /// they find undefined content, and what they write is overwritten.
    void begin_statement(const rhi::CommandHeader& header, const std::byte* payload);
    void end_statement();

    /// Notes which shader ran when the watchdog's limit passed.
    void look_at_watchdog(const std::string& shader);

    Scheduler& scheduler_;
    Watchdog& watchdog_;
    Transfer transfer_;
    Rasterizer rasterizer_;
    std::string stopped_;  ///< Why nothing more is executed.

    // What the list has set.
    CpuGraphicsPipeline* pipeline_ = nullptr;
    CpuComputePipeline* compute_pipeline_ = nullptr;
    std::array<CpuBindGroup*, max_groups> groups_{};
    struct alignas(16) PushConstants {
        std::array<std::byte, push_constant_capacity> bytes{};
    };
    /// The values in use are the last ones. Those before them belong to draws that the rasterizer has not finished.
    std::deque<PushConstants> push_constants_;
    bool push_constants_in_use_ = false;
    struct VertexBuffer {
        const CpuBuffer* buffer = nullptr;
        std::uint64_t offset = 0;
    };
    std::array<VertexBuffer, max_vertex_buffers> vertex_buffers_{};
    const CpuBuffer* index_buffer_ = nullptr;
    std::uint64_t index_offset_ = 0;
    rhi::IndexType index_type_ = rhi::IndexType::uint16;

    // The open render pass.
    bool in_pass_ = false;
    RenderTargets targets_{};
    struct Resolve {
        std::size_t color = 0;
        ImageView destination{};
    };
    std::vector<Resolve> resolves_;
    rhi::Viewport viewport_{};
    rhi::Rectangle scissor_{};
    std::uint8_t stencil_reference_ = 0;
    std::array<float, 4> blend_constants_{};
    std::string pass_shaders_;  ///< Of the last draws, for messages.
    CpuQueryPool* occlusion_ = nullptr;
    std::uint32_t occlusion_index_ = 0;
    std::uint64_t passed_before_ = 0;

    ShaderTrace* trace_ = nullptr;
    std::string traced_shader_;
    Compiler* compiler_ = nullptr;
    const ExecutorChecks checks_;
    const FlatPlan* plan_ = nullptr;
    std::size_t list_ = 0;  ///< Lists that have begun.
    std::uint32_t draws_ = 0, dispatches_ = 0;  ///< Of the list.
    std::string pass_name_;
    std::vector<std::string> debug_groups_;
    std::uint32_t scope_ = 0;
    std::atomic<std::uint64_t> batches_{0};
    std::deque<CommandChecks> command_checks_;
    std::vector<std::unique_ptr<CheckedMemory>> workgroup_checks_;
    std::vector<CheckedMemory*> workgroup_check_pointers_;
    struct Attachment {
        ImageView view{};
        CheckedMemory* checked = nullptr;
        bool is_depth = false, is_discarded = false, is_stencil_discarded = false;
        bool loads_nothing = false, loads_no_stencil = false;  ///< What is kept of it nothing has ever written.
    };
    std::vector<Attachment> attachments_;  ///< Of the open pass, where there are checks.
    /// Content that is kept from the commands of the open statement.
    struct Withheld {
        CheckedMemory* memory = nullptr;
        std::vector<std::byte> content;
        std::vector<std::uint64_t> undefined;
        bool is_poisoned = false, keeps_writes = false;
    };
    std::vector<Withheld> withheld_;

    std::vector<MemoryBlock> workgroup_memory_;  ///< One for each thread.
    std::shared_ptr<HostMemory> scratch_;
};

}  // namespace nacre::cpu
