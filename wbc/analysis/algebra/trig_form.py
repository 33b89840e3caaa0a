"""Matrices of trigonometric polynomials as sums of cosines and sines of sums of joint angles, in floats."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np

from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing, fraction
from wbc.errors import UnsupportedJointError
from wbc.validation import Array

#: Whole multiples of the joint angles in one wave
Wave: TypeAlias = tuple[int, ...]
#: Real and imaginary parts of the coefficient of a wave, over a power of two
Pair: TypeAlias = tuple[int, int]


@dataclass(frozen=True, eq=False)
class TrigForm:
    """M(q), its entries row by row:

        M_e = sum_k cosine[e, k] cos(waves[k].q) + sine[e, k] sin(waves[k].q)

    Attributes:
        shape: of the matrix. waves: [number, joints]. cosine, sine: [entries, number].
    """

    shape: tuple[int, int]
    waves: Array
    cosine: Array
    sine: Array

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Joints that it depends on."""
        return tuple(int(k) for k in np.flatnonzero(np.abs(self.waves).sum(0)))

    @property
    def terms(self) -> int:
        """Waves in all entries together."""
        return int(np.count_nonzero(np.abs(self.cosine) + np.abs(self.sine)))

    def value(self, q: Array) -> Array:
        """At configurations [many, joints]: [many, rows, columns]."""
        phase = q @ self.waves.T
        out = np.cos(phase) @ self.cosine.T + np.sin(phase) @ self.sine.T
        return np.asarray(out, dtype=np.float64).reshape((-1, *self.shape))

    def slopes(self, q: Array) -> Array:
        """Derivatives by each joint [many, joints, rows, columns]."""
        phase = q @ self.waves.T
        slope = np.cos(phase)[:, None] * self.sine - np.sin(phase)[:, None] * self.cosine
        out = np.einsum("sek,ki->sie", slope, self.waves, optimize=True)
        return np.asarray(out, dtype=np.float64).reshape((len(q), self.waves.shape[1], *self.shape))


def trig_form(ring: TrigRing, matrix: Matrix) -> TrigForm:
    """The waves of a matrix of polynomials; symbols take their values, sums are exact before they are rounded.

    Raises:
        UnsupportedJointError: an entry depends on a joint that slides.
    """
    entries = [_waves(ring, p) for row in matrix for p in row]
    order = sorted({wave for entry in entries for wave in entry})
    index = {wave: k for k, wave in enumerate(order)}
    cosine, sine = np.zeros((2, len(entries), len(order)))
    for e, entry in enumerate(entries):
        for wave, (real, imaginary) in entry.items():
            double = 2 if any(wave) else 1
            cosine[e, index[wave]], sine[e, index[wave]] = float(double * real), float(-double * imaginary)
    shape = len(matrix), len(matrix[0]) if matrix else 0
    return TrigForm(shape, np.array(order, float).reshape(-1, len(ring.coordinates)), cosine, sine)


def _waves(ring: TrigRing, p: Poly) -> dict[Wave, tuple[Fraction, Fraction]]:
    """Coefficients of e^(i w.q), for w = 0 and those whose first entry that is not zero is positive."""
    lengths = list(ring.symbols.values())
    start = len(ring.names) - len(lengths)
    places = tuple((k, s, c) for k, (s, c, _) in ring.circles.items())
    terms: list[tuple[Fraction, dict[Wave, Pair]]] = []
    for powers, number in p.terms():
        for k, index in ring.slides.items():
            if powers[index]:
                raise UnsupportedJointError(
                    f"joint {ring.coordinates[k].label}", "sliding", "subdivision needs entries in turning joints alone"
                )
        scale = fraction(number)
        for value, power in zip(lengths, powers[start:], strict=True):
            scale *= value ** int(power)
        factors = tuple((k, int(powers[c]), int(powers[s])) for k, s, c in places if powers[c] or powers[s])
        terms.append((scale / 2 ** sum(c + s for _, c, s in factors), _product(len(ring.coordinates), factors)))
    # Whole numbers over one denominator add up far faster than fractions
    below = math.lcm(*(scale.denominator for scale, _ in terms))
    sums: dict[Wave, Pair] = {}
    for scale, parts in terms:
        above = scale.numerator * (below // scale.denominator)
        for wave, (a, b) in parts.items():
            real, imaginary = sums.get(wave, (0, 0))
            sums[wave] = real + above * a, imaginary + above * b
    kept = {w: ab for w, ab in sums.items() if any(ab) and next((x for x in w if x), 1) > 0}
    return {w: (Fraction(a, below), Fraction(b, below)) for w, (a, b) in kept.items()}


@lru_cache(maxsize=4096)
def _product(joints: int, factors: tuple[tuple[int, int, int], ...]) -> dict[Wave, Pair]:
    """The waves of the product of (2 cos q_k)^c (2 sin q_k)^s over (k, c, s); not to be changed."""
    if not factors:
        return {(0,) * joints: (1, 0)}
    *others, (k, cosines, sines) = factors
    parts = _product(joints, tuple(others))
    for sine in [False] * cosines + [True] * sines:
        parts = _times(parts, k, sine)
    return parts


def _times(parts: dict[Wave, Pair], joint: int, sine: bool) -> dict[Wave, Pair]:
    """Times 2 cos q = z + 1/z or 2 sin q = (z - 1/z) / i."""
    out: dict[Wave, Pair] = {}
    for wave, (a, b) in parts.items():
        for step in (1, -1):
            moved = (*wave[:joint], wave[joint] + step, *wave[joint + 1 :])
            real, imaginary = (step * b, -step * a) if sine else (a, b)
            before = out.get(moved, (0, 0))
            out[moved] = before[0] + real, before[1] + imaginary
    return out


def used_joints(forms: Iterable[TrigForm]) -> tuple[int, ...]:
    """Joints that any of several forms depends on."""
    return tuple(sorted({k for form in forms for k in form.joints}))
