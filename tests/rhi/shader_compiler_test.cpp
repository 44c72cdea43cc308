// SPDX-License-Identifier: Apache-2.0
#include "rhi/shader_compiler.h"

#include <gmock/gmock.h>

#include <fstream>
#include <thread>

#include "core/disk_cache.h"
#include "core/file.h"
#include "rhi/reflection.h"
#include "rhi/spirv.h"
#include "tests/core/temporary_folder.h"

namespace nacre::rhi {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr EmbeddedFile files[] = {
    {"passes/post/post.comp", R"(#version 460
#include "post.glsl"
#include "shared/color.glsl"
layout(local_size_x = 8) in;
layout(set = 0, binding = 0) buffer Words { float values[]; };
void main() { values[0] = exposure(luminance(vec3(SCALE))); }
)"},
    {"passes/post/post.glsl", R"(#pragma once
#include "detail/curve.glsl"
float exposure(float x) { return curve(x); }
)"},
    {"passes/post/detail/curve.glsl", R"(#pragma once
#include "../../../shared/color.glsl"
float curve(float x) { return x * x; }
)"},
    {"shared/color.glsl", R"(#pragma once
float luminance(vec3 c) { return dot(c, vec3(0.2, 0.7, 0.1)); }
)"},
    {"broken/main.comp", R"(#version 460
layout(local_size_x = 8) in;
#include "inner.glsl"
void main() { inner(); }
)"},
    {"broken/inner.glsl", R"(
void inner() {
    float x = undeclared_name;
}
)"},
    {"missing/main.comp", R"(#version 460
layout(local_size_x = 8) in;
#include "deeper/first.glsl"
void main() {}
)"},
    {"missing/deeper/first.glsl", R"(
// A comment.
#include "nowhere.glsl"
)"},
    {"loop/main.comp", R"(
layout(local_size_x = 8) in;
#include "main.glsl"
void main() {}
)"},
    {"loop/main.glsl", "#include \"main.glsl\"\n"},
};

std::string error_of(const Expected<ShaderDesc>& result) { return result ? "(no error)" : result.error().message(); }

void write(const std::filesystem::path& path, std::string_view text) {
    ASSERT_TRUE(write_file_atomically(path, text));
}

TEST(ShaderCompiler, FindsIncludesBesideTheFileAndFromTheRoot) {
    ShaderCompiler compiler({.embedded = {files}});
    const ShaderSource source{.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}};
    const auto shader = compiler.compile(source);
    ASSERT_TRUE(shader) << error_of(shader);
    EXPECT_EQ(shader->stage, ShaderStage::compute);
    EXPECT_EQ(shader->name, "passes/post/post.comp");
    EXPECT_TRUE(reflect(shader->spirv, shader->stage));
    EXPECT_THAT(compiler.dependencies(source), ElementsAre("passes/post/post.comp", "passes/post/post.glsl",
                                                           "shared/color.glsl", "passes/post/detail/curve.glsl"));
    EXPECT_FALSE(compiler.is_outdated(source));
}

TEST(ShaderCompiler, ErrorsNameTheLineOfTheInclude) {
    ShaderCompiler compiler({.embedded = {files}});
    const auto shader = compiler.compile({.path = "broken/main.comp"});
    ASSERT_FALSE(shader);
    EXPECT_EQ(shader.error().code, ErrorCode::shader_compile);
    EXPECT_THAT(error_of(shader), AllOf(HasSubstr("\nbroken/inner.glsl:3: "), HasSubstr("undeclared_name"),
                                        Not(HasSubstr("ERROR"))));
}

TEST(ShaderCompiler, ErrorsInTheMainFileCountItsOwnLines) {
    ShaderCompiler compiler({});
    // The definitions before the text and an include in the middle do not shift the count.
    const auto shader = compiler.compile({.path = "a.frag", .defines = {{"ONE"}, {"TWO", "2"}},
                                          .text = "#version 460\n\nvoid main() {\n  int x = 1.5;\n}\n"});
    ASSERT_FALSE(shader);
    EXPECT_THAT(error_of(shader), HasSubstr("\na.frag:4: "));
}

TEST(ShaderCompiler, MissingIncludesNameFileAndLine) {
    ShaderCompiler compiler({.embedded = {files}});
    const auto shader = compiler.compile({.path = "missing/main.comp"});
    ASSERT_FALSE(shader);
    EXPECT_EQ(shader.error().code, ErrorCode::not_found);
    EXPECT_THAT(error_of(shader), AllOf(HasSubstr("missing/deeper/first.glsl:3"), HasSubstr("'nowhere.glsl'")));
    EXPECT_EQ(compiler.compile({.path = "no/such.comp"}).error().code, ErrorCode::not_found);
}

