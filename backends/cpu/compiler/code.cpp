// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/code.h"

#include <fmt/format.h>
#include <llvm/Analysis/CGSCCPassManager.h>
#include <llvm/Analysis/LoopAnalysisManager.h>
#include <llvm/Analysis/TargetLibraryInfo.h>
#include <llvm/Config/llvm-config.h>
#include <llvm/ExecutionEngine/Orc/LLJIT.h>
#include <llvm/IR/DiagnosticInfo.h>
#include <llvm/IR/IRBuilder.h>
#include <llvm/IR/LegacyPassManager.h>
#include <llvm/IR/Verifier.h>
#include <llvm/MC/TargetRegistry.h>
#include <llvm/Passes/PassBuilder.h>
#include <llvm/Support/CommandLine.h>
#include <llvm/Support/SmallVectorMemoryBuffer.h>
#include <llvm/Support/TargetSelect.h>
#include <llvm/Target/TargetMachine.h>
#include <llvm/TargetParser/Host.h>
#include <llvm/Transforms/Coroutines/CoroCleanup.h>
#include <llvm/Transforms/Coroutines/CoroEarly.h>
#include <llvm/Transforms/Coroutines/CoroSplit.h>
#include <llvm/Transforms/InstCombine/InstCombine.h>
#include <llvm/Transforms/Scalar/ADCE.h>
#include <llvm/Transforms/Scalar/EarlyCSE.h>
#include <llvm/Transforms/Scalar/GVN.h>
#include <llvm/Transforms/Scalar/LICM.h>
#include <llvm/Transforms/Scalar/LoopPassManager.h>
#include <llvm/Transforms/Scalar/SimplifyCFG.h>
#include <llvm/Transforms/Scalar/SROA.h>

#include <atomic>
#include <cmath>
#include <mutex>

#include "backends/cpu/images/double_operations.h"
#include "backends/cpu/checks/check_functions.h"
#include "backends/cpu/images/image_operations.h"
#include "backends/cpu/rays/ray_query.h"
#include "backends/cpu/shader_interface.h"
#include "backends/cpu/trace.h"

namespace nacre::cpu {
namespace {

Error failed(const std::string& name, std::string reason) {
    return Error{ErrorCode::internal, "compile shader", fmt::format("'{}'", name), std::move(reason),
                 "This is a fault of the CPU backend; another backend can run the shader."};
}

std::string text_of(llvm::Error error) { return llvm::toString(std::move(error)); }

class OrcCode final : public LoadedCode {
  public:
    OrcCode(std::shared_ptr<llvm::orc::LLJIT> jit, llvm::orc::JITDylib& library)
        : jit_(std::move(jit)), library_(library) {}
    ~OrcCode() override {
        if (llvm::Error error = jit_->getExecutionSession().removeJITDylib(library_))
            llvm::consumeError(std::move(error));
    }
    void* find(const char* symbol) override {
        auto address = jit_->lookup(library_, symbol);
        if (!address) {
            llvm::consumeError(address.takeError());
            return nullptr;
        }
        return address->toPtr<void*>();
    }

