// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/legalization.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <unordered_map>

#include <fmt/format.h>
#include <spirv-tools/optimizer.hpp>
#include <spirv/unified1/spirv.hpp11>

#include "rhi/spirv.h"

namespace nacre::cpu {
namespace {

using spv::Op;

/// Instructions up to which a module may grow as all calls are replaced by what they call. Beyond, functions that are
/// called more than once become functions of the code that is made, the large ones first.
constexpr std::uint64_t most_inlined_instructions = 60'000;
/// Functions that are kept are at least so large; a call costs about as much as a smaller one.
constexpr std::uint64_t kept_sizes[] = {4'000, 1'000, 250, 60};
/// Blocks up to which SPIRV-Tools makes values of variables: it takes time by the square of their number. LLVM does it
/// for others.
constexpr std::uint64_t most_rewritten_blocks = 3'000;
/// Where even that does not help (functions with barriers are always inlined).
constexpr std::uint64_t most_instructions = 2'000'000;

/// The passes for local variables turn a read of one element into one of the whole variable: not for more scalars than
/// this.
constexpr std::uint64_t most_local_scalars = 4096;

/// Which functions stay functions: those with FunctionControl::DontInline, by which `InlineExhaustivePass` and `Module`
/// go.
class InliningPlan {
  public:
    explicit InliningPlan(std::span<const std::uint32_t> words) {
        std::unordered_map<std::uint32_t, spv::StorageClass> pointers;
        std::unordered_map<std::uint32_t, std::uint32_t> pointees;
        std::unordered_map<std::uint32_t, Op> types;
        std::unordered_map<std::uint32_t, std::uint64_t> scalars, constants;
        const auto scalars_of = [&](std::uint32_t type) {
            const auto found = scalars.find(type);
            return found == scalars.end() ? std::uint64_t{1} : found->second;
        };
        std::vector<std::uint32_t> entries;
        std::vector<std::uint32_t> open_constructs;  // The blocks in which they end, from the outermost.
        FunctionSize* function = nullptr;
        for (const rhi::spirv::Instruction& at : rhi::spirv::instructions(words)) {
            const Op op = static_cast<Op>(at.opcode());
            if (op == Op::OpCapability) {
                const auto capability = static_cast<spv::Capability>(at.operand(0));
                has_variable_pointers_ |= capability == spv::Capability::VariablePointers ||
                                          capability == spv::Capability::VariablePointersStorageBuffer;
            }
            if (function) ++function->own, ++own_instructions_;
            if (op == Op::OpLabel) {
                ++own_blocks_;
                // Behind the block in which a construct ends none that was opened in it is open any more.
                if (const auto end = std::ranges::find(open_constructs, at.operand(0)); end != open_constructs.end())
                    open_constructs.erase(end, open_constructs.end());
            }
            if (op == Op::OpConstant) constants[at.operand(1)] = at.operand(2);
            if (op == Op::OpTypeArray) {
                // A length that may be specialized may be any.
                const auto length = constants.find(at.operand(2));
                scalars[at.operand(0)] = std::min(scalars_of(at.operand(1)), most_local_scalars + 1) *
                                         (length == constants.end() ? most_local_scalars + 1 : length->second);
            }
            if (op == Op::OpTypeStruct) {
                std::uint64_t& sum = scalars[at.operand(0)];
                for (std::size_t i = 1; i + 1 < at.words.size(); ++i)
                    sum += std::min(scalars_of(at.operand(i)), most_local_scalars + 1);
            }
            if (op == Op::OpTypePointer) {
                const auto storage = static_cast<spv::StorageClass>(at.operand(1));
                const bool is_local = storage == spv::StorageClass::Function || storage == spv::StorageClass::Private;
                has_large_variables_ |= is_local && scalars_of(at.operand(2)) > most_local_scalars;
            }
            switch (op) {
                case Op::OpEntryPoint: entries.push_back(at.operand(1)); break;
                case Op::OpTypeArray:
                case Op::OpTypeRuntimeArray:
                case Op::OpTypeRayQueryKHR:
                case Op::OpTypeImage:
                case Op::OpTypeSampler:
                case Op::OpTypeSampledImage: case Op::OpTypeAccelerationStructureKHR:
                    types[at.operand(0)] = op;
                    break;
                case Op::OpTypePointer:
                    pointers[at.operand(0)] = static_cast<spv::StorageClass>(at.operand(1));
                    pointees[at.operand(0)] = at.operand(2);
                    break;
                case Op::OpFunction:
                    function = &functions_[at.operand(1)];
                    function->control = at.offset + 3;
                    order_.push_back(at.operand(1));
                    break;
                case Op::OpFunctionParameter: {
                    // Places of resources in an array, and ray queries, are known only where the call is.
                    const auto pointee = pointees.find(at.operand(0));
                    const auto type = types.find(pointee == pointees.end() ? at.operand(0) : pointee->second);
                    if (type == types.end()) break;
                    const bool is_array = type->second == Op::OpTypeArray || type->second == Op::OpTypeRuntimeArray;
                    const bool is_value =
                        pointee != pointees.end() && pointers[at.operand(0)] != spv::StorageClass::UniformConstant;
                    if (type->second == Op::OpTypeRayQueryKHR || (is_array && !is_value && pointee != pointees.end()))
                        function->must_inline = true;
                    break;
                }
                case Op::OpFunctionCall: function->callees.push_back(at.operand(2)); break;
                // All invocations wait in the kernel; lanes that end must end in the caller too.
                case Op::OpControlBarrier: case Op::OpKill: case Op::OpTerminateInvocation:
                    if (function) function->must_inline = true;
                    break;
                case Op::OpSelectionMerge: case Op::OpLoopMerge: open_constructs.push_back(at.operand(0)); break;
                case Op::OpReturn: case Op::OpReturnValue:
                    if (function && !open_constructs.empty()) function->returns_early = true;
                    break;
                case Op::OpFunctionEnd:
                    function = nullptr;
                    open_constructs.clear();
                    break;
                default: break;
            }
        }
        order_by_calls();
        // Whoever calls a function that must be inlined must be inlined as well.
        for (FunctionSize* const at : callees_first_)
            for (const std::uint32_t callee : at->callees)
                at->must_inline = at->must_inline || functions_[callee].must_inline;
        for (const std::uint32_t id : entries) functions_[id].is_entry = true;
        for (const std::uint32_t id : order_)
            for (const std::uint32_t callee : functions_[id].callees) ++functions_[callee].calls;
        instructions_ = total(std::numeric_limits<std::uint64_t>::max());
        for (const std::uint64_t size : kept_sizes) {
            if (instructions_ <= most_inlined_instructions) break;
            instructions_ = total(size);
        }
    }

