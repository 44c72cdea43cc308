// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/math/compiled_function.h"

#include <llvm/ExecutionEngine/Orc/LLJIT.h>
#include <llvm/IR/LegacyPassManager.h>
#include <llvm/IR/Module.h>
#include <llvm/IR/Verifier.h>
#include <llvm/Passes/PassBuilder.h>
#include <llvm/Support/SmallVectorMemoryBuffer.h>
#include <llvm/Support/TargetSelect.h>
#include <llvm/Target/TargetMachine.h>
#include <llvm/TargetParser/Host.h>

#include <cstdlib>

namespace nacre::cpu {

namespace {

using Run = void (*)(const void* const*, void* const*, std::size_t);

llvm::ExitOnError or_exit;

llvm::Type* element_type(llvm::LLVMContext& context, Kind kind) {
    switch (kind) {
        case Kind::half: return llvm::Type::getHalfTy(context);
        case Kind::single: return llvm::Type::getFloatTy(context);
        case Kind::number64: return llvm::Type::getDoubleTy(context);
        case Kind::int8: return llvm::Type::getInt8Ty(context);
        case Kind::int16: return llvm::Type::getInt16Ty(context);
        case Kind::int32: return llvm::Type::getInt32Ty(context);
        case Kind::int64: return llvm::Type::getInt64Ty(context);
    }
    std::abort();
}

llvm::Type* value_type(llvm::Type* element, unsigned lanes) {
    return lanes == 1 ? element : llvm::FixedVectorType::get(element, lanes);
}

llvm::orc::JITTargetMachineBuilder target_of(const Variant& variant) {
    static const bool initialized = [] {
        llvm::InitializeNativeTarget();
        llvm::InitializeNativeTargetAsmPrinter();
        return true;
    }();
    (void)initialized;
    auto target = or_exit(llvm::orc::JITTargetMachineBuilder::detectHost());
    // What LLJIT chooses on its own; the default of a target machine for a JIT loads the address of every constant
    // first.
    target.setCodeModel(llvm::CodeModel::Small);
    target.setRelocationModel(llvm::Reloc::PIC_);
    if (!variant.processor.empty()) {
        target.setCPU(variant.processor);
        target.getFeatures() = llvm::SubtargetFeatures();
    }
    return target;
}

void optimize(llvm::Module& module, llvm::TargetMachine* machine) {
    llvm::PassBuilder passes(machine);
    llvm::LoopAnalysisManager loops;
    llvm::FunctionAnalysisManager functions;
    llvm::CGSCCAnalysisManager calls;
    llvm::ModuleAnalysisManager modules;
    passes.registerModuleAnalyses(modules);
    passes.registerCGSCCAnalyses(calls);
    passes.registerFunctionAnalyses(functions);
    passes.registerLoopAnalyses(loops);
    passes.crossRegisterProxies(loops, functions, calls, modules);
    passes.buildPerModuleDefaultPipeline(llvm::OptimizationLevel::O2).run(module, modules);
}

void verify_or_exit(const llvm::Module& module) {
    if (llvm::verifyModule(module, &llvm::errs())) std::abort();
}

/// void run(const void* const* inputs, void* const* outputs, size_t count)
void make_loop(llvm::Module& module, const Variant& variant, const std::vector<Kind>& inputs, const Emit& emit) {
    llvm::LLVMContext& context = module.getContext();
    llvm::IRBuilder<> builder(context);
    llvm::Type* pointer = builder.getPtrTy();
    llvm::Type* size = builder.getInt64Ty();
    auto* function =
        llvm::Function::Create(llvm::FunctionType::get(builder.getVoidTy(), {pointer, pointer, size}, false),
                               llvm::Function::ExternalLinkage, "run", module);
    auto* entry = llvm::BasicBlock::Create(context, "entry", function);
    auto* body = llvm::BasicBlock::Create(context, "body", function);
    auto* end = llvm::BasicBlock::Create(context, "end", function);
    builder.SetInsertPoint(entry);
    builder.CreateBr(body);
    builder.SetInsertPoint(body);
    auto* index = builder.CreatePHI(size, 2);
    index->addIncoming(builder.getInt64(0), entry);
    const auto element_address = [&](llvm::Value* arrays, std::size_t i, llvm::Type* element) {
        llvm::Value* array = builder.CreateLoad(pointer, builder.CreateConstGEP1_64(pointer, arrays, i));
        return builder.CreateGEP(element, array, index);
    };
    std::vector<llvm::Value*> arguments;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        llvm::Type* element = element_type(context, inputs[i]);
        arguments.push_back(builder.CreateAlignedLoad(
            value_type(element, variant.lanes), element_address(function->getArg(0), i, element), llvm::Align(1)));
    }
    Math math(builder, variant.options);
    const std::vector<llvm::Value*> results = emit(math, arguments);
    for (std::size_t i = 0; i < results.size(); ++i) {
        llvm::Type* element = results[i]->getType()->getScalarType();
        builder.CreateAlignedStore(results[i], element_address(function->getArg(1), i, element), llvm::Align(1));
    }
    llvm::Value* next = builder.CreateAdd(index, builder.getInt64(variant.lanes));
    index->addIncoming(next, builder.GetInsertBlock());
    builder.CreateCondBr(builder.CreateICmpULT(next, function->getArg(2)), body, end);
    builder.SetInsertPoint(end);
    builder.CreateRetVoid();
    verify_or_exit(module);
}

}  // namespace

