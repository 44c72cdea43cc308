// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <llvm/IR/Constants.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

namespace {

/// Instructions of a block up to which running it with no lane costs less than asking whether there is one.
constexpr std::size_t most_cheap_instructions = 10;
/// Calls nested in each other; valid SPIR-V has no recursion, so this only bounds the work.
constexpr std::uint32_t most_calls = 256;

}  // namespace

void Emitter::analyze_frame(Frame& made) {
    const Function& function = *made.function;
    const auto count = static_cast<std::uint32_t>(function.blocks.size());
    made.blocks.resize(count);
    for (std::uint32_t header = 0; header < count; ++header)
        if (function.blocks[header].continue_target && uniformity.has_divergent_exit(function.blocks[header].id))
            for (std::uint32_t i = header; i < end_of_construct(function, header); ++i) made.blocks[i].divergent_loop = header;
    std::unordered_map<Id, std::uint32_t> home;
    for (std::uint32_t i = 0; i < count; ++i) {
        for (const Instruction& at : function.blocks[i].phis) home[at.result] = i;
        for (const Instruction& at : function.blocks[i].body)
            if (at.result) home[at.result] = i;
    }
    const auto use = [&](Id id, std::uint32_t block) {
        const auto found = home.find(id);
        if (found == home.end() || found->second == block) return;
        made.crossing.insert(id);
        const std::uint32_t loop = made.blocks[found->second].divergent_loop;
        if (loop != ~0u && (block < loop || block >= end_of_construct(function, loop))) made.leaving.insert(id);
    };
    for (std::uint32_t i = 0; i < count; ++i) {
        const Block& block = function.blocks[i];
        for (const Instruction& at : block.phis)
            for (std::size_t k = 0; k + 1 < at.operands.size(); k += 2)
                if (const auto from = function.find_block(at.operands[k + 1])) use(at.operands[k], *from);
        // Literals that look like ids do no harm: a slot too many, which LLVM removes.
        for (const Instruction& at : block.body)
            for (const std::uint32_t operand : at.operands) use(operand, i);
        for (const std::uint32_t operand : block.terminator.operands) use(operand, i);
    }
    // Pointers and images are made again where they are used, from operands that must last until there.
    for (std::uint32_t i = count; i-- > 0;)
        for (auto at = function.blocks[i].body.rbegin(); at != function.blocks[i].body.rend(); ++at) {
            if (!at->result || !at->type || !made.crossing.contains(at->result)) continue;
            const Type& type = module.type(at->type);
            if (type.kind != TypeKind::pointer && !type.is_opaque()) continue;
            for (const std::uint32_t operand : at->operands) {
                const auto found = home.find(operand);
                if (found == home.end()) continue;
                made.crossing.insert(operand);
                if (made.blocks[found->second].divergent_loop != ~0u) made.leaving.insert(operand);
            }
        }

    for (std::uint32_t header = 0; header < count; ++header) {
        const Block& block = function.blocks[header];
        // Lanes meet again at the merge block if every way through the construct leads there.
        const auto merge = function.find_block(block.merge);
        if (!merge || *merge <= header) continue;
        bool meets = true;
        for (std::uint32_t i = header; i < *merge && meets; ++i) {
            // Unreachable blocks of the construct have no predecessors.
            if (i != header && function.blocks[i].predecessors.empty()) continue;
            if (function.blocks[i].successors.empty()) meets = false;
            for (const Id successor : function.blocks[i].successors) {
                const auto to = function.find_block(successor);
                if (!to || *to > *merge || *to < header || (*to == header && !block.continue_target)) meets = false;
            }
        }
        for (const std::uint32_t from : function.blocks[*merge].predecessors)
            if (from < header || from >= *merge) meets = false;
        if (!meets) continue;
        made.blocks[header].reconverges = true;
        made.blocks[*merge].is_reconverged = true;
    }
}

