// SPDX-License-Identifier: Apache-2.0
#include <cstring>
#include <memory>

#include "backends/cpu/scheduler.h"
#include "benchmarks/cpu/bench.h"

/// @file
/// Memory: a kernel that copies 64 MiB, against memcpy split over as many threads.

namespace nacre::bench {
namespace {

constexpr std::uint64_t copied_bytes = 64ull << 20;

struct Copy {
    rhi::Device* device;
    Kernel kernel;

    [[nodiscard]] Expected<double> run() const {
        return time_submission(*device, [&](rhi::CommandList& list) {
            list.set_pipeline(kernel.pipeline);
            list.set_bind_group(0, kernel.group);
            list.dispatch({.x = 65536 / 64, .y = copied_bytes / 16 / 65536});
        });
    }
};

Expected<Copy> make_copy(Bench& bench, const std::string& spec) {
    Copy copy;
    NACRE_TRY(copy.device, bench.device(spec));
    std::vector<std::uint32_t> values(copied_bytes / 4);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::uint32_t>(i * 2654435761u);
    NACRE_TRY(const rhi::Buffer source, copy.device->create_buffer({.size = copied_bytes,
                                                                    .usage = rhi::BufferUsage::storage,
                                                                    .name = "source"}));
    NACRE_CHECK(copy.device->write_buffer(source, std::span<const std::uint32_t>(values)));
    NACRE_TRY(const rhi::Buffer destination, copy.device->create_buffer({.size = copied_bytes,
                                                                         .usage = rhi::BufferUsage::storage,
                                                                         .name = "destination"}));
    NACRE_TRY(copy.kernel, make_kernel(*copy.device, "benchmarks/cpu/copy.comp",
                                       {{.binding = 0, .buffer = source}, {.binding = 1, .buffer = destination}}));
    // Once, to see that it copies.
    NACRE_CHECK(copy.run());
    NACRE_TRY(const auto bytes, copy.device->read_buffer(destination));
    if (std::memcmp(bytes.data(), values.data(), copied_bytes) != 0)
        return fail(ErrorCode::internal, "copy", spec, "the copy differs from the source",
                    "This is a fault of the backend; please report it.");
    return copy;
}

}  // namespace

Expected<void> run_copy(Bench& bench) {
    Case work{.name = "copy", .target = 0.6};
    for (const std::uint32_t lanes : bench.lane_counts()) {
        NACRE_TRY(const Copy copy, make_copy(bench, cpu_spec(lanes)));
        work.cpu.push_back({.name = "cpu", .lanes = lanes, .run = [copy] { return copy.run(); }});
    }
    const std::shared_ptr<cpu::Scheduler> scheduler = cpu::Scheduler::create(0);
    const auto source = std::make_shared<std::vector<std::byte>>(copied_bytes, std::byte{1});
    const auto destination = std::make_shared<std::vector<std::byte>>(copied_bytes, std::byte{2});
    work.references.push_back({.name = "memcpy", .run = [scheduler, source, destination] {
                                   return time_ms([&]() -> Expected<void> {
                                       const std::uint32_t parts = scheduler->thread_count();
                                       scheduler->run(parts, [&](std::uint32_t index, std::uint32_t) {
                                           const std::uint64_t begin = copied_bytes * index / parts;
                                           const std::uint64_t end = copied_bytes * (index + 1) / parts;
                                           std::memcpy(destination->data() + begin, source->data() + begin,
                                                       end - begin);
                                       });
                                       return {};
                                   });
                               }});
    NACRE_CHECK(bench.measure(std::move(work)));

    // For orientation, how the driver copies.
    if (!bench.has_device("vulkan")) return {};
    Case driver{.name = "copy_by_driver"};
    for (const std::uint32_t lanes : bench.lane_counts()) {
        NACRE_TRY(const Copy copy, make_copy(bench, cpu_spec(lanes)));
        driver.cpu.push_back({.name = "cpu", .lanes = lanes, .run = [copy] { return copy.run(); }});
    }
    NACRE_TRY(const Copy copy, make_copy(bench, "vulkan"));
    driver.references.push_back({.name = "vulkan", .run = [copy] { return copy.run(); }});
    return bench.measure(std::move(driver));
}

}  // namespace nacre::bench
