// SPDX-License-Identifier: Apache-2.0
// The closures as a compute shader in 32 bits against the same text in double precision on the host.
#include <gtest/gtest.h>

#include <cstring>

#include "materials/tables/anisotropy_table.h"
#include "materials/tables/interface_table.h"
#include "materials/tables/medium_table.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

using namespace rhi;

/// What the shader reads for one point, in this order; only 32-bit words.
struct Point {
    Slab slab;
    glm::vec3 view, light, random;
    float footprint;
};
constexpr std::uint32_t results_per_point = 24;

/// GLSL that reads a point: the fields of Slab as materials/slab.h orders them.
constexpr const char* shader = R"(
#include "materials/closures/slab.glsl"
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer Points { uint points[]; };
layout(set = 0, binding = 1) writeonly buffer Results { float results[]; };
layout(set = 0, binding = 2) readonly buffer Table { uint interface_words[]; };

layout(set = 0, binding = 3) readonly buffer Medium { uint medium_words[]; };

vec3 specular_lut(uint index, vec2 at) { return vec3(at.x, 1.0 - 0.5 * at.y, 0.5 + 0.5 * at.x * at.y); }

layout(set = 0, binding = 4) readonly buffer Anisotropy { uint anisotropy_words[]; };

#include "materials/closures/table_buffers.glsl"
#include "materials/closures/closure.glsl"

uint place;
float next() { return uintBitsToFloat(points[place++]); }
vec2 next2() { float x = next(); return vec2(x, next()); }
vec3 next3() { float x = next(); float y = next(); return vec3(x, y, next()); }

void put(uint at, vec3 value) {
    results[at] = value.x;
    results[at + 1u] = value.y;
    results[at + 2u] = value.z;
}

void main() {
    place = gl_GlobalInvocationID.x * POINT_WORDS;
    Slab slab;
    slab.features = points[place++];
    slab.coverage = next();
    slab.f0 = next3();
    slab.roughness = next();
    slab.albedo = next3();
    slab.anisotropy = next();
    slab.f90 = next3();
    slab.specular_weight = next();
    slab.f82 = next3();
    slab.second_roughness = next();
    slab.second_weight = next();
    slab.fuzz_amount = next();
    slab.fuzz_roughness = next();
    slab.fuzz_color = next3();
    slab.film_thickness = next();
    slab.film_ior = next();
    slab.specular_lut = points[place++];
    slab.glint_density = next();
    slab.glint_position = next2();
    slab.glint_dx = next2();
    slab.glint_dy = next2();
    slab.mean_free_path = next3();
    slab.phase_anisotropy = next();
    slab.thickness = next();
    slab.emission = next3();
    slab.edge_coverage = next();
    slab.edge_exponent = next();
    place++;  // priority
    vec3 view = next3();
    vec3 light = next3();
    vec3 random = next3();
    Closure closure = prepare_closure(slab, view, next());
    ClosureValue value = evaluate_closure(closure, light);
    ClosureAlbedo albedo = closure_albedo(closure);
    ClosureSample picked = sample_closure(closure, random);
    uint at = gl_GlobalInvocationID.x * RESULT_WORDS;
    put(at, value.specular);
    put(at + 3u, value.diffuse + value.subsurface);
    put(at + 6u, albedo.specular + albedo.fuzz);
    put(at + 9u, albedo.diffuse + albedo.transmission);
    put(at + 12u, closure_throughput(closure));
    results[at + 15u] = closure_pdf(closure, light);
    put(at + 16u, picked.direction);
    put(at + 19u, picked.weight);
    results[at + 22u] = picked.pdf;
    results[at + 23u] = picked.is_mirror ? 1.0 : 0.0;
}
)";

class ClosureOnDevice : public ::testing::TestWithParam<const char*> {};

