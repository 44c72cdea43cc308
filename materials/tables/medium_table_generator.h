// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "materials/tables/medium_table.h"

/// @file
/// Reflection and transmission of a plane layer of an isotropically scattering medium by the doubling method, in double
/// precision: what fills materials/tables/medium_table.h.
///
///     ScatteringLayer layer(0.9, {0.5});        // albedo of a single scattering; a cosine of interest
///     layer.start(0x1p-20);
///     while (layer.depth() < 1.0) layer.twice();
///     double back = layer.reflected(0);
///
/// Source: van de Hulst 1980, "Multiple light scattering", chapter 4; Hansen and Travis 1974.

namespace nacre::materials {

class ScatteringLayer {
  public:
    /// @param cosines  in which reflected() and through() are wanted, (0, 1]
    ScatteringLayer(double albedo, const std::vector<double>& cosines, int nodes = 24) : albedo_(albedo) {
        // Gauss-Legendre on (0, 1); the cosines of interest join with weight 0.
        cosines_ = cosines;
        weights_.assign(cosines.size(), 0.0);
        for (int i = 0; i < nodes; ++i) {
            double x = std::cos(std::numbers::pi * (i + 0.75) / (nodes + 0.5)), slope = 1.0;
            for (int iteration = 0; iteration < 50; ++iteration) {
                double previous = 1.0, value = x;
                for (int k = 2; k <= nodes; ++k)
                    previous = std::exchange(value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k);
                slope = nodes * (x * value - previous) / (x * x - 1.0);
                x -= value / slope;
            }
            cosines_.push_back(0.5 * (x + 1.0));
            weights_.push_back(1.0 / ((1.0 - x * x) * slope * slope));
        }
        size_ = cosines_.size();
    }

    /// A layer so thin that light scatters once in it at most.
    void start(double depth) {
        depth_ = depth;
        reflection_.assign(size_ * size_, 0.0);
        transmission_ = reflection_;
        for (std::size_t i = 0; i < size_; ++i) {
            for (std::size_t j = 0; j < size_; ++j) {
                const double a = cosines_[i], b = cosines_[j];
                reflection_[i * size_ + j] = -0.25 * albedo_ / (a + b) * std::expm1(-depth * (1.0 / a + 1.0 / b));
                // (exp(-depth / a) - exp(-depth / b)) / (a - b), also where a and b are alike.
                const double x = depth * (1.0 / b - 1.0 / a);
                const double mean = std::abs(x) < 1e-8 ? 1.0 : -std::expm1(-x) / x;
                transmission_[i * size_ + j] = 0.25 * albedo_ * std::exp(-depth / a) * mean * depth / (a * b);
            }
        }
    }

    /// Two of these layers, one on the other.
    void twice() {
        const Matrix& r = reflection_;
        const Matrix& t = transmission_;
        // Light between the two: r r + (r r)^2 + ...
        const Matrix rr = product(r, r);
        const Matrix bounces = solve(rr);
        Matrix up = product(bounces, r);
        for (std::size_t i = 0; i < up.size(); ++i) up[i] += r[i];
        const Matrix t_up = product(t, up), up_t = product(up, t), t_up_t = product(t_up, t);
        const Matrix t_bounces = product(t, bounces), bounces_t = product(bounces, t),
                     t_bounces_t = product(t_bounces, t);
        const Matrix tt = product(t, t);
        std::vector<double> e(size_);
        for (std::size_t i = 0; i < size_; ++i) e[i] = std::exp(-depth_ / cosines_[i]);
        Matrix new_r = r, new_t = tt;
        for (std::size_t i = 0; i < size_; ++i) {
            for (std::size_t j = 0; j < size_; ++j) {
                const std::size_t k = i * size_ + j;
                new_r[k] += e[i] * up[k] * e[j] + t_up[k] * e[j] + e[i] * up_t[k] + t_up_t[k];
                new_t[k] += t[k] * e[j] + e[i] * t[k] + e[i] * bounces[k] * e[j] + t_bounces[k] * e[j] +
                            e[i] * bounces_t[k] + t_bounces_t[k];
            }
        }
        reflection_ = std::move(new_r);
        transmission_ = std::move(new_t);
        depth_ *= 2.0;
    }

