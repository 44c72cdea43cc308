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

const Emitter::Shape& Emitter::shape_of(const Function& function) {
    auto& known = shapes_[function.id];
    if (known) return *known;
    known = std::make_unique<Shape>();
    Shape& shape = *known;
    const auto count = static_cast<std::uint32_t>(function.blocks.size());
    shape.blocks.resize(count);
    std::vector<std::uint32_t> outer_loop(count, ~0u);  // Of headers: the loop around theirs.
    for (std::uint32_t header = 0; header < count; ++header) {
        if (!function.blocks[header].continue_target) continue;
        const std::uint32_t end = end_of_construct(function, header);
        Shape::BlockShape& loop = shape.blocks[header];
        loop.end = end;
        for (std::uint32_t i = header; i < end; ++i)
            loop.returns_values |= function.blocks[i].terminator.op == Op::OpReturnValue;
        if (!uniformity.has_divergent_exit(function.blocks[header].id)) continue;
        outer_loop[header] = loop.divergent_loop;
        for (std::uint32_t i = header; i < end; ++i) {
            shape.blocks[i].divergent_loop = header;
            for (const Id successor : function.blocks[i].successors)
                if (const auto to = function.find_block(successor); to && (*to < header || *to >= end))
                    loop.targets.push_back(*to);
        }
        std::ranges::sort(loop.targets);
        loop.targets.erase(std::ranges::unique(loop.targets).begin(), loop.targets.end());
    }
    find_uses(function, shape);
    for (const auto& [id, use] : shape.uses) {
        if (!use.is_leaving) continue;
        for (std::uint32_t loop = shape.blocks[use.home].divergent_loop; loop != ~0u; loop = outer_loop[loop])
            if (use.last >= shape.blocks[loop].end) shape.blocks[loop].leaving.push_back(id);
    }
    // So that the code made does not depend on the order of a hash table.
    for (Shape::BlockShape& block : shape.blocks) std::ranges::sort(block.leaving);

    for (std::uint32_t header = 0; header < count; ++header) {
        const Block& block = function.blocks[header];
        // Lanes meet again at the merge block if every way through the construct leads there.
        const auto merge_block = function.find_block(block.merge);
        if (!merge_block || *merge_block <= header) continue;
        bool meets = true;
        for (std::uint32_t i = header; i < *merge_block && meets; ++i) {
            // Unreachable blocks of the construct have no predecessors.
            if (i != header && function.blocks[i].predecessors.empty()) continue;
            if (function.blocks[i].successors.empty()) meets = false;
            for (const Id successor : function.blocks[i].successors) {
                const auto to = function.find_block(successor);
                if (!to || *to > *merge_block || *to < header || (*to == header && !block.continue_target))
                    meets = false;
            }
        }
        for (const std::uint32_t from : function.blocks[*merge_block].predecessors)
            if (from < header || from >= *merge_block) meets = false;
        if (!meets) continue;
        shape.blocks[header].reconverges = true;
        shape.blocks[*merge_block].is_reconverged = true;
    }
    return shape;
}

void Emitter::find_uses(const Function& function, Shape& shape) const {
    const auto count = static_cast<std::uint32_t>(function.blocks.size());
    const auto is_remade = [&](const Instruction& at) {
        if (!at.type || !module.has_type(at.type)) return false;
        const Type& type = module.type(at.type);
        // Pointers that depend on control flow are values.
        const bool is_value = at.op == Op::OpSelect || at.op == Op::OpLoad || at.op == Op::OpFunctionCall ||
                              at.op == Op::OpCompositeExtract;
        return type.is_opaque() || (type.kind == TypeKind::pointer && !is_value);
    };
    for (std::uint32_t i = 0; i < count; ++i) {
        for (const Instruction& at : function.blocks[i].phis) shape.uses[at.result] = {i, i, false, false};
        for (const Instruction& at : function.blocks[i].body)
            if (at.result) shape.uses[at.result] = {i, i, false, is_remade(at)};
    }
    const auto use = [&](Id id, std::uint32_t block) {
        const auto found = shape.uses.find(id);
        if (found == shape.uses.end()) return;
        found->second.is_used = true;
        if (found->second.home == block) return;
        found->second.last = std::max(found->second.last, block);
        const std::uint32_t loop = shape.blocks[found->second.home].divergent_loop;
        if (loop != ~0u && (block < loop || block >= shape.blocks[loop].end)) found->second.is_leaving = true;
    };
    for (std::uint32_t i = 0; i < count; ++i) {
        const Block& block = function.blocks[i];
        for (const Instruction& at : block.phis)
            for (std::size_t k = 0; k + 1 < at.operands.size(); k += 2)
                if (const auto from = function.find_block(at.operands[k + 1])) use(at.operands[k], *from);
        // Literals that look like ids do no harm: a value that lasts longer than it need.
        for (const Instruction& at : block.body)
            for (const std::uint32_t operand : at.operands) use(operand, i);
        for (const std::uint32_t operand : block.terminator.operands) use(operand, i);
    }
    // Behind the loops that lanes leave one by one, pointers and images are made again from their operands.
    for (std::uint32_t i = count; i-- > 0;)
        for (auto at = function.blocks[i].body.rbegin(); at != function.blocks[i].body.rend(); ++at) {
            if (!at->result || !at->type) continue;
            const Shape::Use& made = shape.uses.at(at->result);
            if (!made.is_leaving || !made.is_remade) continue;
            const std::uint32_t last = made.last;
            for (const std::uint32_t operand : at->operands) {
                const auto found = shape.uses.find(operand);
                if (found == shape.uses.end()) continue;
                found->second.last = std::max(found->second.last, last);
                if (shape.blocks[found->second.home].divergent_loop != ~0u) found->second.is_leaving = true;
            }
        }
}

