// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "tests/backends/cpu/differential/generator.h"

namespace nacre::differential {

std::string GlslType::name() const {
    static const char* const scalars[] = {"bool", "int", "uint", "float"};
    static const char* const vectors[] = {"bvec", "ivec", "uvec", "vec"};
    if (kind == Kind::matrix) return fmt::format("mat{}x{}", columns, size);
    const int at = static_cast<int>(kind);
    return size == 1 ? scalars[at] : fmt::format("{}{}", vectors[at], size);
}

GlslType Generator::random_type(bool with_matrices) {
    const int which = random_.below(with_matrices ? 11 : 10);
    if (which == 10) return {Kind::matrix, random_.between(2, 4), random_.between(2, 4)};
    const Kind kind = which < 4 ? Kind::integer : which < 7 ? Kind::natural : which < 9 ? Kind::real : Kind::boolean;
    return {kind, random_.chance(60) ? 1 : random_.between(2, 4), 1};
}

std::string Generator::literal(const GlslType& type) {
    std::string scalar;
    switch (type.kind) {
        case Kind::boolean: scalar = random_.chance(50) ? "true" : "false"; break;
        case Kind::integer:
            scalar = random_.chance(70)
                         ? fmt::format("({})", random_.between(-9, 40))
                         : random_.pick({"2147483647", "(-2147483647 - 1)", "(-1)", "0", "65535", "(-65536)"});
            break;
        case Kind::natural:
            scalar = random_.chance(70) ? fmt::format("{}u", random_.between(0, 40))
                                        : random_.pick({"0xffffffffu", "0x80000000u", "0x12345678u", "0xffffu"});
            break;
        case Kind::real: scalar = fmt::format("({:.5f})", random_.between(1, 400) / 16.0 - 12.03125); break;
        case Kind::matrix: return fmt::format("{}({}.0)", type.name(), random_.between(1, 9));
    }
    return type.size == 1 ? scalar : fmt::format("{}({})", type.name(), scalar);
}

std::string Generator::index(int count) {
    if (random_.chance(30)) return fmt::format("{}", random_.below(count));
    // Indices of indices end soon.
    if (index_depth_ >= 2) return fmt::format("(identity % {}u)", count);
    ++index_depth_;
    const std::string number = random_.chance(60) ? leaf({Kind::natural, 1, 1}) : expression({Kind::natural, 1, 1}, 1);
    --index_depth_;
    if ((count & (count - 1)) == 0 && random_.chance(50)) return fmt::format("({} & {}u)", number, count - 1);
    return fmt::format("({} % {}u)", number, count);
}

std::string Generator::fill_indices(const Place& place) {
    std::string text;
    for (const char letter : place.text) {
        if (letter == '@') text += index(place.count);
        else if (letter == '#') text += index(place.inner_count);
        else text += letter;
    }
    return text;
}

std::string Generator::swizzle(int from, int count, bool distinct) {
    static const char letters[] = "xyzw";
    std::string text;
    while (static_cast<int>(text.size()) < count) {
        const char letter = letters[random_.below(from)];
        if (!distinct || text.find(letter) == std::string::npos) text += letter;
    }
    return text;
}

std::string Generator::leaf(const GlslType& type) {
    if (random_.chance(15)) return literal(type);
    std::vector<const Place*> fitting;
    for (const Place& place : places_) {
        if (only_uniform_ && !place.is_uniform) continue;
        if (place.type == type) fitting.push_back(&place), fitting.push_back(&place);
        else if (place.type.kind == type.kind && type.kind != Kind::matrix && place.type.size > 1)
            fitting.push_back(&place);
        else if (place.type.kind == Kind::matrix && type.kind == Kind::real && place.type.size == type.size)
            fitting.push_back(&place);
    }
    if (fitting.empty()) return literal(type);
    const Place place = *random_.pick(fitting);
    // Indices may nest; what they hold may be shallow.
    const std::string text = fill_indices(place);
    if (place.type == type) return text;
    if (place.type.kind == Kind::matrix) return fmt::format("{}[{}]", text, index(place.type.columns));
    if (type.size == 1 && random_.chance(40)) return fmt::format("{}[{}]", text, index(place.type.size));
    return fmt::format("{}.{}", text, swizzle(place.type.size, type.size, false));
}

std::string Generator::construct(const GlslType& type, int depth) {
    std::string text = type.name() + "(";
    int left = type.size;
    while (left > 0) {
        const int size = random_.between(1, left);
        if (left != type.size) text += ", ";
        // A whole value of the vector's own size would be no construction.
        const int taken = size == type.size ? 1 : size;
        text += expression({type.kind, taken, 1}, depth);
        left -= taken;
    }
    return text + ")";
}

std::string Generator::call(const GlslFunction& function, int depth) {
    std::string text = function.name + "(";
    for (std::size_t i = 0; i < function.parameters.size(); ++i)
        text += (i ? ", " : "") + expression(function.parameters[i].type, depth);
    return text + ")";
}

std::string Generator::expression(const GlslType& type, int depth) {
    if (depth <= 0) return leaf(type);
    const bool was_uniform = only_uniform_;
    if (random_.chance(12)) only_uniform_ = true;
    std::string text;
    const GlslFunction* callee = nullptr;
    if (random_.chance(8))
        for (const GlslFunction& function : functions_)
            if (&function != current_ && function.is_pure && function.has_result && function.result == type)
                callee = &function;
    if (callee) {
        text = call(*callee, depth - 1);
    } else if (random_.chance(10)) {
        text = fmt::format("({} ? {} : {})", expression({Kind::boolean, 1, 1}, depth - 1), expression(type, depth - 1),
                           expression(type, depth - 1));
    } else if (type.kind != Kind::matrix && type.size > 1 && random_.chance(20)) {
        text = construct(type, depth - 1);
    } else {
        switch (type.kind) {
            case Kind::boolean: text = boolean_expression(type.size, depth); break;
            case Kind::integer:
            case Kind::natural: text = integer_expression(type, depth); break;
            case Kind::real: text = real_expression(type, depth); break;
            case Kind::matrix: text = matrix_expression(type, depth); break;
        }
    }
    only_uniform_ = was_uniform;
    return text;
}

std::string Generator::boolean_expression(int size, int depth) {
    const GlslType type{Kind::boolean, size, 1};
    const int down = depth - 1;
    const Kind kind = random_.pick({Kind::integer, Kind::integer, Kind::natural, Kind::real});
    if (size > 1) {
        if (random_.chance(20)) return fmt::format("not({})", expression(type, down));
        const GlslType compared{kind, size, 1};
        return fmt::format(
            "{}({}, {})",
            random_.pick({"lessThan", "lessThanEqual", "greaterThan", "greaterThanEqual", "equal", "notEqual"}),
            expression(compared, down), expression(compared, down));
    }
    switch (random_.below(9)) {
        case 0: return fmt::format("(!{})", expression(type, down));
        case 1: return fmt::format("({} && {})", expression(type, down), expression(type, down));
        case 2: return fmt::format("({} || {})", expression(type, down), expression(type, down));
        case 3: return fmt::format("({} ^^ {})", expression(type, down), expression(type, down));
        case 4:
            return fmt::format("{}({})", random_.pick({"any", "all"}),
                               expression({Kind::boolean, random_.between(2, 4), 1}, down));
        case 5: {
            const GlslType compared{kind, random_.between(2, 4), 1};
            return fmt::format("({} {} {})", expression(compared, down), random_.pick({"==", "!="}),
                               expression(compared, down));
        }
        default: {
            const GlslType compared{kind, 1, 1};
            return fmt::format("({} {} {})", expression(compared, down),
                               random_.pick({"<", ">", "<=", ">=", "==", "!="}), expression(compared, down));
        }
    }
}

std::string Generator::integer_expression(const GlslType& type, int depth) {
    const int down = depth - 1;
    const bool is_signed = type.kind == Kind::integer;
    const GlslType natural{Kind::natural, type.size, 1}, integer{Kind::integer, type.size, 1},
        real{Kind::real, type.size, 1};
    const auto one = [&] { return expression(type, down); };
    switch (random_.below(24)) {
        case 0: case 1: case 2: return fmt::format("({} + {})", one(), one());
        case 3: return fmt::format("({} - {})", one(), one());
        case 4: case 5: return fmt::format("({} * {})", one(), one());
        case 6: return fmt::format("({} {} {})", one(), random_.pick({"&", "|", "^"}), one());
        case 7: return fmt::format("({} {} ({} & 31))", one(), random_.pick({"<<", ">>"}), expression(integer, down));
        case 8:  // The divisor is above 0.
            return is_signed ? fmt::format("({} / (({} & 1023) + 1))", one(), one())
                             : fmt::format("({} / ({} | 1u))", one(), one());
        case 9:  // Of negative numbers the remainder is undefined.
            return is_signed ? fmt::format("(({} & 0x7fffffff) % (({} & 1023) + 1))", one(), one())
                             : fmt::format("({} % ({} | 1u))", one(), one());
        case 10: return is_signed ? fmt::format("(-{})", one()) : fmt::format("(~{})", one());
        case 11: return fmt::format("{}({}, {})", random_.pick({"min", "max"}), one(), one());
        case 12: return is_signed ? fmt::format("abs({})", one()) : fmt::format("(~{})", one());
        case 13: {
            const char* low = is_signed ? "-5" : "3u";
            const char* high = is_signed ? "900" : "900u";
            return fmt::format("clamp({}, {}, {})", one(), low, high);
        }
        case 14:
            return fmt::format("{}({})", type.name(),
                               fmt::format("{}({})", random_.pick({"bitCount", "findLSB", "findMSB"}), one()));
        case 15: return fmt::format("bitfieldReverse({})", one());
        case 16: {
            const std::string offset = fmt::format("({} & 15)", expression({Kind::integer, 1, 1}, 1));
            const std::string bits = fmt::format("({} & 15)", expression({Kind::integer, 1, 1}, 1));
            if (random_.chance(50)) return fmt::format("bitfieldExtract({}, {}, {})", one(), offset, bits);
            return fmt::format("bitfieldInsert({}, {}, {}, {})", one(), one(), offset, bits);
        }
        case 17: return fmt::format("{}({})", type.name(), expression(is_signed ? natural : integer, down));
        case 18: return fmt::format("{}({})", type.name(), expression({Kind::boolean, type.size, 1}, down));
        case 19:
            return fmt::format("{}(keep({}))", type.name(),
                               is_signed ? expression(real, down) : fmt::format("abs({})", expression(real, down)));
        case 20:
            return fmt::format("{}({})", is_signed ? "floatBitsToInt" : "floatBitsToUint",
                               fmt::format("keep({})", expression(real, down)));
        case 21: return is_signed ? fmt::format("sign({})", one()) : fmt::format("({} ^ {})", one(), one());
        case 22: return fmt::format("({} ^ ({} >> {}))", one(), one(), random_.between(1, 15));
        default:
            if (type.size == 1 && !is_signed && random_.chance(50))
                return fmt::format("texelFetch(numbers, ivec2({} & 15, {} & 15), 0).{}", expression(integer, down),
                                   expression(integer, down), swizzle(4, 1, false));
            if (type.size > 1 && random_.chance(50))
                return fmt::format("mix({}, {}, {})", one(), one(), expression({Kind::boolean, type.size, 1}, down));
            return leaf(type);
    }
}

std::string Generator::real_expression(const GlslType& type, int depth) {
    const int down = depth - 1;
    const GlslType natural{Kind::natural, type.size, 1}, integer{Kind::integer, type.size, 1};
    const auto one = [&] { return expression(type, down); };
    switch (random_.below(16)) {
        case 0: case 1: return fmt::format("({} + {})", one(), one());
        case 2: return fmt::format("({} - {})", one(), one());
        case 3: case 4: return fmt::format("keep({} * {})", one(), one());
        case 5: return fmt::format("(-{})", one());
        case 6: return fmt::format("{}({}, {})", random_.pick({"min", "max"}), one(), one());
        case 7: return fmt::format("{}({})", random_.pick({"floor", "ceil", "trunc", "abs", "roundEven"}), one());
        case 8: return fmt::format("{}({} & 0xffff)", type.name(), expression(integer, down));
        case 9: return fmt::format("{}({} >> 8)", type.name(), expression(natural, down));
        case 10: return fmt::format("{}({})", type.name(), expression({Kind::boolean, type.size, 1}, down));
        case 11: {
            const std::string bits = fmt::format("({} & 0x007fffffu) | 0x3f800000u", expression(natural, down));
            return fmt::format("uintBitsToFloat({})", bits);
        }
        case 12: return fmt::format("step({}, {})", one(), one());
        case 13: return fmt::format("clamp({}, -3.25, 70.5)", one());
        case 14:
            // No unpackHalf2x16: lavapipe of Mesa 22.3 gets some constants wrong.
            if (type.size == 1) {
                // Sums of small whole numbers, exact in any order.
                const int size = random_.between(2, 4);
                const GlslType vector{Kind::integer, size, 1};
                return fmt::format("dot(vec{0}({1} & 63), vec{0}({2} & 63))", size, expression(vector, down),
                                   expression(vector, down));
            }
            return fmt::format("keep({} * {})", one(), expression({Kind::real, 1, 1}, down));
        default: {
            if (type.size == 1) return fmt::format("keep({} * 0.625)", one());
            const GlslType matrix{Kind::matrix, type.size, random_.between(2, 4)};
            if (random_.chance(50))
                return fmt::format("({} * whole({}))", expression(matrix, down),
                                   expression({Kind::real, matrix.columns, 1}, down));
            const GlslType turned{Kind::matrix, random_.between(2, 4), type.size};
            return fmt::format("(whole({}) * {})", expression({Kind::real, turned.size, 1}, down),
                               expression(turned, down));
        }
    }
}

/// Matrices hold whole numbers from 0 to 63, so that their products are exact.
std::string Generator::matrix_expression(const GlslType& type, int depth) {
    const int down = depth - 1;
    const auto fold = [&](const std::string& text) { return fmt::format("fold({})", text); };
    switch (random_.below(6)) {
        case 0: {
            std::string text = type.name() + "(";
            for (int i = 0; i < type.columns; ++i)
                text += fmt::format("{}whole({})", i ? ", " : "", expression({Kind::real, type.size, 1}, down));
            return text + ")";
        }
        case 1: return fmt::format("transpose({})", expression({Kind::matrix, type.columns, type.size}, down));
        case 2: return fold(fmt::format("{} + {}", expression(type, down), expression(type, down)));
        case 3: {
            std::string left = expression({Kind::matrix, type.size, 2}, down);
            // lavapipe of Mesa 22.3 cannot multiply what comes from two transpositions.
            if (left.starts_with("transpose(")) left = fold(left);
            return fold(fmt::format("{} * {}", left, expression({Kind::matrix, 2, type.columns}, down)));
        }
        case 4:
            return fold(fmt::format("{} * whole({})", expression(type, down), expression({Kind::real, 1, 1}, down)));
        default:
            return fold(fmt::format("outerProduct(whole({}), whole({}))", expression({Kind::real, type.size, 1}, down),
                                    expression({Kind::real, type.columns, 1}, down)));
    }
}

std::string Generator::as_bits(const std::string& value, const GlslType& type) {
    static const char letters[] = "xyzw";
    const auto scalar = [&](const std::string& one, Kind kind) {
        switch (kind) {
            case Kind::integer: return fmt::format("uint({})", one);
            case Kind::natural: return one;
            case Kind::boolean: return fmt::format("uint({})", one);
            default: return fmt::format("floatBitsToUint(keep({}))", one);
        }
    };
    if (type.kind == Kind::matrix) {
        std::string text;
        for (int i = 0; i < type.columns; ++i)
            text += (i ? " ^ " : "") + as_bits(fmt::format("{}[{}]", value, i), {Kind::real, type.size, 1});
        return "(" + text + ")";
    }
    if (type.size == 1) return scalar(value, type.kind);
    std::string text;
    for (int i = 0; i < type.size; ++i)
        text += fmt::format("{}{} * {}u", i ? " ^ " : "", scalar(fmt::format("({}).{}", value, letters[i]), type.kind),
                            2 * i + 1);
    return "(" + text + ")";
}

}  // namespace nacre::differential
