"""Forms in half angles as sums of cosines and sines of sums of joint angles: c345 in the place of eight products."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import comb
from typing import TypeAlias

from wbc.analysis.algebra.half_angles import HalfAngles, HalfPoly

#: Multiples of q/2, one a joint; powers of the symbols and of the displacements of sliding joints
Frequency: TypeAlias = tuple[int, ...]
Powers: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class Term:
    """number * symbols^powers * cos or sin of sum of frequency_i q_i / 2."""

    number: Fraction
    powers: Powers
    frequency: Frequency
    sine: bool


@cache
def _expansion(sines: int, cosines: int) -> dict[int, int]:
    """Coefficients of (z - 1/z)^sines (z + 1/z)^cosines by powers of z."""
    out: dict[int, int] = {}
    for i in range(sines + 1):
        for j in range(cosines + 1):
            power = sines - 2 * i + cosines - 2 * j
            out[power] = out.get(power, 0) + (-1) ** i * comb(sines, i) * comb(cosines, j)
    return {p: a for p, a in out.items() if a}


def fourier(half: HalfAngles, form: HalfPoly, degrees: tuple[int, ...]) -> list[Term]:
    """The terms of a form of given degrees in (sin(q_i / 2), cos(q_i / 2)), sorted for display."""
    sums: dict[tuple[Powers, Frequency], list[int]] = {}
    # Every term is over the same power of two, that of the degrees
    below = 2 ** sum(degrees[k] for k in range(half.size) if k not in half.ring.slides)
    for powers, number in form.terms():
        exponents = [int(e) for e in powers]
        parts: dict[Frequency, int] = {(): int(number)}
        sines, others = 0, list[int]()
        for k in range(half.size):
            e = exponents[k]
            if k in half.ring.slides:
                others.append(e)
                table = {0: 1}
            else:
                sines += e
                table = _expansion(e, degrees[k] - e)
            parts = {(*f, n): a * b for f, a in parts.items() for n, b in table.items()}
        kind = (*others, *exponents[half.size :])
        for frequency, value in parts.items():
            pair = sums.setdefault((kind, frequency), [0, 0])
            # 1 / i^sines: 1, -i, -1, i
            pair[sines % 2] += value if sines % 4 in (0, 3) else -value
    return _real(sums, below)


def _real(sums: dict[tuple[Powers, Frequency], list[int]], below: int) -> list[Term]:
    """Conjugate pairs C z^n + conj(C) z^-n as 2 Re C cos - 2 Im C sin."""
    out: list[Term] = []
    for (powers, frequency), (real, imaginary) in sums.items():
        first = next((n for n in frequency if n), 0)
        if first < 0 or not (real or imaginary):
            continue
        double = 2 if first else 1
        if real:
            out.append(Term(Fraction(double * real, below), powers, frequency, False))
        if imaginary and first:
            out.append(Term(Fraction(-double * imaginary, below), powers, frequency, True))
    out.sort(key=lambda t: (tuple(-p for p in t.powers), sum(n != 0 for n in t.frequency), _last(t.frequency), t.sine))
    return out


def _last(frequency: Frequency) -> tuple[int, ...]:
    return tuple(k for k, n in enumerate(frequency) if n)
