// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/program.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>

#include "backends/gl/bind_group.h"
#include "core/hash.h"
#include "core/log.h"

namespace nacre::gl {
namespace {

/// What is kept on disk: the translations, and the driver's binary where it gives one.
struct StoredProgram {
    std::vector<Translation> stages;
    std::uint32_t binary_format = 0;
    std::vector<std::byte> binary;
};

class Writer {
  public:
    std::vector<std::byte> bytes;
    void number(std::uint32_t value) {
        const auto* raw = reinterpret_cast<const std::byte*>(&value);
        bytes.insert(bytes.end(), raw, raw + sizeof value);
    }
    void text(std::string_view value) {
        number(static_cast<std::uint32_t>(value.size()));
        const auto* raw = reinterpret_cast<const std::byte*>(value.data());
        bytes.insert(bytes.end(), raw, raw + value.size());
    }
};

/// Reads what `Writer` wrote; any input is safe, `failed` tells.
class Reader {
  public:
    explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}
    bool failed = false;
    std::uint32_t number() {
        std::uint32_t value = 0;
        if (bytes_.size() < sizeof value) return failed = true, 0;
        std::memcpy(&value, bytes_.data(), sizeof value);
        bytes_ = bytes_.subspan(sizeof value);
        return value;
    }
    std::span<const std::byte> block() {
        const std::uint32_t size = number();
        if (bytes_.size() < size) return failed = true, std::span<const std::byte>{};
        const auto result = bytes_.first(size);
        bytes_ = bytes_.subspan(size);
        return result;
    }
    std::string text() {
        const auto raw = block();
        return {reinterpret_cast<const char*>(raw.data()), raw.size()};
    }
    /// A count of items of at least `item_bytes` each.
    std::uint32_t count(std::size_t item_bytes) {
        const std::uint32_t value = number();
        if (value > bytes_.size() / item_bytes) return failed = true, 0;
        return value;
    }

