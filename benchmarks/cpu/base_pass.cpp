// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>

#include "benchmarks/cpu/bench.h"
#include "materials/single_slab.h"
#include "passes/camera_block.h"
#include "passes/geometry_draws.h"
#include "passes/render_pass.h"
#include "passes/scene_closures.h"
#include "scene/builtin.h"

/// @file
/// Drawing: the base pass (three integer color targets and depth) over a landscape that covers the picture once, as
/// 250,632 triangles of 8 pixels and as 2,450 large ones. Depth is tested and written in the same pass, or tested for
/// equality after a prepass, as whole frames do.

namespace nacre::bench {
namespace {

using rhi::LoadOperation;
using rhi::TextureUsage;

/// Looks straight down on a landscape 40 m deep, so that it covers the picture exactly and nothing hides anything.
scene::Camera camera_above() {
    scene::Camera camera{.name = "above", .projection = scene::Projection::orthographic};
    camera.world = glm::inverse(glm::lookAt(glm::vec3(0, 10, 0), glm::vec3(0, 0, 0), glm::vec3(0, 0, -1)));
    camera.half_width = camera.half_height = 20.0f;
    camera.near_distance = 1.0f;
    camera.far_distance = 20.0f;
    return camera;
}

/// The picture is wider than high, the landscapes are square.
glm::mat4 as_wide_as_the_picture() {
    return glm::scale(glm::mat4(1.0f), glm::vec3(static_cast<float>(picture_width) / picture_height, 1.0f, 1.0f));
}

/// A landscape like that of builtin:grid250k of few and large triangles.
scene::Scene coarse_landscape() {
    constexpr std::uint32_t squares = 35;
    scene::Scene scene{.name = "coarse"};
    scene.materials.push_back({.name = "ground"});
    scene::Primitive primitive;
    const auto height = [](float x, float z) { return 0.9f * std::sin(0.45f * x) * std::cos(0.38f * z); };
    for (std::uint32_t row = 0; row <= squares; ++row) {
        for (std::uint32_t column = 0; column <= squares; ++column) {
            const float x = 40.0f * static_cast<float>(column) / squares - 20.0f;
            const float z = 40.0f * static_cast<float>(row) / squares - 20.0f;
            primitive.positions.emplace_back(x, height(x, z), z);
            primitive.normals.push_back(glm::normalize(glm::vec3(height(x - 0.01f, z) - height(x + 0.01f, z), 0.02f,
                                                                 height(x, z - 0.01f) - height(x, z + 0.01f))));
            primitive.bounds.add(primitive.positions.back());
        }
    }
    for (std::uint32_t row = 0; row < squares; ++row) {
        for (std::uint32_t column = 0; column < squares; ++column) {
            const std::uint32_t a = row * (squares + 1) + column, b = a + squares + 1;
            primitive.indices.insert(primitive.indices.end(), {a, b, b + 1, a, b + 1, a + 1});
        }
    }
    scene.meshes.push_back({.name = "ground", .primitives = {std::move(primitive)}});
    scene.instances.push_back({.name = "ground", .mesh = 0, .transforms = {glm::mat4(1.0f)}});
    scene.cameras.push_back(camera_above());
    return scene;
}

/// A scene on a device, with the passes that draw it.
class Landscape {
  public:
    static Expected<std::shared_ptr<Landscape>> create(rhi::Device& device, const scene::Scene& scene, bool prepass) {
        auto landscape = std::make_shared<Landscape>(device, prepass);
        NACRE_CHECK(landscape->prepare(scene));
        return landscape;
    }
    Landscape(rhi::Device& device, bool prepass) : device_(device), prepass_(prepass) {}

