// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/raster/draw_plan.h"

#include <algorithm>
#include <cmath>

#include "rhi/format.h"

namespace nacre::cpu::raster {
namespace {

/// Color targets of this size and more are written past the caches.
constexpr std::uint64_t cached_color_bytes = 16 << 20;

struct ChannelBits {
    std::uint32_t first, count;
};

/// Where channel `index` (red first) lies in a texel; no bits where the format lacks it.
ChannelBits channel_bits(rhi::Format format, std::uint32_t index) {
    const rhi::FormatInfo& facts = rhi::info(format);
    if (index >= facts.channels) return {0, 0};
    switch (format) {
        case rhi::Format::rgb10a2_unorm:
        case rhi::Format::rgb10a2_uint: return {10 * index, index == 3 ? 2u : 10u};
        case rhi::Format::rg11b10_float: return {11 * index, index == 2 ? 10u : 11u};
        case rhi::Format::bgra8_unorm:
        case rhi::Format::bgra8_srgb: return {8 * (index < 3 ? 2 - index : index), 8};
        default: break;
    }
    const std::uint32_t bits = facts.block_bytes * 8u / facts.channels;
    return {bits * index, bits};
}

bool is_of_destination(rhi::BlendFactor factor) {
    using enum rhi::BlendFactor;
    switch (factor) {
        case destination_color:
        case one_minus_destination_color:
        case destination_alpha:
        case one_minus_destination_alpha:
        case source_alpha_saturated: return true;
        default: return false;
    }
}

bool reads_destination(const rhi::BlendState& blend) {
    const auto reads = [](rhi::BlendOperation operation, rhi::BlendFactor source, rhi::BlendFactor destination) {
        return operation == rhi::BlendOperation::minimum || operation == rhi::BlendOperation::maximum ||
               destination != rhi::BlendFactor::zero || is_of_destination(source);
    };
    return reads(blend.color_operation, blend.source_color, blend.destination_color) ||
           reads(blend.alpha_operation, blend.source_alpha, blend.destination_alpha);
}

void plan_colors(const RasterPipeline& pipeline, const TargetSet& targets, DrawPlan& plan) {
    plan.color_count = 0;
    plan.dual_source = false;
    for (const FragmentOutput& output : pipeline.fragment.outputs)
        plan.dual_source = plan.dual_source || output.output == dual_source_output;
    for (const FragmentOutput& output : pipeline.fragment.outputs) {
        const std::uint32_t index = output.output;
        if (index >= targets.color_count || index >= pipeline.color_targets.size() || !targets.colors[index].data)
            continue;
        const rhi::ColorTargetState& state = pipeline.color_targets[index];
        const rhi::Format format = targets.colors[index].format;
        ColorPlan color{};
        color.target = color.output = index;
        color.components = std::min(output.components, 4u);
        color.blends = state.blend.enabled && !rhi::info(format).is_integer();
        color.blend = state.blend;
        color.reads_destination = color.blends && reads_destination(state.blend);
        color.write_mask = static_cast<std::uint8_t>(state.write_mask);
        bool any = false;
        for (std::uint32_t channel = 0; channel < 4; ++channel) {
            const ChannelBits bits = channel_bits(format, channel);
            if (bits.count == 0) continue;
            if ((state.write_mask >> channel & 1) == 0) {
                color.partial = true;
                continue;
            }
            any = true;
            for (std::uint32_t bit = bits.first; bit < bits.first + bits.count; ++bit)
                color.word_masks[bit / 32] |= 1u << (bit % 32);
        }
        color.as_it_is =
            !color.blends && !color.partial && rhi::info(format).block_bytes == 4 * rhi::info(format).channels &&
            rhi::info(format).kind != rhi::FormatKind::unorm && rhi::info(format).kind != rhi::FormatKind::snorm &&
            color.components >= rhi::info(format).channels;
        if (any) plan.colors[plan.color_count++] = color;
    }
}

bool keeps_order(rhi::CompareOperation operation) {
    return operation == rhi::CompareOperation::less || operation == rhi::CompareOperation::less_or_equal ||
           operation == rhi::CompareOperation::greater || operation == rhi::CompareOperation::greater_or_equal;
}

void plan_tests(const DrawState& state, const TargetSet& targets, bool hierarchical_depth, DrawPlan& plan) {
    const RasterPipeline& pipeline = *state.pipeline;
    const FragmentProgram& fragment = pipeline.fragment;
    const rhi::DepthStencilState& from = pipeline.depth_stencil;
    plan.depth_stencil = {from.depth_test,
                          from.depth_test && from.depth_write,
                          from.stencil_test,
                          from.depth_clamp,
                          from.depth_compare,
                          state.stencil_reference,
                          std::min(state.viewport.min_depth, state.viewport.max_depth),
                          std::max(state.viewport.min_depth, state.viewport.max_depth),
                          from.front,
                          from.back};

    plan.alpha_to_coverage = false;
    for (const FragmentOutput& output : fragment.outputs)
        if (output.output == 0 && output.components == 4) plan.alpha_to_coverage = pipeline.alpha_to_coverage;
    plan.discards = fragment.discards;
    plan.writes_sample_mask = fragment.writes_sample_mask;
    plan.writes_depth = fragment.writes_depth && !fragment.early_tests;
    plan.runs_per_sample = fragment.runs_per_sample && targets.samples > 1;
    plan.uses_centroid = fragment.uses_centroid;
    const bool changes_coverage =
        plan.discards || plan.writes_sample_mask || plan.writes_depth || plan.alpha_to_coverage;
    plan.shades = fragment.run && (plan.color_count != 0 || fragment.has_side_effects || changes_coverage);
    plan.late_tests = plan.shades && !fragment.early_tests && (changes_coverage || fragment.has_side_effects);
    plan.plain_results = !plan.late_tests && !changes_coverage && targets.samples == 1;
    if (plan.in_double) plan.plain_results = false;
    for (std::uint32_t i = 0; i < plan.color_count; ++i)
        plan.plain_results = plan.plain_results && !plan.colors[i].blends && !plan.colors[i].partial;
    // A fragment that fails against what is there now also fails against what the draw itself puts in front of it.
    plan.early_rejection = plan.late_tests && !fragment.has_side_effects && !plan.writes_depth && from.depth_test &&
                           !from.stencil_test && keeps_order(from.depth_compare);
    plan.hierarchical = hierarchical_depth && !plan.in_double && from.depth_test && !from.stencil_test &&
                        keeps_order(from.depth_compare) && (!plan.late_tests || plan.early_rejection);
}

/// Pixels that viewport and scissor leave. Points reach out of the viewport, all else is clipped by it.
void plan_rectangle(const DrawState& state, const TargetSet& targets, DrawPlan& plan) {
    std::int64_t x_begin = state.scissor.x, y_begin = state.scissor.y;
    std::int64_t x_end = x_begin + state.scissor.width, y_end = y_begin + state.scissor.height;
    if (state.pipeline->topology != rhi::Topology::point_list) {
        const auto pixel = [&](double place, bool is_end) {
            // The first pixel whose center is not left of the place; with several samples the one that holds it.
            const double whole = targets.samples == 1 ? std::ceil(place - 0.5)
                                 : is_end             ? std::ceil(place)
                                                      : std::floor(place);
            return static_cast<std::int64_t>(std::clamp(whole, -1e6, 1e6));
        };
        const rhi::Viewport& view = state.viewport;
        x_begin = std::max(x_begin, pixel(view.x, false)), y_begin = std::max(y_begin, pixel(view.y, false));
        x_end = std::min(x_end, pixel(static_cast<double>(view.x) + view.width, true));
        y_end = std::min(y_end, pixel(static_cast<double>(view.y) + view.height, true));
    }
    const auto cut = [](std::int64_t value, std::uint32_t size) {
        return static_cast<std::int32_t>(std::clamp<std::int64_t>(value, 0, size));
    };
    plan.x_begin = cut(x_begin, targets.width), plan.x_end = cut(x_end, targets.width);
    plan.y_begin = cut(y_begin, targets.height), plan.y_end = cut(y_end, targets.height);
}

}  // namespace

TargetSet target_set(const RenderTargets& targets) {
    TargetSet set{};
    set.width = targets.width, set.height = targets.height, set.samples = targets.samples > 1 ? most_samples : 1;
    set.tiles_x = (targets.width + tile_size - 1) / tile_size;
    set.tiles_y = (targets.height + tile_size - 1) / tile_size;
    set.color_count = static_cast<std::uint32_t>(std::min<std::size_t>(targets.colors.size(), 8));
    for (std::uint32_t i = 0; i < set.color_count; ++i) {
        const ImageView& view = targets.colors[i];
        const ImageLevel& level = view.levels[0];
        const std::uint32_t bytes = rhi::info(view.format).block_bytes;
        const std::uint32_t words = bytes < 4 ? 1 : bytes / 4;
        set.colors[i] = {level.data, level.sample_stride, level.row_stride, bytes, view.format, words, set.color_planes,
                         false,      {}, level.shadow};
        if (i < targets.color_clears.size() && targets.color_clears[i] && level.data) {
            set.colors[i].clears = true;
            std::memcpy(set.colors[i].clear, targets.color_clears[i]->data(), bytes);
        }
        if (level.data) set.color_planes += words * set.samples;
    }
    std::uint64_t color_bytes = 0;
    for (std::uint32_t i = 0; i < set.color_count; ++i)
        color_bytes += std::uint64_t{set.colors[i].texel_bytes} * set.width * set.height * set.samples;
    set.streams_colors = color_bytes >= cached_color_bytes;
    const ImageView& view = targets.depth_stencil;
    switch (view.format) {
        case rhi::Format::d16_unorm: set.depth_layout = DepthLayout::unorm16; break;
        case rhi::Format::d24_unorm_s8_uint: set.depth_layout = DepthLayout::unorm24; break;
        case rhi::Format::d32_float:
        case rhi::Format::d32_float_s8_uint: set.depth_layout = DepthLayout::float32; break;
        default: break;
    }
    set.depth = view.levels[0].data;
    set.depth_row_stride = view.levels[0].row_stride;
    set.depth_sample_stride = view.levels[0].sample_stride;
    set.depth_shadow = view.levels[0].shadow;
    if (!set.depth) set.depth_layout = DepthLayout::none;
    set.depth_clears = targets.depth_clear.has_value() && set.depth_layout != DepthLayout::none;
    if (set.depth_clears)
        std::memcpy(&set.clear_depth, targets.depth_clear->data(), set.depth_layout == DepthLayout::unorm16 ? 2 : 4);
    if (rhi::info(view.format).has_stencil) {
        set.stencil = view.stencil_levels[0].data;
        set.stencil_row_stride = view.stencil_levels[0].row_stride;
        set.stencil_sample_stride = view.stencil_levels[0].sample_stride;
        set.stencil_clears = targets.stencil_clear.has_value() && set.stencil;
        set.clear_stencil = targets.stencil_clear.value_or(0);
    }
    return set;
}

void plan_draw(const DrawState& state, const DrawCall& call, const TargetSet& targets, bool hierarchical_depth,
               QueuedDraw& queued) {
    const RasterPipeline& pipeline = *state.pipeline;
    queued.pipeline = &pipeline;
    queued.call = call;
    queued.vertex = state.vertex;
    queued.context = state.context;
    if (state.context.push_constants) {
        std::memcpy(queued.push_constants, state.context.push_constants, push_constant_capacity);
        queued.context.push_constants = queued.push_constants;
    }
    queued.depth_layout = targets.depth_layout;
    queued.samples = targets.samples;

    const std::size_t inputs = std::min(pipeline.fragment.inputs.size(), pipeline.input_slots.size());
    queued.row_count = static_cast<std::uint32_t>((inputs + 3) / 4 * 4);
    queued.vertex_bytes = static_cast<std::uint32_t>(sizeof(ScreenVertex)) + queued.row_count * 4;
    if (pipeline.vertex.in_double)
        queued.vertex_bytes += (4 + queued.row_count) * static_cast<std::uint32_t>(sizeof(double));
    queued.input_masks.assign(static_cast<std::size_t>(queued.row_count) * 2, 0);
    for (std::size_t i = 0; i < inputs; ++i) {
        const Interpolation interpolation = pipeline.fragment.inputs[i].interpolation;
        // Flat values pass through unchanged; they must not be divided on the way either.
        queued.input_masks[i] = interpolation != Interpolation::perspective ? -1 : 0;
        queued.input_masks[queued.row_count + i] = interpolation == Interpolation::flat ? -1 : 0;
    }

    DrawPlan& plan = queued.plan;
    plan = {};
    plan.fragment = pipeline.fragment.run;
    plan.context = &queued.context;
    plan.input_count = static_cast<std::uint32_t>(inputs);
    plan.linear_masks = queued.input_masks.data();
    plan.flat_masks = queued.input_masks.data() + queued.row_count;
    plan.primitive_bytes = static_cast<std::uint32_t>(sizeof(PrimitiveData) + queued.row_count * sizeof(Plane));
    plan.in_double = pipeline.vertex.in_double;
    if (plan.in_double)
        plan.primitive_bytes +=
            static_cast<std::uint32_t>(sizeof(DoublePrimitive) + queued.row_count * sizeof(DoublePlane));
    plan.depth_bias = pipeline.depth_stencil.depth_bias;
    plan.depth_bias_slope = pipeline.depth_stencil.depth_bias_slope;
    plan.depth_bias_clamp = pipeline.depth_stencil.depth_bias_clamp;
    plan_colors(pipeline, targets, plan);
    plan.check_blend = state.check_blend;
    plan_tests(state, targets, hierarchical_depth, plan);
    std::copy(state.blend_constants.begin(), state.blend_constants.end(), plan.blend_constants);
    plan_rectangle(state, targets, plan);

    const rhi::Viewport& view = state.viewport;
    const float scale[3] = {view.width * 0.5f, view.height * 0.5f, view.max_depth - view.min_depth};
    const float translation[3] = {view.x + view.width * 0.5f, view.y + view.height * 0.5f, view.min_depth};
    for (int axis = 0; axis < 3; ++axis) {
        queued.scale[axis] = scale[axis], queued.translation[axis] = translation[axis];
        plan.scale[axis] = scale[axis], plan.translation[axis] = translation[axis];
    }
}

}  // namespace nacre::cpu::raster
