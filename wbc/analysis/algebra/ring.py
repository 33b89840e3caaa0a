"""Exact polynomials in the cosines and sines of joints, in displacements and in symbols for lengths."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import TypeAlias

from flint import fmpq, fmpq_mpoly, fmpq_mpoly_ctx

from wbc.errors import DuplicateNameError, NotFiniteError, RangeError
from wbc.validation import scalar

Poly: TypeAlias = fmpq_mpoly
Matrix: TypeAlias = list[list[Poly]]
#: Digits to which a number of a model is taken as written; what arithmetic has added beyond them is dropped
DIGITS = 12


@dataclass(frozen=True)
class Coordinate:
    """A joint with one coordinate: its number in v (from 0), its index in q, its label, and whether it slides."""

    dof: int
    index: int
    label: str
    slides: bool = False


def written(value: float) -> Fraction:
    """The decimal fraction that a number is written as: 7.11 is 711/100.

    Raises:
        NotFiniteError: NaN or infinity.
    """
    if not math.isfinite(value):
        raise NotFiniteError("number", value, "expected a finite number")
    return Fraction(Decimal(f"{value:.{DIGITS}g}"))


class TrigRing:
    """Polynomials over the rationals in c_i, s_i (turning joints), d_i (sliding joints) and symbols:

        Q[symbols, c_1, s_1, ...] / (c_i^2 + s_i^2 - 1)

    Every product is reduced by s_i^2 -> 1 - c_i^2, so that equal functions are equal polynomials.

    Attributes:
        coordinates: of the joints. symbols: name -> value [m], exact; two symbols cannot have one absolute value.
        ctx: the ring of python-flint.
    """

    def __init__(self, coordinates: Sequence[Coordinate], symbols: Mapping[str, float] | None = None) -> None:
        self.coordinates = tuple(coordinates)
        self.symbols = {name: _symbol(name, value) for name, value in (symbols or {}).items()}
        if len({abs(v) for v in self.symbols.values()}) < len(self.symbols):
            raise DuplicateNameError("symbols", symbols, "two symbols have the same absolute value")
        names: list[str] = []
        for joint in self.coordinates:
            names += [f"d{joint.label}"] if joint.slides else [f"s{joint.label}", f"c{joint.label}"]
        clash = set(names) & set(self.symbols)
        if clash:
            raise DuplicateNameError("symbols", sorted(clash), "names of joint variables")
        self.names = (*names, *self.symbols)
        self.ctx = fmpq_mpoly_ctx.get(self.names or ("unused",), "lex")
        gens = dict(zip(self.names, self.ctx.gens(), strict=False))
        self.zero, self.one = self.ctx.constant(0), self.ctx.constant(1)
        self._gens = gens
        #: Per turning joint: places of sine and cosine among the variables, and s^2 + c^2 - 1
        self.circles: dict[int, tuple[int, int, Poly]] = {}
        self.slides: dict[int, int] = {}
        for k, joint in enumerate(self.coordinates):
            if joint.slides:
                self.slides[k] = self.names.index(f"d{joint.label}")
                continue
            s, c = gens[f"s{joint.label}"], gens[f"c{joint.label}"]
            index = self.names.index(f"s{joint.label}")
            self.circles[k] = index, index + 1, s * s + c * c - 1

    def number(self, value: float | Fraction) -> Poly:
        """A number of a model as a constant; a length that equals a symbol, or its opposite, becomes that symbol."""
        exact = value if isinstance(value, Fraction) else written(value)
        for name, known in self.symbols.items():
            if abs(known) == abs(exact):
                return self._gens[name] if known == exact else -self._gens[name]
        return self.ctx.constant(rational(exact))

    def constant(self, value: float | Fraction) -> Poly:
        """A pure number, never a symbol: an entry of a rotation."""
        return self.ctx.constant(rational(value if isinstance(value, Fraction) else written(value)))

    def cosine(self, k: int) -> Poly:
        return self._gens[f"c{self.coordinates[k].label}"]

    def sine(self, k: int) -> Poly:
        return self._gens[f"s{self.coordinates[k].label}"]

    def displacement(self, k: int) -> Poly:
        """The displacement of sliding joint k."""
        return self._gens[f"d{self.coordinates[k].label}"]

    def normal(self, p: Poly) -> Poly:
        """The polynomial with every s_i at most once in a term."""
        if len(p) == 0:
            return p
        degrees = p.degrees()
        for s, _, circle in self.circles.values():
            if degrees[s] > 1:
                p = p % circle
        return p

    def times(self, a: Poly, b: Poly) -> Poly:
        """The product, reduced."""
        return self.normal(a * b)

    def used(self, p: Poly) -> tuple[int, ...]:
        """Joints that the polynomial depends on."""
        if len(p) == 0:
            return ()
        degrees = p.degrees()
        turning = [k for k, (s, c, _) in self.circles.items() if degrees[s] or degrees[c]]
        return tuple(sorted(turning + [k for k, index in self.slides.items() if degrees[index]]))

    def substitution(self, values: Mapping[int, tuple[fmpq, fmpq]]) -> dict[str | int, int | fmpq]:
        """What :meth:`at` puts in: (cos, sin) of some joints, or (displacement, anything), by place."""
        swap: dict[str | int, int | fmpq] = {}
        for k, (first, second) in values.items():
            if k in self.slides:
                swap[self.slides[k]] = first
            else:
                s, c, _ = self.circles[k]
                swap[c], swap[s] = first, second
        return swap

    def at(self, p: Poly, swap: dict[str | int, int | fmpq]) -> Poly:
        """The polynomial with values put in."""
        return p.subs(swap) if swap and len(p) and not p.is_constant() else p

    def value(self, p: Poly, q: Sequence[float]) -> float:
        """The number at a configuration; symbols take their values. ``q``: one number a coordinate of the ring."""
        numbers: list[float] = []
        for k, joint in enumerate(self.coordinates):
            numbers += [q[k]] if joint.slides else [math.sin(q[k]), math.cos(q[k])]
        numbers += [float(v) for v in self.symbols.values()]
        total = 0.0
        for powers, a in p.terms():
            total += to_float(a) * math.prod(x ** int(e) for x, e in zip(numbers, powers, strict=False) if e)
        return total


def rational(value: Fraction) -> fmpq:
    """A fraction as python-flint's number."""
    return fmpq(value.numerator, value.denominator)


def fraction(value: fmpq | int) -> Fraction:
    """A number of python-flint as a fraction."""
    exact = fmpq(value)
    return Fraction(int(exact.p), int(exact.q))


def to_float(value: fmpq) -> float:
    """The nearest float."""
    return int(value.p) / int(value.q)


def _symbol(name: str, value: float) -> Fraction:
    if not name.isidentifier():
        raise RangeError("symbols", name, "expected a name: letters, digits and underscores")
    number = written(scalar(f"symbols[{name!r}]", value))
    if number == 0:
        raise RangeError(f"symbols[{name!r}]", value, "a symbol stands for a length that is not zero")
    return number
