// SPDX-License-Identifier: Apache-2.0
#include "passes/shader_library.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "core/hash.h"
#include "materials/slab.h"
#include "materials/storage_shader.h"
#include "passes/gbuffer_layout.h"
#include "passes/renderer.h"
#include "rhi/embedded_shaders.h"

namespace nacre::passes {
namespace {

/// GLSL that is made from tables of this part.
std::span<const EmbeddedFile> generated_files() {
    static const std::string gbuffer = gbuffer_glsl();
    static const std::array<EmbeddedFile, 1> files = {EmbeddedFile{"passes/shared/gbuffer_fields.glsl", gbuffer}};
    return files;
}

std::string key_of(const rhi::ShaderSource& source) {
    std::string key = source.path;
    for (const rhi::ShaderDefine& define : source.defines) key += "\n" + define.name + "=" + define.value;
    return key;
}

}  // namespace

ShaderLibrary::ShaderLibrary(rhi::Device& device, DiskCache* cache, std::filesystem::path folder,
                             std::vector<EmbeddedFile> made)
    : device_(device),
      made_(std::move(made)),
      compiler_({.embedded = {embedded_files(), generated_files(), materials::embedded_files(),
                              materials::storage_reader_files(), rhi::embedded_files(), made_},
                 .source_folder = std::move(folder),
                 .cache = cache}),
      pipelines_(device, compiler_) {}

ShaderLibrary::~ShaderLibrary() {
    for (const auto& [key, once] : once_) device_.destroy(once.shader);
}

Expected<void> ShaderLibrary::check_folder(const std::filesystem::path& folder) {
    std::error_code error;
    const bool has_any = std::ranges::any_of(embedded_files(), [&](const EmbeddedFile& file) {
        return std::filesystem::is_regular_file(folder / file.path, error);
    });
    if (has_any) return {};
    return fail(ErrorCode::not_found, "read shaders from", fmt::format("'{}'", folder.string()),
                std::filesystem::is_directory(folder, error) ? "none of the shaders of the passes is below it"
                                                             : "there is no such folder",
                "Name the root of Nacre's sources, the folder that holds passes/.");
}

Expected<rhi::ShaderDesc> ShaderLibrary::compile(const std::string& pass, const rhi::ShaderSource& source) {
    NACRE_TRY(rhi::ShaderDesc desc, compiler_.compile(source));
    const std::string key = key_of(source);
    std::vector<std::string>& used = users_[pass];
    if (std::ranges::find(used, key) == used.end()) used.push_back(key);
    planned_.try_emplace(key, PlannedShader{source.path, source.defines, desc.spirv.size() * sizeof(std::uint32_t),
                                            hash64(std::as_bytes(std::span(desc.spirv)))});
    return desc;
}

Expected<rhi::ReloadableGraphicsPipeline> ShaderLibrary::graphics_pipeline(
    const std::string& pass, const rhi::GraphicsPipelineDesc& desc, const rhi::ShaderSource& vertex,
    const std::optional<rhi::ShaderSource>& fragment) {
    NACRE_CHECK(compile(pass, vertex));
    if (fragment) NACRE_CHECK(compile(pass, *fragment));
    return pipelines_.add(desc, vertex, fragment);
}

Expected<rhi::ReloadableComputePipeline> ShaderLibrary::compute_pipeline(const std::string& pass,
                                                                         const rhi::ComputePipelineDesc& desc,
                                                                         const rhi::ShaderSource& source) {
    NACRE_CHECK(compile(pass, source));
    return pipelines_.add(desc, source);
}

rhi::GraphicsPipeline ShaderLibrary::get(rhi::ReloadableGraphicsPipeline pipeline) const {
    return pipelines_.get(pipeline);
}
rhi::ComputePipeline ShaderLibrary::get(rhi::ReloadableComputePipeline pipeline) const {
    return pipelines_.get(pipeline);
}

Expected<rhi::Shader> ShaderLibrary::shader_for_once(const std::string& pass, const rhi::ShaderSource& source) {
    const std::string key = key_of(source);
    if (const auto known = once_.find(key); known != once_.end()) return known->second.shader;
    NACRE_TRY(const rhi::ShaderDesc desc, compile(pass, source));
    NACRE_TRY(const rhi::Shader shader, device_.create_shader(desc));
    once_.emplace(key, Once{pass, source, shader});
    return shader;
}

std::vector<rhi::PipelineReload> ShaderLibrary::reload_changed() {
    std::vector<rhi::PipelineReload> all = pipelines_.reload_changed();
    for (const auto& [key, once] : once_) {
        if (!compiler_.is_outdated(once.source)) continue;
        // Compiled for what it says, and so that the change is reported only once.
        const auto result = compiler_.compile(once.source);
        all.push_back(
            {once.pass, result ? Error{ErrorCode::unsupported, "reload shader", fmt::format("'{}'", once.source.path),
                                       "it runs once, before the first frame, so its change does not show",
                                       "Start the program again."}
                               : result.error()});
    }
    // A pass has many pipelines of the same files; what is wrong with one is wrong with all.
    std::vector<rhi::PipelineReload> reloads;
    for (rhi::PipelineReload& reload : all) {
        const bool is_known = std::ranges::any_of(reloads, [&](const rhi::PipelineReload& other) {
            return other.pipeline == reload.pipeline && other.error.has_value() == reload.error.has_value() &&
                   (!other.error || other.error->message() == reload.error->message());
        });
        if (!is_known) reloads.push_back(std::move(reload));
    }
    return reloads;
}

std::vector<PlannedShader> ShaderLibrary::shaders_of(const std::string& pass) const {
    std::vector<PlannedShader> result;
    if (const auto used = users_.find(pass); used != users_.end()) {
        for (const std::string& key : used->second) result.push_back(planned_.at(key));
    }
    return result;
}

}  // namespace nacre::passes