    /// What is left to compile.
    [[nodiscard]] std::uint64_t instructions() const { return instructions_; }

    /// Pointers may be loaded from variables: SPIRV-Tools' passes for local variables take such a load for one of the
    /// value.
    [[nodiscard]] bool has_variable_pointers() const { return has_variable_pointers_; }
    /// A variable of a function or an invocation holds more than `most_local_scalars`.
    [[nodiscard]] bool has_large_variables() const { return has_large_variables_; }
    /// Basic blocks in it, about.
    [[nodiscard]] std::uint64_t blocks() const {
        return own_blocks_ * instructions_ / std::max<std::uint64_t>(own_instructions_, 1);
    }

    /// Marks what SPIRV-Tools leaves alone: functions that are kept, and those that return from within a construct, which
    /// it cannot inline; for each call of one it would write the whole module out as text, to name it in a message.
    void apply(std::vector<std::uint32_t>& words, bool inlines_all) const {
        for (const auto& [id, function] : functions_) {
            if (!function.control) continue;
            if ((function.is_kept && !inlines_all) || function.returns_early) words[function.control] |= dont_inline;
            else words[function.control] &= ~dont_inline;
        }
    }

    /// Marks only what is kept, in what SPIRV-Tools made.
    void apply_to_result(std::vector<std::uint32_t>& words, bool inlines_all) const {
        std::vector<std::size_t> inlined;
        for (const rhi::spirv::Instruction& at : rhi::spirv::instructions(words)) {
            if (static_cast<Op>(at.opcode()) != Op::OpFunction) continue;
            const auto found = functions_.find(at.operand(1));
            if (found != functions_.end() && (inlines_all || !found->second.is_kept)) inlined.push_back(at.offset + 3);
        }
        for (const std::size_t control : inlined) words[control] &= ~dont_inline;
    }

