// SPDX-License-Identifier: Apache-2.0
#include "rhi/texture_table.h"

#include <algorithm>
#include <bit>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "rhi/embedded_shaders.h"
#include "rhi/texture_pages.h"

namespace nacre::rhi {
namespace {

constexpr std::string_view add_action = "add texture to a texture table";
constexpr std::uint32_t no_entry = 0xff000000;  // Page 255, which no shader has.
constexpr std::uint32_t most_pages = 12;        // As many as texture_table.glsl has cases.
constexpr std::uint32_t most_textures = 4096;   // 16 KiB of entries: the smallest uniform block of GLES 3.1.

struct Entry {
    Texture texture{};
    Sampler sampler{};
    TextureDesc desc;
    bool is_used = false;
};

struct Page {
    PageKind kind;
    Texture texture{};
    std::uint32_t capacity = 0;                         ///< Layers.
    std::vector<std::optional<std::uint32_t>> layers{}; ///< Index of the entry in each layer.
};

struct LayoutLess {
    bool operator()(BindGroupLayout a, BindGroupLayout b) const { return number(a) < number(b); }
    static std::uint64_t number(BindGroupLayout layout) {
        return std::uint64_t{layout.generation} << 24 | layout.index;
    }
};

}  // namespace

struct TextureTable::State {
    Device& device;
    TextureTableDesc desc;
    bool uses_pages = false;
    std::vector<Entry> entries;
    std::vector<std::uint32_t> free_entries;
    std::vector<std::uint32_t> removed;  ///< Free after the next update: until then the old entry is what shaders see.
    bool is_changed = true;
    Texture empty_texture{};   ///< What indices without a texture and unused pages show: 0.
    Sampler empty_sampler{};
    Buffer indirection{};      ///< With pages: page and layer of every index.
    std::vector<Page> pages;
    std::map<BindGroupLayout, BindGroup, LayoutLess> groups;
    std::map<Format, GraphicsPipeline> resample_pipelines;
    std::vector<BindGroup> resample_groups;  ///< To be destroyed after the update.
    Shader resample_vertex{}, resample_fragment{};

    State(Device& owner, TextureTableDesc description) : device(owner), desc(std::move(description)) {}
    ~State() {
        destroy_groups();
        for (const Page& page : pages) device.destroy(page.texture);
        for (const auto& [format, pipeline] : resample_pipelines) device.destroy(pipeline);
        device.destroy(resample_vertex);
        device.destroy(resample_fragment);
        device.destroy(empty_texture);
        device.destroy(empty_sampler);
        device.destroy(indirection);
    }
    State(const State&) = delete;
    State& operator=(const State&) = delete;

    void destroy_groups() {
        for (const auto& [layout, group] : groups) device.destroy(group);
        groups.clear();
    }

    Expected<void> make_objects() {
        NACRE_TRY(empty_texture, device.create_texture({.format = Format::rgba8_unorm,
                                                        .width = 1,
                                                        .height = 1,
                                                        .layers = uses_pages ? 2u : 1u,
                                                        .usage = TextureUsage::sampled | TextureUsage::copy_destination,
                                                        .name = desc.name + ": nothing"}));
        const std::byte black[4]{};
        for (std::uint32_t layer = 0; layer < (uses_pages ? 2u : 1u); ++layer)
            NACRE_CHECK(device.write_texture(empty_texture, black, 0, layer));
        NACRE_TRY(empty_sampler, device.create_sampler({.name = desc.name + ": nothing"}));
        if (uses_pages) {
            NACRE_TRY(indirection, device.create_buffer({.size = (desc.capacity + 3) / 4 * 16,
                                                         .usage = BufferUsage::uniform,
                                                         .name = desc.name + ": pages and layers"}));
        }
        return {};
    }

    [[nodiscard]] PageKind kind_of(const Entry& entry) const {
        return {entry.desc.format, entry.desc.width, entry.desc.height, entry.desc.mips, entry.sampler};
    }