TEST(ShaderCompiler, AFileThatIncludesItselfIsAnError) {
    ShaderCompiler compiler({.embedded = {files}});
    const auto shader = compiler.compile({.path = "loop/main.comp"});
    ASSERT_FALSE(shader);
    EXPECT_THAT(error_of(shader), HasSubstr("#pragma once"));
}

TEST(ShaderCompiler, RefusesWhatCannotBe) {
    ShaderCompiler compiler({.embedded = {files}});
    EXPECT_EQ(compiler.compile({.path = "shared/color.glsl"}).error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(compiler.compile({.path = "../secret.comp"}).error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(compiler.compile({.path = "/etc/secret.comp"}).error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(compiler.compile({.path = "a.comp", .defines = {{"two words"}}, .text = "void main() {}"}).error().code,
              ErrorCode::invalid_argument);
    EXPECT_EQ(
        compiler.compile({.path = "a.comp", .defines = {{"A", "1\n#error"}}, .text = "void main() {}"}).error().code,
        ErrorCode::invalid_argument);
}

TEST(ShaderCompiler, DebugInformationHoldsFilesAndLines) {
    const auto count = [](const ShaderDesc& shader, std::uint32_t opcode) {
        int found = 0;
        for (const auto& instruction : spirv::instructions(shader.spirv)) found += instruction.opcode() == opcode;
        return found;
    };
    constexpr std::uint32_t op_line = 8, op_string = 7, op_name = 5;
    const ShaderSource source{.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}};
    const auto with = ShaderCompiler({.embedded = {files}}).compile(source);
    ASSERT_TRUE(with);
    EXPECT_GT(count(*with, op_line), 3);
    std::vector<std::string> strings;
    std::string text;
    for (const auto& instruction : spirv::instructions(with->spirv)) {
        if (instruction.opcode() == op_string) strings.push_back(instruction.text(1));
        if (instruction.opcode() == 3 && instruction.operand_count() > 3) text += instruction.text(3);
        if (instruction.opcode() == 2) text += instruction.text(0);
    }
    EXPECT_THAT(strings, ::testing::Contains("passes/post/post.comp"));
    EXPECT_THAT(strings, ::testing::Contains("passes/post/detail/curve.glsl"));
    EXPECT_THAT(text, HasSubstr("exposure(luminance(vec3(SCALE)))")) << "debuggers show the source";
    const auto without = ShaderCompiler({.embedded = {files}, .debug_information = false}).compile(source);
    ASSERT_TRUE(without);
    EXPECT_EQ(count(*without, op_line), 0);
    EXPECT_EQ(count(*without, op_string), 0);
    EXPECT_EQ(count(*without, op_name), 0);
    EXPECT_LT(without->spirv.size(), with->spirv.size());
}

TEST(ShaderCompiler, DebugInformationOfBlocksIsValid) {
    for (const bool debug_information : {false, true}) {
        const auto shader =
            ShaderCompiler({.debug_information = debug_information}).compile({.path = "a.frag", .text = R"(
            layout(location = 0) out vec4 color;
            void main() {
                color = vec4(0);
                if (gl_FragCoord.x > 4.0) {
                    vec4 inner = vec4(1);
                    for (int i = 0; i < 3; ++i) { inner += vec4(i); { vec4 inner_most = inner; inner = inner_most; } }
                    color = inner;
                } else {
                }
            })"});
        ASSERT_TRUE(shader);
        const auto reflection = reflect(shader->spirv, shader->stage);
        EXPECT_TRUE(reflection) << reflection.error().message();
    }
}

TEST(ShaderCompiler, OptimizedModulesAreSmallerAndKeepTheirLayout) {
    const ShaderSource source{.path = "a.comp", .text = R"(
        layout(local_size_x = 8) in;
        layout(constant_id = 4) const uint unused_constant = 1;
        layout(set = 0, binding = 0) buffer Words { uint words[]; };
        layout(set = 0, binding = 1) uniform sampler2D unused_texture;
        uint twice(uint x) { uint y = x; y += x; return y; }
        void main() { uint a = twice(words[0]); uint b = a; words[1] = b; })"};
    const auto plain = ShaderCompiler({.debug_information = false}).compile(source);
    const auto optimized = ShaderCompiler({.debug_information = false, .optimize = true}).compile(source);
    ASSERT_TRUE(plain);
    ASSERT_TRUE(optimized) << error_of(optimized);
    EXPECT_LT(optimized->spirv.size(), plain->spirv.size());
    const auto before = reflect(plain->spirv, plain->stage), after = reflect(optimized->spirv, optimized->stage);
    ASSERT_TRUE(before);
    ASSERT_TRUE(after) << after.error().message();
    EXPECT_EQ(after->bindings.size(), 2u);
    EXPECT_EQ(before->bindings.size(), after->bindings.size());
    EXPECT_EQ(after->specialization.size(), 1u);
}

TEST(ShaderCompiler, TheSameInputGivesTheSameWords) {
    const ShaderSource source{.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}};
    const auto first = ShaderCompiler({.embedded = {files}}).compile(source);
    const auto second = ShaderCompiler({.embedded = {files}}).compile(source);
    ASSERT_TRUE(first && second);
    EXPECT_EQ(first->spirv, second->spirv);
}

TEST(ShaderCompiler, TheCacheServesTheSameAndNothingElse) {
    TemporaryFolder folder;
    DiskCache cache(folder.path() / "cache");
    const ShaderSource half{.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}};
    const ShaderSource whole{.path = "passes/post/post.comp", .defines = {{"SCALE", "1.0"}}};
    std::vector<std::uint32_t> words;
    {
        ShaderCompiler compiler({.embedded = {files}, .cache = &cache});
        words = compiler.compile(half)->spirv;
        ASSERT_TRUE(compiler.compile(half));
        EXPECT_EQ(compiler.statistics().compiled, 1u);
        EXPECT_EQ(compiler.statistics().from_memory, 1u);
        EXPECT_GT(compiler.statistics().compile_ms, 0.0);
    }
    {
        ShaderCompiler compiler({.embedded = {files}, .cache = &cache});
        EXPECT_EQ(compiler.compile(half)->spirv, words);
        EXPECT_EQ(compiler.statistics().compiled, 0u);
        EXPECT_EQ(compiler.statistics().from_cache, 1u);
        EXPECT_NE(compiler.compile(whole)->spirv, words) << "other definitions";
        EXPECT_EQ(compiler.statistics().compiled, 1u);
    }
    {
        // One changed byte in an include of an include.
        std::vector<EmbeddedFile> changed(std::begin(files), std::end(files));
        changed[2].text = "#pragma once\nfloat curve(float x) { return x + x; }\n";
        ShaderCompiler compiler({.embedded = {changed}, .cache = &cache});
        EXPECT_NE(compiler.compile(half)->spirv, words);
        EXPECT_EQ(compiler.statistics().compiled, 1u);
    }
    {
        ShaderCompiler compiler({.embedded = {files}, .cache = &cache, .debug_information = false});
        EXPECT_NE(compiler.compile(half)->spirv, words) << "other options";
    }
}

TEST(ShaderCompiler, DamagedCacheEntriesAreRebuilt) {
    TemporaryFolder folder;
    DiskCache cache(folder.path());
    const ShaderSource source{.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}};
    const auto words = ShaderCompiler({.embedded = {files}, .cache = &cache}).compile(source)->spirv;
    std::filesystem::path entry;
    for (const auto& found : std::filesystem::recursive_directory_iterator(folder.path()))
        if (found.is_regular_file()) entry = found.path();
    ASSERT_FALSE(entry.empty());
    const auto good = *read_binary_file(entry);

    std::vector<std::vector<std::byte>> damaged{{}, {good.begin(), good.begin() + 40}, good, good, good};
    damaged[2][good.size() / 2] ^= std::byte{1};      // One bit of the content.
    damaged[3][3] ^= std::byte{0xff};                 // The header.
    damaged[4].insert(damaged[4].end(), 4, std::byte{0});
    for (const auto& bytes : damaged) {
        ASSERT_TRUE(write_file_atomically(entry, std::span<const std::byte>(bytes)));
        ShaderCompiler compiler({.embedded = {files}, .cache = &cache});
        const auto shader = compiler.compile(source);
        ASSERT_TRUE(shader) << error_of(shader);
        EXPECT_EQ(shader->spirv, words);
        EXPECT_EQ(compiler.statistics().compiled, 1u);
        EXPECT_EQ(*read_binary_file(entry), good) << "the entry is whole again";
    }
}

