// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <span>

#include <llvm/IR/Constants.h>

#include "backends/cpu/compiler/emitter.h"

/// @file
/// Vectors and structures of neighboring lanes that lie one behind the other in memory: whole vectors of words are read or
/// written, and shuffles bring each scalar's words together. A gather or scatter for each scalar, as emit_memory.cpp makes it,
/// is left for the edge of the range and for stores of some lanes only.

namespace nacre::cpu {

namespace {

/// Words from lane to lane up to which elements are taken as rows. More need more shuffles than gathers cost.
constexpr std::uint32_t most_row_words = 16;
/// Scalars from which on it pays to ask whether all lanes mean the same address, and up to which both ways are written out.
constexpr std::uint32_t fewest_equal_scalars = 3, most_equal_scalars = 64;

/// The rest of the elements of a stream: every second one of two vectors, from `first` on.
std::vector<int> every_second(std::uint32_t lanes, int first) {
    std::vector<int> mask(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) mask[i] = first + static_cast<int>(2 * i);
    return mask;
}

/// Half of the elements of two vectors in turns, from element `first` of each on.
std::vector<int> in_turns(std::uint32_t lanes, std::uint32_t first) {
    std::vector<int> mask(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) mask[i] = static_cast<int>(first + i / 2 + (i % 2) * lanes);
    return mask;
}

}  // namespace

std::optional<Emitter::RowLayout> Emitter::row_layout(const Pointer& pointer) {
    if (pointer.kind != Pointer::Kind::bytes || !pointer.base.is_uniform() || !pointer.dynamic_offset.linear_base) return {};
    if (pointer.limit && !pointer.limit.is_uniform()) return {};
    const std::int64_t stride = pointer.dynamic_offset.linear_stride;
    if (stride < 8 || stride % 4 != 0 || stride > 4 * most_row_words || pointer.offset % 4 != 0) return {};
    if (module.type(pointer.type).components > most_row_words) return {};
    RowLayout rows;
    rows.stride = static_cast<std::uint32_t>(stride / 4);
    std::vector<std::int64_t> offsets;
    bool is_plain = true;
    visit_layout(pointer, pointer.type, 0, [&](const Pointer&, std::int64_t extra, const Type& scalar) {
        is_plain = is_plain && (scalar.kind == TypeKind::boolean || scalar.bits == 32) && extra % 4 == 0;
        offsets.push_back(extra);
    });
    if (!is_plain || offsets.empty()) return {};
    rows.first = *std::ranges::min_element(offsets);
    std::vector<bool> used(rows.stride);
    for (const std::int64_t offset : offsets) {
        const std::int64_t word = (offset - rows.first) / 4;
        if (word >= rows.stride || used[static_cast<std::size_t>(word)]) return {};
        used[static_cast<std::size_t>(word)] = true;
        rows.words.push_back(static_cast<std::uint32_t>(word));
        rows.span = std::max(rows.span, static_cast<std::uint32_t>(word) + 1);
    }
    // Of large elements from which little is used, gathers touch less memory.
    if (rows.stride > 4 && offsets.size() * 2 < rows.stride) return {};
    return rows;
}

llvm::Value* Emitter::row_start(const Pointer& pointer, const RowLayout& rows) {
    return builder.CreateGEP(builder.getInt8Ty(), at_offset(pointer.base.value, pointer.offset + rows.first),
                             builder.CreateSExt(pointer.dynamic_offset.linear_base, builder.getInt64Ty()));
}

llvm::Value* Emitter::all(const Component& condition) {
    if (!condition) return builder.getTrue();
    if (condition.is_uniform()) return condition.value;
    if (is_all(condition.value)) return builder.getTrue();
    llvm::Type* bits = builder.getIntNTy(lanes);
    return builder.CreateICmpEQ(builder.CreateBitCast(condition.value, bits), llvm::Constant::getAllOnesValue(bits));
}

/// From a stream of vectors in which each lane has `stream.size()` words to one vector for each word; null where there is
/// nothing.
std::vector<llvm::Value*> Emitter::split_rows(const std::vector<llvm::Value*>& stream) {
    const std::size_t stride = stream.size();
    if (stride == 1) return stream;
    std::vector<llvm::Value*> words(stride);
    if (stride % 2 == 0) {
        for (const std::size_t odd : {0, 1}) {
            std::vector<llvm::Value*> half(stride / 2);
            for (std::size_t i = 0; i < half.size(); ++i)
                half[i] = builder.CreateShuffleVector(stream[2 * i], stream[2 * i + 1], every_second(lanes, static_cast<int>(odd)));
            const std::vector<llvm::Value*> inner = split_rows(half);
            for (std::size_t i = 0; i < inner.size(); ++i) words[2 * i + odd] = inner[i];
        }
        return words;
    }
    for (std::size_t word = 0; word < stride; ++word) words[word] = pick(stream, [&](std::uint32_t lane) {
        const std::size_t at = lane * stride + word;
        return std::pair{at / lanes, at % lanes};
    });
    return words;
}

/// The other way.
std::vector<llvm::Value*> Emitter::join_rows(const std::vector<llvm::Value*>& words) {
    const std::size_t stride = words.size();
    if (stride == 1) return words;
    std::vector<llvm::Value*> stream(stride);
    if (stride % 2 == 0) {
        std::vector<llvm::Value*> halves[2];
        for (const std::size_t odd : {0, 1}) {
            std::vector<llvm::Value*> half(stride / 2);
            for (std::size_t i = 0; i < half.size(); ++i) half[i] = words[2 * i + odd];
            halves[odd] = join_rows(half);
        }
        for (std::size_t i = 0; i < stride; ++i)
            stream[i] = builder.CreateShuffleVector(halves[0][i / 2], halves[1][i / 2], in_turns(lanes, i % 2 * lanes / 2));
        return stream;
    }
    for (std::size_t i = 0; i < stride; ++i) stream[i] = pick(words, [&](std::uint32_t element) {
        const std::size_t at = i * lanes + element;
        return std::pair{at % stride, at / stride};
    });
    return stream;
}

/// The vector whose element i is element `from(i).second` of vector `from(i).first`.
llvm::Value* Emitter::pick(const std::vector<llvm::Value*>& vectors,
                           const std::function<std::pair<std::size_t, std::size_t>(std::uint32_t)>& from) {
    llvm::Value* picked = nullptr;
    std::vector<bool> is_set(lanes);
    for (std::size_t v = 0; v < vectors.size(); ++v) {
        std::vector<int> places(lanes, -1);
        bool any_here = false;
        for (std::uint32_t i = 0; i < lanes; ++i) {
            const auto [vector, element] = from(i);
            if (vector == v) places[i] = static_cast<int>(element + (picked ? lanes : 0)), is_set[i] = any_here = true;
            else if (is_set[i]) places[i] = static_cast<int>(i);
        }
        if (!any_here) continue;
        picked = picked ? builder.CreateShuffleVector(picked, vectors[v], places) : builder.CreateShuffleVector(vectors[v], places);
    }
    return picked;
}

std::optional<std::vector<Component>> Emitter::load_rows(const Pointer& pointer) {
    const auto rows = row_layout(pointer);
    if (!rows) return {};
    llvm::Type* vector = vector_of(builder.getInt32Ty());
    llvm::Value* poison = llvm::PoisonValue::get(vector);
    llvm::Value* is_inside = all(allowed(pointer, rows->first, 4 * rows->span));
    llvm::BasicBlock* fast = llvm::BasicBlock::Create(context, "rows", function_);
    llvm::BasicBlock* slow = llvm::BasicBlock::Create(context, "edge", function_);
    llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "loaded", function_);
    builder.CreateCondBr(is_inside, fast, slow);