std::vector<Component> Emitter::emit_function(const Function& callee, const std::vector<Value>& arguments,
                                              llvm::Value* entry_mask) {
    if (++call_depth > most_calls) reject("functions call each other more than 256 deep");
    Frame made;
    made.function = &callee;
    made.entry_mask = entry_mask;
    analyze_frame(made);
    Frame* const outer = frame;
    llvm::Value* const outer_mask = mask;
    const Instruction* const outer_instruction = current;
    frame = &made;
    made.chains.push_back(++chain_count);
    for (std::size_t i = 0; i < callee.parameters.size(); ++i) made.values[callee.parameters[i].result] = arguments[i];
    for (std::uint32_t i = 0; i < callee.blocks.size(); ++i) {
        Frame::BlockState& state = made.blocks[i];
        state.reached = make_slot(builder.getInt1Ty(), "reached");
        state.mask = make_slot(mask_type, "mask");
        builder.CreateStore(builder.getFalse(), state.reached);
        builder.CreateStore(llvm::Constant::getNullValue(mask_type), state.mask);
        if (callee.blocks[i].continue_target) {
            state.back_reached = make_slot(builder.getInt1Ty(), "back_reached");
            state.back_mask = make_slot(mask_type, "back_mask");
        }
        for (const Instruction& phi : callee.blocks[i].phis) {
            const bool is_uniform = !uniformity.is_divergent(phi.result);
            std::vector<llvm::AllocaInst*> phi_slots;
            const Type& type = module.type(phi.type);
            if (type.kind == TypeKind::pointer || type.is_opaque()) {
                current = &phi;
                reject("pointers that depend on control flow (variable pointers) are not supported");
            }
            for_each_component_type(phi.type, [&](const Type& scalar) {
                llvm::Type* kind = scalar_type(scalar);
                phi_slots.push_back(make_slot(is_uniform ? kind : vector_of(kind), "phi"));
            });
            state.phi_slots.push_back(std::move(phi_slots));
            state.phi_uniform.push_back(is_uniform);
        }
    }
    const Type& result = module.type(callee.return_type);
    if (result.components > 0)
        for_each_component_type(callee.return_type, [&](const Type& scalar) {
            made.return_slots.push_back(make_slot(vector_of(scalar_type(scalar)), "return"));
        });
    if (!callee.blocks.empty()) {
        builder.CreateStore(builder.getTrue(), made.blocks[0].reached);
        builder.CreateStore(entry_mask, made.blocks[0].mask);
        emit_range(0, static_cast<std::uint32_t>(callee.blocks.size()));
    }
    std::vector<Component> values;
    for (llvm::AllocaInst* slot : made.return_slots)
        values.emplace_back(builder.CreateLoad(slot->getAllocatedType(), slot));
    frame = outer;
    mask = outer_mask;
    current = outer_instruction;
    --call_depth;
    return values;
}

void Emitter::emit_range(std::uint32_t begin, std::uint32_t end) {
    while (begin < end) begin = emit_chain(begin, end);
}

bool Emitter::is_cheap(std::uint32_t index) const {
    const Block& block = frame->function->blocks[index];
    if (block.terminator.op != Op::OpBranch || block.merge || block.continue_target) return false;
    if (block.body.size() > most_cheap_instructions) return false;
    // A branch that all lanes take together is never mispredicted in a way that costs, and scalars may not be stored
    // where the block does not run.
    if (block.predecessors.size() != 1 || !uniformity.has_divergent_branch(*frame->function, block.predecessors[0]))
        return false;
    if (const auto to = frame->function->find_block(block.terminator.operand(0)); !to || *to <= index) return false;
    for (const Instruction& at : block.body) {
        switch (at.op) {
            case Op::OpStore: case Op::OpLoad: {
                const Type& type = module.type(module.type_of(at.operand(0)));
                if (type.storage != spv::StorageClass::Function && type.storage != spv::StorageClass::Private) return false;
                break;
            }
            case Op::OpFAdd: case Op::OpFSub: case Op::OpFMul: case Op::OpFNegate: case Op::OpIAdd: case Op::OpISub:
            case Op::OpIMul: case Op::OpBitwiseAnd: case Op::OpBitwiseOr: case Op::OpBitwiseXor: case Op::OpNot:
            case Op::OpSelect: case Op::OpCompositeExtract: case Op::OpCompositeConstruct: case Op::OpVectorShuffle:
            case Op::OpVectorTimesScalar: case Op::OpFOrdLessThan: case Op::OpFOrdGreaterThan: case Op::OpLogicalAnd:
            case Op::OpLogicalOr: case Op::OpLogicalNot: case Op::OpBitcast: case Op::OpShiftLeftLogical:
            case Op::OpShiftRightLogical: case Op::OpIEqual: case Op::OpINotEqual: case Op::OpSLessThan:
            case Op::OpULessThan: case Op::OpFDiv: case Op::OpConvertSToF: case Op::OpConvertUToF:
                if (module.has_type(at.type) && module.type(at.type).components > 4) return false;
                break;
            default: return false;
        }
    }
    return true;
}