TEST(ShaderCompiler, WholeCacheEntriesThatAreNoSpirvAreRebuilt) {
    TemporaryFolder folder;
    DiskCache cache(folder.path());
    const ShaderSource source{.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}};
    const auto words = ShaderCompiler({.embedded = {files}, .cache = &cache}).compile(source)->spirv;
    // Whoever wrote this entry had the right key and the wrong content.
    std::filesystem::path entry;
    for (const auto& found : std::filesystem::recursive_directory_iterator(folder.path()))
        if (found.is_regular_file()) entry = found.path();
    Hash128 key;
    ASSERT_EQ(std::sscanf(entry.stem().c_str(), "%16lx%16lx", &key.high, &key.low), 2);
    cache.store("spirv", key, std::as_bytes(std::span(files[0].text)));
    ShaderCompiler compiler({.embedded = {files}, .cache = &cache});
    EXPECT_EQ(compiler.compile(source)->spirv, words);
    EXPECT_EQ(compiler.statistics().rebuilt_entries, 1u);
}

TEST(ShaderCompiler, WorksWithoutAUsableCacheFolder) {
    TemporaryFolder folder;
    write(folder.path() / "file", "not a folder");
    DiskCache cache(folder.path() / "file" / "cache");
    ShaderCompiler compiler({.embedded = {files}, .cache = &cache});
    EXPECT_TRUE(compiler.compile({.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}}));
}