    builder.SetInsertPoint(fast);
    llvm::Value* start = row_start(pointer, *rows);
    const std::uint32_t count = (lanes - 1) * rows->stride + rows->span;
    std::vector<llvm::Value*> read(rows->stride, poison);
    for (std::uint32_t i = 0; i * lanes < count; ++i) {
        llvm::Value* address = at_offset(start, std::int64_t{i} * lanes * 4);
        llvm::Instruction* words;
        if ((i + 1) * lanes <= count) {
            words = builder.CreateAlignedLoad(vector, address, llvm::Align(4));
        } else {
            // Nothing behind the last lane's element is touched.
            llvm::Value* exists = builder.CreateICmpULT(lane_numbers(), splat(int32(count - i * lanes)));
            words = builder.CreateMaskedLoad(vector, address, llvm::Align(4), exists, poison);
        }
        if (pointer.invariant) words->setMetadata(llvm::LLVMContext::MD_invariant_load, llvm::MDNode::get(context, {}));
        read[i] = words;
    }
    builder.CreateBr(after);

    builder.SetInsertPoint(slow);
    std::vector<llvm::Value*> words(rows->stride, poison);
    std::size_t number = 0;
    visit_layout(pointer, pointer.type, 0, [&](const Pointer& at, std::int64_t extra, const Type& scalar) {
        words[rows->words[number++]] = to_word(Component(widen(load_bytes(at, extra, scalar)))).value;
    });
    const std::vector<llvm::Value*> gathered = join_rows(words);
    llvm::BasicBlock* slow_end = builder.GetInsertBlock();
    builder.CreateBr(after);

