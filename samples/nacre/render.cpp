// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/image.h"
#include "core/log.h"
#include "core/progress.h"
#include "measure/cross_backend.h"
#include "measure/frame_times.h"
#include "measure/image_metrics.h"
#include "measure/texture_comparison.h"
#include "samples/nacre/backends.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/output.h"
#include "samples/nacre/session.h"
#include "samples/nacre/text_table.h"
#include "samples/nacre/watch.h"

namespace nacre::command {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const RenderSession& session, const RenderArguments& arguments, const measure::FrameTimes& times,
             double median_luminance, const std::vector<std::string>& warnings) {
    Json passes = Json::array();
    for (const passes::PassTime& pass : times.passes) passes.push_back({{"name", pass.name}, {"ms", pass.ms}});
    return {{"backend", session.backend},
            {"device", session.device->adapter().name},
            {"profile", arguments.scene.profile},
            {"size", {arguments.scene.width, arguments.scene.height}},
            {"frame_ms", {{"median", times.median_ms}, {"min", times.min_ms}, {"max", times.max_ms}}},
            {"passes", std::move(passes)},
            {"memory_bytes", times.memory_bytes},
            {"median_luminance", median_luminance},
            {"warnings", warnings}};
}

// The picture as the unnamed layer and every texture of its size as a layer of its own.
Expected<LayeredImage> layers_of(passes::Renderer& renderer, const Image& radiance, const std::string& only) {
    LayeredImage layered = make_layered_image(radiance);
    for (const passes::IntermediateDescription& description : renderer.intermediates()) {
        if (!only.empty() && description.name != only) continue;
        const bool fits = description.width == radiance.width && description.height == radiance.height;
        if (!description.is_readable || !fits) continue;
        for (std::uint32_t layer = 0; layer < description.layers; ++layer) {
            NACRE_TRY(auto content, renderer.read_intermediate(description.name, layer));
            NACRE_TRY(ImageLayer image_layer,
                      measure::exr_layer_of(measure::texture_data_of(std::move(content))));
            if (description.layers > 1) image_layer.name += fmt::format(".{}", layer);
            layered.layers.push_back(std::move(image_layer));
        }
    }
    return layered;
}

// "out/car.png" and "depth" give "out/car.depth.png".
Expected<std::filesystem::path> write_dump(passes::Renderer& renderer, const std::string& name,
                                           const std::filesystem::path& output) {
    const bool is_exr = output.extension() == ".exr";
    std::filesystem::path path = output;
    path.replace_extension(file_name_of(name) + (is_exr ? ".exr" : ".png"));
    NACRE_TRY(auto first, renderer.read_intermediate(name));
    if (!is_exr) {
        NACRE_TRY(const Image picture, measure::picture_of(measure::texture_data_of(std::move(first))));
        NACRE_CHECK(write_png(path, picture));
        return path;
    }
    LayeredImage layered{first.width, first.height, {}};
    const std::uint32_t layers = first.description.layers;
    for (std::uint32_t layer = 0; layer < layers; ++layer) {
        NACRE_TRY(auto content, renderer.read_intermediate(name, layer));
        NACRE_TRY(ImageLayer image_layer, measure::exr_layer_of(measure::texture_data_of(std::move(content))));
        if (layers > 1) image_layer.name += fmt::format(".{}", layer);
        layered.layers.push_back(std::move(image_layer));
    }
    NACRE_CHECK(write_exr(path, layered));
    return path;
}

// Renders, writes every file that was asked for, and says so.
Expected<void> render_and_write(const SceneSession& scene, const RenderSession& session,
                                const RenderArguments& arguments) {
    const bool is_exr = arguments.output.ends_with(".exr");
    passes::Renderer& renderer = *session.renderer;
    measure::FrameTimes times;
    {
        Progress progress(fmt::format("rendering on {}", session.backend));
        NACRE_TRY(times, measure::time_frames(renderer, arguments.scene.frames));
    }
    NACRE_TRY(const passes::FinalPicture picture, renderer.read_final());

    std::vector<std::string> warnings = scene.warnings();
    warnings.insert(warnings.end(), renderer.warnings().begin(), renderer.warnings().end());
    if (const measure::ValueScan scan = measure::scan_values(picture.radiance); !scan.clean()) {
        warnings.push_back(fmt::format("the radiance holds {} NaN, {} infinite and {} negative values", scan.nan,
                                       scan.infinite, scan.negative));
        log_message(LogLevel::warning, warnings.back());
    }
    if (is_exr) {
        NACRE_TRY(const LayeredImage layered, layers_of(renderer, picture.radiance, arguments.scene.dump));
        NACRE_CHECK(write_exr(arguments.output, layered));
    } else {
        NACRE_CHECK(write_png(arguments.output, picture.tone_mapped));
    }
    std::string text = fmt::format("{}: {} x {} in {:.2f} ms on {} ({}), profile {}, {}\n", arguments.output,
                                   arguments.scene.width, arguments.scene.height, times.median_ms, session.backend,
                                   session.device->adapter().name, arguments.scene.profile,
                                   bytes_text(times.memory_bytes));
    if (!arguments.scene.dump.empty()) {
        NACRE_TRY(const auto path, write_dump(renderer, arguments.scene.dump, arguments.output));
        text += fmt::format("{}: texture {}\n", path.string(), arguments.scene.dump);
    }
    NACRE_CHECK(write_graph(renderer, arguments.scene.dump_graph));
    print_result(arguments.scene.json, text);
    const double luminance = measure::median_luminance(picture.exposed);
    return write_json(
        arguments.scene.json,
        json_of(session, arguments, times, luminance, warnings).dump(2, ' ', false, Json::error_handler_t::replace) +
            "\n");
}

}  // namespace

Outcome run(const RenderArguments& arguments) {
    const bool is_exr = arguments.output.ends_with(".exr");
    NACRE_TRY(const SceneSession scene, SceneSession::open(arguments.scene));
    const auto instance = make_instance();
    NACRE_TRY(const RenderSession session,
              scene.start(*instance, arguments.scene.backends.front(), is_exr && arguments.scene.dump.empty()));
    const auto render = [&] { return render_and_write(scene, session, arguments); };
    NACRE_CHECK(render());
    NACRE_CHECK(check_messages(session));
    if (!arguments.scene.watch.empty()) {
        NACRE_CHECK(watch_shaders(*session.renderer, arguments.scene.watch, render));
    }
    return ExitCode::success;
}

}  // namespace nacre::command
