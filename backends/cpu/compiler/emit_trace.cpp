// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>
#include <llvm/IR/Intrinsics.h>
#include <spirv-tools/libspirv.h>

#include <algorithm>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

namespace {

/// Operands that are values; the others are literals, types and the like.
std::vector<Id> value_operands(const Instruction& at) {
    std::size_t first = 0, end = at.operands.size();
    switch (at.op) {
        case Op::OpExtInst: first = 2; break;
        case Op::OpCompositeExtract: end = std::min<std::size_t>(end, 1); break;
        case Op::OpCompositeInsert:
        case Op::OpVectorShuffle:
        case Op::OpImageSampleImplicitLod:
        case Op::OpImageFetch:
        case Op::OpImageRead: end = std::min<std::size_t>(end, 2); break;
        default: break;
    }
    std::vector<Id> list;
    for (std::size_t i = first; i < end; ++i) list.push_back(at.operands[i]);
    return list;
}

}  // namespace

Id Emitter::trace_root(Id pointer) const {
    for (const auto& [id, function] : module.functions())
        for (const Block& block : function.blocks)
            for (const Instruction& at : block.body)
                if (at.result == pointer &&
                    (at.op == Op::OpAccessChain || at.op == Op::OpInBoundsAccessChain || at.op == Op::OpCopyObject))
                    return trace_root(at.operand(0));
    return pointer;
}

void Emitter::begin_trace(llvm::Value* is_traced, std::vector<Component> ids) {
    if (!trace_table) return;
    trace_lane = make_slot(builder.getInt32Ty(), "traced");
    // The last one: where a pixel is in the batch twice, it is what stays.
    llvm::Value* leading = builder.CreateIntrinsic(llvm::Intrinsic::ctlz, {builder.getInt32Ty()},
                                                   {mask_bits(is_traced), builder.getFalse()});
    llvm::Value* lane = builder.CreateSub(int32(31), leading);
    builder.CreateStore(lane, trace_lane);
    invocation_ids = std::move(ids);
    llvm::FunctionCallee function =
        external("nacre_cpu_trace_begin", builder.getVoidTy(), {pointer_type, pointer_type, builder.getInt32Ty()});
    llvm::Value* table = llvm::ConstantExpr::getIntToPtr(
        int64(static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(trace_table))), pointer_type);
    builder.CreateCall(function, {load_context(offsetof(ShaderContext, trace), pointer_type), table, lane});
}

void Emitter::trace_result(const Instruction& at, const std::vector<Component>& values) {
    if (!trace_table) return;
    if (at.op == Op::OpLoad) return trace(at, at.result, {trace_root(at.operand(0))}, values);
    if (at.op == Op::OpPhi) {
        std::vector<Id> incoming;
        for (std::size_t i = 0; i < at.operands.size(); i += 2) incoming.push_back(at.operands[i]);
        return trace(at, at.result, std::move(incoming), values);
    }
    trace(at, at.result, value_operands(at), values);
}

void Emitter::trace(const Instruction& at, Id result, std::vector<Id> operands, const std::vector<Component>& values) {
    if (!trace_table || !trace_lane || values.empty() || values.size() > 64) return;
    const auto found = std::ranges::find(trace_table->offsets, at.offset);
    const auto number = static_cast<std::uint32_t>(found - trace_table->offsets.begin());
    if (found == trace_table->offsets.end()) {
        rhi::TracedInstruction made;
        made.operation = spvOpcodeString(static_cast<std::uint32_t>(at.op));
        made.result = result;
        made.operands = std::move(operands);
        made.is_floating = values[0].value->getType()->isFPOrFPVectorTy();
        trace_table->instructions.push_back(std::move(made));
        trace_table->offsets.push_back(at.offset);
    }
    llvm::AllocaInst* rows =
        make_slot(llvm::ArrayType::get(builder.getInt8Ty(), values.size() * max_lanes * 8), "trace");
    std::int64_t offset = 0;
    for (const Component& value : values) {
        llvm::Value* row = widen(value);
        llvm::Type* wide = vector_of(builder.getDoubleTy());
        llvm::Type* scalar = row->getType()->getScalarType();
        if (scalar->isIntegerTy(1))
            row = builder.CreateUIToFP(row, wide);
        else if (scalar->isIntegerTy())
            row = builder.CreateSIToFP(row, wide);
        else if (!scalar->isDoubleTy())
            row = math.convert_float(row, builder.getDoubleTy());
        builder.CreateAlignedStore(row, at_offset(rows, offset), llvm::Align(8));
        offset += max_lanes * 8;
    }
    llvm::Type* word = builder.getInt32Ty();
    llvm::FunctionCallee function =
        external("nacre_cpu_trace_event", builder.getVoidTy(), {pointer_type, word, word, word, pointer_type, word});
    builder.CreateCall(function, {load_context(offsetof(ShaderContext, trace), pointer_type), int32(number),
                                  builder.CreateLoad(word, trace_lane), mask_bits(mask), rows,
                                  int32(static_cast<std::int64_t>(values.size()))});
}

void Emitter::trace_image_write(const std::vector<Component>& coordinates) {
    if (!trace_table || invocation_ids.size() != 3) return;
    std::vector<Component> all = coordinates;
    all.insert(all.end(), invocation_ids.begin(), invocation_ids.end());
    llvm::AllocaInst* rows = make_slot(llvm::ArrayType::get(builder.getInt8Ty(), all.size() * max_lanes * 4), "trace");
    for (std::size_t i = 0; i < all.size(); ++i)
        builder.CreateAlignedStore(builder.CreateSExtOrTrunc(widen(all[i]), vector_of(builder.getInt32Ty())),
                                   at_offset(rows, static_cast<std::int64_t>(i * max_lanes * 4)), llvm::Align(4));
    llvm::Type* word = builder.getInt32Ty();
    llvm::FunctionCallee function =
        external("nacre_cpu_trace_write", builder.getVoidTy(), {pointer_type, word, pointer_type, word});
    builder.CreateCall(function, {load_context(offsetof(ShaderContext, trace), pointer_type), mask_bits(effect_mask()),
                                  rows, int32(static_cast<std::int64_t>(coordinates.size()))});
}

}  // namespace nacre::cpu
