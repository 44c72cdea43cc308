// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>
#include <llvm/IR/Intrinsics.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;
using llvm::CmpInst;

namespace {

std::optional<CmpInst::Predicate> comparison(Op op) {
    switch (op) {
        case Op::OpIEqual: return CmpInst::ICMP_EQ;
        case Op::OpINotEqual: return CmpInst::ICMP_NE;
        case Op::OpUGreaterThan: return CmpInst::ICMP_UGT;
        case Op::OpSGreaterThan: return CmpInst::ICMP_SGT;
        case Op::OpUGreaterThanEqual: return CmpInst::ICMP_UGE;
        case Op::OpSGreaterThanEqual: return CmpInst::ICMP_SGE;
        case Op::OpULessThan: return CmpInst::ICMP_ULT;
        case Op::OpSLessThan: return CmpInst::ICMP_SLT;
        case Op::OpULessThanEqual: return CmpInst::ICMP_ULE;
        case Op::OpSLessThanEqual: return CmpInst::ICMP_SLE;
        case Op::OpFOrdEqual: return CmpInst::FCMP_OEQ;
        case Op::OpFUnordEqual: return CmpInst::FCMP_UEQ;
        case Op::OpFOrdNotEqual: return CmpInst::FCMP_ONE;
        case Op::OpFUnordNotEqual: return CmpInst::FCMP_UNE;
        case Op::OpFOrdLessThan: return CmpInst::FCMP_OLT;
        case Op::OpFUnordLessThan: return CmpInst::FCMP_ULT;
        case Op::OpFOrdGreaterThan: return CmpInst::FCMP_OGT;
        case Op::OpFUnordGreaterThan: return CmpInst::FCMP_UGT;
        case Op::OpFOrdLessThanEqual: return CmpInst::FCMP_OLE;
        case Op::OpFUnordLessThanEqual: return CmpInst::FCMP_ULE;
        case Op::OpFOrdGreaterThanEqual: return CmpInst::FCMP_OGE;
        case Op::OpFUnordGreaterThanEqual: return CmpInst::FCMP_UGE;
        case Op::OpOrdered: return CmpInst::FCMP_ORD;
        case Op::OpUnordered: return CmpInst::FCMP_UNO;
        default: return std::nullopt;
    }
}

}  // namespace

bool Emitter::emit_arithmetic(const Instruction& at) {
    if (!at.result || !at.type) return false;
    std::vector<Component> result = evaluate(at.op, at.type, at.operands, at.result);
    if (result.empty()) return false;
    if (follows_undefined()) refine_undefined(at.op, at.operands, result);
    set(at, std::move(result));
    return true;
}

