// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/hostile/module_runner.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "tests/backends/cpu/differential/random.h"

namespace nacre::hostile {

using namespace rhi;
using differential::Random;

namespace {

// One buffer holds everything that is bound; what lies between may not change.
constexpr std::uint64_t arena_bytes = 32 * 1024, first_region = 4096, region_stride = 1024;
constexpr std::uint32_t region_count = 16;
constexpr std::uint32_t side = 8;  ///< Of textures and targets, pixels.
constexpr std::uint32_t kernel_invocations = 64;
constexpr std::uint32_t elements_of_unbounded = 3;

const char* const known_kernel = R"(
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer Result { uint result[]; };
shared uint numbers[64];
void main() {
    uint id = gl_LocalInvocationIndex;
    numbers[id] = id * 3u;
    barrier();
    uint sum = 0u;
    for (uint i = 0u; i <= id; ++i) sum += numbers[i];
    result[id] = sum;
}
)";
const char* const plain_fragment = R"(
layout(location = 0) out vec4 target;
void main() { target = vec4(1.0); }
)";

Expected<Shader> make_shader(Device& device, const std::string& path, const std::string& text) {
    static ShaderCompiler compiler({.debug_information = false});
    static std::map<std::string, ShaderDesc> compiled;
    if (const auto found = compiled.find(text); found != compiled.end()) return device.create_shader(found->second);
    NACRE_TRY(const ShaderDesc desc, compiler.compile({.path = path, .text = text}));
    compiled.emplace(text, desc);
    return device.create_shader(desc);
}

/// A vertex shader that covers the target and has the outputs that a fragment shader takes.
std::string vertex_for(const ShaderReflection& fragment) {
    std::string declarations, stores;
    for (const ReflectedVariable& input : fragment.inputs) {
        const bool is_float = input.kind == FormatKind::floating;
        const std::string scalar = is_float ? "float" : input.kind == FormatKind::uint ? "uint" : "int";
        const std::string vector = is_float ? "vec" : input.kind == FormatKind::uint ? "uvec" : "ivec";
        const std::string type = input.components == 1 ? scalar : fmt::format("{}{}", vector, input.components);
        for (std::uint32_t i = 0; i < input.locations; ++i) {
            const std::string name = fmt::format("v{}_{}", input.location + i, input.first_component);
            declarations += fmt::format("layout(location = {}, component = {}) {}out {} {};\n", input.location + i,
                                        input.first_component, is_float ? "" : "flat ", type, name);
            stores += fmt::format("    {} = {}(corner.x * 7.0 + float({}));\n", name, type, input.location);
        }
    }
    return declarations + R"(
void main() {
    vec2 corner = vec2(gl_VertexIndex % 3 == 1 ? 2.0 : 0.0, gl_VertexIndex % 3 == 2 ? 2.0 : 0.0);
)" + stores + "    gl_Position = vec4(corner * 2.0 - 1.0, 0.5, 1.0);\n}\n";
}

Format format_of(FormatKind kind) {
    return kind == FormatKind::uint   ? Format::rgba32_uint
           : kind == FormatKind::sint ? Format::rgba32_sint
                                      : Format::rgba32_float;
}

}  // namespace

struct ModuleRunner::Objects {
    Instance instance{all_backends()};
    std::unique_ptr<Device> device;
    /// The second has the same content for bindings that cannot be written: one buffer must not be both in one
    /// dispatch.
    Buffer arena, read_arena, kernel_result;
    ComputePipeline kernel;
    BindGroup kernel_group;
    Sampler sampler, nearest_sampler, comparison_sampler;
    Shader fragment;
    AccelerationStructure bottom, top;
    std::map<std::string, Texture> textures;
    std::map<std::string, Shader> vertices;
    std::vector<std::uint32_t> content;  ///< Of the arena before a run.
    std::vector<std::pair<std::uint64_t, std::uint64_t>> regions;  ///< Bound in this run: begin and end.

    // Of the run.
    Shader shader;
    ComputePipeline compute;
    GraphicsPipeline graphics;
    std::vector<BindGroup> groups;

    void end_run() {
        for (const BindGroup group : groups) device->destroy(group);
        groups.clear(), regions.clear();
        if (compute) device->destroy(std::exchange(compute, {}));
        if (graphics) device->destroy(std::exchange(graphics, {}));
        if (shader) device->destroy(std::exchange(shader, {}));
    }
    Expected<Texture> texture(const std::string& key, const TextureDesc& desc) {
        if (const auto found = textures.find(key); found != textures.end()) return found->second;
        NACRE_TRY(const Texture made, device->create_texture(desc));
        textures.emplace(key, made);
        return made;
    }
    Expected<BindGroupEntry> entry_for(const ReflectedBinding& binding, Random& random);
    Expected<TextureView> view_for(const ReflectedBinding& binding);
};

