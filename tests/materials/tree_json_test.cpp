// SPDX-License-Identifier: Apache-2.0
#include "materials/tree_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "materials/building_blocks.h"
#include "materials/topology.h"

namespace nacre::materials {
namespace {

using testing::HasSubstr;

constexpr const char* lacquer = R"({
  "nacre_material": 1, "name": "lacquer", "thin": true, "surface_thickness": 0.002,
  "images": ["pictures/mask.png"],
  "frames": [{}, {"rotation": 1.57, "normal": {"image": 0, "strength": 0.5, "uv_scale": [2, 2]}}],
  "root": {"layer": {
    "top": {"coverage": {"of": {"slab": {"roughness": 0.05, "albedo": 0, "mean_free_path": [0.001, 0.002, "infinity"]}},
                         "amount": {"value": 0.5, "texture": {"image": 0, "channel": "g", "scale": -1, "bias": 1}}}},
    "base": {"mix": {"first": {"slab": {"name": "gold", "f0": [1, 0.77, 0.34], "frame": 1, "features": ["anisotropy"]}},
                     "second": {"slab": {"albedo": {"value": [0.5, 0.5, 0.25], "texture": {"image": 0}}}},
                     "amount": 0.25, "parameter_blend": true}},
    "thickness": 1e-4}}})";

TEST(TreeJson, ReadsEveryPart) {
    const auto file = parse_material(lacquer, "lacquer.json");
    ASSERT_TRUE(file) << file.error().message();
    const Tree& tree = file->tree;
    EXPECT_EQ(tree.name, "lacquer");
    EXPECT_TRUE(tree.thin);
    EXPECT_EQ(tree.surface_thickness, 0.002f);
    ASSERT_EQ(file->images.size(), 1u);
    ASSERT_EQ(tree.frames.size(), 2u);
    EXPECT_EQ(tree.frames[1].rotation, 1.57f);
    EXPECT_EQ(tree.frames[1].normal_texture.scale, 0.5f);
    EXPECT_EQ(tree.frames[1].normal_texture.transform.scale, glm::vec2(2.0f));
    const Node& layer = tree.nodes[tree.root];
    ASSERT_EQ(layer.kind, NodeKind::layer);
    EXPECT_EQ(layer.thickness, 1e-4f);
    const Node& coverage = tree.nodes[layer.first];
    ASSERT_EQ(coverage.textures.size(), 1u);
    EXPECT_EQ(
        coverage.textures[0],
        (TextureInput{
            .field = "amount", .texture = {.image = 0, .sampler = 0}, .channel = 1, .scale = -1.0f, .bias = 1.0f}));
    const Slab& coat = tree.nodes[coverage.first].slab;
    EXPECT_EQ(coat.features, slab_medium);
    EXPECT_EQ(coat.mean_free_path, glm::vec3(0.001f, 0.002f, std::numeric_limits<float>::infinity()));
    EXPECT_EQ(coat.albedo, glm::vec3(0.0f));
    const Node& mix = tree.nodes[layer.second];
    EXPECT_TRUE(mix.parameter_blend);
    EXPECT_EQ(tree.nodes[mix.first].slab.features, slab_anisotropy);
    EXPECT_EQ(tree.nodes[mix.first].frame, 1u);
    EXPECT_EQ(tree.nodes[mix.second].textures[0].field, "albedo");
}

