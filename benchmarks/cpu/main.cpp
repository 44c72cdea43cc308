// SPDX-License-Identifier: Apache-2.0
// Holds the CPU backend against Mesa's software drivers, against code written by hand and against memcpy, on the same
// SPIR-V through the same interface:
//
//     cpu_bench [--case PREFIX] [--rounds N] [--lanes N] [--alone] [--quick] [--output FOLDER] [--assets FOLDER]
//
// Prints a table and writes FOLDER/report.json and FOLDER/table.md (out/bench-cpu by default). Ratios are reference
// over CPU backend: above 1 the CPU backend is faster. Targets that are missed are marked and do not fail the run; a
// case that cannot be run does.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdlib>

#include "benchmarks/cpu/bench.h"

namespace {

struct Group {
    const char* name;
    nacre::Expected<void> (*run)(nacre::bench::Bench&);
};

constexpr std::array groups = {
    Group{"lighting", nacre::bench::run_lighting},
    Group{"base_pass", nacre::bench::run_base_pass},
    Group{"mandelbrot", nacre::bench::run_mandelbrot},
    Group{"copy", nacre::bench::run_copy},
    Group{"compile", nacre::bench::run_compile},
    Group{"frame", nacre::bench::run_frame},
    Group{"rays", nacre::bench::run_rays},
};

}  // namespace

int main(int count, char** arguments) {
    nacre::bench::Options options;
    std::string output = "out/bench-cpu";
    const char* named = std::getenv("NACRE_ASSETS");
    options.assets = named && *named ? named : "../shared/assets";

    CLI::App app("Times the CPU backend against Mesa's software drivers.");
    app.add_option("--case", options.prefix, "Only the cases whose name begins so");
    auto* rounds = app.add_option("--rounds", options.rounds, "How often each side runs")->check(CLI::Range(1, 1000));
    app.add_option("--lanes", options.lanes, "Only this lane count")->check(CLI::IsMember({4, 8, 16}));
    app.add_flag("--alone", options.alone, "Without references, for profilers; writes no report");
    app.add_flag("--quick", options.quick, "Few rounds, one lane count, few scenes");
    app.add_option("--output", output, "Folder of report.json");
    app.add_option("--assets", options.assets, "Folder of scenes (NACRE_ASSETS)");
    CLI11_PARSE(app, count, arguments);
    if (options.quick && rounds->empty()) options.rounds = 3;

    // Shaders are compiled anew each time, by both sides; drivers look at this when they are loaded.
    setenv("NACRE_CACHE_DIR", "off", 1);
    setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);
    // Mesa's own choice of filters: the conformant ones, which comparisons of pictures ask for, are slower.
    setenv("GALLIVM_PERF", "", 0);

    nacre::bench::Bench bench(options);
    bool failed = false;
    for (const Group& group : groups) {
        if (!bench.wants(group.name)) continue;
        if (const auto ran = group.run(bench); !ran) {
            fmt::print(stderr, "{}: {}\n", group.name, ran.error().message());
            failed = true;
        }
    }
    if (options.alone) return failed ? 1 : 0;
    fmt::print("{}", bench.table());
    if (const auto written = bench.write_report(output); !written) {
        fmt::print(stderr, "{}\n", written.error().message());
        failed = true;
    }
    fmt::print("{}/report.json\n", output);
    return failed ? 1 : 0;
}
