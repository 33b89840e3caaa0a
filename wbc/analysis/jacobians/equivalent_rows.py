"""Declarations that span the same rows at every configuration, with fewer joints in each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeGuard

from wbc.analysis.jacobians.jacobian import cost, symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel
from wbc.analysis.rows import ALL, BodyRows, Rows
from wbc.symbolic.kinematics import WORLD


def whole_twist(rows: Rows) -> TypeGuard[BodyRows]:
    """Whether a declaration is (v; omega) of a frame relative to the world, all six rows."""
    return _from_world(rows) and (sorted(rows.translation), sorted(rows.rotation)) == (list(ALL), list(ALL))


def split_twists(model: ExactModel, rows: Sequence[Rows]) -> Iterator[tuple[Rows, ...]]:
    """Equivalents of rows with one whole twist and the velocity of a point of another body.

    With v_p of the point and (v; omega) of a frame t in the rows, v may give way to the velocity of the point relative
    to the body of t, while v_p and omega stay:

        v_p - (v + omega x (p - t)),    v_p,    omega

    The first has the joints between the two bodies alone. omega is expressed in the axes of each frame in turn.
    """
    whole = [r for r in rows if whole_twist(r)]
    if len(whole) != 1:
        return
    tip = whole[0].frame
    rest = [r for r in rows if r is not whole[0]]
    shorter = {r: nearer(model, r, tip) for r in rest}
    points = {r.frame: r for r in rest if _from_world(r) and sorted(r.translation) == list(ALL) and r.frame != tip}
    for point, held in sorted(points.items()):
        # v is what v_p and the relative velocity leave, so v_p itself stays as it is
        others = [r if r is held else shorter[r] for r in rest]
        between = BodyRows(point, base=tip, rotation=())
        for axes in model.distinct_frames():
            yield (*others, between, BodyRows(tip, expressed=axes, translation=()))


def nearer(model: ExactModel, rows: Rows, tip: str) -> Rows:
    """A declaration, or the same relative to the body of a frame whose whole twist is among the rows, if it is shorter.

    The difference of the two is a sum of rows of that twist.
    """
    if not _from_world(rows) or whole_twist(rows):
        return rows
    other = replace(rows, base=tip)
    return min((rows, other), key=lambda r: _size(model, r))


def _size(model: ExactModel, rows: Rows) -> tuple[int, int, int]:
    """Joints, terms and cost of a declaration."""
    entries = [p for row in symbolic_jacobian(model, [rows]).matrix for p in row]
    return sum(len(p) > 0 for p in entries), sum(len(p) for p in entries), cost(model.ring, entries).total


def _from_world(rows: Rows) -> TypeGuard[BodyRows]:
    return isinstance(rows, BodyRows) and rows.base == WORLD
