// SPDX-License-Identifier: Apache-2.0
// Devices in double precision ("cpu:double"), against closed forms in double: registers, buffers, workgroup memory,
// images, vertex outputs and planes hold doubles, and what goes through single precision does so and no more.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <spirv-tools/libspirv.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu {
namespace {

using namespace rhi;

/// A device, with what tests ask of it; anything that fails throws.
class Bench {
  public:
    explicit Bench(const std::string& backend) : instance_(all_backends()) {
        device_ = ok(instance_.create_device({.backend = backend, .validation = true}));
    }
    Device& device() { return *device_; }

    template <typename T>
    static T ok(Expected<T> result) {
        if (!result) throw std::runtime_error(result.error().message());
        return *std::move(result);
    }
    static void ok(Expected<void> result) {
        if (!result) throw std::runtime_error(result.error().message());
    }

    Shader shader(const std::string& path, const std::string& body) {
        ShaderCompiler compiler({});
        return ok(device_->create_shader(ok(compiler.compile({.path = path, .text = "#version 460\n" + body}))));
    }
    ComputePipeline compute(const std::string& body) {
        return ok(device_->create_compute_pipeline({.shader = shader("test.comp", body), .name = "test"}));
    }
    Buffer storage(std::uint64_t bytes) {
        return ok(device_->create_buffer({.size = bytes,
                                          .usage = BufferUsage::storage | BufferUsage::copy_source |
                                                   BufferUsage::copy_destination | BufferUsage::vertex |
                                                   BufferUsage::uniform_texel | BufferUsage::storage_texel,
                                          .name = "storage"}));
    }
    BindGroup group(auto pipeline, std::vector<BindGroupEntry> entries) {
        return ok(device_->create_bind_group(
            {.layout = ok(device_->bind_group_layout(pipeline, 0)), .entries = std::move(entries), .name = "group"}));
    }
    void run(CommandList list) { ok(device_->wait(ok(device_->submit(std::move(list))))); }
    void dispatch(const std::string& body, std::vector<BindGroupEntry> entries, std::uint32_t groups = 1) {
        const ComputePipeline pipeline = compute(body);
        CommandList list = device_->create_command_list("dispatch");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group(pipeline, std::move(entries)));
        list.dispatch({groups, 1, 1});
        run(std::move(list));
    }
    template <typename T>
    std::vector<T> read(Buffer from, std::size_t count) {
        const std::vector<std::byte> bytes = ok(device_->read_buffer(from));
        std::vector<T> values(count);
        std::memcpy(values.data(), bytes.data(), count * sizeof(T));
        return values;
    }

  private:
    Instance instance_;
    std::unique_ptr<Device> device_;
};

/// Shader text: what a float really is, as the two words of a double.
const std::string prelude =
    "#extension GL_EXT_samplerless_texture_functions : require\n"
    "layout(local_size_x = 64) in;\n"
    "uint at = gl_GlobalInvocationID.x;\n"
    "uvec2 exactly(float x) { return unpackDouble2x32(double(x)); }\n";
const std::string result = "layout(set = 0, binding = 0) buffer Result { uvec2 result[]; };\n";

TEST(DoubleMode, SumsThatSinglePrecisionGetsWrongAreRight) {
    // The harmonic series from its large end: single precision loses the small terms.
    const std::string text = prelude + result +
                             "void main() { float sum = 0.0;\n"
                             "for (int i = 1; i <= 1000000; ++i) sum += 1.0 / float(i);\n"
                             "if (at == 0) result[0] = exactly(sum); }\n";
    double expected = 0;
    for (int i = 1; i <= 1000000; ++i) expected += 1.0 / i;
    const auto sum = [&](const char* backend) {
        Bench bench(backend);
        const Buffer to = bench.storage(8);
        bench.dispatch(text, {{.binding = 0, .buffer = to}});
        return bench.read<double>(to, 1)[0];
    };
    EXPECT_DOUBLE_EQ(sum("cpu:double"), expected);
    EXPECT_GT(std::abs(sum("cpu:consistent") - expected), 1e-4) << "the sum is too easy to tell anything";
}

TEST(DoubleMode, FunctionsAreThoseOfDoublePrecision) {
    struct Function {
        const char* glsl;
        double (*expected)(double);
    };
    const Function functions[] = {
        {"sin(x)", [](double x) { return std::sin(x); }},
        {"exp(x)", [](double x) { return std::exp(x); }},
        {"pow(x, 1.0 / 3.0)", [](double x) { return std::pow(x, static_cast<double>(1.0f / 3.0f)); }},
        {"sqrt(x)", [](double x) { return std::sqrt(x); }},
        {"inversesqrt(x)", [](double x) { return 1 / std::sqrt(x); }},
        {"log2(x)", [](double x) { return std::log2(x); }},
        {"atan(x, 3.0)", [](double x) { return std::atan2(x, 3.0); }},
        {"smoothstep(0.0, 100.0, x)",
         [](double x) {
             const double t = x / 100;
             return t * t * (3 - 2 * t);
         }},
        {"length(vec3(x, 1.0, 2.0))", [](double x) { return std::sqrt(x * x + 5); }},
        {"normalize(vec3(x, 1.0, 2.0)).x", [](double x) { return x / std::sqrt(x * x + 5); }},
        {"dot(vec2(x), vec2(0.1, x))", [](double x) { return x * static_cast<double>(0.1f) + x * x; }},
        {"inverse(mat2(x, 1.0, 2.0, x))[0].x", [](double x) { return x / (x * x - 2); }},
        {"mod(x, 0.75)", [](double x) { return x - 0.75 * std::floor(x / 0.75); }},
        {"mix(x, 7.0, 0.3)",
         [](double x) {
             const double a = static_cast<double>(0.3f);
             return x * (1 - a) + 7 * a;
         }},
        {"fract(x)", [](double x) { return x - std::floor(x); }},
        {"float(uint(x * 1000.0)) / 3.0", [](double x) { return std::trunc(x * 1000) / 3; }},
        {"subgroupShuffleXor(x, 0)", [](double x) { return x; }},
    };
    std::string text = "#extension GL_KHR_shader_subgroup_shuffle : require\n" + prelude + result +
                       "void main() { float x = (float(at) + 1.5) / 3.0;\n";
    const std::size_t count = std::size(functions);
    for (std::size_t i = 0; i < count; ++i)
        text += "result[at + " + std::to_string(64 * i) + "u] = exactly(" + functions[i].glsl + ");\n";
    for (const char* backend : {"cpu:double", "cpu:double:lanes=4"}) {
        Bench bench(backend);
        const Buffer to = bench.storage(count * 64 * 8);
        bench.dispatch(text + "}\n", {{.binding = 0, .buffer = to}});
        const auto found = bench.read<double>(to, count * 64);
        for (std::size_t i = 0; i < count; ++i)
            for (int at = 0; at < 64; ++at) {
                const double expected = functions[i].expected((at + 1.5) / 3);
                EXPECT_NEAR(found[64 * i + static_cast<std::size_t>(at)], expected,
                            4e-15 * std::max(1.0, std::abs(expected)))
                    << functions[i].glsl << " at " << at << " on " << backend;
            }
    }
}

