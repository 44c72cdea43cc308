// SPDX-License-Identifier: Apache-2.0
// Render passes, state, queries and groups; draws and dispatches are in command_validator_work.cpp, copies in
// command_validator_copies.cpp.
#include "rhi/command_validator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace nacre::rhi {

std::string CommandValidator::place() const {
    return in_pass_ ? fmt::format("list '{}', pass '{}'", list_, pass_name_) : fmt::format("list '{}'", list_);
}

Problem CommandValidator::problem(Rule rule, const char* attempted, std::string reason, std::string remedy,
                                  const std::string& subject) const {
    return {rule,
            ErrorCode::validation,
            attempted,
            subject.empty() ? place() : place() + ", " + subject,
            std::move(reason),
            std::move(remedy)};
}

Check CommandValidator::inside(const char* attempted) const {
    if (in_pass_) return {};
    return problem(Rule::outside_render_pass, attempted, "expected an open render pass, found none",
                   "Call it between begin_render_pass and end_render_pass.");
}

Check CommandValidator::outside(const char* attempted) const {
    if (!in_pass_) return {};
    return problem(Rule::inside_render_pass, attempted, "expected no open render pass, found one",
                   "Call it before begin_render_pass or after end_render_pass.");
}

void CommandValidator::unset_state() {
    graphics_ = {};
    compute_ = {};
    groups_ = {};
    checked_groups_ = 0;
    push_constants_.reset();
    vertex_buffers_ = {};
    index_buffer_ = {};
}

Check CommandValidator::check_attachment(const TextureView& view, bool depth, std::size_t index, TextureUsage usage) {
    const char* attempted = "begin render pass";
    Check failed;
    const TextureObject* texture = look_up(view.texture, attempted, "texture", failed);
    if (!texture) return failed;
    const TextureDesc& desc = texture->desc;
    const std::string subject =
        depth ? fmt::format("depth target '{}'", desc.name) : fmt::format("color target {} '{}'", index, desc.name);
    const ViewReference complete = complete_view(view, desc);
    if (auto wrong = check_view(complete, desc, capabilities(), attempted, place() + ", " + subject)) return wrong;
    if (complete.mip_count != 1 || complete.layer_count != 1 || desc.dimension == TextureDimension::d3)
        return problem(
            Rule::attachment_view, attempted,
            fmt::format("expected one mip of one layer of a texture that is not d3, found {} mips and {} layers",
                        complete.mip_count, complete.layer_count),
            "Use TextureView::subresource.", subject);
    if (!has_all(desc.usage, usage))
        return problem(Rule::attachment_usage, attempted,
                       fmt::format("expected usage {}, found {}", text_of(usage), text_of(desc.usage)),
                       "Add the usage where the texture is created.", subject);
    const FormatSupport needed = depth ? FormatSupport::depth_target : FormatSupport::color_target;
    if (!capabilities().supports(complete.format, needed))
        return problem(Rule::attachment_format, attempted,
                       fmt::format("expected a format that the device supports as {}, found {}",
                                   depth ? "depth_target" : "color_target", info(complete.format).name),
                       "View the texture in a format that can be rendered to.", subject);
    const Extent3D extent = mip_extent(desc, complete.base_mip);
    if (!has_size_) {
        has_size_ = true;
        width_ = extent.width;
        height_ = extent.height;
        samples_ = desc.samples;
    }
    if (extent.width != width_ || extent.height != height_)
        return problem(Rule::attachment_size, attempted,
                       fmt::format("expected {}x{} as the other targets have, found {}x{}", width_, height_,
                                   extent.width, extent.height),
                       "Use targets of one size.", subject);
    if (desc.samples != samples_)
        return problem(Rule::attachment_samples, attempted,
                       fmt::format("expected {} samples as the other targets have, found {}", samples_, desc.samples),
                       "Use targets of one number of samples.", subject);
    const std::array<std::uint64_t, 3> key{view.texture.index, complete.base_mip, complete.base_layer};
    if (std::find(attachments_.begin(), attachments_.end(), key) != attachments_.end())
        return problem(Rule::attachment_twice, attempted,
                       fmt::format("expected each mip of each layer once, found mip {} of layer {} twice",
                                   complete.base_mip, complete.base_layer),
                       "Use another texture, mip or layer for one of the two.", subject);
    attachments_.push_back(key);
    if (depth)
        depth_format_ = complete.format;
    else
        color_formats_.push_back(complete.format);
    return {};
}

