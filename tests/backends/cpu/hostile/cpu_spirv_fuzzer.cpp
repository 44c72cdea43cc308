// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <spirv/unified1/spirv.hpp11>

#include "backends/cpu/compiler/compiler.h"
#include "core/hash.h"
#include "rhi/reflection.h"
#include "rhi/spirv.h"
#include "tests/backends/cpu/hostile/spirv_mutation.h"

/// @file
/// libFuzzer target for the way from SPIR-V to native code: any words are a program or an error that says something. A
/// part of the inputs is made by changes that know SPIR-V, since nearly all others end in the validator. All go through
/// the backend's own code up to a valid LLVM module, and one in eight through LLVM as well, which takes ten times as
/// long as the rest.

using nacre::hostile::MutableModule;
using nacre::hostile::Random;
using nacre::hostile::Words;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned int seed);
extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* first, std::size_t first_size,
                                                 const std::uint8_t* second, std::size_t second_size, std::uint8_t* out,
                                                 std::size_t max_size, unsigned int seed);

namespace {

using namespace nacre;

Words words_of(const std::uint8_t* data, std::size_t size) {
    Words words(size / 4);
    if (!words.empty()) std::memcpy(words.data(), data, words.size() * 4);
    return words;
}

std::unique_ptr<cpu::Compiler> make_compiler(bool only_translates) {
    // Few lanes make little code.
    auto compiler = cpu::Compiler::create(
        {.lanes = 4, .mode = cpu::ExecutionMode::fast, .use_disk_cache = false, .only_translates = only_translates});
    if (!compiler) std::abort();
    return *std::move(compiler);
}

/// Which of both is told by the input alone, so that what was found once is found again.
cpu::Compiler& compiler_of(std::span<const std::uint8_t> input) {
    static const std::unique_ptr<cpu::Compiler> whole = make_compiler(false), translation = make_compiler(true);
    return hash128(std::as_bytes(input)).low % 8 == 0 ? *whole : *translation;
}

template <typename T>
void require_message(const Expected<T>& value) {
    // A fault of the backend itself, which no input may bring about, is as bad as a crash.
    if (!value && (value.error().message().empty() || value.error().code == ErrorCode::internal)) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const Words words = words_of(data, size);
    rhi::ShaderStage stage = rhi::ShaderStage::compute;
    std::string entry_point = "main";
    if (rhi::spirv::check_structure(words, "input"))
        for (const rhi::spirv::Instruction& at : rhi::spirv::instructions(words)) {
            if (static_cast<spv::Op>(at.opcode()) != spv::Op::OpEntryPoint) continue;
            entry_point = at.text(2);
            switch (static_cast<spv::ExecutionModel>(at.operand(0))) {
                case spv::ExecutionModel::Vertex: stage = rhi::ShaderStage::vertex; break;
                case spv::ExecutionModel::Fragment: stage = rhi::ShaderStage::fragment; break;
                default: break;
            }
            break;
        }
    const auto reflection = rhi::reflect(words, stage, entry_point, "input");
    require_message(reflection);
    if (!reflection) return 0;

    std::vector<cpu::BindingSlots> slots;
    std::uint32_t next = 0;
    for (const rhi::ReflectedBinding& binding : reflection->bindings) {
        slots.push_back({binding.set, binding.binding, next, binding.count});
        next += std::max(binding.count, 1u);
    }
    cpu::Compiler& compiler = compiler_of({data, size});
    const cpu::ShaderSource source{
        .spirv = words, .entry_point = entry_point, .name = "input", .reflection = &*reflection, .slots = slots};
    if (stage == rhi::ShaderStage::compute) {
        require_message(compiler.compile_compute(source));
    } else if (stage == rhi::ShaderStage::fragment) {
        require_message(compiler.compile_fragment(source));
    } else {
        std::vector<rhi::VertexAttribute> attributes;
        for (const rhi::ReflectedVariable& input : reflection->inputs)
            attributes.push_back({.location = input.location, .format = rhi::Format::rgba32_uint});
        const rhi::VertexBufferLayout buffer{.stride = 16};
        require_message(compiler.compile_vertex(source, {.attributes = attributes, .buffers = std::span(&buffer, 1)}));
    }
    return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned int seed) {
    Random random(seed);
    if (random.chance(50)) return LLVMFuzzerMutate(data, size, max_size);
    Words words = words_of(data, size);
    const bool is_blind = random.chance(50);
    for (int i = random.between(1, 5); i > 0; --i) {
        // What knows SPIR-V asks for valid modules.
        const bool may_know = !is_blind && random.chance(95) && rhi::spirv::validate(words, "input");
        auto module = may_know ? MutableModule::parse(words) : std::nullopt;
        if (!module) hostile::mutate_words(words, random);
        else if (module->mutate(random)) words = module->words();
    }
    const std::size_t bytes = std::min(words.size() * 4, max_size);
    std::memcpy(data, words.data(), bytes);
    return bytes;
}

extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* first, std::size_t first_size,
                                                 const std::uint8_t* second, std::size_t second_size, std::uint8_t* out,
                                                 std::size_t max_size, unsigned int seed) {
    // The begin of one and the end of the other, cut where some instruction begins.
    Random random(seed);
    const auto cut = [&](const std::uint8_t* data, std::size_t size) -> std::size_t {
        const Words words = words_of(data, size);
        if (!rhi::spirv::check_structure(words, "input")) return size / 8 * 4;
        std::vector<std::size_t> places{words.size() * 4};
        for (const rhi::spirv::Instruction& at : rhi::spirv::instructions(words)) places.push_back(at.offset * 4);
        return random.pick(places);
    };
    const std::size_t head = std::min(cut(first, first_size), max_size), from = cut(second, second_size);
    const std::size_t tail = std::min(second_size - from, max_size - head);
    std::memcpy(out, first, head);
    if (tail) std::memcpy(out + head, second + from, tail);
    return head + tail;
}
