// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>
#include <llvm/IR/Constants.h>
#include <spirv/unified1/GLSL.std.450.h>

#include "backends/cpu/compiler/stage_interface.h"
#include "backends/cpu/compiler/stages.h"

namespace nacre::cpu {

using spv::BuiltIn;
using spv::Op;

namespace {

/// Four samples of the standard pattern, in pixels (Vulkan specification, "Standard Sample Locations").
constexpr std::array<std::array<float, 2>, 4> sample_places{
    {{0.375f, 0.125f}, {0.875f, 0.375f}, {0.125f, 0.625f}, {0.625f, 0.875f}}};

}  // namespace

/// The word at an offset in each quad's primitive, spread over the quad.
Component FragmentEmitter::primitive_word(std::size_t offset, llvm::Type* type) {
    if (is_one_primitive)
        return Component(splat(invariant_load(type, at_offset(primitives[0], static_cast<std::int64_t>(offset)), 4)));
    const std::uint32_t quads = lanes / 4;
    const std::size_t aligned = offset / 16 * 16;
    const int part = static_cast<int>(offset % 16 / 4);
    auto* four = llvm::FixedVectorType::get(builder.getFloatTy(), 4);
    llvm::SmallVector<int, 16> spread(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) spread[i] = static_cast<int>(i / 4 * 4) + part;
    const auto finished = [&](llvm::Value* joined) {
        llvm::Value* value = builder.CreateShuffleVector(joined, spread);
        return Component(type->isFloatTy() ? value : builder.CreateBitCast(value, vector_of(type)));
    };
    if (const auto found = joined_words_.find(aligned); found != joined_words_.end()) return finished(found->second);
    std::vector<llvm::Value*> parts;
    for (std::uint32_t q = 0; q < quads; ++q)
        parts.push_back(invariant_load(four, at_offset(primitives[q], static_cast<std::int64_t>(aligned)), 16));
    // Two by two until one vector holds all; then each quad takes its element.
    while (parts.size() > 1) {
        std::vector<llvm::Value*> joined;
        for (std::size_t i = 0; i + 1 < parts.size(); i += 2) {
            const int length =
                static_cast<int>(llvm::cast<llvm::FixedVectorType>(parts[i]->getType())->getNumElements());
            llvm::SmallVector<int, 16> all(static_cast<std::size_t>(2 * length));
            for (int k = 0; k < 2 * length; ++k) all[static_cast<std::size_t>(k)] = k;
            joined.push_back(builder.CreateShuffleVector(parts[i], parts[i + 1], all));
        }
        parts = std::move(joined);
    }
    if (keeps_joined_words) joined_words_.emplace(aligned, parts[0]);
    return finished(parts[0]);
}

Component FragmentEmitter::primitive_double(std::size_t offset) {
    llvm::Value* all = llvm::PoisonValue::get(vector_of(builder.getDoubleTy()));
    const auto at = static_cast<std::int64_t>(double_primitive_offset(program.inputs.size()) + offset);
    for (std::uint32_t lane = 0; lane < lanes; ++lane) {
        llvm::Value* value = invariant_load(builder.getDoubleTy(), at_offset(primitives[lane / 4], at), 8);
        all = builder.CreateInsertElement(all, value, std::uint64_t{lane});
    }
    return Component(all);
}

Component FragmentEmitter::evaluate_plane(std::size_t offset, const Place& place) {
    if (in_double()) {
        // Planes of doubles lie in the same order.
        const std::size_t plane = offsetof(DoublePrimitive, planes) +
                                  (offset - offsetof(PrimitiveData, depth)) / sizeof(Plane) * sizeof(DoublePlane);
        llvm::Value* from_x = builder.CreateFSub(place.x, primitive_double(offsetof(DoublePrimitive, x0)).value);
        llvm::Value* from_y = builder.CreateFSub(place.y, primitive_double(offsetof(DoublePrimitive, y0)).value);
        llvm::Value* along_x = builder.CreateFMul(primitive_double(plane + offsetof(DoublePlane, dx)).value, from_x);
        llvm::Value* along_y = builder.CreateFMul(primitive_double(plane + offsetof(DoublePlane, dy)).value, from_y);
        llvm::Value* start = primitive_double(plane + offsetof(DoublePlane, c)).value;
        return Component(builder.CreateFAdd(builder.CreateFAdd(start, along_x), along_y));
    }
    llvm::Value* c = primitive_word(offset + offsetof(Plane, c), builder.getFloatTy()).value;
    llvm::Value* dx = primitive_word(offset + offsetof(Plane, dx), builder.getFloatTy()).value;
    llvm::Value* dy = primitive_word(offset + offsetof(Plane, dy), builder.getFloatTy()).value;
    const bool is_depth = offset == offsetof(PrimitiveData, depth);
    const auto relative = [&](llvm::Value* coordinate, std::size_t origin) {
        return builder.CreateFSub(coordinate, primitive_word(origin, builder.getFloatTy()).value);
    };
    llvm::Value* x = relative(place.x, is_depth ? offsetof(PrimitiveData, x0) : offsetof(PrimitiveData, origin_x));
    llvm::Value* y = relative(place.y, is_depth ? offsetof(PrimitiveData, y0) : offsetof(PrimitiveData, origin_y));
    if (is_depth)
        return Component(
            builder.CreateFAdd(builder.CreateFAdd(c, builder.CreateFMul(dx, x)), builder.CreateFMul(dy, y)));
    const auto fused = [&](llvm::Value* a, llvm::Value* b, llvm::Value* sum) {
        return builder.CreateIntrinsic(sum->getType(), llvm::Intrinsic::fma, {a, b, sum});
    };
    return Component(fused(dy, y, fused(dx, x, c)));
}

Component FragmentEmitter::evaluate_input(std::uint32_t index, const Place& place, const Type& scalar) {
    const std::size_t offset = sizeof(PrimitiveData) + index * sizeof(Plane);
    const FragmentInput& input = program.inputs[index];
    if (input.interpolation == Interpolation::flat && in_double() && scalar.kind == TypeKind::floating)
        return primitive_double(sizeof(DoublePrimitive) + index * sizeof(DoublePlane) + offsetof(DoublePlane, c));
    if (input.interpolation == Interpolation::flat)
        return from_word(primitive_word(offset, builder.getInt32Ty()), scalar_type(scalar));
    Component value = evaluate_plane(offset, place);
    if (input.interpolation == Interpolation::perspective) {
        llvm::Value* inverse = evaluate_plane(offsetof(PrimitiveData, inverse_w), place).value;
        llvm::Value* one = llvm::ConstantFP::get(inverse->getType(), 1);
        value = Component(builder.CreateFMul(value.value, builder.CreateFDiv(one, inverse)));
    }
    return scalar.bits == 32 || in_double() ? value : Component(math.convert_float(value.value, scalar_type(scalar)));
}

llvm::Value* FragmentEmitter::undefined_input(std::uint32_t index) {
    const std::size_t offset = sizeof(PrimitiveData) + (input_scalars_.size() + index) * sizeof(Plane);
    llvm::Value* none = llvm::Constant::getNullValue(vector_of(builder.getFloatTy()));
    const auto differs = [&](std::size_t part) {
        return builder.CreateFCmpONE(primitive_word(offset + part, builder.getFloatTy()).value, none);
    };
    // The plane through three zeros is zero all over. Elsewhere a vertex has a share in every pixel.
    llvm::Value* undefined = differs(offsetof(Plane, c));
    if (program.inputs[index].interpolation == Interpolation::flat) return undefined;
    return builder.CreateOr(undefined,
                            builder.CreateOr(differs(offsetof(Plane, dx)), differs(offsetof(Plane, dy))));
}

std::vector<llvm::Value*> FragmentEmitter::evaluate_inputs() {
    std::vector<llvm::Value*> values;
    for (std::uint32_t i = 0; i < input_scalars_.size(); ++i) {
        const InterfaceScalar& at = input_scalars_[i];
        values.push_back(
            evaluate_input(i, at.centroid && !program.runs_per_sample ? centroid : center, module.type(at.type)).value);
    }
    if (follows_undefined())
        for (std::uint32_t i = 0; i < input_scalars_.size(); ++i) values.push_back(undefined_input(i));
    values.push_back(evaluate_plane(offsetof(PrimitiveData, depth), center).value);
    values.push_back(evaluate_plane(offsetof(PrimitiveData, inverse_w), center).value);
    return values;
}

std::vector<llvm::Value*> FragmentEmitter::for_one_or_several(
    const std::function<std::vector<llvm::Value*>()>& evaluate) {
    llvm::Value* is_one = builder.getTrue();
    for (std::uint32_t q = 1; q < lanes / 4; ++q)
        is_one = builder.CreateAnd(is_one, builder.CreateICmpEQ(primitives[q], primitives[0]));
    llvm::BasicBlock* one = llvm::BasicBlock::Create(context, "one_primitive", function_);
    llvm::BasicBlock* several = llvm::BasicBlock::Create(context, "several_primitives", function_);
    llvm::BasicBlock* next = llvm::BasicBlock::Create(context, "inputs", function_);
    builder.CreateCondBr(is_one, one, several);
    const auto fill = [&](llvm::BasicBlock*& block, bool of_one) {
        builder.SetInsertPoint(block);
        is_one_primitive = of_one;
        keeps_joined_words = !of_one;
        std::vector<llvm::Value*> values = evaluate();
        is_one_primitive = keeps_joined_words = false;
        joined_words_.clear();
        block = builder.GetInsertBlock();
        builder.CreateBr(next);
        return values;
    };
    const std::vector<llvm::Value*> of_one = fill(one, true), of_several = fill(several, false);
    builder.SetInsertPoint(next);
    std::vector<llvm::Value*> values;
    for (std::size_t i = 0; i < of_one.size(); ++i) {
        llvm::PHINode* value = builder.CreatePHI(of_one[i]->getType(), 2);
        value->addIncoming(of_one[i], one);
        value->addIncoming(of_several[i], several);
        values.push_back(value);
    }
    return values;
}

FragmentEmitter::Place FragmentEmitter::place_at(llvm::Value* inside_x, llvm::Value* inside_y) {
    return {builder.CreateFAdd(pixel_x, inside_x), builder.CreateFAdd(pixel_y, inside_y)};
}

void FragmentEmitter::declare_inputs() {
    for (const Id id : module.interface()) {
        const Variable* variable = module.variable(id);
        if (!variable || variable->storage != spv::StorageClass::Input) continue;
        if (variable->builtin) {
            if (*variable->builtin == BuiltIn::SampleId || *variable->builtin == BuiltIn::SamplePosition)
                program.runs_per_sample = true;
            const bool is_clip = *variable->builtin == BuiltIn::ClipDistance;
            if (!is_clip && *variable->builtin != BuiltIn::CullDistance) continue;
            for (std::uint32_t i = 0; i < module.type(variable->type).components; ++i) {
                input_numbers_[id].push_back(static_cast<std::uint32_t>(program.inputs.size()));
                program.inputs.push_back(
                    {is_clip ? clip_distance_location : cull_distance_location, i, Interpolation::perspective});
                InterfaceScalar distance;
                distance.type = component_type(variable->type, 0);
                input_scalars_.push_back(distance);
            }
            continue;
        }
        const Type& type = module.type(variable->type);
        if (type.kind == TypeKind::structure && !type.members.empty() && type.members[0].builtin) continue;
        const auto scalars = interface_scalars(module, *variable);
        if (!scalars) {
            current = &variable->instruction;
            reject(fmt::format("input '{}' has no location", variable->name));
        }
        std::vector<std::uint32_t>& numbers = input_numbers_[id];
        for (const InterfaceScalar& at : *scalars) {
            FragmentInput input;
            input.location = at.location, input.component = at.component;
            const bool is_flat = at.flat || module.type(at.type).kind != TypeKind::floating;
            input.interpolation = is_flat             ? Interpolation::flat
                                  : at.no_perspective ? Interpolation::linear
                                                      : Interpolation::perspective;
            program.runs_per_sample = program.runs_per_sample || (at.sample && !is_flat);
            program.uses_centroid = program.uses_centroid || (at.centroid && !is_flat);
            numbers.push_back(static_cast<std::uint32_t>(program.inputs.size()));
            // Of 64 bits: two flat words.
            InterfaceScalar word = at;
            if (at.is_wide) input.interpolation = Interpolation::flat, word.type = pointer_offset_type;
            program.inputs.push_back(input);
            input_scalars_.push_back(word);
            if (!at.is_wide) continue;
            input.location = at.upper_location, input.component = at.upper_component;
            program.inputs.push_back(input);
            input_scalars_.push_back(word);
        }
    }
    if (follows_undefined()) {
        program.inputs.reserve(2 * program.inputs.size());
        for (std::size_t i = 0; i < input_scalars_.size(); ++i) {
            FragmentInput told = program.inputs[i];
            told.location += undefined_location;
            program.inputs.push_back(told);
        }
    }
    for (const auto& [id, function] : module.functions())
        for (const Block& block : function.blocks) {
            if (block.terminator.op == Op::OpKill || block.terminator.op == Op::OpTerminateInvocation)
                program.discards = true;
            for (const Instruction& at : block.body) {
                if (at.op == Op::OpDemoteToHelperInvocation) program.discards = true;
                if (at.op == Op::OpExtInst && module.is_glsl_set(at.operand(0)) &&
                    at.operand(1) == GLSLstd450InterpolateAtCentroid)
                    program.uses_centroid = true;
            }
        }
}

std::vector<Component> FragmentEmitter::input_components(const Variable& variable) {
    const auto float_word = [&](std::size_t offset) -> llvm::Value* {
        return builder.CreateAlignedLoad(builder.getFloatTy(), at_offset(batch, static_cast<std::int64_t>(offset)),
                                         llvm::Align(4));
    };
    if (variable.builtin) {
        if (auto of_subgroup = subgroup_input(*variable.builtin)) return std::move(*of_subgroup);
        switch (*variable.builtin) {
            case BuiltIn::ClipDistance:
            case BuiltIn::CullDistance: {
                std::vector<Component> made;
                for (const std::uint32_t number : input_numbers_.at(variable.instruction.result))
                    made.push_back(Component(inputs_[number]));
                return made;
            }
            case BuiltIn::FragCoord:
                return {Component(center.x), Component(center.y), Component(inputs_[inputs_.size() - 2]),
                        Component(inputs_.back())};
            case BuiltIn::FrontFacing: {
                llvm::Value* word = primitive_word(offsetof(PrimitiveData, front_facing), builder.getInt32Ty()).value;
                return {Component(builder.CreateICmpNE(word, llvm::Constant::getNullValue(word->getType())))};
            }
            case BuiltIn::PrimitiveId:
                return {primitive_word(offsetof(PrimitiveData, primitive_id), builder.getInt32Ty())};
            case BuiltIn::Layer: return {primitive_word(offsetof(PrimitiveData, layer), builder.getInt32Ty())};
            case BuiltIn::ViewIndex:
            case BuiltIn::ViewportIndex:
            case BuiltIn::DeviceIndex: return {Component(int32(0))};
            case BuiltIn::PointCoord: {
                if (in_double()) {
                    const Component scale = primitive_double(offsetof(DoublePrimitive, inverse_point_size));
                    const auto inside = [&](llvm::Value* place, std::size_t offset) {
                        llvm::Value* from = primitive_double(offset).value;
                        return Component(builder.CreateFMul(builder.CreateFSub(place, from), scale.value));
                    };
                    return {inside(center.x, offsetof(DoublePrimitive, point_x)),
                            inside(center.y, offsetof(DoublePrimitive, point_y))};
                }
                llvm::Value* scale =
                    primitive_word(offsetof(PrimitiveData, inverse_point_size), builder.getFloatTy()).value;
                llvm::Value* left = primitive_word(offsetof(PrimitiveData, origin_x), builder.getFloatTy()).value;
                llvm::Value* top = primitive_word(offsetof(PrimitiveData, origin_y), builder.getFloatTy()).value;
                return {Component(builder.CreateFMul(builder.CreateFSub(center.x, left), scale)),
                        Component(builder.CreateFMul(builder.CreateFSub(center.y, top), scale))};
            }
            case BuiltIn::SampleId:
                return {Component(builder.CreateAlignedLoad(
                    builder.getInt32Ty(), at_offset(batch, offsetof(FragmentBatch, sample_index)), llvm::Align(4)))};
            case BuiltIn::SamplePosition:
                return {from_single(float_word(offsetof(FragmentBatch, sample_x))),
                        from_single(float_word(offsetof(FragmentBatch, sample_y)))};
            case BuiltIn::SampleMask: {
                std::vector<Component> made(module.type(variable.type).components, Component(int32(0)));
                made[0] = Component(builder.CreateAlignedLoad(vector_of(builder.getInt32Ty()),
                                                              at_offset(batch, offsetof(FragmentBatch, sample_mask_in)),
                                                              llvm::Align(64)));
                return made;
            }
            case BuiltIn::HelperInvocation: return {Component(builder.CreateNot(live()))};
            default:
                reject(fmt::format("built-in input {} is not supported in fragment shaders",
                                   static_cast<unsigned>(*variable.builtin)));
        }
    }
    const auto scalars = interface_scalars(module, variable);
    const auto numbers = input_numbers_.find(variable.instruction.result);
    if (!scalars || numbers == input_numbers_.end())
        reject(fmt::format("input '{}' is not supported in fragment shaders", variable.name));
    std::vector<Component> made;
    for (std::size_t i = 0; i < scalars->size(); ++i) {
        const std::uint32_t number = numbers->second[i];
        llvm::Value* undefined = follows_undefined() ? inputs_[input_scalars_.size() + number] : nullptr;
        if (!(*scalars)[i].is_wide) {
            made.push_back(Component(inputs_[number]));
            made.back().undefined = undefined;
            continue;
        }
        llvm::Type* wide = vector_of(builder.getInt64Ty());
        llvm::Value* bits = builder.CreateOr(builder.CreateZExt(inputs_[number], wide),
                                             builder.CreateShl(builder.CreateZExt(inputs_[number + 1], wide), 32));
        made.emplace_back(builder.CreateBitCast(bits, vector_of(scalar_type(module.type((*scalars)[i].type)))));
        made.back().undefined = undefined;
    }
    return made;
}

Component FragmentEmitter::difference(const Component& value, bool vertical, bool is_fine) {
    if (value.is_uniform()) return Component(llvm::Constant::getNullValue(value.value->getType()));
    llvm::SmallVector<int, 16> low(lanes), high(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) {
        const std::uint32_t quad = i / 4 * 4;
        const std::uint32_t first = vertical ? quad + (is_fine ? i & 1 : 0) : quad + (is_fine ? i & 2 : 0);
        low[i] = static_cast<int>(first);
        high[i] = static_cast<int>(first + (vertical ? 2 : 1));
    }
    Component made = builder.CreateFSub(builder.CreateShuffleVector(value.value, high),
                                        builder.CreateShuffleVector(value.value, low));
    if (value.undefined && value.undefined->getType()->isVectorTy())
        made.undefined = builder.CreateOr(builder.CreateShuffleVector(value.undefined, high),
                                          builder.CreateShuffleVector(value.undefined, low));
    else
        made.undefined = value.undefined;
    return made;
}

bool FragmentEmitter::emit_stage(const Instruction& at) {
    bool both_ways = false, vertical = false, is_fine = true;
    switch (at.op) {
        case Op::OpDPdx: case Op::OpDPdxFine: break;
        case Op::OpDPdxCoarse: is_fine = false; break;
        case Op::OpDPdy: case Op::OpDPdyFine: vertical = true; break;
        case Op::OpDPdyCoarse: vertical = true, is_fine = false; break;
        case Op::OpFwidth: case Op::OpFwidthFine: both_ways = true; break;
        case Op::OpFwidthCoarse: both_ways = true, is_fine = false; break;
        case Op::OpExtInst: {
            if (!module.is_glsl_set(at.operand(0))) return false;
            const std::uint32_t number = at.operand(1);
            if (number != GLSLstd450InterpolateAtCentroid && number != GLSLstd450InterpolateAtSample &&
                number != GLSLstd450InterpolateAtOffset)
                return false;
            const Pointer pointer = get_pointer(at.operand(2));
            Place place = centroid;
            if (number == GLSLstd450InterpolateAtOffset) {
                const Value offset = get(at.operand(3));
                const auto shifted = [&](const Component& by) {
                    return builder.CreateFAdd(widen(by), llvm::ConstantFP::get(vector_of(real_type()), 0.5));
                };
                place = place_at(shifted(offset.components.at(0)), shifted(offset.components.at(1)));
            } else if (number == GLSLstd450InterpolateAtSample) {
                llvm::Value* which = widen(get_scalar(at.operand(3)));
                llvm::Value *x = nullptr, *y = nullptr;
                for (std::size_t i = sample_places.size(); i-- > 0;) {
                    llvm::Value* here_x =
                        llvm::ConstantFP::get(vector_of(real_type()), static_cast<double>(sample_places[i][0]));
                    llvm::Value* here_y =
                        llvm::ConstantFP::get(vector_of(real_type()), static_cast<double>(sample_places[i][1]));
                    llvm::Value* is_this = builder.CreateICmpEQ(which, llvm::ConstantInt::get(which->getType(), i));
                    x = x ? select(is_this, here_x, x) : here_x;
                    y = y ? select(is_this, here_y, y) : here_y;
                }
                // The only sample of other targets is in the middle.
                llvm::Value* samples = builder.CreateAlignedLoad(
                    builder.getInt32Ty(), at_offset(batch, offsetof(FragmentBatch, samples)), llvm::Align(4));
                llvm::Value* several = builder.CreateICmpUGT(samples, int32(1));
                llvm::Value* middle = llvm::ConstantFP::get(x->getType(), 0.5);
                place = place_at(select(several, x, middle), select(several, y, middle));
            }
            const auto numbers = input_numbers_.find(pointer.variable_id);
            if (numbers == input_numbers_.end() || pointer.dynamic_component)
                reject("interpolation at a place needs an input with a constant index");
            std::vector<Component> made;
            std::uint32_t index = pointer.component;
            for_each_component_type(at.type, [&](const Type& scalar) {
                const std::uint32_t input = numbers->second.at(index++);
                made.push_back(evaluate_input(input, place, scalar));
                if (follows_undefined()) made.back().undefined = inputs_[input_scalars_.size() + input];
            });
            note_input(pointer, made);
            set(at, std::move(made));
            return true;
        }
        default: return false;
    }
    if (looks_for(check_sanitize)) check_quads();
    std::vector<Component> made;
    for (const Component& value : get(at.operand(0)).components) {
        if (!both_ways) {
            made.push_back(difference(value, vertical, is_fine));
            continue;
        }
        made.push_back(apply({difference(value, false, is_fine), difference(value, true, is_fine)}, [&](auto v) {
            return builder.CreateFAdd(math.f_abs(v[0]), math.f_abs(v[1]));
        }));
    }
    set(at, std::move(made));
    return true;
}

void FragmentEmitter::store_outputs() {
    llvm::Value* doubles =
        in_double() ? invariant_load(pointer_type, at_offset(batch, offsetof(FragmentBatch, doubles)), 8) : nullptr;
    const auto put_double = [&](std::size_t offset, const Component& value) {
        if (value.value->getType()->getScalarType()->isDoubleTy())
            builder.CreateAlignedStore(widen(value), at_offset(doubles, static_cast<std::int64_t>(offset)),
                                       llvm::Align(64));
    };
    for (const Id id : module.interface()) {
        const Variable* variable = module.variable(id);
        if (!variable || variable->storage != spv::StorageClass::Output) continue;
        const std::vector<Component> values = load(pointer_to(id));
        if (options.checks) check_outputs(*variable, values);
        if (variable->builtin) {
            const auto put = [&](std::size_t offset) {
                builder.CreateAlignedStore(widen(to_word(values.at(0))),
                                           at_offset(batch, static_cast<std::int64_t>(offset)), llvm::Align(64));
            };
            if (*variable->builtin == BuiltIn::FragDepth) {
                program.writes_depth = true;
                put(offsetof(FragmentBatch, depth));
                put_double(offsetof(FragmentDoubles, depth), values.at(0));
            } else if (*variable->builtin == BuiltIn::SampleMask)
                program.writes_sample_mask = true, put(offsetof(FragmentBatch, sample_mask_out));
            else reject("a built-in output is not supported in fragment shaders");
            continue;
        }
        const auto scalars = interface_scalars(module, *variable);
        if (!scalars || module.type(variable->type).has_wide)
            reject(fmt::format("output '{}' has no location, or holds 64-bit values", variable->name));
        for (std::size_t i = 0; i < scalars->size(); ++i) {
            const InterfaceScalar& at = (*scalars)[i];
            const std::uint32_t output = variable->index == 1 ? dual_source_output + at.location : at.location;
            if (output >= max_color_outputs || at.component >= 4)
                reject("a color output lies behind the last location");
            const std::size_t offset = offsetof(FragmentBatch, colors) + (output * 4 + at.component) * max_lanes * 4;
            builder.CreateAlignedStore(widen(to_word(values[i])), at_offset(batch, static_cast<std::int64_t>(offset)),
                                       llvm::Align(64));
            put_double(offsetof(FragmentDoubles, colors) + (output * 4 + at.component) * max_lanes * 8, values[i]);
            auto found = std::ranges::find(program.outputs, output, &FragmentOutput::output);
            if (found == program.outputs.end()) program.outputs.push_back({output, at.component + 1});
            else found->components = std::max(found->components, at.component + 1);
        }
    }
    builder.CreateAlignedStore(mask_bits(live()), at_offset(batch, offsetof(FragmentBatch, live)), llvm::Align(4));
}

void FragmentEmitter::add_stage_values(std::vector<llvm::Value**>& places) {
    places.insert(places.end(), {&batch, &pixel_x, &pixel_y, &center.x, &center.y, &centroid.x, &centroid.y});
    for (llvm::Value*& primitive : primitives) places.push_back(&primitive);
}

void FragmentEmitter::emit() {
    emit_batches(2, sizeof(FragmentBatch), [&](llvm::Value* one) {
        batch = one;
        emit_batch();
    });
    program.early_tests = module.early_fragment_tests;
    program.has_side_effects = has_side_effects;
}

void FragmentEmitter::emit_batch() {
    const std::uint32_t quads = lanes / 4;
    for (std::uint32_t q = 0; q < quads; ++q)
        primitives[q] = builder.CreateAlignedLoad(
            pointer_type, at_offset(batch, static_cast<std::int64_t>(offsetof(FragmentBatch, primitives) + q * 8)),
            llvm::Align(8));
    llvm::SmallVector<int, 16> quad_of_lane(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) quad_of_lane[i] = static_cast<int>(i / 4);
    const auto corner = [&](std::size_t offset) {
        auto* each_quad = llvm::FixedVectorType::get(builder.getInt32Ty(), quads);
        llvm::Value* corners =
            builder.CreateAlignedLoad(each_quad, at_offset(batch, static_cast<std::int64_t>(offset)), llvm::Align(4));
        return builder.CreateShuffleVector(corners, quad_of_lane);
    };
    llvm::Value* x = corner(offsetof(FragmentBatch, x));
    llvm::Value* y = corner(offsetof(FragmentBatch, y));
    std::vector<std::uint32_t> step_x(lanes), step_y(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) step_x[i] = i & 1, step_y[i] = i >> 1 & 1;
    llvm::Value* const corner_x = x;
    llvm::Value* const corner_y = y;
    pixel_x = builder.CreateSIToFP(builder.CreateAdd(x, llvm::ConstantDataVector::get(context, step_x)),
                                   vector_of(real_type()));
    pixel_y = builder.CreateSIToFP(builder.CreateAdd(y, llvm::ConstantDataVector::get(context, step_y)),
                                   vector_of(real_type()));
    declare_inputs();
    const auto batch_float = [&](std::size_t offset) {
        llvm::Value* number = builder.CreateAlignedLoad(
            builder.getFloatTy(), at_offset(batch, static_cast<std::int64_t>(offset)), llvm::Align(4));
        return splat(from_single(number).value);
    };
    center = place_at(batch_float(offsetof(FragmentBatch, sample_x)), batch_float(offsetof(FragmentBatch, sample_y)));
    centroid = center;
    if (program.uses_centroid) {
        const auto lane_float = [&](std::size_t offset) {
            llvm::Value* numbers = builder.CreateAlignedLoad(
                vector_of(builder.getFloatTy()), at_offset(batch, static_cast<std::int64_t>(offset)), llvm::Align(64));
            return from_single(numbers).value;
        };
        centroid =
            place_at(lane_float(offsetof(FragmentBatch, centroid_x)), lane_float(offsetof(FragmentBatch, centroid_y)));
    }
    inputs_ = for_one_or_several([&] { return evaluate_inputs(); });
    live_slot = make_slot(mask_type, "live");
    llvm::Value* live_bits = builder.CreateAlignedLoad(builder.getInt32Ty(),
                                                       at_offset(batch, offsetof(FragmentBatch, live)), llvm::Align(4));
    store_live(builder.CreateBitCast(builder.CreateTrunc(live_bits, builder.getIntNTy(lanes)), mask_type));
    mask = all_lanes();
    if (trace_table) {
        llvm::Value* wanted = load_context(offsetof(ShaderContext, trace), pointer_type);
        const auto is_at = [&](llvm::Value* corner_of, const std::vector<std::uint32_t>& step, std::size_t axis) {
            llvm::Value* coordinate = invariant_load(
                builder.getInt32Ty(),
                at_offset(wanted, static_cast<std::int64_t>(offsetof(ShaderTrace, invocation) + 4 * axis)), 4);
            return builder.CreateICmpEQ(builder.CreateAdd(corner_of, llvm::ConstantDataVector::get(context, step)),
                                        splat(coordinate));
        };
        begin_trace(
            builder.CreateAnd(live(), builder.CreateAnd(is_at(corner_x, step_x, 0), is_at(corner_y, step_y, 1))), {});
    }
    if (options.checks) begin_checks(rhi::ShaderStage::fragment, batch, nullptr, nullptr);
    declare_variables();
    emit_function(module.entry(), {}, all_lanes());
    mask = all_lanes();
    store_outputs();
}

}  // namespace nacre::cpu
