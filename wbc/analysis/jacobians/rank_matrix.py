"""Matrices that have full column rank where a stacked Jacobian has, with fewer columns and shorter entries."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wbc.analysis.algebra.minors import without
from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing
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
    left = [list(row) for row in matrix if any(len(p) for p in row)]
    width = len(matrix[0])
    while left:
        pivots = [(i, j) for i, row in enumerate(left) for j, p in enumerate(row) if _pivot(left, i, j, p)]
        if not pivots:
            break
        i, j = min(pivots, key=lambda pivot: _alone(left, *pivot))
        left = [row for row in without(ring, left, i, j) if any(len(p) for p in row)]
        width -= 1
    # Columns without a row are a loss of rank, and no columns are none
    return left or [[ring.zero] * width for _ in range(width > 0)]


def _number(p: Poly) -> bool:
    return len(p) == 0 or bool(p.is_constant())


def _pivot(matrix: Matrix, i: int, j: int, p: Poly) -> bool:
    if not len(p) or not p.is_constant():
        return False
    return all(map(_number, matrix[i])) or all(_number(row[j]) for row in matrix)


def _alone(matrix: Matrix, i: int, j: int) -> tuple[bool, float]:
    """Pivots alone in their row or column first, then large ones."""
    alone = sum(len(p) > 0 for p in matrix[i]) == 1 or sum(len(row[j]) > 0 for row in matrix) == 1
    number = matrix[i][j].leading_coefficient()
    return not alone, -abs(int(number.p) / int(number.q))
