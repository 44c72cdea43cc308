// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

namespace {

struct Part {
    std::uint32_t first = 0;  ///< Number of its first scalar.
    Id type = 0;
};

}  // namespace

bool Emitter::emit_composite(const Instruction& at) {
    if (!at.result || !at.type) return false;
    switch (at.op) {
        case Op::OpCompositeConstruct:
        case Op::OpCompositeExtract:
        case Op::OpCompositeInsert:
        case Op::OpVectorShuffle:
        case Op::OpVectorExtractDynamic: case Op::OpVectorInsertDynamic:
            set(at, evaluate_composite(at.op, at.type, at.operands));
            return true;
        default: return false;
    }
}

std::vector<Component> Emitter::evaluate_composite(Op op, Id type_id, std::span<const std::uint32_t> operands) {
    const auto part_at = [&](Id whole, std::span<const std::uint32_t> path) {
        Part part{0, whole};
        for (const std::uint32_t index : path) {
            const Type& type = module.type(part.type);
            if (type.kind == TypeKind::structure) {
                part.first += type.members.at(index).first_component;
                part.type = type.members[index].type;
            } else {
                part.first += index * module.type(type.element).components;
                part.type = type.element;
            }
        }
        return part;
    };
    const auto chosen = [&](const Component& condition, const Component& yes, const Component& no) {
        Component made = apply({condition, yes, no}, [&](auto v) { return select(v[0], v[1], v[2]); });
        if (follows_undefined()) made.undefined = chosen_undefined(condition, yes, no);
        return made;
    };
    switch (op) {
        case Op::OpCompositeConstruct: {
            std::vector<Component> components;
            for (const Id part : operands) {
                const std::vector<Component> value = get_components(part);
                components.insert(components.end(), value.begin(), value.end());
            }
            return components;
        }
        case Op::OpCompositeExtract: {
            const Value from = get(operands[0]);
            const Part part = part_at(module.type_of(operands[0]), operands.subspan(1));
            const std::uint32_t count = module.type(part.type).components;
            return std::vector<Component>(from.components.begin() + part.first,
                                          from.components.begin() + part.first + count);
        }
        case Op::OpCompositeInsert: {
            const std::vector<Component> object = get_components(operands[0]);
            std::vector<Component> components = get(operands[1]).components;
            const Part part = part_at(module.type_of(operands[1]), operands.subspan(2));
            for (std::size_t i = 0; i < object.size(); ++i) components.at(part.first + i) = object[i];
            return components;
        }
        case Op::OpVectorShuffle: {
            std::vector<Component> all = get(operands[0]).components;
            const Value second = get(operands[1]);
            all.insert(all.end(), second.components.begin(), second.components.end());
            std::vector<Component> components;
            for (const std::uint32_t index : operands.subspan(2))
                components.push_back(index < all.size() ? all[index]
                                                        : zero(module.type(module.type(type_id).element)));
            return components;
        }
        case Op::OpVectorExtractDynamic: {
            const Value from = get(operands[0]);
            const Component index = get_scalar(operands[1]);
            if (options.checks) check_undefined(std::span(&index, 1), origin_of(operands[1]));
            // A chain of selections: vectors have at most four components.
            Component result = zero(module.type(type_id));
            for (std::size_t i = 0; i < from.components.size(); ++i) {
                const Component is_this = apply({index}, [&](auto v) {
                    return builder.CreateICmpEQ(v[0], llvm::ConstantInt::get(v[0]->getType(), i));
                });
                result = chosen(is_this, from.components[i], result);
            }
            return {result};
        }
        case Op::OpVectorInsertDynamic: {
            std::vector<Component> components = get(operands[0]).components;
            const Component value = get_scalar(operands[1]), index = get_scalar(operands[2]);
            if (options.checks) check_undefined(std::span(&index, 1), origin_of(operands[2]));
            for (std::size_t i = 0; i < components.size(); ++i) {
                const Component is_this = apply({index}, [&](auto v) {
                    return builder.CreateICmpEQ(v[0], llvm::ConstantInt::get(v[0]->getType(), i));
                });
                components[i] = chosen(is_this, value, components[i]);
            }
            return components;
        }
        default: return {};
    }
}

}  // namespace nacre::cpu