    // Keeps the pages that still fit, so that adding a texture copies that texture alone.
    Expected<void> update_pages() {
        std::vector<std::uint32_t> used;
        std::vector<PageKind> kinds;
        for (std::uint32_t i = 0; i < entries.size(); ++i) {
            if (!entries[i].is_used) continue;
            used.push_back(i);
            kinds.push_back(kind_of(entries[i]));
        }
        NACRE_TRY(const std::vector<PlannedPage> plan, plan_pages(kinds, desc.max_pages, device.capabilities()));

        std::vector<Page> old_pages = std::move(pages);
        pages.clear();
        std::vector<std::uint32_t> words((desc.capacity + 3) / 4 * 4, no_entry);
        CommandList list = device.create_command_list(desc.name + ": update");
        bool has_commands = false;
        for (const PlannedPage& planned : plan) {
            NACRE_TRY(Page page, take_page(planned, old_pages));
            for (const std::uint32_t member : planned.members) {
                const std::uint32_t index = used[member];
                auto layer = std::ranges::find(page.layers, std::optional(index));
                if (layer == page.layers.end()) {
                    layer = std::ranges::find(page.layers, std::optional<std::uint32_t>());
                    *layer = index;
                    const auto number = static_cast<std::uint32_t>(layer - page.layers.begin());
                    NACRE_CHECK(fill_layer(list, page, number, entries[index]));
                    has_commands = true;
                }
                words[index] = static_cast<std::uint32_t>(pages.size()) << 24 |
                               static_cast<std::uint32_t>(layer - page.layers.begin());
            }
            pages.push_back(std::move(page));
        }
        if (has_commands) NACRE_CHECK(device.submit(std::move(list)));
        for (const Page& page : old_pages) device.destroy(page.texture);
        return device.write_buffer(indirection, std::span<const std::uint32_t>(words));
    }

    /// The page for a plan: an old one with its content where it is of the same kind and large enough.
    Expected<Page> take_page(const PlannedPage& planned, std::vector<Page>& old_pages) {
        const auto count = static_cast<std::uint32_t>(planned.members.size());
        const auto old = std::ranges::find_if(
            old_pages, [&](const Page& page) { return page.kind == planned.kind && page.capacity >= count; });
        if (old != old_pages.end()) {
            Page page = std::move(*old);
            old_pages.erase(old);
            for (auto& layer : page.layers)
                if (layer && !entries[*layer].is_used) layer.reset();
            return page;
        }
        Page page{.kind = planned.kind};
        // At least 2 layers: a texture of one is no array on every device.
        page.capacity =
            std::min(std::max(std::bit_ceil(count), 2u), std::max(device.capabilities().max_texture_layers, 2u));
        page.layers.resize(page.capacity);
        TextureUsage usage = TextureUsage::sampled | TextureUsage::copy_destination;
        if (planned.is_merged) usage |= TextureUsage::color_target;
        NACRE_TRY(page.texture, device.create_texture({.format = page.kind.format, .width = page.kind.width,
                                                       .height = page.kind.height, .layers = page.capacity,
                                                       .mips = page.kind.mips, .usage = usage,
                                                       .name = fmt::format("{}: page of {} {}x{}", desc.name,
                                                                           info(page.kind.format).name,
                                                                           page.kind.width, page.kind.height)}));
        return page;
    }

