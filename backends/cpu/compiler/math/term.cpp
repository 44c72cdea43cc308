// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/math/term.h"

#include <llvm/IR/IntrinsicsX86.h>
#include <llvm/IR/Module.h>

#include <algorithm>
#include <array>

namespace nacre::cpu {

Emission::Emission(llvm::IRBuilder<>& at, const MathOptions& choice)
    : builder(at.GetInsertBlock(), at.GetInsertPoint()), options(choice) {
    builder.SetCurrentDebugLocation(at.getCurrentDebugLocation());
}

llvm::Type* Term::type_of(llvm::Type* element) const { return type()->getWithNewType(element); }

Term Term::number(double value) const { return with(llvm::ConstantFP::get(type(), value)); }

Term Term::integer(std::int64_t value) const {
    llvm::Type* element = builder().getIntNTy(bits());
    return with(llvm::ConstantInt::get(type_of(element), static_cast<std::uint64_t>(value), true));
}

Term Term::to_bits() const { return with(builder().CreateBitCast(value_, type_of(builder().getIntNTy(bits())))); }

Term Term::from_bits() const {
    return with(
        builder().CreateBitCast(value_, type_of(bits() == 64 ? builder().getDoubleTy() : builder().getFloatTy())));
}

namespace {

bool is_float(const Term& x) { return x.type()->isFPOrFPVectorTy(); }

Term constant(const Term& like, double value) {
    return is_float(like) ? like.number(value) : like.integer(static_cast<std::int64_t>(value));
}

Term compare(const Term& a, const Term& b, llvm::CmpInst::Predicate floats, llvm::CmpInst::Predicate integers) {
    return a.with(a.builder().CreateCmp(is_float(a) ? floats : integers, a.value(), b.value()));
}

}  // namespace

Term operator+(const Term& a, const Term& b) {
    return a.with(is_float(a) ? a.builder().CreateFAdd(a.value(), b.value())
                              : a.builder().CreateAdd(a.value(), b.value()));
}
Term operator-(const Term& a, const Term& b) {
    return a.with(is_float(a) ? a.builder().CreateFSub(a.value(), b.value())
                              : a.builder().CreateSub(a.value(), b.value()));
}
Term operator*(const Term& a, const Term& b) {
    return a.with(is_float(a) ? a.builder().CreateFMul(a.value(), b.value())
                              : a.builder().CreateMul(a.value(), b.value()));
}
Term operator/(const Term& a, const Term& b) { return a.with(a.builder().CreateFDiv(a.value(), b.value())); }
Term operator-(const Term& a) {
    return a.with(is_float(a) ? a.builder().CreateFNeg(a.value()) : a.builder().CreateNeg(a.value()));
}
Term operator&(const Term& a, const Term& b) { return a.with(a.builder().CreateAnd(a.value(), b.value())); }
Term operator|(const Term& a, const Term& b) { return a.with(a.builder().CreateOr(a.value(), b.value())); }
Term operator^(const Term& a, const Term& b) { return a.with(a.builder().CreateXor(a.value(), b.value())); }
Term operator<<(const Term& a, const Term& b) { return a.with(a.builder().CreateShl(a.value(), b.value())); }
Term operator>>(const Term& a, const Term& b) { return a.with(a.builder().CreateAShr(a.value(), b.value())); }
Term shift_right_logical(const Term& a, const Term& b) { return a.with(a.builder().CreateLShr(a.value(), b.value())); }

Term operator+(const Term& a, double b) { return a + constant(a, b); }
Term operator-(const Term& a, double b) { return a - constant(a, b); }
Term operator-(double a, const Term& b) { return constant(b, a) - b; }
Term operator*(const Term& a, double b) { return a * constant(a, b); }
Term operator/(double a, const Term& b) { return constant(b, a) / b; }
Term operator<<(const Term& a, unsigned amount) { return a << a.integer(amount); }
Term operator>>(const Term& a, unsigned amount) { return a >> a.integer(amount); }
Term shift_right_logical(const Term& a, unsigned amount) { return shift_right_logical(a, a.integer(amount)); }

Term operator<(const Term& a, const Term& b) { return compare(a, b, llvm::CmpInst::FCMP_OLT, llvm::CmpInst::ICMP_SLT); }
Term operator>(const Term& a, const Term& b) { return compare(a, b, llvm::CmpInst::FCMP_OGT, llvm::CmpInst::ICMP_SGT); }
Term operator<=(const Term& a, const Term& b) {
    return compare(a, b, llvm::CmpInst::FCMP_OLE, llvm::CmpInst::ICMP_SLE);
}
Term operator>=(const Term& a, const Term& b) {
    return compare(a, b, llvm::CmpInst::FCMP_OGE, llvm::CmpInst::ICMP_SGE);
}
Term operator==(const Term& a, const Term& b) { return compare(a, b, llvm::CmpInst::FCMP_OEQ, llvm::CmpInst::ICMP_EQ); }
Term operator<(const Term& a, double b) { return a < constant(a, b); }
Term operator>(const Term& a, double b) { return a > constant(a, b); }
Term operator<=(const Term& a, double b) { return a <= constant(a, b); }
Term operator>=(const Term& a, double b) { return a >= constant(a, b); }
Term operator==(const Term& a, double b) { return a == constant(a, b); }
Term is_nan(const Term& x) { return x.with(x.builder().CreateFCmpUNO(x.value(), x.value())); }
Term unsigned_less(const Term& a, const Term& b) { return a.with(a.builder().CreateICmpULT(a.value(), b.value())); }

Term select(const Term& condition, const Term& yes, const Term& no) {
    return yes.with(yes.builder().CreateSelect(condition.value(), yes.value(), no.value()));
}

Term multiply_add(const Term& a, const Term& b, const Term& c) {
    if (!a.emission().options.contract) return a * b + c;
    return a.with(a.builder().CreateIntrinsic(llvm::Intrinsic::fmuladd, {a.type()}, {a.value(), b.value(), c.value()}));
}
Term multiply_add(const Term& a, double b, const Term& c) { return multiply_add(a, a.number(b), c); }

Term abs(const Term& x) { return intrinsic(llvm::Intrinsic::fabs, x); }

Term copy_sign(const Term& magnitude, const Term& sign) {
    return magnitude.with(
        magnitude.builder().CreateBinaryIntrinsic(llvm::Intrinsic::copysign, magnitude.value(), sign.value()));
}

Term min(const Term& a, const Term& b) { return select(a < b, a, b); }
Term max(const Term& a, const Term& b) { return select(a > b, a, b); }

Term intrinsic(llvm::Intrinsic::ID id, const Term& x) {
    return x.with(x.builder().CreateUnaryIntrinsic(id, x.value()));
}

Term polynomial(const Term& x, std::span<const float> coefficients) {
    Term sum = x.number(coefficients.back());
    for (std::size_t i = coefficients.size() - 1; i-- > 0;) sum = multiply_add(sum, x, x.number(coefficients[i]));
    return sum;
}

Term resize(const Term& x, llvm::Type* element, bool is_signed) {
    return x.with(x.builder().CreateIntCast(x.value(), x.type_of(element), is_signed));
}

namespace {

unsigned lanes_of(const Term& x) {
    const auto* vector = llvm::dyn_cast<llvm::FixedVectorType>(x.type());
    return vector ? vector->getNumElements() : 1;
}

/// A masked instruction of AVX-512 that does a thing to every lane. Scalars go through the first lane of a vector.
/// @param intrinsics      for 4, 8 and 16 lanes
/// @param result_element  type of the result in one lane
Term for_all_lanes(const std::array<llvm::Intrinsic::ID, 3>& intrinsics, std::vector<llvm::Value*> operands,
                   const Term& x, llvm::Type* result_element) {
    llvm::IRBuilder<>& builder = x.builder();
    const unsigned lanes = std::max(lanes_of(x), 4u);
    auto* const vector = llvm::FixedVectorType::get(builder.getFloatTy(), lanes);
    const bool is_scalar = !x.type()->isVectorTy();
    for (llvm::Value*& operand : operands)
        if (operand->getType()->isFloatTy())
            operand = builder.CreateInsertElement(llvm::Constant::getNullValue(vector), operand, std::uint64_t{0});
    operands.push_back(llvm::Constant::getNullValue(llvm::FixedVectorType::get(result_element, lanes)));
    operands.push_back(llvm::ConstantInt::getAllOnesValue(builder.getIntNTy(std::max(lanes, 8u))));
    constexpr std::uint32_t rounds_as_set = 4;
    if (lanes == 16) operands.push_back(builder.getInt32(rounds_as_set));
    llvm::Value* result = builder.CreateIntrinsic(intrinsics[lanes == 4 ? 0 : lanes == 8 ? 1 : 2], {}, operands);
    return x.with(is_scalar ? builder.CreateExtractElement(result, std::uint64_t{0}) : result);
}

}  // namespace

bool has_exponent_instructions(const Term& x) {
    const unsigned lanes = lanes_of(x);
    return x.emission().options.exponent_instructions && x.element()->isFloatTy() &&
           (lanes == 1 || lanes == 4 || lanes == 8 || lanes == 16);
}

Term exponent_of(const Term& x) {
    using namespace llvm::Intrinsic;
    return for_all_lanes({x86_avx512_mask_getexp_ps_128, x86_avx512_mask_getexp_ps_256, x86_avx512_mask_getexp_ps_512},
                         {x.value()}, x, x.element());
}

Term significand_of(const Term& x) {
    constexpr std::uint32_t from_one_to_two = 0, negative_is_nan = 2 << 2;
    using namespace llvm::Intrinsic;
    return for_all_lanes(
        {x86_avx512_mask_getmant_ps_128, x86_avx512_mask_getmant_ps_256, x86_avx512_mask_getmant_ps_512},
        {x.value(), x.builder().getInt32(from_one_to_two | negative_is_nan)}, x, x.element());
}

Term times_power_of_two(const Term& x, const Term& exponent) {
    using namespace llvm::Intrinsic;
    return for_all_lanes({x86_avx512_mask_scalef_ps_128, x86_avx512_mask_scalef_ps_256, x86_avx512_mask_scalef_ps_512},
                         {x.value(), exponent.value()}, x, x.element());
}

bool has_conversion_instructions(const Term& x) {
    const unsigned lanes = lanes_of(x);
    return x.emission().options.conversion_instructions && x.element()->isFloatTy() &&
           (lanes == 4 || lanes == 8 || lanes == 16);
}

Term to_unsigned(const Term& x) {
    using namespace llvm::Intrinsic;
    return for_all_lanes(
        {x86_avx512_mask_cvttps2udq_128, x86_avx512_mask_cvttps2udq_256, x86_avx512_mask_cvttps2udq_512}, {x.value()},
        x, x.builder().getInt32Ty());
}

Rounded round_to_whole(const Term& x) {
    constexpr double shifter = 0x1.8p23;
    const Term shifted = x + shifter;
    return {shifted - shifter, shifted.to_bits()};
}

Term call_per_lane(const char* function, std::span<const Term> arguments) {
    const Term& first = arguments.front();
    llvm::IRBuilder<>& builder = first.builder();
    llvm::Type* element = first.element();
    llvm::Module& module = *builder.GetInsertBlock()->getModule();
    const std::vector<llvm::Type*> parameters(arguments.size(), element);
    llvm::FunctionCallee callee =
        module.getOrInsertFunction(function, llvm::FunctionType::get(element, parameters, false));
    if (auto* declaration = llvm::dyn_cast<llvm::Function>(callee.getCallee())) {
        // Nobody reads errno here: calls may be merged, moved and dropped.
        declaration->setDoesNotAccessMemory();
        declaration->setDoesNotThrow();
        declaration->setWillReturn();
    }
    auto* vector = llvm::dyn_cast<llvm::FixedVectorType>(first.type());
    const unsigned lanes = vector ? vector->getNumElements() : 1;
    llvm::Value* result = vector ? llvm::PoisonValue::get(vector) : nullptr;
    for (unsigned lane = 0; lane < lanes; ++lane) {
        std::vector<llvm::Value*> values;
        for (const Term& argument : arguments)
            values.push_back(vector ? builder.CreateExtractElement(argument.value(), lane) : argument.value());
        llvm::Value* value = builder.CreateCall(callee, values);
        result = vector ? builder.CreateInsertElement(result, value, lane) : value;
    }
    return first.with(result);
}

}  // namespace nacre::cpu