std::string Variant::name() const {
    return std::to_string(lanes) + " lanes, " + (processor.empty() ? "host" : processor) +
           (options.contract ? ", contract" : "") + (options.half_instructions ? ", half instructions" : "") +
           (options.exponent_instructions ? ", exponent instructions" : "") +
           (options.conversion_instructions ? ", conversion instructions" : "") + (optimized ? ", optimized" : "");
}

std::vector<Variant> measured_variants() {
    std::vector<Variant> variants{{.optimized = true}, {.options = {.contract = true}, .optimized = true}};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512vl"))
        for (const unsigned lanes : {16u, 8u, 4u, 1u})
            variants.push_back(
                {.lanes = lanes, .options = {.contract = true, .exponent_instructions = true}, .optimized = true});
#endif
    return variants;
}

std::vector<Variant> exact_variants() {
    std::vector<Variant> variants{
        {.lanes = 16, .optimized = true},        {.lanes = 1},
        {.lanes = 4, .optimized = true},         {.lanes = 8},
        {.lanes = 4, .processor = "x86-64"},     {.lanes = 1, .processor = "x86-64", .optimized = true},
        {.lanes = 16, .processor = "x86-64-v3"},
    };
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512vl"))
        for (const unsigned lanes : {16u, 8u, 4u, 1u})
            variants.push_back({.lanes = lanes, .options = {.conversion_instructions = true}});
#endif
    return variants;
}

struct CompiledFunction::Program {
    std::unique_ptr<llvm::orc::LLJIT> jit;
    Run run;
};

CompiledFunction::CompiledFunction(const Variant& variant, std::vector<Kind> inputs, const Emit& emit)
    : program_(std::make_unique<Program>()) {
    auto target = target_of(variant);
    program_->jit = or_exit(llvm::orc::LLJITBuilder().setJITTargetMachineBuilder(target).create());
    auto context = std::make_unique<llvm::LLVMContext>();
    auto module = std::make_unique<llvm::Module>("test", *context);
    module->setDataLayout(program_->jit->getDataLayout());
    make_loop(*module, variant, inputs, emit);
    if (variant.optimized) {
        const auto machine = or_exit(target.createTargetMachine());
        optimize(*module, machine.get());
    }
    or_exit(program_->jit->addIRModule(llvm::orc::ThreadSafeModule(std::move(module), std::move(context))));
    program_->run = or_exit(program_->jit->lookup("run")).toPtr<Run>();
}

CompiledFunction::~CompiledFunction() = default;
CompiledFunction::CompiledFunction(CompiledFunction&&) noexcept = default;

void CompiledFunction::run(std::span<const void* const> inputs, std::span<void* const> outputs,
                           std::size_t count) const {
    if (count % 16 != 0) std::abort();
    if (count > 0) program_->run(inputs.data(), outputs.data(), count);
}

std::string assembly(const Variant& variant, const std::vector<Kind>& inputs, const Emit& emit) {
    auto machine = or_exit(target_of(variant).createTargetMachine());
    llvm::LLVMContext context;
    llvm::Module module("test", context);
    module.setDataLayout(machine->createDataLayout());
    std::vector<llvm::Type*> parameters;
    for (const Kind kind : inputs) parameters.push_back(value_type(element_type(context, kind), variant.lanes));
    // One output, of whatever type the emitted value has: known only after it was emitted once.
    llvm::IRBuilder<> builder(context);
    auto* probe = llvm::Function::Create(llvm::FunctionType::get(builder.getVoidTy(), parameters, false),
                                         llvm::Function::InternalLinkage, "probe", module);
    const auto emit_into = [&](llvm::Function* function) {
        builder.SetInsertPoint(llvm::BasicBlock::Create(context, "entry", function));
        std::vector<llvm::Value*> arguments;
        for (llvm::Argument& argument : function->args()) arguments.push_back(&argument);
        Math math(builder, variant.options);
        return emit(math, arguments).front();
    };
    llvm::Type* result = emit_into(probe)->getType();
    probe->eraseFromParent();
    auto* function = llvm::Function::Create(llvm::FunctionType::get(result, parameters, false),
                                            llvm::Function::ExternalLinkage, "function", module);
    function->addFnAttr("min-legal-vector-width", "512");
    function->addFnAttr("prefer-vector-width", "512");
    function->addFnAttr(llvm::Attribute::NoUnwind);
    builder.CreateRet(emit_into(function));
    verify_or_exit(module);
    optimize(module, machine.get());
    llvm::SmallString<0> text;
    llvm::raw_svector_ostream stream(text);
    llvm::legacy::PassManager passes;
    if (machine->addPassesToEmitFile(passes, stream, nullptr, llvm::CodeGenFileType::AssemblyFile)) std::abort();
    passes.run(module);
    return std::string(text);
}

}  // namespace nacre::cpu