// What is written is read back to the same tree, for trees of all kinds.
TEST(TreeJson, TextRoundTrips) {
    std::mt19937 random(7);
    const auto uniform = [&] { return std::uniform_real_distribution<float>(0.0f, 1.0f)(random); };
    for (int round = 0; round < 200; ++round) {
        Tree tree{.name = round % 2 == 0 ? "round" : ""};
        tree.thin = uniform() < 0.5f;
        tree.surface_thickness = uniform();
        if (uniform() < 0.5f) tree.add_frame({.rotation = uniform()});
        std::vector<NodeIndex> open;
        const int slabs = 1 + static_cast<int>(uniform() * 6.0f);
        for (int i = 0; i < slabs; ++i) {
            Slab slab;
            slab.features = random() & ((1u << 11) - 1);
            if ((slab.features & slab_specular_lut) != 0) slab.specular_lut = random() % 256;
            for (const SlabField& field : slab_fields()) {
                if (field.feature != 0 && (slab.features & field.feature) == 0) continue;
                for (std::uint32_t channel = 0; channel < field.channels; ++channel) {
                    const float maximum = std::min(field.maximum, field.minimum + 3.0f);
                    field.set(slab, channel, field.minimum + uniform() * (maximum - field.minimum));
                }
            }
            const NodeIndex node =
                tree.add(slab, i % 2 == 0 ? "" : "named", static_cast<std::uint32_t>(random() % tree.frames.size()));
            if (uniform() < 0.5f)
                tree.nodes[node].textures.push_back({.field = "roughness",
                                                     .texture = {.image = 0, .sampler = 0, .uv_set = 1},
                                                     .channel = 3,
                                                     .scale = uniform(),
                                                     .bias = uniform()});
            if (uniform() < 0.3f)
                tree.nodes[node].textures.push_back(
                    {.field = "f0", .texture = {.image = 0, .sampler = 0}, .channel = 2, .gray = true});
            if (uniform() < 0.3f) tree.nodes[node].vertex_colored.emplace_back("albedo");
            open.push_back(node);
        }
        while (open.size() > 1) {
            const NodeIndex a = open.back();
            open.pop_back();
            const NodeIndex b = open.back();
            open.back() = uniform() < 0.3f   ? tree.coverage(tree.mix(a, b, uniform()), uniform())
                          : uniform() < 0.5f ? tree.layer(a, b, uniform())
                                             : tree.layer(a, b);
            tree.nodes.back().parameter_blend = tree.nodes.back().kind == NodeKind::layer && uniform() < 0.5f;
        }
        const MaterialFile file{.tree = tree, .images = {"a.png"}};
        const std::string text = material_text(file);
        const auto read = parse_material(text, "round trip");
        ASSERT_TRUE(read) << read.error().message() << text;
        EXPECT_EQ(material_text(*read), text);
        // The numbers too, not only the text: compare slabs by the order in which they are met.
        const auto met = [](const Tree& t) {
            std::vector<Node> result;
            for (const NodeIndex index : bottom_up(t)) result.push_back(t.nodes[index]);
            return result;
        };
        const auto expected = met(tree), got = met(read->tree);
        ASSERT_EQ(got.size(), expected.size());
        for (std::size_t i = 0; i < got.size(); ++i) {
            EXPECT_EQ(got[i].slab, expected[i].slab);
            EXPECT_THAT(got[i].textures, testing::UnorderedElementsAreArray(expected[i].textures));
            EXPECT_EQ(got[i].vertex_colored, expected[i].vertex_colored);
            EXPECT_EQ(got[i].amount, expected[i].amount);
            EXPECT_EQ(got[i].thickness, expected[i].thickness);
            EXPECT_EQ(got[i].name, expected[i].name);
        }
    }
}

