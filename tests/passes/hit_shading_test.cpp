// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "materials/builtin_materials.h"
#include "materials/custom_material.h"
#include "materials/evaluation.h"
#include "passes/gbuffer_layout.h"
#include "passes/hit_materials.h"
#include "passes/shader_library.h"
#include "scene/shapes.h"
#include "scene/tangents.h"
#include "tests/passes/renderer_test.h"

// Shading from blobs in a compute shader, against the base pass that drew the same places.
namespace nacre::test {
namespace {

RENDERER_SUITE_OF(HitShading, compiler_variants());

constexpr std::uint32_t side = 64;

scene::Primitive ball() {
    scene::Primitive result = scene::sphere(0.9f, 64, 32);
    const std::vector<glm::vec2> uv = result.uv0;
    scene::add_tangents(result, uv);
    result.uv1 = uv;
    for (glm::vec2& at : result.uv1) at = 3.0f * at + glm::vec2(0.25f, 0.5f);
    for (const glm::vec3& position : result.positions) {
        result.colors.push_back(glm::vec4(0.5f + 0.5f * position, 1.0f));
    }
    return result;
}

/// Random texels; normal maps point roughly along z.
int add_noise(scene::Scene& scene, scene::ColorSpace color_space, bool normals = false) {
    scene::Image image{.name = "noise", .color_space = color_space, .width = 16, .height = 16};
    std::mt19937 random(static_cast<std::uint32_t>(scene.images.size()) + 1);
    std::vector<std::uint8_t> pixels(16 * 16 * 4);
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(random());
    for (std::size_t i = 0; normals && i < pixels.size(); i += 4) {
        pixels[i] = static_cast<std::uint8_t>(96 + random() % 64);
        pixels[i + 1] = static_cast<std::uint8_t>(96 + random() % 64);
        pixels[i + 2] = 230;
    }
    image.pixels = std::make_shared<std::vector<std::uint8_t>>(std::move(pixels));
    scene.images.push_back(image);
    return static_cast<int>(scene.images.size()) - 1;
}

int add_sampler(scene::Scene& scene, scene::MipFilter mip) {
    scene.samplers.push_back({.mip = mip});
    return static_cast<int>(scene.samplers.size()) - 1;
}

/// A plain slab that reads all seven textures.
materials::MaterialDescription textured(scene::Scene& scene, int sampler) {
    materials::MaterialDescription material{.name = "textured"};
    const auto texture = [&](scene::ColorSpace space, int uv_set, bool normals = false) {
        return materials::TextureReference{
            .image = add_noise(scene, space, normals), .sampler = sampler, .uv_set = uv_set};
    };
    material.base_color = {0.9f, 0.7f, 0.5f, 1.0f};
    material.base_color_texture = texture(scene::ColorSpace::srgb, 0);
    material.metallic_roughness_texture = texture(scene::ColorSpace::linear, 1);
    material.normal_texture = texture(scene::ColorSpace::linear, 0, true);
    material.normal_texture.scale = 0.7f;
    material.occlusion_texture = texture(scene::ColorSpace::linear, 1);
    material.occlusion_texture.scale = 0.6f;
    material.emissive = {3.0f, 2.0f, 1.0f};
    material.emissive_texture = texture(scene::ColorSpace::srgb, 0);
    material.specular = materials::Specular{.factor = 0.8f, .color = {0.9f, 1.0f, 0.7f}};
    material.specular->texture = texture(scene::ColorSpace::linear, 0);
    material.specular->color_texture = texture(scene::ColorSpace::srgb, 1);
    return material;
}

materials::MaterialDescription built_in(std::string_view name) {
    materials::MaterialDescription material{.name = std::string(name)};
    material.tree = std::make_shared<const materials::Tree>(*materials::make_builtin_material(name));
    return material;
}

/// Checks that 128 bytes and a place are all that shading needs: words of the compute shader are those of the base
/// pass.
class Comparison {
  public:
    explicit Comparison(const Shot& shot) : shot_(shot) {}

    template <typename T>
    std::vector<T> hits(const char* name, std::uint32_t layer = 0) const {
        const auto content = shot_.renderer->read_hits(name, layer);
        if (!content) {
            ADD_FAILURE() << content.error().message();
            return {};
        }
        std::vector<T> values(content->bytes.size() / sizeof(T));
        std::memcpy(values.data(), content->bytes.data(), content->bytes.size());
        return values;
    }

