// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/shader_interface.h"
#include "backends/cpu/trace.h"

namespace nacre::cpu {
namespace {

void begin(ShaderTrace* trace, const TraceTable* table, std::int32_t lane) {
    if (lane < 0) return;
    const std::lock_guard lock(trace->mutex);
    trace->found.invocations.push_back({table->shader, table->instructions, {}});
}

void event(ShaderTrace* trace, std::uint32_t instruction, std::int32_t lane, std::uint32_t live, const double* values,
           std::uint32_t count) {
    if (lane < 0 || (live >> lane & 1) == 0) return;
    // Only one thread works on the traced invocation: nobody else has come past the lines above.
    const std::lock_guard lock(trace->mutex);
    rhi::TraceEvent noted{instruction, {}};
    for (std::uint32_t i = 0; i < count; ++i)
        noted.values.push_back(values[i * max_lanes + static_cast<std::uint32_t>(lane)]);
    trace->found.invocations.back().events.push_back(std::move(noted));
}

void write(ShaderTrace* trace, std::uint32_t live, const std::int32_t* rows, std::uint32_t count) {
    for (std::uint32_t rest = live; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::uint32_t>(__builtin_ctz(rest));
        bool is_texel = true;
        for (std::uint32_t i = 0; i < count && i < 3; ++i)
            is_texel = is_texel && static_cast<std::uint32_t>(rows[i * max_lanes + lane]) == trace->texel[i];
        if (!is_texel) continue;
        std::array<std::uint32_t, 3> invocation;
        for (std::uint32_t i = 0; i < 3; ++i)
            invocation[i] = static_cast<std::uint32_t>(rows[(count + i) * max_lanes + lane]);
        const std::lock_guard lock(trace->mutex);
        trace->found.writers.push_back(invocation);
    }
}

}  // namespace

TraceFunctions trace_functions() { return {&begin, &event, &write}; }

}  // namespace nacre::cpu
