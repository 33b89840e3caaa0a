"""Random laws for tests of the algebra: smooth ones, and ones whose pieces have nothing to do with each other."""

from __future__ import annotations

from math import comb

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.trajectory import Law, MotionLimits, PolynomialPath, Timing


def limits_of(random: np.random.Generator, dof: int, jerk: bool = True) -> MotionLimits:
    return MotionLimits(
        lower=-random.uniform(0.5, 2.0, dof),
        upper=random.uniform(0.5, 2.0, dof),
        velocity=random.uniform(0.5, 3.0, dof),
        acceleration=random.uniform(0.5, 3.0, dof),
        jerk=random.uniform(0.5, 3.0, dof) if jerk else None,
    )


def smooth(seed: int, dof: int = 3) -> Law:
    """A cubic spline, at path speeds that change at constant rates: position and velocity are continuous."""
    random = np.random.default_rng(seed)
    knots = np.concatenate([[0.0], np.cumsum(random.uniform(0.3, 1.0, 4))])
    path = PolynomialPath(knots, CubicSpline(knots, random.normal(size=(5, dof))).c)
    s = np.concatenate([[0.0], np.sort(random.uniform(0.0, knots[-1], 5)), [knots[-1]]])
    timing = Timing.accelerations(s, random.uniform(0.2, 2.0, 7))
    return Law(path, timing, limits_of(random, dof))


def ragged(seed: int, path_degree: int, timing_degree: int, dof: int = 2) -> Law:
    """Polynomials of any degree on every piece of path and timing; s goes to and fro, and jumps."""
    random = np.random.default_rng(seed)
    pieces, parts = random.integers(1, 4, 2)
    knots = np.concatenate([[0.0], np.cumsum(random.uniform(0.3, 1.0, pieces))])
    path = PolynomialPath(knots, random.normal(size=(path_degree + 1, pieces, dof)))
    spans = random.uniform(0.2, 1.0, parts)
    inside = random.uniform(0.0, knots[-1], (parts, timing_degree + 1))
    columns = [powers(row) / span ** np.arange(timing_degree, -1, -1) for row, span in zip(inside, spans, strict=True)]
    timing = Timing(np.concatenate([[0.0], np.cumsum(spans)]), np.array(columns).T)
    return Law(path, timing, limits_of(random, dof))


def powers(bernstein: np.ndarray) -> np.ndarray:
    """Coefficients, highest power first, of a polynomial that stays within its Bernstein coefficients on [0, 1]."""
    degree = len(bernstein) - 1
    out = np.zeros(degree + 1)
    for k, value in enumerate(bernstein):
        part = np.poly1d([1.0, 0.0]) ** k * np.poly1d([-1.0, 1.0]) ** (degree - k)
        out[degree - part.order :] += comb(degree, k) * value * part.c
    return out


def inner_times(law: Law, count: int = 200) -> np.ndarray:
    """Times spread over a law that stay away from breaks of its timing, and from where it passes knots."""
    breaks = np.concatenate([law.timing.times, law.timing.crossings(law.path.knots)])
    times = np.linspace(0.0, law.duration, count + 2)[1:-1]
    return times[np.abs(times[:, None] - breaks).min(axis=1) > 1e-6 * law.duration]
