// SPDX-License-Identifier: Apache-2.0
// What the RHI costs over Vulkan written by hand: 10,000 draws of one triangle, with another bind group and other push
// constants for each, and 1,000 dispatches, recorded, submitted and released through both in one run.
//
//     rhi_overhead_benchmark [--rounds=N] [--verbose]
//
// Both sides do the same calls of Vulkan and wait in the same places; rounds of the two alternate, so that neither has
// the machine in a better state. Measured is the time that the recording thread spends (CPU time, not waiting) from
// the begin of the recording to the return of the submission. As in a loop over frames, what a round recorded is
// released at the begin of the next one of its side, within that time. The RHI translates at submission, so only the
// last line compares like with like.
// Fails where the RHI needs more than 1.25 times as long, by the fastest round of each.

#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "backends/vulkan/vulkan_backend.h"
#include "rhi/backend.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "tests/backends/vulkan/native_vulkan.h"

namespace nacre {
namespace {

constexpr std::uint32_t draw_count = 10'000, dispatch_count = 1'000;
constexpr std::uint32_t group_count = 64;
constexpr std::uint32_t target_size = 64;
constexpr double promised_ratio = 1.25;

const char* const vertex_text = R"(
layout(set = 0, binding = 0) uniform Placement { vec4 offset; };
layout(push_constant) uniform Push { vec4 color; };
void main() {
    // A triangle of about one pixel.
    vec2 corner = vec2(gl_VertexIndex == 1, gl_VertexIndex == 2) * 0.05;
    gl_Position = vec4(corner + offset.xy, 0, 1);
})";
const char* const fragment_text = R"(
layout(push_constant) uniform Push { vec4 color; };
layout(location = 0) out vec4 result;
void main() { result = color; })";
const char* const compute_text = R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) buffer Counter { uint counter[]; };
layout(push_constant) uniform Push { uvec4 step; };
void main() { counter[0] += step.x; })";

struct Push {
    float values[4];
};

template <typename T>
T must(Expected<T> value) {
    if (value) return *std::move(value);
    std::fprintf(stderr, "%s\n", value.error().message().c_str());
    std::exit(1);
}
void must(Expected<void> value) {
    if (value) return;
    std::fprintf(stderr, "%s\n", value.error().message().c_str());
    std::exit(1);
}

double cpu_ms() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) * 1e3 + static_cast<double>(time.tv_nsec) * 1e-6;
}

struct Times {
    double draws = 0, dispatches = 0, submit = 0;
    [[nodiscard]] double begin_to_submit() const { return draws + dispatches + submit; }
};

std::vector<std::uint32_t> compile(const std::string& path, const char* text) {
    rhi::ShaderCompiler compiler({.debug_information = false});
    return must(compiler.compile({.path = path, .text = text})).spirv;
}