Expected<TextureView> ModuleRunner::Objects::view_for(const ReflectedBinding& binding) {
    const bool is_image = binding.type == BindingType::storage_image ||
                          binding.type == BindingType::readonly_storage_image ||
                          binding.type == BindingType::writeonly_storage_image;
    TextureDesc desc;
    desc.width = side, desc.height = side;
    desc.usage = (is_image ? TextureUsage::storage : TextureUsage::sampled) | TextureUsage::copy_destination;
    desc.format = is_image && binding.image_format != Format::undefined ? binding.image_format
                  : binding.depth_comparison                            ? Format::d32_float
                  : is_image && binding.sampled_kind == FormatKind::uint ? Format::r32_uint
                                                                         : format_of(binding.sampled_kind);
    desc.mips = is_image ? 1 : 3;
    TextureView view;
    view.dimension = binding.dimension;
    switch (binding.dimension) {
        case ViewDimension::d1: desc.dimension = TextureDimension::d1, desc.height = 1, desc.mips = 1; break;
        case ViewDimension::d1_array:
            desc.dimension = TextureDimension::d1, desc.height = 1, desc.mips = 1, desc.layers = 3;
            break;
        case ViewDimension::d2_array: desc.layers = 4, view.base_layer = 1, view.layer_count = 2; break;
        case ViewDimension::d3: desc.dimension = TextureDimension::d3, desc.depth = 4; break;
        case ViewDimension::cube: desc.dimension = TextureDimension::cube, desc.layers = 6; break;
        case ViewDimension::cube_array: desc.dimension = TextureDimension::cube, desc.layers = 12; break;
        default:
            desc.layers = binding.multisampled ? 1 : 3;
            if (!binding.multisampled) view.base_layer = 1, view.layer_count = 1;
            break;
    }
    if (binding.multisampled) {
        desc.samples = 4, desc.mips = 1;
        desc.usage = (is_image ? TextureUsage::storage : TextureUsage::sampled) | TextureUsage::color_target;
    }
    const std::string key = fmt::format("{} {} {} {} {}", static_cast<int>(desc.dimension),
                                        static_cast<int>(desc.format), desc.layers, desc.samples, is_image);
    NACRE_TRY(view.texture, texture(key, desc));
    return view;
}

Expected<BindGroupEntry> ModuleRunner::Objects::entry_for(const ReflectedBinding& binding, Random& random) {
    BindGroupEntry entry{.binding = binding.binding};
    switch (binding.type) {
        case BindingType::uniform_buffer:
        case BindingType::storage_buffer:
        case BindingType::readonly_storage_buffer: {
            const std::uint64_t region = std::min<std::uint64_t>(regions.size(), region_count - 1);
            entry.buffer = binding.type == BindingType::storage_buffer ? arena : read_arena;
            entry.offset = first_region + region * region_stride;
            entry.size = random.pick({std::uint64_t{16}, std::uint64_t{64}, std::uint64_t{256}, std::uint64_t{512}});
            // Some backends want all of a block; here what is not bound reads zero.
            if (binding.block_size > entry.size && random.chance(80))
                entry.size = std::min<std::uint64_t>((binding.block_size + 15) / 16 * 16, 512);
            regions.emplace_back(entry.offset, entry.offset + entry.size);
            break;
        }
        case BindingType::sampler: entry.sampler = random.chance(50) ? nearest_sampler : sampler; break;
        case BindingType::combined_texture_sampler:
            entry.sampler = binding.depth_comparison                         ? comparison_sampler
                            : binding.sampled_kind == FormatKind::floating ? sampler
                                                                           : nearest_sampler;
            [[fallthrough]];
        case BindingType::sampled_texture:
        case BindingType::storage_image:
        case BindingType::readonly_storage_image:
        case BindingType::writeonly_storage_image: {
            NACRE_TRY(entry.texture, view_for(binding));
            break;
        }
        case BindingType::uniform_texel_buffer:
        case BindingType::storage_texel_buffer:
        case BindingType::readonly_storage_texel_buffer:
        case BindingType::writeonly_storage_texel_buffer: {
            const bool is_written = binding.type == BindingType::storage_texel_buffer ||
                                    binding.type == BindingType::writeonly_storage_texel_buffer;
            const std::uint64_t region = std::min<std::uint64_t>(regions.size(), region_count - 1);
            entry.format = binding.image_format != Format::undefined ? binding.image_format
                           : random.chance(50) && binding.sampled_kind == FormatKind::uint
                               ? Format::r32_uint
                               : format_of(binding.sampled_kind);
            entry.buffer = is_written ? arena : read_arena;
            entry.offset = first_region + region * region_stride;
            entry.size = std::uint64_t{info(entry.format).block_bytes} * random.pick({1u, 3u, 8u, 16u});
            regions.emplace_back(entry.offset, entry.offset + entry.size);
            break;
        }
        case BindingType::acceleration_structure: entry.acceleration_structure = top; break;
    }
    return entry;
}

