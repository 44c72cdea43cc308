// SPDX-License-Identifier: Apache-2.0
#include "passes/scene_closures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

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
    if (material.unlit) return false;
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
    const glm::dvec3 covered = shaded.whole.coverage * shaded.whole.view_transmittance + glm::dvec3(1.0 - shaded.whole.coverage);
    return std::max({covered.r, covered.g, covered.b}) > 1e-3;
}

/// The GLSL of one material's topology, and the numbers that it reads.
class TextWriter {
  public:
    TextWriter(const MaterialDescription& description, ClosureMaterial& material)
        : description_(description), material_(material), topology_(material.flat.topology) {}

    std::string run() {
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

        text_ += tree.defines;
        while (numbers_.size() % 4 != 0) numbers_.push_back(0.0f);
        print("layout(set = 1, binding = 0, std140) uniform ClosureBlock {{ vec4 closure_numbers[{}]; }};\n",
              std::max<std::size_t>(numbers_.size() / 4, 1));
        print("layout(set = 1, binding = 1) uniform usampler2D interface_texels;\n");
        if (has(materials::slab_medium)) print("layout(set = 1, binding = 2) uniform usampler2D medium_texels;\n");
        if (has(materials::slab_anisotropy)) print("layout(set = 1, binding = 3) uniform usampler2D anisotropy_texels;\n");
        for (std::size_t i = 0; i < material_.textures.size(); ++i) {
            print("layout(set = 1, binding = {}) uniform sampler2D closure_texture_{};\n", first_closure_texture + i, i);
        }
        print(
            "#include \"passes/shared/fragment_inputs.glsl\"\n#include \"materials/closures/table_textures.glsl\"\n"
            "layout(location = 5) in vec3 in_position;\n"
            "float tree_parameter(uint index) {{ return closure_numbers[index >> 2u][index & 3u]; }}\n");
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
        text_ += samples_ + functions;
        text_ += tree.glsl;
        print_closures();
        if (material_.layout.storage_class == StorageClass::simple) {
            print("#define PLAIN_SLAB\n");
        } else {
            text_ += materials::storage_writer(material_.flat, material_.layout);
            print("const bool stored_has_subsurface = {};\n", material_.layout.has_subsurface);
            if (material_.writes_slices()) print("#define WRITES_SLICES\n");
        }
        material_.numbers.resize(std::max<std::size_t>(numbers_.size() / 4, 1));
        for (std::size_t i = 0; i < numbers_.size(); ++i) {
            material_.numbers[i / 4][static_cast<glm::length_t>(i % 4)] = numbers_[i];
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
        std::string uv = fmt::format("in_uv{}", reference.uv_set);
        if (!reference.transform.is_identity()) {
            const materials::TextureTransform& t = reference.transform;
            const float c = std::cos(t.rotation), s = std::sin(t.rotation);
            const std::size_t row = numbers({c * t.scale.x, s * t.scale.y, t.offset.x, 0.0f});
            numbers({-s * t.scale.x, c * t.scale.y, t.offset.y, 0.0f});
            uv = fmt::format("vec2(dot(closure_numbers[{0}].xyz, vec3({2}, 1.0)), dot(closure_numbers[{1}].xyz, vec3({2}, 1.0)))",
                             row, row + 1, uv);
        }
        samples_ += fmt::format(
            "vec4 closure_sample_{0}() {{\n#ifdef HAS_UV{1}\n    return texture(closure_texture_{2}, {3});\n#else\n    return "
            "{4};\n#endif\n}}\n",
            sample_count_, reference.uv_set, index, uv, without);
        return fmt::format("closure_sample_{}()", sample_count_++);
    }

    void print_frames() {
        std::string normals, rotations;
        for (std::size_t i = 0; i < topology_.frames.size(); ++i) {
            const materials::TangentFrame& frame = material_.flat.visible_tree.frames[topology_.frames[i]];
            if (frame.normal_texture.present()) {
                material_.needs_tangents = true;
                const std::size_t scale = numbers(glm::vec4(frame.normal_texture.scale));
                normals += fmt::format(
                    "    if (frame == {}u) return ({}.rgb * 2.0 - 1.0) * vec3(closure_numbers[{}].xx, 1.0);\n", i,
                    sample(frame.normal_texture, "vec4(0.5, 0.5, 1.0, 1.0)"), scale);
            }
            const std::size_t turn = numbers({std::cos(frame.rotation), std::sin(frame.rotation), 0.0f, 0.0f});
            if (frame.rotation_texture.present()) {
                rotations += fmt::format(
                    "    if (frame == {0}u) {{\n        vec2 turn = {1}.rg * 2.0 - 1.0;\n        vec2 by = "
                    "closure_numbers[{2}].xy;\n        return vec2(turn.x * by.x - turn.y * by.y, turn.x * by.y + turn.y * "
                    "by.x);\n    }}\n",
                    i, sample(frame.rotation_texture, "vec4(1.0, 0.5, 1.0, 1.0)"), turn);
            } else {
                rotations += fmt::format("    if (frame == {}u) return closure_numbers[{}].xy;\n", i, turn);
            }
        }
        if (has(materials::slab_anisotropy)) material_.needs_tangents = true;
        print("vec3 tree_normal(uint frame) {{\n{}    return vec3(0.0, 0.0, 1.0);\n}}\n", normals);
        print("vec2 tree_rotation(uint frame) {{\n{}    return vec2(1.0, 0.0);\n}}\n", rotations);
    }

    void print_occlusion() {
        const TextureReference& texture = description_.occlusion_texture;
        if (!texture.present()) {
            print("float tree_occlusion() {{ return 1.0; }}\n");
            return;
        }
        const std::size_t strength = numbers(glm::vec4(std::clamp(texture.scale, 0.0f, 1.0f)));
        print("float tree_occlusion() {{ return 1.0 + closure_numbers[{}].x * ({}.r - 1.0); }}\n", strength, sample(texture));
    }

    void print_closures() {
        print("uint tree_closure_frame(uint closure) {{\n");
        for (std::size_t i = 0; i < topology_.closures.size(); ++i) {
            const auto slot = std::ranges::find(topology_.frames, topology_.closures[i].frame) - topology_.frames.begin();
            if (slot != 0) print("    if (closure == {}u) return {}u;\n", i, slot);
        }
        print("    return 0u;\n}}\nvec3 tree_emission(TreeState state) {{\n    vec3 sum = vec3(0.0);\n");
        for (std::size_t i = 0; i < topology_.closures.size(); ++i) {
            if ((topology_.closures[i].features & materials::slab_emission) == 0) continue;
            print("    sum += state.slabs[{0}].emission * state.paths[{0}].weight * state.coverages[{0}];\n", i);
        }
        print("    return sum;\n}}\n");
    }

    const MaterialDescription& description_;
    ClosureMaterial& material_;
    const Topology& topology_;
    std::vector<float> numbers_;
    std::string text_, samples_;
    std::uint32_t sample_count_ = 0;
};

}  // namespace

