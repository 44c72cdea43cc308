// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/compiler.h"

#include <fmt/format.h>
#include <llvm/IR/LLVMContext.h>
#include <llvm/IR/Verifier.h>
#include <llvm/Support/raw_ostream.h>
#include <spirv-tools/libspirv.h>

#include <bit>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>

#include "backends/cpu/compiler/code.h"
#include "backends/cpu/compiler/legalization.h"
#include "backends/cpu/compiler/module.h"
#include "backends/cpu/compiler/stages.h"
#include "backends/cpu/compiler/stored_code.h"
#include "compiler_sources_hash.h"
#include "core/disk_cache.h"
#include "rhi/spirv.h"

namespace nacre::cpu {
namespace {

class ShaderCompilation final : public Compiler {
  public:
    /// How code is made.
    struct Variant {
        CompilerOptions options;
        std::unique_ptr<CodeGenerator> generator;
    };
    /// @param subgroups  for compute shaders that see how many lanes there are
    ShaderCompilation(Variant all, Variant subgroups) : all_(std::move(all)), subgroups_(std::move(subgroups)) {}

    Expected<ComputeProgram> compile_compute(const ShaderSource& source) override {
        const bool sees_lanes = source.reflection == nullptr || source.reflection->uses_subgroups;
        const Variant& how = source.reflection && sees_lanes && subgroups_.generator ? subgroups_ : all_;
        std::uint64_t stack_bytes = 0;
        Expected<ComputeProgram> program = compile_compute(how, source, stack_bytes);
        if (program || sees_lanes) return program;
        // What is too large for the stack may fit with fewer lanes, and the shader cannot tell.
        std::uint32_t lanes = how.options.lanes;
        const auto fits = [&] { return stack_bytes * lanes <= most_stack_bytes * how.options.lanes; };
        while (lanes > min_lanes && !fits()) lanes /= 2;
        if (lanes == how.options.lanes || !fits()) return program;
        NACRE_TRY(const Variant* narrower, with_lanes(lanes));
        Expected<ComputeProgram> again = compile_compute(*narrower, source, stack_bytes);
        return again ? std::move(again) : std::move(program);
    }

    Expected<VertexProgram> compile_vertex(const ShaderSource& source, const VertexInput& input) override {
        VertexProgram program;
        std::shared_ptr<CompiledCode> code;
        NACRE_TRY(code, compile(all_, source, spv::ExecutionModel::Vertex, input, program,
                                [&](llvm::Module& target, const Module& module) {
                                    VertexEmitter emitter(target, module, all_.options,
                                                          all_.generator->math_options(), source.slots, input);
                                    emitter.emit();
                                    program = emitter.program;
                                    return Emitted{false, emitter.narrowed()};
                                }));
        return with_entry(std::move(program), std::move(code), source);
    }

    Expected<FragmentProgram> compile_fragment(const ShaderSource& source) override {
        FragmentProgram program;
        std::shared_ptr<CompiledCode> code;
        NACRE_TRY(code, compile(all_, source, spv::ExecutionModel::Fragment, {}, program,
                                [&](llvm::Module& target, const Module& module) {
                                    FragmentEmitter emitter(target, module, all_.options,
                                                            all_.generator->math_options(), source.slots);
                                    emitter.trace_table = source.trace;
                                    emitter.emit();
                                    program = emitter.program;
                                    return Emitted{false, emitter.narrowed()};
                                }));
        return with_entry(std::move(program), std::move(code), source);
    }

  private:
    static constexpr std::uint32_t min_lanes = 4;
    /// Of all functions of a program together. Threads of schedulers have 4 MiB of stack.
    static constexpr std::uint64_t most_stack_bytes = 3 << 20;

    /// @param stack_bytes  what the code takes, where that is too much
    Expected<ComputeProgram> compile_compute(const Variant& how, const ShaderSource& source,
                                             std::uint64_t& stack_bytes) {
        ComputeProgram program;
        program.name = std::string(source.name);
        ComputeFacts facts;
        NACRE_TRY(program.code, compile(how, source, spv::ExecutionModel::GLCompute, {}, facts,
                                        [&](llvm::Module& target, const Module& module) {
                                            ComputeEmitter emitter(target, module, how.options,
                                                                   how.generator->math_options(), source.slots);
                                            emitter.trace_table = source.trace;
                                            emitter.emit();
                                            facts.workgroup_size = module.workgroup_size;
                                            facts.workgroup_bytes = emitter.workgroup_bytes;
                                            facts.subgroups = emitter.subgroups;
                                            facts.has_barriers = emitter.has_barriers;
                                            return Emitted{emitter.has_barriers, emitter.narrowed()};
                                        },
                                        &stack_bytes));
        program.workgroup_size = facts.workgroup_size;
        program.narrowed = std::move(facts.narrowed);
        if (!program.code) return program;
        auto& code = static_cast<LoadedCode&>(*program.code);
        program.run = reinterpret_cast<ComputeFunction>(code.find("kernel"));
        if (!program.run) return missing(source);
        program.workgroup_bytes = (facts.workgroup_bytes + 63) / 64 * 64;
        if (facts.has_barriers) {
            const auto frame_size = reinterpret_cast<void (*)(std::uint64_t*)>(code.find("frame_size"));
            if (!frame_size) return missing(source);
            std::uint64_t bytes = 0;
            frame_size(&bytes);
            program.workgroup_bytes += (bytes + 63) / 64 * 64 * facts.subgroups;
        }
        return program;
    }