TEST(TreeJson, FaultsAreNamedWithTheirPlace) {
    const auto message = [](std::string_view text) {
        const auto result = parse_material(text, "m.json");
        return result ? std::string("no error") : result.error().message();
    };
    const auto root = [&](std::string_view node) {
        return message(R"({"nacre_material": 1, "root": )" + std::string(node) + "}");
    };
    EXPECT_THAT(message("{\n  \"nacre_material\": 1,,\n}"), HasSubstr("'m.json': line 2, column 23"));
    EXPECT_THAT(message(""), HasSubstr("no JSON"));
    EXPECT_THAT(message("[]"), HasSubstr("it is a array, not an object"));
    EXPECT_THAT(message("{}"), HasSubstr("\"nacre_material\": 1"));
    EXPECT_THAT(message(R"({"nacre_material": 1})"), HasSubstr("root"));
    EXPECT_THAT(message(R"({"nacre_material": 1, "colour": 2})"), HasSubstr("unknown member 'colour'"));
    EXPECT_THAT(root(R"({"slab": {"roughnes": 1}})"), HasSubstr("root.slab"));
    EXPECT_THAT(root(R"({"slab": {"roughnes": 1}})"), HasSubstr("roughness"));
    EXPECT_THAT(root(R"({"slab": {"f0": [1, 2]}})"), HasSubstr("root.slab.f0"));
    EXPECT_THAT(root(R"({"slab": {"f0": "red"}})"), HasSubstr("not a number"));
    EXPECT_THAT(root(R"({"slab": {"f0": 2}})"), HasSubstr("f0 is 2"));
    EXPECT_THAT(root(R"({"slab": {"f0": 1e300}})"), HasSubstr("beyond what a float holds"));
    EXPECT_THAT(root(R"({"slab": {}, "mix": {}})"), HasSubstr("it has 2 members"));
    EXPECT_THAT(root(R"({"mix": {"first": {"slab": {}}, "amount": 1}})"), HasSubstr("it has no 'second'"));
    EXPECT_THAT(root(R"({"layer": {"top": {"slab": {}}}})"), HasSubstr("root.layer"));
    EXPECT_THAT(root(R"({"coverage": {"of": {"slab": {}}}})"), HasSubstr("'amount'"));
    EXPECT_THAT(root(R"({"slab": {"albedo": {"texture": {"image": 0}}}})"), HasSubstr("index below 0"));
    EXPECT_THAT(root(R"({"slab": {"features": ["glitter"]}})"), HasSubstr("'glitter'"));
    std::string deep;
    for (int i = 0; i < 5000; ++i) deep += R"({"coverage": {"amount": 0.5, "of": )";
    deep += R"({"slab": {}})" + std::string(10000, '}');
    EXPECT_THAT(root(deep), HasSubstr("more than 16 operators"));
    EXPECT_THAT(load_material("no such file.json").error().message(), HasSubstr("no such file.json"));
}

// Blocks are nodes like others.
TEST(TreeJson, BuildingBlocksAreNodes) {
    const auto file = parse_material(R"({"nacre_material": 1, "images": ["a.png"], "frames": [{}, {"rotation": 1}],
        "root": {"mix": {"first": {"coated_layer": {"name": "lacquered", "coat_color": [1, 0.5, 0.2], "coat_frame": 1,
                                                    "base": {"slab": {"name": "wood"}}}},
                         "second": {"principled": {"base_color": {"value": [1, 0.5, 0.25], "texture": {"image": 0}},
                                                   "specular": {"value": 0.5, "texture": {"image": 0, "channel": "g"}},
                                                   "roughness": 0.25}},
                         "amount": 0.5}}})",
                                     "blocks.json");
    ASSERT_TRUE(file) << file.error().message();
    const Tree& tree = file->tree;
    EXPECT_EQ(topology_text(tree), "mix(layer(colored coat, wood), dielectric)");
    Tree expected{.name = ""};
    add(expected, Principled{.base_color = {{1.0f, 0.5f, 0.25f}, {.texture = {.image = 0, .sampler = 0}}},
                             .specular = {0.5f, {.texture = {.image = 0, .sampler = 0}, .channel = 1}},
                             .roughness = 0.25f});
    const Node& read = tree.nodes[tree.nodes[tree.root].second];
    EXPECT_EQ(read.slab, expected.nodes[expected.root].slab);
    const auto without_field = [](TextureInput input) {
        input.field.clear();
        return input;
    };
    ASSERT_EQ(read.textures.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(read.textures[i].field, expected.nodes[expected.root].textures[i].field);
        EXPECT_EQ(without_field(read.textures[i]), without_field(expected.nodes[expected.root].textures[i]));
    }
    EXPECT_EQ(tree.nodes[tree.nodes[tree.root].first].name, "lacquered");
    EXPECT_EQ(tree.nodes[tree.nodes[tree.nodes[tree.root].first].first].frame, 1u);
    // Written, it is slabs and operators; read again, the same.
    const auto again = parse_material(material_text(*file), "again.json");
    ASSERT_TRUE(again) << again.error().message();
    EXPECT_EQ(material_text(*again), material_text(*file));
    // Every block with nothing said is a material.
    for (const BuildingBlock& block : building_blocks()) {
        const std::string body = block.has_base ? R"({"base": {"slab": {}}})" : "{}";
        EXPECT_TRUE(
            parse_material(R"({"nacre_material": 1, "root": {")" + std::string(block.name) + "\": " + body + "}}", "m"))
            << block.name;
    }
}

