// SPDX-License-Identifier: Apache-2.0
#include "materials/tree_json.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/file.h"
#include "core/text_position.h"
#include "materials/building_blocks.h"

namespace nacre::materials {
namespace {

using json = nlohmann::ordered_json;

constexpr std::uint64_t largest_file = std::uint64_t{16} << 20;
constexpr std::string_view channel_names = "rgba";
constexpr std::size_t specular_lut_count = 256;  // stored in 8 bits

class Reader {
  public:
    explicit Reader(std::string_view source) : source_(source) {}

    Expected<MaterialFile> file(const json& document) {
        NACRE_CHECK(
            members(document, "the document",
                    {"$schema", "nacre_material", "name", "thin", "surface_thickness", "images", "frames", "root"}));
        if (!document.contains("nacre_material") || document["nacre_material"] != 1) {
            return refuse("nacre_material", "it must be 1, the version of the format", "Write \"nacre_material\": 1.");
        }
        MaterialFile result;
        if (document.contains("name")) NACRE_CHECK(text(document["name"], "name", result.tree.name));
        if (document.contains("thin")) NACRE_CHECK(boolean(document["thin"], "thin", result.tree.thin));
        if (document.contains("surface_thickness"))
            NACRE_CHECK(number(document["surface_thickness"], "surface_thickness", result.tree.surface_thickness));
        if (document.contains("images")) {
            if (!document["images"].is_array()) return refuse("images", "it is no array", "Write a list of paths.");
            for (const json& image : document["images"]) {
                std::string path;
                NACRE_CHECK(text(image, fmt::format("images[{}]", result.images.size()), path));
                result.images.emplace_back(path);
            }
        }
        images_ = result.images.size();
        if (document.contains("frames")) {
            if (!document["frames"].is_array() || document["frames"].empty())
                return refuse("frames", "it is no list of at least one frame",
                              "Leave it out where all slabs share the surface's.");
            result.tree.frames.clear();
            for (const json& frame : document["frames"]) {
                TangentFrame read;
                NACRE_CHECK(tangent_frame(frame, fmt::format("frames[{}]", result.tree.frames.size()), read));
                result.tree.frames.push_back(read);
            }
        }
        if (!document.contains("root"))
            return refuse("root", "it is missing", "Write the tree's uppermost node there.");
        NACRE_TRY(result.tree.root, node(document["root"], "root", 0, result.tree));
        if (auto valid = validate(result.tree); !valid) {
            Error error = valid.error();
            error.subject = fmt::format("'{}': {}", source_, error.subject);
            return std::unexpected(error);
        }
        return result;
    }

    std::unexpected<Error> refuse(std::string_view place, std::string reason, std::string remedy) const {
        return fail(ErrorCode::parse, "read material", fmt::format("'{}': {}", source_, place), std::move(reason),
                    std::move(remedy));
    }

  private:
    Expected<void> members(const json& value, std::string_view place,
                           std::initializer_list<std::string_view> known) const {
        return members(value, place, std::vector<std::string_view>(known));
    }

    Expected<void> members(const json& value, std::string_view place,
                           const std::vector<std::string_view>& known) const {
        if (!value.is_object())
            return refuse(place, fmt::format("it is a {}, not an object", value.type_name()), "Write {...}.");
        for (const auto& [key, ignored] : value.items()) {
            if (std::ranges::find(known, key) == known.end()) {
                return refuse(place, fmt::format("it has the unknown member '{}'", key),
                              fmt::format("The members are {}.", fmt::join(known, ", ")));
            }
        }
        return {};
    }

    Expected<void> text(const json& value, std::string_view place, std::string& result) const {
        if (!value.is_string())
            return refuse(place, fmt::format("it is a {}, not a text", value.type_name()), "Write \"...\".");
        result = value.get<std::string>();
        return {};
    }

    Expected<void> boolean(const json& value, std::string_view place, bool& result) const {
        if (!value.is_boolean())
            return refuse(place, fmt::format("it is a {}, not a boolean", value.type_name()), "Write true or false.");
        result = value;
        return {};
    }

