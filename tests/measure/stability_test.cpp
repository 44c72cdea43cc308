// SPDX-License-Identifier: Apache-2.0
// The sweep of all closures, as long as CI has time for, and whether it finds what it is for.
#include "measure/stability.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "measure/chi_square.h"
#include "measure/closure_points.h"
#include "measure/point_shader.h"
#include "measure/stability_subject.h"
#include "samples/backends.h"

namespace nacre::measure {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// The part of the full sweep (nacre stability) that a minute is enough for.
TEST(Stability, ClosuresKeepTheirPromises) {
    const rhi::Instance instance(all_backends());
    const auto report = measure_stability(instance, {.backends = {"cpu"}, .points = 300'000});
    ASSERT_TRUE(report) << report.error().message();
    EXPECT_GE(report->closures.size(), 35u);
    for (const std::string& violation : violations_of(*report)) ADD_FAILURE() << violation;
    std::uint64_t points = 0;
    for (const StabilityClosure& c : report->closures) {
        points += c.all.points;
        EXPECT_GT(c.all.points, 1000u) << c.name;
        EXPECT_LT(c.all.host_error, 1e-5) << c.name << ": the reference is wrong at " << c.all.host_at;
        // Single scattering is reciprocal.
        if (c.name == "lobe-ggx" || c.name == "lobe-chan" || c.name == "classic-disney" ||
            c.name == "classic-charlie") {
            EXPECT_EQ(c.limits.reciprocity, 1e-4) << c.name;
            EXPECT_LT(c.all.reciprocity, 1e-4) << c.name << ": " << c.all.reciprocity_at;
        }
        if (c.name == "lobe-ggx") {
            EXPECT_EQ(c.limits.weight, 1.0 + 1e-5);
            EXPECT_LE(c.all.weight_max, 1.0 + 1e-5);
        }
        if (c.name == "trees-lossless") {
            EXPECT_TRUE(c.has_lossless);
            EXPECT_EQ(c.limits.lossless, 0.98);
            EXPECT_GE(c.furnace_min, 0.98);
        }
    }
    EXPECT_GE(points, 300'000u);
    const nlohmann::json json = nlohmann::json::parse(to_json(*report));
    ASSERT_EQ(json["closures"].size(), report->closures.size());
    for (const nlohmann::json& closure : json["closures"]) {
        for (const char* key : {"name", "points", "nan", "inf", "negative", "max_rel_error", "at", "furnace_min",
                                "furnace_max", "reciprocity", "chi2_failures", "weight_max", "weight_variance"})
            EXPECT_TRUE(closure.contains(key)) << key;
    }
    const auto html = report_page_html(stability_page(*report));
    ASSERT_TRUE(html) << html.error().message();
    EXPECT_THAT(*html, HasSubstr("<svg"));
    EXPECT_THAT(*html, testing::Not(HasSubstr("src=\"http")));
}

TEST(Stability, WhatIsBrokenIsNamed) {
    StabilityReport report;
    report.closures.push_back({.name = "good"});
    EXPECT_TRUE(violations_of(report).empty());
    StabilityClosure bad{.name = "bad"};
    bad.all.nan = 3;
    bad.all.max_rel_error = 0.1;
    bad.all.agreement = 1e-3;
    bad.chi2_tests = 2;
    bad.chi2_failures = 1;
    bad.has_furnace = bad.has_lossless = true;
    bad.furnace_max = 1.002;
    bad.furnace_min = 0.99;
    bad.limits = {.reciprocity = 1e-4, .weight = 1.0};
    bad.all.reciprocity = 2e-4;
    bad.all.weight_max = 1.5;
    report.closures.push_back(bad);
    EXPECT_THAT(violations_of(report),
                ElementsAre(HasSubstr("3 results are not a number"), HasSubstr("error of 0.1"),
                            HasSubstr("sends out 1.00200"), HasSubstr("only 0.99000"), HasSubstr("differ by 0.0002"),
                            HasSubstr("weight of 1.5"), HasSubstr("0.001"), HasSubstr("1 of 2 samplers")));
    // JSON knows no infinity.
    report.closures[1].all.max_rel_error = INFINITY;
    EXPECT_GT(nlohmann::json::parse(to_json(report))["closures"][1]["max_rel_error"], 1e300);
}

// A part of the sweep that is run again has the points of the whole, whatever is left out.
TEST(Stability, APartIsThatOfTheWhole) {
    const rhi::Instance instance(all_backends());
    const auto one = measure_stability(instance, {.backends = {"cpu"}, .points = 2000, .only = "classic-charlie-soft"});
    ASSERT_TRUE(one) << one.error().message();
    ASSERT_EQ(one->closures.size(), 1u);
    const auto both = measure_stability(instance, {.backends = {"cpu"}, .points = 4000, .only = "classic-charlie"});
    ASSERT_TRUE(both) << both.error().message();
    ASSERT_EQ(both->closures.size(), 2u);
    EXPECT_EQ(both->closures[1].name, "classic-charlie-soft");
    EXPECT_EQ(one->closures[0].all.points, both->closures[1].all.points);
    EXPECT_EQ(one->closures[0].all.at, both->closures[1].all.at);
    EXPECT_EQ(one->closures[0].all.errors, both->closures[1].all.errors);
}

// The distribution as textbooks have it cancels for smooth surfaces: the sweep's own points and judgement must see that
// on the device where they do not see it of the closures.
TEST(Stability, FindsTheTextbookDistribution) {
    const rhi::Instance instance(all_backends());
    const auto device = instance.create_device({.backend = "cpu"});
    ASSERT_TRUE(device) << device.error().message();
    auto subjects = lobe_subjects();
    const auto found = std::ranges::find(subjects, "lobe-ggx", &StabilitySubject::name);
    ASSERT_NE(found, subjects.end());
    StabilitySubject textbook = *found;
    const auto replace = [](std::string& text, const std::string& from, const std::string& to) {
        const std::size_t at = text.find(from);
        ASSERT_NE(at, std::string::npos);
        text.replace(at, from.size(), to);
    };
    replace(textbook.shader.text, "put(p.at, value);",
            "float a2 = alpha.x * alpha.x;\n"
            "    float d = (a2 - 1.0) * h.z * h.z + 1.0;\n"
            "    put(p.at, a2 / (pi * d * d));");
    const auto own = measure_subject(**device, **instance.create_device({.backend = "cpu:double"}), *found, 30000, 7);
    const auto figures =
        measure_subject(**device, **instance.create_device({.backend = "cpu:double"}), textbook, 30000, 7);
    ASSERT_TRUE(own) << own.error().message();
    ASSERT_TRUE(figures) << figures.error().message();
    EXPECT_LT(own->max_rel_error, 1e-5);
    EXPECT_GT(figures->max_rel_error, 0.1);
    EXPECT_THAT(figures->at, HasSubstr("roughness"));
}

// Drivers get a tree's text with its large calls made one after the other behind it, and its closures in a loop: that
// must come to what the text as it stands comes to.
TEST(Stability, DeferredCallsGiveWhatTheTextGives) {
    const rhi::Instance instance(all_backends());
    const auto device = instance.create_device({.backend = "cpu:double"});
    ASSERT_TRUE(device) << device.error().message();
    const auto trees = tree_subjects(4);
    ASSERT_TRUE(trees) << trees.error().message();
    const StabilitySubject& tree = trees->back();
    EXPECT_THAT(tree.shader.text, HasSubstr("= slab_matter("));
    EXPECT_THAT(tree.shader.text, HasSubstr("= layer_matter("));
    EXPECT_THAT(tree.shader.text, HasSubstr("= path_through_layer("));
    constexpr std::uint32_t count = 4096;
    Random random(9);
    std::vector<std::uint32_t> points(std::size_t{count} * tree.shader.point_words);
    for (std::uint32_t i = 0; i < count; ++i)
        tree.make_point(random, &points[std::size_t{i} * tree.shader.point_words]);
    std::vector<float> parameters, exact, results;
    tree.make_parameters(random, count / 64, parameters);
    const auto run = [&](const std::string& defines, std::vector<float>& to) {
        PointShaderDesc desc = tree.shader;
        desc.defines += defines;
        desc.capacity = count;
        desc.parameter_words *= count / 64;
        auto shader = PointShader::make(**device, desc);
        ASSERT_TRUE(shader) << shader.error().message();
        ASSERT_TRUE(shader->run(points, {}, parameters, count, to));
    };
    run("", exact);
    run("#define DEFERRED_CALLS " + std::to_string(tree.deferred_calls) + "u\n", results);
    ASSERT_EQ(results.size(), exact.size());
    std::size_t lit = 0;
    for (std::size_t i = 0; i < results.size(); ++i) {
        // Without a loop over the closures there is no scale of their lobes.
        if (i % tree.results.size() == 8) continue;
        lit += exact[i] > 0.0f;
        ASSERT_LE(std::abs(results[i] - exact[i]), 1e-6f * exact[i] + 1e-30f) << i;
    }
    EXPECT_GT(lit, results.size() / 2);
}

// Some devices fuse products and sums, which hides differences of rounded products: this one does not.
TEST(Stability, FilmsKeepTheirDigitsWhereNothingIsFused) {
    const rhi::Instance instance(all_backends());
    const auto device = instance.create_device({.backend = "cpu:consistent"});
    const auto reference = instance.create_device({.backend = "cpu:double"});
    ASSERT_TRUE(device) << device.error().message();
    ASSERT_TRUE(reference) << reference.error().message();
    const auto subjects = lobe_subjects();
    const auto film = std::ranges::find(subjects, "lobe-film", &StabilitySubject::name);
    ASSERT_NE(film, subjects.end());
    const auto figures = measure_subject(**device, **reference, *film, 200'000, 7);
    ASSERT_TRUE(figures) << figures.error().message();
    EXPECT_LT(figures->max_rel_error, 1e-3) << figures->at;
}

TEST(Stability, TooFewPointsAndUnknownNamesAreErrors) {
    const rhi::Instance instance(all_backends());
    const auto none = measure_stability(instance, {.points = 0});
    ASSERT_FALSE(none);
    EXPECT_THAT(none.error().message(), HasSubstr("0 points"));
    const auto nothing = measure_stability(instance, {.points = 1000, .only = "glitter"});
    ASSERT_FALSE(nothing);
    EXPECT_THAT(nothing.error().message(), HasSubstr("'glitter'"));
    EXPECT_FALSE(measure_stability(instance, {.backends = {"abacus"}, .points = 1000}));
}

// Samples of a cosine lobe pass against its own density, and not against one that is wrong by 1 %, nor against another.
TEST(ChiSquareTest, TellsOnePercent) {
    const auto cosine = [](const glm::dvec3& w) { return std::max(w.z, 0.0) / std::numbers::pi; };
    const DirectionBins bins{.rings = 40, .smallest_angle = 0.5};
    ChiSquareTest test(bins, cosine);
    ChiSquareTest other(bins, [](const glm::dvec3& w) { return w.z > 0.0 ? 0.5 / std::numbers::pi : 0.0; });
    Random random(3);
    for (int i = 0; i < 1'000'000; ++i) {
        const glm::dvec3 sample = direction(std::sqrt(random()), 2.0 * std::numbers::pi * random());
        test.add(sample);
        other.add(sample);
    }
    EXPECT_GT(test.smallest_probability(), 1e-3);
    EXPECT_LT(test.smallest_probability(1.01), 1e-9);
    EXPECT_LT(test.smallest_probability(0.99), 1e-9);
    EXPECT_LT(other.smallest_probability(), 1e-9);
}

// Bins around an axis that lies low are cut by the surface, where a density ends: their integrals are those of fine
// sums, to a part of what their counts vary by.
TEST(ChiSquareTest, BinsEndAtTheSurface) {
    const auto density = [](const glm::dvec3& w) { return w.z > 0.0 ? 0.5 / std::numbers::pi : 0.0; };
    const DirectionBins bins{.rings = 16, .axis = {std::sqrt(1.0 - 0.09), 0.0, 0.3}, .smallest_angle = 0.5};
    ChiSquareTest test(bins, density);
    Random random(4);
    const int samples = 1'000'000;
    for (int i = 0; i < samples; ++i) test.add(direction(random(), 2.0 * std::numbers::pi * random()));
    EXPECT_GT(test.smallest_probability(), 1e-3);
    EXPECT_LT(test.smallest_probability(1.01), 1e-9);
    double sum = 0.0;
    for (const double share : test.expected()) sum += share;
    EXPECT_NEAR(sum, 1.0, 1e-6);
    // Each ring of a hemisphere of constant density is cut by the surface over a part of its circle: by rings of
    // angles.
    const double growth = std::log1p(1.0 / bins.smallest_angle) / bins.rings;
    for (int ring = 0; ring < bins.rings; ++ring) {
        const double low = std::numbers::pi * bins.smallest_angle * std::expm1(growth * ring),
                     high = std::numbers::pi * bins.smallest_angle * std::expm1(growth * (ring + 1));
        double exact = 0.0;
        const int steps = 20000;
        for (int i = 0; i < steps; ++i) {
            const double angle = low + (high - low) * (i + 0.5) / steps;
            // Above the surface where cos(phi) tilt sin(angle) > -axis.z cos(angle).
            const double edge = -0.3 * std::cos(angle) / (std::sqrt(1.0 - 0.09) * std::sin(angle));
            exact += std::acos(std::clamp(edge, -1.0, 1.0)) / std::numbers::pi * std::sin(angle) * (high - low) / steps;
        }
        double found = 0.0;
        for (int sector = 0; sector < 2 * bins.rings; ++sector)
            found += test.expected()[ring * 2 * bins.rings + sector];
        EXPECT_NEAR(found, exact, 1e-6) << ring;
    }
}

// What is much narrower than a bin, and lies where no node is, is found by the counts.
TEST(ChiSquareTest, SeesPeaksThatNoNodeMeets) {
    const glm::dvec3 peak = direction(0.7, 1.0), right = glm::normalize(glm::cross(peak, glm::dvec3(0.0, 0.0, 1.0))),
                     up = glm::cross(peak, right);
    const double sharpness = 1e7;
    const auto density = [&](const glm::dvec3& w) {
        const double distance = glm::length(w - peak);
        return 0.5 * std::max(w.z, 0.0) / std::numbers::pi +
               0.5 * sharpness / (2.0 * std::numbers::pi) * std::exp(-0.5 * sharpness * distance * distance);
    };
    ChiSquareTest test({.rings = 40, .smallest_angle = 0.5}, density);
    Random random(5);
    for (int i = 0; i < 1'000'000; ++i) {
        if (random() < 0.5) {
            test.add(direction(std::sqrt(random()), 2.0 * std::numbers::pi * random()));
        } else {
            // 1 - cos is distributed exponentially.
            const double cosine = 1.0 + std::log(1.0 - random()) / sharpness, phi = 2.0 * std::numbers::pi * random();
            const double sine = std::sqrt(1.0 - cosine * cosine);
            test.add(cosine * peak + sine * (std::cos(phi) * right + std::sin(phi) * up));
        }
    }
    EXPECT_GT(test.smallest_probability(), 1e-3);
    EXPECT_LT(test.smallest_probability(1.01), 1e-9);
}

}  // namespace
}  // namespace nacre::measure