TEST_P(ClosureOnDevice, AgreesWithDoublePrecision) {
    Instance instance(all_backends());
    auto device = instance.create_device({.backend = GetParam()});
    if (!device && device.error().code == ErrorCode::not_found) GTEST_SKIP() << device.error().message();
    ASSERT_TRUE(device) << device.error().message();
    std::vector<ShaderDefine> defines = {{"POINT_WORDS", std::to_string(sizeof(Point) / 4) + "u"},
                                         {"RESULT_WORDS", std::to_string(results_per_point) + "u"}};
    for (const SlabFeature& feature : slab_features()) defines.push_back({feature.macro, "1"});
    ShaderCompiler compiler({.embedded = {embedded_files()}});
    auto compiled = compiler.compile({.path = "test.comp", .defines = defines, .text = shader});
    ASSERT_TRUE(compiled) << compiled.error().message();
    const auto made = [](auto expected) {
        EXPECT_TRUE(expected) << expected.error().message();
        return *expected;
    };
    const auto pipeline = made((*device)->create_compute_pipeline(
        {.shader = made((*device)->create_shader(std::move(*compiled))), .name = "closures"}));

    constexpr std::uint32_t count = 64 * 512;
    Random random(11);
    std::vector<Point> points(count);
    for (Point& point : points) {
        point.slab = random_slab(random, ~0u);
        const glm::dvec3 view = random_direction(random);
        point.view = view;
        point.light = random_light(random, view);
        point.random = {random(), random(), random()};
        point.footprint = static_cast<float>(std::pow(10.0, random(-6.0, 2.0)));
    }
    const auto point_buffer =
        made((*device)->create_buffer({.size = count * sizeof(Point), .usage = BufferUsage::storage}));
    const auto result_buffer =
        made((*device)->create_buffer({.size = count * results_per_point * 4, .usage = BufferUsage::storage}));
    const auto table = interface_table();
    const auto table_buffer =
        made((*device)->create_buffer({.size = table.size_bytes(), .usage = BufferUsage::storage}));
    ASSERT_TRUE((*device)->write_buffer(point_buffer, std::span<const Point>(points)));
    ASSERT_TRUE((*device)->write_buffer(table_buffer, table));
    const auto medium_buffer =
        made((*device)->create_buffer({.size = medium_table().size_bytes(), .usage = BufferUsage::storage}));
    ASSERT_TRUE((*device)->write_buffer(medium_buffer, medium_table()));
    const auto anisotropy_buffer =
        made((*device)->create_buffer({.size = anisotropy_table().size_bytes(), .usage = BufferUsage::storage}));
    ASSERT_TRUE((*device)->write_buffer(anisotropy_buffer, anisotropy_table()));
    const auto group = made((*device)->create_bind_group({.layout = made((*device)->bind_group_layout(pipeline, 0)),
                                                          .entries = {{.binding = 0, .buffer = point_buffer},
                                                                      {.binding = 1, .buffer = result_buffer},
                                                                      {.binding = 2, .buffer = table_buffer},
                                                                      {.binding = 3, .buffer = medium_buffer},
                                                                      {.binding = 4, .buffer = anisotropy_buffer}},
                                                          .name = "closures"}));
    CommandList list = (*device)->create_command_list("closures");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    list.dispatch({count / 64, 1, 1});
    ASSERT_TRUE((*device)->submit(std::move(list)));
    const auto bytes = made((*device)->read_buffer(result_buffer));
    std::vector<float> results(count * results_per_point);
    std::memcpy(results.data(), bytes.data(), results.size() * 4);

    // In double precision what is left are the words of tables, which are unpacked in 32 bits, and the points
    // themselves.
    // (A direction comes back rounded, and with it the density of narrow lobes would be another.)
    const bool is_double = std::string_view(GetParam()) == "cpu:double";
    const double tolerance = is_double ? 1e-5 : 1e-3;
    closures::Library library;
    library.tints = [](std::uint32_t, glm::dvec2 at) {
        return glm::dvec3(at.x, 1.0 - 0.5 * at.y, 0.5 + 0.5 * at.x * at.y);
    };
    struct Worst {
        double error = 0.0, exact = 0.0;
        std::uint32_t point = 0;
    } worst[results_per_point];
    int beyond = 0, other_counts = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Point& point = points[i];
        const float* result = &results[i * results_per_point];
        for (std::uint32_t k = 0; k < results_per_point; ++k)
            ASSERT_TRUE(std::isfinite(result[k]) && (result[k] >= 0.0f || (k >= 16 && k < 19)))
                << "point " << i << " result " << k << ": " << result[k];
        const auto closure = library.prepare_closure(Library::slab_of(point.slab), point.view, point.footprint);
        const auto value = library.evaluate_closure(closure, point.light);
        const auto albedo = library.closure_albedo(closure);
        double exact[16];
        const auto put = [&](int at, const glm::dvec3& v) {
            for (int channel = 0; channel < 3; ++channel) exact[at + channel] = v[channel];
        };
        put(0, value.specular);
        put(3, value.diffuse + value.subsurface);
        put(6, albedo.specular + albedo.fuzz);
        put(9, albedo.diffuse + albedo.transmission);
        put(12, library.closure_throughput(closure));
        exact[15] = library.closure_pdf(closure, point.light);
        const glm::dvec3 sum = albedo.specular + albedo.fuzz + albedo.diffuse + albedo.transmission;
        const bool is_black = std::max({sum.x, sum.y, sum.z}) < 1e-4;
        // What the specular lobes would send if the interface reflected everything.
        const glm::dvec3 h = library.half_vector(closure.view, point.light);
        double lobe_scale = 1.0;
        const auto add_lobe = [&](const Library::SpecularLobe& lobe) {
            if (!lobe.is_mirror)
                lobe_scale += library.ggx_value(closure.view, lobe.view_length, point.light, h, lobe.alpha);
        };
        add_lobe(closure.specular);
        if ((point.slab.features & slab_second_lobe) != 0) add_lobe(closure.second);
        // Of a black closure it does not matter which of its lobes is sampled.
        for (std::uint32_t k = 0; k < (is_black ? 15u : 16u); ++k) {
            // Relative, above an absolute floor of 1e-7: every result here is a share of light or a density of order 1.
            // A film's reflectance is what is left of 1 after interference: where it is near 0 its last digits are
            // those of 1.
            const bool has_film = (point.slab.features & slab_thin_film) != 0;
            const double floor = has_film ? 3e-6 * (k < 3 || k == 15 ? lobe_scale : 1.0) : 1e-7;
            const double error = std::max(std::abs(result[k] - exact[k]) - floor, 0.0) /
                                 std::max(std::abs(exact[k]), 1e-30) * (has_film ? 0.1 : 1.0);
            // The count of facets in a cell may fall to the other side of a whole number.
            if (k < 3 && (point.slab.features & slab_glints) != 0) {
                if (error > tolerance) ++other_counts;
                continue;
            }
            if (error > tolerance) ++beyond;
            if (error > worst[k].error) worst[k] = {error, exact[k], i};
        }
        // A sample's direction need not be that of double precision (the choice of a lobe may fall the other way); its
        // weight and density are those of the direction that it has.
        if (is_black || is_double || result[22] <= 0.0f || result[23] > 0.0f) continue;
        const glm::dvec3 direction(result[16], result[17], result[18]);
        ASSERT_NEAR(glm::length(direction), 1.0, 1e-5);
        const double pdf = library.closure_pdf(closure, direction);
        EXPECT_NEAR(result[22] / pdf, 1.0, 1e-3) << "point " << i;
    }
    for (std::uint32_t k = 0; k < 16; ++k) {
        const Point& point = points[worst[k].point];
        EXPECT_LE(worst[k].error, tolerance)
            << "result " << k << " exact " << worst[k].exact << " roughness " << point.slab.roughness << " anisotropy "
            << point.slab.anisotropy << " features " << point.slab.features << " view " << point.view.x << " "
            << point.view.y << " " << point.view.z << " light " << point.light.x << " " << point.light.y << " "
            << point.light.z << " point " << worst[k].point;
    }
    EXPECT_EQ(beyond, 0);
    EXPECT_LE(other_counts, static_cast<int>(count / 50));
    std::printf("%d of %u values differ where glints are counted\n", other_counts, 3 * count / 2);
}

