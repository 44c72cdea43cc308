// SPDX-License-Identifier: Apache-2.0
#include "benchmarks/cpu/bench.h"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/file.h"
#include "measure/frame_times.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::bench {

/// GLSL of this folder.
std::span<const EmbeddedFile> embedded_files();

namespace {

using Json = nlohmann::ordered_json;

double load_average() {
    double loads[1] = {};
    return getloadavg(loads, 1) == 1 ? loads[0] : 0.0;
}

/// Processor time of all threads of this process.
double processor_ms() {
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) * 1e3 + static_cast<double>(time.tv_nsec) * 1e-6;
}

}  // namespace

Bench::Bench(Options options)
    : options_(std::move(options)),
      instance_(std::make_unique<rhi::Instance>(all_backends())),
      load_at_start_(load_average()) {}
Bench::~Bench() = default;

bool Bench::wants(const std::string& kind) const {
    // The prefix may be longer than the kind ("frame_ToyCar") or shorter ("base").
    return kind.starts_with(options_.prefix) || options_.prefix.starts_with(kind);
}

std::vector<std::uint32_t> Bench::lane_counts() const {
    if (options_.lanes != 0) return {options_.lanes};
    return options_.quick ? std::vector<std::uint32_t>{16} : std::vector<std::uint32_t>{16, 8};
}

Expected<std::unique_ptr<rhi::Device>> Bench::new_device(const std::string& spec) const {
    return instance_->create_device({.backend = spec, .validation = false, .debug_names = false, .name = spec});
}

Expected<rhi::Device*> Bench::device(const std::string& spec) {
    if (const auto found = devices_.find(spec); found != devices_.end()) return found->second.get();
    NACRE_TRY(auto made, new_device(spec));
    return devices_.emplace(spec, std::move(made)).first->second.get();
}

bool Bench::has_device(const std::string& spec) {
    if (options_.alone || unavailable_.contains(spec)) return false;
    const auto made = device(spec);
    if (made) return true;
    unavailable_[spec] = made.error().message();
    skip(spec, made.error().message());
    return false;
}

void Bench::skip(const std::string& name, const std::string& why) {
    fmt::print("skipped {}: {}\n", name, why);
    std::fflush(stdout);
    skipped_.emplace_back(name, why);
}

Expected<void> Bench::measure(Case work) {
    if (options_.alone) work.references.clear();
    if (!work.name.starts_with(options_.prefix) || work.cpu.empty() || (work.references.empty() && !options_.alone))
        return {};
    struct Measured {
        Side* side;
        std::vector<double> times, processor_times;
    };
    // Every run on the CPU backend has a reference beside it: cpu, reference, cpu of fewer lanes, reference, ...
    std::vector<Measured> measured;
    for (std::size_t i = 0; i < std::max(work.cpu.size(), work.references.size()); ++i) {
        if (i < work.cpu.size()) measured.push_back({&work.cpu[i], {}, {}});
        if (i < work.references.size()) measured.push_back({&work.references[i], {}, {}});
    }
    std::string failure;
    for (std::uint32_t round = 0; round <= options_.rounds; ++round) {
        for (auto at = measured.begin(); at != measured.end();) {
            const double processor_begin = processor_ms();
            const auto ms = at->side->run();
            const double used_ms = processor_ms() - processor_begin;
            if (!ms) {
                failure = ms.error().message();
                skip(fmt::format("{} on {}", work.name, at->side->name), failure);
                at = measured.erase(at);
                continue;
            }
            // The first round pays for what is made at first use.
            if (round > 0) at->times.push_back(*ms), at->processor_times.push_back(used_ms);
            ++at;
        }
    }
    bool any = false;
    for (const Measured& cpu : measured) {
        if (cpu.side->lanes == 0) continue;
        if (options_.alone) {
            any = true;
            fmt::print(
                "{:<38} {:>2} lanes {:>9.2f} ms, median {:>9.2f} ms, processor time {:>9.2f} ms, median {:>9.2f} ms\n",
                work.name, cpu.side->lanes, std::ranges::min(cpu.times), measure::median(cpu.times),
                std::ranges::min(cpu.processor_times), measure::median(cpu.processor_times));
            continue;
        }
        for (const Measured& reference : measured) {
            if (reference.side->lanes != 0) continue;
            any = true;
            results_.push_back({.name = work.name,
                                .reference = reference.side->name,
                                .lanes = cpu.side->lanes,
                                .cpu_ms = std::ranges::min(cpu.times),
                                .reference_ms = std::ranges::min(reference.times),
                                .cpu_median_ms = measure::median(cpu.times),
                                .reference_median_ms = measure::median(reference.times),
                                .cpu_processor_ms = measure::median(cpu.processor_times),
                                .reference_processor_ms = measure::median(reference.processor_times),
                                .target = cpu.side->lanes == 16 ? work.target : 0.0});
            const Result& result = results_.back();
            fmt::print("{:<38} {:>2} lanes {:>9.2f} ms, {:<10} {:>9.2f} ms, ratio {:.2f}, of processor time {:.2f}\n",
                       result.name, result.lanes, result.cpu_ms, result.reference, result.reference_ms, result.ratio(),
                       result.ratio_of_processor_time());
            std::fflush(stdout);
        }
    }
    if (any) return {};
    return fail(ErrorCode::internal, "measure", fmt::format("'{}'", work.name), failure,
                "See the messages above for the side that failed.");
}

