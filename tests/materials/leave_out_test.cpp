// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "materials/builtin_materials.h"
#include "materials/simplification.h"
#include "materials/storage_shader.h"
#include "materials/tree_shader.h"
#include "rhi/shader_compiler.h"

namespace nacre::materials {
namespace {

// The files of the closures in which the code of one feature is an error.
class SourcesWithout {
  public:
    explicit SourcesWithout(const std::string& macro) {
        for (const std::span<const EmbeddedFile> files : {embedded_files(), storage_reader_files()}) {
            for (const EmbeddedFile& file : files) {
                std::string text(file.text);
                const std::string condition = "#ifdef " + macro + "\n";
                for (std::size_t at = text.find(condition); at != std::string::npos;
                     at = text.find(condition, at + 1)) {
                    text.insert(at + condition.size(), "#error this feature does not exist\n");
                    ++places_;
                }
                texts_.push_back(std::move(text));
                paths_.emplace_back(file.path);
            }
        }
        for (std::size_t i = 0; i < texts_.size(); ++i) files_.push_back({paths_[i], texts_[i]});
    }
    [[nodiscard]] std::span<const EmbeddedFile> files() const { return files_; }
    [[nodiscard]] int places() const { return places_; }

  private:
    std::vector<std::string> texts_, paths_;
    std::vector<EmbeddedFile> files_;
    int places_ = 0;
};

// A shader that shades, stores and reads back a material, as the passes of a renderer do.
std::string shader_of(const FlattenedTree& flat) {
    const StorageLayout layout = storage_layout(flat);
    const TreeShader tree = tree_shader(flat);
    std::string text = tree.defines + fmt::format("#define NACRE_STORED_FRAMES {}\n#define NACRE_STORED_LAYERS\n",
                                                  layout.frames.empty() ? 1 : layout.frames.size());
    text += R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 0, std430) buffer Words { uint words[]; };
layout(set = 0, binding = 1, std430) readonly buffer InterfaceTable { uint interface_words[]; };
layout(set = 0, binding = 2, std430) readonly buffer MediumTable { uint medium_words[]; };
layout(set = 0, binding = 3, std430) readonly buffer AnisotropyTable { uint anisotropy_words[]; };
#include "materials/closures/table_buffers.glsl"
float tree_parameter(uint index) { return uintBitsToFloat(words[index]); }
vec4 tree_texture(uint index) { return vec4(1.0); }
#ifdef NACRE_SLAB_SPECULAR_LUT
vec3 specular_lut(uint index, vec2 at) { return vec3(1.0); }
#endif
uint material_word(uint index) { return words[index]; }
)";
    text += tree.glsl;
    if (layout.storage_class != StorageClass::simple) text += storage_writer(flat, layout);
    text += R"(
#include "materials/closures/stored_closures.glsl"
void main() {
    vec3 views[tree_frame_count];
    for (uint i = 0u; i < tree_frame_count; ++i) views[i] = vec3(0.0, 0.0, 1.0);
    TreeState state = shade_tree(views, 1e-3);
    words[0] = floatBitsToUint(tree_reflected(state, views, views, 1e-3).x);
    StoredHeader header = read_stored_header(vec3(0.0, 0.0, 1.0));
    StoredClosure closure = read_stored_closure(header, 0u, 0.5, 0u);
    words[1] = floatBitsToUint(evaluate_closure(prepare_closure(closure.slab, views[0], 1e-3), views[0]).specular.x);
})";
    return text;
}

// With a feature's GLSL replaced by an error, each material that does not use it compiles to the same bytes.
TEST(MaterialLeaveOut, AFeatureThatIsNotUsedLeavesNoTrace) {
    rhi::ShaderCompiler whole({.embedded = {embedded_files(), storage_reader_files()}, .debug_information = false});
    struct Compiled {
        std::string name, text;
        std::uint32_t features;
        std::vector<std::uint32_t> spirv;
    };
    std::vector<Compiled> materials;
    for (const char* name : {"simple", "single-haze-f90", "single-fuzz", "silks-under-plastic", "gold"}) {
        const auto flat = flatten(*make_builtin_material(name));
        ASSERT_TRUE(flat);
        Compiled compiled{.name = std::string(name), .text = shader_of(*flat), .features = flat->topology.features};
        const auto shader = whole.compile({.path = "material.comp", .text = compiled.text});
        ASSERT_TRUE(shader) << shader.error().message();
        compiled.spirv = shader->spirv;
        materials.push_back(std::move(compiled));
    }
    for (const SlabFeature& feature : slab_features()) {
        SCOPED_TRACE(feature.name);
        const SourcesWithout sources(feature.macro);
        EXPECT_GT(sources.places(), 0);
        rhi::ShaderCompiler compiler({.embedded = {sources.files()}, .debug_information = false});
        for (const Compiled& material : materials) {
            const auto shader = compiler.compile({.path = "material.comp", .text = material.text});
            if ((material.features & feature.bit) != 0) {
                EXPECT_FALSE(shader) << material.name << " uses what is not there";
                continue;
            }
            ASSERT_TRUE(shader) << material.name << ": " << shader.error().message();
            EXPECT_EQ(shader->spirv, material.spirv) << material.name;
        }
    }
}

}  // namespace
}  // namespace nacre::materials