TEST(DoubleMode, BuffersKeepDoublesBetweenDispatches) {
    Bench bench("cpu:double");
    const Buffer values = bench.storage(64 * 16), copied = bench.storage(64 * 16), to = bench.storage(64 * 3 * 8);
    const std::string block = "struct Part { vec3 v; int n; };\n";
    bench.dispatch(prelude + block +
                       "layout(set = 0, binding = 0) buffer Values { Part parts[]; };\n"
                       "void main() { parts[at].v = vec3(1.0, 2.0, 3.0) / float(at + 7u); parts[at].n = int(at); }\n",
                   {{.binding = 0, .buffer = values}});
    CommandList list = bench.device().create_command_list("copy");
    list.copy_buffer(values, 0, copied, 0, 64 * 16);
    bench.run(std::move(list));
    bench.dispatch(
        prelude + result + block +
            "layout(set = 0, binding = 1) buffer Values { Part parts[]; };\n"
            "void main() { vec3 v = parts[63u - at].v; int n = parts[63u - at].n;\n"
            "result[3 * n] = exactly(v.x); result[3 * n + 1] = exactly(v.y); result[3 * n + 2] = exactly(v.z); }\n",
        {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = copied}});
    const auto found = bench.read<double>(to, 64 * 3);
    for (int at = 0; at < 64; ++at)
        for (int c = 0; c < 3; ++c)
            EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(3 * at + c)], (c + 1.0) / (at + 7)) << at << " " << c;
    // The host sees the rounded values.
    const auto floats = bench.read<float>(copied, 64 * 4);
    EXPECT_EQ(floats[0], static_cast<float>(1.0 / 7));
}

TEST(DoubleMode, WhatTheHostWritesHidesOlderDoubles) {
    Bench bench("cpu:double");
    const Buffer values = bench.storage(64 * 4), to = bench.storage(64 * 8);
    const std::string block = "layout(set = 0, binding = 1) buffer Values { float values[]; };\n";
    bench.dispatch(prelude + block + "void main() { values[at] = 1.0 / float(at + 3u); }\n",
                   {{.binding = 1, .buffer = values}});
    std::vector<float> host(64, 0.1f);
    Bench::ok(bench.device().write_buffer(values, std::as_bytes(std::span(host))));
    const std::string show = prelude + result + block + "void main() { result[at] = exactly(values[at]); }\n";
    bench.dispatch(show, {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = values}});
    EXPECT_EQ(bench.read<double>(to, 64)[5], static_cast<double>(0.1f));
    // And what a shader writes as an integer.
    bench.dispatch(prelude +
                       "layout(set = 0, binding = 1) buffer Values { uint values[]; };\n"
                       "void main() { values[at] = floatBitsToUint(0.3); }\n",
                   {{.binding = 1, .buffer = values}});
    bench.dispatch(show, {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = values}});
    EXPECT_EQ(bench.read<double>(to, 64)[5], static_cast<double>(0.3f));
}

