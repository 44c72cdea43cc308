// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/embedded_file.h"
#include "core/error.h"
#include "core/image.h"
#include "passes/gbuffer_layout.h"
#include "passes/plan.h"
#include "rhi/device.h"
#include "rhi/pipeline_reloader.h"
#include "scene/scene.h"

/// @file
/// Renders a scene by the shared deferred passes, the same on every device.
///
///     auto renderer = *Renderer::create(*device, scene, {.profile = "high", .width = 1280, .height = 720});
///     FrameStatistics frame = *renderer->render_frame();
///     FinalPicture picture = *renderer->read_final();
///     write_png("out.png", picture.tone_mapped);
///
/// A renderer belongs to one device and is used by one thread at a time. The scene is read in `create` only.

namespace nacre {
class DiskCache;
}

namespace nacre::passes {

/// From linear light to what a display shows, before sRGB encoding.
enum class ToneMapping : std::uint8_t {
    filmic,  ///< An S-shaped curve in the manner of ACES: toe, straight middle, soft shoulder.
    linear,  ///< Clamps at 1; for comparisons.
};

/// Parts of a renderer that can be made not to exist (`RenderOptions::without`), for tests and for looking at one thing
/// at a time. A scene that does not use a feature gives the same plan with and without it.
enum class Feature : std::uint32_t {
    none = 0,
    emission = 1u << 0, alpha_test = 1u << 1, blend = 1u << 2, unlit = 1u << 3, shadows = 1u << 4,
    lights = 1u << 5, normal_maps = 1u << 6, occlusion = 1u << 7, vertex_colors = 1u << 8,
    texture_transforms = 1u << 9, specular_textures = 1u << 10, automatic_exposure = 1u << 11,
    closures = 1u << 12,  ///< Materials of several lobes; without it they are plain slabs.
};
constexpr Feature operator|(Feature a, Feature b) {
    return static_cast<Feature>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}
constexpr bool has(Feature set, Feature one) {
    return (static_cast<std::uint32_t>(set) & static_cast<std::uint32_t>(one)) != 0;
}

struct RenderOptions {
    std::string profile = "high";             ///< See passes/profiles.h.
    std::uint32_t width = 1280;               ///< Pixels, 1 to the device's limit.
    std::uint32_t height = 720;
    std::string camera;                       ///< Name or index in the scene; empty: its first.
    const scene::Environment* environment = nullptr;  ///< In place of the scene's own; read in `create`.
    std::optional<float> exposure_ev;  ///< Stops: light is multiplied by 2^EV. Empty: metered (docs/exposure.md).
    ToneMapping tone_mapping = ToneMapping::filmic;
    bool keep_intermediates = false;          ///< Every intermediate can be read after a frame; none share memory.
    std::vector<std::string> keep;            ///< As above for these names only.
    Feature without = Feature::none;
    /// After each frame, shade what the camera sees once more in a compute shader, from the blobs of the materials as
    /// hits of rays are shaded, for `read_hits` (docs/materials.md). Costs time and memory; the picture is the same.
    bool shade_hits = false;
    DiskCache* cache = nullptr;               ///< For compiled shaders; null: nothing is kept.
    /// Root of a source tree whose shaders are used in place of those in the program, and followed by `reload_shaders`;
    /// empty: that of NACRE_SHADER_DIR, if any.
    std::filesystem::path shader_folder;
};

struct PassTime {
    std::string name;
    double ms = 0.0;  ///< On the device; 0 where it has no timestamps.
};

struct FrameStatistics {
    double frame_ms = 0.0;           ///< From recording to the end of the device's work, by the host's clock.
    std::vector<PassTime> passes;    ///< In order of execution.
    std::uint64_t memory_bytes = 0;  ///< Buffers and textures of the device.
    double exposure_ev = 0.0;        ///< As used, metered or given.
};

/// A texture that passes hand on, readable after a frame if it was kept.
struct IntermediateDescription {
    std::string name;                ///< "material.0", "depth", "shadow_maps", "lit", ...
    rhi::Format format = rhi::Format::undefined;
    std::uint32_t width = 0, height = 0, layers = 1, mips = 1;
    std::string written_by;          ///< Names of the passes that write it, comma separated.
    std::span<const Field> fields{}; ///< How to decode a word; empty for textures that are not part of the G-buffer.
    bool is_readable = false;        ///< Kept (or shares memory with nothing).
};

/// The texels of one mip and layer, tightly packed rows, top row first, in the texture's own format (depth: floats).
struct IntermediateContent {
    IntermediateDescription description;
    std::uint32_t width = 0, height = 0;
    std::vector<std::byte> bytes;
};

struct FinalPicture {
    ImageBytes tone_mapped;   ///< RGBA, 8 bits, sRGB encoded.
    Image radiance;           ///< RGB, scene-linear luminance in cd/m2, before exposure and tone mapping.
    Image exposed;            ///< RGB, tone mapped but linear, [0, 1] (decoded from `tone_mapped`).
};

class Renderer {
  public:
    /// Uploads the scene, compiles shaders, prepares the environment's tables. Errors: not_found (profile, camera,
    /// shader folder), unsupported (the device cannot hold the profile; the text names the limit), out_of_memory,
    /// shader_compile, device_lost.
    static Expected<std::unique_ptr<Renderer>> create(rhi::Device& device, const scene::Scene& scene,
                                                      const RenderOptions& options = {});
    ~Renderer();
    Renderer(const Renderer&) = delete;
    Renderer& operator=(const Renderer&) = delete;

