// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <numeric>
#include <optional>

#include "backends/cpu/capabilities.h"
#include "backends/cpu/commands.h"

/// @file
/// Draws and dispatches: what shaders see of the state that lists set.

namespace nacre::cpu {
namespace {

/// Indirect arguments; nothing where they do not lie in the buffer.
template <typename Arguments>
std::optional<Arguments> read_arguments(const rhi::BufferReference& reference, std::uint64_t offset) {
    const auto& buffer = *static_cast<const CpuBuffer*>(reference.object);
    if (buffer.size_from(offset) < sizeof(Arguments)) return {};
    Arguments arguments;
    std::memcpy(&arguments, buffer.data() + offset, sizeof arguments);
    return arguments;
}

/// total * part / parts, without overflow on the way.
std::uint64_t share(std::uint64_t total, std::uint64_t part, std::uint64_t parts) {
    return total / parts * part + total % parts * part / parts;
}

/// Puts the numbers below a total into another order, always the same for one seed.
class Shuffle {
  public:
    Shuffle(std::uint64_t total, std::uint32_t seed) : total_(total) {
        if (total >> 32) return;  // Backwards is order enough, and products stay in range.
        // Steps of about a golden part of the whole, which have no factor in common with it: neighbors come far apart.
        step_ =
            std::max<std::uint64_t>(1, static_cast<std::uint64_t>(static_cast<double>(total) * 0.6180339887) + seed) %
            total;
        while (std::gcd(step_, total) != 1) ++step_;
    }
    std::uint64_t operator()(std::uint64_t index) const {
        return total_ - 1 - index * step_ % total_;
    }