TEST(DoubleMode, WorkgroupMemoryAndArraysKeepDoubles) {
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(prelude + result +
                       "shared float parts[64]; shared int places[64];\n"
                       "void main() { parts[at] = 1.0 / float(at + 3u); places[at] = int(at);\n"
                       "float own[8]; int number[8];\n"
                       "barrier();\n"
                       "for (int i = 0; i < 8; ++i) { own[i] = parts[(at + uint(i)) % 64u]; number[i] = places[(at + "
                       "uint(i)) % 64u]; }\n"
                       "int k = int(at % 8u);\n"
                       "result[at] = exactly(own[k] + float(number[k])); }\n",
                   {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64);
    for (std::size_t at = 0; at < 64; ++at) {
        const std::size_t from = (at + at % 8) % 64;
        EXPECT_DOUBLE_EQ(found[at], 1.0 / static_cast<double>(from + 3) + static_cast<double>(from)) << at;
    }
}

/// Structs of scalars of all widths, in every memory, against what was put into each scalar.
class Aggregates {
  public:
    enum class Kind : std::uint8_t { boolean, integer, floating, wide };
    struct Leaf {
        std::string name;
        Kind kind;
    };

    explicit Aggregates(bool has_wide) : has_wide_(has_wide) {
        const auto leaf = [&](std::string name, Kind kind) { leaves_.push_back({std::move(name), kind}); };
        leaf("n", Kind::integer), leaf("a", Kind::floating);
        for (const std::string inner : {"inner[0].", "inner[1]."}) {
            for (const char* at : {"v.x", "v.y", "v.z"}) leaf(inner + at, Kind::floating);
            leaf(inner + "flag", Kind::boolean);
            for (const char* at : {"m[0].x", "m[0].y", "m[0].z", "m[1].x", "m[1].y", "m[1].z"})
                leaf(inner + at, Kind::floating);
        }
        leaf("k.x", Kind::integer), leaf("k.y", Kind::integer), leaf("odd.x", Kind::boolean);
        leaf("odd.y", Kind::boolean);
        for (const char* at : {"w[0].x", "w[0].y", "w[0].z", "w[0].w", "w[1].x", "w[1].y", "w[1].z", "w[1].w"})
            leaf(at, Kind::floating);
        leaf("b", Kind::floating);
        if (has_wide) leaf("d", Kind::wide);
    }

    [[nodiscard]] std::size_t count() const { return leaves_.size(); }
    [[nodiscard]] const Leaf& operator[](std::size_t i) const { return leaves_[i]; }

    /// The struct, and functions that fill it, change it and show it. They are so large that they stay functions.
    [[nodiscard]] std::string declarations() const {
        std::string text =
            "struct Inner { vec3 v; bool flag; mat2x3 m; };\n"
            "struct Part { uint n; float a; Inner inner[2]; ivec2 k; bvec2 odd; vec4 w[2]; float b;" +
            std::string(has_wide_ ? " double d;" : "") + " };\n";
        std::string ballast = "if (gl_NumWorkGroups.y == 2u) { float x = float(at), y = x + 0.5;\n";
        for (int i = 0; i < 250; ++i) ballast += "x = x * y + 0.25;\n";
        ballast += "result[0] = exactly(x); }\n";
        std::string fill = "void fill(out Part p, uint seed) {\n", turn = "void turn(inout Part p) {\n",
                    show = "void show(Part p, uint place) {\nuint to = (place * 64u + at) * " +
                           std::to_string(count()) + "u;\n";
        for (std::size_t i = 0; i < count(); ++i) {
            const std::string name = "p." + leaves_[i].name, number = "seed + " + std::to_string(i) + "u",
                              to = "result[to + " + std::to_string(i) + "u] = ";
            switch (leaves_[i].kind) {
                case Kind::boolean:
                    fill += name + " = ((" + number + ") & 1u) != 0u;\n";
                    turn += name + " = !" + name + ";\n";
                    show += to + "exactly(" + name + " ? 1.0 : 0.0);\n";
                    break;
                case Kind::integer:
                    fill += name + " = " + (leaves_[i].name == "n" ? "uint(" : "int(") + number + ");\n";
                    turn += name + " += 1;\n";
                    show += to + "exactly(float(" + name + "));\n";
                    break;
                case Kind::floating:
                    fill += name + " = 1.0 / float(" + number + ");\n";
                    turn += name + " *= 3.0;\n";
                    show += to + "exactly(" + name + ");\n";
                    break;
                case Kind::wide:
                    fill += name + " = 1.0lf / double(" + number + ");\n";
                    turn += name + " *= 3.0lf;\n";
                    show += to + "unpackDouble2x32(" + name + ");\n";
                    break;
            }
        }
        return text + fill + ballast + "}\n" + turn + ballast + "}\n" + show + ballast +
               "}\nPart made(uint seed) { Part p; fill(p, seed); return p; }\n";
    }

    /// A constant expression whose scalars are quarters of `first` and what follows.
    [[nodiscard]] std::string constant(unsigned first) const {
        std::size_t at = 0;
        std::string text;
        const auto add = [&](const char* before, unsigned number) {
            text += before;
            for (unsigned i = 0; i < number; ++i, ++at) {
                const std::size_t value = first + at;
                if (i) text += ", ";
                switch (leaves_[at].kind) {
                    case Kind::boolean: text += value % 2 ? "true" : "false"; break;
                    case Kind::integer: text += std::to_string(value); break;
                    case Kind::floating: text += std::to_string(static_cast<double>(value) / 4); break;
                    case Kind::wide: text += std::to_string(static_cast<double>(value) / 4) + "lf"; break;
                }
            }
        };
        add("Part(", 2);
        for (const char* before : {", Inner[2](Inner(vec3(", ", Inner(vec3("})
            add(before, 3), add("), ", 1), add(", mat2x3(", 6), text += "))";
        add("), ivec2(", 2), add("), bvec2(", 2), add("), vec4[2](vec4(", 4), add("), vec4(", 4), add(")), ", 1);
        if (has_wide_) add(", ", 1);
        return text + ")";
    }

    /// What fill(seed) and `turns` calls of turn() leave in scalar i.
    [[nodiscard]] double expected(std::size_t i, unsigned seed, unsigned turns) const {
        const auto number = static_cast<unsigned>(seed + i);
        switch (leaves_[i].kind) {
            case Kind::boolean: return (number + turns) % 2;
            case Kind::integer: return number + turns;
            default: return 1.0 / number * (turns ? 3 : 1);
        }
    }

  private:
    bool has_wide_;
    std::vector<Leaf> leaves_;
};

TEST(DoubleMode, StructsAreTheSameInEveryMemoryAndAcrossCalls) {
    // Where a Part lies, of which seed it is and how often it was turned, for invocation `at`.
    struct Place {
        const char* what;
        const char* text;
        unsigned (*seed)(unsigned at);
        unsigned turns;
    };
    const Place places[] = {
        {"a variable of a function", "Part p; fill(p, at + 3u); turn(p);", [](unsigned at) { return at + 3; }, 1},
        {"one that is equal in all lanes", "Part p; fill(p, one + 6u); turn(p);", [](unsigned) { return 7u; }, 1},
        {"a value", "Part p = made(at + 4u);", [](unsigned at) { return at + 4; }, 0},
        {"a value that is equal in all lanes", "Part p = made(one);", [](unsigned) { return 1u; }, 0},
        {"a private variable", "fill(own, at + 5u); turn(own); Part p = own;", [](unsigned at) { return at + 5; }, 1},
        {"a private variable that is equal in all lanes", "fill(same, one + 8u); turn(same); Part p = same;",
         [](unsigned) { return 9u; }, 1},
        {"filled in branches",
         "Part p; if (at % 3u == 0u) fill(p, at + 1u); else { fill(p, at + 2u); turn(p); turn(p); turn(p); }", nullptr,
         0},
        {"an array, index by lane",
         "Part a[3]; for (uint i = 0u; i < 3u; ++i) fill(a[i], at + i + 1u); turn(a[at % 3u]); Part p = a[at % 3u];",
         [](unsigned at) { return at + at % 3 + 1; }, 1},
        {"an array, one index",
         "Part a[3]; for (uint i = 0u; i < 3u; ++i) a[i] = made(at + i + 1u); turn(a[one]); Part p = a[one];",
         [](unsigned at) { return at + 2; }, 1},
        {"an array that is equal in all lanes, index by lane",
         "Part a[3]; for (uint i = 0u; i < 3u; ++i) fill(a[i], one + i); Part p = a[at % 3u];",
         [](unsigned at) { return at % 3 + 1; }, 0},
        {"workgroup memory", "shared_parts[at] = made(at + 3u); barrier(); Part p = shared_parts[63u - at];",
         [](unsigned at) { return 63 - at + 3; }, 0},
        {"workgroup memory, one for all",
         "if (at == 9u) { shared_part = made(at); turn(shared_part); } barrier(); Part p = shared_part;",
         [](unsigned) { return 9u; }, 1},
        {"a storage buffer", "parts[at] = made(at + 3u); Part p = parts[at]; turn(p);",
         [](unsigned at) { return at + 3; }, 1},
        {"a storage buffer by rows", "row_parts[at] = made(at + 3u); turn(row_parts[at]); Part p = row_parts[at];",
         [](unsigned at) { return at + 3; }, 1},
    };
    struct Device {
        const char* backend;
        double tolerance;
    };
    for (const bool has_wide : {false, true}) {
        const Aggregates part(has_wide);
        const std::vector<Device> narrow = {{"cpu:double", 4e-16}, {"cpu:double:lanes=4", 4e-16}, {"cpu", 2e-7}},
                                  wide = {{"cpu:double", 4e-16}};
        std::string text = prelude + result + "shared float before; shared int between;\n" + part.declarations() +
                           "layout(set = 0, binding = 1, std430) buffer Parts { Part parts[]; };\n"
                           "layout(set = 0, binding = 2, std140, row_major) buffer Rows { Part row_parts[]; };\n"
                           "Part own, same;\nshared Part shared_parts[64], shared_part;\n"
                           "void main() { uint one = gl_NumWorkGroups.x; before = 1.0; between = 2;\n";
        unsigned number = 0;
        for (const Place& place : places)
            text += "{ " + std::string(place.text) + " show(p, " + std::to_string(number++) + "u); }\n";
        // Constant ones.
        text += "const Part a[2] = Part[2](" + part.constant(5) + ", " + part.constant(50) + ");\n";
        text +=
            "show(a[at % 2u], " + std::to_string(number) + "u); show(a[one], " + std::to_string(number + 1) + "u); }\n";
        for (const auto& [backend, tolerance] : has_wide ? wide : narrow) {
            Bench bench(backend);
            const std::size_t count = part.count();
            const Buffer to = bench.storage((std::size(places) + 2) * 64 * count * 8);
            const Buffer parts = bench.storage(64 * 1024), rows = bench.storage(64 * 1024);
            bench.dispatch(
                text, {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = parts}, {.binding = 2, .buffer = rows}});
            const auto found = bench.read<double>(to, (std::size(places) + 2) * 64 * count);
            std::vector<bool> is_wrong(std::size(places) + 2);  // One line for each place tells enough.
            const auto compare = [&](std::size_t place, const char* what, unsigned at, std::size_t i, double expected) {
                const double value = found[(place * 64 + at) * count + i];
                if (std::abs(value - expected) <= tolerance * std::max(1.0, expected) || is_wrong[place]) return;
                is_wrong[place] = true;
                ADD_FAILURE() << part[i].name << " of " << what << " is " << value << " and not " << expected
                              << " in invocation " << at << " on " << backend << (has_wide ? ", beside a double" : "");
            };
            for (unsigned at = 0; at < 64; ++at)
                for (std::size_t i = 0; i < count; ++i) {
                    for (std::size_t place = 0; place < std::size(places); ++place) {
                        const Place& of = places[place];
                        double expected;
                        if (of.seed)
                            expected = part.expected(i, of.seed(at), of.turns);
                        else if (at % 3 == 0)
                            expected = part.expected(i, at + 1, 0);
                        else
                            expected =
                                part.expected(i, at + 2, 3) * (part[i].kind >= Aggregates::Kind::floating ? 9 : 1);
                        compare(place, of.what, at, i, expected);
                    }
                    const auto quarter = [&](unsigned first) {
                        const auto value = static_cast<unsigned>(first + i);
                        return part[i].kind == Aggregates::Kind::boolean   ? value % 2
                               : part[i].kind == Aggregates::Kind::integer ? value
                                                                           : value / 4.0;
                    };
                    compare(std::size(places), "a constant, index by lane", at, i, quarter(at % 2 ? 50 : 5));
                    compare(std::size(places) + 1, "a constant, one index", at, i, quarter(50));
                }
        }
    }
}