    /// Counts pixels of a class, and those whose words differ. `slices`: words beyond the targets that each of them
    /// has.
    void run(passes::PixelClass of_class, std::uint32_t slices = 0) {
        const auto classes = shot_.intermediate<std::uint32_t>("material.0");
        std::vector<bool> same(classes.size(), true);
        const auto compare = [&](const char* name, std::uint32_t layer) {
            const auto drawn = shot_.intermediate<std::uint32_t>(name, layer),
                       shaded = hits<std::uint32_t>(name, layer);
            ASSERT_EQ(drawn.size(), shaded.size());
            for (std::size_t i = 0; i < drawn.size(); ++i) {
                if (drawn[i] == shaded[i] || (classes[i] & 3u) != static_cast<std::uint32_t>(of_class)) continue;
                same[i] = false;
                for (const passes::Field& field : passes::fields_of(name)) {
                    fields_off += passes::field_differs(field, drawn[i], shaded[i]) ? 1 : 0;
                }
            }
        };
        for (const char* name : {"material.0", "material.1", "top_layer"}) compare(name, 0);
        for (std::uint32_t layer = 0; layer < slices; ++layer) compare("material.slices", layer);
        for (std::size_t i = 0; i < classes.size(); ++i) {
            if ((classes[i] & 3u) != static_cast<std::uint32_t>(of_class)) continue;
            ++pixels;
            if (!same[i]) ++different;
        }
    }

    int pixels = 0, different = 0, fields_off = 0;