  private:
    std::uint64_t total_, step_ = 1;
};

}  // namespace

void Executor::set_push_constants(const rhi::SetPushConstantsCommand& command) {
    if (command.offset > push_constant_capacity || command.size > push_constant_capacity - command.offset) return;
    if (push_constants_in_use_) {
        push_constants_.push_back(PushConstants(push_constants_.back()));
        push_constants_in_use_ = false;
    }
    std::memcpy(push_constants_.back().bytes.data() + command.offset, command.data(), command.size);
}

ShaderContext Executor::make_context() {
    ShaderContext context{};
    for (std::size_t i = 0; i < groups_.size(); ++i) {
        if (!groups_[i]) continue;
        context.groups[i] = groups_[i]->descriptors.data();
        context.group_sizes[i] = static_cast<std::uint32_t>(groups_[i]->descriptors.size());
    }
    context.push_constants = push_constants_.back().bytes.data();
    // Draws may be carried out after the values have changed; dispatches are over when they return.
    push_constants_in_use_ = in_pass_;
    context.state = &watchdog_.state();
    context.trace = trace_;
    return context;
}

void Executor::set_trace(ShaderTrace* trace, std::string shader, Compiler* compiler) {
    trace_ = trace;
    traced_shader_ = std::move(shader);
    compiler_ = compiler;
}

bool Executor::is_traced(const std::string& name) const {
    return trace_ && (name == traced_shader_ || name.starts_with(traced_shader_ + "/") ||
                      name.find("/" + traced_shader_ + "/") != std::string::npos);
}

void Executor::look_at_watchdog(const std::string& shader) {
    if (!stopped_.empty() || !watchdog_.has_expired()) return;
    if (checks_.log) stopped_ = checks_.log->stop();
    if (!stopped_.empty()) return;
    const double seconds = std::chrono::duration<double>(watchdog_.limit()).count();
    stopped_ = fmt::format("shader {} ran for longer than {} s and was stopped (NACRE_CPU_WATCHDOG_SECONDS)",
                           shader.empty() ? "of an empty pass" : shader, seconds);
}

void Executor::draw(const DrawCall& call, std::uint32_t draw_index) {
    if (call.count == 0 || call.instance_count == 0 || !pipeline_ || !in_pass_) return;
    DrawState state;
    state.pipeline = &pipeline_->raster;
    if (is_traced(state.pipeline->fragment.name))
        if (const RasterPipeline* traced = pipeline_->traced(*compiler_)) state.pipeline = traced;
    state.context = make_context();
    if (checks_.flags) {
        const CommandChecks* const checks = make_checks("draw", ++draws_);
        state.context.checks = checks;
        if (checks_.flags & (check_sanitize | check_hostile)) {
            state.check_blend = check_blend;
            check_draw(call, *checks);
        }
    }
    for (std::size_t i = 0; i < vertex_buffers_.size(); ++i) {
        const VertexBuffer& bound = vertex_buffers_[i];
        const std::uint64_t size = bound.buffer ? bound.buffer->size_from(bound.offset) : 0;
        if (size != 0)
            state.vertex.buffers[i] = {bound.buffer->data() + bound.offset, size,
                                       bound.buffer->shadow() ? bound.buffer->shadow() + 2 * bound.offset : nullptr};
    }
    state.vertex.base_vertex = call.indexed ? call.vertex_offset : static_cast<std::int32_t>(call.first);
    state.vertex.base_instance = call.first_instance;
    state.vertex.draw_index = draw_index;
    state.viewport = viewport_;
    const std::uint32_t left = std::min(scissor_.x, targets_.width), top = std::min(scissor_.y, targets_.height);
    state.scissor = {left, top, std::min(scissor_.width, targets_.width - left),
                     std::min(scissor_.height, targets_.height - top)};
    state.stencil_reference = stencil_reference_;
    state.blend_constants = blend_constants_;
    pass_shaders_ = pipeline_->shader_names;
    {
        const Watchdog::Step step(watchdog_);
        rasterizer_.draw(state, call);
    }
    look_at_watchdog(pass_shaders_);
}

void Executor::draw(const rhi::DrawArguments& arguments, std::uint32_t draw_index) {
    DrawCall call;
    call.first = arguments.first_vertex;
    call.count = arguments.vertex_count;
    call.first_instance = arguments.first_instance;
    call.instance_count = arguments.instance_count;
    draw(call, draw_index);
}

void Executor::draw_indexed(const rhi::DrawIndexedArguments& arguments, std::uint32_t draw_index) {
    if (!index_buffer_) return;
    DrawCall call;
    call.indexed = true;
    call.index_type = index_type_;
    call.index_bytes = index_buffer_->size_from(index_offset_);
    if (call.index_bytes != 0) call.indices = index_buffer_->data() + index_offset_;
    call.first = arguments.first_index;
    call.count = arguments.index_count;
    call.first_instance = arguments.first_instance;
    call.instance_count = arguments.instance_count;
    call.vertex_offset = arguments.vertex_offset;
    draw(call, draw_index);
}

void Executor::draw_indirect(const rhi::DrawIndirectCommand& command) {
    for (std::uint32_t i = 0; i < command.count && stopped_.empty(); ++i) {
        const std::uint64_t offset = command.offset + std::uint64_t{i} * command.stride;
        const auto arguments = read_arguments<rhi::DrawArguments>(command.arguments, offset);
        if (!arguments) return;
        if (are_undefined(command.arguments, offset, sizeof *arguments, "draw")) continue;
        draw(*arguments, i);
    }
}

void Executor::draw_indexed_indirect(const rhi::DrawIndexedIndirectCommand& command) {
    for (std::uint32_t i = 0; i < command.count && stopped_.empty(); ++i) {
        const std::uint64_t offset = command.offset + std::uint64_t{i} * command.stride;
        const auto arguments = read_arguments<rhi::DrawIndexedArguments>(command.arguments, offset);
        if (!arguments) return;
        if (are_undefined(command.arguments, offset, sizeof *arguments, "draw")) continue;
        draw_indexed(*arguments, i);
    }
}

void Executor::dispatch_indirect(const rhi::DispatchIndirectCommand& command) {
    const auto arguments = read_arguments<rhi::DispatchArguments>(command.arguments, command.offset);
    if (arguments && !are_undefined(command.arguments, command.offset, sizeof *arguments, "dispatch"))
        dispatch(*arguments);
}

void Executor::dispatch(rhi::DispatchArguments groups) {
    if (!compute_pipeline_) return;
    const ComputeProgram* traced =
        is_traced(compute_pipeline_->program.name) ? compute_pipeline_->traced(*compiler_) : nullptr;
    const ComputeProgram& program = traced ? *traced : compute_pipeline_->program;
    // Indirect arguments are whatever lies in the buffer; the limits keep the total within 64 bits.
    groups.x = std::min(groups.x, most_workgroups[0]);
    groups.y = std::min(groups.y, most_workgroups[1]);
    groups.z = std::min(groups.z, most_workgroups[2]);
    const std::uint64_t total = std::uint64_t{groups.x} * groups.y * groups.z;
    if (total == 0) return;
    for (MemoryBlock& memory : workgroup_memory_) {
        if (memory.data() && memory.size() >= program.workgroup_bytes) continue;
        memory = MemoryBlock(scratch_, std::max<std::uint64_t>(program.workgroup_bytes, 64));
        if (!memory.data()) throw std::bad_alloc();
    }
    ShaderContext context = make_context();
    if (checks_.flags) {
        begin_scope();
        prepare_workgroup_checks();
        context.checks = make_checks("dispatch", ++dispatches_);
    }
    // Hostile order: workgroups one by one, in an order that nobody can rely on.
    const bool is_shuffled = (checks_.flags & check_hostile) != 0;
    const Shuffle shuffle(total, checks_.seed);
    // Enough parts that threads finish together; neighbors stay together for the sake of caches.
    constexpr std::uint64_t parts_for_each_thread = 32;
    const auto parts =
        static_cast<std::uint32_t>(std::min(total, std::uint64_t{scheduler_.thread_count()} * parts_for_each_thread));
    {
        const Watchdog::Step step(watchdog_);
        scheduler_.run(parts, [&](std::uint32_t part, std::uint32_t thread) {
            const std::uint64_t end = share(total, part + 1, parts);
            // Shaders without a loop look at nothing: a call never runs so many that stopping would take long.
            constexpr std::uint64_t most_at_once = 1024;
            for (std::uint64_t at = share(total, part, parts); at < end && !watchdog_.has_expired();) {
                WorkgroupRange range{};
                const std::uint64_t first = is_shuffled ? shuffle(at) : at;
                range.x_begin = static_cast<std::uint32_t>(first % groups.x);
                const std::uint64_t count =
                    is_shuffled ? 1 : std::min({end - at, std::uint64_t{groups.x} - range.x_begin, most_at_once});
                range.x_end = range.x_begin + static_cast<std::uint32_t>(count);
                range.y = static_cast<std::uint32_t>(first / groups.x % groups.y);
                range.z = static_cast<std::uint32_t>(first / groups.x / groups.y);
                range.count[0] = groups.x, range.count[1] = groups.y, range.count[2] = groups.z;
                range.memory = workgroup_memory_[thread].data();
                program.run(&context, &range);
                at += count;
            }
        });
    }
    look_at_watchdog(fmt::format("'{}'", program.name));
}

}  // namespace nacre::cpu
