"""What both locus algorithms share: maximal minors under values of joints, the cheapest one, real branches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice

from wbc.analysis.algebra.branches import BranchArithmetic, LocusBranch, unique
from wbc.analysis.algebra.emptiness import proved_empty
from wbc.analysis.algebra.half_angles import Factor, Factors, HalfAngles, Relation
from wbc.analysis.algebra.minors import eliminated, maximal_minors, transposed
from wbc.analysis.algebra.points import changes_sign, univariate_roots
from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing

#: Minors, shortest first, that are factored to find the cheapest
CANDIDATES = 16
#: Terms of relations that bounds are computed of, at most
TERMS = 600


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