Check CommandValidator::check_resolve(const ColorAttachment& color, std::size_t index) {
    const char* attempted = "begin render pass";
    Check failed;
    const TextureObject* source = look_up(color.view.texture, attempted, "texture", failed);
    if (!source) return failed;
    const TextureObject* texture = look_up(color.resolve.texture, attempted, "texture", failed);
    if (!texture) return failed;
    const TextureDesc& desc = texture->desc;
    const ViewReference complete = complete_view(color.resolve, desc);
    const std::string subject = fmt::format("resolve target {} '{}'", index, desc.name);
    if (auto wrong = check_view(complete, desc, capabilities(), attempted, place() + ", " + subject)) return wrong;
    const Extent3D extent = mip_extent(desc, complete.base_mip);
    const auto wrong = [&](std::string expected, std::string found) {
        return problem(
            Rule::resolve_target, attempted, fmt::format("expected {}, found {}", expected, found),
            "Resolve 4 samples of a float or normalized format into a color target of equal format and size.", subject);
    };
    if (source->desc.samples == 1) return wrong("a source of 4 samples", "1 sample");
    if (desc.samples != 1) return wrong("a target of 1 sample", fmt::format("{} samples", desc.samples));
    if (info(desc.format).is_integer())
        return wrong("a format that can be averaged", std::string(info(desc.format).name));
    if (complete.mip_count != 1 || complete.layer_count != 1)
        return wrong("one mip of one layer",
                     fmt::format("{} mips and {} layers", complete.mip_count, complete.layer_count));
    if (!has_all(desc.usage, TextureUsage::color_target)) return wrong("usage color_target", text_of(desc.usage));
    if (complete.format != complete_view(color.view, source->desc).format)
        return wrong(std::string(info(source->desc.format).name), std::string(info(complete.format).name));
    if (extent.width != width_ || extent.height != height_)
        return wrong(fmt::format("{}x{}", width_, height_), fmt::format("{}x{}", extent.width, extent.height));
    return {};
}

Check CommandValidator::begin_render_pass(const RenderPassDesc& desc) {
    const char* attempted = "begin render pass";
    if (auto failed = outside(attempted)) return failed;
    const std::shared_lock lock(device_->tables_mutex);
    in_pass_ = true;
    pass_name_ = desc.name;
    unset_state();
    color_formats_.clear();
    attachments_.clear();
    depth_format_ = Format::undefined;
    has_size_ = false;
    const DepthStencilAttachment& depth = desc.depth_stencil;
    read_only_depth_ = depth.read_only;
    if (desc.color.empty() && !depth.view.texture)
        return problem(Rule::render_pass_empty, attempted, "expected at least one target, found none",
                       "Give a color or a depth target.");
    if (desc.color.size() > std::min(capabilities().max_color_targets, most_color_targets))
        return problem(Rule::color_target_limit, attempted,
                       fmt::format("expected at most {} color targets (max_color_targets), found {}",
                                   capabilities().max_color_targets, desc.color.size()),
                       "Draw in several passes.");
    for (std::size_t i = 0; i < desc.color.size(); ++i)
        if (auto failed = check_attachment(desc.color[i].view, false, i, TextureUsage::color_target)) return failed;
    if (depth.view.texture) {
        if (auto failed = check_attachment(depth.view, true, 0, TextureUsage::depth_target)) return failed;
        const bool has_stencil = info(depth_format_).has_stencil;
        if (depth.read_only &&
            (depth.depth_load != LoadOperation::load || (has_stencil && depth.stencil_load != LoadOperation::load)))
            return problem(Rule::read_only_cleared, attempted,
                           "expected LoadOperation::load for a read-only depth target, found clear or discard",
                           "Clear the target in a pass before, or drop read_only.");
    }
    for (std::size_t i = 0; i < desc.color.size(); ++i)
        if (desc.color[i].resolve.texture)
            if (auto failed = check_resolve(desc.color[i], i)) return failed;
    return {};
}