  private:
    std::shared_ptr<llvm::orc::LLJIT> jit_;
    llvm::orc::JITDylib& library_;
};

class OrcGenerator final : public CodeGenerator {
  public:
    Expected<void> start(std::uint32_t lanes, bool contract) {
        static std::once_flag once;
        std::call_once(once, [] {
            llvm::InitializeNativeTarget();
            llvm::InitializeNativeTargetAsmPrinter();
            search_less_for_splits();
        });
        lanes_ = lanes;
        std::string features;
        std::string sorted;
        for (const auto& feature : llvm::sys::getHostCPUFeatures()) {
            if (!features.empty()) features += ',';
            features += (feature.getValue() ? "+" : "-") + feature.getKey().str();
            if (feature.getKey() == "f16c" && feature.getValue()) math_options_.half_instructions = true;
            if (feature.getKey() == "avx512vl" && feature.getValue())
                math_options_.exponent_instructions = contract, math_options_.conversion_instructions = true;
        }
        cpu_ = llvm::sys::getHostCPUName().str();
        features_ = features;
        math_options_.contract = contract;
        triple_ = llvm::sys::getProcessTriple();
        auto machine = make_machine(llvm::CodeGenOptLevel::Less);
        if (!machine) return std::unexpected(failed("CPU backend", "LLVM knows no target for " + triple_));
        layout_ = machine->createDataLayout();
        fingerprint_ = fmt::format("llvm {} {} {} {} {}", LLVM_VERSION_STRING, triple_, cpu_, features_, contract);

        auto builder = llvm::orc::JITTargetMachineBuilder(llvm::Triple(triple_));
        builder.setCPU(cpu_);
        auto jit = llvm::orc::LLJITBuilder().setJITTargetMachineBuilder(builder).setNumCompileThreads(0).create();
        if (!jit) return std::unexpected(failed("CPU backend", text_of(jit.takeError())));
        jit_ = std::move(*jit);
        return {};
    }

    void prepare(llvm::Module& module) override {
        module.setTargetTriple(triple_);
        module.setDataLayout(layout_);
    }

    Expected<Object> compile(llvm::Module& module, const std::string& name, bool has_coroutines) override {
        bool is_huge = module.getInstructionCount() > most_instructions;
        auto machine = make_machine(is_huge ? llvm::CodeGenOptLevel::None : llvm::CodeGenOptLevel::Less);
        if (!machine) return std::unexpected(failed(name, "no target machine"));
        for (llvm::Function& function : module) {
            if (function.isDeclaration()) continue;
            function.addFnAttr("target-cpu", cpu_);
            function.addFnAttr("target-features", features_);
            function.addFnAttr("prefer-vector-width", "512");
            function.addFnAttr(llvm::Attribute::NoUnwind);
            function.addFnAttr("warn-stack-size", "0");  // LLVM tells the size of each frame.
        }
        std::string problems;
        llvm::raw_string_ostream problem_stream(problems);
        if (llvm::verifyModule(module, &problem_stream))
            return std::unexpected(failed(name, "the code made is not valid: " + problems));
        optimize(module, *machine, has_coroutines);
        // Translation with less care takes time in proportion, where blocks are not long; the usual one does so in
        // blocks up to some length.
        if (!is_huge && largest_block(module) > most_in_block) {
            is_huge = true;
            machine = make_machine(llvm::CodeGenOptLevel::None);
            if (!machine) return std::unexpected(failed(name, "no target machine"));
        }
        if (is_huge) split_blocks(module);

        struct {
            std::uint64_t stack_bytes = 0;
            bool has_error = false;
        } told;
        module.getContext().setDiagnosticHandlerCallBack(
            [](const llvm::DiagnosticInfo* what, void* to) {
                auto& all = *static_cast<decltype(told)*>(to);
                if (const auto* frame = llvm::dyn_cast<llvm::DiagnosticInfoStackSize>(what))
                    all.stack_bytes += frame->getStackSize();
                all.has_error = all.has_error || what->getSeverity() == llvm::DS_Error;
            },
            &told);
        llvm::SmallVector<char, 0> bytes;
        llvm::raw_svector_ostream stream(bytes);
        llvm::legacy::PassManager passes;
        if (machine->addPassesToEmitFile(passes, stream, nullptr, llvm::CodeGenFileType::ObjectFile))
            return std::unexpected(failed(name, "the target writes no object files"));
        passes.run(module);
        if (told.has_error) return std::unexpected(failed(name, "LLVM cannot translate the code"));
        const auto* first = reinterpret_cast<const std::byte*>(bytes.data());
        return Object{{first, first + bytes.size()}, told.stack_bytes};
    }

