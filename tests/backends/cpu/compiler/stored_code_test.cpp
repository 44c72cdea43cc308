// SPDX-License-Identifier: Apache-2.0
// What the disk cache keeps of compiled shaders, and that what it holds is not compiled again.
#include "backends/cpu/compiler/stored_code.h"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <algorithm>
#include <charconv>
#include <set>

#include "backends/cpu/compiler/compiler.h"
#include "core/disk_cache.h"
#include "rhi/shader_compiler.h"
#include "tests/core/temporary_folder.h"

namespace nacre::cpu {
namespace {

bool same(const NarrowedOperation& a, const NarrowedOperation& b) {
    return a.line == b.line && a.operation == b.operation;
}
bool same(const VertexOutput& a, const VertexOutput& b) {
    return a.location == b.location && a.component == b.component && a.slot == b.slot;
}
bool same(const FragmentInput& a, const FragmentInput& b) {
    return a.location == b.location && a.component == b.component && a.interpolation == b.interpolation;
}
bool same(const FragmentOutput& a, const FragmentOutput& b) {
    return a.output == b.output && a.components == b.components;
}
template <typename Element>
bool same(const std::vector<Element>& a, const std::vector<Element>& b) {
    return std::ranges::equal(a, b, [](const Element& one, const Element& other) { return same(one, other); });
}
bool same(const ComputeFacts& a, const ComputeFacts& b) {
    return a.workgroup_size == b.workgroup_size && a.workgroup_bytes == b.workgroup_bytes &&
           a.subgroups == b.subgroups && a.has_barriers == b.has_barriers && same(a.narrowed, b.narrowed);
}
bool same(const VertexProgram& a, const VertexProgram& b) {
    return a.output_slots == b.output_slots && same(a.outputs, b.outputs) &&
           a.writes_point_size == b.writes_point_size && a.clip_distances == b.clip_distances &&
           a.cull_distances == b.cull_distances && a.has_side_effects == b.has_side_effects &&
           same(a.narrowed, b.narrowed);
}
bool same(const FragmentProgram& a, const FragmentProgram& b) {
    return same(a.inputs, b.inputs) && same(a.outputs, b.outputs) && a.early_tests == b.early_tests &&
           a.discards == b.discards && a.writes_depth == b.writes_depth &&
           a.writes_sample_mask == b.writes_sample_mask && a.has_side_effects == b.has_side_effects &&
           a.runs_per_sample == b.runs_per_sample && a.uses_centroid == b.uses_centroid && same(a.narrowed, b.narrowed);
}

const std::vector<NarrowedOperation> narrowed{{"a.comp:3", "packing"}, {"", "bit cast"}};

/// Facts none of which is what it is where nobody sets it, and others with each flag alone.
std::vector<ComputeFacts> compute_facts() { return {{}, {{2, 3, 4}, 1ull << 40, 5, true, narrowed}}; }
std::vector<VertexProgram> vertex_facts() {
    std::vector<VertexProgram> all(4);
    all[1] = {.output_slots = 17,
              .outputs = {{1, 2, 13}, {4, 0, 14}},
              .clip_distances = 3,
              .cull_distances = 2,
              .narrowed = narrowed,
              .name = {},
              .code = {}};
    all[2].writes_point_size = true;
    all[3].has_side_effects = true;
    return all;
}
std::vector<FragmentProgram> fragment_facts() {
    std::vector<FragmentProgram> all(9);
    all[1].inputs = {{1, 2, Interpolation::flat}, {3, 0, Interpolation::linear}};
    all[1].outputs = {{2, 3}};
    all[1].narrowed = narrowed;
    bool FragmentProgram::* const flags[] = {&FragmentProgram::early_tests,      &FragmentProgram::discards,
                                             &FragmentProgram::writes_depth,     &FragmentProgram::writes_sample_mask,
                                             &FragmentProgram::has_side_effects, &FragmentProgram::runs_per_sample,
                                             &FragmentProgram::uses_centroid};
    for (std::size_t i = 0; i < std::size(flags); ++i) all[2 + i].*flags[i] = true;
    return all;
}

template <typename Facts>
void expect_kept(const std::vector<Facts>& all) {
    const StoredCode code{.stack_bytes = 1234, .object = {std::byte{1}, std::byte{2}, std::byte{3}}};
    for (const Facts& facts : all)
        for (const Facts& previous : all) {
            Facts found = previous;
            StoredCode found_code{.stack_bytes = 9, .object = {std::byte{9}}};
            ASSERT_TRUE(from_entry(to_entry(facts, code), found, found_code));
            EXPECT_TRUE(same(found, facts));
            EXPECT_EQ(found_code.stack_bytes, code.stack_bytes);
            EXPECT_EQ(found_code.object, code.object);
        }
    // All but the object, which may be any.
    for (const Facts& facts : all) {
        const std::vector<std::byte> entry = to_entry(facts, {});
        for (std::size_t size = 0; size < entry.size(); ++size) {
            Facts found;
            StoredCode found_code;
            EXPECT_FALSE(from_entry(std::span(entry).first(size), found, found_code)) << size;
            EXPECT_TRUE(same(found, Facts{}));
        }
    }
}

TEST(StoredCode, KeepsWhatIsKnownOfAProgram) {
    expect_kept(compute_facts());
    expect_kept(vertex_facts());
    expect_kept(fragment_facts());
}

TEST(StoredCode, BelievesNoLength) {
    // The first of these is the number of outputs.
    std::vector<std::byte> entry(64, std::byte{0xff});
    VertexProgram vertex;
    FragmentProgram fragment;
    ComputeFacts compute;
    StoredCode code;
    EXPECT_FALSE(from_entry(entry, vertex, code));
    EXPECT_FALSE(from_entry(entry, fragment, code));
    EXPECT_FALSE(from_entry(entry, compute, code));
}

/// Compilers over a cache folder of their own.
class CompiledBefore : public testing::Test {
  protected:
    CompiledBefore() { setenv("NACRE_CACHE_DIR", folder_.path().c_str(), 1); }
    ~CompiledBefore() override {
        if (previous_.empty())
            unsetenv("NACRE_CACHE_DIR");
        else
            setenv("NACRE_CACHE_DIR", previous_.c_str(), 1);
    }

