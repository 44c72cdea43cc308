// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/disk_cache.h"
#include "passes/renderer.h"
#include "rhi/device.h"
#include "samples/nacre/command_line.h"
#include "samples/nacre/outcome.h"
#include "scene/scene.h"

/// @file
/// From arguments to a renderer: the steps that `render`, `compare`, `explain` and `demo` share.
///
///     NACRE_TRY(SceneSession scene, SceneSession::open(arguments));
///     NACRE_TRY(RenderSession session, scene.start(*instance, "vulkan"));
///     session.renderer->render_frame();

namespace nacre::command {

template <typename T>
using Attempt = std::expected<T, Failure>;

/// A device and the renderer on it; destroyed in the right order.
struct RenderSession {
    std::string backend;  ///< Resolved: never "auto".
    std::unique_ptr<rhi::Device> device;
    std::unique_ptr<passes::Renderer> renderer;
};

/// The scene of the arguments with its camera, environment and options, ready for any number of devices.
class SceneSession {
  public:
    /// Loads scene and environment, and checks camera, profile and restriction. Warnings of the scene go to the log.
    static Attempt<SceneSession> open(const SceneArguments& arguments);

    /// Makes a device of `backend` (a spec) and a renderer on it. Intermediates are kept where `keep_intermediates`
    /// says so, and `SceneArguments::dump` in any case.
    [[nodiscard]] Attempt<RenderSession> start(const rhi::Instance& instance, const std::string& backend,
                                               bool keep_intermediates) const;

    [[nodiscard]] const scene::Scene& scene() const { return *scene_; }
    [[nodiscard]] const SceneArguments& arguments() const { return arguments_; }
    /// Of the scene, then of the environment.
    [[nodiscard]] const std::vector<std::string>& warnings() const { return scene_->warnings; }

  private:
    SceneArguments arguments_;
    std::unique_ptr<scene::Scene> scene_;
    std::unique_ptr<DiskCache> cache_;
};

/// Fails, naming the textures that there are, where `name` is none of `renderer`'s.
Attempt<void> check_dump_name(const passes::Renderer& renderer, const std::string& name);

/// Fails where validation (Nacre's own or the driver's, see --driver-validation) reported errors on this device.
Expected<void> check_messages(const RenderSession& session);

/// Writes the graph of passes where `--dump-graph` asked for it.
Expected<void> write_graph(const passes::Renderer& renderer, const std::string& path);

}  // namespace nacre::command