std::uint32_t Emitter::emit_chain(std::uint32_t first, std::uint32_t end) {
    const Function& function = *frame->function;
    Frame::BlockState& start = frame->blocks[first];
    llvm::BasicBlock* after = nullptr;
    const bool is_guarded = first != 0 && !is_cheap(first);
    const bool was_unguarded = runs_without_lanes;
    runs_without_lanes = first != 0 && !is_guarded;
    if (is_guarded) {
        llvm::BasicBlock* body = llvm::BasicBlock::Create(context, "block", function_);
        after = llvm::BasicBlock::Create(context, "next", function_);
        builder.CreateCondBr(builder.CreateLoad(builder.getInt1Ty(), start.reached), body, after);
        builder.SetInsertPoint(body);
    }
    // The entry's mask is taken as it is, so that what is known of it (all lanes) is known everywhere.
    llvm::Value* chain_mask = first == 0 ? frame->entry_mask : builder.CreateLoad(mask_type, start.mask);
    frame->chains.push_back(++chain_count);
    std::uint32_t at = first;
    for (;;) {
        const Block& block = function.blocks[at];
        std::uint32_t next = at + 1;
        if (block.continue_target) {
            const std::uint32_t loop_end = std::min(end_of_construct(function, at), end);
            emit_loop_body(at, loop_end, chain_mask);
            next = loop_end;
        } else {
            emit_block(at, chain_mask);
        }
        if (frame->blocks[at].reconverges) {
            const std::uint32_t merge = *function.find_block(block.merge);
            emit_range(next, std::min(merge, end));
            if (merge < end) {
                at = merge;
                continue;
            }
            // Behind the range: found there by its mask, as any other block.
            builder.CreateStore(builder.getTrue(), frame->blocks[merge].reached);
            builder.CreateStore(chain_mask, frame->blocks[merge].mask);
            next = end;
        } else if (!runs_without_lanes && !block.continue_target && block.terminator.op == Op::OpBranch && next < end &&
                   function.find_block(block.terminator.operand(0)) == next &&
                   function.blocks[next].predecessors.size() == 1) {
            at = next;
            continue;
        }
        at = next;
        break;
    }
    frame->chains.pop_back();
    runs_without_lanes = was_unguarded;
    if (is_guarded) {
        builder.CreateBr(after);
        builder.SetInsertPoint(after);
    }
    return at;
}

void Emitter::emit_loop_body(std::uint32_t header, std::uint32_t end, llvm::Value* entry_mask) {
    Frame::BlockState& state = frame->blocks[header];
    llvm::BasicBlock* head = llvm::BasicBlock::Create(context, "loop", function_);
    llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "left_loop", function_);
    builder.CreateStore(entry_mask, state.mask);
    builder.CreateBr(head);
    builder.SetInsertPoint(head);
    llvm::Value* loop_mask = builder.CreateLoad(mask_type, state.mask);
    llvm::Value* none = llvm::Constant::getNullValue(mask_type);
    for (std::uint32_t i = header + 1; i < end; ++i) {
        builder.CreateStore(builder.getFalse(), frame->blocks[i].reached);
        builder.CreateStore(none, frame->blocks[i].mask);
    }
    builder.CreateStore(builder.getFalse(), state.back_reached);
    builder.CreateStore(none, state.back_mask);
    frame->chains.push_back(++chain_count);
    emit_block(header, loop_mask);
    emit_range(header + 1, end);
    frame->chains.pop_back();
    llvm::Value* again = builder.CreateLoad(builder.getInt1Ty(), state.back_reached);
    builder.CreateStore(builder.CreateLoad(mask_type, state.back_mask), state.mask);
    // Asked in each iteration, so that a shader without end can be stopped from outside.
    llvm::Value* execution = load_context(offsetof(ShaderContext, state), pointer_type);
    llvm::LoadInst* expired = builder.CreateAlignedLoad(builder.getInt32Ty(), execution, llvm::Align(4));
    expired->setAtomic(llvm::AtomicOrdering::Monotonic);
    builder.CreateCondBr(builder.CreateAnd(again, builder.CreateICmpEQ(expired, int32(0))), head, after);
    builder.SetInsertPoint(after);
}

