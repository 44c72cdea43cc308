// SPDX-License-Identifier: Apache-2.0
// Functions of vectors and matrices, and interpolation, in shaders, in 16, 32 and 64 bits and at all lane widths, where
// their arguments are zero, denormal, infinite, NaN or so large that squares overflow; against what the formulas may
// give from which Vulkan derives their precision ("Precision and Operation of SPIR-V Instructions").
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "tests/backends/cpu/compiler/compute_runner.h"
#include "tests/backends/cpu/compiler/half_number.h"
#include "tests/backends/cpu/compiler/value_range.h"

namespace nacre::cpu {
namespace {

using Word = std::uint32_t;
using Ranges = std::vector<Range>;

const char* const specs[] = {"cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16",
                             "cpu:fast:lanes=4",       "cpu:fast:lanes=8",       "cpu:fast:lanes=16"};

/// How GLSL and the test see a type of numbers.
template <typename T>
struct Kind;
template <>
struct Kind<Half> {
    static constexpr const char* name = "f16";
    static constexpr const char* prefix = "f16";
    static constexpr const char* scalar = "float16_t";
    static constexpr const char* read = "unpackFloat2x16(edges[i]).x";
    static constexpr const char* write = "result[i] = packFloat2x16(f16vec2(x, float16_t(0.0)));";
    static constexpr std::size_t words = 1;
    static const Precision& precision() { return half_precision; }
    static constexpr double least_normal = 0x1p-14, greatest = 65504;
    static Half from(const Word* word) {
        Half half;
        half.bits = static_cast<std::uint16_t>(word[0]);
        return half;
    }
    static std::vector<Word> to(double x) { return {Half(x).bits}; }
};
template <>
struct Kind<float> {
    static constexpr const char* name = "f32";
    static constexpr const char* prefix = "";
    static constexpr const char* scalar = "float";
    static constexpr const char* read = "uintBitsToFloat(edges[i])";
    static constexpr const char* write = "result[i] = floatBitsToUint(x);";
    static constexpr std::size_t words = 1;
    static const Precision& precision() { return single_precision; }
    static constexpr double least_normal = 0x1p-126, greatest = std::numeric_limits<float>::max();
    static float from(const Word* word) { return std::bit_cast<float>(word[0]); }
    static std::vector<Word> to(double x) { return {std::bit_cast<Word>(static_cast<float>(x))}; }
};
template <>
struct Kind<double> {
    static constexpr const char* name = "f64";
    static constexpr const char* prefix = "d";
    static constexpr const char* scalar = "double";
    static constexpr const char* read = "packDouble2x32(uvec2(edges[2u * i], edges[2u * i + 1u]))";
    static constexpr const char* write =
        "uvec2 both = unpackDouble2x32(x); result[2u * i] = both.x; result[2u * i + 1u] = both.y;";
    static constexpr std::size_t words = 2;
    static const Precision& precision() { return twice_precision; }
    static constexpr double least_normal = std::numeric_limits<double>::min(),
                            greatest = std::numeric_limits<double>::max();
    static double from(const Word* word) { return std::bit_cast<double>(word[0] | std::uint64_t{word[1]} << 32); }
    static std::vector<Word> to(double x) {
        const auto bits = std::bit_cast<std::uint64_t>(x);
        return {static_cast<Word>(bits), static_cast<Word>(bits >> 32)};
    }
};

using Vector = std::array<double, 4>;

/// Vectors at the edges of the type; of shorter ones the first elements count.
template <typename T>
std::vector<Vector> edge_vectors() {
    const double most = Kind<T>::greatest, root = std::sqrt(most), least = Kind<T>::least_normal, tiny = least / 4,
                 small = std::sqrt(least), infinity = HUGE_VAL, nan = std::nan("");
    std::vector<Vector> vectors{{0, 0, 0, 0},
                                {-0.0, 0, -0.0, 0},
                                {1, 0, 0, 0},
                                {0, 0, 1, 0},
                                {1, 2, 3, 4},
                                {-1.5, 0.25, 2, -3},
                                {0.6, 0.8, 0, 0},
                                {-0.6, -0.8, 0, 0},
                                {most, 0, 0, 0},
                                {most, most, most, most},
                                {most, -most, 1, 1},
                                {2 * root, 2 * root, -root, root},
                                {root / 4, root / 4, root / 4, root / 4},
                                {least, least, least, least},
                                {small, small, small, small},
                                {small / 64, 0, 0, -small / 64},
                                {tiny, tiny, tiny, tiny},
                                {1, tiny, 0, least},
                                {infinity, 0, 0, 0},
                                {infinity, infinity, 1, 1},
                                {-infinity, 1, 2, 3},
                                {nan, 0, 0, 0},
                                {1, nan, 1, 1},
                                {infinity, nan, 0, 1}};
    // As the type holds them.
    for (Vector& vector : vectors)
        for (double& x : vector) {
            const auto words = Kind<T>::to(x);
            x = static_cast<double>(Kind<T>::from(words.data()));
        }
    return vectors;
}

std::string words_text(const std::vector<Word>& words) {
    std::string text;
    for (const Word word : words) text += fmt::format("{}{:#x}u", text.empty() ? "" : ", ", word);
    return text;
}

/// A shader of 64 invocations that runs `body` for each case (`at`, below `cases`) with the functions `read(i)` of the
/// numbers and `write(i, x)` of the results.
template <typename T>
std::string shader_of(const std::vector<double>& numbers, std::size_t cases, const std::string& body) {
    std::vector<Word> words;
    for (const double number : numbers)
        for (const Word word : Kind<T>::to(number)) words.push_back(word);
    return fmt::format(
        "#extension GL_EXT_shader_explicit_arithmetic_types : require\n"
        "layout(local_size_x = 64) in;\nlayout(set = 0, binding = 0) buffer Result {{ uint result[]; }};\n"
        "const uint edges[{0}] = uint[]({1});\n"
        "{2} read(uint i) {{ return {3}; }}\nvoid write(uint i, {2} x) {{ {4} }}\n"
        "void main() {{ for (uint at = gl_LocalInvocationIndex; at < {5}u; at += 64u) {{\n{6}}} }}\n",
        words.size(), words_text(words), Kind<T>::scalar, Kind<T>::read, Kind<T>::write, cases, body);
}

template <typename T>
std::vector<double> run(const std::string& spec, const std::string& text, std::size_t results) {
    const ComputeRunner runner{.spec = spec, .result_words = static_cast<Word>(results * Kind<T>::words)};
    const auto found = runner.run_glsl(text);
    if (!found) {
        ADD_FAILURE() << spec << ": " << found.error().message();
        return {};
    }
    std::vector<double> values(results);
    for (std::size_t i = 0; i < results; ++i)
        values[i] = static_cast<double>(Kind<T>::from(found->data() + i * Kind<T>::words));
    return values;
}

std::string text_of(const Vector& vector, std::size_t size) {
    std::string text;
    for (std::size_t i = 0; i < size; ++i) text += fmt::format("{}{:.9g}", i ? ", " : "", vector[i]);
    return "(" + text + ")";
}

// ---- Functions of vectors

struct Arguments {
    const RangeArithmetic& r;
    Ranges a, b, c;
    Range eta;
};

struct Function {
    const char* glsl;  ///< Of a, b, c and eta.
    bool is_vector;    ///< Else one number.
    std::size_t only_size;
    std::function<Ranges(const Arguments&)> expected;
};

Ranges each(std::size_t size, const std::function<Range(std::size_t)>& make) {
    Ranges made;
    for (std::size_t i = 0; i < size; ++i) made.push_back(make(i));
    return made;
}

Range length_of(const RangeArithmetic& r, const Ranges& x) { return r.root(r.dot(x, x)); }

const Function functions[] = {
    {"length(a)", false, 0, [](const Arguments& v) { return Ranges{length_of(v.r, v.a)}; }},
    {"distance(a, b)", false, 0,
     [](const Arguments& v) {
         return Ranges{length_of(v.r, each(v.a.size(), [&](std::size_t i) { return v.r.subtract(v.a[i], v.b[i]); }))};
     }},
    {"dot(a, b)", false, 0, [](const Arguments& v) { return Ranges{v.r.dot(v.a, v.b)}; }},
    {"normalize(a)", true, 0,
     [](const Arguments& v) {
         const Range square = v.r.dot(v.a, v.a);
         return each(v.a.size(), [&](std::size_t i) {
             Range made = RangeArithmetic::either(v.r.multiply(v.a[i], v.r.inverse_root(square)),
                                                  v.r.divide(v.a[i], v.r.root(square)));
             // The sign of a single number, whatever its size.
             if (v.a.size() == 1 && v.a[i].has_numbers)
                 made = RangeArithmetic::either(made, {v.a[i].low < 0 ? -1.0L : 0.0L, v.a[i].high > 0 ? 1.0L : 0.0L});
             return made;
         });
     }},
    {"mix(a, b, eta)", true, 0,
     [](const Arguments& v) {
         const Range rest = v.r.subtract(v.r.value(1), v.eta);
         return each(v.a.size(), [&](std::size_t i) {
             return RangeArithmetic::either(v.r.add(v.r.multiply(v.a[i], rest), v.r.multiply(v.b[i], v.eta)),
                                            v.r.add(v.a[i], v.r.multiply(v.r.subtract(v.b[i], v.a[i]), v.eta)));
         });
     }},
    {"smoothstep(a, b, c)", true, 0,
     [](const Arguments& v) {
         return each(v.a.size(), [&](std::size_t i) {
             const Range t =
                 RangeArithmetic::clamp(v.r.divide(v.r.subtract(v.c[i], v.a[i]), v.r.subtract(v.b[i], v.a[i])), 0, 1);
             const Range rest = v.r.subtract(v.r.value(3), v.r.multiply(v.r.value(2), t));
             return v.r.multiply(v.r.multiply(t, t), rest);
         });
     }},
    {"cross(a, b)", true, 3,
     [](const Arguments& v) {
         return each(3, [&](std::size_t i) {
             const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
             return v.r.subtract(v.r.multiply(v.a[j], v.b[k]), v.r.multiply(v.b[j], v.a[k]));
         });
     }},
    {"reflect(a, b)", true, 0,
     [](const Arguments& v) {
         const Range dot = v.r.dot(v.b, v.a);
         return each(v.a.size(), [&](std::size_t i) {
             return v.r.subtract(v.a[i], v.r.multiply(v.r.multiply(v.r.value(2), dot), v.b[i]));
         });
     }},
    {"refract(a, b, eta)", true, 0,
     [](const Arguments& v) {
         const Range dot = v.r.dot(v.b, v.a), one = v.r.value(1);
         const Range turned = v.r.subtract(one, v.r.multiply(dot, dot));
         // eta * eta * turned, whichever product comes first.
         const Range product = RangeArithmetic::either(v.r.multiply(v.r.multiply(v.eta, v.eta), turned),
                                                       v.r.multiply(v.eta, v.r.multiply(v.eta, turned)));
         const Range k = v.r.subtract(one, product);
         const bool may_reflect = k.has_numbers && k.low < 0, may_bend = k.can_be_nan || k.high >= 0;
         Range kept = k;
         kept.low = std::max(kept.low, 0.0L);
         return each(v.a.size(), [&](std::size_t i) {
             const Range along = v.r.add(v.r.multiply(v.eta, dot), may_bend ? v.r.root(kept) : RangeArithmetic::nan());
             const Range bent = v.r.subtract(v.r.multiply(v.eta, v.a[i]), v.r.multiply(along, v.b[i]));
             if (!may_bend) return v.r.value(0);
             return may_reflect ? RangeArithmetic::either(bent, v.r.value(0)) : bent;
         });
     }},
    {"faceforward(a, b, c)", true, 0,
     [](const Arguments& v) {
         const Range dot = v.r.dot(v.c, v.b);
         const bool may_be_less = dot.has_numbers && dot.low < 0,
                    may_be_more = dot.can_be_nan || !dot.has_numbers || dot.high >= 0;
         return each(v.a.size(), [&](std::size_t i) {
             if (!may_be_more) return v.a[i];
             const Range turned = v.r.negate(v.a[i]);
             return may_be_less ? RangeArithmetic::either(v.a[i], turned) : turned;
         });
     }},
};

template <typename T>
class GeometryEdges : public testing::Test {};
using Numbers = testing::Types<Half, float, double>;
struct Names {
    template <typename T>
    static std::string GetName(int) {
        return Kind<T>::name;
    }
};
TYPED_TEST_SUITE(GeometryEdges, Numbers, Names);

TYPED_TEST(GeometryEdges, FunctionsOfVectorsGiveWhatTheirFormulasMay) {
    using K = Kind<TypeParam>;
    const RangeArithmetic r(K::precision());
    const auto vectors = edge_vectors<TypeParam>();
    const std::size_t count = vectors.size(), cases = count * count;
    const std::vector<double> etas{0.75, 1.5, 0, 1, HUGE_VAL, std::nan(""), 1e-3};
    std::vector<double> numbers;
    for (const Vector& vector : vectors) numbers.insert(numbers.end(), vector.begin(), vector.end());
    numbers.insert(numbers.end(), etas.begin(), etas.end());
    const auto third = [&](std::size_t at) { return (at / count * 7 + at % count * 5 + 3) % count; };
    for (std::size_t size = 1; size <= 4; ++size) {
        std::string body = fmt::format(
            "uint first = at / {0}u, second = at % {0}u, other = (first * 7u + second * 5u + 3u) % {0}u;\n"
            "{1} eta = read({2}u + at % {3}u);\n",
            count, K::scalar, count * 4, etas.size());
        const std::string type = size == 1 ? K::scalar : fmt::format("{}vec{}", K::prefix, size);
        for (const auto& [name, from] : {std::pair{"a", "first"}, {"b", "second"}, {"c", "other"}}) {
            body += fmt::format("{} {} = {}(", type, name, type);
            for (std::size_t i = 0; i < size; ++i) body += fmt::format("{}read({} * 4u + {}u)", i ? ", " : "", from, i);
            body += ");\n";
        }
        std::size_t rows = 0;
        for (const Function& function : functions) {
            if (function.only_size != 0 && function.only_size != size) continue;
            if (!function.is_vector || size == 1) {
                body += fmt::format("write({}u + at, {});\n", rows++ * cases, function.glsl);
                continue;
            }
            body += fmt::format("{{ {} made = {};\n", type, function.glsl);
            for (std::size_t i = 0; i < size; ++i)
                body += fmt::format("write({}u + at, made[{}]);\n", rows++ * cases, i);
            body += "}\n";
        }
        const std::string text = shader_of<TypeParam>(numbers, cases, body);
        for (const char* spec : specs) {
            const auto found = run<TypeParam>(spec, text, rows * cases);
            ASSERT_FALSE(found.empty());
            std::map<const char*, int> wrong;  // By function: a few say enough.
            for (std::size_t at = 0; at < cases; ++at) {
                const std::array<std::size_t, 3> which{at / count, at % count, third(at)};
                std::array<Ranges, 3> ranges;
                for (std::size_t k = 0; k < 3; ++k)
                    ranges[k] = each(size, [&](std::size_t i) { return r.value(vectors[which[k]][i]); });
                const double eta = static_cast<double>(K::from(K::to(etas[at % etas.size()]).data()));
                const Arguments arguments{r, ranges[0], ranges[1], ranges[2], r.value(eta)};
                std::size_t row = 0;
                for (const Function& function : functions) {
                    if (function.only_size != 0 && function.only_size != size) continue;
                    for (const Range& range : function.expected(arguments)) {
                        const double value = found[row++ * cases + at];
                        if (r.contains(range, value) || ++wrong[function.glsl] > 3) continue;
                        ADD_FAILURE() << spec << ", " << K::name << " " << function.glsl << " of "
                                      << text_of(vectors[which[0]], size) << ", " << text_of(vectors[which[1]], size)
                                      << ", " << text_of(vectors[which[2]], size) << ", eta " << eta << ": " << value
                                      << ", not " << static_cast<double>(range.low) << " to "
                                      << static_cast<double>(range.high) << (range.can_be_nan ? " or NaN" : "");
                    }
                }
                ASSERT_EQ(row, rows);
            }
        }
    }
}

// ---- Products of all shapes

TYPED_TEST(GeometryEdges, ProductsOfAllShapesGiveWhatTheirFormulasMay) {
    using K = Kind<TypeParam>;
    const RangeArithmetic r(K::precision());
    const auto vectors = edge_vectors<TypeParam>();
    const std::size_t count = vectors.size(), cases = count * 3;
    std::vector<double> numbers;
    for (const Vector& vector : vectors) numbers.insert(numbers.end(), vector.begin(), vector.end());
    // Column c of the first matrix of a case is vector (case + c * step) mod count; of the second, one further on.
    const auto column = [&](std::size_t at, std::size_t c, std::size_t more) {
        return (at % count + c * (1 + 4 * (at / count)) + more) % count;
    };
    const auto matrix_text = [&](const char* name, std::size_t columns, std::size_t rows, std::size_t more) {
        std::string text = fmt::format("{0}mat{1}x{2} {3} = {0}mat{1}x{2}(", K::prefix, columns, rows, name);
        for (std::size_t c = 0; c < columns; ++c)
            for (std::size_t i = 0; i < rows; ++i)
                text += fmt::format("{}read((at % {}u + {}u * (1u + 4u * (at / {}u)) + {}u) % {}u * 4u + {}u)",
                                    c + i ? ", " : "", count, c, count, more, count, i);
        return text + ");\n";
    };
    const auto vector_text = [&](const char* name, std::size_t size, std::size_t more) {
        std::string text = fmt::format("{0}vec{1} {2} = {0}vec{1}(", K::prefix, size, name);
        for (std::size_t i = 0; i < size; ++i)
            text += fmt::format("{}read((at % {}u + {}u) % {}u * 4u + {}u)", i ? ", " : "", count, more, count, i);
        return text + ");\n";
    };
    for (std::size_t columns = 2; columns <= 4; ++columns)
        for (std::size_t rows = 2; rows <= 4; ++rows) {
            std::string body =
                matrix_text("m", columns, rows, 0) + vector_text("v", columns, 5) + vector_text("w", rows, 9);
            std::vector<std::pair<std::string, std::function<Range(std::size_t)>>> expected;
            const auto m = [&](std::size_t at, std::size_t c, std::size_t i) {
                return r.value(vectors[column(at, c, 0)][i]);
            };
            const auto v = [&](std::size_t at, std::size_t i) { return r.value(vectors[(at % count + 5) % count][i]); };
            const auto w = [&](std::size_t at, std::size_t i) { return r.value(vectors[(at % count + 9) % count][i]); };
            const auto write = [&](const std::string& value, std::function<Range(std::size_t)> range) {
                body += fmt::format("write({}u + at, {});\n", expected.size() * cases, value);
                expected.emplace_back(value, std::move(range));
            };
            for (std::size_t i = 0; i < rows; ++i)
                write(fmt::format("(m * v)[{}]", i), [=, &r](std::size_t at) {
                    std::vector<Range> terms;
                    for (std::size_t c = 0; c < columns; ++c) terms.push_back(r.multiply(m(at, c, i), v(at, c)));
                    return r.sum(terms);
                });
            for (std::size_t c = 0; c < columns; ++c)
                write(fmt::format("(w * m)[{}]", c), [=, &r](std::size_t at) {
                    std::vector<Range> terms;
                    for (std::size_t i = 0; i < rows; ++i) terms.push_back(r.multiply(w(at, i), m(at, c, i)));
                    return r.sum(terms);
                });
            for (std::size_t c = 0; c < columns; ++c)
                for (std::size_t i = 0; i < rows; ++i) {
                    write(fmt::format("outerProduct(w, v)[{}][{}]", c, i),
                          [=, &r](std::size_t at) { return r.multiply(w(at, i), v(at, c)); });
                    write(fmt::format("transpose(m)[{}][{}]", i, c), [=](std::size_t at) { return m(at, c, i); });
                    write(fmt::format("(m * v.x)[{}][{}]", c, i),
                          [=, &r](std::size_t at) { return r.multiply(m(at, c, i), v(at, 0)); });
                }
            for (std::size_t other = 2; other <= 4; ++other) {
                const std::string name = fmt::format("n{}", other);
                body += matrix_text(name.c_str(), other, columns, 11);
                for (std::size_t k = 0; k < other; ++k)
                    for (std::size_t i = 0; i < rows; ++i)
                        write(fmt::format("(m * {})[{}][{}]", name, k, i), [=, &r, &vectors](std::size_t at) {
                            std::vector<Range> terms;
                            for (std::size_t c = 0; c < columns; ++c)
                                terms.push_back(r.multiply(m(at, c, i), r.value(vectors[column(at, k, 11)][c])));
                            return r.sum(terms);
                        });
            }
            const std::string text = shader_of<TypeParam>(numbers, cases, body);
            for (const char* spec : specs) {
                const auto found = run<TypeParam>(spec, text, expected.size() * cases);
                ASSERT_FALSE(found.empty());
                for (std::size_t row = 0; row < expected.size(); ++row) {
                    int wrong = 0;
                    for (std::size_t at = 0; at < cases && wrong < 2; ++at) {
                        const double value = found[row * cases + at];
                        const Range range = expected[row].second(at);
                        if (r.contains(range, value)) continue;
                        ++wrong;
                        ADD_FAILURE() << spec << ", " << K::name << " of " << columns << "x" << rows << ", "
                                      << expected[row].first << ", case " << at << ": " << value << ", not "
                                      << static_cast<double>(range.low) << " to " << static_cast<double>(range.high)
                                      << (range.can_be_nan ? " or NaN" : "");
                    }
                }
            }
        }
}

// ---- Determinant and inverse

struct Square {
    const char* name;
    std::array<std::array<double, 4>, 4> rows;
};

/// Of the first `size` rows and columns; `magnitude` is the same with all terms positive: the measure of its error.
long double determinant(const std::array<std::array<double, 4>, 4>& m, std::vector<std::size_t> rows,
                        std::vector<std::size_t> columns, bool magnitude) {
    if (rows.empty()) return 1;
    long double sum = 0;
    const std::vector<std::size_t> rest(rows.begin() + 1, rows.end());
    for (std::size_t i = 0; i < columns.size(); ++i) {
        std::vector<std::size_t> others = columns;
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
        const long double factor = m[rows[0]][columns[i]], minor = determinant(m, rest, others, magnitude);
        sum += magnitude ? std::abs(factor) * minor : (i % 2 ? -factor : factor) * minor;
    }
    return sum;
}
std::vector<std::size_t> all_but(std::size_t size, std::size_t left_out) {
    std::vector<std::size_t> list;
    for (std::size_t i = 0; i < size; ++i)
        if (i != left_out) list.push_back(i);
    return list;
}

TYPED_TEST(GeometryEdges, DeterminantsAndInverses) {
    using K = Kind<TypeParam>;
    constexpr double infinity = HUGE_VAL;
    const double nan = std::nan("");
    // The fourth root of what the type holds: determinants of four rows are just within.
    const double large = std::sqrt(std::sqrt(K::greatest)) / 2, small = std::sqrt(std::sqrt(K::least_normal)) * 2;
    const auto scaled = [](Square square, double factor) {
        for (auto& row : square.rows)
            for (double& x : row) x *= factor;
        return square;
    };
    const Square plain{"plain", {{{2, -1, 0.5, 1}, {0.25, 3, 1, -2}, {1, 0.5, -2, 0.75}, {-1, 2, 0.5, 1.5}}}};
    const Square unit{"unit", {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}};
    const Square turned{"turned", {{{0, 1, 0, 0}, {-1, 0, 0, 0}, {0, 0, 0, -2}, {0, 0, 4, 0}}}};
    const Square singular{"singular", {{{1, 2, 3, 4}, {2, 4, 6, 8}, {1, 0, 1, 0}, {3, 1, 2, 5}}}};
    const Square zero{"zero", {}};
    Square with_nan = plain, with_infinity = plain, overflowing = plain;
    with_nan.name = "NaN", with_nan.rows[1][0] = nan;
    with_infinity.name = "infinity", with_infinity.rows[0][1] = infinity;
    std::vector<Square> squares{plain,
                                unit,
                                turned,
                                singular,
                                zero,
                                with_nan,
                                with_infinity,
                                scaled(unit, large),
                                scaled(unit, small),
                                scaled(turned, -0.5)};
    squares[7].name = "large", squares[8].name = "small", squares[9].name = "turned back";
    overflowing = scaled(unit, K::greatest / 2);
    overflowing.name = "overflowing";
    squares.push_back(overflowing);
    std::vector<double> numbers;
    for (Square& square : squares)
        for (auto& row : square.rows)
            for (double& x : row) {
                x = static_cast<double>(K::from(K::to(x).data()));
                numbers.push_back(x);
            }
    const long double unit_step = std::ldexp(1.0L, -K::precision().bits);
    const long double least = std::ldexp(1.0L, K::precision().least_exponent);
    for (std::size_t size = 2; size <= 4; ++size) {
        std::string body = fmt::format("{0}mat{1} m = {0}mat{1}(", K::prefix, size);
        for (std::size_t c = 0; c < size; ++c)
            for (std::size_t i = 0; i < size; ++i)
                body += fmt::format("{}read(at * 16u + {}u)", c + i ? ", " : "", i * 4 + c);
        body += fmt::format(");\n{0}mat{1} inverted = inverse(m);\nwrite(at, determinant(m));\n", K::prefix, size);
        for (std::size_t i = 0; i < size * size; ++i)
            body += fmt::format("write({}u + at, inverted[{}][{}]);\n", (1 + i) * squares.size(), i / size, i % size);
        const std::string text = shader_of<TypeParam>(numbers, squares.size(), body);
        for (const char* spec : specs) {
            const auto found = run<TypeParam>(spec, text, squares.size() * (1 + size * size));
            ASSERT_FALSE(found.empty());
            for (std::size_t at = 0; at < squares.size(); ++at) {
                const Square& square = squares[at];
                SCOPED_TRACE(fmt::format("{}, {} of {}x{}, {}", spec, K::name, size, size, square.name));
                const bool has_nan = square.name == std::string("NaN");
                const auto all = all_but(size, size);
                const long double exact = determinant(square.rows, all, all, false),
                                  magnitude = determinant(square.rows, all, all, true);
                const double value = found[at];
                // Each term takes few roundings, and the terms are few.
                const long double error = 16 * unit_step * magnitude + 8 * least;
                if (std::isnan(exact)) {
                    // A NaN reaches everything; an infinity makes an infinity, or NaN where it meets zero.
                    EXPECT_FALSE(std::isfinite(value)) << value;
                    if (has_nan) {
                        EXPECT_TRUE(std::isnan(value)) << value;
                    }
                } else if (std::isinf(exact) || std::abs(exact) - error > K::greatest) {
                    EXPECT_FALSE(std::isfinite(value)) << value;
                } else {
                    EXPECT_NEAR(value, static_cast<double>(exact), static_cast<double>(error));
                }
                for (std::size_t c = 0; c < size; ++c)
                    for (std::size_t i = 0; i < size; ++i) {
                        const double element = found[(1 + c * size + i) * squares.size() + at];
                        const auto rows = all_but(size, c), columns = all_but(size, i);
                        if (has_nan) {
                            EXPECT_TRUE(std::isnan(element)) << c << " " << i;
                            continue;
                        }
                        if (exact == 0 && square.name != std::string("small")) {
                            EXPECT_FALSE(std::isfinite(element)) << c << " " << i << ": " << element;
                            continue;
                        }
                        // What is beyond any promise: determinants and minors that are no numbers of the type.
                        const long double cofactor =
                                              determinant(square.rows, rows, columns, false) * ((c + i) % 2 ? -1 : 1),
                                          size_of_cofactor = determinant(square.rows, rows, columns, true);
                        if (!std::isfinite(exact) || std::abs(exact) > K::greatest / 2 ||
                            size_of_cofactor > K::greatest / 2 || std::abs(exact) < 4 * least)
                            continue;
                        const long double inverse = cofactor / exact;
                        const long double allowed = (16 * unit_step * size_of_cofactor + 8 * least) / std::abs(exact) +
                                                    std::abs(inverse) * (error / std::abs(exact) + 4 * unit_step) +
                                                    least;
                        EXPECT_NEAR(element, static_cast<double>(inverse), static_cast<double>(allowed))
                            << c << " " << i;
                    }
            }
        }
    }
}

}  // namespace
}  // namespace nacre::cpu
