// SPDX-License-Identifier: Apache-2.0
#include "measure/closure_comparison.h"

#include <gtest/gtest.h>

#include <cstring>

#include "materials/builtin_materials.h"
#include "materials/storage.h"

namespace nacre::measure {
namespace {

using namespace materials;

// A picture of one pixel.
TextureData texture_of(std::uint32_t word) {
    TextureData texture{.name = "word", .format = rhi::Format::r32_uint, .width = 1, .height = 1};
    texture.bytes.resize(4);
    std::memcpy(texture.bytes.data(), &word, 4);
    return texture;
}

MaterialWords words_of(const StoredPixel& pixel) {
    MaterialWords words{.material_0 = texture_of(pixel.words[0]), .material_1 = texture_of(pixel.words[1])};
    for (std::size_t i = 2; i < pixel.words.size(); ++i) words.slices.push_back(texture_of(pixel.words[i]));
    words.slices.push_back(texture_of(pixel.subsurface));
    return words;
}

class ClosureComparison : public testing::Test {
  protected:
    void SetUp() override {
        const auto flat = flatten(*make_builtin_material("complex-coat"));
        ASSERT_TRUE(flat);
        layout_ = storage_layout(*flat);
        pixel_ = pack_pixel(layout_, shade(*flat, {0, 0, 1}), {});
    }

    // The pixel with one field's code changed.
    StoredPixel with(StorageValue value, int change) const {
        StoredPixel pixel = pixel_;
        for (const StorageField& field : layout_.fields) {
            if (field.value != value) continue;
            std::uint64_t bits = pixel.words[field.offset / 32];
            if (field.offset / 32 + 1 < pixel.words.size()) bits |= std::uint64_t{pixel.words[field.offset / 32 + 1]} << 32;
            bits += static_cast<std::uint64_t>(change) << (field.offset % 32);
            pixel.words[field.offset / 32] = static_cast<std::uint32_t>(bits);
            if (field.offset / 32 + 1 < pixel.words.size()) pixel.words[field.offset / 32 + 1] = static_cast<std::uint32_t>(bits >> 32);
            return pixel;
        }
        ADD_FAILURE() << "no such field";
        return pixel;
    }

    StorageLayout layout_;
    StoredPixel pixel_;
};

TEST_F(ClosureComparison, EqualWordsAreEqual) {
    const auto result = compare_closures(words_of(pixel_), words_of(pixel_));
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_TRUE(result->is_closure[0]);
    EXPECT_EQ(result->difference.differing, 0u);
    EXPECT_EQ(result->difference.fields_differing, 0u);
    EXPECT_FALSE(result->difference.fields.empty());
}

TEST_F(ClosureComparison, OneStepIsNoDifferenceAndTwoAre) {
    const auto one = compare_closures(words_of(pixel_), words_of(with(StorageValue::f0, 1)));
    const auto two = compare_closures(words_of(pixel_), words_of(with(StorageValue::f0, 2)));
    ASSERT_TRUE(one && two);
    EXPECT_EQ(one->difference.differing, 1u);
    EXPECT_EQ(one->difference.fields_differing, 0u);
    EXPECT_EQ(two->difference.fields_differing, 1u);
    for (const FieldDifference& field : two->difference.fields) EXPECT_EQ(field.differing, field.name == "f0") << field.name;
    EXPECT_NEAR(two->difference.max_abs, 2.0 / 127, 1e-9);
}

TEST_F(ClosureComparison, AnotherTopologyIsADifference) {
    const auto result = compare_closures(words_of(pixel_), words_of(with(StorageValue::features, 1)));
    ASSERT_TRUE(result);
    EXPECT_EQ(result->difference.fields_differing, 1u);
}

TEST_F(ClosureComparison, PixelsOfOtherClassesAreNotLookedAt) {
    StoredPixel plain = pixel_;
    plain.words[0] = (plain.words[0] & ~3u) | 1u;
    const auto result = compare_closures(words_of(pixel_), words_of(plain));
    ASSERT_TRUE(result);
    EXPECT_FALSE(result->is_closure[0]);
    EXPECT_EQ(result->difference.differing, 0u);
}

TEST_F(ClosureComparison, DifferentSizesAreAnError) {
    MaterialWords words = words_of(pixel_);
    words.material_1.bytes.clear();
    EXPECT_FALSE(compare_closures(words_of(pixel_), words));
}

}  // namespace
}  // namespace nacre::measure
