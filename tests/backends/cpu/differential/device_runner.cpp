// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/differential/device_runner.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <mutex>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <spirv-tools/libspirv.hpp>
#include <spirv-tools/optimizer.hpp>

#include "rhi/reflection.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "tests/backends/cpu/differential/random.h"

namespace nacre::differential {

using namespace rhi;

namespace {

constexpr std::uint32_t side = 16;                ///< Of textures and targets, pixels.
constexpr std::uint32_t item_bytes = 128 * 1024;
constexpr std::uint32_t result_bytes = workgroups * most_invocations * result_words * 4;
constexpr std::uint32_t pair_bytes = workgroups * most_invocations * approximate_pairs * 8;

/// The interface of the other stage of a pipeline.
const char* const plain_vertex = R"(
layout(location = 0) flat out uvec4 flat_input;
layout(location = 1) out vec2 ramp;
void main() {
    vec2 corner = vec2(gl_VertexIndex == 1 ? 2.0 : 0.0, gl_VertexIndex == 2 ? 2.0 : 0.0);
    flat_input = uvec4(3u, 5u, 0x80000001u, 9u);
    ramp = corner * 16.0 + 0.25;
    gl_Position = vec4(corner * 2.0 - 1.0, 0.5, 1.0);
}
)";
const char* const plain_fragment = R"(
layout(location = 0) flat in uvec4 color;
layout(location = 0) out uvec4 target;
void main() { target = color; }
)";

ShaderStage kind_of(Stage stage) {
    return stage == Stage::compute    ? ShaderStage::compute
           : stage == Stage::fragment ? ShaderStage::fragment
                                      : ShaderStage::vertex;
}

bool may_be_fused(std::uint32_t op) {
    // FNegate, FAdd, FSub, FMul, FDiv, and the products of vectors and matrices up to Dot.
    return op == 127 || op == 129 || op == 131 || op == 133 || op == 136 || (op >= 142 && op <= 148);
}

}  // namespace

Expected<std::vector<std::uint32_t>> compile(const std::string& text, Stage stage, bool with_lines) {
    static ShaderCompiler plain({.debug_information = false}), debuggable({});
    ShaderCompiler& compiler = with_lines ? debuggable : plain;
    const char* path = stage == Stage::compute    ? "generated.comp"
                       : stage == Stage::fragment ? "generated.frag"
                                                  : "generated.vert";
    NACRE_TRY(const ShaderDesc desc, compiler.compile({.path = path, .text = text}));
    const std::vector<std::uint32_t>& words = desc.spirv;
    std::vector<std::uint32_t> decorations;
    std::size_t annotations = 0;
    for (std::size_t at = 5; at < words.size() && words[at] >> 16; at += words[at] >> 16) {
        const std::uint32_t op = words[at] & 0xffff;
        if (annotations == 0 && op >= 19 && op <= 73) annotations = at;  // The first type or decoration.
        if (may_be_fused(op)) decorations.insert(decorations.end(), {(3u << 16) | 71u, words[at + 2], 42u});
    }
    std::vector<std::uint32_t> result(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(annotations));
    result.insert(result.end(), decorations.begin(), decorations.end());
    result.insert(result.end(), words.begin() + static_cast<std::ptrdiff_t>(annotations), words.end());
    return result;
}

