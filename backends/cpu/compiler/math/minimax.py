#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Derives the polynomials of Nacre's single precision functions and prints them as C++ arrays.

Method: the Remez exchange algorithm for a weighted error (Cheney, "Introduction to Approximation Theory", chapter 3),
in decimal arithmetic of 50 digits. Coefficients are then rounded to single precision one after another, from the one of
the lowest power on; after each rounding those that remain are fitted again to what the rounded ones leave (or simply
rounded, where that is better). The errors that it prints
are those of the polynomial with rounded coefficients, evaluated exactly.

exponentials.cpp, trigonometry.cpp and so on hold what it prints. It fails if one of them does not.
"""
import pathlib
import re
import struct
import sys
from decimal import Decimal, getcontext

getcontext().prec = 50
ONE = Decimal(1)


def single(value):
    """The nearest single precision number."""
    return Decimal(struct.unpack("f", struct.pack("f", float(value)))[0])


missing = []


def look_up(file, name, numbers):
    """Prints the numbers and notes whether the source file holds them in this order."""
    print("{" + ", ".join(short(n) for n in numbers) + "}")
    text = (pathlib.Path(__file__).parent / (file + ".cpp")).read_text()
    held = [float.fromhex(literal) for literal in re.findall(r"-?0x1(?:\.[0-9a-f]+)?p[+-]\d+", text)]
    wanted = [float(n) for n in numbers]
    # Parts of a constant may stand in declarations of their own.
    if not any(held[i : i + len(wanted)] == wanted for i in range(len(held))):
        missing.append(f"{name} in {file}.cpp")


def short(number):
    """As C++ has it, without the zeros that single precision never needs."""
    return re.sub(r"\.?0*p", "p", float(number).hex())


def series(first, ratio):
    """Sum of first * (1 + ratio(1) * (1 + ratio(2) * ...)), for quickly converging series."""
    total, term, k = first, first, 1
    while abs(term) > Decimal(10) ** -48 * max(abs(total), Decimal(10) ** -20):
        term *= ratio(k)
        total += term
        k += 1
    return total


def sin(x):
    return series(x, lambda k: -x * x / (2 * k * (2 * k + 1)))


def cos(x):
    return series(ONE, lambda k: -x * x / (2 * k * (2 * k - 1)))


def atan(x):
    # Halves the argument twice, so that the series converges quickly also at 1.
    for _ in range(3):
        x = x / (1 + (1 + x * x).sqrt())
    total, power, k = x, x, 1
    while abs(power) > Decimal(10) ** -48 * abs(x):
        power *= -x * x
        total += power / (2 * k + 1)
        k += 1
    return total * 8


def asin(x):
    return atan(x / (1 - x * x).sqrt())


def log1p(x):
    return (1 + x).ln()


def sinh(x):
    return (x.exp() - (-x).exp()) / 2


def tanh(x):
    return ((2 * x).exp() - 1) / ((2 * x).exp() + 1)


PI = 4 * atan(ONE)
LN2 = Decimal(2).ln()


def solve(matrix, right):
    """Gaussian elimination with partial pivoting."""
    n = len(right)
    rows = [row[:] + [value] for row, value in zip(matrix, right)]
    for column in range(n):
        pivot = max(range(column, n), key=lambda r: abs(rows[r][column]))
        rows[column], rows[pivot] = rows[pivot], rows[column]
        for r in range(column + 1, n):
            factor = rows[r][column] / rows[column][column]
            rows[r] = [a - factor * b for a, b in zip(rows[r], rows[column])]
    result = [Decimal(0)] * n
    for r in reversed(range(n)):
        known = sum(rows[r][c] * result[c] for c in range(r + 1, n))
        result[r] = (rows[r][n] - known) / rows[r][r]
    return result


def remez(grid, target, weight, powers):
    """Coefficients c that minimize max |weight * (target - sum c_k x^powers_k)| over the grid, and that maximum."""
    count = len(powers) + 1
    # Chebyshev nodes as first guess of where the error is largest.
    last = len(grid) - 1
    chosen = [int((1 - cos(PI * i / (count - 1))) / 2 * last) for i in range(count)]
    basis = [[x**p if p else ONE for p in powers] for x in grid]
    best, best_error = None, None
    for _ in range(30):
        matrix, right = [], []
        for sign, i in enumerate(chosen):
            matrix.append([b for b in basis[i]] + [(-1) ** sign / weight[i]])
            right.append(target[i])
        solution = solve(matrix, right)
        errors = [w * (t - sum(c * b for c, b in zip(solution, row))) for w, t, row in zip(weight, target, basis)]
        largest = max(abs(e) for e in errors)
        if best is None or largest < best_error:
            best, best_error = solution[:-1], largest
        # One extremum for each run of equal signs.
        extrema = []
        for i, error in enumerate(errors):
            if extrema and (errors[extrema[-1]] > 0) == (error > 0):
                if abs(error) > abs(errors[extrema[-1]]):
                    extrema[-1] = i
            else:
                extrema.append(i)
        while len(extrema) > count:
            extrema.pop(0 if abs(errors[extrema[0]]) < abs(errors[extrema[-1]]) else -1)
        if len(extrema) < count or extrema == chosen:
            break
        chosen = extrema
    return best, best_error


def fit(file, name, function, weight, low, high, degree, points=400):
    """Prints the polynomial of the given degree that approximates the function on [low, high]."""
    # Denser towards the ends, where the error of a best approximation turns most quickly.
    grid = [(low + high) / 2 - (high - low) / 2 * cos(PI * (2 * i + 1) / (2 * points)) for i in range(points)]
    target = [function(x) for x in grid]
    weights = [abs(weight(x)) for x in grid]
    exact_coefficients, exact_error = remez(grid, target, weights, list(range(degree + 1)))
    # Divided by x after each step, so that what is fitted always starts with a constant and alternation holds.
    coefficients, rest, rest_weights = [], target, weights
    for first in range(degree + 1):
        free, _ = remez(grid, rest, rest_weights, list(range(degree + 1 - first)))
        coefficients.append(single(free[0]))
        rest = [(r - coefficients[-1]) / x for r, x in zip(rest, grid)]
        rest_weights = [abs(w * x) for w, x in zip(rest_weights, grid)]
    error = max(abs(r * w) for r, w in zip(rest, rest_weights))
    # Fitting again does harm where the function is nowhere near zero, which the rounded constant then cannot follow.
    plain = [single(c) for c in exact_coefficients]
    plain_error = max(abs(w * (t - sum(c * x**p if p else c for p, c in enumerate(plain))))
                      for w, t, x in zip(weights, target, grid))
    if plain_error < error:
        coefficients, error = plain, plain_error
    print(f"// {name}: degree {degree} on [{float(low):.6g}, {float(high):.6g}], relative error 2^"
          f"{float(error.ln() / LN2):.1f} (2^{float(exact_error.ln() / LN2):.1f} before rounding)")
    look_up(file, name, coefficients)


def split(file, name, value, bits):
    """Prints a constant as a sum of single precision numbers, each but the last of the bits given."""
    parts = []
    for count in bits:
        scale = Decimal(2) ** (count - 1 - int((abs(value).ln() / LN2).to_integral_value(rounding="ROUND_FLOOR")))
        part = (value * scale).to_integral_value(rounding="ROUND_FLOOR") / scale
        parts.append(single(part))
        value -= parts[-1]
    parts.append(single(value))
    print(f"// {name} as a sum")
    look_up(file, name, parts)


def odd(function):
    """(f(x) / x - 1) / x^2 as a function of x^2, and the weight that makes its error the relative error of f."""
    return (lambda z: (function(z.sqrt()) / z.sqrt() - 1) / z), (lambda z: z * z.sqrt() / function(z.sqrt()))


def main():
    half_ln2, root = LN2 / 2, Decimal(2).sqrt()
    tiny = Decimal(10) ** -12
    fit("exponentials", "(2^f - 1) / f", lambda f: ((f * LN2).exp() - 1) / f, lambda f: f / (f * LN2).exp(),
        -ONE / 2, ONE / 2, 5)
    fit("exponentials", "(e^r - 1 - r) / r^2", lambda r: (r.exp() - 1 - r) / r**2, lambda r: r**2 / r.exp(),
        -half_ln2, half_ln2, 4)
    fit("exponentials", "log2(1 + f) / f", lambda f: log1p(f) / LN2 / f, lambda f: f * LN2 / log1p(f),
        1 / root - 1, root - 1, 8)
    fit("exponentials", "(ln(1 + f) - f + f^2 / 2) / f^3", lambda f: (log1p(f) - f + f * f / 2) / f**3,
        lambda f: f**3 / log1p(f), 1 / root - 1, root - 1, 7)
    split("exponentials", "ln 2", LN2, [16])
    fit("trigonometry", "(sin(r) - r) / r^3 of r^2", *odd(sin), tiny, PI**2 / 4, 3)
    fit("trigonometry", "(sin(r) - r) / r^3 of r^2", *odd(sin), tiny, PI**2 / 16, 2)
    fit("trigonometry", "(cos(r) - 1 + r^2 / 2) / r^4 of r^2", lambda z: (cos(z.sqrt()) - 1 + z / 2) / z**2,
        lambda z: z**2 / cos(z.sqrt()), Decimal("1e-8"), PI**2 / 16, 2)
    split("trigonometry", "pi", PI, [8, 8, 5])
    split("trigonometry", "pi, finer", PI, [8, 8, 5, 8])
    fit("inverse_trigonometry", "(asin(s) - s) / s^3 of s^2", *odd(asin), tiny, ONE / 4, 4)
    fit("inverse_trigonometry", "(atan(t) - t) / t^3 of t^2", *odd(atan), tiny, ONE, 8)
    fit("hyperbolics", "(sinh(x) - x) / x^3 of x^2", *odd(sinh), tiny, ONE, 3)
    fit("hyperbolics", "(tanh(x) - x) / x^3 of x^2", *odd(tanh), tiny, Decimal("0.390625"), 4)
    if missing:
        sys.exit(f"not in the sources: {', '.join(missing)}")


if __name__ == "__main__":
    main()
