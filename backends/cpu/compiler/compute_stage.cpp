// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <llvm/IR/Constants.h>
#include <llvm/IR/Intrinsics.h>

#include "backends/cpu/compiler/stages.h"

namespace nacre::cpu {

using spv::BuiltIn;
using spv::Op;

/// Whether a barrier is one of the workgroup: the lanes of a subgroup run together anyway.
bool ComputeEmitter::waits_for_workgroup(const Instruction& barrier) const {
    return module.constant_word(barrier.operand(0)) != static_cast<std::uint32_t>(spv::Scope::Subgroup);
}

bool ComputeEmitter::emit_stage(const Instruction& at) {
    switch (at.op) {
        case Op::OpControlBarrier: {
            if (options.checks) check_barrier();
            if (!has_barriers || !waits_for_workgroup(at)) return true;
            // All subgroups of the workgroup come to this point before the first of them goes on.
            llvm::Value* state = builder.CreateIntrinsic(llvm::Intrinsic::coro_suspend, {},
                                                         {llvm::ConstantTokenNone::get(context), builder.getFalse()});
            llvm::BasicBlock* resumed = llvm::BasicBlock::Create(context, "resumed", function_);
            llvm::SwitchInst* next = builder.CreateSwitch(state, suspend_block, 2);
            next->addCase(builder.getInt8(0), resumed);
            next->addCase(builder.getInt8(1), cleanup_block);
            builder.SetInsertPoint(resumed);
            return true;
        }
        case Op::OpDPdx:
        case Op::OpDPdy:
        case Op::OpFwidth:
        case Op::OpDPdxFine:
        case Op::OpDPdyFine:
        case Op::OpFwidthFine:
        case Op::OpDPdxCoarse:
        case Op::OpDPdyCoarse:
        case Op::OpFwidthCoarse:
            reject("derivatives in a compute shader are not supported");
        default: return false;
    }
}

std::vector<Component> ComputeEmitter::input_components(const Variable& variable) {
    if (!variable.builtin) reject("an input of a compute shader is no built-in variable");
    if (auto of_subgroup = subgroup_input(*variable.builtin)) return std::move(*of_subgroup);
    const auto range_word = [&](std::size_t offset) {
        return invariant_load(builder.getInt32Ty(), at_offset(range, static_cast<std::int64_t>(offset)), 4);
    };
    const std::array<std::uint32_t, 3>& size = module.workgroup_size;
    const std::array<llvm::Value*, 3> group{group_x, range_word(offsetof(WorkgroupRange, y)),
                                            range_word(offsetof(WorkgroupRange, z))};
    switch (*variable.builtin) {
        case BuiltIn::WorkgroupId: return {Component(group[0]), Component(group[1]), Component(group[2])};
        case BuiltIn::NumWorkgroups:
            return {Component(range_word(offsetof(WorkgroupRange, count))),
                    Component(range_word(offsetof(WorkgroupRange, count) + 4)),
                    Component(range_word(offsetof(WorkgroupRange, count) + 8))};
        case BuiltIn::WorkgroupSize:
            return {Component(int32(size[0])), Component(int32(size[1])), Component(int32(size[2]))};
        case BuiltIn::LocalInvocationId: return {local_id[0], local_id[1], local_id[2]};
        case BuiltIn::GlobalInvocationId: {
            std::vector<Component> made;
            for (std::size_t i = 0; i < 3; ++i)
                made.push_back(add(local_id[i], Component(builder.CreateMul(group[i], int32(size[i])))));
            return made;
        }
        case BuiltIn::LocalInvocationIndex: return {linear(builder.CreateMul(subgroup_index, int32(lanes)), 1)};
        case BuiltIn::NumSubgroups: return {Component(int32(subgroups))};
        case BuiltIn::SubgroupId: return {Component(subgroup_index)};
        case BuiltIn::DeviceIndex: return {Component(int32(0))};
        default:
            reject(fmt::format("built-in input {} is not supported in compute shaders",
                               static_cast<unsigned>(*variable.builtin)));
    }
}

void ComputeEmitter::emit_subgroup_body(llvm::Value* subgroup) {
    subgroup_index = subgroup;
    if (options.checks) begin_checks(rhi::ShaderStage::compute, range, group_x, subgroup);
    const auto& size = module.workgroup_size;
    const std::uint32_t total = size[0] * size[1] * size[2];
    const Component index = linear(builder.CreateMul(subgroup, int32(lanes)), 1);
    // Where rows are as long as a vector or longer, x rises evenly and y and z are the same in all lanes.
    if (size[0] % lanes == 0) {
        llvm::Value* first = builder.CreateMul(subgroup, int32(lanes));
        local_id[0] = linear(builder.CreateURem(first, int32(size[0])), 1);
        llvm::Value* row = builder.CreateUDiv(first, int32(size[0]));
        local_id[1] = builder.CreateURem(row, int32(size[1]));
        local_id[2] = builder.CreateUDiv(row, int32(size[1]));
    } else {
        const auto split = [&](llvm::Value* value, std::uint32_t by) {
            return llvm::ConstantInt::get(value->getType(), by);
        };
        local_id[0] = builder.CreateURem(index.value, split(index.value, size[0]));
        llvm::Value* row = builder.CreateUDiv(index.value, split(index.value, size[0]));
        local_id[1] = size[1] == 1 ? Component(int32(0)) : Component(builder.CreateURem(row, split(row, size[1])));
        local_id[2] = size[2] == 1 ? Component(int32(0)) : Component(builder.CreateUDiv(row, split(row, size[1])));
        if (size[1] == 1 && size[2] == 1) local_id[0] = index;
    }
    if (size[0] % row_lanes() == 0) {
        row_shapes[local_id[0].value] = RowShape::rising;
        for (const std::size_t axis : {1, 2}) row_shapes[local_id[axis].value] = RowShape::equal;
    }
    mask = all_lanes();
    if (total % lanes != 0) mask = builder.CreateICmpULT(index.value, splat(int32(total)));
    llvm::Value* const entry_mask = mask;
    if (trace_table) {
        const std::array<llvm::Value*, 3> group{
            group_x, invariant_load(builder.getInt32Ty(), at_offset(range, offsetof(WorkgroupRange, y)), 4),
            invariant_load(builder.getInt32Ty(), at_offset(range, offsetof(WorkgroupRange, z)), 4)};
        llvm::Value* wanted = load_context(offsetof(ShaderContext, trace), pointer_type);
        std::vector<Component> ids;
        llvm::Value* is_traced = mask;
        for (std::size_t i = 0; i < 3; ++i) {
            ids.push_back(Component(widen(add(local_id[i], Component(builder.CreateMul(group[i], int32(size[i])))))));
            llvm::Value* coordinate = invariant_load(
                builder.getInt32Ty(),
                at_offset(wanted, static_cast<std::int64_t>(offsetof(ShaderTrace, invocation) + 4 * i)), 4);
            is_traced = both(is_traced, builder.CreateICmpEQ(ids.back().value, splat(coordinate)));
        }
        begin_trace(is_traced, std::move(ids));
    }
    declare_variables();
    emit_function(module.entry(), {}, entry_mask);
}

llvm::Value* ComputeEmitter::large_memory(std::uint64_t bytes) {
    if (is_on_heap()) return nullptr;
    // Behind the workgroup's variables, and right behind where their address comes from, so that all code sees it.
    auto* made = llvm::dyn_cast<llvm::Instruction>(memory);
    if (!made || !made->getNextNode()) return nullptr;
    const std::uint64_t offset = (workgroup_variable_bytes + 63) / 64 * 64;
    workgroup_variable_bytes = offset + bytes;
    llvm::IRBuilder<> at(made->getNextNode());
    return at.CreateGEP(at.getInt8Ty(), memory, at.getInt64(offset));
}

void ComputeEmitter::add_stage_values(std::vector<llvm::Value**>& places) {
    places.insert(places.end(), {&range, &memory, &group_x, &subgroup_index});
    for (Component& axis : local_id) places.insert(places.end(), {&axis.value, &axis.linear_base});
}

void ComputeEmitter::emit_plain_kernel() {
    auto* type = llvm::FunctionType::get(builder.getVoidTy(), {pointer_type, pointer_type}, false);
    function_ = llvm::Function::Create(type, llvm::Function::ExternalLinkage, "kernel", target);
    shader_context = function_->getArg(0);
    range = function_->getArg(1);
    slot_block = llvm::BasicBlock::Create(context, "slots", function_);
    llvm::BasicBlock* start = llvm::BasicBlock::Create(context, "start", function_);
    llvm::BasicBlock* groups = llvm::BasicBlock::Create(context, "workgroup", function_);
    llvm::BasicBlock* body = llvm::BasicBlock::Create(context, "subgroup", function_);
    llvm::BasicBlock* next_group = llvm::BasicBlock::Create(context, "next_workgroup", function_);
    llvm::BasicBlock* done = llvm::BasicBlock::Create(context, "done", function_);
    builder.SetInsertPoint(start);
    memory = invariant_load(pointer_type, at_offset(range, offsetof(WorkgroupRange, memory)), 8);
    llvm::Value* begin = invariant_load(builder.getInt32Ty(), at_offset(range, offsetof(WorkgroupRange, x_begin)), 4);
    llvm::Value* end = invariant_load(builder.getInt32Ty(), at_offset(range, offsetof(WorkgroupRange, x_end)), 4);
    builder.CreateCondBr(builder.CreateICmpULT(begin, end), groups, done);
    builder.SetInsertPoint(groups);
    llvm::PHINode* x = builder.CreatePHI(builder.getInt32Ty(), 2, "x");
    x->addIncoming(begin, start);
    group_x = x;
    if (follows_undefined()) check_workgroup(shader_context, memory);
    builder.CreateBr(body);
    builder.SetInsertPoint(body);
    llvm::PHINode* subgroup = builder.CreatePHI(builder.getInt32Ty(), 2, "subgroup");
    subgroup->addIncoming(int32(0), groups);
    emit_subgroup_body(subgroups == 1 ? static_cast<llvm::Value*>(int32(0)) : subgroup);
    llvm::Value* following = builder.CreateAdd(subgroup, int32(1));
    subgroup->addIncoming(following, builder.GetInsertBlock());
    builder.CreateCondBr(builder.CreateICmpULT(following, int32(subgroups)), body, next_group);
    builder.SetInsertPoint(next_group);
    llvm::Value* next_x = builder.CreateAdd(x, int32(1));
    x->addIncoming(next_x, next_group);
    builder.CreateCondBr(builder.CreateICmpULT(next_x, end), groups, done);
    builder.SetInsertPoint(done);
    builder.CreateRetVoid();
    builder.SetInsertPoint(slot_block);
    builder.CreateBr(start);
}

/// Each subgroup is a coroutine that suspends at every barrier:
///     ptr subgroup(context, range, x, index, frame memory or null, ptr to the frame's size)
/// and the kernel runs all of them from barrier to barrier. With null for the memory only the size is told.
void ComputeEmitter::emit_suspending_kernel() {
    llvm::Type* word = builder.getInt32Ty();
    auto* type = llvm::FunctionType::get(pointer_type,
                                         {pointer_type, pointer_type, word, word, pointer_type, pointer_type}, false);
    llvm::Function* coroutine = llvm::Function::Create(type, llvm::Function::InternalLinkage, "subgroup", target);
    coroutine->setPresplitCoroutine();
    function_ = coroutine;
    shader_context = coroutine->getArg(0);
    range = coroutine->getArg(1);
    group_x = coroutine->getArg(2);
    slot_block = llvm::BasicBlock::Create(context, "slots", coroutine);
    llvm::BasicBlock* size_block = llvm::BasicBlock::Create(context, "size_only", coroutine);
    llvm::BasicBlock* begin = llvm::BasicBlock::Create(context, "begin", coroutine);
    cleanup_block = llvm::BasicBlock::Create(context, "cleanup", coroutine);
    suspend_block = llvm::BasicBlock::Create(context, "suspended", coroutine);
    llvm::BasicBlock* start = llvm::BasicBlock::Create(context, "start", coroutine);

    builder.SetInsertPoint(start);
    llvm::Value* null = llvm::ConstantPointerNull::get(pointer_type);
    llvm::Value* id = builder.CreateIntrinsic(llvm::Intrinsic::coro_id, {}, {int32(64), null, null, null});
    llvm::Value* size = builder.CreateIntrinsic(llvm::Intrinsic::coro_size, {builder.getInt64Ty()}, {});
    builder.CreateCondBr(builder.CreateICmpEQ(coroutine->getArg(4), null), size_block, begin);
    builder.SetInsertPoint(size_block);
    builder.CreateStore(size, coroutine->getArg(5));
    builder.CreateRet(null);
    builder.SetInsertPoint(begin);
    llvm::Value* handle = builder.CreateIntrinsic(llvm::Intrinsic::coro_begin, {}, {id, coroutine->getArg(4)});
    memory = invariant_load(pointer_type, at_offset(range, offsetof(WorkgroupRange, memory)), 8);
    emit_subgroup_body(coroutine->getArg(3));
    // The last stop, from which nothing is resumed.
    llvm::Value* state = builder.CreateIntrinsic(llvm::Intrinsic::coro_suspend, {},
                                                 {llvm::ConstantTokenNone::get(context), builder.getTrue()});
    llvm::BasicBlock* never = llvm::BasicBlock::Create(context, "never", coroutine);
    llvm::SwitchInst* last = builder.CreateSwitch(state, suspend_block, 2);
    last->addCase(builder.getInt8(0), never);
    last->addCase(builder.getInt8(1), cleanup_block);
    builder.SetInsertPoint(never);
    builder.CreateUnreachable();
    builder.SetInsertPoint(cleanup_block);
    // Keeps the frame's memory out of the coroutine's care.
    builder.CreateIntrinsic(llvm::Intrinsic::coro_free, {}, {id, handle});
    builder.CreateBr(suspend_block);
    builder.SetInsertPoint(suspend_block);
    builder.CreateIntrinsic(llvm::Intrinsic::coro_end, {},
                            {handle, builder.getFalse(), llvm::ConstantTokenNone::get(context)});
    builder.CreateRet(handle);
    builder.SetInsertPoint(slot_block);
    builder.CreateBr(start);

    // void frame_size(ptr result)
    llvm::Function* frame_size =
        llvm::Function::Create(llvm::FunctionType::get(builder.getVoidTy(), {pointer_type}, false),
                               llvm::Function::ExternalLinkage, "frame_size", target);
    builder.SetInsertPoint(llvm::BasicBlock::Create(context, "start", frame_size));
    builder.CreateCall(coroutine, {null, null, int32(0), int32(0), null, frame_size->getArg(0)});
    builder.CreateRetVoid();

    // void kernel(context, range): frames lie behind the workgroup's variables, each at a multiple of 64 bytes.
    llvm::Function* kernel =
        llvm::Function::Create(llvm::FunctionType::get(builder.getVoidTy(), {pointer_type, pointer_type}, false),
                               llvm::Function::ExternalLinkage, "kernel", target);
    llvm::BasicBlock* entry = llvm::BasicBlock::Create(context, "entry", kernel);
    llvm::BasicBlock* group_loop = llvm::BasicBlock::Create(context, "workgroup", kernel);
    llvm::BasicBlock* launch = llvm::BasicBlock::Create(context, "launch", kernel);
    llvm::BasicBlock* round = llvm::BasicBlock::Create(context, "round", kernel);
    llvm::BasicBlock* resume = llvm::BasicBlock::Create(context, "resume", kernel);
    llvm::BasicBlock* resume_one = llvm::BasicBlock::Create(context, "resume_one", kernel);
    llvm::BasicBlock* resume_next = llvm::BasicBlock::Create(context, "resume_next", kernel);
    llvm::BasicBlock* round_end = llvm::BasicBlock::Create(context, "round_end", kernel);
    llvm::BasicBlock* next_group = llvm::BasicBlock::Create(context, "next_workgroup", kernel);
    llvm::BasicBlock* done = llvm::BasicBlock::Create(context, "done", kernel);
    llvm::Value *kernel_context = kernel->getArg(0), *kernel_range = kernel->getArg(1);
    builder.SetInsertPoint(entry);
    llvm::AllocaInst* frame_bytes = builder.CreateAlloca(builder.getInt64Ty());
    llvm::AllocaInst* handles = builder.CreateAlloca(llvm::ArrayType::get(pointer_type, subgroups));
    builder.CreateCall(frame_size, {frame_bytes});
    llvm::Value* stride = builder.CreateAnd(
        builder.CreateAdd(builder.CreateLoad(builder.getInt64Ty(), frame_bytes), int64(63)), int64(~63ll));
    llvm::Value* frames =
        at_offset(builder.CreateLoad(pointer_type, at_offset(kernel_range, offsetof(WorkgroupRange, memory))),
                  static_cast<std::int64_t>((workgroup_variable_bytes + 63) / 64 * 64));
    llvm::Value* x_begin = builder.CreateLoad(word, at_offset(kernel_range, offsetof(WorkgroupRange, x_begin)));
    llvm::Value* x_end = builder.CreateLoad(word, at_offset(kernel_range, offsetof(WorkgroupRange, x_end)));
    builder.CreateCondBr(builder.CreateICmpULT(x_begin, x_end), group_loop, done);
    builder.SetInsertPoint(group_loop);
    llvm::PHINode* x = builder.CreatePHI(word, 2);
    x->addIncoming(x_begin, entry);
    if (follows_undefined())
        check_workgroup(kernel_context,
                        builder.CreateLoad(pointer_type, at_offset(kernel_range, offsetof(WorkgroupRange, memory))));
    builder.CreateBr(launch);
    builder.SetInsertPoint(launch);
    llvm::PHINode* index = builder.CreatePHI(word, 2);
    index->addIncoming(int32(0), group_loop);
    llvm::Value* wide = builder.CreateZExt(index, builder.getInt64Ty());
    llvm::Value* frame_memory = builder.CreateGEP(builder.getInt8Ty(), frames, builder.CreateMul(wide, stride));
    llvm::Value* made = builder.CreateCall(coroutine, {kernel_context, kernel_range, x, index, frame_memory, null});
    builder.CreateStore(made, builder.CreateGEP(pointer_type, handles, wide));
    llvm::Value* next_index = builder.CreateAdd(index, int32(1));
    index->addIncoming(next_index, launch);
    builder.CreateCondBr(builder.CreateICmpULT(next_index, int32(subgroups)), launch, round);
    // Rounds from barrier to barrier until every subgroup has come to its end.
    builder.SetInsertPoint(round);
    builder.CreateBr(resume);
    builder.SetInsertPoint(resume);
    llvm::PHINode* which = builder.CreatePHI(word, 2);
    llvm::PHINode* running = builder.CreatePHI(builder.getInt1Ty(), 2);
    which->addIncoming(int32(0), round);
    running->addIncoming(builder.getFalse(), round);
    llvm::Value* one = builder.CreateLoad(
        pointer_type, builder.CreateGEP(pointer_type, handles, builder.CreateZExt(which, builder.getInt64Ty())));
    llvm::Value* is_done = builder.CreateIntrinsic(llvm::Intrinsic::coro_done, {}, {one});
    builder.CreateCondBr(is_done, resume_next, resume_one);
    builder.SetInsertPoint(resume_one);
    builder.CreateIntrinsic(llvm::Intrinsic::coro_resume, {}, {one});
    builder.CreateBr(resume_next);
    builder.SetInsertPoint(resume_next);
    llvm::PHINode* still = builder.CreatePHI(builder.getInt1Ty(), 2);
    still->addIncoming(running, resume);
    still->addIncoming(builder.getTrue(), resume_one);
    llvm::Value* next_which = builder.CreateAdd(which, int32(1));
    which->addIncoming(next_which, resume_next);
    running->addIncoming(still, resume_next);
    builder.CreateCondBr(builder.CreateICmpULT(next_which, int32(subgroups)), resume, round_end);
    builder.SetInsertPoint(round_end);
    builder.CreateCondBr(still, round, next_group);
    builder.SetInsertPoint(next_group);
    llvm::Value* next_x = builder.CreateAdd(x, int32(1));
    x->addIncoming(next_x, next_group);
    builder.CreateCondBr(builder.CreateICmpULT(next_x, x_end), group_loop, done);
    builder.SetInsertPoint(done);
    builder.CreateRetVoid();
}

void ComputeEmitter::emit() {
    const auto& size = module.workgroup_size;
    const std::uint64_t total = std::uint64_t{size[0]} * size[1] * size[2];
    if (total == 0 || total > 4096)
        reject("a workgroup has " + std::to_string(total) + " invocations; 1 to 4096 are possible");
    subgroups = static_cast<std::uint32_t>((total + lanes - 1) / lanes);
    for (const auto& [id, function] : module.functions())
        for (const Block& block : function.blocks)
            for (const Instruction& at : block.body)
                has_barriers = has_barriers || (at.op == Op::OpControlBarrier && waits_for_workgroup(at));
    has_barriers = has_barriers && subgroups > 1;
    if (has_barriers) emit_suspending_kernel();
    else emit_plain_kernel();
    workgroup_bytes = workgroup_variable_bytes;
}

}  // namespace nacre::cpu
