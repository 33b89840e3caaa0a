"""Determinants of square Jacobians, factored."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from flint import fmpq

from wbc import validation
from wbc.analysis.algebra.branches import cosine_sine
from wbc.analysis.algebra.deficiency import Exact
from wbc.analysis.algebra.fourier import fourier
from wbc.analysis.algebra.half_angles import Factors, HalfPoly, Relation, Value
from wbc.analysis.algebra.minors import determinant
from wbc.analysis.algebra.notation import Notation
from wbc.analysis.algebra.ring import Poly, fraction
from wbc.analysis.jacobians.jacobian import SymbolicJacobian
from wbc.errors import ShapeError


@dataclass(frozen=True, eq=False)
class Determinant:
    """det J of a square Jacobian.

    Attributes:
        exact: arithmetic of the robot. poly: the determinant, expanded. factors: irreducible ones, in half angles.
    """

    exact: Exact
    poly: Poly
    factors: Factors

    def text(self, *, latex: bool = False) -> str:
        """number * lengths * cosines and sines * the rest: c2 c6 L^2 s4 (L (s3 + s34) + D (1 - c345))."""
        latex = validation.flag("latex", latex)
        if self.factors.zero:
            return "0"
        notation = Notation(self.exact.half, latex)
        forms, names = self._pairs(notation)
        number = self._number(forms)
        parts = [] if abs(number) == 1 else [str(abs(number))]
        return ("-" if number < 0 else "") + " ".join(parts + names or ["1"])

    def _pairs(self, notation: Notation) -> tuple[list[tuple[HalfPoly, tuple[int, ...], int]], list[str]]:
        """Factors that are trigonometric polynomials by themselves: (form, degrees, power), and their text.

        t and u, which are zero at 0 and pi, pair to a sine, those of +-pi/2 to a cosine; what has no partner joins the
        relations that are of odd degree in its joint.
        """
        half = self.exact.half
        size, one = half.size, half.ctx.constant(1)
        powers = {(f.joint, f.value): n for f, n in self.factors.conditions if isinstance(f, Value)}
        forms: list[tuple[HalfPoly, tuple[int, ...], int]] = [
            (g, (0,) * size, n) for g, n in sorted(self.factors.lengths, key=lambda item: str(item[0]))
        ]
        for k in half.ring.circles:
            t = half.gens[k]
            for pair, form in (((Fraction(0), None), t), ((Fraction(-1), Fraction(1)), one - t * t)):
                count = min(powers.get((k, v), 0) for v in pair)
                if count:
                    forms.append((form, _unit(size, k, 2), count))
                    for v in pair:
                        powers[k, v] -= count
        left = [(key, n) for key, n in powers.items() if n]
        relations = [(f, n) for f, n in self.factors.conditions if isinstance(f, Relation)]
        rest, degrees = one, [0] * size
        for relation, n in relations:
            if all(e % 2 == 0 for e in relation.degrees):
                forms.append((relation.poly, relation.degrees, n))
                continue
            rest = rest * relation.poly**n
            degrees = [a + n * b for a, b in zip(degrees, relation.degrees, strict=True)]
        for (k, v), n in left:
            linear = one if v is None else v.denominator * half.gens[k] - v.numerator
            rest = rest * linear**n
            degrees[k] += n
        if any(degrees):
            forms.append((rest, tuple(degrees), 1))
        return forms, [self._written(notation, *item) for item in forms]

    def _written(self, notation: Notation, form: HalfPoly, degrees: tuple[int, ...], power: int) -> str:
        text = notation.form(form, degrees)
        if len(fourier(self.exact.half, form, degrees)) > 1 or text.startswith("-"):
            text = f"({text})"
        return text if power == 1 else f"{text}^{{{power}}}" if notation.latex else f"{text}^{power}"

    def _number(self, forms: list[tuple[HalfPoly, tuple[int, ...], int]]) -> Fraction:
        """The determinant over the product of its written factors, at a point where none is zero."""
        half, ring = self.exact.half, self.exact.ring
        t = [Fraction(2 * k + 3, 7 * k + 11) for k in range(half.size)]
        lengths = [Fraction(5 * i + 7, 3) for i in range(len(ring.symbols))]
        values: list[fmpq] = [fmpq(0)] * len(ring.names)
        for k, (s, c, _) in ring.circles.items():
            values[c], values[s] = cosine_sine(t[k])
        for k, index in ring.slides.items():
            values[index] = fmpq(t[k].numerator, t[k].denominator)
        start = len(ring.names) - len(lengths)
        values[start:] = [fmpq(x.numerator, x.denominator) for x in lengths]
        number = fraction(self.poly(*values))
        point = [fmpq(x.numerator, x.denominator) for x in (*t, *lengths)]
        notation = Notation(half)
        for form, degrees, power in forms:
            value = fraction(half.at(form, point)) / notation.scale(form, degrees)
            for k, e in enumerate(degrees):
                value /= (1 + t[k] ** 2) ** (e // 2)
            number /= value**power
        return number


def factored_determinant(exact: Exact, jacobian: SymbolicJacobian) -> Determinant:
    """The determinant of a square Jacobian.

    Raises:
        ShapeError: it is not square.
    """
    if jacobian.shape[0] != jacobian.shape[1]:
        raise ShapeError("jacobian", jacobian.shape, "expected as many rows as joints")
    poly = determinant(exact.ring, jacobian.matrix)
    return Determinant(exact, poly, exact.half.factors(poly))


def _unit(size: int, joint: int, degree: int) -> tuple[int, ...]:
    return tuple(degree if k == joint else 0 for k in range(size))