    Expected<void> number(const json& value, std::string_view place, float& result) const {
        if (value.is_string() && value.get<std::string>() == "infinity") {
            result = std::numeric_limits<float>::infinity();
            return {};
        }
        if (!value.is_number()) {
            return refuse(place, fmt::format("it is a {}, not a number", value.type_name()),
                          "Write a number, or \"infinity\".");
        }
        const double wide = value.get<double>();
        if (std::abs(wide) > std::numeric_limits<float>::max()) {
            return refuse(place, fmt::format("{} is beyond what a float holds", wide),
                          "Write \"infinity\" where that is meant.");
        }
        result = static_cast<float>(wide);
        return {};
    }

    Expected<void> index(const json& value, std::string_view place, std::size_t count, int& result) const {
        if (!value.is_number_integer() || value.get<double>() < 0 ||
            value.get<double>() >= static_cast<double>(count)) {
            return refuse(place, fmt::format("it is {}, not an index below {}", value.dump(), count),
                          "Indices begin at 0.");
        }
        result = value.get<int>();
        return {};
    }

    // The members of a texture that are those of a reference.
    Expected<void> reference(const json& value, const std::string& place, TextureReference& result) const {
        if (!value.contains("image")) return refuse(place, "it has no image", "Write the index of one in 'images'.");
        NACRE_CHECK(index(value["image"], place + ".image", images_, result.image));
        result.sampler = 0;
        if (value.contains("uv_set")) NACRE_CHECK(index(value["uv_set"], place + ".uv_set", 2, result.uv_set));
        const auto pair = [&](const char* name, glm::vec2& target) -> Expected<void> {
            if (!value.contains(name)) return {};
            if (!value[name].is_array() || value[name].size() != 2)
                return refuse(place + "." + name, "it is no pair", "Write [x, y].");
            for (int i = 0; i < 2; ++i)
                NACRE_CHECK(number(value[name][static_cast<std::size_t>(i)], place + "." + name, target[i]));
            return {};
        };
        NACRE_CHECK(pair("uv_offset", result.transform.offset));
        NACRE_CHECK(pair("uv_scale", result.transform.scale));
        if (value.contains("uv_rotation"))
            NACRE_CHECK(number(value["uv_rotation"], place + ".uv_rotation", result.transform.rotation));
        return {};
    }

    Expected<void> tangent_frame(const json& value, const std::string& place, TangentFrame& result) const {
        NACRE_CHECK(members(value, place, {"normal", "rotation", "rotation_texture"}));
        if (value.contains("rotation")) NACRE_CHECK(number(value["rotation"], place + ".rotation", result.rotation));
        if (value.contains("normal")) {
            NACRE_CHECK(members(value["normal"], place + ".normal",
                                {"image", "uv_set", "uv_offset", "uv_scale", "uv_rotation", "strength"}));
            NACRE_CHECK(reference(value["normal"], place + ".normal", result.normal_texture));
            if (value["normal"].contains("strength"))
                NACRE_CHECK(
                    number(value["normal"]["strength"], place + ".normal.strength", result.normal_texture.scale));
        }
        if (value.contains("rotation_texture")) {
            NACRE_CHECK(members(value["rotation_texture"], place + ".rotation_texture",
                                {"image", "uv_set", "uv_offset", "uv_scale", "uv_rotation"}));
            NACRE_CHECK(reference(value["rotation_texture"], place + ".rotation_texture", result.rotation_texture));
        }
        return {};
    }

