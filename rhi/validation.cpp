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

}  // namespace

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
