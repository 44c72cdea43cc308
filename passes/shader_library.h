// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/embedded_file.h"
#include "core/error.h"
#include "passes/plan.h"
#include "rhi/device.h"
#include "rhi/pipeline_reloader.h"
#include "rhi/shader_compiler.h"

/// @file
/// Shaders and pipelines of one renderer, with a record of which pass uses which. Pipelines follow the files of their
/// shaders where these come from a folder.
///
///     NACRE_TRY(auto sky, library.compute_pipeline("sky", desc, {.path = "passes/sky/sky.comp"}));
///     for (const rhi::PipelineReload& reload : library.reload_changed()) ...
///     list.set_pipeline(library.get(sky));

namespace nacre::passes {

class ShaderLibrary {
  public:
    /// Files come from `folder` where it has them, else from the program; empty: that of NACRE_SHADER_DIR, if any.
    /// `made` are files made for this renderer; they outlive the library.
    ShaderLibrary(rhi::Device& device, DiskCache* cache, std::filesystem::path folder = {},
                  std::vector<EmbeddedFile> made = {});
    ~ShaderLibrary();
    ShaderLibrary(const ShaderLibrary&) = delete;
    ShaderLibrary& operator=(const ShaderLibrary&) = delete;

    /// Error not_found: `folder` is none, or holds none of the files that shaders are made of.
    static Expected<void> check_folder(const std::filesystem::path& folder);

    /// Pipelines that live as long as the library. The shaders of `desc` are left empty; what they are is noted under
    /// the pass's name for the plan.
    Expected<rhi::ReloadableGraphicsPipeline> graphics_pipeline(const std::string& pass,
                                                                const rhi::GraphicsPipelineDesc& desc,
                                                                const rhi::ShaderSource& vertex,
                                                                const std::optional<rhi::ShaderSource>& fragment);
    Expected<rhi::ReloadableComputePipeline> compute_pipeline(const std::string& pass,
                                                              const rhi::ComputePipelineDesc& desc,
                                                              const rhi::ShaderSource& source);
    /// The pipeline in use; asked anew in every frame.
    [[nodiscard]] rhi::GraphicsPipeline get(rhi::ReloadableGraphicsPipeline pipeline) const;
    [[nodiscard]] rhi::ComputePipeline get(rhi::ReloadableComputePipeline pipeline) const;

    /// SPIR-V of a shader, noted as above.
    Expected<rhi::ShaderDesc> compile(const std::string& pass, const rhi::ShaderSource& source);
    /// A shader for work that is done once, when the renderer is made; noted as above.
    Expected<rhi::Shader> shader_for_once(const std::string& pass, const rhi::ShaderSource& source);

    /// Makes those pipelines anew of which a file has changed. One entry for each pass and error; an error of code
    /// unsupported also says of a shader used once that its change does not show.
    std::vector<rhi::PipelineReload> reload_changed();

    /// What was made for a pass, without repetitions.
    [[nodiscard]] std::vector<PlannedShader> shaders_of(const std::string& pass) const;

  private:
    struct Once {
        std::string pass;
        rhi::ShaderSource source;
        rhi::Shader shader;
    };
    rhi::Device& device_;
    std::vector<EmbeddedFile> made_;
    rhi::ShaderCompiler compiler_;
    rhi::PipelineReloader pipelines_;
    std::map<std::string, Once> once_;
    std::map<std::string, PlannedShader> planned_;
    std::map<std::string, std::vector<std::string>> users_;
};

}  // namespace nacre::passes
