// SPDX-License-Identifier: Apache-2.0
#include "measure/stability.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <future>
#include <glm/geometric.hpp>
#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "core/progress.h"
#include "measure/chi_square.h"
#include "measure/stability_subject.h"

namespace nacre::measure {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint32_t batch_points = 1 << 15;
constexpr double floor_of_scale = 1e-7;
constexpr double infinity = std::numeric_limits<double>::infinity();

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Points with what was computed for them.
struct Batch {
    std::uint64_t seed = 0;
    std::uint32_t count = 0;
    std::vector<std::uint32_t> points;
    std::vector<float> parameters, candidate, reference;
};

void fill(const StabilitySubject& subject, Batch& batch) {
    Random random(batch.seed);
    const std::uint32_t groups = (batch.count + 63) / 64;
    batch.points.assign(std::size_t{groups} * 64 * subject.shader.point_words, 0u);
    // Whole workgroups run: what is behind the last point is a point as well.
    for (std::uint32_t i = 0; i < groups * 64; ++i)
        subject.make_point(random, &batch.points[std::size_t{i} * subject.shader.point_words]);
    if (subject.make_parameters) subject.make_parameters(random, groups, batch.parameters);
}

std::size_t slot_of(const StabilitySubject& subject, ResultKind kind) {
    return static_cast<std::size_t>(std::ranges::find(subject.results, kind) - subject.results.begin());
}

// The decade of a number from 10^lowest on, as a bin of `count`.
int decade_bin(double value, int lowest, int count) {
    if (!(value > 0.0)) return 0;
    if (!std::isfinite(value)) return count - 1;
    return std::clamp(static_cast<int>(std::floor(std::log10(value))) - lowest, 0, count - 1);
}

struct Worst {
    double error = 0.0;
    std::uint32_t point = 0;
    std::size_t result = 0;
    double got = 0.0, exact = 0.0;
    void add(double e, std::uint32_t p, std::size_t r, double g, double x) {
        if (!(e > error)) return;
        *this = {e, p, r, g, x};
    }
    [[nodiscard]] std::string text(const StabilitySubject& subject, const Batch& batch) const {
        if (!(error > 0.0)) return {};
        return fmt::format("result {} is {:.9g}, exactly {:.9g}: {}", result, got, exact,
                           subject.describe(&batch.points[std::size_t{point} * subject.shader.point_words]));
    }
};

StabilityFigures judge(const StabilitySubject& subject, const Batch& batch) {
    StabilityFigures figures{.points = batch.count};
    const std::size_t width = subject.results.size();
    const std::size_t light_scale = slot_of(subject, ResultKind::light_scale),
                      sample_scale = slot_of(subject, ResultKind::sample_scale),
                      no_density = slot_of(subject, ResultKind::no_density),
                      density = slot_of(subject, ResultKind::density);
    Worst worst, worst_closed, worst_host, worst_reciprocity;
    std::vector<double> closed(width);
    for (std::uint32_t i = 0; i < batch.count; ++i) {
        const std::uint32_t* const words = &batch.points[std::size_t{i} * subject.shader.point_words];
        const float* const got = &batch.candidate[i * width];
        const float* const exact = &batch.reference[i * width];
        const double at_light = light_scale < width ? std::max(1.0, double{exact[light_scale]}) : 1.0;
        const double at_sample = sample_scale < width ? std::max(1.0, double{exact[sample_scale]}) : 1.0;
        const bool is_density_known = no_density >= width || got[no_density] < 0.5f;
        const double exact_density = density < width ? exact[density] : 1.0;
        double largest = 0.0;
        for (std::size_t k = 0; k < width; ++k) {
            const ResultKind kind = subject.results[k];
            if (kind == ResultKind::light_scale || kind == ResultKind::sample_scale || kind == ResultKind::no_density)
                continue;
            const double value = got[k];
            if (!std::isfinite(value)) {
                (std::isnan(value) ? figures.nan : figures.inf) += 1;
                worst.add(infinity, i, k, value, exact[k]);
                largest = infinity;
                continue;
            }
            if (kind == ResultKind::direction) continue;
            if (value < 0.0) ++figures.negative;
            if (kind == ResultKind::reciprocity) {
                worst_reciprocity.add(value, i, k, value, 0.0);
                continue;
            }
            if (kind == ResultKind::agreement) {
                figures.agreement = std::max(figures.agreement, value);
                continue;
            }
            double scale = 1.0;
            if (kind == ResultKind::lobe) scale = at_light;
            if (kind == ResultKind::weight) figures.weight_max = std::max(figures.weight_max, value);
            if (kind == ResultKind::density) scale = at_sample;
            if ((kind == ResultKind::weight || kind == ResultKind::density) && !is_density_known) continue;
            // Of what is hardly ever sampled the weight does not matter.
            if (kind == ResultKind::weight && exact_density < floor_of_scale * at_sample) continue;
            const double error = std::max(std::abs(value - exact[k]) - floor_of_scale * scale, 0.0) /
                                 std::max({std::abs(double{exact[k]}), floor_of_scale * scale});
            if (!std::isfinite(exact[k])) {
                worst.add(infinity, i, k, value, exact[k]);
                continue;
            }
            if (subject.counts_facets && error > 1e-2) {
                ++figures.facets;
                continue;
            }
            ++figures.errors[decade_bin(error, -9, StabilityFigures::error_bins)];
            largest = std::max(largest, error);
            worst.add(error, i, k, value, exact[k]);
        }
        const int angle =
            decade_bin(subject.lower_cosine(words), -StabilityFigures::angle_bins, StabilityFigures::angle_bins);
        figures.error_by_angle[angle] = std::max(figures.error_by_angle[angle], largest);
        if (subject.on_host && i % 64 == 17) {
            std::ranges::fill(closed, std::numeric_limits<double>::quiet_NaN());
            const std::size_t set = subject.shader.parameter_words;
            subject.on_host(words, 1, set > 0 ? &batch.parameters[i / 64 * set] : nullptr, closed.data());
            for (std::size_t k = 0; k < width; ++k) {
                if (std::isnan(closed[k])) continue;
                const double scale = subject.results[k] == ResultKind::lobe ? at_light : 1.0;
                const double difference = std::abs(exact[k] - closed[k]);
                // Tables are unpacked in single precision on the device.
                worst_host.add(std::isnan(difference) ? infinity
                                                      : std::max(difference - floor_of_scale * scale, 0.0) /
                                                            std::max(std::abs(closed[k]), floor_of_scale * scale),
                               i, k, exact[k], closed[k]);
            }
        }
        if (subject.closed_form && i % 8 == 0) {
            std::ranges::fill(closed, std::numeric_limits<double>::quiet_NaN());
            subject.closed_form(words, closed.data());
            for (std::size_t k = 0; k < width; ++k) {
                if (std::isnan(closed[k])) continue;
                const double scale = subject.results[k] == ResultKind::lobe ? at_light : 1.0;
                worst_closed.add(std::max(std::abs(got[k] - closed[k]) - floor_of_scale * scale, 0.0) /
                                     std::max(std::abs(closed[k]), floor_of_scale * scale),
                                 i, k, got[k], closed[k]);
            }
        }
    }
    figures.host_error = worst_host.error;
    figures.host_at = worst_host.text(subject, batch);
    figures.max_rel_error = worst.error;
    figures.at = worst.text(subject, batch);
    figures.closed_error = worst_closed.error;
    figures.closed_at = worst_closed.text(subject, batch);
    figures.reciprocity = worst_reciprocity.error;
    figures.reciprocity_at = worst_reciprocity.text(subject, batch);
    return figures;
}

// Work on all cores: `function` gets the numbers below `count`.
template <typename Function>
void for_all(std::size_t count, const Function& function) {
    std::atomic<std::size_t> next{0};
    std::vector<std::jthread> threads;
    for (unsigned t = 0; t < std::max(std::thread::hardware_concurrency(), 1u); ++t)
        threads.emplace_back([&] {
            for (std::size_t i = next++; i < count; i = next++) function(i);
        });
}

void compute_reference(const StabilitySubject& subject, Batch& batch) {
    const std::size_t width = subject.results.size();
    batch.reference.resize(width * batch.count);
    for_all((batch.count + 63) / 64, [&](std::size_t group) {
        const auto first = static_cast<std::uint32_t>(64 * group);
        const std::uint32_t count = std::min(64u, batch.count - first);
        std::vector<double> values(width * count, 0.0);
        const std::size_t set = subject.shader.parameter_words;
        subject.on_host(&batch.points[std::size_t{first} * subject.shader.point_words], count,
                        set > 0 ? &batch.parameters[group * set] : nullptr, values.data());
        std::ranges::transform(values, &batch.reference[width * first],
                               [](double value) { return static_cast<float>(value); });
    });
}

// Whether a shader's large calls are made one after the other. Drivers put every function in the place of its calls,
// which takes minutes for a deep tree; of few slabs, each with its own features, that is less than once all features.
// The backend `cpu` in single precision compiles what products use.
bool defers_calls(const rhi::Device& device, const StabilitySubject& subject) {
    return subject.deferred_calls > 24 && device.desc().backend != "cpu";
}

PointShaderDesc variant(const rhi::Device& device, const StabilitySubject& subject, const char* define,
                        bool has_candidates) {
    PointShaderDesc desc = subject.shader;
    desc.defines += fmt::format("#define {} 1\n", define);
    if (defers_calls(device, subject))
        desc.defines += fmt::format("#define DEFERRED_CALLS {}u\n", subject.deferred_calls);
    desc.capacity = batch_points;
    desc.has_candidates = has_candidates;
    desc.parameter_words *= batch_points / 64;
    return desc;
}

Expected<void> measure_furnaces(const StabilitySubject& subject, bool is_short, StabilityClosure& row) {
    if (subject.furnace) {
        NACRE_TRY(const auto range, subject.furnace(is_short));
        row.has_furnace = true;
        row.has_lossless = subject.is_furnace_lossless;
        row.furnace_min = range.first;
        row.furnace_max = range.second;
        return {};
    }
    if (subject.furnaces.empty()) return {};
    row.has_furnace = true;
    row.has_lossless = std::ranges::any_of(subject.furnaces, &FurnaceCase::is_lossless);
    row.furnace_min = infinity;
    std::mutex mutex;
    const std::size_t stride = is_short ? 7 : 1;
    for_all((subject.furnaces.size() + stride - 1) / stride, [&](std::size_t i) {
        const FurnaceCase& furnace = subject.furnaces[i * stride];
        Library library;
        library.tints = stability_tint;
        const auto closure = library.prepare_closure(Library::slab_of(furnace.slab),
                                                     direction(furnace.cosine, furnace.azimuth), 1e-3);
        const glm::dvec3 energy = integrate(library, closure, is_short ? 64 : 96) + library.closure_throughput(closure);
        const std::scoped_lock lock(mutex);
        row.furnace_max = std::max({row.furnace_max, energy.x, energy.y, energy.z});
        if (furnace.is_lossless || !row.has_lossless)
            row.furnace_min = std::min({row.furnace_min, energy.x, energy.y, energy.z});
    });
    return {};
}

// One slab and view whose samples are tested, and what they are tested with.
struct SamplerTest {
    SamplerTest(const SamplingCase& sampling, bool is_short)
        : view(glm::vec3(direction(sampling.cosine, sampling.azimuth))) {
        Library library;
        library.tints = stability_tint;
        const auto closure = library.prepare_closure(Library::slab_of(sampling.slab), view, 1e-3f);
        const glm::dvec2 alphas = closure.specular.alpha;
        // Along the surface a lobe is as thin as the view is low.
        const double narrowest = std::min(alphas.x, alphas.y) * std::max(sampling.cosine, 0.02);
        chi_square.emplace(DirectionBins{.rings = is_short ? 40 : 80,
                                         .axis = {-view.x, -view.y, view.z},
                                         .smallest_angle = std::clamp(narrowest, 1e-5, 1.0)},
                           [library, closure](const glm::dvec3& w) mutable { return library.closure_pdf(closure, w); });
    }
    void add(std::span<const float> results) {
        for (std::size_t i = 0; i < results.size(); i += 8) {
            const float* const s = &results[i];
            const double weight = std::max({s[3], s[4], s[5]});
            sum += weight;
            squares += weight * weight;
            weight_max = std::max(weight_max, weight);
            if (s[6] <= 0.0f || s[7] > 0.5f) chi_square->add_lost();
            else chi_square->add(glm::normalize(glm::dvec3(s[0], s[1], s[2])));
        }
    }

