// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <string_view>

#include "backends/cpu/images/block_formats.h"

namespace nacre::cpu {

const std::uint16_t two_subset_partitions[64] = {
    0xcccc, 0x8888, 0xeeee, 0xecc8, 0xc880, 0xfeec, 0xfec8, 0xec80, 0xc800, 0xffec, 0xfe80, 0xe800, 0xffe8,
    0xff00, 0xfff0, 0xf000, 0xf710, 0x008e, 0x7100, 0x08ce, 0x008c, 0x7310, 0x3100, 0x8cce, 0x088c, 0x3110,
    0x6666, 0x366c, 0x17e8, 0x0ff0, 0x718e, 0x399c, 0xaaaa, 0xf0f0, 0x5a5a, 0x33cc, 0x3c3c, 0x55aa, 0x9696,
    0xa55a, 0x73ce, 0x13c8, 0x324c, 0x3bdc, 0x6996, 0xc33c, 0x9966, 0x0660, 0x0272, 0x04e4, 0x4e40, 0x2720,
    0xc936, 0x936c, 0x39c6, 0x639c, 0x9336, 0x9cc6, 0x817e, 0xe718, 0xccf0, 0x0fcc, 0x7744, 0xee22,
};
const std::uint8_t two_subset_anchors[64] = {
    15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 2,  8, 2,  2, 8,
    8,  15, 2,  8,  2,  2,  8,  8,  2,  2,  15, 15, 6,  8,  2,  8,  15, 15, 2, 8,  2, 2,
    2,  15, 15, 6,  6,  2,  6,  8,  15, 15, 2,  2,  15, 15, 15, 15, 15, 2,  2, 15,
};

namespace {

// Two bits a texel: its subset of three; and the anchors of the second and third subset.
constexpr std::uint32_t three_subset_partitions[64] = {
    0xaa685050, 0x6a5a5040, 0x5a5a4200, 0x5450a0a8, 0xa5a50000, 0xa0a05050, 0x5555a0a0, 0x5a5a5050,
    0xaa550000, 0xaa555500, 0xaaaa5500, 0x90909090, 0x94949494, 0xa4a4a4a4, 0xa9a59450, 0x2a0a4250,
    0xa5945040, 0x0a425054, 0xa5a5a500, 0x55a0a0a0, 0xa8a85454, 0x6a6a4040, 0xa4a45000, 0x1a1a0500,
    0x0050a4a4, 0xaaa59090, 0x14696914, 0x69691400, 0xa08585a0, 0xaa821414, 0x50a4a450, 0x6a5a0200,
    0xa9a58000, 0x5090a0a8, 0xa8a09050, 0x24242424, 0x00aa5500, 0x24924924, 0x24499224, 0x50a50a50,
    0x500aa550, 0xaaaa4444, 0x66660000, 0xa5a0a5a0, 0x50a050a0, 0x69286928, 0x44aaaa44, 0x66666600,
    0xaa444444, 0x54a854a8, 0x95809580, 0x96969600, 0xa85454a8, 0x80959580, 0xaa141414, 0x96960000,
    0xaaaa1414, 0xa05050a0, 0xa0a5a5a0, 0x96000000, 0x40804080, 0xa9a8a9a8, 0xaaaaaa44, 0x2a4a5254,
};
constexpr std::uint8_t three_subset_anchors[2][64] = {
    {3,  3,  15, 15, 8, 3,  15, 15, 8,  8,  6, 6,  6, 5,  3, 3,  3,  3,  8,  15, 3,  3,
     6,  10, 5,  8,  8, 6,  8,  5,  15, 15, 8, 15, 3, 5,  6, 10, 8,  15, 15, 3,  15, 5,
     15, 15, 15, 15, 3, 15, 5,  5,  5,  8,  5, 10, 5, 10, 8, 13, 15, 12, 3,  3},
    {15, 8, 8, 3,  15, 15, 3,  8,  15, 15, 15, 15, 15, 15, 15, 8,  15, 8,  15, 3,  15, 8,
     15, 8, 3, 15, 6,  10, 15, 15, 10, 8,  15, 3,  15, 10, 10, 8,  9,  10, 6,  15, 8,  15,
     3,  6, 6, 8,  15, 3,  15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 3,  15, 15, 8},
};

constexpr std::uint8_t weights_2[4] = {0, 21, 43, 64};
constexpr std::uint8_t weights_3[8] = {0, 9, 18, 27, 37, 46, 55, 64};
constexpr std::uint8_t weights_4[16] = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};
std::int32_t weight(std::uint32_t index, std::uint32_t bits) {
    return bits == 2 ? weights_2[index] : bits == 3 ? weights_3[index] : weights_4[index];
}
std::int32_t interpolate(std::int32_t a, std::int32_t b, std::int32_t w) { return (a * (64 - w) + b * w + 32) >> 6; }

// The 128 bits of a block from the lowest on.
class BitReader {
  public:
    explicit BitReader(const std::byte* block) {
        std::memcpy(&low_, block, 8);
        std::memcpy(&high_, block + 8, 8);
    }
    // At most 16 bits; 0 of them are 0.
    std::uint32_t take(std::uint32_t count) {
        const auto value = static_cast<std::uint32_t>(low_ & ((1u << count) - 1));
        if (count != 0) {
            low_ = (low_ >> count) | (high_ << (64 - count));
            high_ >>= count;
        }
        return value;
    }

