// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include <llvm/IR/Constants.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::StorageClass;

void Emitter::share_environment() {
    const auto& functions = module.functions();
    if (std::ranges::any_of(functions, [&](const auto& entry) {
            return entry.first != module.entry().id && std::ranges::any_of(entry.second.blocks, [](const Block& block) {
                       return block.terminator.op == spv::Op::OpKill ||
                              block.terminator.op == spv::Op::OpTerminateInvocation;
                   });
        })) {
        killed_slot = make_slot(mask_type, "killed");
        builder.CreateStore(llvm::Constant::getNullValue(mask_type), killed_slot);
    }
    if (std::ranges::none_of(functions, [](const auto& entry) { return entry.second.is_kept; })) return;
    std::vector<llvm::Value**> places{&shader_context, &live_slot, &killed_slot};
    // In the order of their ids, so that the code made does not depend on that of a hash table.
    std::vector<Id> ids;
    for (const auto& [id, variable] : lane_variables) ids.push_back(id);
    std::ranges::sort(ids);
    for (const Id id : ids) {
        places.push_back(&lane_variables[id]->memory);
        for (Component& component : lane_variables[id]->components)
            places.insert(places.end(), {&component.value, &component.linear_base});
    }
    ids.clear();
    for (const auto& [id, query] : ray_queries) ids.push_back(id);
    std::ranges::sort(ids);
    for (const Id id : ids) places.push_back(&ray_queries[id]);
    add_stage_values(places);
    std::erase_if(places, [](llvm::Value** place) { return !*place || llvm::isa<llvm::Constant>(*place); });
    std::vector<llvm::Type*> types;
    for (llvm::Value** place : places) types.push_back((*place)->getType());
    shared_places_ = std::move(places);
    environment_type_ = llvm::StructType::get(context, types);
    environment_ = make_slot(environment_type_, "environment");
    for (unsigned i = 0; i < types.size(); ++i)
        builder.CreateStore(*shared_places_[i], builder.CreateStructGEP(environment_type_, environment_, i));
}

std::vector<llvm::Type*> Emitter::argument_types(const Instruction& parameter) {
    const Type& type = module.type(parameter.type);
    const bool is_uniform = !uniformity.is_divergent(parameter.result);
    const auto shaped = [&](llvm::Type* kind) { return is_uniform ? kind : static_cast<llvm::Type*>(vector_of(kind)); };
    std::vector<llvm::Type*> types;
    if (type.components > 0) {
        for_each_component_type(parameter.type,
                                [&](const Type& scalar) { types.push_back(shaped(scalar_type(scalar))); });
    } else if (type.is_opaque()) {
        types.assign(2, shaped(pointer_type));
    } else if (type.kind == TypeKind::pointer) {
        const bool is_resource = module.type(type.element).is_opaque();
        types.push_back(is_resource ? shaped(pointer_type) : pointer_type);
    } else {
        reject("an argument of a type without a value");
    }
    return types;
}

Emitter::Argument Emitter::argument(const Instruction& parameter, Id id) {
    const Type& type = module.type(parameter.type);
    const bool is_uniform = !uniformity.is_divergent(parameter.result);
    const auto shaped = [&](const Component& component) {
        return is_uniform ? narrow(component, mask) : widen(component);
    };
    Argument made;
    if (type.components > 0) {
        for (const Component& component : get_components(id)) made.values.push_back(shaped(component));
        return made;
    }
    if (type.is_opaque()) {
        const Value value = get(id);
        const Component image = value.image ? value.image : value.sampler;
        made.values = {shaped(image), shaped(value.sampler ? value.sampler : image)};
        return made;
    }
    const Pointer pointer = get_pointer(id);
    if (module.type(type.element).is_opaque()) {
        made.values.push_back(shaped(descriptor(pointer)));
        return made;
    }
    // A whole variable of which each lane has its own.
    made.fits = pointer.kind == Pointer::Kind::lanes && pointer.component == 0 && !pointer.dynamic_component &&
                !pointer.valid && pointer.variable->memory && !pointer.variable->is_uniform &&
                pointer.variable->type == pointer.type;
    if (made.fits) made.values.push_back(pointer.variable->memory);
    return made;
}

Value Emitter::parameter_value(const Instruction& parameter, std::span<llvm::Value* const> values) {
    const Type& type = module.type(parameter.type);
    Value value;
    if (type.components > 0) {
        value.components.assign(values.begin(), values.end());
        return value;
    }
    if (type.is_opaque()) {
        value.image = values[0], value.sampler = values[1];
        value.image_type = type.kind == TypeKind::sampled_image ? type.element : parameter.type;
        return value;
    }
    auto pointer = std::make_shared<Pointer>();
    pointer->storage = type.storage, pointer->type = type.element;
    if (module.type(type.element).is_opaque()) {
        pointer->kind = Pointer::Kind::descriptor;
        pointer->descriptor_address = values[0];
    } else {
        auto& variable = lane_variables[parameter.result];
        variable = std::make_unique<LaneVariable>();
        variable->type = type.element;
        variable->slot_bytes = slot_bytes_of(module.type(type.element));
        variable->memory = values[0];
        pointer->kind = Pointer::Kind::lanes;
        pointer->variable = variable.get(), pointer->variable_id = parameter.result;
    }
    value.pointer = std::move(pointer);
    return value;
}

