// SPDX-License-Identifier: Apache-2.0
#include "passes/scene_closures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <cctype>
#include <map>
#include <set>

#include "materials/description_tree.h"
#include "materials/simplification.h"

namespace nacre::passes {
namespace {

using materials::FlattenedTree;
using materials::MaterialDescription;
using materials::StorageClass;
using materials::TextureReference;
using materials::Topology;

/// Whether the model of one plain slab (materials/single_slab.h) is not all that the material says.
bool has_several_lobes(const MaterialDescription& material) {
    if (material.unlit || material.custom) return false;
    if (material.tree) return true;
    return (material.clearcoat && material.clearcoat->factor > 0.0f) ||
           (material.sheen && material.sheen->color != glm::vec3(0.0f)) ||
           (material.anisotropy && material.anisotropy->strength != 0.0f) ||
           (material.iridescence && material.iridescence->factor > 0.0f) ||
           (material.transmission && material.transmission->factor > 0.0f) ||
           (material.diffuse_transmission && material.diffuse_transmission->factor > 0.0f);
}

std::vector<bool> used_materials(const scene::Scene& scene) {
    std::vector<bool> used(scene.materials.size());
    for (const scene::Instance& instance : scene.instances) {
        for (const scene::Primitive& primitive : scene.meshes[instance.mesh].primitives) {
            // Without normals nothing is lit.
            if (!primitive.normals.empty()) used[primitive.material] = true;
        }
    }
    return used;
}

/// Whether some of the light from behind a tree reaches the viewer, as far as its numbers tell.
bool lets_light_through(const FlattenedTree& flat) {
    const materials::ShadedTree shaded = materials::shade(flat, {0.0, 0.0, 1.0});
    const glm::dvec3 covered =
        shaded.whole.coverage * shaded.whole.view_transmittance + glm::dvec3(1.0 - shaded.whole.coverage);
    return std::max({covered.r, covered.g, covered.b}) > 1e-3;
}

/// The GLSL of one material's topology, and the numbers that it reads.
class TextWriter {
  public:
    /// `known_features`: those that shaders with this text know, at least the topology's own.
    TextWriter(const TextureReference& occlusion, ClosureMaterial& material, std::uint32_t known_features = 0)
        : occlusion_(occlusion), material_(material), topology_(material.flat.topology) {
        material.flat.topology.features |= known_features;
    }

    /// What all stages share: from numbers, textures and a place on the surface to what is stored.
    std::string topology() {
        materials::TreeShader tree = materials::tree_shader(material_.flat);
        numbers_ = tree.parameters;
        std::string functions;
        std::swap(text_, functions);
        print("vec4 tree_texture(uint index) {{\n");
        for (std::size_t i = 0; i < tree.textures.size(); ++i) {
            print("    if (index == {}u) return {};\n", i, sample(tree.textures[i].input.texture));
        }
        print("    return vec4(1.0);\n}}\n");
        print_frames();
        print_occlusion();
        std::swap(text_, functions);

        while (numbers_.size() % 4 != 0) numbers_.push_back(0.0f);
        material_.numbers.resize(std::max<std::size_t>(numbers_.size() / 4, 1));
        for (std::size_t i = 0; i < numbers_.size(); ++i) {
            material_.numbers[i / 4][static_cast<glm::length_t>(i % 4)] = numbers_[i];
        }
        defines_ = std::move(tree.defines);
        print("float tree_parameter(uint index) {{ return tree_row(index >> 2u)[index & 3u]; }}\n");
        print_samples();
        text_ += functions;
        text_ += tree.glsl;
        print_closures();
        if (material_.layout.storage_class == StorageClass::simple) {
            print("#define PLAIN_SLAB\nconst uint stored_words = 2u;\n");
        } else {
            text_ += materials::storage_writer(material_.flat, material_.layout);
        }
        print("const bool stored_has_subsurface = {};\n", material_.layout.has_subsurface);
        return std::move(text_);
    }

