// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

void Emitter::emit_instruction(const Instruction& at) {
    switch (at.op) {
        case Op::OpNop: case Op::OpLine: case Op::OpNoLine: case Op::OpMemoryBarrier: case Op::OpAssumeTrueKHR:
            return;
        case Op::OpFunctionCall: emit_call(at); return;
        case Op::OpCopyObject: case Op::OpCopyLogical: case Op::OpExpectKHR: {
            const Value from = get(at.operand(0));
            if (from.pointer || from.image || from.sampler) {
                define(at.result) = from;
                finish_definition(at.result);
            } else {
                set(at, from.components);
            }
            return;
        }
        case Op::OpDemoteToHelperInvocation:
            if (live_slot)
                store_live(builder.CreateSelect(mask, llvm::Constant::getNullValue(mask_type), live()));
            return;
        case Op::OpIsHelperInvocationEXT:
            set(at, {Component(live_slot ? builder.CreateNot(live())
                                         : static_cast<llvm::Value*>(llvm::Constant::getNullValue(mask_type)))});
            return;
        default: break;
    }
    if (emit_stage(at) || emit_memory(at) || emit_arithmetic(at) || emit_composite(at) || emit_extended(at) ||
        emit_image(at) || emit_ray(at) || emit_atomic(at) || emit_subgroup(at))
        return;
    // Lanes run together anyway; only workgroups wait.
    if (at.op == Op::OpControlBarrier) return;
    reject(fmt::format("the instruction with opcode {} is not supported", static_cast<unsigned>(at.op)));
}

}  // namespace nacre::cpu