Check CommandValidator::end_render_pass() {
    if (auto failed = inside("end render pass")) return failed;
    if (query_open_)
        return problem(Rule::query_unbalanced, "end render pass",
                       fmt::format("expected occlusion query {} to be ended, found it open", open_query_),
                       "Call end_occlusion_query in the pass that began it.");
    in_pass_ = false;
    unset_state();
    return {};
}

Check CommandValidator::set_pipeline(GraphicsPipeline pipeline) {
    const char* attempted = "set pipeline";
    const std::shared_lock lock(device_->tables_mutex);
    Check failed;
    const GraphicsPipelineObject* object = look_up(pipeline, attempted, "graphics pipeline", failed);
    if (!object) return failed;
    if (auto wrong = inside(attempted)) return wrong;
    const GraphicsPipelineDesc& desc = object->desc;
    const std::string subject = fmt::format("pipeline '{}'", desc.name);
    const auto mismatch = [&](std::string expected, std::string found) {
        return problem(Rule::pipeline_target_mismatch, attempted, fmt::format("expected {}, found {}", expected, found),
                       "Make a pipeline for the targets of this pass.", subject);
    };
    if (desc.color_targets.size() != color_formats_.size())
        return mismatch(fmt::format("{} color targets as the pass has", color_formats_.size()),
                        std::to_string(desc.color_targets.size()));
    for (std::size_t i = 0; i < color_formats_.size(); ++i)
        if (desc.color_targets[i].format != color_formats_[i])
            return mismatch(
                fmt::format("format {} for color target {} as the pass has", info(color_formats_[i]).name, i),
                std::string(info(desc.color_targets[i].format).name));
    if (desc.depth_stencil.format != depth_format_)
        return mismatch(fmt::format("depth format {} as the pass has", info(depth_format_).name),
                        std::string(info(desc.depth_stencil.format).name));
    if (desc.samples != samples_)
        return mismatch(fmt::format("{} samples as the pass has", samples_), std::to_string(desc.samples));
    if (read_only_depth_ && object->writes_depth)
        return problem(Rule::read_only_depth_written, attempted,
                       "expected a pipeline that writes neither depth nor stencil in a pass where both are read-only, "
                       "found one that writes",
                       "Turn depth_write and the stencil operations off, or drop read_only.", subject);
    if (!(graphics_ == pipeline)) checked_groups_ = 0;
    graphics_ = pipeline;
    return {};
}

Check CommandValidator::set_pipeline(ComputePipeline pipeline) {
    const char* attempted = "set pipeline";
    const std::shared_lock lock(device_->tables_mutex);
    Check failed;
    if (!look_up(pipeline, attempted, "compute pipeline", failed)) return failed;
    if (auto wrong = outside(attempted)) return wrong;
    if (!(compute_ == pipeline)) checked_groups_ = 0;
    compute_ = pipeline;
    return {};
}

Check CommandValidator::set_bind_group(std::uint32_t index, BindGroup group) {
    const char* attempted = "set bind group";
    const std::shared_lock lock(device_->tables_mutex);
    Check failed;
    if (!look_up(group, attempted, "bind group", failed)) return failed;
    const std::uint32_t limit = std::min(capabilities().max_bind_groups, most_bind_groups);
    if (index >= limit)
        return problem(Rule::bind_group_index, attempted,
                       fmt::format("expected an index below {} (max_bind_groups), found {}", limit, index),
                       "Use a lower bind-group index.");
    groups_[index] = group;
    checked_groups_ &= ~(1u << index);
    return {};
}

Check CommandValidator::set_push_constants(std::size_t size, std::uint32_t offset) {
    const std::uint32_t limit = std::min<std::uint32_t>(capabilities().max_push_constant_bytes, 4096);
    if (size == 0 || size % 4 != 0 || offset % 4 != 0 || offset > limit || size > limit - offset)
        return problem(
            Rule::push_constants_range, "set push constants",
            fmt::format("expected multiples of 4 bytes within {} (max_push_constant_bytes), found {} bytes at "
                        "offset {}",
                        limit, size, offset),
            "Pad the structure, or move data into a uniform buffer.");
    for (std::size_t word = offset / 4; word < (offset + size) / 4; ++word) push_constants_.set(word);
    return {};
}

