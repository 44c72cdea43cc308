// SPDX-License-Identifier: Apache-2.0
#include "rhi/validation.h"

#include <array>

#include "rhi/validation_rules.h"

namespace nacre::rhi {
namespace {

constexpr ValidationRule rules[] = {
#define NACRE_RULE_ENTRY(number, enumerator, name, meaning) {"N-" #number " " name, meaning},
    NACRE_VALIDATION_RULES(NACRE_RULE_ENTRY)
#undef NACRE_RULE_ENTRY
};

constexpr ValidationRule faults[] = {
    {"N-801 not-a-number", "An operation on numbers has given none (NaN)."},
    {"N-802 infinity", "An operation on finite numbers has given an infinite one."},
    {"N-803 division-by-zero", "A number is divided by zero."},
    {"N-804 index-range", "An index or a coordinate lies outside of what it reaches into."},
    {"N-805 uninitialized-read", "Something is read that nothing has written, and the result depends on it."},
    {"N-806 data-race",
     "Two invocations use one place in memory, at least one writes it, and no barrier stands between."},
    {"N-807 nonuniform-derivative", "A derivative is taken where some pixels of a quad do not run."},
    {"N-820 host-access", "The host uses the memory of a buffer while submitted work may use it too."},
    {"N-821 unstated-access",
     "A pass uses a resource in a way that its statement does not name, so nothing makes it wait for others."},
};

}  // namespace

std::span<const ValidationRule> shader_faults() { return faults; }

std::string_view code_of(ShaderFault fault) {
    const std::string number = std::to_string(static_cast<unsigned>(fault));
    for (const ValidationRule& known : faults)
        if (known.code.substr(2, 3) == number) return known.code;
    return "N-800 unknown";
}

std::span<const ValidationRule> validation_rules() { return rules; }

std::string_view code_of(Rule rule) {
    switch (rule) {
#define NACRE_RULE_CASE(number, enumerator, name, meaning) \
    case Rule::enumerator: return "N-" #number " " name;
        NACRE_VALIDATION_RULES(NACRE_RULE_CASE)
#undef NACRE_RULE_CASE
    }
    return "N-000 unknown";
}

}  // namespace nacre::rhi
