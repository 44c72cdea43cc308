// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include <fmt/format.h>
#include <llvm/IR/Constants.h>
#include <spirv/unified1/GLSL.std.450.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

namespace {

/// Determinant and inverse of square matrices by cofactors; `at(column, row)`.
class MatrixArithmetic {
  public:
    using Multiply = std::function<Component(const Component&, const Component&)>;
    MatrixArithmetic(std::uint32_t size, const std::vector<Component>& elements, Multiply multiply, Multiply subtract,
                     Multiply add)
        : size_(size),
          elements_(elements),
          multiply_(std::move(multiply)),
          subtract_(std::move(subtract)),
          add_(std::move(add)) {}

    /// Of the matrix without the columns and rows that are left out.
    [[nodiscard]] Component minor(std::vector<std::uint32_t> columns, std::vector<std::uint32_t> rows) const {
        if (columns.size() == 1) return elements_[columns[0] * size_ + rows[0]];
        if (columns.size() == 2)
            return subtract_(multiply_(element(columns[0], rows[0]), element(columns[1], rows[1])),
                             multiply_(element(columns[1], rows[0]), element(columns[0], rows[1])));
        Component sum;
        const std::vector<std::uint32_t> rest(rows.begin() + 1, rows.end());
        for (std::size_t i = 0; i < columns.size(); ++i) {
            std::vector<std::uint32_t> others = columns;
            others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
            const Component term = multiply_(element(columns[i], rows[0]), minor(others, rest));
            sum = !sum ? term : i % 2 ? subtract_(sum, term) : add_(sum, term);
        }
        return sum;
    }
    [[nodiscard]] std::vector<std::uint32_t> all_but(std::uint32_t left_out) const {
        std::vector<std::uint32_t> list;
        for (std::uint32_t i = 0; i < size_; ++i)
            if (i != left_out) list.push_back(i);
        return list;
    }

  private:
    [[nodiscard]] const Component& element(std::uint32_t column, std::uint32_t row) const {
        return elements_[column * size_ + row];
    }
    std::uint32_t size_;
    const std::vector<Component>& elements_;
    Multiply multiply_, subtract_, add_;
};

}  // namespace