Expected<std::unique_ptr<ModuleRunner>> ModuleRunner::create(const std::string& spec) {
    std::unique_ptr<ModuleRunner> made(new ModuleRunner(spec));
    NACRE_CHECK(made->make_device());
    return made;
}

ModuleRunner::ModuleRunner(std::string spec) : spec_(std::move(spec)) {}
ModuleRunner::~ModuleRunner() = default;

Expected<void> ModuleRunner::make_device() {
    objects_ = std::make_unique<Objects>();
    Objects& at = *objects_;
    NACRE_TRY(at.device, at.instance.create_device(
                             {.backend = spec_, .validation = false, .debug_names = false, .name = "hostile"}));
    Device& device = *at.device;
    device.set_message_callback([](const Message&) {});
    Random random(7);
    at.content.resize(arena_bytes / 4);
    for (std::uint32_t& word : at.content)
        word = random.chance(50) ? static_cast<std::uint32_t>(random.below(40))
                                 : static_cast<std::uint32_t>(random.next());
    const auto usage = BufferUsage::storage | BufferUsage::uniform | BufferUsage::uniform_texel |
                       BufferUsage::storage_texel | BufferUsage::vertex | BufferUsage::copy_source |
                       BufferUsage::copy_destination;
    NACRE_TRY(at.arena, device.create_buffer({.size = arena_bytes, .usage = usage, .name = "arena"}));
    NACRE_CHECK(device.write_buffer(at.arena, std::span<const std::uint32_t>(at.content)));
    NACRE_TRY(at.read_arena, device.create_buffer({.size = arena_bytes, .usage = usage, .name = "read arena"}));
    NACRE_CHECK(device.write_buffer(at.read_arena, std::span<const std::uint32_t>(at.content)));
    NACRE_TRY(at.kernel_result,
              device.create_buffer({.size = kernel_invocations * 4, .usage = usage, .name = "known"}));
    NACRE_TRY(const Shader kernel, make_shader(device, "known.comp", known_kernel));
    NACRE_TRY(at.kernel, device.create_compute_pipeline({.shader = kernel, .name = "known"}));
    NACRE_TRY(const BindGroupLayout layout, device.bind_group_layout(at.kernel, 0));
    NACRE_TRY(at.kernel_group,
              device.create_bind_group(
                  {.layout = layout, .entries = {{.binding = 0, .buffer = at.kernel_result}}, .name = "known"}));
    NACRE_TRY(at.sampler, device.create_sampler({.max_anisotropy = 2.0f}));
    NACRE_TRY(at.nearest_sampler,
              device.create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest}));
    NACRE_TRY(at.comparison_sampler, device.create_sampler({.comparison = true}));
    NACRE_TRY(at.fragment, make_shader(device, "plain.frag", plain_fragment));

    constexpr std::array<float, 18> corners{-1, -1, 1, 3, -1, 1, -1, 3, 1, -1, -1, 2, 3, -1, 2, -1, 3, 2};
    NACRE_TRY(
        const Buffer vertices,
        device.create_buffer({.size = sizeof(corners), .usage = BufferUsage::acceleration_structure_input | usage}));
    NACRE_CHECK(device.write_buffer(vertices, std::span<const float>(corners)));
    NACRE_TRY(at.bottom, device.create_acceleration_structure(
                             {.geometries = {{.primitive_count = 2, .vertex_count = 6}}, .name = "bottom"}));
    NACRE_TRY(at.top, device.create_acceleration_structure(
                          {.level = AccelerationStructureLevel::top, .max_instances = 2, .name = "top"}));
    CommandList list = device.create_command_list("build");
    const std::array<GeometrySource, 1> sources{{{.vertices = vertices}}};
    list.build_acceleration_structure(at.bottom, sources);
    const std::array<AccelerationStructureInstance, 2> instances{
        {{.bottom_level = at.bottom}, {.bottom_level = at.bottom, .flags = InstanceFlags::force_no_opaque}}};
    list.build_acceleration_structure(at.top, instances);
    NACRE_TRY(const Fence fence, device.submit(std::move(list)));
    return device.wait(fence);
}