    /// Renders one frame and waits for it.
    Expected<FrameStatistics> render_frame();
    /// Looks for changes of the shaders' files ("hot reload"; call it between frames) and makes the pipelines anew that
    /// they concern, from the next frame on. One entry for each pass and outcome, none where nothing changed. A shader
    /// that does not compile is reported once, with file and line, and leaves the old pipeline in use. Shaders that
    /// prepare the environment have run by then: that a change does not show is reported as unsupported. The plan stays
    /// that of `create`.
    std::vector<rhi::PipelineReload> reload_shaders();
    /// Sees the scene from elsewhere, from the next frame on.
    void set_camera(const scene::Camera& camera);

    /// The picture of the last frame. Error: invalid_argument before the first frame.
    Expected<FinalPicture> read_final();
    /// All textures that passes hand on, in the order in which they are first written.
    [[nodiscard]] std::vector<IntermediateDescription> intermediates() const;
    /// Content after the last frame. Errors: not_found (lists the names), invalid_argument (not kept).
    Expected<IntermediateContent> read_intermediate(std::string_view name, std::uint32_t layer = 0,
                                                    std::uint32_t mip = 0);

    /// With RenderOptions::shade_hits, what was stored or found for each pixel: "material.0", "material.1", "top_layer"
    /// and "material.slices" as the base pass stores them; "albedo" (rgb: towards the viewer; a: roughness) and
    /// "emission" (rgb: cd/m2; a: 1 where the alpha test lets the surface be) as floats. Where nothing is seen all is
    /// 0. Errors: not_found, invalid_argument.
    Expected<IntermediateContent> read_hits(std::string_view name, std::uint32_t layer = 0);

    /// Four doubles for each texel of an intermediate texture of floats or fixed-point numbers, with all the precision
    /// that the device has (see exact_readback.h). Errors: those of `read_intermediate`, and unsupported.
    Expected<std::vector<double>> read_exact_intermediate(std::string_view name, std::uint32_t layer = 0,
                                                          std::uint32_t mip = 0);

    [[nodiscard]] const Plan& plan() const;
    [[nodiscard]] std::string graph_as_dot() const;
    [[nodiscard]] std::string graph_as_svg() const;
    /// What was not as the scene asked (lights over the budget, ...), one sentence each.
    [[nodiscard]] const std::vector<std::string>& warnings() const;

  private:
    struct State;
    explicit Renderer(std::unique_ptr<State> state);
    Expected<rhi::Texture> find_intermediate(std::string_view name, std::uint32_t layer, std::uint32_t mip,
                                             IntermediateDescription& description) const;
    std::unique_ptr<State> state_;
};

/// The GLSL of all passes and passes/profiles.json.
std::span<const EmbeddedFile> embedded_files();

}  // namespace nacre::passes
