// SPDX-License-Identifier: Apache-2.0
// Structs and arrays on devices in double precision: the same numbers in every memory and across calls.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/backends/cpu/compiler/double_mode_bench.h"

namespace nacre::cpu {
namespace {

using namespace double_mode;

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

}  // namespace
}  // namespace nacre::cpu