std::vector<Component> Emitter::evaluate(Op op, Id type_id, std::span<const std::uint32_t> operands, Id result) {
    const bool contract = options.mode == ExecutionMode::fast && !module.is_no_contraction(result);
    // Multiplications and sums may be fused only where the shader does not ask for exact ones.
    llvm::FastMathFlags flags;
    flags.setAllowContract(contract);
    builder.setFastMathFlags(flags);
    struct Reset {
        llvm::IRBuilder<>& builder;
        ~Reset() { builder.clearFastMathFlags(); }
    } reset{builder};

    using Values = std::span<llvm::Value* const>;
    const auto unary = [&](const std::function<llvm::Value*(llvm::Value*)>& function) {
        std::vector<Component> made;
        for (const Component& x : get(operands[0]).components)
            made.push_back(apply({x}, [&](Values v) { return function(v[0]); }));
        return made;
    };
    const auto binary = [&](const std::function<llvm::Value*(llvm::Value*, llvm::Value*)>& function) {
        const Value x = get(operands[0]), y = get(operands[1]);
        std::vector<Component> made;
        for (std::size_t i = 0; i < x.components.size(); ++i)
            made.push_back(
                apply({x.components[i], y.components.at(i)}, [&](Values v) { return function(v[0], v[1]); }));
        return made;
    };
    const auto scalar_of = [&](Id id) -> const Type& { return module.type(component_type(id, 0)); };
    const auto operand_type = [&](std::size_t i) { return module.type_of(operands[i]); };
    const auto multiply_add = [&](const Component& a, const Component& b, const Component& c) {
        return apply({a, b, c}, [&](Values v) { return builder.CreateFAdd(builder.CreateFMul(v[0], v[1]), v[2]); });
    };
    const auto product = [&](const Component& a, const Component& b) {
        return apply({a, b}, [&](Values v) { return builder.CreateFMul(v[0], v[1]); });
    };

    if (const auto predicate = comparison(op))
        return binary([&](auto* x, auto* y) { return builder.CreateCmp(*predicate, x, y); });

    switch (op) {
        // Integers. What is linear over the lanes stays so.
        case Op::OpIAdd: {
            const Value x = get(operands[0]), y = get(operands[1]);
            std::vector<Component> made;
            for (std::size_t i = 0; i < x.components.size(); ++i) {
                if (scalar_of(type_id).bits == 32) made.push_back(add(x.components[i], y.components.at(i)));
                else
                    made.push_back(apply({x.components[i], y.components.at(i)},
                                         [&](Values v) { return builder.CreateAdd(v[0], v[1]); }));
            }
            return made;
        }
        case Op::OpISub: {
            const Value x = get(operands[0]), y = get(operands[1]);
            std::vector<Component> made;
            for (std::size_t i = 0; i < x.components.size(); ++i) {
                const Component &a = x.components[i], &b = y.components.at(i);
                Component difference = apply({a, b}, [&](Values v) { return builder.CreateSub(v[0], v[1]); });
                if (a.linear_base && b.is_uniform())
                    difference.linear_base = builder.CreateSub(a.linear_base, b.value),
                    difference.linear_stride = a.linear_stride;
                made.push_back(difference);
            }
            return made;
        }
        case Op::OpIMul: {
            const Value x = get(operands[0]), y = get(operands[1]);
            std::vector<Component> made;
            for (std::size_t i = 0; i < x.components.size(); ++i) {
                Component a = x.components[i], b = y.components.at(i);
                if (!a.linear_base) std::swap(a, b);
                const auto* factor = llvm::dyn_cast<llvm::ConstantInt>(b.value);
                Component made_product = apply({a, b}, [&](Values v) { return builder.CreateMul(v[0], v[1]); });
                if (a.linear_base && factor && factor->getBitWidth() == 32)
                    made_product.linear_base = builder.CreateMul(a.linear_base, b.value),
                    made_product.linear_stride = Component::wrapped(a.linear_stride * factor->getZExtValue());
                made.push_back(made_product);
            }
            return made;
        }
        case Op::OpShiftLeftLogical: {
            const Value x = get(operands[0]), y = get(operands[1]);
            std::vector<Component> made;
            for (std::size_t i = 0; i < x.components.size(); ++i) {
                const Component &a = x.components[i], &b = y.components.at(i);
                Component shifted = a.is_uniform() && b.is_uniform() ? Component(math.shift_left(a.value, b.value))
                                                                     : Component(math.shift_left(widen(a), widen(b)));
                const auto* amount = llvm::dyn_cast<llvm::ConstantInt>(b.value);
                if (a.linear_base && amount && amount->getBitWidth() == 32 && amount->getZExtValue() < 31)
                    shifted.linear_base = builder.CreateShl(a.linear_base, amount->getZExtValue()),
                    shifted.linear_stride =
                        Component::wrapped(static_cast<std::uint64_t>(a.linear_stride) << amount->getZExtValue());
                made.push_back(shifted);
            }
            return made;
        }
        case Op::OpShiftRightLogical: return binary([&](auto* x, auto* y) { return math.shift_right_logical(x, y); });
        case Op::OpShiftRightArithmetic:
            return binary([&](auto* x, auto* y) { return math.shift_right_arithmetic(x, y); });
        case Op::OpSNegate: return unary([&](auto* x) { return builder.CreateNeg(x); });
        case Op::OpUDiv: return binary([&](auto* x, auto* y) { return math.u_div(x, y); });
        case Op::OpSDiv: return binary([&](auto* x, auto* y) { return math.s_div(x, y); });
        case Op::OpUMod: return binary([&](auto* x, auto* y) { return math.u_mod(x, y); });
        case Op::OpSRem: return binary([&](auto* x, auto* y) { return math.s_rem(x, y); });
        case Op::OpSMod: return binary([&](auto* x, auto* y) { return math.s_mod(x, y); });
        case Op::OpBitwiseOr: return binary([&](auto* x, auto* y) { return builder.CreateOr(x, y); });
        case Op::OpBitwiseXor: return binary([&](auto* x, auto* y) { return builder.CreateXor(x, y); });
        case Op::OpBitwiseAnd: return binary([&](auto* x, auto* y) { return builder.CreateAnd(x, y); });
        case Op::OpNot: return unary([&](auto* x) { return builder.CreateNot(x); });
        case Op::OpBitReverse: return unary([&](auto* x) { return math.bit_reverse(x); });
        case Op::OpBitCount: {
            llvm::Type* to = scalar_type(scalar_of(type_id));
            return unary([&](auto* x) {
                return builder.CreateZExtOrTrunc(math.bit_count(x), x->getType()->isVectorTy() ? vector_of(to) : to);
            });
        }
        case Op::OpBitFieldInsert:
        case Op::OpBitFieldSExtract:
        case Op::OpBitFieldUExtract: {
            const Value base = get(operands[0]);
            const std::size_t first = op == Op::OpBitFieldInsert ? 2 : 1;
            const Component offset = get_scalar(operands[first]), count = get_scalar(operands[first + 1]);
            std::vector<Component> made;
            for (std::size_t i = 0; i < base.components.size(); ++i) {
                if (op == Op::OpBitFieldInsert) {
                    const Component insert = get(operands[1]).components.at(i);
                    made.push_back(apply({base.components[i], insert, offset, count},
                                         [&](Values v) { return math.bitfield_insert(v[0], v[1], v[2], v[3]); }));
                } else {
                    made.push_back(apply({base.components[i], offset, count}, [&](Values v) {
                        return op == Op::OpBitFieldSExtract ? math.bitfield_s_extract(v[0], v[1], v[2])
                                                            : math.bitfield_u_extract(v[0], v[1], v[2]);
                    }));
                }
            }
            return made;
        }
        case Op::OpIAddCarry: case Op::OpISubBorrow: case Op::OpUMulExtended: case Op::OpSMulExtended: {
            const Value x = get(operands[0]), y = get(operands[1]);
            std::vector<Component> low, high;
            for (std::size_t i = 0; i < x.components.size(); ++i) {
                const bool is_uniform = x.components[i].is_uniform() && y.components.at(i).is_uniform();
                llvm::Value* a = is_uniform ? x.components[i].value : widen(x.components[i]);
                llvm::Value* b = is_uniform ? y.components[i].value : widen(y.components[i]);
                if (op == Op::OpIAddCarry || op == Op::OpISubBorrow) {
                    const auto carried = op == Op::OpIAddCarry ? math.uadd_carry(a, b) : math.usub_borrow(a, b);
                    low.emplace_back(carried.result), high.emplace_back(carried.carry);
                } else {
                    const auto both_words =
                        op == Op::OpUMulExtended ? math.umul_extended(a, b) : math.smul_extended(a, b);
                    low.emplace_back(both_words.low), high.emplace_back(both_words.high);
                }
            }
            low.insert(low.end(), high.begin(), high.end());
            return low;
        }

        // Logic.
        case Op::OpLogicalEqual:
            return binary([&](auto* x, auto* y) { return builder.CreateNot(builder.CreateXor(x, y)); });
        case Op::OpLogicalNotEqual: return binary([&](auto* x, auto* y) { return builder.CreateXor(x, y); });
        case Op::OpLogicalOr: return binary([&](auto* x, auto* y) { return builder.CreateOr(x, y); });
        case Op::OpLogicalAnd: return binary([&](auto* x, auto* y) { return builder.CreateAnd(x, y); });
        case Op::OpLogicalNot: return unary([&](auto* x) { return builder.CreateNot(x); });
        case Op::OpAny:
        case Op::OpAll: {
            const Value x = get(operands[0]);
            Component all = x.components.at(0);
            for (std::size_t i = 1; i < x.components.size(); ++i)
                all = apply({all, x.components[i]}, [&](Values v) {
                    return op == Op::OpAny ? builder.CreateOr(v[0], v[1]) : builder.CreateAnd(v[0], v[1]);
                });
            return {all};
        }
        case Op::OpSelect: {
            const Value condition = get(operands[0]);
            const std::vector<Component> yes = get_components(operands[1]), no = get_components(operands[2]);
            std::vector<Component> made;
            for (std::size_t i = 0; i < yes.size(); ++i) {
                const Component& which =
                    condition.components.size() == 1 ? condition.components[0] : condition.components.at(i);
                if (which.is_uniform() && !(yes[i].is_uniform() && no.at(i).is_uniform()))
                    made.emplace_back(select(which.value, widen(yes[i]), widen(no.at(i))));
                else
                    made.push_back(apply({which, yes[i], no.at(i)},
                                         [&](Values v) { return select(v[0], v[1], v[2]); }));
            }
            return made;
        }

        // Floating point.
        case Op::OpFNegate: return unary([&](auto* x) { return builder.CreateFNeg(x); });
        case Op::OpFAdd: return binary([&](auto* x, auto* y) { return builder.CreateFAdd(x, y); });
        case Op::OpFSub: return binary([&](auto* x, auto* y) { return builder.CreateFSub(x, y); });
        case Op::OpFMul: return binary([&](auto* x, auto* y) { return builder.CreateFMul(x, y); });
        case Op::OpFDiv: return binary([&](auto* x, auto* y) { return builder.CreateFDiv(x, y); });
        case Op::OpFRem: return binary([&](auto* x, auto* y) { return math.f_rem(x, y); });
        case Op::OpFMod: return binary([&](auto* x, auto* y) { return math.f_mod(x, y); });
        case Op::OpIsNan: return unary([&](auto* x) { return builder.CreateFCmpUNO(x, x); });
        case Op::OpIsInf:
            return unary([&](auto* x) {
                return builder.CreateFCmpOEQ(math.f_abs(x), llvm::ConstantFP::getInfinity(x->getType()));
            });
        case Op::OpVectorTimesScalar:
        case Op::OpMatrixTimesScalar: {
            const Component factor = get_scalar(operands[1]);
            std::vector<Component> made;
            for (const Component& x : get(operands[0]).components) made.push_back(product(x, factor));
            return made;
        }
        case Op::OpDot: {
            const Value x = get(operands[0]), y = get(operands[1]);
            Component sum = product(x.components.at(0), y.components.at(0));
            for (std::size_t i = 1; i < x.components.size(); ++i)
                sum = multiply_add(x.components[i], y.components.at(i), sum);
            return {sum};
        }
        case Op::OpSDot:
        case Op::OpUDot:
        case Op::OpSUDot:
        case Op::OpSDotAccSat:
        case Op::OpUDotAccSat:
        case Op::OpSUDotAccSat: {
            const bool is_unsigned = op == Op::OpUDot || op == Op::OpUDotAccSat;
            const bool is_mixed = op == Op::OpSUDot || op == Op::OpSUDotAccSat;
            const bool accumulates = op == Op::OpSDotAccSat || op == Op::OpUDotAccSat || op == Op::OpSUDotAccSat;
            llvm::Type* kind = scalar_type(scalar_of(type_id));
            const auto elements = [&](Id id, bool zero_extends) {
                const Type& type = module.type(module.type_of(id));
                std::vector<Component> parts = get(id).components;
                if (type.kind != TypeKind::vector) {  // Four packed bytes.
                    const Component word = parts.at(0);
                    parts.clear();
                    for (unsigned shift = 0; shift < 32; shift += 8)
                        parts.push_back(apply({word}, [&](Values v) {
                            return builder.CreateTrunc(builder.CreateLShr(v[0], shift),
                                                       like(v[0], builder.getInt8Ty()));
                        }));
                }
                for (Component& part : parts)
                    part = apply({part}, [&](Values v) {
                        return zero_extends ? builder.CreateZExtOrTrunc(v[0], like(v[0], kind))
                                            : builder.CreateSExtOrTrunc(v[0], like(v[0], kind));
                    });
                return parts;
            };
            const std::vector<Component> x = elements(operands[0], is_unsigned),
                                         y = elements(operands[1], is_unsigned || is_mixed);
            Component sum;
            for (std::size_t i = 0; i < x.size(); ++i) {
                const Component term = apply({x[i], y.at(i)}, [&](Values v) { return builder.CreateMul(v[0], v[1]); });
                sum = sum ? apply({sum, term}, [&](Values v) { return builder.CreateAdd(v[0], v[1]); }) : term;
            }
            if (accumulates)
                sum = apply({sum, get_scalar(operands[2])}, [&](Values v) {
                    return builder.CreateBinaryIntrinsic(
                        is_unsigned ? llvm::Intrinsic::uadd_sat : llvm::Intrinsic::sadd_sat, v[0], v[1]);
                });
            return {sum};
        }
        case Op::OpMatrixTimesVector: {
            const Type& matrix = module.type(operand_type(0));
            const std::uint32_t rows = module.type(matrix.element).count;
            const Value m = get(operands[0]), v = get(operands[1]);
            std::vector<Component> made;
            for (std::uint32_t row = 0; row < rows; ++row) {
                Component sum = product(m.components[row], v.components.at(0));
                for (std::uint32_t column = 1; column < matrix.count; ++column)
                    sum = multiply_add(m.components[column * rows + row], v.components[column], sum);
                made.push_back(sum);
            }
            return made;
        }
        case Op::OpVectorTimesMatrix: {
            const Type& matrix = module.type(operand_type(1));
            const std::uint32_t rows = module.type(matrix.element).count;
            const Value v = get(operands[0]), m = get(operands[1]);
            std::vector<Component> made;
            for (std::uint32_t column = 0; column < matrix.count; ++column) {
                Component sum = product(v.components.at(0), m.components[column * rows]);
                for (std::uint32_t row = 1; row < rows; ++row)
                    sum = multiply_add(v.components[row], m.components[column * rows + row], sum);
                made.push_back(sum);
            }
            return made;
        }
        case Op::OpMatrixTimesMatrix: {
            const Type &left = module.type(operand_type(0)), &right = module.type(operand_type(1));
            const std::uint32_t rows = module.type(left.element).count, inner = left.count;
            const Value a = get(operands[0]), b = get(operands[1]);
            std::vector<Component> made;
            for (std::uint32_t column = 0; column < right.count; ++column)
                for (std::uint32_t row = 0; row < rows; ++row) {
                    Component sum = product(a.components[row], b.components[column * inner]);
                    for (std::uint32_t k = 1; k < inner; ++k)
                        sum = multiply_add(a.components[k * rows + row], b.components[column * inner + k], sum);
                    made.push_back(sum);
                }
            return made;
        }
        case Op::OpOuterProduct: {
            const Value column_vector = get(operands[0]), row_vector = get(operands[1]);
            std::vector<Component> made;
            for (const Component& y : row_vector.components)
                for (const Component& x : column_vector.components) made.push_back(product(x, y));
            return made;
        }
        case Op::OpTranspose: {
            const Type& matrix = module.type(operand_type(0));
            const std::uint32_t rows = module.type(matrix.element).count;
            const Value m = get(operands[0]);
            std::vector<Component> made;
            for (std::uint32_t row = 0; row < rows; ++row)
                for (std::uint32_t column = 0; column < matrix.count; ++column)
                    made.push_back(m.components[column * rows + row]);
            return made;
        }

        // Conversions.
        case Op::OpConvertFToU: case Op::OpConvertFToS: {
            const unsigned bits = scalar_of(type_id).bits;
            return unary([&](auto* x) { return math.float_to_int(x, bits, op == Op::OpConvertFToS); });
        }
        case Op::OpConvertSToF: case Op::OpConvertUToF: {
            llvm::Type* to = scalar_type(scalar_of(type_id));
            return unary([&](auto* x) { return math.int_to_float(x, to, op == Op::OpConvertSToF); });
        }
        case Op::OpUConvert: case Op::OpSConvert: {
            llvm::Type* to = scalar_type(scalar_of(type_id));
            return unary([&](auto* x) {
                llvm::Type* kind = x->getType()->isVectorTy() ? vector_of(to) : to;
                return op == Op::OpUConvert ? builder.CreateZExtOrTrunc(x, kind) : builder.CreateSExtOrTrunc(x, kind);
            });
        }
        case Op::OpFConvert: {
            llvm::Type* to = scalar_type(scalar_of(type_id));
            return unary([&](auto* x) { return math.convert_float(x, to); });
        }
        case Op::OpQuantizeToF16:
            note_narrowed("rounding to 16 bits");
            return unary([&](auto* x) { return math.quantize_to_f16(x); });
        case Op::OpBitcast: {
            const Value from = get(operands[0]);
            if (from.pointer || module.type(type_id).kind == TypeKind::pointer)
                reject("casts of pointers are not supported");
            const Type &source = scalar_of(operand_type(0)), &to = scalar_of(type_id);
            const auto is_narrow = [](const Type& scalar) {
                return scalar.kind == TypeKind::floating && scalar.bits < 64;
            };
            if (is_narrow(source) || is_narrow(to)) note_narrowed("bit cast");
            std::vector<Component> made;
            if (source.bits == to.bits) {
                for (const Component& x : from.components) made.push_back(of_bits(bits_of(x, source), to));
                return made;
            }
            // Components of different widths: lower-numbered components are the lower bits.
            if (source.bits < to.bits) {
                const std::uint32_t parts = to.bits / source.bits;
                for (std::size_t i = 0; i + parts <= from.components.size(); i += parts) {
                    Component whole;
                    for (std::uint32_t k = 0; k < parts; ++k) {
                        Component part = apply({bits_of(from.components[i + k], source)}, [&](Values v) {
                            llvm::Type* wide = builder.getIntNTy(to.bits);
                            llvm::Value* bits = builder.CreateZExt(v[0], like(v[0], wide));
                            return k ? builder.CreateShl(bits, k * source.bits) : bits;
                        });
                        whole =
                            whole ? apply({whole, part}, [&](Values v) { return builder.CreateOr(v[0], v[1]); }) : part;
                    }
                    made.push_back(of_bits(whole, to));
                }
            } else {
                const std::uint32_t parts = source.bits / to.bits;
                for (const Component& x : from.components)
                    for (std::uint32_t k = 0; k < parts; ++k) {
                        const Component part = apply({bits_of(x, source)}, [&](Values v) {
                            llvm::Value* bits = k ? builder.CreateLShr(v[0], k * to.bits) : v[0];
                            return builder.CreateTrunc(bits, like(bits, builder.getIntNTy(to.bits)));
                        });
                        made.push_back(of_bits(part, to));
                    }
            }
            return made;
        }
        default: return {};
    }
}

}  // namespace nacre::cpu