TEST(DoubleMode, VariablesThatTakeMoreThanTheStackRun) {
    // 100 arrays, each small enough for the stack: 3 MiB with 16 lanes. Indices that differ keep them from registers.
    const int count = 100, length = 256;
    std::string text = prelude + result + "void main() {\n";
    for (int i = 0; i < count; ++i) {
        const std::string name = "a" + std::to_string(i);
        text += "float " + name + "[" + std::to_string(length) + "];\n";
        text += "for (uint i = 0u; i < " + std::to_string(length) + "u; ++i) " + name + "[(i * 5u + at) % " +
                std::to_string(length) + "u] = float(i) / float(at + " + std::to_string(i + 3) + "u);\n";
    }
    text += "float sum = 0.0;\n";
    for (int i = 0; i < count; ++i)
        text += "sum += a" + std::to_string(i) + "[(at * 7u + " + std::to_string(i) + "u) % " + std::to_string(length) +
                "u];\n";
    text += "result[at] = exactly(sum); }\n";
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(text, {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64);
    for (int at = 0; at < 64; ++at) {
        double sum = 0;
        for (int i = 0; i < count; ++i) {
            int from = 0;  // What was put where it is read.
            while ((from * 5 + at) % length != (at * 7 + i) % length) ++from;
            sum += static_cast<double>(from) / (at + i + 3);
        }
        EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(at)], sum) << at;
    }
}

