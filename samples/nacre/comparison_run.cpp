// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/comparison_run.h"

#include <fmt/format.h>

#include <set>

#include "core/file.h"
#include "core/image.h"
#include "core/progress.h"
#include "measure/flip.h"
#include "samples/nacre/output.h"

namespace nacre::command {

Attempt<measure::SceneComparison> run_comparison(const SceneSession& scene, const rhi::Instance& instance,
                                                 const std::vector<std::string>& backends,
                                                 const measure::ComparisonOptions& options) {
    std::vector<RenderSession> sessions;
    for (const std::string& backend : backends) {
        NACRE_TRY(RenderSession session,
                  scene.start(instance, backend, options.textures && options.only_texture.empty()));
        sessions.push_back(std::move(session));
    }
    std::vector<measure::Contestant> contestants;
    for (RenderSession& session : sessions) {
        contestants.push_back(
            {session.backend, session.device->adapter().name, *session.renderer, session.device.get()});
    }
    Progress progress(fmt::format("comparing {} on {}", scene.arguments().scene, fmt::join(backends, ", ")));
    NACRE_TRY(measure::SceneComparison comparison,
              measure::compare_backends(scene.arguments().scene, contestants, options));
    for (const RenderSession& session : sessions) NACRE_CHECK(check_messages(session));
    // Passes are the same on all backends; the graph drawn is that of the reference.
    NACRE_CHECK(write_graph(*sessions.front().renderer, scene.arguments().dump_graph));
    return comparison;
}

Expected<void> write_comparison(const std::filesystem::path& folder, const SceneArguments& arguments,
                                const measure::SceneComparison& comparison,
                                const std::vector<std::string>& violations) {
    Progress progress("writing pictures to " + folder.string());
    std::set<std::string> names;
    std::vector<std::string> file_names;
    for (const measure::BackendResult& result : comparison.backends) {
        std::string name = file_name_of(result.backend);
        for (int count = 2; !names.insert(name).second; ++count) {
            name = fmt::format("{}-{}", file_name_of(result.backend), count);
        }
        file_names.push_back(name);
        NACRE_CHECK(write_png(folder / (name + ".png"), result.picture.tone_mapped));
        for (const measure::TexturePictures& pictures : result.texture_pictures) {
            const std::string texture = name + "." + file_name_of(pictures.name);
            NACRE_CHECK(write_png(folder / (texture + ".png"), pictures.reference));
            NACRE_CHECK(write_png(folder / (texture + ".difference.png"), pictures.difference));
        }
    }
    NACRE_TRY(const auto pairs, measure::compare_pairs(comparison));
    for (const measure::PairDifference& pair : pairs) {
        const std::string name = file_names[pair.a] + "-" + file_names[pair.b];
        NACRE_TRY(const Image difference,
                  measure::difference_image(
                      linear_from_srgb_bytes(comparison.backends[pair.a].picture.tone_mapped),
                      linear_from_srgb_bytes(comparison.backends[pair.b].picture.tone_mapped), 32.0f));
        NACRE_CHECK(write_png(folder / (name + ".difference.png"), difference));
        NACRE_CHECK(write_png(folder / (name + ".flip.png"), measure::colored_flip_map(pair.difference.flip_map)));
    }
    std::vector<std::string> facts = {fmt::format("{} x {}", arguments.width, arguments.height),
                                      "profile " + arguments.profile};
    if (!arguments.camera.empty()) facts.push_back("camera " + arguments.camera);
    if (!arguments.environment.empty()) facts.push_back(arguments.environment);
    if (arguments.time) facts.push_back(fmt::format("{} s", *arguments.time));
    NACRE_TRY(const auto page, measure::comparison_page(comparison, pairs, std::move(facts), violations));
    return measure::write_report_page(folder / "index.html", page);
}

Attempt<measure::Tolerance> read_tolerance(const std::string& path) {
    if (path.empty()) return measure::Tolerance{};
    auto text = read_text_file(path);
    if (!text) return wrong_usage(text.error());
    auto tolerance = measure::parse_tolerance(*text, path);
    if (!tolerance) return wrong_usage(tolerance.error());
    return *std::move(tolerance);
}

}  // namespace nacre::command