/// SPIR-V words of the test's shader with some features, the files of the others replaced.
std::vector<std::uint32_t> words_of(const std::vector<ShaderDefine>& features, std::span<const EmbeddedFile> files) {
    ShaderCompiler compiler({.embedded = {files}, .debug_information = false});
    std::vector<ShaderDefine> defines = features;
    auto compiled = compiler.compile({.path = "test.comp", .defines = defines, .text = R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) buffer Data { float data[]; };
vec4 interface_table(vec2 at) { return vec4(at.x, at.y, 0.5, 0.25); }
vec2 medium_table(vec3 at) { return at.xy; }
vec2 anisotropy_table(vec4 at) { return at.xy; }
vec3 specular_lut(uint index, vec2 at) { return vec3(at.x, at.y, 1.0); }
#include "materials/closures/closure.glsl"
void main() {
    Slab slab;
    slab.features = 0u;
    slab.f0 = vec3(data[0]);
    slab.roughness = data[1];
    slab.albedo = vec3(data[2]);
    Closure closure = prepare_closure(slab, vec3(0.0, 0.0, 1.0), 1.0);
    data[3] = evaluate_closure(closure, vec3(data[4], data[5], data[6])).specular.x + sample_closure(closure, vec3(data[7])).pdf;
})"});
    EXPECT_TRUE(compiled) << compiled.error().message();
    return compiled ? compiled->spirv : std::vector<std::uint32_t>{};
}

