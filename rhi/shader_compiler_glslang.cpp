// SPDX-License-Identifier: Apache-2.0
#include "rhi/shader_compiler_glslang.h"

#include <set>
#include <sstream>

#include <fmt/format.h>
#include <spirv-tools/libspirv.h>
#include <spirv-tools/optimizer.hpp>

#include "core/log.h"
#include "rhi/glslang_version.h"

namespace nacre::rhi {
namespace {

// Deep enough for any real tree; a file that includes itself without a guard ends here.
constexpr std::size_t max_include_depth = 48;

/// glslang wants its process-wide tables made once; they live as long as the program.
void initialize_glslang() {
    static const bool is_initialized = glslang::InitializeProcess();
    static_cast<void>(is_initialized);
}

EShLanguage language_of(ShaderStage stage) {
    switch (stage) {
        case ShaderStage::vertex: return EShLangVertex;
        case ShaderStage::fragment: return EShLangFragment;
        default: return EShLangCompute;
    }
}

/// Answers glslang's requests for includes from the files in memory.
class Includer final : public glslang::TShader::Includer {
  public:
    struct Missing {
        std::string name, includer;
        bool is_too_deep = false;
    };

    explicit Includer(const GlslInput& input) : input_(input) {}

    IncludeResult* includeLocal(const char* name, const char* includer, std::size_t depth) override {
        const auto file = input_.files.find(includer);
        if (depth > max_include_depth) {
            missing_.push_back({name, includer, true});
            return nullptr;
        }
        if (file != input_.files.end()) {
            if (const auto path = file->second.includes.find(name); path != file->second.includes.end()) {
                if (const auto found = input_.files.find(path->second); found != input_.files.end())
                    return result(*found);
            }
        }
        missing_.push_back({name, includer});
        return nullptr;
    }
    // <name> means the same as "name"; glslang also asks here after includeLocal had no answer.
    IncludeResult* includeSystem(const char* name, const char* includer, std::size_t depth) override {
        if (!missing_.empty() && missing_.back().name == name && missing_.back().includer == includer) return nullptr;
        return includeLocal(name, includer, depth);
    }
    void releaseInclude(IncludeResult* result) override { delete result; }

    [[nodiscard]] const std::vector<Missing>& missing() const { return missing_; }

  private:
    // glslang knows no `#pragma once`: the second inclusion of such a file is empty.
    IncludeResult* result(const std::pair<const std::string, GlslFile>& file) {
        static const std::string empty = "\n";
        const bool once = file.second.text.find("#pragma once") != std::string::npos;
        const std::string& text = once && !included_once_.insert(file.first).second ? empty : file.second.text;
        return new IncludeResult(file.first, text.data(), text.size(), nullptr);
    }

