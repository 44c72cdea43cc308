// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/embedded_file.h"
#include "core/error.h"
#include "rhi/pipeline.h"

/// @file
/// GLSL to SPIR-V.
///
///     ShaderCompiler compiler({.embedded = {passes::embedded_files(), rhi::embedded_files()}});
///     ShaderDesc shader = *compiler.compile({.path = "passes/lighting/lighting.comp", .defines = {{"SHADOWS", "1"}}});
///     Shader handle = *device.create_shader(shader);

namespace nacre {
class DiskCache;
}

namespace nacre::rhi {

struct ShaderDefine {
    std::string name;
    std::string value = "1";
};

struct ShaderCompilerDesc {
    /// Files compiled into the program, searched by path ("passes/lighting/lighting.comp").
    std::vector<std::span<const EmbeddedFile>> embedded;
    /// Folder that holds the same paths as the embedded files; searched first where it is set. Default: the environment
    /// variable NACRE_SHADER_DIR. This is what makes hot reload possible.
    std::filesystem::path source_folder{};
    DiskCache* cache = nullptr;     ///< Null: nothing is kept.
    bool debug_information = true;  ///< Names, files and line tables that debuggers show.
    bool optimize = false;          ///< Runs SPIRV-Tools' performance passes.
};

struct ShaderSource {
    std::string path;               ///< Virtual path; the extension (.vert, .frag, .comp) tells the stage.
    std::vector<ShaderDefine> defines{};
    std::string text{};             ///< GLSL; empty: read from `path`.
};

/// Compiles GLSL 4.60 for Vulkan to SPIR-V 1.3, with `#include "path"` (relative to the including file, then from the
/// root) and `#pragma once`. `GL_GOOGLE_include_directive` and `#version 460` are implied, and one of
/// NACRE_VERTEX_STAGE, NACRE_FRAGMENT_STAGE and NACRE_COMPUTE_STAGE is defined; what of the language runs on all
/// backends stands in docs/writing-shaders.md. Thread-safe; compiles on as many threads as call it.
///
/// A cache entry's key holds the text of every file, all definitions and options and the versions of the libraries;
/// a damaged entry is rebuilt. Includes are found by a scan of the text, so their names cannot come from macros.
class ShaderCompiler {
  public:
    explicit ShaderCompiler(ShaderCompilerDesc desc);
    ~ShaderCompiler();

    /// Errors: not_found (names the including file and line), shader_compile with the whole log, each line as
    /// "path:line: message", path being that of the include where the fault is.
    Expected<ShaderDesc> compile(const ShaderSource& source);

    /// True when a file below the source folder that `compile` has read for this source (whether it succeeded or not)
    /// has since changed, vanished or come into being. Costs one look at the file system for each file.
    bool is_outdated(const ShaderSource& source) const;

    /// Paths of the files that the last `compile` of this source read, the source itself first. Files that are
    /// included under a false #if count as well.
    std::vector<std::string> dependencies(const ShaderSource& source) const;

    struct Statistics {
        std::uint64_t compiled = 0;         ///< Times that glslang ran.
        std::uint64_t from_memory = 0;      ///< Asked for again in this process.
        std::uint64_t from_cache = 0;       ///< Read from the disk cache.
        std::uint64_t rebuilt_entries = 0;  ///< Cache entries that held something else than SPIR-V.
        double compile_ms = 0.0;            ///< Spent in glslang and the optimizer, over all threads.
    };
    [[nodiscard]] Statistics statistics() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace nacre::rhi
