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
    const auto part_at = [&](Id type_id, std::span<const std::uint32_t> path) {
        Part part{0, type_id};
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
    switch (at.op) {
        case Op::OpCompositeConstruct: {
            std::vector<Component> components;
            for (const Id part : at.operands) {
                const std::vector<Component> value = get_components(part);
                components.insert(components.end(), value.begin(), value.end());
            }
            set(at, std::move(components));
            return true;
        }
        case Op::OpCompositeExtract: {
            const Value from = get(at.operand(0));
            const Part part = part_at(module.type_of(at.operand(0)), at.operands.subspan(1));
            const std::uint32_t count = module.type(part.type).components;
            set(at, std::vector<Component>(from.components.begin() + part.first, from.components.begin() + part.first + count));
            return true;
        }
        case Op::OpCompositeInsert: {
            const std::vector<Component> object = get_components(at.operand(0));
            std::vector<Component> components = get(at.operand(1)).components;
            const Part part = part_at(module.type_of(at.operand(1)), at.operands.subspan(2));
            for (std::size_t i = 0; i < object.size(); ++i) components.at(part.first + i) = object[i];
            set(at, std::move(components));
            return true;
        }
        case Op::OpVectorShuffle: {
            std::vector<Component> all = get(at.operand(0)).components;
            const Value second = get(at.operand(1));
            all.insert(all.end(), second.components.begin(), second.components.end());
            std::vector<Component> components;
            for (const std::uint32_t index : at.operands.subspan(2))
                components.push_back(index < all.size() ? all[index]
                                                        : zero(module.type(module.type(at.type).element)));
            set(at, std::move(components));
            return true;
        }
        case Op::OpVectorExtractDynamic: {
            const Value from = get(at.operand(0));
            const Component index = get_scalar(at.operand(1));
            // A chain of selections: vectors have at most four components.
            Component result = zero(module.type(at.type));
            for (std::size_t i = 0; i < from.components.size(); ++i) {
                const Component is_this = apply({index}, [&](auto v) {
                    return builder.CreateICmpEQ(v[0], llvm::ConstantInt::get(v[0]->getType(), i));
                });
                result = apply({is_this, from.components[i], result}, [&](auto v) { return select(v[0], v[1], v[2]); });
            }
            set(at, {result});
            return true;
        }
        case Op::OpVectorInsertDynamic: {
            std::vector<Component> components = get(at.operand(0)).components;
            const Component value = get_scalar(at.operand(1)), index = get_scalar(at.operand(2));
            for (std::size_t i = 0; i < components.size(); ++i) {
                const Component is_this = apply({index}, [&](auto v) {
                    return builder.CreateICmpEQ(v[0], llvm::ConstantInt::get(v[0]->getType(), i));
                });
                components[i] = apply({is_this, value, components[i]}, [&](auto v) { return select(v[0], v[1], v[2]); });
            }
            set(at, std::move(components));
            return true;
        }
        default: return false;
    }
}

}  // namespace nacre::cpu