    /// What a draw's shader includes before: where it finds them. After topology().
    std::string bindings() {
        text_ = defines_;
        if (material_.writes_slices()) print("#define WRITES_SLICES\n");
        print("#define READS_POSITION\n#define TREE_NUMBERS {}\n#include \"passes/shared/draw_tree.glsl\"\n",
              material_.numbers.size());
        print("layout(set = 1, binding = 1) uniform usampler2D interface_texels;\n");
        if (has(materials::slab_medium)) print("layout(set = 1, binding = 2) uniform usampler2D medium_texels;\n");
        if (has(materials::slab_anisotropy))
            print("layout(set = 1, binding = 3) uniform usampler2D anisotropy_texels;\n");
        for (std::size_t i = 0; i < material_.textures.size(); ++i) {
            print("layout(set = 1, binding = {}) uniform sampler2D closure_texture_{};\n", first_material_texture + i,
                  i);
        }
        print("#include \"materials/closures/table_textures.glsl\"\n");
        if (has(materials::slab_specular_lut)) {
            print(
                "layout(set = 1, binding = 4) uniform usampler2D specular_texels;\n"
                "#include \"materials/closures/specular_tables.glsl\"\n");
        }
        print("#ifdef HAS_COLORS\n#define NACRE_TREE_VERTEX_COLOR in_color\n#endif\n");
        if (has(materials::slab_glints)) {
            print(
                "#ifdef HAS_UV0\n#define NACRE_TREE_GLINT_POSITION in_uv0\n#define NACRE_TREE_GLINT_DX dFdx(in_uv0)\n"
                "#define NACRE_TREE_GLINT_DY dFdy(in_uv0)\n#endif\n");
        }
        return std::move(text_);
    }

  private:
    template <typename... Arguments>
    void print(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
        fmt::format_to(std::back_inserter(text_), format, std::forward<Arguments>(arguments)...);
    }

    bool has(std::uint32_t feature) const { return (topology_.features & feature) != 0; }

    /// Index of four numbers of their own in the block.
    std::size_t numbers(const glm::vec4& value) {
        while (numbers_.size() % 4 != 0) numbers_.push_back(0.0f);
        for (int i = 0; i < 4; ++i) numbers_.push_back(value[i]);
        return numbers_.size() / 4 - 1;
    }

    /// A function that reads a texel as the reference says; `without` where a primitive has no such coordinates.
    std::string sample(const TextureReference& reference, const char* without = "vec4(1.0)") {
        const auto known = std::ranges::find(material_.textures, reference);
        const auto index = static_cast<std::size_t>(known - material_.textures.begin());
        if (known == material_.textures.end()) material_.textures.push_back(reference);
        // Several fields may be channels of one texture.
        const auto same = std::ranges::find_if(samples_, [&](const Sample& at) {
            return at.texture == index && std::string_view(at.without) == without;
        });
        if (same != samples_.end()) {
            same->is_shared = true;
            return fmt::format("closure_sample_{}()", same - samples_.begin());
        }
        std::string texel;
        if (reference.transform.is_identity()) {
            texel = fmt::format("closure_texel({}, {})", index, reference.uv_set);
        } else {
            glm::vec4 rows[2];
            write_uv_rows(reference.transform, rows);
            const std::size_t row = numbers(rows[0]);
            numbers(rows[1]);
            texel = fmt::format("closure_texel_moved({}, {}, tree_row({}u), tree_row({}u))", index, reference.uv_set,
                                row, row + 1);
        }
        samples_.push_back({index, static_cast<std::uint32_t>(reference.uv_set), std::move(texel), without});
        return fmt::format("closure_sample_{}()", samples_.size() - 1);
    }

    /// The functions that `sample` told of, and read_shared_texels(), which goes before them: what several fields ask
    /// for is read once.
    void print_samples() {
        std::string reads;
        for (std::size_t i = 0; i < samples_.size(); ++i) {
            const Sample& at = samples_[i];
            if (at.is_shared) {
                print("vec4 shared_texel_{};\n", i);
                reads += fmt::format("#ifdef HAS_UV{0}\n    WHERE_UV{0} shared_texel_{1} = {2};\n#endif\n", at.uv_set,
                                     i, at.texel);
            }
            print(
                "vec4 closure_sample_{0}() {{\n#ifdef HAS_UV{1}\n    WHERE_UV{1} return {2};\n#endif\n"
                "#if !defined(HAS_UV{1}) || defined(NACRE_HITS)\n    return {3};\n#endif\n}}\n",
                i, at.uv_set, at.is_shared ? fmt::format("shared_texel_{}", i) : at.texel, at.without);
        }
        print("void read_shared_texels() {{\n{}}}\n", reads);
    }

