// SPDX-License-Identifier: Apache-2.0
#include "samples/nacre/session.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/file.h"
#include "core/log.h"
#include "core/progress.h"
#include "passes/profiles.h"
#include "scene/environment.h"
#include "scene/load.h"

namespace nacre::command {
namespace {

std::string camera_names(const scene::Scene& scene) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
        const std::string& name = scene.cameras[i].name;
        names.push_back(name.empty() ? fmt::format("{}", i) : fmt::format("'{}' ({})", name, i));
    }
    return fmt::format("{}", fmt::join(names, ", "));
}

// The camera that loading makes for files without one is framed for 16:9; other pictures get one that fits them.
void fit_made_camera(scene::Scene& scene, float aspect_ratio) {
    if (scene.cameras.size() != 1) return;
    const scene::Bounds bounds = scene::world_bounds(scene);
    const scene::Camera made = scene::framing_camera(bounds);
    scene::Camera& camera = scene.cameras.front();
    if (camera.name == made.name && camera.world == made.world) camera = scene::framing_camera(bounds, aspect_ratio);
}

// The backend that a spec ends up on: "auto" is resolved, options stay.
std::string resolved_name(const std::string& spec, const rhi::Device& device) {
    return spec.starts_with("auto") ? device.adapter().backend + spec.substr(4) : spec;
}

}  // namespace

Attempt<SceneSession> SceneSession::open(const SceneArguments& arguments) {
    SceneSession session;
    session.arguments_ = arguments;
    if (auto profile = passes::find_profile(arguments.profile); !profile) return wrong_usage(profile.error());
    if (session.arguments_.restriction.empty()) {
        // This profile promises to need no more than OpenGL ES 3.1 guarantees, so it is not given more.
        session.arguments_.restriction = arguments.profile == "mobile" ? "gles31-minimum" : "none";
    }
    {
        Progress progress("loading " + arguments.scene);
        auto scene = scene::load_scene(arguments.scene, {.time = arguments.time});
        if (!scene) {
            const bool is_name = arguments.scene.starts_with("builtin:");
            return std::unexpected(Failure(scene.error(), is_name ? ExitCode::usage : ExitCode::failure));
        }
        session.scene_ = std::make_unique<scene::Scene>(*std::move(scene));
        if (!arguments.environment.empty()) {
            NACRE_TRY(session.scene_->environment, scene::load_environment(arguments.environment));
        }
    }
    fit_made_camera(*session.scene_, static_cast<float>(arguments.width) / static_cast<float>(arguments.height));
    if (!arguments.camera.empty() && !scene::find_camera(*session.scene_, arguments.camera)) {
        return wrong_usage({ErrorCode::not_found, "find camera", fmt::format("'{}'", arguments.camera),
                            fmt::format("scene '{}' has no camera of this name", arguments.scene),
                            fmt::format("Use one of: {}.", camera_names(*session.scene_))});
    }
    for (const std::string& warning : session.scene_->warnings) log_message(LogLevel::warning, warning);
    session.cache_ = std::make_unique<DiskCache>();
    return session;
}

Attempt<RenderSession> SceneSession::start(const rhi::Instance& instance, const std::string& backend,
                                           bool keep_intermediates) const {
    auto spec = rhi::BackendSpec::parse(backend);
    if (!spec) return wrong_usage(spec.error());
    const std::vector<std::string> known = instance.backend_names();
    if (spec->name != "auto" && std::ranges::find(known, spec->name) == known.end()) {
        return wrong_usage({ErrorCode::not_found, "find backend", fmt::format("'{}'", spec->name),
                            "there is no backend of this name",
                            fmt::format("Use auto or one of: {}.", fmt::join(known, ", "))});
    }
    Progress progress(fmt::format("preparing {} on {}", arguments_.scene, backend));
    auto device = instance.create_device({.backend = backend,
                                          .adapter = arguments_.device,
                                          .restriction = arguments_.restriction,
                                          .driver_validation = arguments_.driver_validation,
                                          .name = backend});
    if (!device) {
        // Options that a backend does not know, and devices that do not exist, are faults of the command line.
        const bool is_usage = device.error().code == ErrorCode::invalid_argument;
        return std::unexpected(Failure(device.error(), is_usage ? ExitCode::usage : ExitCode::failure));
    }
    RenderSession session;
    session.backend = resolved_name(backend, **device);
    session.device = *std::move(device);
    passes::RenderOptions options{.profile = arguments_.profile,
                                  .width = arguments_.width,
                                  .height = arguments_.height,
                                  .camera = arguments_.camera,
                                  .exposure_ev = arguments_.exposure_ev,
                                  .keep_intermediates = keep_intermediates,
                                  .cache = cache_.get(),
                                  .shader_folder = arguments_.watch};
    if (arguments_.tone_mapping == "linear") options.tone_mapping = passes::ToneMapping::linear;
    if (!arguments_.dump.empty()) options.keep.push_back(arguments_.dump);
    NACRE_TRY(session.renderer, passes::Renderer::create(*session.device, *scene_, options));
    if (!arguments_.dump.empty()) NACRE_CHECK(check_dump_name(*session.renderer, arguments_.dump));
    for (const std::string& warning : session.renderer->warnings()) {
        log_message(LogLevel::warning, fmt::format("{}: {}", session.backend, warning));
    }
    return session;
}

Attempt<void> check_dump_name(const passes::Renderer& renderer, const std::string& name) {
    std::vector<std::string> names;
    for (const passes::IntermediateDescription& description : renderer.intermediates()) {
        if (description.name == name) return {};
        names.push_back(description.name);
    }
    return wrong_usage({ErrorCode::not_found, "find texture", fmt::format("'{}'", name),
                        "no pass of this plan writes a texture of this name",
                        fmt::format("Use one of: {}.", fmt::join(names, ", "))});
}

Expected<void> check_messages(const RenderSession& session) {
    const std::uint64_t count = session.device->error_message_count();
    if (count == 0) return {};
    return fail(ErrorCode::validation, "render on", fmt::format("'{}'", session.backend),
                fmt::format("validation reported {} error{}", count, count == 1 ? "" : "s"),
                "The messages are above; this is a fault of Nacre or of the driver, please report it.");
}

Expected<void> write_graph(const passes::Renderer& renderer, const std::string& path) {
    if (path.empty()) return {};
    return write_file_atomically(path, path.ends_with(".svg") ? renderer.graph_as_svg() : renderer.graph_as_dot());
}

}  // namespace nacre::command
