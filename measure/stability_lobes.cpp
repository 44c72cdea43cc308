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

/// What the shaders read, in this order. Meters; the rest is of order 1.
struct LobePoint {
    glm::vec3 view, light;
    float roughness, anisotropy;
    glm::vec3 color;
    glm::vec2 random;
    float mean_free_path, distance;
};
constexpr std::uint32_t point_words = sizeof(LobePoint) / 4;

constexpr const char* point_text = R"(
struct LobePoint {
    vec3 view;
    vec3 light;
    float roughness;
    float anisotropy;
    vec3 color;
    vec2 random;
    float mean_free_path;
    float distance;
    uint at;
};
// A relative defect, where it counts.
float defect(float a, float b, float scale) { return max(abs(a - b) - 1e-7 * scale, 0.0) / max(max(a, b), 1e-30); }
)";

void make_lobe_point(Random& random, std::uint32_t* words) {
    const auto unit = [&] {
        const double kind = random();
        if (kind < 0.12) return 0.0f;
        if (kind < 0.24) return 1.0f;
        if (kind < 0.27) return 1e-40f;
        if (kind < 0.4) return static_cast<float>(std::pow(10.0, random(-7.0, -1.0)));
        if (kind < 0.45) return 1.0f - static_cast<float>(std::pow(10.0, random(-7.0, -1.0)));
        return static_cast<float>(random());
    };
    LobePoint point{};
    const glm::dvec3 view = random_direction(random);
    point.view = view;
    point.light = random_light(random, view);
    point.roughness = unit();
    point.anisotropy = unit() * (random() < 0.5 ? -1.0f : 1.0f);
    point.color = {unit(), unit(), unit()};
    point.random = {std::min(unit(), 1.0f - 0x1p-24f), std::min(unit(), 1.0f - 0x1p-24f)};
    const auto meters = [&] {
        const double kind = random();
        return kind < 0.05 ? 0.0f : kind < 0.1 ? std::numeric_limits<float>::infinity()
                                               : static_cast<float>(std::pow(10.0, random(-9.0, 9.0)));
    };
    point.mean_free_path = meters();
    point.distance = random() < 0.7 && std::isfinite(point.mean_free_path)
                       ? point.mean_free_path * static_cast<float>(std::pow(10.0, random(-8.0, 3.0)))
                       : meters();
    put_point(point, words);
}

std::string describe_lobe(const std::uint32_t* words) {
    const LobePoint p = point_of<LobePoint>(words);
    return fmt::format(
        "roughness {:.9g}, anisotropy {:.9g}, color {:.9g} {:.9g} {:.9g}, random {:.9g} {:.9g}, mean free path {:.9g} "
        "m, "
        "length {:.9g} m; view {:.9g} {:.9g} {:.9g}, light {:.9g} {:.9g} {:.9g}",
        p.roughness, p.anisotropy, p.color.x, p.color.y, p.color.z, p.random.x, p.random.y, p.mean_free_path,
        p.distance, p.view.x, p.view.y, p.view.z, p.light.x, p.light.y, p.light.z);
}

// `body`: statements of `void evaluate(LobePoint p)` that put one number for each of `results`.
StabilitySubject lobe_subject(std::string name, std::string what, const char* includes, const char* body,
                              std::vector<ResultKind> results) {
    StabilitySubject subject{.name = std::move(name), .what = std::move(what), .results = std::move(results)};
    std::string main;
    for (const EmbeddedFile& file : embedded_files())
        if (file.path == "measure/stability_lobe.glsl") main = file.text;
    subject.shader = {.name = subject.name,
                      .text = fmt::format("{}\n{}\nvoid evaluate(LobePoint p) {{\n{}\n}}\n{}", includes, point_text,
                                          body, main),
                      .point_words = point_words,
                      .result_words = static_cast<std::uint32_t>(subject.results.size())};
    subject.share = 0.4;
    subject.make_point = make_lobe_point;
    subject.describe = describe_lobe;
    subject.lower_cosine = [](const std::uint32_t* words) {
        const LobePoint p = point_of<LobePoint>(words);
        return static_cast<double>(std::min(p.view.z, p.light.z));
    };
    return subject;
}

