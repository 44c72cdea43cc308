// SPDX-License-Identifier: Apache-2.0
#include "measure/chi_square.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>
#include <utility>

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

// A part of a bin on one side of the surface: sectors from phi[0] to phi[1], and in each of them from `part[0]` to
// `part[1]` of the way between the angles where the bin begins and ends on that side.
struct ChiSquareTest::Cell {
    double angles[2];  // of the bin
    bool is_behind;    // the surface, seen from the axis
    double part[2], phi[2];
    double sum = 0.0;              // by three nodes of Gauss along either direction
    double bend[2] = {0.0, 0.0};   // second differences along part and phi
};

void ChiSquareTest::measure(Cell& cell) {
    constexpr double nodes[3] = {0.5 - 0.38729833462074169, 0.5, 0.5 + 0.38729833462074169};
    constexpr double weights[3] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
    double values[3][3];
    cell.sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        const double phi = std::lerp(cell.phi[0], cell.phi[1], nodes[i]);
        const glm::dvec3 outwards = std::cos(phi) * frame_.right + std::sin(phi) * frame_.up;
        // Where the sector meets the surface: cos(angle) axis.z + sin(angle) outwards.z = 0.
        const double surface = std::atan2(std::abs(frame_.axis.z), frame_.axis.z > 0.0 ? -outwards.z : outwards.z);
        const double from = cell.is_behind ? std::max(surface, cell.angles[0]) : cell.angles[0];
        const double to = cell.is_behind ? cell.angles[1] : std::min(surface, cell.angles[1]);
        const double length = std::max(to - from, 0.0);
        for (int j = 0; j < 3; ++j) {
            const double angle = from + length * std::lerp(cell.part[0], cell.part[1], nodes[j]);
            const double sine = std::sin(angle);
            values[i][j] =
                length > 0.0 ? length * sine * density_(sine * outwards + std::cos(angle) * frame_.axis) : 0.0;
            cell.sum += weights[i] * weights[j] * values[i][j];
        }
    }
    evaluations_ += 9;
    cell.sum *= (cell.phi[1] - cell.phi[0]) * (cell.part[1] - cell.part[0]);
    cell.bend[0] = cell.bend[1] = 0.0;
    for (int i = 0; i < 3; ++i) {
        cell.bend[0] += std::abs(values[i][0] - 2.0 * values[i][1] + values[i][2]);
        cell.bend[1] += std::abs(values[0][i] - 2.0 * values[1][i] + values[2][i]);
    }
}

// The integral over a measured cell, which is halved along the direction of the larger bend, and where that changes
// nothing along the other one, until neither does.
double ChiSquareTest::refined(const Cell& cell, double tolerance, int depth) {
    const auto halves = [this](const Cell& whole, bool is_along_phi) {
        std::array<Cell, 2> result{whole, whole};
        double(Cell::*const range)[2] = is_along_phi ? &Cell::phi : &Cell::part;
        (result[0].*range)[1] = (result[1].*range)[0] = std::midpoint((whole.*range)[0], (whole.*range)[1]);
        for (Cell& half : result) measure(half);
        return result;
    };
    const bool is_along_phi = cell.bend[1] > cell.bend[0];
    const std::array<Cell, 2> two = halves(cell, is_along_phi);
    const double by_two = two[0].sum + two[1].sum;
    // The sums are much nearer to the integral than to each other.
    const double below = std::numbers::sqrt2 * 0.5 * tolerance;
    if (depth > 0 && std::abs(by_two - cell.sum) > tolerance)
        return refined(two[0], below, depth - 1) + refined(two[1], below, depth - 1);
    const std::array<std::array<Cell, 2>, 2> four = {halves(two[0], !is_along_phi), halves(two[1], !is_along_phi)};
    double result = 0.0;
    for (int i = 0; i < 2; ++i) {
        const double by_halves = four[i][0].sum + four[i][1].sum;
        result +=
            depth > 0 && std::abs(by_halves - two[i].sum) > below
                ? refined(four[i][0], 0.5 * tolerance, depth - 1) + refined(four[i][1], 0.5 * tolerance, depth - 1)
                : by_halves;
    }
    return result;
}