Expected<SceneClosures> SceneClosures::choose(const scene::Scene& scene, const Profile& profile, bool storage_in_fragment,
                                              std::vector<std::string>& warnings) {
    SceneClosures result;
    const std::vector<bool> used = used_materials(scene);
    result.materials_.resize(scene.materials.size());
    std::map<std::string, std::uint32_t> topologies;
    // Words beyond the color targets need a storage image.
    const std::uint32_t bytes = storage_in_fragment ? profile.material_bytes : std::min(profile.material_bytes, 12u);
    if (!storage_in_fragment && profile.storage_in_fragment && profile.material_bytes > 12) {
        warnings.push_back("the device has no storage images in fragment shaders: materials are simplified to 12 bytes");
    }
    for (std::uint32_t i = 0; i < scene.materials.size(); ++i) {
        const MaterialDescription& description = scene.materials[i];
        if (!used[i] || !has_several_lobes(description)) continue;
        const materials::Tree tree = description.tree ? *description.tree : materials::tree_of(description);
        const std::uint32_t closures = std::min(profile.material_closures, materials::StorageLayout::max_closures);
        NACRE_TRY(const materials::Simplification simple, materials::simplify(tree, {.closures = closures, .bytes = bytes}));
        if (!simple.fits) {
            warnings.push_back(fmt::format("material '{}' takes more than the profile's {} bytes even as one plain slab",
                                           description.name, bytes));
            continue;
        }
        const materials::SimplificationStep& last = simple.steps.back();
        ClosureMaterial material;
        NACRE_TRY(material.flat, materials::flatten(last.tree, last.flatten));
        if (material.flat.topology.frames.size() > materials::StorageLayout::max_frames) {
            warnings.push_back(fmt::format("material '{}' has more than {} tangent frames: it is shaded as one plain slab",
                                           description.name, materials::StorageLayout::max_frames));
            continue;
        }
        material.features = material.flat.topology.features;
        material.layout =
            materials::storage_layout(material.flat, {.has_occlusion = description.occlusion_texture.present()});
        material.is_translucent =
            description.alpha_mode == materials::AlphaMode::opaque && lets_light_through(material.flat);
        std::string text = TextWriter(description, material).run();
        const auto [known, is_new] = topologies.emplace(std::move(text), static_cast<std::uint32_t>(topologies.size()));
        material.topology = known->second;
        if (is_new) {
            auto files = std::make_unique<Text>();
            files->topology = known->first;
            files->topology_path = fmt::format("passes/closures/topology_{}.glsl", material.topology);
            const auto wrap = [&](const char* main) {
                return fmt::format("#version 460\n#include \"{}\"\n#include \"{}\"\n", files->topology_path, main);
            };
            files->base_pass = wrap("passes/base_pass/base_pass.closures.glsl");
            files->base_pass_path = fmt::format("passes/closures/base_pass_{}.frag", material.topology);
            files->blend = wrap("passes/blend/blend.closures.glsl");
            files->blend_path = fmt::format("passes/closures/blend_{}.frag", material.topology);
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
                if (material.layout.media[c] != materials::StoredMedium::opaque) lighting.features |= materials::slab_medium;
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
    if (material.needs_tangents && !primitive.tangents.empty()) features.attributes |= attribute_bit(Attribute::tangent);
    const bool needs_uv0 = (material.features & materials::slab_glints) != 0 ||
                           std::ranges::any_of(material.textures, [](const auto& t) { return t.uv_set == 0; });
    const bool needs_uv1 = std::ranges::any_of(material.textures, [](const auto& t) { return t.uv_set == 1; });
    const bool needs_colors = std::ranges::any_of(material.flat.visible_tree.nodes,
                                                  [](const materials::Node& node) { return !node.vertex_colored.empty(); });
    if (needs_colors && !primitive.colors.empty()) features.attributes |= attribute_bit(Attribute::color);
    if (needs_uv0 && !primitive.uv0.empty()) features.attributes |= attribute_bit(Attribute::uv0);
    if (needs_uv1 && !primitive.uv1.empty()) features.attributes |= attribute_bit(Attribute::uv1);
    return features;
}

std::vector<EmbeddedFile> SceneClosures::files() const {
    std::vector<EmbeddedFile> result;
    for (const std::unique_ptr<Text>& text : texts_) {
        result.push_back({text->topology_path, text->topology});
        result.push_back({text->base_pass_path, text->base_pass});
        result.push_back({text->blend_path, text->blend});
        result.push_back({text->emission_path, text->emission});
    }
    return result;
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
