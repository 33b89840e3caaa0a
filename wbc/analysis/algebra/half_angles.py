"""Half-angle form of trigonometric polynomials, in which they factor uniquely."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import TypeAlias

from flint import fmpq, fmpq_mpoly, fmpq_mpoly_ctx, fmpz_mpoly, fmpz_mpoly_ctx

from wbc.analysis.algebra.ring import Poly, TrigRing, fraction, rational
from wbc.errors import RangeError

HalfPoly: TypeAlias = fmpz_mpoly


@dataclass(frozen=True)
class Value:
    """Joint ``joint`` (from 0) at one place: tan(q/2) = value, None meaning q = pi; of a sliding joint d = value."""

    joint: int
    value: Fraction | None

    @property
    def key(self) -> tuple[int, float, str]:
        """For sorting."""
        return self.joint, float("inf") if self.value is None else float(self.value), ""


class Relation:
    """An irreducible polynomial in t_i = tan(q_i / 2), d_i and symbols that is zero.

    Attributes:
        poly: primitive, with a positive leading coefficient. degrees: in t_i of each joint; with u_i = 1 / sqrt(1 +
            t_i^2) put back it is a form of that degree in (sin(q_i / 2), cos(q_i / 2)).
    """

    __slots__ = ("degrees", "joints", "poly", "text")

    def __init__(self, poly: HalfPoly, coordinates: int) -> None:
        _, primitive = poly.primitive()
        self.poly: HalfPoly = -primitive if primitive.leading_coefficient() < 0 else primitive
        self.degrees = tuple(int(e) for e in self.poly.degrees()[:coordinates])
        self.joints = tuple(k for k, e in enumerate(self.degrees) if e)
        self.text = str(self.poly)

    def __reduce__(self) -> tuple[Callable[..., Relation], tuple[object, ...]]:
        terms = [(tuple(map(int, powers)), int(number)) for powers, number in self.poly.terms()]
        return _relation, (self.poly.context().names(), terms, len(self.degrees))

    def __hash__(self) -> int:
        return hash(self.text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Relation) and self.text == other.text

    @property
    def key(self) -> tuple[int, float, str]:
        """For sorting."""
        return len(self.degrees), float(len(self.poly)), self.text


def _relation(names: tuple[str, ...], terms: list[tuple[tuple[int, ...], int]], coordinates: int) -> Relation:
    """Of its terms: polynomials of python-flint cannot be pickled."""
    return Relation(fmpz_mpoly_ctx.get(names, "lex").from_dict(dict(terms)), coordinates)


Factor: TypeAlias = Value | Relation


@dataclass(frozen=True)
class Factors:
    """A trigonometric polynomial as a product.

    Attributes:
        zero: whether it is identically zero. conditions: factors that can vanish, with their powers. lengths: factors
            in symbols alone, which are taken as not zero.
    """

    zero: bool
    conditions: tuple[tuple[Factor, int], ...] = ()
    lengths: tuple[tuple[HalfPoly, int], ...] = ()


class HalfAngles:
    """The ring Z[t_1, ..., symbols] beside a :class:`TrigRing`, with c = (1 - t^2)/(1 + t^2), s = 2 t/(1 + t^2).

    Q[c, s]/(c^2 + s^2 - 1) has no unique factors: s^2 = (1 - c)(1 + c). Polynomials in t have. The factor 1 + t^2
    is never zero and dropped, a lack of degree stands for the root q = pi.
    """

    def __init__(self, ring: TrigRing) -> None:
        self.ring = ring
        self.size = len(ring.coordinates)
        names = [("d" if j.slides else "t") + j.label for j in ring.coordinates]
        self.names = (*names, *ring.symbols)
        self.ctx = fmpz_mpoly_ctx.get(self.names or ("unused",), "lex")
        self._rational = fmpq_mpoly_ctx.get(self.names or ("unused",), "lex")
        self.gens = self.ctx.gens()
        self._factored: dict[str, Factors] = {}

    @cached_property
    def _wide(self) -> tuple[fmpz_mpoly_ctx, tuple[HalfPoly, ...]]:
        """A ring with a homogenising variable a joint, and what its variables become."""
        ring, one = self.ring, self.ctx.constant(1)
        images = [one] * len(ring.names)
        for k, (s, c, _) in ring.circles.items():
            images[s], images[c] = 2 * self.gens[k], one - self.gens[k] ** 2
        for k, index in ring.slides.items():
            images[index] = self.gens[k]
        start = len(ring.names) - len(ring.symbols)
        for i in range(len(ring.symbols)):
            images[start + i] = self.gens[self.size + i]
        extra = [one + self.gens[k] ** 2 for k in range(self.size)]
        names = (*ring.names, *(f"w{k}" for k in range(self.size)))
        return fmpz_mpoly_ctx.get(names, "lex"), (*images, *extra)

    def form(self, p: Poly) -> tuple[HalfPoly, tuple[int, ...]]:
        """The numerator in t, up to a positive rational factor, and its degree as a form in each joint."""
        terms = list(p.terms())
        scale = lcm(*(int(a.q) for _, a in terms))
        circles = self.ring.circles
        degrees = [0] * self.size
        for k, (s, c, _) in circles.items():
            degrees[k] = max(int(powers[s] + powers[c]) for powers, _ in terms)
        wide: dict[tuple[int, ...], int] = {}
        for powers, a in terms:
            fill = [0] * self.size
            for k, (s, c, _) in circles.items():
                fill[k] = degrees[k] - int(powers[s] + powers[c])
            wide[(*(int(e) for e in powers), *fill)] = int(a * scale)
        ctx, images = self._wide
        out = ctx.from_dict(wide).compose(*images, ctx=self.ctx)
        return out, tuple(2 * d for d in degrees)

    def factors(self, p: Poly) -> Factors:
        """All factors of a trigonometric polynomial."""
        if len(p) == 0:
            return Factors(True)
        name = str(p)
        if name not in self._factored:
            self._factored[name] = self.split(*self.form(p))
        return self._factored[name]

    def split(self, poly: HalfPoly, degrees: tuple[int, ...] | None = None) -> Factors:
        """Factors of a form; where its degrees as a form are above those of the polynomial, q = pi is a root."""
        if len(poly) == 0:
            return Factors(True)
        # The factors of integer polynomials are sorted by coefficients in C ints, and large ones overflow
        _, rational_factors = fmpq_mpoly(poly, self._rational).factor()
        found = [(self._integral(g), int(power)) for g, power in rational_factors]
        left = list(degrees or (int(e) for e in poly.degrees()[: self.size]))
        conditions: list[tuple[Factor, int]] = []
        lengths: list[tuple[HalfPoly, int]] = []
        for g, power in found:
            own = [int(e) for e in g.degrees()[: self.size]]
            left = [a - power * b for a, b in zip(left, own, strict=True)]
            joints = [k for k, e in enumerate(own) if e]
            if not joints:
                lengths.append((self._length(g), power))
            elif not (len(joints) == 1 and g == 1 + self.gens[joints[0]] ** 2):
                conditions.append((self._condition(g, joints), power))
        for k, lack in enumerate(left):
            if lack and k in self.ring.circles:
                conditions.append((Value(k, None), lack))
        conditions.sort(key=lambda item: item[0].key)
        return Factors(False, tuple(conditions), tuple(lengths))

    def _length(self, g: HalfPoly) -> HalfPoly:
        """A factor in symbols alone, which must not be zero."""
        values = [rational(v) for v in self.ring.symbols.values()]
        if self.at(g, [fmpq(0)] * self.size + values) == 0:
            raise RangeError("symbols", str(g), "this is zero for the lengths given: leave symbols out")
        return g

    def _integral(self, p: fmpq_mpoly) -> HalfPoly:
        scale = lcm(*(int(a.q) for a in p.coeffs()))
        terms = {(*(int(e) for e in powers),): int(a * scale) for powers, a in p.terms()}
        return self.ctx.from_dict(terms)

    def _condition(self, g: HalfPoly, joints: list[int]) -> Factor:
        """A value, if the factor is linear in one variable with rational numbers; else a relation."""
        if len(joints) == 1:
            degrees = g.degrees()
            k = joints[0]
            if sum(degrees) == 1:
                numbers = {int(powers[k]): a for powers, a in g.terms()}
                return Value(k, fraction(-int(numbers.get(0, 0))) / fraction(int(numbers[1])))
        return Relation(g, self.size)

    def at(self, poly: HalfPoly, point: Sequence[fmpq]) -> fmpq:
        """The number that a polynomial is where its variables have these values."""
        return fmpq_mpoly(poly, self._rational)(*point)

    def put(self, poly: HalfPoly, value: Value, degree: int) -> HalfPoly:
        """A form of some degree in one joint with that joint at a value, up to a factor that is not zero."""
        k = value.joint
        if value.value is None:
            kept = {p: a for p, a in poly.to_dict().items() if int(p[k]) == degree}
            return self.ctx.from_dict({(*p[:k], 0, *p[k + 1 :]): a for p, a in kept.items()})
        top, below = value.value.numerator, value.value.denominator
        terms: dict[tuple[int, ...], int] = {}
        for powers, a in poly.terms():
            e = int(powers[k])
            rest = (*(int(x) for x in powers[:k]), 0, *(int(x) for x in powers[k + 1 :]))
            terms[rest] = terms.get(rest, 0) + int(a) * top**e * below ** (degree - e)
        return self.ctx.from_dict(terms)