void Emitter::assign(llvm::Value*& place, llvm::Value* value, llvm::Value* otherwise, std::uint32_t last_use) {
    frame->changes.push_back({&place, place, otherwise, last_use});
    place = value;
}

void Emitter::merge(std::size_t first_change, llvm::BasicBlock* skipped, llvm::BasicBlock* ran, std::uint32_t next) {
    auto& changes = frame->changes;
    std::unordered_set<llvm::Value**> seen;
    std::size_t kept = first_change;
    for (std::size_t i = first_change; i < changes.size(); ++i) {
        const Frame::Change change = changes[i];
        if (change.last_use < next || !*change.place || !seen.insert(change.place).second) continue;
        llvm::Value* const now = *change.place;
        llvm::Value* before = change.before ? change.before : change.otherwise;
        // Constants are the same wherever they are needed.
        if (!before && llvm::isa<llvm::Constant>(now)) before = now;
        if (!before) before = llvm::UndefValue::get(now->getType());
        if (before != now) {
            llvm::PHINode* either = builder.CreatePHI(now->getType(), 2);
            either->addIncoming(now, ran);
            either->addIncoming(before, skipped);
            *change.place = either;
            // Behind code that was skipped nobody reads the value.
            if (llvm::isa<llvm::UndefValue>(before) && now->getType()->isIntOrIntVectorTy(32))
                if (const RowShape shape = row_shape(now); shape != RowShape::other) row_shapes[either] = shape;
        }
        changes[kept++] = change;
    }
    changes.resize(kept);
}

