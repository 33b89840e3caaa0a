"""What the tasks of a past tick lost, to whom, and what one unit of each active bound costs them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc.explain.explanation import ExplainedBound, Loss, Price, Share
from wbc.explain.past import Frozen, PastTick
from wbc.qp.problem import QPSolution
from wbc.qp.relax import Relaxed
from wbc.qp.sensitivity import Sensitivity
from wbc.stack.layout import Block, rate_unit
from wbc.tasks._direction import Direction
from wbc.validation import Array

#: Losses and regained parts below this share of what was requested are not named
_SHARE = 1e-3
#: Losses and regained parts below this rate are not named [rad/s, m/s]
_LEAST = 1e-6


class RowGroup:
    """Rows of one task that share a unit: J v - w is what they miss."""

    def __init__(self, block: Block, unit: str, J: Array, desired: Array) -> None:
        self.block, self.J, self.desired, self.unit = block, J, desired, unit

    def lost(self, v: Array) -> float:
        """Norm of what is missing at v."""
        return float(np.linalg.norm(self.J @ v - self.desired))

    def slope(self, v: Array) -> Array:
        """Derivative of :meth:`lost` along v."""
        missing = self.J @ v - self.desired
        return np.asarray(missing @ self.J / np.linalg.norm(missing))


class SoftGroup(RowGroup):
    """Rows of one soft constraint that share a unit: what they miss is how far A v is outside their bounds."""

    def __init__(self, block: Block, unit: str, A: Array, lower: Array, upper: Array) -> None:
        super().__init__(block, unit, A, np.zeros(len(A)))
        self._lower, self._upper = lower, upper

    def _missing(self, v: Array) -> Array:
        at = self.J @ v
        return np.asarray(np.maximum(at - self._upper, 0.0) - np.maximum(self._lower - at, 0.0))

    def lost(self, v: Array) -> float:
        return float(np.linalg.norm(self._missing(v)))

    def slope(self, v: Array) -> Array:
        missing = self._missing(v)
        return np.asarray(missing @ self.J / np.linalg.norm(missing))


def groups(past: PastTick) -> list[RowGroup]:
    """Rows that count of every task and of every soft constraint that is on, by unit."""
    out: list[RowGroup] = []
    for block in past.layout.of_form("task"):
        if not past.is_on(block):
            continue
        J, desired = past.task_rows(block)
        counts = past.tick.weight[block.span] > 0.0
        for unit in dict.fromkeys(row.unit for row in block.rows):
            mine = np.array([row.unit == unit for row in block.rows]) & counts
            if mine.any():
                out.append(RowGroup(block, rate_unit(unit, past.layout.command), J[mine], desired[mine]))
    return [*out, *_soft_groups(past)]


def _soft_groups(past: PastTick) -> list[RowGroup]:
    """The same of soft constraints; what keeps the direction of a task asks for nothing of its own."""
    out: list[RowGroup] = []
    nv = past.layout.variables
    for block in past.layout.of_form("margins", "rows"):
        if block.entry.price is None or isinstance(block.entry.item, Direction) or not past.is_on(block):
            continue
        A = past.qp.A[block.span]
        lower, upper = past.qp.lower[nv:][block.span], past.qp.upper[nv:][block.span]
        for unit in dict.fromkeys(row.unit for row in block.rows):
            mine = np.array([row.unit == unit for row in block.rows])
            out.append(SoftGroup(block, rate_unit(unit, past.layout.command), A[mine], lower[mine], upper[mine]))
    return out


def losses(past: PastTick, found: list[RowGroup], v: Array, culprits: list[Block]) -> tuple[Loss, ...]:
    """Every task that misses something, and what it would regain without each of the culprits."""
    short = [g for g in found if g.lost(v) > max(_LEAST, _SHARE * float(np.linalg.norm(g.desired)))]
    if not short:
        return ()
    without: dict[str, Array] = {}
    for block in culprits:
        with past.without([block]):
            without[block.entry.name] = past.solve()[0]
    alone: dict[str, Array] = {}
    for block in {g.block.entry.name: g.block for g in short}.values():
        with past.without(past.others(block)):
            alone[block.entry.name] = past.solve()[0]
    out = []
    for group in short:
        name, lost, requested = group.block.entry.name, group.lost(v), float(np.linalg.norm(group.desired))
        regained = [Share(item, lost - group.lost(other)) for item, other in without.items() if item != name]
        named = [share for share in regained if share.amount > max(_LEAST, _SHARE * requested)]
        named.sort(key=lambda share: -share.amount)
        out.append(Loss(name, group.unit, requested, lost, group.lost(alone[name]), tuple(named)))
    return tuple(out)


def prices(
    past: PastTick, found: list[RowGroup], answer: Relaxed, bounds: dict[int, ExplainedBound]
) -> tuple[Price, ...]:
    """Of every active bound and every task that misses something, from the active set of an optimum: of one QP, or of
    all levels; none where a level has none.
    """
    frozen = past.frozen()
    if past.layout.cascade and frozen is None:
        return ()
    v, slope = _of_one(past, answer) if frozen is None else _of_levels(past, frozen)
    out = []
    for row, bound in bounds.items():
        moved = slope(row)
        if not moved.any():
            continue
        moved = moved * (-1.0 if bound.which == "lower" else 1.0)
        for group in found:
            if group.lost(v) <= max(_LEAST, _SHARE * float(np.linalg.norm(group.desired))):
                continue
            if group.block.entry.name == bound.item:
                continue
            fall = -float(group.slope(v) @ moved)
            if bound.which == "equal":
                fall = abs(fall)
            if abs(fall) > _SHARE:
                out.append(Price(bound, group.block.entry.name, fall, group.unit))
    return tuple(out)


def _of_one(past: PastTick, answer: Relaxed) -> tuple[Array, Callable[[int], Array]]:
    """(command, row -> dv / db of the bound that holds it, zero where it holds nothing)."""
    wide, n = past.qp.with_slacks(), past.qp.n
    one = Sensitivity(wide, QPSolution(answer.x, answer.multipliers, "solved"))

    def slope(row: int) -> Array:
        return one.to_bound(row if row < n else row + wide.n - n)[:n]

    return answer.x[:n], slope


def _of_levels(past: PastTick, frozen: Frozen) -> tuple[Array, Callable[[int], Array]]:
    """The same with strict levels."""
    first = Sensitivity(frozen.qp, QPSolution(frozen.first.x, frozen.first.multipliers, "solved"))
    dofs, numbers = past.layout.dof_scales(past.stack), frozen.numbers(past.tick.qp(), frozen.first.x)

    def slope(row: int) -> Array:
        size = frozen.sizes[row]
        start = first.to_bound(row) / dofs * size
        return np.asarray(frozen.optimum.to_bound(numbers, row, start) * dofs / size)

    return frozen.answer.x * dofs, slope