TEST(DoubleMode, ValuesThatTakeMoreThanTheStackRunWithFewerLanes) {
    // A copy of an array holds all of it in registers, which are on the stack: 3.4 MiB with 16 lanes.
    const int length = 28000;
    const std::string text = prelude + result + "void main() { float a[" + std::to_string(length) + "], b[" +
                             std::to_string(length) +
                             "];\n"
                             "for (uint i = 0u; i < a.length(); ++i) a[(i + at) % a.length()] = 1.0 / float(i + 3u);\n"
                             "b = a; a[at] = 2.0;\n"
                             "result[at] = exactly(b[2u * at] + a[at]); }\n";
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(text, {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64);
    for (std::size_t at = 0; at < 64; ++at) EXPECT_DOUBLE_EQ(found[at], 1.0 / static_cast<double>(at + 3) + 2.0) << at;
}

TEST(DoubleMode, BitsPackingAndAtomicsGoThroughSinglePrecision) {
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 3 * 8);
    bench.dispatch(prelude + result +
                       "void main() { float third = 1.0 / float(at + 3u);\n"
                       "result[3 * at] = exactly(uintBitsToFloat(floatBitsToUint(third)));\n"
                       "result[3 * at + 1] = exactly(unpackUnorm2x16(packUnorm2x16(vec2(third))).x);\n"
                       "result[3 * at + 2] = exactly(unpackHalf2x16(packHalf2x16(vec2(third, 0.5))).y); }\n",
                   {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64 * 3);
    for (std::size_t at = 0; at < 64; ++at) {
        const float third = static_cast<float>(1.0 / static_cast<double>(at + 3));
        EXPECT_EQ(found[3 * at], static_cast<double>(third));
        EXPECT_NEAR(found[3 * at + 1], third, 0.5 / 65535 + 1e-7);
        EXPECT_EQ(found[3 * at + 2], 0.5);
    }
}

TEST(DoubleMode, WhatGoesThroughSinglePrecisionIsListedWithItsLine) {
    Bench bench("cpu:double");
    EXPECT_EQ(bench.device().capabilities().float_bits, 53u);
    bench.compute(
        "layout(local_size_x = 1) in;\n"
        "layout(set = 0, binding = 0) buffer Result { float f; uint u; } r;\n"
        "void main() {\n"
        "r.f = sin(r.f);\n"
        "r.u = floatBitsToUint(r.f);\n"
        "r.f += unpackHalf2x16(r.u).x; }\n");
    const std::vector<NarrowedOperation> found = bench.device().narrowed_operations();
    ASSERT_EQ(found.size(), 2u);
    EXPECT_EQ(found[0], (NarrowedOperation{"test.comp", "test.comp:6", "bit cast"}));
    EXPECT_EQ(found[1], (NarrowedOperation{"test.comp", "test.comp:7", "unpacking"}));
    Bench single("cpu");
    EXPECT_EQ(single.device().capabilities().float_bits, 24u);
    single.compute("layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer R { float f; uint u; } r;\n"
                   "void main() { r.u = floatBitsToUint(r.f); }\n");
    EXPECT_TRUE(single.device().narrowed_operations().empty());
}

TEST(DoubleMode, VariablePointersGoThroughSinglePrecisionAndAreListed) {
    // id / 3 is stored through a pointer that depends on the lane, and through a plain one.
    const std::string text = R"(
        OpCapability Shader
        OpCapability VariablePointersStorageBuffer
        OpExtension "SPV_KHR_variable_pointers"
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %main "main" %index
        OpExecutionMode %main LocalSize 64 1 1
        OpDecorate %index BuiltIn LocalInvocationIndex
        OpDecorate %numbers DescriptorSet 0
        OpDecorate %numbers Binding 0
        OpDecorate %floats ArrayStride 4
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        %void = OpTypeVoid
        %bool = OpTypeBool
        %uint = OpTypeInt 32 0
        %float = OpTypeFloat 32
        %floats = OpTypeRuntimeArray %float
        %block = OpTypeStruct %floats
        %block_pointer = OpTypePointer StorageBuffer %block
        %pointer = OpTypePointer StorageBuffer %float
        %input_pointer = OpTypePointer Input %uint
        %index = OpVariable %input_pointer Input
        %numbers = OpVariable %block_pointer StorageBuffer
        %c0 = OpConstant %uint 0
        %c1 = OpConstant %uint 1
        %c64 = OpConstant %uint 64
        %three = OpConstant %float 3
        %main_type = OpTypeFunction %void
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %further = OpIAdd %uint %id %c64
        %a = OpAccessChain %pointer %numbers %c0 %id
        %b = OpAccessChain %pointer %numbers %c0 %further
        %odd = OpBitwiseAnd %uint %id %c1
        %is_odd = OpINotEqual %bool %odd %c0
        %p = OpSelect %pointer %is_odd %b %a
        %n = OpConvertUToF %float %id
        %third = OpFDiv %float %n %three
        OpStore %PLACE %third
        OpReturn
        OpFunctionEnd
    )";
    for (const bool is_variable : {false, true}) {
        std::string with_place = text;
        with_place.replace(text.find("%PLACE"), 6, is_variable ? "%p" : "%a");
        std::vector<std::uint32_t> words;
        ASSERT_TRUE(spvtools::SpirvTools(SPV_ENV_VULKAN_1_1).Assemble(with_place, &words));
        Bench bench("cpu:double");
        const ComputePipeline pipeline = Bench::ok(bench.device().create_compute_pipeline(
            {.shader = Bench::ok(bench.device().create_shader(
                 {.spirv = std::move(words), .stage = ShaderStage::compute, .name = "pointers"})),
             .name = "pointers"}));
        const std::vector<NarrowedOperation> expected = {{"pointers", "", "variable pointer"}};
        EXPECT_EQ(bench.device().narrowed_operations(), is_variable ? expected : std::vector<NarrowedOperation>());
        const Buffer numbers = bench.storage(128 * 4), to = bench.storage(64 * 8);
        CommandList list = bench.device().create_command_list("pointers");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, bench.group(pipeline, {{.binding = 0, .buffer = numbers}}));
        list.dispatch({});
        bench.run(std::move(list));
        bench.dispatch(prelude + result +
                           "layout(set = 0, binding = 1) buffer Numbers { float numbers[]; };\n"
                           "void main() { result[at] = exactly(numbers[at + " +
                           (is_variable ? "64u * (at % 2u)" : "0u") + "]); }\n",
                       {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = numbers}});
        const auto found = bench.read<double>(to, 64);
        for (std::size_t at = 0; at < 64; ++at) {
            const double third = static_cast<double>(at) / 3;
            EXPECT_EQ(found[at], is_variable ? static_cast<double>(static_cast<float>(third)) : third) << at;
        }
    }
}

TEST(DoubleMode, SubgroupsAreAsLargeAsTheDeviceSays) {
    for (const char* backend : {"cpu:double", "cpu:double:lanes=4", "cpu:double:lanes=8"}) {
        Bench bench(backend);
        const Buffer to = bench.storage(64 * 8);
        bench.dispatch("#extension GL_KHR_shader_subgroup_arithmetic : require\n" + prelude + result +
                           "void main() { result[at] = exactly(subgroupAdd(1.0) + float(gl_SubgroupSize)); }\n",
                       {{.binding = 0, .buffer = to}});
        EXPECT_EQ(bench.read<double>(to, 64)[5], 2.0 * bench.device().capabilities().subgroup_size) << backend;
    }
}

Texture make_texture(Bench& bench, Format format, TextureUsage usage, std::uint32_t size = 64, std::uint32_t mips = 1) {
    return Bench::ok(bench.device().create_texture(
        {.format = format, .width = size, .height = size, .mips = mips, .usage = usage, .name = "texture"}));
}

TEST(DoubleMode, StorageImagesKeepDoublesAndSamplingFiltersThem) {
    Bench bench("cpu:double");
    for (const auto& [format, name] : {std::pair{Format::rgba16_float, "rgba16f"},
                                       std::pair{Format::rgba8_unorm, "rgba8"}, std::pair{Format::r32_float, "r32f"}}) {
        const Texture image = make_texture(bench, format, TextureUsage::storage | TextureUsage::sampled);
        const Buffer to = bench.storage(64 * 2 * 8);
        bench.dispatch(
            prelude + "layout(set = 0, binding = 1, " + name +
                ") writeonly uniform image2D image;\n"
                "void main() { for (int y = 0; y < 64; ++y)\n"
                "imageStore(image, ivec2(at, y), vec4(1.0 / float(at + 3u) / float(y + 1), 0.25, 1.0, 1.0)); }\n",
            {{.binding = 1, .texture = image}});
        const Sampler linear = Bench::ok(bench.device().create_sampler(
            {.address_u = AddressMode::clamp_to_edge, .address_v = AddressMode::clamp_to_edge, .name = "linear"}));
        bench.dispatch(
            prelude + result +
                "layout(set = 0, binding = 1) uniform texture2D image;\n"
                "layout(set = 0, binding = 2) uniform sampler linear;\n"
                "void main() { result[2 * at] = exactly(texelFetch(image, ivec2(at, 5), 0).x);\n"
                "vec2 place = vec2(float(at) + 0.8, 9.9) / 64.0;\n"
                "result[2 * at + 1] = exactly(textureLod(sampler2D(image, linear), place, 0.0).x); }\n",
            {{.binding = 0, .buffer = to}, {.binding = 1, .texture = image}, {.binding = 2, .sampler = linear}});
        const auto found = bench.read<double>(to, 64 * 2);
        const auto value = [](int x, int y) { return 1.0 / (std::min(x, 63) + 3.0) / (y + 1.0); };
        const double fx = static_cast<double>(0.8f) - 0.5, fy = static_cast<double>(9.9f) - 9.5;
        for (int at = 0; at < 64; ++at) {
            EXPECT_NEAR(found[static_cast<std::size_t>(2 * at)], value(at, 5), 1e-16) << name << " " << at;
            const double filtered = (value(at, 9) * (1 - fx) + value(at + 1, 9) * fx) * (1 - fy) +
                                    (value(at, 10) * (1 - fx) + value(at + 1, 10) * fx) * fy;
            EXPECT_NEAR(found[static_cast<std::size_t>(2 * at + 1)], filtered, 1e-14) << name << " " << at;
        }
    }
}

