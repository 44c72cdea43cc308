// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/checks/fault_log.h"

#include <fmt/format.h>

#include "core/error.h"

namespace nacre::cpu {
namespace {

const char* remedy_of(rhi::ShaderFault kind) {
    using enum rhi::ShaderFault;
    switch (kind) {
        case not_a_number: return "Keep the operands where the operation is defined.";
        case infinity: return "Keep the operands so small that the result can be represented.";
        case division_by_zero: return "Compare the divisor with zero before.";
        case index_range: return "Compare the index with the number of elements before.";
        case uninitialized_read: return "Write it before it is read.";
        case data_race: return "Use an atomic operation, a barrier, or a place for each invocation.";
        case nonuniform_derivative:
            return "Take derivatives, and sample with an implicit level of detail, where all pixels go.";
        case host_access: return "Wait for the work before, or use another buffer.";
        case unstated_access: return "Add the use to the statement of the pass.";
    }
    return "";
}

}  // namespace

void FaultLog::add(rhi::ShaderFault kind, const void* key, const std::string& object, std::uint32_t count, bool stops,
                   const std::function<FoundFault()>& describe) {
    const std::scoped_lock lock(mutex_);
    // Whatever follows may be its consequence.
    if (stop_ != ~std::size_t{0} && !known_.contains({kind, key, object})) return;
    const auto [at, is_new] = known_.try_emplace({kind, key, object}, entries_.size());
    if (!is_new) {
        entries_[at->second].fault.count += count;
        return;
    }
    FoundFault fault = describe();
    fault.kind = kind;
    fault.count = count;
    if (stops && stop_ == ~std::size_t{0}) stop_ = entries_.size();
    entries_.push_back({std::move(fault)});
}

std::string FaultLog::text_of(const FoundFault& fault) {
    std::string reason = fault.reason;
    if (fault.count > 1) reason += fmt::format(" (and {} more here)", fault.count - 1);
    return Error{ErrorCode::validation, fault.attempted, fault.subject,
                 fmt::format("{} [{}].", reason, rhi::code_of(fault.kind)), remedy_of(fault.kind)}
        .message();
}

void FaultLog::send() {
    std::vector<rhi::Message> messages;
    {
        const std::scoped_lock lock(mutex_);
        for (Entry& entry : entries_) {
            if (entry.is_sent) continue;
            entry.is_sent = true;
            messages.push_back({.severity = rhi::MessageSeverity::error,
                                .source = rhi::MessageSource::shader,
                                .code = std::string(rhi::code_of(entry.fault.kind)),
                                .text = text_of(entry.fault)});
        }
    }
    // Not under the lock: who is told may take his time.
    for (const rhi::Message& message : messages) report_(message);
}

std::string FaultLog::stop() const {
    const std::scoped_lock lock(mutex_);
    return stop_ < entries_.size() ? text_of(entries_[stop_].fault) : std::string();
}

}  // namespace nacre::cpu
