// SPDX-License-Identifier: Apache-2.0
#include "rhi/shader_compiler.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>

#include <fmt/format.h>

#include "core/disk_cache.h"
#include "core/file.h"
#include "core/hash.h"
#include "rhi/shader_compiler_glslang.h"
#include "rhi/spirv.h"

namespace nacre::rhi {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view cache_category = "spirv";
constexpr std::uint64_t max_file_bytes = 16u << 20;

std::optional<ShaderStage> stage_of(std::string_view path) {
    if (path.ends_with(".vert")) return ShaderStage::vertex;
    if (path.ends_with(".frag")) return ShaderStage::fragment;
    if (path.ends_with(".comp")) return ShaderStage::compute;
    return {};
}

/// A virtual path in its shortest form; nothing where it leads out of the root.
std::optional<std::string> normalized(const fs::path& path) {
    std::string text = path.lexically_normal().generic_string();
    if (text.empty() || text.starts_with('/') || text == ".." || text.starts_with("../")) return {};
    return text;
}

/// The name in a line `#include "name"` or `#include <name>`.
std::optional<std::string_view> included_name(std::string_view line) {
    const auto skip = [&] {
        while (!line.empty() && (line.front() == ' ' || line.front() == '\t')) line.remove_prefix(1);
    };
    skip();
    if (!line.starts_with('#')) return {};
    line.remove_prefix(1), skip();
    if (!line.starts_with("include")) return {};
    line.remove_prefix(7), skip();
    if (line.empty() || (line.front() != '"' && line.front() != '<')) return {};
    const char close = line.front() == '"' ? '"' : '>';
    line.remove_prefix(1);
    const auto end = line.find(close);
    if (end == std::string_view::npos) return {};
    return line.substr(0, end);
}

bool is_identifier(std::string_view name) {
    const auto is_part = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
    return !name.empty() && !std::isdigit(static_cast<unsigned char>(name.front())) &&
           std::ranges::all_of(name, is_part);
}

/// What a file on disk was like when it was read, to notice that it has changed.
struct FileStamp {
    bool exists = false;
    fs::file_time_type time{};
    std::uintmax_t bytes = 0;
    Hash128 hash{};
    bool is_recent = false;  ///< Written so shortly before that its time can stay the same over one more change.

    static FileStamp of(const fs::path& path) {
        FileStamp stamp;
        std::error_code error;
        stamp.time = fs::last_write_time(path, error);
        if (error) return stamp;
        stamp.bytes = fs::file_size(path, error);
        stamp.exists = !error;
        stamp.is_recent = fs::file_time_type::clock::now() - stamp.time < std::chrono::seconds(2);
        return stamp;
    }

    [[nodiscard]] bool is_still_true(const fs::path& path) const {
        const FileStamp now = of(path);
        if (now.exists != exists) return false;
        if (!exists || (now.time == time && now.bytes == bytes && !is_recent)) return true;
        const auto text = read_text_file(path, max_file_bytes);
        return text && hash128(*text) == hash;
    }
};

/// All files that a source can need, and the places on disk that were looked at.
struct Collection {
    GlslInput input;
    std::vector<std::string> order;
    std::map<fs::path, FileStamp> looked_at;
};

std::string preamble_of(std::span<const ShaderDefine> defines) {
    std::string preamble;
    for (const ShaderDefine& define : defines) preamble += fmt::format("#define {} {}\n", define.name, define.value);
    return preamble;
}

/// Lets an include leave out what only one stage has.
std::string_view stage_definition(ShaderStage stage) {
    switch (stage) {
        case ShaderStage::vertex: return "#define NACRE_VERTEX_STAGE 1\n";
        case ShaderStage::fragment: return "#define NACRE_FRAGMENT_STAGE 1\n";
        default: return "#define NACRE_COMPUTE_STAGE 1\n";
    }
}

Hash128 identity_of(const ShaderSource& source) {
    Hasher hasher;
    hasher.add(source.path).add(source.text).add(preamble_of(source.defines));
    return hasher.finish();
}

}  // namespace

struct ShaderCompiler::State {
    ShaderCompilerDesc desc;
    std::map<std::string_view, std::string_view> embedded;