std::vector<std::uint32_t> optimized(const std::vector<std::uint32_t>& words, Passes passes) {
    spvtools::Optimizer optimizer(SPV_ENV_VULKAN_1_1);
    if (passes == Passes::performance) {
        optimizer.RegisterPerformancePasses();
    } else {
        optimizer.RegisterPass(spvtools::CreateMergeReturnPass())
            .RegisterPass(spvtools::CreateInlineExhaustivePass())
            .RegisterPass(spvtools::CreatePrivateToLocalPass())
            .RegisterPass(spvtools::CreateScalarReplacementPass(100))
            .RegisterPass(spvtools::CreateLocalAccessChainConvertPass())
            .RegisterPass(spvtools::CreateLocalMultiStoreElimPass());
        // One of those that change loops: several behind one another crash now and then.
        switch (words.size() % 5) {
            case 0: optimizer.RegisterPass(spvtools::CreateLoopPeelingPass()); break;
            case 1: optimizer.RegisterPass(spvtools::CreateLoopUnswitchPass()); break;
            case 2: optimizer.RegisterPass(spvtools::CreateLoopUnrollPass(false, 2)); break;
            case 3: optimizer.RegisterPass(spvtools::CreateLoopInvariantCodeMotionPass()); break;
            default:
                optimizer.RegisterPass(spvtools::CreateIfConversionPass())
                    .RegisterPass(spvtools::CreateCodeSinkingPass());
                break;
        }
    }
    spvtools::OptimizerOptions options;
    options.set_run_validator(false);
    std::vector<std::uint32_t> result;
    // Now and then the passes leave a module that is no longer valid.
    const bool is_valid = optimizer.Run(words.data(), words.size(), &result, options) &&
                          spvtools::SpirvTools(SPV_ENV_VULKAN_1_1).Validate(result);
    return is_valid ? result : words;
}

std::string Output::place_of(std::size_t word, Stage stage) {
    if (stage != Stage::compute)
        return fmt::format("pixel ({}, {}) component {}", word / 4 % side, word / 4 / side, word % 4);
    if (word < result_bytes / 4)
        return fmt::format("result of invocation {}, word {}", word / result_words, word % result_words);
    word -= result_bytes / 4;
    if (word < item_bytes / 4) return fmt::format("items, byte {}", word * 4);
    word -= item_bytes / 4;
    if (word < 24) return fmt::format("counter {}", word);
    return fmt::format("texel {}", word - 24);
}

struct DeviceRunner::Objects {
    // Before the device, which may have something to say until its end.
    std::mutex messages_mutex;
    std::vector<std::string> messages;
    Instance instance{all_backends()};
    std::unique_ptr<Device> device;
    Buffer input, numbers, reals, result, items, counters, pairs, attributes;
    Texture texture, texels, target;
    Sampler sampler;
    Shader vertex, fragment;
    std::vector<std::uint32_t> first_items, first_texels;
};

DeviceRunner::DeviceRunner(std::unique_ptr<Objects> objects) : objects_(std::move(objects)) {}
DeviceRunner::~DeviceRunner() = default;

std::vector<std::string> DeviceRunner::take_messages() {
    const std::scoped_lock lock(objects_->messages_mutex);
    return std::exchange(objects_->messages, {});
}

