// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "tests/backends/cpu/math/evaluate.h"

// What the functions become on a machine with vectors of 16 lanes.

namespace nacre::cpu {
namespace {

struct Code {
    unsigned instructions = 0;
    bool has_calls = false;
};

Code code_of(const Variant& variant, const std::vector<Kind>& inputs, const Emit& emit) {
    Code code;
    std::istringstream lines(assembly(variant, inputs, emit));
    for (std::string line; std::getline(lines, line);) {
        if (line.size() < 2 || line[0] != '\t' || line[1] == '.' || line[1] == '#') continue;
        if (line.starts_with("\tretq")) continue;
        if (line.starts_with("\tcall") || line.starts_with("\tjmp")) code.has_calls = true;
        ++code.instructions;
    }
    return code;
}

Emit to_int(bool is_signed) {
    return [=](Math& math, Values values) {
        return std::vector<llvm::Value*>{math.float_to_int(values[0], 32, is_signed)};
    };
}

TEST(Code, of_sixteen_lanes_is_short_and_calls_nothing) {
    const struct {
        const char* name;
        Emit emit;
        std::vector<Kind> inputs;
        unsigned
            most;  ///< Instructions without contraction, as counted with LLVM 19.1; a few more are no fault, many are.
    } functions[] = {
        {"sin", call(&Math::sin), {Kind::single}, 29},
        {"cos", call(&Math::cos), {Kind::single}, 32},
        {"tan", call(&Math::tan), {Kind::single}, 37},
        {"asin", call(&Math::asin), {Kind::single}, 22},
        {"acos", call(&Math::acos), {Kind::single}, 27},
        {"atan", call(&Math::atan), {Kind::single}, 27},
        {"atan2", call(&Math::atan2), {Kind::single, Kind::single}, 38},
        {"sinh", call(&Math::sinh), {Kind::single}, 45},
        {"tanh", call(&Math::tanh), {Kind::single}, 49},
        {"exp", call(&Math::exp), {Kind::single}, 30},
        {"exp2", call(&Math::exp2), {Kind::single}, 26},
        {"log", call(&Math::log), {Kind::single}, 44},
        {"log2", call(&Math::log2), {Kind::single}, 38},
        {"pow", call(&Math::pow), {Kind::single, Kind::single}, 67},
        {"inverse_sqrt", call(&Math::inverse_sqrt), {Kind::single}, 3},
        {"float_to_half", call(&Math::float_to_half), {Kind::single}, 16},
        {"half_to_float", call(&Math::half_to_float), {Kind::int32}, 14},
        {"round", call(&Math::round), {Kind::single}, 4},
        {"float_to_int", to_int(true), {Kind::single}, 9},
        {"float_to_uint", to_int(false), {Kind::single}, 6},
        {"s_div", call(&Math::s_div), {Kind::int32, Kind::int32}, 21},
        {"u_mod", call(&Math::u_mod), {Kind::int32, Kind::int32}, 17},
        {"find_u_msb", call(&Math::find_u_msb), {Kind::int32}, 3},
        {"bit_reverse", call(&Math::bit_reverse), {Kind::int32}, 10},
    };
    for (const auto& function : functions) {
        const Code code = code_of({.processor = "x86-64-v4"}, function.inputs, function.emit);
        const Code contracted =
            code_of({.processor = "x86-64-v4", .options = {.contract = true, .half_instructions = true}},
                    function.inputs, function.emit);
        const MathOptions all{.contract = true,
                              .half_instructions = true,
                              .exponent_instructions = true,
                              .conversion_instructions = true};
        const Code shortest = code_of({.processor = "x86-64-v4", .options = all}, function.inputs, function.emit);
        EXPECT_LE(code.instructions, function.most + 3) << function.name;
        EXPECT_LE(contracted.instructions, code.instructions) << function.name;
        EXPECT_LE(shortest.instructions, contracted.instructions) << function.name;
        EXPECT_FALSE(code.has_calls || contracted.has_calls || shortest.has_calls) << function.name;
        std::printf("%s: %u, %u, %u\n", function.name, code.instructions, contracted.instructions,
                    shortest.instructions);
    }
}

}  // namespace
}  // namespace nacre::cpu