    Expected<std::shared_ptr<LoadedCode>> load(std::vector<std::byte> object, const std::string& name) override {
        auto library = jit_->createJITDylib(fmt::format("shader{}", counter_.fetch_add(1)));
        if (!library) return std::unexpected(failed(name, text_of(library.takeError())));
        auto code = std::make_shared<OrcCode>(jit_, *library);
        if (llvm::Error error = define_symbols(*library))
            return std::unexpected(failed(name, text_of(std::move(error))));
        llvm::SmallVector<char, 0> bytes(reinterpret_cast<const char*>(object.data()),
                                         reinterpret_cast<const char*>(object.data()) + object.size());
        auto buffer = std::make_unique<llvm::SmallVectorMemoryBuffer>(std::move(bytes), name, false);
        if (llvm::Error error = jit_->addObjectFile(*library, std::move(buffer)))
            return std::unexpected(failed(name, text_of(std::move(error))));
        return code;
    }

    const std::string& fingerprint() const override { return fingerprint_; }
    const MathOptions& math_options() const override { return math_options_; }

  private:
    /// Instructions of a module up to which its code is worth the time that good code takes.
    static constexpr unsigned most_instructions = 150'000;
    /// And of one block.
    static constexpr std::size_t most_in_block = 10'000;

    static std::size_t largest_block(const llvm::Module& module) {
        std::size_t largest = 0;
        for (const llvm::Function& function : module)
            for (const llvm::BasicBlock& block : function) largest = std::max(largest, block.size());
        return largest;
    }

    /// Makes blocks short: LLVM selects the instructions of one in time by the square of their number.
    static void split_blocks(llvm::Module& module) {
        constexpr std::size_t most_at_once = 1000;
        std::vector<llvm::Instruction*> begins;
        for (llvm::Function& function : module)
            for (llvm::BasicBlock& block : function) {
                std::size_t count = 0;
                for (llvm::Instruction& at : block) {
                    // Variables stay together in the first block.
                    if (llvm::isa<llvm::PHINode>(at) || llvm::isa<llvm::AllocaInst>(at)) count = 0;
                    else if (++count % most_at_once == 0 && !at.isTerminator()) begins.push_back(&at);
                }
                if (&block != &function.getEntryBlock()) continue;
                llvm::Instruction* last_variable = nullptr;
                for (llvm::Instruction& at : block)
                    if (llvm::isa<llvm::AllocaInst>(at)) last_variable = &at;
                if (last_variable)
                    std::erase_if(begins, [&](const llvm::Instruction* at) {
                        return at->getParent() == &block && at->comesBefore(last_variable);
                    });
            }
        // From the back, so that each moves only what is behind it.
        for (auto at = begins.rbegin(); at != begins.rend(); ++at) (*at)->getParent()->splitBasicBlock(*at);
    }

    /// Most of the time that a shader of many values takes would go to the register allocator's search for regions of
    /// the code in which a value had better stay in a register. A fiftieth of LLVM's budget for it halves the time to
    /// translate such a shader, and its code is smaller and as fast.
    static void search_less_for_splits() {
        constexpr const char* budget = "grow-region-complexity-budget";
        auto& options = llvm::cl::getRegisteredOptions();
        if (const auto found = options.find(budget); found != options.end())
            found->second->addOccurrence(1, budget, "200");
    }

    std::unique_ptr<llvm::TargetMachine> make_machine(llvm::CodeGenOptLevel level) const {
        std::string error;
        const llvm::Target* target = llvm::TargetRegistry::lookupTarget(triple_, error);
        if (!target) return nullptr;
        llvm::TargetOptions options;
        options.AllowFPOpFusion = math_options_.contract ? llvm::FPOpFusion::Standard : llvm::FPOpFusion::Strict;
        return std::unique_ptr<llvm::TargetMachine>(target->createTargetMachine(
            triple_, cpu_, features_, options, llvm::Reloc::PIC_, llvm::CodeModel::Small, level, true));
    }