  private:
    std::uint64_t low_ = 0, high_ = 0;
};

struct Bc7Mode {
    std::uint8_t subsets, partition_bits, rotation_bits, selection_bits, color_bits, alpha_bits;
    bool endpoint_p_bits, shared_p_bits;  // A low bit more for each endpoint, or for both of a subset.
    std::uint8_t index_bits, second_index_bits;
};
constexpr Bc7Mode bc7_modes[8] = {
    {3, 4, 0, 0, 4, 0, true, false, 3, 0},  {2, 6, 0, 0, 6, 0, false, true, 3, 0},
    {3, 6, 0, 0, 5, 0, false, false, 2, 0}, {2, 6, 0, 0, 7, 0, true, false, 2, 0},
    {1, 0, 2, 1, 5, 6, false, false, 2, 3}, {1, 0, 2, 0, 7, 8, false, false, 2, 2},
    {1, 0, 0, 0, 7, 7, true, false, 4, 0},  {2, 6, 0, 0, 5, 5, true, false, 2, 0},
};

// Widens `bits` (4 to 8) to 8 by repeating the highest.
std::uint32_t widen(std::uint32_t value, std::uint32_t bits) {
    value <<= 8 - bits;
    return value | (value >> bits);
}

// Fields of a BC6H block behind the mode, in the order of the bits. A field is channel (r, g, b), endpoint (w, x, y, z)
// and its highest and lowest bit as hexadecimal digits; "hl" with h < l means that the bits lie in reverse order.
struct Bc6hMode {
    std::uint8_t code, base_bits, delta_bits[3];
    bool is_delta, has_two_subsets;
    std::string_view fields;
};
// clang-format off
constexpr Bc6hMode bc6h_modes[14] = {
    {0x00, 10, {5, 5, 5}, true, true,
     "gy44 by44 bz44 rw90 gw90 bw90 rx40 gz44 gy30 gx40 bz00 gz30 bx40 bz11 by30 ry40 bz22 rz40 bz33"},
    {0x01, 7, {6, 6, 6}, true, true,
     "gy55 gz44 gz55 rw60 bz00 bz11 by44 gw60 by55 bz22 gy44 bw60 "
     "bz33 bz55 bz44 rx50 gy30 gx50 gz30 bx50 by30 ry50 rz50"},
    {0x02, 11, {5, 4, 4}, true, true,
     "rw90 gw90 bw90 rx40 rwaa gy30 gx30 gwaa bz00 gz30 bx30 bwaa bz11 by30 ry40 bz22 rz40 bz33"},
    {0x06, 11, {4, 5, 4}, true, true,
     "rw90 gw90 bw90 rx30 rwaa gz44 gy30 gx40 gwaa gz30 bx30 bwaa bz11 by30 ry30 bz00 bz22 rz30 gy44 bz33"},
    {0x0a, 11, {4, 4, 5}, true, true,
     "rw90 gw90 bw90 rx30 rwaa by44 gy30 gx30 gwaa bz00 gz30 bx40 bwaa by30 ry30 bz11 bz22 rz30 bz44 bz33"},
    {0x0e, 9, {5, 5, 5}, true, true,
     "rw80 by44 gw80 gy44 bw80 bz44 rx40 gz44 gy30 gx40 bz00 gz30 bx40 bz11 by30 ry40 bz22 rz40 bz33"},
    {0x12, 8, {6, 5, 5}, true, true,
     "rw70 gz44 by44 gw70 bz22 gy44 bw70 bz33 bz44 rx50 gy30 gx40 bz00 gz30 bx40 bz11 by30 ry50 rz50"},
    {0x16, 8, {5, 6, 5}, true, true,
     "rw70 bz00 by44 gw70 gy55 gy44 bw70 gz55 bz44 rx40 gz44 gy30 gx50 gz30 bx40 bz11 by30 ry40 bz22 rz40 bz33"},
    {0x1a, 8, {5, 5, 6}, true, true,
     "rw70 bz11 by44 gw70 by55 gy44 bw70 bz55 bz44 rx40 gz44 gy30 gx40 bz00 gz30 bx50 by30 ry40 bz22 rz40 bz33"},
    {0x1e, 6, {6, 6, 6}, false, true,
     "rw50 gz44 bz00 bz11 by44 gw50 gy55 by55 bz22 gy44 bw50 "
     "gz55 bz33 bz55 bz44 rx50 gy30 gx50 gz30 bx50 by30 ry50 rz50"},
    {0x03, 10, {10, 10, 10}, false, false, "rw90 gw90 bw90 rx90 gx90 bx90"},
    {0x07, 11, {9, 9, 9}, true, false, "rw90 gw90 bw90 rx80 rwaa gx80 gwaa bx80 bwaa"},
    {0x0b, 12, {8, 8, 8}, true, false, "rw90 gw90 bw90 rx70 rwab gx70 gwab bx70 bwab"},
    {0x0f, 16, {4, 4, 4}, true, false, "rw90 gw90 bw90 rx30 rwaf gx30 gwaf bx30 bwaf"},
};
// clang-format on

std::uint32_t digit(char c) { return static_cast<std::uint32_t>(c <= '9' ? c - '0' : c - 'a' + 10); }

std::int32_t sign_extend(std::int32_t value, std::uint32_t bits) {
    const std::uint32_t shift = 32 - bits;
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(value) << shift) >> shift;
}