  private:
    const Shot& shot_;
};

/// Whether this device can write down places; elsewhere the renderer says what is missing, which is tested here.
bool can_shade_hits(RendererTest& test, const scene::Scene& scene) {
    if (test.device().capabilities().storage_in_fragment) return true;
    const auto renderer = passes::Renderer::create(
        test.device(), scene,
        {.profile = HitShading::GetParam().profile, .width = side, .height = side, .shade_hits = true});
    EXPECT_FALSE(renderer);
    if (!renderer) {
        EXPECT_EQ(renderer.error().code, ErrorCode::unsupported);
        EXPECT_NE(renderer.error().message().find("storage_in_fragment"), std::string::npos)
            << renderer.error().message();
    }
    return false;
}

const passes::RenderOptions options{
    .width = side, .height = side, .exposure_ev = 0.0f, .keep_intermediates = true, .shade_hits = true};

/// To the bit on the CPU, where both shaders compute the same operations in the same order; other compilers may
/// contract one of them, and devices without descriptor indexing may enlarge textures.
void expect_equal(const Comparison& comparison, int least_pixels, const std::string& what) {
    EXPECT_GE(comparison.pixels, least_pixels) << what;
    if (HitShading::GetParam().backend.starts_with("cpu")) {
        EXPECT_EQ(comparison.different, 0) << what << ": of " << comparison.pixels << " pixels";
    } else {
        EXPECT_LE(comparison.fields_off, comparison.pixels / 100) << what << ": of " << comparison.pixels << " pixels";
    }
}

TEST_P(HitShading, PlainSlabsAreWhatTheBasePassStores) {
    for (const bool moved : {false, true}) {
        scene::Scene scene = empty_scene();
        materials::MaterialDescription material = textured(scene, add_sampler(scene, scene::MipFilter::none));
        if (moved) {
            material.base_color_texture.transform = {.offset = {0.1f, 0.3f}, .rotation = 0.4f, .scale = {2.0f, 1.5f}};
            material.occlusion_texture.transform.scale = {0.5f, 4.0f};
        }
        place(scene, ball(), add_material(scene, material));
        if (!can_shade_hits(*this, scene)) return;
        const Shot shot = render(scene, options);
        Comparison comparison(shot);
        comparison.run(passes::PixelClass::slab);
        expect_equal(comparison, 2000, moved ? "moved textures" : "textures");
    }
}

// With mips the level follows from the differentials, which are given here and taken by the draw.
TEST_P(HitShading, DifferentialsChooseTheLevelsOfTheDraws) {
    const bool is_cpu = GetParam().backend.starts_with("cpu");
    for (const scene::Filter minification : {scene::Filter::nearest, scene::Filter::linear}) {
        // Filters that are all linear are anisotropic, which Mesa does for draws and not for differentials that are
        // given.
        if (minification == scene::Filter::linear && !is_cpu) continue;
        scene::Scene scene = empty_scene();
        scene.samplers.push_back({.minification = minification, .mip = scene::MipFilter::linear});
        place(scene, ball(), add_material(scene, textured(scene, static_cast<int>(scene.samplers.size()) - 1)));
        if (!can_shade_hits(*this, scene)) return;
        const Shot shot = render(scene, options);
        Comparison comparison(shot);
        comparison.run(passes::PixelClass::slab);
        expect_equal(comparison, 2000, minification == scene::Filter::linear ? "anisotropic" : "isotropic");
    }
}

TEST_P(HitShading, WhatAPrimitiveLacksIsNotRead) {
    scene::Scene scene = empty_scene();
    const std::uint32_t material = add_material(scene, textured(scene, add_sampler(scene, scene::MipFilter::none)));
    scene::Primitive without_tangents = ball(), without_uv1 = ball(), without_normals = ball(), bare = ball();
    without_tangents.tangents.clear();
    without_uv1.uv1.clear();
    without_normals.normals.clear(), without_normals.tangents.clear();
    bare.tangents.clear(), bare.uv0.clear(), bare.uv1.clear(), bare.colors.clear();
    const glm::mat4 half = glm::mat4(glm::mat3(0.5f));
    int i = 0;
    for (scene::Primitive* primitive : {&without_tangents, &without_uv1, &without_normals, &bare}) {
        glm::mat4 world = half;
        world[3] = glm::vec4(i % 2 == 0 ? -0.5f : 0.5f, i < 2 ? -0.5f : 0.5f, 0.0f, 1.0f);
        place(scene, *primitive, material, world);
        ++i;
    }
    if (!can_shade_hits(*this, scene)) return;
    const Shot shot = render(scene, options);
    Comparison lit(shot), unlit(shot), nothing(shot);
    lit.run(passes::PixelClass::slab);
    expect_equal(lit, 1400, "lit");
    unlit.run(passes::PixelClass::unlit);
    expect_equal(unlit, 400, "without normals");
    nothing.run(passes::PixelClass::background);
    EXPECT_GT(nothing.pixels, 1000);
    EXPECT_EQ(nothing.different, 0) << "where nothing is seen nothing is stored";
}

TEST_P(HitShading, AlphaTestsAreThoseOfTheDraws) {
    scene::Scene scene = empty_scene();
    materials::MaterialDescription leaves = textured(scene, add_sampler(scene, scene::MipFilter::none));
    leaves.alpha_mode = materials::AlphaMode::mask;
    leaves.alpha_cutoff = 0.35f;
    leaves.double_sided = true;
    place(scene, ball(), add_material(scene, leaves));
    if (!can_shade_hits(*this, scene)) return;
    const Shot shot = render(scene, options);
    Comparison comparison(shot);
    comparison.run(passes::PixelClass::slab);
    // Through the holes of the front the inside is seen.
    expect_equal(comparison, 1500, "alpha-tested");
    const auto emission = comparison.hits<glm::vec4>("emission");
    const auto classes = shot.intermediate<std::uint32_t>("material.0");
    int wrong = 0;
    for (std::size_t i = 0; i < classes.size(); ++i)
        wrong += (emission[i].a == 1.0f) != ((classes[i] & 3u) != 0) ? 1 : 0;
    EXPECT_EQ(wrong, 0) << "the alpha test must let be what is drawn";
}

TEST_P(HitShading, TreesAreWhatTheBasePassStores) {
    if (GetParam().profile == "mobile") return;  // its trees are plain slabs of 12 bytes; the test below has them
    // Words beyond the targets are compared where the scene has one tree, the others where it has several.
    // Mesa takes long for each of these shaders.
    const bool is_cpu = GetParam().backend.starts_with("cpu");
    const std::vector<const char*> names =
        is_cpu ? std::vector{"complex-coat", "single-sss", "special-glints"} : std::vector{"single-fuzz"};
    for (const char* name : names) {
        scene::Scene scene = empty_scene();
        place(scene, ball(), add_material(scene, built_in(name)));
        if (!can_shade_hits(*this, scene)) return;
        const Shot shot = render(scene, options);
        std::uint32_t slices = 0;
        for (const auto& description : shot.renderer->intermediates()) {
            if (description.name == "material.slices") slices = description.layers;
        }
        Comparison closures(shot);
        closures.run(passes::PixelClass::closures, slices);
        Comparison slabs(shot);
        slabs.run(passes::PixelClass::slab);
        EXPECT_GT(closures.pixels + slabs.pixels, 2000) << name;
        expect_equal(closures, 0, name);
        expect_equal(slabs, 0, name);
    }
}

TEST_P(HitShading, ManyKindsAtOnce) {
    scene::Scene scene = empty_scene();
    const int sampler = add_sampler(scene, scene::MipFilter::none);
    materials::MaterialDescription coated = textured(scene, sampler);
    coated.clearcoat = materials::Clearcoat{.factor = 0.8f, .roughness = 0.1f};
    coated.clearcoat->normal_texture = {.image = add_noise(scene, scene::ColorSpace::linear, true), .sampler = sampler};
    materials::MaterialDescription brushed = textured(scene, sampler);
    brushed.anisotropy = materials::Anisotropy{.strength = 0.7f, .rotation = 0.5f};
    brushed.base_color_texture.transform.scale = {3.0f, 2.0f};
    brushed.double_sided = true;
    // Mesa takes long for each kind of tree.
    if (!GetParam().backend.starts_with("cpu")) brushed = coated;
    const glm::mat4 third = glm::mat4(glm::mat3(0.33f));
    int i = 0;
    scene::Primitive no_tangents = ball();
    no_tangents.tangents.clear();
    for (const auto& material : {coated, brushed, textured(scene, sampler), coated, built_in("complex-coat"), coated,
                                 coated, brushed, matte(glm::vec3(0.5f))}) {
        glm::mat4 world = third;
        world[3] = glm::vec4(0.66f * static_cast<float>(i % 3 - 1), 0.66f * static_cast<float>(i / 3 - 1), 0.0f, 1.0f);
        if (i == 1) world[0] = -world[0];  // mirrored
        place(scene, i == 6 ? no_tangents : ball(), add_material(scene, material), world);
        ++i;
    }
    if (!can_shade_hits(*this, scene)) return;
    const Shot shot = render(scene, options);
    Comparison closures(shot), slabs(shot);
    closures.run(passes::PixelClass::closures);
    slabs.run(passes::PixelClass::slab);
    EXPECT_GT(closures.pixels + slabs.pixels, 1800);
    expect_equal(slabs, 300, "plain slabs");
    expect_equal(closures, GetParam().profile == "mobile" ? 0 : 900, "trees");
}

/// Stripes along u or around y, whose colors and width are numbers; a table of roughness in the sideband.
class Stripes final : public materials::CustomMaterial {
  public:
    glm::vec3 light{0.9f, 0.8f, 0.3f}, dark{0.1f, 0.05f, 0.3f};
    float count = 6.0f, holes = 0.0f;
    std::vector<glm::vec4> roughness = {glm::vec4(0.2f), glm::vec4(0.8f)};
    materials::TextureReference normal_map{};
    bool emits = false, is_dirty = false;

