// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "core/embedded_file.h"
#include "measure/stability_subject.h"

namespace nacre::measure {

// Generated from the files named in measure/CMakeLists.txt.
std::span<const EmbeddedFile> embedded_files();

namespace {

using namespace materials;

/// What the shader reads for one point, in this order; only 32-bit words.
struct ClosurePoint {
    Slab slab;
    glm::vec3 view, light, random;
    float footprint;
};

std::string describe_closure(const std::uint32_t* words) {
    const auto p = point_of<ClosurePoint>(words);
    const Slab& s = p.slab;
    std::string text = fmt::format("f0 {:.7g} {:.7g} {:.7g}, roughness {:.9g}, albedo {:.7g} {:.7g} {:.7g}", s.f0.x,
                                   s.f0.y, s.f0.z, s.roughness, s.albedo.x, s.albedo.y, s.albedo.z);
    const auto has = [&](std::uint32_t feature) { return (s.features & feature) != 0; };
    if (has(slab_anisotropy)) text += fmt::format(", anisotropy {:.9g}", s.anisotropy);
    if (has(slab_f90))
        text += fmt::format(", f90 {:.7g} {:.7g} {:.7g}, weight {:.7g}", s.f90.x, s.f90.y, s.f90.z, s.specular_weight);
    if (has(slab_f82)) text += fmt::format(", f82 {:.7g} {:.7g} {:.7g}", s.f82.x, s.f82.y, s.f82.z);
    if (has(slab_second_lobe))
        text += fmt::format(", second roughness {:.9g} weight {:.7g}", s.second_roughness, s.second_weight);
    if (has(slab_fuzz)) text += fmt::format(", fuzz {:.7g} roughness {:.7g}", s.fuzz_amount, s.fuzz_roughness);
    if (has(slab_thin_film)) text += fmt::format(", film {:.9g} m index {:.9g}", s.film_thickness, s.film_ior);
    if (has(slab_glints)) text += fmt::format(", glints {:.7g}", s.glint_density);
    if (has(slab_medium))
        text += fmt::format(", mean free path {:.7g} {:.7g} {:.7g} m, thickness {:.7g} m, phase {:.7g}",
                            s.mean_free_path.x, s.mean_free_path.y, s.mean_free_path.z, s.thickness,
                            s.phase_anisotropy);
    if (has(slab_edge_coverage))
        text +=
            fmt::format(", coverage {:.7g} to {:.7g} exponent {:.7g}", s.coverage, s.edge_coverage, s.edge_exponent);
    return text + fmt::format("; view {:.9g} {:.9g} {:.9g}, light {:.9g} {:.9g} {:.9g}, random {:.9g} {:.9g} {:.9g}",
                              p.view.x, p.view.y, p.view.z, p.light.x, p.light.y, p.light.z, p.random.x, p.random.y,
                              p.random.z);
}

std::vector<ResultKind> closure_results() {
    using enum ResultKind;
    std::vector<ResultKind> results(3, lobe);
    results.insert(results.end(), 16, share);
    results.push_back(lobe);
    results.insert(results.end(), 3, direction);
    results.insert(results.end(), 3, weight);
    results.insert(results.end(), {density, no_density, reciprocity, agreement, light_scale, sample_scale});
    return results;
}

// A subject whose slabs have `features`, and of the optional ones some; `shape` puts the slab where it is wanted.
StabilitySubject closure_subject(std::string name, std::string what, std::uint32_t features,
                                 std::function<void(Random&, Slab&)> shape = {}, std::uint32_t optional = 0) {
    StabilitySubject subject{.name = std::move(name), .what = std::move(what)};
    std::string text;
    for (const EmbeddedFile& file : embedded_files())
        if (file.path == "measure/stability_closure.glsl") text = file.text;
    subject.results = closure_results();
    subject.shader = {.text = std::move(text),
                      .point_words = sizeof(ClosurePoint) / 4,
                      .result_words = static_cast<std::uint32_t>(subject.results.size()),
                      .features = features | optional,
                      .has_tables = true};
    subject.make_point = [=](Random& random, std::uint32_t* words) {
        ClosurePoint point{};
        point.slab = random_slab(random, optional);
        point.slab.features |= features;
        if (random() < 0.03) point.slab.coverage = 1e-40f;
        if (shape) shape(random, point.slab);
        const glm::dvec3 view = random_direction(random);
        point.view = view;
        point.light = random_light(random, view);
        if ((features & slab_medium) != 0 && random() < 0.3) point.light.z = -point.light.z;
        // The ends of the range of random numbers as well.
        const auto unit = [&] {
            const double kind = random();
            return kind < 0.02   ? 0.0f
                   : kind < 0.04 ? 1.0f - 0x1p-24f
                                 : std::floor(static_cast<float>(random() * 0x1p24)) * 0x1p-24f;
        };
        point.random = {unit(), unit(), unit()};
        point.random = glm::min(point.random, glm::vec3(1.0f - 0x1p-24f));
        point.footprint = static_cast<float>(std::pow(10.0, random(-6.0, 2.0)));
        put_point(point, words);
    };
    subject.describe = describe_closure;
    // One point; the models of the host's library are those of a shader without defines.
    subject.on_host = [](const std::uint32_t* words, std::uint32_t, const float*, double* values) {
        const auto p = point_of<ClosurePoint>(words);
        Library library;
        library.tints = stability_tint;
        const auto slab = Library::slab_of(p.slab);
        const auto closure = library.prepare_closure(slab, p.view, p.footprint);
        const auto value = library.evaluate_closure(closure, p.light);
        const auto albedo = library.closure_albedo(closure);
        const auto put = [&](int at, const glm::dvec3& v) {
            values[at] = v.x, values[at + 1] = v.y, values[at + 2] = v.z;
        };
        put(0, value.specular);
        put(3, value.diffuse + value.subsurface);
        put(6, albedo.specular + albedo.fuzz);
        put(9, albedo.diffuse + albedo.transmission);
        put(12, library.closure_throughput(closure));
        put(15, library.closure_transmittance(closure, std::max(p.light.z, 0.0f)));
        values[18] = library.slab_coverage(slab, p.view.z);
    };
    subject.lower_cosine = [](const std::uint32_t* words) {
        const auto p = point_of<ClosurePoint>(words);
        return static_cast<double>(std::min(p.view.z, std::abs(p.light.z)));
    };
    subject.make_sampling = [](const Slab& slab, const glm::dvec3& view, std::uint32_t* words) {
        ClosurePoint point{.slab = slab, .view = view, .light = {0.0f, 0.0f, 1.0f}, .random = {}, .footprint = 1e-3f};
        put_point(point, words);
    };
    subject.number_word = offsetof(ClosurePoint, random) / 4;
    return subject;
}

// Furnaces at all roughnesses and views.
void add_furnaces(StabilitySubject& subject, Slab slab, bool is_lossless,
                  const std::vector<float>& anisotropies = {0.0f}) {
    slab.features |= subject.shader.features;
    for (const double roughness : roughnesses()) {
        slab.roughness = static_cast<float>(roughness);
        for (const float anisotropy : anisotropies) {
            slab.anisotropy = anisotropy;
            for (const double cosine : view_cosines()) {
                for (const double azimuth : anisotropies.size() > 1 ? std::vector{0.0, 0.8, 1.5708} : std::vector{0.3})
                    subject.furnaces.push_back({slab, cosine, azimuth, is_lossless});
            }
        }
    }
}

// Samplers at some roughnesses, and views down to a cosine of 0.01.
void add_samplings(StabilitySubject& subject, Slab slab, const std::vector<float>& rough,
                   const std::vector<float>& anisotropies = {0.0f}) {
    slab.features |= subject.shader.features;
    for (const float roughness : rough) {
        for (const float anisotropy : anisotropies) {
            slab.roughness = roughness;
            slab.anisotropy = anisotropy;
            for (const double cosine : {0.9, 0.3, 0.01}) subject.samplings.push_back({slab, cosine});
        }
    }
}

// Lengths whose optical depth lies between two powers of ten.
void set_depth(Random& random, Slab& slab, double low, double high) {
    const auto decades = [&](double from, double to) { return std::pow(10.0, random(from, to)); };
    const double thickness = decades(-9.0, 9.0);
    slab.thickness = static_cast<float>(thickness);
    slab.mean_free_path = {static_cast<float>(thickness / decades(low, high)),
                           static_cast<float>(thickness / decades(low, high)),
                           static_cast<float>(thickness / decades(low, high))};
}

}  // namespace

glm::dvec3 stability_tint(std::uint32_t, glm::dvec2 at) { return {at.x, 1.0 - 0.5 * at.y, 0.5 + 0.5 * at.x * at.y}; }

std::vector<StabilitySubject> closure_subjects() {
    std::vector<StabilitySubject> subjects;
    const auto add = [&](StabilitySubject subject) -> StabilitySubject& {
        return subjects.emplace_back(std::move(subject));
    };
    const Slab white_metal{.f0 = glm::vec3(1.0f), .albedo = glm::vec3(0.0f)};
    const Slab metal{.f0 = glm::vec3(0.8f), .albedo = glm::vec3(0.0f)};
    const Slab plastic{.f0 = glm::vec3(0.04f)};
    const std::vector<float> grid = {0.02f, 0.1f, 0.3f, 0.6f, 1.0f};

    {
        auto& s = add(closure_subject("ggx", "Metals: one GGX lobe with compensation.", 0,
                                      [](Random&, Slab& slab) { slab.albedo = glm::vec3(0.0f); }));
        add_furnaces(s, white_metal, true);
        add_samplings(s, metal, grid);
        s.share = 2.0;
    }
    {
        auto& s = add(closure_subject("ggx-chan", "GGX over Chan's opaque medium.", 0));
        add_furnaces(s, plastic, true);
        add_furnaces(s, {.f0 = glm::vec3(0.0f)}, true);
        add_samplings(s, {.f0 = glm::vec3(0.04f), .albedo = glm::vec3(0.5f)}, {0.1f, 0.7f});
        s.share = 2.0;
    }
    {
        auto& s = add(closure_subject("ggx-lambert", "GGX over a Lambertian medium.", 0));
        s.shader.defines = "#define NACRE_DIFFUSE_MODEL 1\n";
        s.on_host = {};
        add_samplings(s, {.f0 = glm::vec3(0.04f), .albedo = glm::vec3(0.5f)}, {0.3f});
    }
    {
        auto& s = add(closure_subject("ggx-disney", "GGX over renormalized Disney diffuse.", 0));
        s.shader.defines = "#define NACRE_DIFFUSE_MODEL 2\n";
        s.on_host = {};
        add_samplings(s, {.f0 = glm::vec3(0.04f), .albedo = glm::vec3(0.5f)}, {0.3f});
    }
    {
        auto& s = add(closure_subject("anisotropy", "Stretched GGX.", slab_anisotropy));
        s.note =
            "Compensation comes from a table of 63 KiB in four inputs, whose interpolation is off by up to 0.0025 for "
            "metals: more than the 0.001 and 0.002 that are promised elsewhere.";
        s.limits.furnace = 1.0016;
        s.limits.lossless = 0.997;
        add_furnaces(s, white_metal, true, {-0.9f, 0.3f, 0.95f, 1.0f});
        add_samplings(s, metal, {0.1f, 0.3f, 0.6f, 1.0f}, {-1.0f, -0.6f, 0.3f, 0.9f});
        s.share = 2.0;
    }
    {
        auto& s = add(closure_subject("f90", "Tinted grazing reflection.", slab_f90));
        Slab slab{.f0 = {0.9f, 0.5f, 0.2f}, .f90 = {0.2f, 1.0f, 0.6f}};
        add_furnaces(s, slab, true);
        add_samplings(s, slab, {0.3f});
    }
    {
        auto& s =
            add(closure_subject("f82", "The dip at 82 degrees, with and without a tint.", slab_f82, {}, slab_f90));
        Slab slab{.f0 = {0.9f, 0.5f, 0.2f}, .f90 = {0.2f, 1.0f, 0.6f}, .f82 = {0.3f, 0.0f, 1.0f}};
        add_furnaces(s, slab, true);
        add_samplings(s, slab, {0.3f});
    }
    {
        auto& s = add(closure_subject("second-lobe", "Two lobes, half of them made from haze.", slab_second_lobe,
                                      [](Random& random, Slab& slab) {
                                          if (random() < 0.5) return;
                                          Library library;
                                          const auto haze = library.make_haze(slab.f0.x, slab.roughness, random(),
                                                                              10.0 * slab.second_roughness);
                                          slab.f0 = glm::vec3(static_cast<float>(haze.f0));
                                          slab.second_roughness = static_cast<float>(haze.second_roughness);
                                          slab.second_weight = static_cast<float>(haze.second_weight);
                                      },
                                      slab_anisotropy));
        Slab slab{.f0 = glm::vec3(0.3f), .second_roughness = 0.8f, .second_weight = 0.4f};
        s.shader.features = slab_second_lobe;
        add_furnaces(s, slab, true);
        slab.second_roughness = 0.0f;
        add_furnaces(s, slab, true);
        slab.second_roughness = 0.7f;
        add_samplings(s, slab, {0.05f, 0.3f});
        s.shader.features |= slab_anisotropy;
    }
    {
        auto& s = add(closure_subject("fuzz", "Fibers (LTC) on an interface.", slab_fuzz));
        for (const float roughness : {0.0f, 0.3f, 1.0f})
            add_furnaces(s, {.f0 = glm::vec3(0.04f), .fuzz_amount = 1.0f, .fuzz_roughness = roughness}, true);
        for (const float roughness : {0.05f, 0.3f, 0.8f})
            add_samplings(
                s,
                {.f0 = glm::vec3(0.04f), .albedo = glm::vec3(0.2f), .fuzz_amount = 1.0f, .fuzz_roughness = roughness},
                {0.3f});
    }
    {
        auto& s = add(closure_subject("thin-film", "A film on metals and dielectrics.", slab_thin_film));
        for (const float thickness : {2e-8f, 3e-7f}) {
            add_furnaces(s, {.f0 = glm::vec3(1.0f), .albedo = glm::vec3(0.0f), .film_thickness = thickness}, true);
            add_furnaces(s, {.f0 = glm::vec3(0.1f), .film_thickness = thickness}, true);
        }
        add_samplings(s, {.f0 = glm::vec3(0.1f), .film_thickness = 3e-7f}, {0.3f});
        s.share = 2.0;
    }
    {
        auto& s = add(closure_subject("specular-table", "A tint by the angles of view and light.", slab_specular_lut));
        add_furnaces(s, white_metal, false);
        add_samplings(s, plastic, {0.3f});
    }
    {
        auto& s = add(closure_subject("glints", "A lobe of counted facets.", slab_glints,
                                      [](Random&, Slab& slab) { slab.albedo = glm::vec3(0.0f); }));
        s.counts_facets = true;
        s.tolerance = 1e-2;
        s.note =
            "A place between two cells of surface or slopes is what is left of a number of up to millions by its whole "
            "part: that costs digits. A count of facets may fall to the other side of a whole number; these points are "
            "counted, not judged. The sampler draws from the smooth lobe: its weights carry the count. Energy holds in "
            "the mean over places; at one place it is that of as many facets as lie there.";
        s.limits.furnace = 1.01;
        s.limits.lossless = 0.97;
        add_furnaces(s, {.f0 = glm::vec3(1.0f), .albedo = glm::vec3(0.0f), .glint_density = 1e30f}, true);
        add_samplings(s, {.f0 = glm::vec3(0.8f), .albedo = glm::vec3(0.0f), .glint_density = 1e6f}, {0.3f});
    }
    struct Regime {
        const char* name;
        const char* what;
        double low, high;
    };
    for (const Regime& regime :
         {Regime{"medium-opaque", "A medium of an optical depth from 1e3 to 1e18.", 3.0, 18.0},
          Regime{"medium-thick", "A medium of an optical depth from 4 to 1e4, or without a far side.", 0.6, 4.0},
          Regime{"medium-thin", "A medium of an optical depth from 1e-3 to 10.", -3.0, 1.0},
          Regime{"medium-empty", "A medium of an optical depth from nothing to 1e-2.", -18.0, -2.0}}) {
        auto& s = add(closure_subject(regime.name, regime.what, slab_medium, [regime](Random& random, Slab& slab) {
            set_depth(random, slab, regime.low, regime.high);
            const bool is_opaque = regime.high > 10.0, is_empty = regime.low < -10.0;
            if (is_opaque && random() < 0.1) slab.mean_free_path = glm::vec3(random() < 0.5 ? 0.0f : 1e-40f);
            if (is_empty && random() < 0.1) slab.mean_free_path = glm::vec3(std::numeric_limits<float>::infinity());
            if (is_empty && random() < 0.1) slab.thickness = random() < 0.5 ? 0.0f : 1e-40f;
            if (regime.low > 0.0 && regime.low < 1.0 && random() < 0.3)
                slab.thickness = std::numeric_limits<float>::infinity();
        }));
        for (const double depth : {regime.low, 0.5 * (regime.low + regime.high), regime.high}) {
            for (const float phase : {0.0f, 0.8f, -0.8f}) {
                Slab slab{.f0 = glm::vec3(0.04f), .phase_anisotropy = phase, .thickness = 1e-3f};
                slab.mean_free_path = glm::vec3(static_cast<float>(1e-3 / std::pow(10.0, depth)));
                slab.features = slab_medium;
                slab.roughness = 0.4f;
                for (const double cosine : view_cosines()) s.furnaces.push_back({slab, cosine, 0.3, true});
            }
        }
        Slab slab{.f0 = glm::vec3(0.04f), .albedo = {0.9f, 0.7f, 0.8f}, .thickness = 1e-3f};
        slab.mean_free_path = glm::vec3(static_cast<float>(1e-3 / std::pow(10.0, 0.5 * (regime.low + regime.high))));
        add_samplings(s, slab, {0.4f});
    }
    {
        auto& s = add(closure_subject("view-coverage", "Coverage that turns with the view.", slab_edge_coverage,
                                      [](Random& random, Slab& slab) {
                                          slab.coverage = random() < 0.3 ? 0.0f : static_cast<float>(random());
                                          slab.edge_exponent = static_cast<float>(std::pow(10.0, random(-3.0, 2.0)));
                                      }));
        add_furnaces(s, plastic, true);
    }
    {
        const std::uint32_t all = slab_anisotropy | slab_f90 | slab_f82 | slab_second_lobe | slab_fuzz |
                                  slab_thin_film | slab_specular_lut | slab_medium | slab_edge_coverage;
        auto& s = add(closure_subject("everything", "Slabs with any of all features but glints.", 0, {}, all));
        s.shader.features = slab_anisotropy | slab_second_lobe | slab_fuzz;
        const Slab slab{.f0 = {0.5f, 0.2f, 0.1f},
                        .albedo = {0.1f, 0.6f, 0.2f},
                        .second_roughness = 0.7f,
                        .second_weight = 0.4f,
                        .fuzz_amount = 0.5f,
                        .fuzz_roughness = 0.3f};
        add_samplings(s, slab, {0.1f, 0.5f}, {0.5f});
        s.shader.features = all;
        // As many random slabs as are worth while.
        Random random(4);
        for (int i = 0; i < 300; ++i) {
            FurnaceCase furnace{random_slab(random, all & ~(slab_anisotropy | slab_specular_lut))};
            furnace.cosine = random_direction(random).z;
            s.furnaces.push_back(furnace);
        }
        s.share = 4.0;
    }
    for (StabilitySubject& subject : subjects) subject.shader.name = subject.name;
    return subjects;
}

}  // namespace nacre::measure
