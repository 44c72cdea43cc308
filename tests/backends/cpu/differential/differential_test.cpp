// SPDX-License-Identifier: Apache-2.0
// Random shaders on the CPU backend, with several lane widths, and on Vulkan: their outputs must be equal.
//
//     cpu_differential_test                                        300 shaders with fixed seeds
//     cpu_differential_test --seed=1000 --count=10000 --folder=/tmp/found
//     cpu_differential_test --seed=1234 --print                    the text of one shader
//     cpu_differential_test --seed=1234 --try=changed.glsl         a text of that seed's stage on several devices
//     cpu_differential_test --seed=1234 --on="cpu:double,gl" --try=changed.glsl
//     cpu_differential_test --on="cpu,gl" --count=1000             two devices, whatever the seed
//
// "optimized" and "reshaped" behind a device let it run the module that passes of SPIRV-Tools leave. Those that reshape
// loops change what some shaders do: only two devices that both run what is left of them can be compared.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "samples/backends.h"
#include "tests/backends/cpu/differential/comparison.h"
#include "tests/core/arguments.h"

namespace nacre::differential {
namespace {

struct Settings {
    std::uint64_t seed = 1;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    std::uint64_t count = 60;
#else
    std::uint64_t count = 300;  ///< What one core does in three quarters of a minute.
#endif
    int workers = 2;
    std::string folder;   ///< Where shaders go that differ; empty: the test's temporary folder.
    bool reduces = true;
    std::vector<std::string> devices;  ///< Empty: the usual ones.
} settings;

constexpr int most_seconds = 120;  ///< For one shader with its reduction.

/// A process of its own that goes through seeds and says in lines what it does: a driver that crashes takes only it
/// down.
struct Worker {
    pid_t process = -1;
    int lines = -1;
    std::string pending;
    std::uint64_t next = 0, stride = 1, end = 0;
    std::uint64_t seed = 0;          ///< That is being tried.
    std::string device = "none";
    std::chrono::steady_clock::time_point since;
};

void say(int to, const std::string& text) {
    const std::string whole = text + "\n";
    if (write(to, whole.data(), whole.size()) < 0) _exit(3);
}

[[noreturn]] void work(std::uint64_t first, std::uint64_t end, std::uint64_t stride, int to, bool has_vulkan) {
    Comparison comparison;
    comparison.has_vulkan = has_vulkan;
    comparison.devices = settings.devices;
    comparison.before_run = [&](const std::string& device) { say(to, "device " + device); };
    for (std::uint64_t seed = first; seed < end; seed += stride) {
        say(to, fmt::format("seed {}", seed));
        const GeneratedShader shader = generate(seed);
        const auto found = comparison.check(shader);
        if (!found) continue;
        const std::string base = fmt::format("{}/{}", settings.folder, seed);
        std::ofstream(base + ".glsl") << shader.text;
        std::ofstream(base + ".txt") << fmt::format("seed {}\n{} and {}\n{}\n", seed, found->first, found->second,
                                                    found->what);
        say(to, fmt::format("differs {} and {}: {}", found->first, found->second,
                            found->what.substr(0, found->what.find('\n', 120))));
        if (settings.reduces && found->what.find("shader_compile") == std::string::npos)
            std::ofstream(base + ".reduced.glsl") << comparison.reduce(shader, *found);
    }
    say(to, "end");
    // Without destructors: what they would find does not matter here.
    _exit(0);
}

void launch(Worker& worker, bool has_vulkan) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) std::abort();
    std::cout.flush();
    worker.process = fork();
    if (worker.process == 0) {
        close(ends[0]);
        work(worker.next, worker.end, worker.stride, ends[1], has_vulkan);
    }
    close(ends[1]);
    worker.lines = ends[0];
    worker.pending.clear();
    worker.since = std::chrono::steady_clock::now();
}

