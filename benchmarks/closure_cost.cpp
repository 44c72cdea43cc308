// SPDX-License-Identifier: Apache-2.0
/// @file
/// What the closures' library costs (docs/materials.md, "Cost"):
///
///     closure_cost_benchmark [--rounds N] [--backends LIST] [--json FILE]
///
/// 1. A slab without features, by the library and by a shader written by hand for it alone
///    (benchmarks/closure_cost_by_hand.glsl): the same lobes, compensation and diffuse model. Once with many lights for
///    each slab, where evaluation counts, and once with one, where preparation does. The two take turns; a ratio is the
///    median of those of the rounds. Both pictures must agree.
/// 2. Lighting of a picture whose pixels all hold 1 to 8 closures: the time of the renderer's lighting pass, and the
///    straight line through it.
///
/// Exit status 1 where a ratio exceeds 1.05.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <glm/geometric.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>

#include "core/embedded_file.h"
#include "materials/slab.h"
#include "materials/tables/interface_table.h"
#include "materials/tree.h"
#include "measure/frame_times.h"
#include "passes/renderer.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "scene/scene.h"
#include "scene/shapes.h"

namespace nacre::closure_cost {
/// GLSL of this folder.
std::span<const EmbeddedFile> embedded_files();
}  // namespace nacre::closure_cost

namespace {

using namespace nacre;
using namespace nacre::rhi;
using Json = nlohmann::ordered_json;

constexpr double most_over_by_hand = 1.05;

/// As the shader reads it.
struct Point {
    glm::vec4 f0_and_roughness, albedo, view;
};

constexpr std::uint32_t light_count = 64;

struct Work {
    const char* name;
    std::uint32_t lights_per_point, points_per_invocation, invocations;
};
// 17 and 2 million evaluations.
constexpr Work works[] = {{"64 lights for each slab", light_count, 1, 1u << 18},
                          {"1 light for each slab", 1, 8, 1u << 18}};

std::vector<Point> make_points() {
    std::mt19937 random(3);
    const auto number = [&] { return static_cast<float>(random() >> 8) * 0x1p-24f; };
    std::vector<Point> points(1u << 16);
    for (Point& point : points) {
        const bool is_metal = number() < 0.3f;
        const float dielectric = 0.02f + 0.06f * number();
        point.f0_and_roughness = is_metal ? glm::vec4(0.5f + 0.5f * number(), 0.5f * number() + 0.3f, number(), 0.0f)
                                          : glm::vec4(dielectric, dielectric, dielectric, 0.0f);
        point.f0_and_roughness.w = 0.05f + 0.95f * number();
        point.albedo = is_metal ? glm::vec4(0.0f) : glm::vec4(number(), number(), number(), 0.0f);
        const float z = 0.05f + 0.95f * number(), angle = 6.2831853f * number(), side = std::sqrt(1.0f - z * z);
        point.view = {side * std::cos(angle), side * std::sin(angle), z, 0.0f};
    }
    return points;
}

std::vector<glm::vec4> make_lights() {
    std::mt19937 random(5);
    const auto number = [&] { return static_cast<float>(random() >> 8) * 0x1p-24f; };
    std::vector<glm::vec4> lights(light_count);
    for (glm::vec4& light : lights) {
        // All above the surface: neither side shall gain by what it leaves out.
        const float z = 0.02f + 0.98f * number(), angle = 6.2831853f * number(), side = std::sqrt(1.0f - z * z);
        light = {side * std::cos(angle), side * std::sin(angle), z, 1.0f / light_count};
    }
    return lights;
}

class Kernel {
  public:
    static Expected<Kernel> make(Device& device, const Work& work, bool by_hand) {
        Kernel kernel;
        kernel.device_ = &device;
        kernel.groups_ = work.invocations / 64;
        std::vector<ShaderDefine> defines = {{"LIGHTS_PER_POINT", fmt::format("{}u", work.lights_per_point)},
                                             {"POINTS_PER_INVOCATION", fmt::format("{}u", work.points_per_invocation)}};
        if (by_hand) defines.push_back({"BY_HAND"});
        ShaderCompiler compiler({.embedded = {closure_cost::embedded_files(), materials::embedded_files()}});
        NACRE_TRY(const ShaderDesc desc,
                  compiler.compile({.path = "benchmarks/closure_cost.comp", .defines = defines}));
        NACRE_TRY(const Shader shader, device.create_shader(desc));
        NACRE_TRY(kernel.pipeline_, device.create_compute_pipeline({.shader = shader, .name = work.name}));
        const auto points = make_points();
        const auto lights = make_lights();
        std::vector<BindGroupEntry> entries;
        const auto add = [&](std::uint64_t size, BufferUsage usage) -> Expected<Buffer> {
            NACRE_TRY(const Buffer buffer, device.create_buffer({.size = size, .usage = usage, .name = "cost"}));
            entries.push_back({.binding = static_cast<std::uint32_t>(entries.size()), .buffer = buffer});
            return buffer;
        };
        NACRE_TRY(const Buffer point_buffer, add(points.size() * sizeof(Point), BufferUsage::storage));
        NACRE_TRY(const Buffer light_buffer, add(lights.size() * sizeof(glm::vec4), BufferUsage::uniform));
        NACRE_TRY(kernel.results_, add(std::uint64_t{16} * work.invocations, BufferUsage::storage));
        NACRE_TRY(const Buffer table_buffer, add(materials::interface_table().size_bytes(), BufferUsage::storage));
        NACRE_CHECK(device.write_buffer(point_buffer, std::span<const Point>(points)));
        NACRE_CHECK(device.write_buffer(light_buffer, std::span<const glm::vec4>(lights)));
        NACRE_CHECK(device.write_buffer(table_buffer, materials::interface_table()));
        NACRE_TRY(const BindGroupLayout layout, device.bind_group_layout(kernel.pipeline_, 0));
        NACRE_TRY(kernel.group_, device.create_bind_group({.layout = layout, .entries = entries, .name = "cost"}));
        return kernel;
    }