    [[nodiscard]] materials::MaterialModule module() const override {
        return {"stripes", R"(
float stripes_phase() {
    float along = in_uv0.x + 0.125 * in_position.y;
    return fract(along * custom_numbers(0).w);
}
vec4 stripes_base_color() {
    float phase = stripes_phase();
    vec3 color = phase < 0.5 ? custom_numbers(0).rgb : custom_numbers(1).rgb;
    return vec4(color * in_color.rgb, phase < custom_numbers(1).w ? 0.0 : 1.0);
}
vec3 stripes_emission() { return custom_numbers(0).rgb * 2.0; }
SingleSlab stripes_slab(vec3 color) {
    SingleSlab slab;
    slab.diffuse = color;
    slab.f0 = vec3(0.04);
    slab.f90 = 1.0;
    slab.roughness = (stripes_phase() < 0.5 ? custom_sideband(0) : custom_sideband(1)).x * material_texel(0).r;
    slab.normal = shading_normal();
    slab.occlusion = 1.0;
    return slab;
}
)"};
    }
    [[nodiscard]] materials::CustomMaterialData data() const override {
        materials::CustomMaterialData data;
        data.numbers[0] = glm::vec4(light, count);
        data.numbers[1] = glm::vec4(dark, holes);
        data.sideband = roughness;
        data.textures[2] = normal_map;
        data.alpha_mode = holes > 0.0f ? materials::AlphaMode::mask : materials::AlphaMode::opaque;
        data.emits = emits;
        data.reads = materials::reads_uv0 | materials::reads_colors;
        return data;
    }
    materials::MaterialUpdate update() override {
        return std::exchange(is_dirty, false) ? materials::MaterialUpdate::numbers : materials::MaterialUpdate::none;
    }
};

/// A second kind, of one color; with a function of the same purpose under its own name.
class Flat final : public materials::CustomMaterial {
  public:
    [[nodiscard]] materials::MaterialModule module() const override {
        return {"flat1", R"(
vec4 flat1_base_color() { return vec4(0.25, 0.5, 0.75, 1.0); }
vec3 flat1_emission() { return vec3(0.0); }
SingleSlab flat1_slab(vec3 color) { return SingleSlab(color, vec3(0.5), 1.0, 0.5, shading_normal(), 1.0); }
)"};
    }
    [[nodiscard]] materials::CustomMaterialData data() const override { return {}; }
};

materials::MaterialDescription custom(std::shared_ptr<materials::CustomMaterial> material) {
    return {.name = "custom", .custom = std::move(material)};
}

/// Value of one field at a pixel.
std::array<float, 3> field_at(const Shot& shot, std::string_view name, std::uint32_t x, std::uint32_t y) {
    const passes::Field& field = *std::ranges::find(passes::gbuffer_fields(), name, &passes::Field::name);
    return passes::decode_field(field, shot.intermediate<std::uint32_t>(std::string(field.word).c_str())[y * side + x]);
}

TEST_P(HitShading, KindsOfTheProgramsOwnAreDrawnAsTheySay) {
    scene::Scene scene = empty_scene();
    auto stripes = std::make_shared<Stripes>();
    stripes->count = 2.0f;
    // u is (x + 1) / 2 on the sheet, and y is 0 in its middle.
    scene::Primitive sheet = scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
    place(scene, sheet, add_material(scene, custom(stripes)));
    Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f, .keep_intermediates = true});
    const auto expect_stripes = [&](const Stripes& expected) {
        for (std::uint32_t x = 1; x < side; x += 3) {
            // Row 31 lies at y = 1 / 64.
            const float u = (static_cast<float>(x) + 0.5f) / side, along = u + 0.125f / side;
            const float phase = along * expected.count - std::floor(along * expected.count);
            if (std::abs(phase - 0.5f) < 0.02f || phase < 0.02f || phase > 0.98f) continue;
            const bool is_light = phase < 0.5f;
            const glm::vec3 color = is_light ? expected.light : expected.dark;
            EXPECT_NEAR(field_at(shot, "diffuse_r", x, 31)[0], color.r, 0.02f) << x;
            EXPECT_NEAR(field_at(shot, "roughness", x, 31)[0], expected.roughness[is_light ? 0 : 1].x, 0.01f) << x;
        }
    };
    expect_stripes(*stripes);
    // What changes between frames shows in the next one, but only if the material says so.
    Stripes before;
    before.count = stripes->count;
    stripes->light = {0.2f, 0.9f, 0.4f};
    stripes->roughness = {glm::vec4(0.6f), glm::vec4(0.1f)};
    ASSERT_TRUE(shot.renderer->render_frame());
    expect_stripes(before);
    stripes->is_dirty = true;
    ASSERT_TRUE(shot.renderer->render_frame());
    expect_stripes(*stripes);
    stripes->roughness.emplace_back(0.5f);
    stripes->is_dirty = true;
    const auto frame = shot.renderer->render_frame();
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, ErrorCode::invalid_argument);
}