    // A number, a color, or either under "value" beside a "texture". `set` takes one channel.
    template <typename Set>
    Expected<void> input(const json& value, const std::string& place, std::string_view field, std::uint32_t channels,
                         Node& owner, Set&& set) const {
        const json* constant = &value;
        if (value.is_object()) {
            NACRE_CHECK(members(value, place, {"value", "texture", "vertex_color"}));
            bool colored = false;
            if (value.contains("vertex_color"))
                NACRE_CHECK(boolean(value["vertex_color"], place + ".vertex_color", colored));
            if (colored) owner.vertex_colored.emplace_back(field);
            constant = value.contains("value") ? &value["value"] : nullptr;
            if (value.contains("texture")) {
                const json& texture = value["texture"];
                const std::string at = place + ".texture";
                NACRE_CHECK(members(
                    texture, at,
                    {"image", "uv_set", "uv_offset", "uv_scale", "uv_rotation", "channel", "scale", "bias", "gray"}));
                TextureInput read{.field = std::string(field)};
                NACRE_CHECK(reference(texture, at, read.texture));
                if (texture.contains("channel")) {
                    std::string name;
                    NACRE_CHECK(text(texture["channel"], at + ".channel", name));
                    const std::size_t found = name.size() == 1 ? channel_names.find(name) : std::string_view::npos;
                    if (found == std::string_view::npos)
                        return refuse(at + ".channel", fmt::format("it is '{}'", name), "Write r, g, b or a.");
                    read.channel = static_cast<std::uint32_t>(found);
                }
                if (texture.contains("scale")) NACRE_CHECK(number(texture["scale"], at + ".scale", read.scale));
                if (texture.contains("bias")) NACRE_CHECK(number(texture["bias"], at + ".bias", read.bias));
                if (texture.contains("gray")) NACRE_CHECK(boolean(texture["gray"], at + ".gray", read.gray));
                owner.textures.push_back(read);
            }
            if (constant == nullptr) return {};
        }
        if (constant->is_array()) {
            if (constant->size() != channels) {
                return refuse(
                    place, fmt::format("it has {} numbers, not {}", constant->size(), channels),
                    channels == 1 ? "Write one number." : "Write one number for all channels, or [red, green, blue].");
            }
            for (std::uint32_t channel = 0; channel < channels; ++channel) {
                float read = 0.0f;
                NACRE_CHECK(number((*constant)[channel], fmt::format("{}[{}]", place, channel), read));
                set(channel, read);
            }
            return {};
        }
        float read = 0.0f;
        NACRE_CHECK(number(*constant, place, read));
        for (std::uint32_t channel = 0; channel < channels; ++channel) set(channel, read);
        return {};
    }

    Expected<NodeIndex> slab(const json& value, const std::string& place, Tree& tree) const {
        std::vector<std::string_view> known{"name", "frame", "features", "specular_lut"};
        for (const SlabField& field : slab_fields()) known.emplace_back(field.name);
        NACRE_CHECK(members(value, place, known));
        Node read;
        if (value.contains("name")) NACRE_CHECK(text(value["name"], place + ".name", read.name));
        if (value.contains("frame")) {
            int frame = 0;
            NACRE_CHECK(index(value["frame"], place + ".frame", tree.frames.size(), frame));
            read.frame = static_cast<std::uint32_t>(frame);
        }
        if (value.contains("features")) {
            if (!value["features"].is_array())
                return refuse(place + ".features", "it is no list", "Write a list of names.");
            for (const json& item : value["features"]) {
                std::string name;
                NACRE_CHECK(text(item, place + ".features", name));
                std::vector<std::string_view> names;
                for (const SlabFeature& feature : slab_features()) {
                    names.emplace_back(feature.name);
                    if (name == feature.name) read.slab.features |= feature.bit;
                }
                if (std::ranges::find(names, name) == names.end()) {
                    return refuse(place + ".features", fmt::format("there is no feature '{}'", name),
                                  fmt::format("The features are {}.", fmt::join(names, ", ")));
                }
            }
        }
        if (value.contains("specular_lut")) {
            int table = 0;
            NACRE_CHECK(index(value["specular_lut"], place + ".specular_lut", specular_lut_count, table));
            read.slab.features |= slab_specular_lut;
            read.slab.specular_lut = static_cast<std::uint32_t>(table);
        }
        for (const SlabField& field : slab_fields()) {
            if (!value.contains(field.name)) continue;
            read.slab.features |= field.feature;
            NACRE_CHECK(input(value[field.name], fmt::format("{}.{}", place, field.name), field.name, field.channels,
                              read,
                              [&](std::uint32_t channel, float number) { field.set(read.slab, channel, number); }));
        }
        tree.nodes.push_back(std::move(read));
        return static_cast<NodeIndex>(tree.nodes.size() - 1);
    }