// What an integral may be off by: a share of the standard deviation of the count. Bins of few samples are pooled until
// there are 5, with errors that may all have one sign.
double ChiSquareTest::tolerance_of(double share, double observed) const {
    const double samples = kept_ + lost_, count = std::max(samples * share, observed);
    return bins_.tolerance * std::max(std::min(std::sqrt(count), count / std::sqrt(5.0)), 0.01) / samples;
}

double ChiSquareTest::integral(int ring, int sector, int parts) {
    constexpr int depth = 24;
    const double angles[2] = {angle_at(ring), angle_at(ring + 1)};
    std::array<double, 6> marks;
    int count = 0;
    const double from = 2.0 * std::numbers::pi * sector / sectors_,
                 to = 2.0 * std::numbers::pi * (sector + 1) / sectors_;
    marks[count++] = from;
    // Where the surface enters and leaves the bin.
    const double tilt = std::hypot(frame_.right.z, frame_.up.z), lowest = std::atan2(frame_.up.z, frame_.right.z);
    for (const double angle : angles) {
        const double cosine = -frame_.axis.z * std::cos(angle) / (tilt * std::sin(angle));
        if (!(std::abs(cosine) < 1.0)) continue;
        for (const double side : {-1.0, 1.0}) {
            const double turn = lowest + side * std::acos(cosine) - from;
            const double phi = from + turn - 2.0 * std::numbers::pi * std::floor(turn / (2.0 * std::numbers::pi));
            if (phi < to && count < 5) marks[count++] = phi;
        }
    }
    marks[count++] = to;
    std::sort(marks.begin(), marks.begin() + count);
    std::vector<Cell> cells;
    double share = 0.0;
    for (int i = 0; i + 1 < count; ++i) {
        if (!(marks[i + 1] > marks[i])) continue;
        for (const bool is_behind : {false, true}) {
            for (int p = 0; p < parts * parts; ++p) {
                const double step = 1.0 / parts, x = p % parts * step, y = p / parts * step;
                Cell cell{.angles = {angles[0], angles[1]},
                          .is_behind = is_behind,
                          .part = {x, x + step},
                          .phi = {std::lerp(marks[i], marks[i + 1], y), std::lerp(marks[i], marks[i + 1], y + step)}};
                measure(cell);
                share += cell.sum;
                // Nothing there: the bin does not reach to this side of the surface, or the density does not.
                if (cell.sum > 0.0) cells.push_back(cell);
            }
        }
    }
    const double tolerance = tolerance_of(share, observed_[ring * sectors_ + sector]) / parts;
    double result = 0.0;
    for (const Cell& cell : cells) result += refined(cell, tolerance, depth);
    return std::max(result, 0.0);
}

void ChiSquareTest::integrate() {
    const double samples = kept_ + lost_;
    if (integrated_ == samples) return;
    integrated_ = samples;
    total_ = 0.0;
    for (int ring = 0; ring < bins_.rings; ++ring) {
        for (int sector = 0; sector < sectors_; ++sector) {
            const int bin = ring * sectors_ + sector;
            double share = integral(ring, sector, 1);
            // Either the samples are wrong, or all nodes missed a peak: looking more closely hurts neither.
            const double off = std::abs(observed_[bin] - samples * share);
            if (off > 4.0 * std::sqrt(std::max(samples * share, 1.0))) share = integral(ring, sector, 8);
            total_ += expected_[bin] = share;
        }
    }
}

ChiSquareTest::ChiSquareTest(const DirectionBins& bins, std::function<double(const glm::dvec3&)> density)
    : bins_(bins), density_(std::move(density)), sectors_(2 * bins.rings) {
    frame_.axis = bins.axis;
    const glm::dvec3 helper = std::abs(bins.axis.z) < 0.9 ? glm::dvec3(0.0, 0.0, 1.0) : glm::dvec3(1.0, 0.0, 0.0);
    frame_.right = glm::normalize(glm::cross(helper, bins.axis));
    frame_.up = glm::cross(frame_.axis, frame_.right);
    expected_.resize(static_cast<std::size_t>(bins_.rings) * sectors_);
    observed_.resize(expected_.size());
}

void ChiSquareTest::add(const glm::dvec3& direction) {
    observed_[bin_of(direction)] += 1.0;
    ++kept_;
}

double ChiSquareTest::smallest_probability(double scale) {
    integrate();
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