TEST_P(HitShading, KindsOfTheProgramsOwnAreShadedAsTheyAreDrawn) {
    scene::Scene scene = empty_scene();
    auto stripes = std::make_shared<Stripes>();
    stripes->holes = 0.2f;
    stripes->emits = true;
    stripes->normal_map = {.image = add_noise(scene, scene::ColorSpace::linear, true),
                           .sampler = add_sampler(scene, scene::MipFilter::none),
                           .transform = {.scale = {2.0f, 3.0f}}};
    const glm::mat4 half = glm::mat4(glm::mat3(0.5f));
    int i = 0;
    // Mesa takes long for trees.
    const bool is_cpu = GetParam().backend.starts_with("cpu");
    for (const auto& material : {custom(stripes), custom(std::make_shared<Flat>()), matte(glm::vec3(0.5f)),
                                 is_cpu ? built_in("complex-coat") : matte(glm::vec3(0.2f))}) {
        glm::mat4 world = half;
        world[3] = glm::vec4(i % 2 == 0 ? -0.5f : 0.5f, i < 2 ? -0.5f : 0.5f, 0.0f, 1.0f);
        place(scene, ball(), add_material(scene, material), world);
        ++i;
    }
    // Without normals it is unlit, and still of its kind.
    scene::Primitive bare = scene::sphere(0.2f, 16, 8);
    bare.normals.clear(), bare.uv0.clear();
    place(scene, bare, 0);
    scene.lights.push_back(directional_light({0, -1, -1}, 1.0f));
    if (!can_shade_hits(*this, scene)) return;
    const Shot shot = render(scene, options);
    EXPECT_TRUE(shot.has_pass("alpha test prepass"));
    EXPECT_TRUE(shot.has_pass("emission"));
    Comparison comparison(shot);
    comparison.run(passes::PixelClass::slab);
    expect_equal(comparison, 1200, "own kinds");
    Comparison unlit(shot);
    unlit.run(passes::PixelClass::unlit);
    expect_equal(unlit, 10, "own kinds without normals");
    const auto emission = comparison.hits<glm::vec4>("emission");
    int glowing = 0;
    for (const glm::vec4& value : emission) glowing += value.r == 1.8f && value.b == 0.6f ? 1 : 0;
    EXPECT_GT(glowing, 300) << "emission is 2 times the light color, in one quarter of the picture";
}

