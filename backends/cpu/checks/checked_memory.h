// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "backends/cpu/checks/check_interface.h"

/// @file
/// What is known of the memory of a buffer, a texture or a workgroup besides its content: which bytes were ever
/// written, and who used which word last.

namespace nacre::cpu {

/// Who used a word: an invocation, at one place of its shader.
struct WordUse {
    std::uint64_t batch = 0;  ///< Workgroup or batch.
    const CheckSite* site = nullptr;
    std::uint32_t scope = 0;     ///< Dispatch or render pass; 0: nobody.
    std::uint16_t lane = 0;      ///< Within the batch.
    std::uint16_t barriers = 0;  ///< Workgroup barriers that it had passed.
    std::uint8_t bytes = 0;      ///< One bit for each byte of the word.
    bool is_atomic = false;
    bool is_private = false;  ///< Each batch has content of its own, one after another: a workgroup's memory.
};

/// A view's texels as numbers: 1 where any byte is undefined, else 0. What sampling makes of them tells whether an
/// undefined texel has a share in the result.
struct UndefinedTexels {
    ImageView view;
    std::vector<float> numbers;
    bool has_any = false;
    std::uint64_t version = 0;
};

/// Thread-safe but for the constructor.
class CheckedMemory {
  public:
    /// @param name  for messages: "buffer 'values'"
    CheckedMemory(std::string name, std::byte* data, std::uint64_t size, bool is_defined);

    [[nodiscard]] const std::string& name() const { return name_; }
    [[nodiscard]] std::byte* data() const { return data_; }
    [[nodiscard]] std::uint64_t size() const { return size_; }

    /// Offset of an address; nothing where it lies elsewhere.
    [[nodiscard]] std::optional<std::uint64_t> offset_of(const std::byte* address) const {
        if (address < data_ || address >= data_ + size_) return {};
        return static_cast<std::uint64_t>(address - data_);
    }
    /// Some of the bytes were never written.
    [[nodiscard]] bool is_undefined(std::uint64_t offset, std::uint64_t bytes) const {
        return has_undefined() && holds(offset, bytes, true);
    }
    /// Some of the bytes were written.
    [[nodiscard]] bool has_defined(std::uint64_t offset, std::uint64_t bytes) const {
        return !has_undefined() || holds(offset, bytes, false);
    }
    void define(std::uint64_t offset, std::uint64_t bytes, bool is_defined = true);
    /// Whether any byte may be undefined; cheap.
    [[nodiscard]] bool has_undefined() const { return has_undefined_.load(std::memory_order_relaxed); }
    /// Takes over from other memory what is defined there.
    void copy_definedness(std::uint64_t offset, const CheckedMemory& from, std::uint64_t from_offset,
                          std::uint64_t bytes);

    /// Of a view of this texture, as of now; null where nothing of it is undefined.
    [[nodiscard]] std::shared_ptr<const UndefinedTexels> undefined_texels(const ImageView& view);

    /// Which bytes are undefined, one bit for each; for `restore`. Not while shaders run.
    [[nodiscard]] const std::vector<std::uint64_t>& undefined_bytes() const { return undefined_; }
    void restore(std::vector<std::uint64_t> undefined_bytes);

    /// Takes note of a use of the word at `offset`; returns an earlier use that it races with.
    std::optional<WordUse> note_use(std::uint64_t offset, bool writes, const WordUse& use);

  private:
    struct Word {
        WordUse write, first_read, last_read;
    };
    struct Free {
        void operator()(Word* words) const;
    };
    [[nodiscard]] Word* words();
    /// Whether any of the bytes is undefined, or any is not.
    [[nodiscard]] bool holds(std::uint64_t offset, std::uint64_t bytes, bool undefined) const;

    const std::string name_;
    std::byte* const data_;
    const std::uint64_t size_;
    std::atomic<bool> has_undefined_;
    std::vector<std::uint64_t> undefined_;   ///< One bit for each byte.
    std::atomic<std::uint64_t> version_{1};  ///< Rises with every change of `undefined_`.
    std::mutex texels_mutex_;
    std::map<const ImageView*, std::shared_ptr<const UndefinedTexels>> texels_;
    std::atomic<Word*> words_{nullptr};
    std::unique_ptr<Word[], Free> owned_words_;
};

/// Resources as the checks see them, in the order of the descriptors of a bind group. Null: nothing is known.
using CheckedObjects = std::vector<CheckedMemory*>;

}  // namespace nacre::cpu