    void print_frames() {
        std::string normals, rotations;
        for (std::size_t i = 0; i < topology_.frames.size(); ++i) {
            const materials::TangentFrame& frame = material_.flat.visible_tree.frames[topology_.frames[i]];
            if (frame.normal_texture.present()) {
                material_.needs_tangents = true;
                const std::size_t scale = numbers(glm::vec4(frame.normal_texture.scale));
                normals += fmt::format(
                    "    if (frame == {}u) return ({}.rgb * 2.0 - 1.0) * vec3(tree_row({}u).xx, 1.0);\n", i,
                    sample(frame.normal_texture, "vec4(0.5, 0.5, 1.0, 1.0)"), scale);
            }
            const std::size_t turn = numbers({std::cos(frame.rotation), std::sin(frame.rotation), 0.0f, 0.0f});
            if (frame.rotation_texture.present()) {
                rotations += fmt::format(
                    "    if (frame == {0}u) {{\n        vec2 turn = {1}.rg * 2.0 - 1.0;\n        vec2 by = "
                    "tree_row({2}u).xy;\n        return vec2(turn.x * by.x - turn.y * by.y, turn.x * by.y + turn.y * "
                    "by.x);\n    }}\n",
                    i, sample(frame.rotation_texture, "vec4(1.0, 0.5, 1.0, 1.0)"), turn);
            } else {
                rotations += fmt::format("    if (frame == {}u) return tree_row({}u).xy;\n", i, turn);
            }
        }
        if (has(materials::slab_anisotropy)) material_.needs_tangents = true;
        print("vec3 tree_normal(uint frame) {{\n{}    return vec3(0.0, 0.0, 1.0);\n}}\n", normals);
        print("vec2 tree_rotation(uint frame) {{\n{}    return vec2(1.0, 0.0);\n}}\n", rotations);
    }

    void print_occlusion() {
        const TextureReference& texture = occlusion_;
        if (!texture.present()) {
            print("float tree_occlusion() {{ return 1.0; }}\n");
            return;
        }
        const std::size_t strength = numbers(glm::vec4(std::clamp(texture.scale, 0.0f, 1.0f)));
        print("float tree_occlusion() {{ return 1.0 + tree_row({}u).x * ({}.r - 1.0); }}\n", strength, sample(texture));
    }

    void print_closures() {
        print("uint tree_closure_frame(uint closure) {{\n");
        for (std::size_t i = 0; i < topology_.closures.size(); ++i) {
            const auto slot =
                std::ranges::find(topology_.frames, topology_.closures[i].frame) - topology_.frames.begin();
            if (slot != 0) print("    if (closure == {}u) return {}u;\n", i, slot);
        }
        print("    return 0u;\n}}\nvec3 tree_emission(TreeState state) {{\n    vec3 sum = vec3(0.0);\n");
        for (std::size_t i = 0; i < topology_.closures.size(); ++i) {
            if ((topology_.closures[i].features & materials::slab_emission) == 0) continue;
            print("    sum += state.slabs[{0}].emission * state.paths[{0}].weight * state.coverages[{0}];\n", i);
        }
        print("    return sum;\n}}\n");
    }

    const TextureReference& occlusion_;
    ClosureMaterial& material_;
    const Topology& topology_;
    std::vector<float> numbers_;
    struct Sample {
        std::size_t texture;  ///< Into ClosureMaterial::textures.
        std::uint32_t uv_set;
        std::string texel;
        const char* without;
        bool is_shared = false;  ///< By several fields.
    };
    std::string text_, defines_;
    std::vector<Sample> samples_;
};

/// Names that every topology's text and what is included behind it define: in one shader they need to differ.
std::set<std::string> names_of_topology(const std::string& text) {
    std::set<std::string> names = {"TreeState", "shade_tree", "pack_tree", "stored_words", "stored_top_closure",
                                   "stored_top_frame", "stored_has_subsurface", "SurfaceFrames", "surface_frames",
                                   "stored_frame", "shade_surface", "closure_words", "closure_properties",
                                   "read_shared_texels"};
    const auto is_part = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; };
    for (std::size_t i = 0; i < text.size();) {
        if (!is_part(text[i])) {
            ++i;
            continue;
        }
        const std::size_t start = i;
        while (i < text.size() && is_part(text[i])) ++i;
        std::string name = text.substr(start, i - start);
        // tree_row() is there for all of them.
        if ((name.starts_with("tree_") || name.starts_with("closure_sample_") || name.starts_with("shared_texel_")) &&
            name != "tree_row") {
            names.insert(std::move(name));
        }
    }
    return names;
}

}  // namespace

