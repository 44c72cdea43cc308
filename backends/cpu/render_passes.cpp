// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>

#include "backends/cpu/commands.h"

namespace nacre::cpu {

using rhi::LoadOperation;

void Executor::begin_render_pass(const rhi::BeginRenderPassCommand& command) {
    reset_state();
    targets_ = {};
    targets_.width = command.width, targets_.height = command.height, targets_.samples = command.samples;
    resolves_.clear();
    for (std::uint32_t i = 0; i < command.color_count; ++i) {
        const rhi::ColorAttachmentCommand& color = command.colors()[i];
        ImageView& view = targets_.colors.emplace_back();
        if (!color.view.texture.object) continue;
        view = texture_of(color.view.texture).make_view(color.view);
        if (color.load == LoadOperation::clear && view.levels[0].shadow) {
            // Doubles are cleared with their texels.
            transfer_.clear_color(view, color.clear);
        } else if (color.load == LoadOperation::clear) {
            targets_.color_clears.resize(command.color_count);
            targets_.color_clears[i] = cleared_texel(view.format, color.clear);
        }
        if (color.resolve.texture.object)
            resolves_.push_back({i, texture_of(color.resolve.texture).make_view(color.resolve)});
    }
    if (command.has_depth_stencil) {
        targets_.depth_stencil = texture_of(command.depth_stencil.texture).make_view(command.depth_stencil);
        const bool clears_depth = command.depth_load == LoadOperation::clear && !command.read_only;
        if (clears_depth && targets_.depth_stencil.levels[0].shadow)
            transfer_.clear_depth(targets_.depth_stencil, command.clear_depth);
        else if (clears_depth)
            targets_.depth_clear = cleared_depth(targets_.depth_stencil.format, command.clear_depth);
        if (command.stencil_load == LoadOperation::clear && !command.read_only)
            targets_.stencil_clear = command.clear_stencil;
    }
    viewport_ = {0.0f, 0.0f, static_cast<float>(command.width), static_cast<float>(command.height), 0.0f, 1.0f};
    scissor_ = {0, 0, command.width, command.height};
    stencil_reference_ = 0;
    blend_constants_ = {};
    pass_shaders_.clear();
    occlusion_ = nullptr;
    in_pass_ = true;
    if (checks_.flags) note_pass_begin(command);
    rasterizer_.begin_pass(targets_);
}

void Executor::end_render_pass() {
    {
        const Watchdog::Step step(watchdog_);
        rasterizer_.end_pass();
    }
    in_pass_ = false;
    look_at_watchdog(pass_shaders_);
    if (!stopped_.empty()) return;
    for (const Resolve& resolve : resolves_)
        transfer_.resolve(targets_.colors[resolve.color], resolve.destination, targets_.width, targets_.height);
    if (checks_.flags) note_pass_end();
    reset_state();
}

void Executor::begin_occlusion_query(CpuQueryPool& pool, std::uint32_t index) {
    const Watchdog::Step step(watchdog_);
    occlusion_ = &pool;
    occlusion_index_ = index;
    passed_before_ = rasterizer_.passed_samples();
}

void Executor::end_occlusion_query() {
    if (!occlusion_) return;
    {
        const Watchdog::Step step(watchdog_);
        occlusion_->values[occlusion_index_] = rasterizer_.passed_samples() - passed_before_;
    }
    occlusion_ = nullptr;
    look_at_watchdog(pass_shaders_);
}

void Executor::write_timestamp(CpuQueryPool& pool, std::uint32_t index) {
    if (in_pass_) {
        // The time at which the draws before it are finished.
        {
            const Watchdog::Step step(watchdog_);
            (void)rasterizer_.passed_samples();
        }
        look_at_watchdog(pass_shaders_);
    }
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    pool.values[index] = static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

}  // namespace nacre::cpu