Check CommandValidator::set_vertex_buffer(std::uint32_t slot, Buffer buffer, std::uint64_t offset) {
    const char* attempted = "set vertex buffer";
    const std::shared_lock lock(device_->tables_mutex);
    Check failed;
    const BufferObject* object = look_up(buffer, attempted, "buffer", failed);
    if (!object) return failed;
    if (auto wrong = inside(attempted)) return wrong;
    const std::uint32_t limit = std::min(capabilities().max_vertex_buffers, most_vertex_buffers);
    const std::string subject = fmt::format("buffer '{}'", object->desc.name);
    if (slot >= limit)
        return problem(Rule::vertex_buffer_use, attempted,
                       fmt::format("expected a slot below {} (max_vertex_buffers), found {}", limit, slot),
                       "Use a lower slot.", subject);
    if (!has_all(object->desc.usage, BufferUsage::vertex))
        return problem(Rule::vertex_buffer_use, attempted,
                       fmt::format("expected usage vertex, found {}", text_of(object->desc.usage)),
                       "Add the usage where the buffer is created.", subject);
    if (offset >= object->desc.size || offset % 4 != 0)
        return problem(Rule::vertex_buffer_use, attempted,
                       fmt::format("expected an offset that is a multiple of 4 and below {} bytes, found {}",
                                   object->desc.size, offset),
                       "Correct the offset.", subject);
    vertex_buffers_[slot] = {buffer, offset};
    return {};
}

Check CommandValidator::set_index_buffer(Buffer buffer, IndexType type, std::uint64_t offset) {
    const char* attempted = "set index buffer";
    const std::shared_lock lock(device_->tables_mutex);
    Check failed;
    const BufferObject* object = look_up(buffer, attempted, "buffer", failed);
    if (!object) return failed;
    if (auto wrong = inside(attempted)) return wrong;
    const std::string subject = fmt::format("buffer '{}'", object->desc.name);
    if (!has_all(object->desc.usage, BufferUsage::index))
        return problem(Rule::index_buffer_use, attempted,
                       fmt::format("expected usage index, found {}", text_of(object->desc.usage)),
                       "Add the usage where the buffer is created.", subject);
    const std::uint32_t bytes = type == IndexType::uint16 ? 2 : 4;
    if (offset >= object->desc.size || offset % bytes != 0)
        return problem(Rule::index_buffer_use, attempted,
                       fmt::format("expected an offset that is a multiple of {} and below {} bytes, found {}", bytes,
                                   object->desc.size, offset),
                       "Correct the offset.", subject);
    index_buffer_ = {buffer, offset};
    index_type_ = type;
    return {};
}

Check CommandValidator::set_viewport(const Viewport& viewport) {
    if (auto failed = inside("set viewport")) return failed;
    const bool finite = std::isfinite(viewport.x) && std::isfinite(viewport.y) && std::isfinite(viewport.width) &&
                        std::isfinite(viewport.height);
    const auto unit = [](float depth) { return depth >= 0.0f && depth <= 1.0f; };
    constexpr float most = 32768.0f;
    if (!finite || !(viewport.width > 0.0f) || !(viewport.height > 0.0f) || !unit(viewport.min_depth) ||
        !unit(viewport.max_depth) || viewport.width > most || viewport.height > most || std::abs(viewport.x) > most ||
        std::abs(viewport.y) > most)
        return problem(
            Rule::viewport, "set viewport",
            fmt::format("expected a finite position and size above 0 within 32768 and depths of 0 to 1, found "
                        "{}x{} at {}, {} with depths {} to {}",
                        viewport.width, viewport.height, viewport.x, viewport.y, viewport.min_depth,
                        viewport.max_depth),
            "Correct the values; a viewport may reach beyond the target.");
    return {};
}

Check CommandValidator::set_scissor(const Rectangle& scissor) {
    if (auto failed = inside("set scissor")) return failed;
    if (scissor.x > width_ || scissor.y > height_ || scissor.width > width_ - scissor.x ||
        scissor.height > height_ - scissor.y)
        return problem(Rule::scissor, "set scissor",
                       fmt::format("expected a rectangle within {}x{}, found {}x{} at {}, {}", width_, height_,
                                   scissor.width, scissor.height, scissor.x, scissor.y),
                       "Clamp it to the size of the targets.");
    return {};
}

