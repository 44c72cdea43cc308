// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/device.h"
#include "tests/backends/cpu/differential/generated_shader.h"

namespace nacre::differential {

/// What one run of a shader wrote.
struct Output {
    std::vector<std::uint32_t> words;   ///< Of all buffers and images, one behind another.
    std::vector<float> pairs;           ///< Arguments and results of approximate functions; compute shaders only.
    /// Names the place of a word: "result[5][3]".
    [[nodiscard]] static std::string place_of(std::size_t word, Stage stage);
};

/// SPIR-V of a generated text, in which no multiplication and addition may be fused: without that, bits are the
/// device's choice.
/// @param with_lines  with names and line tables
Expected<std::vector<std::uint32_t>> compile(const std::string& text, Stage stage, bool with_lines = false);
/// The same module as passes of SPIRV-Tools leave it: those for performance; or those that change control flow most,
/// which leave single returns, peeled, unswitched and unrolled loops, and branches turned into selections.
enum class Passes : std::uint8_t { performance, control_flow };
std::vector<std::uint32_t> optimized(const std::vector<std::uint32_t>& words, Passes passes);

/// One device, with the inputs that all shaders read.
class DeviceRunner {
  public:
    /// @param spec  of the backend: "cpu:fast:lanes=8"
    static Expected<std::unique_ptr<DeviceRunner>> create(const std::string& spec);
    Expected<Output> run(const std::vector<std::uint32_t>& words, Stage stage);
    /// What the device has said since the last call.
    std::vector<std::string> take_messages();
    ~DeviceRunner();

  private:
    struct Objects;
    explicit DeviceRunner(std::unique_ptr<Objects> objects);
    std::unique_ptr<Objects> objects_;
};

}  // namespace nacre::differential