// Smallest and largest albedo of a lobe (value times the cosine of light) over views and roughnesses.
template <typename Lobe>
std::function<Expected<std::pair<double, double>>(bool)> furnace_of(const Lobe& lobe, double smoothest = 0.0) {
    return [=](bool is_short) -> Expected<std::pair<double, double>> {
        double smallest = 1e9, largest = 0.0;
        const int rings = is_short ? 64 : 192;
        for (const double roughness : roughnesses()) {
            if (roughness < smoothest) continue;
            for (const double cosine : view_cosines()) {
                const glm::dvec3 view = direction(cosine, 0.0);
                double sum = 0.0;
                for (int i = 0; i < rings; ++i) {
                    // Rings crowd along the surface and around the normal.
                    const double s = (i + 0.5) / rings, z = s * s * (3.0 - 2.0 * s),
                                 width = 6.0 * s * (1.0 - s) / rings;
                    for (int j = 0; j < rings; ++j) {
                        // Azimuths crowd around the plane of the view, of which one half counts for both.
                        const double t = (j + 0.5) / rings, phi = std::numbers::pi * t * t * (3.0 - 2.0 * t);
                        sum += 2.0 * lobe(view, direction(z, phi), roughness) * width * 6.0 * t * (1.0 - t) *
                               std::numbers::pi / rings;
                    }
                }
                smallest = std::min(smallest, sum);
                largest = std::max(largest, sum);
            }
        }
        return std::pair{smallest, largest};
    };
}

// GGX as in textbooks, in double precision: all that cancels in 32 bits does no harm here.
double textbook_ggx(const glm::dvec3& h, double alpha_x, double alpha_y) {
    const double sum = h.x * h.x / (alpha_x * alpha_x) + h.y * h.y / (alpha_y * alpha_y) + h.z * h.z;
    return 1.0 / (std::numbers::pi * alpha_x * alpha_y * sum * sum);
}

double textbook_lambda(const glm::dvec3& w, double alpha_x, double alpha_y) {
    const double tan2 = (alpha_x * alpha_x * w.x * w.x + alpha_y * alpha_y * w.y * w.y) / (w.z * w.z);
    return 0.5 * (std::sqrt(1.0 + tan2) - 1.0);
}

}  // namespace