    /// Milliseconds.
    Expected<double> run() const {
        CommandList list = device_->create_command_list("cost");
        list.set_pipeline(pipeline_);
        list.set_bind_group(0, group_);
        list.dispatch({groups_, 1, 1});
        NACRE_CHECK(list.status());
        const auto begin = std::chrono::steady_clock::now();
        NACRE_TRY(const Fence fence, device_->submit(std::move(list)));
        NACRE_CHECK(device_->wait(fence));
        return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    }

    Expected<std::vector<float>> results() const {
        NACRE_TRY(const auto bytes, device_->read_buffer(results_));
        std::vector<float> values(bytes.size() / 4);
        std::memcpy(values.data(), bytes.data(), bytes.size());
        return values;
    }

  private:
    Device* device_ = nullptr;
    ComputePipeline pipeline_;
    Buffer results_;
    BindGroup group_;
    std::uint32_t groups_ = 0;
};

/// Largest difference, by the size of the value and a floor.
double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
    double worst = a.size() == b.size() ? 0.0 : INFINITY;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
        const double difference = std::abs(double{a[i]} - b[i]) / (std::abs(double{b[i]}) + 1e-3);
        if (!(difference <= worst)) worst = difference;
    }
    return worst;
}

Expected<bool> compare(Device& device, const std::string& backend, std::uint32_t rounds, Json& rows) {
    bool is_close = true;
    for (const Work& work : works) {
        NACRE_TRY(const Kernel library, Kernel::make(device, work, false));
        NACRE_TRY(const Kernel by_hand, Kernel::make(device, work, true));
        std::vector<double> ratios, library_ms, by_hand_ms;
        for (std::uint32_t round = 0; round <= rounds; ++round) {
            // Whoever goes first may find the caches colder.
            double first = 0.0, second = 0.0;
            if (round % 2 == 0) {
                NACRE_TRY(first, library.run());
                NACRE_TRY(second, by_hand.run());
            } else {
                NACRE_TRY(second, by_hand.run());
                NACRE_TRY(first, library.run());
            }
            if (round == 0) continue;
            library_ms.push_back(first);
            by_hand_ms.push_back(second);
            ratios.push_back(first / second);
        }
        NACRE_TRY(const auto seen, library.results());
        NACRE_TRY(const auto expected, by_hand.results());
        const double difference = largest_difference(seen, expected);
        if (!(difference < 1e-3)) {
            return fail(ErrorCode::internal, "compare with what is written by hand", backend,
                        fmt::format("results differ by up to {} of their values", difference),
                        "Both must compute the same: look at benchmarks/closure_cost_by_hand.glsl.");
        }
        const double ratio = measure::median(ratios);
        const double evaluations = double(work.lights_per_point) *
                                   work.points_per_invocation * work.invocations;
        std::printf("%-8s %-26s library %8.2f ms, by hand %8.2f ms, ratio %.3f (fastest %.3f), %.2f ns each\n",
                    backend.c_str(), work.name, measure::median(library_ms), measure::median(by_hand_ms), ratio,
                    std::ranges::min(library_ms) / std::ranges::min(by_hand_ms),
                    std::ranges::min(library_ms) * 1e6 / evaluations);
        std::fflush(stdout);
        rows.push_back({{"backend", backend},
                        {"work", work.name},
                        {"library_ms", measure::median(library_ms)},
                        {"by_hand_ms", measure::median(by_hand_ms)},
                        {"ratio", ratio},
                        {"ratio_of_fastest", std::ranges::min(library_ms) / std::ranges::min(by_hand_ms)},
                        {"largest_difference", difference}});
        is_close = is_close && ratio <= most_over_by_hand;
    }
    return is_close;
}