TEST(ShaderCompiler, ManyThreadsAndOneCache) {
    TemporaryFolder folder;
    DiskCache cache(folder.path());
    std::vector<std::vector<std::uint32_t>> expected;
    {
        ShaderCompiler compiler({.embedded = {files}});
        for (int i = 0; i < 6; ++i)
            expected.push_back(
                compiler.compile({.path = "passes/post/post.comp", .defines = {{"SCALE", std::to_string(i) + ".0"}}})
                    ->spirv);
    }
    // Two compilers, as of two processes, and two threads on each.
    ShaderCompiler compilers[] = {ShaderCompiler({.embedded = {files}, .cache = &cache}),
                                  ShaderCompiler({.embedded = {files}, .cache = &cache})};
    std::atomic<int> wrong = 0;
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t) {
        threads.emplace_back([&, t] {
            for (int i = 0; i < 6; ++i) {
                const auto shader = compilers[t % 2].compile(
                    {.path = "passes/post/post.comp", .defines = {{"SCALE", std::to_string((i + t) % 6) + ".0"}}});
                if (!shader || shader->spirv != expected[static_cast<std::size_t>((i + t) % 6)]) ++wrong;
            }
        });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0);
}

TEST(ShaderCompiler, TheSourceFolderComesFirstAndIsWatched) {
    TemporaryFolder folder;
    ShaderCompiler compiler({.embedded = {files}, .source_folder = folder.path()});
    const ShaderSource source{.path = "passes/post/post.comp", .defines = {{"SCALE", "0.5"}}};
    const auto embedded = compiler.compile(source);
    ASSERT_TRUE(embedded) << error_of(embedded);
    EXPECT_FALSE(compiler.is_outdated(source));

    // A file that comes into being wins over the embedded one.
    write(folder.path() / "shared/color.glsl", "float luminance(vec3 c) { return c.x; }\n");
    EXPECT_TRUE(compiler.is_outdated(source));
    const auto first = compiler.compile(source);
    EXPECT_FALSE(first) << "without #pragma once, luminance is defined twice";
    EXPECT_FALSE(compiler.is_outdated(source)) << "a failure is not tried again before something changes";
    write(folder.path() / "shared/color.glsl", "#pragma once\nfloat luminance(vec3 c) { return c.x; }\n");
    EXPECT_TRUE(compiler.is_outdated(source));
    const auto second = compiler.compile(source);
    ASSERT_TRUE(second) << error_of(second);
    EXPECT_NE(second->spirv, embedded->spirv);

    // The same size, within the same tick of the clock.
    write(folder.path() / "shared/color.glsl", "#pragma once\nfloat luminance(vec3 c) { return c.y; }\n");
    EXPECT_TRUE(compiler.is_outdated(source));
    EXPECT_NE(compiler.compile(source)->spirv, second->spirv);

    std::filesystem::remove(folder.path() / "shared/color.glsl");
    EXPECT_TRUE(compiler.is_outdated(source));
    EXPECT_EQ(compiler.compile(source)->spirv, embedded->spirv);
    EXPECT_FALSE(compiler.is_outdated(source));
}

TEST(ShaderCompiler, TheEnvironmentNamesTheSourceFolder) {
    TemporaryFolder folder;
    write(folder.path() / "only/here.comp", "layout(local_size_x = 1) in;\nvoid main() {}\n");
    setenv("NACRE_SHADER_DIR", folder.path().c_str(), 1);
    ShaderCompiler compiler({});
    unsetenv("NACRE_SHADER_DIR");
    EXPECT_TRUE(compiler.compile({.path = "only/here.comp"}));
}

}  // namespace
}  // namespace nacre::rhi
