// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/legalization.h"

#include <bit>
#include <unordered_map>

#include <fmt/format.h>
#include <spirv-tools/optimizer.hpp>

namespace nacre::cpu {

Expected<std::vector<std::uint32_t>> legalize(std::span<const std::uint32_t> words,
                                              std::span<const rhi::SpecializationConstant> specialization, std::string_view name,
                                              bool keeps_variables) {
    const std::uint32_t version = words.size() > 1 ? words[1] : 0x10300;
    const spv_target_env environment = version <= 0x10300   ? SPV_ENV_VULKAN_1_1
                                       : version == 0x10400 ? SPV_ENV_VULKAN_1_1_SPIRV_1_4
                                       : version == 0x10500 ? SPV_ENV_VULKAN_1_2
                                                            : SPV_ENV_VULKAN_1_3;
    spvtools::Optimizer optimizer(environment);
    std::string log;
    optimizer.SetMessageConsumer([&](spv_message_level_t level, const char*, const spv_position_t&, const char* message) {
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
    optimizer.RegisterPass(spvtools::CreateEliminateDeadFunctionsPass())
        .RegisterPass(spvtools::CreatePrivateToLocalPass())
        .RegisterPass(spvtools::CreateInlineExhaustivePass())
        .RegisterPass(spvtools::CreateEliminateDeadFunctionsPass());
    if (!keeps_variables)
        optimizer.RegisterPass(spvtools::CreateScalarReplacementPass(100))
            .RegisterPass(spvtools::CreateLocalAccessChainConvertPass())
            // Access chains that nothing uses any more would keep variables from becoming values.
            .RegisterPass(spvtools::CreateAggressiveDCEPass(true))
            .RegisterPass(spvtools::CreateLocalSingleBlockLoadStoreElimPass())
            .RegisterPass(spvtools::CreateLocalSingleStoreElimPass())
            .RegisterPass(spvtools::CreateSSARewritePass());
    optimizer.RegisterPass(spvtools::CreateAggressiveDCEPass(true));
    spvtools::OptimizerOptions options;
    options.set_run_validator(false);
    std::vector<std::uint32_t> result;
    if (!optimizer.Run(words.data(), words.size(), &result, options)) {
        // Simpler is better, not needed; only specialization constants must be frozen.
        if (!has_specialization) return std::vector<std::uint32_t>(words.begin(), words.end());
        return fail(ErrorCode::shader_compile, "compile shader", fmt::format("'{}'", name), "the module cannot be specialized: " + log,
                    "Check the types of the specialization constants.");
    }
    return result;
}

}  // namespace nacre::cpu