std::vector<Component> Emitter::emit_function(const Function& callee, const std::vector<Value>& arguments,
                                              llvm::Value* entry_mask) {
    if (++call_depth > most_calls) reject("functions call each other more than 256 deep");
    Frame made;
    made.function = &callee;
    made.shape = &shape_of(callee);
    made.entry_mask = entry_mask;
    Frame* const outer = frame;
    llvm::Value* const outer_mask = mask;
    const Instruction* const outer_instruction = current;
    const bool was_unguarded = runs_without_lanes;
    frame = &made;
    runs_without_lanes = false;
    for (std::size_t i = 0; i < callee.parameters.size(); ++i) made.values[callee.parameters[i].result] = arguments[i];
    made.blocks.resize(callee.blocks.size());
    for (std::uint32_t i = 0; i < callee.blocks.size(); ++i) {
        Frame::BlockState& state = made.blocks[i];
        for (const Instruction& phi : callee.blocks[i].phis) {
            const Type& type = module.type(phi.type);
            if (type.components == 0) {
                current = &phi;
                reject("images and pointers to what is no buffer cannot depend on control flow");
            }
            state.phi_uniform.push_back(!uniformity.is_divergent(phi.result));
            state.arrival.phis.emplace_back(type.components, nullptr);
            if (callee.blocks[i].continue_target) state.back.phis.emplace_back(type.components, nullptr);
        }
    }
    made.returned.resize(module.type(callee.return_type).components);
    emit_range(0, static_cast<std::uint32_t>(callee.blocks.size()));
    std::vector<Component> values;
    for (std::uint32_t i = 0; i < made.returned.size(); ++i) {
        llvm::Value* value = made.returned[i];
        // Of a function that never returns.
        if (!value) value = widen(zero(module.type(component_type(callee.return_type, i))));
        values.emplace_back(value);
    }
    frame = outer;
    mask = outer_mask;
    current = outer_instruction;
    runs_without_lanes = was_unguarded;
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
                if (type.storage != spv::StorageClass::Function && type.storage != spv::StorageClass::Private)
                    return false;
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
    const Arrival& arrival = frame->blocks[first].arrival;
    if (first != 0 && !arrival.reached) return first + 1;  // Nothing leads there.
    llvm::BasicBlock *before = builder.GetInsertBlock(), *after = nullptr;
    const std::size_t first_change = frame->changes.size();
    const bool is_certain = first == 0 || is_all(arrival.reached);
    const bool is_guarded = !is_certain && !is_cheap(first);
    const bool was_unguarded = runs_without_lanes;
    runs_without_lanes = !is_certain && !is_guarded;
    if (is_guarded) {
        llvm::BasicBlock* body = llvm::BasicBlock::Create(context, "block", function_);
        after = llvm::BasicBlock::Create(context, "next", function_);
        builder.CreateCondBr(arrival.reached, body, after);
        builder.SetInsertPoint(body);
    }
    // The entry's mask is taken as it is, so that what is known of it (all lanes) is known everywhere.
    llvm::Value* chain_mask = first == 0 ? frame->entry_mask : arrival.mask;
    std::uint32_t at = first;
    for (;;) {
        const Block& block = function.blocks[at];
        std::uint32_t next = at + 1;
        if (block.continue_target) {
            const std::uint32_t loop_end = std::min(frame->shape->blocks[at].end, end);
            emit_loop_body(at, loop_end, chain_mask);
            next = loop_end;
        } else {
            emit_block(at, chain_mask);
        }
        if (frame->shape->blocks[at].reconverges) {
            const std::uint32_t merge_block = *function.find_block(block.merge);
            emit_range(next, std::min(merge_block, end));
            if (merge_block < end) {
                at = merge_block;
                continue;
            }
            // Behind the range: found there by its mask, as any other block.
            Arrival& later = frame->blocks[merge_block].arrival;
            assign(later.reached, builder.getTrue(), builder.getFalse(), merge_block);
            assign(later.mask, chain_mask, llvm::Constant::getNullValue(mask_type), merge_block);
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
    runs_without_lanes = was_unguarded;
    if (is_guarded) {
        llvm::BasicBlock* ran = builder.GetInsertBlock();
        builder.CreateBr(after);
        builder.SetInsertPoint(after);
        merge(first_change, before, ran, at);
    }
    return at;
}

void Emitter::emit_loop_body(std::uint32_t header, std::uint32_t end, llvm::Value* entry_mask) {
    const Function& function = *frame->function;
    const Shape::BlockShape& shape = frame->shape->blocks[header];
    Frame::BlockState& state = frame->blocks[header];
    const bool is_divergent = uniformity.has_divergent_exit(function.blocks[header].id);
    llvm::BasicBlock* before = builder.GetInsertBlock();
    llvm::BasicBlock* head = llvm::BasicBlock::Create(context, "loop", function_);
    llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "left_loop", function_);
    builder.CreateBr(head);
    builder.SetInsertPoint(head);

    // What goes from one iteration to the next; where from, is known at the end.
    std::vector<std::pair<llvm::PHINode*, llvm::Value**>> carried;
    const auto carry = [&](llvm::Value*& place, llvm::Type* type, llvm::Value* otherwise, std::uint32_t last_use) {
        llvm::PHINode* either = builder.CreatePHI(type, 2);
        if (!otherwise) otherwise = llvm::UndefValue::get(type);
        either->addIncoming(place ? place : otherwise, before);
        assign(place, either, otherwise, last_use);
        carried.emplace_back(either, &place);
    };
    llvm::Value* const none = llvm::Constant::getNullValue(mask_type);
    llvm::PHINode* loop_mask = nullptr;
    if (is_divergent) {
        loop_mask = builder.CreatePHI(mask_type, 2);
        loop_mask->addIncoming(entry_mask, before);
    }
    std::vector<std::vector<llvm::PHINode*>> own(function.blocks[header].phis.size());
    for (std::size_t i = 0; i < own.size(); ++i) {
        std::uint32_t index = 0;
        for_each_component_type(function.blocks[header].phis[i].type, [&](const Type& scalar) {
            llvm::Type* kind = scalar_type(scalar);
            if (!state.phi_uniform[i]) kind = vector_of(kind);
            llvm::PHINode* either = builder.CreatePHI(kind, 2);
            llvm::Value*& place = state.arrival.phis[i][index++];
            either->addIncoming(place ? place : llvm::UndefValue::get(kind), before);
            place = either;
            own[i].push_back(either);
        });
    }
    // Lanes that leave in different iterations gather outside.
    if (is_divergent) {
        for (const std::uint32_t target_block : shape.targets) {
            Arrival& arrival =
                target_block < header ? frame->blocks[target_block].back : frame->blocks[target_block].arrival;
            const std::uint32_t last_use =
                target_block < header ? frame->shape->blocks[target_block].end : target_block;
            if (!frame->shape->blocks[target_block].is_reconverged || target_block < header) {
                carry(arrival.reached, builder.getInt1Ty(), builder.getFalse(), last_use);
                carry(arrival.mask, mask_type, none, last_use);
            }
            for (std::size_t i = 0; i < arrival.phis.size(); ++i) {
                std::uint32_t index = 0;
                for_each_component_type(function.blocks[target_block].phis[i].type, [&](const Type& scalar) {
                    llvm::Type* kind = scalar_type(scalar);
                    if (!frame->blocks[target_block].phi_uniform[i]) kind = vector_of(kind);
                    carry(arrival.phis[i][index++], kind, nullptr, last_use);
                });
            }
        }
        for (const Id id : shape.leaving) {
            const Type& type = module.type(module.type_of(id));
            if (type.components == 0 || frame->shape->uses.at(id).is_remade) continue;
            std::vector<llvm::Value*>& places = frame->values_outside[id];
            places.resize(type.components);
            std::uint32_t index = 0;
            for_each_component_type(module.type_of(id), [&](const Type& scalar) {
                carry(places[index++], vector_of(scalar_type(scalar)), nullptr, frame->shape->uses.at(id).last);
            });
        }
    }
    if (shape.returns_values)
        for (std::uint32_t i = 0; i < frame->returned.size(); ++i)
            carry(frame->returned[i], vector_of(scalar_type(module.type(component_type(function.return_type, i)))),
                  nullptr, ~0u);

    emit_block(header, is_divergent ? loop_mask : entry_mask);
    emit_range(header + 1, end);

    llvm::BasicBlock* bottom = builder.GetInsertBlock();
    if (state.back.reached) {
        // Asked in each iteration, so that a shader without end can be stopped from outside.
        llvm::Value* execution = load_context(offsetof(ShaderContext, state), pointer_type);
        llvm::LoadInst* expired = builder.CreateAlignedLoad(builder.getInt32Ty(), execution, llvm::Align(4));
        expired->setAtomic(llvm::AtomicOrdering::Monotonic);
        builder.CreateCondBr(builder.CreateAnd(state.back.reached, builder.CreateICmpEQ(expired, int32(0))), head,
                             after);
        if (loop_mask) loop_mask->addIncoming(state.back.mask, bottom);
        for (std::size_t i = 0; i < own.size(); ++i)
            for (std::size_t k = 0; k < own[i].size(); ++k) {
                llvm::Value* value = state.back.phis[i][k];
                own[i][k]->addIncoming(value ? value : llvm::UndefValue::get(own[i][k]->getType()), bottom);
            }
        for (const auto& [either, place] : carried) either->addIncoming(*place, bottom);
    } else {
        builder.CreateBr(after);
    }
    builder.SetInsertPoint(after);
    // Nobody reads it any more.
    state.back.reached = state.back.mask = nullptr;
    for (auto& components : state.back.phis) std::ranges::fill(components, nullptr);
}

void Emitter::emit_block(std::uint32_t index, llvm::Value* block_mask) {
    const Block& block = frame->function->blocks[index];
    Frame::BlockState& state = frame->blocks[index];
    frame->block = index;
    mask = block_mask;
    for (std::size_t i = 0; i < block.phis.size(); ++i) {
        current = &block.phis[i];
        std::vector<Component> components;
        for_each_component_type(block.phis[i].type, [&](const Type& scalar) {
            llvm::Value* value = state.arrival.phis[i][components.size()];
            llvm::Type* kind = scalar_type(scalar);
            if (!value) value = llvm::UndefValue::get(state.phi_uniform[i] ? kind : vector_of(kind));
            components.emplace_back(value);
        });
        if (module.type(block.phis[i].type).kind == TypeKind::pointer) {
            Id origin = 0;
            for (std::size_t k = 0; k < block.phis[i].operands.size() && !origin; k += 2)
                if (module.variable(block.phis[i].operands[k]) || frame->values.contains(block.phis[i].operands[k]))
                    origin = block.phis[i].operands[k];
            set_pointer(block.phis[i], std::move(components), origin);
            continue;
        }
        trace_result(block.phis[i], components);
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
            llvm::Value* none = llvm::ConstantInt::getFalse(
                selector.is_uniform() ? builder.getInt1Ty() : static_cast<llvm::Type*>(mask_type));
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
            const std::vector<Component> value = get_components(end.operand(0));
            for (std::size_t i = 0; i < frame->returned.size(); ++i) {
                llvm::Value* all = widen(value.at(i));
                llvm::Value* before = frame->returned[i];
                assign(frame->returned[i], before ? select(mask, all, before) : all, nullptr, ~0u);
            }
            return;
        }
        case Op::OpKill:
        case Op::OpTerminateInvocation:
            if (live_slot) {
                llvm::Value* none = llvm::Constant::getNullValue(mask_type);
                store_live(builder.CreateSelect(mask, none, live()));
            }
            if (killed_slot)
                builder.CreateStore(builder.CreateOr(mask, builder.CreateLoad(mask_type, killed_slot)), killed_slot);
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
    if (is_back && !block.continue_target) reject("a branch leads back to a block that is no loop header");
    Arrival& arrival = is_back ? state.back : state.arrival;
    const std::uint32_t last_use = is_back ? frame->shape->blocks[*target_index].end : *target_index;
    llvm::Value* edge_mask = both(mask, condition);
    // Lanes that ended inside of a function that was called here do not go round for ever.
    const bool may_end = is_back && killed_slot;
    if (may_end) edge_mask = both(edge_mask, builder.CreateNot(builder.CreateLoad(mask_type, killed_slot)));
    llvm::Value* taken = may_end                            ? any(edge_mask)
                         : !condition                          ? runs_without_lanes ? any(mask) : builder.getTrue()
                         : condition->getType()->isVectorTy() ? any(edge_mask)
                                                             : condition;

    // Phis: all are read before any is written, as they may use each other.
    std::vector<std::vector<llvm::Value*>> incoming(block.phis.size());
    for (std::size_t i = 0; i < block.phis.size(); ++i) {
        const Instruction& phi = block.phis[i];
        for (std::size_t k = 0; k + 1 < phi.operands.size(); k += 2) {
            if (phi.operands[k + 1] != function.blocks[from].id) continue;
            for (const Component& component : get_components(phi.operands[k]))
                incoming[i].push_back(state.phi_uniform[i] ? narrow(component, edge_mask) : widen(component));
            break;
        }
    }
    // The first way into a block brings values for all lanes that come; others add to what lanes before them brought.
    for (std::size_t i = 0; i < block.phis.size(); ++i)
        for (std::size_t k = 0; k < incoming[i].size(); ++k) {
            llvm::Value*& place = arrival.phis[i][k];
            llvm::Value* value = incoming[i][k];
            // A scalar is written only if the edge is taken; then no other edge into the block is.
            if (place) value = select(state.phi_uniform[i] ? taken : edge_mask, value, place);
            assign(place, value, nullptr, last_use);
        }

    // Where all lanes of the header meet again nothing needs to be counted.
    if (frame->shape->blocks[*target_index].is_reconverged && !is_back) return;
    // One way in: the mask counts only if the block is reached, so a scalar condition need not clear it. It must where
    // the block runs whether it is reached or not: of a vector that differs between lanes, one component may be a
    // scalar.
    const bool is_plain = !arrival.reached && !may_end && block.predecessors.size() == 1 && condition &&
                          !condition->getType()->isVectorTy() && !is_cheap(*target_index);
    llvm::Value* lanes_coming = is_plain ? mask : edge_mask;
    const bool is_first = !arrival.reached;
    assign(arrival.reached, is_first ? taken : builder.CreateOr(arrival.reached, taken), builder.getFalse(), last_use);
    assign(arrival.mask, is_first ? lanes_coming : builder.CreateOr(arrival.mask, lanes_coming),
           llvm::Constant::getNullValue(mask_type), last_use);
}

}  // namespace nacre::cpu
