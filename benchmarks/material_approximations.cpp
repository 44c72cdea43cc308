// SPDX-License-Identifier: Apache-2.0
/// @file
/// Error against run time of what the closures approximate, on the host in double precision on one thread:
///
///     material_approximations_benchmark [--json FILE]
///
/// Each row: the approximation, its mean and largest error against what is named, and nanoseconds for one evaluation
/// (the median of nine runs).

#include <algorithm>
#include <array>
#include <chrono>
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "materials/evaluation.h"
#include "materials/layering_error.h"
#include "materials/reference_stacks.h"
#include "materials/tables/interface_table_generator.h"

namespace {

using namespace nacre::materials;
using closures::Library;

double uniform(std::mt19937& random) { return static_cast<double>(random() >> 8) * 0x1p-24; }
glm::dvec3 view_at(double cosine) { return {std::sqrt(1.0 - cosine * cosine), 0.0, cosine}; }

// Nanoseconds for one call of `work` with 0 to count - 1; the sum of the results keeps it from being left out.
template <typename Work>
double nanoseconds(int count, const Work& work) {
    std::array<double, 9> runs{};
    volatile double sink = 0.0;
    for (double& run : runs) {
        double sum = 0.0;
        const auto start = std::chrono::steady_clock::now();
        for (int i = 0; i < count; ++i) sum += work(i);
        run = std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count() / count;
        sink = sink + sum;
    }
    std::ranges::nth_element(runs, runs.begin() + 4);
    return runs[4];
}

struct Errors {
    double sum = 0.0, largest = 0.0;
    int count = 0;
    void add(double error) {
        sum += std::abs(error);
        largest = std::max(largest, std::abs(error));
        ++count;
    }
};

class Report {
  public:
    Report() { std::printf("%-40s %-44s %9s %9s %11s\n", "approximation", "against", "mean", "largest", "ns"); }
    void add(const std::string& what, const std::string& against, const Errors& errors, double time) {
        const double mean = errors.sum / std::max(errors.count, 1);
        std::printf("%-40s %-44s %9.5f %9.5f %11.1f\n", what.c_str(), against.c_str(), mean, errors.largest, time);
        std::fflush(stdout);
        rows_.push_back({{"approximation", what},
                         {"against", against},
                         {"mean_error", mean},
                         {"largest_error", errors.largest},
                         {"nanoseconds", time}});
    }
    [[nodiscard]] const nlohmann::ordered_json& rows() const { return rows_; }

