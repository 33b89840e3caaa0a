"""What every form of inverse kinematics shares: a stack without time, compiled, and its search."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.random import default_rng

from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.controller.core import Core
from wbc.controller.handle import Handle
from wbc.controller.step import Step
from wbc.ik.descent import DescentSearch
from wbc.ik.search import FOUND, NativeSearch, Query, SearchResult
from wbc.ik.solution import Ending
from wbc.ik.timeless import FIRST, TICK, chosen_goals, goal_rows, hasten, searching, timeless
from wbc.multibody import pin
from wbc.qp.problem import QP
from wbc.robot import Robot
from wbc.stack.declaration import Declaration
from wbc.stack.tables import stops
from wbc.tasks.base import Constraint, Sensor
from wbc.tick.native import CompiledTick, NativeTick
from wbc.tick.solved import SolvedTick
from wbc.validation import Array

#: How far constraints may be off at an answer [m, rad, or the margin's unit]
ROOM = 1e-9

#: What counts as a joint that the goals move: its share of the Hessian
_MOVED = 1e-6

#: Searches that are prepared for other goals or another tolerance at most
_KEPT = 16


class Starts:
    """Random configurations within limits, deterministic for a seed.

    Joints that are ``moved`` get a uniform value between their limits, those without limits any angle; bases, ball
    joints and joints that are not moved stay where a search began, which ``chosen`` says for each coordinate of q.
    Followers of mimic joints follow.
    """

    def __init__(self, robot: Robot, lower: Array, upper: Array, moved: np.ndarray) -> None:
        self._robot = robot
        model, index = robot.model, robot.position_index
        #: (first coordinate, how many, lower, upper) of every joint that is chosen
        self._joints: list[tuple[int, int, float, float]] = []
        for j in range(1, model.njoints):
            q, width, dof = int(model.idx_qs[j]), int(model.nqs[j]), int(model.idx_vs[j])
            if int(model.nvs[j]) != 1 or not moved[dof]:
                continue
            low, high = float(lower[dof]), float(upper[dof])
            middle = float(robot.neutral[q]) if index[dof] >= 0 else 0.0
            low = low if np.isfinite(low) else min(middle, high) - np.pi
            high = high if np.isfinite(high) else max(middle, low) + np.pi
            self._joints.append((q, width, low, high))
        leaders = {c.follower: c for c in robot.couplings}
        self._couplings = [c for c in leaders.values() if moved[c.leader] and index[c.leader] >= 0]
        self.chosen = np.zeros(robot.nq)
        for q, width, _, _ in self._joints:
            self.chosen[q : q + width] = 1.0
        for c in self._couplings:
            self.chosen[index[c.follower]] = 1.0

    def table(self, count: int, seed: int) -> Array:
        """count x nq numbers; the first ones do not depend on the count."""
        random = default_rng(seed)
        out = np.tile(np.asarray(pin.neutral(self._robot.model)), (count, 1))
        share = random.random((count, len(self._joints)))
        for k, (q, width, low, high) in enumerate(self._joints):
            value = low + share[:, k] * (high - low)
            out[:, q] = np.cos(value) if width == 2 else value
            if width == 2:
                out[:, q + 1] = np.sin(value)
        index = self._robot.position_index
        for c in self._couplings:
            out[:, index[c.follower]] = c.ratio * out[:, index[c.leader]] + c.offset
        return out


class ItemSensing:
    """What items want measured before a tick that no controller steps: their sensors, writing into its
    parameters; false where there are none.
    """

    def __init__(self, core: Core, tick: CompiledTick) -> None:
        robot, self._tick = core.stack.robot, tick
        self._sensors: list[tuple[Sensor, Handle]] = []
        for entry in core.stack.entries:
            item = entry.item
            if isinstance(item, Constraint) and item.sensed_rows(robot) > 0:
                slots = core.layout.blocks[entry.name].slots
                places = {name: tick.p[slot.span] for name, slot in slots.items()}
                self._sensors.append((item.sensor(robot, places), core.handles[entry.name]))

    def __bool__(self) -> bool:
        return bool(self._sensors)

    def sense(self) -> None:
        """Measure at the tick's q what enabled items sense."""
        for sensor, handle in self._sensors:
            if handle.enabled:
                sensor.sense(self._tick.q)


