"""Determinants of square sub-matrices of a matrix of polynomials, exactly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import Any

from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing


def transposed(matrix: Matrix) -> Matrix:
    """Rows become columns."""
    return [list(column) for column in zip(*matrix, strict=True)]


def fill(matrix: Matrix, i: int, j: int) -> int:
    """Terms that elimination with a pivot writes, at most."""
    column = sum(len(row[j]) for k, row in enumerate(matrix) if k != i)
    return column * sum(len(p) for k, p in enumerate(matrix[i]) if k != j)


def eliminated(
    ring: TrigRing, matrix: Matrix, columns: int | None = None, cost: Callable[[Matrix, int, int], Any] = fill
) -> tuple[Matrix, int]:
    """Pivots that are numbers, eliminated: (what is left, how many). Those of the first ``columns``, or of all.

    The rank of the matrix is that of what is left plus the number of pivots, at every configuration, since a number
    is never zero. Among the pivots of a step that of the least ``cost`` is taken, none whose cost is None.
    """
    left = [list(row) for row in matrix]
    count = 0
    while left and left[0]:
        first = None if columns is None else columns - count
        pivots = [(i, j) for i, row in enumerate(left) for j, p in enumerate(row[:first]) if len(p) and p.is_constant()]
        costs = [(price, i, j) for i, j in pivots if (price := cost(left, i, j)) is not None]
        if not costs:
            break
        _, i, j = min(costs)
        left = [row for row in without(ring, left, i, j) if any(len(p) for p in row)]
        count += 1
    return left, count


def without(ring: TrigRing, matrix: Matrix, i: int, j: int) -> Matrix:
    """What elimination with a pivot that is a number leaves: M_kl - M_kj M_il / M_ij for k other than i, l than j."""
    row, number = matrix[i], matrix[i][j].leading_coefficient()
    rest: Matrix = []
    for k, other in enumerate(matrix):
        if k == i:
            continue
        if len(other[j]):
            ratio = other[j] / number
            other = [ring.normal(a - ratio * b) if len(b) else a for a, b in zip(other, row, strict=True)]
        rest.append(other[:j] + other[j + 1 :])
    return rest


def determinant(ring: TrigRing, matrix: Matrix) -> Poly:
    """det of a square matrix, by expansion along columns with the minors of fewer columns kept."""
    found = dict(maximal_minors(ring, matrix))
    return found.get(tuple(range(len(matrix))), ring.zero)


def maximal_minors(ring: TrigRing, matrix: Matrix) -> Iterator[tuple[tuple[int, ...], Poly]]:
    """(rows, determinant) of every square sub-matrix with all columns that is not identically zero.

    For a matrix with at least as many rows as columns. Laplace's expansion, column by column, sparse ones first: the
    minors of the first k columns give those of k + 1.
    """
    columns = transposed(matrix)
    order = sorted(range(len(columns)), key=lambda j: sum(len(p) for p in columns[j]))
    known: dict[tuple[int, ...], Poly] = {(): ring.one}
    for j in order:
        known = _one_more(ring, known, columns[j])
    sign = -1 if _odd(order) else 1
    for rows, value in sorted(known.items()):
        yield rows, sign * value


def _one_more(ring: TrigRing, known: dict[tuple[int, ...], Poly], column: list[Poly]) -> dict[tuple[int, ...], Poly]:
    """Minors with one column more, on the right."""
    sums: dict[tuple[int, ...], Poly] = {}
    for rows, value in known.items():
        for i, entry in enumerate(column):
            if not len(entry) or i in rows:
                continue
            taken = tuple(sorted((*rows, i)))
            term = value * entry
            below = len(taken) - 1 - taken.index(i)
            previous = sums.get(taken, ring.zero)
            sums[taken] = previous - term if below % 2 else previous + term
    reduced = {rows: ring.normal(p) for rows, p in sums.items()}
    return {rows: p for rows, p in reduced.items() if len(p)}


def _odd(order: list[int]) -> bool:
    return sum(a > b for a, b in combinations(order, 2)) % 2 == 1