    /// A program of one stage of drawing with what `compile` gave for it.
    template <typename Program>
    Expected<Program> with_entry(Program program, std::shared_ptr<CompiledCode> code,
                                 const ShaderSource& source) const {
        program.in_double = all_.options.mode == ExecutionMode::double_precision;
        program.name = std::string(source.name);
        if (!code) return program;
        program.run = reinterpret_cast<decltype(program.run)>(static_cast<LoadedCode&>(*code).find("kernel"));
        program.code = std::move(code);
        if (!program.run) return missing(source);
        return program;
    }

    /// As all_, with fewer lanes.
    Expected<const Variant*> with_lanes(std::uint32_t lanes) {
        const std::lock_guard lock(fewer_lanes_mutex_);
        Variant& made = fewer_lanes_[lanes];
        if (!made.generator) {
            made.options = all_.options, made.options.lanes = lanes;
            NACRE_TRY(made.generator, CodeGenerator::create(lanes, made.options.mode == ExecutionMode::fast));
        }
        return &made;
    }

    static std::unexpected<Error> missing(const ShaderSource& source) {
        return fail(ErrorCode::internal, "compile shader", fmt::format("'{}'", source.name),
                    "the code that was made has no entry", "Purge the cache (nacre cache --purge) and try again.");
    }

    struct Emitted {
        bool has_coroutines = false;
        std::map<std::uint32_t, std::string> narrowed;
    };

    /// The code of a shader, from the disk cache or made anew; null where none is wanted.
    /// @param facts  gets what is known of it (stored_code.h), from the cache or from `translate`
    /// @param emit   fills an LLVM module and all of `facts` but `narrowed`; gives an Emitted
    /// @param too_large_stack  gets the bytes of stack that the code takes where that is too much
    template <typename Facts, typename Emit>
    Expected<std::shared_ptr<CompiledCode>> compile(const Variant& how, const ShaderSource& source,
                                                    spv::ExecutionModel model, const VertexInput& input, Facts& facts,
                                                    Emit&& emit, std::uint64_t* too_large_stack = nullptr) {
        // Code that is traced refers to addresses of this process; only what is translated can be written out.
        const bool is_kept =
            how.options.use_disk_cache && !source.trace && !how.options.only_translates && cache_.is_on();
        const Hash128 key = is_kept ? key_of(how, source, model, input) : Hash128{};
        StoredCode code;
        const auto is_known = [&] {
            if (!is_kept || std::getenv("NACRE_CPU_DUMP")) return false;
            const auto entry = cache_.load("cpu", key);
            return entry && from_entry(*entry, facts, code);
        };
        if (!is_known()) {
            NACRE_TRY(code, translate(how, source, model, facts, emit));
            if (how.options.only_translates) return nullptr;
            if (is_kept) cache_.store("cpu", key, to_entry(facts, code));
        }
        if (code.stack_bytes > most_stack_bytes) {
            if (too_large_stack) *too_large_stack = code.stack_bytes;
            return fail(
                ErrorCode::unsupported, "compile shader", fmt::format("'{}'", source.name),
                fmt::format("its values take {} bytes of stack with {} lanes; {} are the most", code.stack_bytes,
                            how.options.lanes, most_stack_bytes),
                fmt::format("Load parts of arrays and structures instead of whole ones{}.",
                            how.options.lanes > min_lanes ? ", or choose fewer lanes (as in 'cpu:lanes=4')" : ""));
        }
        NACRE_TRY(std::shared_ptr<LoadedCode> loaded,
                  how.generator->load(std::move(code.object), std::string(source.name)));
        return std::shared_ptr<CompiledCode>(std::move(loaded));
    }

