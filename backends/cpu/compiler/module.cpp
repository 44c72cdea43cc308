// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/module.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "backends/cpu/rays/ray_query.h"
#include "rhi/spirv.h"

namespace nacre::cpu {
namespace {

using spv::Op;

struct Decorations {
    std::optional<spv::BuiltIn> builtin;
    std::optional<std::uint32_t> set, binding, location, spec_id;
    std::uint32_t component = 0, index = 0, array_stride = 0;
    bool flat = false, no_perspective = false, centroid = false, sample = false, block = false, buffer_block = false,
         no_contraction = false;
};
struct MemberDecorations {
    std::optional<spv::BuiltIn> builtin;
    std::optional<std::uint32_t> location;
    std::uint32_t component = 0, offset = 0, matrix_stride = 0;
    bool row_major = false, flat = false, no_perspective = false, centroid = false, sample = false;
};

std::uint64_t key_of(Id type, std::uint32_t member) { return (std::uint64_t{type} << 32) | member; }

void decorate(Decorations& to, spv::Decoration decoration, std::uint32_t value) {
    switch (decoration) {
        case spv::Decoration::BuiltIn: to.builtin = static_cast<spv::BuiltIn>(value); break;
        case spv::Decoration::DescriptorSet: to.set = value; break;
        case spv::Decoration::Binding: to.binding = value; break;
        case spv::Decoration::Location: to.location = value; break;
        case spv::Decoration::Component: to.component = value; break;
        case spv::Decoration::Index: to.index = value; break;
        case spv::Decoration::ArrayStride: to.array_stride = value; break;
        case spv::Decoration::Flat: to.flat = true; break;
        case spv::Decoration::NoPerspective: to.no_perspective = true; break;
        case spv::Decoration::Centroid: to.centroid = true; break;
        case spv::Decoration::Sample: to.sample = true; break;
        case spv::Decoration::Block: to.block = true; break;
        case spv::Decoration::BufferBlock: to.block = to.buffer_block = true; break;
        case spv::Decoration::NoContraction: to.no_contraction = true; break;
        default: break;
    }
}

void decorate(MemberDecorations& to, spv::Decoration decoration, std::uint32_t value) {
    switch (decoration) {
        case spv::Decoration::BuiltIn: to.builtin = static_cast<spv::BuiltIn>(value); break;
        case spv::Decoration::Location: to.location = value; break;
        case spv::Decoration::Component: to.component = value; break;
        case spv::Decoration::Offset: to.offset = value; break;
        case spv::Decoration::MatrixStride: to.matrix_stride = value; break;
        case spv::Decoration::RowMajor: to.row_major = true; break;
        case spv::Decoration::Flat: to.flat = true; break;
        case spv::Decoration::NoPerspective: to.no_perspective = true; break;
        case spv::Decoration::Centroid: to.centroid = true; break;
        case spv::Decoration::Sample: to.sample = true; break;
        default: break;
    }
}

bool ends_block(Op op) {
    switch (op) {
        case Op::OpBranch: case Op::OpBranchConditional: case Op::OpSwitch: case Op::OpReturn: case Op::OpReturnValue:
        case Op::OpKill: case Op::OpUnreachable: case Op::OpTerminateInvocation:
            return true;
        default: return false;
    }
}

void add_unique(std::vector<Id>& list, Id id) {
    if (std::ranges::find(list, id) == list.end()) list.push_back(id);
}

}  // namespace

std::optional<std::uint32_t> Module::constant_word(Id id) const {
    const Instruction* found = constant(id);
    if (!found) return std::nullopt;
    if (found->op == Op::OpConstantNull || found->op == Op::OpConstantFalse || found->op == Op::OpSpecConstantFalse)
        return 0;
    if (found->op == Op::OpConstantTrue || found->op == Op::OpSpecConstantTrue) return 1;
    if (found->op != Op::OpConstant && found->op != Op::OpSpecConstant) return std::nullopt;
    const Type& kind = type(found->type);
    if (kind.kind != TypeKind::integer) return std::nullopt;
    // A wide index that fits is as good as a narrow one.
    if (kind.bits == 64 && found->operand(1) != 0) return std::nullopt;
    return found->operand(0);
}

std::uint64_t Module::tight_size(Id id) const {
    const Type& kind = type(id);
    switch (kind.kind) {
        case TypeKind::boolean: return 4;
        case TypeKind::integer:
        case TypeKind::floating: return kind.bits / 8;
        case TypeKind::vector:
        case TypeKind::matrix:
        case TypeKind::array: {
            // Elements of 8 and 16 bits leave what follows them unaligned; nothing here minds but 64-bit atomics.
            return tight_size(kind.element) * kind.count;
        }
        case TypeKind::structure: return tight_offset(id, static_cast<std::uint32_t>(kind.members.size()));
        case TypeKind::ray_query: return sizeof(RayQueryLanes);  // Of all lanes together.
        default: return 0;
    }
}

std::uint64_t Module::tight_offset(Id structure, std::uint32_t member) const {
    const Type& kind = type(structure);
    std::uint64_t at = 0;
    for (std::uint32_t i = 0; i < kind.members.size(); ++i) {
        const std::uint64_t alignment = types_.at(kind.members[i].type).has_wide ? 8 : 4;
        at = (at + alignment - 1) / alignment * alignment;
        if (i == member) return at;
        at += tight_size(kind.members[i].type);
    }
    return (at + 7) / 8 * 8;
}

void Module::finish_type(Type& type) {
    const auto element = [&]() -> const Type& { return types_.at(type.element); };
    const auto multiply = [](std::uint32_t a, std::uint32_t b) {
        return static_cast<std::uint32_t>(
            std::min<std::uint64_t>(std::uint64_t{a} * b, std::numeric_limits<std::uint32_t>::max()));
    };
    switch (type.kind) {
        case TypeKind::boolean: type.components = 1; break;
        case TypeKind::integer:
        case TypeKind::floating: type.components = 1, type.has_wide = type.bits == 64; break;
        case TypeKind::vector:
        case TypeKind::matrix:
        case TypeKind::array:
            type.components = multiply(element().components, type.count);
            type.has_wide = element().has_wide;
            break;
        case TypeKind::structure: {
            std::uint64_t total = 0;
            for (Member& member : type.members) {
                member.first_component = static_cast<std::uint32_t>(std::min<std::uint64_t>(total, ~0u));
                total += types_.at(member.type).components;
                type.has_wide = type.has_wide || types_.at(member.type).has_wide;
            }
            type.components = static_cast<std::uint32_t>(std::min<std::uint64_t>(total, ~0u));
            break;
        }
        case TypeKind::pointer:
            if (type.storage == spv::StorageClass::StorageBuffer || type.storage == spv::StorageClass::Workgroup)
                type.components = 3, type.has_wide = true;
            break;
        default: break;
    }
}

Expected<Module> Module::parse(std::span<const std::uint32_t> words, std::string_view entry_point,
                               spv::ExecutionModel model, std::string_view name) {
    const auto unsupported = [&](std::string reason, std::string remedy) {
        return fail(ErrorCode::unsupported, "compile shader", fmt::format("'{}'", name), std::move(reason),
                    std::move(remedy));
    };
    Module module;
    for (const Id id : {pointer_word_type, pointer_offset_type}) {
        Type& word = module.types_[id];
        word.id = id, word.kind = TypeKind::integer, word.bits = id == pointer_word_type ? 64 : 32;
        module.finish_type(word);
    }
    module.words_ = words;
    module.name = std::string(name);
    module.model = model;
    std::unordered_map<Id, Decorations> decorations;
    std::unordered_map<std::uint64_t, MemberDecorations> member_decorations;
    std::unordered_map<Id, std::string> names;
    std::vector<Id> workgroup_size_ids;
    Function function;
    std::vector<Block> blocks;
    bool in_function = false, in_block = false;

    for (const rhi::spirv::Instruction& at : rhi::spirv::instructions(words)) {
        const Op op = static_cast<Op>(at.opcode());
        bool has_result = false, has_type = false;
        spv::HasResultAndType(op, &has_result, &has_type);
        Instruction instruction;
        instruction.op = op;
        instruction.offset = static_cast<std::uint32_t>(at.offset);
        std::size_t first = 0;
        if (has_type) instruction.type = at.operand(first++);
        if (has_result) instruction.result = at.operand(first++);
        instruction.operands = at.words.subspan(std::min(first + 1, at.words.size()));
        if (instruction.result && instruction.type) {
            module.result_types_[instruction.result] = instruction.type;
            if (const auto made = module.types_.find(instruction.type);
                made != module.types_.end() && made->second.components > max_components)
                return unsupported(fmt::format("word {}: a value of {} scalars", at.offset, made->second.components),
                                   fmt::format("At most {} are possible; load a part.", max_components));
        }

        switch (op) {
            case Op::OpName: names[at.operand(0)] = at.text(1); continue;
            case Op::OpExtInstImport:
                if (const std::string set = at.text(1); set == "GLSL.std.450") module.glsl_set_ = instruction.result;
                else if (!set.starts_with("NonSemantic.") && !set.ends_with(".DebugInfo.100"))
                    module.foreign_sets_[instruction.result] = set;
                continue;
            case Op::OpEntryPoint:
                if (static_cast<spv::ExecutionModel>(at.operand(0)) == model && at.text(2) == entry_point) {
                    module.entry_ = at.operand(1);
                    for (std::size_t i = at.after_text(2); i < at.operand_count(); ++i)
                        module.interface_.push_back(at.operand(i));
                }
                continue;
            case Op::OpExecutionMode:
            case Op::OpExecutionModeId:
                if (at.operand(0) != module.entry_) continue;
                switch (static_cast<spv::ExecutionMode>(at.operand(1))) {
                    case spv::ExecutionMode::LocalSize:
                        for (std::uint32_t i = 0; i < 3; ++i) module.workgroup_size[i] = at.operand(2 + i);
                        break;
                    case spv::ExecutionMode::LocalSizeId:
                        for (std::uint32_t i = 0; i < 3; ++i) workgroup_size_ids.push_back(at.operand(2 + i));
                        break;
                    case spv::ExecutionMode::EarlyFragmentTests: module.early_fragment_tests = true; break;
                    case spv::ExecutionMode::DepthReplacing: module.depth_replacing = true; break;
                    default: break;
                }
                continue;
            case Op::OpDecorate:
            case Op::OpDecorateId:
                decorate(decorations[at.operand(0)], static_cast<spv::Decoration>(at.operand(1)), at.operand(2));
                continue;
            case Op::OpMemberDecorate:
                decorate(member_decorations[key_of(at.operand(0), at.operand(1))],
                         static_cast<spv::Decoration>(at.operand(2)), at.operand(3));
                continue;
            case Op::OpGroupDecorate:
                for (std::size_t i = 1; i < at.operand_count(); ++i)
                    decorations[at.operand(i)] = decorations[at.operand(0)];
                continue;
            case Op::OpTypeForwardPointer: continue;
            default: break;
        }

        // Types.
        Type type;
        type.id = instruction.result;
        bool is_type = true;
        switch (op) {
            case Op::OpTypeVoid: type.kind = TypeKind::void_type; break;
            case Op::OpTypeBool: type.kind = TypeKind::boolean, type.bits = 1; break;
            case Op::OpTypeInt:
                type.kind = TypeKind::integer, type.bits = instruction.operand(0),
                type.is_signed = instruction.operand(1) != 0;
                break;
            case Op::OpTypeFloat: type.kind = TypeKind::floating, type.bits = instruction.operand(0); break;
            case Op::OpTypeVector:
                type.kind = TypeKind::vector, type.element = instruction.operand(0),
                type.count = instruction.operand(1);
                break;
            case Op::OpTypeMatrix:
                type.kind = TypeKind::matrix, type.element = instruction.operand(0),
                type.count = instruction.operand(1);
                break;
            case Op::OpTypeArray: {
                const auto count = module.constant_word(instruction.operand(1));
                if (!count)
                    return unsupported(
                        fmt::format("word {}: the length of an array is no constant of 32 bits", at.offset),
                        "Use a constant.");
                type.kind = TypeKind::array, type.element = instruction.operand(0), type.count = *count;
                type.array_stride = decorations[type.id].array_stride;
                break;
            }
            case Op::OpTypeRuntimeArray:
                type.kind = TypeKind::runtime_array, type.element = instruction.operand(0);
                type.array_stride = decorations[type.id].array_stride;
                break;
            case Op::OpTypeStruct: {
                type.kind = TypeKind::structure;
                type.is_block = decorations[type.id].block;
                type.is_buffer_block = decorations[type.id].buffer_block;
                for (std::uint32_t i = 0; i < instruction.operands.size(); ++i) {
                    Member member;
                    member.type = instruction.operands[i];
                    if (const auto found = member_decorations.find(key_of(type.id, i));
                        found != member_decorations.end()) {
                        const MemberDecorations& from = found->second;
                        member.builtin = from.builtin, member.location = from.location,
                        member.component = from.component;
                        member.offset = from.offset, member.matrix_stride = from.matrix_stride;
                        member.row_major = from.row_major, member.flat = from.flat;
                        member.no_perspective = from.no_perspective, member.centroid = from.centroid;
                        member.sample = from.sample;
                    }
                    type.members.push_back(member);
                }
                break;
            }
            case Op::OpTypePointer:
                type.kind = TypeKind::pointer;
                type.storage = static_cast<spv::StorageClass>(instruction.operand(0));
                type.element = instruction.operand(1);
                type.array_stride = decorations[type.id].array_stride;
                break;
            case Op::OpTypeImage:
                type.kind = TypeKind::image;
                type.element = instruction.operand(0);
                type.dim = static_cast<spv::Dim>(instruction.operand(1));
                type.arrayed = instruction.operand(3) != 0;
                type.multisampled = instruction.operand(4) != 0;
                type.sampled = instruction.operand(5);
                break;
            case Op::OpTypeSampler: type.kind = TypeKind::sampler; break;
            case Op::OpTypeSampledImage:
                type.kind = TypeKind::sampled_image, type.element = instruction.operand(0);
                break;
            case Op::OpTypeFunction: type.kind = TypeKind::function, type.element = instruction.operand(0); break;
            case Op::OpTypeAccelerationStructureKHR: type.kind = TypeKind::acceleration_structure; break;
            case Op::OpTypeRayQueryKHR: type.kind = TypeKind::ray_query; break;
            default: is_type = false;
        }
        if (is_type) {
            module.finish_type(type);
            module.types_.emplace(type.id, std::move(type));
            continue;
        }

        switch (op) {
            case Op::OpConstantTrue: case Op::OpConstantFalse: case Op::OpConstant: case Op::OpConstantComposite:
            case Op::OpConstantNull: case Op::OpSpecConstantTrue: case Op::OpSpecConstantFalse: case Op::OpSpecConstant:
            case Op::OpSpecConstantComposite: case Op::OpSpecConstantOp:
                module.constants_.emplace(instruction.result, instruction);
                if (decorations[instruction.result].builtin == spv::BuiltIn::WorkgroupSize)
                    workgroup_size_ids.assign(instruction.operands.begin(), instruction.operands.end());
                continue;
            case Op::OpUndef:
                module.constants_.emplace(instruction.result, instruction);
                continue;
            case Op::OpVariable: {
                Variable variable;
                variable.instruction = instruction;
                variable.type = module.type(instruction.type).element;
                variable.storage = static_cast<spv::StorageClass>(instruction.operand(0));
                variable.initializer = instruction.operand(1);
                const Decorations& from = decorations[instruction.result];
                variable.builtin = from.builtin, variable.set = from.set, variable.binding = from.binding;
                variable.location = from.location, variable.component = from.component, variable.index = from.index;
                variable.flat = from.flat, variable.no_perspective = from.no_perspective;
                variable.centroid = from.centroid, variable.sample = from.sample;
                if (const auto found = names.find(instruction.result); found != names.end())
                    variable.name = found->second;
                // Of buffers only what is loaded takes registers.
                const bool is_buffer = variable.storage == spv::StorageClass::StorageBuffer ||
                                       variable.storage == spv::StorageClass::Uniform ||
                                       variable.storage == spv::StorageClass::PushConstant;
                if (!is_buffer && module.type(variable.type).components > max_components)
                    return unsupported(
                        fmt::format("word {}: variable '{}' holds {} scalars", at.offset, variable.name,
                                    module.type(variable.type).components),
                        fmt::format("At most {} fit into a variable; use a storage buffer.", max_components));
                module.variables_.emplace(instruction.result, std::move(variable));
                if (in_block) blocks.back().body.push_back(instruction);
                continue;
            }
            case Op::OpFunction:
                function = Function{};
                blocks.clear();
                function.id = instruction.result;
                function.return_type = instruction.type;
                function.is_kept =
                    (instruction.operand(0) & static_cast<std::uint32_t>(spv::FunctionControlMask::DontInline)) != 0;
                in_function = true;
                continue;
            case Op::OpFunctionParameter: function.parameters.push_back(instruction); continue;
            case Op::OpFunctionEnd:
                module.order_blocks(function, std::move(blocks));
                blocks = {};
                module.functions_.emplace(function.id, std::move(function));
                in_function = in_block = false;
                continue;
            case Op::OpLabel:
                if (!in_function) continue;
                blocks.emplace_back();
                blocks.back().id = instruction.result;
                in_block = true;
                continue;
            case Op::OpLine: case Op::OpNoLine: case Op::OpNop: continue;
            default: break;
        }
        if (!in_block) continue;
        Block& block = blocks.back();
        if (op == Op::OpSelectionMerge) {
            block.merge = instruction.operand(0);
        } else if (op == Op::OpLoopMerge) {
            block.merge = instruction.operand(0), block.continue_target = instruction.operand(1);
        } else if (op == Op::OpPhi) {
            block.phis.push_back(instruction);
        } else if (ends_block(op)) {
            block.terminator = instruction;
            if (op == Op::OpBranch) block.successors.push_back(instruction.operand(0));
            if (op == Op::OpBranchConditional) {
                add_unique(block.successors, instruction.operand(1));
                add_unique(block.successors, instruction.operand(2));
            }
            if (op == Op::OpSwitch) {
                const Type& selector = module.type(module.type_of(instruction.operand(0)));
                const std::size_t step = selector.bits > 32 ? 3 : 2;
                add_unique(block.successors, instruction.operand(1));
                for (std::size_t i = 2; i + step - 1 < instruction.operands.size(); i += step)
                    add_unique(block.successors, instruction.operands[i + step - 1]);
            }
            in_block = false;
        } else {
            block.body.push_back(instruction);
        }
    }
    if (!module.functions_.contains(module.entry_))
        return fail(ErrorCode::shader_compile, "compile shader", fmt::format("'{}'", name),
                    fmt::format("the module has no entry point '{}' of this stage", entry_point),
                    "Name one that it has.");
    for (std::size_t i = 0; i < workgroup_size_ids.size() && i < 3; ++i)
        if (const auto value = module.constant_word(workgroup_size_ids[i])) module.workgroup_size[i] = *value;
    for (const auto& [id, from] : decorations)
        if (from.no_contraction) module.no_contraction_.emplace(id, 1);
    module.find_constant_contents();
    return module;
}

void Module::find_constant_contents() {
    constexpr std::uint32_t small_components = 16;  // Up to which registers do as well.
    std::unordered_map<Id, Id> roots;               // Variables that may be constant, and pointers into them.
    for (const auto& [id, at] : variables_) {
        if (at.storage != spv::StorageClass::Function && at.storage != spv::StorageClass::Private) continue;
        if (type(at.type).components <= small_components) continue;
        roots[id] = id;
        if (constant(at.initializer)) constant_contents_[id] = at.initializer;
    }
    if (roots.empty()) return;
    const auto root_of = [&](Id id) {
        const auto found = roots.find(id);
        return found == roots.end() ? 0 : found->second;
    };
    std::unordered_map<Id, char> changing;
    for (const auto& [function_id, function] : functions_)
        for (const Block& block : function.blocks) {
            for (const Instruction& at : block.body) {
                if (at.op == Op::OpVariable || at.op == Op::OpLoad) continue;
                if (at.op == Op::OpAccessChain || at.op == Op::OpInBoundsAccessChain) {
                    if (const Id root = root_of(at.operand(0))) roots[at.result] = root;
                    continue;
                }
                if (at.op == Op::OpStore) {
                    const Id root = root_of(at.operand(0)), value = at.operand(1);
                    const Instruction* stored = constant(value);
                    if (root && root == at.operand(0) && stored && stored->op != Op::OpUndef) {
                        const Id before = std::exchange(constant_contents_[root], value);
                        if (before && before != value) changing[root] = 1;
                        continue;
                    }
                }
                for (const Id operand : at.operands)
                    if (const Id root = root_of(operand)) changing[root] = 1;
            }
            for (const Instruction& phi : block.phis)
                for (const Id operand : phi.operands)
                    if (const Id root = root_of(operand)) changing[root] = 1;
            for (const Id operand : block.terminator.operands)
                if (const Id root = root_of(operand)) changing[root] = 1;
        }
    for (const auto& [id, is_changing] : changing) constant_contents_.erase(id);
}

void Module::order_blocks(Function& function, std::vector<Block> blocks) {
    if (blocks.empty()) return;
    std::unordered_map<Id, std::uint32_t> original;
    for (std::uint32_t i = 0; i < blocks.size(); ++i) original.emplace(blocks[i].id, i);
    // Depth-first search in which a header finishes its merge block first, then its continue target, then what it
    // branches to; reversed, the order of finishing is the structured order. Iterative: nesting has no limit.
    struct Visit {
        std::uint32_t block;
        std::vector<std::uint32_t> next;
        std::size_t at = 0;
    };
    const auto targets = [&](std::uint32_t index) {
        std::vector<std::uint32_t> list;
        const Block& block = blocks[index];
        const auto add = [&](Id id) {
            if (const auto found = original.find(id); found != original.end()) list.push_back(found->second);
        };
        if (block.merge) add(block.merge);
        if (block.continue_target) add(block.continue_target);
        for (auto successor = block.successors.rbegin(); successor != block.successors.rend(); ++successor)
            add(*successor);
        return list;
    };
    std::vector<char> seen(blocks.size(), 0);
    std::vector<std::uint32_t> finished;
    std::vector<Visit> stack;
    seen[0] = 1;
    stack.push_back({0, targets(0)});
    while (!stack.empty()) {
        Visit& visit = stack.back();
        if (visit.at < visit.next.size()) {
            const std::uint32_t next = visit.next[visit.at++];
            if (seen[next]) continue;
            seen[next] = 1;
            stack.push_back({next, targets(next)});
        } else {
            finished.push_back(visit.block);
            stack.pop_back();
        }
    }
    for (auto index = finished.rbegin(); index != finished.rend(); ++index) {
        function.block_index.emplace(blocks[*index].id, static_cast<std::uint32_t>(function.blocks.size()));
        function.blocks.push_back(std::move(blocks[*index]));
    }
    for (std::uint32_t i = 0; i < function.blocks.size(); ++i)
        for (const Id successor : function.blocks[i].successors)
            if (const auto target = function.find_block(successor)) function.blocks[*target].predecessors.push_back(i);
}

}  // namespace nacre::cpu
