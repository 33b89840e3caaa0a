"""Polynomials on [0, 1] in Bernstein form: the coefficients enclose the values, more closely with every halving."""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array

#: Up to this degree, coefficients found from values are off by less than 1e-8 of them
HIGHEST = 24

#: Bounds are this near to a value that is taken, as a share of the largest coefficient
CLOSE = 1e-13


@cache
def nodes(degree: int) -> Array:
    """degree + 1 points in [0, 1], both ends among them, at which values fix a polynomial well."""
    return 0.5 - 0.5 * np.cos(np.pi * np.arange(degree + 1) / max(degree, 1))


@cache
def _to_coefficients(degree: int) -> Array:
    u = nodes(degree)[:, None]
    k = np.arange(degree + 1)
    basis = np.array([comb(degree, i) for i in k]) * u**k * (1.0 - u) ** (degree - k)
    return np.asarray(np.linalg.inv(basis), dtype=np.float64)


@cache
def rounding(degree: int) -> float:
    """How far :func:`coefficients` may be off, as a share of the largest value, for values that are rounded."""
    return 4.0 * float(np.finfo(float).eps * np.abs(_to_coefficients(degree)).sum(axis=1).max())


def coefficients(values: Array) -> Array:
    """Bernstein coefficients along the second axis, from values at :func:`nodes` along it."""
    return np.asarray(np.tensordot(_to_coefficients(values.shape[1] - 1), values, axes=(1, 1)).swapaxes(0, 1))


def halves(c: Array) -> tuple[Array, Array]:
    """Coefficients (polynomials x coefficients) on the lower and on the upper half, by de Casteljau."""
    low, high, row = np.empty_like(c), np.empty_like(c), c.copy()
    count = c.shape[1]
    for k in range(count):
        low[:, k], high[:, count - 1 - k] = row[:, 0], row[:, -1]
        row = 0.5 * (row[:, :-1] + row[:, 1:])
    return low, high


def largest(c: Array, tolerance: float = CLOSE) -> tuple[float, int, float]:
    """max p over [0, 1] and over all polynomials: (a bound of it, above it by at most ``tolerance`` of the largest
    coefficient, the number of the polynomial, the place).

    ``c``: polynomials x coefficients.
    """
    slack = tolerance * float(np.abs(c).max(initial=0.0))
    number, start, width = np.arange(len(c)), np.zeros(len(c)), 1.0
    best, which, place = _highest_end(c, number, start, width)
    for _ in range(60):
        bound = c.max(axis=1)
        above = bound > best + slack
        if not above.any():
            break
        low, high = halves(c[above])
        width *= 0.5
        c = np.concatenate([low, high])
        number = np.concatenate([number[above], number[above]])
        start = np.concatenate([start[above], start[above] + width])
        top, owner, at = _highest_end(c, number, start, width)
        if top > best:
            best, which, place = top, owner, at
    return best + slack, which, place


def _highest_end(c: Array, number: NDArray[np.intp], start: Array, width: float) -> tuple[float, int, float]:
    """(value, polynomial, place) of the highest end of a piece."""
    ends = c[:, (0, -1)]
    piece, side = (int(k) for k in np.unravel_index(int(ends.argmax()), ends.shape))
    return float(ends[piece, side]), int(number[piece]), float(start[piece] + side * width)