std::string Bench::table() const {
    std::string text = fmt::format("\n{:<38} {:>5} {:>10} {:<10} {:>10} {:>7} {:>8} {:>11} {:>7}\n", "case", "lanes",
                                   "cpu ms", "reference", "ms", "ratio", "(median)", "(processor)", "target");
    for (const Result& result : results_) {
        text += fmt::format("{:<38} {:>5} {:>10.2f} {:<10} {:>10.2f} {:>7.2f} {:>8.2f} {:>11.2f} {:>7}{}\n",
                            result.name, result.lanes, result.cpu_ms, result.reference, result.reference_ms,
                            result.ratio(), result.ratio_of_medians(), result.ratio_of_processor_time(),
                            result.target > 0 ? fmt::format("{:.2f}", result.target) : "",
                            result.target > result.ratio() ? "  missed" : "");
    }
    for (const auto& [name, why] : skipped_) text += fmt::format("{}: skipped, {}\n", name, why);
    return text;
}

std::string Bench::markdown() const {
    struct Row {
        std::string name, ours, references, ratios, processor_ratios, of_fewer_lanes;
        double target = 0.0;
    };
    std::vector<Row> rows;
    for (const Result& result : results_) {
        if (rows.empty() || rows.back().name != result.name) rows.push_back({.name = result.name});
        Row& row = rows.back();
        const auto add = [](std::string& cell, const char* separator, const std::string& text) {
            cell += (cell.empty() ? "" : separator) + text;
        };
        if (result.lanes != lane_counts().front()) {
            add(row.of_fewer_lanes, " / ", fmt::format("{:.2f}", result.ratio()));
            continue;
        }
        row.ours = fmt::format("{:.1f} ms", result.cpu_ms);
        const std::string reference = result.reference == "vulkan" ? "lavapipe"
                                      : result.reference == "gl"   ? "llvmpipe"
                                                                   : result.reference;
        add(row.references, ", ", fmt::format("{} {:.0f} ms", reference, result.reference_ms));
        add(row.ratios, " / ", fmt::format("{:.2f}", result.ratio()));
        add(row.processor_ratios, " / ", fmt::format("{:.2f}", result.ratio_of_processor_time()));
        row.target = result.target;
    }
    std::string text = fmt::format(
        "| case | {} lanes | reference | ratio | of processor time | ratio, fewer lanes | target |\n"
        "|---|---|---|---|---|---|---|\n",
        lane_counts().front());
    for (const Row& row : rows)
        text += fmt::format("| {} | {} | {} | {} | {} | {} | {} |\n", row.name, row.ours, row.references, row.ratios,
                            row.processor_ratios, row.of_fewer_lanes,
                            row.target > 0.0 ? fmt::format("{:g}", row.target) : "");
    return text;
}

Expected<void> Bench::write_report(const std::string& folder) const {
    Json cases = Json::array();
    for (const Result& result : results_) {
        Json entry{{"name", result.name},
                   {"cpu_ms", result.cpu_ms},
                   {"reference", result.reference},
                   {"reference_ms", result.reference_ms},
                   {"ratio", result.ratio()},
                   {"lanes", result.lanes},
                   {"cpu_median_ms", result.cpu_median_ms},
                   {"reference_median_ms", result.reference_median_ms},
                   {"ratio_of_medians", result.ratio_of_medians()},
                   {"cpu_processor_ms", result.cpu_processor_ms},
                   {"reference_processor_ms", result.reference_processor_ms},
                   {"ratio_of_processor_time", result.ratio_of_processor_time()}};
        if (result.target > 0) {
            entry["target"] = result.target;
            entry["reached"] = result.ratio() >= result.target;
        }
        cases.push_back(std::move(entry));
    }
    Json skipped = Json::array();
    for (const auto& [name, why] : skipped_) skipped.push_back({{"name", name}, {"reason", why}});
    Json adapters = Json::object();
    for (const auto& [spec, made] : devices_) adapters[spec] = made->adapter().name + ", " + made->adapter().driver;
    const Json report{{"cases", std::move(cases)},
                      {"skipped", std::move(skipped)},
                      {"rounds", options_.rounds},
                      {"threads", std::thread::hardware_concurrency()},
                      {"load_average", {{"start", load_at_start_}, {"end", load_average()}}},
                      {"devices", std::move(adapters)}};
    std::error_code problem;
    std::filesystem::create_directories(folder, problem);
    NACRE_CHECK(write_file_atomically(folder + "/table.md", markdown()));
    return write_file_atomically(folder + "/report.json",
                                 report.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

Expected<double> time_ms(const std::function<Expected<void>()>& work) {
    const auto begin = std::chrono::steady_clock::now();
    NACRE_CHECK(work());
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

Expected<double> time_submission(rhi::Device& device, const std::function<void(rhi::CommandList&)>& record) {
    rhi::CommandList list = device.create_command_list("measured");
    record(list);
    NACRE_CHECK(list.status());
    return time_ms([&]() -> Expected<void> {
        NACRE_TRY(const rhi::Fence fence, device.submit(std::move(list)));
        return device.wait(fence);
    });
}

std::string cpu_spec(std::uint32_t lanes) { return fmt::format("cpu:lanes={}", lanes); }

Expected<Kernel> make_kernel(rhi::Device& device, const std::string& path, std::vector<rhi::BindGroupEntry> entries) {
    rhi::ShaderCompiler compiler({.embedded = {embedded_files()}});
    NACRE_TRY(const rhi::ShaderDesc desc, compiler.compile({.path = path}));
    NACRE_TRY(const rhi::Shader shader, device.create_shader(desc));
    Kernel kernel;
    NACRE_TRY(kernel.pipeline, device.create_compute_pipeline({.shader = shader, .name = path}));
    NACRE_TRY(const rhi::BindGroupLayout layout, device.bind_group_layout(kernel.pipeline, 0));
    NACRE_TRY(kernel.group,
              device.create_bind_group({.layout = layout, .entries = std::move(entries), .name = path}));
    return kernel;
}

}  // namespace nacre::bench
