// SPDX-License-Identifier: Apache-2.0
// Valid modules that nobody would write, compiled and run: none may crash, write outside of what is bound, or leave a
// device that does not work.
//
//     cpu_mutation_test                                            as many modules as a short test has time for
//     cpu_mutation_test --seed=1000 --count=100000 --chains --folder=found
//     cpu_mutation_test --seed=1234 --count=1 --in-process         one of them in a debugger
//     cpu_mutation_test --run=found.spv                            one module on all devices
//     cpu_mutation_test --write-seeds=tests/seeds/cpu_spirv_fuzzer  the modules that others are made from
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "rhi/spirv.h"
#include "tests/backends/cpu/differential/device_runner.h"
#include "tests/backends/cpu/hostile/module_runner.h"
#include "tests/backends/cpu/hostile/seed_shaders.h"
#include "tests/backends/cpu/hostile/spirv_mutation.h"
#include "tests/core/arguments.h"

namespace nacre::hostile {
namespace {

struct Settings {
    std::uint64_t seed = 1;
    std::uint64_t count = 150;
    std::string folder;  ///< Where modules go that break something; empty: the test's temporary folder.
    bool in_process = false;
    bool chains =
        false;  ///< Modules are made one out of another, which is quicker; what a number gives depends on those before.
} settings;

constexpr int most_seconds = 60;  ///< For one module.
constexpr std::array<const char*, 5> specs{"cpu:fast:lanes=4:threads=1", "cpu:consistent:lanes=8:threads=1",
                                           "cpu:fast:lanes=16:threads=2", "cpu:double:threads=1",
                                           "cpu:consistent:lanes=4:threads=1"};

/// What a process that runs modules tells the one that started it; lies in memory of both.
struct Progress {
    std::uint64_t next = 0;  ///< The module being run.
    std::uint64_t tried = 0, valid = 0;  ///< Changes, and those after which the module was valid.
    std::uint64_t ran = 0, refused = 0, lost = 0, broken = 0;
    std::uint64_t module_bytes = 0;
    char reason[512] = {};
    bool ended = false;
};

/// Makes modules of the seeds by changes that leave them valid: each from a seed, or one out of another until it starts
/// again.
class ModuleSource {
  public:
    explicit ModuleSource(std::vector<SeedShader> seeds) : seeds_(std::move(seeds)), latest_(seeds_) {}

    SeedShader& make(std::uint64_t number, Progress& progress) {
        Random random(number);
        // Now and then something larger and more regular.
        if (random.chance(3)) {
            const differential::GeneratedShader generated = differential::generate(number);
            if (auto words = differential::compile(generated.text, generated.stage)) {
                generated_ = {"generated",
                              generated.stage == differential::Stage::compute    ? rhi::ShaderStage::compute
                              : generated.stage == differential::Stage::fragment ? rhi::ShaderStage::fragment
                                                                                 : rhi::ShaderStage::vertex,
                              *std::move(words)};
                return change(generated_, random, progress);
            }
        }
        const auto which = static_cast<std::size_t>(random.below(static_cast<int>(seeds_.size())));
        last_ = which;
        if (!settings.chains || random.chance(15) || latest_[which].words.size() > 3 * seeds_[which].words.size())
            latest_[which] = seeds_[which];
        return change(latest_[which], random, progress);
    }

    /// The last module was refused: what would be made of it would be refused as well.
    void start_again() { latest_[last_] = seeds_[last_]; }

  private:
    static SeedShader& change(SeedShader& at, Random& random, Progress& progress) {
        int wanted = random.between(1, settings.chains ? 4 : 12);
        for (int i = 0; i < 50 && wanted > 0; ++i) {
            auto module = MutableModule::parse(at.words);
            if (!module || !module->mutate(random)) continue;
            Words changed = module->words();
            if (changed == at.words) continue;
            ++progress.tried;
            if (!rhi::spirv::validate(changed, "mutated")) continue;
            ++progress.valid, --wanted;
            at.words = std::move(changed);
        }
        return at;
    }

