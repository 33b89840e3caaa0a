"""Which bounds of a QP contradict each other, and how little has to give for all to hold.

A *bound* is one inequality: C_i x >= lower_i or C_i x <= upper_i, C = [1; A]. A conflict is a set of bounds that cannot
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

#: Bounds that are missed by no more than this count as met [rad/s, characteristic lengths per second]
MET = 2e-9
#: Weight of |x|^2 against |slack|^2
PROXIMAL = 1e-6
#: Steps at most
STEPS = 30
#: Change of the slack at which the steps end
SETTLED = 1e-12
#: Multipliers below this share of the largest one are rounding
_PUSHING = 1e-6
_Mask = NDArray[np.bool_]


class RowBound(NamedTuple):
    """One bound of a row of [1; A]."""

    row: int
    upper: bool


@dataclass(frozen=True, eq=False, slots=True)
class Conflict:
    """Bounds that cannot all hold; without any one of them the others can.

    Attributes:
        bounds: in the order of the rows.
        alone: by how much each bound has to give if it alone gives and everything else of the problem holds; inf
            where that is not enough, because there are other conflicts too.
        within: the same if only the bounds of this conflict have to hold.
    """

    bounds: tuple[RowBound, ...]
    alone: Array
    within: Array


@dataclass(frozen=True, eq=False, slots=True)
class Infeasibility:
    """Why a QP has no solution.

    Attributes:
        slack: violation of each row at the least sum of squares over the general rows, simple bounds holding [n + m].
        conflicts: one after the other; the general rows of one are left out in the search for the next. Where all
            general rows are left out nothing contradicts any more. Empty: all bounds can hold.
    """

    slack: Array
    conflicts: tuple[Conflict, ...]


def diagnose(qp: QP, limit: int = 4) -> Infeasibility:
    """The conflicts among the bounds of ``qp``, ``limit`` at most, and the least slack that ends all of them.

    Simple bounds must leave an interval each. Rows are compared as they are: give them in units in which violations
    compare. H and g are not read.
    """
    search = _ConflictSearch(qp)
    chosen = np.isfinite(qp.lower), np.isfinite(qp.upper)
    whole = search.least_slack(chosen, np.arange(search.n, search.size))
    if whole is None:
        return Infeasibility(np.zeros(search.size), ())
    found: list[Conflict] = []
    low, high = chosen[0].copy(), chosen[1].copy()
    slack, multipliers = whole
    while np.abs(slack).max(initial=0.0) > MET and len(found) < limit:
        members = search.irreducible((low, high), multipliers)
        if not members:
            break
        alone = np.array([search.alone(chosen, member.row) for member in members])
        within = np.array([search.alone(search.only(members), member.row) for member in members])
        found.append(Conflict(members, alone, within))
        rows = [member.row for member in members if member.row >= search.n]
        low[rows] = high[rows] = False
        rest = search.least_slack((low, high), np.arange(search.n, search.size))
        if not rows or rest is None:
            break
        slack, multipliers = rest
    return Infeasibility(np.abs(whole[0]), tuple(found))


class _ConflictSearch:
    """Feasibility of parts of one problem."""

    def __init__(self, qp: QP) -> None:
        self.n, self.size = qp.n, qp.n + qp.m
        self.qp = qp
        self.C = np.vstack((np.eye(qp.n), qp.A))
        norms = np.linalg.norm(self.C, axis=1)
        self.dead = norms == 0.0
        self.norms = np.where(self.dead, 1.0, norms)
        self.plain = Daqp(qp.n, qp.m)

    def bounds(self, chosen: tuple[_Mask, _Mask], tolerance: float = 0.0) -> tuple[Array, Array]:
        """Lower and upper bounds of the chosen ones."""
        return (
            np.where(chosen[0], self.qp.lower - tolerance, -np.inf),
            np.where(chosen[1], self.qp.upper + tolerance, np.inf),
        )

    def only(self, members: Iterable[RowBound]) -> tuple[_Mask, _Mask]:
        """A mask of these bounds."""
        on = np.zeros(self.size, dtype=np.bool_), np.zeros(self.size, dtype=np.bool_)
        for member in members:
            on[int(member.upper)][member.row] = True
        return on

    def contradictory(self, members: list[RowBound]) -> bool:
        """No x meets all of these bounds."""
        lower, upper = self.bounds(self.only(members), MET)
        if (self.dead & ((lower > 0.0) | (upper < 0.0))).any():
            return True
        scale = np.concatenate((np.ones(self.n), self.norms[self.n :]))
        qp = QP(np.eye(self.n), np.zeros(self.n), lower / scale, upper / scale, self.qp.A / scale[self.n :, None])
        return self.plain.solve(qp, warm=False).flag == "infeasible"

    def least_slack(self, chosen: tuple[_Mask, _Mask], soft: NDArray[np.intp]) -> tuple[Array, Array] | None:
        """(s, multipliers) [n + m each] of the least |s| with lower <= C x + s <= upper, s = 0 but for ``soft`` rows;
        None: there is none.
        """
        n, count = self.n, soft.size
        lower, upper = self.bounds(chosen)
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

    def irreducible(self, chosen: tuple[_Mask, _Mask], multipliers: Array) -> tuple[RowBound, ...]:
        """An irreducible conflict; bounds of small multipliers are tried first for deletion."""
        force = np.abs(multipliers) * self.norms
        pushing = force > _PUSHING * force.max(initial=0.0)
        members = [RowBound(int(i), bool(multipliers[i] > 0.0)) for i in np.flatnonzero(pushing)]
        if not self.contradictory(members):
            members = [RowBound(int(i), bool(u)) for u in (0, 1) for i in np.flatnonzero(chosen[u])]
            if not self.contradictory(members):
                return ()
        for member in sorted(members, key=lambda member: force[member.row]):
            without = [other for other in members if other != member]
            if self.contradictory(without):
                members = without
        return tuple(sorted(members))

    def alone(self, chosen: tuple[_Mask, _Mask], row: int) -> float:
        """By how much one row must give if nothing else does, inf where that is not enough."""
        found = self.least_slack(chosen, np.array([row]))
        return np.inf if found is None else float(abs(found[0][row]))
