// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>

#include "materials/builtin_materials.h"
#include "passes/profiles.h"
#include "rhi/capabilities.h"
#include "samples/nacre/backends.h"
#include "samples/nacre/outcome.h"
#include "scene/builtin.h"

#ifndef NACRE_VERSION
#define NACRE_VERSION "unknown"
#endif

namespace nacre::command {
namespace {

constexpr const char* main_footer = R"(
Examples:
  nacre demo                                        render the built-in scene everywhere, write out/demo/index.html
  nacre devices                                     what can be rendered on, and why the rest cannot
  nacre render builtin:spheres -o spheres.png       a picture
  nacre compare car.gltf --backends vulkan,gl       do two backends agree?
  nacre COMMAND --help                              everything about one command

Exit codes:  0 done   1 failed   2 wrong command line   3 a comparison is over the tolerance
Environment: NACRE_CACHE_DIR (folder of the cache, or "off"), NACRE_LOG (trace ... error, off), NACRE_PROGRESS
)";

constexpr const char* devices_footer = R"(
Examples:
  nacre devices
  nacre devices --capabilities                      every feature, limit and format of every device
  nacre devices --json - | jq .devices[].name
)";

constexpr const char* render_footer = R"(
A scene is a glTF 2.0 file (.gltf, .glb) or a built-in one (see below). Without a camera in the file one is placed so that
everything is seen; without lights there is a photo studio.

FILE ends in .png (tone mapped, 8-bit sRGB) or .exr (linear radiance in cd/m2, 32-bit float, with the textures that the
passes hand on as layers).

Examples:
  nacre render builtin:spheres -o spheres.png --backend gl --size 1920x1080
  nacre render car.gltf -o car.exr --env studio.hdr --camera Front
  nacre render car.gltf -o car.png --exposure -1.5 --frames 20 --json times.json
  nacre render car.gltf -o car.png --dump depth     also writes car.depth.png (car.depth.exr beside an .exr)
  nacre render car.gltf -o car.png --watch ~/nacre  edit the shaders below ~/nacre/passes and look at car.png
)";

constexpr const char* compare_footer = R"(
The first backend is the reference. Every texture of every pass is compared texel by texel: how many are not bit-equal, how
many hold a value that is off by more than one quantization step, the largest absolute and relative difference; then
the final picture: PSNR (200 dB: equal), mean FLIP, the share of pixels off by more than 1/255. With -o FOLDER the pictures,
their differences and a page index.html are written.

Tolerance, as JSON; what is left out keeps these defaults, and shares are of texels or pixels:
  {"fields_differing": 0.0005, "final": {"psnr_db": 50, "flip_mean": 0.005, "share_above_1": 0.001}}
"final" may also bound "max_abs_8bit"; {"textures": {"NAME": {...}}} bounds "fields_differing", "differing", "max_abs" and
"max_rel" of one texture.

Examples:
  nacre compare builtin:spheres --backends vulkan,gl,gles
  nacre compare car.gltf --backends vulkan,gl -o out/car --json out/car.json
  nacre compare car.gltf --backends vulkan,vulkan   is one backend the same twice?
)";

constexpr const char* diff_footer = R"(
Reads PNG, JPEG, Radiance HDR and OpenEXR. Of OpenEXR files every layer that both have is compared as well.

Examples:
  nacre diff before.png after.png
  nacre diff before.exr after.exr -o out/diff       also writes the difference, the FLIP map and index.html
  nacre diff a.png b.png --tolerance strict.json    exit code 3 where the difference is larger (format: nacre compare --help)
)";

constexpr const char* explain_footer = R"(
Examples:
  nacre explain builtin:spheres --profile mobile
  nacre explain car.gltf --dump-graph graph.svg
)";

constexpr const char* material_footer = R"(
A material is a built-in one, a JSON file of docs/materials.md, or SCENE#NAME for one of a scene. The report tells what it takes in the G-buffer before and
after simplification to the budget; the picture shows its tree, a lit ball for each step, and the lobes of its closures.