    Expected<void> fill_layer(CommandList& list, const Page& page, std::uint32_t layer, const Entry& entry) {
        for (std::uint32_t mip = 0; mip < page.kind.mips; ++mip) {
            const TextureDesc page_desc{.width = page.kind.width, .height = page.kind.height, .mips = page.kind.mips};
            const Extent3D wanted = mip_extent(page_desc, mip);
            // The source's smallest mip that is at least as large; mip 0 where all are smaller.
            std::uint32_t source_mip = 0;
            while (source_mip + 1 < entry.desc.mips) {
                const Extent3D next = mip_extent(entry.desc, source_mip + 1);
                if (next.width < wanted.width || next.height < wanted.height) break;
                ++source_mip;
            }
            if (entry.desc.format == page.kind.format && mip_extent(entry.desc, source_mip) == wanted) {
                list.copy_texture(entry.texture, page.texture, {.source_mip = source_mip, .destination_mip = mip,
                                                                .destination_layer = layer});
                continue;
            }
            NACRE_TRY(const GraphicsPipeline pipeline, resample_pipeline(page.kind.format));
            NACRE_TRY(const BindGroupLayout layout, device.bind_group_layout(pipeline, 0));
            NACRE_TRY(const BindGroup group,
                      device.create_bind_group(
                          {.layout = layout,
                           .entries = {{.binding = 0, .texture = entry.texture, .sampler = entry.sampler}},
                           .name = desc.name + ": resample"}));
            list.begin_render_pass({.color = {{.view = TextureView::subresource(page.texture, mip, layer),
                                               .load = LoadOperation::discard}},
                                    .name = "resample"});
            list.set_pipeline(pipeline);
            list.set_bind_group(0, group);
            list.set_push_constants(static_cast<float>(source_mip));
            list.draw({.vertex_count = 3});
            list.end_render_pass();
            resample_groups.push_back(group);
        }
        return list.status();
    }
    Expected<GraphicsPipeline> resample_pipeline(Format format) {
        if (const auto found = resample_pipelines.find(format); found != resample_pipelines.end()) return found->second;
        if (!resample_vertex) {
            ShaderCompiler compiler({.embedded = {embedded_files()}});
            NACRE_TRY(const ShaderDesc vertex, compiler.compile({.path = "rhi/shaders/fullscreen.vert"}));
            NACRE_TRY(const ShaderDesc fragment, compiler.compile({.path = "rhi/shaders/resample.frag"}));
            NACRE_TRY(resample_vertex, device.create_shader(vertex));
            NACRE_TRY(resample_fragment, device.create_shader(fragment));
        }
        NACRE_TRY(const GraphicsPipeline pipeline,
                  device.create_graphics_pipeline({.vertex = resample_vertex, .fragment = resample_fragment,
                                                   .color_targets = {{.format = format}},
                                                   .name = desc.name + ": resample"}));
        return resample_pipelines[format] = pipeline;
    }