    const GlslInput& input_;
    std::set<std::string> included_once_;
    std::vector<Missing> missing_;
};

/// glslang writes "ERROR: path:12: 'x' : undeclared identifier"; people and editors read "path:12: ...".
std::string readable_log(const char* log, const std::string& path) {
    std::istringstream lines(log ? log : "");
    std::string result;
    for (std::string line; std::getline(lines, line);) {
        while (!line.empty() && (line.back() == ' ' || line.back() == '\r')) line.pop_back();
        const bool is_warning = line.starts_with("WARNING: ");
        if (line.starts_with("ERROR: ")) line.erase(0, 7);
        if (is_warning) line.erase(0, 9);
        if (line.empty() || line.find("compilation errors.  No code generated") != std::string::npos ||
            line.find("compilation terminated") != std::string::npos || line.find("#pragma once") != std::string::npos)
            continue;
        if (line.starts_with("Linking ") || line.starts_with("Missing entry point"))
            line = fmt::format("{}:1: {}", path, line);
        // The text before the main file has no name: the definitions.
        if (line.starts_with("0:")) line = fmt::format("(definitions):{}", line.substr(2));
        if (is_warning) {
            const auto text = line.find(": ");
            if (text != std::string::npos) line.insert(text + 2, "warning: ");
        }
        result += line;
        result += '\n';
    }
    if (!result.empty()) result.pop_back();
    return result;
}

std::unexpected<Error> rejected(const GlslInput& input, const Includer& includer, const std::string& log) {
    if (!includer.missing().empty()) {
        const auto& missing = includer.missing().front();
        const auto file = input.files.find(missing.includer);
        int line = 0;
        if (file != input.files.end() && file->second.include_lines.contains(missing.name))
            line = file->second.include_lines.at(missing.name);
        if (missing.is_too_deep)
            return fail(ErrorCode::shader_compile, std::string(compile_action), fmt::format("'{}'", input.path),
                        fmt::format("{}:{}: includes are nested more than {} deep; '{}' includes itself",
                                    missing.includer, line, max_include_depth, missing.name),
                        "Write #pragma once at its top.");
        return fail(ErrorCode::not_found, std::string(compile_action), fmt::format("'{}'", input.path),
                    fmt::format("{}:{}: there is no file '{}', neither beside '{}' nor from the root", missing.includer,
                                line, missing.name, missing.includer),
                    "Correct the path, or add the file to the embedded files of its part.");
    }
    return fail(ErrorCode::shader_compile, std::string(compile_action), fmt::format("'{}'", input.path),
                fmt::format("the compiler says:\n{}", log));
}

Expected<std::vector<std::uint32_t>> optimize(std::vector<std::uint32_t> words, const std::string& path) {
    spvtools::Optimizer optimizer(words[1] > 0x10300 ? SPV_ENV_VULKAN_1_1_SPIRV_1_4 : SPV_ENV_VULKAN_1_1);
    std::string log;
    optimizer.SetMessageConsumer([&](spv_message_level_t, const char*, const spv_position_t& position,
                                     const char* message) { log += fmt::format("{}: {}\n", position.index, message); });
    optimizer.RegisterPerformancePasses();
    spvtools::OptimizerOptions options;
    options.set_run_validator(false);       // `reflect` validates what comes out.
    options.set_preserve_bindings(true);    // A layout does not depend on what is left over.
    options.set_preserve_spec_constants(true);
    std::vector<std::uint32_t> optimized;
    if (!optimizer.Run(words.data(), words.size(), &optimized, options))
        return fail(ErrorCode::internal, "optimize shader", fmt::format("'{}'", path), log,
                    "Compile it without ShaderCompilerDesc::optimize.");
    return optimized;
}

/// @param asks_for_rays  set where the shader requests GL_EXT_ray_query
Expected<std::vector<std::uint32_t>> compile_for(const GlslInput& input, glslang::EShTargetLanguageVersion target,
                                                 bool& asks_for_rays) {
    const EShLanguage language = language_of(input.stage);
    const GlslFile& main_file = input.files.at(input.path);

    glslang::TShader shader(language);
    const char* text = main_file.text.data();
    const int length = static_cast<int>(main_file.text.size());
    const char* name = input.path.c_str();
    shader.setStringsWithLengthsAndNames(&text, &length, &name, 1);
    const std::string preamble = "#extension GL_GOOGLE_include_directive : require\n" + input.preamble;
    shader.setPreamble(preamble.c_str());
    shader.setEntryPoint("main");
    shader.setSourceEntryPoint("main");
    shader.setEnvInput(glslang::EShSourceGlsl, language, glslang::EShClientVulkan, 100);
    shader.setEnvClient(glslang::EShClientVulkan, glslang::EShTargetVulkan_1_1);
    shader.setEnvTarget(glslang::EShTargetSpv, target);
    // Not TShader::setDebugInfo: it is for NonSemantic.Shader.DebugInfo alone, and without that glslang 12.0 writes
    // invalid modules for every block in braces. SpvOptions::generateDebugInfo is all that line tables need.

    auto messages = static_cast<EShMessages>(EShMsgSpvRules | EShMsgVulkanRules);
    if (input.debug_information) messages = static_cast<EShMessages>(messages | EShMsgDebugInfo);

    Includer includer(input);
    constexpr int default_version = 460;
    if (!shader.parse(GetDefaultResources(), default_version, ECoreProfile, false, false, messages, includer))
        return rejected(input, includer, readable_log(shader.getInfoLog(), input.path));
    asks_for_rays = shader.getIntermediate()->getRequestedExtensions().contains("GL_EXT_ray_query");
    if (asks_for_rays && target < glslang::EShTargetSpv_1_4) return std::vector<std::uint32_t>();
    if (const std::string log = readable_log(shader.getInfoLog(), input.path); !log.empty())
        log_message(LogLevel::debug, log);

    glslang::TProgram program;
    program.addShader(&shader);
    if (!program.link(messages)) return rejected(input, includer, readable_log(program.getInfoLog(), input.path));

    glslang::SpvOptions options;
    options.generateDebugInfo = input.debug_information;
    options.stripDebugInfo = !input.debug_information;
    options.disableOptimizer = true;
    spv::SpvBuildLogger logger;
    std::vector<std::uint32_t> words;
    glslang::GlslangToSpv(*program.getIntermediate(language), words, &logger, &options);
    if (words.empty())
        return fail(ErrorCode::shader_compile, std::string(compile_action), fmt::format("'{}'", input.path),
                    fmt::format("no SPIR-V came out: {}", logger.getAllMessages()));
    return input.optimize ? optimize(std::move(words), input.path) : std::move(words);
}

}  // namespace

const std::string& glsl_compiler_version() {
    static const std::string version =
        fmt::format("form 3, glslang {}, {}", glslang_version, spvSoftwareVersionDetailsString());
    return version;
}

Expected<std::vector<std::uint32_t>> compile_glsl(const GlslInput& input) {
    initialize_glslang();
    // SPIR-V 1.3 is the newest that all consumers take: Vulkan 1.1 drivers, SPIRV-Cross of Debian 12. Ray queries need
    // 1.4, which every device that has them takes; whether a shader asks for them is known once it was read.
    bool asks_for_rays = false;
    auto words = compile_for(input, glslang::EShTargetSpv_1_3, asks_for_rays);
    if (!asks_for_rays) return words;
    return compile_for(input, glslang::EShTargetSpv_1_4, asks_for_rays);
}

}  // namespace nacre::rhi
