// SPDX-License-Identifier: Apache-2.0
// Drivers are opened at run time: the command starts on a machine that has none.
#include <gmock/gmock.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

namespace nacre {
namespace {

std::string libraries_of(const std::string& program) {
    std::string output;
    std::FILE* pipe = popen(("ldd '" + program + "' 2>&1").c_str(), "r");
    if (!pipe) return output;
    std::array<char, 4096> buffer;
    while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe))
        output.append(buffer.data(), count);
    pclose(pipe);
    return output;
}

TEST(Linking, TheCommandNamesNoDriverLibrary) {
    if (!std::filesystem::exists(NACRE_PROGRAM)) GTEST_SKIP() << "this build has no " << NACRE_PROGRAM;
    const std::string libraries = libraries_of(NACRE_PROGRAM);
    EXPECT_THAT(libraries, testing::HasSubstr("libc.so")) << "ldd did not work";
    for (const char* driver : {"libvulkan", "libEGL", "libGL.so", "libGLX", "libGLES", "libOpenGL", "libOSMesa",
                               "libGLdispatch", "libX11", "libwayland", "not found"})
        EXPECT_THAT(libraries, testing::Not(testing::HasSubstr(driver)));
}

}  // namespace
}  // namespace nacre