    glm::dvec3 view;
    std::optional<ChiSquareTest> chi_square;
    double sum = 0.0, squares = 0.0, weight_max = 0.0;  ///< Of the samples' weights.
    double probability = 1.0, probability_of_wrong = 1.0;
};

// Samples of the device in single precision against the density of the host in double precision. first_sample: their
// number among those of all tests, so that no two tests have random numbers in common.
Expected<void> test_samplers(rhi::Device& device, const StabilitySubject& subject, std::uint64_t samples,
                             std::uint64_t first_sample, bool is_short, double limit, StabilityClosure& row) {
    if (subject.samplings.empty()) return {};
    row.has_sampler = true;
    StabilitySubject sampled = subject;
    sampled.shader.result_words = 8;
    NACRE_TRY(PointShader shader, PointShader::make(device, variant(device, sampled, "SAMPLES", false)));
    const std::size_t stride = is_short ? 5 : 1;
    std::vector<SamplerTest> tests;
    for (std::size_t c = 0; c < subject.samplings.size(); c += stride) {
        tests.emplace_back(subject.samplings[c], is_short);
        std::vector<std::uint32_t> point(subject.shader.point_words, 0u);
        subject.make_sampling(subject.samplings[c].slab, tests.back().view, point.data());
        std::vector<float> results, last;
        std::future<void> added;
        for (std::uint64_t done = 0; done < samples; done += batch_points) {
            const auto count = static_cast<std::uint32_t>(std::min<std::uint64_t>(batch_points, samples - done));
            point[subject.number_word] = static_cast<std::uint32_t>(first_sample + c / stride * samples + done);
            NACRE_CHECK(shader.run(point, {}, {}, count, results));
            // Counted while the device works on.
            if (added.valid()) added.get();
            std::swap(results, last);
            added = std::async(std::launch::async, [&test = tests.back(), &last] { test.add(last); });
        }
        if (added.valid()) added.get();
    }
    for_all(tests.size(), [&](std::size_t i) {
        tests[i].probability = tests[i].chi_square->smallest_probability();
        tests[i].probability_of_wrong = tests[i].chi_square->smallest_probability(1.01);
    });
    for (std::size_t i = 0; i < tests.size(); ++i) {
        const SamplerTest& test = tests[i];
        const SamplingCase& sampling = subject.samplings[i * stride];
        const double mean = test.sum / static_cast<double>(samples);
        row.all.weight_max = std::max(row.all.weight_max, test.weight_max);
        row.weight_variance = std::max(row.weight_variance, test.squares / static_cast<double>(samples) - mean * mean);
        ++row.chi2_tests;
        if (test.probability < limit) ++row.chi2_failures;
        if (test.probability_of_wrong >= limit) ++row.chi2_blind;
        if (test.probability < row.chi2_probability) {
            row.chi2_probability = test.probability;
            row.chi2_at =
                fmt::format("roughness {:.3g}, anisotropy {:.3g}, view cosine {:.3g}: {:.2g}", sampling.slab.roughness,
                            sampling.slab.anisotropy, sampling.cosine, test.probability);
        }
    }
    return {};
}

}  // namespace