class ByHand {
  public:
    explicit ByHand(vulkan::test::NativeVulkan& native) : native_(native), vk_(native.vk) {
        target_ = native_.make_target(VK_FORMAT_R8G8B8A8_UNORM, target_size, target_size);
        const auto uniform = native_.make_set_layout(VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, VK_SHADER_STAGE_VERTEX_BIT);
        const auto storage = native_.make_set_layout(VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, VK_SHADER_STAGE_COMPUTE_BIT);
        draw_ = native_.make_graphics_pipeline(compile("draw.vert", vertex_text), compile("draw.frag", fragment_text),
                                               VK_FORMAT_R8G8B8A8_UNORM, uniform, sizeof(Push));
        dispatch_ = native_.make_compute_pipeline(compile("count.comp", compute_text), storage, sizeof(Push));
        for (std::uint32_t i = 0; i < group_count; ++i) {
            uniforms_.push_back(native_.make_buffer(256, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT));
            storages_.push_back(native_.make_buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
            std::memset(storages_.back().mapped, 0, 256);
        }
        uniform_sets_ = native_.make_sets(uniform, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, uniforms_);
        storage_sets_ = native_.make_sets(storage, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, storages_);
    }

    Times round() {
        const double begin = cpu_ms();
        const VkCommandBuffer commands = native_.begin_commands();  // Releases the last round.
        native_.begin_rendering(commands, target_, target_size, target_size);
        vk_.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw_.handle);
        for (std::uint32_t i = 0; i < draw_count; ++i) {
            const Push push{{static_cast<float>(i), 0, 0, 1}};
            vk_.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw_.layout, 0, 1,
                                      &uniform_sets_[i % group_count], 0, nullptr);
            vk_.CmdPushConstants(commands, draw_.layout, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0,
                                 sizeof(push), &push);
            vk_.CmdDraw(commands, 3, 1, 0, 0);
        }
        vk_.CmdEndRendering(commands);
        const double drawn = cpu_ms();
        vk_.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, dispatch_.handle);
        // Each dispatch changes what an earlier one wrote, 64 dispatches before.
        VkMemoryBarrier2 barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
        barrier.srcStageMask = barrier.dstStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
        barrier.srcAccessMask = VK_ACCESS_2_SHADER_WRITE_BIT;
        barrier.dstAccessMask = VK_ACCESS_2_SHADER_READ_BIT | VK_ACCESS_2_SHADER_WRITE_BIT;
        VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
        dependency.memoryBarrierCount = 1;
        dependency.pMemoryBarriers = &barrier;
        for (std::uint32_t i = 0; i < dispatch_count; ++i) {
            const std::uint32_t push[4] = {i, 0, 0, 0};
            vk_.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, dispatch_.layout, 0, 1,
                                      &storage_sets_[i % group_count], 0, nullptr);
            vk_.CmdPushConstants(commands, dispatch_.layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(push), push);
            vk_.CmdPipelineBarrier2(commands, &dependency);
            vk_.CmdDispatch(commands, 1, 1, 1);
        }
        const double dispatched = cpu_ms();
        native_.submit(commands);
        const double submitted = cpu_ms();
        native_.wait();
        return {drawn - begin, dispatched - drawn, submitted - dispatched};
    }

    [[nodiscard]] std::uint32_t counted(std::uint32_t group) const {
        std::uint32_t value = 0;
        std::memcpy(&value, storages_[group].mapped, 4);
        return value;
    }

  private:
    vulkan::test::NativeVulkan& native_;
    const vulkan::DeviceFunctions& vk_;
    vulkan::test::NativeImage target_;
    vulkan::test::NativePipeline draw_, dispatch_;
    std::vector<vulkan::test::NativeBuffer> uniforms_, storages_;
    std::vector<VkDescriptorSet> uniform_sets_, storage_sets_;
};

class ThroughRhi {
  public:
    explicit ThroughRhi(rhi::Device& device) : device_(device) {
        target_ = must(device.create_texture({.format = rhi::Format::rgba8_unorm,
                                              .width = target_size,
                                              .height = target_size,
                                              .usage = rhi::TextureUsage::color_target,
                                              .name = "target"}));
        const auto shader = [&](const char* path, const char* text, rhi::ShaderStage stage) {
            return must(device.create_shader({.spirv = compile(path, text), .stage = stage, .name = path}));
        };
        rhi::GraphicsPipelineDesc desc;
        desc.vertex = shader("draw.vert", vertex_text, rhi::ShaderStage::vertex);
        desc.fragment = shader("draw.frag", fragment_text, rhi::ShaderStage::fragment);
        desc.color_targets = {{.format = rhi::Format::rgba8_unorm}};
        draw_ = must(device.create_graphics_pipeline(desc));
        dispatch_ = must(
            device.create_compute_pipeline({.shader = shader("count.comp", compute_text, rhi::ShaderStage::compute)}));
        const auto uniform = must(device.bind_group_layout(draw_, 0));
        const auto storage = must(device.bind_group_layout(dispatch_, 0));
        const std::vector<std::byte> zero(256);
        for (std::uint32_t i = 0; i < group_count; ++i) {
            const auto make = [&](rhi::BufferUsage usage, rhi::BindGroupLayout layout) {
                const auto buffer = must(device.create_buffer({.size = 256, .usage = usage, .name = "buffer"}));
                must(device.write_buffer(buffer, std::span<const std::byte>(zero)));
                if (usage == rhi::BufferUsage::storage) storages_.push_back(buffer);
                return must(
                    device.create_bind_group({.layout = layout, .entries = {{.binding = 0, .buffer = buffer}}}));
            };
            uniform_groups_.push_back(make(rhi::BufferUsage::uniform, uniform));
            storage_groups_.push_back(make(rhi::BufferUsage::storage, storage));
        }
    }

    Times round() {
        const double begin = cpu_ms();
        rhi::CommandList list = device_.create_command_list("round");
        list.begin_render_pass({.color = {{.view = target_, .load = rhi::LoadOperation::clear}}, .name = "draws"});
        list.set_pipeline(draw_);
        for (std::uint32_t i = 0; i < draw_count; ++i) {
            list.set_bind_group(0, uniform_groups_[i % group_count]);
            list.set_push_constants(Push{{static_cast<float>(i), 0, 0, 1}});
            list.draw({.vertex_count = 3});
        }
        list.end_render_pass();
        const double drawn = cpu_ms();
        list.set_pipeline(dispatch_);
        for (std::uint32_t i = 0; i < dispatch_count; ++i) {
            const std::uint32_t push[4] = {i, 0, 0, 0};
            list.set_bind_group(0, storage_groups_[i % group_count]);
            list.set_push_constants(std::as_bytes(std::span(push)));
            list.dispatch({});
        }
        const double dispatched = cpu_ms();
        const rhi::Fence fence = must(device_.submit(std::move(list)));
        const double submitted = cpu_ms();
        must(device_.wait(fence));
        return {drawn - begin, dispatched - drawn, submitted - dispatched};
    }

