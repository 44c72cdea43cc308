// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>
#include <llvm/IR/Constants.h>

#include "backends/cpu/compiler/stage_interface.h"
#include "backends/cpu/compiler/stages.h"

namespace nacre::cpu {

using rhi::FormatKind;
using spv::BuiltIn;

/// One component of an attribute, read from its buffer and converted as its format says.
Component VertexEmitter::fetch(const std::string& name, const rhi::VertexAttribute& attribute, std::uint32_t component,
                               const Type& scalar) {
    const rhi::FormatInfo& format = rhi::info(attribute.format);
    const bool is_integer = scalar.kind == TypeKind::integer;
    llvm::Type* word = builder.getInt32Ty();
    const auto default_value = [&]() -> Component {
        const double value = component == 3 ? 1 : 0;
        if (is_integer) return llvm::ConstantInt::get(scalar_type(scalar), component == 3);
        return llvm::ConstantFP::get(scalar_type(scalar), value);
    };
    if (component >= format.channels) return default_value();
    const rhi::VertexBufferLayout& layout = input_.buffers[attribute.buffer];
    const std::size_t binding = offsetof(VertexDraw, buffers) + attribute.buffer * sizeof(VertexBufferBinding);
    llvm::Value* data = invariant_load(
        pointer_type, at_offset(draw, static_cast<std::int64_t>(binding + offsetof(VertexBufferBinding, data))), 8);
    llvm::Value* size =
        invariant_load(builder.getInt64Ty(),
                       at_offset(draw, static_cast<std::int64_t>(binding + offsetof(VertexBufferBinding, size))), 8);

    // A format's bits as words: which one holds the channel, and where in it.
    struct Channel {
        std::uint32_t word, shift, bits;
    } channel{};
    const std::uint32_t bytes = format.block_bytes;
    if (attribute.format == rhi::Format::rgb10a2_unorm || attribute.format == rhi::Format::rgb10a2_uint)
        channel = {0, component * 10, component == 3 ? 2u : 10u};
    else if (attribute.format == rhi::Format::rg11b10_float || attribute.format == rhi::Format::rgb9e5_float)
        reject("vertex attributes with shared or short exponents are not supported");
    else {
        const std::uint32_t bits = bytes * 8 / format.channels;
        channel = {component * bits / 32, component * bits % 32, bits};
        if (attribute.format == rhi::Format::bgra8_unorm || attribute.format == rhi::Format::bgra8_srgb)
            channel.shift = component == 3 ? 24 : (2 - component) * 8;
    }
    // The element counts as a whole: an attribute that reaches past the buffer's end reads zero. Buffers can be read a
    // little behind their end, so words need not fit.
    const bool is_fixed = layout.per_instance || layout.stride == 0;
    llvm::Value* element = is_fixed ? (layout.stride == 0 ? static_cast<llvm::Value*>(int32(0)) : instance) : indices;
    const auto widened = [&](llvm::Value* value) {
        return builder.CreateZExt(value, like(value, builder.getInt64Ty()));
    };
    llvm::Value* wide = widened(element);
    llvm::Type* wide_type = wide->getType();
    const auto wide_constant = [&](std::uint64_t value) { return llvm::ConstantInt::get(wide_type, value); };
    llvm::Value* begin =
        builder.CreateAdd(builder.CreateMul(wide, wide_constant(layout.stride)), wide_constant(attribute.offset));
    llvm::Value* end = builder.CreateAdd(begin, wide_constant(bytes));
    llvm::Value* fits = builder.CreateICmpULE(end, is_fixed ? size : splat(size));
    const std::int64_t extra = channel.word * 4;
    llvm::Value* bits = nullptr;
    if (is_fixed) {
        llvm::Value* address = builder.CreateGEP(builder.getInt8Ty(), data, builder.CreateAdd(begin, int64(extra)));
        bits = select(fits, builder.CreateAlignedLoad(word, select(fits, address, zeros()), llvm::Align(1)), int32(0));
    } else {
        // 32-bit offsets where they are in range keep to the hardware's gather.
        llvm::Value* offsets = builder.CreateTrunc(begin, vector_of(word));
        llvm::Value* addresses_of = builder.CreateGEP(builder.getInt8Ty(), at_offset(data, extra), offsets);
        bits = builder.CreateMaskedGather(vector_of(word), addresses_of, llvm::Align(1), fits,
                                          llvm::Constant::getNullValue(vector_of(word)));
    }
    const auto constant_word = [&](std::uint32_t value) { return llvm::ConstantInt::get(bits->getType(), value); };
    const auto float_type = [&]() { return like(bits, real_type()); };
    llvm::Value* undefined = nullptr;
    if (follows_undefined()) {
        const bool is_packed = channel.bits % 8 != 0;
        llvm::Value* first = at_offset(data, extra + (is_packed ? 0 : channel.shift / 8));
        undefined = check_vertex_memory(name, attribute.buffer, builder.CreateGEP(builder.getInt8Ty(), first, begin),
                                        is_packed ? 4 : channel.bits / 8, both(live(), fits));
    }
    const auto noted = [&](Component value) {
        if (undefined) value.undefined = value.is_uniform() ? any(undefined) : undefined;
        return value;
    };
    const auto to_result = [&](llvm::Value* value) -> Component {
        llvm::Type* kind = scalar_type(scalar);
        Component result(value);
        if (is_integer)
            result = Component(builder.CreateZExtOrTrunc(value, like(value, kind)));
        else if (value->getType()->getScalarType() != kind)
            result = Component(math.convert_float(value, kind));
        return noted(result);
    };
    const bool is_signed = format.kind == FormatKind::sint || format.kind == FormatKind::snorm;
    if (channel.bits < 32) {
        if (is_signed) {
            bits = builder.CreateAShr(builder.CreateShl(bits, constant_word(32 - channel.shift - channel.bits)),
                                      constant_word(32 - channel.bits));
        } else {
            bits = builder.CreateAnd(builder.CreateLShr(bits, constant_word(channel.shift)),
                                     constant_word((1u << channel.bits) - 1));
        }
    }
    switch (format.kind) {
        case FormatKind::uint:
        case FormatKind::sint:
            if (is_integer) return to_result(bits);
            return to_result(is_signed ? builder.CreateSIToFP(bits, float_type())
                                       : builder.CreateUIToFP(bits, float_type()));
        case FormatKind::floating:
            if (channel.bits == 16) return to_result(math.half_to_float(bits));
            if (is_integer) return to_result(bits);
            if (in_double()) {
                const Component plain = from_word(Component(bits), real_type());
                if (layout.stride % 4 != 0 || attribute.offset % 4 != 0) return noted(plain);
                // The word's double, where it stands for the word.
                const std::size_t shadow_offset = binding + offsetof(VertexBufferBinding, shadow);
                llvm::Value* shadow =
                    invariant_load(pointer_type, at_offset(draw, static_cast<std::int64_t>(shadow_offset)), 8);
                llvm::Value* twice = builder.CreateShl(begin, llvm::ConstantInt::get(begin->getType(), 1));
                llvm::Value* places = builder.CreateGEP(builder.getInt8Ty(), at_offset(shadow, 2 * extra),
                                                        is_fixed ? splat(twice) : twice);
                llvm::Value* none = llvm::Constant::getNullValue(vector_of(real_type()));
                const Component precise = builder.CreateMaskedGather(vector_of(real_type()), places, llvm::Align(8),
                                                                     is_fixed ? splat(fits) : fits, none);
                llvm::Value* stands = builder.CreateICmpEQ(to_word(precise).value, widen(Component(bits)));
                return noted(Component(select(stands, precise.value, widen(plain))));
            }
            return to_result(builder.CreateBitCast(bits, float_type()));
        case FormatKind::unorm:
        case FormatKind::srgb: {
            const double most = channel.bits == 32 ? 4294967295.0 : (1u << channel.bits) - 1;
            return to_result(builder.CreateFDiv(builder.CreateUIToFP(bits, float_type()),
                                                llvm::ConstantFP::get(float_type(), most)));
        }
        case FormatKind::snorm: {
            const double most = (1u << (channel.bits - 1)) - 1;
            llvm::Value* value =
                builder.CreateFDiv(builder.CreateSIToFP(bits, float_type()), llvm::ConstantFP::get(float_type(), most));
            return to_result(math.f_max(value, llvm::ConstantFP::get(float_type(), -1)));
        }
    }
    return default_value();
}

std::vector<Component> VertexEmitter::input_components(const Variable& variable) {
    if (variable.builtin) {
        if (auto of_subgroup = subgroup_input(*variable.builtin)) return std::move(*of_subgroup);
        const auto draw_word = [&](std::size_t offset) -> Component {
            return invariant_load(builder.getInt32Ty(), at_offset(draw, static_cast<std::int64_t>(offset)), 4);
        };
        switch (*variable.builtin) {
            case BuiltIn::VertexIndex: return {Component(indices)};
            case BuiltIn::InstanceIndex: return {Component(instance)};
            case BuiltIn::BaseVertex: return {draw_word(offsetof(VertexDraw, base_vertex))};
            case BuiltIn::BaseInstance: return {draw_word(offsetof(VertexDraw, base_instance))};
            case BuiltIn::DrawIndex: return {draw_word(offsetof(VertexDraw, draw_index))};
            case BuiltIn::ViewIndex:
            case BuiltIn::DeviceIndex: return {Component(int32(0))};
            default:
                reject(fmt::format("built-in input {} is not supported in vertex shaders",
                                   static_cast<unsigned>(*variable.builtin)));
        }
    }
    const auto scalars = interface_scalars(module, variable);
    if (!scalars) reject(fmt::format("input '{}' has no location", variable.name));
    std::vector<Component> made;
    for (const InterfaceScalar& at : *scalars) {
        if (at.is_wide)
            reject(fmt::format("input '{}' holds 64-bit values, of which no vertex format is made", variable.name));
        const auto attribute = std::ranges::find(input_.attributes, at.location, &rhi::VertexAttribute::location);
        if (attribute == input_.attributes.end()) made.push_back(zero(module.type(at.type)));
        else
            made.push_back(fetch(variable.name, *attribute, at.component, module.type(at.type)));
    }
    return made;
}

void VertexEmitter::store_outputs() {
    llvm::Value* outputs = invariant_load(pointer_type, at_offset(batch, offsetof(VertexBatch, outputs)), 8);
    llvm::Value* doubles =
        in_double() ? invariant_load(pointer_type, at_offset(batch, offsetof(VertexBatch, doubles)), 8) : nullptr;
    const auto put = [&](std::uint32_t slot, const Component& value) {
        builder.CreateAlignedStore(widen(to_word(value)), at_offset(outputs, std::int64_t{slot} * max_lanes * 4),
                                   llvm::Align(64));
        if (value.value->getType()->getScalarType()->isDoubleTy())
            builder.CreateAlignedStore(widen(value), at_offset(doubles, std::int64_t{slot} * max_lanes * 8),
                                       llvm::Align(64));
    };
    bool has_point_size = false;
    // Clip distances come before cull distances, wherever the shader declares them.
    struct BuiltInOutput {
        BuiltIn builtin;
        std::vector<Component> values;
    };
    std::vector<BuiltInOutput> builtins;
    const auto add_builtin = [&](const Variable& variable, BuiltIn builtin, const Pointer& place) {
        builtins.push_back({builtin, load(place)});
        // Other outputs may be undefined as long as no fragment depends on them, which fragment shaders look after.
        if (options.checks) check_outputs(variable, builtins.back().values);
    };
    for (const Id id : module.interface()) {
        const Variable* variable = module.variable(id);
        if (!variable || variable->storage != spv::StorageClass::Output) continue;
        const Type& type = module.type(variable->type);
        const Pointer pointer = pointer_to(id);
        if (variable->builtin) {
            add_builtin(*variable, *variable->builtin, pointer);
        } else if (type.kind == TypeKind::structure && !type.members.empty() && type.members[0].builtin) {
            for (std::uint32_t i = 0; i < type.members.size(); ++i) {
                if (!uses_member(module, id, i)) continue;
                Pointer member = pointer;
                member.component += type.members[i].first_component;
                member.type = type.members[i].type;
                add_builtin(*variable, *type.members[i].builtin, member);
            }
        } else {
            const auto scalars = interface_scalars(module, *variable);
            if (!scalars) reject(fmt::format("output '{}' has no location", variable->name));
            const std::vector<Component> values = load(pointer);
            for (std::size_t i = 0; i < scalars->size(); ++i) {
                const InterfaceScalar& at = (*scalars)[i];
                if (values[i].undefined) {
                    constexpr std::int32_t one = 0x3f800000;
                    llvm::Value* told = widen(Component(values[i].undefined));
                    program.outputs.push_back({undefined_location + at.location, at.component, program.output_slots});
                    if (at.is_wide)
                        program.outputs.push_back(
                            {undefined_location + at.upper_location, at.upper_component, program.output_slots});
                    put(program.output_slots++, Component(select(told, splat(int32(one)), splat(int32(0)))));
                }
                program.outputs.push_back({at.location, at.component, program.output_slots});
                if (!at.is_wide) {
                    put(program.output_slots++, values[i]);
                    continue;
                }
                llvm::Value* bits = builder.CreateBitCast(widen(values[i]), vector_of(builder.getInt64Ty()));
                put(program.output_slots++, Component(bits));
                program.outputs.push_back({at.upper_location, at.upper_component, program.output_slots});
                put(program.output_slots++, Component(builder.CreateLShr(bits, 32)));
            }
        }
    }
    bool has_position = false;
    for (const BuiltInOutput& output : builtins) {
        if (output.builtin == BuiltIn::Position) {
            has_position = true;
            for (std::uint32_t i = 0; i < 4; ++i) put(slot_position + i, output.values.at(i));
        } else if (output.builtin == BuiltIn::PointSize) {
            has_point_size = true;
            put(slot_point_size, output.values.at(0));
        } else if (output.builtin == BuiltIn::ClipDistance) {
            program.clip_distances = static_cast<std::uint32_t>(std::min<std::size_t>(output.values.size(), 8));
        } else if (output.builtin == BuiltIn::CullDistance) {
            program.cull_distances = static_cast<std::uint32_t>(std::min<std::size_t>(output.values.size(), 8));
        }
    }
    if (program.clip_distances + program.cull_distances > 8) reject("clip and cull distances are more than 8 together");
    for (const BuiltInOutput& output : builtins) {
        const bool is_clip = output.builtin == BuiltIn::ClipDistance;
        if (!is_clip && output.builtin != BuiltIn::CullDistance) continue;
        const std::uint32_t first = slot_clip_distance + (is_clip ? 0 : program.clip_distances);
        for (std::uint32_t i = 0; i < output.values.size() && first + i < first_user_slot; ++i) {
            put(first + i, output.values[i]);
            // Fragment shaders may ask for them.
            program.outputs.push_back({is_clip ? clip_distance_location : cull_distance_location, i, first + i});
        }
    }
    if (!has_position)
        for (std::uint32_t i = 0; i < 4; ++i)
            put(slot_position + i, Component(llvm::ConstantFP::get(real_type(), i == 3)));
    if (!has_point_size) put(slot_point_size, Component(llvm::ConstantFP::get(real_type(), 1)));
    program.writes_point_size = has_point_size;
    std::ranges::sort(program.outputs, {}, [](const VertexOutput& at) { return std::pair(at.location, at.component); });
}

void VertexEmitter::add_stage_values(std::vector<llvm::Value**>& places) {
    places.insert(places.end(), {&draw, &batch, &indices, &instance});
}

void VertexEmitter::emit() {
    emit_batches(3, sizeof(VertexBatch), [&](llvm::Value* one) {
        batch = one;
        draw = function_->getArg(1);
        emit_batch();
    });
    program.has_side_effects = has_side_effects;
}

void VertexEmitter::emit_batch() {
    indices = builder.CreateAlignedLoad(vector_of(builder.getInt32Ty()),
                                        at_offset(batch, offsetof(VertexBatch, indices)), llvm::Align(4));
    instance = builder.CreateAlignedLoad(builder.getInt32Ty(), at_offset(batch, offsetof(VertexBatch, instance)),
                                         llvm::Align(4));
    llvm::Value* count =
        builder.CreateAlignedLoad(builder.getInt32Ty(), at_offset(batch, offsetof(VertexBatch, count)), llvm::Align(4));
    // Lanes behind the last vertex repeat one; only what they write must not be seen.
    live_slot = make_slot(mask_type, "live");
    store_live(builder.CreateICmpULT(lane_numbers(), splat(count)));
    mask = all_lanes();
    if (options.checks) begin_checks(rhi::ShaderStage::vertex, batch, nullptr, nullptr);
    declare_variables();
    emit_function(module.entry(), {}, all_lanes());
    mask = all_lanes();
    store_outputs();
}

}  // namespace nacre::cpu