    // Vectors of words come together here, so that they can be written as they were read.
    builder.SetInsertPoint(after);
    std::vector<llvm::Value*> stream(rows->stride, poison);
    for (std::uint32_t i = 0; i * lanes < count; ++i) {
        llvm::PHINode* either = builder.CreatePHI(vector, 2);
        either->addIncoming(read[i], fast);
        either->addIncoming(gathered[i], slow_end);
        stream[i] = either;
    }
    const std::vector<llvm::Value*> split = split_rows(stream);
    const auto origin = std::make_shared<const std::vector<llvm::Value*>>(std::move(stream));
    std::vector<Component> values;
    number = 0;
    for_each_component_type(pointer.type, [&](const Type& scalar) {
        const std::uint32_t place = rows->words[number++];
        llvm::Value* word = split[place];
        if (scalar.kind == TypeKind::boolean) values.emplace_back(builder.CreateICmpNE(word, llvm::Constant::getNullValue(vector)));
        else values.push_back(from_word(Component(word), scalar_type(scalar)));
        if (scalar.kind != TypeKind::boolean) row_origins[values.back().value] = {origin, place};
    });
    return values;
}

std::optional<std::vector<Component>> Emitter::load_where_equal(const Pointer& pointer) {
    const Component& offset = pointer.dynamic_offset;
    if (pointer.kind != Pointer::Kind::bytes || !pointer.base.is_uniform() || !offset || offset.is_uniform()) return {};
    if (pointer.limit && !pointer.limit.is_uniform()) return {};
    const std::uint32_t count = module.type(pointer.type).components;
    if (count < fewest_equal_scalars || count > most_equal_scalars) return {};
    llvm::Value* lane = first_lane(mask);
    llvm::Value* one = builder.CreateExtractElement(offset.value, lane);
    llvm::Value* differs = both(mask, builder.CreateICmpNE(offset.value, splat(one)));
    Pointer alike = pointer;
    alike.dynamic_offset = Component(one);
    if (pointer.valid && !pointer.valid.is_uniform()) {
        // An index out of range may give the offset of another that is not.
        differs = builder.CreateOr(differs, both(mask, builder.CreateNot(pointer.valid.value)));
        alike.valid = Component(builder.CreateExtractElement(pointer.valid.value, lane));
    }
    llvm::BasicBlock* equal = llvm::BasicBlock::Create(context, "equal", function_);
    llvm::BasicBlock* different = llvm::BasicBlock::Create(context, "different", function_);
    llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "loaded", function_);
    builder.CreateCondBr(any(differs), different, equal);
    const auto load_each = [&](llvm::BasicBlock* block, const Pointer& from) {
        builder.SetInsertPoint(block);
        std::vector<llvm::Value*> values;
        visit_layout(from, from.type, 0, [&](const Pointer& at, std::int64_t extra, const Type& scalar) {
            values.push_back(widen(load_bytes(at, extra, scalar)));
        });
        builder.CreateBr(after);
        return values;
    };
    const std::vector<llvm::Value*> once = load_each(equal, alike);
    const std::vector<llvm::Value*> gathered = load_each(different, pointer);
    builder.SetInsertPoint(after);
    std::vector<Component> values;
    for (std::size_t i = 0; i < once.size(); ++i) {
        llvm::PHINode* either = builder.CreatePHI(once[i]->getType(), 2);
        either->addIncoming(once[i], equal);
        either->addIncoming(gathered[i], different);
        values.emplace_back(either);
    }
    return values;
}

