// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/cpu_backend.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "backends/cpu/device.h"

namespace nacre::cpu {
namespace {

constexpr std::array<rhi::Backend::Mode, 4> all_modes{{
    {"", "as fast"},
    {"fast", "multiplications and additions are fused where that helps"},
    {"consistent", "results do not depend on lanes or threads"},
    {"double", "the reference: every float is a double, in registers and in memory"},
}};

constexpr std::array<rhi::Backend::Mode, 3> all_checks{{
    {"traps", "the first number that is none or infinite, division by zero or index out of range stops the device"},
    {"sanitize", "uninitialized reads, indices out of range, data races, divided quads and births of NaN are reported"},
    {"hostile", "undefined contents are poison, orders are the worst allowed; hostile=N for another order"},
}};

constexpr std::uint32_t most_threads = 1024;

class CpuBackend : public rhi::Backend {
  public:
    [[nodiscard]] std::string_view name() const override { return "cpu"; }
    [[nodiscard]] std::span<const Mode> modes() const override { return all_modes; }
    [[nodiscard]] std::span<const Mode> checks() const override { return all_checks; }
    [[nodiscard]] bool accepts_lanes() const override { return true; }
    [[nodiscard]] bool accepts_threads() const override { return true; }

    Expected<std::vector<rhi::AdapterInfo>> adapters() override { return std::vector{describe_machine()}; }

    Expected<std::unique_ptr<rhi::BackendDevice>> create_device(const rhi::BackendDeviceDesc& desc) override {
        const rhi::BackendSpec& spec = desc.spec;
        const auto refuse = [&](ErrorCode code, std::string reason, std::string remedy) {
            return fail(code, "create device", fmt::format("'{}'", spec.text()), std::move(reason), std::move(remedy));
        };
        if (desc.desc->adapter != 0)
            return refuse(ErrorCode::not_found,
                          fmt::format("expected adapter 0, the only one of this backend, found {}", desc.desc->adapter),
                          "Leave DeviceDesc::adapter at 0.");
        if (spec.lanes != 0 && spec.lanes != 4 && spec.lanes != 8 && spec.lanes != 16)
            return refuse(ErrorCode::invalid_argument, fmt::format("expected 4, 8 or 16 lanes, found {}", spec.lanes),
                          "Leave lanes out for what this processor runs well.");
        if (spec.threads > most_threads)
            return refuse(ErrorCode::invalid_argument,
                          fmt::format("expected at most {} threads, found {}", most_threads, spec.threads),
                          "Leave threads out for one on each core.");
        DeviceOptions options;
        options.mode = spec.mode == "consistent" ? ExecutionMode::consistent
                       : spec.mode == "double"   ? ExecutionMode::double_precision
                                                 : ExecutionMode::fast;
        options.lanes = spec.lanes != 0 ? spec.lanes : native_lanes();
        options.threads = spec.threads;
        const auto looks_for = [&](std::string_view check) {
            return std::ranges::find(spec.checks, check) != spec.checks.end();
        };
        options.checks = (looks_for("traps") ? check_traps : 0u) | (looks_for("sanitize") ? check_sanitize : 0u) |
                         (looks_for("hostile") ? check_hostile : 0u);
        options.seed = spec.seed;
        return CpuDevice::create(options, desc);
    }
};

}  // namespace

std::unique_ptr<rhi::Backend> make_backend() { return std::make_unique<CpuBackend>(); }

}  // namespace nacre::cpu
