// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "core/error.h"
#include "materials/slab.h"
#include "measure/closure_points.h"
#include "measure/point_shader.h"
#include "measure/stability.h"

/// @file
/// What the stability sweep (measure/stability.h) runs: closures, single lobes and trees, as shaders with points.

namespace nacre::measure {

/// What a number is that a subject's shader writes, and how it is judged. All but `direction` must not be negative.
enum class ResultKind : std::uint8_t {
    share,        ///< Of light, or another number of order 1: floor 1e-7.
    lobe,         ///< A value or density at the point's light: floor 1e-7 of the lobe's scale there.
    direction,    ///< A component of a sampled direction; the reference follows it.
    weight,       ///< Of that sample.
    density,      ///< Of that sample: floor 1e-7 of the lobe's scale at its direction.
    no_density,   ///< 1 where the sample is of a mirror or none: weight and density are not compared.
    reciprocity,  ///< A relative defect, from the candidate alone.
    agreement,    ///< Of sample, value and density with one another: a relative defect, from the candidate alone.
    light_scale,  ///< The lobe's scale at the light, from the reference alone.
    sample_scale, ///< The lobe's scale at the sample, from the reference alone.
};

/// White light from everywhere at one view of one slab.
struct FurnaceCase {
    materials::Slab slab;
    double cosine = 1.0, azimuth = 0.3;
    bool is_lossless = false;
};

/// One slab and view whose samples are tested.
struct SamplingCase {
    materials::Slab slab;
    double cosine = 1.0, azimuth = 0.4;
};

/// See the top of this file.
struct StabilitySubject {
    std::string name;
    std::string what;  ///< One sentence.
    /// Why the error of single precision may be above 1e-3 (and then below 1e-2), or what else is to be known.
    std::string note;
    PointShaderDesc shader;  ///< `capacity` is that of one run; `text` is without the defines of its variants.
    std::vector<ResultKind> results;
    double share = 1.0;         ///< Of the sweep's points, relative to other subjects.
    bool counts_facets = false; ///< Results may jump where a count falls to the other side of a whole number.
    double tolerance = 1e-3;    ///< Relative error that is allowed; above 1e-3 only with a `note`.
    StabilityLimits limits;

    std::function<void(Random&, std::uint32_t* words)> make_point;
    std::function<std::string(const std::uint32_t* words)> describe;
    /// Of view and light, the one nearer to the surface.
    std::function<double(const std::uint32_t* words)> lower_cosine;
    /// A point of the shader's variant SAMPLES; `words[number_word]` is to be set for each run to the number of its
    /// first sample.
    std::function<void(const materials::Slab&, const glm::dvec3& view, std::uint32_t* words)> make_sampling;
    std::uint32_t number_word = 0;
    /// Parameters for a run; one set serves 64 points in a row.
    std::function<void(Random&, std::uint32_t sets, std::vector<float>&)> make_parameters;
    /// What formulae of other form give for the results, in double precision; NaN where there is none.
    std::function<void(const std::uint32_t* words, double* values)> closed_form;

    /// What the same text gives for the results of `count` points in a row when it is compiled for the host; the rest
    /// is left as it is. `parameters`: the set that these points share.
    std::function<void(const std::uint32_t* words, std::uint32_t count, const float* parameters, double* values)>
        on_host;
    /// `on_host` gives all results: it judges few points, for which a shader in double precision takes too long to
    /// compile.
    bool is_complete_on_host = false;
    /// Large calls in the shader's text that it makes one after the other behind the text where DEFERRED_CALLS says how
    /// many they are (measure/stability_deferred.glsl); 0: it cannot.
    std::uint32_t deferred_calls = 0;

    std::vector<FurnaceCase> furnaces;    ///< Of slabs.
    std::vector<SamplingCase> samplings;  ///< Of slabs.
    /// Smallest and largest energy under white light, where the subject is not a slab; the flag asks for fewer cases.
    std::function<Expected<std::pair<double, double>>(bool is_short)> furnace;
    bool is_furnace_lossless = false;  ///< All of what `furnace` measures absorbs nothing.
};

/// The point that a shader reads, a plain struct of 32-bit words, out of and into them.
template <typename Point>
Point point_of(const std::uint32_t* words) {
    Point point;
    std::memcpy(static_cast<void*>(&point), words, sizeof point);
    return point;
}
template <typename Point>
void put_point(const Point& point, std::uint32_t* words) {
    static_assert(sizeof point % 4 == 0);
    std::memcpy(words, static_cast<const void*>(&point), sizeof point);
}

/// Runs `points` of a subject on `device`, and on `reference` (in double precision) what it is judged by. Errors: those
/// of shaders and buffers.
Expected<StabilityFigures> measure_subject(rhi::Device& device, rhi::Device& reference, const StabilitySubject& subject,
                                           std::uint64_t points, std::uint64_t seed);

/// What slab_specular_lut looks up in the sweep, on devices and on the host.
[[nodiscard]] glm::dvec3 stability_tint(std::uint32_t index, glm::dvec2 at);

/// All closures and lobes.
[[nodiscard]] std::vector<StabilitySubject> closure_subjects();
[[nodiscard]] std::vector<StabilitySubject> lobe_subjects();
/// `count` trees, the first of which are extreme: 16 deep, 32 wide, both.
[[nodiscard]] Expected<std::vector<StabilitySubject>> tree_subjects(std::uint32_t count);

}  // namespace nacre::measure
