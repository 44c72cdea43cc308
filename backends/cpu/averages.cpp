// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <vector>

#include "backends/cpu/images/double_texels.h"
#include "backends/cpu/parallel_parts.h"
#include "backends/cpu/texel_rows.h"
#include "backends/cpu/transfer.h"

/// @file
/// Mips and resolves: averages of texels in linear light. Rows are worked on in pieces that lie on the stack.

namespace nacre::cpu {
namespace {

constexpr std::uint32_t piece_texels = 64;
/// Texels of the mip above that a piece is made of: at most 3 for each, where 3 texels become 1; 2 and a fraction else.
constexpr std::uint32_t source_piece_texels = piece_texels * 2 + 8;

/// The two texels that a texel of the next mip is made of, and the weight of the second.
struct Taps {
    std::uint32_t first, second;
    float weight;
    double exact_weight;
};

/// @param size  texels of the mip above
/// @param next  texels of the mip that is made
Taps taps_of(std::uint32_t index, std::uint32_t size, std::uint32_t next) {
    const double place = std::max((index + 0.5) * size / next - 0.5, 0.0);
    const auto first = static_cast<std::uint32_t>(place);
    return {first, std::min(first + 1, size - 1), static_cast<float>(place - first), place - first};
}

void add_weighted(std::span<LinearTexel> sum, std::span<const LinearTexel> texels, float weight) {
    for (std::size_t x = 0; x < sum.size(); ++x)
        for (std::size_t c = 0; c < 4; ++c) sum[x][c] += texels[x][c] * weight;
}

/// In the middle, as everywhere where sizes are powers of two, by the operations of Mesa's software drivers; elsewhere
/// without their loss of digits where b is much smaller than a.
float between(float a, float b, float weight) {
    return weight == 0.5f ? a + weight * (b - a) : a * (1.0f - weight) + b * weight;
}

/// The rows of the mip above that a row is made of: texels of the first and second row in the first and second slice.
struct SourceRows {
    const std::byte* texels[2][2];  // [slice][row]
    float row_weight, slice_weight;
};

/// Makes one row of a mip of the up to four rows above it: interpolates along x, then y, then z, which is also the
/// order of Mesa's software drivers, so that results have the same bits.
class MipRow {
  public:
    MipRow(rhi::Format format, std::uint32_t texel_bytes, std::span<const Taps> columns)
        : format_(format), texel_bytes_(texel_bytes), columns_(columns) {}

    void make(const SourceRows& rows, std::byte* out) {
        const auto width = static_cast<std::uint32_t>(columns_.size());
        for (std::uint32_t begin = 0; begin < width; begin += piece_texels) {
            const auto columns = columns_.subspan(begin, std::min(piece_texels, width - begin));
            const std::uint32_t from = columns.front().first;
            const std::uint32_t count = columns.back().second - from + 1;
            const auto along_x = [&](const std::byte* texels, Piece& result) {
                decode_row(format_, texels + std::size_t{from} * texel_bytes_, count, decoded_.data());
                for (std::size_t x = 0; x < columns.size(); ++x) {
                    const LinearTexel &a = decoded_[columns[x].first - from], &b = decoded_[columns[x].second - from];
                    for (std::size_t c = 0; c < 4; ++c) result[x][c] = between(a[c], b[c], columns[x].weight);
                }
            };
            const auto blend = [&](Piece& first, const Piece& second, float weight) {
                for (std::size_t x = 0; x < columns.size(); ++x)
                    for (std::size_t c = 0; c < 4; ++c) first[x][c] = between(first[x][c], second[x][c], weight);
            };
            const auto slice = [&](std::size_t index, Piece& result) {
                along_x(rows.texels[index][0], result);
                if (rows.row_weight == 0.0f) return;
                along_x(rows.texels[index][1], row_);
                blend(result, row_, rows.row_weight);
            };
            slice(0, result_);
            if (rows.slice_weight != 0.0f) {
                slice(1, slice_);
                blend(result_, slice_, rows.slice_weight);
            }
            encode_row(format_, result_.data(), static_cast<std::uint32_t>(columns.size()),
                       out + std::size_t{begin} * texel_bytes_);
        }
    }