    Expected<double> run() {
        return time_submission(device_, [&](rhi::CommandList& list) {
            if (prepass_) {
                list.begin_render_pass({.depth_stencil = {.view = depth_,
                                                          .depth_load = LoadOperation::clear,
                                                          .clear_depth = 0.0f},
                                        .name = "depth prepass"});
                depth_draws_.record(list, group_, visible_);
                list.end_render_pass();
            }
            rhi::RenderPassDesc pass{
                .depth_stencil = {.view = depth_,
                                  .depth_load = prepass_ ? LoadOperation::load : LoadOperation::clear,
                                  .clear_depth = 0.0f,
                                  .read_only = prepass_},
                .name = "base pass"};
            for (const rhi::Texture word : words_) {
                rhi::ColorAttachment attachment{.view = word, .load = LoadOperation::clear};
                attachment.clear.uint = {0, 0, 0, 0};
                pass.color.push_back(attachment);
            }
            list.begin_render_pass(pass);
            draws_.record(list, group_, visible_);
            list.end_render_pass();
        });
    }

    /// Share of the pixels that hold a surface.
    Expected<double> coverage() {
        NACRE_TRY(const auto bytes, device_.read_texture(words_[0]));
        std::size_t covered = 0;
        for (std::size_t i = 0; i < bytes.size(); i += 4) {
            std::uint32_t word = 0;
            std::memcpy(&word, bytes.data() + i, 4);
            covered += word != 0 ? 1 : 0;
        }
        return static_cast<double>(covered) * 4.0 / static_cast<double>(bytes.size());
    }

  private:
    Expected<void> prepare(const scene::Scene& scene) {
        std::vector<materials::SingleSlab> slabs;
        for (const auto& material : scene.materials) slabs.push_back(materials::single_slab(material));
        NACRE_TRY(geometry_, passes::SceneGeometry::create(device_, scene, slabs, closures_, kinds_, 0, false));
        NACRE_TRY(materials_, passes::SceneMaterials::create(device_, scene, slabs, closures_, kinds_,
                                                             std::vector<bool>(slabs.size(), true), 0, 1.0f));
        shaders_ = std::make_unique<passes::ShaderLibrary>(device_, nullptr);

        const passes::CameraBlock block = passes::camera_block(camera_above(), picture_width, picture_height);
        NACRE_TRY(const rhi::Buffer camera, device_.create_buffer({.size = sizeof(block),
                                                                   .usage = rhi::BufferUsage::uniform,
                                                                   .name = "camera"}));
        NACRE_CHECK(device_.write_buffer(camera, std::as_bytes(std::span(&block, 1))));
        NACRE_TRY(const rhi::BindGroupLayout layout,
                  device_.create_bind_group_layout(
                      {.bindings = {{.binding = 0,
                                     .type = rhi::BindingType::uniform_buffer,
                                     .stages = rhi::ShaderStage::vertex | rhi::ShaderStage::fragment}},
                       .name = "camera"}));
        NACRE_TRY(group_, device_.create_bind_group(
                              {.layout = layout, .entries = {{.binding = 0, .buffer = camera}}, .name = "camera"}));

        const auto target = [&](rhi::Format format, TextureUsage usage) {
            return device_.create_texture({.format = format,
                                           .width = picture_width,
                                           .height = picture_height,
                                           .usage = usage | TextureUsage::copy_source,
                                           .name = "target"});
        };
        NACRE_TRY(depth_, target(rhi::Format::d32_float, TextureUsage::depth_target));
        for (rhi::Texture& word : words_) {
            NACRE_TRY(word, target(rhi::Format::r32_uint, TextureUsage::color_target));
        }

        NACRE_TRY(const passes::Profile* profile, passes::find_profile("high"));
        const passes::Decisions decisions;
        passes::FrameGraph graph;
        passes::FrameResources resources;
        passes::RenderContext context{.device = device_,
                                      .graph = graph,
                                      .shaders = *shaders_,
                                      .geometry = *geometry_,
                                      .materials = *materials_,
                                      .closures = closures_,
                                      .profile = *profile,
                                      .decisions = decisions,
                                      .resources = resources,
                                      .camera_layout = layout,
                                      .camera_group = group_};
        const rhi::DepthStencilState writes{.format = rhi::Format::d32_float,
                                            .depth_test = true,
                                            .depth_write = true,
                                            .depth_compare = rhi::CompareOperation::greater_or_equal};
        const rhi::DepthStencilState equal{.format = rhi::Format::d32_float,
                                           .depth_test = true,
                                           .depth_compare = rhi::CompareOperation::equal};
        visible_.assign(geometry_->draws().size(), true);
        const auto all = [](const passes::Draw&) { return true; };
        if (prepass_) {
            NACRE_CHECK(depth_draws_.prepare(context,
                                             {.name = "depth prepass",
                                              .vertex_shader = "passes/depth_prepass/depth_prepass.vert",
                                              .depth_stencil = writes,
                                              .frame_layout = layout},
                                             passes::select_draws(*geometry_, all)));
        }
        return draws_.prepare(context,
                              {.name = "base pass",
                               .vertex_shader = "passes/base_pass/base_pass.vert",
                               .fragment_shader = "passes/base_pass/base_pass.frag",
                               .with_normals = true,
                               .keeps_unlit = true,
                               .depth_stencil = prepass_ ? equal : writes,
                               .color_targets = {{.format = rhi::Format::r32_uint},
                                                 {.format = rhi::Format::r32_uint},
                                                 {.format = rhi::Format::r32_uint}},
                               .frame_layout = layout},
                              passes::select_draws(*geometry_, all));
    }

