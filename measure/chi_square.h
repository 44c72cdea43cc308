// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
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
    int rings = 80;  ///< A multiple of 8.
    glm::dvec3 axis{0.0, 0.0, 1.0};  ///< Unit.
    double smallest_angle = 1e-3;    ///< Radians; rings are not much thinner.
    /// Error of the integral of the density over a bin, in standard deviations of the number of samples in it. A
    /// hundredth adds less to the sum over 12,800 bins than a hundredth of the spread of that sum.
    double tolerance = 0.01;
};

/// One test. Not for several threads at once.
class ChiSquareTest {
  public:
    /// @param density  per solid angle, at most 1 in total; smooth but where it may end, at the surface (z = 0). What
    /// it
    ///                 refers to must outlive the test.
    ChiSquareTest(const DirectionBins& bins, std::function<double(const glm::dvec3&)> density);

    /// A sample of the density; unit.
    void add(const glm::dvec3& direction);
    /// A sample of what the density leaves to 1.
    void add_lost() { ++lost_; }

    /// Smallest probability, over four sizes of bins, that honest samples look as unlike the density as these. The
    /// first call after a sample integrates the density over the bins, as exactly as the number of samples asks for.
    /// `scale`: what the density is wrong by. A significance of s over n tests is a limit of 1 - (1 - s)^(1 / (4 n)).
    [[nodiscard]] double smallest_probability(double scale = 1.0);

    /// Shares of all samples that the bins should have, ring by ring, as of the last call of smallest_probability().
    [[nodiscard]] const std::vector<double>& expected() const { return expected_; }
    /// Values of the density that were asked for.
    [[nodiscard]] std::uint64_t evaluations() const { return evaluations_; }

  private:
    struct Frame {
        glm::dvec3 axis, right, up;
    };
    struct Cell;
    [[nodiscard]] double angle_at(double ring) const;
    [[nodiscard]] int bin_of(const glm::dvec3& direction) const;
    void integrate();
    /// Of one bin, that many parts of it along either direction at first.
    [[nodiscard]] double integral(int ring, int sector, int parts);
    [[nodiscard]] double refined(const Cell& cell, double tolerance, int depth);
    void measure(Cell& cell);
    [[nodiscard]] double tolerance_of(double share, double observed) const;

    DirectionBins bins_;
    std::function<double(const glm::dvec3&)> density_;
    int sectors_;
    Frame frame_;
    std::vector<double> expected_;  ///< Shares.
    std::vector<double> observed_;  ///< Counts.
    double total_ = 0.0, kept_ = 0.0, lost_ = 0.0;
    double integrated_ = 0.0;       ///< For so many samples.
    std::uint64_t evaluations_ = 0;
};

}  // namespace nacre::measure
