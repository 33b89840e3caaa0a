"""Factors, relations and branches as text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

from wbc.analysis.algebra.branches import LocusBranch
from wbc.analysis.algebra.fourier import Term, fourier
from wbc.analysis.algebra.half_angles import HalfAngles, HalfPoly, Relation, Value

#: Terms in half angles beyond which a relation is not written out
LONG = 400
_ANGLES = {
    Fraction(0): ("0", "0"),
    Fraction(1): ("pi/2", r"\pi/2"),
    Fraction(-1): ("-pi/2", r"-\pi/2"),
    None: ("pi", r"\pi"),
}


@dataclass(frozen=True)
class Notation:
    """How polynomials of one robot are written. ``latex``: for LaTeX, else plain text."""

    half: HalfAngles
    latex: bool = False

    def label(self, joint: int) -> str:
        """Of a joint: q4."""
        coordinate = self.half.ring.coordinates[joint]
        letter = "d" if coordinate.slides else "q"
        return f"{letter}_{{{coordinate.label}}}" if self.latex else f"{letter}{coordinate.label}"

    def value(self, value: Value) -> str:
        """The place of a joint: -pi/2."""
        if value.joint in self.half.ring.slides:
            return str(value.value)
        if value.value in _ANGLES:
            return _ANGLES[value.value][self.latex]
        return rf"2\arctan({value.value})" if self.latex else f"2 atan({value.value})"

    def form(self, form: HalfPoly, degrees: tuple[int, ...], over: Fraction | None = None) -> str:
        """A form in half angles by cosines and sines of sums of angles, over a number; None: over what is common."""
        terms = fourier(self.half, form, degrees)
        if not terms:
            return "0"
        scale = 1 / (self.scale(form, degrees) if over is None else over)
        groups: dict[tuple[Fraction, tuple[int, ...]], list[Term]] = {}
        for term in terms:
            groups.setdefault((abs(term.number), term.powers), []).append(term)
        parts = [self._group(group, scale) for group in groups.values()]
        text = "".join((" - " if negative else " + ") + part for negative, part in parts)
        return f"-{text[3:]}" if parts[0][0] else text[3:]

    def scale(self, form: HalfPoly, degrees: tuple[int, ...]) -> Fraction:
        """The number that text without a common number is to be multiplied by to be the form."""
        terms = fourier(self.half, form, degrees)
        below = lcm(*(t.number.denominator for t in terms))
        above = gcd(*(int(t.number * below) for t in terms))
        return Fraction(above if terms[0].number > 0 else -above, below)

    def _common(self, forms: Sequence[HalfPoly], degrees: tuple[int, ...]) -> Fraction:
        """The number that several forms have in common, with the sign of the first."""
        scales = [self.scale(p, degrees) for p in forms if len(p)]
        below = lcm(*(s.denominator for s in scales))
        above = gcd(*(int(s * below) for s in scales))
        return Fraction(above if scales[0] > 0 else -above, below)

    def relation(self, relation: Relation) -> str:
        """The condition: q4 = pi - 2 q3 where it is one of the angles themselves, else the polynomial that is zero."""
        if len(relation.poly) > LONG:
            labels = ", ".join(map(self.label, relation.joints))
            text = f"({len(relation.poly)} terms in {labels}) = 0"
            return rf"\text{{{text}}}" if self.latex else text
        return self._linear(relation) or f"{self.form(relation.poly, relation.degrees)} = 0"

    def _linear(self, relation: Relation) -> str:
        """A single sine or cosine of sum n_i q_i / 2 that is zero, solved for one joint; "" where it is none.

        The sine is zero where the sum n_i q_i is a whole number of turns, the cosine half a turn away from it.
        """
        terms = fourier(self.half, relation.poly, relation.degrees)
        if len(terms) != 1 or len(relation.joints) < 2 or set(relation.joints) & set(self.half.ring.slides):
            return ""
        turns = terms[0].frequency
        alone = [k for k in relation.joints if abs(turns[k]) == 1]
        if not alone:
            return ""
        # q3 = q5 and not q5 = q3, but q4 = -2 q3 and not the other way round
        solved = max(alone, key=lambda k: (sum(abs(n) > 1 for n in turns[:k] + turns[k + 1 :]), -k))
        pi = (r"\pi" if self.latex else "pi") if not terms[0].sine else ""
        text = "".join(
            f" {'-' if turns[k] * turns[solved] > 0 else '+'} {self._multiple(abs(turns[k]), k)}"
            for k in relation.joints
            if k != solved
        )
        right = f"{pi}{text}" if pi else f"-{text[3:]}" if text.startswith(" -") else text[3:]
        return f"{self.label(solved)} = {right}"

    def _multiple(self, times: int, joint: int) -> str:
        return self.label(joint) if times == 1 else f"{times} {self.label(joint)}"

    def joints(self, names: Sequence[str]) -> str:
        """Whose numbers the labels are, by the names of the joints: q1 = shoulder, q2 = elbow."""
        return ", ".join(f"{self.label(k)} = {name}" for k, name in enumerate(names))

    def solved(self, relation: Relation) -> str:
        """The relation solved for one joint, where it is of first or second degree in its half angle; else "", as
        where :meth:`relation` is solved already.

        First degree, A sin(q/2) + B cos(q/2) = 0: tan(q/2) = -B/A. Second, A cos q + B sin q = C: for C = 0
        tan q = -A/B, else q = atan2(B, A) +- acos(C / sqrt(A^2 + B^2)).
        """
        if len(relation.poly) > LONG or self._linear(relation):
            return ""
        turning = [k for k in relation.joints if k in self.half.ring.circles]
        for degree in (1, 2):
            chosen = [k for k in turning if relation.degrees[k] == degree]
            if chosen and len(relation.joints) > 1:
                best = min(chosen, key=lambda k: len(self._solve(relation, k)))
                return self._solve(relation, best)
        return ""

    def _solve(self, relation: Relation, joint: int) -> str:
        rest = tuple(0 if k == joint else e for k, e in enumerate(relation.degrees))
        parts = coefficients(self.half, relation, joint)
        q = self.label(joint)
        if len(parts) == 2:
            half = rf"\tfrac{{1}}{{2}}{q}" if self.latex else f"{q}/2"
            return self._tangent(half, -parts[0], parts[1], rest)
        u2, tu, t2 = parts
        a, b, c = u2 - t2, tu, u2 + t2
        if not len(c) and len(b):
            return self._tangent(q, -a, b, rest)
        common = self._common((a, b, c), rest)
        A, B, C = (self.form(p, rest, common) for p in (a, b, -c))
        if self.latex:
            root = rf"\sqrt{{({A})^2 + ({B})^2}}"
            return rf"{q} = \operatorname{{atan2}}({B}, {A}) \pm \arccos\frac{{{C}}}{{{root}}}"
        return f"{q} = atan2({B}, {A}) +- acos(({C}) / sqrt(({A})^2 + ({B})^2))"

    def _tangent(self, angle: str, above: HalfPoly, below: HalfPoly, degrees: tuple[int, ...]) -> str:
        """tan(angle) = above / below."""
        common = self._common((below, above), degrees)
        top, bottom = (self.form(p, degrees, common) for p in (above, below))
        return rf"\tan({angle}) = \frac{{{top}}}{{{bottom}}}" if self.latex else f"tan({angle}) = ({top}) / ({bottom})"

    def branch(self, branch: LocusBranch) -> str:
        """The conditions, joined."""
        both = r" \wedge " if self.latex else " and "
        parts = [f"{self.label(v.joint)} = {self.value(v)}" for v in branch.values]
        parts += [self.relation(r) for r in branch.relations]
        return both.join(parts) or ("\\text{everywhere}" if self.latex else "everywhere")

    def branches(self, branches: Iterable[LocusBranch]) -> list[str]:
        """Branches with the values that a joint takes gathered: one line for q2 = -pi/2 and q2 = pi/2."""
        return list(self.lines(branches))

    def lines(self, branches: Iterable[LocusBranch]) -> Iterator[str]:
        """The lines of :meth:`branches`, each written when it is asked for: of many joints one takes seconds."""
        return (self._gathered(choice, relations) for choice, relations in gathered(branches))

    def _gathered(self, choice: dict[int, tuple[Value, ...]], relations: tuple[Relation, ...]) -> str:
        parts = []
        for joint, values in sorted(choice.items()):
            texts = [self.value(v) for v in values]
            if [v.value for v in values] == [-1, 1]:
                texts = [r"\pm\pi/2" if self.latex else "+-pi/2"]
            many = (r"\in \{", r"\}") if self.latex else ("in {", "}")
            said = f"= {texts[0]}" if len(texts) == 1 else f"{many[0]}{', '.join(texts)}{many[1]}"
            parts.append(f"{self.label(joint)} {said}")
        parts += [self.relation(r) for r in relations]
        both = r" \wedge " if self.latex else " and "
        return both.join(parts) or (r"\text{everywhere}" if self.latex else "everywhere")

    def _group(self, group: list[Term], scale: Fraction) -> tuple[bool, str]:
        """(whether it is negative, its text) of terms with one coefficient up to sign."""
        number, powers = group[0].number * scale, group[0].powers
        negative = number < 0
        inner = ""
        for term in group:
            opposite = (term.number * scale < 0) != negative
            inner += (" - " if opposite else " + ") + self._trig(term)
        inner = inner[3:]
        factors = [] if abs(number) == 1 else [self._number(abs(number))]
        names = [self.label(k) for k in self.half.ring.slides] + list(self.half.ring.symbols)
        for name, power in zip(names, powers, strict=True):
            if power:
                factors.append(name if power == 1 else f"{name}^{{{power}}}" if self.latex else f"{name}^{power}")
        if inner != "1" or not factors:
            factors.append(f"({inner})" if len(group) > 1 and factors else inner)
        if len(group) > 1 and not factors[:-1] and negative:
            factors[-1] = f"({inner})"
        return negative, " ".join(factors)

    def _number(self, number: Fraction) -> str:
        if number.denominator == 1 or not self.latex:
            return str(number)
        return rf"\tfrac{{{number.numerator}}}{{{number.denominator}}}"

    def _trig(self, term: Term) -> str:
        """c345, or cos(q3 + q4/2) where a multiple other than 1 appears."""
        turning = {k: n for k, n in enumerate(term.frequency) if n}
        if not turning:
            return "1"
        labels = [self.half.ring.coordinates[k].label for k in turning]
        if set(turning.values()) == {2} and all(len(label) == 1 for label in labels):
            letter = "s" if term.sine else "c"
            return f"{letter}_{{{''.join(labels)}}}" if self.latex else f"{letter}{''.join(labels)}"
        text = ""
        for k, n in turning.items():
            times = Fraction(abs(n), 2)
            whole = "" if times.numerator == 1 else f"{times.numerator} "
            below = "" if times.denominator == 1 else f"/{times.denominator}"
            text += (" - " if n < 0 else " + ") + f"{whole}{self.label(k)}{below}"
        name = ("\\" if self.latex else "") + ("sin" if term.sine else "cos")
        return f"{name}({text[3:]})"


def coefficients(half: HalfAngles, relation: Relation, joint: int) -> list[HalfPoly]:
    """Coefficients of cos(q/2)^d, cos(q/2)^(d-1) sin(q/2), ... of a relation in one joint's half angle."""
    out: list[dict[tuple[int, ...], int]] = [{} for _ in range(relation.degrees[joint] + 1)]
    for powers, number in relation.poly.terms():
        plain = [int(e) for e in powers]
        degree = plain[joint]
        plain[joint] = 0
        out[degree][tuple(plain)] = int(number)
    return [half.ctx.from_dict(terms) for terms in out]


def gathered(branches: Iterable[LocusBranch]) -> list[tuple[dict[int, tuple[Value, ...]], tuple[Relation, ...]]]:
    """Branches that differ in the value of one joint alone, put together as long as there are any."""
    sets: list[tuple[dict[int, tuple[Value, ...]], tuple[Relation, ...]]]
    sets = [({v.joint: (v,) for v in b.values}, b.relations) for b in branches]
    merged = True
    while merged:
        merged = False
        for i, (a, relations) in enumerate(sets):
            for j in range(i + 1, len(sets)):
                b, others = sets[j]
                apart = [k for k in a if a.get(k) != b.get(k)]
                if relations == others and a.keys() == b.keys() and len(apart) == 1:
                    both = sorted((*a[apart[0]], *b[apart[0]]), key=lambda v: v.key)
                    sets[i] = ({**a, apart[0]: tuple(both)}, relations)
                    del sets[j]
                    merged = True
                    break
            if merged:
                break
    return sets