Expected<std::unique_ptr<DeviceRunner>> DeviceRunner::create(const std::string& spec) {
    auto made = std::make_unique<Objects>();
    NACRE_TRY(made->device, made->instance.create_device(
                                {.backend = spec, .validation = false, .debug_names = false, .name = "differential"}));
    Device& device = *made->device;
    device.set_message_callback([objects = made.get()](const Message& message) {
        const std::scoped_lock lock(objects->messages_mutex);
        objects->messages.push_back(message.text);
    });
    Random random(4711);
    std::vector<std::uint32_t> input(256);
    for (std::uint32_t& word : input) {
        word = static_cast<std::uint32_t>(random.next());
        if (random.chance(40)) word &= 15;
        if (random.chance(5)) word = random.pick({0u, ~0u, 0x80000000u, 0x7fffffffu});
    }
    std::vector<std::uint32_t> numbers(64);
    for (std::uint32_t& word : numbers) word = static_cast<std::uint32_t>(random.below(60) - 20);
    const auto whole = [&] { return std::bit_cast<std::uint32_t>(static_cast<float>(random.below(64))); };
    std::vector<std::uint32_t> reals(256);
    for (std::uint32_t& word : reals) word = whole();
    made->first_items.resize(item_bytes / 4);
    for (std::uint32_t& word : made->first_items) word = whole();
    std::vector<std::uint32_t> texels(side * side * 4);
    for (std::uint32_t& word : texels) word = static_cast<std::uint32_t>(random.next()) >> random.below(31);
    made->first_texels.assign(texels.begin(), texels.begin() + side * side);
    std::vector<std::uint32_t> attributes(side * side * 4);
    for (std::uint32_t& word : attributes) word = static_cast<std::uint32_t>(random.next()) >> random.below(31);

    const auto storage = BufferUsage::storage | BufferUsage::copy_source | BufferUsage::copy_destination;
    const auto buffer = [&](Buffer& where, std::uint64_t size, BufferUsage usage,
                            std::span<const std::uint32_t> content) -> Expected<void> {
        NACRE_TRY(where, device.create_buffer({.size = size, .usage = usage, .name = "buffer"}));
        if (!content.empty()) NACRE_CHECK(device.write_buffer(where, content));
        return {};
    };
    NACRE_CHECK(buffer(made->input, input.size() * 4, storage, input));
    NACRE_CHECK(
        buffer(made->numbers, numbers.size() * 4, BufferUsage::uniform | BufferUsage::copy_destination, numbers));
    NACRE_CHECK(buffer(made->reals, reals.size() * 4, BufferUsage::uniform | BufferUsage::copy_destination, reals));
    NACRE_CHECK(buffer(made->result, result_bytes, storage, {}));
    NACRE_CHECK(buffer(made->items, item_bytes, storage, {}));
    NACRE_CHECK(buffer(made->counters, 24 * 4, storage, {}));
    NACRE_CHECK(buffer(made->pairs, pair_bytes, storage, {}));
    NACRE_CHECK(buffer(made->attributes, attributes.size() * 4, BufferUsage::vertex | BufferUsage::copy_destination,
                       attributes));
    const auto copied = TextureUsage::copy_source | TextureUsage::copy_destination;
    NACRE_TRY(
        made->texture,
        device.create_texture(
            {.format = Format::rgba32_uint, .width = side, .height = side, .usage = TextureUsage::sampled | copied}));
    NACRE_CHECK(device.write_texture(made->texture, std::as_bytes(std::span(texels))));
    NACRE_TRY(
        made->texels,
        device.create_texture(
            {.format = Format::r32_uint, .width = side, .height = side, .usage = TextureUsage::storage | copied}));
    NACRE_TRY(made->target, device.create_texture({.format = Format::rgba32_uint,
                                                   .width = side,
                                                   .height = side,
                                                   .usage = TextureUsage::color_target | copied}));
    NACRE_TRY(made->sampler,
              device.create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest}));
    NACRE_TRY(std::vector<std::uint32_t> vertex, compile(plain_vertex, Stage::vertex));
    NACRE_TRY(made->vertex,
              device.create_shader({.spirv = std::move(vertex), .stage = ShaderStage::vertex, .name = "plain vertex"}));
    NACRE_TRY(std::vector<std::uint32_t> fragment, compile(plain_fragment, Stage::fragment));
    NACRE_TRY(
        made->fragment,
        device.create_shader({.spirv = std::move(fragment), .stage = ShaderStage::fragment, .name = "plain fragment"}));
    return std::unique_ptr<DeviceRunner>(new DeviceRunner(std::move(made)));
}

