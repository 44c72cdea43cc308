// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "materials/building_blocks.h"
#include "materials/tree_json.h"

namespace nacre::materials {
namespace {

using json = nlohmann::ordered_json;

json object_schema(json properties, json required = json::array()) {
    json result{{"type", "object"}, {"properties", std::move(properties)}, {"additionalProperties", false}};
    if (!required.empty()) result["required"] = std::move(required);
    return result;
}

// A number, or a color as one number or three.
json constant_schema(std::uint32_t channels, float minimum, float maximum) {
    json bounded{{"type", "number"}, {"minimum", minimum}};
    if (std::isfinite(maximum)) bounded["maximum"] = maximum;
    json number = std::isfinite(maximum) ? bounded : json{{"oneOf", {bounded, json{{"const", "infinity"}}}}};
    if (channels == 1) return number;
    return json{{"oneOf", {number, json{{"type", "array"}, {"items", number}, {"minItems", 3}, {"maxItems", 3}}}}};
}

}  // namespace

std::string material_schema() {
    const json one{{"oneOf", {json{{"type", "number"}}, json{{"const", "infinity"}}}}};
    json placement{
        {"image", {{"type", "integer"}, {"minimum", 0}}},
        {"uv_set", {{"enum", {0, 1}}}},
        {"uv_offset", {{"type", "array"}, {"items", {{"type", "number"}}}, {"minItems", 2}, {"maxItems", 2}}},
        {"uv_scale", {{"type", "array"}, {"items", {{"type", "number"}}}, {"minItems", 2}, {"maxItems", 2}}},
        {"uv_rotation", {{"type", "number"}, {"description", "radians"}}}};
    json texture = placement, normal = placement;
    texture.update(json{{"channel", {{"enum", {"r", "g", "b", "a"}}}},
                        {"scale", {{"type", "number"}}},
                        {"bias", {{"type", "number"}}},
                        {"gray", {{"type", "boolean"}}}});
    normal["strength"] = json{{"type", "number"}};
    const json texture_ref{{"$ref", "#/$defs/texture"}};
    const auto input = [&](json constant) {
        json with =
            object_schema({{"value", constant}, {"texture", texture_ref}, {"vertex_color", {{"type", "boolean"}}}});
        return json{{"oneOf", {std::move(constant), std::move(with)}}};
    };
    json slab{{"name", {{"type", "string"}}}, {"frame", {{"type", "integer"}, {"minimum", 0}}}};
    json features = json::array();
    for (const SlabFeature& feature : slab_features()) features.push_back(feature.name);
    slab["specular_lut"] = json{{"type", "integer"}, {"minimum", 0}, {"maximum", 255}};
    slab["features"] = json{{"type", "array"}, {"items", {{"enum", features}}}};
    for (const SlabField& field : slab_fields())
        slab[field.name] = input(constant_schema(field.channels, field.minimum, field.maximum));
    const json node{{"$ref", "#/$defs/node"}}, name{{"type", "string"}}, yes{{"type", "boolean"}};
    const json amount = input(json{{"type", "number"}, {"minimum", 0}, {"maximum", 1}});
    const auto only = [](const std::string& kind, json body) {
        json result = object_schema(json::object(), json::array({kind}));
        result["properties"][kind] = std::move(body);
        return result;
    };
    json kinds = json::array();
    kinds.push_back(only("slab", object_schema(std::move(slab))));
    kinds.push_back(only(
        "mix",
        object_schema({{"name", name}, {"first", node}, {"second", node}, {"amount", amount}, {"parameter_blend", yes}},
                      json::array({"first", "second", "amount"}))));
    kinds.push_back(only(
        "layer",
        object_schema({{"name", name}, {"top", node}, {"base", node}, {"thickness", one}, {"parameter_blend", yes}},
                      json::array({"top", "base"}))));
    kinds.push_back(only(
        "coverage", object_schema({{"name", name}, {"of", node}, {"amount", amount}}, json::array({"of", "amount"}))));
    for (const BuildingBlock& block : building_blocks()) {
        json properties{{"name", name}}, required = json::array();
        for (std::size_t i = 0; i < block.inputs.size(); ++i) {
            const BlockInput& item = block.inputs[i];
            json value{{"type", "integer"}, {"minimum", 0}};
            if (item.kind != BlockInputKind::frame) {
                value = constant_schema(item.kind == BlockInputKind::color ? 3 : 1, item.minimum, item.maximum);
                if (item.takes_texture) value = input(std::move(value));
            }
            value["description"] = item.meaning;
            properties[std::string(item.name)] = std::move(value);
        }
        if (block.has_base) {
            properties["base"] = node;
            required.push_back("base");
        }
        json body = object_schema(std::move(properties), std::move(required));
        body["description"] = block.meaning;
        kinds.push_back(only(std::string(block.name), std::move(body)));
    }
    json schema = object_schema(
        {{"$schema", {{"type", "string"}}},
         {"nacre_material", {{"const", 1}}},
         {"name", name},
         {"thin", yes},
         {"surface_thickness", one},
         {"images", {{"type", "array"}, {"items", {{"type", "string"}}}}},
         {"frames",
          {{"type", "array"},
           {"minItems", 1},
           {"items", object_schema({{"normal", object_schema(std::move(normal), json::array({"image"}))},
                                    {"rotation", {{"type", "number"}}},
                                    {"rotation_texture", object_schema(placement, json::array({"image"}))}})}}},
         {"root", node}},
        json::array({"nacre_material", "root"}));
    schema["$defs"] = json{{"node", {{"oneOf", std::move(kinds)}}},
                           {"texture", object_schema(std::move(texture), json::array({"image"}))}};
    json result{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "Material of Nacre"}};
    result.update(schema);
    return result.dump(2) + "\n";
}

}  // namespace nacre::materials