std::vector<StabilitySubject> lobe_subjects() {
    using enum ResultKind;
    std::vector<StabilitySubject> subjects;
    const auto add = [&](StabilitySubject subject) -> StabilitySubject& {
        return subjects.emplace_back(std::move(subject));
    };
    {
        auto& s = add(lobe_subject("lobe-ggx", "The GGX lobe alone, single scattering, without Fresnel; stretched too.",
                                   "#include \"materials/closures/ggx.glsl\"", R"(
    vec2 alpha = ggx_alpha(p.roughness, p.anisotropy);
    float view_length = ggx_stretched_length(p.view, alpha);
    float light_length = ggx_stretched_length(p.light, alpha);
    vec3 h = half_vector(p.view, p.light);
    float value = ggx_value(p.view, view_length, p.light, h, alpha);
    put(p.at, value);
    put(p.at + 1u, ggx_pdf(p.view, view_length, p.light, h, alpha));
    put(p.at + 9u, 0.0);
#ifdef CANDIDATE
    vec3 sampled = ggx_sample(p.view, view_length, alpha, p.random.x, p.random.y);
    put3(p.at + 2u, sampled);
    float back = ggx_value(p.light, light_length, p.view, h, alpha);
    put(p.at + 7u, defect(value / p.light.z, back / p.view.z, value / p.light.z));
#else
    uint from = p.at + 2u;
    vec3 sampled = vec3(candidates[from], candidates[from + 1u], candidates[from + 2u]);
    put(p.at + 9u, 1.0 + ggx_pdf(p.view, view_length, p.light, h, alpha));
#endif
    vec3 sampled_h = half_vector(p.view, sampled);
    float pdf = ggx_pdf(p.view, view_length, sampled, sampled_h, alpha);
    float weight = ggx_weight(p.view, view_length, sampled, alpha);
    put(p.at + 5u, weight);
    put(p.at + 6u, pdf);
#ifdef CANDIDATE
    put(p.at + 8u, defect(weight * pdf, ggx_value(p.view, view_length, sampled, sampled_h, alpha), 1.0 + pdf));
#endif
    put(p.at + 10u, 1.0 + pdf);)",
                                   {lobe, lobe, direction, direction, direction, weight, density, reciprocity,
                                    agreement, light_scale, sample_scale}));
        s.closed_form = [](const std::uint32_t* words, double* values) {
            const LobePoint p = point_of<LobePoint>(words);
            const double alpha = static_cast<double>(p.roughness) * p.roughness, a = p.anisotropy;
            const double alpha_x = std::clamp(alpha * (1.0 + a), 1e-4, 1.0),
                         alpha_y = std::clamp(alpha * (1.0 - a), 1e-4, 1.0);
            const glm::dvec3 v = p.view, l = p.light, sum = v + l;
            const glm::dvec3 h = sum / glm::length(sum);
            const double distribution = textbook_ggx(h, alpha_x, alpha_y);
            const double lambda_v = textbook_lambda(v, alpha_x, alpha_y),
                         lambda_l = textbook_lambda(l, alpha_x, alpha_y);
            values[0] = distribution / (1.0 + lambda_v + lambda_l) / (4.0 * v.z);
            // Visible normals over the Jacobian of the reflection.
            values[1] = distribution / (1.0 + lambda_v) / (4.0 * v.z);
        };
        s.limits = {.reciprocity = 1e-4, .weight = 1.0 + 1e-5};
        // Weights are at most 1: the mean of what single scattering keeps.
        s.furnace = [](bool is_short) -> Expected<std::pair<double, double>> {
            Library library;
            double smallest = 1.0, largest = 0.0;
            const int strata = is_short ? 32 : 128;
            for (const double roughness : roughnesses()) {
                const glm::dvec2 alpha = library.ggx_alpha(roughness, 0.0);
                for (const double cosine : view_cosines()) {
                    const glm::dvec3 view = measure::direction(cosine, 0.3);
                    const double length = library.ggx_stretched_length(view, alpha);
                    double sum = 0.0;
                    for (int i = 0; i < strata * strata; ++i) {
                        const glm::dvec3 light = library.ggx_sample(view, length, alpha, (i / strata + 0.5) / strata,
                                                                    (i % strata + 0.5) / strata);
                        sum += library.ggx_weight(view, length, light, alpha);
                    }
                    smallest = std::min(smallest, sum / (strata * strata));
                    largest = std::max(largest, sum / (strata * strata));
                }
            }
            return std::pair{smallest, largest};
        };
        s.share = 2.0;
    }
    {
        auto& s = add(lobe_subject("lobe-chan", "Chan's diffuse model as published, without its normalization.",
                                   "#include \"materials/closures/diffuse.glsl\"", R"(
    float gloss = chan_gloss(p.roughness);
    float value = chan_diffuse(p.view, p.light, gloss);
    put(p.at, value);
    put(p.at + 1u, lambert_diffuse(p.light));
    put(p.at + 2u, chan_albedo(p.view.z, gloss, p.color.x));
    put(p.at + 3u, gloss);
    put(p.at + 4u, defect(value / p.light.z, chan_diffuse(p.light, p.view, gloss) / p.view.z, 1.0));)",
                                   {share, share, share, share, reciprocity}));
        s.limits = {.furnace = StabilityLimits::none, .reciprocity = 1e-4};
        s.note = "As published it sends out more than it gets: closures divide by its albedo.";
        s.furnace = furnace_of([](const glm::dvec3& view, const glm::dvec3& light, double roughness) {
            Library library;
            return library.chan_diffuse(view, light, library.chan_gloss(roughness));
        });
    }
    {
        auto& s = add(lobe_subject("fresnel", "Schlick's curve with F90 and F82, its complement and means.",
                                   "#include \"materials/closures/fresnel.glsl\"", R"(
    Fresnel fresnel = make_fresnel(p.color, vec3(p.roughness, 1.0, abs(p.anisotropy)), vec3(p.random.x, 1.0, p.random.y));
    float c = half_vector_cosine(p.view, p.light);
    put3(p.at, fresnel_reflectance(fresnel, c));
    put3(p.at + 3u, fresnel_transmittance(fresnel, c));
    put3(p.at + 6u, fresnel_mean(fresnel));
    put3(p.at + 9u, fresnel_mean_transmittance(fresnel));
    put(p.at + 12u, refracted_cosine(p.view.z, p.color.x));
    put(p.at + 13u, reflectance_under(p.color.x, 1.0 + p.color.y));
    put(p.at + 14u, ior_to_reflectance(reflectance_to_ior(p.color.x)));)",
                                   std::vector<ResultKind>(15, share)));
        s.closed_form = [](const std::uint32_t* words, double* values) {
            const LobePoint p = point_of<LobePoint>(words);
            // Snell's law, and the index there and back.
            const double root = std::sqrt(std::min(static_cast<double>(p.color.x), 0.98));
            const double ior = (1.0 + root) / (1.0 - root), z = p.view.z;
            values[12] = std::sqrt(1.0 - (1.0 - z * z) / (ior * ior));
            values[14] = std::min(static_cast<double>(p.color.x), 0.98);
            const double c = std::min(0.5 * glm::length(glm::dvec3(p.view) + glm::dvec3(p.light)), 1.0);
            if (p.random.x == 1.0f && p.color.x >= 0.02f && p.roughness == 1.0f)
                values[0] = p.color.x + (1.0 - p.color.x) * std::pow(1.0 - c, 5.0);
        };
    }
    {
        auto& s = add(lobe_subject("lobe-film", "Reflectance of a thin film, and of the curve through it.",
                                   "#include \"materials/closures/thin_film.glsl\"", R"(
    float thickness = p.distance;
    float ior = 1.0 + p.random.x;
    // The cosines that the curve through it asks for.
    float c = max(p.view.z, 0.1);
    FilmShares shares = film_shares(p.color, thickness, ior, c);
    put3(p.at, shares.passed);
    Fresnel fresnel = make_film_fresnel(make_fresnel(p.color, vec3(1.0), vec3(1.0)), thickness, ior, c);
    put3(p.at + 3u, fresnel.normal);
    put3(p.at + 6u, fresnel_reflectance(fresnel, p.light.z));
    put3(p.at + 9u, vec3(shares.passed.x < 0.5 ? 1.0 - shares.passed.x : shares.reflected.x,
                         shares.passed.y < 0.5 ? 1.0 - shares.passed.y : shares.reflected.y,
                         shares.passed.z < 0.5 ? 1.0 - shares.passed.z : shares.reflected.z));)",
                         std::vector<ResultKind>(12, share)));
        // What a shader makes of a point must be the same in both precisions.
        s.make_point = [](Random& random, std::uint32_t* words) {
            make_lobe_point(random, words);
            auto point = point_of<LobePoint>(words);
            point.distance = point.roughness * 1e-6f;
            point.random.x = std::round(point.random.x * 1024.0f) / 1024.0f;
            put_point(point, words);
        };
    }
    {
        auto& s = add(lobe_subject("lobe-fuzz", "The fibers' map: density, sample and albedo.",
                                   "#include \"materials/closures/fuzz.glsl\"", R"(
    SheenMap map = sheen_map(p.view, p.roughness);
    float value = sheen_density(map, p.light);
    put(p.at, value);
    put(p.at + 1u, sheen_albedo(p.view.z, p.roughness));
#ifdef CANDIDATE
    vec3 sampled = sheen_sample(map, p.random.x, p.random.y);
    put3(p.at + 2u, sampled);
    put(p.at + 5u, sheen_density(map, sampled));
#else
    uint from = p.at + 2u;
    put(p.at + 5u, sheen_density(map, vec3(candidates[from], candidates[from + 1u], candidates[from + 2u])));
    put(p.at + 6u, 1.0 + value);
    put(p.at + 7u, 1.0 + sheen_density(map, vec3(candidates[from], candidates[from + 1u], candidates[from + 2u])));
#endif)",
                                   {lobe, share, direction, direction, direction, density, light_scale, sample_scale}));
        s.furnace = furnace_of([](const glm::dvec3& view, const glm::dvec3& light, double roughness) {
            Library library;
            return library.sheen_albedo(view.z, roughness) *
                   library.sheen_density(library.sheen_map(view, roughness), light);
        });
    }
    {
        auto& s = add(lobe_subject("medium", "What a layer of a medium reflects and lets through, at any depth.",
                                   "#include \"materials/closures/medium.glsl\"", R"(
    Scattering s = medium_scattering(p.color.x, 1.0 - p.color.x, optical_depth(p.mean_free_path, p.distance), 0.99 * p.anisotropy, p.view.z);
    put(p.at, s.reflected);
    put(p.at + 1u, s.through);
    put(p.at + 2u, s.straight);
    put(p.at + 3u, s.opaque);
    put(p.at + 4u, subsurface_share(p.color.x, p.mean_free_path, p.distance));)",
                                   std::vector<ResultKind>(5, share)));
        s.shader.features = materials::slab_medium;
        s.shader.has_tables = true;
        s.closed_form = [](const std::uint32_t* words, double* values) {
            const LobePoint p = point_of<LobePoint>(words);
            if (p.anisotropy > -1e-3f && std::isfinite(p.mean_free_path) && std::isfinite(p.distance) &&
                p.mean_free_path > 0.0f)
                values[2] = std::exp(-static_cast<double>(p.distance) / p.mean_free_path / p.view.z);
        };
        s.share = 1.0;
    }
    {
        auto& s = add(lobe_subject("medium-conversions",
                                   "Mean free path, transmittance, albedo inversion and their ways back.",
                                   "#include \"materials/closures/medium.glsl\"", R"(
    put(p.at, medium_transmittance(p.mean_free_path, p.distance));
    put(p.at + 1u, medium_transmittance(transmittance_to_mean_free_path(max(p.color.x, 1e-6), max(p.random.x, 1e-6)),
                                        max(p.random.x, 1e-6)));
    put(p.at + 2u, medium_albedo(medium_similarity(p.color.y, 1.0 - p.color.y)));
    put(p.at + 3u, medium_similarity(p.color.y, 1.0 - p.color.y));
    put(p.at + 4u, medium_dissimilarity(p.color.y));
    put(p.at + 5u, scattering_albedo(medium_dissimilarity(p.color.y), 0.99 * p.anisotropy));)",
                                   std::vector<ResultKind>(6, share)));
        s.shader.features = materials::slab_medium;
        s.shader.has_tables = true;
        s.closed_form = [](const std::uint32_t* words, double* values) {
            const LobePoint p = point_of<LobePoint>(words);
            if (std::isfinite(p.mean_free_path) && std::isfinite(p.distance) && p.mean_free_path > 1e-12f)
                values[0] = std::exp(-static_cast<double>(p.distance) / p.mean_free_path);
            // There and back.
            values[1] = std::max(p.color.x, 1e-6f);
        };
    }
    {
        add(lobe_subject("haze", "The second lobe from a perceptual haze.",
                                   "#include \"materials/closures/haze.glsl\"", R"(
    Haze haze = make_haze(p.color.x, p.roughness, p.color.y, 10.0 * p.color.z);
    put(p.at, haze.f0);
    put(p.at + 1u, haze.second_roughness);
    // What the second lobe reflects: its share of nothing does not matter.
    put(p.at + 2u, haze.f0 * haze.second_weight);)",
                                   std::vector<ResultKind>(3, share)));
    }
    const auto add_classic = [&](const char* name, const char* what, const char* body,
                                 const auto& lobe, double smoothest) -> StabilitySubject& {
        auto& s = add(lobe_subject(name, what, "#include \"materials/closures/classic.glsl\"", body,
                                   {share, reciprocity}));
        s.furnace = furnace_of(lobe, smoothest);
        // As published: not all keep energy. Those that are not reciprocal by design write no defect.
        s.limits = {.furnace = StabilityLimits::none, .reciprocity = 1e-4};
        return s;
    };
    using Direction = glm::dvec3;
    add_classic("classic-disney", "Renormalized Disney diffuse.", R"(
    float value = disney_diffuse(p.view, p.light, p.roughness);
    put(p.at, value);
    put(p.at + 1u, defect(value / p.light.z, disney_diffuse(p.light, p.view, p.roughness) / p.view.z, 1.0));)",
                [](const Direction& view, const Direction& light, double roughness) {
                    return Library().disney_diffuse(view, light, roughness);
                },
                0.0);
    add_classic("classic-fabric", "Wrapped diffuse of fabric; not reciprocal by design.", R"(
    float value = fabric_diffuse(p.light, p.roughness, 0.5);
    put(p.at, value);
    put(p.at + 1u, 0.0);)",
                [](const Direction&, const Direction& light, double roughness) {
                    return Library().fabric_diffuse(light, roughness, 0.5);
                },
                0.0);
    add_classic("classic-kelemen", "GGX under Kelemen's visibility.", R"(
    put(p.at, min(kelemen_visibility(half_vector_cosine(p.view, p.light)) * p.light.z, 1e4));
    put(p.at + 1u, 0.0);)",
                [](const Direction& view, const Direction& light, double roughness) {
                    Library library;
                    const glm::dvec3 h = library.half_vector(view, light);
                    const double alpha = std::max(roughness * roughness, 1e-4);
                    return library.ggx_distribution(h, glm::dvec2(alpha)) *
                           library.kelemen_visibility(library.half_vector_cosine(view, light)) * light.z;
                },
                0.35);
    add_classic("classic-ashikhmin", "Ashikhmin's distribution with Neubelt's visibility.", R"(
    float distribution = ashikhmin_distribution(half_vector(p.view, p.light), max(p.roughness * p.roughness, 1e-3));
    float value = distribution * neubelt_visibility(p.view.z, p.light.z) * p.light.z;
    put(p.at, value);
    put(p.at + 1u, defect(neubelt_visibility(p.view.z, p.light.z), neubelt_visibility(p.light.z, p.view.z), 1.0));)",
                [](const Direction& view, const Direction& light, double roughness) {
                    Library library;
                    return library.ashikhmin_distribution(library.half_vector(view, light),
                                                          std::max(roughness * roughness, 1e-3)) *
                           library.neubelt_visibility(view.z, light.z) * light.z;
                },
                0.1);
    for (const bool is_softened : {false, true}) {
        add_classic(is_softened ? "classic-charlie-soft" : "classic-charlie",
                    is_softened ? "Charlie with its own visibility and softened terminator."
                                : "Charlie with its own visibility.",
                    is_softened ? R"(
    float distribution = charlie_distribution(half_vector(p.view, p.light), p.roughness);
    put(p.at, distribution * charlie_visibility(p.view.z, p.light.z, p.roughness, true) * p.light.z);
    put(p.at + 1u, 0.0);)"
                                : R"(
    float distribution = charlie_distribution(half_vector(p.view, p.light), p.roughness);
    put(p.at, distribution * charlie_visibility(p.view.z, p.light.z, p.roughness, false) * p.light.z);
    put(p.at + 1u, defect(charlie_visibility(p.view.z, p.light.z, p.roughness, false),
                          charlie_visibility(p.light.z, p.view.z, p.roughness, false), 1.0));)",
                    [is_softened](const Direction& view, const Direction& light, double roughness) {
                        Library library;
                        return library.charlie_distribution(library.half_vector(view, light), roughness) *
                               library.charlie_visibility(view.z, light.z, roughness, is_softened) * light.z;
                    },
                    0.1);
    }
    add(lobe_subject("classic-coat-f0", "F0 under a coat, as a cubic fit.",
                     "#include \"materials/closures/classic.glsl\"", R"(
    put(p.at, reflectance_under_coat_fit(p.color.x));)",
                     {share}));
    return subjects;
}

}  // namespace nacre::measure
