// SPDX-License-Identifier: Apache-2.0
#include "measure/chi_square.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace nacre::measure {
namespace {

// Upper tail of the chi-square distribution. Source: Wilson and Hilferty 1931, good for the tails of many degrees.
double chi_square_tail(double statistic, double degrees) {
    const double spread = 2.0 / (9.0 * degrees);
    const double z = (std::cbrt(statistic / degrees) - (1.0 - spread)) / std::sqrt(spread);
    return 0.5 * std::erfc(z / std::numbers::sqrt2);
}

}  // namespace

double ChiSquareTest::angle_at(double ring) const {
    return std::numbers::pi * std::expm1(ring / bins_.rings * std::log1p(1.0 / bins_.smallest_angle)) *
           bins_.smallest_angle;
}

int ChiSquareTest::bin_of(const glm::dvec3& direction) const {
    // The angle from the chord: the cosine loses the digits of small angles.
    const double angle = 2.0 * std::asin(std::min(0.5 * glm::length(direction - frame_.axis), 1.0));
    const double ring = std::log1p(angle / (std::numbers::pi * bins_.smallest_angle)) /
                        std::log1p(1.0 / bins_.smallest_angle) * bins_.rings;
    double phi = std::atan2(glm::dot(direction, frame_.up), glm::dot(direction, frame_.right));
    if (phi < 0.0) phi += 2.0 * std::numbers::pi;
    return std::clamp(static_cast<int>(ring), 0, bins_.rings - 1) * sectors_ +
           std::clamp(static_cast<int>(phi / (2.0 * std::numbers::pi) * sectors_), 0, sectors_ - 1);
}

glm::dvec3 ChiSquareTest::direction_at(double ring, double sector) const {
    const double angle = angle_at(ring), phi = 2.0 * std::numbers::pi * sector / sectors_;
    return std::sin(angle) * (std::cos(phi) * frame_.right + std::sin(phi) * frame_.up) + std::cos(angle) * frame_.axis;
}

// Integral of the density over a part of a bin, halving it until its midpoints agree.
double ChiSquareTest::integral(const std::function<double(const glm::dvec3&)>& density, double ring, double sector,
                               double ring_size, double sector_size, int depth) const {
    const auto sum = [&](int count) {
        double result = 0.0;
        for (int i = 0; i < count; ++i) {
            const double low = ring + ring_size * i / count, high = ring + ring_size * (i + 1) / count;
            // 1 - cos by half angles.
            const double area =
                2.0 * (std::pow(std::sin(0.5 * angle_at(high)), 2.0) - std::pow(std::sin(0.5 * angle_at(low)), 2.0)) *
                2.0 * std::numbers::pi * sector_size / count / sectors_;
            for (int j = 0; j < count; ++j)
                result += area * density(direction_at(ring + ring_size * (i + 0.5) / count,
                                                      sector + sector_size * (j + 0.5) / count));
        }
        return result;
    };
    double lowest = 1.0, highest = -1.0;
    for (int corner = 0; corner < 5; ++corner) {
        const double z = corner == 4
                             ? direction_at(ring + 0.5 * ring_size, sector + 0.5 * sector_size).z
                             : direction_at(ring + ring_size * (corner & 1), sector + sector_size * (corner >> 1)).z;
        lowest = std::min(lowest, z);
        highest = std::max(highest, z);
    }
    // Densities end at the surface, and some lobes lie along it: midpoints may all miss that.
    const bool is_at_surface = lowest < 0.1 && highest > 0.0 && highest - lowest > 0.02 * highest;
    const double coarse = sum(2), fine = sum(4);
    const bool is_fine_enough = std::abs(coarse - fine) < bins_.tolerance * fine + 2.5e-3 * bins_.tolerance * bins_.tolerance;
    if (depth == 0 || (!(is_at_surface && depth > bins_.subdivisions * 3 / 5) && is_fine_enough))
        return fine + (fine - coarse) / 3.0;
    double result = 0.0;
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j)
            result += integral(density, ring + 0.5 * i * ring_size, sector + 0.5 * j * sector_size, 0.5 * ring_size,
                               0.5 * sector_size, depth - 1);
    return result;
}

ChiSquareTest::ChiSquareTest(const DirectionBins& bins, const std::function<double(const glm::dvec3&)>& density)
    : bins_(bins), sectors_(2 * bins.rings) {
    frame_.axis = bins.axis;
    const glm::dvec3 helper = std::abs(bins.axis.z) < 0.9 ? glm::dvec3(0.0, 0.0, 1.0) : glm::dvec3(1.0, 0.0, 0.0);
    frame_.right = glm::normalize(glm::cross(helper, bins.axis));
    frame_.up = glm::cross(frame_.axis, frame_.right);
    expected_.resize(static_cast<std::size_t>(bins_.rings) * sectors_);
    observed_.resize(expected_.size());
    for (int ring = 0; ring < bins_.rings; ++ring)
        for (int sector = 0; sector < sectors_; ++sector)
            total_ += expected_[ring * sectors_ + sector] =
                std::max(integral(density, ring, sector, 1.0, 1.0, bins_.subdivisions), 0.0);
}

void ChiSquareTest::add(const glm::dvec3& direction) {
    observed_[bin_of(direction)] += 1.0;
    ++kept_;
}

double ChiSquareTest::smallest_probability(double scale) const {
    const double samples = kept_ + lost_;
    double smallest = 1.0;
    for (const int merged : {1, 4, 8, bins_.rings}) {
        double statistic = 0.0, degrees = 0.0, rest_expected = 0.0, rest_observed = 0.0;
        for (int ring = 0; ring < bins_.rings; ring += merged) {
            for (int sector = 0; sector < sectors_; sector += merged) {
                for (int i = 0; i < merged; ++i) {
                    for (int j = 0; j < merged; ++j) {
                        rest_expected += samples * scale * expected_[(ring + i) * sectors_ + sector + j];
                        rest_observed += observed_[(ring + i) * sectors_ + sector + j];
                    }
                }
                if (rest_expected < 5.0) continue;  // bins of few samples are pooled
                statistic += (rest_observed - rest_expected) * (rest_observed - rest_expected) / rest_expected;
                degrees += 1.0;
                rest_expected = rest_observed = 0.0;
            }
        }
        // What goes below the surface or into a mirror is one more bin; where nothing does, the total is no freedom.
        const double lost = samples * (1.0 - scale * total_);
        if (lost > 5.0) {
            statistic += (lost_ - lost) * (lost_ - lost) / lost;
        } else if (std::abs(lost_ - lost) > 5.0 + 2e-4 * samples) {
            return 0.0;
        } else {
            degrees -= 1.0;
        }
        if (degrees > 0.0) smallest = std::min(smallest, chi_square_tail(statistic, degrees));
    }
    return smallest;
}

}  // namespace nacre::measure