void write_uv_rows(const materials::TextureTransform& transform, glm::vec4* rows) {
    const float c = std::cos(transform.rotation), s = std::sin(transform.rotation);
    rows[0] = {c * transform.scale.x, s * transform.scale.y, transform.offset.x, 0.0f};
    rows[1] = {-s * transform.scale.x, c * transform.scale.y, transform.offset.y, 0.0f};
}

Expected<SceneClosures> SceneClosures::choose(const scene::Scene& scene, const Profile& profile,
                                              bool storage_in_fragment, std::vector<std::string>& warnings) {
    SceneClosures result;
    const std::vector<bool> used = used_materials(scene);
    result.materials_.resize(scene.materials.size());
    std::map<std::string, std::uint32_t> topologies;
    // Words beyond the color targets need a storage image.
    const std::uint32_t bytes = storage_in_fragment ? profile.material_bytes : std::min(profile.material_bytes, 12u);
    if (!storage_in_fragment && profile.storage_in_fragment && profile.material_bytes > 12) {
        warnings.push_back(
            "the device has no storage images in fragment shaders: materials are simplified to 12 bytes");
    }
    for (std::uint32_t i = 0; i < scene.materials.size(); ++i) {
        const MaterialDescription& description = scene.materials[i];
        if (!used[i] || !has_several_lobes(description)) continue;
        const materials::Tree tree = description.tree ? *description.tree : materials::tree_of(description);
        const std::uint32_t closures = std::min(profile.material_closures, materials::StorageLayout::max_closures);
        NACRE_TRY(const materials::Simplification simple,
                  materials::simplify(tree, {.closures = closures, .bytes = bytes}));
        if (!simple.fits) {
            warnings.push_back(
                fmt::format("material '{}' takes more than the profile's {} bytes even as one plain slab",
                            description.name, bytes));
            continue;
        }
        const materials::SimplificationStep& last = simple.steps.back();
        ClosureMaterial material;
        NACRE_TRY(material.flat, materials::flatten(last.tree, last.flatten));
        if (material.flat.topology.frames.size() > materials::StorageLayout::max_frames) {
            warnings.push_back(
                fmt::format("material '{}' has more than {} tangent frames: it is shaded as one plain slab",
                            description.name, materials::StorageLayout::max_frames));
            continue;
        }
        material.features = material.flat.topology.features;
        material.layout =
            materials::storage_layout(material.flat, {.has_occlusion = description.occlusion_texture.present()});
        material.is_translucent =
            description.alpha_mode == materials::AlphaMode::opaque && lets_light_through(material.flat);
        TextWriter writer(description.occlusion_texture, material);
        std::string text = writer.topology();
        const std::string bindings = writer.bindings();
        const auto [known, is_new] = topologies.emplace(bindings + text, static_cast<std::uint32_t>(topologies.size()));
        material.topology = known->second;
        if (is_new) {
            auto files = std::make_unique<Text>();
            files->topology = std::move(text);
            files->topology_path = fmt::format("passes/closures/topology_{}.glsl", material.topology);
            files->first_material = i;
            files->occlusion = description.occlusion_texture;
            const auto wrap = [&](const char* main) {
                return fmt::format("#version 460\n{}#include \"{}\"\n#include \"{}\"\n", bindings, files->topology_path,
                                   main);
            };
            files->base_pass = wrap("passes/base_pass/base_pass.closures.glsl");
            files->base_pass_path = fmt::format("passes/closures/base_pass_{}.frag", material.topology);
            files->blend = wrap("passes/blend/blend.closures.glsl");
            files->blend_path = fmt::format("passes/closures/blend_{}.frag", material.topology);
            files->points_path = fmt::format("passes/closures/surface_points_{}.frag", material.topology);
            files->emission = wrap("passes/emission/emission.closures.glsl");
            files->emission_path = fmt::format("passes/closures/emission_{}.frag", material.topology);
            result.texts_.push_back(std::move(files));
        }
        for (std::uint32_t table = 0; table < closure_table_count; ++table) {
            if (reads_table(material.features, table)) result.tables_ |= 1u << table;
        }
        const bool is_deferred = !material.is_translucent && description.alpha_mode != materials::AlphaMode::blend;
        if (is_deferred && material.layout.storage_class != StorageClass::simple) {
            Lighting& lighting = result.lighting_;
            for (std::size_t c = 0; c < material.layout.closures.size(); ++c) {
                lighting.features |= material.layout.features[c];
                if (material.layout.media[c] != materials::StoredMedium::opaque)
                    lighting.features |= materials::slab_medium;
                lighting.has_layers |= !material.flat.topology.closures[material.layout.closures[c]].is_top;
            }
            lighting.frames = std::max(lighting.frames, static_cast<std::uint32_t>(material.layout.frames.size()));
            lighting.has_subsurface |= material.layout.has_subsurface;
            lighting.slices = std::max(lighting.slices, material.layout.material_words() - 2);
        }
        result.materials_[i] = std::move(material);
    }
    if (result.lighting_.has_subsurface) ++result.lighting_.slices;
    return result;
}