TEST(TreeJson, FaultsInBlocksAreNamed) {
    const auto message = [](std::string_view node) {
        const auto result = parse_material(
            R"({"nacre_material": 1, "images": ["a.png"], "root": )" + std::string(node) + "}", "m.json");
        return result ? std::string("no error") : result.error().message();
    };
    EXPECT_THAT(message(R"({"principle": {}})"), HasSubstr("principled"));
    EXPECT_THAT(message(R"({"principled": {"base_colour": 1}})"), HasSubstr("unknown member 'base_colour'"));
    EXPECT_THAT(message(R"({"principled": {"base_colour": 1}})"), HasSubstr("base_color"));
    EXPECT_THAT(message(R"({"principled": {"metallic": 2}})"),
                HasSubstr("root.principled.metallic: it is 2. It must be in [0, 1]"));
    EXPECT_THAT(message(R"({"principled": {"metallic": [0, 1, 0]}})"), HasSubstr("it has 3 numbers, not 1"));
    EXPECT_THAT(message(R"({"principled": {"anisotropic": {"value": 1, "texture": {"image": 0}}}})"),
                HasSubstr("takes no texture"));
    EXPECT_THAT(message(R"({"principled": {"frame": 1}})"), HasSubstr("index below 1"));
    EXPECT_THAT(message(R"({"coated_layer": {}})"), HasSubstr("it has no 'base'"));
    EXPECT_THAT(message(R"({"standard_surface_opaque": {"transmission_weight": 1}})"),
                HasSubstr("transmission_weight"));
    EXPECT_THAT(message(R"({"standard_surface_opaque": {"specular_weight": {"texture": {"image": 0}},
                                                        "specular_color": {"texture": {"image": 0}}}})"),
                HasSubstr("'f0' has two textures"));
    std::string deep;
    for (int i = 0; i < 3000; ++i) deep += R"({"coated_layer": {"base": )";
    EXPECT_THAT(message(deep + R"({"slab": {}})" + std::string(6000, '}')), HasSubstr("more than 16 operators"));
}

// Cut anywhere, the text is an error and nothing else.
TEST(TreeJson, TruncatedTextIsRefused) {
    const std::string text = lacquer;
    for (std::size_t size = 0; size < text.size(); ++size) EXPECT_FALSE(parse_material(text.substr(0, size), "cut"));
    EXPECT_TRUE(parse_material(text, "whole"));
}

TEST(TreeJson, TheSchemaInTheTreeIsTheOneOfTheFormat) {
    std::ifstream stream(NACRE_SOURCE_DIR "/materials/material.schema.json");
    std::stringstream text;
    text << stream.rdbuf();
    EXPECT_EQ(text.str(), material_schema())
        << "write it anew: nacre material --schema > materials/material.schema.json";
    const auto schema = nlohmann::json::parse(material_schema());
    EXPECT_TRUE(schema["$defs"]["texture"]["required"].is_array());
    const auto& slab = schema["$defs"]["node"]["oneOf"][0]["properties"]["slab"]["properties"];
    for (const SlabField& field : slab_fields()) EXPECT_TRUE(slab.contains(field.name)) << field.name;
    const auto& kinds = schema["$defs"]["node"]["oneOf"];
    for (const BuildingBlock& block : building_blocks()) {
        const auto found =
            std::ranges::find_if(kinds, [&](const auto& kind) { return kind["properties"].contains(block.name); });
        ASSERT_NE(found, kinds.end()) << block.name;
        for (const BlockInput& input : block.inputs)
            EXPECT_TRUE((*found)["properties"][std::string(block.name)]["properties"].contains(input.name))
                << input.name;
    }
}

}  // namespace
}  // namespace nacre::materials
