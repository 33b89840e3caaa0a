"""What both locus algorithms share: maximal minors under values of joints, the cheapest one, real branches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from wbc.analysis.algebra.branches import BranchArithmetic, LocusBranch, unique
from wbc.analysis.algebra.fourier import fourier
from wbc.analysis.algebra.half_angles import Factor, Factors, HalfAngles, Relation
from wbc.analysis.algebra.minors import eliminated, maximal_minors, transposed
from wbc.analysis.algebra.points import changes_sign, univariate_roots
from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing
from wbc.validation import Array

#: Minors, shortest first, that are factored to find the cheapest
CANDIDATES = 16
#: Terms of relations that bounds are computed of, at most
TERMS = 600
#: Boxes that are looked at together
BOXES = 4000
#: Rounds of cutting each box in two; what is left then is not proved
ROUNDS = 80
#: What a bound must keep from zero, in parts of the sum of all coefficients: beyond any rounding
_ROOM = 1e-9


def proved_empty(half: HalfAngles, relations: Sequence[Relation], boxes: int = BOXES) -> bool:
    """Whether no configuration satisfies all of the relations. False proves nothing.

    Over a box with centre c and half widths h a relation f(q) = sum_k a_k cos(w_k.q + b_k) keeps within

        |f(q) - f(c)| <= sum_i |df/dq_i(c)| h_i + 1/2 sum_k |a_k| (|w_k|.h)^2

    of its value at the centre. Boxes in which some relation keeps from zero are done, the others are cut in the joint
    that counts most. Relations with sliding joints are not decided.
    """
    joints = sorted({k for r in relations for k in r.joints})
    if not relations or set(joints) & set(half.ring.slides):
        return False
    waves = [_WaveSum(half, r, joints) for r in relations]
    centre, width = np.zeros((1, len(joints))), np.full((1, len(joints)), np.nextafter(np.pi, 4.0))
    for _ in range(ROUNDS):
        left, weight = np.ones(len(centre), bool), np.zeros_like(centre)
        for one in waves:
            value, spread, share = one.bounds(centre, width)
            left &= np.abs(value) <= spread + _ROOM * one.size
            weight += share
        centre, width, weight = centre[left], width[left], weight[left]
        if not len(centre):
            return True
        if 2 * len(centre) > boxes:
            return False
        rows, cut = np.arange(len(centre)), np.argmax(weight, axis=1)
        width[rows, cut] /= 2.0
        low, high = centre.copy(), centre.copy()
        low[rows, cut] -= width[rows, cut]
        high[rows, cut] += width[rows, cut]
        centre, width = np.concatenate((low, high)), np.concatenate((width, width))
    return False


class _WaveSum:
    """A relation as a sum of waves in some joints; symbols take their values."""

    def __init__(self, half: HalfAngles, relation: Relation, joints: Sequence[int]) -> None:
        values = [float(v) for v in half.ring.symbols.values()]
        terms = fourier(half, relation.poly, relation.degrees)
        sliding = len(half.ring.slides)
        largest = max(abs(t.number) for t in terms)
        numbers = [
            float(t.number / largest) * float(np.prod([v**p for v, p in zip(values, t.powers[sliding:], strict=True)]))
            for t in terms
        ]
        self._number = np.array(numbers)
        self.size = float(np.abs(self._number).sum())
        self._wave = np.array([[t.frequency[k] / 2.0 for k in joints] for t in terms])
        # sin x = cos(x - pi/2)
        self._shift = np.array([-np.pi / 2.0 if t.sine else 0.0 for t in terms])

    def bounds(self, centre: Array, width: Array) -> tuple[Array, Array, Array]:
        """(values at the centres, how far they may be off, what each joint adds to that)."""
        phase = np.einsum("bj,tj->bt", centre, self._wave) + self._shift
        slope = np.abs(np.einsum("bt,tj->bj", -np.sin(phase) * self._number, self._wave)) * width
        reach = np.einsum("bj,tj->bt", width, np.abs(self._wave))
        curved = 0.5 * np.einsum("bt,t->b", reach * reach, np.abs(self._number))
        bent = np.einsum("bt,tj->bj", reach * np.abs(self._number), np.abs(self._wave)) * width
        value = np.einsum("bt,t->b", np.cos(phase), self._number)
        return value, slope.sum(1) + curved, (slope + 0.5 * bent) / max(self.size, 1e-300)


@dataclass(frozen=True)
class Minors:
    """Maximal minors of a matrix under some values.

    Attributes:
        full: whether the matrix has full rank at every configuration with these values.
        polys: those that are not identically zero, shortest first; none, and not ``full``: deficient everywhere.
    """

    full: bool
    polys: tuple[Poly, ...]


class Exact:
    """Arithmetic of one ring, with all that is worth keeping between the branches of an analysis."""

    def __init__(self, ring: TrigRing) -> None:
        self.ring = ring
        self.half = HalfAngles(ring)
        self.branches = BranchArithmetic(self.half)
        self._real: dict[Relation, bool] = {}

    def minors(self, matrix: Matrix, branch: LocusBranch = LocusBranch()) -> Minors:  # noqa: B008
        """Of a matrix with the values of a branch put in, after elimination of pivots that are numbers."""
        put = [[self.branches.put(p, branch) for p in row] for row in matrix]
        tall = put if len(put) >= len(put[0]) else transposed(put)
        rank = len(tall[0])
        left, pivots = eliminated(self.ring, tall)
        if pivots == rank:
            return Minors(True, ())
        if len(left) < rank - pivots:
            return Minors(False, ())
        polys = (p for _, p in maximal_minors(self.ring, left))
        found = sorted(polys, key=lambda p: (len(p), p.total_degree()))
        full = any(p.is_constant() for p in found)
        return Minors(full, () if full else tuple(found))

    def deficient(self, matrix: Matrix, branch: LocusBranch) -> bool:
        """Whether the matrix is proved to be short of full rank on the whole branch."""
        found = self.minors(matrix, branch)
        return not found.full and all(self.branches.vanishes(p, branch) for p in found.polys)

    def cheapest(self, polys: Iterable[Poly]) -> tuple[Poly, Factors]:
        """Of the shortest polynomials the one whose zeros are said most simply: few relations, short ones."""
        tried: list[tuple[Poly, Factors]] = []
        for p in islice(polys, CANDIDATES):
            tried.append((p, self.half.factors(p)))
            if _effort(tried[-1][1]) <= (0, 1):
                break
        return min(tried, key=lambda item: _effort(item[1]))

    def extended(self, branch: LocusBranch, conditions: Iterable[Factor]) -> list[LocusBranch]:
        """The branch with each one of the conditions, where some configuration can satisfy it."""
        out = [child for c in conditions for child in self.branches.with_condition(branch, c)]
        return [child for child in unique(out) if all(self.may_vanish(r) for r in child.relations)]

    def may_vanish(self, relation: Relation) -> bool:
        """False where its roots, if it is in one joint, or bounds prove that the relation is never zero."""
        if relation not in self._real:
            alone = len(relation.joints) == 1 and not any(relation.poly.degrees()[self.half.size :])
            self._real[relation] = (
                bool(univariate_roots(self.half, relation))
                if alone
                else changes_sign(self.half, relation) or not self._empty((relation,))
            )
        return self._real[relation]

    def real(self, branches: Iterable[LocusBranch]) -> tuple[LocusBranch, ...]:
        """The branches without those whose relations are proved to have no real solution together."""
        return tuple(b for b in branches if len(b.relations) < 2 or not self._empty(b.relations))

    def _empty(self, relations: tuple[Relation, ...]) -> bool:
        """Whether bounds prove it; long relations are left alone."""
        return sum(len(r.poly) for r in relations) <= TERMS and proved_empty(self.half, relations)

    def without_redundant(self, branches: Iterable[LocusBranch]) -> list[LocusBranch]:
        """The branches without those that lie within another one, larger sets first."""
        kept: list[LocusBranch] = []
        for branch in sorted(unique(map(self.branches.simplified, branches)), key=_order):
            if not any(self.branches.within(branch, other) for other in kept):
                kept = [other for other in kept if not self.branches.within(other, branch)]
                kept.append(branch)
        return sorted(kept, key=_order)


def _effort(factors: Factors) -> tuple[int, int]:
    relations = sum(len(f.poly) for f, _ in factors.conditions if isinstance(f, Relation))
    return relations, len(factors.conditions)


def _order(branch: LocusBranch) -> tuple[object, ...]:
    values = tuple((v.joint, v.value is None, v.value or 0) for v in branch.values)
    return branch.codimension, len(branch.relations), values, tuple(r.key for r in branch.relations)
