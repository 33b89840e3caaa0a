"""The Recursive Sub-Determinant Algorithm: where a matrix of polynomials loses rank."""

from __future__ import annotations

from wbc.analysis.branches import Branch
from wbc.analysis.deficiency import Exact
from wbc.analysis.locus import Locus
from wbc.analysis.ring import Matrix

#: Branches that one search looks at, at most
BUDGET = 2000


def sub_determinant_locus(exact: Exact, matrix: Matrix, budget: int = BUDGET) -> Locus:
    """The locus { q : rank J(q) < min(rows, columns) } as branches without redundant ones.

    The conditions found so far are put into the original matrix. If it is deficient there, they are a branch of the
    locus. If some minor is never zero, they are none. Else the cheapest maximal minor that does not vanish is
    factored, and each of its factors joins the conditions in turn.

    What differs from the published form: pivots that are numbers are eliminated before minors are formed, minors are
    ordered by their length after simplification, and zero is decided exactly.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 3.6.
    """
    accepted: list[Branch] = []
    seen: set[Branch] = set()
    waiting = [Branch()]
    while waiting and len(seen) < budget:
        branch = waiting.pop()
        if branch in seen or any(exact.branches.within(branch, known) for known in accepted):
            continue
        seen.add(branch)
        minors = exact.minors(matrix, branch)
        if minors.full:
            continue
        left = [p for p in minors.polys if not exact.branches.vanishes(p, branch)]
        if not left:
            accepted.append(branch)
            continue
        _, factors = exact.cheapest(left)
        children = exact.extended(branch, (f for f, _ in factors.conditions))
        waiting += sorted(children, key=lambda child: -len(child.relations))
    return Locus(tuple(exact.without_redundant(accepted)), tuple(exact.without_redundant(waiting)))