    rhi::Device& device_;
    const bool prepass_;
    const passes::SceneClosures closures_;
    const passes::CustomKinds kinds_;      ///< None.
    std::unique_ptr<passes::SceneGeometry> geometry_;
    std::unique_ptr<passes::SceneMaterials> materials_;
    std::unique_ptr<passes::ShaderLibrary> shaders_;
    rhi::BindGroup group_{};
    rhi::Texture depth_{}, words_[3]{};
    std::vector<bool> visible_;
    passes::GeometryDraws depth_draws_, draws_;
};

Expected<void> run_landscape(Bench& bench, const std::string& name, double target, const scene::Scene& scene,
                             bool prepass) {
    if (!bench.wants(name)) return {};
    Case work{.name = name, .target = target};
    const auto side = [&](const std::string& spec, std::string side_name, std::uint32_t lanes) -> Expected<Side> {
        NACRE_TRY(rhi::Device * device, bench.device(spec));
        NACRE_TRY(const auto landscape, Landscape::create(*device, scene, prepass));
        NACRE_CHECK(landscape->run());
        NACRE_TRY(const double coverage, landscape->coverage());
        if (coverage < 0.999)
            return fail(ErrorCode::internal, "draw", fmt::format("'{}' on {}", name, spec),
                        fmt::format("only {:.1f} % of the picture are covered", coverage * 100.0),
                        "The landscape must cover all of it: one of the rasterizers is wrong.");
        return Side{.name = std::move(side_name), .lanes = lanes, .run = [landscape] { return landscape->run(); }};
    };
    for (const std::uint32_t lanes : bench.lane_counts()) {
        NACRE_TRY(Side ours, side(cpu_spec(lanes), "cpu", lanes));
        work.cpu.push_back(std::move(ours));
    }
    for (const std::string spec : {"vulkan", "gl"}) {
        if (!bench.has_device(spec)) continue;
        NACRE_TRY(Side reference, side(spec, spec, 0));
        work.references.push_back(std::move(reference));
    }
    return bench.measure(std::move(work));
}

}  // namespace

Expected<void> run_base_pass(Bench& bench) {
    NACRE_TRY(scene::Scene fine, scene::make_builtin_scene("builtin:grid250k"));
    scene::Scene coarse = coarse_landscape();
    for (scene::Scene* scene : {&fine, &coarse})
        for (scene::Instance& instance : scene->instances) instance.transforms = {as_wide_as_the_picture()};
    NACRE_CHECK(run_landscape(bench, "base_pass_250k_triangles", 3.0, fine, false));
    NACRE_CHECK(run_landscape(bench, "base_pass_2500_triangles", 2.5, coarse, false));
    NACRE_CHECK(run_landscape(bench, "base_pass_250k_after_prepass", 3.0, fine, true));
    return run_landscape(bench, "base_pass_2500_after_prepass", 2.5, coarse, true);
}

}  // namespace nacre::bench
