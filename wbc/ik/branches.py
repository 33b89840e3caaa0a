"""All configurations that meet the goals, as far as descents from random configurations find them."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from wbc.errors import InfeasibleError, RangeError
from wbc.ik.engine import SearchEngine
from wbc.ik.search import FOUND, Query, SearchResult
from wbc.ik.solution import Ending, Solution
from wbc.multibody import pin
from wbc.tasks import Damping, Momentum
from wbc.validation import Array

#: Configurations are one branch where no joint is farther apart than this [rad, or characteristic lengths]
APART = 0.01

#: Configurations are compared where the goals are met within this [m, rad], if they can be: near a singular one the
#: tolerance leaves them farther apart
BRANCH_TOLERANCE = 1e-9

#: A direction is free where the rows' squares move it by less than this, against the direction that they move most
_FREE = 1e-6


@dataclass(frozen=True, eq=False)
class Branches:
    """Answer of :meth:`wbc.InverseKinematics.branches`.

    Attributes:
        solutions: one a branch, those nearest to q0 first (Euclidean, rad or characteristic lengths).
        hits: descents that ended in each branch [count].
        descents: configurations that a descent started from.
        seconds: what the search took [s].
        complete: every descent that was asked for came to its end, or as many branches as wanted were found; False:
            the time was over before.
    """

    solutions: tuple[Solution, ...]
    hits: Array
    descents: int
    seconds: float
    complete: bool

    @property
    def q(self) -> Array:
        """The configurations [count, nq]."""
        return np.array([solution.q for solution in self.solutions])

    @property
    def unseen(self) -> float:
        """Estimated probability that a further successful descent ends in a branch that is not listed:

            branches with one hit / hits of all

        (I. J. Good, The population frequencies of species, Biometrika 40, 1953).
        """
        return float((self.hits == 1.0).sum() / self.hits.sum())


class Gathering:
    """Branches of one call: what was found, and how to tell whether it is new."""

    def __init__(self, engine: SearchEngine, first: Array, tolerance: float) -> None:
        self._engine, self._first = engine, first
        self._query: Query = engine.query(engine.goals, tolerance, 0, 0)
        self._fine: Query = engine.query(engine.goals, min(tolerance, BRANCH_TOLERANCE), 0, 0)
        robot = engine.stack.robot
        coupled = {i for c in robot.couplings for i in (c.leader, c.follower)}
        turning = [u == "rad" and i not in coupled for i, u in enumerate(robot.dof_units)]
        #: degrees of freedom of which full turns leave all links where they are, and their coordinates
        self._turning = np.flatnonzero((robot.position_index >= 0) & np.array(turning))
        self._coordinates = robot.position_index[self._turning]
        self.found: list[tuple[Array, SearchResult]] = []
        self.hits: list[float] = []
        self.nearest: tuple[float, Array] = np.inf, first

    def descend(self, start: Array, end: float) -> bool:
        """One descent; False where the time ended it."""
        engine = self._engine
        found = engine.run(engine.within_limits(start), self._query, end - perf_counter())
        q = engine.within_limits(engine.tick.q)
        if perf_counter() >= end:
            return False
        if found.ending != FOUND:
            if found.cost < self.nearest[0]:
                self.nearest = found.cost, q
            return True
        fine = engine.run(q, self._fine, end - perf_counter())
        q = engine.within_limits(engine.tick.q) if fine.ending == FOUND else q
        for k, (other, _) in enumerate(self.found):
            if self._distance(q, other, turns=True) <= APART:
                self.hits[k] += 1.0
                return True
        self.found.append((self._unwound(q, end), found))
        self.hits.append(1.0)
        return True

    def solutions(self) -> tuple[tuple[Solution, ...], Array]:
        """The branches, nearest first, and their hits."""
        engine = self._engine

        def key(k: int) -> tuple[float, ...]:
            q = self.found[k][0]
            way = pin.difference(engine.stack.robot.model, self._first, q) / engine.dof_scales
            return round(float(np.linalg.norm(way)), 6), *np.round(q, 6)

        order = sorted(range(len(self.found)), key=key)
        out = []
        for k in order:
            q, found = self.found[k]
            step = engine.look(q, self._query.settling)
            out.append(Solution(q, Ending.SOLVED, engine.goals, found.ticks, 1, found.seconds, step))
        return tuple(out), np.array([self.hits[k] for k in order])

    def _unwound(self, q: Array, end: float) -> Array:
        """Full turns taken back towards the first configuration, where goals and constraints stay as they are."""
        engine, out = self._engine, q.copy()
        turns = np.round((self._first[self._coordinates] - q[self._coordinates]) / (2.0 * np.pi))
        for coordinate, count in zip(self._coordinates, turns, strict=True):
            # As many turns as the limits allow
            for n in range(int(abs(count)), 0, -1):
                turned = out.copy()
                turned[coordinate] += np.sign(count) * n * 2.0 * np.pi
                if (engine.within_limits(turned) == turned).all():
                    out = turned
                    break
        if (out == q).all():
            return q
        found = engine.run(out, self._fine, end - perf_counter())
        again = engine.within_limits(engine.tick.q)
        return again if found.ending == FOUND and self._distance(again, out, turns=False) <= APART else q

    def _distance(self, one: Array, other: Array, *, turns: bool) -> float:
        """Largest way of a joint between two configurations; full turns do not count where they are asked not to."""
        way = np.asarray(pin.difference(self._engine.stack.robot.model, one, other))
        if turns:
            way[self._turning] -= 2.0 * np.pi * np.round(way[self._turning] / (2.0 * np.pi))
        return float(np.abs(way / self._engine.dof_scales).max())


def branches(
    engine: SearchEngine, first: Array, *, most: int, seed: int, seconds: float, restarts: int, tolerance: float
) -> Branches:
    """Descents from a configuration and from random ones, until there are as many branches as wanted."""
    _refuse_free_directions(engine, first)
    gathering, descents, complete = Gathering(engine, first, tolerance), 0, True
    table, chosen = engine.random(restarts, seed), engine.starts.chosen != 0.0
    begin = perf_counter()
    for k in range(-1, restarts):
        start = first if k < 0 else np.where(chosen, table[k], first)
        complete = gathering.descend(start, begin + seconds)
        if not complete:
            break
        descents += 1
        if len(gathering.found) >= most:
            break
    if not gathering.found:
        q = gathering.nearest[1]
        step = engine.look(q, engine.query(engine.goals, tolerance, 0, 0).seeking)
        off = max(float(np.abs(step.residuals[name].values).max(initial=0.0)) for name in engine.goals)
        far = "; ".join(f"{name} off by {step.residuals[name]}" for name in engine.goals)
        binding = ", ".join(str(b) for b in step.binding) or "no row"
        reason = f"no configuration was found in {descents} descents; at the nearest {far}; binding: {binding}"
        raise InfeasibleError("targets", off, reason if complete else f"{reason}; the time is over")
    solutions, hits = gathering.solutions()
    return Branches(solutions, hits, descents, perf_counter() - begin, complete)


def _refuse_free_directions(engine: SearchEngine, first: Array) -> None:
    """Answers are points only where the rows of all tasks, holds and couplings leave no direction free."""
    weight = (engine.tick.weight > 0.0) * engine.core.row_costs
    for block in engine.core.layout.of_form("task"):
        if isinstance(block.entry.item, (Damping, Momentum)):
            weight[block.span] = 0.0
    qp = engine.qp(np.where(engine.starts.chosen != 0.0, engine.random(1, 0)[0], first), weight)
    nv, scales = len(engine.dof_scales), engine.dof_scales
    held = qp.A[qp.lower[nv:] == qp.upper[nv:]] * scales
    size = np.linalg.norm(held, axis=1, keepdims=True)
    held = held / np.where(size > 0.0, size, 1.0)
    H = qp.H * np.outer(scales, scales) + held.T @ held + np.diag((qp.lower[:nv] == qp.upper[:nv]) * 1.0)
    share = np.linalg.eigvalsh(H)
    free = int((share < _FREE * share[-1]).sum())
    if free:
        reason = (
            f"tasks and holds leave {free} of {nv} directions free, in which there is no end of configurations; "
            "add tasks that decide, as a Posture of small weight"
        )
        raise RangeError("goals", engine.goals, reason)