  private:
    using Piece = std::array<LinearTexel, piece_texels>;

    rhi::Format format_;
    std::uint32_t texel_bytes_;
    std::span<const Taps> columns_;
    std::array<LinearTexel, source_piece_texels> decoded_;
    Piece row_, slice_, result_;
};

}  // namespace

/// On doubles: the eight texels of two rows, columns and slices, each with the product of its weights.
void Transfer::generate_double_mip(const ImageView& view, std::uint32_t mip) {
    const ImageLevel &from = view.levels[mip - 1], &to = view.levels[mip];
    const auto offset_of = [&](const ImageLevel& level, std::uint64_t layer, std::uint64_t x, std::uint64_t y,
                               std::uint64_t z) {
        return layer * level.layer_stride + z * level.slice_stride + y * level.row_stride + x * view.texel_bytes;
    };
    const std::uint64_t layer_rows = std::uint64_t{to.height} * to.depth;
    in_parallel(scheduler_, layer_rows * view.layer_count, from.width * sizeof(DoubleTexel),
                [&](std::uint64_t begin, std::uint64_t count) {
                    for (std::uint64_t at = begin; at < begin + count; ++at) {
                        const std::uint64_t layer = at / layer_rows;
                        const auto z = static_cast<std::uint32_t>(at % layer_rows / to.height),
                                   y = static_cast<std::uint32_t>(at % to.height);
                        const Taps rows = taps_of(y, from.height, to.height), slices = taps_of(z, from.depth, to.depth);
                        for (std::uint32_t x = 0; x < to.width; ++x) {
                            const Taps columns = taps_of(x, from.width, to.width);
                            DoubleTexel sum{};
                            for (int tap = 0; tap < 8; ++tap) {
                                const auto part = [&](const Taps& taps, bool is_second) {
                                    return is_second ? taps.exact_weight : 1.0 - taps.exact_weight;
                                };
                                const bool right = (tap & 1) != 0, lower = (tap & 2) != 0, behind = (tap & 4) != 0;
                                const double weight = part(columns, right) * part(rows, lower) * part(slices, behind);
                                if (weight == 0.0) continue;
                                const std::uint64_t offset =
                                    offset_of(from, layer, right ? columns.second : columns.first,
                                              lower ? rows.second : rows.first, behind ? slices.second : slices.first);
                                const DoubleTexel texel = load_double(view.format, from.data + offset,
                                                                      from.shadow + offset / view.texel_bytes * 4);
                                for (std::size_t c = 0; c < 4; ++c) sum[c] += weight * texel[c];
                            }
                            const std::uint64_t offset = offset_of(to, layer, x, y, z);
                            store_double(view.format, sum, to.data + offset, to.shadow + offset / view.texel_bytes * 4);
                        }
                    }
                });
}

void Transfer::generate_mips(const ImageView& view) {
    for (std::uint32_t mip = 1; mip < view.mip_count; ++mip) {
        if (view.levels[mip].shadow) {
            generate_double_mip(view, mip);
            continue;
        }
        const ImageLevel &from = view.levels[mip - 1], &to = view.levels[mip];
        std::vector<Taps> columns(to.width);
        for (std::uint32_t x = 0; x < to.width; ++x) columns[x] = taps_of(x, from.width, to.width);
        const std::uint64_t layer_rows = std::uint64_t{to.height} * to.depth;
        const std::uint64_t row_cost = std::uint64_t{from.width} * sizeof(LinearTexel);
        in_parallel(scheduler_, layer_rows * view.layer_count, row_cost, [&](std::uint64_t first, std::uint64_t count) {
            MipRow row(view.format, view.texel_bytes, columns);
            for (std::uint64_t at = first; at < first + count; ++at) {
                const std::uint64_t layer = at / layer_rows;
                const auto z = static_cast<std::uint32_t>(at % layer_rows / to.height);
                const auto y = static_cast<std::uint32_t>(at % to.height);
                const Taps rows = taps_of(y, from.height, to.height), slices = taps_of(z, from.depth, to.depth);
                const auto source = [&](std::uint32_t slice, std::uint32_t line) {
                    return from.data + layer * from.layer_stride + slice * from.slice_stride +
                           std::uint64_t{line} * from.row_stride;
                };
                row.make({.texels = {{source(slices.first, rows.first), source(slices.first, rows.second)},
                                     {source(slices.second, rows.first), source(slices.second, rows.second)}},
                          .row_weight = rows.weight,
                          .slice_weight = slices.weight},
                         to.data + layer * to.layer_stride + z * to.slice_stride + std::uint64_t{y} * to.row_stride);
            }
        });
    }
}

void Transfer::resolve(const ImageView& source, const ImageView& destination, std::uint32_t width,
                       std::uint32_t height) {
    const ImageLevel &from = source.levels[0], &to = destination.levels[0];
    if (from.shadow && to.shadow) {
        in_parallel(
            scheduler_, height, std::uint64_t{width} * sizeof(DoubleTexel),
            [&](std::uint64_t first, std::uint64_t count) {
                for (std::uint64_t y = first; y < first + count; ++y)
                    for (std::uint32_t x = 0; x < width; ++x) {
                        DoubleTexel sum{};
                        for (std::uint32_t sample = 0; sample < source.samples; ++sample) {
                            const std::uint64_t offset =
                                sample * from.sample_stride + y * from.row_stride + x * source.texel_bytes;
                            const DoubleTexel texel = load_double(source.format, from.data + offset,
                                                                  from.shadow + offset / source.texel_bytes * 4);
                            for (std::size_t c = 0; c < 4; ++c) sum[c] += texel[c] / source.samples;
                        }
                        const std::uint64_t offset = y * to.row_stride + std::uint64_t{x} * destination.texel_bytes;
                        store_double(destination.format, sum, to.data + offset,
                                     to.shadow + offset / destination.texel_bytes * 4);
                    }
            });
        return;
    }
    const bool is_copy = source.samples == 1 || rhi::info(source.format).is_integer();
    const std::uint64_t row_cost = std::uint64_t{width} * (is_copy ? source.texel_bytes : sizeof(LinearTexel));
    const float weight = 1.0f / static_cast<float>(source.samples);
    in_parallel(scheduler_, height, row_cost, [&](std::uint64_t first, std::uint64_t count) {
        std::array<LinearTexel, piece_texels> sum, decoded;
        for (std::uint64_t y = first; y < first + count; ++y) {
            const std::byte* texels = from.data + y * from.row_stride;
            std::byte* out = to.data + y * to.row_stride;
            if (is_copy) {
                std::memcpy(out, texels, std::size_t{width} * source.texel_bytes);
                continue;
            }
            for (std::uint32_t x = 0; x < width; x += piece_texels) {
                const std::uint32_t piece = std::min(piece_texels, width - x);
                // Inside of surfaces all samples are the same.
                const std::size_t bytes = std::size_t{piece} * source.texel_bytes,
                                  at = std::size_t{x} * source.texel_bytes;
                std::uint32_t same = 1;
                while (same < source.samples &&
                       std::memcmp(texels + at, texels + same * from.sample_stride + at, bytes) == 0)
                    ++same;
                if (same == source.samples && source.format == destination.format) {
                    std::memcpy(out + at, texels + at, bytes);
                    continue;
                }
                const std::span totals(sum.data(), piece);
                std::ranges::fill(totals, LinearTexel{});
                for (std::uint32_t sample = 0; sample < source.samples; ++sample) {
                    decode_row(source.format, texels + sample * from.sample_stride + at, piece, decoded.data());
                    add_weighted(totals, decoded, weight);
                }
                encode_row(destination.format, totals.data(), piece, out + at);
            }
        }
    });
}

}  // namespace nacre::cpu