    std::vector<SeedShader> seeds_, latest_;
    std::size_t last_ = 0;
    SeedShader generated_;
};

void write_words(const std::string& path, const Words& words) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(words.data()), static_cast<std::streamsize>(words.size() * 4));
}

/// Runs modules up to the end, or to the first that breaks something.
void work(std::uint64_t end, Progress& progress) {
    auto seeds = seed_shaders();
    if (!seeds) {
        std::snprintf(progress.reason, sizeof(progress.reason), "%s", seeds.error().message().c_str());
        ++progress.broken;
        return;
    }
    ModuleSource source(*std::move(seeds));
    std::array<std::unique_ptr<ModuleRunner>, specs.size()> runners;
    std::ofstream refusals(settings.folder + "/refused.txt", std::ios::app);
    for (; progress.next < end; ++progress.next) {
        const SeedShader& module = source.make(progress.next, progress);
        write_words(settings.folder + "/current.spv", module.words);
        // Few lanes make little code: most modules run with four.
        const std::size_t which = progress.next % 16 < specs.size() ? progress.next % 16 : 0;
        if (!runners[which]) {
            auto made = ModuleRunner::create(specs[which]);
            if (!made) {
                std::snprintf(progress.reason, sizeof(progress.reason), "%s", made.error().message().c_str());
                ++progress.broken;
                return;
            }
            runners[which] = *std::move(made);
        }
        progress.module_bytes += module.words.size() * 4;
        switch (runners[which]->run(module.words, module.stage, progress.next)) {
            case Outcome::ran: ++progress.ran; break;
            case Outcome::refused:
                ++progress.refused;
                source.start_again();
                refusals << progress.next << " " << module.name << " " << runners[which]->reason() << std::endl;
                break;
            case Outcome::lost: ++progress.lost, source.start_again(); break;
            case Outcome::broken: {
                ++progress.broken;
                std::snprintf(progress.reason, sizeof(progress.reason), "%s of %s: %s", specs[which],
                              module.name.c_str(), runners[which]->reason().c_str());
                return;
            }
        }
    }
    progress.ended = true;
}

std::string tally(const Progress& progress) {
    return fmt::format(
        "{} ran, {} refused, {} stopped by the watchdog, {} broke something; {:.0f} % of {} changes left a valid "
        "module, {} bytes on average",
        progress.ran, progress.refused, progress.lost, progress.broken,
        100.0 * static_cast<double>(progress.valid) / static_cast<double>(std::max<std::uint64_t>(progress.tried, 1)),
        progress.tried,
        progress.module_bytes /
            std::max<std::uint64_t>(progress.ran + progress.refused + progress.lost + progress.broken, 1));
}

