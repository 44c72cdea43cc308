// SPDX-License-Identifier: Apache-2.0
#include "materials/storage_shader.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "materials/builtin_materials.h"
#include "materials/evaluation.h"
#include "tests/materials/random_tree.h"
#include "tests/materials/tree_run.h"

namespace nacre::materials {
namespace {

using closures::Library;

// What one invocation writes behind the words: subsurface data, roughness of the top, and what the closures reflect
// that are read back.
constexpr std::uint32_t extra_words = 5;

// The surface's frame is that of the world here.
constexpr const char* store_text = R"(
layout(set = 0, binding = 2, std430) writeonly buffer Results { uint results[]; };
uint stored[stored_words];
uint material_word(uint index) { return stored[index]; }
#include "materials/closures/stored_closures.glsl"
void main() {
    uint i = gl_GlobalInvocationID.x;
    vec3 view = directions[2u * i].xyz, light = directions[2u * i + 1u].xyz;
    vec3 views[tree_frame_count], normals[tree_frame_count], tangents[tree_frame_count];
    for (uint frame = 0u; frame < tree_frame_count; ++frame) {
        views[frame] = view;
        normals[frame] = vec3(0.0, 0.0, 1.0);
        tangents[frame] = vec3(1.0, 0.0, 0.0);
    }
    TreeState state = shade_tree(views, 1e-3);
    uint words[stored_words];
    uint subsurface;
    pack_tree(state, normals, tangents, 0.25, uvec2(i % 16u, i / 16u), words, subsurface);
    float roughness = state.slabs[stored_top_closure].roughness;
    for (uint word = 0u; word < stored_words; ++word) stored[word] = words[word];
    StoredHeader header = read_stored_header(vec3(0.0, 0.0, 1.0));
    vec3 sum = vec3(0.0);
    for (uint index = 0u; index < header.closure_count; ++index) {
        StoredClosure closure = read_stored_closure(header, index, roughness, subsurface);
        ClosureValue value = evaluate_closure(closure_below(closure.slab, closure.path, view, 1e-3), light);
        sum += (value.specular + value.diffuse + value.subsurface) * closure.path.weight *
               top_transmittance(closure.path, light.z);
    }
    uint base = i * (stored_words + 5u);
    for (uint word = 0u; word < stored_words; ++word) results[base + word] = words[word];
    results[base + stored_words] = subsurface;
    results[base + stored_words + 1u] = floatBitsToUint(roughness);
    for (uint channel = 0u; channel < 3u; ++channel)
        results[base + stored_words + 2u + channel] = floatBitsToUint(sum[channel]);
})";

class StorageShaderTest : public TreeDeviceTest {
  protected:
    void compare(const FlattenedTree& flat, std::mt19937& random) {
        const std::string name = topology_text(flat.visible_tree);
        const StorageLayout layout = storage_layout(flat, {.has_occlusion = true});
        ASSERT_NE(layout.storage_class, StorageClass::simple);
        const std::vector<glm::vec4> directions = random_directions(random);
        TreeShader tree = tree_shader(flat);
        tree.defines +=
            fmt::format("#define NACRE_STORED_FRAMES {}\n#define NACRE_STORED_LAYERS\n", layout.frames.size());
        const std::uint32_t words = layout.material_words(), stride = words + extra_words;
        const auto bytes = run_tree(*device_, tree, tree.glsl + storage_writer(flat, layout) + store_text, directions,
                                    std::size_t{4} * stride * direction_pairs);
        ASSERT_TRUE(bytes) << bytes.error().message();
        Library library;
        std::uint32_t codes_off = 0, codes = 0;
        for (std::uint32_t i = 0; i < direction_pairs; ++i) {
            std::vector<std::uint32_t> result(stride);
            std::memcpy(result.data(), bytes->data() + std::size_t{4} * stride * i, std::size_t{4} * stride);
            const auto number = [&](std::uint32_t at) {
                float value = 0.0f;
                std::memcpy(&value, &result[words + at], 4);
                return static_cast<double>(value);
            };
            const glm::dvec3 view = glm::normalize(glm::dvec3(directions[2 * i])),
                             light = glm::normalize(glm::dvec3(directions[2 * i + 1]));
            // What the host writes of the same matter.
            const StoredPixel expected =
                pack_pixel(layout, shade(flat, view), {.occlusion = 0.25, .position = {i % 16, i / 16}});
            const StoredPixel got{.words = {result.begin(), result.begin() + words},
                                  .subsurface = result[words],
                                  .roughness = number(1)};
            EXPECT_NEAR(got.roughness, expected.roughness, 1e-5);
            const auto read = unpack_pixel(got), wanted = unpack_pixel(expected);
            ASSERT_TRUE(read) << read.error().message();
            ASSERT_EQ(read->codes.size(), wanted->codes.size()) << name;
            for (std::size_t field = 0; field < read->codes.size(); ++field) {
                const StorageFormat& format = storage_format(read->fields[field].value);
                const std::uint32_t a = read->codes[field], b = wanted->codes[field];
                ++codes;
                if (a == b) continue;
                ++codes_off;
                if (format.codec == StorageCodec::color) {
                    EXPECT_LE(std::abs(static_cast<int>(a & 127u) - static_cast<int>(b & 127u)), 1)
                        << format.name << name;
                    EXPECT_LE(std::abs(static_cast<int>(a >> 7 & 127u) - static_cast<int>(b >> 7 & 127u)), 1)
                        << format.name;
                    EXPECT_LE(std::abs(static_cast<int>(a >> 14) - static_cast<int>(b >> 14)), 1)
                        << format.name << name;
                } else {
                    EXPECT_LE(std::abs(static_cast<int>(a) - static_cast<int>(b)), 1) << format.name << name;
                }
            }
            // And what both make of the device's words.
            glm::dvec3 sum(0.0);
            for (const UnpackedClosure& closure : read->closures) {
                const Library::ClosureValue value =
                    library.evaluate_closure(library.closure_below(closure.slab, closure.path, view, 1e-3), light);
                sum += (value.specular + value.diffuse + value.subsurface) * closure.path.weight *
                       library.top_transmittance(closure.path, light.z);
            }
            for (int channel = 0; channel < 3; ++channel) {
                EXPECT_NEAR(number(2 + static_cast<std::uint32_t>(channel)), sum[channel], 1e-3 * (sum[channel] + 1e-3))
                    << name << " pair " << i;
            }
        }
        // Rounding differs only where a value lies next to a step.
        EXPECT_LT(codes_off, codes / 200 + 2) << name;
    }
};

TEST_P(StorageShaderTest, WritesAndReadsAsTheHostDoes) {
    std::mt19937 random(21);
    for (const std::uint32_t slabs : {1u, 2u, 4u}) {
        const auto flat = flatten(random_tree(random, {.slabs = slabs,
                                                       .features = slab_anisotropy | slab_f90 | slab_f82 |
                                                                   slab_second_lobe | slab_fuzz | slab_medium}));
        ASSERT_TRUE(flat) << flat.error().message();
        compare(*flat, random);
    }
}

TEST_P(StorageShaderTest, BuiltinMaterials) {
    std::mt19937 random(22);
    for (const char* name : {"single-sss", "complex-coat", "silks-under-plastic", "jade-in-gold"}) {
        compare(*flatten(*make_builtin_material(name)), random);
    }
}

INSTANTIATE_TEST_SUITE_P(Backends, StorageShaderTest, testing::ValuesIn(TreeDeviceTest::backends),
                         TreeDeviceTest::name_of);

}  // namespace
}  // namespace nacre::materials
