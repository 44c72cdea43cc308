// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/image.h"
#include "materials/builtin_materials.h"
#include "materials/description_tree.h"
#include "materials/evaluation.h"
#include "materials/layering_error.h"
#include "materials/preview.h"
#include "materials/simplification.h"
#include "materials/storage.h"
#include "materials/tree_json.h"
#include "materials/tree_shader.h"
#include "measure/flip.h"
#include "passes/profiles.h"
#include "rhi/shader_compiler.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/material_sheet.h"
#include "samples/nacre/output.h"
#include "samples/nacre/text_table.h"
#include "scene/load.h"

namespace nacre::command {
namespace {

using Json = nlohmann::ordered_json;
using namespace materials;

constexpr std::uint32_t ball_size = 128;

// "SCENE#NAME": a material of a scene.
Expected<Tree> material_of_scene(const std::string& scene_name, const std::string& name) {
    NACRE_TRY(const scene::Scene scene, scene::load_scene(scene_name));
    std::vector<std::string> names;
    for (const MaterialDescription& material : scene.materials) {
        if (material.name == name) return tree_of(material);
        names.push_back(material.name);
    }
    return fail(ErrorCode::not_found, "find material", fmt::format("'{}'", name),
                fmt::format("scene '{}' has none of this name", scene_name),
                fmt::format("Use one of: {}.", fmt::join(names, ", ")));
}

Expected<Tree> find_material(const std::string& name) {
    if (const std::size_t mark = name.rfind('#'); mark != std::string::npos)
        return material_of_scene(name.substr(0, mark), name.substr(mark + 1));
    if (!name.ends_with(".json")) {
        auto builtin = make_builtin_material(name);
        if (!builtin) builtin.error().remedy += " A file's name ends in .json; a scene's material is SCENE#NAME.";
        return builtin;
    }
    NACRE_TRY(MaterialFile file, load_material(name));
    return std::move(file.tree);
}

std::string features_text(std::uint32_t features) {
    std::vector<std::string_view> names;
    for (const SlabFeature& feature : slab_features()) {
        if ((features & feature.bit) != 0) names.emplace_back(feature.name);
    }
    return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

// Six numbers with commas between them.
Expected<std::array<glm::dvec3, 2>> parse_directions(const std::string& text) {
    std::array<glm::dvec3, 2> result;
    const char* at = text.data();
    const char* end = text.data() + text.size();
    for (int i = 0; i < 6; ++i) {
        double value = 0.0;
        const auto [next, error] = std::from_chars(at, end, value);
        const bool is_last = i == 5;
        if (error != std::errc{} || !std::isfinite(value) || (is_last ? next != end : next == end || *next != ',')) {
            return fail(ErrorCode::invalid_argument, "read directions", fmt::format("'{}'", text),
                        "they are not six numbers", "Write view and light as x,y,z,x,y,z; z is the normal.");
        }
        result[static_cast<std::size_t>(i / 3)][i % 3] = value;
        at = next + (is_last ? 0 : 1);
    }
    for (glm::dvec3& direction : result) {
        const double length =
            std::sqrt(direction.x * direction.x + direction.y * direction.y + direction.z * direction.z);
        if (length == 0.0) {
            return fail(ErrorCode::invalid_argument, "read directions", fmt::format("'{}'", text),
                        "one of them has no length", "Write view and light as x,y,z,x,y,z; z is the normal.");
        }
        direction /= length;
    }
    if (result[0].z <= 0.0) {
        return fail(ErrorCode::invalid_argument, "read directions", fmt::format("'{}'", text),
                    "the view is below the surface", "Its third number must be above 0.");
    }
    return result;
}

Expected<std::string> evaluation_text(const FlattenedTree& flat, const std::string& directions) {
    NACRE_TRY(const auto parsed, parse_directions(directions));
    const ShadedTree shaded = shade(flat, parsed[0]);
    closures::Library library;
    TextTable table({"closure", "specular", "diffuse", "pdf", "weight", "transmittance"});
    const auto color = [](const glm::dvec3& c) { return fmt::format("{:.6g} {:.6g} {:.6g}", c.x, c.y, c.z); };
    for (const ShadedClosure& c : shaded.closures) {
        const auto value = library.evaluate_closure(c.closure, parsed[1]);
        const Node& node = flat.visible_tree.nodes[c.node];
        table.add({node.name.empty() ? fmt::format("node {}", c.node) : node.name, color(value.specular),
                   color(value.diffuse + value.subsurface),
                   fmt::format("{:.6g}", library.closure_pdf(c.closure, parsed[1])), color(c.path.weight * c.coverage),
                   color(library.top_transmittance(c.path, std::max(parsed[1].z, 0.0)))});
    }
    return table.text() +
           fmt::format("sum: {}\n", color(parsed[1].z > 0.0 ? reflected(shaded, parsed[1]) : glm::dvec3(0.0)));
}

struct ShaderFigures {
    std::size_t bytes = 0;
    double compile_ms = 0.0;
};

// The material as a compute shader, as far as SPIR-V.
Expected<ShaderFigures> shader_figures(const FlattenedTree& flat) {
    rhi::ShaderCompiler compiler({.embedded = {embedded_files()}, .debug_information = false});
    const TreeShader shader = tree_shader(flat);
    const std::string text = fmt::format(R"({}
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer Parameters {{ float parameters[]; }};
layout(set = 0, binding = 1) buffer Results {{ vec4 results[]; }};
layout(set = 0, binding = 2) readonly buffer InterfaceTable {{ uint interface_words[]; }};
layout(set = 0, binding = 3) readonly buffer MediumTable {{ uint medium_words[]; }};
layout(set = 0, binding = 4) readonly buffer AnisotropyTable {{ uint anisotropy_words[]; }};
#include "materials/closures/table_buffers.glsl"
float tree_parameter(uint index) {{ return parameters[index]; }}
vec4 tree_texture(uint index) {{ return vec4(1.0); }}
vec3 specular_lut(uint index, vec2 at) {{ return vec3(1.0); }}
{}
void main() {{
    vec3 views[tree_frame_count];
    vec3 lights[tree_frame_count];
    for (uint i = 0u; i < tree_frame_count; ++i) {{
        views[i] = results[0].xyz;
        lights[i] = results[1].xyz;
    }}
    TreeState state = shade_tree(views, results[0].w);
    results[gl_GlobalInvocationID.x] = vec4(tree_reflected(state, views, lights, results[0].w), state.whole.coverage);
}})",
                                         shader.defines, shader.glsl);
    const auto start = std::chrono::steady_clock::now();
    NACRE_TRY(const rhi::ShaderDesc compiled, compiler.compile({.path = "material.comp", .text = text}));
    return ShaderFigures{
        .bytes = 4 * compiled.spirv.size(),
        .compile_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count()};
}

// The closures against brute force, as text, for JSON, and drawn.
struct ReferenceReport {
    std::string text;
    Json json;
    MaterialSheetStep drawn;
};

Expected<ReferenceReport> reference_report(const FlattenedTree& flat) {
    constexpr std::uint32_t paths = 65536, ball_paths = 4096;
    const RandomWalk walk(flat);
    const LayeringError error = layering_error(flat, walk, paths);
    Image ball = walked_ball(walk, ball_size, ball_paths);
    NACRE_TRY(const measure::FlipResult flip, measure::compute_flip(ball, preview_ball(flat, ball_size, 16)));
    ReferenceReport report;
    TextTable table({"cosine of view", "closures", "random walk", "+-"});
    Json rows = Json::array();
    for (std::size_t i = 0; i < LayeringError::cosines.size(); ++i) {
        const auto color = [](const glm::dvec3& c) { return fmt::format("{:.4f} {:.4f} {:.4f}", c.x, c.y, c.z); };
        const auto numbers = [](const glm::dvec3& c) { return Json::array({c.x, c.y, c.z}); };
        const WalkAlbedo& seen = error.walk[i];
        table.add({fmt::format("{:.1f}", LayeringError::cosines[i]), color(error.closures[i]), color(seen.reflected),
                   color(seen.uncertainty)});
        rows.push_back({{"cosine", LayeringError::cosines[i]},
                        {"closures", numbers(error.closures[i])},
                        {"walk", numbers(seen.reflected)},
                        {"uncertainty", numbers(seen.uncertainty)}});
    }
    report.text = fmt::format(
        "\nreference (random walk, {} paths for each view, 95 % confidence): albedo error {:.4f}, largest {:.4f}, FLIP "
        "{:.4f}\n{}",
        paths, error.mean, error.largest, flip.mean, table.text());
    report.json = {{"paths", paths},
                   {"albedo_error", error.mean},
                   {"largest_albedo_error", error.largest},
                   {"image_error", flip.mean},
                   {"albedos", rows}};
    report.drawn = {.captions = {"random walk", fmt::format("albedo error {:.4f}", error.mean),
                                 fmt::format("FLIP {:.4f}", flip.mean)},
                    .ball = std::move(ball)};
    return report;
}

Outcome list_materials(const std::string& json) {
    TextTable table({"material", "bytes", "closures", "what it is"});
    Json rows = Json::array();
    for (const BuiltinMaterial& material : builtin_materials()) {
        NACRE_TRY(const Tree tree, make_builtin_material(material.name));
        NACRE_TRY(const FlattenedTree flat, flatten(tree));
        const std::uint32_t bytes = storage_layout(flat).total_bytes();
        table.add({std::string(material.name), fmt::format("{}", bytes),
                   fmt::format("{}", flat.topology.closures.size()), std::string(material.meaning)});
        rows.push_back({{"name", material.name},
                        {"meaning", material.meaning},
                        {"bytes", bytes},
                        {"closures", flat.topology.closures.size()}});
    }
    print_result(json, table.text());
    NACRE_CHECK(write_json(json, Json{{"materials", rows}}.dump(2)));
    return ExitCode::success;
}

}  // namespace

Outcome run(const MaterialArguments& arguments) {
    if (arguments.list) return list_materials(arguments.json);
    if (arguments.schema) {
        print_result({}, material_schema());
        return ExitCode::success;
    }
    if (arguments.material.empty()) {
        return wrong_usage({ErrorCode::invalid_argument, "look into a material", "MATERIAL", "it is not given",
                            "Write a name of `nacre material --list`, or a .json file."});
    }
    NACRE_TRY(const Tree tree, find_material(arguments.material));
    NACRE_TRY(const FlattenedTree flat, flatten(tree));
    if (!arguments.evaluate.empty()) {
        auto text = evaluation_text(flat, arguments.evaluate);
        if (!text) return wrong_usage(text.error());
        print_result(arguments.json, *text);
        return ExitCode::success;
    }

    NACRE_TRY(const passes::Profile* profile, passes::find_profile(arguments.profile));
    const std::uint32_t budget = arguments.budget.value_or(profile->material_bytes);
    NACRE_TRY(const Simplification result,
              arguments.full ? simplify_fully(tree)
                             : simplify(tree, {.closures = profile->material_closures, .bytes = budget}));
    NACRE_TRY(const ShaderFigures shader, shader_figures(flat));
    const StorageLayout layout = storage_layout(flat);
    const SimplificationStep& last = result.steps.back();

    std::vector<MaterialSheetStep> drawn;
    TextTable steps({"step", "bytes", "closures", "albedo error", "lobe error", "image error"});
    Json step_rows = Json::array();
    for (const SimplificationStep& step : result.steps) {
        NACRE_TRY(const FlattenedTree step_flat, flatten(step.tree, step.flatten));
        Image ball = preview_ball(step_flat, ball_size);
        double image_error = 0.0;
        if (!drawn.empty()) {
            NACRE_TRY(const measure::FlipResult flip, measure::compute_flip(drawn.front().ball, ball));
            image_error = flip.mean;
        }
        steps.add({step.what, fmt::format("{}", step.bytes), fmt::format("{}", step.closures),
                   figure_text(step.albedo_error), figure_text(step.lobe_error), figure_text(image_error)});
        step_rows.push_back({{"what", step.what},
                             {"bytes", step.bytes},
                             {"closures", step.closures},
                             {"albedo_error", step.albedo_error},
                             {"lobe_error", step.lobe_error},
                             {"image_error", image_error}});
        drawn.push_back({.captions = {step.what.size() > 28 ? step.what.substr(0, 26) + ".." : step.what,
                                      fmt::format("{} bytes, {} closure{}", step.bytes, step.closures,
                                                  step.closures == 1 ? "" : "s"),
                                      fmt::format("albedo error {:.4f}", step.albedo_error),
                                      fmt::format("FLIP {:.4f}", image_error)},
                         .ball = std::move(ball)});
    }

    std::string text = fmt::format("{}: {}\n{} surface\n", tree.name.empty() ? arguments.material : tree.name,
                                   topology_text(flat.visible_tree), tree.thin ? "thin" : "thick");
    text += fmt::format("bytes: {} requested ({} words), {} after simplification, budget {}{}\n", layout.total_bytes(),
                        layout.total_bytes() / 4, last.bytes, arguments.full ? "none" : fmt::format("{}", budget),
                        result.fits ? "" : " - it does not fit");
    text += fmt::format("closures: {} before, {} after; tangent bases: {}; class: {}\n", flat.topology.closures.size(),
                        last.closures, flat.topology.frames.size(), name_of(layout.storage_class));
    text += fmt::format("shader: {} of SPIR-V, {:.0f} ms to compile\n\n", bytes_text(shader.bytes), shader.compile_ms);
    TextTable slabs({"slab", "place", "base", "features"});
    Json features = Json::array();
    for (const SlabFeature& feature : slab_features()) {
        if ((flat.topology.features & feature.bit) != 0) features.push_back(feature.name);
    }
    for (const TopologyClosure& closure : flat.topology.closures) {
        const Node& node = flat.visible_tree.nodes[closure.node];
        slabs.add({node.name.empty() ? fmt::format("node {}", closure.node) : node.name,
                   closure.is_top      ? closure.is_bottom ? "alone" : "top"
                   : closure.is_bottom ? "bottom"
                                       : "middle",
                   fmt::format("{}", closure.frame), features_text(closure.features)});
    }
    text += slabs.text() + "\n" + steps.text();
    Json reference;
    if (arguments.reference) {
        NACRE_TRY(ReferenceReport report, reference_report(flat));
        text += report.text;
        reference = std::move(report.json);
        drawn.push_back(std::move(report.drawn));
    }
    print_result(arguments.json, text);
    NACRE_CHECK(write_json(arguments.json, Json{{"name", tree.name},
                                                {"profile", arguments.profile},
                                                {"bytes_requested", layout.total_bytes()},
                                                {"bytes", last.bytes},
                                                {"closures", last.closures},
                                                {"bases", flat.topology.frames.size()},
                                                {"complexity", name_of(layout.storage_class)},
                                                {"features", features},
                                                {"shader_bytes", shader.bytes},
                                                {"shader_compile_ms", shader.compile_ms},
                                                {"fits", result.fits},
                                                {"steps", step_rows},
                                                {"reference", reference}}
                                               .dump(2)));
    if (!arguments.output.empty()) {
        const std::string title = fmt::format("{}  {} bytes, {}  profile {}", tree.name, layout.total_bytes(),
                                              name_of(layout.storage_class), arguments.profile);
        NACRE_CHECK(write_png(arguments.output, material_sheet(title, flat, drawn)));
    }
    return ExitCode::success;
}

}  // namespace nacre::command
