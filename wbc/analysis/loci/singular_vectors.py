"""The Singular Vector Algorithm: where a matrix of polynomials loses rank, by null vectors of a square part of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import combinations

from wbc.analysis.algebra.branches import LocusBranch, unique
from wbc.analysis.algebra.deficiency import Exact
from wbc.analysis.algebra.locus import Locus
from wbc.analysis.algebra.minors import determinant, eliminated, maximal_minors, transposed
from wbc.analysis.algebra.ring import Matrix, Poly
from wbc.analysis.algebra.transforms import dot
from wbc.analysis.loci.budget import Budget

#: Blocks of full rank that are compared before the cheapest is taken
BLOCKS = 8
#: Terms of the relations of a branch, beyond which it is left open: its null vectors are minors of long polynomials
TERMS = 120


@dataclass(frozen=True)
class _SquareBlock:
    """A square block whose determinant does not vanish on a branch."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    det: Poly


def singular_vector_locus(
    exact: Exact, matrix: Matrix, budget: Budget | None = None, progress: Callable[[Locus], None] | None = None
) -> Locus:
    """The locus { q : rank J(q) < min(rows, columns) } as branches without redundant ones.

    Of a wide J (a tall one is transposed) the square part J_sq with the cheapest determinant is taken, J_r is the
    rest. On each branch of det J_sq = 0, with U the left null vectors of J_sq there, J is deficient where U' J_r is,
    which is the same problem in a smaller matrix. A branch is accepted if there are fewer redundant columns than null
    vectors, or if U' J_r is zero. Where J_sq loses more rank, the branch is split first. What the budget, a keyboard
    interrupt or the length of relations cuts off is among the open branches.

    Args:
        progress: called after each step of the outermost matrix with what is known.

    What differs from the published form: pivots that are numbers are eliminated first, null vectors are minors, not
    orthogonal (the rank of U' J_r is the same), branches within accepted ones are left out at once, and every accepted
    branch is checked: where null vectors vanish together they prove nothing.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 3.4.
    """
    wide = matrix if len(matrix) <= len(matrix[0]) else transposed(matrix)
    search = _VectorSearch(exact, budget or Budget(), progress)
    found = search.started(wide)
    return Locus(tuple(exact.without_redundant(found)), tuple(unique(search.open)))


