// SPDX-License-Identifier: Apache-2.0
// Random shaders without faults on devices that look for faults: nothing is reported, and the results are the same.
//
//     cpu_clean_test                                   10 shaders with fixed seeds
//     cpu_clean_test --seed=1000 --count=10000
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

#include "tests/backends/cpu/differential/device_runner.h"

namespace nacre::differential {
namespace {

struct Settings {
    std::uint64_t seed = 1, count = 10;
} settings;

TEST(CpuClean, RandomShadersGiveNoReport) {
    const auto plain = DeviceRunner::create("cpu:consistent");
    ASSERT_TRUE(plain) << plain.error().message();
    for (const char* spec : {"cpu:consistent:sanitize", "cpu:consistent:hostile=3"}) {
        const auto checked = DeviceRunner::create(spec);
        ASSERT_TRUE(checked) << checked.error().message();
        std::uint64_t reported = 0;
        for (std::uint64_t seed = settings.seed; seed < settings.seed + settings.count; ++seed) {
            SCOPED_TRACE(testing::Message() << spec << ", seed " << seed);
            const GeneratedShader shader = generate(seed);
            const auto words = compile(shader.text, shader.stage, true);
            ASSERT_TRUE(words) << words.error().message();
            const auto expected = (*plain)->run(*words, shader.stage);
            const auto found = (*checked)->run(*words, shader.stage);
            ASSERT_TRUE(found) << found.error().message();
            if (expected) {
                EXPECT_EQ(found->words, expected->words);
            }
            const std::vector<std::string> messages = (*checked)->take_messages();
            for (const std::string& message : messages) ADD_FAILURE() << message;
            reported += !messages.empty();
            if (const std::uint64_t done = seed - settings.seed + 1; done % 100 == 0)
                std::cout << done << " shaders on " << spec << ", reports on " << reported << std::endl;
        }
        EXPECT_EQ(reported, 0u) << "of " << settings.count << " shaders on " << spec;
    }
}

}  // namespace
}  // namespace nacre::differential

int main(int argc, char** argv) {
    testing::InitGoogleTest(&argc, argv);
    for (int i = 1; i < argc; ++i) {
        const std::string_view argument = argv[i];
        if (argument.starts_with("--seed="))
            nacre::differential::settings.seed = std::strtoull(argv[i] + 7, nullptr, 10);
        if (argument.starts_with("--count="))
            nacre::differential::settings.count = std::strtoull(argv[i] + 8, nullptr, 10);
    }
    return RUN_ALL_TESTS();
}