bool Emitter::store_rows(const Pointer& pointer, const std::vector<Component>& values) {
    const auto rows = row_layout(pointer);
    if (!rows) return false;
    llvm::Type* vector = vector_of(builder.getInt32Ty());
    llvm::Value* poison = llvm::PoisonValue::get(vector);
    const Component inside = allowed(pointer, rows->first, 4 * rows->span);
    llvm::Value* is_whole = all(Component(both(effect_mask(), inside ? inside.value : nullptr)));
    llvm::BasicBlock* fast = llvm::BasicBlock::Create(context, "rows", function_);
    llvm::BasicBlock* slow = llvm::BasicBlock::Create(context, "edge", function_);
    llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "stored", function_);
    builder.CreateCondBr(is_whole, fast, slow);

    builder.SetInsertPoint(fast);
    std::vector<llvm::Value*> words(rows->stride, poison);
    std::vector<bool> is_written(rows->stride);
    // Values that come from rows of the same layout are written as they were read, without a shuffle.
    std::shared_ptr<const std::vector<llvm::Value*>> origin;
    bool is_copy = true;
    for (std::size_t i = 0; i < values.size(); ++i) {
        words[rows->words[i]] = widen(to_word(values[i]));
        is_written[rows->words[i]] = true;
        const auto found = row_origins.find(values[i].value);
        is_copy = is_copy && found != row_origins.end() && found->second.word == rows->words[i] &&
                  found->second.stream->size() == rows->stride && (!origin || origin == found->second.stream);
        if (is_copy) origin = found->second.stream;
    }
    const std::vector<llvm::Value*> stream = is_copy ? *origin : join_rows(words);
    llvm::Value* start = row_start(pointer, *rows);
    for (std::uint32_t i = 0; i < rows->stride; ++i) {
        // Words between the elements belong to others.
        std::vector<llvm::Constant*> bits(lanes);
        bool is_full = true, is_empty = true;
        for (std::uint32_t k = 0; k < lanes; ++k) {
            const bool on = is_written[(i * lanes + k) % rows->stride];
            bits[k] = builder.getInt1(on);
            is_full = is_full && on, is_empty = is_empty && !on;
        }
        llvm::Value* address = at_offset(start, std::int64_t{i} * lanes * 4);
        if (is_full) builder.CreateAlignedStore(stream[i], address, llvm::Align(4));
        else if (!is_empty) builder.CreateMaskedStore(stream[i], address, llvm::Align(4), llvm::ConstantVector::get(bits));
    }
    builder.CreateBr(after);

    builder.SetInsertPoint(slow);
    std::size_t number = 0;
    visit_layout(pointer, pointer.type, 0, [&](const Pointer& at, std::int64_t extra, const Type& scalar) {
        store_bytes(at, extra, scalar, values.at(number++));
    });
    builder.CreateBr(after);
    builder.SetInsertPoint(after);
    return true;
}

}  // namespace nacre::cpu