  private:
    static constexpr auto dont_inline = static_cast<std::uint32_t>(spv::FunctionControlMask::DontInline);

    struct FunctionSize {
        std::size_t control = 0;  ///< Word of its FunctionControl.
        std::uint64_t own = 0;    ///< Instructions.
        std::uint64_t inlined = 0;
        std::uint32_t calls = 0;  ///< Places from which it is called.
        std::vector<std::uint32_t> callees;
        bool is_entry = false, must_inline = false, is_kept = false, is_ordered = false;
        bool returns_early = false;  ///< From within a construct.
    };

    /// Without recursion of its own, since calls may be as deep as there are functions. What an entry point reaches has
    /// no cycles; in what none reaches a cycle is cut somewhere.
    void order_by_calls() {
        for (const std::uint32_t id : order_) {
            std::vector<std::pair<FunctionSize*, std::size_t>> path{{&functions_[id], 0}};
            while (!path.empty()) {
                auto& [function, next] = path.back();
                if (next == 0 && function->is_ordered) {
                    path.pop_back();
                } else if (next < function->callees.size()) {
                    function->is_ordered = true;
                    FunctionSize* const callee = &functions_[function->callees[next++]];
                    if (!callee->is_ordered) path.emplace_back(callee, 0);
                } else {
                    function->is_ordered = true;
                    callees_first_.push_back(function);
                    path.pop_back();
                }
            }
        }
    }
    void find_inlined_size(FunctionSize& function, std::uint64_t kept_size) {
        constexpr std::uint64_t limit = std::uint64_t{1} << 40;
        std::uint64_t size = function.own;
        for (const std::uint32_t callee : function.callees) {
            const FunctionSize& called = functions_[callee];
            size = std::min(limit, size + (called.is_kept ? 1 : called.inlined));
        }
        function.is_kept = !function.is_entry && !function.must_inline && function.calls > 1 && size >= kept_size;
        function.inlined = std::max<std::uint64_t>(size, 1);
    }
    std::uint64_t total(std::uint64_t kept_size) {
        for (FunctionSize* const at : callees_first_) find_inlined_size(*at, kept_size);
        std::uint64_t sum = 0;
        for (const std::uint32_t id : order_) {
            const std::uint64_t size = functions_[id].inlined;
            if (functions_[id].is_kept) sum += size;
            if (functions_[id].is_entry) largest_entry_ = std::max(largest_entry_, size);
        }
        return sum + std::exchange(largest_entry_, 0);
    }

