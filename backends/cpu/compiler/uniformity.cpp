// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/uniformity.h"

#include <algorithm>

#include <spirv/unified1/GLSL.std.450.h>

namespace nacre::cpu {

using spv::BuiltIn;
using spv::Op;
using spv::StorageClass;

std::uint32_t end_of_construct(const Function& function, std::uint32_t header) {
    const auto merge = function.find_block(function.blocks[header].merge);
    return merge ? *merge : static_cast<std::uint32_t>(function.blocks.size());
}

Uniformity::Uniformity(const Module& module) : module_(module) {
    const std::size_t bound = module.id_bound();
    for (auto* flags : {&divergent_, &content_, &divergent_exit_, &partial_, &divergent_join_, &divergent_return_})
        flags->assign(bound, 0);
    pointer_base_.assign(bound, 0);
    for (const auto& [id, variable] : module.variables()) {
        if (variable.storage == StorageClass::Input) {
            const Type& type = module.type(variable.type);
            bool divergent = false;
            if (variable.builtin) divergent = is_divergent_builtin(*variable.builtin);
            else if (type.kind == TypeKind::structure && !type.members.empty() && type.members[0].builtin)
                divergent = true;
            else divergent = true;
            if (divergent) content_[id] = 1;
        }
        // Blocks of one stage that the next one reads are kept for each lane.
        if (variable.storage == StorageClass::Output) content_[id] = 1;
    }
    // Which pointer comes from which, once: the links do not change.
    for (const auto& [id, function] : module.functions())
        for (const Block& block : function.blocks)
            for (const Instruction& at : block.body)
                if (at.op == Op::OpAccessChain || at.op == Op::OpInBoundsAccessChain || at.op == Op::OpCopyObject ||
                    at.op == Op::OpPtrAccessChain || at.op == Op::OpInBoundsPtrAccessChain)
                    pointer_base_[at.result] = at.operand(0);
    do {
        changed_ = false;
        for (const auto& [id, function] : module.functions()) analyze(function);
    } while (changed_);
}

bool Uniformity::is_divergent_builtin(BuiltIn builtin) const {
    switch (builtin) {
        case BuiltIn::NumWorkgroups: case BuiltIn::WorkgroupSize: case BuiltIn::WorkgroupId: case BuiltIn::SubgroupSize:
        case BuiltIn::NumSubgroups: case BuiltIn::SubgroupId: case BuiltIn::InstanceIndex: case BuiltIn::BaseVertex:
        case BuiltIn::BaseInstance: case BuiltIn::DrawIndex: case BuiltIn::ViewIndex: case BuiltIn::DeviceIndex:
        case BuiltIn::SampleId:
            return false;
        default: return true;
    }
}

bool Uniformity::has_divergent_branch(const Function& function, std::uint32_t block) const {
    const Instruction& end = function.blocks[block].terminator;
    if (end.op != Op::OpBranchConditional && end.op != Op::OpSwitch) return false;
    return function.blocks[block].successors.size() > 1 && is_divergent(end.operand(0));
}

Id Uniformity::root_of(Id pointer) const {
    while (pointer < pointer_base_.size() && pointer_base_[pointer]) pointer = pointer_base_[pointer];
    return module_.variable(pointer) ? pointer : 0;
}

/// Marks what a divergent branch at the end of `block` does to the blocks that its lanes reach before they meet again.
///
/// Follows the lanes in the order in which blocks run. Each way that lanes took has a label; where two labels come
/// together lanes join, with different values. As long as lanes wait anywhere else, be it at a later block, for the
/// next iteration of a loop or, in a function that is called, for its end, the block that runs is partial.
void Uniformity::spread(const Function& function, std::uint32_t block) {
    constexpr std::uint32_t none = ~0u;
    const auto count = static_cast<std::uint32_t>(function.blocks.size());
    const bool is_called = function.id != module_.entry().id;
    std::vector<std::uint32_t> labels(count, none);
    std::uint32_t waiting = 0;  // Blocks with a label.
    bool leaves = false;
    struct Loop {
        std::uint32_t header, end;
        bool goes_on = false;
    };
    std::vector<Loop> loops;  // Around the block, the innermost last.
    for (std::uint32_t header = 0; header <= block; ++header)
        if (function.blocks[header].continue_target && end_of_construct(function, header) > block)
            loops.push_back({header, end_of_construct(function, header)});

    const auto reach = [&](std::uint32_t from, Id id, std::uint32_t label) {
        const auto to = function.find_block(id);
        if (!to) return;
        if (*to <= from) {
            for (Loop& loop : loops) loop.goes_on = loop.goes_on || loop.header == *to;
        } else if (labels[*to] == none) {
            labels[*to] = label, ++waiting;
        } else if (labels[*to] != label) {
            labels[*to] = *to;
            mark(divergent_join_, id);
        }
    };
    for (const Id successor : function.blocks[block].successors)
        if (const auto to = function.find_block(successor)) reach(block, successor, count + *to);
    for (std::uint32_t at = block + 1; at <= count; ++at) {
        while (!loops.empty() && loops.back().end <= at) {
            const Loop loop = loops.back();
            loops.pop_back();
            if (!loop.goes_on) continue;
            // All lanes that are left go round again together.
            if (waiting == 0 && !leaves) return;
            mark(divergent_exit_, function.blocks[loop.header].id);
            for (std::uint32_t i = loop.header; i < loop.end; ++i) {
                mark(partial_, function.blocks[i].id);
                // Lanes that leave in different iterations bring different values, wherever they go.
                for (const Id successor : function.blocks[i].successors) {
                    const auto to = function.find_block(successor);
                    if (!to || (*to >= loop.header && *to < loop.end)) continue;
                    mark(divergent_join_, successor);
                    if (*to <= i) {
                        reach(i, successor, none);
                        continue;
                    }
                    if (labels[*to] == none) ++waiting;
                    labels[*to] = *to;
                }
                leaves = leaves || (function.blocks[i].successors.empty() && !function.blocks[i].predecessors.empty());
            }
        }
        if (at == count || labels[at] == none) continue;
        bool alone = waiting == 1 && !(leaves && is_called);
        for (const Loop& loop : loops) alone = alone && !loop.goes_on;
        // Here all have met, but for those that have left a loop for good, whose exit is known by then.
        if (alone && (loops.empty() || !leaves)) break;
        if (!alone) mark(partial_, function.blocks[at].id);
        --waiting;
        const std::uint32_t label = labels[at];
        labels[at] = none;
        if (function.blocks[at].successors.empty()) leaves = true;
        for (const Id successor : function.blocks[at].successors) reach(at, successor, label);
    }
    // A callee's lanes come back to the caller wherever they return.
    if (leaves && is_called) mark(divergent_return_, function.id);
}

void Uniformity::visit(const Instruction& at, Id block) {
    const auto any_operand = [&](std::size_t first) {
        for (std::size_t i = first; i < at.operands.size(); ++i)
            if (is_divergent(at.operands[i])) return true;
        return false;
    };
    switch (at.op) {
        case Op::OpVariable:
            if (at.operand(1) == 0) break;
            return;
        case Op::OpLoad: {
            if (is_divergent(at.operand(0))) return mark(divergent_, at.result);
            const Id root = root_of(at.operand(0));
            if (!root) return mark(divergent_, at.result);
            const StorageClass storage = module_.variable(root)->storage;
            const bool in_lanes = storage == StorageClass::Function || storage == StorageClass::Private ||
                                  storage == StorageClass::Output || storage == StorageClass::Input;
            if (in_lanes && has_divergent_content(root)) mark(divergent_, at.result);
            return;
        }
        case Op::OpStore:
        case Op::OpCopyMemory: {
            const Id root = root_of(at.operand(0));
            if (!root || module_.constant_content(root)) return;
            bool divergent = is_divergent(at.operand(0)) || is_partial(block);
            if (at.op == Op::OpStore) {
                divergent = divergent || is_divergent(at.operand(1));
            } else {
                const Id source = root_of(at.operand(1));
                divergent = divergent || !source || is_divergent(at.operand(1)) || has_divergent_content(source);
            }
            if (divergent) mark(content_, root);
            return;
        }
        case Op::OpFunctionCall: {
            const Function& callee = module_.function(at.operand(0));
            for (std::size_t i = 0; i < callee.parameters.size(); ++i) {
                const Id argument = at.operand(i + 1), parameter = callee.parameters[i].result;
                const Type& type = module_.type(callee.parameters[i].type);
                if (type.kind == TypeKind::pointer &&
                    (type.storage == StorageClass::Function || type.storage == StorageClass::Private)) {
                    // Who writes through the parameter is not followed back to the variable: it counts as divergent.
                    mark(divergent_, parameter);
                    if (const Id root = root_of(argument)) mark(content_, root);
                } else if (is_divergent(argument)) {
                    mark(divergent_, parameter);
                }
            }
            if (is_partial(block))
                for (const Block& inner : callee.blocks) mark(partial_, inner.id);
            if (divergent_return_[callee.id]) mark(divergent_, at.result);
            return;
        }
        case Op::OpExtInst: {
            const std::uint32_t number = at.operand(1);
            // An input at a place in each pixel; its pointer and the place are uniform.
            const bool interpolates = module_.is_glsl_set(at.operand(0)) && number >= GLSLstd450InterpolateAtCentroid &&
                                      number <= GLSLstd450InterpolateAtOffset;
            if (interpolates || any_operand(2)) mark(divergent_, at.result);
            // modf and frexp write through a pointer.
            if (module_.is_glsl_set(at.operand(0)) && at.operands.size() > 3)
                if (const Id root = root_of(at.operand(3)); root && (is_divergent(at.operand(2)) || is_partial(block)))
                    mark(content_, root);
            return;
        }
        case Op::OpImageFetch:
            // What textures hold does not change while a shader runs; the third operand is a mask of those behind it.
            if (is_divergent(at.operand(0)) || is_divergent(at.operand(1)) || any_operand(3))
                mark(divergent_, at.result);
            return;
        case Op::OpImageSampleImplicitLod: case Op::OpImageSampleExplicitLod: case Op::OpImageSampleDrefImplicitLod:
        case Op::OpImageSampleDrefExplicitLod: case Op::OpImageSampleProjImplicitLod:
        case Op::OpImageSampleProjExplicitLod: case Op::OpImageSampleProjDrefImplicitLod:
        case Op::OpImageSampleProjDrefExplicitLod: case Op::OpImageGather:
        case Op::OpImageDrefGather: case Op::OpImageRead: case Op::OpImageQueryLod: case Op::OpImageSparseRead:
        case Op::OpAtomicLoad: case Op::OpAtomicExchange: case Op::OpAtomicCompareExchange: case Op::OpAtomicIIncrement:
        case Op::OpAtomicIDecrement: case Op::OpAtomicIAdd: case Op::OpAtomicISub: case Op::OpAtomicSMin:
        case Op::OpAtomicUMin: case Op::OpAtomicSMax: case Op::OpAtomicUMax: case Op::OpAtomicAnd: case Op::OpAtomicOr:
        case Op::OpAtomicXor: case Op::OpAtomicFAddEXT: case Op::OpAtomicFMinEXT: case Op::OpAtomicFMaxEXT:
        case Op::OpImageTexelPointer: case Op::OpGroupNonUniformElect: case Op::OpGroupNonUniformInverseBallot:
        case Op::OpGroupNonUniformShuffle: case Op::OpGroupNonUniformShuffleXor: case Op::OpGroupNonUniformShuffleUp:
        case Op::OpRayQueryProceedKHR: case Op::OpRayQueryGetIntersectionTypeKHR: case Op::OpRayQueryGetRayTMinKHR:
        case Op::OpRayQueryGetRayFlagsKHR: case Op::OpRayQueryGetIntersectionTKHR:
        case Op::OpRayQueryGetIntersectionInstanceCustomIndexKHR: case Op::OpRayQueryGetIntersectionInstanceIdKHR:
        case Op::OpRayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR:
        case Op::OpRayQueryGetIntersectionGeometryIndexKHR: case Op::OpRayQueryGetIntersectionPrimitiveIndexKHR:
        case Op::OpRayQueryGetIntersectionBarycentricsKHR: case Op::OpRayQueryGetIntersectionFrontFaceKHR:
        case Op::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR:
        case Op::OpRayQueryGetIntersectionObjectRayDirectionKHR: case Op::OpRayQueryGetIntersectionObjectRayOriginKHR:
        case Op::OpRayQueryGetWorldRayDirectionKHR: case Op::OpRayQueryGetWorldRayOriginKHR:
        case Op::OpRayQueryGetIntersectionObjectToWorldKHR: case Op::OpRayQueryGetIntersectionWorldToObjectKHR:
        case Op::OpGroupNonUniformShuffleDown: case Op::OpGroupNonUniformQuadBroadcast:
        case Op::OpGroupNonUniformQuadSwap: case Op::OpGroupNonUniformRotateKHR: case Op::OpIsHelperInvocationEXT:
            return mark(divergent_, at.result);
        // Equal in all lanes whatever goes in, if the whole subgroup takes part in the reduction.
        case Op::OpGroupNonUniformBroadcastFirst: case Op::OpGroupNonUniformBallot: case Op::OpGroupNonUniformAll:
        case Op::OpGroupNonUniformAny: case Op::OpGroupNonUniformAllEqual: case Op::OpGroupNonUniformBroadcast:
        case Op::OpSubgroupBallotKHR: case Op::OpSubgroupAllKHR: case Op::OpSubgroupAnyKHR:
        case Op::OpSubgroupAllEqualKHR: case Op::OpSubgroupFirstInvocationKHR: case Op::OpSubgroupReadInvocationKHR:
            return;
        case Op::OpGroupNonUniformIAdd: case Op::OpGroupNonUniformFAdd: case Op::OpGroupNonUniformIMul:
        case Op::OpGroupNonUniformFMul: case Op::OpGroupNonUniformSMin: case Op::OpGroupNonUniformUMin:
        case Op::OpGroupNonUniformFMin: case Op::OpGroupNonUniformSMax: case Op::OpGroupNonUniformUMax:
        case Op::OpGroupNonUniformFMax: case Op::OpGroupNonUniformBitwiseAnd: case Op::OpGroupNonUniformBitwiseOr:
        case Op::OpGroupNonUniformBitwiseXor: case Op::OpGroupNonUniformLogicalAnd:
        case Op::OpGroupNonUniformLogicalOr: case Op::OpGroupNonUniformLogicalXor:
            if (static_cast<spv::GroupOperation>(at.operand(1)) != spv::GroupOperation::Reduce)
                mark(divergent_, at.result);
            return;
        case Op::OpGroupNonUniformBallotBitCount:
            if (is_divergent(at.operand(2)) ||
                static_cast<spv::GroupOperation>(at.operand(1)) != spv::GroupOperation::Reduce)
                mark(divergent_, at.result);
            return;
        case Op::OpGroupNonUniformBallotBitExtract: case Op::OpGroupNonUniformBallotFindLSB:
        case Op::OpGroupNonUniformBallotFindMSB:
            if (any_operand(1)) mark(divergent_, at.result);
            return;
        case Op::OpSelect: case Op::OpPhi:
        default: break;
    }
    if (!at.result) return;
    // Literal operands look like ids of other things; only those that can be values or pointers count.
    switch (at.op) {
        case Op::OpCompositeExtract:
            if (is_divergent(at.operand(0))) mark(divergent_, at.result);
            return;
        case Op::OpCompositeInsert: case Op::OpVectorShuffle:
            if (is_divergent(at.operand(0)) || is_divergent(at.operand(1))) mark(divergent_, at.result);
            return;
        case Op::OpVariable: return;
        default:
            if (any_operand(0)) mark(divergent_, at.result);
    }
}

void Uniformity::analyze(const Function& function) {
    for (std::uint32_t index = 0; index < function.blocks.size(); ++index) {
        const Block& block = function.blocks[index];
        for (const Instruction& phi : block.phis) {
            bool divergent = divergent_join_[block.id] != 0;
            for (std::size_t i = 0; i < phi.operands.size(); i += 2)
                divergent = divergent || is_divergent(phi.operands[i]);
            if (divergent) mark(divergent_, phi.result);
        }
        for (const Instruction& instruction : block.body) visit(instruction, block.id);
        const Instruction& end = block.terminator;
        if (end.op == Op::OpReturnValue && is_divergent(end.operand(0))) mark(divergent_return_, function.id);
        if (has_divergent_branch(function, index)) spread(function, index);
    }
    // Values that are uniform in a loop differ behind it where lanes leave it one by one. Who uses them there sees
    // different values; the definition itself stays uniform.
    for (std::uint32_t header = 0; header < function.blocks.size(); ++header) {
        if (!function.blocks[header].continue_target || !has_divergent_exit(function.blocks[header].id)) continue;
        const std::uint32_t end = end_of_construct(function, header);
        std::vector<Id> inside;
        for (std::uint32_t i = header; i < end; ++i) {
            for (const Instruction& at : function.blocks[i].phis) inside.push_back(at.result);
            for (const Instruction& at : function.blocks[i].body)
                if (at.result) inside.push_back(at.result);
        }
        std::ranges::sort(inside);
        const auto is_inside = [&](Id id) { return std::ranges::binary_search(inside, id); };
        for (std::uint32_t i = 0; i < function.blocks.size(); ++i) {
            if (i >= header && i < end) continue;
            const Block& block = function.blocks[i];
            // Before the loop: at the header of a loop around it, for the next iteration.
            for (const Instruction& at : block.phis)
                for (std::size_t k = 0; k < at.operands.size(); k += 2)
                    if (is_inside(at.operands[k])) mark(divergent_, at.result);
            if (i < header) continue;
            for (const Instruction& at : block.body)
                for (const std::uint32_t operand : at.operands)
                    if (at.result && is_inside(operand)) mark(divergent_, at.result);
            // A branch or a store behind the loop that uses such a value directly: the definition counts as divergent.
            const auto direct = [&](Id id) {
                if (is_inside(id)) mark(divergent_, id);
            };
            for (const Instruction& at : block.body)
                if (!at.result)
                    for (const std::uint32_t operand : at.operands) direct(operand);
            direct(block.terminator.operand(0));
        }
    }
}

}  // namespace nacre::cpu
