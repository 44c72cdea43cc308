// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <type_traits>

#include "tests/backends/cpu/math/evaluate.h"
#include "tests/backends/cpu/math/samples.h"

// Integers of all widths against plain C++ in wider types.

namespace nacre::cpu {
namespace {

__extension__ typedef __int128 Wide;
__extension__ typedef unsigned __int128 UnsignedWide;

template <typename S>
class Integer : public testing::Test {
  public:
    using SignedNumber = S;
    using Number = std::make_unsigned_t<S>;
    static constexpr int width = 8 * sizeof(S);

    /// All bytes, or edges and some noise of wider integers.
    static std::vector<Number> samples() {
        std::vector<Number> result;
        if constexpr (width == 8) {
            for (int i = 0; i < 256; ++i) result.push_back(static_cast<Number>(i));
        } else {
            for (int i = 0; i < width; ++i)
                for (const int near : {-1, 0, 1}) {
                    const Number x = static_cast<Number>((Number{1} << i) + static_cast<Number>(near));
                    result.push_back(x);
                    result.push_back(static_cast<Number>(~x));
                }
            for (const int small : {3, 5, 6, 7, 10, 100}) {
                result.push_back(static_cast<Number>(small));
                result.push_back(static_cast<Number>(-small));
            }
            for (std::uint64_t i = 0; i < 40; ++i) result.push_back(static_cast<Number>(noise(i) >> (i % width)));
        }
        return result;
    }

    template <typename Expected>
    static void check_one(const char* name, const Emit& emit, Expected expected) {
        const std::vector<Number> x = samples();
        for (const Variant& variant : exact_variants()) {
            const auto result = evaluate_one<Number>(variant, emit, x);
            for (std::size_t i = 0; i < x.size(); ++i)
                ASSERT_EQ(+result[i], +static_cast<Number>(expected(x[i])))
                    << name << " " << +x[i] << "; " << variant.name();
        }
    }

    template <typename Expected>
    static void check_two(const char* name, const Emit& emit, Expected expected) {
        const auto [x, y] = all_pairs(samples());
        for (const Variant& variant : exact_variants()) {
            const auto result = evaluate_one<Number>(variant, emit, x, y);
            for (std::size_t i = 0; i < x.size(); ++i)
                ASSERT_EQ(+result[i], +static_cast<Number>(expected(x[i], y[i])))
                    << name << " " << +x[i] << " " << +y[i] << "; " << variant.name();
        }
    }

    template <typename Expected>
    static void check_pair(const char* name, const Emit& emit, Expected expected) {
        const auto [x, y] = all_pairs(samples());
        for (const Variant& variant : exact_variants()) {
            const auto [first, second] = evaluate<Number, Number>(variant, emit, x, y);
            for (std::size_t i = 0; i < x.size(); ++i) {
                const auto [expected_first, expected_second] = expected(x[i], y[i]);
                ASSERT_TRUE(first[i] == static_cast<Number>(expected_first) &&
                            second[i] == static_cast<Number>(expected_second))
                    << name << " " << +x[i] << " " << +y[i] << " = " << +first[i] << ", " << +second[i] << "; "
                    << variant.name();
            }
        }
    }