ShadingFeatures SceneClosures::features_of(const ClosureMaterial& material, const scene::Primitive& primitive,
                                           bool double_sided) {
    ShadingFeatures features;
    features.attributes = attribute_bit(Attribute::position) | attribute_bit(Attribute::normal);
    features.double_sided = double_sided;
    features.points = primitive.topology == scene::Topology::point_list;
    features.thin = primitive.topology != scene::Topology::triangle_list;
    if (features.thin) features.attributes |= attribute_bit(Attribute::corner);
    if (material.needs_tangents && !primitive.tangents.empty())
        features.attributes |= attribute_bit(Attribute::tangent);
    const bool needs_uv0 = (material.features & materials::slab_glints) != 0 ||
                           std::ranges::any_of(material.textures, [](const auto& t) { return t.uv_set == 0; });
    const bool needs_uv1 = std::ranges::any_of(material.textures, [](const auto& t) { return t.uv_set == 1; });
    const bool needs_colors = std::ranges::any_of(
        material.flat.visible_tree.nodes, [](const materials::Node& node) { return !node.vertex_colored.empty(); });
    if (needs_colors && !primitive.colors.empty()) features.attributes |= attribute_bit(Attribute::color);
    if (needs_uv0 && !primitive.uv0.empty()) features.attributes |= attribute_bit(Attribute::uv0);
    if (needs_uv1 && !primitive.uv1.empty()) features.attributes |= attribute_bit(Attribute::uv1);
    return features;
}

std::vector<EmbeddedFile> SceneClosures::files() const {
    std::vector<EmbeddedFile> result;
    static const std::string points = fmt::format(
        "#version 460\n#define MATERIAL_BLOCK_BINDING {}\n#include \"passes/hit_shading/surface_points.glsl\"\n",
        sideband_binding);
    for (const std::unique_ptr<Text>& text : texts_) {
        result.push_back({text->topology_path, text->topology});
        result.push_back({text->base_pass_path, text->base_pass});
        result.push_back({text->blend_path, text->blend});
        result.push_back({text->emission_path, text->emission});
        // The same for all: it writes down places.
        result.push_back({text->points_path, points});
    }
    return result;
}