llvm::Function* Emitter::kept_function(const Function& callee) {
    if (const auto found = kept_.find(callee.id); found != kept_.end()) return found->second;
    std::vector<llvm::Type*> types{pointer_type, mask_type};
    std::vector<std::size_t> first_argument;
    for (const Instruction& parameter : callee.parameters) {
        first_argument.push_back(types.size());
        const std::vector<llvm::Type*> more = argument_types(parameter);
        types.insert(types.end(), more.begin(), more.end());
    }
    first_argument.push_back(types.size());
    std::vector<llvm::Type*> results;
    if (module.type(callee.return_type).components > 0)
        for_each_component_type(callee.return_type,
                                [&](const Type& scalar) { results.push_back(vector_of(scalar_type(scalar))); });
    llvm::Type* result_type =
        results.empty() ? builder.getVoidTy() : static_cast<llvm::Type*>(llvm::StructType::get(context, results));
    llvm::Function* made = llvm::Function::Create(llvm::FunctionType::get(result_type, types, false),
                                                  llvm::Function::InternalLinkage, "function", target);
    kept_.emplace(callee.id, made);

    // What belongs to the function from which the call was found is put aside.
    const auto outer_place = builder.saveIP();
    llvm::Function* const outer_function = std::exchange(function_, made);
    llvm::BasicBlock* const outer_slots = std::exchange(slot_block, llvm::BasicBlock::Create(context, "slots", made));
    llvm::AllocaInst* const outer_nowhere = std::exchange(nowhere_slot, nullptr);
    llvm::AllocaInst* const outer_image = std::exchange(image_arguments, nullptr);
    llvm::Value* const outer_environment = std::exchange(environment_, made->getArg(0));
    std::vector<llvm::Value*> outer_values;
    for (llvm::Value** place : shared_places_) outer_values.push_back(*place);
    auto outer_variables = std::exchange(lane_variables, {});
    auto outer_queries = ray_queries;
    for (auto& [id, variable] : outer_variables)
        if (const Variable* declared = module.variable(id); declared && declared->storage != StorageClass::Function)
            lane_variables[id] = std::move(variable);

    llvm::BasicBlock* start = llvm::BasicBlock::Create(context, "start", made);
    builder.SetInsertPoint(start);
    for (unsigned i = 0; i < shared_places_.size(); ++i)
        *shared_places_[i] = builder.CreateLoad(environment_type_->getElementType(i),
                                                builder.CreateStructGEP(environment_type_, environment_, i));
    std::vector<llvm::Value*> arguments;
    for (llvm::Argument& argument : made->args()) arguments.push_back(&argument);
    std::vector<Value> values;
    for (std::size_t i = 0; i < callee.parameters.size(); ++i)
        values.push_back(parameter_value(
            callee.parameters[i],
            std::span(arguments).subspan(first_argument[i], first_argument[i + 1] - first_argument[i])));
    const std::vector<Component> returned = emit_function(callee, values, made->getArg(1));
    if (results.empty()) {
        builder.CreateRetVoid();
    } else {
        llvm::Value* all = llvm::UndefValue::get(result_type);
        for (unsigned i = 0; i < returned.size(); ++i) all = builder.CreateInsertValue(all, returned[i].value, i);
        builder.CreateRet(all);
    }
    builder.SetInsertPoint(slot_block);
    builder.CreateBr(start);

    for (auto& [id, variable] : lane_variables)
        if (const Variable* declared = module.variable(id); declared && declared->storage != StorageClass::Function)
            outer_variables[id] = std::move(variable);
    lane_variables = std::move(outer_variables);
    for (std::size_t i = 0; i < shared_places_.size(); ++i) *shared_places_[i] = outer_values[i];
    for (const auto& [id, query] : outer_queries) ray_queries[id] = query;
    environment_ = outer_environment;
    image_arguments = outer_image;
    nowhere_slot = outer_nowhere;
    slot_block = outer_slots;
    function_ = outer_function;
    builder.restoreIP(outer_place);
    return made;
}

void Emitter::emit_call(const Instruction& at) {
    const Function& callee = module.function(at.operand(0));
    const bool has_result = module.type(at.type).components > 0;
    if (callee.is_kept) {
        std::vector<llvm::Value*> values{environment_, mask};
        bool fits = true;
        for (std::size_t i = 0; i < callee.parameters.size() && fits; ++i) {
            const Argument one = argument(callee.parameters[i], at.operand(i + 1));
            fits = one.fits;
            values.insert(values.end(), one.values.begin(), one.values.end());
        }
        if (fits) {
            llvm::Value* result = builder.CreateCall(kept_function(callee), values);
            if (!has_result) return;
            std::vector<Component> components;
            for (unsigned i = 0; i < module.type(at.type).components; ++i)
                components.emplace_back(builder.CreateExtractValue(result, i));
            return set(at, std::move(components));
        }
    }
    std::vector<Value> arguments;
    for (std::size_t i = 1; i < at.operands.size(); ++i) arguments.push_back(get(at.operands[i]));
    std::vector<Component> result = emit_function(callee, arguments, mask);
    if (has_result) set(at, std::move(result));
}

}  // namespace nacre::cpu