    static std::vector<std::uint32_t> spirv(const std::string& path, const std::string& text) {
        rhi::ShaderCompiler compiler({});
        const auto shader = compiler.compile({.path = path, .text = "#version 460\n" + text});
        EXPECT_TRUE(shader) << shader.error().message();
        return shader ? shader->spirv : std::vector<std::uint32_t>{};
    }
    static std::unique_ptr<Compiler> compiler(CompilerOptions options = {.lanes = 4}) {
        auto made = Compiler::create(options);
        EXPECT_TRUE(made) << made.error().message();
        return std::move(*made);
    }
    /// Keys of all entries, or of those that came since `known`.
    [[nodiscard]] std::set<Hash128> keys(const std::set<Hash128>& known = {}) const {
        std::set<Hash128> found;
        std::error_code error;
        for (const auto& file : std::filesystem::directory_iterator(folder_.path() / "cpu", error)) {
            const std::string name = file.path().filename().native();
            Hash128 key;
            std::from_chars(name.data(), name.data() + 16, key.high, 16);
            std::from_chars(name.data() + 16, name.data() + 32, key.low, 16);
            EXPECT_EQ(name, key.to_string() + ".entry");
            if (!known.contains(key)) found.insert(key);
        }
        return found;
    }
    [[nodiscard]] Hash128 only_key(const std::set<Hash128>& known = {}) const {
        const std::set<Hash128> found = keys(known);
        EXPECT_EQ(found.size(), 1u);
        return found.empty() ? Hash128{} : *found.begin();
    }
    /// Puts what is kept of one shader in the place of what is kept of another.
    void replace(const Hash128& key, const Hash128& by) const {
        const DiskCache cache(folder_.path());
        const auto entry = cache.load("cpu", by);
        ASSERT_TRUE(entry);
        ASSERT_TRUE(cache.store("cpu", key, *entry));
    }