Expected<Output> DeviceRunner::run(const std::vector<std::uint32_t>& words, Stage stage) {
    Objects& at = *objects_;
    Device& device = *at.device;
    const auto entries_of = [&](BindGroupLayout layout) -> Expected<std::vector<BindGroupEntry>> {
        NACRE_TRY(const BindGroupLayoutDesc desc, device.describe(layout));
        std::vector<BindGroupEntry> entries;
        for (const BindingLayout& binding : desc.bindings) {
            BindGroupEntry entry{.binding = binding.binding};
            switch (binding.binding) {
                case 0: entry.buffer = at.input; break;
                case 1: entry.buffer = at.numbers; break;
                case 2: entry.buffer = at.reals; break;
                case 3: entry.texture = at.texture, entry.sampler = at.sampler; break;
                case 4: entry.buffer = at.result; break;
                case 5: entry.buffer = at.items; break;
                case 6: entry.buffer = at.counters; break;
                case 7: entry.buffer = at.pairs; break;
                default: entry.texture = at.texels; break;
            }
            entries.push_back(entry);
        }
        return entries;
    };
    // Passes may leave nothing that needs one.
    NACRE_TRY(const ShaderReflection reflection, reflect(words, kind_of(stage)));
    const auto group_of = [&](auto pipeline) -> Expected<std::optional<BindGroup>> {
        if (reflection.bindings.empty()) return std::nullopt;
        NACRE_TRY(const BindGroupLayout layout, device.bind_group_layout(pipeline, 0));
        NACRE_TRY(std::vector<BindGroupEntry> entries, entries_of(layout));
        NACRE_TRY(const BindGroup group,
                  device.create_bind_group({.layout = layout, .entries = std::move(entries), .name = "generated"}));
        return group;
    };
    NACRE_TRY(const Shader shader,
              device.create_shader({.spirv = words, .stage = kind_of(stage), .name = "generated"}));
    Output output;
    const auto append = [&](const std::vector<std::byte>& bytes) {
        const std::size_t first = output.words.size();
        output.words.resize(first + bytes.size() / 4);
        std::memcpy(output.words.data() + first, bytes.data(), bytes.size());
    };
    CommandList list = device.create_command_list("generated");
    if (stage == Stage::compute) {
        NACRE_TRY(const ComputePipeline pipeline,
                  device.create_compute_pipeline({.shader = shader, .name = "generated"}));
        const auto empty = [&](Buffer buffer, std::size_t bytes) {
            return device.write_buffer(buffer, std::span<const std::byte>(std::vector<std::byte>(bytes)));
        };
        NACRE_CHECK(empty(at.result, result_bytes));
        NACRE_CHECK(empty(at.counters, 24 * 4));
        NACRE_CHECK(empty(at.pairs, pair_bytes));
        NACRE_CHECK(device.write_buffer(at.items, std::span<const std::uint32_t>(at.first_items)));
        NACRE_CHECK(device.write_texture(at.texels, std::as_bytes(std::span(at.first_texels))));
        NACRE_TRY(const std::optional<BindGroup> group, group_of(pipeline));
        list.set_pipeline(pipeline);
        if (group) list.set_bind_group(0, *group);
        list.dispatch({.x = workgroups});
        NACRE_TRY(const Fence fence, device.submit(std::move(list)));
        NACRE_CHECK(device.wait(fence));
        for (const Buffer buffer : {at.result, at.items, at.counters}) {
            NACRE_TRY(const std::vector<std::byte> bytes, device.read_buffer(buffer));
            append(bytes);
        }
        NACRE_TRY(const std::vector<std::byte> texels, device.read_texture(at.texels));
        append(texels);
        NACRE_TRY(const std::vector<std::byte> pairs, device.read_buffer(at.pairs));
        output.pairs.resize(pairs.size() / 4);
        std::memcpy(output.pairs.data(), pairs.data(), pairs.size());
        if (group) device.destroy(*group);
        device.destroy(pipeline);
    } else {
        GraphicsPipelineDesc desc{.vertex = stage == Stage::vertex ? shader : at.vertex,
                                  .fragment = stage == Stage::fragment ? shader : at.fragment,
                                  .color_targets = {{.format = Format::rgba32_uint}},
                                  .name = "generated"};
        if (stage == Stage::vertex) {
            desc.topology = Topology::point_list;
            desc.vertex_buffers = {{.stride = 16}};
            desc.vertex_attributes = {{.location = 0, .buffer = 0, .offset = 0, .format = Format::rgba32_uint}};
        }
        NACRE_TRY(const GraphicsPipeline pipeline, device.create_graphics_pipeline(desc));
        NACRE_TRY(const std::optional<BindGroup> group, group_of(pipeline));
        ColorAttachment attachment{.view = at.target, .load = LoadOperation::clear};
        attachment.clear.uint = {17, 18, 19, 20};
        list.begin_render_pass({.color = {attachment}});
        list.set_pipeline(pipeline);
        if (group) list.set_bind_group(0, *group);
        if (stage == Stage::vertex) list.set_vertex_buffer(0, at.attributes);
        list.draw({.vertex_count = stage == Stage::vertex ? side * side : 3});
        list.end_render_pass();
        NACRE_TRY(const Fence fence, device.submit(std::move(list)));
        NACRE_CHECK(device.wait(fence));
        NACRE_TRY(const std::vector<std::byte> pixels, device.read_texture(at.target));
        append(pixels);
        if (group) device.destroy(*group);
        device.destroy(pipeline);
    }
    device.destroy(shader);
    return output;
}

}  // namespace nacre::differential
