// SPDX-License-Identifier: Apache-2.0
// The small samples do what they say, on every backend that is here, and draw the same picture.
#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "core/image.h"
#include "rhi/device.h"
#include "samples/backends.h"
#include "tests/core/temporary_folder.h"
#include "tests/samples/run_command.h"

namespace nacre {
namespace {

using ::testing::HasSubstr;

std::set<std::string> backends_here() {
    std::set<std::string> names;
    const rhi::Instance instance(all_backends());
    for (const rhi::AdapterInfo& adapter : instance.adapters()) names.insert(adapter.backend);
    return names;
}

ImageBytes picture_of(const std::string& program, const std::string& backend) {
    TemporaryFolder folder;
    const std::string file = folder.path() / "picture.png";
    const CommandResult result = run_program(program, {backend, file});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    auto image = read_image_bytes(file);
    EXPECT_TRUE(image) << backend;
    return image ? *image : ImageBytes{};
}

/// Texels that differ by more than one step in any channel.
std::size_t different_texels(const ImageBytes& a, const ImageBytes& b) {
    if (a.bytes.size() != b.bytes.size()) return a.bytes.size() + b.bytes.size();
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.bytes.size(); i += 4) {
        bool differs = false;
        for (std::size_t c = 0; c < 4; ++c) differs |= std::abs(a.bytes[i + c] - b.bytes[i + c]) > 1;
        count += differs;
    }
    return count;
}

TEST(SmallSamples, TheTriangleIsTheSameEverywhere) {
    const auto backends = backends_here();
    if (backends.empty()) GTEST_SKIP() << "no backend is here";
    const ImageBytes first = picture_of(TRIANGLE_SAMPLE, *backends.begin());
    ASSERT_EQ(first.width, 640u);
    ASSERT_EQ(first.height, 480u);
    const auto texel = [&](std::uint32_t x, std::uint32_t y) { return &first.bytes[(y * 640 + x) * 4]; };
    // Red on top, green on the right, blue on the left, the background in the corners.
    EXPECT_GT(texel(320, 60)[0], 220);
    EXPECT_LT(texel(320, 60)[1], 100);
    EXPECT_GT(texel(560, 425)[1], 220);
    EXPECT_GT(texel(80, 425)[2], 220);
    for (const auto& [x, y] : {std::pair(0u, 0u), {639u, 0u}, {0u, 479u}, {639u, 479u}})
        EXPECT_NEAR(texel(x, y)[0], 39, 1);  // 0.02 in sRGB.
    for (const std::string& backend : backends)
        EXPECT_EQ(different_texels(first, picture_of(TRIANGLE_SAMPLE, backend)), 0u) << backend;
}

TEST(SmallSamples, TheSumIsRight) {
    for (const std::string& backend : backends_here()) {
        const CommandResult result = run_program(COMPUTE_SAMPLE, {backend});
        EXPECT_EQ(result.exit_code, 0) << result.errors;
        EXPECT_THAT(result.output, HasSubstr("the sum of 1 to 10000 is 50005000"));
    }
}

TEST(SmallSamples, ThePassDarkensTheCorners) {
    const auto backends = backends_here();
    if (backends.empty()) GTEST_SKIP() << "no backend is here";
    const ImageBytes first = picture_of(PASS_SAMPLE, *backends.begin());
    ASSERT_EQ(first.width, 320u);
    for (const auto& [x, y] : {std::pair(0u, 0u), {319u, 239u}, {160u, 120u}, {40u, 200u}}) {
        const double u = (x + 0.5) / 160 - 1, v = (y + 0.5) / 120 - 1;
        const double light = 1 - 0.4 * (u * u + v * v);
        const double red = (x / 20 + y / 20) % 2 == 0 ? 255 : 100;
        EXPECT_NEAR(first.bytes[(y * 320 + x) * 4], red * light, 1.0) << x << ", " << y;
        EXPECT_NEAR(first.bytes[(y * 320 + x) * 4 + 1], 255 * light, 1.0) << x << ", " << y;
    }
    for (const std::string& backend : backends)
        EXPECT_EQ(different_texels(first, picture_of(PASS_SAMPLE, backend)), 0u) << backend;
}

TEST(SmallSamples, AnUnknownBackendIsAnError) {
    for (const char* program : {TRIANGLE_SAMPLE, COMPUTE_SAMPLE, PASS_SAMPLE}) {
        const CommandResult result = run_program(program, {"crayons"});
        EXPECT_EQ(result.exit_code, 1);
        EXPECT_THAT(result.errors, HasSubstr("'crayons'"));
    }
}

}  // namespace
}  // namespace nacre