    mutable std::mutex mutex;
    struct Known {
        std::vector<std::string> dependencies;
        std::map<fs::path, FileStamp> looked_at;
    };
    std::map<Hash128, Known> sources;                        // By identity; of the last attempt.
    std::map<Hash128, std::vector<std::uint32_t>> compiled;  // By content.
    Statistics statistics;

    /// Text of a virtual path: the source folder first, then what is embedded.
    std::optional<std::string> find(const std::string& path, Collection& collection) const {
        if (!desc.source_folder.empty()) {
            const fs::path file = desc.source_folder / path;
            FileStamp stamp = FileStamp::of(file);
            std::optional<std::string> text;
            if (stamp.exists) {
                if (auto read = read_text_file(file, max_file_bytes)) text = *std::move(read);
                if (text) stamp.hash = hash128(*text);
                else stamp.exists = false;
            }
            collection.looked_at.emplace(file, stamp);
            if (text) return text;
        }
        if (const auto found = embedded.find(path); found != embedded.end()) return std::string(found->second);
        return {};
    }

    /// Adds a file's includes, and theirs. Not recursive: a chain of includes may be as long as it likes.
    void collect_includes(Collection& collection) const {
        for (std::size_t i = 0; i < collection.order.size(); ++i) {
            const std::string path = collection.order[i];
            // References into a map stay valid when it grows.
            GlslFile& file = collection.input.files.at(path);
            const std::string_view text = file.text;
            int line_number = 0;
            for (std::size_t start = 0; start < text.size();) {
                const std::size_t end = std::min(text.find('\n', start), text.size());
                ++line_number;
                if (const auto name = included_name(text.substr(start, end - start)))
                    resolve_include(collection, file, path, std::string(*name), line_number);
                start = end + 1;
            }
        }
    }

    void resolve_include(Collection& collection, GlslFile& file, const std::string& path, const std::string& name,
                         int line) const {
        file.include_lines.try_emplace(name, line);
        if (file.includes.contains(name)) return;
        for (const auto& candidate : {normalized(fs::path(path).parent_path() / name), normalized(name)}) {
            if (!candidate) continue;
            if (!collection.input.files.contains(*candidate)) {
                auto text = find(*candidate, collection);
                if (!text) continue;
                collection.input.files[*candidate].text = *std::move(text);
                collection.order.push_back(*candidate);
            }
            file.includes.emplace(name, *candidate);
            return;
        }
    }

    Expected<Collection> collect(const ShaderSource& source) const {
        Collection collection;
        const auto subject = fmt::format("'{}'", source.path);
        const auto stage = stage_of(source.path);
        if (!stage)
            return fail(ErrorCode::invalid_argument, std::string(compile_action), subject,
                        "the end of the path does not tell the stage", "Let it end in .vert, .frag or .comp.");
        const auto path = normalized(source.path);
        if (!path)
            return fail(ErrorCode::invalid_argument, std::string(compile_action), subject,
                        "the path leads out of the root of the sources",
                        "Use a path below it, as in \"passes/lighting/lighting.comp\".");
        for (const ShaderDefine& define : source.defines) {
            if (!is_identifier(define.name) || define.value.find_first_of("\n\\") != std::string::npos)
                return fail(ErrorCode::invalid_argument, std::string(compile_action), subject,
                            fmt::format("cannot define '{}' as '{}'", define.name, define.value),
                            "Names are identifiers; values are one line without a backslash.");
        }
        collection.input.path = *path;
        collection.input.stage = *stage;
        collection.input.preamble = std::string(stage_definition(*stage)) + preamble_of(source.defines);
        collection.input.debug_information = desc.debug_information;
        collection.input.optimize = desc.optimize;
        auto text = source.text.empty() ? find(*path, collection) : std::optional(source.text);
        // A missing source is remembered by the caller like any other failure, so that its coming is noticed.
        if (text) {
            collection.input.files[*path].text = *std::move(text);
            collection.order.push_back(*path);
            collect_includes(collection);
        }
        return collection;
    }