bool has_vulkan_device() {
    // In a process of its own: no driver is loaded here.
    constexpr int absent = 1, broken = 2;
    const pid_t process = fork();
    if (process == 0) {
        const auto runner = DeviceRunner::create("vulkan");
        _exit(runner ? 0 : runner.error().code == ErrorCode::not_found ? absent : broken);
    }
    int status = 0;
    waitpid(process, &status, 0);
    const bool is_known = WIFEXITED(status) && (WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == absent);
    EXPECT_TRUE(is_known) << "there is a Vulkan driver, but no device can be made";
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

struct Tally {
    std::uint64_t shaders = 0;
    std::vector<std::string> differences;
    std::vector<std::string>
        failures_of_others;  ///< Crashes and hangs of other drivers and of SPIRV-Tools' passes: no verdict.
};

Tally run_all(bool has_vulkan) {
    Tally tally;
    std::vector<Worker> workers(static_cast<std::size_t>(settings.workers));
    for (std::size_t i = 0; i < workers.size(); ++i) {
        workers[i].next = settings.seed + i, workers[i].stride = workers.size(),
        workers[i].end = settings.seed + settings.count;
        launch(workers[i], has_vulkan);
    }
    const auto finish = [&](Worker& worker, const std::string& how) {
        close(worker.lines);
        int status = 0;
        waitpid(worker.process, &status, 0);
        worker.process = -1;
        if (how.empty()) return;
        std::string text = fmt::format("seed {}: {} on {}", worker.seed, how, worker.device);
        std::cout << text << std::endl;
        std::ofstream(fmt::format("{}/{}.txt", settings.folder, worker.seed)) << text << "\n";
        std::ofstream(fmt::format("{}/{}.glsl", settings.folder, worker.seed)) << generate(worker.seed).text;
        const bool has_no_verdict =
            worker.device.starts_with("vulkan") || worker.device.starts_with("gl") || worker.device == "SPIRV-Tools";
        (has_no_verdict ? tally.failures_of_others : tally.differences).push_back(text);
        worker.next = worker.seed + worker.stride;
        if (worker.next < worker.end) launch(worker, has_vulkan);
    };
    for (;;) {
        std::vector<pollfd> polled;
        std::vector<Worker*> owners;
        for (Worker& worker : workers)
            if (worker.process > 0) polled.push_back({worker.lines, POLLIN, 0}), owners.push_back(&worker);
        if (polled.empty()) return tally;
        poll(polled.data(), polled.size(), 1000);
        for (std::size_t i = 0; i < polled.size(); ++i) {
            Worker& worker = *owners[i];
            if (std::chrono::steady_clock::now() - worker.since > std::chrono::seconds(most_seconds)) {
                kill(worker.process, SIGKILL);
                finish(worker, "hang");
                continue;
            }
            if (!polled[i].revents) continue;
            char bytes[4096];
            const ssize_t got = read(worker.lines, bytes, sizeof(bytes));
            if (got <= 0) {
                finish(worker, "crash");
                continue;
            }
            worker.pending.append(bytes, static_cast<std::size_t>(got));
            bool ended = false;
            for (std::size_t end; (end = worker.pending.find('\n')) != std::string::npos;
                 worker.pending.erase(0, end + 1)) {
                const std::string text = worker.pending.substr(0, end);
                if (text.starts_with("seed ")) {
                    worker.seed = std::strtoull(text.c_str() + 5, nullptr, 10);
                    worker.device = "none", worker.since = std::chrono::steady_clock::now();
                    if (++tally.shaders % 100 == 0) std::cout << tally.shaders << " shaders" << std::endl;
                } else if (text.starts_with("device ")) {
                    worker.device = text.substr(7);
                } else if (text.starts_with("differs ")) {
                    tally.differences.push_back(fmt::format("seed {}: {}", worker.seed, text.substr(8)));
                    std::cout << tally.differences.back() << std::endl;
                } else if (text == "end") {
                    ended = true;
                }
            }
            if (ended) finish(worker, "");
        }
    }
}

/// Nothing is kept on disk; the reference filters as Vulkan asks, and compiles in half the time: without LLVM's passes
/// and for vectors of 128 bits, with which its results have the same bits.
void set_environment() {
    setenv("NACRE_CACHE_DIR", "off", 1);
    setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);
    setenv("GALLIVM_PERF", "no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx,nopt", 0);
    setenv("LP_NATIVE_VECTOR_WIDTH", "128", 0);
}

