"""Proofs of full column rank by blocks: two smaller matrices in the place of one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing
from wbc.analysis.algebra.trig_form import TrigForm, trig_form
from wbc.analysis.jacobians.equivalent_rows import split_twists
from wbc.analysis.jacobians.jacobian import symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel
from wbc.analysis.jacobians.rank_matrix import reduced
from wbc.analysis.rows import Rows

#: Pairs that are given to the subdivision, at most
MOST = 2


def block_proofs(model: ExactModel, rows: Sequence[Rows], allowed: Sequence[int]) -> tuple[tuple[TrigForm, ...], ...]:
    """Pairs (A, B) with: A and B of full column rank implies M of full column rank.

    With the columns in two groups and A the part of the rows that are zero outside the first one,

        M = [A  0]
            [C  B]

    up to the order of rows, for the splits M of a whole twist among the rows. A v = 0 leaves v = 0 in the first group,
    and then B v = 0 in the second. The splits are equivalents of one another by row operations, so A and B may come
    from different ones: the shortest is taken. Those that depend on other joints than ``allowed`` are left out.
    """
    whole = [symbolic_jacobian(model, equivalent).matrix for equivalent in split_twists(model, rows)]
    found: list[tuple[Matrix, ...]] = []
    for group in _groups(whole):
        first = _shortest(model.ring, [_inside(m, group) for m in whole], allowed)
        second = _shortest(model.ring, [[_without(row, group) for row in m] for m in whole], allowed)
        if first is not None and second is not None:
            found.append(tuple(matrix for matrix in (first, second) if matrix and matrix[0]))
    found.sort(key=lambda proof: _order(model.ring, proof))
    return tuple(tuple(trig_form(model.ring, matrix) for matrix in proof) for proof in found[:MOST] if proof)


def _order(ring: TrigRing, proof: tuple[Matrix, ...]) -> tuple[int, ...]:
    """Few joints in one matrix first, since boxes count by their power; then more rows than are needed."""
    spare = [len(matrix) - len(matrix[0]) for matrix in proof] or [0]
    joints = max((len(_joints(ring, matrix)) for matrix in proof), default=0)
    return joints, -min(spare), -sum(spare), sum(map(_terms, proof))


def _joints(ring: TrigRing, matrix: Matrix) -> set[int]:
    return {k for row in matrix for p in row for k in ring.used(p)}


def _terms(matrix: Matrix) -> int:
    return sum(len(p) for row in matrix for p in row)


def _groups(matrices: Sequence[Matrix]) -> list[tuple[int, ...]]:
    """Sets of columns that contain the supports of at least as many rows of some matrix, as even as any."""
    out: dict[tuple[int, ...], None] = {}
    for matrix in matrices:
        supports = [frozenset(j for j, p in enumerate(row) if len(p)) for row in matrix]
        unions = {a | b for a, b in combinations(supports, 2)} | set(supports)
        for union in sorted(unions, key=sorted):
            if 1 < len(union) < len(matrix[0]) - 1 and sum(s <= union for s in supports if s) >= len(union):
                out[tuple(sorted(union))] = None
    size = {group: max(len(group), len(matrices[0][0]) - len(group)) for group in out}
    return [group for group in out if size[group] == min(size.values())]


def _inside(matrix: Matrix, group: Sequence[int]) -> Matrix:
    chosen = set(group)
    rows = [row for row in matrix if all(j in chosen or not len(p) for j, p in enumerate(row))]
    return [[row[j] for j in group] for row in rows]


def _without(row: list[Poly], group: Sequence[int]) -> list[Poly]:
    return [p for j, p in enumerate(row) if j not in group]


def _shortest(ring: TrigRing, matrices: Sequence[Matrix], allowed: Sequence[int]) -> Matrix | None:
    """Of those with the most rows the one with the fewest joints, after elimination; None: all are too wide."""
    found: list[tuple[tuple[int, ...], Matrix]] = []
    for matrix in matrices:
        columns = len(matrix[0]) if matrix else 0
        if not columns or len(matrix) < columns:
            continue
        left = reduced(ring, matrix)
        joints, width = _joints(ring, left), len(left[0]) if left else 0
        if width <= len(left) and joints <= set(allowed):
            height = sum(any(len(p) for p in row) for row in matrix)
            found.append(((-height, len(joints), width, _terms(left)), left))
    return min(found, key=lambda item: item[0], default=((), None))[1]
