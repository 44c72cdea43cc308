// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/source_names.h"

#include <fmt/format.h>

#include <algorithm>

#include "rhi/spirv.h"

namespace nacre::cpu {
namespace {

constexpr std::uint32_t whole = ~0u;

std::uint64_t key_of(Id id, std::uint32_t member) { return (std::uint64_t{id} << 32) | member; }

const std::string& find(const std::unordered_map<std::uint64_t, std::string>& names, std::uint64_t key) {
    static const std::string none;
    const auto found = names.find(key);
    return found == names.end() ? none : found->second;
}

}  // namespace

SourceNames::SourceNames(std::span<const std::uint32_t> words) {
    for (const rhi::spirv::Instruction& at : rhi::spirv::instructions(words)) {
        const auto offset = static_cast<std::uint32_t>(at.offset);
        switch (static_cast<spv::Op>(at.opcode())) {
            case spv::Op::OpName: names_[key_of(at.operand(0), whole)] = at.text(1); break;
            case spv::Op::OpMemberName: names_[key_of(at.operand(0), at.operand(1))] = at.text(2); break;
            case spv::Op::OpString: strings_[at.operand(0)] = at.text(1); break;
            case spv::Op::OpLine: lines_.push_back({offset, at.operand(0), at.operand(1)}); break;
            case spv::Op::OpNoLine:
            case spv::Op::OpFunctionEnd: lines_.push_back({offset, 0, 0}); break;
            default: break;
        }
    }
}

const std::string& SourceNames::name(Id id) const { return find(names_, key_of(id, whole)); }

const std::string& SourceNames::member_name(Id structure, std::uint32_t member) const {
    return find(names_, key_of(structure, member));
}

std::string SourceNames::line(std::uint32_t offset) const {
    const auto behind = std::ranges::upper_bound(lines_, offset, {}, &Line::offset);
    if (behind == lines_.begin() || (behind - 1)->number == 0) return {};
    const auto file = strings_.find((behind - 1)->file);
    return fmt::format("{}:{}", file == strings_.end() ? std::string("line") : file->second, (behind - 1)->number);
}

}  // namespace nacre::cpu