Examples:
  nacre material --list
  nacre material coated-carbon -o coated-carbon.png
  nacre material my.json --profile mobile
  nacre material --schema > material.schema.json    for editors: "$schema": "material.schema.json" in a file of yours
  nacre material car.gltf#paint -o paint.png
  nacre material complex-opal --budget 48 --json -
  nacre material dusty-car-paint --reference -o dusty.png    closures against brute force, with a ball of each
  nacre material gold --eval 0,0,1,0.6,0,0.8     what one closure after the other reflects: view x,y,z, light x,y,z
)";

constexpr const char* stability_footer = R"(
Every closure, lobe and tree of the materials at points with the edges over-represented, in single precision against
double precision (the backend cpu computes that); energy under white light, reciprocity, and a chi-square test of every
sampler. The first backend takes all points, each of the others a tenth. With 100000000 points it takes up to half an hour
on two cores; with -o FOLDER report.json and a page index.html are written. Exit code 3: a closure breaks a promise.

Examples:
  nacre stability -o out/stability
  nacre stability --points 1000000 --backends cpu
  nacre stability --points 1000000 --only medium --json - | jq '.closures[] | {name, max_rel_error, at}'
)";

constexpr const char* demo_footer = R"(
Examples:
  nacre demo
  nacre demo --size 640x360 -o /tmp/demo
  nacre demo car.gltf --profile low
)";

constexpr const char* cache_footer = R"(
Examples:
  nacre cache             where it is and how much it holds
  nacre cache purge       empty it; everything is made again when it is needed
)";

constexpr const char* completion_footer = R"(
Examples:
  source <(nacre completion)                                                       for this shell
  nacre completion > ~/.local/share/bash-completion/completions/nacre              for good
)";

std::string scene_names() {
    std::string text = "\nBuilt-in scenes:\n";
    for (const std::string_view name : scene::builtin_scene_names()) {
        text += fmt::format("  {:<20} {}\n", name, scene::builtin_scene_description(name));
    }
    return text;
}

std::string join(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, ", ")); }

std::vector<std::string> profile_names() {
    std::vector<std::string> names;
    for (const passes::Profile& profile : passes::profiles()) names.push_back(profile.name);
    return names;
}

// A finite number in a range; CLI11's own range lets NaN through.
CLI::Validator finite_number(double smallest, double largest, const std::string& unit) {
    return {[=](std::string& text) -> std::string {
                double value = 0;
                const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
                if (error == std::errc{} && end == text.data() + text.size() && value >= smallest && value <= largest) {
                    return {};
                }
                return fmt::format("'{}' is not a number from {} to {}{}", text, smallest, largest, unit);
            },
            "", ""};
}

CLI::Validator one_of(std::vector<std::string> names) {
    return {[names = std::move(names)](std::string& text) -> std::string {
                if (std::ranges::find(names, text) != names.end()) return {};
                return fmt::format("'{}' is not one of: {}", text, join(names));
            },
            "", ""};
}

CLI::Validator file_ending(std::vector<std::string> endings) {
    return {[endings = std::move(endings)](std::string& text) -> std::string {
                for (const std::string& ending : endings) {
                    if (text.size() > ending.size() && text.ends_with(ending)) return {};
                }
                return fmt::format("'{}' does not end in {}", text, fmt::join(endings, " or "));
            },
            "", ""};
}

// "vulkan,gl" to its members.
std::vector<std::string> split_backends(const std::string& list, std::size_t fewest) {
    std::vector<std::string> backends;
    for (std::size_t start = 0; start <= list.size();) {
        const std::size_t end = std::min(list.find(',', start), list.size());
        backends.push_back(list.substr(start, end - start));
        start = end + 1;
    }
    if (backends.size() < fewest || std::ranges::any_of(backends, &std::string::empty)) {
        throw CLI::ValidationError(
            "--backends", fmt::format("'{}' is not a list of {} or more backends, as in vulkan,gl", list,
                                      fewest == 1 ? "one" : "two"));
    }
    return backends;
}

// A whole number in a range; says what was expected, and keeps the help text short.
CLI::Validator whole_number(std::uint64_t smallest, std::uint64_t largest) {
    return {[=](std::string& text) -> std::string {
                std::uint64_t value = 0;
                const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
                if (error == std::errc{} && end == text.data() + text.size() && value >= smallest && value <= largest) {
                    return {};
                }
                return fmt::format("'{}' is not a whole number from {} to {}", text, smallest, largest);
            },
            "", ""};
}