  private:
    std::span<const std::byte> bytes_;
};

std::vector<std::byte> store(const StoredProgram& program) {
    Writer writer;
    writer.number(static_cast<std::uint32_t>(program.stages.size()));
    for (const Translation& stage : program.stages) {
        writer.text(stage.source);
        writer.number(stage.flat_inputs);
        writer.number(static_cast<std::uint32_t>(stage.slots.size()));
        for (const SlotRange& slot : stage.slots)
            for (std::uint32_t value : {static_cast<std::uint32_t>(slot.kind), slot.set, slot.binding, slot.count,
                                        slot.first, std::uint32_t{slot.readable}, std::uint32_t{slot.writable}})
                writer.number(value);
        writer.number(static_cast<std::uint32_t>(stage.textures.size()));
        for (const TextureRange& range : stage.textures)
            for (std::uint32_t value : {range.set, range.binding, range.count, range.sampler_set, range.sampler_binding,
                                        range.first, std::uint32_t{range.combined}})
                writer.number(value);
        writer.number(static_cast<std::uint32_t>(stage.push_constants.size()));
        for (const PushConstantLeaf& leaf : stage.push_constants) {
            writer.text(leaf.name);
            for (std::uint32_t value : {static_cast<std::uint32_t>(leaf.scalar), leaf.offset, leaf.components,
                                        leaf.columns, leaf.count, leaf.array_stride, leaf.matrix_stride,
                                        std::uint32_t{leaf.row_major}})
                writer.number(value);
        }
    }
    writer.number(program.binary_format);
    writer.text({reinterpret_cast<const char*>(program.binary.data()), program.binary.size()});
    return std::move(writer.bytes);
}

std::optional<StoredProgram> load(std::span<const std::byte> bytes) {
    Reader reader(bytes);
    StoredProgram program;
    program.stages.resize(reader.count(20));
    for (Translation& stage : program.stages) {
        stage.source = reader.text();
        stage.flat_inputs = reader.number() != 0;
        stage.slots.resize(reader.count(28));
        for (SlotRange& slot : stage.slots) {
            slot.kind = static_cast<SlotRange::Kind>(reader.number());
            slot.set = reader.number(), slot.binding = reader.number(), slot.count = reader.number();
            slot.first = reader.number();
            slot.readable = reader.number() != 0, slot.writable = reader.number() != 0;
        }
        stage.textures.resize(reader.count(28));
        for (TextureRange& range : stage.textures) {
            range.set = reader.number(), range.binding = reader.number(), range.count = reader.number();
            range.sampler_set = reader.number(), range.sampler_binding = reader.number();
            range.first = reader.number();
            range.combined = reader.number() != 0;
        }
        stage.push_constants.resize(reader.count(36));
        for (PushConstantLeaf& leaf : stage.push_constants) {
            leaf.name = reader.text();
            leaf.scalar = static_cast<PushConstantLeaf::Scalar>(reader.number());
            leaf.offset = reader.number(), leaf.components = reader.number(), leaf.columns = reader.number();
            leaf.count = reader.number(), leaf.array_stride = reader.number();
            leaf.matrix_stride = reader.number();
            leaf.row_major = reader.number() != 0;
        }
    }
    program.binary_format = reader.number();
    const auto binary = reader.block();
    program.binary.assign(binary.begin(), binary.end());
    if (reader.failed) return std::nullopt;
    return program;
}

Hash128 key_of(const Traits& traits, std::span<rhi::BackendShader* const> stages,
               std::span<const rhi::SpecializationConstant> specialization) {
    Hasher hasher;
    hasher.add("gl program").add(translation_version).add(traits.renderer).add(traits.vendor).add(traits.version_text);
    hasher.add(traits.es).add(traits.version).add(traits.clip_control).add(traits.shader_base_instance);
    for (const rhi::BackendShader* stage : stages) {
        hasher.add(stage->reflection.stage).add(stage->entry_point);
        hasher.add_bytes(std::as_bytes(std::span(stage->spirv)));
    }
    for (const rhi::SpecializationConstant& constant : specialization) {
        hasher.add(constant.id);
        std::visit([&](auto value) { hasher.add(value); }, constant.value);
    }
    return hasher.finish();
}

GLenum stage_name(rhi::ShaderStage stage) {
    return stage == rhi::ShaderStage::vertex     ? GL_VERTEX_SHADER
           : stage == rhi::ShaderStage::fragment ? GL_FRAGMENT_SHADER
                                                 : GL_COMPUTE_SHADER;
}

/// Compiles and links on the worker thread.
Expected<void> build(const Driver& driver, GLuint program, std::span<rhi::BackendShader* const> stages,
                     std::span<const Translation> translations) {
    const Functions& gl = driver.gl;
    std::array<char, 4096> log{};
    for (std::size_t i = 0; i < stages.size(); ++i) {
        const GLuint shader = gl.CreateShader(stage_name(stages[i]->reflection.stage));
        const char* source = translations[i].source.c_str();
        gl.ShaderSource(shader, 1, &source, nullptr);
        gl.CompileShader(shader);
        GLint compiled = 0;
        gl.GetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
        if (!compiled) {
            gl.GetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
            gl.DeleteShader(shader);
            if (log_is_on(LogLevel::debug)) log_message(LogLevel::debug, translations[i].source);
            return fail(ErrorCode::shader_compile, "compile shader", fmt::format("'{}'", stages[i]->name),
                        fmt::format("the OpenGL driver refuses its translation: {}", log.data()),
                        "Set NACRE_LOG=debug to see the translated source.");
        }
        driver.label(GL_SHADER, shader, stages[i]->name);
        gl.AttachShader(program, shader);
        // Lives on as long as the program has it.
        gl.DeleteShader(shader);
    }
    if (driver.traits.es && stages.size() == 1 && stages[0]->reflection.stage == rhi::ShaderStage::vertex) {
        // OpenGL ES links no program without a fragment shader; depth-only pipelines have none.
        const GLuint shader = gl.CreateShader(GL_FRAGMENT_SHADER);
        const std::string& vertex = translations[0].source;
        const std::string nothing = vertex.substr(0, vertex.find('\n')) + "\nvoid main() {}\n";  // the same #version
        const char* source = nothing.c_str();
        gl.ShaderSource(shader, 1, &source, nullptr);
        gl.CompileShader(shader);
        gl.AttachShader(program, shader);
        gl.DeleteShader(shader);
    }
    if (driver.traits.program_binary) gl.ProgramParameteri(program, GL_PROGRAM_BINARY_RETRIEVABLE_HINT, GL_TRUE);
    gl.LinkProgram(program);
    GLint linked = 0;
    gl.GetProgramiv(program, GL_LINK_STATUS, &linked);
    if (!linked) {
        gl.GetProgramInfoLog(program, static_cast<GLsizei>(log.size()), nullptr, log.data());
        return fail(ErrorCode::shader_compile, "link shaders", fmt::format("'{}'", stages[0]->name),
                    fmt::format("the OpenGL driver reports: {}", log.data()),
                    "See whether the pipeline exceeds a limit of the device's capabilities.");
    }
    return {};
}

Expected<void> check_limits(const Driver& driver, const Program& program, const std::string& name) {
    const auto exceeds = [&](const char* what, std::uint32_t wanted, std::size_t limit) {
        return fail(ErrorCode::unsupported, "create pipeline", fmt::format("'{}'", name),
                    fmt::format("it uses {} {}, and this OpenGL has {}", wanted, what, limit),
                    "Use fewer of them in one pipeline.");
    };
    for (const Program::Slot& slot : program.slots) {
        const std::uint32_t end = slot.range.first + slot.range.count;
        switch (slot.range.kind) {
            case SlotRange::Kind::uniform_buffer:
                if (end > driver.bound.uniform_buffers.size())
                    return exceeds("uniform buffers", end, driver.bound.uniform_buffers.size());
                break;
            case SlotRange::Kind::storage_buffer:
                if (end > driver.bound.storage_buffers.size())
                    return exceeds("storage buffers", end, driver.bound.storage_buffers.size());
                break;
            case SlotRange::Kind::image:
                if (end > driver.bound.images.size()) return exceeds("storage images", end, driver.bound.images.size());
                break;
        }
    }
    for (const Program::TextureSlot& slot : program.textures)
        if (slot.range.first + slot.range.count > driver.bound.textures.size() - 1)
            return exceeds("textures", slot.range.first + slot.range.count, driver.bound.textures.size() - 1);
    return {};
}

void read_binary(const Functions& gl, GLuint program, StoredProgram& stored) {
    GLint size = 0;
    gl.GetProgramiv(program, GL_PROGRAM_BINARY_LENGTH, &size);
    if (size <= 0) return;
    stored.binary.resize(static_cast<std::size_t>(size));
    GLenum format = 0;
    GLsizei written = 0;
    gl.GetProgramBinary(program, size, &written, &format, stored.binary.data());
    stored.binary.resize(static_cast<std::size_t>(std::max(written, 0)));
    stored.binary_format = format;
}

/// Names of layouts' positions for all tables of the translations.
void fill_tables(Program& program, std::span<const Translation> translations,
                 std::span<rhi::BackendBindGroupLayout* const> layouts) {
    const auto position = [&](std::uint32_t set, std::uint32_t binding) {
        return set < layouts.size() && layouts[set] ? GlBindGroupLayout::position(layouts[set]->desc, binding) : -1;
    };
    for (const Translation& translation : translations) {
        for (const SlotRange& range : translation.slots)
            program.slots.push_back({range, position(range.set, range.binding)});
        for (const TextureRange& range : translation.textures)
            program.textures.push_back({range, position(range.set, range.binding),
                                        range.sampler_binding == TextureRange::no_sampler
                                            ? -1
                                            : position(range.sampler_set, range.sampler_binding)});
        for (const PushConstantLeaf& leaf : translation.push_constants) program.push_constants.push_back({leaf, -1});
        program.flat_inputs |= translation.flat_inputs;
    }
}

template <typename Scalar>
void gather(const PushConstantLeaf& leaf, const std::byte* content, std::vector<Scalar>& values) {
    values.clear();
    for (std::uint32_t element = 0; element < leaf.count; ++element)
        for (std::uint32_t column = 0; column < leaf.columns; ++column)
            for (std::uint32_t row = 0; row < leaf.components; ++row) {
                const std::uint32_t in_matrix = leaf.columns == 1 ? row * 4u
                                                : leaf.row_major  ? row * leaf.matrix_stride + column * 4u
                                                                  : column * leaf.matrix_stride + row * 4u;
                Scalar value;
                std::memcpy(&value, content + leaf.offset + element * leaf.array_stride + in_matrix, sizeof value);
                values.push_back(value);
            }
}

std::uint32_t leaf_bytes(const PushConstantLeaf& leaf) {
    const std::uint32_t element = leaf.columns == 1 ? leaf.components * 4
                                  : leaf.row_major  ? (leaf.components - 1) * leaf.matrix_stride + leaf.columns * 4
                                                    : (leaf.columns - 1) * leaf.matrix_stride + leaf.components * 4;
    return (leaf.count - 1) * leaf.array_stride + element;
}

void set_uniform(const Functions& gl, const Program::PushConstant& constant, const std::byte* content) {
    const PushConstantLeaf& leaf = constant.leaf;
    const GLint location = constant.location;
    const auto count = static_cast<GLsizei>(leaf.count);
    if (leaf.scalar == PushConstantLeaf::Scalar::floating) {
        thread_local std::vector<GLfloat> values;
        gather(leaf, content, values);
        const GLfloat* data = values.data();
        using Matrix = PFNGLUNIFORMMATRIX4FVPROC;
        const Matrix matrices[3][3] = {
            {gl.UniformMatrix2fv, gl.UniformMatrix2x3fv, gl.UniformMatrix2x4fv},
            {gl.UniformMatrix3x2fv, gl.UniformMatrix3fv, gl.UniformMatrix3x4fv},
            {gl.UniformMatrix4x2fv, gl.UniformMatrix4x3fv, gl.UniformMatrix4fv},
        };
        if (leaf.columns > 1) {
            matrices[leaf.columns - 2][leaf.components - 2](location, count, GL_FALSE, data);
            return;
        }
        const std::array vectors{gl.Uniform1fv, gl.Uniform2fv, gl.Uniform3fv, gl.Uniform4fv};
        vectors[leaf.components - 1](location, count, data);
    } else if (leaf.scalar == PushConstantLeaf::Scalar::sint) {
        thread_local std::vector<GLint> values;
        gather(leaf, content, values);
        const std::array vectors{gl.Uniform1iv, gl.Uniform2iv, gl.Uniform3iv, gl.Uniform4iv};
        vectors[leaf.components - 1](location, count, values.data());
    } else {
        thread_local std::vector<GLuint> values;
        gather(leaf, content, values);
        const std::array vectors{gl.Uniform1uiv, gl.Uniform2uiv, gl.Uniform3uiv, gl.Uniform4uiv};
        vectors[leaf.components - 1](location, count, values.data());
    }
}

}  // namespace

