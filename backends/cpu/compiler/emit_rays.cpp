// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>

#include <bit>
#include <optional>

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
        case Op::OpRayQueryGetIntersectionInstanceIdKHR:
        case Op::OpRayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR:
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

/// The flags of every query of the shader, where they are the same constant.
std::optional<std::uint32_t> flags_of_all_queries(const Module& module) {
    std::optional<std::uint32_t> result;
    for (const auto& [id, function] : module.functions())
        for (const Block& block : function.blocks)
            for (const Instruction& at : block.body) {
                if (at.op != Op::OpRayQueryInitializeKHR) continue;
                const std::optional<std::uint32_t> flags = module.constant_word(at.operand(2));
                if (!flags || (result && *result != *flags)) return {};
                result = flags;
            }
    return result;
}

}  // namespace

bool Emitter::is_ray_query(Id id) const {
    const Type* type = &module.type(id);
    while (type->kind == TypeKind::array) type = &module.type(type->element);
    return type->kind == TypeKind::ray_query;
}

Pointer Emitter::ray_query_pointer(Id id) {
    const Variable& variable = *module.variable(id);
    llvm::Value*& slot = ray_queries[id];
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
        builder.CreateMemSet(
            at_offset(pointer.base.value, static_cast<std::int64_t>(at + offsetof(RayQueryLanes, status))),
            builder.getInt8(0), row_bytes, llvm::MaybeAlign(64));
}

void Emitter::for_each_query(Id pointer_id, const std::function<void(llvm::Value*, llvm::Value*)>& body) {
    const Value value = get(pointer_id);
    if (!value.pointer || module.type(value.pointer->type).kind != TypeKind::ray_query)
        reject("a ray query is used that is no variable");
    const Pointer& pointer = *value.pointer;
    for_each_different(Component(addresses(pointer, 0)), both(mask, pointer.valid ? pointer.valid.value : nullptr),
                       body);
}