TEST(DoubleMode, TexelBuffersOfFloatsHaveTheDoublesOfTheirBuffer) {
    Bench bench("cpu:double");
    struct Case {
        Format format;
        const char* layout;
        std::size_t channels;
    };
    for (const Case& one : {Case{Format::r32_float, "r32f", 1}, Case{Format::rg32_float, "rg32f", 2},
                            Case{Format::rgba32_float, "rgba32f", 4}}) {
        const std::size_t words = 64 * one.channels;
        const auto value = [](std::size_t word) { return 1.0 / static_cast<double>(3 + word); };
        const auto texels = [&](std::uint32_t binding, Buffer buffer) {
            return BindGroupEntry{.binding = binding, .buffer = buffer, .offset = 32, .format = one.format};
        };
        // Written as a block, fetched and loaded as elements.
        const Buffer block = bench.storage(32 + 4 * words), image = bench.storage(32 + 4 * words),
                     to = bench.storage(words * 2 * 8);
        const std::string channels = std::to_string(one.channels);
        const std::string floats = "layout(set = 0, binding = 1) buffer Floats { float before[8]; float floats[]; };\n";
        bench.dispatch(prelude + floats + "void main() { for (uint c = 0; c < " + channels + "; ++c)\nfloats[at * " + channels +
                           " + c] = 1.0 / float(3 + at * " + channels + " + c); }\n",
                       {{.binding = 1, .buffer = block}});
        bench.dispatch(prelude + result +
                           "layout(set = 0, binding = 1) uniform samplerBuffer fetched;\n"
                           "layout(set = 0, binding = 2, " + one.layout + ") readonly uniform imageBuffer loaded;\n"
                           "layout(set = 0, binding = 3, " + one.layout + ") writeonly uniform imageBuffer stored;\n"
                           "void main() {\nvec4 a = texelFetch(fetched, int(at)), b = imageLoad(loaded, int(at));\n"
                           "imageStore(stored, int(at), b);\nfor (uint c = 0; c < " + channels + "; ++c) {\n"
                           "result[2 * (at * " + channels + " + c)] = exactly(a[c]);\n"
                           "result[2 * (at * " + channels + " + c) + 1] = exactly(b[c]); } }\n",
                       {{.binding = 0, .buffer = to}, texels(1, block), texels(2, block), texels(3, image)});
        auto found = bench.read<double>(to, words * 2);
        for (std::size_t i = 0; i < words; ++i) {
            ASSERT_EQ(found[2 * i], value(i)) << one.layout << " " << i;
            ASSERT_EQ(found[2 * i + 1], value(i)) << one.layout << " " << i;
        }
        // Written as elements, read as a block.
        bench.dispatch(prelude + result + floats + "void main() { for (uint c = 0; c < " + channels +
                           "; ++c) result[at * " + channels + " + c] = exactly(floats[at * " + channels + " + c]); }\n",
                       {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = image}});
        found = bench.read<double>(to, words);
        for (std::size_t i = 0; i < words; ++i) ASSERT_EQ(found[i], value(i)) << one.layout << " " << i;
        // What the host writes hides the doubles.
        std::vector<float> host(8 + words, 0.1f);
        Bench::ok(bench.device().write_buffer(image, std::span<const float>(host)));
        bench.dispatch(prelude + result + "layout(set = 0, binding = 1) uniform samplerBuffer fetched;\n"
                           "void main() { result[at] = exactly(texelFetch(fetched, int(at)).x); }\n",
                       {{.binding = 0, .buffer = to}, texels(1, image)});
        for (const double one_value : bench.read<double>(to, 64)) ASSERT_EQ(one_value, static_cast<double>(0.1f));
    }
    // Other formats hold what their bits hold.
    const Buffer halves = bench.storage(64 * 8), to = bench.storage(64 * 8);
    bench.dispatch(prelude + "layout(set = 0, binding = 1, rgba16f) writeonly uniform imageBuffer stored;\n"
                             "void main() { imageStore(stored, int(at), vec4(1.0 / 3.0)); }\n",
                   {{.binding = 1, .buffer = halves, .format = Format::rgba16_float}});
    bench.dispatch(prelude + result + "layout(set = 0, binding = 1) uniform samplerBuffer fetched;\n"
                                      "void main() { result[at] = exactly(texelFetch(fetched, int(at)).x); }\n",
                   {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = halves, .format = Format::rgba16_float}});
    for (const double one_value : bench.read<double>(to, 64)) ASSERT_EQ(one_value, 0x1.554p-2);
}

TEST(DoubleMode, CodesOfTexturesAreExactInDouble) {
    Bench bench("cpu:double");
    const TextureUsage usage = TextureUsage::sampled | TextureUsage::copy_destination;
    const Texture unorm = make_texture(bench, Format::rgba8_unorm, usage),
                  srgb = make_texture(bench, Format::rgba8_srgb, usage);
    std::vector<std::uint8_t> codes(64 * 64 * 4);
    for (std::size_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<std::uint8_t>(i / 4 % 256);
    Bench::ok(bench.device().write_texture(unorm, std::as_bytes(std::span(codes))));
    Bench::ok(bench.device().write_texture(srgb, std::as_bytes(std::span(codes))));
    const Buffer to = bench.storage(256 * 2 * 8);
    bench.dispatch(prelude + result +
                       "layout(set = 0, binding = 1) uniform texture2D codes;\n"
                       "layout(set = 0, binding = 2) uniform texture2D curved;\n"
                       "void main() { ivec2 place = ivec2(at % 64u, at / 64u);\n"
                       "result[2 * at] = exactly(texelFetch(codes, place, 0).x);\n"
                       "result[2 * at + 1] = exactly(texelFetch(curved, place, 0).x); }\n",
                   {{.binding = 0, .buffer = to}, {.binding = 1, .texture = unorm}, {.binding = 2, .texture = srgb}},
                   4);
    const auto found = bench.read<double>(to, 256 * 2);
    for (int code = 0; code < 256; ++code) {
        const double c = code / 255.0;
        EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(2 * code)], c);
        EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(2 * code + 1)],
                         c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4))
            << code;
    }
}

