// SPDX-License-Identifier: Apache-2.0
#include "measure/point_shader.h"

#include <fmt/format.h>

#include <cstring>

#include "core/embedded_file.h"
#include "materials/slab.h"
#include "materials/tables/anisotropy_table.h"
#include "materials/tables/interface_table.h"
#include "materials/tables/medium_table.h"
#include "rhi/shader_compiler.h"

namespace nacre::measure {

// Generated from the files named in measure/CMakeLists.txt.
std::span<const EmbeddedFile> embedded_files();

namespace {

constexpr const char* reading = R"(
uint place;
float next() { return uintBitsToFloat(points[place++]); }
vec2 next2() { float x = next(); return vec2(x, next()); }
vec3 next3() { float x = next(); float y = next(); return vec3(x, y, next()); }
void put(uint at, float value) { results[at] = value; }
void put3(uint at, vec3 value) {
    results[at] = value.x;
    results[at + 1u] = value.y;
    results[at + 2u] = value.z;
}
)";

std::string buffer_text(std::uint32_t binding, const char* access, const char* type, const char* name) {
    return fmt::format("layout(set = 0, binding = {}) {} buffer Buffer{} {{ {} {}[]; }};\n", binding, access, binding,
                       type, name);
}

}  // namespace

PointShader& PointShader::operator=(PointShader&& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(desc_, other.desc_);
    std::swap(module_, other.module_);
    std::swap(pipeline_, other.pipeline_);
    std::swap(buffers_, other.buffers_);
    std::swap(points_, other.points_);
    std::swap(results_, other.results_);
    std::swap(candidates_, other.candidates_);
    std::swap(parameters_, other.parameters_);
    std::swap(group_, other.group_);
    return *this;
}

PointShader::~PointShader() {
    if (device_ == nullptr) return;
    device_->destroy(group_);
    for (const rhi::Buffer& buffer : buffers_) device_->destroy(buffer);
    device_->destroy(pipeline_);
    device_->destroy(module_);
}

Expected<PointShader> PointShader::make(rhi::Device& device, const PointShaderDesc& desc) {
    PointShader shader;
    shader.device_ = &device;
    shader.desc_ = desc;
    const bool has_medium = desc.has_tables && (desc.features & materials::slab_medium) != 0;
    const bool has_anisotropy = desc.has_tables && (desc.features & materials::slab_anisotropy) != 0;
    std::string text = desc.defines;
    for (const materials::SlabFeature& feature : materials::slab_features())
        if ((desc.features & feature.bit) != 0) text += fmt::format("#define {} 1\n", feature.macro);
    text += fmt::format("#define POINT_WORDS {}u\n#define RESULT_WORDS {}u\n", desc.point_words, desc.result_words);
    text += "layout(local_size_x = 64) in;\n";
    text += buffer_text(0, "readonly", "uint", "points") + buffer_text(1, "writeonly", "float", "results");
    if (desc.has_tables) text += buffer_text(2, "readonly", "uint", "interface_words");
    if (has_medium) text += buffer_text(3, "readonly", "uint", "medium_words");
    if (has_anisotropy) text += buffer_text(4, "readonly", "uint", "anisotropy_words");
    if (desc.has_candidates) text += buffer_text(5, "readonly", "float", "candidates");
    if (desc.parameter_words != 0) text += buffer_text(6, "readonly", "float", "parameters");
    text += reading;
    if (desc.has_tables) text += "#include \"materials/closures/table_buffers.glsl\"\n";
    text += desc.text;

    rhi::ShaderCompiler compiler(
        {.embedded = {materials::embedded_files(), embedded_files()}, .debug_information = false});
    NACRE_TRY(const rhi::ShaderDesc compiled, compiler.compile({.path = desc.name + ".comp", .text = text}));
    NACRE_TRY(shader.module_, device.create_shader(compiled));
    NACRE_TRY(shader.pipeline_, device.create_compute_pipeline({.shader = shader.module_, .name = desc.name}));

    std::vector<rhi::BindGroupEntry> entries;
    const auto add = [&](std::uint32_t binding, std::uint64_t size) -> Expected<rhi::Buffer> {
        NACRE_TRY(const rhi::Buffer buffer,
                  device.create_buffer({.size = size, .usage = rhi::BufferUsage::storage, .name = desc.name}));
        shader.buffers_.push_back(buffer);
        entries.push_back({.binding = binding, .buffer = buffer});
        return buffer;
    };
    const auto add_table = [&](std::uint32_t binding, std::span<const std::uint16_t> words) -> Expected<void> {
        NACRE_TRY(const rhi::Buffer buffer, add(binding, words.size_bytes()));
        return device.write_buffer(buffer, words);
    };
    NACRE_TRY(shader.points_, add(0, std::uint64_t{4} * desc.point_words * desc.capacity));
    NACRE_TRY(shader.results_, add(1, std::uint64_t{4} * desc.result_words * desc.capacity));
    if (desc.has_tables) NACRE_CHECK(add_table(2, materials::interface_table()));
    if (has_medium) NACRE_CHECK(add_table(3, materials::medium_table()));
    if (has_anisotropy) NACRE_CHECK(add_table(4, materials::anisotropy_table()));
    if (desc.has_candidates) {
        NACRE_TRY(shader.candidates_, add(5, std::uint64_t{4} * desc.result_words * desc.capacity));
    }
    if (desc.parameter_words != 0) {
        NACRE_TRY(shader.parameters_, add(6, std::uint64_t{4} * desc.parameter_words));
    }
    NACRE_TRY(const rhi::BindGroupLayout layout, device.bind_group_layout(shader.pipeline_, 0));
    NACRE_TRY(shader.group_, device.create_bind_group({.layout = layout, .entries = entries, .name = desc.name}));
    return shader;
}

Expected<void> PointShader::run(std::span<const std::uint32_t> points, std::span<const float> candidates,
                                std::span<const float> parameters, std::uint32_t count, std::vector<float>& results) {
    NACRE_CHECK(device_->write_buffer(points_, points));
    if (desc_.has_candidates) NACRE_CHECK(device_->write_buffer(candidates_, candidates));
    if (desc_.parameter_words != 0) NACRE_CHECK(device_->write_buffer(parameters_, parameters));
    rhi::CommandList list = device_->create_command_list(desc_.name);
    list.set_pipeline(pipeline_);
    list.set_bind_group(0, group_);
    list.dispatch({(count + 63) / 64, 1, 1});
    NACRE_CHECK(device_->submit(std::move(list)));
    NACRE_TRY(const std::vector<std::byte> bytes,
              device_->read_buffer(results_, 0, std::uint64_t{4} * desc_.result_words * count));
    results.resize(static_cast<std::size_t>(count) * desc_.result_words);
    std::memcpy(results.data(), bytes.data(), results.size() * sizeof(float));
    return {};
}

}  // namespace nacre::measure
