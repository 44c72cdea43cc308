// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/math/term.h"

namespace nacre::cpu {

namespace {

using Value = llvm::Value;

/// One normalized component as an integer in the low bits of i32, the bits above zero.
Term pack_normalized(const Term& component, unsigned bits, bool is_signed) {
    const Term x = convert(component, component.builder().getFloatTy());
    // NaN becomes zero: it is not above zero, and neither it nor its magnitude is.
    const Term low = is_signed ? max(x, x.number(-1)) : max(x, x.number(0));
    Term bounded = min(low, x.number(1));
    if (is_signed) bounded = select(is_nan(x), x.number(0), bounded);
    const double scale = static_cast<double>((1u << (is_signed ? bits - 1 : bits)) - 1);
    // The low bits of x + 1.5 * 2^23 are those of x rounded to even, in two's complement where negative.
    const Term rounded = round_to_whole(bounded * scale).bits;
    return rounded & rounded.integer((1 << bits) - 1);
}

template <std::size_t count>
Value* pack_all(Emission& emission, const std::array<Value*, count>& components, bool is_signed) {
    constexpr unsigned bits = 32 / count;
    Term word = pack_normalized({emission, components[0]}, bits, is_signed);
    for (unsigned i = 1; i < count; ++i)
        word = word | (pack_normalized({emission, components[i]}, bits, is_signed) << (i * bits));
    return word.value();
}

/// number / (2^bits - 1) as correctly rounded, for whole numbers of that many bits: the reciprocal in two parts, the
/// first of which multiplies exactly. A division takes several times as long.
Term divide_by_ones(const Term& number, unsigned bits) {
    const double divisor = static_cast<double>((1u << bits) - 1);
    const double high_scale = static_cast<double>(1u << (24 - bits + bits - 1));
    const double high = static_cast<double>(static_cast<std::int64_t>(high_scale / divisor)) / high_scale;
    return number * high + number * (1 / divisor - high);
}

template <std::size_t count>
std::array<Value*, count> unpack_all(Emission& emission, Value* word, bool is_signed) {
    constexpr unsigned bits = 32 / count;
    const Term packed(emission, word);
    llvm::Type* single = packed.type_of(emission.builder.getFloatTy());
    std::array<Value*, count> components;
    for (unsigned i = 0; i < count; ++i) {
        if (is_signed) {
            const Term field = (packed << (32 - bits * (i + 1))) >> (32 - bits);
            const Term number = field.with(emission.builder.CreateSIToFP(field.value(), single));
            components[i] = max(number.number(-1), divide_by_ones(number, bits - 1)).value();
        } else {
            const Term field = shift_right_logical(packed, i * bits) & packed.integer((1 << bits) - 1);
            // Signed, because it is positive either way and not every target converts unsigned vectors.
            const Term number = field.with(emission.builder.CreateSIToFP(field.value(), single));
            components[i] = divide_by_ones(number, bits).value();
        }
    }
    return components;
}

}  // namespace

Value* Math::pack_unorm4x8(const std::array<Value*, 4>& components) {
    Emission emission(builder_, options_);
    return pack_all(emission, components, false);
}

Value* Math::pack_snorm4x8(const std::array<Value*, 4>& components) {
    Emission emission(builder_, options_);
    return pack_all(emission, components, true);
}

Value* Math::pack_unorm2x16(const std::array<Value*, 2>& components) {
    Emission emission(builder_, options_);
    return pack_all(emission, components, false);
}

Value* Math::pack_snorm2x16(const std::array<Value*, 2>& components) {
    Emission emission(builder_, options_);
    return pack_all(emission, components, true);
}

Value* Math::pack_half2x16(const std::array<Value*, 2>& components) {
    Emission emission(builder_, options_);
    const auto half = [&](Value* component) {
        const Term single = convert({emission, component}, builder_.getFloatTy());
        return resize(single_to_half(single), builder_.getInt32Ty(), false);
    };
    return (half(components[0]) | (half(components[1]) << 16)).value();
}

Value* Math::pack_double2x32(const std::array<Value*, 2>& words) {
    Emission emission(builder_, options_);
    const auto wide = [&](Value* word) { return resize({emission, word}, builder_.getInt64Ty(), false); };
    return (wide(words[0]) | (wide(words[1]) << 32)).from_bits().value();
}

std::array<Value*, 4> Math::unpack_unorm4x8(Value* word) {
    Emission emission(builder_, options_);
    return unpack_all<4>(emission, word, false);
}

std::array<Value*, 4> Math::unpack_snorm4x8(Value* word) {
    Emission emission(builder_, options_);
    return unpack_all<4>(emission, word, true);
}

std::array<Value*, 2> Math::unpack_unorm2x16(Value* word) {
    Emission emission(builder_, options_);
    return unpack_all<2>(emission, word, false);
}

std::array<Value*, 2> Math::unpack_snorm2x16(Value* word) {
    Emission emission(builder_, options_);
    return unpack_all<2>(emission, word, true);
}

std::array<Value*, 2> Math::unpack_half2x16(Value* word) {
    Emission emission(builder_, options_);
    const Term packed(emission, word);
    llvm::Type* half = builder_.getInt16Ty();
    return {half_to_single(resize(packed, half, false)).value(),
            half_to_single(resize(cpu::shift_right_logical(packed, 16u), half, false)).value()};
}

std::array<Value*, 2> Math::unpack_double2x32(Value* number) {
    Emission emission(builder_, options_);
    const Term bits = Term(emission, number).to_bits();
    llvm::Type* word = builder_.getInt32Ty();
    return {resize(bits, word, false).value(), resize(cpu::shift_right_logical(bits, 32u), word, false).value()};
}

}  // namespace nacre::cpu