void add_json(CLI::App& app, std::string& json) {
    app.add_option("--json", json, "Write the results as JSON to FILE; \"-\": standard output, instead of the text")
        ->type_name("FILE");
}

void add_scene(CLI::App& app, SceneArguments& arguments, bool is_required = true) {
    app.add_option("SCENE", arguments.scene, "A .gltf or .glb file, or builtin:NAME")
        ->type_name("")
        ->required(is_required);
}

void add_backend(CLI::App& app, SceneArguments& arguments) {
    app.add_option_function<std::string>(
           "-b,--backend", [&](const std::string& text) { arguments.backends = {text}; },
           fmt::format(
               "Where to render: NAME[:MODE][:CHECK][:lanes=N][:threads=N], NAME being auto (the first that works: "
               "cpu) or one of {}; checks of cpu are traps, sanitize and hostile[=N]",
               join(backend_names())))
        ->type_name("BACKEND")
        ->group("Device");
}

void add_device(CLI::App& app, SceneArguments& arguments) {
    app.add_option("-d,--device", arguments.device, "Which device of the backend, by number (see `nacre devices`)")
        ->type_name("N")
        ->check(whole_number(0, 1023))
        ->group("Device");
    app.add_option("-p,--profile", arguments.profile,
                   fmt::format("Budget for the picture: {}; default high", join(profile_names())))
        ->type_name("PROFILE")
        ->check(one_of(profile_names()))
        ->group("Device");
    app.add_option(
           "--restrict", arguments.restriction,
           fmt::format("Hold the device to smaller capabilities: {}; default gles31-minimum for profile mobile, "
                       "else none",
                       join(rhi::restriction_names())))
        ->type_name("NAME")
        ->check(one_of(rhi::restriction_names()))
        ->group("Device");
    app.add_flag("--driver-validation", arguments.driver_validation,
                 "Let the driver check what it is told (Khronos validation layer, GL debug output); slow")
        ->group("Device");
}

void add_picture(CLI::App& app, SceneArguments& arguments) {
    app.add_option_function<std::string>(
           "-s,--size",
           [&](const std::string& text) {
               if (parse_size(text, arguments.width, arguments.height)) return;
               throw CLI::ValidationError(
                   "--size", fmt::format("'{}' is not a size; write WIDTHxHEIGHT, each from 1 to 16384", text));
           },
           "Pixels, as in 1920x1080; default 1280x720")
        ->type_name("WxH")
        ->group("Picture");
    app.add_option("-c,--camera", arguments.camera, "Camera by name or number; default: the first")
        ->type_name("NAME")
        ->group("Picture");
    app.add_option("-e,--env", arguments.environment,
                   "Light from this environment map (.hdr, .exr) instead of the scene's")
        ->type_name("FILE")
        ->group("Picture");
    app.add_option("--exposure", arguments.exposure_ev, "Stops: light is multiplied by 2^EV; default: metered")
        ->type_name("EV")
        ->check(finite_number(-64, 64, " stops"))
        ->group("Picture");
    app.add_option("--tone-mapping", arguments.tone_mapping, "filmic (default) or linear")
        ->type_name("NAME")
        ->check(one_of({"filmic", "linear"}))
        ->group("Picture");
    app.add_option("-t,--time", arguments.time, "Seconds into the animation; without it, the scene is at rest")
        ->type_name("S")
        ->check(finite_number(-1e6, 1e6, " seconds"))
        ->group("Picture");
}

void add_output_options(CLI::App& app, SceneArguments& arguments, const std::string& dump_meaning) {
    app.add_option("-n,--frames", arguments.frames,
                   "Frames to time; with more than 1 a first one is rendered that is not counted")
        ->type_name("N")
        ->check(whole_number(1, 100000))
        ->group("Output");
    app.add_option("--dump", arguments.dump, dump_meaning)->type_name("TEXTURE")->group("Output");
}

void add_dump_graph(CLI::App& app, SceneArguments& arguments) {
    app.add_option("--dump-graph", arguments.dump_graph, "Draw the passes and what they hand on, as .svg or .dot")
        ->type_name("FILE")
        ->check(file_ending({".svg", ".dot"}))
        ->group("Output");
}