bool Emitter::emit_extended(const Instruction& at) {
    if (at.op != Op::OpExtInst) return false;
    if (const std::string* set = module.foreign_set(at.operand(0)))
        reject(fmt::format("instruction {} of {} is not supported", at.operand(1), *set));
    if (!module.is_glsl_set(at.operand(0))) return true;  // Debug information and the like: no effect on values.
    const auto number = static_cast<GLSLstd450>(at.operand(1));
    const auto argument = [&](std::size_t i) { return get(at.operand(2 + i)); };
    using Values = std::span<llvm::Value* const>;
    const auto map1 = [&](const std::function<llvm::Value*(llvm::Value*)>& function) {
        std::vector<Component> made;
        for (const Component& x : argument(0).components)
            made.push_back(apply({x}, [&](Values v) { return function(v[0]); }));
        set(at, std::move(made));
        return true;
    };
    const auto map2 = [&](const std::function<llvm::Value*(llvm::Value*, llvm::Value*)>& function) {
        const Value x = argument(0), y = argument(1);
        std::vector<Component> made;
        for (std::size_t i = 0; i < x.components.size(); ++i)
            made.push_back(
                apply({x.components[i], y.components.at(i)}, [&](Values v) { return function(v[0], v[1]); }));
        set(at, std::move(made));
        return true;
    };
    const auto map3 = [&](const std::function<llvm::Value*(llvm::Value*, llvm::Value*, llvm::Value*)>& function) {
        const Value x = argument(0), y = argument(1), z = argument(2);
        std::vector<Component> made;
        for (std::size_t i = 0; i < x.components.size(); ++i)
            made.push_back(apply({x.components[i], y.components.at(i), z.components.at(i)},
                                 [&](Values v) { return function(v[0], v[1], v[2]); }));
        set(at, std::move(made));
        return true;
    };
    const auto number_like = [&](llvm::Value* x, double value) { return llvm::ConstantFP::get(x->getType(), value); };
    const auto f_add = [&](const Component& a, const Component& b) {
        return apply({a, b}, [&](Values v) { return builder.CreateFAdd(v[0], v[1]); });
    };
    const auto f_subtract = [&](const Component& a, const Component& b) {
        return apply({a, b}, [&](Values v) { return builder.CreateFSub(v[0], v[1]); });
    };
    const auto f_multiply = [&](const Component& a, const Component& b) {
        return apply({a, b}, [&](Values v) { return builder.CreateFMul(v[0], v[1]); });
    };
    const auto f_negate = [&](const Component& a) {
        return apply({a}, [&](Values v) { return builder.CreateFNeg(v[0]); });
    };
    const auto dot = [&](const std::vector<Component>& a, const std::vector<Component>& b) {
        Component sum = f_multiply(a.at(0), b.at(0));
        for (std::size_t i = 1; i < a.size(); ++i) sum = f_add(f_multiply(a[i], b.at(i)), sum);
        return sum;
    };
    const auto root = [&](const Component& x) { return apply({x}, [&](Values v) { return math.sqrt(v[0]); }); };
    llvm::FastMathFlags flags;
    flags.setAllowContract(options.mode == ExecutionMode::fast && !module.is_no_contraction(at.result));
    builder.setFastMathFlags(flags);
    struct Reset {
        llvm::IRBuilder<>& builder;
        ~Reset() { builder.clearFastMathFlags(); }
    } reset{builder};

    switch (number) {
        case GLSLstd450Round:
            return map1([&](auto* x) { return math.round_even(x); });  // Either way is allowed for halves.
        case GLSLstd450RoundEven: return map1([&](auto* x) { return math.round_even(x); });
        case GLSLstd450Trunc: return map1([&](auto* x) { return math.trunc(x); });
        case GLSLstd450FAbs: return map1([&](auto* x) { return math.f_abs(x); });
        case GLSLstd450SAbs: return map1([&](auto* x) { return math.s_abs(x); });
        case GLSLstd450FSign: return map1([&](auto* x) { return math.sign(x); });
        case GLSLstd450SSign: return map1([&](auto* x) { return math.s_sign(x); });
        case GLSLstd450Floor: return map1([&](auto* x) { return math.floor(x); });
        case GLSLstd450Ceil: return map1([&](auto* x) { return math.ceil(x); });
        case GLSLstd450Fract: return map1([&](auto* x) { return math.fract(x); });
        case GLSLstd450Radians:
            return map1([&](auto* x) { return builder.CreateFMul(x, number_like(x, std::numbers::pi / 180)); });
        case GLSLstd450Degrees:
            return map1([&](auto* x) { return builder.CreateFMul(x, number_like(x, 180 / std::numbers::pi)); });
        case GLSLstd450Sin: return map1([&](auto* x) { return math.sin(x); });
        case GLSLstd450Cos: return map1([&](auto* x) { return math.cos(x); });
        case GLSLstd450Tan: return map1([&](auto* x) { return math.tan(x); });
        case GLSLstd450Asin: return map1([&](auto* x) { return math.asin(x); });
        case GLSLstd450Acos: return map1([&](auto* x) { return math.acos(x); });
        case GLSLstd450Atan: return map1([&](auto* x) { return math.atan(x); });
        case GLSLstd450Sinh: return map1([&](auto* x) { return math.sinh(x); });
        case GLSLstd450Cosh: return map1([&](auto* x) { return math.cosh(x); });
        case GLSLstd450Tanh: return map1([&](auto* x) { return math.tanh(x); });
        case GLSLstd450Asinh: return map1([&](auto* x) { return math.asinh(x); });
        case GLSLstd450Acosh: return map1([&](auto* x) { return math.acosh(x); });
        case GLSLstd450Atanh: return map1([&](auto* x) { return math.atanh(x); });
        case GLSLstd450Atan2: return map2([&](auto* y, auto* x) { return math.atan2(y, x); });
        case GLSLstd450Pow: return map2([&](auto* x, auto* y) { return math.pow(x, y); });
        case GLSLstd450Exp: return map1([&](auto* x) { return math.exp(x); });
        case GLSLstd450Log: return map1([&](auto* x) { return math.log(x); });
        case GLSLstd450Exp2: return map1([&](auto* x) { return math.exp2(x); });
        case GLSLstd450Log2: return map1([&](auto* x) { return math.log2(x); });
        case GLSLstd450Sqrt: return map1([&](auto* x) { return math.sqrt(x); });
        case GLSLstd450InverseSqrt: return map1([&](auto* x) { return math.inverse_sqrt(x); });
        case GLSLstd450FMin: return map2([&](auto* x, auto* y) { return math.f_min(x, y); });
        case GLSLstd450FMax: return map2([&](auto* x, auto* y) { return math.f_max(x, y); });
        case GLSLstd450NMin: return map2([&](auto* x, auto* y) { return math.n_min(x, y); });
        case GLSLstd450NMax: return map2([&](auto* x, auto* y) { return math.n_max(x, y); });
        case GLSLstd450UMin: return map2([&](auto* x, auto* y) { return math.u_min(x, y); });
        case GLSLstd450SMin: return map2([&](auto* x, auto* y) { return math.s_min(x, y); });
        case GLSLstd450UMax: return map2([&](auto* x, auto* y) { return math.u_max(x, y); });
        case GLSLstd450SMax: return map2([&](auto* x, auto* y) { return math.s_max(x, y); });
        case GLSLstd450FClamp: return map3([&](auto* x, auto* a, auto* b) { return math.f_clamp(x, a, b); });
        case GLSLstd450NClamp: return map3([&](auto* x, auto* a, auto* b) { return math.n_clamp(x, a, b); });
        case GLSLstd450UClamp: return map3([&](auto* x, auto* a, auto* b) { return math.u_clamp(x, a, b); });
        case GLSLstd450SClamp: return map3([&](auto* x, auto* a, auto* b) { return math.s_clamp(x, a, b); });
        case GLSLstd450FMix: return map3([&](auto* x, auto* y, auto* a) { return math.mix(x, y, a); });
        case GLSLstd450Step: return map2([&](auto* edge, auto* x) { return math.step(edge, x); });
        case GLSLstd450SmoothStep: return map3([&](auto* a, auto* b, auto* x) { return math.smooth_step(a, b, x); });
        case GLSLstd450Fma: return map3([&](auto* a, auto* b, auto* c) { return math.fma(a, b, c); });
        case GLSLstd450Ldexp: return map2([&](auto* x, auto* e) { return math.ldexp(x, e); });
        case GLSLstd450FindILsb: return map1([&](auto* x) { return math.find_lsb(x); });
        case GLSLstd450FindSMsb: return map1([&](auto* x) { return math.find_s_msb(x); });
        case GLSLstd450FindUMsb: return map1([&](auto* x) { return math.find_u_msb(x); });

        case GLSLstd450Modf: case GLSLstd450ModfStruct: case GLSLstd450Frexp: case GLSLstd450FrexpStruct: {
            const bool is_modf = number == GLSLstd450Modf || number == GLSLstd450ModfStruct;
            const bool is_struct = number == GLSLstd450ModfStruct || number == GLSLstd450FrexpStruct;
            std::vector<Component> first, second;
            for (const Component& x : argument(0).components) {
                if (is_modf) {
                    const auto parts = math.modf(x.value);
                    first.emplace_back(parts.fraction), second.emplace_back(parts.whole);
                } else {
                    const auto parts = math.frexp(x.value);
                    first.emplace_back(parts.significand), second.emplace_back(parts.exponent);
                }
            }
            // The exponent comes in whatever integer type the module asks for.
            const Id second_type = is_struct ? module.type(at.type).members.at(1).type
                                             : module.type(module.type_of(at.operand(3))).element;
            const Type& scalar = module.type(component_type(second_type, 0));
            if (!is_modf && scalar.bits != 32)
                for (Component& exponent : second)
                    exponent = apply({exponent}, [&](Values v) {
                        llvm::Type* kind = scalar_type(scalar);
                        return builder.CreateSExtOrTrunc(v[0], like(v[0], kind));
                    });
            if (is_struct) {
                first.insert(first.end(), second.begin(), second.end());
            } else {
                store(get_pointer(at.operand(3)), second);
            }
            set(at, std::move(first));
            return true;
        }

        case GLSLstd450PackSnorm4x8: case GLSLstd450PackUnorm4x8: {
            note_narrowed("packing");
            std::vector<Component> x = argument(0).components;
            set(at, {apply(x, [&](Values v) {
                    const std::array<llvm::Value*, 4> four{v[0], v[1], v[2], v[3]};
                    return number == GLSLstd450PackSnorm4x8 ? math.pack_snorm4x8(four) : math.pack_unorm4x8(four);
                })});
            return true;
        }
        case GLSLstd450PackSnorm2x16:
        case GLSLstd450PackUnorm2x16:
        case GLSLstd450PackHalf2x16:
        case GLSLstd450PackDouble2x32: {
            if (number != GLSLstd450PackDouble2x32) note_narrowed("packing");
            std::vector<Component> x = argument(0).components;
            set(at, {apply(x, [&](Values v) {
                    const std::array<llvm::Value*, 2> two{v[0], v[1]};
                    return number == GLSLstd450PackSnorm2x16   ? math.pack_snorm2x16(two)
                           : number == GLSLstd450PackUnorm2x16 ? math.pack_unorm2x16(two)
                           : number == GLSLstd450PackHalf2x16  ? math.pack_half2x16(two)
                                                               : math.pack_double2x32(two);
                })});
            return true;
        }
        case GLSLstd450UnpackSnorm4x8: case GLSLstd450UnpackUnorm4x8: {
            note_narrowed("unpacking");
            const Component word = argument(0).components.at(0);
            const auto four = number == GLSLstd450UnpackSnorm4x8 ? math.unpack_snorm4x8(word.value)
                                                                 : math.unpack_unorm4x8(word.value);
            std::vector<Component> made;
            for (llvm::Value* component : four) made.push_back(from_single(component));
            set(at, std::move(made));
            return true;
        }
        case GLSLstd450UnpackSnorm2x16:
        case GLSLstd450UnpackUnorm2x16:
        case GLSLstd450UnpackHalf2x16:
        case GLSLstd450UnpackDouble2x32: {
            if (number != GLSLstd450UnpackDouble2x32) note_narrowed("unpacking");
            const Component word = argument(0).components.at(0);
            const auto two = number == GLSLstd450UnpackSnorm2x16   ? math.unpack_snorm2x16(word.value)
                             : number == GLSLstd450UnpackUnorm2x16 ? math.unpack_unorm2x16(word.value)
                             : number == GLSLstd450UnpackHalf2x16  ? math.unpack_half2x16(word.value)
                                                                   : math.unpack_double2x32(word.value);
            std::vector<Component> made;
            for (llvm::Value* component : two)
                made.push_back(number == GLSLstd450UnpackDouble2x32 ? Component(component) : from_single(component));
            set(at, std::move(made));
            return true;
        }

        case GLSLstd450Length: {
            const Value x = argument(0);
            if (x.components.size() == 1) return map1([&](auto* v) { return math.f_abs(v); });
            set(at, {root(dot(x.components, x.components))});
            return true;
        }
        case GLSLstd450Distance: {
            const Value x = argument(0), y = argument(1);
            std::vector<Component> between;
            for (std::size_t i = 0; i < x.components.size(); ++i)
                between.push_back(f_subtract(x.components[i], y.components.at(i)));
            if (between.size() == 1)
                set(at, {apply({between[0]}, [&](Values v) { return math.f_abs(v[0]); })});
            else
                set(at, {root(dot(between, between))});
            return true;
        }
        case GLSLstd450Cross: {
            const Value x = argument(0), y = argument(1);
            const auto& a = x.components;
            const auto& b = y.components;
            set(at, {f_subtract(f_multiply(a[1], b[2]), f_multiply(b[1], a[2])),
                     f_subtract(f_multiply(a[2], b[0]), f_multiply(b[2], a[0])),
                     f_subtract(f_multiply(a[0], b[1]), f_multiply(b[0], a[1]))});
            return true;
        }
        case GLSLstd450Normalize: {
            const Value x = argument(0);
            // NaN has no sign, and stays.
            if (x.components.size() == 1)
                return map1([&](auto* v) { return select(builder.CreateFCmpUNO(v, v), v, math.sign(v)); });
            const Component scale =
                apply({dot(x.components, x.components)}, [&](Values v) { return math.inverse_sqrt(v[0]); });
            std::vector<Component> made;
            for (const Component& component : x.components) made.push_back(f_multiply(component, scale));
            set(at, std::move(made));
            return true;
        }
        case GLSLstd450FaceForward: {
            const Value n = argument(0), i = argument(1), reference = argument(2);
            const Component faces = apply({dot(reference.components, i.components)}, [&](Values v) {
                return builder.CreateFCmpOLT(v[0], number_like(v[0], 0));
            });
            std::vector<Component> made;
            for (const Component& component : n.components)
                made.push_back(
                    apply({faces, component, f_negate(component)}, [&](Values v) { return select(v[0], v[1], v[2]); }));
            set(at, std::move(made));
            return true;
        }
        case GLSLstd450Reflect: {
            const Value i = argument(0), n = argument(1);
            Component twice = dot(n.components, i.components);
            twice = f_add(twice, twice);
            std::vector<Component> made;
            for (std::size_t k = 0; k < i.components.size(); ++k)
                made.push_back(f_subtract(i.components[k], f_multiply(twice, n.components.at(k))));
            set(at, std::move(made));
            return true;
        }
        case GLSLstd450Refract: {
            const Value i = argument(0), n = argument(1);
            const Component eta = argument(2).components.at(0);
            const Component cosine = dot(n.components, i.components);
            const Component one = apply({cosine}, [&](Values v) { return number_like(v[0], 1); });
            const Component k =
                f_subtract(one, f_multiply(f_multiply(eta, eta), f_subtract(one, f_multiply(cosine, cosine))));
            const Component is_reflected =
                apply({k}, [&](Values v) { return builder.CreateFCmpOLT(v[0], number_like(v[0], 0)); });
            const Component along = f_add(f_multiply(eta, cosine), root(k));
            std::vector<Component> made;
            for (std::size_t c = 0; c < i.components.size(); ++c) {
                const Component bent =
                    f_subtract(f_multiply(eta, i.components[c]), f_multiply(along, n.components.at(c)));
                made.push_back(
                    apply({is_reflected, bent}, [&](Values v) { return select(v[0], number_like(v[1], 0), v[1]); }));
            }
            set(at, std::move(made));
            return true;
        }
        case GLSLstd450Determinant: case GLSLstd450MatrixInverse: {
            const Value m = argument(0);
            const std::uint32_t size = module.type(module.type_of(at.operand(2))).count;
            const MatrixArithmetic matrix(size, m.components, f_multiply, f_subtract, f_add);
            std::vector<std::uint32_t> all = matrix.all_but(size);
            if (number == GLSLstd450Determinant) {
                set(at, {matrix.minor(all, all)});
                return true;
            }
            std::vector<Component> cofactors(std::size_t{size} *
                                             size);  // Of column c and row r at r * size + c: transposed.
            for (std::uint32_t c = 0; c < size; ++c)
                for (std::uint32_t r = 0; r < size; ++r) {
                    Component minor = matrix.minor(matrix.all_but(c), matrix.all_but(r));
                    cofactors[r * size + c] = (c + r) % 2 ? f_negate(minor) : minor;
                }
            // The first row of elements with their cofactors gives the determinant.
            Component determinant;
            for (std::uint32_t c = 0; c < size; ++c) {
                const Component term = f_multiply(m.components[c * size], cofactors[c]);
                determinant = determinant ? f_add(determinant, term) : term;
            }
            std::vector<Component> made;
            for (const Component& cofactor : cofactors)
                made.push_back(
                    apply({cofactor, determinant}, [&](Values v) { return builder.CreateFDiv(v[0], v[1]); }));
            set(at, std::move(made));
            return true;
        }
        default: reject(fmt::format("instruction {} of GLSL.std.450 is not supported", at.operand(1)));
    }
}

}  // namespace nacre::cpu