std::string SceneClosures::hit_text() const {
    std::uint32_t features = 0;
    std::size_t words = 2;
    for (const auto& material : materials_) {
        if (!material) continue;
        features |= material->features;
        if (material->layout.storage_class != StorageClass::simple) {
            words = std::max<std::size_t>(words, material->layout.material_words());
        }
    }
    std::string text;
    for (const materials::SlabFeature& feature : materials::slab_features()) {
        if ((features & feature.bit) != 0) text += fmt::format("#define {} 1\n", feature.macro);
    }
    constexpr const char* tables[closure_table_count] = {"interface", "medium", "anisotropy", "specular"};
    for (std::uint32_t i = 0; i < closure_table_count; ++i) {
        if (reads_table(features, i)) {
            text += fmt::format("layout(set = 2, binding = {}) uniform usampler2D {}_texels;\n", 1 + i, tables[i]);
        }
    }
    text += "#include \"materials/closures/table_textures.glsl\"\n";
    if ((features & materials::slab_specular_lut) != 0) {
        text += "#include \"materials/closures/specular_tables.glsl\"\n";
    }
    text += "#define NACRE_TREE_VERTEX_COLOR in_color\n";
    if ((features & materials::slab_glints) != 0) {
        text +=
            "#define NACRE_TREE_GLINT_POSITION in_uv0\n#if TEXTURE_DETAIL == 0\n#define NACRE_TREE_GLINT_DX in_uv0_dx\n"
            "#define NACRE_TREE_GLINT_DY in_uv0_dy\n#elif TEXTURE_DETAIL == 1\n"
            "#define NACRE_TREE_GLINT_DX vec2(in_uv0_cone, 0.0)\n#define NACRE_TREE_GLINT_DY vec2(0.0, "
            "in_uv0_cone)\n#else\n"
            "#define NACRE_TREE_GLINT_DX vec2(0.0)\n#define NACRE_TREE_GLINT_DY vec2(0.0)\n#endif\n";
    }
    // Before names are changed below.
    text +=
        "#include \"materials/closures/blending.glsl\"\n#include \"materials/closures/stored_fields.glsl\"\n"
        "#include \"materials/closures/stored_frame.glsl\"\n#include \"passes/shared/gbuffer_fields.glsl\"\n";
    text += fmt::format("const uint hit_word_capacity = {}u;\n", words);
    for (std::size_t t = 0; t < texts_.size(); ++t) {
        // A material of the topology, with the fields of slabs that others have.
        ClosureMaterial material = *materials_[texts_[t]->first_material];
        material.textures.clear();
        const std::string topology = TextWriter(texts_[t]->occlusion, material, features).topology();
        const std::set<std::string> names = names_of_topology(topology);
        for (const std::string& name : names) text += fmt::format("#define {0} {0}_t{1}\n", name, t);
        text += topology;
        text +=
            "#undef NACRE_CLOSURE_INPUTS\n#undef NACRE_CLOSURE_WORDS\n#undef NACRE_CLOSURE_PROPERTIES\n"
            "#include \"passes/shared/closure_words.glsl\"\n#include \"passes/shared/closure_properties.glsl\"\n"
            "#undef PLAIN_SLAB\n";
        text += fmt::format(
            "void own_hit_words_t{}(vec3 to_viewer, float footprint, uvec2 pixel, out uint words[hit_word_capacity], "
            "out uint "
            "top_layer, out uint subsurface, out bool has_subsurface) {{\n    uint own[stored_words];\n    "
            "closure_words(to_viewer, footprint, pixel, own, top_layer, subsurface);\n    for (uint i = 0u; i < "
            "hit_word_capacity; ++i) words[i] = i < stored_words ? own[min(i, stored_words - 1u)] : 0u;\n    "
            "has_subsurface = stored_has_subsurface;\n}}\n",
            t);
        for (const std::string& name : names) text += fmt::format("#undef {}\n", name);
    }
    text +=
        "void tree_hit_words(uint topology, vec3 to_viewer, float footprint, uvec2 pixel, out uint "
        "words[hit_word_capacity], out "
        "uint top_layer, out uint subsurface, out bool has_subsurface) {\n    for (uint i = 0u; i < hit_word_capacity; "
        "++i) "
        "words[i] = 0u;\n    top_layer = subsurface = 0u;\n    has_subsurface = false;\n";
    for (std::size_t t = 0; t < texts_.size(); ++t) {
        text += fmt::format(
            "    if (topology == {0}u) own_hit_words_t{0}(to_viewer, footprint, pixel, words, top_layer, subsurface, "
            "has_subsurface);\n",
            t);
    }
    text +=
        "}\nvoid tree_hit_properties(uint topology, vec3 to_viewer, float footprint, out vec3 albedo, out vec3 "
        "emission, out float roughness) {\n    albedo = emission = vec3(0.0);\n    roughness = 1.0;\n";
    for (std::size_t t = 0; t < texts_.size(); ++t) {
        text += fmt::format(
            "    if (topology == {0}u) closure_properties_t{0}(to_viewer, footprint, albedo, emission, roughness);\n",
            t);
    }
    return text + "}\n";
}

std::vector<rhi::ShaderDefine> SceneClosures::lighting_defines() const {
    std::vector<rhi::ShaderDefine> defines = {{"CLOSURES"}, {"NACRE_STORED_FRAMES", std::to_string(lighting_.frames)}};
    for (const materials::SlabFeature& feature : materials::slab_features()) {
        if ((lighting_.features & feature.bit) != 0) defines.push_back({feature.macro});
    }
    if (lighting_.has_layers) defines.push_back({"NACRE_STORED_LAYERS"});
    if (lighting_.slices > 0) defines.push_back({"MATERIAL_SLICES", std::to_string(lighting_.slices)});
    if (lighting_.has_subsurface) defines.push_back({"SUBSURFACE_SLICE", std::to_string(lighting_.slices - 1)});
    return defines;
}

}  // namespace nacre::passes