// To 16 bits, of which -0x7fff to 0x7fff are used where there is a sign.
std::int32_t unquantize(std::int32_t value, std::uint32_t bits, bool is_signed) {
    if (!is_signed) {
        if (bits >= 15 || value == 0) return value;
        return value == (1 << bits) - 1 ? 0xffff : ((value << 15) + 0x4000) >> (bits - 1);
    }
    if (bits >= 16 || value == 0) return value;
    const std::int32_t magnitude = value < 0 ? -value : value;
    const std::int32_t widened =
        magnitude >= (1 << (bits - 1)) - 1 ? 0x7fff : ((magnitude << 15) + 0x4000) >> (bits - 1);
    return value < 0 ? -widened : widened;
}

// The last scaling, after which all codes are finite halves.
std::uint16_t finish(std::int32_t value, bool is_signed) {
    if (!is_signed) return static_cast<std::uint16_t>((value * 31) >> 6);
    return static_cast<std::uint16_t>(value < 0 ? ((-value * 31) >> 5) | 0x8000 : (value * 31) >> 5);
}

}  // namespace

void decode_bc7_block(const std::byte* block, std::uint32_t (&texels)[16]) {
    BitReader reader(block);
    std::uint32_t mode_index = 0;
    while (mode_index < 8 && reader.take(1) == 0) ++mode_index;
    if (mode_index == 8) {
        std::fill(std::begin(texels), std::end(texels), 0u);
        return;
    }
    const Bc7Mode& mode = bc7_modes[mode_index];
    const std::uint32_t partition = reader.take(mode.partition_bits), rotation = reader.take(mode.rotation_bits);
    const std::uint32_t selection = reader.take(mode.selection_bits);

    // Endpoints 2s and 2s + 1 belong to subset s.
    std::uint32_t endpoints[6][4];
    const std::uint32_t endpoint_count = 2u * mode.subsets, channels = mode.alpha_bits != 0 ? 4 : 3;
    for (std::uint32_t c = 0; c < channels; ++c) {
        for (std::uint32_t e = 0; e < endpoint_count; ++e)
            endpoints[e][c] = reader.take(c == 3 ? mode.alpha_bits : mode.color_bits);
    }
    const bool has_p_bits = mode.endpoint_p_bits || mode.shared_p_bits;
    std::uint32_t p_bits[6] = {};
    if (mode.endpoint_p_bits) {
        for (std::uint32_t e = 0; e < endpoint_count; ++e) p_bits[e] = reader.take(1);
    } else if (mode.shared_p_bits) {
        for (std::uint32_t s = 0; s < mode.subsets; ++s) p_bits[2 * s] = p_bits[2 * s + 1] = reader.take(1);
    }
    for (std::uint32_t e = 0; e < endpoint_count; ++e) {
        for (std::uint32_t c = 0; c < channels; ++c) {
            const std::uint32_t bits = c == 3 ? mode.alpha_bits : mode.color_bits;
            endpoints[e][c] =
                has_p_bits ? widen((endpoints[e][c] << 1) | p_bits[e], bits + 1) : widen(endpoints[e][c], bits);
        }
        if (channels == 3) endpoints[e][3] = 255;
    }

    const auto subset_of = [&](std::uint32_t texel) {
        if (mode.subsets == 1) return 0u;
        if (mode.subsets == 2) return (static_cast<std::uint32_t>(two_subset_partitions[partition]) >> texel) & 1;
        return (three_subset_partitions[partition] >> (2 * texel)) & 3;
    };
    const auto is_anchor = [&](std::uint32_t texel) {
        if (texel == 0) return true;
        if (mode.subsets == 2) return texel == two_subset_anchors[partition];
        return mode.subsets == 3 &&
               (texel == three_subset_anchors[0][partition] || texel == three_subset_anchors[1][partition]);
    };
    std::uint32_t indices[16], second_indices[16];
    for (std::uint32_t i = 0; i < 16; ++i) indices[i] = reader.take(mode.index_bits - (is_anchor(i) ? 1u : 0u));
    if (mode.second_index_bits != 0) {
        for (std::uint32_t i = 0; i < 16; ++i)
            second_indices[i] = reader.take(mode.second_index_bits - (i == 0 ? 1u : 0u));
    }

    for (std::uint32_t i = 0; i < 16; ++i) {
        std::int32_t color_weight = weight(indices[i], mode.index_bits), alpha_weight = color_weight;
        if (mode.second_index_bits != 0) {
            alpha_weight = weight(second_indices[i], mode.second_index_bits);
            if (selection != 0) std::swap(color_weight, alpha_weight);
        }
        const std::uint32_t first = 2 * subset_of(i);
        std::uint32_t rgba[4];
        for (std::uint32_t c = 0; c < 4; ++c) {
            rgba[c] = static_cast<std::uint32_t>(interpolate(static_cast<std::int32_t>(endpoints[first][c]),
                                                             static_cast<std::int32_t>(endpoints[first + 1][c]),
                                                             c == 3 ? alpha_weight : color_weight));
        }
        if (rotation != 0) std::swap(rgba[rotation - 1], rgba[3]);
        texels[i] = rgba[0] | (rgba[1] << 8) | (rgba[2] << 16) | (rgba[3] << 24);
    }
}

