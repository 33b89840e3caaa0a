"""Branches of a locus: sets of conditions on joints, and what follows from them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

from flint import fmpq, fmpz_mpoly_vec

from wbc.analysis.algebra.half_angles import Factor, HalfAngles, HalfPoly, Relation, Value
from wbc.analysis.algebra.ring import Poly, rational

#: Largest work of one ideal basis: its size, terms a polynomial, bits a coefficient
LIMITS = (40, 400, 800)


@dataclass(frozen=True)
class LocusBranch:
    """Conditions that hold together.

    Attributes:
        values: joints at one place, sorted. relations: irreducible polynomials that are zero, sorted.
    """

    values: tuple[Value, ...] = ()
    relations: tuple[Relation, ...] = ()

    @property
    def codimension(self) -> int:
        """Number of conditions."""
        return len(self.values) + len(self.relations)

    @property
    def terms(self) -> int:
        """Terms of the relations."""
        return sum(len(relation.poly) for relation in self.relations)


@cache
def cosine_sine(t: Fraction | None) -> tuple[fmpq, fmpq]:
    """cos q and sin q where tan(q/2) = t."""
    if t is None:
        return fmpq(-1), fmpq(0)
    n = 1 + t * t
    return rational((1 - t * t) / n), rational(2 * t / n)


class BranchArithmetic:
    """What can be done with branches of one robot. Keeps ideal bases, so one object serves a whole analysis."""

    def __init__(self, half: HalfAngles) -> None:
        self.half = half
        self._bases: dict[tuple[Relation, ...], fmpz_mpoly_vec | None] = {}
        self._swaps: dict[tuple[Value, ...], dict[str | int, int | fmpq]] = {}

    def put(self, p: Poly, branch: LocusBranch) -> Poly:
        """A trigonometric polynomial with the values of a branch put in."""
        if branch.values not in self._swaps:
            slides = self.half.ring.slides
            numbers = {
                v.joint: (rational(v.value or Fraction(0)), fmpq(0)) if v.joint in slides else cosine_sine(v.value)
                for v in branch.values
            }
            self._swaps[branch.values] = self.half.ring.substitution(numbers)
        return self.half.ring.at(p, self._swaps[branch.values])

    def vanishes(self, p: Poly, branch: LocusBranch) -> bool:
        """Whether a polynomial is proved to be zero on the whole branch: it is in the ideal of the relations.

        False means that it is not in the ideal; with several relations it may be zero all the same.
        """
        p = self.put(p, branch)
        if len(p) == 0:
            return True
        return bool(branch.relations) and self.form_vanishes(self.half.form(p)[0], branch)

    def form_vanishes(self, form: HalfPoly, branch: LocusBranch) -> bool:
        """The same of a form in half angles that the values are already in."""
        if len(form) == 0:
            return True
        for relation in branch.relations:
            if len(form % relation.poly) == 0:
                return True
        if len(branch.relations) < 2:
            return False
        basis = self._basis(branch.relations)
        return basis is not None and _remainder_is_zero(form, basis)

    def holds(self, condition: Factor, branch: LocusBranch) -> bool:
        """Whether a condition follows from those of a branch."""
        if isinstance(condition, Value):
            return condition in branch.values
        if condition in branch.relations:
            return True
        return self.form_vanishes(self._put(condition, branch)[0], branch)

    def within(self, inner: LocusBranch, outer: LocusBranch) -> bool:
        """Whether the conditions of ``outer`` all follow from those of ``inner``."""
        conditions: tuple[Factor, ...] = (*outer.values, *outer.relations)
        return all(self.holds(c, inner) for c in conditions)

    def with_condition(self, branch: LocusBranch, condition: Factor) -> list[LocusBranch]:
        """The branches in which the condition holds as well; none where it contradicts the others."""
        if isinstance(condition, Relation):
            return self._with_relation(branch, condition)
        for value in branch.values:
            if value.joint == condition.joint:
                return [branch] if value == condition else []
        out = [LocusBranch(tuple(sorted((*branch.values, condition), key=lambda v: v.key)))]
        for relation in branch.relations:
            out = [after for one in out for after in self._with_form(one, relation)]
        return unique(out)

    def _put(self, relation: Relation, branch: LocusBranch) -> tuple[HalfPoly, tuple[int, ...]]:
        """A relation with the values of a branch put in, and its degrees as a form in the other joints."""
        form, degrees = relation.poly, list(relation.degrees)
        for value in branch.values:
            form = self.half.put(form, value, degrees[value.joint])
            degrees[value.joint] = 0
        return form, tuple(degrees)

    def _with_form(self, branch: LocusBranch, relation: Relation) -> list[LocusBranch]:
        """Branches in which a relation holds, some joints of which are at values."""
        found = self.half.split(*self._put(relation, branch))
        if found.zero:
            return [branch]
        return unique(after for factor, _ in found.conditions for after in self.with_condition(branch, factor))

    def _with_relation(self, branch: LocusBranch, relation: Relation) -> list[LocusBranch]:
        if {v.joint for v in branch.values} & set(relation.joints):
            return self._with_form(branch, relation)
        if relation in branch.relations:
            return [branch]
        together = _joined(branch, relation)
        for other in branch.relations:
            shared = [k for k in other.joints if k in relation.joints]
            if shared:
                return self._eliminated(together, other, relation, shared[-1])
        return self._refined(together)

    def _eliminated(self, branch: LocusBranch, a: Relation, b: Relation, joint: int) -> list[LocusBranch]:
        """A pair of relations split along the factors of their resultant with respect to one joint."""
        resultant = a.poly.resultant(b.poly, joint)
        degrees = tuple(
            0 if k == joint else a.degrees[joint] * b.degrees[k] + b.degrees[joint] * a.degrees[k]
            for k in range(self.half.size)
        )
        out: list[LocusBranch] = []
        for factor, _ in self.half.split(resultant, degrees).conditions:
            if isinstance(factor, Value):
                out += self.with_condition(branch, factor)
            else:
                out += self._refined(_joined(branch, factor))
        return unique(out)

    def _refined(self, branch: LocusBranch) -> list[LocusBranch]:
        """A branch with several relations split along the factors of its ideal's basis.

        In half angles the basis speaks of configurations with no joint at pi; those with one are branches of their
        own. A member of the basis that is never zero ends the branch.
        """
        if len(branch.relations) < 2:
            return [branch]
        out: list[LocusBranch] = []
        for k in sorted({k for r in branch.relations for k in r.joints} & set(self.half.ring.circles)):
            out += self.with_condition(branch, Value(k, None))
        return unique(out + self._finite(branch))

    def _finite(self, branch: LocusBranch) -> list[LocusBranch]:
        """The part of a branch where no joint of the relations is at pi."""
        for member in self._basis(branch.relations) or ():
            conditions = [c for c, _ in self.half.split(member).conditions]
            if not conditions:
                return []
            if len(conditions) == 1 and isinstance(conditions[0], Relation):
                continue
            out: list[LocusBranch] = []
            for condition in conditions:
                if isinstance(condition, Value):
                    out += self.with_condition(branch, condition)
                else:
                    out += self._finite(_joined(branch, condition))
            return unique(out)
        return [branch]

    def simplified(self, branch: LocusBranch) -> LocusBranch:
        """The same branch by few short relations: members of the basis may replace what they imply."""
        if len(branch.relations) < 2:
            return branch
        members = [self.half.split(member).conditions for member in self._basis(branch.relations) or ()]
        known = {*branch.relations}
        known |= {c[0][0] for c in members if len(c) == 1 and isinstance(c[0][0], Relation)}
        kept: tuple[Relation, ...] = ()
        for relation in sorted(known, key=lambda r: (len(r.joints), *r.key)):
            if not self.form_vanishes(relation.poly, LocusBranch((), kept)):
                kept = (*kept, relation)
        for relation in reversed(kept):
            others = tuple(r for r in kept if r != relation)
            if self.form_vanishes(relation.poly, LocusBranch((), others)):
                kept = others
        return LocusBranch(branch.values, tuple(sorted(kept, key=lambda r: r.key)))

    def _basis(self, relations: tuple[Relation, ...]) -> fmpz_mpoly_vec | None:
        """Basis of the ideal, or None where it takes too much."""
        if relations not in self._bases:
            vector = fmpz_mpoly_vec([r.poly for r in relations], self.half.ctx)
            # With limits it says as well whether it came to an end, which the annotations of python-flint leave out
            found: Any = vector.buchberger_naive(limits=LIMITS)
            self._bases[relations] = found[0].autoreduction() if found[1] else None
        return self._bases[relations]


def _joined(branch: LocusBranch, relation: Relation) -> LocusBranch:
    return LocusBranch(branch.values, tuple(sorted({*branch.relations, relation}, key=lambda r: r.key)))


def _remainder_is_zero(form: HalfPoly, basis: fmpz_mpoly_vec) -> bool:
    # The annotations of python-flint leave this method out
    reduce: Callable[[fmpz_mpoly_vec], HalfPoly] = getattr(form, "reduction_primitive_part")  # noqa: B009
    return len(reduce(basis)) == 0


def unique(branches: Iterable[LocusBranch]) -> list[LocusBranch]:
    """The branches in order, each once."""
    return list(dict.fromkeys(branches))
