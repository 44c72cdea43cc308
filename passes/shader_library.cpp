// SPDX-License-Identifier: Apache-2.0
#include "passes/shader_library.h"

#include <algorithm>
#include <array>

#include "core/hash.h"
#include "passes/gbuffer_layout.h"
#include "passes/renderer.h"

namespace nacre::passes {
namespace {

/// GLSL that is made from tables of this part.
std::span<const EmbeddedFile> generated_files() {
    static const std::string gbuffer = gbuffer_glsl();
    static const std::array<EmbeddedFile, 1> files = {EmbeddedFile{"passes/shared/gbuffer_fields.glsl", gbuffer}};
    return files;
}

}  // namespace

ShaderLibrary::ShaderLibrary(rhi::Device& device, DiskCache* cache)
    : device_(device), compiler_({.embedded = {embedded_files(), generated_files()}, .cache = cache}) {}

ShaderLibrary::~ShaderLibrary() {
    for (const auto& [key, entry] : entries_) device_.destroy(entry.shader);
}

Expected<rhi::Shader> ShaderLibrary::get(const std::string& pass, const rhi::ShaderSource& source) {
    std::string key = source.path;
    for (const rhi::ShaderDefine& define : source.defines) key += "\n" + define.name + "=" + define.value;
    std::vector<std::string>& used = users_[pass];
    if (std::ranges::find(used, key) == used.end()) used.push_back(key);
    if (const auto found = entries_.find(key); found != entries_.end()) return found->second.shader;

    NACRE_TRY(const rhi::ShaderDesc desc, compiler_.compile(source));
    Entry entry;
    entry.planned = {source.path, source.defines, desc.spirv.size() * sizeof(std::uint32_t),
                     hash64(std::as_bytes(std::span(desc.spirv)))};
    NACRE_TRY(entry.shader, device_.create_shader(desc));
    return entries_.emplace(key, std::move(entry)).first->second.shader;
}

std::vector<PlannedShader> ShaderLibrary::shaders_of(const std::string& pass) const {
    std::vector<PlannedShader> result;
    if (const auto used = users_.find(pass); used != users_.end()) {
        for (const std::string& key : used->second) {
            if (const auto found = entries_.find(key); found != entries_.end()) result.push_back(found->second.planned);
        }
    }
    return result;
}

}  // namespace nacre::passes