    [[nodiscard]] std::vector<BindGroupEntry> group_entries() const {
        std::vector<BindGroupEntry> list;
        if (!uses_pages) {
            for (std::uint32_t i = 0; i < desc.capacity; ++i) {
                const bool is_used = i < entries.size() && entries[i].is_used;
                list.push_back({.binding = 0, .texture = is_used ? entries[i].texture : empty_texture,
                                .sampler = is_used ? entries[i].sampler : empty_sampler, .element = i});
            }
            return list;
        }
        list.push_back({.binding = 0, .buffer = indirection});
        for (std::uint32_t i = 0; i < desc.max_pages; ++i) {
            const bool is_used = i < pages.size();
            TextureView view(is_used ? pages[i].texture : empty_texture);
            view.dimension = ViewDimension::d2_array;
            list.push_back({.binding = i + 1, .texture = view,
                            .sampler = is_used ? pages[i].kind.sampler : empty_sampler});
        }
        return list;
    }
};

TextureTable::TextureTable(std::unique_ptr<State> state) : state_(std::move(state)) {}
TextureTable::TextureTable(TextureTable&&) noexcept = default;
TextureTable& TextureTable::operator=(TextureTable&&) noexcept = default;
TextureTable::~TextureTable() = default;

Expected<TextureTable> TextureTable::create(Device& device, const TextureTableDesc& desc) {
    const auto reject = [&](std::string reason, std::string remedy) {
        return fail(ErrorCode::invalid_argument, "create texture table", fmt::format("'{}'", desc.name),
                    std::move(reason), std::move(remedy));
    };
    if (desc.capacity == 0 || desc.capacity > most_textures)
        return reject(fmt::format("the capacity is {}", desc.capacity), fmt::format("Use 1 to {}.", most_textures));
    if (desc.max_pages == 0 || desc.max_pages > most_pages)
        return reject(fmt::format("the number of pages is {}", desc.max_pages),
                      fmt::format("Use 1 to {}.", most_pages));
    const Capabilities& capabilities = device.capabilities();
    if (desc.set >= capabilities.max_bind_groups)
        return reject(fmt::format("the set is {}", desc.set),
                      fmt::format("This device has the sets 0 to {}.", capabilities.max_bind_groups - 1));
    auto state = std::make_unique<State>(device, desc);
    state->uses_pages = desc.force_pages || !capabilities.descriptor_indexing;
    constexpr std::size_t fragment = 1;
    if (state->uses_pages)
        state->desc.max_pages = std::min({desc.max_pages, capabilities.max_sampled_textures[fragment],
                                          capabilities.max_samplers[fragment]});
    else
        state->desc.capacity = std::min(desc.capacity, std::max(capabilities.max_bindless_textures, 1u));
    NACRE_CHECK(state->make_objects());
    return TextureTable(std::move(state));
}

Expected<std::uint32_t> TextureTable::add(Texture texture, Sampler sampler) {
    State& state = *state_;
    NACRE_TRY(TextureDesc desc, state.device.describe(texture));
    const auto reject = [&](std::string reason, std::string remedy) {
        return fail(ErrorCode::invalid_argument, std::string(add_action), fmt::format("'{}'", desc.name),
                    std::move(reason), std::move(remedy));
    };
    if (desc.dimension != TextureDimension::d2 || desc.layers != 1 || desc.samples != 1)
        return reject("it is not a 2D texture of one layer and one sample", "Bind it by itself.");
    if (!has_all(desc.usage, TextureUsage::sampled | TextureUsage::copy_source))
        return reject("it was made without the usages sampled and copy_source", "Add them to TextureDesc::usage.");
    if (info(desc.format).is_integer() || info(desc.format).is_depth_stencil())
        return reject(fmt::format("shaders read {} through another kind of sampler", info(desc.format).name),
                      "Bind it by itself.");
    std::uint32_t index = 0;
    if (!state.free_entries.empty()) {
        index = state.free_entries.back();
        state.free_entries.pop_back();
    } else if (state.entries.size() < state.desc.capacity) {
        index = static_cast<std::uint32_t>(state.entries.size());
        state.entries.emplace_back();
    } else {
        return fail(ErrorCode::out_of_memory, std::string(add_action), fmt::format("'{}'", desc.name),
                    fmt::format("'{}' holds {} textures already", state.desc.name, state.desc.capacity),
                    "Raise TextureTableDesc::capacity.");
    }
    state.entries[index] = {texture, sampler, std::move(desc), true};
    state.is_changed = true;
    return index;
}

void TextureTable::remove(std::uint32_t index) {
    State& state = *state_;
    if (index >= state.entries.size() || !state.entries[index].is_used) return;
    state.entries[index] = {};
    state.removed.push_back(index);
    state.is_changed = true;
}

Expected<void> TextureTable::update() {
    State& state = *state_;
    if (!state.is_changed) return {};
    state.destroy_groups();
    if (state.uses_pages) {
        auto updated = state.update_pages();
        for (const BindGroup group : std::exchange(state.resample_groups, {})) state.device.destroy(group);
        if (!updated) return updated;
    }
    state.free_entries.insert(state.free_entries.end(), state.removed.begin(), state.removed.end());
    state.removed.clear();
    state.is_changed = false;
    return {};
}

Expected<BindGroup> TextureTable::bind_group(BindGroupLayout layout) {
    State& state = *state_;
    if (const auto found = state.groups.find(layout); found != state.groups.end()) return found->second;
    NACRE_TRY(
        const BindGroup group,
        state.device.create_bind_group({.layout = layout, .entries = state.group_entries(), .name = state.desc.name}));
    return state.groups[layout] = group;
}

std::vector<ShaderDefine> TextureTable::defines() const {
    return {{"NACRE_TEXTURE_TABLE_SET", std::to_string(state_->desc.set)},
            {"NACRE_TEXTURE_TABLE_PAGES", std::to_string(state_->uses_pages ? state_->desc.max_pages : 0)},
            {"NACRE_TEXTURE_TABLE_CAPACITY", std::to_string(state_->desc.capacity)}};
}

bool TextureTable::uses_pages() const { return state_->uses_pages; }
std::uint32_t TextureTable::page_count() const { return static_cast<std::uint32_t>(state_->pages.size()); }

}  // namespace nacre::rhi
