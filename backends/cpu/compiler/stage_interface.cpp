// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/stage_interface.h"

#include <algorithm>
#include <utility>

namespace nacre::cpu {
namespace {

/// Appends the scalars of a type and returns the location behind them.
std::uint32_t append(const Module& module, Id type_id, std::uint32_t location, std::uint32_t component,
                     const InterfaceScalar& how, std::vector<InterfaceScalar>& list) {
    const Type& type = module.type(type_id);
    switch (type.kind) {
        case TypeKind::vector: {
            // Vectors of more than two 64-bit values go on in the next location.
            const std::uint32_t words = module.type(type.element).bits == 64 ? 2 : 1;
            std::uint32_t word = component;
            for (std::uint32_t i = 0; i < type.count; ++i, word += words)
                append(module, type.element, location + word / 4, word % 4, how, list);
            return location + (word + 3) / 4;
        }
        case TypeKind::matrix:
        case TypeKind::array:
            for (std::uint32_t i = 0; i < type.count; ++i)
                location = append(module, type.element, location, component, how, list);
            return location;
        case TypeKind::structure:
            for (const Member& member : type.members) {
                InterfaceScalar inner = how;
                inner.flat |= member.flat, inner.no_perspective |= member.no_perspective;
                inner.centroid |= member.centroid, inner.sample |= member.sample;
                location =
                    append(module, member.type, member.location.value_or(location), member.component, inner, list);
            }
            return location;
        default: {
            InterfaceScalar scalar = how;
            scalar.location = location, scalar.component = component, scalar.type = type_id;
            scalar.is_wide = type.bits == 64;
            scalar.upper_location = location + (component + 1) / 4, scalar.upper_component = (component + 1) % 4;
            list.push_back(scalar);
            return location + 1;
        }
    }
}

/// First and behind the last of the operands that may be pointers; others may be literals that look like a pointer's
/// id.
std::pair<std::size_t, std::size_t> pointer_operands(const Instruction& at) {
    switch (at.op) {
        case spv::Op::OpVariable: return {0, 0};
        case spv::Op::OpCopyMemory: return {0, 2};
        case spv::Op::OpFunctionCall: return {1, at.operands.size()};
        case spv::Op::OpExtInst: return {2, at.operands.size()};
        case spv::Op::OpSelect: return {1, 3};
        default: return {0, 1};  // Of loads, stores, atomic operations, copies.
    }
}

}  // namespace

std::optional<std::vector<InterfaceScalar>> interface_scalars(const Module& module, const Variable& variable) {
    const Type& type = module.type(variable.type);
    const bool has_location =
        variable.location || (type.kind == TypeKind::structure && !type.members.empty() && type.members[0].location);
    if (!has_location) return std::nullopt;
    std::vector<InterfaceScalar> list;
    InterfaceScalar how;
    how.flat = variable.flat, how.no_perspective = variable.no_perspective;
    how.centroid = variable.centroid, how.sample = variable.sample;
    append(module, variable.type, variable.location.value_or(0), variable.component, how, list);
    return list;
}

bool uses_member(const Module& module, Id variable, std::uint32_t member) {
    for (const auto& [id, function] : module.functions())
        for (const Block& block : function.blocks)
            for (const Instruction& at : block.body) {
                if (at.op == spv::Op::OpAccessChain || at.op == spv::Op::OpInBoundsAccessChain) {
                    if (at.operand(0) == variable && at.operands.size() > 1 &&
                        module.constant_word(at.operand(1)) == member)
                        return true;
                    continue;
                }
                const auto [first, end] = pointer_operands(at);
                for (std::size_t i = first; i < std::min(end, at.operands.size()); ++i)
                    if (at.operands[i] == variable) return true;
            }
    return false;
}

}  // namespace nacre::cpu
