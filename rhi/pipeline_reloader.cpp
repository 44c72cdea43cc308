// SPDX-License-Identifier: Apache-2.0
#include "rhi/pipeline_reloader.h"

#include <algorithm>

#include <fmt/format.h>

namespace nacre::rhi {
namespace {

/// The same for both kinds of pipelines: a description, sources, and what was made of them.
template <typename Desc, typename Pipeline>
struct Reloadable {
    Desc desc;
    std::vector<ShaderSource> sources;
    std::vector<Shader> shaders{};
    Pipeline pipeline{};
};

using Graphics = Reloadable<GraphicsPipelineDesc, GraphicsPipeline>;
using Compute = Reloadable<ComputePipelineDesc, ComputePipeline>;

Expected<GraphicsPipeline> make(Device& device, GraphicsPipelineDesc desc, const std::vector<Shader>& shaders) {
    desc.vertex = shaders[0];
    if (shaders.size() > 1) desc.fragment = shaders[1];
    return device.create_graphics_pipeline(desc);
}
Expected<ComputePipeline> make(Device& device, ComputePipelineDesc desc, const std::vector<Shader>& shaders) {
    desc.shader = shaders[0];
    return device.create_compute_pipeline(desc);
}

void destroy(Device& device, const std::vector<Shader>& shaders) {
    for (const Shader shader : shaders) device.destroy(shader);
}

}  // namespace

struct PipelineReloader::State {
    Device& device;
    ShaderCompiler& compiler;
    std::vector<Graphics> graphics{};
    std::vector<Compute> compute{};

    Expected<std::vector<Shader>> make_shaders(const std::vector<ShaderSource>& sources) {
        // All are compiled, also after an error: a source that was never tried would not be watched.
        std::vector<Expected<ShaderDesc>> compiled;
        for (const ShaderSource& source : sources) compiled.push_back(compiler.compile(source));
        for (const auto& result : compiled)
            if (!result) return std::unexpected(result.error());
        std::vector<Shader> shaders;
        for (const auto& result : compiled) {
            auto shader = device.create_shader(*result);
            if (!shader) {
                destroy(device, shaders);
                return std::unexpected(shader.error());
            }
            shaders.push_back(*shader);
        }
        return shaders;
    }

    /// Number of bind-group indices up to the highest that the shaders use.
    [[nodiscard]] std::uint32_t set_count(const std::vector<Shader>& shaders) const {
        std::uint32_t count = 0;
        for (const Shader shader : shaders) {
            const auto reflection = device.reflection(shader);
            if (reflection && !reflection->bindings.empty())
                count = std::max(count, reflection->bindings.back().set + 1);
        }
        return count;
    }

    /// Bytes of push constants that the shaders take.
    [[nodiscard]] std::uint32_t push_constant_bytes(const std::vector<Shader>& shaders) const {
        std::uint32_t bytes = 0;
        for (const Shader shader : shaders) {
            if (const auto reflection = device.reflection(shader))
                bytes = std::max(bytes, reflection->push_constant_bytes);
        }
        return bytes;
    }

    /// What the program binds and pushes for the old pipeline must fit the new one. (Equal layouts are one object.)
    template <typename Item, typename Pipeline>
    Expected<void> check_interface(const Item& before, Pipeline after, const std::vector<Shader>& shaders) const {
        const auto unfit = [&](std::string reason) {
            return fail(ErrorCode::unsupported, "reload pipeline", fmt::format("'{}'", before.desc.name),
                        std::move(reason), "Undo that change, or start the program again.");
        };
        const std::vector<BindGroupLayout>& given = before.desc.bind_group_layouts;
        const std::uint32_t old_count = set_count(before.shaders), new_count = set_count(shaders);
        for (std::uint32_t set = 0; set < std::max(old_count, new_count); ++set) {
            // Explicit layouts stay; making the pipeline has checked that the shaders fit them.
            if (set < given.size() && given[set]) continue;
            if (set < std::min(old_count, new_count)) {
                NACRE_TRY(const BindGroupLayout old_layout, device.bind_group_layout(before.pipeline, set));
                NACRE_TRY(const BindGroupLayout new_layout, device.bind_group_layout(after, set));
                if (old_layout == new_layout) continue;
            }
            return unfit(fmt::format("the bindings of set {} have changed, so bind groups in use no longer fit", set));
        }
        const std::uint32_t old_bytes = push_constant_bytes(before.shaders), new_bytes = push_constant_bytes(shaders);
        if (old_bytes != new_bytes)
            return unfit(
                fmt::format("its push constants have grown or shrunk from {} to {} bytes, which is not what the "
                            "program pushes",
                            old_bytes, new_bytes));
        return {};
    }