TEST(ClosureFeatures, WhatASlabDoesNotUseDoesNotExist) {
    const std::pair<const char*, const char*> optional_files[] = {
        {"materials/closures/fuzz.glsl", "NACRE_SLAB_FUZZ"},
        {"materials/closures/glints.glsl", "NACRE_SLAB_GLINTS"},
        {"materials/closures/medium.glsl", "NACRE_SLAB_MEDIUM"},
        {"materials/closures/thin_film.glsl", "NACRE_SLAB_THIN_FILM"},
        {"materials/closures/classic.glsl", ""},
        {"materials/closures/covered_closure.glsl", "NACRE_CLOSURE_COVERED"},
        {"materials/closures/haze.glsl", ""},
    };
    const std::vector<std::uint32_t> plain = words_of({}, embedded_files());
    for (const auto& [path, macro] : optional_files) {
        std::vector<EmbeddedFile> files(embedded_files().begin(), embedded_files().end());
        for (EmbeddedFile& file : files)
            if (file.path == path) file.text = "#error this feature is not used\n";
        EXPECT_EQ(words_of({}, files), plain) << path;
    }
    for (const char* model : {"1", "2"})
        EXPECT_NE(words_of({{"NACRE_DIFFUSE_MODEL", model}}, embedded_files()), plain) << "diffuse model " << model;
    EXPECT_NE(words_of({{"NACRE_CLOSURE_COVERED", "1"}}, embedded_files()), plain) << "below layers";
    // The comparison can fail: with a feature the shader is another.
    for (const SlabFeature& feature : slab_features()) {
        if (feature.bit == slab_emission || feature.bit == slab_edge_coverage) continue;
        EXPECT_NE(words_of({{feature.macro, "1"}}, embedded_files()), plain) << feature.name;
    }
}

INSTANTIATE_TEST_SUITE_P(Backends, ClosureOnDevice, ::testing::Values("cpu", "cpu:double", "vulkan", "gl"),
                         [](const auto& parameter) {
                             return std::string(parameter.param) == "cpu:double" ? "cpu_double"
                                                                                 : std::string(parameter.param);
                         });

}  // namespace
}  // namespace nacre::materials::test