void StabilityFigures::add(const StabilityFigures& other) {
    points += other.points;
    nan += other.nan;
    inf += other.inf;
    negative += other.negative;
    facets += other.facets;
    seconds += other.seconds;
    first_seconds += other.first_seconds;
    if (other.max_rel_error > max_rel_error) max_rel_error = other.max_rel_error, at = other.at;
    if (other.closed_error > closed_error) closed_error = other.closed_error, closed_at = other.closed_at;
    if (other.reciprocity > reciprocity) reciprocity = other.reciprocity, reciprocity_at = other.reciprocity_at;
    if (other.host_error > host_error) host_error = other.host_error, host_at = other.host_at;
    agreement = std::max(agreement, other.agreement);
    weight_max = std::max(weight_max, other.weight_max);
    for (int i = 0; i < error_bins; ++i) errors[i] += other.errors[i];
    for (int i = 0; i < angle_bins; ++i) error_by_angle[i] = std::max(error_by_angle[i], other.error_by_angle[i]);
}

std::uint32_t stability_trees(std::uint64_t points) {
    return static_cast<std::uint32_t>(std::clamp<std::uint64_t>(points / 200'000, 4, 50));
}

std::uint64_t stability_samples(std::uint64_t points) {
    return std::clamp<std::uint64_t>(points / 25, 100'000, 4'000'000);
}

namespace {

// A subject in double precision, compiled once for all devices, which take turns. points: about how many it is for.
class Reference {
  public:
    Reference(rhi::Device& device, const StabilitySubject& subject, std::uint64_t points)
        : device_(device), subject_(subject), is_on_host_(subject.is_complete_on_host && points < 100'000) {}

    Expected<void> run(Batch& batch) {
        if (is_on_host_) {
            compute_reference(subject_, batch);
            return {};
        }
        const std::scoped_lock lock(mutex_);
        if (!shader_) {
            const bool follows = std::ranges::find(subject_.results, ResultKind::direction) != subject_.results.end();
            NACRE_TRY(shader_, PointShader::make(device_, variant(device_, subject_, "REFERENCE", follows)));
        }
        return shader_->run(batch.points, batch.candidate, batch.parameters, batch.count, batch.reference);
    }

  private:
    rhi::Device& device_;
    const StabilitySubject& subject_;
    const bool is_on_host_;
    std::mutex mutex_;
    std::optional<PointShader> shader_;
};

// The next batch is made, and the last one judged, while devices work.
Expected<StabilityFigures> measure_on(rhi::Device& device, Reference& reference, const StabilitySubject& subject,
                                      std::uint64_t points, std::uint64_t seed) {
    const auto start = Clock::now();
    NACRE_TRY(PointShader candidate_shader, PointShader::make(device, variant(device, subject, "CANDIDATE", false)));
    StabilityFigures figures;
    const auto make = [&](std::uint64_t number) {
        auto batch = std::make_unique<Batch>();
        batch->seed = seed + 0x9e3779b97f4a7c15ull * (number + 1);
        batch->count = static_cast<std::uint32_t>(
            std::min<std::uint64_t>(batch_points, points - std::min(points, number * batch_points)));
        if (batch->count > 0) fill(subject, *batch);
        return batch;
    };
    std::unique_ptr<Batch> last;  // outlives who reads it
    std::future<std::unique_ptr<Batch>> next = std::async(std::launch::async, make, 0);
    std::future<StabilityFigures> judged;
    for (std::uint64_t number = 0;; ++number) {
        std::unique_ptr<Batch> batch = next.get();
        const bool is_end = batch->count == 0;
        if (!is_end) {
            next = std::async(std::launch::async, make, number + 1);
            NACRE_CHECK(candidate_shader.run(batch->points, {}, batch->parameters, batch->count, batch->candidate));
            if (number == 0) figures.first_seconds = seconds_since(start);
            NACRE_CHECK(reference.run(*batch));
        }
        if (judged.valid()) figures.add(judged.get());
        if (is_end) break;
        last = std::move(batch);
        judged = std::async(std::launch::async, [&subject, &last] { return judge(subject, *last); });
    }
    figures.seconds = seconds_since(start);
    return figures;
}

}  // namespace

Expected<StabilityFigures> measure_subject(rhi::Device& device, rhi::Device& reference, const StabilitySubject& subject,
                                           std::uint64_t points, std::uint64_t seed) {
    Reference exact(reference, subject, points);
    return measure_on(device, exact, subject, points, seed);
}

Expected<StabilityReport> measure_stability(const rhi::Instance& instance, const StabilityDesc& desc) {
    if (desc.points < 1000) {
        return fail(ErrorCode::invalid_argument, "measure stability", fmt::format("{} points", desc.points),
                    "they are too few to tell anything", "Ask for 1000 or more.");
    }
    const auto start = Clock::now();
    StabilityReport report{.desc = desc};
    auto reference = instance.create_device({.backend = "cpu:double"});
    if (!reference) return std::unexpected(reference.error());
    std::vector<std::unique_ptr<rhi::Device>> devices;
    for (const std::string& backend : desc.backends) {
        NACRE_TRY(std::unique_ptr<rhi::Device> device, instance.create_device({.backend = backend}));
        report.devices.push_back(fmt::format("{}: {}", backend, device->adapter().name));
        devices.push_back(std::move(device));
    }
    report.trees = stability_trees(desc.points);
    report.samples = stability_samples(desc.points);
    std::vector<StabilitySubject> subjects = closure_subjects();
    std::ranges::move(lobe_subjects(), std::back_inserter(subjects));
    NACRE_TRY(std::vector<StabilitySubject> trees, tree_subjects(report.trees));
    std::ranges::move(trees, std::back_inserter(subjects));
    std::set<std::string> names;
    for (const StabilitySubject& subject : subjects) names.insert(subject.name);
    const auto is_asked_for = [&](const StabilitySubject& s) { return s.name.find(desc.only) != std::string::npos; };
    if (std::ranges::none_of(subjects, is_asked_for)) {
        return fail(ErrorCode::not_found, "measure stability", fmt::format("'{}'", desc.only),
                    "no closure's name contains it", fmt::format("Use a part of one of: {}.", fmt::join(names, ", ")));
    }
    double shares = 0.0;
    std::size_t tests = 0, wanted = 0;
    // Furnaces and chi-square tests in full take some ten minutes, whatever the points.
    const bool is_short = desc.points < 50'000'000;
    const auto tests_of = [&](const StabilitySubject& subject) {
        return is_short ? (subject.samplings.size() + 4) / 5 : subject.samplings.size();
    };
    for (const StabilitySubject& subject : subjects) {
        tests += tests_of(subject);
        if (is_asked_for(subject)) shares += subject.share, ++wanted;
    }
    // Significance 0.01 over all tests together (Sidak), four sizes of bins in each. Over those that are not asked for
    // as well: a part of the sweep that is run again has the same samples and the same limit.
    const double limit = 1.0 - std::pow(0.99, 1.0 / (4.0 * static_cast<double>(std::max<std::size_t>(tests, 1))));

    Progress progress("measuring closures", wanted);
    std::size_t done = 0;
    std::uint64_t first_sample = 0;
    for (std::size_t s = 0; s < subjects.size(); ++s) {
        const StabilitySubject& subject = subjects[s];
        const std::uint64_t first = first_sample;
        first_sample += tests_of(subject) * report.samples;
        if (!is_asked_for(subject)) continue;
        progress.update(done++, subject.name);
        auto row = std::ranges::find(report.closures, subject.name, &StabilityClosure::name);
        if (row == report.closures.end()) {
            report.closures.push_back({.name = subject.name,
                                       .what = subject.what,
                                       .note = subject.note,
                                       .tolerance = subject.tolerance,
                                       .limits = subject.limits});
            row = report.closures.end() - 1;
            row->devices.resize(devices.size());
            for (std::size_t d = 0; d < devices.size(); ++d) row->devices[d].backend = desc.backends[d];
        }
        const auto points_on = [&](std::size_t device) {
            return static_cast<std::uint64_t>(
                std::ceil(static_cast<double>(device == 0 ? desc.points : desc.points / 10) * subject.share / shares));
        };
        // At once, since drivers compile on one core only.
        Reference exact(**reference, subject, points_on(0));
        std::vector<std::future<Expected<StabilityFigures>>> measured;
        for (std::size_t d = 0; d < devices.size(); ++d) {
            measured.push_back(std::async(std::launch::async, [&, d] {
                return measure_on(*devices[d], exact, subject, points_on(d), 1000 * s + d);
            }));
        }
        auto furnaces =
            std::async(std::launch::async, [&] { return measure_furnaces(subject, is_short, *row); });
        NACRE_CHECK(test_samplers(*devices.front(), subject, report.samples, first, is_short, limit, *row));
        NACRE_CHECK(furnaces.get());
        for (std::size_t d = 0; d < devices.size(); ++d) {
            NACRE_TRY(const StabilityFigures figures, measured[d].get());
            row->devices[d].add(figures);
            row->all.add(figures);
        }
        report.seconds = seconds_since(start);
        if (desc.on_progress) desc.on_progress(report);
    }
    return report;
}

std::vector<std::string> violations_of(const StabilityReport& report) {
    std::vector<std::string> violations;
    const auto add = [&](const StabilityClosure& closure, const std::string& what) {
        violations.push_back(fmt::format("{}: {}", closure.name, what));
    };
    for (const StabilityClosure& c : report.closures) {
        const StabilityFigures& f = c.all;
        if (f.nan + f.inf + f.negative > 0)
            add(c, fmt::format("{} results are not a number, {} infinite, {} negative", f.nan, f.inf, f.negative));
        if (f.max_rel_error > c.tolerance)
            add(c, fmt::format("an error of {:.3g} where {:.3g} is allowed", f.max_rel_error, c.tolerance));
        if (f.closed_error > c.tolerance) add(c, fmt::format("off the closed form by {:.3g}", f.closed_error));
        if (c.has_furnace && c.furnace_max > c.limits.furnace)
            add(c, fmt::format("sends out {:.5f} of white light", c.furnace_max));
        if (c.has_lossless && c.furnace_min < c.limits.lossless)
            add(c, fmt::format("sends out only {:.5f} of white light, absorbing nothing", c.furnace_min));
        if (f.reciprocity > c.limits.reciprocity) add(c, fmt::format("two directions differ by {:.3g}", f.reciprocity));
        if (f.weight_max > c.limits.weight) add(c, fmt::format("a sample's weight of {:.7g}", f.weight_max));
        if (f.agreement > 1e-4) add(c, fmt::format("sample, value and density differ by {:.3g}", f.agreement));
        // Fewer samples cannot tell a percent where most of them are lost below the surface.
        if (c.chi2_blind > 0 && report.samples >= 1'000'000)
            add(c, fmt::format("{} of {} tests would not see a density wrong by 1 %", c.chi2_blind, c.chi2_tests));
        if (c.chi2_failures > 0)
            add(c, fmt::format("{} of {} samplers do not draw their density", c.chi2_failures, c.chi2_tests));
    }
    return violations;
}

}  // namespace nacre::measure