bool ModuleRunner::is_sound() {
    Objects& at = *objects_;
    const auto failed = [&](const Error& error) {
        reason_ = "the device does not work afterwards: " + error.message();
        return false;
    };
    for (const Buffer buffer : {at.arena, at.read_arena}) {
        const auto bytes = at.device->read_buffer(buffer);
        if (!bytes) return failed(bytes.error());
        std::vector<std::uint32_t> words(arena_bytes / 4);
        std::memcpy(words.data(), bytes->data(), arena_bytes);
        for (std::uint64_t word = 0; word < words.size(); ++word) {
            if (words[word] == at.content[word]) continue;
            // Validators let writes pass to what is said to be only read: both buffers may change where they are bound.
            const auto holds = [&](const auto& region) { return word * 4 >= region.first && word * 4 < region.second; };
            if (std::ranges::any_of(at.regions, holds)) continue;
            reason_ = fmt::format("byte {} of a buffer was not bound and has changed", word * 4);
            return false;
        }
    }
    CommandList list = at.device->create_command_list("known");
    list.set_pipeline(at.kernel);
    list.set_bind_group(0, at.kernel_group);
    list.dispatch({});
    const auto fence = at.device->submit(std::move(list));
    if (!fence) return failed(fence.error());
    if (const auto done = at.device->wait(*fence); !done) return failed(done.error());
    const auto known = at.device->read_buffer(at.kernel_result);
    if (!known) return failed(known.error());
    std::array<std::uint32_t, kernel_invocations> numbers{};
    std::memcpy(numbers.data(), known->data(), sizeof(numbers));
    for (std::uint32_t i = 0; i < kernel_invocations; ++i)
        if (numbers[i] != 3 * i * (i + 1) / 2) {
            reason_ = fmt::format("a known kernel gives {} for {} afterwards", numbers[i], i);
            return false;
        }
    const std::vector<std::byte> zeros(kernel_invocations * 4);
    if (const auto cleared = at.device->write_buffer(at.kernel_result, std::span<const std::byte>(zeros)); !cleared)
        return failed(cleared.error());
    return true;
}