void Emitter::emit_block(std::uint32_t index, llvm::Value* block_mask) {
    const Block& block = frame->function->blocks[index];
    Frame::BlockState& state = frame->blocks[index];
    frame->block = index;
    mask = block_mask;
    for (std::size_t i = 0; i < block.phis.size(); ++i) {
        current = &block.phis[i];
        std::vector<Component> components;
        for (llvm::AllocaInst* slot : state.phi_slots[i])
            components.emplace_back(builder.CreateLoad(slot->getAllocatedType(), slot));
        define(block.phis[i].result).components = std::move(components);
        finish_definition(block.phis[i].result);
    }
    for (const Instruction& at : block.body) {
        current = &at;
        if (options.checks) check_operands(at);
        emit_instruction(at);
        current = &at;
        if (options.checks) check_result(at);
    }
    current = &block.terminator;
    if (options.checks) check_operands(block.terminator);
    emit_terminator(index);
    current = nullptr;
}

void Emitter::emit_terminator(std::uint32_t index) {
    const Instruction& end = frame->function->blocks[index].terminator;
    switch (end.op) {
        case Op::OpBranch: emit_edge(index, end.operand(0), nullptr); return;
        case Op::OpBranchConditional: {
            if (end.operand(1) == end.operand(2)) return emit_edge(index, end.operand(1), nullptr);
            llvm::Value* condition = get_scalar(end.operand(0)).value;
            emit_edge(index, end.operand(1), condition);
            emit_edge(index, end.operand(2), builder.CreateNot(condition));
            return;
        }
        case Op::OpSwitch: {
            const Component selector = get_scalar(end.operand(0));
            const Type& type = module.type(module.type_of(end.operand(0)));
            const std::size_t step = type.bits > 32 ? 3 : 2;
            std::vector<std::pair<Id, llvm::Value*>> targets;
            llvm::Type* kind = selector.value->getType();
            llvm::Value* none = llvm::ConstantInt::getFalse(selector.is_uniform() ? builder.getInt1Ty()
                                                                                  : static_cast<llvm::Type*>(mask_type));
            llvm::Value* matched = none;
            const auto condition_of = [&](Id block) -> llvm::Value*& {
                for (auto& [id, condition] : targets)
                    if (id == block) return condition;
                return targets.emplace_back(block, none).second;
            };
            condition_of(end.operand(1));
            for (std::size_t i = 2; i + step - 1 < end.operands.size(); i += step) {
                std::uint64_t value = end.operands[i];
                if (step == 3) value |= std::uint64_t{end.operands[i + 1]} << 32;
                if (type.bits < 64) value &= (1ull << type.bits) - 1;
                llvm::Value* equal = builder.CreateICmpEQ(selector.value, llvm::ConstantInt::get(kind, value));
                matched = builder.CreateOr(matched, equal);
                llvm::Value*& condition = condition_of(end.operands[i + step - 1]);
                condition = builder.CreateOr(condition, equal);
            }
            llvm::Value*& otherwise = condition_of(end.operand(1));
            otherwise = builder.CreateOr(otherwise, builder.CreateNot(matched));
            if (targets.size() == 1) return emit_edge(index, targets[0].first, nullptr);
            for (const auto& [id, condition] : targets) emit_edge(index, id, condition);
            return;
        }
        case Op::OpReturnValue: {
            const Value value = get(end.operand(0));
            for (std::size_t i = 0; i < frame->return_slots.size(); ++i) {
                llvm::AllocaInst* slot = frame->return_slots[i];
                llvm::Value* old = builder.CreateLoad(slot->getAllocatedType(), slot);
                builder.CreateStore(select(mask, widen(value.components.at(i)), old), slot);
            }
            return;
        }
        case Op::OpKill:
        case Op::OpTerminateInvocation:
            if (live_slot) {
                llvm::Value* none = llvm::Constant::getNullValue(mask_type);
                store_live(builder.CreateSelect(mask, none, live()));
            }
            return;
        case Op::OpReturn:
        case Op::OpUnreachable:
        default: return;
    }
}

