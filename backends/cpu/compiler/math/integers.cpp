// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/math/term.h"

namespace nacre::cpu {

namespace {

using Value = llvm::Value;

/// An amount of any integer type in the type of x, modulo the width of x.
Term shift_amount(const Term& x, const Term& amount) {
    return resize(amount, x.element(), false) & x.integer(x.bits() - 1);
}

Term binary(llvm::Intrinsic::ID id, const Term& x, const Term& y) {
    return x.with(x.builder().CreateBinaryIntrinsic(id, x.value(), y.value()));
}

/// llvm.ctlz or llvm.cttz, with the width of x for zero.
Term count_zeros(llvm::Intrinsic::ID id, const Term& x) {
    return x.with(x.builder().CreateBinaryIntrinsic(id, x.value(), x.builder().getFalse()));
}

Term highest_one(const Term& x) {
    // 31 - 32 = -1 for zero.
    return x.integer(x.bits() - 1) - count_zeros(llvm::Intrinsic::ctlz, x);
}

/// An offset or count of any integer type in the type of x; what is too large becomes the width of x.
Term field_measure(const Term& x, const Term& given) {
    llvm::IRBuilder<>& builder = given.builder();
    const Term bounded = given.bits() > 6 ? binary(llvm::Intrinsic::umin, given, given.integer(x.bits())) : given;
    return resize(given.with(bounded.value()), builder.getIntNTy(x.bits()), false);
}

/// The lowest `count` bits, for counts up to the width.
Term low_ones(const Term& x, const Term& count) {
    const Term shorter = (x.integer(1) << (count & x.integer(x.bits() - 1))) - 1.0;
    return select(count == x.integer(x.bits()), x.integer(-1), shorter);
}

/// Shift by up to the width of x, which gives zero.
Term shift_out_left(const Term& x, const Term& amount) {
    return select(amount == x.integer(x.bits()), x.integer(0), x << (amount & x.integer(x.bits() - 1)));
}

Term shift_out_right(const Term& x, const Term& amount) {
    return select(amount == x.integer(x.bits()), x.integer(0),
                  shift_right_logical(x, amount & x.integer(x.bits() - 1)));
}

Term extract_field(const Term& base, const Term& offset, const Term& count) {
    return shift_out_right(base, offset) & low_ones(base, count);
}

template <typename Extend>
Math::Product wide_product(const Term& x, const Term& y, Extend extend) {
    llvm::IRBuilder<>& builder = x.builder();
    const Term product = extend(x, builder.getIntNTy(2 * x.bits())) * extend(y, builder.getIntNTy(2 * x.bits()));
    return {resize(product, x.element(), false).value(),
            resize(shift_right_logical(product, x.bits()), x.element(), false).value()};
}

}  // namespace

Value* Math::shift_left(Value* x, Value* amount) {
    Emission emission(builder_, options_);
    const Term shifted(emission, x);
    return (shifted << shift_amount(shifted, {emission, amount})).value();
}

Value* Math::shift_right_logical(Value* x, Value* amount) {
    Emission emission(builder_, options_);
    const Term shifted(emission, x);
    return cpu::shift_right_logical(shifted, shift_amount(shifted, {emission, amount})).value();
}

Value* Math::shift_right_arithmetic(Value* x, Value* amount) {
    Emission emission(builder_, options_);
    const Term shifted(emission, x);
    return (shifted >> shift_amount(shifted, {emission, amount})).value();
}

Value* Math::find_lsb(Value* x) {
    Emission emission(builder_, options_);
    const Term bits(emission, x);
    return select(bits == 0.0, bits.integer(-1), count_zeros(llvm::Intrinsic::cttz, bits)).value();
}

Value* Math::find_s_msb(Value* x) {
    Emission emission(builder_, options_);
    const Term bits(emission, x);
    return highest_one(bits ^ (bits >> (bits.bits() - 1))).value();
}

Value* Math::find_u_msb(Value* x) {
    Emission emission(builder_, options_);
    return highest_one({emission, x}).value();
}

Value* Math::bit_reverse(Value* x) {
    Emission emission(builder_, options_);
    return intrinsic(llvm::Intrinsic::bitreverse, {emission, x}).value();
}

Value* Math::bit_count(Value* x) {
    Emission emission(builder_, options_);
    return intrinsic(llvm::Intrinsic::ctpop, {emission, x}).value();
}

Value* Math::bitfield_insert(Value* base, Value* insert, Value* offset, Value* count) {
    Emission emission(builder_, options_);
    const Term whole(emission, base);
    const Term position = field_measure(whole, {emission, offset});
    const Term mask = shift_out_left(low_ones(whole, field_measure(whole, {emission, count})), position);
    const Term field = shift_out_left({emission, insert}, position);
    return (whole ^ ((whole ^ field) & mask)).value();
}

Value* Math::bitfield_s_extract(Value* base, Value* offset, Value* count) {
    Emission emission(builder_, options_);
    const Term whole(emission, base);
    const Term length = field_measure(whole, {emission, count});
    const Term field = extract_field(whole, field_measure(whole, {emission, offset}), length);
    // The field's own highest bit is the sign: everything above it becomes equal to it.
    const Term sign = low_ones(whole, length) ^ cpu::shift_right_logical(low_ones(whole, length), 1u);
    return ((field ^ sign) - sign).value();
}

Value* Math::bitfield_u_extract(Value* base, Value* offset, Value* count) {
    Emission emission(builder_, options_);
    const Term whole(emission, base);
    return extract_field(whole, field_measure(whole, {emission, offset}), field_measure(whole, {emission, count}))
        .value();
}

Value* Math::s_abs(Value* x) {
    Emission emission(builder_, options_);
    const Term number(emission, x);
    return select(number < 0.0, -number, number).value();
}

Value* Math::s_sign(Value* x) {
    Emission emission(builder_, options_);
    const Term number(emission, x);
    // All ones where negative, and a one where not zero.
    return ((number >> (number.bits() - 1)) | cpu::shift_right_logical(-number, number.bits() - 1)).value();
}

Value* Math::s_min(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return binary(llvm::Intrinsic::smin, {emission, x}, {emission, y}).value();
}

Value* Math::s_max(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return binary(llvm::Intrinsic::smax, {emission, x}, {emission, y}).value();
}

Value* Math::u_min(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return binary(llvm::Intrinsic::umin, {emission, x}, {emission, y}).value();
}

Value* Math::u_max(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return binary(llvm::Intrinsic::umax, {emission, x}, {emission, y}).value();
}

Value* Math::s_clamp(Value* x, Value* low, Value* high) { return s_min(s_max(x, low), high); }

Value* Math::u_clamp(Value* x, Value* low, Value* high) { return u_min(u_max(x, low), high); }

Math::Carried Math::uadd_carry(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const Term sum = Term(emission, x) + Term(emission, y);
    const Term carry = unsigned_less(sum, {emission, x});
    return {sum.value(), emission.builder.CreateZExt(carry.value(), sum.type())};
}

Math::Carried Math::usub_borrow(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const Term difference = Term(emission, x) - Term(emission, y);
    const Term borrow = unsigned_less({emission, x}, {emission, y});
    return {difference.value(), emission.builder.CreateZExt(borrow.value(), difference.type())};
}

Math::Product Math::umul_extended(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const auto extend = [](const Term& a, llvm::Type* wide) { return resize(a, wide, false); };
    return wide_product({emission, x}, {emission, y}, extend);
}

Math::Product Math::smul_extended(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const auto extend = [](const Term& a, llvm::Type* wide) { return resize(a, wide, true); };
    return wide_product({emission, x}, {emission, y}, extend);
}

}  // namespace nacre::cpu