    template <typename Item>
    Expected<void> remake(Item& item) {
        NACRE_TRY(std::vector<Shader> shaders, make_shaders(item.sources));
        auto pipeline = make(device, item.desc, shaders);
        if (!pipeline) {
            destroy(device, shaders);
            return std::unexpected(pipeline.error());
        }
        if (item.pipeline) {
            if (auto fits = check_interface(item, *pipeline, shaders); !fits) {
                device.destroy(*pipeline);
                destroy(device, shaders);
                return fits;
            }
            // The device keeps them for as long as submitted work needs them.
            device.destroy(item.pipeline);
            destroy(device, item.shaders);
        }
        item.pipeline = *pipeline;
        item.shaders = std::move(shaders);
        return {};
    }

    template <typename Item>
    [[nodiscard]] std::vector<bool> outdated(const std::vector<Item>& items) const {
        std::vector<bool> result;
        for (const Item& item : items)
            result.push_back(std::ranges::any_of(
                item.sources, [&](const ShaderSource& source) { return compiler.is_outdated(source); }));
        return result;
    }

    template <typename Item>
    void reload(std::vector<Item>& items, const std::vector<bool>& which, std::vector<PipelineReload>& reloads) {
        for (std::size_t i = 0; i < items.size(); ++i) {
            if (!which[i]) continue;
            const auto result = remake(items[i]);
            reloads.push_back({items[i].desc.name, result ? std::nullopt : std::optional(result.error())});
        }
    }
};

PipelineReloader::PipelineReloader(Device& device, ShaderCompiler& compiler)
    : state_(new State{device, compiler}) {}

PipelineReloader::~PipelineReloader() {
    const auto destroy_all = [&](const auto& items) {
        for (const auto& item : items) {
            state_->device.destroy(item.pipeline);
            destroy(state_->device, item.shaders);
        }
    };
    destroy_all(state_->graphics);
    destroy_all(state_->compute);
}

Expected<ReloadableGraphicsPipeline> PipelineReloader::add(const GraphicsPipelineDesc& desc,
                                                           const ShaderSource& vertex,
                                                           const std::optional<ShaderSource>& fragment) {
    Graphics item{.desc = desc, .sources = {vertex}};
    if (fragment) item.sources.push_back(*fragment);
    NACRE_CHECK(state_->remake(item));
    state_->graphics.push_back(std::move(item));
    return ReloadableGraphicsPipeline{static_cast<std::uint32_t>(state_->graphics.size() - 1)};
}

Expected<ReloadableComputePipeline> PipelineReloader::add(const ComputePipelineDesc& desc, const ShaderSource& shader) {
    Compute item{.desc = desc, .sources = {shader}};
    NACRE_CHECK(state_->remake(item));
    state_->compute.push_back(std::move(item));
    return ReloadableComputePipeline{static_cast<std::uint32_t>(state_->compute.size() - 1)};
}

GraphicsPipeline PipelineReloader::get(ReloadableGraphicsPipeline pipeline) const {
    return pipeline.index < state_->graphics.size() ? state_->graphics[pipeline.index].pipeline : GraphicsPipeline{};
}

ComputePipeline PipelineReloader::get(ReloadableComputePipeline pipeline) const {
    return pipeline.index < state_->compute.size() ? state_->compute[pipeline.index].pipeline : ComputePipeline{};
}

std::vector<PipelineReload> PipelineReloader::reload_changed() {
    // Asked for all before any is made: pipelines share sources, and a source is up to date once it is compiled.
    const std::vector<bool> graphics = state_->outdated(state_->graphics);
    const std::vector<bool> compute = state_->outdated(state_->compute);
    std::vector<PipelineReload> reloads;
    state_->reload(state_->graphics, graphics, reloads);
    state_->reload(state_->compute, compute, reloads);
    return reloads;
}

}  // namespace nacre::rhi
