"""Which sides of a QP contradict each other, and how little has to give for all to hold.

A *side* is one inequality: C_i x >= lower_i or C_i x <= upper_i, C = [1; A]. A conflict is a set of sides that cannot
all hold while every smaller part of it can: an irreducible infeasible subset. It is found by the deletion filter
(Chinneck, Dravnieks: Locating minimal infeasible constraint sets in linear programs, ORSA J. Computing 3, 1991) on
the support of a Farkas certificate, which is what the multipliers of the least violation are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc.qp.problem import QP
from wbc.qp.solvers.daqp import Daqp
from wbc.validation import Array

#: Sides that are missed by no more than this count as met; the weight of |x|^2 against |slack|^2; steps at most, and
#: the change of the slack at which they end
ROOM, PROXIMAL, STEPS, SETTLED = 2e-9, 1e-6, 30, 1e-12
#: Multipliers below this share of the largest one are rounding
_PUSHING = 1e-6
_Mask = NDArray[np.bool_]


class Side(NamedTuple):
    """One side of a row of [1; A]."""

    row: int
    upper: bool


@dataclass(frozen=True, eq=False, slots=True)
class Conflict:
    """Sides that cannot all hold; without any one of them the others can.

    Attributes:
        sides: in the order of the rows.
        alone: by how much each side has to give if it alone gives and everything else of the problem holds; inf
            where that is not enough, because there are other conflicts too.
        within: the same if only the sides of this conflict have to hold.
    """

    sides: tuple[Side, ...]
    alone: Array
    within: Array


@dataclass(frozen=True, eq=False, slots=True)
class Infeasibility:
    """Why a QP has no solution.

    Attributes:
        slack: violation of each row at the least sum of squares over the general rows, simple bounds holding [n + m].
        conflicts: one after the other; the general rows of one are left out in the search for the next. Where all
            general rows are left out nothing contradicts any more. Empty: all sides can hold.
    """

    slack: Array
    conflicts: tuple[Conflict, ...]


def diagnose(qp: QP, limit: int = 4) -> Infeasibility:
    """The conflicts among the sides of ``qp``, ``limit`` at most, and the least slack that ends all of them.

    Simple bounds must leave an interval each. Rows are compared as they are: give them in units in which violations
    compare. H and g are not read.
    """
    search = _Search(qp)
    sides = np.isfinite(qp.lower), np.isfinite(qp.upper)
    whole = search.least_slack(sides, np.arange(search.n, search.size))
    if whole is None:
        return Infeasibility(np.zeros(search.size), ())
    found: list[Conflict] = []
    low, high = sides[0].copy(), sides[1].copy()
    slack, multipliers = whole
    while np.abs(slack).max(initial=0.0) > ROOM and len(found) < limit:
        members = search.irreducible((low, high), multipliers)
        if not members:
            break
        alone = np.array([search.alone(sides, side.row) for side in members])
        within = np.array([search.alone(search.only(members), side.row) for side in members])
        found.append(Conflict(members, alone, within))
        rows = [side.row for side in members if side.row >= search.n]
        low[rows] = high[rows] = False
        rest = search.least_slack((low, high), np.arange(search.n, search.size))
        if not rows or rest is None:
            break
        slack, multipliers = rest
    return Infeasibility(np.abs(whole[0]), tuple(found))


class _Search:
    """Feasibility of parts of one problem."""

    def __init__(self, qp: QP) -> None:
        self.n, self.size = qp.n, qp.n + qp.m
        self.qp = qp
        self.C = np.vstack((np.eye(qp.n), qp.A))
        norms = np.linalg.norm(self.C, axis=1)
        self.dead = norms == 0.0
        self.norms = np.where(self.dead, 1.0, norms)
        self.plain = Daqp(qp.n, qp.m)

    def bounds(self, sides: tuple[_Mask, _Mask], room: float = 0.0) -> tuple[Array, Array]:
        """Lower and upper bounds of the sides that are on."""
        return (
            np.where(sides[0], self.qp.lower - room, -np.inf),
            np.where(sides[1], self.qp.upper + room, np.inf),
        )

    def only(self, members: Iterable[Side]) -> tuple[_Mask, _Mask]:
        """These sides on and no other."""
        on = np.zeros(self.size, dtype=np.bool_), np.zeros(self.size, dtype=np.bool_)
        for side in members:
            on[int(side.upper)][side.row] = True
        return on

    def contradictory(self, members: list[Side]) -> bool:
        """No x meets all of these sides."""
        lower, upper = self.bounds(self.only(members), ROOM)
        if (self.dead & ((lower > 0.0) | (upper < 0.0))).any():
            return True
        scale = np.concatenate((np.ones(self.n), self.norms[self.n :]))
        qp = QP(np.eye(self.n), np.zeros(self.n), lower / scale, upper / scale, self.qp.A / scale[self.n :, None])
        return self.plain.solve(qp, warm=False).flag == "infeasible"

    def least_slack(self, sides: tuple[_Mask, _Mask], soft: NDArray[np.intp]) -> tuple[Array, Array] | None:
        """(s, multipliers) [n + m each] of the least |s| with lower <= C x + s <= upper, s = 0 but for ``soft`` rows;
        None: there is none.
        """
        n, count = self.n, soft.size
        lower, upper = self.bounds(sides)
        rows = np.hstack((self.C, np.zeros((self.size, count))))
        rows[soft, n + np.arange(count)] = 1.0
        free = np.full(n + count, np.inf)
        H = np.diag(np.concatenate((np.full(n, PROXIMAL), np.ones(count))))
        scale = np.maximum(1.0, self.norms)
        qp = QP(
            H,
            np.zeros(n + count),
            np.concatenate((-free, lower / scale)),
            np.concatenate((free, upper / scale)),
            rows / scale[:, None],
        )
        solver, best = Daqp(n + count, self.size), None
        for _ in range(STEPS):
            stage = solver.solve(qp, warm=best is not None)
            if not stage.solved:
                break
            change = np.inf if best is None else float(np.abs(stage.x[n:] - best.x[n:]).max(initial=0.0))
            best = stage
            qp.g[:n] = -PROXIMAL * stage.x[:n]
            if change <= SETTLED:
                break
        if best is None:
            return None
        slack = np.zeros(self.size)
        slack[soft] = best.x[n:]
        return slack, best.multipliers[n + count :] / scale

    def irreducible(self, sides: tuple[_Mask, _Mask], multipliers: Array) -> tuple[Side, ...]:
        """An irreducible conflict; sides of small multipliers are tried first for deletion."""
        force = np.abs(multipliers) * self.norms
        pushing = force > _PUSHING * force.max(initial=0.0)
        members = [Side(int(i), bool(multipliers[i] > 0.0)) for i in np.flatnonzero(pushing)]
        if not self.contradictory(members):
            members = [Side(int(i), bool(u)) for u in (0, 1) for i in np.flatnonzero(sides[u])]
            if not self.contradictory(members):
                return ()
        for side in sorted(members, key=lambda side: force[side.row]):
            without = [other for other in members if other != side]
            if self.contradictory(without):
                members = without
        return tuple(sorted(members))

    def alone(self, sides: tuple[_Mask, _Mask], row: int) -> float:
        """By how much one row must give if nothing else does, inf where that is not enough."""
        found = self.least_slack(sides, np.array([row]))
        return np.inf if found is None else float(abs(found[0][row]))