    /// The lean list of passes of the design: twice as fast to compile as O2, and code that runs as fast.
    static void optimize(llvm::Module& module, llvm::TargetMachine& machine, bool has_coroutines) {
        llvm::LoopAnalysisManager loops;
        llvm::FunctionAnalysisManager functions;
        llvm::CGSCCAnalysisManager graph;
        llvm::ModuleAnalysisManager modules;
        llvm::PassBuilder builder(&machine);
        builder.registerModuleAnalyses(modules);
        builder.registerCGSCCAnalyses(graph);
        builder.registerFunctionAnalyses(functions);
        builder.registerLoopAnalyses(loops);
        builder.crossRegisterProxies(loops, functions, graph, modules);

        const auto lean = [] {
            llvm::FunctionPassManager passes;
            passes.addPass(llvm::SROAPass(llvm::SROAOptions::ModifyCFG));
            passes.addPass(llvm::EarlyCSEPass());
            passes.addPass(llvm::SimplifyCFGPass());
            passes.addPass(llvm::InstCombinePass(llvm::InstCombineOptions().setMaxIterations(1)));
            passes.addPass(llvm::GVNPass());
            passes.addPass(llvm::createFunctionToLoopPassAdaptor(llvm::LICMPass(llvm::LICMOptions()), true));
            passes.addPass(llvm::InstCombinePass(llvm::InstCombineOptions().setMaxIterations(1)));
            passes.addPass(llvm::SimplifyCFGPass());
            passes.addPass(llvm::ADCEPass());
            return passes;
        };
        llvm::ModulePassManager passes;
        if (has_coroutines) {
            passes.addPass(llvm::CoroEarlyPass());
            llvm::CGSCCPassManager split;
            split.addPass(llvm::createCGSCCToFunctionPassAdaptor(lean()));
            split.addPass(llvm::CoroSplitPass());
            passes.addPass(llvm::createModuleToPostOrderCGSCCPassAdaptor(std::move(split)));
            passes.addPass(llvm::CoroCleanupPass());
        }
        passes.addPass(llvm::createModuleToFunctionPassAdaptor(lean()));
        passes.run(module, modules);
        spread_conditions(module);
    }

    /// Makes a condition for all lanes a splat where it is a choice between all and none: instruction selection of LLVM
    /// 19 goes round for ever over two such choices of 8 lanes that are joined, where masks have registers of their own
    /// (AVX-512).
    static void spread_conditions(llvm::Module& module) {
        for (llvm::Function& function : module)
            for (llvm::BasicBlock& block : function)
                for (llvm::Instruction& at : llvm::make_early_inc_range(block)) {
                    auto* choice = llvm::dyn_cast<llvm::SelectInst>(&at);
                    const auto* type = choice ? llvm::dyn_cast<llvm::FixedVectorType>(choice->getType()) : nullptr;
                    if (!type || !type->getElementType()->isIntegerTy(1) ||
                        !choice->getCondition()->getType()->isIntegerTy(1))
                        continue;
                    const auto* yes = llvm::dyn_cast<llvm::Constant>(choice->getTrueValue());
                    const auto* no = llvm::dyn_cast<llvm::Constant>(choice->getFalseValue());
                    if (!yes || !no || !yes->isAllOnesValue() || !no->isNullValue()) continue;
                    llvm::IRBuilder<> builder(choice);
                    choice->replaceAllUsesWith(
                        builder.CreateVectorSplat(type->getNumElements(), choice->getCondition()));
                    choice->eraseFromParent();
                }
    }

