// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <llvm/IR/Constants.h>
#include <llvm/IR/Intrinsics.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

namespace {

/// How two values of a reduction become one, and the value that changes nothing.
struct Combination {
    std::function<llvm::Value*(llvm::Value*, llvm::Value*)> combine;
    llvm::Constant* identity = nullptr;
};

}  // namespace

llvm::Value* Emitter::permute(llvm::Value* values, llvm::Value* sources) {
    // Through memory: LLVM has no shuffle by a variable that all targets take.
    llvm::Type* scalar = values->getType()->getScalarType();
    const bool is_boolean = scalar->isIntegerTy(1);
    if (is_boolean) {
        scalar = builder.getInt32Ty();
        values = builder.CreateZExt(values, vector_of(scalar));
    }
    llvm::AllocaInst* memory = make_slot(vector_of(scalar), "permuted");
    builder.CreateStore(values, memory);
    llvm::Value* inside = builder.CreateAnd(sources, splat(int32(lanes - 1)));
    llvm::Value* places = builder.CreateGEP(scalar, memory, inside);
    const llvm::Align alignment(std::max(1u, scalar->getScalarSizeInBits() / 8));
    llvm::Value* result = builder.CreateMaskedGather(vector_of(scalar), places, alignment, all_lanes(),
                                                     llvm::Constant::getNullValue(vector_of(scalar)));
    return is_boolean ? builder.CreateICmpNE(result, llvm::Constant::getNullValue(result->getType())) : result;
}

std::optional<std::vector<Component>> Emitter::subgroup_input(spv::BuiltIn builtin) {
    using spv::BuiltIn;
    switch (builtin) {
        case BuiltIn::SubgroupSize: return {{Component(int32(lanes))}};
        case BuiltIn::SubgroupLocalInvocationId: return {{linear(int32(0), 1)}};
        case BuiltIn::SubgroupEqMask:
        case BuiltIn::SubgroupGeMask:
        case BuiltIn::SubgroupGtMask:
        case BuiltIn::SubgroupLeMask:
        case BuiltIn::SubgroupLtMask: {
            const std::uint32_t used = (1u << lanes) - 1;
            std::vector<std::uint32_t> words(lanes);
            for (std::uint32_t i = 0; i < lanes; ++i) {
                const std::uint32_t equal = 1u << i, below = equal - 1;
                words[i] = builtin == BuiltIn::SubgroupEqMask   ? equal
                           : builtin == BuiltIn::SubgroupGeMask ? used & ~below
                           : builtin == BuiltIn::SubgroupGtMask ? used & ~(below | equal)
                           : builtin == BuiltIn::SubgroupLeMask ? below | equal
                                                                : below;
            }
            return {{Component(llvm::ConstantDataVector::get(context, words)), Component(int32(0)), Component(int32(0)),
                     Component(int32(0))}};
        }
        default: return std::nullopt;
    }
}

