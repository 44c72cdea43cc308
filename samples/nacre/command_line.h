// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

/// @file
/// The command line as plain data: every subcommand gets its options checked for form (numbers in range, sizes, lists);
/// whether names exist is decided where they are used. Only command_line.cpp knows the parser.

namespace nacre::command {

/// What `render`, `compare`, `explain` and `demo` have in common.
struct SceneArguments {
    std::string scene;
    std::vector<std::string> backends{"auto"};  ///< One for `render` and `explain`.
    std::uint32_t device = 0;
    std::string profile = "high";
    std::string restriction;                    ///< Empty: what the profile asks for.
    std::uint32_t width = 1280;                 ///< Pixels.
    std::uint32_t height = 720;
    std::string camera;                         ///< Empty: the first.
    std::string environment;                    ///< Path; empty: that of the scene.
    std::optional<float> exposure_ev;           ///< Stops; empty: metered.
    std::string tone_mapping = "filmic";
    std::uint32_t frames = 1;
    std::optional<float> time;                  ///< Seconds into the animation; empty: the pose at rest.
    std::string dump;                           ///< An intermediate texture; empty: none.
    std::string dump_graph;                     ///< Path of a .svg or .dot; empty: none.
    std::string watch;                          ///< Root of a source tree whose shaders are followed; empty: none.
    bool driver_validation = false;
    std::string json;                           ///< Path, "-" for standard output; empty: none.
};

struct DevicesArguments {
    bool capabilities = false;
    std::string json;
};

struct RenderArguments {
    SceneArguments scene;
    std::string output;
};

struct CompareArguments {
    SceneArguments scene;
    std::string output;     ///< Folder; empty: no files.
    std::string tolerance;  ///< Path; empty: the default.
};

struct DiffArguments {
    std::string a, b;
    std::string output;     ///< Folder; empty: no files.
    std::string tolerance;  ///< Path; empty: figures are not judged.
    std::string json;
};

struct ExplainArguments {
    SceneArguments scene;
};

struct MaterialArguments {
    std::string material;             ///< A built-in name or a file; empty with `list`.
    bool list = false;
    bool schema = false;              ///< Print the JSON schema of material files and do nothing else.
    bool full = false;                ///< Simplify to one closure, whatever the budget.
    std::string profile = "high";
    std::optional<std::uint32_t> budget;  ///< Bytes; empty: that of the profile.
    bool reference = false;               ///< Compare with a random walk through the stack.
    std::string evaluate;             ///< "VX,VY,VZ,LX,LY,LZ"; empty: no value is asked for.
    std::string output;               ///< PNG; empty: none.
    std::string json;
};

struct StabilityArguments {
    std::vector<std::string> backends;     ///< Empty: those of cpu, vulkan and gl that work.
    std::uint64_t points = 100'000'000;
    std::string only;                      ///< Part of closures' names; empty: all.
    std::string output;                    ///< Folder; empty: no files.
    std::string json;
};

struct DemoArguments {
    SceneArguments scene;
    std::string output = "out/demo";
};

struct CacheArguments {
    bool purge = false;
    std::string json;
};

struct CompletionArguments {
    bool list = false;               ///< Print candidates instead of the script.
    std::vector<std::string> words;  ///< The words typed after "nacre"; the last one is being typed.
};

using Invocation =
    std::variant<DevicesArguments, RenderArguments, CompareArguments, DiffArguments, ExplainArguments,
                 MaterialArguments, StabilityArguments, DemoArguments, CacheArguments, CompletionArguments>;

/// An invocation, or the exit code where everything is said already (help, version, wrong usage).
std::variant<Invocation, int> parse_command_line(int argc, const char* const* argv);

/// What can follow the words typed so far: subcommands, options, or values of an option ("<file>" and "<folder>" stand
/// for paths).
std::vector<std::string> completion_candidates(const std::vector<std::string>& words);

/// Reads "1280x720". Returns false where it is not of that form or outside [1, 16384].
bool parse_size(std::string_view text, std::uint32_t& width, std::uint32_t& height);

}  // namespace nacre::command
