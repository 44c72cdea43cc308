// SPDX-License-Identifier: Apache-2.0
#include <llvm/Analysis/VectorUtils.h>
#include <llvm/IR/Constants.h>
#include <llvm/IR/Intrinsics.h>
#include <llvm/IR/MDBuilder.h>

#include <algorithm>
#include <bit>
#include <numeric>

#include "backends/cpu/compiler/emitter.h"
#include "backends/cpu/image_view.h"

// Texels of the layouts that passes over whole pictures use, read and written without a call. In compute shaders whose
// lanes are neighbors in a row of pixels, as most of those passes are, whole rows are moved at once.

namespace nacre::cpu {

namespace {

/// 1.5 * 2^23: floats next to it are whole numbers apart, and the low bits of a sum with it are the number.
constexpr float whole_numbers = 12582912.0f;

/// Tells LLVM that one of the cases is almost always the one: what goes on then stays in registers and in one piece,
/// and the call, which no vector register outlives, saves and restores what it must beside.
void expect_cases(llvm::SwitchInst& which) {
    std::vector<std::uint32_t> weights(which.getNumSuccessors(), 2000);
    weights[0] = 1;  // the default
    which.setMetadata(llvm::LLVMContext::MD_prof, llvm::MDBuilder(which.getContext()).createBranchWeights(weights));
}

}  // namespace

Emitter::RowShape Emitter::row_shape(llvm::Value* value, std::uint32_t depth) const {
    // From an invocation's place in its workgroup to a coordinate it is never far.
    constexpr std::uint32_t most_steps = 6;
    if (depth > most_steps) return RowShape::other;
    if (!value->getType()->isVectorTy()) return RowShape::equal;
    if (const auto found = row_shapes.find(value); found != row_shapes.end()) return found->second;
    if (llvm::getSplatValue(value)) return RowShape::equal;
    const auto* made = llvm::dyn_cast<llvm::BinaryOperator>(value);
    if (!made) return RowShape::other;
    const RowShape a = row_shape(made->getOperand(0), depth + 1), b = row_shape(made->getOperand(1), depth + 1);
    if (a == RowShape::other || b == RowShape::other) return RowShape::other;
    if (a == RowShape::equal && b == RowShape::equal) return RowShape::equal;
    if (made->getOpcode() == llvm::Instruction::Add && a != b) return RowShape::rising;
    if (made->getOpcode() == llvm::Instruction::Sub && b == RowShape::equal) return RowShape::rising;
    return RowShape::other;
}

bool Emitter::are_rows(const std::vector<Component>& coordinates, std::size_t count) const {
    if (coordinates.size() < count || row_shape(coordinates[0].value) != RowShape::rising) return false;
    for (std::size_t i = 1; i < count; ++i)
        if (row_shape(coordinates[i].value) != RowShape::equal) return false;
    return true;
}

std::uint32_t Emitter::row_lanes() const { return std::min(lanes, 8u); }

Emitter::TexelPlaces Emitter::texel_places(llvm::Value* view, const Type& type,
                                           const std::vector<Component>& coordinates, llvm::Value* level,
                                           std::uint32_t texel_bytes) {
    llvm::Type* word = builder.getInt32Ty();
    llvm::Value* levels = at_offset(view, offsetof(ImageView, levels));
    llvm::Value* mip = builder.CreateGEP(
        builder.getInt8Ty(), levels,
        builder.CreateMul(builder.CreateZExt(level, builder.getInt64Ty()), int64(sizeof(ImageLevel))));
    const auto member = [&](std::size_t offset) {
        return invariant_load(word, at_offset(mip, static_cast<std::int64_t>(offset)), 4);
    };
    // Strides of views that are read here fit into 32 bits: their lower halves.
    static_assert(std::endian::native == std::endian::little);
    struct Axis {
        llvm::Value *size, *stride;
    };
    std::vector<Axis> axes{{member(offsetof(ImageLevel, width)), int32(texel_bytes)}};
    const std::uint32_t dimensions = dimensions_of(type.dim);
    if (dimensions > 1)
        axes.push_back({member(offsetof(ImageLevel, height)), member(offsetof(ImageLevel, row_stride))});
    if (dimensions > 2)
        axes.push_back({member(offsetof(ImageLevel, depth)), member(offsetof(ImageLevel, slice_stride))});
    if (type.arrayed)
        axes.push_back({invariant_load(word, at_offset(view, offsetof(ImageView, layer_count)), 4),
                        member(offsetof(ImageLevel, layer_stride))});
    TexelPlaces places;
    places.inside = mask;
    for (std::size_t i = 0; i < axes.size(); ++i) {
        llvm::Value* at = widen(coordinates.at(i));
        places.inside = both(places.inside, builder.CreateICmpULT(at, splat(axes[i].size)));
        llvm::Value* step = builder.CreateMul(at, splat(axes[i].stride));
        places.offset = places.offset ? builder.CreateAdd(places.offset, step) : step;
    }
    places.data = invariant_load(pointer_type, at_offset(mip, offsetof(ImageLevel, data)), 8);
    return places;
}

llvm::Value* Emitter::row_address(const TexelPlaces& places, std::uint32_t first_lane_of_row) {
    llvm::Value* offset = builder.CreateExtractElement(places.offset, std::uint64_t{first_lane_of_row});
    return builder.CreateGEP(builder.getInt8Ty(), places.data, builder.CreateSExt(offset, builder.getInt64Ty()));
}

llvm::Value* Emitter::load_texel_rows(const TexelPlaces& places, llvm::Type* element, std::uint32_t per_texel) {
    const std::uint32_t row = row_lanes();
    llvm::Value* all_rows = nullptr;
    for (std::uint32_t first = 0; first < lanes; first += row) {
        llvm::Value* texels = builder.CreateAlignedLoad(llvm::FixedVectorType::get(element, row * per_texel),
                                                        row_address(places, first), llvm::Align(4));
        if (!all_rows) {
            all_rows = texels;
            continue;
        }
        std::vector<int> order(std::size_t{2} * row * per_texel);
        std::iota(order.begin(), order.end(), 0);
        all_rows = builder.CreateShuffleVector(all_rows, texels, order);
    }
    return all_rows;
}

std::vector<Component> Emitter::fetch_directly(const Component& image, Id image_type,
                                               const std::vector<Component>& coordinates, const Component& level,
                                               const std::function<std::vector<Component>()>& otherwise) {
    const Type& type = module.type(image_type);
    llvm::Type* word = builder.getInt32Ty();
    llvm::Type* words = vector_of(word);
    llvm::Value* none = llvm::Constant::getNullValue(words);
    llvm::Value* view = bound_view(image.value);
    const bool is_integer = image_integer_flag(image_type) != 0;
    const bool is_row = are_rows(coordinates, dimensions_of(type.dim) + (type.arrayed ? 1u : 0u));
    llvm::Value* layout = invariant_load(word, at_offset(view, offsetof(ImageView, direct_texels)), 4);
    llvm::Value* mips = invariant_load(word, at_offset(view, offsetof(ImageView, mip_count)), 4);
    llvm::Value* known = select(builder.CreateICmpULT(level.value, mips), layout, int32(0));
    const auto block = [&](const char* block_name) { return llvm::BasicBlock::Create(context, block_name, function_); };
    llvm::BasicBlock *word_block = block("fetch_words"), *call = block("fetch_call"), *after = block("fetched");
    const auto layout_number = [&](DirectTexels which) { return builder.getInt32(static_cast<std::uint32_t>(which)); };
    llvm::SwitchInst* which = builder.CreateSwitch(known, call, 3);
    which->addCase(layout_number(is_integer ? DirectTexels::integer_word : DirectTexels::float_word), word_block);
    std::array<std::vector<std::pair<llvm::Value*, llvm::BasicBlock*>>, 4> arriving;
    const auto arrive = [&](const std::array<llvm::Value*, 4>& texel) {
        for (std::size_t i = 0; i < 4; ++i) arriving[i].emplace_back(texel[i], builder.GetInsertBlock());
        builder.CreateBr(after);
    };
    /// Goes on where whole rows are read; returns where they are not, or null.
    const auto begin_rows = [&](const TexelPlaces& places) -> llvm::BasicBlock* {
        if (!is_row) return nullptr;
        llvm::BasicBlock *rows = block("rows"), *each = block("each");
        builder.CreateCondBr(all(Component(places.inside)), rows, each);
        builder.SetInsertPoint(rows);
        return each;
    };
    const auto one = [&](llvm::Value* inside) {
        return select(inside, splat(int32(is_integer ? 1 : std::bit_cast<std::int32_t>(1.0f))), none);
    };

    builder.SetInsertPoint(word_block);
    TexelPlaces places = texel_places(view, type, coordinates, level.value, 4);
    if (llvm::BasicBlock* each = begin_rows(places)) {
        arrive({load_texel_rows(places, word, 1), none, none, one(all_lanes())});
        builder.SetInsertPoint(each);
    }
    llvm::Value* texels = builder.CreateMaskedGather(
        words, builder.CreateGEP(builder.getInt8Ty(), places.data, places.offset), llvm::Align(4), places.inside, none);
    arrive({texels, none, none, one(places.inside)});

    // Tables, whose entries lie anywhere: materials ask them for every pixel.
    if (is_integer && !is_row) {
        llvm::BasicBlock* pair_block = block("fetch_pairs");
        which->addCase(layout_number(DirectTexels::integer_pair), pair_block);
        builder.SetInsertPoint(pair_block);
        places = texel_places(view, type, coordinates, level.value, 8);
        llvm::Type* wide = vector_of(builder.getInt64Ty());
        llvm::Value* pairs = builder.CreateMaskedGather(
            wide, builder.CreateGEP(builder.getInt8Ty(), places.data, places.offset), llvm::Align(4), places.inside,
            llvm::Constant::getNullValue(wide));
        pairs = builder.CreateBitCast(pairs, llvm::FixedVectorType::get(word, 2 * lanes));
        std::array<llvm::Value*, 2> channels{};
        for (std::uint32_t c = 0; c < 2; ++c) {
            std::vector<int> of_channel(lanes);
            for (std::uint32_t i = 0; i < lanes; ++i) of_channel[i] = static_cast<int>(2 * i + c);
            channels[c] = builder.CreateShuffleVector(pairs, of_channel);
        }
        arrive({channels[0], channels[1], none, one(places.inside)});
    }

    // In fragment shaders, which look into other pictures, code for more layouts is hardly worth its time.
    if (!is_integer && module.model == spv::ExecutionModel::GLCompute) {
        llvm::BasicBlock* half_block = block("fetch_halves");
        which->addCase(layout_number(DirectTexels::half4), half_block);
        builder.SetInsertPoint(half_block);
        places = texel_places(view, type, coordinates, level.value, 8);
        llvm::Type* half_word = builder.getInt16Ty();
        const auto decoded = [&](llvm::Value* bits) {
            llvm::Value* half = builder.CreateBitCast(bits, vector_of(builder.getHalfTy()));
            return builder.CreateBitCast(math.convert_float(half, builder.getFloatTy()), words);
        };
        if (llvm::BasicBlock* each = begin_rows(places)) {
            llvm::Value* rows = load_texel_rows(places, half_word, 4);
            std::array<llvm::Value*, 4> channels{};
            for (std::uint32_t c = 0; c < 4; ++c) {
                std::vector<int> of_channel(lanes);
                for (std::uint32_t i = 0; i < lanes; ++i) of_channel[i] = static_cast<int>(4 * i + c);
                channels[c] = decoded(builder.CreateShuffleVector(rows, of_channel));
            }
            arrive(channels);
            builder.SetInsertPoint(each);
        }
        llvm::Type* wide = vector_of(builder.getInt64Ty());
        llvm::Value* pairs = builder.CreateMaskedGather(
            wide, builder.CreateGEP(builder.getInt8Ty(), places.data, places.offset), llvm::Align(4), places.inside,
            llvm::Constant::getNullValue(wide));
        std::array<llvm::Value*, 4> channels{};
        for (std::uint32_t c = 0; c < 4; ++c)
            channels[c] = decoded(builder.CreateTrunc(builder.CreateLShr(pairs, 16 * c), vector_of(half_word)));
        arrive(channels);
    }

    expect_cases(*which);
    builder.SetInsertPoint(call);
    const std::vector<Component> called = otherwise();
    arrive({called.at(0).value, called.at(1).value, called.at(2).value, called.at(3).value});

    builder.SetInsertPoint(after);
    std::vector<Component> result;
    for (const auto& ways : arriving) {
        llvm::PHINode* either = builder.CreatePHI(words, static_cast<unsigned>(ways.size()));
        for (const auto& [value, from] : ways) either->addIncoming(value, from);
        result.emplace_back(either);
    }
    return result;
}

std::vector<Component> Emitter::fetch_once(const Component& image, Id image_type,
                                           const std::vector<Component>& coordinates, const Component& level,
                                           std::uint32_t flags) {
    const Type& type = module.type(image_type);
    llvm::Type *word = builder.getInt32Ty(), *pair = builder.getInt64Ty();
    llvm::FunctionCallee callee = external("nacre_cpu_texel", llvm::StructType::get(context, {pair, pair}),
                                           {pointer_type, word, word, word, word, word});
    // No shader writes what it fetches, and no argument does harm: as arithmetic, it may be done earlier, once for
    // many.
    auto& function = *llvm::cast<llvm::Function>(callee.getCallee());
    function.setMemoryEffects(llvm::MemoryEffects::none());
    for (const auto attribute : {llvm::Attribute::NoUnwind, llvm::Attribute::WillReturn, llvm::Attribute::Speculatable,
                                 llvm::Attribute::NoSync, llvm::Attribute::NoFree})
        function.addFnAttr(attribute);
    std::vector<llvm::Value*> arguments{bound_view(image.value)};
    const std::uint32_t count = dimensions_of(type.dim) + (type.arrayed ? 1u : 0u);
    for (std::uint32_t i = 0; i < 3; ++i) arguments.push_back(i < count ? coordinates.at(i).value : int32(0));
    arguments.push_back(level.value);
    arguments.push_back(int32(static_cast<std::int32_t>(flags)));
    llvm::Value* texel = builder.CreateCall(callee, arguments);
    std::vector<Component> words;
    for (unsigned i = 0; i < 4; ++i) {
        llvm::Value* two = builder.CreateExtractValue(texel, i / 2);
        words.emplace_back(builder.CreateTrunc(i % 2 == 0 ? two : builder.CreateLShr(two, 32), word));
    }
    return words;
}

bool Emitter::store_directly(const Component& image, Id image_type, const std::vector<Component>& coordinates,
                             const std::vector<Component>& texel, const std::function<void()>& otherwise) {
    const Type& type = module.type(image_type);
    if (!are_rows(coordinates, dimensions_of(type.dim) + (type.arrayed ? 1u : 0u)) || texel.size() < 4) return false;
    const bool is_integer = image_integer_flag(image_type) != 0;
    llvm::Type* word = builder.getInt32Ty();
    llvm::Type* words = vector_of(word);
    llvm::Value* view = bound_view(image.value);
    const auto block = [&](const char* block_name) { return llvm::BasicBlock::Create(context, block_name, function_); };
    llvm::BasicBlock *call = block("store_call"), *after = block("stored");
    llvm::Value* layout = invariant_load(word, at_offset(view, offsetof(ImageView, direct_texels)), 4);
    llvm::SwitchInst* which = builder.CreateSwitch(layout, call, 3);
    /// Goes on where the rows of a layout are whole.
    const auto begin = [&](DirectTexels of, std::uint32_t bytes) {
        llvm::BasicBlock *known = block("store_known"), *rows = block("store_rows");
        which->addCase(builder.getInt32(static_cast<std::uint32_t>(of)), known);
        builder.SetInsertPoint(known);
        const TexelPlaces places = texel_places(view, type, coordinates, int32(0), bytes);
        builder.CreateCondBr(all(Component(both(effect_mask(), places.inside))), rows, call);
        builder.SetInsertPoint(rows);
        return places;
    };
    const auto store_rows_of = [&](const TexelPlaces& places, llvm::Value* first, llvm::Value* second,
                                   std::uint32_t per_texel, auto element_of) {
        const std::uint32_t row = row_lanes();
        for (std::uint32_t lane = 0; lane < lanes; lane += row) {
            std::vector<int> order(std::size_t{row} * per_texel);
            for (std::uint32_t i = 0; i < order.size(); ++i)
                order[i] = static_cast<int>(element_of(lane + i / per_texel, i % per_texel));
            builder.CreateAlignedStore(builder.CreateShuffleVector(first, second, order), row_address(places, lane),
                                       llvm::Align(4));
        }
        builder.CreateBr(after);
    };
    const auto store_words = [&](const TexelPlaces& places, llvm::Value* value) {
        store_rows_of(places, value, llvm::PoisonValue::get(value->getType()), 1,
                      [](std::uint32_t lane, std::uint32_t) { return lane; });
    };

    TexelPlaces places = begin(is_integer ? DirectTexels::integer_word : DirectTexels::float_word, 4);
    store_words(places, widen(to_word(texel[0])));
    if (!is_integer) {
        places = begin(DirectTexels::half4, 8);
        std::array<llvm::Value*, 4> halves{};
        for (std::size_t c = 0; c < 4; ++c) {
            llvm::Value* single = builder.CreateBitCast(widen(to_word(texel[c])), vector_of(builder.getFloatTy()));
            halves[c] = builder.CreateBitCast(math.convert_float(single, builder.getHalfTy()),
                                              vector_of(builder.getInt16Ty()));
        }
        std::vector<int> joined(std::size_t{2} * lanes);
        std::iota(joined.begin(), joined.end(), 0);
        store_rows_of(places, builder.CreateShuffleVector(halves[0], halves[1], joined),
                      builder.CreateShuffleVector(halves[2], halves[3], joined), 4,
                      [&](std::uint32_t lane, std::uint32_t channel) { return channel * lanes + lane; });

        places = begin(DirectTexels::unorm8x4, 4);
        const llvm::IRBuilder<>::FastMathFlagGuard guard(builder);
        builder.clearFastMathFlags();
        llvm::Type* floats = vector_of(builder.getFloatTy());
        const auto number = [&](float value) { return llvm::ConstantFP::get(floats, value); };
        llvm::Value* packed = nullptr;
        for (unsigned c = 0; c < 4; ++c) {
            llvm::Value* value = builder.CreateBitCast(widen(to_word(texel[c])), floats);
            // NaN becomes 0.
            value = builder.CreateSelect(builder.CreateFCmpOGT(value, number(0.0f)), value, number(0.0f));
            value = builder.CreateSelect(builder.CreateFCmpOLT(value, number(1.0f)), value, number(1.0f));
            // One rounding, to the nearest whole number, ties to even.
            llvm::Value* rounded = builder.CreateIntrinsic(llvm::Intrinsic::fma, {floats},
                                                           {value, number(255.0f), number(whole_numbers)});
            llvm::Value* code = builder.CreateAnd(builder.CreateBitCast(rounded, words), 255);
            code = c == 0 ? code : builder.CreateShl(code, 8 * c);
            packed = packed ? builder.CreateOr(packed, code) : code;
        }
        store_words(places, packed);
    }

    expect_cases(*which);
    builder.SetInsertPoint(call);
    otherwise();
    builder.CreateBr(after);
    builder.SetInsertPoint(after);
    has_side_effects = true;
    return true;
}

}  // namespace nacre::cpu
