"""Inverse kinematics: the tasks and constraints of a stack, converged to a configuration."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller.batch import search_many
from wbc.controller.controller import Controller
from wbc.controller.descent import Search
from wbc.controller.handle import Handle
from wbc.controller.native import NativeTick
from wbc.controller.search import EXHAUSTED, FOUND, Found, NativeSearch, Query
from wbc.controller.sensing import Sensing
from wbc.controller.solution import Batch, Ending, Solution
from wbc.controller.solved import SolvedTick
from wbc.controller.starts import Starts
from wbc.controller.tick import Assembly
from wbc.controller.timeless import FIRST, TICK, chosen_goals, goal_rows, hasten, searching, timeless
from wbc.errors import RangeError, ShapeError
from wbc.stack.declaration import Declaration
from wbc.stack.places import stops
from wbc.validation import Array

#: How far constraints may be off at an answer [m, rad, or the margin's unit]
ROOM = 1e-9

#: Share of the time that is kept for the question which goals contradict each other
ASKING = 0.2

#: What counts as a joint that the goals move: its share of the Hessian
_MOVED = 1e-6


class Solver:
    """Inverse kinematics of a stack, compiled once. Made by :meth:`wbc.Stack.solver`.

        solver = stack.solver()
        solver["hand"].target = pose
        solution = solver.solve(q0)

    A search makes Newton steps on the rows of the controller, with gains of one step, no limits of speed, and a damping
    that falls with the error, from q0 and then from random configurations, until the goals are met and the constraints
    hold. Then the wishes (all other tasks) are followed as far as they cost the goals nothing. docs/ik.md

    Attributes:
        stack: the same items without time.
        goals: names of the tasks to be met.
        backend: ``native`` (the loop in C) or ``vm``.

    What it cannot do: prove that a target is out of reach; that there is no answer is what the descents say for which
    there was time. Of several answers it returns the first one. Limits of speed and acceleration do not count.
    """

    def __init__(self, stack: Declaration, goals: Iterable[str] | None = None, backend: str = "auto") -> None:
        self.goals = chosen_goals(stack, goals)
        self.stack = timeless(stack)
        self._controller: Controller = searching(self.stack, backend)
        hasten(self._controller)
        self.backend = self._controller.backend
        layout, tick = self._controller.layout, self._controller.tick
        self._rows = goal_rows(self._controller, self.goals)
        self._stops = stops(self.stack, layout)
        at, lower, upper = np.array(self._stops[0]), *self._stops[1:]
        dofs = np.flatnonzero(at >= 0)
        #: coordinates with position limits: where they are in q and in ``bound_enabled``, and the limits
        self._limited = self.stack.robot.position_index[dofs], at[dofs], lower[dofs], upper[dofs]
        self._tick: Assembly = tick.assembly if isinstance(tick, SolvedTick) else tick
        sensing = Sensing(self._controller, self._tick)
        self._search: NativeSearch | Search
        if isinstance(tick, NativeTick) and not sensing:
            self._search = NativeSearch(tick)
        else:
            self._search = Search(self._tick, self.stack, layout, sensing.sense)
        self._starts: Starts | None = None
        self._table: tuple[int, Array] = (0, np.zeros((0, layout.nq)))

    def __getitem__(self, name: str) -> Handle:
        """Run-time values of an item, as ``controller[name]``; targets that nobody sets are taken from q0."""
        return self._controller[name]

    def __contains__(self, name: object) -> bool:
        return name in self._controller

    def solve(
        self,
        q0: Any,
        *,
        seed: int = 0,
        budget: float | None = 0.005,
        restarts: int = 100,
        tolerance: float = 1e-5,
    ) -> Solution:
        """The configuration at which the goals are met, or the nearest one that was found, and why.

        Args:
            q0: where the search begins [nq]; what lies outside the position limits is moved to them.
            seed: of the random configurations. The answer is a function of q0, the run-time values, the seed and the
                number of restarts, unless the time ends the search.
            budget: time for the search [s], overrun by one iteration and the report of the answer at most; None: no
                limit.
            restarts: random configurations to start from after q0 at most.
            tolerance: of every row of a goal, in metres and radians.

        Raises:
            ShapeError, NotFiniteError, RotationError, RangeError: bad input.
        """
        first, seconds, near, count = self._prepared(q0, seed, budget, restarts, tolerance)
        found = self._run(first, self._rows, seconds * (1.0 - ASKING if len(self.goals) > 1 else 1.0), near, count)
        answer, spent, ticks = self._tick.q.copy(), found.seconds, found.ticks
        status = _ending(found)
        if status == Ending.UNREACHABLE and len(self.goals) > 1:
            share = (seconds - spent) / len(self.goals)
            alone = [self._run(first, self._only(name), share, near, count) for name in self.goals]
            spent, ticks = spent + sum(a.seconds for a in alone), ticks + sum(a.ticks for a in alone)
            if all(a.ending == FOUND for a in alone):
                status = Ending.CONTRADICTORY
        # Rounding of the last tick may pass a limit by its last digit
        answer = self._within_limits(answer)
        step = self._controller.step(answer, np.zeros(self.stack.robot.nv), dt=TICK)
        return Solution(answer, status, self.goals, ticks, found.descents + (found.ending > EXHAUSTED), spent, step)

    def solve_batch(
        self,
        q0: Any,
        targets: Mapping[str, Sequence[Any]],
        *,
        seed: int = 0,
        budget: float | None = 0.005,
        restarts: int = 100,
        tolerance: float = 1e-5,
        workers: int | None = None,
    ) -> Batch:
        """:meth:`solve` for many targets, in threads that run at the same time.

        Args:
            q0: where every search begins [nq].
            targets: name of a task -> its ``target`` in each search; all of one length.
            budget: time for each search [s].
            workers: threads; default: as many as cores. Without a compiler, or where rows are measured, there is one.

        Raises:
            WbcError: as for :meth:`solve`; ShapeError: no targets, or of different lengths.
        """
        lengths = {name: len(values) for name, values in targets.items()}
        if len(set(lengths.values())) != 1:
            raise ShapeError("targets", lengths, "expected targets of one length")
        threads = _count("workers", os.cpu_count() or 1 if workers is None else workers)
        if threads < 1:
            raise RangeError("workers", workers, "expected at least one thread")
        total = next(iter(lengths.values()))
        first, seconds, near, count = self._prepared(q0, seed, budget, restarts, tolerance)
        parameters = np.tile(self._tick.p, (total, 1))
        for name, values in targets.items():
            handle, span = self._controller[name], self._controller.layout.blocks[name].slots["target"].span
            for k, value in enumerate(values):
                parameters[k, span] = handle.checked("target", value)
        query, before = self._query(self._rows, seconds, near, count), self._tick.p.copy()
        starts = np.tile(first, (total, 1))
        if isinstance(self._search, NativeSearch):
            clones = [self._controller.clone().tick for _ in range(min(threads, max(1, total)))]
            ticks = [tick for tick in clones if isinstance(tick, NativeTick)]
            for tick in ticks:
                tick.dt[0] = TICK
            answers, found = search_many(ticks, query, starts, parameters)
        else:
            answers, found = starts, []
            for k in range(total):
                self._tick.p[:] = parameters[k]
                found.append(self._from(first, query))
                answers[k] = self._tick.q
            self._tick.p[:] = before
        descents = np.array([float(f.descents + (f.ending > EXHAUSTED)) for f in found])
        return Batch(
            self._within_limits(answers),
            tuple(_ending(f) for f in found),
            descents,
            np.array([f.seconds for f in found]),
        )

    def _prepared(
        self, q0: Any, seed: Any, budget: Any, restarts: Any, tolerance: Any
    ) -> tuple[Array, float, float, int]:
        """Checked input: first configuration, time, tolerance, restarts; targets that wait are taken from q0."""
        q = self.stack.robot.configuration("q0", q0)
        seconds = math.inf if budget is None else validation.scalar("budget", budget, low=0.0, open_low=True, unit="s")
        near = validation.scalar("tolerance", tolerance, low=0.0, open_low=True)
        count, number = _count("restarts", restarts), _count("seed", seed)
        self._controller.reset(q)
        first = self._within_limits(q)
        if self._starts is None:
            self._starts = self._find_starts(first)
        if self._table[0] != number or len(self._table[1]) < count:
            self._table = (number, self._starts.table(count, number))
        return first, seconds, near, count

    def _run(self, first: Array, goals: Array, seconds: float, tolerance: float, count: int) -> Found:
        """Search from a configuration for the rows of some goals."""
        return self._from(first, self._query(goals, seconds, tolerance, count))

    def _from(self, first: Array, query: Query) -> Found:
        """Search from a configuration."""
        self._tick.dt[0], self._tick.q[:], self._tick.v_last[:] = TICK, first, 0.0
        return self._search.run(query)

    def _query(self, goals: Array, seconds: float, tolerance: float, count: int) -> Query:
        """A search for the rows of some goals."""
        assert self._starts is not None
        tick = self._tick
        aims, wishes = tick.weight * goals, tick.weight * (1.0 - self._rows)
        heaviest = float((wishes * self._controller.row_costs**-1).max(initial=0.0))
        return Query(
            starts=self._table[1][:count],
            chosen=self._starts.chosen,
            tolerance=np.where(goals > 0.0, tolerance, -1.0),
            seeking=aims,
            settling=aims * max(1.0, FIRST * heaviest) + wishes,
            seconds=seconds,
            room=ROOM,
            wishes=heaviest > 0.0,
        )

    def _only(self, name: str) -> Array:
        return goal_rows(self._controller, (name,))

    def _find_starts(self, q: Array) -> Starts:
        """Joints that move a goal, as the Hessian of the goals at a configuration off all symmetries shows."""
        tick, robot = self._tick, self.stack.robot
        weight = tick.weight.copy()
        _, lower, upper = self._stops
        everywhere = Starts(robot, lower, upper, np.ones(robot.nv, dtype=bool))
        random = everywhere.table(1, 0)[0]
        tick.weight[:] = weight * self._rows
        tick.q[:] = np.where(everywhere.chosen != 0.0, random, q)
        tick.dt[0] = TICK
        tick.plain[0] = 1.0
        share = np.diag(tick.qp().H) * self._controller.layout.dof_scales(self.stack) ** 2
        tick.plain[0] = 0.0
        tick.weight[:] = weight
        return Starts(robot, lower, upper, share > _MOVED * share.max(initial=0.0))

    def _within_limits(self, q: Array) -> Array:
        """The nearest configuration (or each of several) within the position limits that are on."""
        coordinates, places, lower, upper = self._limited
        out, here, on = q.copy(), q[..., coordinates], self._tick.bound_enabled[places] != 0.0
        out[..., coordinates] = np.where(on, np.minimum(np.maximum(here, lower), upper), here)
        return out


def _ending(found: Found) -> Ending:
    if found.ending == FOUND:
        return Ending.SOLVED
    if found.descents == 0:
        return Ending.OUT_OF_TIME
    return Ending.UNREACHABLE if found.cost < np.inf else Ending.CONTRADICTORY


def _count(field: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise ShapeError(field, value, "expected an integer")
    if value < 0:
        raise RangeError(field, value, "expected an integer of 0 or more")
    return int(value)