@dataclass
class _VectorSearch:
    """One search: its arithmetic, what it may take, and the branches that it did not decide."""

    exact: Exact
    budget: Budget
    progress: Callable[[Locus], None] | None
    open: list[LocusBranch] = field(default_factory=list)
    depth: int = 0

    def started(self, matrix: Matrix) -> list[LocusBranch]:
        """The branches of the locus of a wide matrix."""
        try:
            return self.locus(matrix, LocusBranch(), [])
        except KeyboardInterrupt:
            self.open = [LocusBranch()]
            return []

    def locus(self, matrix: Matrix, parent: LocusBranch, known: list[LocusBranch]) -> list[LocusBranch]:
        """Branches within ``parent`` where a wide matrix is deficient; those within ``known`` may be missing."""
        exact = self.exact
        put = [[exact.branches.put(p, parent) for p in row] for row in matrix]
        here, pivots = eliminated(exact.ring, put)
        n = len(matrix) - pivots
        if n == 0:
            return []
        if len(here) < n:
            return [parent]
        minors = list(maximal_minors(exact.ring, transposed(here)))
        if any(det.is_constant() for _, det in minors):
            return []
        found = [(det, columns) for columns, det in minors if not exact.branches.vanishes(det, parent)]
        if not found:
            return [parent]
        found.sort(key=lambda item: len(item[0]))
        cheapest, factors = exact.cheapest([det for det, _ in found])
        chosen = next(columns for det, columns in found if det == cheapest)
        waiting = exact.extended(parent, (f for f, _ in factors.conditions))
        if n == len(here[0]):
            return waiting
        others = [j for j in range(len(here[0])) if j not in chosen]
        sorted_columns = [[row[j] for j in (*chosen, *others)] for row in here]
        return self._accepted(sorted_columns, waiting, known)

    def _accepted(self, matrix: Matrix, waiting: list[LocusBranch], known: list[LocusBranch]) -> list[LocusBranch]:
        """Of branches on which the square part, the first columns, is deficient those parts where the matrix is."""
        accepted: list[LocusBranch] = []
        seen: set[LocusBranch] = set()
        self.depth += 1
        while waiting:
            waiting.sort(key=lambda b: (-b.codimension, -b.terms))
            branch = waiting.pop()
            if branch in seen or any(self.exact.branches.within(branch, other) for other in (*known, *accepted)):
                continue
            if branch.terms > TERMS or not self.budget.take():
                self.open.append(branch)
                continue
            seen.add(branch)
            try:
                inner, deeper = self._on_branch(matrix, branch, [*known, *accepted])
            except KeyboardInterrupt:
                self.budget.end()
                self.open.append(branch)
                continue
            accepted += [b for b in inner if self.exact.deficient(matrix, b)]
            waiting += deeper
            if self.progress is not None and self.depth == 1:
                self.progress(Locus(tuple(unique(accepted)), tuple(unique([*waiting, *self.open]))))
        self.depth -= 1
        return self.exact.without_redundant(accepted)

    def _on_branch(
        self, matrix: Matrix, branch: LocusBranch, known: list[LocusBranch]
    ) -> tuple[list[LocusBranch], list[LocusBranch]]:
        """(branches where the whole matrix may be deficient, branches where the square part loses more rank)."""
        exact, n = self.exact, len(matrix)
        put = [[exact.branches.put(p, branch) for p in row] for row in matrix]
        here, pivots = eliminated(exact.ring, put, n)
        if len(here) < n - pivots:
            return [branch], []
        n -= pivots
        square, rest = [row[:n] for row in here], [row[n:] for row in here]
        block = _largest_block(exact, square, branch)
        deeper = exact.extended(branch, (f for f, _ in exact.half.factors(block.det).conditions))
        redundant = len(rest[0])
        if n - len(block.rows) > redundant:
            return [branch], deeper
        vectors = _null_vectors(exact, square, block)
        product = [[dot(u, [row[j] for row in rest], exact.ring) for j in range(redundant)] for u in vectors]
        if all(exact.branches.vanishes(p, branch) for row in product for p in row):
            return [branch], deeper
        return self.locus(product, branch, known), deeper


def _largest_block(exact: Exact, square: Matrix, branch: LocusBranch) -> _SquareBlock:
    """A block as large as the rank on the branch; of several the one with the shortest determinant."""
    for size in range(len(square) - 1, 0, -1):
        blocks: list[_SquareBlock] = []
        for block in _blocks(exact, square, size):
            if not exact.branches.vanishes(block.det, branch):
                blocks.append(block)
            if len(blocks) == BLOCKS or (blocks and blocks[-1].det.is_constant()):
                break
        if blocks:
            return min(blocks, key=lambda b: (not b.det.is_constant(), len(b.det)))
    return _SquareBlock((), (), exact.ring.one)


def _blocks(exact: Exact, square: Matrix, size: int) -> Iterator[_SquareBlock]:
    indices = range(len(square))
    for rows in combinations(indices, size):
        for columns in combinations(indices, size):
            yield _SquareBlock(rows, columns, determinant(exact.ring, [[square[i][j] for j in columns] for i in rows]))


def _null_vectors(exact: Exact, square: Matrix, block: _SquareBlock) -> Matrix:
    """Left null vectors by Cramer's rule: det B for one more row, minus det B with that row in B's rows."""
    inside = [[square[i][j] for j in block.columns] for i in block.rows]
    out: Matrix = []
    for i in range(len(square)):
        if i in block.rows:
            continue
        vector = [exact.ring.zero] * len(square)
        vector[i] = block.det
        extra = [square[i][j] for j in block.columns]
        for k, row in enumerate(block.rows):
            vector[row] = -determinant(exact.ring, [*inside[:k], extra, *inside[k + 1 :]])
        out.append(vector)
    return out