TEST(CpuMutations, ValidModulesRunAndLeaveTheDeviceSound) {
    setenv("NACRE_CACHE_DIR", "off", 1);
    setenv("NACRE_CPU_WATCHDOG_SECONDS", "0.1", 1);
    if (settings.folder.empty()) settings.folder = fmt::format("{}/mutations-{}", testing::TempDir(), getpid());
    std::filesystem::create_directories(settings.folder);
    void* const memory = mmap(nullptr, sizeof(Progress), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(memory, MAP_FAILED);
    Progress& progress = *new (memory) Progress;
    const std::uint64_t end = settings.seed + settings.count;
    progress.next = settings.seed;
    std::vector<std::string> failures;
    auto told = std::chrono::steady_clock::now();
    while (!progress.ended && failures.size() < 20) {
        std::cout.flush();
        if (settings.in_process) {
            work(end, progress);
            if (!progress.ended) failures.push_back(fmt::format("module {}: {}", progress.next++, progress.reason));
            continue;
        }
        const pid_t process = fork();
        ASSERT_GE(process, 0);
        if (process == 0) {
            work(end, progress);
            _exit(0);
        }
        std::uint64_t seen = progress.next;
        auto since = std::chrono::steady_clock::now();
        int status = 0;
        bool hangs = false;
        while (waitpid(process, &status, WNOHANG) == 0) {
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
            const auto now = std::chrono::steady_clock::now();
            if (seen != progress.next) seen = progress.next, since = now;
            if (now - since > std::chrono::seconds(most_seconds)) hangs = true, kill(process, SIGKILL);
            if (now - told > std::chrono::seconds(30)) {
                told = now;
                std::cout << fmt::format("module {}: {}", progress.next, tally(progress)) << std::endl;
            }
        }
        if (progress.ended) break;
        const std::string how = hangs                      ? "hang"
                                : WIFSIGNALED(status)      ? fmt::format("signal {}", WTERMSIG(status))
                                : WEXITSTATUS(status) != 0 ? fmt::format("exit status {}", WEXITSTATUS(status))
                                                           : progress.reason;
        failures.push_back(fmt::format("module {}: {}", progress.next, how));
        std::cout << failures.back() << std::endl;
        std::error_code ignored;
        std::filesystem::rename(settings.folder + "/current.spv",
                                fmt::format("{}/{}.spv", settings.folder, progress.next), ignored);
        ++progress.next;
    }
    std::cout << tally(progress) << std::endl;
    for (const std::string& text : failures) ADD_FAILURE() << text << "\nThe module is in " << settings.folder;
    EXPECT_EQ(progress.ran + progress.refused + progress.lost + failures.size(), settings.count);
    // Otherwise nothing would be tested: most of what is valid must run.
    EXPECT_GT(progress.ran * 10, settings.count * 7);
    munmap(memory, sizeof(Progress));
}

int run_file(const std::string& path) {
    setenv("NACRE_CACHE_DIR", "off", 1);
    std::ifstream file(path, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(file)), {});
    Words words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), words.size() * 4);
    rhi::ShaderStage stage = rhi::ShaderStage::compute;
    if (rhi::spirv::check_structure(words, path))
        for (const auto& at : rhi::spirv::instructions(words))
            if (static_cast<spv::Op>(at.opcode()) == spv::Op::OpEntryPoint)
                stage = at.operand(0) == 0   ? rhi::ShaderStage::vertex
                        : at.operand(0) == 4 ? rhi::ShaderStage::fragment
                                             : rhi::ShaderStage::compute;
    for (const char* spec : specs) {
        auto runner = ModuleRunner::create(spec);
        if (!runner) return 1;
        constexpr std::array<const char*, 4> names{"ran", "refused", "lost", "broken"};
        const Outcome outcome = (*runner)->run(words, stage, 1);
        std::cout << spec << ": " << names[static_cast<std::size_t>(outcome)] << " " << (*runner)->reason()
                  << std::endl;
    }
    return 0;
}

int write_seeds(const std::string& folder) {
    const auto seeds = seed_shaders();
    if (!seeds) {
        std::cerr << seeds.error().message() << "\n";
        return 1;
    }
    for (const SeedShader& seed : *seeds) write_words(folder + "/" + seed.name + ".spv", seed.words);
    return 0;
}

}  // namespace
}  // namespace nacre::hostile

int main(int argc, char** argv) {
    using namespace nacre::hostile;
    testing::InitGoogleTest(&argc, argv);
    for (int i = 1; i < argc; ++i) {
        const std::string text = argv[i];
        const auto value = [&](const char* name) { return nacre::test::value_of(text, name); };
        if (nacre::test::read_number(text, "seed", settings.seed)) continue;
        if (nacre::test::read_number(text, "count", settings.count)) continue;
        if (const auto folder = value("folder")) settings.folder = *folder;
        else if (text == "--in-process") settings.in_process = true;
        else if (text == "--chains") settings.chains = true;
        else if (const auto file = value("run")) return run_file(*file);
        else if (const auto seeds = value("write-seeds")) return write_seeds(*seeds);
        else {
            std::cerr << "unknown argument " << text << "\n";
            return 2;
        }
    }
    return RUN_ALL_TESTS();
}
