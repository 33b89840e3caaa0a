"""Matrices that have full column rank where a stacked Jacobian has, with fewer columns and shorter entries."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wbc.analysis.algebra.minors import eliminated
from wbc.analysis.algebra.ring import Matrix, TrigRing
from wbc.analysis.jacobians.equivalent_rows import split_twists, whole_twist
from wbc.analysis.jacobians.jacobian import body_rows, symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel
from wbc.analysis.rows import Rows


def equivalent_matrices(model: ExactModel, rows: Sequence[Rows]) -> Iterator[Matrix]:
    """Matrices of the rank of the rows at every configuration, their columns the joints.

    A whole twist (v; omega) of a body is taken in the axes of any frame and at its origin or that of a neighbour, which
    is a regular change of its six rows, or split at a point of another body, see :func:`split_twists`.
    """
    whole = [r for r in rows if whole_twist(r)]
    rest = [r for r in rows if not whole_twist(r)]
    fixed = symbolic_jacobian(model, rest).matrix if rest else []
    if not whole:
        yield fixed
        return
    frames = model.distinct_frames()
    for i, axes in enumerate(frames):
        for point in frames[max(i - 1, 0) : i + 2]:
            yield [row for r in whole for row in body_rows(model, r, axes, at=point)] + fixed
    for equivalent in split_twists(model, rows):
        yield symbolic_jacobian(model, equivalent).matrix


def rank_matrices(model: ExactModel, rows: Sequence[Rows]) -> Iterator[Matrix]:
    """Matrices M(q), each for all q: J has rank m where M has full column rank; no columns: J has it everywhere.

    They are what pivots that are numbers leave of the equivalents, see :func:`reduced`.
    """
    for matrix in equivalent_matrices(model, rows):
        yield reduced(model.ring, matrix)


def reduced(ring: TrigRing, matrix: Matrix) -> Matrix:
    """What pivots that are numbers leave. Only those whose row or column has nothing but numbers are taken: no entry
    becomes a product of two others.
    """
    left, count = eliminated(ring, [row for row in matrix if any(len(p) for p in row)], cost=_alone)
    width = len(matrix[0]) - count
    # Columns without a row are a loss of rank, and no columns are none
    return left or [[ring.zero] * width for _ in range(width > 0)]


def _alone(matrix: Matrix, i: int, j: int) -> tuple[bool, float] | None:
    """Pivots alone in their row or column first, then large ones; None where neither has numbers alone."""
    row, column = matrix[i], [other[j] for other in matrix]
    if not any(all(len(p) == 0 or p.is_constant() for p in line) for line in (row, column)):
        return None
    number = row[j].leading_coefficient()
    return min(sum(len(p) > 0 for p in line) for line in (row, column)) > 1, -abs(int(number.p) / int(number.q))