  private:
    nlohmann::ordered_json rows_ = nlohmann::ordered_json::array();
};

// One closure for each slab, against walks of ever more paths: what a value of the directional albedo costs.
void layers(Report& report) {
    Errors closures;
    std::vector<Errors> walks(3);
    constexpr std::array<std::uint32_t, 3> paths{16, 256, 4096};
    std::vector<FlattenedTree> stacks;
    for (const Tree& stack : reference_stacks()) stacks.push_back(*flatten(stack));
    for (const FlattenedTree& stack : stacks) {
        const RandomWalk walk(stack);
        for (const double cosine : LayeringError::cosines) {
            const glm::dvec3 view = view_at(cosine), exact = walk.albedo(view, 65536, 1).reflected;
            const glm::dvec3 seen = directional_albedo(shade(stack, view));
            for (int channel = 0; channel < 3; ++channel) closures.add(seen[channel] - exact[channel]);
            for (std::size_t i = 0; i < paths.size(); ++i) {
                const glm::dvec3 rough = walk.albedo(view, paths[i], 2).reflected;
                for (int channel = 0; channel < 3; ++channel) walks[i].add(rough[channel] - exact[channel]);
            }
        }
    }
    const std::string against = "walk of 65536 paths, albedo of the five stacks";
    report.add("one closure for each slab", against, closures, nanoseconds(2000, [&](int i) {
                   return shade(stacks[i % stacks.size()], view_at(0.1 + 0.8 * (i % 97) / 97.0)).whole.albedo.x;
               }));
    for (std::size_t i = 0; i < paths.size(); ++i) {
        std::vector<RandomWalk> walk;
        for (const FlattenedTree& stack : stacks) walk.emplace_back(stack);
        report.add(
            "all paths, " + std::to_string(paths[i]) + " of them by chance", against, walks[i],
            nanoseconds(10, [&](int k) {
                return walk[static_cast<std::size_t>(k) % walk.size()].albedo(view_at(0.6), paths[i]).reflected.x;
            }));
    }
}

// The table of what a GGX lobe's single scattering misses, in the coordinates of materials/tables/interface_table.h.
void tables(Report& report) {
    closures::Lobes lobes;
    struct Point {
        double cosine, alpha, missing;
    };
    std::vector<Point> points;
    std::mt19937 random(1);
    for (int i = 0; i < 400; ++i) {
        const double cosine = 0.02 + 0.98 * uniform(random), roughness = 0.05 + 0.95 * uniform(random);
        const double alpha = roughness * roughness;
        points.push_back({cosine, alpha, 1.0 - ggx_albedo(view_at(cosine), glm::dvec2(alpha), 160).total});
    }
    for (const int columns : {8, 16, 32, 64}) {
        const int rows = columns * 3 / 2;
        std::vector<double> table;
        for (int row = 0; row < rows; ++row) {
            const double roughness = std::max(row / (rows - 1.0), 2e-3), alpha = roughness * roughness;
            for (int column = 0; column < columns; ++column) {
                const double cosine = std::max(lobes.ggx_table_cosine(column / (columns - 1.0), alpha), 1e-9);
                const double missing = 1.0 - ggx_albedo(view_at(cosine), glm::dvec2(alpha), 96).total;
                table.push_back(std::round(std::clamp(missing, 0.0, 1.0) * 65535.0) / 65535.0);
            }
        }
        const auto read = [&](double cosine, double alpha) {
            const double x = lobes.ggx_table_coordinate(cosine, alpha) * (columns - 1),
                         y = std::sqrt(alpha) * (rows - 1);
            const int i = std::min(static_cast<int>(x), columns - 2), k = std::min(static_cast<int>(y), rows - 2);
            const double* at = &table[static_cast<std::size_t>(k * columns + i)];
            return std::lerp(std::lerp(at[0], at[1], x - i), std::lerp(at[columns], at[columns + 1], x - i), y - k);
        };
        Errors errors;
        for (const Point& point : points) errors.add(read(point.cosine, point.alpha) - point.missing);
        report.add("energy table of " + std::to_string(columns) + " x " + std::to_string(rows) + ", " +
                       std::to_string(2 * columns * rows) + " bytes",
                   "quadrature, albedo with F = 1", errors, nanoseconds(200000, [&](int i) {
                       const Point& point = points[static_cast<std::size_t>(i) % points.size()];
                       return read(point.cosine, point.alpha);
                   }));
    }
}

// Lobes that should send out all of a white light: how far they are off. Cosines from 0.05.
template <typename Value>
void lobe(Report& report, const std::string& name, const std::string& against, double target, const Value& value) {
    Errors errors;
    for (double roughness = 0.1; roughness <= 1.0; roughness += 0.15) {
        for (const double cosine : {1.0, 0.7, 0.4, 0.2, 0.05}) {
            const glm::dvec3 view = view_at(cosine);
            errors.add(hemisphere_integral(48, [&](glm::dvec3 light) { return value(view, light, roughness); }) -
                       (target >= 0.0 ? target : Library{}.sheen_albedo(cosine, roughness)));
        }
    }
    std::vector<glm::dvec3> lights;
    std::mt19937 random(2);
    for (int i = 0; i < 256; ++i) {
        const double u = uniform(random), v = uniform(random);
        lights.push_back(Library{}.cosine_direction(u, v));
    }
    report.add(name, against, errors, nanoseconds(100000, [&](int i) {
                   return value(lights[static_cast<std::size_t>(i) % 256],
                                lights[static_cast<std::size_t>(i) * 7 % 256], 0.1 + 0.8 * (i % 13) / 13.0);
               }));
}

void lobes(Report& report) {
    Library library;
    using Vector = glm::dvec3;
    const std::string white = "white light, albedo 1";
    lobe(report, "Lambert", white, 1.0, [&](Vector, Vector light, double) { return library.lambert_diffuse(light); });
    lobe(report, "renormalized Disney", white, 1.0,
         [&](Vector view, Vector light, double roughness) { return library.disney_diffuse(view, light, roughness); });
    lobe(report, "Chan as published", white, 1.0, [&](Vector view, Vector light, double roughness) {
        return library.chan_diffuse(view, light, library.chan_gloss(roughness));
    });
    const auto chan = [&](Vector view, Vector light, double roughness) {
        const double gloss = library.chan_gloss(roughness);
        return library.chan_diffuse(view, light, gloss) / library.chan_albedo_by_table(view.z, gloss);
    };
    lobe(report, "Chan over its albedo", white, 1.0, chan);
    // What is sent elsewhere counts twice: where it lacks and where it is too much. The time is that of both.
    lobe(report, "Lambert, by directions", "Chan over its albedo", 0.0,
         [&](Vector view, Vector light, double roughness) {
             return std::abs(library.lambert_diffuse(light) - chan(view, light, roughness));
         });
    const std::string sheen = "albedo of the volumetric fit (Zeltner 2022)";
    lobe(report, "sheen by linearly transformed cosines", sheen, -1.0,
         [&](Vector view, Vector light, double roughness) {
             return library.sheen_albedo(view.z, roughness) *
                    library.sheen_density(library.sheen_map(view, roughness), light);
         });
    lobe(report, "Charlie, Neubelt's visibility", sheen, -1.0, [&](Vector view, Vector light, double roughness) {
        return library.charlie_distribution(library.half_vector(view, light), roughness) *
               library.neubelt_visibility(view.z, light.z) * light.z;
    });
    lobe(report, "Charlie, own visibility", sheen, -1.0, [&](Vector view, Vector light, double roughness) {
        return library.charlie_distribution(library.half_vector(view, light), roughness) *
               library.charlie_visibility(view.z, light.z, roughness, false) * light.z;
    });
}

// Both models of fuzz as closures use them: prepared once for each view, then evaluated for each light.
void fuzz(Report& report) {
    Library library;
    std::vector<glm::dvec3> lights;
    std::mt19937 random(4);
    for (int i = 0; i < 256; ++i) {
        const double u = uniform(random), v = uniform(random);
        lights.push_back(library.cosine_direction(u, v));
    }
    const auto light = [&](int i) { return lights[static_cast<std::size_t>(i) % 256]; };
    const auto roughness = [](int i) { return 0.1 + 0.9 * (i % 13) / 13.0; };
    Errors errors, energy;
    for (double r = 0.1; r <= 1.0; r += 0.15) {
        for (const double cosine : {1.0, 0.7, 0.4, 0.2, 0.05}) {
            const glm::dvec3 view = view_at(cosine);
            const auto map = library.sheen_map(view, r);
            const auto lobe = library.make_charlie_lobe(cosine, r);
            const auto charlie = [&](glm::dvec3 l) {
                return library.charlie_value(lobe, l.z, library.half_vector(view, l));
            };
            errors.add(library.sheen_albedo(cosine, r) * hemisphere_integral(96, [&](glm::dvec3 l) {
                           return std::abs(charlie(l) - library.sheen_density(map, l));
                       }));
            energy.add(library.sheen_albedo(cosine, r) * (hemisphere_integral(96, charlie) - 1.0));
        }
    }
    report.add("fuzz by mapped cosines, preparation", "itself", {},
               nanoseconds(100000, [&](int i) { return library.sheen_map(light(i), roughness(i)).scale; }));
    report.add("fuzz by mapped cosines, a light", "itself", {}, nanoseconds(100000, [&](int i) {
                   static const auto map = library.sheen_map(view_at(0.6), 0.4);
                   return library.sheen_density(map, light(i));
               }));
    report.add("fuzz by Charlie, preparation", "mapped cosines, energy of white fuzz", energy,
               nanoseconds(100000, [&](int i) { return library.make_charlie_lobe(light(i).z, roughness(i)).scale; }));
    report.add("fuzz by Charlie, a light", "mapped cosines, what differs of white fuzz", errors,
               nanoseconds(100000, [&](int i) {
                   static const auto lobe = library.make_charlie_lobe(0.6, 0.4);
                   // The half vector is there already.
                   return library.charlie_value(lobe, light(i).z, light(i + 7));
               }));
}

// What the G-buffer's bits do to a plain slab: F0 and sRGB-encoded albedo with 7, 7 and 6 bits, roughness with 8.
void packing(Report& report) {
    Library library;
    const auto rounded = [](float value, int bits) {
        const float steps = static_cast<float>((1 << bits) - 1);
        return std::round(value * steps) / steps;
    };
    constexpr std::array<int, 3> bits{7, 7, 6};
    const auto packed = [&](Slab slab) {
        for (int channel = 0; channel < 3; ++channel) {
            slab.f0[channel] = rounded(slab.f0[channel], bits[static_cast<std::size_t>(channel)]);
            slab.albedo[channel] = std::pow(
                rounded(std::pow(slab.albedo[channel], 1.0f / 2.2f), bits[static_cast<std::size_t>(channel)]), 2.2f);
        }
        slab.roughness = rounded(slab.roughness, 8);
        return slab;
    };
    std::mt19937 random(3);
    std::vector<Slab> slabs;
    for (int i = 0; i < 512; ++i) {
        Slab slab;
        for (int channel = 0; channel < 3; ++channel) {
            slab.f0[channel] = static_cast<float>(uniform(random));
            slab.albedo[channel] = static_cast<float>(uniform(random));
        }
        slab.roughness = static_cast<float>(0.1 + 0.9 * uniform(random));
        slabs.push_back(slab);
    }
    const auto albedo = [&](const Slab& slab, double cosine) {
        const auto lobes =
            library.closure_albedo(library.prepare_closure(Library::slab_of(slab), view_at(cosine), 1e-3));
        return lobes.specular + lobes.diffuse;
    };
    Errors errors;
    for (const Slab& slab : slabs) {
        for (const double cosine : {1.0, 0.5, 0.1}) {
            const glm::dvec3 difference = albedo(packed(slab), cosine) - albedo(slab, cosine);
            for (int channel = 0; channel < 3; ++channel) errors.add(difference[channel]);
        }
    }
    const auto run = [&](bool is_packed) {
        return nanoseconds(20000, [&](int i) {
            const Slab& slab = slabs[static_cast<std::size_t>(i) % slabs.size()];
            return albedo(is_packed ? packed(slab) : slab, 0.5).x;
        });
    };
    report.add("slab rounded to 48 bits", "slab in floats, albedo", errors, run(true));
    report.add("slab in floats", "itself", {}, run(false));
}

}  // namespace

int main(int count, char** arguments) {
    std::string json;
    CLI::App app("Error against run time of what the closures approximate.");
    app.add_option("--json", json, "File for all figures");
    CLI11_PARSE(app, count, arguments);
    Report report;
    layers(report);
    tables(report);
    lobes(report);
    fuzz(report);
    packing(report);
    if (!json.empty()) std::ofstream(json) << nlohmann::ordered_json{{"rows", report.rows()}}.dump(2) << '\n';
}