/// Draws into an rgba32_float target, once for each of `draws`, and gives its texels back as the doubles that they are.
class Picture {
  public:
    static constexpr std::uint32_t size = 16;
    explicit Picture(Bench& bench, Format format = Format::rgba32_float, std::uint32_t samples = 1)
        : bench_(bench), samples_(samples) {
        const TextureUsage usage = TextureUsage::color_target | TextureUsage::sampled;
        target_ = make_texture(bench, format, usage, size);
        depth_ = make_texture(bench, Format::d32_float, TextureUsage::depth_target | TextureUsage::sampled, size);
        if (samples == 1) return;
        many_ = Bench::ok(bench.device().create_texture({.format = format,
                                                         .width = size,
                                                         .height = size,
                                                         .samples = samples,
                                                         .usage = TextureUsage::color_target,
                                                         .name = "many"}));
    }

    void draw(GraphicsPipelineDesc desc, const std::string& vertex, const std::string& fragment, std::uint32_t draws,
              Buffer vertices = {}) {
        desc.vertex = bench_.shader("test.vert", vertex), desc.fragment = bench_.shader("test.frag", fragment);
        desc.samples = samples_;
        const bool has_depth = desc.depth_stencil.format != Format::undefined;
        desc.name = "test";
        const GraphicsPipeline pipeline = Bench::ok(bench_.device().create_graphics_pipeline(desc));
        CommandList list = bench_.device().create_command_list("draw");
        RenderPassDesc pass{.name = "draw"};
        pass.color = {{.view = samples_ == 1 ? target_ : many_, .load = LoadOperation::clear}};
        if (samples_ > 1) pass.color[0].resolve = target_;
        if (has_depth) pass.depth_stencil = {.view = depth_, .depth_load = LoadOperation::clear, .clear_depth = 1.0f};
        list.begin_render_pass(pass);
        list.set_pipeline(pipeline);
        if (vertices) list.set_vertex_buffer(0, vertices, 0);
        for (std::uint32_t i = 0; i < draws; ++i) list.draw({.vertex_count = 3});
        list.end_render_pass();
        bench_.run(std::move(list));
    }

    /// Four channels of each texel; `depth`: of the depth target.
    std::vector<double> texels(bool depth = false) {
        const Buffer to = bench_.storage(size * size * 4 * 8);
        bench_.dispatch(prelude + result +
                            "layout(set = 0, binding = 1) uniform texture2D image;\n"
                            "void main() { vec4 texel = texelFetch(image, ivec2(at % 16u, at / 16u), 0);\n"
                            "for (int c = 0; c < 4; ++c) result[4 * at + c] = exactly(texel[c]); }\n",
                        {{.binding = 0, .buffer = to}, {.binding = 1, .texture = depth ? depth_ : target_}}, 4);
        return bench_.read<double>(to, size * size * 4);
    }

  private:
    Bench& bench_;
    std::uint32_t samples_;
    Texture target_, depth_, many_;
};

TEST(DoubleMode, ValuesBetweenTheStagesAreInterpolatedInDouble) {
    Bench bench("cpu:double");
    Picture picture(bench);
    GraphicsPipelineDesc desc;
    desc.color_targets = {{.format = Format::rgba32_float}};
    desc.depth_stencil = {
        .format = Format::d32_float, .depth_test = true, .depth_write = true, .depth_compare = CompareOperation::less};
    // A triangle that covers all pixels, with a different w at each vertex.
    picture.draw(
        desc,
        "layout(location = 0) out float perspective;\n"
        "layout(location = 1) noperspective out float linear;\n"
        "layout(location = 2) flat out float constant;\n"
        "layout(location = 3) flat out int number;\n"
        "void main() { vec2 corner = vec2(gl_VertexIndex == 1 ? 7.0 : -1.0, gl_VertexIndex == 2 ? 7.0 : -1.0);\n"
        "float w = float(gl_VertexIndex + 1);\n"
        "perspective = 1.0 / float(gl_VertexIndex + 3); linear = perspective; constant = perspective; number = "
        "gl_VertexIndex + 5;\n"
        "gl_Position = vec4(corner * w, w / float(gl_VertexIndex + 3), w); }\n",
        "layout(location = 0) in float perspective;\n"
        "layout(location = 1) noperspective in float linear;\n"
        "layout(location = 2) flat in float constant;\n"
        "layout(location = 3) flat in int number;\n"
        "layout(location = 0) out vec4 color;\n"
        "void main() { color = vec4(perspective, linear, gl_FragCoord.z, constant + float(number)); }\n",
        1);
    const std::vector<double> found = picture.texels(), depths = picture.texels(true);
    for (std::uint32_t y = 0; y < 16; ++y)
        for (std::uint32_t x = 0; x < 16; ++x) {
            const double nx = (x + 0.5) / 8 - 1, ny = (y + 0.5) / 8 - 1;
            const double b1 = (nx + 1) / 8, b2 = (ny + 1) / 8, b0 = 1 - b1 - b2;
            const double values[3] = {1.0 / 3, 1.0 / 4, 1.0 / 5};
            const double linear = b0 * values[0] + b1 * values[1] + b2 * values[2];
            const double numerator = b0 * values[0] + b1 * values[1] / 2 + b2 * values[2] / 3,
                         denominator = b0 + b1 / 2 + b2 / 3;
            const std::size_t at = (y * 16 + x) * 4;
            EXPECT_NEAR(found[at], numerator / denominator, 1e-14) << x << " " << y;
            EXPECT_NEAR(found[at + 1], linear, 1e-14) << x << " " << y;
            EXPECT_NEAR(found[at + 2], linear, 1e-14) << x << " " << y;
            EXPECT_NEAR(found[at + 3], 1.0 / 3 + 5, 1e-15) << x << " " << y;
            EXPECT_NEAR(depths[at], linear, 1e-14) << x << " " << y;
        }
}