    /// The way from SPIR-V to an object file; to nothing where only translation is wanted. As for `compile`.
    template <typename Facts, typename Emit>
    Expected<StoredCode> translate(const Variant& how, const ShaderSource& source, spv::ExecutionModel model,
                                   Facts& facts, Emit& emit) {
        NACRE_TRY(const std::vector<std::uint32_t> words,
                  legalize(source.spirv, source.specialization, source.name,
                           {.keeps_variables = (how.options.checks & check_sanitize) != 0,
                            .inlines_all = how.options.checks != 0 || source.trace}));
        NACRE_TRY(const Module module, Module::parse(words, source.entry_point, model, source.name));
        llvm::LLVMContext context;
        auto target = std::make_unique<llvm::Module>("shader", context);
        how.generator->prepare(*target);
        Emitted emitted;
        try {
            emitted = emit(*target, module);
        } catch (const EmitError& error) {
            const std::string line = rhi::spirv::source_line(words, error.offset);
            return fail(ErrorCode::unsupported, "compile shader", fmt::format("'{}'", source.name),
                        fmt::format("{}{}", error.reason, line.empty() ? std::string() : " (" + line + ")"),
                        "Write it another way for the CPU backend, or use another backend.");
        } catch (const std::out_of_range&) {
            return fail(ErrorCode::unsupported, "compile shader", fmt::format("'{}'", source.name),
                        "the module refers to something in a way that the CPU backend does not know",
                        "Use another backend.");
        }
        for (const auto& [offset, operation] : emitted.narrowed)
            facts.narrowed.push_back({rhi::spirv::source_line(words, offset), operation});
        if (const char* dump = std::getenv("NACRE_CPU_DUMP")) {
            std::error_code problem;
            std::string file(source.name);
            for (char& letter : file)
                if (letter == '/' || letter == ' ') letter = '_';
            llvm::raw_fd_ostream out(fmt::format("{}/{}.ll", dump, file), problem);
            if (!problem) target->print(out, nullptr);
        }
        if (source.trace) {
            source.trace->shader = source.name;
            for (std::size_t i = 0; i < source.trace->offsets.size(); ++i)
                source.trace->instructions[i].line = rhi::spirv::source_line(words, source.trace->offsets[i]);
        }
        if (how.options.only_translates) {
            if (llvm::verifyModule(*target))
                return fail(ErrorCode::internal, "compile shader", fmt::format("'{}'", source.name),
                            "its LLVM module is not valid", "Use another backend.");
            return StoredCode{};
        }
        NACRE_TRY(CodeGenerator::Object made,
                  how.generator->compile(*target, std::string(source.name), emitted.has_coroutines));
        // What cannot run need not be kept; that it cannot is.
        if (made.stack_bytes > most_stack_bytes) made.bytes.clear();
        return StoredCode{made.stack_bytes, std::move(made.bytes)};
    }

    /// Of all that the code depends on. The module is that which came in: what legalization makes of it depends on the
    /// module, the constants, the options and SPIRV-Tools.
    static Hash128 key_of(const Variant& how, const ShaderSource& source, spv::ExecutionModel model,
                          const VertexInput& input) {
        std::string text = fmt::format("{} {} {} {} {} {} {} {} {}\n", nacre_cpu_compiler_sources, how.options.lanes,
                                       static_cast<int>(how.options.mode), how.options.checks, static_cast<int>(model),
                                       source.entry_point, how.generator->fingerprint(),
                                       spvSoftwareVersionDetailsString(), source.spirv.size());
        for (const rhi::SpecializationConstant& constant : source.specialization)
            text += std::visit(
                [&](auto value) {
                    const auto bits = [&] {
                        if constexpr (std::is_same_v<decltype(value), bool>) return std::uint32_t{value};
                        else return std::bit_cast<std::uint32_t>(value);
                    }();
                    return fmt::format("c{} {}\n", constant.id, bits);
                },
                constant.value);
        for (const BindingSlots& slot : source.slots)
            text += fmt::format("s{} {} {} {}\n", slot.set, slot.binding, slot.first, slot.count);
        for (const rhi::VertexAttribute& at : input.attributes)
            text += fmt::format("a{} {} {} {}\n", at.location, at.buffer, at.offset, static_cast<int>(at.format));
        for (const rhi::VertexBufferLayout& at : input.buffers)
            text += fmt::format("b{} {}\n", at.stride, at.per_instance);
        text.append(reinterpret_cast<const char*>(source.spirv.data()), source.spirv.size() * 4);
        return hash128(std::as_bytes(std::span(text)));
    }

    Variant all_, subgroups_;
    std::mutex fewer_lanes_mutex_;
    std::map<std::uint32_t, Variant> fewer_lanes_;  ///< By their lanes.
    DiskCache cache_;
};

}  // namespace

Expected<std::unique_ptr<Compiler>> Compiler::create(const CompilerOptions& options) {
    if (options.lanes != 4 && options.lanes != 8 && options.lanes != 16)
        return fail(ErrorCode::invalid_argument, "make CPU compiler", fmt::format("lanes={}", options.lanes),
                    "lanes are 4, 8 or 16", "Choose one of them.");
    const bool is_fast = options.mode == ExecutionMode::fast;
    ShaderCompilation::Variant all{options, nullptr}, subgroups{options, nullptr};
    NACRE_TRY(all.generator, CodeGenerator::create(options.lanes, is_fast));
    // Results must not depend on the lanes where arithmetic is consistent: subgroups are as large as they can be.
    if (!is_fast && options.lanes < max_lanes) {
        subgroups.options.lanes = max_lanes;
        NACRE_TRY(subgroups.generator, CodeGenerator::create(max_lanes, is_fast));
    }
    return std::make_unique<ShaderCompilation>(std::move(all), std::move(subgroups));
}

std::uint32_t native_lanes() {
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx2") ? 16 : 4;
#else
    return 4;
#endif
}

}  // namespace nacre::cpu