void Emitter::emit_edge(std::uint32_t from, Id to, llvm::Value* condition) {
    const Function& function = *frame->function;
    const auto target_index = function.find_block(to);
    if (!target_index) return;
    const Block& block = function.blocks[*target_index];
    Frame::BlockState& state = frame->blocks[*target_index];
    const bool is_back = *target_index <= from;
    llvm::Value* edge_mask = both(mask, condition);

    // Phis: all are read before any is written, as they may use each other.
    std::vector<std::vector<llvm::Value*>> incoming(block.phis.size());
    for (std::size_t i = 0; i < block.phis.size(); ++i) {
        const Instruction& phi = block.phis[i];
        for (std::size_t k = 0; k + 1 < phi.operands.size(); k += 2) {
            if (phi.operands[k + 1] != function.blocks[from].id) continue;
            const Value value = get(phi.operands[k]);
            for (const Component& component : value.components)
                incoming[i].push_back(state.phi_uniform[i] ? narrow(component, edge_mask) : widen(component));
            break;
        }
    }
    // Lanes that leave a loop one by one add to those that left it in earlier iterations.
    const std::uint32_t loop = frame->blocks[from].divergent_loop;
    const bool leaves = loop != ~0u && (*target_index < loop || *target_index >= end_of_construct(function, loop));
    // The only way into a block, and the ways into a loop, bring values for all lanes that come; others add to what lanes
    // before them brought.
    bool is_plain = is_back || block.predecessors.size() == 1;
    if (block.continue_target && !is_back) {
        std::size_t entries = 0;
        for (const std::uint32_t predecessor : block.predecessors) entries += predecessor < *target_index;
        is_plain = entries == 1;
    }
    is_plain = is_plain && !leaves;
    for (std::size_t i = 0; i < block.phis.size(); ++i)
        for (std::size_t k = 0; k < incoming[i].size(); ++k) {
            llvm::AllocaInst* slot = state.phi_slots[i][k];
            llvm::Value* value = incoming[i][k];
            if (state.phi_uniform[i]) {
                // A scalar is written only if the edge is taken; then no other edge into the block is.
                if (condition && !is_plain) {
                    llvm::Value* taken = condition->getType()->isVectorTy() ? any(edge_mask) : condition;
                    value = select(taken, value, builder.CreateLoad(slot->getAllocatedType(), slot));
                }
            } else if (!is_plain) {
                value = select(edge_mask, value, builder.CreateLoad(slot->getAllocatedType(), slot));
            }
            builder.CreateStore(value, slot);
        }

    // Where all lanes of the header meet again nothing needs to be counted.
    if (state.is_reconverged && !is_back) return;
    llvm::AllocaInst* reached = is_back ? state.back_reached : state.reached;
    llvm::AllocaInst* gathered = is_back ? state.back_mask : state.mask;
    if (!reached) reject("a branch leads back to a block that is no loop header");
    llvm::Value* taken = !condition                          ? runs_without_lanes ? any(mask) : builder.getTrue()
                         : condition->getType()->isVectorTy() ? any(edge_mask)
                                                             : condition;
    if (block.predecessors.size() == 1 && !leaves) {
        // One way in: the mask counts only if the block is reached, so a scalar condition need not clear it.
        builder.CreateStore(taken, reached);
        builder.CreateStore(condition && !condition->getType()->isVectorTy() ? mask : edge_mask, gathered);
        return;
    }
    builder.CreateStore(builder.CreateOr(builder.CreateLoad(builder.getInt1Ty(), reached), taken), reached);
    builder.CreateStore(builder.CreateOr(builder.CreateLoad(mask_type, gathered), edge_mask), gathered);
}

}  // namespace nacre::cpu
