// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/device.h"

/// @file
/// Runs any shader on the CPU backend: everything that it declares is bound, and what lies around that is watched.

namespace nacre::hostile {

enum class Outcome : std::uint8_t {
    ran,
    refused,  ///< With an error that says why.
    lost,     ///< The watchdog stopped it; another device was made.
    broken,   ///< A write outside of what was bound, a device that does not work afterwards, or an internal error.
};

class ModuleRunner {
  public:
    /// @param spec  of the backend: "cpu:fast:lanes=4"
    static Expected<std::unique_ptr<ModuleRunner>> create(const std::string& spec);
    ~ModuleRunner();

    /// @param seed  of the sizes of what is bound
    Outcome run(const std::vector<std::uint32_t>& words, rhi::ShaderStage stage, std::uint64_t seed);
    /// What went wrong in the last run, or why it was refused.
    [[nodiscard]] const std::string& reason() const { return reason_; }

  private:
    struct Objects;
    explicit ModuleRunner(std::string spec);
    Expected<void> make_device();
    Expected<void> try_run(const std::vector<std::uint32_t>& words, rhi::ShaderStage stage, std::uint64_t seed);
    /// The known kernel gives its result and nothing has changed that was not bound.
    bool is_sound();

    std::string spec_, reason_;
    std::unique_ptr<Objects> objects_;
};

}  // namespace nacre::hostile