    TemporaryFolder folder_;
    const std::string previous_ = getenv("NACRE_CACHE_DIR") ? getenv("NACRE_CACHE_DIR") : "";
};

TEST_F(CompiledBefore, ComputeShadersAreNotTranslatedAgain) {
    const auto narrow = spirv("a.comp", "layout(local_size_x = 8) in;\nvoid main() {}\n");
    const auto wide = spirv("b.comp", "layout(local_size_x = 32) in;\nvoid main() {}\n");
    ASSERT_TRUE(compiler()->compile_compute({.spirv = narrow, .name = "narrow"}));
    const Hash128 key = only_key();
    ASSERT_TRUE(compiler()->compile_compute({.spirv = wide, .name = "wide"}));
    replace(key, only_key({key}));
    // Whoever looked at the module would see eight.
    const auto found = compiler()->compile_compute({.spirv = narrow, .name = "narrow"});
    ASSERT_TRUE(found) << found.error().message();
    EXPECT_THAT(found->workgroup_size, testing::ElementsAre(32, 1, 1));
    // Without the cache, and where a trace is wanted.
    const auto anew =
        compiler({.lanes = 4, .use_disk_cache = false})->compile_compute({.spirv = narrow, .name = "narrow"});
    ASSERT_TRUE(anew);
    EXPECT_THAT(anew->workgroup_size, testing::ElementsAre(8, 1, 1));
    TraceTable table;
    const auto traced = compiler()->compile_compute({.spirv = narrow, .name = "narrow", .trace = &table});
    ASSERT_TRUE(traced);
    EXPECT_THAT(traced->workgroup_size, testing::ElementsAre(8, 1, 1));
}

TEST_F(CompiledBefore, ShadersOfDrawsAreNotTranslatedAgain) {
    const auto vertex =
        spirv("a.vert", "layout(location = 0) out vec2 a;\nvoid main() { a = vec2(1); gl_Position = vec4(0); }\n");
    const auto other_vertex = spirv("b.vert", "void main() { gl_PointSize = 2.0; gl_Position = vec4(0); }\n");
    const auto fragment = spirv("a.frag", "layout(location = 1) out vec3 a;\nvoid main() { a = gl_FragCoord.xyz; }\n");
    const auto other_fragment = spirv("b.frag", "void main() { discard; }\n");
    const auto check = [&](const auto& compile, const auto& one, const auto& other) {
        const auto known = keys();
        const auto first = compile(one);
        ASSERT_TRUE(first);
        const Hash128 key = only_key(known);
        const auto again = compile(one);
        ASSERT_TRUE(again);
        EXPECT_TRUE(same(*first, *again));
        EXPECT_NE(again->run, nullptr);
        auto both = known;
        both.insert(key);
        const auto second = compile(other);
        ASSERT_TRUE(second);
        ASSERT_FALSE(same(*first, *second));
        replace(key, only_key(both));
        const auto found = compile(one);
        ASSERT_TRUE(found);
        EXPECT_TRUE(same(*found, *second));
    };
    check([&](const auto& words) { return compiler()->compile_vertex({.spirv = words, .name = "a"}, {}); }, vertex,
          other_vertex);
    check([&](const auto& words) { return compiler()->compile_fragment({.spirv = words, .name = "a"}); }, fragment,
          other_fragment);
}

TEST_F(CompiledBefore, WhateverCodeDependsOnIsPartOfTheKey) {
    const auto words = spirv("a.comp",
                             "layout(local_size_x = 8) in;\n"
                             "layout(constant_id = 0) const int a = 0;\nlayout(constant_id = 1) const float b = 0.0;\n"
                             "layout(set = 0, binding = 0) buffer Data { float data[]; };\n"
                             "void main() { data[gl_LocalInvocationIndex] = b + float(a); }\n");
    std::size_t expected = 0;
    const auto expect_new = [&](const CompilerOptions& options, const ShaderSource& source) {
        ASSERT_TRUE(compiler(options)->compile_compute(source));
        EXPECT_EQ(keys().size(), ++expected);
        ASSERT_TRUE(compiler(options)->compile_compute(source));
        EXPECT_EQ(keys().size(), expected);
    };
    const BindingSlots slots[2][1] = {{{.first = 0}}, {{.first = 1}}};
    const rhi::SpecializationConstant constants[] = {{0, 1}, {0, 2}, {1, 1.0f}, {1, 2.0f}};
    const CompilerOptions options{.lanes = 4};
    expect_new(options, {.spirv = words, .name = "a", .slots = slots[0]});
    expect_new(options, {.spirv = words, .name = "a", .slots = slots[1]});
    for (const rhi::SpecializationConstant& constant : constants)
        expect_new(options,
                   {.spirv = words, .name = "a", .specialization = std::span(&constant, 1), .slots = slots[0]});
    expect_new({.lanes = 8}, {.spirv = words, .name = "a", .slots = slots[0]});
    expect_new({.lanes = 4, .mode = ExecutionMode::consistent}, {.spirv = words, .name = "a", .slots = slots[0]});
    // Not on what the shader is called.
    ASSERT_TRUE(compiler(options)->compile_compute({.spirv = words, .name = "b", .slots = slots[0]}));
    EXPECT_EQ(keys().size(), expected);
}

TEST_F(CompiledBefore, CodeWithTooMuchStackIsRefusedAgain) {
    // A copy of an array holds all of it in registers, which are on the stack: 3.4 MiB of doubles in 16 lanes.
    const auto words =
        spirv("large.comp",
              "layout(local_size_x = 16) in;\nlayout(set = 0, binding = 0) buffer Data { float data[]; };\n"
              "void main() {\n    const uint at = gl_LocalInvocationIndex;\n    float a[28000], b[28000];\n"
              "    for (uint i = 0u; i < a.length(); ++i) a[(i + at) % a.length()] = 1.0 / float(i + 3u);\n"
              "    b = a; a[at] = 2.0;\n    data[at] = b[2u * at] + a[at];\n}\n");
    const BindingSlots slots[] = {{}};
    const ShaderSource source{.spirv = words, .name = "large", .slots = slots};
    const CompilerOptions doubles{.lanes = 16, .mode = ExecutionMode::double_precision};
    const auto first = compiler(doubles)->compile_compute(source);
    ASSERT_FALSE(first);
    EXPECT_EQ(first.error().code, ErrorCode::unsupported);
    const Hash128 key = only_key();
    const auto again = compiler(doubles)->compile_compute(source);
    ASSERT_FALSE(again);
    EXPECT_EQ(again.error().message(), first.error().message());
    // It is the entry that says so.
    const auto small = spirv("small.comp", "layout(local_size_x = 8) in;\nvoid main() {}\n");
    ASSERT_TRUE(compiler()->compile_compute({.spirv = small, .name = "small"}));
    replace(key, only_key({key}));
    EXPECT_TRUE(compiler(doubles)->compile_compute(source));
}

}  // namespace
}  // namespace nacre::cpu
