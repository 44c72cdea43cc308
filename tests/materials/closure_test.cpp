// SPDX-License-Identifier: Apache-2.0
// Whole closures in double precision: energy, agreement of what they offer, and extreme inputs.
#include <gtest/gtest.h>

#include "tests/materials/closure_points.h"

namespace nacre::materials::test {
namespace {

struct Furnace {
    double smallest = 1e9;
    double largest = 0.0;
    std::string where;

    void add(const glm::dvec3& reflected, const std::string& place) {
        const double low = std::min({reflected.x, reflected.y, reflected.z});
        const double high = std::max({reflected.x, reflected.y, reflected.z});
        if (low < smallest || high > largest)
            where += place + ": " + std::to_string(low) + " to " + std::to_string(high) + "\n";
        smallest = std::min(smallest, low);
        largest = std::max(largest, high);
    }
};

/// The slab at all roughnesses and from all views.
Furnace furnace_of(Slab slab, const std::vector<float>& anisotropies = {0.0f}, int strata = 64) {
    Library library;
    Furnace furnace;
    for (const double roughness : roughnesses()) {
        slab.roughness = static_cast<float>(roughness);
        for (const float anisotropy : anisotropies) {
            slab.anisotropy = anisotropy;
            for (const double cosine : view_cosines()) {
                for (const double phi : anisotropies.size() > 1 ? std::vector{0.0, 0.8, 1.5708} : std::vector{0.3}) {
                    const auto closure = library.prepare_closure(Library::slab_of(slab), direction(cosine, phi), 1e-3);
                    furnace.add(integrate(library, closure, strata) + library.closure_throughput(closure),
                                "roughness " + std::to_string(roughness) + " anisotropy " + std::to_string(anisotropy) +
                                    " cosine " + std::to_string(cosine) + " phi " + std::to_string(phi));
                }
            }
        }
    }
    return furnace;
}

void expect_lossless(const Furnace& furnace) {
    EXPECT_LE(furnace.largest, 1.001) << furnace.where;
    EXPECT_GE(furnace.smallest, 0.998) << furnace.where;
}

TEST(Closure, WhiteMetalLosesNothing) {
    expect_lossless(furnace_of({.f0 = glm::vec3(1.0f), .albedo = glm::vec3(0.0f)}));
}

TEST(Closure, WhiteStretchedMetalLosesNothingUpToItsTable) {
    // Four dimensions in 63 KiB: AnisotropyTable.BetweenEntriesTheErrorIsSmall says by how much the table is off.
    const Furnace most = furnace_of({.features = slab_anisotropy, .f0 = glm::vec3(1.0f), .albedo = glm::vec3(0.0f)},
                                    {-0.9f, 0.3f, 0.95f}, 96);
    EXPECT_LE(most.largest, 1.0016) << most.where;
    EXPECT_GE(most.smallest, 0.997) << most.where;
    const Furnace all = furnace_of({.features = slab_anisotropy, .f0 = glm::vec3(0.04f)}, {-1.0f, 0.999f}, 48);
    EXPECT_LE(all.largest, 1.0016) << all.where;
    EXPECT_GE(all.smallest, 0.998) << all.where;
    std::printf("stretched: %.4f to %.4f, to the utmost %.4f to %.4f\n", most.smallest, most.largest, all.smallest,
                all.largest);
}

TEST(Closure, WhiteDiffuseUnderAnInterfaceLosesNothing) {
    expect_lossless(furnace_of({.f0 = glm::vec3(0.0f)}));
    expect_lossless(furnace_of({.f0 = glm::vec3(0.04f)}));
    expect_lossless(furnace_of({.f0 = {1.0f, 0.5f, 0.2f}}));
}

TEST(Closure, WhiteDiffuseUnderTintedReflectionLosesNothing) {
    expect_lossless(furnace_of({.features = slab_f90 | slab_f82,
                                .f0 = {0.9f, 0.5f, 0.2f},
                                .f90 = {0.2f, 1.0f, 0.6f},
                                .f82 = {0.3f, 0.0f, 1.0f}}));
}

TEST(Closure, WhiteDiffuseUnderAPartOfAnInterfaceLosesNothing) {
    for (const float weight : {0.0f, 0.3f, 0.9f})
        expect_lossless(furnace_of({.features = slab_f90, .f0 = {0.9f, 0.5f, 0.04f}, .specular_weight = weight}));
}

// KHR_materials_specular: the specular factor scales F0 and is F90.
TEST(Closure, ASpecularWeightScalesWhatAnInterfaceReflects) {
    Library library;
    Slab slab{.features = slab_f90, .f0 = {0.04f, 0.3f, 0.01f}, .roughness = 0.4f, .specular_weight = 0.25f};
    const auto part = library.slab_fresnel(Library::slab_of(slab));
    // As a plain slab bounds it: min(saturated(50 F0), F90) of the scaled F0, the brightest channel of it.
    EXPECT_NEAR(part.normal.y, 0.075, 1e-6);
    EXPECT_NEAR(part.grazing.x, 0.25, 1e-6);
    slab.features = 0;
    const auto whole = library.slab_fresnel(Library::slab_of(slab));
    for (const double cosine : {0.01, 0.4, 1.0})
        EXPECT_NEAR(
            glm::distance(library.fresnel_reflectance(part, cosine), 0.25 * library.fresnel_reflectance(whole, cosine)),
            0.0, 1e-9);
    // Side by side with a metal it is what glTF mixes: F0 and F90 by metalness.
    slab.features = slab_f90;
    const Slab metal{.f0 = {0.9f, 0.6f, 0.3f}, .roughness = 0.4f, .albedo = glm::vec3(0.0f)};
    const auto both = library.slab_fresnel(library.mix_slabs(Library::slab_of(slab), Library::slab_of(metal), 0.3));
    const glm::dvec3 f0 = glm::mix(0.25 * glm::dvec3(slab.f0), glm::dvec3(metal.f0), 0.3);
    EXPECT_NEAR(glm::distance(both.normal, f0), 0.0, 1e-6);
    EXPECT_NEAR(both.grazing.x, glm::mix(0.25, 1.0, 0.3), 1e-6);
}

TEST(Closure, WhiteDiffuseUnderTwoLobesLosesNothing) {
    expect_lossless(furnace_of(
        {.features = slab_second_lobe, .f0 = glm::vec3(0.3f), .second_roughness = 0.8f, .second_weight = 0.4f}));
    expect_lossless(furnace_of(
        {.features = slab_second_lobe, .f0 = glm::vec3(0.3f), .second_roughness = 0.0f, .second_weight = 0.4f}));
}

TEST(Closure, WhiteDiffuseUnderWhiteFuzzLosesNothing) {
    for (const float roughness : {0.0f, 0.3f, 1.0f})
        expect_lossless(furnace_of(
            {.features = slab_fuzz, .f0 = glm::vec3(0.04f), .fuzz_amount = 1.0f, .fuzz_roughness = roughness}));
}

TEST(Closure, WhiteInterfacesUnderAFilmLoseNothing) {
    for (const float thickness : {2e-8f, 3e-7f}) {
        expect_lossless(furnace_of({.features = slab_thin_film,
                                    .f0 = glm::vec3(1.0f),
                                    .albedo = glm::vec3(0.0f),
                                    .film_thickness = thickness}));
        expect_lossless(furnace_of({.features = slab_thin_film, .f0 = glm::vec3(0.1f), .film_thickness = thickness}));
    }
}

TEST(Closure, ATintOnlyTakes) {
    Library library;
    library.tints = [](std::uint32_t index, glm::dvec2 at) { return glm::dvec3(at.x, at.y, index == 3 ? 7.0 : 0.0); };
    Slab slab{.features = slab_specular_lut,
              .f0 = glm::vec3(0.9f),
              .roughness = 0.4f,
              .albedo = glm::vec3(0.0f),
              .specular_lut = 3};
    const glm::dvec3 view = direction(0.6, 0.0), light = direction(0.8, 3.0);
    const auto tinted = library.evaluate_closure(library.prepare_closure(Library::slab_of(slab), view, 1e-3), light);
    slab.features = 0;
    const auto plain = library.evaluate_closure(library.prepare_closure(Library::slab_of(slab), view, 1e-3), light);
    EXPECT_NEAR(tinted.specular.x / plain.specular.x, 0.6, 1e-9);
    EXPECT_NEAR(tinted.specular.y / plain.specular.y, 0.8, 1e-9);
    EXPECT_NEAR(tinted.specular.z / plain.specular.z, 1.0, 1e-9) << "tints above 1 are cut";
}

TEST(Closure, CoverageTurnsWithTheView) {
    Library library;
    Library::Slab slab = Library::slab_of(
        {.features = slab_edge_coverage, .coverage = 0.2f, .edge_coverage = 0.9f, .edge_exponent = 5.0f});
    EXPECT_NEAR(library.slab_coverage(slab, 1.0), 0.2, 1e-6);
    EXPECT_NEAR(library.slab_coverage(slab, 0.0), 0.9, 1e-6);
    EXPECT_NEAR(library.slab_coverage(slab, 0.5), 0.2 + 0.7 / 32.0, 1e-6);
    slab.features = 0;
    EXPECT_NEAR(library.slab_coverage(slab, 0.0), 0.2, 1e-6);
}

TEST(Closure, WhiteMediumOfAnyDepthLosesNothing) {
    for (const float depth : {0.0f, 1e-7f, 1e-3f, 0.1f, 1.0f, 7.0f, 100.0f, 1e5f, 1e12f}) {
        for (const float phase : {0.0f, 0.8f, -0.8f}) {
            Slab slab{.features = slab_medium, .f0 = glm::vec3(0.04f), .mean_free_path = glm::vec3(1e-3f)};
            slab.thickness = depth * 1e-3f;
            slab.phase_anisotropy = phase;
            Library library;
            Furnace furnace;
            for (const double cosine : view_cosines()) {
                const auto closure = library.prepare_closure(Library::slab_of(slab), direction(cosine, 0.3), 1e-3);
                furnace.add(integrate(library, closure, 64) + library.closure_throughput(closure),
                            "depth " + std::to_string(depth) + " phase " + std::to_string(phase) + " cosine " +
                                std::to_string(cosine));
            }
            expect_lossless(furnace);
        }
    }
}

TEST(Closure, NoSlabSendsOutMoreThanItGets) {
    Library library;
    Random random(4);
    for (int i = 0; i < 300; ++i) {
        Slab slab =
            random_slab(random, slab_f90 | slab_f82 | slab_second_lobe | slab_fuzz | slab_medium | slab_thin_film);
        const auto closure = library.prepare_closure(Library::slab_of(slab), random_direction(random), 1e-3);
        const glm::dvec3 reflected = integrate(library, closure, 96);
        const glm::dvec3 all = reflected + library.closure_throughput(closure);
        ASSERT_LE(std::max({all.x, all.y, all.z}), 1.001) << "point " << i;
        // What the closure says it reflects is what it reflects.
        const auto albedo = library.closure_albedo(closure);
        const glm::dvec3 sum = albedo.specular + albedo.fuzz + albedo.diffuse + albedo.transmission;
        for (int channel = 0; channel < 3; ++channel)
            ASSERT_NEAR(sum[channel], reflected[channel], 2e-3) << "point " << i;
    }
}

constexpr std::uint32_t finished_features = slab_anisotropy | slab_f90 | slab_f82 | slab_second_lobe | slab_fuzz |
                                            slab_medium | slab_edge_coverage | slab_thin_film | slab_specular_lut;

TEST(Closure, SamplesAgreeWithValueAndDensity) {
    Library library;
    Random random(5);
    int sampled = 0;
    for (int i = 0; i < 20000; ++i) {
        const Slab slab = random_slab(random, finished_features);
        const auto closure = library.prepare_closure(Library::slab_of(slab), random_direction(random), 1e-3);
        const auto sample = library.sample_closure(closure, {random(), random(), random()});
        if (sample.pdf <= 0.0) continue;
        ++sampled;
        ASSERT_NEAR(glm::length(sample.direction), 1.0, 1e-9);
        if (sample.is_mirror) continue;
        const auto value = library.evaluate_closure(closure, sample.direction);
        ASSERT_NEAR(library.closure_pdf(closure, sample.direction) / sample.pdf, 1.0, 1e-4);
        for (int channel = 0; channel < 3; ++channel) {
            const double all = value.specular[channel] + value.diffuse[channel] + value.subsurface[channel];
            ASSERT_NEAR(all, sample.weight[channel] * sample.pdf, 1e-4 * all);
        }
    }
    EXPECT_GT(sampled, 15000);
}

TEST(Closure, ExtremeInputsGiveFiniteValues) {
    Library library;
    Random random(6);
    const auto good = [](const glm::dvec3& v) {
        for (int channel = 0; channel < 3; ++channel)
            if (!std::isfinite(v[channel]) || v[channel] < 0.0) return false;
        return true;
    };
    for (int i = 0; i < 100000; ++i) {
        const Slab slab = random_slab(random, finished_features);
        const glm::dvec3 view = random_direction(random), light = random_light(random, view);
        const auto closure = library.prepare_closure(Library::slab_of(slab), view, std::pow(10.0, random(-6.0, 3.0)));
        const auto value = library.evaluate_closure(closure, light);
        ASSERT_TRUE(good(value.specular) && good(value.diffuse) && good(value.subsurface)) << "point " << i;
        const auto albedo = library.closure_albedo(closure);
        ASSERT_TRUE(good(albedo.specular) && good(albedo.fuzz) && good(albedo.diffuse) && good(albedo.transmission))
            << "point " << i;
        ASSERT_TRUE(good(library.closure_throughput(closure))) << "point " << i;
        ASSERT_TRUE(good(library.closure_transmittance(closure, light.z))) << "point " << i;
        const double edges[] = {0.0, 1.0 - 0x1p-24, random()};
        const auto sample =
            library.sample_closure(closure, {edges[random.below(3)], edges[random.below(3)], edges[random.below(3)]});
        ASSERT_TRUE(good(sample.weight) && std::isfinite(sample.pdf) && sample.pdf >= 0.0) << "point " << i;
    }
}

TEST(Closure, BouncesBetweenInterfaceAndBaseAreASum) {
    Library library;
    const glm::dvec3 internal(0.6, 0.0, 1.0), albedo(0.5, 0.5, 1.0);
    Library::Matter top = library.no_matter(), base = library.no_matter();
    top.diffuse.back = internal;
    top.diffuse.leaving = 1.0 - internal;
    base.albedo = albedo;
    base.passed = glm::dvec3(0.0);
    base.absorbed = 1.0 - albedo;
    const glm::dvec3 factor = library.bounces_between(top, base).leaving;
    double sum = 0.0, left = 1.0;
    for (int i = 0; i < 200; ++i) {
        sum += left * (1.0 - internal.x);
        left *= internal.x * albedo.x;
    }
    EXPECT_NEAR(factor.x, sum, 1e-7);
    EXPECT_NEAR(factor.y, 1.0, 1e-7);
    EXPECT_NEAR(factor.z, 1.0, 1e-7) << "what loses nothing gives everything back";
    // 0.596 is the reflectance of an index of 1.5 from inside (Egan and Hilgeman 1979); Schlick's formula is off by
    // 0.003.
    EXPECT_NEAR(library.internal_transmittance(Library::slab_of({.f0 = glm::vec3(0.04f)})).x, 1.0 - 0.596, 0.004);
}

// What is left of 1 has formulae of its own, so that single precision keeps its digits; in double precision both agree.
TEST(Closure, WhatMatterKeepsIsTheRest) {
    Library library;
    Random random(17);
    double worst = 0.0;
    const auto check = [&](const glm::dvec3& sum, const char* what, int i, double allowed = 1e-9) {
        for (int channel = 0; channel < 3; ++channel) {
            const double error = std::abs(sum[channel] - 1.0);
            worst = std::max(worst, error);
            ASSERT_LT(error, allowed) << what << " of tree " << i;
        }
    };
    // Light that would never leave is let out by 1e-9 at each bounce, which thousands of them show.
    constexpr double bounced = 1e-4;
    const auto check_matter = [&](const Library::Matter& m, int i, double allowed_from_above) {
        ASSERT_NEAR(m.coverage + m.bare, 1.0, 1e-9) << i;
        check(m.albedo + m.passed + m.absorbed, "light from above", i, allowed_from_above);
        for (const Library::Underside& u : {m.diffuse, m.mirrored, m.trapped})
            check(u.back + u.leaving + u.absorbed, "light from below", i);
    };
    for (int i = 0; i < 3000; ++i) {
        const double cosine = random_direction(random).z;
        const auto make = [&] {
            Slab slab = random_slab(random, slab_f90 | slab_f82 | slab_fuzz | slab_medium | slab_edge_coverage);
            slab.coverage = static_cast<float>(random());
            // Between two that let nothing out light stays for ever and counts nowhere.
            slab.f0 = glm::min(slab.f0, 0.9999f);
            slab.albedo = glm::min(slab.albedo, 0.9999f);
            slab.fuzz_color = glm::min(slab.fuzz_color, 0.9999f);
            const auto read = Library::slab_of(slab);
            check(library.internal_transmittance(read) + library.internal_reflectance(read), "an interface", i);
            if ((slab.features & slab_medium) != 0) {
                const auto medium = library.slab_scattering(read, std::max(random(), 1e-3));
                check(medium.reflected + medium.through + medium.straight + medium.absorbed, "a medium", i);
            }
            return library.base_matter(read, cosine);
        };
        const auto a = make(), b = make(), c = make();
        const auto mixed = library.cover_matter(library.mix_matter(a, b, random()), random());
        const auto layered = library.layer_matter(mixed, c);
        for (const auto& m : {a, b, c, mixed}) ASSERT_NO_FATAL_FAILURE(check_matter(m, i, 1e-9));
        for (const auto& m : {layered, library.layer_matter(layered, library.layer_matter(b, a))})
            ASSERT_NO_FATAL_FAILURE(check_matter(m, i, bounced));
        const auto bounces = library.bounces_between(mixed, c);
        check(c.albedo * bounces.leaving * mixed.transmittance + c.passed * bounces.arriving + bounces.absorbed,
              "what bounces", i, bounced);
    }
    std::printf("sums are off by at most %.1e\n", worst);
}

}  // namespace
}  // namespace nacre::materials::test