TEST_P(HitShading, WrongKindsAreErrors) {
    class Wrong final : public materials::CustomMaterial {
      public:
        explicit Wrong(std::string name, std::string glsl = "", std::size_t rows = 0)
            : name_(std::move(name)), glsl_(std::move(glsl)), rows_(rows) {}
        [[nodiscard]] materials::MaterialModule module() const override { return {name_, glsl_}; }
        [[nodiscard]] materials::CustomMaterialData data() const override {
            materials::CustomMaterialData data;
            data.sideband.resize(rows_);
            return data;
        }

      private:
        std::string name_, glsl_;
        std::size_t rows_;
    };
    const auto error_of = [&](std::vector<std::shared_ptr<materials::CustomMaterial>> wrong) {
        scene::Scene scene = empty_scene();
        for (auto& material : wrong) place(scene, ball(), add_material(scene, custom(std::move(material))));
        const auto renderer =
            passes::Renderer::create(device(), scene, {.profile = GetParam().profile, .width = 16, .height = 16});
        EXPECT_FALSE(renderer);
        return renderer ? Error{} : renderer.error();
    };
    EXPECT_EQ(error_of({std::make_shared<Wrong>("two words")}).code, ErrorCode::invalid_argument);
    EXPECT_EQ(error_of({std::make_shared<Wrong>("")}).code, ErrorCode::invalid_argument);
    EXPECT_EQ(error_of({std::make_shared<Wrong>("a", "", 513)}).code, ErrorCode::invalid_argument);
    EXPECT_EQ(error_of({std::make_shared<Wrong>("a", "x"), std::make_shared<Wrong>("a", "y")}).code,
              ErrorCode::invalid_argument);
    EXPECT_EQ(error_of({std::make_shared<Wrong>("a", "x"), std::make_shared<Wrong>("a", "x", 1)}).code,
              ErrorCode::invalid_argument);
    const Error syntax = error_of({std::make_shared<Wrong>("broken", "vec4 broken_base_color() { return 1; }\n")});
    EXPECT_EQ(syntax.code, ErrorCode::shader_compile);
    EXPECT_NE(syntax.message().find("passes/kinds/broken.glsl:1"), std::string::npos) << syntax.message();
}