    [[nodiscard]] std::uint32_t counted(std::uint32_t group) {
        const auto bytes = must(device_.read_buffer(storages_[group], 0, 4));
        std::uint32_t value = 0;
        std::memcpy(&value, bytes.data(), 4);
        return value;
    }

  private:
    rhi::Device& device_;
    rhi::Texture target_;
    rhi::GraphicsPipeline draw_;
    rhi::ComputePipeline dispatch_;
    std::vector<rhi::Buffer> storages_;
    std::vector<rhi::BindGroup> uniform_groups_, storage_groups_;
};

/// The least of all rounds: what the work costs when nothing else disturbs it.
double least(const std::vector<Times>& times, double (*value)(const Times&)) {
    double best = value(times.front());
    for (const Times& each : times) best = std::min(best, value(each));
    return best;
}

double median(const std::vector<Times>& times, double (*value)(const Times&)) {
    std::vector<double> values;
    for (const Times& each : times) values.push_back(value(each));
    std::ranges::sort(values);
    return values[values.size() / 2];
}

int run(int rounds, bool verbose) {
    const auto native = vulkan::test::NativeVulkan::create();
    std::vector<std::unique_ptr<rhi::Backend>> backends;
    backends.push_back(vulkan::make_backend());
    rhi::Instance instance(std::move(backends));
    auto device = instance.create_device({.backend = "vulkan", .validation = false});
    if (!native || !device) {
        std::printf("skipped: %s\n", device ? "no Vulkan 1.3 device" : device.error().message().c_str());
        return 0;
    }
    ByHand by_hand(*native);
    ThroughRhi through_rhi(**device);
    std::vector<Times> native_times, rhi_times;
    constexpr int warm_up = 3;
    for (int i = 0; i < rounds + warm_up; ++i) {
        // Who comes first alternates too.
        Times native_round, rhi_round;
        if (i % 2 == 0) native_round = by_hand.round();
        rhi_round = through_rhi.round();
        if (i % 2 != 0) native_round = by_hand.round();
        if (i < warm_up) continue;
        native_times.push_back(native_round);
        rhi_times.push_back(rhi_round);
        if (verbose)
            std::printf("round %2d: by hand %.3f ms, RHI %.3f ms\n", i - warm_up, native_round.begin_to_submit(),
                        rhi_round.begin_to_submit());
    }
    // Both must have done the same work.
    for (std::uint32_t group = 0; group < group_count; ++group) {
        if (by_hand.counted(group) == through_rhi.counted(group)) continue;
        std::fprintf(stderr, "the dispatches of the two did not do the same\n");
        return 1;
    }
    std::printf("%s, %u draws and %u dispatches, CPU time of the recording thread over %d alternating rounds\n",
                (*device)->adapter().name.c_str(), draw_count, dispatch_count, rounds);
    std::printf("%-20s %12s %12s %8s %24s\n", "", "by hand", "RHI", "ratio", "(ratio of the medians)");
    const auto row = [&](const char* name, double (*value)(const Times&)) {
        const double hand = least(native_times, value), ours = least(rhi_times, value);
        std::printf("%-20s %9.3f ms %9.3f ms %7.2fx %23.2fx\n", name, hand, ours, ours / hand,
                    median(rhi_times, value) / median(native_times, value));
        return ours / hand;
    };
    row("record draws", [](const Times& times) { return times.draws; });
    row("record dispatches", [](const Times& times) { return times.dispatches; });
    row("submit", [](const Times& times) { return times.submit; });
    const double ratio = row("begin to submit", [](const Times& times) { return times.begin_to_submit(); });
    if (ratio <= promised_ratio) return 0;
    std::printf("The RHI costs more than the promised %.2fx.\n", promised_ratio);
    return 1;
}

}  // namespace
}  // namespace nacre

int main(int count, char** arguments) {
    int rounds = 121;
    bool verbose = false;
    for (int i = 1; i < count; ++i) {
        const std::string argument = arguments[i];
        if (argument.starts_with("--rounds=")) rounds = std::max(1, std::atoi(argument.c_str() + 9));
        if (argument == "--verbose") verbose = true;
    }
    return nacre::run(rounds, verbose);
}