    static Wide as_signed(Number x) { return static_cast<SignedNumber>(x); }
};

using Widths = testing::Types<std::int8_t, std::int16_t, std::int32_t, std::int64_t>;
TYPED_TEST_SUITE(Integer, Widths);

TYPED_TEST(Integer, is_divided_without_traps) {
    using Unsigned = typename TestFixture::Number;
    const auto s = [](Unsigned x) { return TestFixture::as_signed(x); };
    this->check_two("s_div", call(&Math::s_div), [&](Unsigned x, Unsigned y) { return y == 0 ? 0 : s(x) / s(y); });
    this->check_two("s_rem", call(&Math::s_rem), [&](Unsigned x, Unsigned y) { return y == 0 ? -1 : s(x) % s(y); });
    this->check_two("s_mod", call(&Math::s_mod), [&](Unsigned x, Unsigned y) {
        if (y == 0) return Wide{-1};
        const Wide remainder = s(x) % s(y);
        return remainder != 0 && (remainder < 0) != (s(y) < 0) ? remainder + s(y) : remainder;
    });
    constexpr Unsigned ones = std::numeric_limits<Unsigned>::max();
    this->check_two("u_div", call(&Math::u_div),
                    [](Unsigned x, Unsigned y) { return y == 0 ? ones : static_cast<Unsigned>(x / y); });
    this->check_two("u_mod", call(&Math::u_mod),
                    [](Unsigned x, Unsigned y) { return y == 0 ? ones : static_cast<Unsigned>(x % y); });
}

TYPED_TEST(Integer, is_divided_by_constants) {
    using Unsigned = typename TestFixture::Number;
    for (const int divisor : {0, 1, -1, 3, 10, -7, 64}) {
        const auto with_constant = [&](llvm::Value* (Math::*function)(llvm::Value*, llvm::Value*)) -> Emit {
            return [function, divisor](Math& math, Values values) {
                llvm::Value* constant =
                    llvm::ConstantInt::get(values[0]->getType(), static_cast<std::uint64_t>(divisor), true);
                return std::vector<llvm::Value*>{(math.*function)(values[0], constant)};
            };
        };
        this->check_one("s_div", with_constant(&Math::s_div),
                        [&](Unsigned x) { return divisor == 0 ? 0 : TestFixture::as_signed(x) / divisor; });
        this->check_one("s_rem", with_constant(&Math::s_rem),
                        [&](Unsigned x) { return divisor == 0 ? -1 : TestFixture::as_signed(x) % divisor; });
        const Unsigned positive = static_cast<Unsigned>(divisor);
        this->check_one("u_div", with_constant(&Math::u_div), [&](Unsigned x) {
            return positive == 0 ? std::numeric_limits<Unsigned>::max() : static_cast<Unsigned>(x / positive);
        });
        this->check_one("u_mod", with_constant(&Math::u_mod), [&](Unsigned x) {
            return positive == 0 ? std::numeric_limits<Unsigned>::max() : static_cast<Unsigned>(x % positive);
        });
    }
}

TYPED_TEST(Integer, is_shifted_by_any_amount) {
    using Unsigned = typename TestFixture::Number;
    constexpr int mask = TestFixture::width - 1;
    const auto s = [](Unsigned x) { return TestFixture::as_signed(x); };
    this->check_two("left", call(&Math::shift_left),
                    [](Unsigned x, Unsigned y) { return UnsignedWide{x} << (y & mask); });
    this->check_two("right", call(&Math::shift_right_logical),
                    [](Unsigned x, Unsigned y) { return UnsignedWide{x} >> (y & mask); });
    this->check_two("right, signed", call(&Math::shift_right_arithmetic),
                    [&](Unsigned x, Unsigned y) { return s(x) >> (y & mask); });
}

TYPED_TEST(Integer, is_searched_for_bits) {
    using Unsigned = typename TestFixture::Number;
    constexpr int bits = TestFixture::width;
    const auto highest = [](Unsigned x) {
        for (int i = bits - 1; i >= 0; --i)
            if (x >> i & 1) return i;
        return -1;
    };
    this->check_one("find_lsb", call(&Math::find_lsb), [](Unsigned x) {
        for (int i = 0; i < bits; ++i)
            if (x >> i & 1) return i;
        return -1;
    });
    this->check_one("find_u_msb", call(&Math::find_u_msb), highest);
    this->check_one("find_s_msb", call(&Math::find_s_msb),
                    [&](Unsigned x) { return highest(x >> (bits - 1) ? static_cast<Unsigned>(~x) : x); });
    this->check_one("bit_count", call(&Math::bit_count), [](Unsigned x) {
        int count = 0;
        for (int i = 0; i < bits; ++i) count += static_cast<int>(x >> i & 1);
        return count;
    });
    this->check_one("bit_reverse", call(&Math::bit_reverse), [](Unsigned x) {
        UnsignedWide reversed = 0;
        for (int i = 0; i < bits; ++i) reversed |= UnsignedWide{static_cast<Unsigned>(x >> i & 1)} << (bits - 1 - i);
        return reversed;
    });
}

TYPED_TEST(Integer, has_a_sign_and_an_order) {
    using Unsigned = typename TestFixture::Number;
    const auto s = [](Unsigned x) { return TestFixture::as_signed(x); };
    this->check_one("s_abs", call(&Math::s_abs), [&](Unsigned x) { return s(x) < 0 ? -s(x) : s(x); });
    this->check_one("s_sign", call(&Math::s_sign), [&](Unsigned x) { return (s(x) > 0) - (s(x) < 0); });
    this->check_two("s_min", call(&Math::s_min), [&](Unsigned x, Unsigned y) { return std::min(s(x), s(y)); });
    this->check_two("s_max", call(&Math::s_max), [&](Unsigned x, Unsigned y) { return std::max(s(x), s(y)); });
    this->check_two("u_min", call(&Math::u_min), [](Unsigned x, Unsigned y) { return std::min(x, y); });
    this->check_two("u_max", call(&Math::u_max), [](Unsigned x, Unsigned y) { return std::max(x, y); });
    const auto clamp_to_next = [](auto function) -> Emit {
        return [function](Math& math, Values values) {
            return std::vector<llvm::Value*>{(math.*function)(values[0], values[1], values[1])};
        };
    };
    this->check_two("s_clamp", clamp_to_next(&Math::s_clamp), [](Unsigned, Unsigned y) { return y; });
    this->check_two("u_clamp", clamp_to_next(&Math::u_clamp), [](Unsigned, Unsigned y) { return y; });
    const auto clamp_to_some = [](auto function, int low, int high) -> Emit {
        return [=](Math& math, Values values) {
            llvm::Type* type = values[0]->getType();
            return std::vector<llvm::Value*>{
                (math.*function)(values[0], llvm::ConstantInt::get(type, static_cast<std::uint64_t>(low), true),
                                 llvm::ConstantInt::get(type, static_cast<std::uint64_t>(high), true))};
        };
    };
    this->check_one("s_clamp", clamp_to_some(&Math::s_clamp, -5, 7),
                    [&](Unsigned x) { return std::clamp(s(x), Wide{-5}, Wide{7}); });
    this->check_one("u_clamp", clamp_to_some(&Math::u_clamp, 5, 70),
                    [](Unsigned x) { return std::clamp<Unsigned>(x, 5, 70); });
}

TYPED_TEST(Integer, is_added_and_multiplied_with_all_digits) {
    using Unsigned = typename TestFixture::Number;
    constexpr int bits = TestFixture::width;
    const auto s = [](Unsigned x) { return TestFixture::as_signed(x); };
    const auto carried = [](auto function) -> Emit {
        return [function](Math& math, Values values) {
            const Math::Carried both = (math.*function)(values[0], values[1]);
            return std::vector<llvm::Value*>{both.result, both.carry};
        };
    };
    const auto product = [](auto function) -> Emit {
        return [function](Math& math, Values values) {
            const Math::Product both = (math.*function)(values[0], values[1]);
            return std::vector<llvm::Value*>{both.low, both.high};
        };
    };
    this->check_pair("uadd_carry", carried(&Math::uadd_carry), [](Unsigned x, Unsigned y) {
        const UnsignedWide sum = UnsignedWide{x} + y;
        return std::pair(sum, sum >> bits);
    });
    this->check_pair("usub_borrow", carried(&Math::usub_borrow),
                     [](Unsigned x, Unsigned y) { return std::pair(UnsignedWide{x} - y, x < y ? 1 : 0); });
    this->check_pair("umul_extended", product(&Math::umul_extended), [](Unsigned x, Unsigned y) {
        const UnsignedWide whole = UnsignedWide{x} * y;
        return std::pair(whole, whole >> bits);
    });
    this->check_pair("smul_extended", product(&Math::smul_extended), [&](Unsigned x, Unsigned y) {
        const Wide whole = s(x) * s(y);
        return std::pair(whole, whole >> bits);
    });
}

/// Bit i of x, zero beyond the width.
template <typename Unsigned>
unsigned bit(Unsigned x, std::uint64_t i) {
    return i < 8 * sizeof(Unsigned) ? static_cast<unsigned>(x >> i & 1) : 0;
}

template <typename Unsigned, typename Measure>
void check_bit_fields(const std::vector<Unsigned>& samples) {
    constexpr std::uint64_t bits = 8 * sizeof(Unsigned);
    std::vector<Unsigned> base, insert;
    std::vector<Measure> offset, count;
    std::size_t next = 0;
    const auto add = [&](std::uint64_t o, std::uint64_t c) {
        if (o > std::numeric_limits<Measure>::max() || c > std::numeric_limits<Measure>::max()) return;
        for (int repeat = 0; repeat < 3; ++repeat) {
            base.push_back(samples[noise(next) % samples.size()]);
            insert.push_back(samples[noise(next + 1) % samples.size()]);
            offset.push_back(static_cast<Measure>(o));
            count.push_back(static_cast<Measure>(c));
            next += 2;
        }
    };
    for (std::uint64_t o = 0; o <= bits + 2; ++o)
        for (std::uint64_t c = 0; c <= bits + 2; ++c) add(o, c);
    for (const std::uint64_t large : {std::uint64_t{200}, std::uint64_t{255}, std::uint64_t{256},
                                      std::uint64_t{0x80000000}, std::uint64_t{0xffffffff}, ~std::uint64_t{0}}) {
        add(large, 3);
        add(3, large);
        add(large, large);
    }
    for (const Variant& variant : exact_variants()) {
        const auto inserted =
            evaluate_one<Unsigned>(variant, call(&Math::bitfield_insert), base, insert, offset, count);
        const auto extracted = evaluate_one<Unsigned>(variant, call(&Math::bitfield_u_extract), base, offset, count);
        const auto extended = evaluate_one<Unsigned>(variant, call(&Math::bitfield_s_extract), base, offset, count);
        for (std::size_t i = 0; i < base.size(); ++i) {
            const std::uint64_t o = offset[i], c = std::min<std::uint64_t>(count[i], bits);
            for (std::uint64_t b = 0; b < bits; ++b) {
                const bool in_field = b >= o && b - o < c;
                ASSERT_EQ(bit(inserted[i], b), in_field ? bit(insert[i], b - o) : bit(base[i], b))
                    << "insert " << o << " " << c << " bit " << b << "; " << variant.name();
                const unsigned field_bit = b < c && o < bits ? bit(base[i], o + b) : 0;
                ASSERT_EQ(bit(extracted[i], b), field_bit)
                    << "extract " << o << " " << c << " bit " << b << "; " << variant.name();
                const unsigned sign = c > 0 && o < bits ? bit(base[i], o + c - 1) : 0;
                ASSERT_EQ(bit(extended[i], b), b < c ? field_bit : sign)
                    << "signed extract " << o << " " << c << " bit " << b << "; " << variant.name();
            }
        }
    }
}

TYPED_TEST(Integer, has_bit_fields) {
    check_bit_fields<typename TestFixture::Number, std::uint32_t>(this->samples());
    check_bit_fields<typename TestFixture::Number, std::uint8_t>(this->samples());
    check_bit_fields<typename TestFixture::Number, std::uint64_t>(this->samples());
}

}  // namespace
}  // namespace nacre::cpu