    [[nodiscard]] Hash128 key_of(const GlslInput& input) const {
        Hasher hasher;
        hasher.add(glsl_compiler_version()).add(input.path).add(input.stage).add(input.preamble);
        hasher.add(input.debug_information).add(input.optimize);
        for (const auto& [path, file] : input.files) hasher.add(path).add(file.text);
        return hasher.finish();
    }

    std::optional<std::vector<std::uint32_t>> load(const Hash128& key, const std::string& path) {
        if (!desc.cache) return {};
        const auto bytes = desc.cache->load(cache_category, key);
        if (!bytes) return {};
        std::vector<std::uint32_t> words(bytes->size() / 4);
        if (!words.empty()) std::memcpy(words.data(), bytes->data(), words.size() * 4);
        if (bytes->size() % 4 == 0 && spirv::check_structure(words, path)) return words;
        desc.cache->remove(cache_category, key);
        std::lock_guard lock(mutex);
        ++statistics.rebuilt_entries;
        return {};
    }

    Expected<std::vector<std::uint32_t>> compile(const GlslInput& input) {
        const Hash128 key = key_of(input);
        {
            std::lock_guard lock(mutex);
            if (const auto found = compiled.find(key); found != compiled.end()) {
                ++statistics.from_memory;
                return found->second;
            }
        }
        auto words = load(key, input.path);
        const bool is_cached = words.has_value();
        double milliseconds = 0.0;
        if (!is_cached) {
            const auto begin = std::chrono::steady_clock::now();
            NACRE_TRY(words, compile_glsl(input));
            milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
            if (desc.cache) desc.cache->store(cache_category, key, std::as_bytes(std::span(*words)));
        }
        std::lock_guard lock(mutex);
        ++(is_cached ? statistics.from_cache : statistics.compiled);
        statistics.compile_ms += milliseconds;
        compiled[key] = *words;
        return *std::move(words);
    }
};

ShaderCompiler::ShaderCompiler(ShaderCompilerDesc desc) : state_(std::make_unique<State>()) {
    if (const char* folder = std::getenv("NACRE_SHADER_DIR"); folder && *folder && desc.source_folder.empty())
        desc.source_folder = folder;
    state_->desc = std::move(desc);
    for (const auto& files : state_->desc.embedded)
        for (const EmbeddedFile& file : files) state_->embedded.emplace(file.path, file.text);
}

ShaderCompiler::~ShaderCompiler() = default;

Expected<ShaderDesc> ShaderCompiler::compile(const ShaderSource& source) {
    NACRE_TRY(Collection collection, state_->collect(source));
    {
        std::lock_guard lock(state_->mutex);
        state_->sources[identity_of(source)] = {collection.order, collection.looked_at};
    }
    if (collection.order.empty())
        return fail(ErrorCode::not_found, std::string(compile_action), fmt::format("'{}'", source.path),
                    state_->desc.source_folder.empty()
                        ? std::string("there is no embedded file of that path")
                        : fmt::format("there is no such file below '{}', and none is embedded",
                                      state_->desc.source_folder.string()),
                    "Correct the path, or add the file to the embedded files of its part.");
    NACRE_TRY(std::vector<std::uint32_t> words, state_->compile(collection.input));
    return ShaderDesc{.spirv = std::move(words), .stage = collection.input.stage, .entry_point = "main",
                      .name = collection.input.path};
}

bool ShaderCompiler::is_outdated(const ShaderSource& source) const {
    std::map<fs::path, FileStamp> looked_at;
    {
        std::lock_guard lock(state_->mutex);
        const auto found = state_->sources.find(identity_of(source));
        if (found == state_->sources.end()) return false;
        looked_at = found->second.looked_at;
    }
    return std::ranges::any_of(looked_at, [](const auto& entry) { return !entry.second.is_still_true(entry.first); });
}

std::vector<std::string> ShaderCompiler::dependencies(const ShaderSource& source) const {
    std::lock_guard lock(state_->mutex);
    const auto found = state_->sources.find(identity_of(source));
    return found == state_->sources.end() ? std::vector<std::string>() : found->second.dependencies;
}

ShaderCompiler::Statistics ShaderCompiler::statistics() const {
    std::lock_guard lock(state_->mutex);
    return state_->statistics;
}

}  // namespace nacre::rhi
