// SPDX-License-Identifier: Apache-2.0
#include "materials/storage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "materials/builtin_materials.h"
#include "tests/materials/random_tree.h"

namespace nacre::materials {
namespace {

using closures::Library;

std::uint32_t bytes_of(std::string_view name) {
    const auto tree = make_builtin_material(name);
    EXPECT_TRUE(tree);
    const auto flat = flatten(*tree);
    EXPECT_TRUE(flat) << flat.error().message();
    return storage_layout(*flat).total_bytes();
}

// Topologies that fit a pixel.
std::vector<FlattenedTree> storable_trees(std::uint32_t count) {
    std::uint32_t all = 0;
    for (const SlabFeature& feature : slab_features()) all |= feature.bit;
    std::mt19937 random(2);
    std::vector<FlattenedTree> result;
    for (std::uint32_t i = 0; result.size() < count; ++i) {
        auto flat = flatten(random_tree(random, {.slabs = 1 + i % 6, .features = all}));
        if (!flat) ADD_FAILURE() << flat.error().message();
        if (!flat) return result;
        if (flat->topology.frames.size() > StorageLayout::max_frames) continue;
        if (storage_layout(*flat).storage_class != StorageClass::simple) result.push_back(std::move(*flat));
    }
    for (const BuiltinMaterial& material : builtin_materials()) {
        auto flat = flatten(*make_builtin_material(material.name));
        if (storage_layout(*flat).storage_class != StorageClass::simple) result.push_back(std::move(*flat));
    }
    return result;
}

// The rows of storage of the Substrate talk; each holds all that those before it hold.
TEST(Storage, RowsTakeAtMostWhatTheTalkStates) {
    const std::pair<const char*, std::uint32_t> rows[] = {
        {"simple", 12},         {"single", 16},        {"single-haze-f90", 20}, {"single-fuzz", 24},
        {"single-sss", 28},     {"complex-aniso", 28}, {"complex-coat", 40},    {"special-speclut", 44},
        {"special-glints", 60}, {"complex-opal", 76}};
    std::uint32_t features = 0, closures = 0;
    for (const auto& [name, bytes] : rows) {
        EXPECT_LE(bytes_of(name), bytes) << name;
        const auto flat = flatten(*make_builtin_material(name));
        EXPECT_EQ(features & ~flat->topology.features, 0u) << name << " lacks a feature of the row before";
        EXPECT_GE(flat->topology.closures.size(), closures) << name;
        features = flat->topology.features;
        closures = static_cast<std::uint32_t>(flat->topology.closures.size());
    }
    EXPECT_EQ(bytes_of("simple"), 12u);
}

TEST(Storage, LayoutHasNoFieldTwiceAndCountsItsBits) {
    for (const FlattenedTree& flat : storable_trees(100)) {
        const StorageLayout layout = storage_layout(flat);
        std::map<std::tuple<std::uint32_t, std::uint32_t, StorageValue>, int> seen;
        std::uint32_t bits = 0;
        for (const StorageField& field : layout.fields) {
            EXPECT_EQ(field.offset, bits) << storage_format(field.value).name;
            bits += field.bits;
            EXPECT_TRUE(field.closure == StorageLayout::no_closure || field.closure < flat.topology.closures.size());
            EXPECT_EQ(++seen[std::tuple(field.closure, field.frame, field.value)], 1)
                << storage_format(field.value).name;
        }
        EXPECT_LE(bits, 32 * layout.material_words());
        EXPECT_TRUE(layout.material_words() == 2 || bits > 32 * (layout.material_words() - 1));
    }
}

TEST(Storage, FormatsStandInTheOrderOfTheirValues) {
    std::uint32_t i = 0;
    for (const StorageFormat& format : storage_formats()) {
        EXPECT_EQ(static_cast<std::uint32_t>(format.value), i++) << format.name;
        EXPECT_EQ(&storage_format(format.value), &format);
    }
}

// What comes back is off by one step at most, whatever the dither; the mean over all dithers is off by much less.
TEST(Storage, FieldsComeBackWithinAStep) {
    Library library;
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    for (int i = 0; i < 2000; ++i) {
        const glm::dvec3 color(i == 0 ? 0.0 : uniform(random), i == 1 ? 1.0 : uniform(random), uniform(random));
        const double number = i == 2 ? 0.0 : i == 3 ? 1.0 : uniform(random), low = 1e-8, octaves = std::log2(1e3);
        const double length = low * std::exp2(octaves * uniform(random)), with_sign = 2.0 * number - 1.0;
        glm::dvec3 mean(0.0);
        double mean_number = 0.0;
        for (std::uint32_t pixel = 0; pixel < 64; ++pixel) {
            const auto dither = [&](std::uint32_t which) {
                return library.ordered_dither(pixel % 8, pixel / 8, which);
            };
            const glm::dvec3 back = library.unpack_color(library.pack_color(color, {dither(0), dither(1), dither(2)}));
            for (int channel = 0; channel < 3; ++channel) {
                const double step = channel == 2 ? 1.0 / 63 : 1.0 / 127;
                EXPECT_LE(std::abs(std::sqrt(back[channel]) - std::sqrt(color[channel])), step);
                mean[channel] += std::sqrt(back[channel]) / 64.0;
            }
            const double unit = library.unpack_unit(library.pack_unit(number, 6, dither(0)), 6);
            EXPECT_LE(std::abs(unit - number), 1.0 / 63);
            mean_number += unit / 64.0;
            EXPECT_LE(std::abs(library.unpack_signed(library.pack_signed(with_sign, 8, dither(0)), 8) - with_sign),
                      1.0 / 127);
            const double back_length =
                library.unpack_logarithm(library.pack_logarithm(length, 10, low, octaves, dither(0)), 10, low, octaves);
            EXPECT_LE(std::abs(std::log2(back_length / length)), octaves / 1022);
            const double negative = library.unpack_signed_logarithm(
                library.pack_signed_logarithm(-length, 16, low, octaves, dither(0)), 16, low, octaves);
            EXPECT_NEAR(negative / length, -1.0, 3e-4);
            EXPECT_EQ(library.pack_logarithm(0.0, 10, low, octaves, dither(0)), 0u);
        }
        for (int channel = 0; channel < 3; ++channel)
            EXPECT_NEAR(mean[channel], std::sqrt(color[channel]), (channel == 2 ? 1.0 / 63 : 1.0 / 127) / 64 + 1e-9);
        EXPECT_NEAR(mean_number, number, 1.0 / 63 / 64 + 1e-9);
    }
}

// Writing and reading find the same places, and what a pixel reflects stays what it was within the steps.
TEST(Storage, MaterialsComeBack) {
    Library library;
    double worst = 0.0;
    for (const FlattenedTree& flat : storable_trees(200)) {
        const StorageLayout layout = storage_layout(flat, {.has_occlusion = true});
        const glm::dvec3 view = glm::normalize(glm::dvec3(0.4, 0.2, 0.9));
        const ShadedTree shaded = shade(flat, view);
        PixelInputs inputs{.occlusion = 0.5, .position = {3, 6}};
        for (const std::uint32_t slot : layout.frames) {
            inputs.normals.emplace_back(0.0, 0.0, 1.0);
            inputs.tangent_angles.push_back(flat.visible_tree.frames[flat.topology.frames[slot]].rotation);
        }
        const StoredPixel pixel = pack_pixel(layout, shaded, inputs);
        ASSERT_EQ(pixel.words.size(), layout.material_words());
        const auto back = unpack_pixel(pixel);
        ASSERT_TRUE(back) << back.error().message();
        ASSERT_EQ(back->fields.size(), layout.fields.size()) << topology_text(flat.visible_tree);
        for (std::size_t i = 0; i < layout.fields.size(); ++i) {
            EXPECT_EQ(back->fields[i].offset, layout.fields[i].offset);
            EXPECT_EQ(back->fields[i].value, layout.fields[i].value);
        }
        EXPECT_NEAR(back->occlusion, 0.5, 0.5 / 63 + 1e-9);
        ASSERT_EQ(back->closures.size(), layout.closures.size());
        for (std::size_t i = 0; i < back->closures.size(); ++i) {
            const ShadedClosure& before = shaded.closures[layout.closures[i]];
            const UnpackedClosure& after = back->closures[i];
            EXPECT_NEAR(std::sqrt(after.slab.f0.g), std::sqrt(before.slab.f0.g), 1.0 / 127);
            EXPECT_NEAR(after.slab.roughness, before.slab.roughness, 1.0 / 255);
            EXPECT_EQ(after.slab.features & ~slab_medium, before.slab.features & stored_features() & ~slab_medium);
            if (layout.closures.size() > 1) {
                EXPECT_NEAR(std::sqrt(after.path.weight.r), std::sqrt(before.path.weight.r * before.coverage), 0.07);
            }
            worst = std::max(worst, std::abs(std::sqrt(after.slab.albedo.r) - std::sqrt(before.slab.albedo.r)));
        }
    }
    EXPECT_LE(worst, 1.0 / 127);
}

// The brightness of F90, which closures do without, holds the weight; a white one has its place in a plain slab.
TEST(Storage, SpecularWeightsComeBack) {
    Tree tree;
    tree.root = tree.add(Slab{.features = slab_f90 | slab_fuzz, .f90 = {0.1f, 0.2f, 0.05f}, .specular_weight = 0.36f});
    const auto flat = flatten(tree);
    ASSERT_TRUE(flat);
    const auto back = unpack_pixel(pack_pixel(storage_layout(*flat), shade(*flat, {0, 0, 1}), {}));
    ASSERT_TRUE(back);
    const Library::Slab& slab = back->closures[0].slab;
    EXPECT_NEAR(std::sqrt(slab.specular_weight), 0.6, 1.0 / 127);
    EXPECT_NEAR(slab.f90.r / slab.f90.g, 0.5, 0.03) << "the color stays";
    tree.nodes[tree.root].slab = {.features = slab_f90, .specular_weight = 0.36f};
    EXPECT_EQ(storage_layout(*flatten(tree)).storage_class, StorageClass::simple);
    tree.nodes[tree.root].slab.f90 = {1.0f, 0.9f, 0.9f};
    EXPECT_EQ(storage_layout(*flatten(tree)).storage_class, StorageClass::single);
}

TEST(Storage, ATruncatedPixelIsAnError) {
    for (const FlattenedTree& flat : storable_trees(10)) {
        StoredPixel pixel = pack_pixel(storage_layout(flat), shade(flat, {0, 0, 1}), {});
        if (pixel.words.size() < 3) continue;
        pixel.words.pop_back();
        EXPECT_FALSE(unpack_pixel(pixel));
    }
    EXPECT_FALSE(unpack_pixel({.words = {~0u}}));
}

TEST(Storage, SubsurfaceDataKeepsItsMedium) {
    Library library;
    for (const double length : {0.0, 1e-5, 1e-3, 0.1, 5.0}) {
        Library::Slab slab = Library::slab_of(Slab{});
        slab.features = slab_medium;
        slab.mean_free_path = glm::dvec3(length);
        slab.thickness = 0.01;
        StoredPixel pixel{.words = {}, .subsurface = pack_subsurface(slab, {0, 0})};
        const auto flat = flatten(*make_builtin_material("single-sss"));
        StoredPixel whole = pack_pixel(storage_layout(*flat), shade(*flat, {0, 0, 1}), {});
        whole.subsurface = pixel.subsurface;
        const auto back = unpack_pixel(whole);
        ASSERT_TRUE(back);
        const Library::Slab& read = back->closures[0].slab;
        EXPECT_NEAR(read.mean_free_path.x, length, 0.07 * length);
        EXPECT_NEAR(read.thickness, 0.01, 0.05 * 0.01);
    }
}

}  // namespace
}  // namespace nacre::materials