/// A wall that fills the picture, under eight lights without shadows, of a material with so many closures side by side.
scene::Scene wall(std::uint32_t closures) {
    scene::Scene scene{.name = "wall"};
    materials::MaterialDescription material{.name = "mix"};
    materials::Tree tree{.name = "mix"};
    materials::NodeIndex root = 0;
    for (std::uint32_t i = 0; i < closures; ++i) {
        materials::Slab slab;
        // A tint along the surface, so that one closure takes the way of the others too.
        slab.features = materials::slab_f90;
        slab.f90 = {1.0f, 0.8f, 0.6f};
        slab.roughness = 0.2f + 0.1f * static_cast<float>(i);
        slab.albedo = glm::vec3(0.3f + 0.05f * static_cast<float>(i));
        const materials::NodeIndex leaf = tree.add(slab);
        root = i == 0 ? leaf : tree.mix(root, leaf, 1.0f / static_cast<float>(i + 1));
    }
    tree.root = root;
    material.tree = std::make_shared<const materials::Tree>(std::move(tree));
    scene.materials.push_back(std::move(material));
    scene::Primitive primitive = scene::parallelogram({-4, -4, 0}, {8, 0, 0}, {0, 8, 0});
    scene.meshes.push_back({.name = "wall", .primitives = {std::move(primitive)}});
    scene.instances.push_back({.name = "wall", .mesh = 0, .transforms = {glm::mat4(1.0f)}});
    scene::Camera camera{.name = "front", .projection = scene::Projection::orthographic};
    camera.world[3] = glm::vec4(0, 0, 10, 1);
    camera.near_distance = 1.0f;
    camera.far_distance = 20.0f;
    scene.cameras.push_back(camera);
    for (int i = 0; i < 8; ++i) {
        scene::Light light{.name = "lamp", .kind = scene::LightKind::point, .intensity = 1.0f};
        light.position = {std::cos(0.8f * static_cast<float>(i)), std::sin(0.8f * static_cast<float>(i)), 2.0f};
        light.casts_shadows = false;
        scene.lights.push_back(light);
    }
    return scene;
}

