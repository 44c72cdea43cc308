// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/checks/checked_memory.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <mutex>
#include <new>
#include <utility>

namespace nacre::cpu {
namespace {

constexpr std::size_t readable_texels_behind = 16;

/// Words are shared out over some locks: one for each would be more memory than the words themselves.
class WordLock {
  public:
    explicit WordLock(std::uint64_t word) : flag_(flags[word % flags.size()]) {
        while (flag_.test_and_set(std::memory_order_acquire)) flag_.wait(true, std::memory_order_relaxed);
    }
    ~WordLock() {
        flag_.clear(std::memory_order_release);
        flag_.notify_one();
    }
    WordLock(const WordLock&) = delete;
    WordLock& operator=(const WordLock&) = delete;

  private:
    static std::array<std::atomic_flag, 251> flags;
    std::atomic_flag& flag_;
};
std::array<std::atomic_flag, 251> WordLock::flags;

/// Whether two uses of a word, one of which writes, may happen in either order.
bool races(const WordUse& earlier, const WordUse& later) {
    if (earlier.scope != later.scope || (earlier.bytes & later.bytes) == 0) return false;
    if (earlier.is_atomic && later.is_atomic) return false;
    if (earlier.batch != later.batch) return !later.is_private;
    return earlier.lane != later.lane && earlier.barriers == later.barriers;
}

}  // namespace

CheckedMemory::CheckedMemory(std::string name, std::byte* data, std::uint64_t size, bool is_defined)
    : name_(std::move(name)), data_(data), size_(size), has_undefined_(!is_defined) {
    undefined_.assign((size + 63) / 64, is_defined ? 0 : ~std::uint64_t{0});
}

bool CheckedMemory::holds(std::uint64_t offset, std::uint64_t bytes, bool undefined) const {
    const std::uint64_t turned = undefined ? 0 : ~std::uint64_t{0};
    for (std::uint64_t at = offset; at < offset + bytes && at < size_;) {
        const std::uint64_t first = at % 64, count = std::min(64 - first, offset + bytes - at);
        const std::uint64_t mask = (count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1) << first;
        const std::atomic_ref bits(const_cast<std::uint64_t&>(undefined_[at / 64]));
        if ((bits.load(std::memory_order_relaxed) ^ turned) & mask) return true;
        at += count;
    }
    return false;
}

void CheckedMemory::define(std::uint64_t offset, std::uint64_t bytes, bool is_defined) {
    if (is_defined && !has_undefined()) return;
    if (!is_defined) has_undefined_.store(true, std::memory_order_relaxed);
    version_.fetch_add(1, std::memory_order_relaxed);
    for (std::uint64_t at = offset; at < offset + bytes && at < size_;) {
        const std::uint64_t first = at % 64, count = std::min(64 - first, offset + bytes - at);
        const std::uint64_t mask = (count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1) << first;
        const std::atomic_ref bits(undefined_[at / 64]);
        if (is_defined)
            bits.fetch_and(~mask, std::memory_order_relaxed);
        else
            bits.fetch_or(mask, std::memory_order_relaxed);
        at += count;
    }
}

void CheckedMemory::copy_definedness(std::uint64_t offset, const CheckedMemory& from, std::uint64_t from_offset,
                                     std::uint64_t bytes) {
    if (!has_undefined() && !from.has_undefined()) return;
    // By words of memory: nobody copies less.
    for (std::uint64_t at = 0; at < bytes; at += 4) {
        const std::uint64_t count = std::min<std::uint64_t>(4, bytes - at);
        define(offset + at, count, !from.is_undefined(from_offset + at, count));
    }
}

void CheckedMemory::restore(std::vector<std::uint64_t> undefined_bytes) {
    undefined_ = std::move(undefined_bytes);
    version_.fetch_add(1, std::memory_order_relaxed);
    has_undefined_ = std::ranges::any_of(undefined_, [](std::uint64_t bits) { return bits != 0; });
}

std::shared_ptr<const UndefinedTexels> CheckedMemory::undefined_texels(const ImageView& view) {
    if (!has_undefined()) return nullptr;
    const std::scoped_lock lock(texels_mutex_);
    std::shared_ptr<const UndefinedTexels>& known = texels_[&view];
    const std::uint64_t version = version_.load(std::memory_order_relaxed);
    if (!known || known->version != version) {
        auto made = std::make_shared<UndefinedTexels>();
        made->version = version;
        made->view = view;
        made->view.format = rhi::Format::r32_float;
        made->view.texel_bytes = 4;
        made->view.direct_texels = DirectTexels::no;
        made->view.stencil_levels = {};
        std::uint64_t total = 0;
        for (std::uint32_t mip = 0; mip < view.mip_count; ++mip) {
            ImageLevel& level = made->view.levels[mip];
            level.row_stride = level.width * 4;
            level.slice_stride = std::uint64_t{level.row_stride} * level.height;
            level.sample_stride = level.layer_stride = level.slice_stride * level.depth;
            total += level.layer_stride * view.layer_count;
        }
        // Vectors of texels are read whole, up to the last.
        made->numbers.resize(total / 4 + readable_texels_behind);
        const std::uint32_t edge = rhi::info(view.format).block_width;
        float* next = made->numbers.data();
        for (std::uint32_t mip = 0; mip < view.mip_count; ++mip) {
            const ImageLevel& from = view.levels[mip];
            made->view.levels[mip].data = reinterpret_cast<std::byte*>(next);
            for (std::uint32_t layer = 0; layer < view.layer_count; ++layer)
                for (std::uint32_t z = 0; z < from.depth; ++z)
                    for (std::uint32_t y = 0; y < from.height; ++y) {
                        const std::byte* row = from.data + layer * from.layer_stride + z * from.slice_stride +
                                               std::uint64_t{y / edge} * from.row_stride;
                        const auto offset = offset_of(row);
                        for (std::uint32_t x = 0; x < from.width; ++x, ++next) {
                            const std::uint64_t texel = std::uint64_t{x / edge} * view.texel_bytes;
                            if (!offset || !is_undefined(*offset + texel, view.texel_bytes)) continue;
                            *next = 1.0f;
                            made->has_any = true;
                        }
                    }
        }
        known = std::move(made);
    }
    return known->has_any ? known : nullptr;
}

void CheckedMemory::Free::operator()(Word* words) const { std::free(words); }

CheckedMemory::Word* CheckedMemory::words() {
    if (Word* made = words_.load(std::memory_order_acquire)) return made;
    static std::mutex mutex;
    const std::scoped_lock lock(mutex);
    if (!owned_words_) {
        // Zeros are words that nobody used; pages that stay so take no memory.
        owned_words_.reset(static_cast<Word*>(std::calloc(size_ / 4 + 1, sizeof(Word))));
        if (!owned_words_) return nullptr;
        words_.store(owned_words_.get(), std::memory_order_release);
    }
    return owned_words_.get();
}

std::optional<WordUse> CheckedMemory::note_use(std::uint64_t offset, bool writes, const WordUse& use) {
    Word* const all = words();
    if (!all) return {};
    Word& word = all[offset / 4];
    const WordLock lock(offset / 4);
    std::optional<WordUse> other;
    if (races(word.write, use)) other = word.write;
    if (writes) {
        if (!other && races(word.first_read, use)) other = word.first_read;
        if (!other && races(word.last_read, use)) other = word.last_read;
        word.write = use;
        return other;
    }
    // The first reader of a scope is kept, so that a write behind several reads finds one that is not its own; readers
    // of other times are of no more use.
    const WordUse& first = word.first_read;
    const bool is_over = first.scope != use.scope || (first.batch != use.batch && use.is_private) ||
                         (first.batch == use.batch && first.barriers != use.barriers);
    if (is_over) word.first_read = use;
    word.last_read = use;
    return other;
}

}  // namespace nacre::cpu