Expected<void> ModuleRunner::try_run(const std::vector<std::uint32_t>& words, ShaderStage stage, std::uint64_t seed) {
    Objects& at = *objects_;
    Device& device = *at.device;
    Random random(seed);
    for (const Buffer buffer : {at.arena, at.read_arena})
        NACRE_CHECK(device.write_buffer(buffer, std::span<const std::uint32_t>(at.content)));
    NACRE_TRY(at.shader, device.create_shader({.spirv = words, .stage = stage, .name = "hostile"}));
    NACRE_TRY(const ShaderReflection reflection, device.reflection(at.shader));
    std::vector<ColorAttachment> colors;
    DepthStencilAttachment depth;
    if (stage == ShaderStage::compute) {
        NACRE_TRY(at.compute, device.create_compute_pipeline({.shader = at.shader, .name = "hostile"}));
    } else {
        GraphicsPipelineDesc desc{.vertex = at.shader, .fragment = at.fragment, .name = "hostile"};
        const auto add_target = [&](Format format) -> Expected<void> {
            const std::string key = fmt::format("target {} {}", static_cast<int>(format), colors.size());
            NACRE_TRY(const Texture target,
                      at.texture(
                          key, {.format = format, .width = side, .height = side, .usage = TextureUsage::color_target}));
            colors.push_back({.view = target, .load = LoadOperation::clear});
            const bool is_written = stage == ShaderStage::vertex ||
                                    std::ranges::any_of(reflection.outputs, [&](const ReflectedVariable& output) {
                                        return output.index == 0 && colors.size() > output.location &&
                                               colors.size() <= output.location + output.locations;
                                    });
            desc.color_targets.push_back(
                {.format = format, .write_mask = static_cast<std::uint8_t>(is_written ? 15 : 0)});
            return {};
        };
        if (stage == ShaderStage::fragment) {
            desc.fragment = at.shader;
            const std::string text = vertex_for(reflection);
            if (const auto found = at.vertices.find(text); found != at.vertices.end()) {
                desc.vertex = found->second;
            } else {
                NACRE_TRY(desc.vertex, make_shader(device, "counterpart.vert", text));
                at.vertices.emplace(text, desc.vertex);
            }
            std::uint32_t targets = 0;
            for (const ReflectedVariable& output : reflection.outputs)
                targets = std::max(targets, output.location + output.locations);
            for (std::uint32_t i = 0; i < std::min(targets, 8u); ++i) {
                FormatKind kind = FormatKind::floating;
                for (const ReflectedVariable& output : reflection.outputs)
                    if (output.location == i) kind = output.kind;
                NACRE_CHECK(add_target(format_of(kind)));
            }
            if (reflection.writes_depth) {
                NACRE_TRY(const Texture target, at.texture("depth", {.format = Format::d32_float,
                                                                     .width = side,
                                                                     .height = side,
                                                                     .usage = TextureUsage::depth_target}));
                depth = {.view = target, .depth_load = LoadOperation::clear};
                desc.depth_stencil = {.format = Format::d32_float,
                                      .depth_test = true,
                                      .depth_write = true,
                                      .depth_compare = CompareOperation::always};
            }
        } else {
            NACRE_CHECK(add_target(Format::rgba8_unorm));
            for (const ReflectedVariable& input : reflection.inputs)
                for (std::uint32_t i = 0; i < input.locations; ++i)
                    desc.vertex_attributes.push_back(
                        {.location = input.location + i, .buffer = 0, .offset = 0, .format = format_of(input.kind)});
            if (!desc.vertex_attributes.empty()) desc.vertex_buffers = {{.stride = 16}};
            desc.topology = random.pick({Topology::triangle_list, Topology::point_list, Topology::line_strip});
        }
        NACRE_TRY(at.graphics, device.create_graphics_pipeline(desc));
    }

    std::map<std::uint32_t, std::vector<BindGroupEntry>> entries;
    for (const ReflectedBinding& binding : reflection.bindings) {
        const std::uint32_t count = binding.count == 0 ? elements_of_unbounded : std::min(binding.count, 64u);
        for (std::uint32_t i = 0; i < count; ++i) {
            NACRE_TRY(BindGroupEntry entry, at.entry_for(binding, random));
            entry.element = i;
            entries[binding.set].push_back(entry);
        }
    }
    CommandList list = device.create_command_list("hostile");
    if (stage != ShaderStage::compute)
        list.begin_render_pass({.color = colors, .depth_stencil = depth, .name = "hostile"});
    if (at.compute) list.set_pipeline(at.compute);
    else list.set_pipeline(at.graphics);
    for (const auto& [set, of_set] : entries) {
        NACRE_TRY(const BindGroupLayout layout,
                  at.compute ? device.bind_group_layout(at.compute, set) : device.bind_group_layout(at.graphics, set));
        NACRE_TRY(const BindGroup group,
                  device.create_bind_group({.layout = layout, .entries = of_set, .name = "hostile"}));
        at.groups.push_back(group);
        list.set_bind_group(set, group);
    }
    if (reflection.push_constant_bytes) {
        std::vector<std::byte> bytes(reflection.push_constant_bytes);
        std::memcpy(bytes.data(), at.content.data(), std::min<std::size_t>(bytes.size(), 256));
        list.set_push_constants(std::span<const std::byte>(bytes));
    }
    if (at.compute) {
        list.dispatch({.x = static_cast<std::uint32_t>(random.between(1, 3)),
                       .y = static_cast<std::uint32_t>(random.between(1, 2))});
    } else {
        if (stage == ShaderStage::vertex) list.set_vertex_buffer(0, at.arena, first_region);
        list.draw({.vertex_count = stage == ShaderStage::vertex ? 33u : 3u, .instance_count = 2});
        list.end_render_pass();
    }
    NACRE_TRY(const Fence fence, device.submit(std::move(list)));
    return device.wait(fence);
}

Outcome ModuleRunner::run(const std::vector<std::uint32_t>& words, ShaderStage stage, std::uint64_t seed) {
    const Expected<void> done = try_run(words, stage, seed);
    reason_ = done ? std::string() : done.error().message();
    if (!done && done.error().code == ErrorCode::device_lost) {
        const std::string why = reason_;
        // The promise: named, and another device works.
        if (why.find("'hostile'") == std::string::npos) {
            reason_ = "the device was lost, and the error does not name the shader: " + why;
            return Outcome::broken;
        }
        if (const auto made = make_device(); !made) {
            reason_ = "no device can be made after one was lost: " + made.error().message();
            return Outcome::broken;
        }
        if (!is_sound()) return Outcome::broken;
        reason_ = why;
        return Outcome::lost;
    }
    const bool is_internal = !done && done.error().code == ErrorCode::internal;
    const std::string why = reason_;
    // Where it was refused, nothing was bound and nothing may have changed.
    const bool sound = !is_internal && is_sound();
    objects_->end_run();
    if (!sound) return Outcome::broken;
    reason_ = why;
    return done ? Outcome::ran : Outcome::refused;
}

}  // namespace nacre::hostile
