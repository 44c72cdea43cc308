// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/stored_code.h"

#include <concepts>
#include <cstring>
#include <string>
#include <tuple>
#include <type_traits>

namespace nacre::cpu {
namespace {

template <typename Value, typename Structure>
concept Is = std::same_as<std::remove_const_t<Value>, Structure>;

// The members of each structure that are kept, in their order.
auto kept_members(Is<NarrowedOperation> auto& of) { return std::tie(of.line, of.operation); }
auto kept_members(Is<VertexOutput> auto& of) { return std::tie(of.location, of.component, of.slot); }
auto kept_members(Is<FragmentInput> auto& of) { return std::tie(of.location, of.component, of.interpolation); }
auto kept_members(Is<FragmentOutput> auto& of) { return std::tie(of.output, of.components); }
auto kept_members(Is<ComputeFacts> auto& of) {
    return std::tie(of.workgroup_size[0], of.workgroup_size[1], of.workgroup_size[2], of.workgroup_bytes, of.subgroups,
                    of.has_barriers, of.narrowed);
}
auto kept_members(Is<VertexProgram> auto& of) {
    return std::tie(of.output_slots, of.outputs, of.writes_point_size, of.clip_distances, of.cull_distances,
                    of.has_side_effects, of.narrowed);
}
auto kept_members(Is<FragmentProgram> auto& of) {
    return std::tie(of.inputs, of.outputs, of.early_tests, of.discards, of.writes_depth, of.writes_sample_mask,
                    of.has_side_effects, of.runs_per_sample, of.uses_centroid, of.narrowed);
}

template <typename Value>
constexpr bool is_plain = std::is_arithmetic_v<Value> || std::is_enum_v<Value>;
template <typename Value>
constexpr bool is_list = requires(Value list) { list.resize(1); };

template <typename Value>
void write(std::vector<std::byte>& entry, const Value& value) {
    if constexpr (is_plain<Value>) {
        const auto* const bytes = reinterpret_cast<const std::byte*>(&value);
        entry.insert(entry.end(), bytes, bytes + sizeof(value));
    } else if constexpr (is_list<Value>) {
        write(entry, std::uint64_t{value.size()});
        for (const auto& element : value) write(entry, element);
    } else {
        std::apply([&](const auto&... members) { (write(entry, members), ...); }, kept_members(value));
    }
}

/// Takes a value from the front of the rest of an entry.
template <typename Value>
bool read(std::span<const std::byte>& rest, Value& value) {
    if constexpr (std::is_same_v<Value, bool>) {
        std::uint8_t byte = 0;
        if (!read(rest, byte)) return false;
        value = byte != 0;
        return true;
    } else if constexpr (is_plain<Value>) {
        if (rest.size() < sizeof(value)) return false;
        std::memcpy(&value, rest.data(), sizeof(value));
        rest = rest.subspan(sizeof(value));
        return true;
    } else if constexpr (is_list<Value>) {
        std::uint64_t count = 0;
        // Elements take a byte at least.
        if (!read(rest, count) || count > rest.size()) return false;
        value.resize(count);
        for (auto& element : value)
            if (!read(rest, element)) return false;
        return true;
    } else {
        return std::apply([&](auto&... members) { return (read(rest, members) && ...); }, kept_members(value));
    }
}

template <typename Facts>
std::vector<std::byte> made_of(const Facts& facts, const StoredCode& code) {
    std::vector<std::byte> entry;
    write(entry, facts);
    write(entry, code.stack_bytes);
    entry.insert(entry.end(), code.object.begin(), code.object.end());
    return entry;
}

template <typename Facts>
bool taken_from(std::span<const std::byte> entry, Facts& facts, StoredCode& code) {
    Facts read_facts;
    if (!read(entry, read_facts) || !read(entry, code.stack_bytes)) return false;
    facts = std::move(read_facts);
    code.object.assign(entry.begin(), entry.end());
    return true;
}

}  // namespace

std::vector<std::byte> to_entry(const ComputeFacts& facts, const StoredCode& code) { return made_of(facts, code); }
std::vector<std::byte> to_entry(const VertexProgram& facts, const StoredCode& code) { return made_of(facts, code); }
std::vector<std::byte> to_entry(const FragmentProgram& facts, const StoredCode& code) { return made_of(facts, code); }

bool from_entry(std::span<const std::byte> entry, ComputeFacts& facts, StoredCode& code) {
    return taken_from(entry, facts, code);
}
bool from_entry(std::span<const std::byte> entry, VertexProgram& facts, StoredCode& code) {
    return taken_from(entry, facts, code);
}
bool from_entry(std::span<const std::byte> entry, FragmentProgram& facts, StoredCode& code) {
    return taken_from(entry, facts, code);
}

}  // namespace nacre::cpu
