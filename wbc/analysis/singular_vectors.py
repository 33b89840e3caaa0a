"""The Singular Vector Algorithm: where a matrix of polynomials loses rank, by null vectors of a square part of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

from wbc.analysis.branches import Branch
from wbc.analysis.deficiency import Exact
from wbc.analysis.locus import Locus
from wbc.analysis.minors import determinant, transposed
from wbc.analysis.ring import Matrix, Poly
from wbc.analysis.transforms import dot

#: Blocks of full rank that are compared before the cheapest is taken
BLOCKS = 8


@dataclass(frozen=True)
class _Block:
    """A square block whose determinant does not vanish on a branch."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    det: Poly


def singular_vector_locus(exact: Exact, matrix: Matrix) -> Locus:
    """The locus { q : rank J(q) < min(rows, columns) } as branches without redundant ones.

    Of a wide J (a tall one is transposed) the square part J_sq with the cheapest determinant is taken, J_r is the
    rest. On each branch of det J_sq = 0, with U the left null vectors of J_sq there, J is deficient where U' J_r is,
    which is the same problem in a smaller matrix. A branch is accepted if there are fewer redundant columns than null
    vectors, or if U' J_r is zero. Where J_sq loses more rank, the branch is split first.

    What differs from the published form: null vectors are minors, not orthogonal (the rank of U' J_r is the same), and
    every accepted branch is checked: where null vectors vanish together they prove nothing.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 3.4.
    """
    wide = matrix if len(matrix) <= len(matrix[0]) else transposed(matrix)
    return Locus(tuple(exact.without_redundant(_locus(exact, wide, Branch()))))


def _locus(exact: Exact, matrix: Matrix, parent: Branch) -> list[Branch]:
    """Branches within ``parent`` where a wide matrix is deficient."""
    n, m = len(matrix), len(matrix[0])
    put = [[exact.branches.put(p, parent) for p in row] for row in matrix]
    found: list[tuple[Poly, tuple[int, ...]]] = []
    for columns in combinations(range(m), n):
        det = determinant(exact.ring, [[row[j] for j in columns] for row in put])
        if not exact.branches.vanishes(det, parent):
            found.append((det, columns))
    if not found:
        return [parent]
    found.sort(key=lambda item: len(item[0]))
    cheapest, factors = exact.cheapest([det for det, _ in found])
    chosen = next(columns for det, columns in found if det == cheapest)
    square = [[row[j] for j in chosen] for row in matrix]
    rest = [[row[j] for j in range(m) if j not in chosen] for row in matrix]
    waiting = exact.extended(parent, (f for f, _ in factors.conditions))
    if n == m:
        return waiting
    accepted: list[Branch] = []
    seen: set[Branch] = set()
    while waiting:
        branch = waiting.pop()
        if branch in seen:
            continue
        seen.add(branch)
        inner, deeper = _on_branch(exact, square, rest, branch)
        accepted += [b for b in inner if exact.deficient(matrix, b)]
        waiting += deeper
    return exact.without_redundant(accepted)


def _on_branch(exact: Exact, square: Matrix, rest: Matrix, branch: Branch) -> tuple[list[Branch], list[Branch]]:
    """(branches where the whole matrix may be deficient, branches where the square part loses more rank)."""
    here = [[exact.branches.put(p, branch) for p in row] for row in square]
    block = _largest_block(exact, here, branch)
    deeper = exact.extended(branch, (f for f, _ in exact.half.factors(block.det).conditions)) if block.rows else []
    nullity = len(here) - len(block.rows)
    redundant = len(rest[0])
    if nullity > redundant:
        return [branch], deeper
    vectors = _null_vectors(exact, here, block)
    product = [
        [dot(u, [exact.branches.put(row[j], branch) for row in rest], exact.ring) for j in range(redundant)]
        for u in vectors
    ]
    if all(exact.branches.vanishes(p, branch) for row in product for p in row):
        return [branch], deeper
    return _locus(exact, product, branch), deeper


def _largest_block(exact: Exact, square: Matrix, branch: Branch) -> _Block:
    """A block as large as the rank on the branch; of several the one with the shortest determinant."""
    for size in range(len(square) - 1, 0, -1):
        blocks: list[_Block] = []
        for block in _blocks(exact, square, size):
            if not exact.branches.vanishes(block.det, branch):
                blocks.append(block)
            if len(blocks) == BLOCKS or (blocks and blocks[-1].det.is_constant()):
                break
        if blocks:
            return min(blocks, key=lambda b: (not b.det.is_constant(), len(b.det)))
    return _Block((), (), exact.ring.one)


def _blocks(exact: Exact, square: Matrix, size: int) -> Iterator[_Block]:
    places = range(len(square))
    for rows in combinations(places, size):
        for columns in combinations(places, size):
            yield _Block(rows, columns, determinant(exact.ring, [[square[i][j] for j in columns] for i in rows]))


def _null_vectors(exact: Exact, square: Matrix, block: _Block) -> Matrix:
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
