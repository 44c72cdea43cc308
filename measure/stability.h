// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "measure/report_page.h"
#include "rhi/device.h"

/// @file
/// How the materials' closures behave in single precision: every closure, lobe and tree at very many points with the
/// edges over-represented, against the same text in double precision and against closed forms; energy, reciprocity, and
/// whether samplers draw what they claim.
///
///     NACRE_TRY(const StabilityReport report, measure_stability(instance, {.backends = {"cpu"}, .points =
///     1'000'000})); for (const std::string& violation : violations_of(report)) ...
///
/// docs/stability.md says what each figure means.

namespace nacre::measure {

struct StabilityReport;

struct StabilityDesc {
    /// Specs of the devices to measure. The first takes all points, the others a tenth.
    std::vector<std::string> backends{"cpu"};
    std::uint64_t points = 100'000'000;  ///< Of all closures together, at least 1,000.
    /// Closures whose name contains this; empty: all. What is measured of them is judged as a part of the whole.
    std::string only;
    /// Gets what is known after each closure, lobe and tree: a full sweep takes long enough to be broken off.
    std::function<void(const StabilityReport&)> on_progress = {};
};

/// How many of a sweep's trees, and samples of each chi-square test, so many points are worth.
[[nodiscard]] std::uint32_t stability_trees(std::uint64_t points);
[[nodiscard]] std::uint64_t stability_samples(std::uint64_t points);

/// The numbers that one device computed.
struct StabilityFigures {
    static constexpr int error_bins = 10;  ///< Decades of relative errors: below 1e-8, to 1e-7, ... above 1.
    static constexpr int angle_bins = 8;   ///< Decades of the lower of both cosines, from 1e-8.
    std::string backend;                   ///< Spec; "" for several together.
    std::uint64_t points = 0;
    std::uint64_t nan = 0, inf = 0, negative = 0;  ///< Results.
    std::uint64_t facets = 0;    ///< Results that counts of facets made jump.
    double max_rel_error = 0.0;  ///< Above the floor; infinite where the result was not finite.
    std::string at;              ///< The point where it occurs.
    double closed_error = 0.0;   ///< Against closed forms.
    std::string closed_at;
    double host_error = 0.0;     ///< Of the reference, against the same text compiled for the host.
    std::string host_at;
    double reciprocity = 0.0;    ///< Relative defect between two directions.
    std::string reciprocity_at;
    double agreement = 0.0;      ///< Of sample, value and density.
    double weight_max = 0.0;     ///< Largest weight of a sample.
    std::array<std::uint64_t, error_bins> errors{};    ///< Results by error.
    std::array<double, angle_bins> error_by_angle{};   ///< Largest error by the lower cosine.
    double seconds = 0.0;        ///< Of this device and its reference, beside all that runs at the same time.
    double first_seconds = 0.0;  ///< Of them, until the device had computed its first points: it compiles until then.
    void add(const StabilityFigures& other);
};

/// What a row promises besides small errors; infinite (0 for `lossless`) where it promises nothing.
struct StabilityLimits {
    static constexpr double none = std::numeric_limits<double>::infinity();
    double furnace = 1.001;      ///< Energy under white light.
    double lossless = 0.998;     ///< The least of it that what absorbs nothing sends out, where a row has some.
    double reciprocity = none;   ///< Relative defect: of lobes that scatter once.
    double weight = none;        ///< Of a sample: of lobes without compensation.
};

/// One closure's row.
struct StabilityClosure {
    std::string name, what, note;
    double tolerance = 1e-3;
    StabilityLimits limits;
    StabilityFigures all;                   ///< Of all devices together.
    std::vector<StabilityFigures> devices;  ///< In the order of the desc's backends.
    bool has_furnace = false, has_lossless = false, has_sampler = false;
    double furnace_min = 0.0;  ///< Of lossless slabs, where there are some.
    double furnace_max = 0.0;
    std::uint32_t chi2_tests = 0, chi2_failures = 0;
    std::uint32_t chi2_blind = 0;  ///< Tests that a density wrong by 1 % would have passed.
    double weight_variance = 0.0;  ///< Largest of the tested slabs and views.
    std::string chi2_at;           ///< The slab with the smallest probability.
    double chi2_probability = 1.0;
};

struct StabilityReport {
    StabilityDesc desc;
    std::vector<std::string> devices;  ///< "cpu: NAME", as in the desc's backends.
    std::vector<StabilityClosure> closures;
    std::uint32_t trees = 0;
    std::uint64_t samples = 0;
    double seconds = 0.0;
};

/// Runs it. Errors: those of making devices; the reference needs the backend `cpu`.
Expected<StabilityReport> measure_stability(const rhi::Instance& instance, const StabilityDesc& desc);

/// What of the report is beyond what the closures promise, a sentence each.
std::vector<std::string> violations_of(const StabilityReport& report);

/// {"closures": [{"name", "points", "nan", ...}]}
std::string to_json(const StabilityReport& report);

/// Tables and plots.
ReportPage stability_page(const StabilityReport& report);

}  // namespace nacre::measure