Expected<void> measure_closures(Device& device, const std::string& backend, std::uint32_t rounds, Json& rows) {
    constexpr std::uint32_t most = 8;
    std::vector<std::unique_ptr<passes::Renderer>> renderers;
    for (std::uint32_t count = 1; count <= most; ++count) {
        NACRE_TRY(auto renderer, passes::Renderer::create(device, wall(count),
                                                          {.profile = "reference", .width = 512, .height = 512,
                                                           .exposure_ev = 0.0f}));
        renderers.push_back(std::move(renderer));
    }
    std::vector<std::vector<double>> times(most);
    for (std::uint32_t round = 0; round <= rounds; ++round) {
        for (std::uint32_t i = 0; i < most; ++i) {
            NACRE_TRY(const passes::FrameStatistics frame, renderers[i]->render_frame());
            const auto pass = std::ranges::find(frame.passes, "lighting", &passes::PassTime::name);
            if (round > 0 && pass != frame.passes.end()) times[i].push_back(pass->ms);
        }
    }
    Json each = Json::array();
    double sum_x = 0, sum_y = 0, sum_xx = 0, sum_xy = 0, sum_yy = 0;
    std::printf("%-8s lighting ms by closures:", backend.c_str());
    for (std::uint32_t i = 0; i < most; ++i) {
        const double x = i + 1.0, y = std::ranges::min(times[i]);
        std::printf(" %.2f", y);
        each.push_back(y);
        sum_x += x, sum_y += y, sum_xx += x * x, sum_xy += x * y, sum_yy += y * y;
    }
    const double n = most, slope = (n * sum_xy - sum_x * sum_y) / (n * sum_xx - sum_x * sum_x);
    const double intercept = (sum_y - slope * sum_x) / n;
    const double correlation = (n * sum_xy - sum_x * sum_y) /
                               std::sqrt((n * sum_xx - sum_x * sum_x) * (n * sum_yy - sum_y * sum_y));
    std::printf("; slope %.3f, intercept %.3f, R^2 %.4f\n", slope, intercept, correlation * correlation);
    std::fflush(stdout);
    rows.push_back({{"backend", backend},
                    {"lighting_ms", each},
                    {"slope_ms", slope},
                    {"intercept_ms", intercept},
                    {"r_squared", correlation * correlation}});
    return {};
}

}  // namespace

int main(int count, char** arguments) {
    std::uint32_t rounds = 15;
    std::vector<std::string> backends = {"cpu", "vulkan", "gl"};
    std::string json;
    bool only_ratio = false, only_count = false;
    CLI::App app("Cost of the closures: against a shader written by hand, and by their number.");
    app.add_option("--rounds", rounds, "Rounds that count")->check(CLI::PositiveNumber);
    app.add_option("--backends", backends, "Backends")->delimiter(',');
    app.add_option("--json", json, "File for all figures");
    app.add_flag("--only-ratio", only_ratio, "Leave out the cost by number");
    app.add_flag("--only-number", only_count, "Leave out what is written by hand");
    CLI11_PARSE(app, count, arguments);

    const Instance instance(all_backends());
    Json ratios = Json::array(), numbers = Json::array(), skipped = Json::array();
    bool is_close = true;
    for (const std::string& backend : backends) {
        const auto device =
            instance.create_device({.backend = backend, .validation = false, .debug_names = false, .name = backend});
        if (!device) {
            std::printf("%-8s skipped: %s\n", backend.c_str(), device.error().message().c_str());
            skipped.push_back({{"backend", backend}, {"reason", device.error().message()}});
            if (device.error().code != ErrorCode::not_found) is_close = false;
            continue;
        }
        if (!only_count) {
            const auto close = compare(**device, backend, rounds, ratios);
            if (!close) {
                std::fprintf(stderr, "%s\n", close.error().message().c_str());
                return 2;
            }
            is_close = is_close && *close;
        }
        if (only_ratio) continue;
        if (const auto measured = measure_closures(**device, backend, rounds, numbers); !measured) {
            std::fprintf(stderr, "%s\n", measured.error().message().c_str());
            return 2;
        }
    }
    if (!json.empty()) {
        const Json report{{"ratios", ratios}, {"by_number", numbers}, {"skipped", skipped}, {"rounds", rounds}};
        std::ofstream(json) << report.dump(2) << '\n';
    }
    return is_close ? 0 : 1;
}