std::vector<Component> Emitter::read_query(Id pointer, std::span<const std::size_t> offsets, llvm::Type* scalar) {
    std::vector<llvm::AllocaInst*> slots_of;
    for (std::size_t i = 0; i < offsets.size(); ++i) {
        slots_of.push_back(make_slot(vector_of(scalar), "of_query"));
        builder.CreateStore(llvm::Constant::getNullValue(vector_of(scalar)), slots_of.back());
    }
    for_each_query(pointer, [&](llvm::Value* query, llvm::Value* lanes_on) {
        for (std::size_t i = 0; i < offsets.size(); ++i) {
            llvm::Value* row = builder.CreateAlignedLoad(
                vector_of(scalar), at_offset(query, static_cast<std::int64_t>(offsets[i])), llvm::Align(64));
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

std::vector<Component> Emitter::ray_property(Id pointer, std::uint32_t property, std::uint32_t words,
                                             llvm::Type* scalar) {
    llvm::FunctionCallee function = external("nacre_cpu_ray_property", builder.getVoidTy(),
                                             {pointer_type, builder.getInt32Ty(), builder.getInt32Ty(), pointer_type});
    llvm::AllocaInst* result =
        make_slot(llvm::ArrayType::get(builder.getInt8Ty(), row_bytes * most_property_words), "property");
    std::vector<llvm::AllocaInst*> slots_of;
    for (std::uint32_t i = 0; i < words; ++i) {
        slots_of.push_back(make_slot(vector_of(scalar), "of_hit"));
        builder.CreateStore(llvm::Constant::getNullValue(vector_of(scalar)), slots_of.back());
    }
    for_each_query(pointer, [&](llvm::Value* query, llvm::Value* lanes_on) {
        builder.CreateCall(function, {query, int32(property), mask_bits(lanes_on), result});
        for (std::uint32_t i = 0; i < words; ++i) {
            llvm::Value* row = builder.CreateAlignedLoad(
                vector_of(scalar), at_offset(result, static_cast<std::int64_t>(i * row_bytes)), llvm::Align(64));
            builder.CreateStore(select(lanes_on, row, builder.CreateLoad(vector_of(scalar), slots_of[i])), slots_of[i]);
        }
    });
    std::vector<Component> values;
    for (llvm::AllocaInst* slot : slots_of) values.emplace_back(builder.CreateLoad(vector_of(scalar), slot));
    if (scalar->isFloatTy())
        for (Component& value : values) value = from_single(value);
    return values;
}

llvm::Value* Emitter::status_row(RayStatus status) { return splat(int32(static_cast<std::int32_t>(status))); }

llvm::Value* Emitter::traceable(const Value& origin, const Value& direction, const Component& t_min,
                                const Component& t_max) {
    // Bits of floats that are not negative rise as they do, and those of what is no number lie above all others.
    const auto bits = [&](const Component& component) {
        return builder.CreateBitCast(widen(component), vector_of(builder.getInt32Ty()));
    };
    const auto without_sign = [&](llvm::Value* value) { return builder.CreateAnd(value, splat(int32(0x7fffffff))); };
    llvm::Value* largest = splat(int32(std::bit_cast<std::int32_t>(largest_ray_coordinate)));
    llvm::Value* infinity = splat(int32(0x7f800000));
    llvm::Value* begin = without_sign(bits(t_min));
    llvm::Value* end = bits(t_max);
    llvm::Value* result = builder.CreateAnd(builder.CreateICmpULE(begin, end), builder.CreateICmpULE(end, infinity));
    // Zero may have a sign.
    result = builder.CreateAnd(
        result, builder.CreateICmpSGE(builder.CreateSub(bits(t_min), splat(int32(1))), splat(int32(-1))));
    for (const Value* vector : {&origin, &direction})
        for (const Component& component : vector->components)
            result = builder.CreateAnd(result, builder.CreateICmpULE(without_sign(bits(component)), largest));
    return result;
}

llvm::Value* Emitter::proceed_hints(llvm::Value* query, llvm::Value* fresh, llvm::Value*& spread2) {
    llvm::Type* word = builder.getInt32Ty();
    llvm::Type* real = builder.getFloatTy();
    const auto row_at = [&](std::size_t offset, llvm::Type* scalar) {
        return builder.CreateAlignedLoad(vector_of(scalar), at_offset(query, static_cast<std::int64_t>(offset)),
                                         llvm::Align(64));
    };
    llvm::Value* first = builder.CreateZExt(first_lane(fresh), builder.getInt64Ty());
    const auto first_of = [&](std::size_t offset, llvm::Type* scalar) {
        llvm::Value* row = at_offset(query, static_cast<std::int64_t>(offset));
        return splat(builder.CreateLoad(scalar, builder.CreateGEP(scalar, row, first)));
    };
    const auto holds = [&](llvm::Value* condition) {
        return builder.CreateNot(
            any(select(fresh, builder.CreateNot(condition), llvm::Constant::getNullValue(mask_type))));
    };
    const auto hint = [&](llvm::Value* condition, RayHints bit) {
        return builder.CreateSelect(condition, int32(bit), int32(0));
    };

    std::uint32_t known = 0;
    if (asks_only_whether_hit(module)) known |= ray_only_whether_hit;
    if (options.mode == ExecutionMode::consistent) known |= ray_one_by_one;
    llvm::Value* hints = nullptr;
    if (const std::optional<std::uint32_t> flags = flags_of_all_queries(module)) {
        if (*flags & ray_opaque) known |= ray_all_opaque;
        if (*flags & ray_terminate_on_first_hit) known |= ray_all_terminate;
        hints = int32(static_cast<std::int32_t>(known | *flags << ray_flags_shift));
    } else {
        llvm::Value* flags_row = row_at(offsetof(RayQueryLanes, flags), word);
        llvm::Value* none = llvm::Constant::getNullValue(vector_of(word));
        llvm::Value* of_any = builder.CreateOrReduce(select(fresh, flags_row, none));
        llvm::Value* of_all =
            builder.CreateAndReduce(select(fresh, flags_row, llvm::Constant::getAllOnesValue(vector_of(word))));
        const auto is_set = [&](RayFlags flag) {
            return builder.CreateICmpNE(builder.CreateAnd(of_all, int32(flag)), int32(0));
        };
        hints = builder.CreateOr(int32(static_cast<std::int32_t>(known)),
                                 builder.CreateShl(of_any, int32(ray_flags_shift)));
        hints = builder.CreateOr(hints, hint(is_set(ray_opaque), ray_all_opaque));
        hints = builder.CreateOr(hints, hint(is_set(ray_terminate_on_first_hit), ray_all_terminate));
    }
    llvm::Type* wide = builder.getInt64Ty();
    hints = builder.CreateOr(hints, hint(holds(builder.CreateICmpEQ(row_at(offsetof(RayQueryLanes, scene), wide),
                                                                    first_of(offsetof(RayQueryLanes, scene), wide))),
                                         ray_one_scene));

    // Squares throughout: of lengths, cosines and distances.
    llvm::Value* dot = nullptr;
    llvm::Value* length2 = nullptr;
    llvm::Value* first_length2 = nullptr;
    llvm::Value* distance2 = nullptr;
    const auto accumulate = [&](llvm::Value*& sum, llvm::Value* a, llvm::Value* b) {
        llvm::Value* product = builder.CreateFMul(a, b);
        sum = sum ? builder.CreateFAdd(sum, product) : product;
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t direction = offsetof(RayQueryLanes, direction) + axis * row_bytes;
        const std::size_t origin = offsetof(RayQueryLanes, origin) + axis * row_bytes;
        llvm::Value* along = row_at(direction, real);
        llvm::Value* first_along = first_of(direction, real);
        accumulate(dot, along, first_along);
        accumulate(length2, along, along);
        accumulate(first_length2, first_along, first_along);
        llvm::Value* apart = builder.CreateFSub(row_at(origin, real), first_of(origin, real));
        accumulate(distance2, apart, apart);
    }
    llvm::Value* limit = builder.CreateFMul(builder.CreateFMul(length2, first_length2),
                                            splat(llvm::ConstantFP::get(real, smallest_similar_cosine2)));
    llvm::Value* is_similar =
        builder.CreateAnd(builder.CreateFCmpOGT(dot, llvm::Constant::getNullValue(vector_of(real))),
                          builder.CreateFCmpOGE(builder.CreateFMul(dot, dot), limit));
    hints = builder.CreateOr(hints, hint(holds(is_similar), ray_similar_directions));
    spread2 = builder.CreateFPMaxReduce(select(fresh, distance2, llvm::Constant::getNullValue(vector_of(real))));
    return hints;
}

void Emitter::proceed_query(const Instruction& at) {
    llvm::Type* word = builder.getInt32Ty();
    llvm::FunctionCallee function =
        external("nacre_cpu_ray_proceed", word, {pointer_type, word, word, word, builder.getFloatTy()});
    llvm::AllocaInst* bits = make_slot(word, "candidates");
    builder.CreateStore(int32(0), bits);
    for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
        llvm::Value* status_address = at_offset(query, offsetof(RayQueryLanes, status));
        llvm::Value* status = builder.CreateAlignedLoad(vector_of(word), status_address, llvm::Align(64));
        llvm::Value* fresh = both(lanes_on, builder.CreateICmpEQ(status, status_row(RayStatus::ready)));
        llvm::Value* waiting = both(lanes_on, builder.CreateICmpEQ(status, status_row(RayStatus::waiting)));
        llvm::Value* active = builder.CreateOr(fresh, waiting);
        llvm::BasicBlock* proceeds = llvm::BasicBlock::Create(context, "proceeds", function_);
        llvm::BasicBlock* proceeded = llvm::BasicBlock::Create(context, "proceeded", function_);
        builder.CreateCondBr(any(active), proceeds, proceeded);
        builder.SetInsertPoint(proceeds);
        llvm::Value* spread2 = nullptr;
        llvm::Value* hints = proceed_hints(query, fresh, spread2);
        llvm::Value* found =
            builder.CreateCall(function, {query, mask_bits(fresh), mask_bits(waiting), hints, spread2});
        llvm::Value* is_waiting =
            builder.CreateBitCast(builder.CreateZExtOrTrunc(found, builder.getIntNTy(lanes)), mask_type);
        llvm::Value* next = select(is_waiting, status_row(RayStatus::waiting), status_row(RayStatus::finished));
        builder.CreateAlignedStore(select(active, next, status), status_address, llvm::Align(64));
        builder.CreateStore(builder.CreateOr(builder.CreateLoad(word, bits), found), bits);
        builder.CreateBr(proceeded);
        builder.SetInsertPoint(proceeded);
    });
    llvm::Value* narrow_bits = builder.CreateZExtOrTrunc(builder.CreateLoad(word, bits), builder.getIntNTy(lanes));
    set(at, {Component(builder.CreateBitCast(narrow_bits, mask_type))});
}

bool Emitter::emit_ray(const Instruction& at) {
    llvm::Type* word = builder.getInt32Ty();
    llvm::Type* real = builder.getFloatTy();
    const auto put = [&](llvm::Value* query, llvm::Value* lanes_on, std::size_t offset, llvm::Value* values) {
        llvm::Value* address = at_offset(query, static_cast<std::int64_t>(offset));
        if (!is_all(lanes_on))
            values = select(lanes_on, values, builder.CreateAlignedLoad(values->getType(), address, llvm::Align(64)));
        builder.CreateAlignedStore(values, address, llvm::Align(64));
    };
    const auto is_committed = [&] { return module.constant_word(at.operand(1)).value_or(1) != 0; };
    const auto get_row = [&](std::size_t committed, std::size_t candidate, llvm::Type* scalar) {
        const std::size_t offset = is_committed() ? committed : candidate;
        set(at, read_query(at.operand(0), std::span(&offset, 1), scalar));
        return true;
    };
    const auto get_property = [&](RayProperty property, std::uint32_t words, llvm::Type* scalar) {
        set(at, ray_property(at.operand(0),
                             static_cast<std::uint32_t>(property) | (is_committed() ? ray_property_committed : 0),
                             words, scalar));
        return true;
    };
    const auto candidate_kind = [&] {
        const std::size_t offset = offsetof(RayQueryLanes, candidate_kind);
        return read_query(at.operand(0), std::span(&offset, 1), word).at(0).value;
    };
    switch (at.op) {
        case Op::OpRayQueryInitializeKHR: {
            const Component descriptor_address = get(at.operand(1)).image;
            if (!descriptor_address) reject("an acceleration structure that is no bound resource is not supported");
            llvm::Value* scenes = nullptr;
            if (descriptor_address.is_uniform()) {
                scenes = splat(
                    invariant_load(pointer_type, at_offset(descriptor_address.value, offsetof(Descriptor, data)), 8));
            } else {
                llvm::Value* places =
                    builder.CreateGEP(builder.getInt8Ty(), descriptor_address.value, int64(offsetof(Descriptor, data)));
                llvm::Type* wide = vector_of(builder.getInt64Ty());
                scenes = builder.CreateIntToPtr(
                    builder.CreateMaskedGather(wide, places, llvm::Align(8), mask, llvm::Constant::getNullValue(wide)),
                    vector_of(pointer_type));
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
                // A ray that cannot be traced ends where it begins, with its query.
                llvm::Value* is_traceable = traceable(origin, direction, t_min, t_max);
                row(offsetof(RayQueryLanes, t),
                    select(is_traceable, widen(t_max), llvm::Constant::getNullValue(vector_of(real))));
                row(offsetof(RayQueryLanes, cull_mask), builder.CreateAnd(widen(cull_mask), splat(int32(0xff))));
                row(offsetof(RayQueryLanes, id), lane_numbers());
                row(offsetof(RayQueryLanes, reserved), zero_row);
                row(offsetof(RayQueryLanes, primitive), none_row);
                row(offsetof(RayQueryLanes, geometry), none_row);
                row(offsetof(RayQueryLanes, instance), none_row);
                row(offsetof(RayQueryLanes, scene), scenes);
                row(offsetof(RayQueryLanes, flags), widen(flags));
                row(offsetof(RayQueryLanes, status),
                    select(is_traceable, status_row(RayStatus::ready), status_row(RayStatus::finished)));
                row(offsetof(RayQueryLanes, kind), splat(int32(1)));
            });
            return true;
        }
        case Op::OpRayQueryProceedKHR: proceed_query(at); return true;
        case Op::OpRayQueryTerminateKHR:
            for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
                put(query, lanes_on, offsetof(RayQueryLanes, status), status_row(RayStatus::finished));
            });
            return true;
        case Op::OpRayQueryConfirmIntersectionKHR: {
            llvm::FunctionCallee function =
                external("nacre_cpu_ray_confirm", builder.getVoidTy(), {pointer_type, word});
            for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
                builder.CreateCall(function, {query, mask_bits(lanes_on)});
            });
            return true;
        }
        case Op::OpRayQueryGenerateIntersectionKHR: {
            llvm::FunctionCallee function =
                external("nacre_cpu_ray_generate", builder.getVoidTy(), {pointer_type, word, pointer_type});
            llvm::AllocaInst* distances = make_slot(llvm::ArrayType::get(builder.getInt8Ty(), row_bytes), "distances");
            builder.CreateAlignedStore(widen(get_scalar(at.operand(1))), distances, llvm::Align(64));
            for_each_query(at.operand(0), [&](llvm::Value* query, llvm::Value* lanes_on) {
                builder.CreateCall(function, {query, mask_bits(lanes_on), distances});
            });
            return true;
        }
        case Op::OpRayQueryGetIntersectionTypeKHR: {
            if (!is_committed()) {
                // The bit is GLSL's number for a box, and a triangle is 0.
                set(at, {Component(builder.CreateAnd(candidate_kind(), splat(int32(ray_candidate_box))))});
                return true;
            }
            const std::array<std::size_t, 3> offsets{offsetof(RayQueryLanes, geometry), offsetof(RayQueryLanes, kind),
                                                     offsetof(RayQueryLanes, status)};
            const std::vector<Component> found = read_query(at.operand(0), offsets, word);
            llvm::Value* zero_row = llvm::Constant::getNullValue(vector_of(word));
            llvm::Value* is_hit = builder.CreateAnd(
                builder.CreateICmpNE(found[0].value, llvm::Constant::getAllOnesValue(vector_of(word))),
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
        case Op::OpRayQueryGetIntersectionInstanceCustomIndexKHR:
            return get_property(RayProperty::custom_index, 1, word);
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
        case Op::OpRayQueryGetIntersectionObjectRayDirectionKHR:
            return get_property(RayProperty::object_direction, 3, real);
        case Op::OpRayQueryGetIntersectionObjectToWorldKHR: return get_property(RayProperty::object_to_world, 12, real);
        case Op::OpRayQueryGetIntersectionWorldToObjectKHR: return get_property(RayProperty::world_to_object, 12, real);
        case Op::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR:
            set(at,
                {Component(builder.CreateICmpNE(builder.CreateAnd(candidate_kind(), splat(int32(ray_candidate_opaque))),
                                                llvm::Constant::getNullValue(vector_of(word))))});
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
