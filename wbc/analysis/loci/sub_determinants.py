"""The Recursive Sub-Determinant Algorithm: where a matrix of polynomials loses rank."""

from __future__ import annotations

from collections.abc import Callable

from wbc.analysis.algebra.branches import LocusBranch, unique
from wbc.analysis.algebra.deficiency import Exact
from wbc.analysis.algebra.locus import Locus
from wbc.analysis.algebra.ring import Matrix
from wbc.analysis.loci.budget import Budget


def sub_determinant_locus(
    exact: Exact, matrix: Matrix, budget: Budget | None = None, progress: Callable[[Locus], None] | None = None
) -> Locus:
    """The locus { q : rank J(q) < min(rows, columns) } as branches without redundant ones.

    The conditions found so far are put into the original matrix. If it is deficient there, they are a branch of the
    locus. If some minor is never zero, they are none. Else the cheapest maximal minor that does not vanish is
    factored, and each of its factors joins the conditions in turn. What the budget or a keyboard interrupt cuts off
    is among the open branches.

    Args:
        progress: called after each step with what is known.

    What differs from the published form: pivots that are numbers are eliminated before minors are formed, minors are
    ordered by their length after simplification, and zero is decided exactly.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 3.6.
    """
    budget = budget or Budget()
    accepted: list[LocusBranch] = []
    seen: set[LocusBranch] = set()
    waiting = [LocusBranch()]
    while waiting:
        branch = waiting[-1]
        if branch in seen or any(exact.branches.within(branch, known) for known in accepted):
            waiting.pop()
            continue
        if not budget.take():
            break
        try:
            children = _children(exact, matrix, branch)
        except KeyboardInterrupt:
            budget.end()
            break
        waiting.pop()
        seen.add(branch)
        if children is None:
            accepted.append(branch)
        else:
            waiting += sorted(children, key=lambda child: -len(child.relations))
        if progress is not None:
            progress(Locus(tuple(unique(accepted)), tuple(unique(waiting))))
    return Locus(tuple(exact.without_redundant(accepted)), tuple(unique(waiting)))


def _children(exact: Exact, matrix: Matrix, branch: LocusBranch) -> list[LocusBranch] | None:
    """Branches within one to go on with; None: the matrix is deficient on all of it."""
    minors = exact.minors(matrix, branch)
    if minors.full:
        return []
    left = [p for p in minors.polys if not exact.branches.vanishes(p, branch)]
    if not left:
        return None
    _, factors = exact.cheapest(left)
    return exact.extended(branch, (f for f, _ in factors.conditions))