/// All options with the places that they are stored to.
struct Definition {
    CLI::App app{"Nacre renders layered materials the same way on every backend, and tells how far they are apart.",
                 "nacre"};
    DevicesArguments devices;
    RenderArguments render;
    CompareArguments compare;
    DiffArguments diff;
    ExplainArguments explain;
    MaterialArguments material;
    StabilityArguments stability;
    DemoArguments demo;
    CacheArguments cache;
    CompletionArguments completion;

    Definition() {
        app.footer(main_footer);
        app.set_version_flag("--version", std::string("nacre " NACRE_VERSION));
        app.require_subcommand(0, 1);
        app.get_formatter()->column_width(34);

        CLI::App* command = app.add_subcommand("devices", "List the devices of all backends");
        command->footer(devices_footer);
        command->add_flag("-a,--capabilities", devices.capabilities, "Also list what each device can do");
        add_json(*command, devices.json);

        command = app.add_subcommand("render", "Render a scene to a picture");
        command->footer(render_footer + scene_names());
        add_scene(*command, render.scene);
        command->add_option("-o,--output", render.output, "The picture, .png or .exr")
            ->type_name("FILE")
            ->required()
            ->check(file_ending({".png", ".exr"}))
            ->group("Output");
        add_backend(*command, render.scene);
        add_device(*command, render.scene);
        add_picture(*command, render.scene);
        add_output_options(*command, render.scene, "Also write this texture that passes hand on, beside the picture");
        add_dump_graph(*command, render.scene);
        command
            ->add_option("--watch", render.scene.watch,
                         "Take the shaders from this source folder; render again whenever one of them changes, until "
                         "Ctrl-C")
            ->type_name("FOLDER")
            ->group("Output");
        add_json(*command, render.scene.json);

        command = app.add_subcommand("compare", "Render a scene on several backends and compare every texture");
        command->footer(compare_footer + scene_names());
        add_scene(*command, compare.scene);
        command
            ->add_option_function<std::string>(
                "-b,--backends", [this](const std::string& list) { compare.scene.backends = split_backends(list, 2); },
                fmt::format(
                    "Two or more of {}, separated by commas, each as NAME[:MODE][:CHECK][:lanes=N][:threads=N]; "
                    "the first is the reference",
                    join(backend_names())))
            ->type_name("LIST")
            ->required()
            ->group("Device");
        command->add_option("-o,--output", compare.output, "Write pictures, differences and index.html to this folder")
            ->type_name("FOLDER")
            ->group("Output");
        command->add_option("--tolerance", compare.tolerance, "Judge by this JSON file (see below)")
            ->type_name("FILE")
            ->group("Output");
        add_device(*command, compare.scene);
        add_picture(*command, compare.scene);
        add_output_options(*command, compare.scene,
                           "Compare this texture alone; with -o FOLDER its pictures are written as well");
        add_dump_graph(*command, compare.scene);
        add_json(*command, compare.scene.json);

        command = app.add_subcommand("diff", "Compare two picture files");
        command->footer(diff_footer);
        command->add_option("A", diff.a, "The reference")->type_name("")->required();
        command->add_option("B", diff.b, "The picture to judge, of the same size")->type_name("")->required();
        command->add_option("-o,--output", diff.output, "Write difference pictures and index.html to this folder")
            ->type_name("FOLDER");
        command
            ->add_option("--tolerance", diff.tolerance, "Judge by this JSON file; default: the figures are only shown")
            ->type_name("FILE");
        add_json(*command, diff.json);

        command = app.add_subcommand(
            "explain", "Show the plan for a scene: passes, shaders, resources, and what was left out");
        command->footer(explain_footer + scene_names());
        add_scene(*command, explain.scene);
        add_backend(*command, explain.scene);
        add_device(*command, explain.scene);
        add_picture(*command, explain.scene);
        add_dump_graph(*command, explain.scene);
        add_json(*command, explain.scene.json);

        command = app.add_subcommand("material", "Look into a material: closures, bytes, simplification, a picture");
        command->footer(material_footer);
        command->add_option("MATERIAL", material.material, "A built-in material, a .json file, or SCENE#NAME")
            ->type_name("");
        command->add_flag("-l,--list", material.list, "List the built-in materials");
        command->add_flag("--schema", material.schema, "Print the JSON schema of material files, for editors");
        command->add_flag("--full", material.full, "Simplify to one closure, as rays carry it");
        command
            ->add_option("-p,--profile", material.profile,
                         fmt::format("Budget: {}; default high", join(profile_names())))
            ->type_name("PROFILE")
            ->check(one_of(profile_names()));
        command->add_option("--budget", material.budget, "Bytes for each pixel instead of the profile's")
            ->type_name("BYTES")
            ->check(whole_number(4, 1024));
        command->add_flag("--reference", material.reference,
                          "Tell how far the closures are off a random walk through the stack (some seconds)");
        command
            ->add_option("--eval", material.evaluate,
                         "Print what each closure reflects: view and light, comma separated")
            ->type_name("DIRECTIONS");
        command->add_option("-o,--output", material.output, "Draw it")->type_name("FILE")->check(file_ending({".png"}));
        add_json(*command, material.json);

        command = app.add_subcommand("stability", "Measure the closures of materials in single precision");
        command->footer(stability_footer);
        command
            ->add_option_function<std::string>(
                "-b,--backends", [this](const std::string& list) { stability.backends = split_backends(list, 1); },
                "Where, separated by commas, as for compare; default: cpu, vulkan and gl where they work")
            ->type_name("LIST");
        command->add_option("-n,--points", stability.points, "Points for the first backend; default 100000000")
            ->type_name("N")
            ->check(whole_number(1000, 100'000'000'000));
        command->add_option("--only", stability.only, "Only closures whose name contains this")->type_name("NAME");
        command->add_option("-o,--output", stability.output, "Write report.json and index.html to this folder")
            ->type_name("FOLDER");
        add_json(*command, stability.json);

        command = app.add_subcommand("demo", "Render on all backends that work here and write one page about it");
        command->footer(demo_footer + scene_names());
        demo.scene.scene = "builtin:spheres";
        demo.scene.frames = 3;
        add_scene(*command, demo.scene, false);
        command->add_option("-o,--output", demo.output, "Where to write; default out/demo")
            ->type_name("FOLDER")
            ->group("Output");
        add_device(*command, demo.scene);
        add_picture(*command, demo.scene);
        command->add_option("-n,--frames", demo.scene.frames, "Frames to time, after a first one; default 3")
            ->type_name("N")
            ->check(whole_number(1, 100000))
            ->group("Output");
        add_json(*command, demo.scene.json);

        command = app.add_subcommand("cache", "Show or empty the cache of compiled shaders, pipelines and tables");
        command->footer(cache_footer);
        command->require_subcommand(0, 1);
        add_json(*command, cache.json);
        CLI::App* size = command->add_subcommand("size", "Where it is and how much it holds (the default)");
        size->fallthrough();
        CLI::App* purge = command->add_subcommand("purge", "Remove everything in it");
        purge->fallthrough();
        purge->callback([this] { cache.purge = true; });

        command = app.add_subcommand("completion", "Print a script for tab completion in bash");
        command->footer(completion_footer);
        command->add_flag("--list", completion.list, "Print what can follow WORDS instead (used by the script)")
            ->group("");
        command->add_option("WORDS", completion.words)->group("");
    }
    Definition(const Definition&) = delete;
    Definition& operator=(const Definition&) = delete;

    [[nodiscard]] Invocation invocation() const {
        const std::string name = app.get_subcommands().front()->get_name();
        if (name == "devices") return devices;
        if (name == "render") return render;
        if (name == "compare") return compare;
        if (name == "diff") return diff;
        if (name == "explain") return explain;
        if (name == "material") return material;
        if (name == "stability") return stability;
        if (name == "demo") return demo;
        if (name == "cache") return cache;
        return completion;
    }
};

std::vector<std::string> scene_candidates() {
    std::vector<std::string> names{"<file>"};
    for (const std::string_view name : scene::builtin_scene_names()) names.emplace_back(name);
    return names;
}

std::vector<std::string> value_candidates(const std::string& command, const CLI::Option& option,
                                          const std::string& typed) {
    const std::string name = option.get_name();
    const std::string type = option.get_type_name();
    if (name == "--backend" || name == "--backends") {
        std::vector<std::string> names = backend_names();
        if (name == "--backend") names.insert(names.begin(), "auto");
        // A list is completed at its last member.
        const std::string before = typed.substr(0, typed.rfind(',') + 1);
        for (std::string& candidate : names) candidate.insert(0, before);
        return names;
    }
    if (name == "--profile") return profile_names();
    if (name == "--restrict") return rhi::restriction_names();
    if (name == "--tone-mapping") return {"filmic", "linear"};
    if (name == "--size") return {"1280x720", "1920x1080", "640x360"};
    if (name == "MATERIAL") {
        std::vector<std::string> names{"<file>"};
        for (const materials::BuiltinMaterial& material : materials::builtin_materials())
            names.emplace_back(material.name);
        return names;
    }
    if (name == "SCENE" || command == "diff")
        return name == "SCENE" ? scene_candidates() : std::vector<std::string>{"<file>"};
    if (type == "FILE") return {"<file>"};
    if (type == "FOLDER") return {"<folder>"};
    return {};
}

}  // namespace

bool parse_size(std::string_view text, std::uint32_t& width, std::uint32_t& height) {
    const std::size_t cross = text.find('x');
    if (cross == std::string_view::npos) return false;
    const auto number = [](std::string_view part, std::uint32_t& value) {
        const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
        return error == std::errc{} && end == part.data() + part.size() && value >= 1 && value <= 16384;
    };
    std::uint32_t w = 0, h = 0;
    if (!number(text.substr(0, cross), w) || !number(text.substr(cross + 1), h)) return false;
    width = w;
    height = h;
    return true;
}

std::variant<Invocation, int> parse_command_line(int argc, const char* const* argv) {
    Definition definition;
    if (argc <= 1) {
        fmt::print(stderr, "{}", definition.app.help());
        return static_cast<int>(ExitCode::usage);
    }
    try {
        definition.app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        if (error.get_exit_code() == 0) return definition.app.exit(error);  // --help, --version
        std::string command = "nacre";
        if (const auto used = definition.app.get_subcommands(); !used.empty())
            command += " " + used.front()->get_name();
        fmt::print(stderr, "nacre: {}\n`{} --help` tells what can be written here.\n", error.what(), command);
        return static_cast<int>(ExitCode::usage);
    }
    if (definition.app.get_subcommands().empty()) {
        fmt::print(stderr, "nacre: a command is required\n`nacre --help` tells what can be written here.\n");
        return static_cast<int>(ExitCode::usage);
    }
    return definition.invocation();
}

std::vector<std::string> completion_candidates(const std::vector<std::string>& words) {
    Definition definition;
    const std::string typed = words.empty() ? "" : words.back();
    std::vector<std::string> candidates;
    if (words.size() <= 1) {
        for (const CLI::App* command : definition.app.get_subcommands(nullptr))
            candidates.push_back(command->get_name());
        candidates.emplace_back("--help");
        candidates.emplace_back("--version");
        return candidates;
    }
    const auto commands = definition.app.get_subcommands(nullptr);
    const auto found = std::ranges::find(commands, words.front(), [](const CLI::App* app) { return app->get_name(); });
    if (found == commands.end()) return {};
    const CLI::App* command = *found;
    const std::string& previous = words[words.size() - 2];
    if (words.size() > 2 && previous.starts_with("-")) {
        const CLI::Option* option = command->get_option_no_throw(previous);
        if (option && option->get_items_expected_max() > 0) return value_candidates(words.front(), *option, typed);
    }
    for (const CLI::App* nested : command->get_subcommands(nullptr)) candidates.push_back(nested->get_name());
    for (const CLI::Option* option : command->get_options()) {
        if (option->get_group().empty()) continue;
        if (!option->get_positional()) {
            candidates.push_back("--" + option->get_lnames().front());
        } else if (!typed.starts_with("-")) {
            for (std::string& value : value_candidates(words.front(), *option, typed)) {
                candidates.push_back(std::move(value));
            }
        }
    }
    return candidates;
}

}  // namespace nacre::command
