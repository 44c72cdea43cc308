// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <tuple>
#include <vector>

#include "backends/cpu/checks/check_interface.h"
#include "rhi/validation.h"

/// @file
/// Faults that running shaders were seen to make, as messages: one for each place and kind.

namespace nacre::cpu {

/// One fault, in words. The parts make the text
///     run shader 'a.comp' (a.comp:7), dispatch 1 of list 'frame', invocation (3, 0, 0): expected an index below 4 into
///     buffer 'values' (values), found 9 [N-804 index-range]. Compare ...
struct FoundFault {
    rhi::ShaderFault kind{};
    std::string attempted = "run shader";
    std::string subject;  ///< Where it is; `place` with a command and an invocation.
    std::string reason;   ///< "expected ..., found ...".
    std::uint32_t count = 1;
};

/// Thread-safe.
class FaultLog {
  public:
    explicit FaultLog(std::function<void(const rhi::Message&)> report) : report_(std::move(report)) {}

    /// Takes note of a fault. `key` names its place: of several with one key and kind the first is kept, and the others
    /// are counted. `describe` is called for the first only.
    /// @param stops  the device is given up because of it
    void add(rhi::ShaderFault kind, const void* key, const std::string& object, std::uint32_t count, bool stops,
             const std::function<FoundFault()>& describe);
    /// Gives what was added since the last call as messages, those of the order in which they came.
    void send();
    /// What the first fault says that stops the device; empty: none does.
    [[nodiscard]] std::string stop() const;

  private:
    struct Entry {
        FoundFault fault;
        bool is_sent = false;
    };
    static std::string text_of(const FoundFault& fault);
    const std::function<void(const rhi::Message&)> report_;
    mutable std::mutex mutex_;
    std::vector<Entry> entries_;
    std::size_t stop_ = ~std::size_t{0};  ///< Into entries_.
    std::map<std::tuple<rhi::ShaderFault, const void*, std::string>, std::size_t> known_;
};

}  // namespace nacre::cpu
