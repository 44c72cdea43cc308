// SPDX-License-Identifier: Apache-2.0
// Random shaders without faults on devices that look for faults: nothing is reported, and the results are the same.
//
//     cpu_clean_test                                   10 shaders with fixed seeds
//     cpu_clean_test --seed=1000 --count=10000
//     cpu_clean_test --seed=1000 --count=10000 --together   most with all checks on one device, which is quicker
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "tests/backends/cpu/differential/device_runner.h"
#include "tests/core/arguments.h"

namespace nacre::differential {
namespace {

struct Settings {
    std::uint64_t seed = 1, count = 10;
    bool together = false;
} settings;

constexpr std::array<const char*, 3> checks{"sanitize", "hostile=3", "sanitize:hostile=3"};

/// Lanes of the devices that a shader runs on: mostly few, since those make little code and most time goes into
/// compiling.
std::uint32_t lanes_for(std::uint64_t seed) { return seed % 8 == 1 ? 16 : seed % 8 == 5 ? 8 : 4; }

TEST(CpuClean, RandomShadersGiveNoReport) {
    std::map<std::string, std::unique_ptr<DeviceRunner>> runners;
    const auto run = [&](const std::string& spec, const std::vector<std::uint32_t>& words,
                         Stage stage) -> Expected<Output> {
        std::unique_ptr<DeviceRunner>& runner = runners[spec];
        if (!runner) {
            NACRE_TRY(runner, DeviceRunner::create(spec));
        }
        return runner->run(words, stage);
    };
    std::uint64_t reported = 0;
    for (std::uint64_t seed = settings.seed; seed < settings.seed + settings.count; ++seed) {
        const GeneratedShader shader = generate(seed);
        const auto words = compile(shader.text, shader.stage, true);
        ASSERT_TRUE(words) << "seed " << seed << ": " << words.error().message();
        const std::string lanes = fmt::format(":lanes={}", lanes_for(seed)), plain = "cpu:consistent" + lanes;
        const auto expected = run(plain, *words, shader.stage);
        const bool is_together = settings.together && seed % 4 != 1;
        for (std::size_t check = is_together ? 2 : 0; check < (is_together ? 3 : 2); ++check) {
            const std::string spec = fmt::format("cpu:consistent:{}{}", checks[check], lanes);
            SCOPED_TRACE(fmt::format("{}, seed {}", spec, seed));
            const auto found = run(spec, *words, shader.stage);
            if (!found) {
                ADD_FAILURE() << found.error().message();
                // A device that is lost says nothing of the shaders after.
                runners.erase(spec);
                continue;
            }
            if (expected) {
                EXPECT_EQ(found->words, expected->words);
            }
            const std::vector<std::string> messages = runners[spec]->take_messages();
            for (const std::string& message : messages) ADD_FAILURE() << message;
            reported += !messages.empty();
        }
        if (!expected) runners.erase(plain);
        if (const std::uint64_t done = seed - settings.seed + 1; done % 100 == 0)
            std::cout << fmt::format("{} shaders, reports on {}", done, reported) << std::endl;
    }
}

}  // namespace
}  // namespace nacre::differential

int main(int argc, char** argv) {
    testing::InitGoogleTest(&argc, argv);
    // So many objects that nobody wants again.
    setenv("NACRE_CACHE_DIR", "off", 1);
    for (int i = 1; i < argc; ++i) {
        const std::string_view argument = argv[i];
        nacre::test::read_number(argument, "seed", nacre::differential::settings.seed);
        nacre::test::read_number(argument, "count", nacre::differential::settings.count);
        if (argument == "--together") nacre::differential::settings.together = true;
    }
    return RUN_ALL_TESTS();
}