void decode_bc6h_block(const std::byte* block, bool is_signed, std::uint16_t (&texels)[16][3]) {
    BitReader reader(block);
    std::uint32_t code = reader.take(2);
    if (code >= 2) code |= reader.take(3) << 2;
    const auto* mode =
        std::find_if(std::begin(bc6h_modes), std::end(bc6h_modes), [&](const Bc6hMode& m) { return m.code == code; });
    if (mode == std::end(bc6h_modes)) {
        std::memset(texels, 0, sizeof texels);
        return;
    }

    std::int32_t endpoints[4][3] = {};
    for (std::size_t at = 0; at < mode->fields.size(); at += 5) {
        const std::string_view field = mode->fields.substr(at, 4);
        std::int32_t& value = endpoints[field[1] - 'w'][field[0] == 'r' ? 0 : field[0] == 'g' ? 1 : 2];
        const std::uint32_t high = digit(field[2]), low = digit(field[3]);
        if (high >= low) {
            value |= static_cast<std::int32_t>(reader.take(high - low + 1) << low);
        } else {
            for (std::uint32_t bit = low + 1; bit-- > high;) value |= static_cast<std::int32_t>(reader.take(1) << bit);
        }
    }
    const std::uint32_t partition = mode->has_two_subsets ? reader.take(5) : 0;

    const std::uint32_t endpoint_count = mode->has_two_subsets ? 4 : 2;
    for (std::uint32_t c = 0; c < 3; ++c) {
        if (is_signed) endpoints[0][c] = sign_extend(endpoints[0][c], mode->base_bits);
        for (std::uint32_t e = 1; e < endpoint_count; ++e) {
            std::int32_t& value = endpoints[e][c];
            if (mode->is_delta) {
                value = (endpoints[0][c] + sign_extend(value, mode->delta_bits[c])) & ((1 << mode->base_bits) - 1);
            }
            if (is_signed) value = sign_extend(value, mode->base_bits);
        }
        for (std::uint32_t e = 0; e < endpoint_count; ++e)
            endpoints[e][c] = unquantize(endpoints[e][c], mode->base_bits, is_signed);
    }

    const std::uint32_t index_bits = mode->has_two_subsets ? 3 : 4;
    for (std::uint32_t i = 0; i < 16; ++i) {
        const bool is_anchor = i == 0 || (mode->has_two_subsets && i == two_subset_anchors[partition]);
        const std::int32_t w = weight(reader.take(index_bits - (is_anchor ? 1u : 0u)), index_bits);
        const std::uint32_t first = mode->has_two_subsets ? 2u * ((two_subset_partitions[partition] >> i) & 1u) : 0u;
        for (std::uint32_t c = 0; c < 3; ++c) {
            texels[i][c] = finish(interpolate(endpoints[first][c], endpoints[first + 1][c], w), is_signed);
        }
    }
}

}  // namespace nacre::cpu