bool Emitter::emit_subgroup(const Instruction& at) {
    // Validators look at few of the types here.
    const auto condition_of = [&](Id id) {
        const Component condition = get_scalar(id);
        if (!condition.value->getType()->getScalarType()->isIntegerTy(1)) reject("a condition is not of type bool");
        return condition;
    };
    const auto ballot_of = [&](Id id) {
        const Component word = get(id).components.at(0);
        if (!word.value->getType()->getScalarType()->isIntegerTy(32)) reject("a ballot is not made of words");
        return word;
    };
    const auto lane_of = [&](Id id) {
        const Component lane = get_scalar(id);
        if (follows_undefined()) check_undefined(std::span(&lane, 1), origin_of(id));
        if (!lane.value->getType()->getScalarType()->isIntegerTy() ||
            lane.value->getType()->getScalarType()->isIntegerTy(1))
            reject("the number of an invocation is no integer");
        return lane;
    };
    const auto operand_value = [&](std::size_t i) { return get(at.operand(i)); };
    // A ballot is four words; only the first has lanes.
    const auto ballot = [&](llvm::Value* lanes_on) {
        return std::vector<Component>{Component(mask_bits(lanes_on)), Component(int32(0)), Component(int32(0)),
                                      Component(int32(0))};
    };
    const auto condition_mask = [&](const Component& condition) { return both(mask, condition.value); };
    const auto lane_bit = [&](llvm::Value* word) {  // i1 of each lane from a scalar word of bits.
        return builder.CreateBitCast(builder.CreateTrunc(word, builder.getIntNTy(lanes)), mask_type);
    };
    const auto one_lane = [&](const Component& value, llvm::Value* lane) -> Component {
        if (value.is_uniform()) return value;
        llvm::Value* inside =
            builder.CreateAnd(builder.CreateZExtOrTrunc(lane, builder.getInt32Ty()), int32(lanes - 1));
        return Component(builder.CreateExtractElement(value.value, inside));
    };

    // What of a value nothing has written, lane by lane. Null: all of it was written.
    const auto undefined_in = [&](const Component& value) -> llvm::Value* {
        if (!value.undefined) return nullptr;
        return value.undefined->getType()->isVectorTy() ? value.undefined : splat(value.undefined);
    };
    // A result that depends on the values of all lanes.
    const auto of_all = [&](std::vector<Component> result, std::span<const Component> values) {
        llvm::Value* undefined = nullptr;
        for (const Component& value : values)
            if (llvm::Value* more = undefined_in(value))
                undefined = undefined ? builder.CreateOr(undefined, more) : more;
        if (undefined) undefined = any(both(mask, undefined));
        for (Component& component : result) component.undefined = undefined;
        return result;
    };

    switch (at.op) {
        case Op::OpGroupNonUniformElect: {
            llvm::Value* lowest = first_lane(mask);
            set(at, {Component(both(mask, builder.CreateICmpEQ(lane_numbers(), splat(lowest))))});
            return true;
        }
        case Op::OpGroupNonUniformAll: case Op::OpSubgroupAllKHR: {
            const Component condition = condition_of(at.operand(at.op == Op::OpSubgroupAllKHR ? 0 : 1));
            if (condition.is_uniform()) set(at, {condition});
            else
                set(at, of_all({Component(builder.CreateNot(any(both(mask, builder.CreateNot(condition.value)))))},
                               std::span(&condition, 1)));
            return true;
        }
        case Op::OpGroupNonUniformAny: case Op::OpSubgroupAnyKHR: {
            const Component condition = condition_of(at.operand(at.op == Op::OpSubgroupAnyKHR ? 0 : 1));
            if (condition.is_uniform()) set(at, {condition});
            else
                set(at, of_all({Component(any(condition_mask(condition)))}, std::span(&condition, 1)));
            return true;
        }
        case Op::OpGroupNonUniformAllEqual: case Op::OpSubgroupAllEqualKHR: {
            const Value value = operand_value(at.op == Op::OpSubgroupAllEqualKHR ? 0 : 1);
            llvm::Value* equal = builder.getTrue();
            for (const Component& component : value.components) {
                if (component.is_uniform()) {
                    // NaN is not equal to itself.
                    if (component.value->getType()->isFloatingPointTy())
                        equal = builder.CreateAnd(equal, builder.CreateFCmpORD(component.value, component.value));
                    continue;
                }
                llvm::Value* first = splat(narrow(component, mask));
                llvm::Value* same = first->getType()->isFPOrFPVectorTy() ? builder.CreateFCmpOEQ(component.value, first)
                                                                         : builder.CreateICmpEQ(component.value, first);
                equal = builder.CreateAnd(equal, builder.CreateNot(any(both(mask, builder.CreateNot(same)))));
            }
            set(at, of_all({Component(equal)}, value.components));
            return true;
        }
        case Op::OpGroupNonUniformBroadcastFirst: case Op::OpSubgroupFirstInvocationKHR: {
            std::vector<Component> made;
            for (const Component& component :
                 operand_value(at.op == Op::OpSubgroupFirstInvocationKHR ? 0 : 1).components) {
                made.emplace_back(narrow(component, mask));
                if (component.undefined) made.back().undefined = narrow(Component(component.undefined), mask);
            }
            set(at, std::move(made));
            return true;
        }
        case Op::OpGroupNonUniformBroadcast: case Op::OpSubgroupReadInvocationKHR: {
            const std::size_t first = at.op == Op::OpSubgroupReadInvocationKHR ? 0 : 1;
            llvm::Value* lane = narrow(lane_of(at.operand(first + 1)), mask);
            std::vector<Component> made;
            for (const Component& component : operand_value(first).components) {
                made.push_back(one_lane(component, lane));
                if (component.undefined) made.back().undefined = one_lane(Component(component.undefined), lane).value;
            }
            set(at, std::move(made));
            return true;
        }
        case Op::OpGroupNonUniformBallot: case Op::OpSubgroupBallotKHR: {
            const Component condition = condition_of(at.operand(at.op == Op::OpSubgroupBallotKHR ? 0 : 1));
            set(at, of_all(ballot(condition_mask(condition)), std::span(&condition, 1)));
            return true;
        }
        case Op::OpGroupNonUniformInverseBallot: {
            const Component word = ballot_of(at.operand(1));
            set(at, of_all({Component(lane_bit(narrow(word, mask)))}, std::span(&word, 1)));
            return true;
        }
        case Op::OpGroupNonUniformBallotBitExtract: {
            const Component word = ballot_of(at.operand(1)), index = lane_of(at.operand(2));
            set(at, {apply({word, index}, [&](auto v) {
                    llvm::Value* shifted =
                        builder.CreateLShr(v[0], builder.CreateAnd(v[1], llvm::ConstantInt::get(v[1]->getType(), 31)));
                    return builder.CreateTrunc(shifted, v[0]->getType()->isVectorTy()
                                                            ? static_cast<llvm::Type*>(mask_type)
                                                            : builder.getInt1Ty());
                })});
            return true;
        }
        case Op::OpGroupNonUniformBallotBitCount: {
            const auto operation = static_cast<spv::GroupOperation>(at.operand(1));
            llvm::Value* used = int32(static_cast<std::int64_t>((std::uint64_t{1} << lanes) - 1));
            Component word = apply({ballot_of(at.operand(2))}, [&](auto v) {
                return builder.CreateAnd(v[0], v[0]->getType()->isVectorTy() ? splat(used) : used);
            });
            if (operation != spv::GroupOperation::Reduce) {
                std::vector<std::uint32_t> below(lanes);
                for (std::uint32_t i = 0; i < lanes; ++i)
                    below[i] = operation == spv::GroupOperation::InclusiveScan ? (2u << i) - 1 : (1u << i) - 1;
                word = apply({word, Component(llvm::ConstantDataVector::get(context, below))},
                             [&](auto v) { return builder.CreateAnd(v[0], v[1]); });
            }
            set(at, {apply({word}, [&](auto v) { return math.bit_count(v[0]); })});
            return true;
        }
        case Op::OpGroupNonUniformBallotFindLSB: case Op::OpGroupNonUniformBallotFindMSB: {
            set(at, {apply({ballot_of(at.operand(1))}, [&](auto v) {
                    return at.op == Op::OpGroupNonUniformBallotFindLSB ? math.find_lsb(v[0]) : math.find_u_msb(v[0]);
                })});
            return true;
        }
        case Op::OpGroupNonUniformShuffle: case Op::OpGroupNonUniformShuffleXor: case Op::OpGroupNonUniformShuffleUp:
        case Op::OpGroupNonUniformShuffleDown:
        case Op::OpGroupNonUniformQuadBroadcast:
        case Op::OpGroupNonUniformQuadSwap:
        case Op::OpGroupNonUniformRotateKHR: {
            llvm::Value* operand = nullptr;
            if (at.op != Op::OpGroupNonUniformQuadSwap || !module.constant_word(at.operand(2)))
                operand = builder.CreateZExtOrTrunc(widen(lane_of(at.operand(2))), vector_of(builder.getInt32Ty()));
            else
                operand = splat(int32(static_cast<std::int64_t>(*module.constant_word(at.operand(2)))));
            llvm::Value* numbers = lane_numbers();
            llvm::Value* source = operand;
            switch (at.op) {
                case Op::OpGroupNonUniformShuffleXor: source = builder.CreateXor(numbers, operand); break;
                case Op::OpGroupNonUniformShuffleUp: source = builder.CreateSub(numbers, operand); break;
                case Op::OpGroupNonUniformShuffleDown: source = builder.CreateAdd(numbers, operand); break;
                case Op::OpGroupNonUniformRotateKHR: {
                    // Round the subgroup, or each cluster of it.
                    const std::uint32_t cluster =
                        std::min(lanes, std::max(1u, module.constant_word(at.operand(3)).value_or(lanes)));
                    llvm::Value* inside = splat(int32(cluster - 1));
                    source = builder.CreateOr(builder.CreateAnd(numbers, builder.CreateNot(inside)),
                                              builder.CreateAnd(builder.CreateAdd(numbers, operand), inside));
                    break;
                }
                case Op::OpGroupNonUniformQuadBroadcast:
                    source = builder.CreateOr(builder.CreateAnd(numbers, splat(int32(~3))),
                                              builder.CreateAnd(operand, splat(int32(3))));
                    break;
                case Op::OpGroupNonUniformQuadSwap:
                    // Horizontal 0, vertical 1, diagonal 2: the lane number with bit 0, bit 1 or both turned over.
                    source = builder.CreateXor(
                        numbers, builder.CreateAnd(builder.CreateAdd(operand, splat(int32(1))), splat(int32(3))));
                    break;
                default: break;
            }
            std::vector<Component> made;
            for (const Component& component : operand_value(1).components) {
                made.push_back(component.is_uniform() ? Component(widen(component))
                                                      : Component(permute(component.value, source)));
                if (llvm::Value* undefined = undefined_in(component))
                    made.back().undefined = permute(undefined, source);
            }
            set(at, std::move(made));
            return true;
        }
        default: break;
    }

    // Reductions and scans.
    const Type& scalar = module.has_type(at.type) && module.type(at.type).components > 0
                             ? module.type(component_type(at.type, 0))
                             : Type{};
    Combination how;
    llvm::Type* kind = scalar.is_scalar() && scalar.bits ? scalar_type(scalar) : nullptr;
    const auto integer = [&](std::uint64_t value) { return llvm::ConstantInt::get(kind, value); };
    if (at.op >= Op::OpGroupNonUniformIAdd && at.op <= Op::OpGroupNonUniformLogicalXor) {
        const TypeKind wanted = at.op == Op::OpGroupNonUniformFAdd || at.op == Op::OpGroupNonUniformFMul ||
                                        at.op == Op::OpGroupNonUniformFMin || at.op == Op::OpGroupNonUniformFMax
                                    ? TypeKind::floating
                                : at.op >= Op::OpGroupNonUniformLogicalAnd ? TypeKind::boolean
                                                                           : TypeKind::integer;
        if (!kind || scalar.kind != wanted) reject("what is combined is not of the kind that the instruction takes");
    }
    switch (at.op) {
        case Op::OpGroupNonUniformIAdd:
            how = {[&](auto* a, auto* b) { return builder.CreateAdd(a, b); }, integer(0)};
            break;
        case Op::OpGroupNonUniformFAdd:
            how = {[&](auto* a, auto* b) { return builder.CreateFAdd(a, b); }, llvm::ConstantFP::get(kind, -0.0)};
            break;
        case Op::OpGroupNonUniformIMul:
            how = {[&](auto* a, auto* b) { return builder.CreateMul(a, b); }, integer(1)};
            break;
        case Op::OpGroupNonUniformFMul:
            how = {[&](auto* a, auto* b) { return builder.CreateFMul(a, b); }, llvm::ConstantFP::get(kind, 1.0)};
            break;
        case Op::OpGroupNonUniformSMin:
            how = {[&](auto* a, auto* b) { return math.s_min(a, b); },
                   integer((std::uint64_t{1} << (scalar.bits - 1)) - 1)};
            break;
        case Op::OpGroupNonUniformUMin:
            how = {[&](auto* a, auto* b) { return math.u_min(a, b); }, integer(~std::uint64_t{0})};
            break;
        case Op::OpGroupNonUniformFMin:
            how = {[&](auto* a, auto* b) { return math.n_min(a, b); }, llvm::ConstantFP::getInfinity(kind)};
            break;
        case Op::OpGroupNonUniformSMax:
            how = {[&](auto* a, auto* b) { return math.s_max(a, b); }, integer(std::uint64_t{1} << (scalar.bits - 1))};
            break;
        case Op::OpGroupNonUniformUMax: how = {[&](auto* a, auto* b) { return math.u_max(a, b); }, integer(0)}; break;
        case Op::OpGroupNonUniformFMax:
            how = {[&](auto* a, auto* b) { return math.n_max(a, b); }, llvm::ConstantFP::getInfinity(kind, true)};
            break;
        case Op::OpGroupNonUniformBitwiseAnd: case Op::OpGroupNonUniformLogicalAnd:
            how = {[&](auto* a, auto* b) { return builder.CreateAnd(a, b); }, llvm::Constant::getAllOnesValue(kind)};
            break;
        case Op::OpGroupNonUniformBitwiseOr: case Op::OpGroupNonUniformLogicalOr:
            how = {[&](auto* a, auto* b) { return builder.CreateOr(a, b); }, llvm::Constant::getNullValue(kind)}; break;
        case Op::OpGroupNonUniformBitwiseXor: case Op::OpGroupNonUniformLogicalXor:
            how = {[&](auto* a, auto* b) { return builder.CreateXor(a, b); }, llvm::Constant::getNullValue(kind)};
            break;
        default: return false;
    }
    if (module.type_of(at.operand(2)) != at.type) reject("what is combined is not of the type of the result");
    const auto operation = static_cast<spv::GroupOperation>(at.operand(1));
    std::uint32_t cluster = lanes;
    if (operation == spv::GroupOperation::ClusteredReduce)
        cluster = std::min(lanes, std::max(1u, module.constant_word(at.operand(3)).value_or(lanes)));
    std::vector<Component> made;
    const bool is_scan =
        operation == spv::GroupOperation::InclusiveScan || operation == spv::GroupOperation::ExclusiveScan;
    const auto combined = [&](llvm::Value* values, const Combination& by) {
        llvm::Value* identity = splat(by.identity);
        values = select(mask, values, identity);
        const auto moved_by = [&](llvm::Value* from, std::int32_t distance, bool exchange) {
            // Lanes from `distance` below (or exchanged with it); the identity where there is none.
            llvm::SmallVector<int, 16> source(lanes);
            for (std::uint32_t i = 0; i < lanes; ++i) {
                const std::int32_t lane = static_cast<std::int32_t>(i);
                source[i] = exchange           ? lane ^ distance
                            : lane >= distance ? lane - distance
                                               : static_cast<std::int32_t>(lanes);
            }
            return builder.CreateShuffleVector(from, identity, source);
        };
        for (std::uint32_t step = 1; step < (is_scan ? lanes : cluster); step *= 2) {
            llvm::Value* moved = moved_by(values, static_cast<std::int32_t>(step), !is_scan);
            values = is_scan ? by.combine(moved, values) : by.combine(values, moved);
        }
        if (operation == spv::GroupOperation::ExclusiveScan) values = moved_by(values, 1, false);
        return operation == spv::GroupOperation::Reduce ? builder.CreateExtractElement(values, std::uint64_t{0})
                                                        : values;
    };
    const Combination either{[&](auto* a, auto* b) { return builder.CreateOr(a, b); }, builder.getFalse()};
    for (const Component& component : operand_value(2).components) {
        made.emplace_back(combined(widen(component), how));
        if (llvm::Value* undefined = undefined_in(component)) made.back().undefined = combined(undefined, either);
    }
    set(at, std::move(made));
    return true;
}

}  // namespace nacre::cpu
