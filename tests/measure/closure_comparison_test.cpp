// SPDX-License-Identifier: Apache-2.0
#include "measure/closure_comparison.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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
            if (field.offset / 32 + 1 < pixel.words.size())
                bits |= std::uint64_t{pixel.words[field.offset / 32 + 1]} << 32;
            bits += static_cast<std::uint64_t>(change) << (field.offset % 32);
            pixel.words[field.offset / 32] = static_cast<std::uint32_t>(bits);
            if (field.offset / 32 + 1 < pixel.words.size())
                pixel.words[field.offset / 32 + 1] = static_cast<std::uint32_t>(bits >> 32);
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
    for (const FieldDifference& field : two->difference.fields)
        EXPECT_EQ(field.differing, field.name == "f0") << field.name;
    EXPECT_NEAR(two->difference.max_abs, 2.0 / 127, 1e-9);
}

TEST_F(ClosureComparison, AnotherTopologyIsADifference) {
    const auto result = compare_closures(words_of(pixel_), words_of(with(StorageValue::features, 1)));
    ASSERT_TRUE(result);
    EXPECT_EQ(result->difference.fields_differing, 1u);
}

const NumericalError& error_of(const std::vector<NumericalError>& errors, std::string_view field) {
    const auto found = std::ranges::find_if(errors, [&](const auto& error) { return error.largest.name == field; });
    EXPECT_NE(found, errors.end()) << field;
    return *found;
}

TEST_F(ClosureComparison, ErrorsAreThoseOfTheDecodedFields) {
    const auto same = closure_errors(words_of(pixel_), words_of(pixel_));
    ASSERT_TRUE(same) << same.error().message();
    for (const NumericalError& error : *same) {
        EXPECT_EQ(error.texture, "material.slices");
        EXPECT_FALSE(error.largest.name.empty()) << "the field is named, right or wrong";
        EXPECT_EQ(error.largest.error, 0.0) << error.largest.name;
        EXPECT_GT(error.values, 0u);
    }
    // Two codes of red, whose square root is stored in 7 bits.
    const UnpackedMaterial before = *unpack_pixel(pixel_), after = *unpack_pixel(with(StorageValue::f0, 2));
    const double red = before.closures[0].slab.f0.r, wrong = after.closures[0].slab.f0.r;
    ASSERT_NEAR(std::sqrt(wrong) - std::sqrt(red), 2.0 / 127, 1e-12);
    const auto errors = closure_errors(words_of(pixel_), words_of(with(StorageValue::f0, 2)));
    ASSERT_TRUE(errors);
    for (const NumericalError& error : *errors)
        EXPECT_EQ(error.largest.error > 0.0, error.largest.name == "f0.r") << error.largest.name;
    const WrongValue& found = error_of(*errors, "f0.r").largest;
    EXPECT_DOUBLE_EQ(found.reference, red);
    EXPECT_DOUBLE_EQ(found.value, wrong);
    EXPECT_DOUBLE_EQ(found.error, wrong - red);
    // Numbers on a scale of their own: 1 / 255 for each code.
    const auto weight = closure_errors(words_of(pixel_), words_of(with(StorageValue::roughness, 3)));
    ASSERT_TRUE(weight);
    EXPECT_NEAR(error_of(*weight, "roughness").largest.error, 3.0 / 255, 1e-12);
}

TEST_F(ClosureComparison, OtherTopologiesAreNoErrorsOfValues) {
    const auto both = [](const StoredPixel& first, const StoredPixel& second) {
        MaterialWords words = words_of(first);
        const MaterialWords more = words_of(second);
        const auto append = [](TextureData& to, const TextureData& from) {
            to.bytes.insert(to.bytes.end(), from.bytes.begin(), from.bytes.end());
            to.width = 2;
        };
        append(words.material_0, more.material_0);
        append(words.material_1, more.material_1);
        for (std::size_t i = 0; i < words.slices.size(); ++i) append(words.slices[i], more.slices[i]);
        return words;
    };
    const auto errors =
        closure_errors(both(pixel_, pixel_), both(with(StorageValue::features, 1), with(StorageValue::f0, 2)));
    ASSERT_TRUE(errors);
    std::uint64_t flips = 0;
    for (const NumericalError& error : *errors) flips += error.flips;
    EXPECT_EQ(flips, 1u);
    EXPECT_EQ(error_of(*errors, "f0.r").largest.x, 1u);
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
