// SPDX-License-Identifier: Apache-2.0
#include "rhi/texture_pages.h"

#include <algorithm>
#include <optional>
#include <string>

#include <fmt/format.h>

namespace nacre::rhi {
namespace {

constexpr std::string_view action = "add textures to a texture table";

bool can_be_drawn(Format format, const Capabilities& capabilities) {
    return !info(format).is_compressed() &&
           capabilities.supports(format, FormatSupport::color_target | FormatSupport::filtered);
}

bool has_full_chain(const PageKind& kind) { return kind.mips == full_mip_count(kind.width, kind.height); }

/// The kind of a page that can hold both, if there is one.
std::optional<PageKind> common_kind(const PageKind& a, const PageKind& b, const Capabilities& capabilities) {
    if (!(a.sampler == b.sampler) || info(a.format).is_integer() || info(b.format).is_integer()) return {};
    const bool chains = has_full_chain(a) && has_full_chain(b);
    if (!chains && !(a.mips == 1 && b.mips == 1)) return {};
    PageKind kind = a;
    // Wide enough for 8-bit sRGB in linear light and for 11-bit unorm; 16-bit unorm loses a few bits above 0.25.
    if (a.format != b.format || !can_be_drawn(kind.format, capabilities)) kind.format = Format::rgba16_float;
    if (!can_be_drawn(kind.format, capabilities)) return {};
    kind.width = std::max(a.width, b.width);
    kind.height = std::max(a.height, b.height);
    kind.mips = chains ? full_mip_count(kind.width, kind.height) : 1;
    return kind;
}

std::uint64_t bytes_of(const PageKind& kind, std::size_t layers) {
    const TextureDesc desc{.format = kind.format, .width = kind.width, .height = kind.height};
    std::uint64_t bytes = 0;
    for (std::uint32_t mip = 0; mip < kind.mips; ++mip) bytes += mip_bytes(desc, mip);
    return bytes * layers;
}

std::string describe(std::span<const PlannedPage> pages) {
    std::string text;
    for (const PlannedPage& page : pages)
        text += fmt::format("{}{} of {} {}x{} with {} mips", text.empty() ? "" : ", ", page.members.size(),
                            info(page.kind.format).name, page.kind.width, page.kind.height, page.kind.mips);
    return text;
}

}  // namespace

Expected<std::vector<PlannedPage>> plan_pages(std::span<const PageKind> requests, std::uint32_t max_pages,
                                              const Capabilities& capabilities) {
    std::vector<PlannedPage> pages;
    for (std::uint32_t i = 0; i < requests.size(); ++i) {
        auto page = std::ranges::find(pages, requests[i], &PlannedPage::kind);
        if (page == pages.end()) page = pages.insert(page, {.kind = requests[i]});
        page->members.push_back(i);
    }

    while (pages.size() > max_pages) {
        struct Merger {
            std::size_t first, second;
            PageKind kind;
            std::int64_t cost;
        };
        std::optional<Merger> best;
        for (std::size_t first = 0; first < pages.size(); ++first) {
            for (std::size_t second = first + 1; second < pages.size(); ++second) {
                const PlannedPage &a = pages[first], &b = pages[second];
                const auto kind = common_kind(a.kind, b.kind, capabilities);
                const std::size_t layers = a.members.size() + b.members.size();
                if (!kind || layers > capabilities.max_texture_layers) continue;
                const auto cost = static_cast<std::int64_t>(bytes_of(*kind, layers)) -
                                  static_cast<std::int64_t>(bytes_of(a.kind, a.members.size()) +
                                                            bytes_of(b.kind, b.members.size()));
                if (!best || cost < best->cost) best = Merger{first, second, *kind, cost};
            }
        }
        if (!best)
            return fail(ErrorCode::unsupported, std::string(action), "",
                        fmt::format("{} kinds of textures need a page each, but there are {} pages: {}", pages.size(),
                                    max_pages, describe(pages)),
                        "Give the textures fewer different sizes, formats and samplers, or raise "
                        "TextureTableDesc::max_pages.");
        PlannedPage& page = pages[best->first];
        const PlannedPage& other = pages[best->second];
        page.kind = best->kind;
        page.members.insert(page.members.end(), other.members.begin(), other.members.end());
        std::ranges::sort(page.members);
        pages.erase(pages.begin() + static_cast<std::ptrdiff_t>(best->second));
    }

    for (PlannedPage& page : pages) {
        page.is_merged = std::ranges::any_of(page.members, [&](std::uint32_t i) { return requests[i] != page.kind; });
        if (page.members.size() > capabilities.max_texture_layers)
            return fail(ErrorCode::unsupported, std::string(action), "",
                        fmt::format("{} textures of one kind, but a texture of this device has at most {} layers",
                                    page.members.size(), capabilities.max_texture_layers),
                        "Use fewer textures.");
    }
    return pages;
}

}  // namespace nacre::rhi
