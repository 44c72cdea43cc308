// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>

#include "backends/cpu/compiler/emitter.h"
#include "backends/cpu/rays/ray_query.h"

namespace nacre::cpu {

using spv::Op;

namespace {

constexpr std::uint64_t most_query_bytes = 1 << 20;
constexpr std::size_t row_bytes = max_lanes * 4;

std::array<std::size_t, 3> rows(std::size_t first) { return {first, first + row_bytes, first + 2 * row_bytes}; }

bool is_committed_getter(Op op) {
    switch (op) {
        case Op::OpRayQueryGetIntersectionTKHR: case Op::OpRayQueryGetIntersectionInstanceCustomIndexKHR:
        case Op::OpRayQueryGetIntersectionInstanceIdKHR: case Op::OpRayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR:
        case Op::OpRayQueryGetIntersectionGeometryIndexKHR: case Op::OpRayQueryGetIntersectionPrimitiveIndexKHR:
        case Op::OpRayQueryGetIntersectionBarycentricsKHR: case Op::OpRayQueryGetIntersectionFrontFaceKHR:
        case Op::OpRayQueryGetIntersectionObjectRayDirectionKHR: case Op::OpRayQueryGetIntersectionObjectRayOriginKHR:
        case Op::OpRayQueryGetIntersectionObjectToWorldKHR: case Op::OpRayQueryGetIntersectionWorldToObjectKHR:
            return true;
        default: return false;
    }
}

/// Whether the shader asks nothing of committed hits but their type.
bool asks_only_whether_hit(const Module& module) {
    for (const auto& [id, function] : module.functions())
        for (const Block& block : function.blocks)
            for (const Instruction& at : block.body)
                if (is_committed_getter(at.op) && module.constant_word(at.operand(1)).value_or(1) != 0) return false;
    return true;
}

}  // namespace

bool Emitter::is_ray_query(Id id) const {
    const Type* type = &module.type(id);
    while (type->kind == TypeKind::array) type = &module.type(type->element);
    return type->kind == TypeKind::ray_query;
}

Pointer Emitter::ray_query_pointer(Id id) {
    const Variable& variable = *module.variable(id);
    llvm::AllocaInst*& slot = ray_queries[id];
    if (!slot) {
        const std::uint64_t bytes = module.tight_size(variable.type);
        if (bytes == 0 || bytes > most_query_bytes) reject("an array of that many ray queries is not supported");
        slot = make_slot(llvm::ArrayType::get(builder.getInt8Ty(), bytes), "ray_query");
    }
    Pointer pointer;
    pointer.kind = Pointer::Kind::bytes;
    pointer.storage = variable.storage;
    pointer.type = variable.type;
    pointer.base = Component(slot);
    return pointer;
}

void Emitter::clear_ray_query(Id id) {
    const Pointer pointer = ray_query_pointer(id);
    const std::uint64_t bytes = module.tight_size(pointer.type);
    // All that must not be what lay there before: without a status no other member is looked at.
    for (std::uint64_t at = 0; at < bytes; at += sizeof(RayQueryLanes))
        builder.CreateMemSet(at_offset(pointer.base.value, static_cast<std::int64_t>(at + offsetof(RayQueryLanes, status))),
                             builder.getInt8(0), row_bytes, llvm::MaybeAlign(64));
}

void Emitter::for_each_query(Id pointer_id, const std::function<void(llvm::Value*, llvm::Value*)>& body) {
    const Value value = get(pointer_id);
    if (!value.pointer || module.type(value.pointer->type).kind != TypeKind::ray_query)
        reject("a ray query is used that is no variable");
    const Pointer& pointer = *value.pointer;
    for_each_different(Component(addresses(pointer, 0)), both(mask, pointer.valid ? pointer.valid.value : nullptr), body);
}

std::vector<Component> Emitter::read_query(Id pointer, std::span<const std::size_t> offsets, llvm::Type* scalar) {
    std::vector<llvm::AllocaInst*> slots_of;
    for (std::size_t i = 0; i < offsets.size(); ++i) {
        slots_of.push_back(make_slot(vector_of(scalar), "of_query"));
        builder.CreateStore(llvm::Constant::getNullValue(vector_of(scalar)), slots_of.back());
    }
    for_each_query(pointer, [&](llvm::Value* query, llvm::Value* lanes_on) {
        for (std::size_t i = 0; i < offsets.size(); ++i) {
            llvm::Value* row = builder.CreateAlignedLoad(vector_of(scalar), at_offset(query, static_cast<std::int64_t>(offsets[i])),
                                                         llvm::Align(64));
            if (!is_all(lanes_on)) row = select(lanes_on, row, builder.CreateLoad(vector_of(scalar), slots_of[i]));
            builder.CreateStore(row, slots_of[i]);
        }
    });
    std::vector<Component> values;
    for (llvm::AllocaInst* slot : slots_of) values.emplace_back(builder.CreateLoad(vector_of(scalar), slot));
    if (scalar->isFloatTy())
        for (Component& value : values) value = from_single(value);
    return values;
}

std::vector<Component> Emitter::ray_property(Id pointer, std::uint32_t property, std::uint32_t words, llvm::Type* scalar) {
    llvm::FunctionCallee function = external("nacre_cpu_ray_property", builder.getVoidTy(),
                                             {pointer_type, builder.getInt32Ty(), builder.getInt32Ty(), pointer_type});
    llvm::AllocaInst* result = make_slot(llvm::ArrayType::get(builder.getInt8Ty(), row_bytes * most_property_words), "property");
    std::vector<llvm::AllocaInst*> slots_of;
    for (std::uint32_t i = 0; i < words; ++i) {
        slots_of.push_back(make_slot(vector_of(scalar), "of_hit"));
        builder.CreateStore(llvm::Constant::getNullValue(vector_of(scalar)), slots_of.back());
    }
    for_each_query(pointer, [&](llvm::Value* query, llvm::Value* lanes_on) {
        builder.CreateCall(function, {query, int32(property), mask_bits(lanes_on), result});
        for (std::uint32_t i = 0; i < words; ++i) {
            llvm::Value* row = builder.CreateAlignedLoad(vector_of(scalar), at_offset(result, static_cast<std::int64_t>(i * row_bytes)),
                                                         llvm::Align(64));
            builder.CreateStore(select(lanes_on, row, builder.CreateLoad(vector_of(scalar), slots_of[i])), slots_of[i]);
        }
    });
    std::vector<Component> values;
    for (llvm::AllocaInst* slot : slots_of) values.emplace_back(builder.CreateLoad(vector_of(scalar), slot));
    if (scalar->isFloatTy())
        for (Component& value : values) value = from_single(value);
    return values;
}

bool Emitter::emit_ray(const Instruction& at) {
    llvm::Type* word = builder.getInt32Ty();
    llvm::Type* real = builder.getFloatTy();
    const auto put = [&](llvm::Value* query, llvm::Value* lanes_on, std::size_t offset, llvm::Value* values) {
        llvm::Value* address = at_offset(query, static_cast<std::int64_t>(offset));
        if (!is_all(lanes_on)) values = select(lanes_on, values, builder.CreateAlignedLoad(values->getType(), address, llvm::Align(64)));
        builder.CreateAlignedStore(values, address, llvm::Align(64));
    };
    const auto is_committed = [&] { return module.constant_word(at.operand(1)).value_or(1) != 0; };
    const auto get_row = [&](std::size_t committed, std::size_t candidate, llvm::Type* scalar) {
        const std::size_t offset = is_committed() ? committed : candidate;
        set(at, read_query(at.operand(0), std::span(&offset, 1), scalar));
        return true;
    };
    const auto get_property = [&](RayProperty property, std::uint32_t words, llvm::Type* scalar) {
        set(at, ray_property(at.operand(0), static_cast<std::uint32_t>(property) | (is_committed() ? ray_property_committed : 0), words, scalar));
        return true;
    };
    switch (at.op) {
        case Op::OpRayQueryInitializeKHR: {
            const Component descriptor_address = get(at.operand(1)).image;
            if (!descriptor_address) reject("an acceleration structure that is no bound resource is not supported");
            llvm::Value* scenes = nullptr;
            if (descriptor_address.is_uniform()) {
                scenes = splat(invariant_load(pointer_type, at_offset(descriptor_address.value, offsetof(Descriptor, data)), 8));
            } else {
                llvm::Value* places = builder.CreateGEP(builder.getInt8Ty(), descriptor_address.value, int64(offsetof(Descriptor, data)));
                llvm::Type* wide = vector_of(builder.getInt64Ty());
                scenes = builder.CreateIntToPtr(
                    builder.CreateMaskedGather(wide, places, llvm::Align(8), mask, llvm::Constant::getNullValue(wide)), vector_of(pointer_type));
            }
            const Component flags = get_scalar(at.operand(2)), cull_mask = get_scalar(at.operand(3));
            note_narrowed("ray");
            Value origin = get(at.operand(4)), direction = get(at.operand(6));
            for (Component& coordinate : origin.components) coordinate = to_single(coordinate);
            for (Component& coordinate : direction.components) coordinate = to_single(coordinate);
            const Component t_min = to_single(get_scalar(at.operand(5))), t_max = to_single(get_scalar(at.operand(7)));
            llvm::Value* zero_row = llvm::Constant::getNullValue(vector_of(word));
            llvm::Value* none_row = llvm::Constant::getAllOnesValue(vector_of(word));
            for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
                const auto row = [&](std::size_t offset, llvm::Value* values) { put(query, lanes_on, offset, values); };
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    row(offsetof(RayQueryLanes, origin) + axis * row_bytes, widen(origin.components.at(axis)));
                    row(offsetof(RayQueryLanes, direction) + axis * row_bytes, widen(direction.components.at(axis)));
                }
                row(offsetof(RayQueryLanes, t_min), widen(t_min));
                row(offsetof(RayQueryLanes, time), zero_row);
                row(offsetof(RayQueryLanes, t), widen(t_max));
                row(offsetof(RayQueryLanes, cull_mask), builder.CreateAnd(widen(cull_mask), splat(int32(0xff))));
                row(offsetof(RayQueryLanes, id), lane_numbers());
                row(offsetof(RayQueryLanes, reserved), zero_row);
                row(offsetof(RayQueryLanes, primitive), none_row);
                row(offsetof(RayQueryLanes, geometry), none_row);
                row(offsetof(RayQueryLanes, instance), none_row);
                row(offsetof(RayQueryLanes, scene), scenes);
                row(offsetof(RayQueryLanes, flags), widen(flags));
                row(offsetof(RayQueryLanes, status), splat(int32(static_cast<std::int32_t>(RayStatus::ready))));
                row(offsetof(RayQueryLanes, kind), splat(int32(1)));
            });
            return true;
        }
        case Op::OpRayQueryProceedKHR: {
            llvm::FunctionCallee function = external("nacre_cpu_ray_proceed", word, {pointer_type, word, word});
            const std::uint32_t hints = asks_only_whether_hit(module) ? std::uint32_t{ray_only_whether_hit} : 0;
            llvm::AllocaInst* bits = make_slot(word, "candidates");
            builder.CreateStore(int32(0), bits);
            for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
                llvm::Value* found = builder.CreateCall(function, {query, mask_bits(lanes_on), int32(hints)});
                builder.CreateStore(builder.CreateOr(builder.CreateLoad(word, bits), found), bits);
            });
            llvm::Value* narrow_bits = builder.CreateZExtOrTrunc(builder.CreateLoad(word, bits), builder.getIntNTy(lanes));
            set(at, {Component(builder.CreateBitCast(narrow_bits, mask_type))});
            return true;
        }
        case Op::OpRayQueryTerminateKHR:
            for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
                put(query, lanes_on, offsetof(RayQueryLanes, status), splat(int32(static_cast<std::int32_t>(RayStatus::finished))));
            });
            return true;
        case Op::OpRayQueryConfirmIntersectionKHR: {
            llvm::FunctionCallee function = external("nacre_cpu_ray_confirm", builder.getVoidTy(), {pointer_type, word});
            for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
                builder.CreateCall(function, {query, mask_bits(lanes_on)});
            });
            return true;
        }
        case Op::OpRayQueryGenerateIntersectionKHR:
            // Only candidates that are boxes may be answered so, and no acceleration structure has boxes.
            return true;
        case Op::OpRayQueryGetIntersectionTypeKHR: {
            if (!is_committed()) {
                // Candidates are triangles: type 0.
                set(at, {Component(llvm::Constant::getNullValue(vector_of(word)))});
                return true;
            }
            const std::array<std::size_t, 3> offsets{offsetof(RayQueryLanes, geometry), offsetof(RayQueryLanes, kind),
                                                     offsetof(RayQueryLanes, status)};
            const std::vector<Component> found = read_query(at.operand(0), offsets, word);
            llvm::Value* zero_row = llvm::Constant::getNullValue(vector_of(word));
            llvm::Value* is_hit = builder.CreateAnd(builder.CreateICmpNE(found[0].value, llvm::Constant::getAllOnesValue(vector_of(word))),
                                                    builder.CreateICmpNE(found[2].value, zero_row));
            set(at, {Component(builder.CreateSelect(is_hit, found[1].value, zero_row))});
            return true;
        }
        case Op::OpRayQueryGetIntersectionTKHR:
            return get_row(offsetof(RayQueryLanes, t), offsetof(RayQueryLanes, candidate_t), real);
        case Op::OpRayQueryGetIntersectionInstanceIdKHR:
            return get_row(offsetof(RayQueryLanes, instance), offsetof(RayQueryLanes, candidate_instance), word);
        case Op::OpRayQueryGetIntersectionGeometryIndexKHR:
            return get_row(offsetof(RayQueryLanes, geometry), offsetof(RayQueryLanes, candidate_geometry), word);
        case Op::OpRayQueryGetIntersectionPrimitiveIndexKHR:
            return get_row(offsetof(RayQueryLanes, primitive), offsetof(RayQueryLanes, candidate_primitive), word);
        case Op::OpRayQueryGetIntersectionBarycentricsKHR: {
            const std::array<std::size_t, 2> offsets =
                is_committed() ? std::array{offsetof(RayQueryLanes, u), offsetof(RayQueryLanes, v)}
                               : std::array{offsetof(RayQueryLanes, candidate_u), offsetof(RayQueryLanes, candidate_v)};
            set(at, read_query(at.operand(0), offsets, real));
            return true;
        }
        case Op::OpRayQueryGetIntersectionInstanceCustomIndexKHR: return get_property(RayProperty::custom_index, 1, word);
        case Op::OpRayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR:
            return get_property(RayProperty::table_offset, 1, word);
        case Op::OpRayQueryGetIntersectionFrontFaceKHR: {
            const std::uint32_t property =
                static_cast<std::uint32_t>(RayProperty::front_face) | (is_committed() ? ray_property_committed : 0);
            const Component found = ray_property(at.operand(0), property, 1, word).at(0);
            set(at, {Component(builder.CreateICmpNE(found.value, llvm::Constant::getNullValue(vector_of(word))))});
            return true;
        }
        case Op::OpRayQueryGetIntersectionObjectRayOriginKHR: return get_property(RayProperty::object_origin, 3, real);
        case Op::OpRayQueryGetIntersectionObjectRayDirectionKHR: return get_property(RayProperty::object_direction, 3, real);
        case Op::OpRayQueryGetIntersectionObjectToWorldKHR: return get_property(RayProperty::object_to_world, 12, real);
        case Op::OpRayQueryGetIntersectionWorldToObjectKHR: return get_property(RayProperty::world_to_object, 12, real);
        case Op::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR:
            // No acceleration structure has boxes.
            set(at, {Component(llvm::Constant::getNullValue(mask_type))});
            return true;
        case Op::OpRayQueryGetRayTMinKHR: {
            const std::size_t offset = offsetof(RayQueryLanes, t_min);
            set(at, read_query(at.operand(0), std::span(&offset, 1), real));
            return true;
        }
        case Op::OpRayQueryGetRayFlagsKHR: {
            const std::size_t offset = offsetof(RayQueryLanes, flags);
            set(at, read_query(at.operand(0), std::span(&offset, 1), word));
            return true;
        }
        case Op::OpRayQueryGetWorldRayOriginKHR:
            set(at, read_query(at.operand(0), rows(offsetof(RayQueryLanes, origin)), real));
            return true;
        case Op::OpRayQueryGetWorldRayDirectionKHR:
            set(at, read_query(at.operand(0), rows(offsetof(RayQueryLanes, direction)), real));
            return true;
        default: return false;
    }
}

}  // namespace nacre::cpu
