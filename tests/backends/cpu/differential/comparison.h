// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/backends/cpu/differential/device_runner.h"

namespace nacre::differential {

/// Runs shaders on several devices and says where they differ. Devices are made when they are needed first.
class Comparison {
  public:
    struct Difference {
        std::string first, second;   ///< Devices; "optimized" or "reshaped" behind one that ran a changed module.
        std::string what;            ///< Place and values, or the error.
    };

    /// Told before each run on a device, so that a crash can be laid at its door.
    std::function<void(const std::string& device)> before_run = [](const std::string&) {};
    /// Compare with Vulkan, too.
    bool has_vulkan = true;
    /// Not empty: only the first and the last of them are compared.
    std::vector<std::string> devices;

    /// What one device writes; "optimized" or "reshaped" may stand behind its name.
    Expected<Output> run(const std::string& device, const std::string& text, Stage stage);
    /// The difference between Vulkan and the CPU device that this seed takes, or between that and another where there
    /// is no Vulkan; nothing where they agree.
    std::optional<Difference> check(const GeneratedShader& shader);
    /// The shortest text that still has the same two devices differ and keeps the lines that give first values.
    std::string reduce(const GeneratedShader& shader, const Difference& difference);

  private:
    std::optional<Difference> compare(const std::string& first, const std::string& second, const std::string& text,
                                      Stage stage);
    std::map<std::string, std::unique_ptr<DeviceRunner>> runners_;
    std::map<std::string, Output> outputs_;  ///< Of the text that is being compared.
    std::string compared_;
};

}  // namespace nacre::differential