    Expected<void> range(float value, float minimum, float maximum, std::string_view place) const {
        if (value >= minimum && value <= maximum) return {};
        return refuse(place, fmt::format("it is {}", value), fmt::format("It must be in [{}, {}].", minimum, maximum));
    }

    Expected<NodeIndex> block(const BuildingBlock& kind, const json& value, const std::string& place,
                              std::uint32_t depth, Tree& tree) const {
        std::vector<std::string_view> known{"name"};
        if (kind.has_base) known.emplace_back("base");
        for (const BlockInput& item : kind.inputs) known.emplace_back(item.name);
        NACRE_CHECK(members(value, place, known));
        std::vector<BlockValue> values = kind.defaults;
        for (std::size_t i = 0; i < values.size(); ++i) {
            const BlockInput& item = kind.inputs[i];
            const std::string name(item.name), at = place + "." + name;
            if (!value.contains(name)) continue;
            const json& given = value[name];
            if (item.kind == BlockInputKind::frame) {
                int frame = 0;
                NACRE_CHECK(index(given, at, tree.frames.size(), frame));
                values[i].frame = static_cast<std::uint32_t>(frame);
                continue;
            }
            if (given.is_object() && given.contains("texture") && !item.takes_texture) {
                return refuse(at, "it takes no texture: no input of a slab is in proportion to it",
                              "Write a number, or build the material of slabs.");
            }
            if (given.is_object() && given.contains("vertex_color")) {
                return refuse(at, "blocks have no vertex colors", "Leave it out, or build the material of slabs.");
            }
            const std::uint32_t channels = item.kind == BlockInputKind::color ? 3 : 1;
            Node read;
            NACRE_CHECK(input(given, at, name, channels, read, [&](std::uint32_t channel, float number) {
                values[i].value[static_cast<int>(channel)] = number;
            }));
            for (std::uint32_t channel = 0; channel < channels; ++channel)
                NACRE_CHECK(range(values[i].value[static_cast<int>(channel)], item.minimum, item.maximum, at));
            if (!read.textures.empty()) values[i].texture = read.textures.front();
        }
        NodeIndex base = 0;
        if (kind.has_base) {
            if (!value.contains("base")) return refuse(place, "it has no 'base'", "Write the node there.");
            NACRE_TRY(base, node(value["base"], place + ".base", depth + 1, tree));
        }
        const NodeIndex result = kind.add(tree, values, base);
        if (value.contains("name")) NACRE_CHECK(text(value["name"], place + ".name", tree.nodes[result].name));
        return result;
    }

    Expected<NodeIndex> node(const json& value, const std::string& place, std::uint32_t depth, Tree& tree) const {
        std::vector<std::string_view> kinds{"slab", "mix", "layer", "coverage"};
        for (const BuildingBlock& known : building_blocks()) kinds.emplace_back(known.name);
        NACRE_CHECK(members(value, place, kinds));
        if (value.size() != 1) {
            return refuse(place, fmt::format("it has {} members", value.size()),
                          fmt::format("A node has one: {}.", fmt::join(kinds, ", ")));
        }
        const std::string kind = value.begin().key();
        const json& body = value.begin().value();
        const std::string at = place + "." + kind;
        if (kind == "slab") return slab(body, at, tree);
        if (depth >= max_tree_depth) {
            return refuse(place, fmt::format("more than {} operators lie above it", max_tree_depth),
                          "Arrange the operators in a flatter tree.");
        }
        if (const BuildingBlock* known = find_building_block(kind)) return block(*known, body, at, depth, tree);
        Node read;
        const auto child = [&](const char* name) -> Expected<NodeIndex> {
            if (!body.contains(name)) return refuse(at, fmt::format("it has no '{}'", name), "Write the node there.");
            return node(body[name], at + "." + name, depth + 1, tree);
        };
        if (kind == "layer") {
            read.kind = NodeKind::layer;
            NACRE_CHECK(members(body, at, {"name", "top", "base", "thickness", "parameter_blend"}));
            if (body.contains("thickness")) NACRE_CHECK(number(body["thickness"], at + ".thickness", read.thickness));
            NACRE_TRY(read.first, child("top"));
            NACRE_TRY(read.second, child("base"));
        } else {
            read.kind = kind == "mix" ? NodeKind::mix : NodeKind::coverage;
            const bool is_mix = read.kind == NodeKind::mix;
            NACRE_CHECK(is_mix ? members(body, at, {"name", "first", "second", "amount", "parameter_blend"})
                               : members(body, at, {"name", "of", "amount"}));
            read.amount = 1.0f;
            if (!body.contains("amount"))
                return refuse(at, "it has no 'amount'", "Write a number in [0, 1], or a texture.");
            NACRE_CHECK(input(body["amount"], at + ".amount", "amount", 1, read,
                              [&](std::uint32_t, float number) { read.amount = number; }));
            NACRE_TRY(read.first, child(is_mix ? "first" : "of"));
            if (is_mix) {
                NACRE_TRY(read.second, child("second"));
            }
        }
        if (body.contains("name")) NACRE_CHECK(text(body["name"], at + ".name", read.name));
        if (body.contains("parameter_blend"))
            NACRE_CHECK(boolean(body["parameter_blend"], at + ".parameter_blend", read.parameter_blend));
        tree.nodes.push_back(std::move(read));
        return static_cast<NodeIndex>(tree.nodes.size() - 1);
    }