// Asked without light: albedo of a white metal and of a diffuse slab, emission, roughness.
TEST_P(HitShading, PropertiesCanBeAskedFor) {
    scene::Scene scene = empty_scene();
    materials::MaterialDescription metal{.name = "metal"};
    metal.roughness = 0.7f;
    materials::MaterialDescription glowing = matte({0.2f, 0.4f, 0.6f});
    glowing.emissive = {5.0f, 6.0f, 7.0f};
    scene::Primitive left = scene::parallelogram({-1, -1, 0}, {1, 0, 0}, {0, 2, 0});
    scene::Primitive right = scene::parallelogram({0, -1, 0}, {1, 0, 0}, {0, 2, 0});
    place(scene, left, add_material(scene, metal));
    place(scene, right, add_material(scene, glowing));
    if (!can_shade_hits(*this, scene)) return;
    {
        const Shot shot = render(scene, options);
        const Comparison comparison(shot);
        const auto albedo = comparison.hits<glm::vec4>("albedo"), emission = comparison.hits<glm::vec4>("emission");
        const std::size_t at_left = 32 * side + 16, at_right = 32 * side + 48;
        // A white metal reflects everything; 1.5e-3 is the table's.
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(albedo[at_left][c], 1.0f, 3e-3f);
        EXPECT_EQ(albedo[at_left].a, 0.7f);
        EXPECT_EQ(glm::vec3(emission[at_left]), glm::vec3(0.0f));
        EXPECT_EQ(glm::vec3(emission[at_right]), glm::vec3(5.0f, 6.0f, 7.0f));
        EXPECT_EQ(emission[at_right].a, 1.0f);
        // matte() has no interface.
        EXPECT_NEAR(albedo[at_right].r, 0.2f, 0.05f);
        EXPECT_NEAR(albedo[at_right].b, 0.6f, 0.05f);
    }
    if (GetParam().profile == "mobile") return;
    // A tree against the host's double precision.
    scene::Scene coated = empty_scene();
    auto tree = *materials::make_builtin_material("single-haze-f90");
    for (materials::Node& node : tree.nodes) {
        node.slab.features |= materials::slab_emission;
        node.slab.emission = glm::vec3(3.0f, 2.0f, 1.0f);
    }
    materials::MaterialDescription glowing_tree{.name = "tree"};
    glowing_tree.tree = std::make_shared<const materials::Tree>(tree);
    place(coated, scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), add_material(coated, glowing_tree));
    const Shot shot = render(coated, options);
    const auto flat = materials::flatten(tree);
    ASSERT_TRUE(flat);
    const glm::dvec3 expected = materials::directional_albedo(materials::shade(*flat, {0.0, 0.0, 1.0}, 2.0 / side));
    const glm::vec4 seen = Comparison(shot).hits<glm::vec4>("albedo")[32 * side + 32];
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen[c], expected[c], 2e-3) << c;
    const glm::vec3 sent = glm::vec3(Comparison(shot).hits<glm::vec4>("emission")[32 * side + 32]);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sent[c], static_cast<float>(3 - c), 2e-3f) << c;
}