TEST(CpuDifferential, RandomShadersGiveEqualResults) {
    if (settings.folder.empty()) settings.folder = fmt::format("{}/differential", testing::TempDir());
    std::filesystem::create_directories(settings.folder);
    const bool has_vulkan = has_vulkan_device();
    if (!has_vulkan) std::cout << "no Vulkan device: lane widths are compared with each other only" << std::endl;
    const Tally tally = run_all(has_vulkan);
    std::cout << fmt::format("{} shaders, {} differences, {} failures of others", tally.shaders,
                             tally.differences.size(), tally.failures_of_others.size())
              << std::endl;
    EXPECT_EQ(tally.shaders, settings.count);
    for (const std::string& text : tally.differences) ADD_FAILURE() << text << "\nThe shader is in " << settings.folder;
    // The reference may fail now and then, not as a rule.
    EXPECT_LE(tally.failures_of_others.size(), 1 + settings.count / 100);
}

}  // namespace
}  // namespace nacre::differential

int main(int argc, char** argv) {
    using nacre::differential::settings;
    testing::InitGoogleTest(&argc, argv);
    nacre::differential::set_environment();
    if (const char* text = std::getenv("NACRE_DIFFERENTIAL_SEED")) settings.seed = std::strtoull(text, nullptr, 10);
    if (const char* text = std::getenv("NACRE_DIFFERENTIAL_COUNT")) settings.count = std::strtoull(text, nullptr, 10);
    for (int i = 1; i < argc; ++i) {
        const std::string text = argv[i];
        const auto value = [&](const char* name) { return nacre::test::value_of(text, name); };
        if (nacre::test::read_number(text, "seed", settings.seed)) continue;
        if (nacre::test::read_number(text, "count", settings.count)) continue;
        if (const auto workers = value("workers")) settings.workers = std::max(1, std::atoi(workers->c_str()));
        else if (const auto folder = value("folder")) settings.folder = *folder;
        else if (const auto devices = value("on")) {
            std::istringstream list(*devices);
            for (std::string device; std::getline(list, device, ',');) settings.devices.push_back(device);
        }
        else if (text == "--no-reduction") settings.reduces = false;
        else if (text == "--print") {
            std::cout << nacre::differential::generate(settings.seed).text;
            return 0;
        } else if (const auto path = value("try")) {
            // One text on all devices, its stage told by the seed: the first words of what each writes.
            const auto shader = nacre::differential::generate(settings.seed);
            std::ifstream file(*path);
            const std::string changed(std::istreambuf_iterator<char>(file), {});
            nacre::differential::Comparison comparison;
            if (settings.devices.empty())
                settings.devices = {"cpu:consistent",
                                    "cpu:consistent optimized",
                                    "cpu:consistent reshaped",
                                    "cpu:fast:lanes=8",
                                    "cpu:fast:lanes=4",
                                    "vulkan",
                                    "gl"};
            for (const std::string& device : settings.devices) {
                const auto output = comparison.run(device, changed, shader.stage);
                std::cout << device << ":";
                for (std::size_t word = 0; output && word < 8; ++word)
                    std::cout << fmt::format(" {:#x}", output->words[word]);
                std::cout << (output ? "" : output.error().message()) << std::endl;
            }
            return 0;
        } else {
            std::cerr << "unknown argument " << text << "\n";
            return 2;
        }
    }
    return RUN_ALL_TESTS();
}