    std::string_view source_;
    std::size_t images_ = 0;
};

// The shortest decimal that reads back to the same float.
json number_json(float value) {
    if (std::isinf(value)) return "infinity";
    return std::strtod(fmt::format("{}", value).c_str(), nullptr);
}

json reference_json(const TextureReference& reference) {
    json result{{"image", reference.image}};
    if (reference.uv_set != 0) result["uv_set"] = reference.uv_set;
    const TextureTransform plain;
    if (reference.transform.offset != plain.offset)
        result["uv_offset"] = {number_json(reference.transform.offset.x), number_json(reference.transform.offset.y)};
    if (reference.transform.scale != plain.scale)
        result["uv_scale"] = {number_json(reference.transform.scale.x), number_json(reference.transform.scale.y)};
    if (reference.transform.rotation != 0.0f) result["uv_rotation"] = number_json(reference.transform.rotation);
    return result;
}

const TextureInput* texture_of(const Node& node, std::string_view field) {
    const auto found = std::ranges::find(node.textures, field, &TextureInput::field);
    return found == node.textures.end() ? nullptr : &*found;
}

// The constant, or an object with what multiplies it.
json input_json(json constant, const Node& node, std::string_view field) {
    if (!node.varies(field)) return constant;
    json result{{"value", std::move(constant)}};
    if (const TextureInput* input = texture_of(node, field)) {
        json texture = reference_json(input->texture);
        if (input->channel != 0) texture["channel"] = std::string(1, channel_names[input->channel]);
        if (input->scale != 1.0f) texture["scale"] = number_json(input->scale);
        if (input->bias != 0.0f) texture["bias"] = number_json(input->bias);
        if (input->gray) texture["gray"] = true;
        result["texture"] = std::move(texture);
    }
    if (std::ranges::find(node.vertex_colored, field) != node.vertex_colored.end()) result["vertex_color"] = true;
    return result;
}

json slab_json(const Node& node) {
    const Slab plain;
    json result = json::object();
    if (!node.name.empty()) result["name"] = node.name;
    if (node.frame != 0) result["frame"] = node.frame;
    std::uint32_t shown = 0;
    if ((node.slab.features & slab_specular_lut) != 0 && node.slab.specular_lut != 0) {
        result["specular_lut"] = node.slab.specular_lut;
        shown |= slab_specular_lut;
    }
    json fields = json::object();
    for (const SlabField& field : slab_fields()) {
        if (field.feature != 0 && (node.slab.features & field.feature) == 0) continue;
        bool is_plain = !node.varies(field.name), is_gray = true;
        for (std::uint32_t channel = 0; channel < field.channels; ++channel) {
            is_plain &= field.get(node.slab, channel) == field.get(plain, channel);
            is_gray &= field.get(node.slab, channel) == field.get(node.slab, 0);
        }
        if (is_plain) continue;
        shown |= field.feature;
        json constant = number_json(field.get(node.slab, 0));
        if (!is_gray) {
            constant = json::array();
            for (std::uint32_t channel = 0; channel < field.channels; ++channel)
                constant.push_back(number_json(field.get(node.slab, channel)));
        }
        fields[field.name] = input_json(std::move(constant), node, field.name);
    }
    json features = json::array();
    for (const SlabFeature& feature : slab_features()) {
        if ((node.slab.features & feature.bit) != 0 && (shown & feature.bit) == 0) features.push_back(feature.name);
    }
    if (!features.empty()) result["features"] = std::move(features);
    result.update(fields);
    return result;
}

json node_json(const Tree& tree, NodeIndex index) {
    const Node& node = tree.nodes[index];
    json body = json::object();
    if (node.kind == NodeKind::slab) return json{{"slab", slab_json(node)}};
    if (!node.name.empty()) body["name"] = node.name;
    switch (node.kind) {
        case NodeKind::mix:
            body["first"] = node_json(tree, node.first);
            body["second"] = node_json(tree, node.second);
            body["amount"] = input_json(number_json(node.amount), node, "amount");
            break;
        case NodeKind::layer:
            body["top"] = node_json(tree, node.first);
            body["base"] = node_json(tree, node.second);
            if (node.thickness >= 0.0f) body["thickness"] = number_json(node.thickness);
            break;
        case NodeKind::coverage:
            body["of"] = node_json(tree, node.first);
            body["amount"] = input_json(number_json(node.amount), node, "amount");
            break;
        case NodeKind::slab: break;
    }
    if (node.parameter_blend) body["parameter_blend"] = true;
    return json{{std::string(name_of(node.kind)), std::move(body)}};
}

}  // namespace

Expected<MaterialFile> parse_material(std::string_view text, std::string_view source) {
    const Reader reader(source);
    json document;
    try {
        document = json::parse(text);
    } catch (const json::parse_error& error) {
        // The parser counts bytes from 1.
        const TextPosition at = text_position(text, error.byte > 0 ? error.byte - 1 : 0);
        return reader.refuse(fmt::format("line {}, column {}", at.line, at.column), "the text is no JSON",
                             "See docs/materials.md for the format.");
    }
    return Reader(source).file(document);
}

Expected<MaterialFile> load_material(const std::filesystem::path& path) {
    NACRE_TRY(const std::string text, read_text_file(path, largest_file));
    NACRE_TRY(MaterialFile file, parse_material(text, path.string()));
    for (std::filesystem::path& image : file.images) image = path.parent_path() / image;
    if (file.tree.name.empty()) file.tree.name = path.stem().string();
    return file;
}

std::string material_text(const MaterialFile& file) {
    json result{{"nacre_material", 1}};
    if (!file.tree.name.empty()) result["name"] = file.tree.name;
    if (file.tree.thin) result["thin"] = true;
    if (file.tree.surface_thickness != Tree{}.surface_thickness)
        result["surface_thickness"] = number_json(file.tree.surface_thickness);
    for (const std::filesystem::path& image : file.images) result["images"].push_back(image.generic_string());
    if (file.tree.frames != Tree{}.frames) {
        for (const TangentFrame& frame : file.tree.frames) {
            json entry = json::object();
            if (frame.normal_texture.present()) {
                entry["normal"] = reference_json(frame.normal_texture);
                if (frame.normal_texture.scale != 1.0f)
                    entry["normal"]["strength"] = number_json(frame.normal_texture.scale);
            }
            if (frame.rotation != 0.0f) entry["rotation"] = number_json(frame.rotation);
            if (frame.rotation_texture.present()) entry["rotation_texture"] = reference_json(frame.rotation_texture);
            result["frames"].push_back(std::move(entry));
        }
    }
    result["root"] = node_json(file.tree, file.tree.root);
    return result.dump(2) + "\n";
}

}  // namespace nacre::materials