// Ray cones and levels that are given, against the level of the closed form: texels that a cone covers, as a power of
// two.
TEST_P(HitShading, ConesAndLevelsChooseMips) {
    scene::Scene scene = empty_scene();
    materials::MaterialDescription material{.name = "textured"};
    material.base_color_texture = {.image = add_noise(scene, scene::ColorSpace::linear),
                                   .sampler = add_sampler(scene, scene::MipFilter::linear)};
    material.metallic_roughness_texture = material.base_color_texture;
    material.metallic_roughness_texture.transform.scale = {2.0f, 2.0f};
    material.metallic_roughness_texture.transform.offset = {0.125f, 0.0f};
    add_material(scene, matte(glm::vec3(0.5f)));
    const std::uint32_t number = add_material(scene, material);
    const auto kinds = passes::CustomKinds::choose(scene);
    ASSERT_TRUE(kinds);
    const passes::SceneClosures closures;
    std::vector<materials::SingleSlab> slabs;
    for (const auto& description : scene.materials) slabs.push_back(materials::single_slab(description));
    auto on_device = passes::SceneMaterials::create(device(), scene, slabs, closures, *kinds,
                                                    std::vector<bool>(slabs.size(), true), passes::all_textures, 1.0f);
    ASSERT_TRUE(on_device) << on_device.error().message();
    auto hits = passes::HitMaterials::create(device(), **on_device, closures, *kinds);
    ASSERT_TRUE(hits) << hits.error().message();
    const std::string text = R"(#version 460
#include "passes/shared/hit_shading.glsl"
layout(local_size_x = 1) in;
layout(set = 0, binding = 0, std430) buffer Results { vec4 results[]; };
void main() {
    hit_material = MATERIAL;
    in_attributes = attribute_normals | attribute_uv0;
    in_uv0 = vec2(0.3, 0.6);
#if TEXTURE_DETAIL == 1
    in_uv0_cone = uv_cone(0.5, 0.5, 0.125);  // an eighth: two of 16 texels, and four where coordinates are doubled
    float level = 1.0, moved_level = 2.0;
#else
    in_texture_level = 1.5;
    float level = 1.5, moved_level = 1.5;
#endif
    results[0] = base_color();
    results[1] = sample_table_lod(material_texture(0u), in_uv0, level);
    results[2] = metallic_roughness_texel();
    results[3] = sample_table_lod(material_texture(1u), 2.0 * in_uv0 + vec2(0.125, 0.0), moved_level);
    results[4] = sample_table_lod(material_texture(0u), in_uv0, 0.0);
}
)";
    for (const passes::TextureDetail detail : {passes::TextureDetail::cones, passes::TextureDetail::one_level}) {
        std::vector<EmbeddedFile> files = kinds->files();
        files.push_back((*hits)->file());
        passes::ShaderLibrary shaders(device(), nullptr, {}, files);
        auto defines = (*hits)->defines(detail);
        defines.push_back({"MATERIAL", std::to_string(number) + "u"});
        const auto pipeline = shaders.compute_pipeline("detail", {.name = "detail"}, {"detail.comp", defines, text});
        ASSERT_TRUE(pipeline) << pipeline.error().message();
        const auto buffer = device().create_buffer(
            {.size = 80, .usage = rhi::BufferUsage::storage | rhi::BufferUsage::copy_source, .name = "results"});
        ASSERT_TRUE(buffer);
        const auto layout = device().bind_group_layout(shaders.get(*pipeline), 0);
        ASSERT_TRUE(layout);
        const auto group = device().create_bind_group(
            {.layout = *layout, .entries = {{.binding = 0, .buffer = *buffer}}, .name = "results"});
        ASSERT_TRUE(group);
        rhi::CommandList list = device().create_command_list("detail");
        list.set_pipeline(shaders.get(*pipeline));
        list.set_bind_group(0, *group);
        ASSERT_TRUE((*hits)->bind(list, shaders.get(*pipeline)));
        list.dispatch({1, 1, 1});
        ASSERT_TRUE(device().submit(std::move(list)));
        const auto bytes = device().read_buffer(*buffer);
        ASSERT_TRUE(bytes);
        glm::vec4 results[5];
        std::memcpy(results, bytes->data(), sizeof(results));
        for (int c = 0; c < 3; ++c) {
            EXPECT_NEAR(results[0][c], results[1][c], 2e-3f) << c;
            EXPECT_NEAR(results[2][c], results[3][c], 2e-3f) << c;
        }
        EXPECT_GT(glm::distance(results[1], results[4]), 0.02f) << "levels must differ for this to tell anything";
        device().destroy(*group);
        device().destroy(*buffer);
    }
}

TEST_P(HitShading, ReadingTellsWhatIsMissing) {
    scene::Scene scene = empty_scene();
    place(scene, ball(), add_material(scene, matte(glm::vec3(0.5f))));
    const Shot without = render(scene, {.width = 16, .height = 16, .exposure_ev = 0.0f});
    const auto not_shaded = without.renderer->read_hits("material.0");
    ASSERT_FALSE(not_shaded);
    EXPECT_EQ(not_shaded.error().code, ErrorCode::invalid_argument);
    if (!can_shade_hits(*this, scene)) return;
    const Shot shot = render(scene, options);
    EXPECT_EQ(shot.renderer->read_hits("lit").error().code, ErrorCode::not_found);
    EXPECT_EQ(shot.renderer->read_hits("material.0", 1).error().code, ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace nacre::test
