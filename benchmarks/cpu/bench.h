// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/device.h"

/// @file
/// What the cases of the CPU backend's benchmark share: devices, interleaved rounds, and the report.
///
///     NACRE_CHECK(bench.measure({.name = "copy", .target = 0.6,
///                                .cpu = {{.name = "cpu", .lanes = 16, .run = run_kernel}},
///                                .references = {{.name = "memcpy", .run = run_memcpy}}}));
///
/// The sides of a case take turns, round by round, so that whatever else the machine does befalls all of them alike. A
/// ratio is that of the fastest rounds; that of the medians stands beside it.

namespace nacre::bench {

/// One that does the work of a case. `run` does it once and returns what it took, in milliseconds.
struct Side {
    std::string name;         ///< "cpu", "vulkan", "gl", "memcpy", "intrinsics".
    std::uint32_t lanes = 0;  ///< Of the CPU backend; 0 for references.
    std::function<Expected<double>()> run;
};

struct Case {
    std::string name;         ///< Begins with the kind of case: "base_pass_250k_triangles".
    double target = 0.0;      ///< Ratio that is wanted at 16 lanes; 0: none.
    std::vector<Side> cpu;
    std::vector<Side> references;
};

struct Result {
    std::string name, reference;
    std::uint32_t lanes = 0;
    double cpu_ms = 0.0, reference_ms = 0.0;                ///< Fastest rounds.
    double cpu_median_ms = 0.0, reference_median_ms = 0.0;
    /// Processor time of all threads, user and system, which neighbors on the machine disturb less.
    double cpu_processor_ms = 0.0, reference_processor_ms = 0.0;
    double target = 0.0;
    [[nodiscard]] double ratio() const { return reference_ms / cpu_ms; }
    [[nodiscard]] double ratio_of_medians() const { return reference_median_ms / cpu_median_ms; }
    [[nodiscard]] double ratio_of_processor_time() const { return reference_processor_ms / cpu_processor_ms; }
};

struct Options {
    std::string prefix;           ///< Only cases that begin so.
    std::uint32_t rounds = 9;
    std::uint32_t lanes = 0;      ///< Only this lane count; 0: all.
    bool alone = false;           ///< Without references: for profilers, and to hold two builds against each other.
    bool quick = false;           ///< Few rounds, one lane count, few scenes: whether it runs at all.
    std::string assets;           ///< Folder of scenes; may not exist.
};

class Bench {
  public:
    explicit Bench(Options options);
    ~Bench();

    [[nodiscard]] const Options& options() const { return options_; }
    /// Whether any case whose name begins with `kind` is wanted.
    [[nodiscard]] bool wants(const std::string& kind) const;
    /// Lane counts to measure, the most important first.
    [[nodiscard]] std::vector<std::uint32_t> lane_counts() const;

    /// The device of a backend spec, made at first use and kept. Validation is off.
    Expected<rhi::Device*> device(const std::string& spec);
    /// A device of its own.
    Expected<std::unique_ptr<rhi::Device>> new_device(const std::string& spec) const;
    /// Whether the device of a reference is wanted and can be made; says so once where it cannot.
    bool has_device(const std::string& spec);

    /// Runs all sides in turn, once uncounted and then for all rounds, and keeps the results. A side that fails is
    /// reported and left out; an error is returned where no pair is left. Where the CPU backend is alone its times are
    /// printed, and no results kept.
    Expected<void> measure(Case work);
    /// Says why something was not measured, in the output and in the report.
    void skip(const std::string& name, const std::string& why);

    [[nodiscard]] const std::vector<Result>& results() const { return results_; }
    /// The table, for people.
    [[nodiscard]] std::string table() const;
    /// The same in Markdown, a row for each case, as docs/cpu-performance.md has it.
    [[nodiscard]] std::string markdown() const;
    /// Writes report.json and table.md below the folder. Errors: input_output.
    Expected<void> write_report(const std::string& folder) const;

  private:
    Options options_;
    std::unique_ptr<rhi::Instance> instance_;
    std::map<std::string, std::unique_ptr<rhi::Device>> devices_;
    std::map<std::string, std::string> unavailable_;
    std::vector<Result> results_;
    std::vector<std::pair<std::string, std::string>> skipped_;
    double load_at_start_ = 0.0;
};

/// Milliseconds that `work` takes.
Expected<double> time_ms(const std::function<Expected<void>()>& work);

/// The time from submission to the end of the work of what `record` records; recording is not counted.
Expected<double> time_submission(rhi::Device& device, const std::function<void(rhi::CommandList&)>& record);

/// The spec of the CPU backend with so many lanes: "cpu:lanes=16".
std::string cpu_spec(std::uint32_t lanes);

/// A compute pipeline from GLSL of this folder, with its bind group of set 0.
struct Kernel {
    rhi::ComputePipeline pipeline;
    rhi::BindGroup group;
};
Expected<Kernel> make_kernel(rhi::Device& device, const std::string& path, std::vector<rhi::BindGroupEntry> entries);

/// The size of the picture of all cases that have one.
inline constexpr std::uint32_t picture_width = 1920, picture_height = 1080;

// The cases, one function for each file.
Expected<void> run_lighting(Bench& bench);
Expected<void> run_base_pass(Bench& bench);
Expected<void> run_frame(Bench& bench);
Expected<void> run_mandelbrot(Bench& bench);
Expected<void> run_copy(Bench& bench);
Expected<void> run_compile(Bench& bench);
Expected<void> run_rays(Bench& bench);

}  // namespace nacre::bench
