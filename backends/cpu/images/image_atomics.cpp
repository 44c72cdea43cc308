// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/image_atomics.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

namespace nacre::cpu {
namespace {

// What an operation writes where it finds `old`.
std::uint32_t updated(AtomicOperation operation, std::uint32_t old, std::uint32_t value, std::uint32_t comparator) {
    const auto is_less = [&] { return static_cast<std::int32_t>(old) < static_cast<std::int32_t>(value); };
    const auto as_float = [](std::uint32_t bits) { return std::bit_cast<float>(bits); };
    switch (operation) {
        case AtomicOperation::add: return old + value;
        case AtomicOperation::minimum_signed: return is_less() ? old : value;
        case AtomicOperation::minimum_unsigned: return std::min(old, value);
        case AtomicOperation::maximum_signed: return is_less() ? value : old;
        case AtomicOperation::maximum_unsigned: return std::max(old, value);
        case AtomicOperation::bit_and: return old & value;
        case AtomicOperation::bit_or: return old | value;
        case AtomicOperation::bit_xor: return old ^ value;
        case AtomicOperation::exchange: return value;
        case AtomicOperation::compare_exchange: return old == comparator ? value : old;
        case AtomicOperation::add_float: return std::bit_cast<std::uint32_t>(as_float(old) + as_float(value));
        case AtomicOperation::minimum_float:
            return std::bit_cast<std::uint32_t>(std::fmin(as_float(old), as_float(value)));
        case AtomicOperation::maximum_float:
            return std::bit_cast<std::uint32_t>(std::fmax(as_float(old), as_float(value)));
    }
    return old;
}

bool fits(AtomicOperation operation, rhi::Format format) {
    const bool is_float_operation = operation == AtomicOperation::add_float ||
                                    operation == AtomicOperation::minimum_float ||
                                    operation == AtomicOperation::maximum_float;
    if (format == rhi::Format::r32_float) return is_float_operation || operation == AtomicOperation::exchange;
    return (format == rhi::Format::r32_uint || format == rhi::Format::r32_sint) && !is_float_operation;
}

// Null outside.
std::byte* texel_address(const ImageView& image, const ImageArguments& arguments, std::uint32_t lane) {
    const ImageLevel& level = image.levels[0];
    const auto coordinate = [&](std::uint32_t axis) { return arguments.coordinates[axis][lane]; };
    const std::uint32_t x = coordinate(0);
    std::uint32_t y = 0, z = 0, layer = 0;
    using enum rhi::ViewDimension;
    switch (image.dimension) {
        case d1: break;
        case d1_array: layer = coordinate(1); break;
        case d2_array:
        case cube:
        case cube_array: y = coordinate(1), layer = coordinate(2); break;
        case d3: y = coordinate(1), z = coordinate(2); break;
        default: y = coordinate(1); break;
    }
    const std::uint32_t sample = image.samples > 1 ? static_cast<std::uint32_t>(arguments.sample[lane]) : 0;
    if (x >= level.width || y >= level.height || z >= level.depth || layer >= image.layer_count ||
        sample >= image.samples) {
        return nullptr;
    }
    return level.data + layer * level.layer_stride + sample * level.sample_stride + z * level.slice_stride +
           std::uint64_t{y} * level.row_stride + std::uint64_t{x} * 4;
}

}  // namespace

void image_atomic(const ImageView* image, ImageArguments* arguments, std::uint32_t, std::uint32_t live,
                  std::uint32_t lanes) {
    const bool can_run = image != nullptr && image->mip_count > 0 && image->levels[0].data != nullptr &&
                         fits(arguments->atomic, image->format);
    for (std::uint32_t lane = 0; lane < lanes; ++lane) {
        for (auto& channel : arguments->result) channel[lane] = 0;
        std::byte* at = can_run && ((live >> lane) & 1) != 0 ? texel_address(*image, *arguments, lane) : nullptr;
        if (at == nullptr) continue;
        std::atomic_ref word(*reinterpret_cast<std::uint32_t*>(at));
        const std::uint32_t value = arguments->texel[0][lane], comparator = arguments->comparator[lane];
        std::uint32_t old;
        switch (arguments->atomic) {
            case AtomicOperation::add: old = word.fetch_add(value, std::memory_order_relaxed); break;
            case AtomicOperation::bit_and: old = word.fetch_and(value, std::memory_order_relaxed); break;
            case AtomicOperation::bit_or: old = word.fetch_or(value, std::memory_order_relaxed); break;
            case AtomicOperation::bit_xor: old = word.fetch_xor(value, std::memory_order_relaxed); break;
            case AtomicOperation::exchange: old = word.exchange(value, std::memory_order_relaxed); break;
            default: {
                old = word.load(std::memory_order_relaxed);
                for (;;) {
                    const std::uint32_t next = updated(arguments->atomic, old, value, comparator);
                    // Most minima and maxima change nothing: then there is nothing to write either.
                    if (next == old || word.compare_exchange_weak(old, next, std::memory_order_relaxed)) break;
                }
                break;
            }
        }
        arguments->result[0][lane] = old;
    }
}

}  // namespace nacre::cpu
