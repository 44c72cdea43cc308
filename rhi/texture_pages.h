// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/error.h"
#include "rhi/capabilities.h"
#include "rhi/resources.h"

/// @file
/// Which textures of a `TextureTable` share a page, where the device cannot index textures. Pure arithmetic, for
/// rhi/texture_table.cpp and its tests.

namespace nacre::rhi {

/// What textures of one page have in common. A sampler belongs to the page, since it filters and repeats whole layers.
struct PageKind {
    Format format = Format::undefined;
    std::uint32_t width = 0, height = 0;
    std::uint32_t mips = 1;
    Sampler sampler{};
    friend bool operator==(const PageKind&, const PageKind&) = default;
};

struct PlannedPage {
    PageKind kind;
    std::vector<std::uint32_t> members;  ///< Indices into the requests, in their order.
    bool is_merged = false;              ///< Some members have another size or format and are resampled.
};

/// Groups textures into at most `max_pages` pages. Textures of equal kind always share one. Where that takes too many
/// pages, those pages are merged, two at a time, whose merger costs the least memory: the page takes the larger width
/// and height; formats that differ, or that cannot be color targets (compressed ones), become rgba16_float. Pages can
/// merge when they have one sampler, and both a full chain of mips or both none. Error: unsupported, with the kinds
/// that are left over and what to change, also where the device cannot draw rgba16_float, or where a page has more
/// layers than the device.
Expected<std::vector<PlannedPage>> plan_pages(std::span<const PageKind> requests, std::uint32_t max_pages,
                                              const Capabilities& capabilities);

}  // namespace nacre::rhi