    std::unordered_map<std::uint32_t, FunctionSize> functions_;
    std::vector<std::uint32_t> order_;
    std::vector<FunctionSize*> callees_first_;
    bool has_variable_pointers_ = false, has_large_variables_ = false;
    std::uint64_t instructions_ = 0, largest_entry_ = 0, own_instructions_ = 0, own_blocks_ = 0;
};

}  // namespace

Expected<std::vector<std::uint32_t>> legalize(std::span<const std::uint32_t> words,
                                              std::span<const rhi::SpecializationConstant> specialization,
                                              std::string_view name, const LegalizationOptions& options) {
    const std::uint32_t version = words.size() > 1 ? words[1] : 0x10300;
    const spv_target_env environment = version <= 0x10300   ? SPV_ENV_VULKAN_1_1
                                       : version == 0x10400 ? SPV_ENV_VULKAN_1_1_SPIRV_1_4
                                       : version == 0x10500 ? SPV_ENV_VULKAN_1_2
                                                            : SPV_ENV_VULKAN_1_3;
    spvtools::Optimizer optimizer(environment);
    std::string log;
    optimizer.SetMessageConsumer(
        [&](spv_message_level_t level, const char*, const spv_position_t&, const char* message) {
            if (level <= SPV_MSG_ERROR) log += std::string(message) + "\n";
        });
    bool has_specialization = false;
    for (std::size_t at = 5; at < words.size() && (words[at] >> 16); at += words[at] >> 16) {
        const std::uint32_t op = words[at] & 0xffff;
        has_specialization = has_specialization || (op >= 48 && op <= 52);  // OpSpecConstantTrue to OpSpecConstantOp
        if (op == 54) break;                                                // OpFunction
    }
    if (has_specialization) {
        if (!specialization.empty()) {
            std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> values;
            for (const rhi::SpecializationConstant& constant : specialization)
                values[constant.id] = {std::visit(
                    [](auto value) -> std::uint32_t {
                        if constexpr (std::is_same_v<decltype(value), bool>) return value;
                        else return std::bit_cast<std::uint32_t>(value);
                    },
                    constant.value)};
            optimizer.RegisterPass(spvtools::CreateSetSpecConstantDefaultValuePass(values));
        }
        optimizer.RegisterPass(spvtools::CreateFreezeSpecConstantValuePass())
            .RegisterPass(spvtools::CreateFoldSpecConstantOpAndCompositePass());
    }
    const InliningPlan plan(words);
    if (plan.instructions() > most_instructions)
        return fail(ErrorCode::unsupported, "compile shader", fmt::format("'{}'", name),
                    fmt::format("with its calls replaced by what they call the shader has {} instructions",
                                plan.instructions()),
                    "Call functions with barriers less often, or use another backend.");
    std::vector<std::uint32_t> planned(words.begin(), words.end());
    plan.apply(planned, options.inlines_all);
    // Dead branches first: the pass against dead code crashes on unreachable blocks behind a loop without end.
    optimizer.RegisterPass(spvtools::CreateDeadBranchElimPass())
        .RegisterPass(spvtools::CreateEliminateDeadFunctionsPass())
        .RegisterPass(spvtools::CreateInlineExhaustivePass())
        .RegisterPass(spvtools::CreateEliminateDeadFunctionsPass())
        .RegisterPass(spvtools::CreatePrivateToLocalPass());
    const bool rewrites_variables =
        !plan.has_variable_pointers() && !plan.has_large_variables() && !options.keeps_variables;
    if (rewrites_variables)
        optimizer.RegisterPass(spvtools::CreateScalarReplacementPass(100))
            .RegisterPass(spvtools::CreateLocalAccessChainConvertPass())
            // Access chains that nothing uses any more would keep variables from becoming values.
            .RegisterPass(spvtools::CreateAggressiveDCEPass(true))
            .RegisterPass(spvtools::CreateLocalSingleBlockLoadStoreElimPass())
            .RegisterPass(spvtools::CreateLocalSingleStoreElimPass());
    if (rewrites_variables && plan.blocks() <= most_rewritten_blocks)
        optimizer.RegisterPass(spvtools::CreateSSARewritePass());
    optimizer.RegisterPass(spvtools::CreateAggressiveDCEPass(true));
    spvtools::OptimizerOptions optimizer_options;
    optimizer_options.set_run_validator(false);
    std::vector<std::uint32_t> result;
    if (!optimizer.Run(planned.data(), planned.size(), &result, optimizer_options)) {
        // Simpler is better, not needed; only specialization constants must be frozen.
        if (!has_specialization) {
            plan.apply_to_result(planned, options.inlines_all);
            return planned;
        }
        return fail(ErrorCode::shader_compile, "compile shader", fmt::format("'{}'", name),
                    "the module cannot be specialized: " + log, "Check the types of the specialization constants.");
    }
    plan.apply_to_result(result, options.inlines_all);
    return result;
}

}  // namespace nacre::cpu
