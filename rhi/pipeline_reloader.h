// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"

/// @file
/// Pipelines that follow the files of their shaders while a program runs ("hot reload").
///
///     ShaderCompiler compiler({.embedded = {passes::embedded_files()}, .source_folder = "."});
///     PipelineReloader pipelines(device, compiler);
///     auto sky = *pipelines.add(desc, {.path = "passes/sky/sky.vert"}, {.path = "passes/sky/sky.frag"});
///     for (const PipelineReload& reload : pipelines.reload_changed())   // once in a frame, or in a second
///         if (reload.error) show(reload.error->message());              // the old pipeline goes on working
///     list.set_pipeline(pipelines.get(sky));
///
/// A file that does not compile, or that changes the bindings or the size of the push constants (what the program
/// binds and pushes would no longer fit), is reported once and leaves the old pipeline as it is; the next change of the
/// file is tried again.

namespace nacre::rhi {

/// Names a pipeline of one `PipelineReloader`.
struct ReloadableGraphicsPipeline {
    std::uint32_t index = ~0u;
};
struct ReloadableComputePipeline {
    std::uint32_t index = ~0u;
};

/// What became of one pipeline whose files had changed.
struct PipelineReload {
    std::string pipeline;        ///< Its name.
    std::optional<Error> error;  ///< Empty: the new one is in use.
};

/// Not thread-safe. Device and compiler must outlive it; it destroys its pipelines.
class PipelineReloader {
  public:
    PipelineReloader(Device& device, ShaderCompiler& compiler);
    ~PipelineReloader();
    PipelineReloader(const PipelineReloader&) = delete;
    PipelineReloader& operator=(const PipelineReloader&) = delete;

    /// Makes a pipeline now. The shaders of `desc` are left empty; so is `fragment` for pipelines that only write
    /// depth.
    Expected<ReloadableGraphicsPipeline> add(const GraphicsPipelineDesc& desc, const ShaderSource& vertex,
                                             const std::optional<ShaderSource>& fragment);
    Expected<ReloadableComputePipeline> add(const ComputePipelineDesc& desc, const ShaderSource& shader);

    /// The pipeline in use; ask anew in every frame.
    [[nodiscard]] GraphicsPipeline get(ReloadableGraphicsPipeline pipeline) const;
    [[nodiscard]] ComputePipeline get(ReloadableComputePipeline pipeline) const;

    /// Makes those pipelines anew of which a file has changed. Returns one entry for each, none where nothing changed.
    std::vector<PipelineReload> reload_changed();

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace nacre::rhi