class SearchEngine:
    """A timeless stack with the memory of its tick; see :class:`wbc.InverseKinematics`.

    Attributes:
        goals: names of the tasks to be met. rows: 1 for their task rows, 0 for those of secondary tasks.
        stack: the items without time. controller: theirs. core: what that is inside, whose tick is :attr:`tick`.
    """

    def __init__(self, stack: Declaration, goals: Iterable[str] | None, backend: str) -> None:
        self.goals = chosen_goals(stack, goals)
        self.stack = timeless(stack)
        self.controller: CompiledStack = searching(self.stack, backend)
        hasten(self.controller)
        self.core = core_of(self.controller)
        layout, tick = self.core.layout, self.core.tick
        self.rows = goal_rows(self.controller, self.goals)
        self.dof_scales = layout.dof_scales(self.stack)
        #: unit of each task row in one metre or radian, in which tolerances are given
        self._units = np.array([row.scale(1.0) for block in layout.of_form("task") for row in block.rows])
        self.tick: CompiledTick = tick.assembly if isinstance(tick, SolvedTick) else tick
        self._stops = stops(self.stack, layout)
        at = np.array(self._stops.bounds)
        dofs = np.flatnonzero(at >= 0)
        #: coordinates with position limits: where they are in q and in ``bound_enabled``, and the limits
        self._limited = (
            self.stack.robot.position_index[dofs],
            at[dofs],
            self._stops.lower[dofs],
            self._stops.upper[dofs],
        )
        self._switches: bytes | None = None
        self._limits = np.zeros(0), np.zeros(0)
        self._sensing = ItemSensing(self.core, self.tick)
        self.search: NativeSearch | DescentSearch
        if isinstance(tick, NativeTick) and not self._sensing:
            self.search = NativeSearch(tick)
        else:
            self.search = DescentSearch(self.tick, self.stack, layout, self._sensing.sense)
        self._table: tuple[int, Array] = (0, np.zeros((0, layout.nq)))
        self._queries: dict[Any, Query] = {}
        self._weights = b""
        self._rest = np.zeros(layout.nv)

    def begin(self, q0: Any) -> Array:
        """Checked, as the first configuration of a search: targets that wait are taken from q0, then limits hold."""
        q = self.stack.robot.configuration("q0", q0)
        self.core.begin(q, self._rest)
        self.tick.dt[0] = TICK
        self.tick.q[:] = self.within_limits(q)
        return self.tick.q.copy()

    def run(self, first: Array, query: Query, seconds: float) -> SearchResult:
        """Search from a configuration for some seconds; the answer is in the tick's q."""
        self.tick.q[:], self.tick.v_last[:] = first, 0.0
        return self.search.run(query, seconds)

    def look(self, q: Array, weight: Array) -> Step:
        """The tick at q, for weights that a search ended with."""
        tick, before = self.tick, self.tick.weight.copy()
        tick.weight[:] = weight
        if self._sensing:
            step = self.controller.step(q, self._rest, dt=TICK)
        else:
            tick.q[:], tick.v_last[:] = q, 0.0
            step = self.core.again()
        tick.weight[:] = before
        return step

    def query(self, goals: Sequence[str], tolerance: float, restarts: int, seed: int) -> Query:
        """A search for some goals, with the weights as they are."""
        weight = self.tick.weight
        now = weight.tobytes()
        if now != self._weights:
            # Other weights, other goals: perhaps other joints move them
            self._weights, self._table = now, (0, self._table[1][:0])
            self._queries.clear()
            self.__dict__.pop("starts", None)
        key = (tuple(goals), tolerance, restarts, seed)
        if key not in self._queries:
            if len(self._queries) > _KEPT:
                self._queries.clear()
            rows = goal_rows(self.controller, goals)
            aims, secondary = weight * rows, weight * (1.0 - self.rows)
            heaviest = float((secondary / self.core.row_costs).max(initial=0.0))
            self._queries[key] = Query(
                starts=self.random(restarts, seed),
                chosen=self.starts.chosen,
                tolerance=np.where(rows > 0.0, tolerance * self._units, -1.0),
                seeking=aims,
                settling=aims * max(1.0, FIRST * heaviest) + secondary,
                room=ROOM,
                secondary=heaviest > 0.0,
            )
        return self._queries[key]

    def within_limits(self, q: Array) -> Array:
        """The nearest configuration (or each of several) within the position limits that are on."""
        switches = self.tick.bound_enabled.tobytes()
        if switches != self._switches:
            coordinates, places, lower, upper = self._limited
            on = self.tick.bound_enabled[places] != 0.0
            low, high = np.full(self.stack.robot.nq, -np.inf), np.full(self.stack.robot.nq, np.inf)
            low[coordinates], high[coordinates] = np.where(on, lower, -np.inf), np.where(on, upper, np.inf)
            self._switches, self._limits = switches, (low, high)
        return np.minimum(np.maximum(q, self._limits[0]), self._limits[1])

    @cached_property
    def starts(self) -> Starts:
        """Random configurations of the joints that move a goal."""
        lower, upper = self._stops.lower, self._stops.upper
        robot = self.stack.robot
        everywhere = Starts(robot, lower, upper, np.ones(robot.nv, dtype=bool))
        q = np.where(everywhere.chosen != 0.0, everywhere.table(1, 0)[0], self.tick.q)
        share = np.diag(self.qp(q, self.tick.weight * self.rows).H) * self.dof_scales**2
        return Starts(robot, lower, upper, share > _MOVED * share.max(initial=0.0))

    def random(self, count: int, seed: int) -> Array:
        """Configurations that searches start again from [count, nq]; coordinates that stay mean nothing."""
        if self._table[0] != seed or len(self._table[1]) < count:
            self._table = (seed, self.starts.table(count, seed))
        return self._table[1][:count]

    def qp(self, q: Array, weight: Array) -> QP:
        """The QP at q, without curvature, for some weights of the task rows."""
        tick, before, here = self.tick, self.tick.weight.copy(), self.tick.q.copy()
        tick.weight[:], tick.q[:], tick.dt[0], tick.plain[0] = weight, q, TICK, 1.0
        qp = tick.qp()
        tick.weight[:], tick.q[:], tick.plain[0] = before, here, 0.0
        return qp


def ending(found: SearchResult) -> Ending:
    """How a search ended, in words."""
    if found.ending == FOUND:
        return Ending.SOLVED
    if found.descents == 0:
        return Ending.OUT_OF_TIME
    return Ending.UNREACHABLE if found.cost < np.inf else Ending.CONTRADICTORY