    llvm::Error define_symbols(llvm::orc::JITDylib& library) {
        llvm::orc::SymbolMap symbols;
        const auto define = [&](const char* symbol, auto* function) {
            symbols[jit_->mangleAndIntern(symbol)] = {llvm::orc::ExecutorAddr::fromPtr(function),
                                                      llvm::JITSymbolFlags::Exported | llvm::JITSymbolFlags::Callable};
        };
        define("nacre_cpu_image", image_function(lanes_));
        define("nacre_cpu_texel", texel_function());
        define("nacre_cpu_double_image", double_image_function());
        define("nacre_cpu_check_begin", check_begin_function());
        define("nacre_cpu_check_workgroup", check_workgroup_function());
        define("nacre_cpu_check_fault", check_fault_function());
        define("nacre_cpu_check_memory", check_memory_function());
        define("nacre_cpu_check_image", check_image_function());
        define("nacre_cpu_check_input", check_input_function());
        define("nacre_cpu_ray_proceed", ray_proceed_function());
        define("nacre_cpu_ray_confirm", ray_confirm_function());
        define("nacre_cpu_ray_generate", ray_generate_function());
        define("nacre_cpu_ray_property", ray_property_function());
        define("nacre_cpu_trace_begin", trace_functions().begin);
        define("nacre_cpu_trace_event", trace_functions().event);
        define("nacre_cpu_trace_write", trace_functions().write);
        // What LLVM and the functions in double precision call.
        using One = double (*)(double);
        using Two = double (*)(double, double);
        const std::pair<const char*, One> one_argument[] = {{"sin", std::sin},        {"cos", std::cos},
                                                            {"tan", std::tan},        {"asin", std::asin},
                                                            {"acos", std::acos},      {"atan", std::atan},
                                                            {"sinh", std::sinh},      {"cosh", std::cosh},
                                                            {"tanh", std::tanh},      {"asinh", std::asinh},
                                                            {"acosh", std::acosh},    {"atanh", std::atanh},
                                                            {"exp", std::exp},        {"exp2", std::exp2},
                                                            {"log", std::log},        {"log2", std::log2},
                                                            {"floor", std::floor},    {"ceil", std::ceil},
                                                            {"trunc", std::trunc},    {"rint", std::rint},
                                                            {"roundeven", std::rint}, {"nearbyint", std::nearbyint},
                                                            {"round", std::round},    {"sqrt", std::sqrt}};
        for (const auto& [symbol, function] : one_argument) define(symbol, function);
        const std::pair<const char*, Two> two_arguments[] = {
            {"atan2", std::atan2}, {"pow", std::pow}, {"fmod", std::fmod}, {"fmin", std::fmin}, {"fmax", std::fmax}};
        for (const auto& [symbol, function] : two_arguments) define(symbol, function);
        define("fma", static_cast<double (*)(double, double, double)>(std::fma));
        define("fmaf", static_cast<float (*)(float, float, float)>(std::fma));
        define("floorf", static_cast<float (*)(float)>(std::floor));
        define("ceilf", static_cast<float (*)(float)>(std::ceil));
        define("truncf", static_cast<float (*)(float)>(std::trunc));
        define("rintf", static_cast<float (*)(float)>(std::rint));
        define("roundevenf", static_cast<float (*)(float)>(std::rint));
        define("roundf", static_cast<float (*)(float)>(std::round));
        define("fmodf", static_cast<float (*)(float, float)>(std::fmod));
        define("fminf", static_cast<float (*)(float, float)>(std::fmin));
        define("fmaxf", static_cast<float (*)(float, float)>(std::fmax));
        define("ldexp", static_cast<double (*)(double, int)>(std::ldexp));
        define("ldexpf", static_cast<float (*)(float, int)>(std::ldexp));
        define("memcpy", static_cast<void* (*)(void*, const void*, std::size_t)>(std::memcpy));
        define("memset", static_cast<void* (*)(void*, int, std::size_t)>(std::memset));
        define("memmove", static_cast<void* (*)(void*, const void*, std::size_t)>(std::memmove));
        define("abort", static_cast<void (*)()>(std::abort));
        return library.define(llvm::orc::absoluteSymbols(std::move(symbols)));
    }

    std::shared_ptr<llvm::orc::LLJIT> jit_;
    std::string triple_, cpu_, features_, fingerprint_;
    llvm::DataLayout layout_{""};
    std::uint32_t lanes_ = 16;
    MathOptions math_options_;
    std::atomic<std::uint64_t> counter_{0};
};

}  // namespace

Expected<std::unique_ptr<CodeGenerator>> CodeGenerator::create(std::uint32_t lanes, bool contract) {
    auto generator = std::make_unique<OrcGenerator>();
    NACRE_CHECK(generator->start(lanes, contract));
    return generator;
}

}  // namespace nacre::cpu