Program::~Program() {
    if (!name) return;
    driver->worker->post([owner = driver.get(), deleted = name] {
        if (owner->bound.program == deleted) owner->gl.UseProgram(owner->bound.program = 0);
        owner->gl.DeleteProgram(deleted);
    });
}

void Program::upload_push_constants(const Functions& gl, std::span<const std::byte> content) {
    const bool is_first = uploaded.empty();
    if (is_first) uploaded.assign(content.begin(), content.end());
    for (const PushConstant& constant : push_constants) {
        if (constant.location < 0) continue;
        const std::uint32_t offset = constant.leaf.offset, size = leaf_bytes(constant.leaf);
        if (offset + size > content.size()) continue;
        if (!is_first && std::memcmp(uploaded.data() + offset, content.data() + offset, size) == 0) continue;
        set_uniform(gl, constant, content.data());
    }
    std::ranges::copy(content, uploaded.begin());
}

Expected<std::unique_ptr<Program>> make_program(const DriverPointer& driver, const DiskCache& cache,
                                                std::span<rhi::BackendShader* const> stages,
                                                std::span<const rhi::SpecializationConstant> specialization,
                                                std::span<rhi::BackendBindGroupLayout* const> layouts,
                                                const std::string& name) {
    const Hash128 key = key_of(driver->traits, stages, specialization);
    StoredProgram stored;
    bool from_cache = false;
    if (const auto bytes = cache.load("gl-program", key))
        if (auto loaded = load(*bytes); loaded && loaded->stages.size() == stages.size()) {
            stored = *std::move(loaded);
            from_cache = true;
        }
    if (!from_cache) {
        SlotAllocator slots;
        for (const rhi::BackendShader* stage : stages) {
            NACRE_TRY(Translation translation, translate(*stage, specialization, driver->traits, slots));
            if (log_is_on(LogLevel::trace))
                log_message(LogLevel::trace, fmt::format("translation of '{}':\n{}", stage->name, translation.source));
            stored.stages.push_back(std::move(translation));
        }
    }
    auto program = std::make_unique<Program>();
    program->driver = driver;
    fill_tables(*program, stored.stages, layouts);
    NACRE_CHECK(check_limits(*driver, *program, name));

    bool is_new = !from_cache;
    const Expected<void> made = driver->worker->run([&]() -> Expected<void> {
        const Functions& gl = driver->gl;
        program->name = gl.CreateProgram();
        GLint linked = 0;
        if (!stored.binary.empty() && driver->traits.program_binary) {
            gl.ProgramBinary(program->name, stored.binary_format, stored.binary.data(),
                             static_cast<GLsizei>(stored.binary.size()));
            gl.GetProgramiv(program->name, GL_LINK_STATUS, &linked);
            while (gl.GetError() != GL_NO_ERROR && !driver->lost) {}
        }
        if (!linked) {
            NACRE_CHECK(build(*driver, program->name, stages, stored.stages));
            if (driver->traits.program_binary) {
                read_binary(gl, program->name, stored);
                is_new = true;
            }
        }
        driver->label(GL_PROGRAM, program->name, name);
        for (Program::PushConstant& constant : program->push_constants)
            constant.location = gl.GetUniformLocation(program->name, constant.leaf.name.c_str());
        program->base_instance_location = gl.GetUniformLocation(program->name, "SPIRV_Cross_BaseInstance");
        return {};
    });
    NACRE_CHECK(made);
    if (is_new) cache.store("gl-program", key, store(stored));
    return program;
}

}  // namespace nacre::gl