Check CommandValidator::set_pass_state(const char* attempted) { return inside(attempted); }

Check CommandValidator::check_query(const char* attempted, QueryPool pool, std::uint32_t index, QueryType type) {
    const std::shared_lock lock(device_->tables_mutex);
    Check failed;
    const QueryPoolObject* object = look_up(pool, attempted, "query pool", failed);
    if (!object) return failed;
    const std::string subject = fmt::format("pool '{}'", object->desc.name);
    if (object->desc.type != type)
        return problem(Rule::query_type_mismatch, attempted,
                       fmt::format("expected a pool of type {}, found {}",
                                   type == QueryType::timestamp ? "timestamp" : "occlusion",
                                   object->desc.type == QueryType::timestamp ? "timestamp" : "occlusion"),
                       "Use a pool of the right type.", subject);
    if (index >= object->desc.count)
        return problem(Rule::query_range, attempted,
                       fmt::format("expected an index below {}, found {}", object->desc.count, index),
                       "Make the pool larger or use a lower index.", subject);
    return {};
}

Check CommandValidator::write_timestamp(QueryPool pool, std::uint32_t index) {
    return check_query("write timestamp", pool, index, QueryType::timestamp);
}

Check CommandValidator::begin_occlusion_query(QueryPool pool, std::uint32_t index) {
    const char* attempted = "begin occlusion query";
    if (auto failed = inside(attempted)) return failed;
    if (auto failed = check_query(attempted, pool, index, QueryType::occlusion)) return failed;
    if (query_open_)
        return problem(Rule::query_unbalanced, attempted,
                       fmt::format("expected no open occlusion query, found {}", open_query_),
                       "End the query before the next; they are not nested.");
    query_open_ = true;
    open_pool_ = pool;
    open_query_ = index;
    return {};
}

Check CommandValidator::end_occlusion_query(QueryPool pool, std::uint32_t index) {
    const char* attempted = "end occlusion query";
    if (auto failed = inside(attempted)) return failed;
    if (auto failed = check_query(attempted, pool, index, QueryType::occlusion)) return failed;
    if (!query_open_ || !(open_pool_ == pool) || open_query_ != index)
        return problem(Rule::query_unbalanced, attempted,
                       fmt::format("expected query {} of this pool to be open, found {}", index,
                                   query_open_ ? fmt::format("query {} open", open_query_) : "none open"),
                       "Begin the query first, in the same pass.");
    query_open_ = false;
    return {};
}

Check CommandValidator::push_debug_group() {
    ++debug_groups_;
    return {};
}

Check CommandValidator::pop_debug_group() {
    if (debug_groups_ == 0)
        return problem(Rule::debug_group_unbalanced, "pop debug group", "expected an open debug group, found none",
                       "Push and pop in pairs.");
    --debug_groups_;
    return {};
}

Check CommandValidator::begin_statement() {
    if (in_pass_ || statement_open_)
        return problem(Rule::statement_unbalanced, "begin statement",
                       in_pass_ ? "expected no open render pass, found one" : "expected no open statement, found one",
                       "Statements stand around render passes and are not nested.");
    statement_open_ = true;
    return {};
}

Check CommandValidator::end_statement() {
    if (in_pass_ || !statement_open_)
        return problem(Rule::statement_unbalanced, "end statement",
                       in_pass_ ? "expected no open render pass, found one" : "expected an open statement, found none",
                       "Pair begin_statement and end_statement outside of render passes.");
    statement_open_ = false;
    return {};
}

Check CommandValidator::finish() {
    if (in_pass_)
        return problem(Rule::render_pass_open, "submit", "expected the render pass to be ended, found it open",
                       "Call end_render_pass before submitting.");
    if (debug_groups_ != 0)
        return problem(Rule::debug_group_unbalanced, "submit",
                       fmt::format("expected all debug groups to be popped, found {} open", debug_groups_),
                       "Push and pop in pairs.");
    if (statement_open_)
        return problem(Rule::statement_unbalanced, "submit", "expected the statement to be ended, found it open",
                       "Call end_statement before submitting.");
    return {};
}

}  // namespace nacre::rhi