    [[nodiscard]] double depth() const { return depth_; }
    /// Of light from the direction of a cosine of interest: what is scattered back, and what is scattered through.
    [[nodiscard]] double reflected(std::size_t cosine) const { return total(reflection_, cosine); }
    [[nodiscard]] double through(std::size_t cosine) const { return total(transmission_, cosine); }
    [[nodiscard]] double interacting(std::size_t cosine) const { return -std::expm1(-depth_ / cosines_[cosine]); }
    /// pi times the reflected radiance in one cosine of interest under unit irradiance from another.
    [[nodiscard]] double reflection(std::size_t to, std::size_t from) const { return reflection_[to * size_ + from]; }

  private:
    using Matrix = std::vector<double>;

    [[nodiscard]] double measure(std::size_t k) const { return 2.0 * cosines_[k] * weights_[k]; }
    [[nodiscard]] double total(const Matrix& m, std::size_t cosine) const {
        double sum = 0.0;
        for (std::size_t k = 0; k < size_; ++k) sum += m[cosine * size_ + k] * measure(k);
        return sum;
    }
    [[nodiscard]] Matrix product(const Matrix& a, const Matrix& b) const {
        Matrix result(size_ * size_, 0.0);
        for (std::size_t i = 0; i < size_; ++i) {
            for (std::size_t k = 0; k < size_; ++k) {
                const double factor = a[i * size_ + k] * measure(k);
                if (factor == 0.0) continue;
                for (std::size_t j = 0; j < size_; ++j) result[i * size_ + j] += factor * b[k * size_ + j];
            }
        }
        return result;
    }
    /// x = q + q x, by elimination.
    [[nodiscard]] Matrix solve(const Matrix& q) const {
        Matrix left(size_ * size_), right = q;
        for (std::size_t i = 0; i < size_; ++i)
            for (std::size_t k = 0; k < size_; ++k)
                left[i * size_ + k] = (i == k ? 1.0 : 0.0) - q[i * size_ + k] * measure(k);
        for (std::size_t column = 0; column < size_; ++column) {
            // The matrix is diagonally dominant enough for elimination without a search.
            const double inverse = 1.0 / left[column * size_ + column];
            for (std::size_t row = 0; row < size_; ++row) {
                if (row == column) continue;
                const double factor = left[row * size_ + column] * inverse;
                if (factor == 0.0) continue;
                for (std::size_t j = column; j < size_; ++j) left[row * size_ + j] -= factor * left[column * size_ + j];
                for (std::size_t j = 0; j < size_; ++j) right[row * size_ + j] -= factor * right[column * size_ + j];
            }
        }
        for (std::size_t row = 0; row < size_; ++row)
            for (std::size_t j = 0; j < size_; ++j) right[row * size_ + j] /= left[row * size_ + row];
        return right;
    }

    double albedo_;
    double depth_ = 0.0;
    std::size_t size_ = 0;
    std::vector<double> cosines_, weights_;
    Matrix reflection_, transmission_;
};

/// One slice of medium_table(), numbers in [0, 1] in its order.
inline std::vector<double> medium_table_slice(std::uint32_t slice) {
    const double at_slice = slice / (medium_table_slices - 1.0), similarity = at_slice * at_slice;
    // The shares have limits where nothing scatters; they are taken close by.
    const double albedo = std::max(1.0 - similarity * similarity, 1e-4);
    std::vector<double> cosines;
    for (std::uint32_t column = 0; column < medium_table_columns; ++column)
        cosines.push_back(std::max(std::pow(column / (medium_table_columns - 1.0), 2.0), 1e-4));
    std::vector<double> result(2 * medium_table_columns * medium_table_rows);
    // Rows are half octaves: two series of doublings.
    for (int odd = 0; odd < 2; ++odd) {
        ScatteringLayer layer(albedo, cosines);
        layer.start((odd ? std::numbers::sqrt2 : 1.0) * 0x1p-30);
        for (std::uint32_t row = odd; row < medium_table_rows; row += 2) {
            while (layer.depth() < std::exp2(-8.0 + 0.5 * row) * 0.999) layer.twice();
            for (std::uint32_t column = 0; column < medium_table_columns; ++column) {
                const double out = layer.reflected(column) + layer.through(column);
                result[2 * (row * medium_table_columns + column)] = layer.through(column) / out;
                result[2 * (row * medium_table_columns + column) + 1] =
                    1.0 - out / (layer.interacting(column) * albedo);
            }
        }
    }
    return result;
}

}  // namespace nacre::materials
