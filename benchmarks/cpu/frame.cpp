// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <memory>

#include "benchmarks/cpu/bench.h"
#include "core/disk_cache.h"
#include "passes/renderer.h"
#include "scene/builtin.h"
#include "scene/load.h"

/// @file
/// Whole frames of whole scenes, as `nacre render` makes them, after warm-up.

namespace nacre::bench {
namespace {

/// A renderer with the device that it belongs to. Each scene has devices of its own, so that none of them finds memory
/// that another has touched.
struct Rendering {
    std::unique_ptr<rhi::Device> device;
    std::unique_ptr<passes::Renderer> renderer;
};

Expected<std::shared_ptr<Rendering>> start(const Bench& bench, const std::string& spec, const scene::Scene& scene) {
    auto rendering = std::make_shared<Rendering>();
    NACRE_TRY(rendering->device, bench.new_device(spec));
    NACRE_TRY(rendering->renderer, passes::Renderer::create(*rendering->device, scene,
                                                            {.width = picture_width, .height = picture_height}));
    return rendering;
}

Side side_of(std::string name, std::uint32_t lanes, std::shared_ptr<Rendering> rendering) {
    return {.name = std::move(name), .lanes = lanes, .run = [rendering]() -> Expected<double> {
                NACRE_TRY(const passes::FrameStatistics frame, rendering->renderer->render_frame());
                return frame.frame_ms;
            }};
}

Expected<void> run_scene(Bench& bench, const std::string& name, const std::string& path) {
    NACRE_TRY(const scene::Scene scene, scene::load_scene(path));
    Case work{.name = "frame_" + name, .target = 3.0};
    for (const std::uint32_t lanes : bench.lane_counts()) {
        NACRE_TRY(auto rendering, start(bench, cpu_spec(lanes), scene));
        work.cpu.push_back(side_of("cpu", lanes, std::move(rendering)));
    }
    for (const std::string reference : {"vulkan", "gl"}) {
        if (!bench.has_device(reference)) continue;
        NACRE_TRY(auto rendering, start(bench, reference, scene));
        work.references.push_back(side_of(reference, 0, std::move(rendering)));
    }
    return bench.measure(std::move(work));
}

}  // namespace

Expected<void> run_frame(Bench& bench) {
    // Both are asked, so that both are reported where they are absent.
    const bool has_vulkan = bench.has_device("vulkan"), has_gl = bench.has_device("gl");
    if (!has_vulkan && !has_gl && !bench.options().alone) return {};
    std::vector<std::pair<std::string, std::string>> scenes;  // name, what to load
    for (const std::string_view name : scene::builtin_scene_names())
        scenes.emplace_back(name.substr(name.find(':') + 1), name);
    const std::filesystem::path folder = bench.options().assets;
    if (std::filesystem::is_directory(folder)) {
        std::vector<std::filesystem::path> files;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
            const auto extension = entry.path().extension();
            if (extension == ".gltf" || extension == ".glb") files.push_back(entry.path());
        }
        std::ranges::sort(files);
        for (const auto& file : files) scenes.emplace_back(file.stem().string(), file.string());
    } else {
        bench.skip("frame of sample scenes", "there is no folder " + folder.string());
    }
    if (bench.options().quick)
        std::erase_if(scenes, [](const auto& scene) { return scene.first != "spheres" && scene.first != "ToyCar"; });
    for (const auto& [name, path] : scenes) {
        if (!bench.wants("frame_" + name)) continue;
        if (const auto ran = run_scene(bench, name, path); !ran) bench.skip("frame_" + name, ran.error().message());
    }
    return {};
}

}  // namespace nacre::bench