TEST(DoubleMode, ArraysAndStructsBetweenTheStagesKeepDoublesWhateverTheIndex) {
    Bench bench("cpu:double");
    Picture picture(bench);
    GraphicsPipelineDesc desc;
    desc.color_targets = {{.format = Format::rgba32_float}};
    const std::string types = "struct Pair { vec2 v; float a; };\n";
    picture.draw(
        desc,
        types +
            "layout(location = 0) out Pair pairs[3];\n"
            "layout(location = 6) flat out int numbers[3];\n"
            "void main() { for (int i = 0; i < 3; ++i) { float k = float(3 * i + gl_InstanceIndex + 3);\n"
            "pairs[i].v = vec2(1.0 / k, 1.0 / (k + 1.0)); pairs[i].a = 1.0 / (k + 2.0);\n"
            "numbers[i] = i + 7 + gl_InstanceIndex; }\n"
            "gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.0, 1.0); }\n",
        types +
            "layout(location = 0) in Pair pairs[3];\n"
            "layout(location = 6) flat in int numbers[3];\n"
            "layout(location = 0) out vec4 color;\n"
            "void main() { int i = int(gl_FragCoord.x) % 3, j = int(gl_FragCoord.y) % 2;\n"
            "Pair pair = pairs[i]; color = vec4(pair.v[j], pairs[i].a, float(numbers[i]), pairs[2].v.x); }\n",
        1);
    const auto found = picture.texels();
    for (std::size_t y = 0; y < 16; ++y)
        for (std::size_t x = 0; x < 16; ++x) {
            const double k = static_cast<double>(3 * (x % 3) + 3);
            const double* texel = &found[(y * 16 + x) * 4];
            EXPECT_NEAR(texel[0], 1.0 / (k + static_cast<double>(y % 2)), 1e-15) << x << " " << y;
            EXPECT_NEAR(texel[1], 1.0 / (k + 2.0), 1e-15) << x << " " << y;
            EXPECT_EQ(texel[2], static_cast<double>(x % 3 + 7)) << x << " " << y;
            EXPECT_NEAR(texel[3], 1.0 / 9, 1e-15) << x << " " << y;
        }
}

TEST(DoubleMode, VerticesThatShadersWroteKeepTheirDoubles) {
    Bench bench("cpu:double");
    const Buffer vertices = bench.storage(3 * 16);
    bench.dispatch(prelude +
                       "layout(set = 0, binding = 0) buffer Vertices { vec4 vertices[]; };\n"
                       // Constant expressions are computed in single precision, long before any device sees them.
                       "void main() { float zero = float(gl_NumWorkGroups.x - 1u); if (at < 3u) vertices[at] = vec4(at "
                       "== 1u ? 3.0 : -1.0, at == 2u ? 3.0 : -1.0, 1.0 / (3.0 + zero), 1.0 / (7.0 + zero)); }\n",
                   {{.binding = 0, .buffer = vertices}});
    Picture picture(bench);
    GraphicsPipelineDesc desc;
    desc.vertex_attributes = {{.location = 0, .format = Format::rgba32_float}};
    desc.vertex_buffers = {{.stride = 16}};
    desc.color_targets = {{.format = Format::rgba32_float}};
    picture.draw(desc,
                 "layout(location = 0) in vec4 vertex; layout(location = 0) out vec2 value;\n"
                 "void main() { value = vertex.zw; gl_Position = vec4(vertex.xy, 0.0, 1.0); }\n",
                 "layout(location = 0) in vec2 value; layout(location = 0) out vec4 color;\n"
                 "void main() { color = vec4(value, dFdx(gl_FragCoord.x * value.x), 1.0); }\n",
                 1, vertices);
    const auto found = picture.texels();
    EXPECT_NEAR(found[0], 1.0 / 3, 1e-15);
    EXPECT_NEAR(found[1], 1.0 / 7, 1e-15);
    EXPECT_NEAR(found[2], 1.0 / 3, 1e-14);
}

TEST(DoubleMode, BlendingAddsDoublesWhateverTheFormat) {
    for (const Format format : {Format::rgba16_float, Format::rgba8_unorm, Format::rgba32_float})
        for (const std::uint32_t samples : {1u, 4u}) {
            Bench bench("cpu:double");
            Picture picture(bench, format, samples);
            GraphicsPipelineDesc desc;
            desc.color_targets = {{.format = format,
                                   .blend = {.enabled = true,
                                             .source_color = BlendFactor::source_alpha,
                                             .destination_color = BlendFactor::one},
                                   .write_mask = 7}};
            picture.draw(desc,
                         "void main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 "
                         ": -1.0, 0.0, 1.0); }\n",
                         "layout(location = 0) out vec4 color; void main() { color = vec4(1.0 / (3.0 + "
                         "gl_FragCoord.z), gl_FragCoord.x / 300.0, 0.0, 0.1); }\n",
                         7);
            const auto found = picture.texels();
            for (std::size_t x = 0; x < 16; ++x) {
                EXPECT_NEAR(found[4 * x], 7.0 / 3 * static_cast<double>(0.1f), 1e-14)
                    << rhi::info(format).name << " " << samples;
                EXPECT_NEAR(found[4 * x + 1], 7 * (static_cast<double>(x) + 0.5) / 300 * static_cast<double>(0.1f),
                            1e-14);
                EXPECT_EQ(found[4 * x + 3], 0.0);
            }
        }
}

TEST(DoubleMode, MipsAreAveragesOfDoubles) {
    Bench bench("cpu:double");
    const Texture image = make_texture(bench, Format::rgba8_unorm,
                                       TextureUsage::storage | TextureUsage::sampled | TextureUsage::copy_source |
                                           TextureUsage::copy_destination | TextureUsage::color_target,
                                       16, 3);
    bench.dispatch(
        prelude +
            "layout(set = 0, binding = 1, rgba8) writeonly uniform image2D image;\n"
            "void main() { if (at < 16u) for (int y = 0; y < 16; ++y)\n"
            "imageStore(image, ivec2(at, y), vec4(1.0 / float(at + 3u) / float(y + 1), 0.25, 1.0, 1.0)); }\n",
        {{.binding = 1, .texture = TextureView::subresource(image, 0)}});
    CommandList list = bench.device().create_command_list("mips");
    list.generate_mips(image);
    bench.run(std::move(list));
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(
        prelude + result +
            "layout(set = 0, binding = 1) uniform texture2D image;\n"
            "void main() { if (at < 16u) result[at] = exactly(texelFetch(image, ivec2(at % 4u, at / 4u), 2).x); }\n",
        {{.binding = 0, .buffer = to}, {.binding = 1, .texture = image}});
    const auto found = bench.read<double>(to, 16);
    for (std::size_t at = 0; at < 16; ++at) {
        double sum = 0;
        for (std::size_t y = 0; y < 4; ++y)
            for (std::size_t x = 0; x < 4; ++x)
                sum += 1.0 / static_cast<double>(at % 4 * 4 + x + 3) / static_cast<double>(at / 4 * 4 + y + 1) / 16;
        EXPECT_NEAR(found[at], sum, 1e-15) << at;
    }
}

}  // namespace
}  // namespace nacre::cpu
