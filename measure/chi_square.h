// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

/// @file
/// Do directions that a sampler draws follow the density that it claims? Pearson's chi-square test over bins around an
/// axis.
///
///     ChiSquareTest test({.axis = mirrored_view, .smallest_angle = 1e-3}, density);
///     for (...) test.add(sampled_direction);      // and add_lost() for what is not of the density
///     test.smallest_probability() > limit;        // honest samples
///     test.smallest_probability(1.01) < limit;    // would a density that is wrong by 1 % be found?

namespace nacre::measure {

/// Rings around an axis whose angles grow exponentially, so that narrow lobes around the axis get as many bins as wide
/// ones, each of twice as many sectors as there are rings.
struct DirectionBins {
    int rings = 80;
    glm::dvec3 axis{0.0, 0.0, 1.0};  ///< Unit.
    double smallest_angle = 1e-3;    ///< Radians; rings are not much thinner.
    /// Accuracy of the integral of the density over a bin, relative; millions of samples need 2e-5.
    double tolerance = 2e-5;
    int subdivisions = 13;  ///< Halvings of a bin, at most.
};

/// One test. Not for several threads at once.
class ChiSquareTest {
  public:
    /// Integrates `density` (per solid angle, 0 below a surface it ends at; at most 1 in total) over the bins.
    ChiSquareTest(const DirectionBins& bins, const std::function<double(const glm::dvec3&)>& density);

    /// A sample of the density; unit.
    void add(const glm::dvec3& direction);
    /// A sample of what the density leaves to 1.
    void add_lost() { ++lost_; }

    /// Smallest probability, over four sizes of bins, that honest samples look as unlike the density as these.
    /// `scale`: what the density is wrong by. A significance of s over n tests is a limit of 1 - (1 - s)^(1 / (4 n)).
    [[nodiscard]] double smallest_probability(double scale = 1.0) const;

  private:
    struct Frame {
        glm::dvec3 axis, right, up;
    };
    [[nodiscard]] double angle_at(double ring) const;
    [[nodiscard]] glm::dvec3 direction_at(double ring, double sector) const;
    [[nodiscard]] int bin_of(const glm::dvec3& direction) const;
    [[nodiscard]] double integral(const std::function<double(const glm::dvec3&)>& density, double ring, double sector,
                                  double ring_size, double sector_size, int depth) const;

    DirectionBins bins_;
    int sectors_;
    Frame frame_;
    std::vector<double> expected_;  ///< Shares.
    std::vector<double> observed_;  ///< Counts.
    double total_ = 0.0, kept_ = 0.0, lost_ = 0.0;
};

}  // namespace nacre::measure
