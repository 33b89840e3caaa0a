"""The published driver: a trajectory, step by step with position feedback; what it lacked is there as settings."""

from __future__ import annotations

import copy
import enum
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, WbcError
from wbc.multibody import pin
from wbc.published.ikor.avoidance import broken, gaps
from wbc.published.ikor.lines import GIMBAL, Trajectory, euler_angles, rotation_of, turned
from wbc.published.ikor.machines import STEERING, WHEEL_BASE, ArmMachine
from wbc.published.ikor.polygons import convex_parts
from wbc.published.ikor.settings import AXES, Settings, step_criterion
from wbc.published.ikor.stack_steps import StackSteps
from wbc.resolvers import PseudoInverse, RateProblem
from wbc.resolvers.fsp import Criterion, EqualityRow, Optimum, SolutionSpace, best, blocked, orthogonal
from wbc.resolvers.fsp.compiled import library
from wbc.validation import Array

#: Steps that a loop back goes back by, and holds its joint beyond the step that was too long
BACK = 8
#: What an operator moves: pair -> units of its six rates. ``tool``: x, y, z, yaw, pitch, roll of the tool; ``base``: x,
#: y, z of the tool, and x, y, turn of the platform, with the first joystick's button off, as published
PAIRS = {"tool": ("m", "m", "m", "rad", "rad", "rad"), "base": ("m", "m", "m", "m", "m", "rad")}
NO_ROWS: tuple[EqualityRow, ...] = ()


class Code(enum.IntEnum):
    """The published codes of status."""

    OK = 0
    PARTIAL = -1
    FILES = 2


class Stop(enum.StrEnum):
    """Why a run ended."""

    DONE = "all points done"
    TRUNCATED = "more points than a trajectory may have"
    NOTHING = "no points"
    NO_COLUMN = "no joint moves the task"
    INCONSISTENT = "the task contradicts itself"
    NO_STEP = "no step within the limits"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, eq=False)
class CourseRun:
    """What came of it.

    Attributes:
        q: columns, the start first [steps + 1, M]. norms: of every step, (180 / pi)^2 sum of squares, metres as
            radians, as printed [steps]. errors: largest miss of a row of the task after it [steps].
        clearance: least distance of a link from a sphere, inf without any [steps]. seconds: of every step [steps].
        acted: names of the constraints of every step. given_up: those that contradicted others.
        code, stop, message: how it ended. loops: how often it went back.
    """

    q: Array
    norms: Array
    errors: Array
    clearance: Array
    seconds: Array
    acted: tuple[tuple[str, ...], ...]
    given_up: tuple[tuple[str, ...], ...]
    code: Code
    stop: Stop
    message: str = ""
    loops: int = 0


@dataclass
class _StepLog:
    """Steps so far: columns before each, and what is known of each."""

    path: list[Array]
    steps: list[tuple[Any, ...]] = field(default_factory=list)

    def run(self, stop: Stop, message: str = "", loops: int = 0) -> CourseRun:
        columns: list[tuple[Any, ...]] = list(zip(*self.steps, strict=True)) or [()] * 6
        norms, errors, clearance, seconds = (np.array(column, dtype=float) for column in columns[:4])
        acted, given_up = columns[4:]
        code = Code.OK if stop in (Stop.DONE, Stop.NOTHING) else Code.PARTIAL
        q = np.array(self.path)
        return CourseRun(q, norms, errors, clearance, seconds, acted, given_up, code, stop, message, loops)


class Driver:
    """A machine on its way.

    Raises:
        WbcError: settings that the machine cannot have.
    """

    def __init__(
        self, machine: ArmMachine, settings: Settings | None = None, spheres: Any = (), polygons: Sequence[Any] = ()
    ) -> None:
        self.machine, self.settings = machine, settings or Settings()
        spheres = validation.ordinary_array("spheres", np.asarray(spheres, dtype=float).reshape(-1, 4))
        self.spheres = spheres[spheres[:, 3] > 0.0]
        self.polygons = [convex_parts(polygon) for polygon in polygons]
        if polygons and not machine.flat:
            raise RangeError("polygons", machine.name, "expected a planar arm; other arms have spheres as obstacles")
        # Compiled now, so that it is no step's time
        library()
        # The step before, and columns that a switch holds at rest
        self.last, self.still = np.zeros(machine.joints), tuple[int, ...]()
        self._criterion(machine.home).check(machine.joints)
        if self.settings.plain and machine.base == "car":
            raise RangeError("base", machine.base, "a pseudo-inverse takes no bound of a steering angle; take FSP")
        stacked = self.settings.resolver == "stack"
        if polygons and (stacked or self.settings.plain):
            raise RangeError("resolver", self.settings.resolver, "polygons are obstacles of FSP alone")
        self._stack = StackSteps(machine, self.settings, self.spheres) if stacked else None
        self._phases = self._switched()

    def _criterion(self, q: Array) -> Criterion:
        chosen = self.settings.criterion
        return step_criterion(self.machine, chosen, q, self.last) if isinstance(chosen, str) else chosen

    def _switched(self) -> list[tuple[int, Driver]]:
        """(point from which on, driver) in their order."""
        platform = tuple(range(self.machine.joints - 3, self.machine.joints))
        out = [(1, self)]
        for switch in sorted(self.settings.switches, key=lambda one: one.point):
            before = out[-1][1]
            driver, rows = copy.copy(before), before.settings.rows
            if switch.orientation is not None:
                rows = tuple(r for r in rows if r not in AXES[3:]) + (AXES[3:] if switch.orientation else ())
            if switch.platform is not None:
                if self.machine.base == "none":
                    raise RangeError("switch", switch.point, "there is no platform; choose a base")
                driver.still = () if switch.platform else platform
            driver.settings = replace(before.settings, rows=rows)
            out.append((switch.point, driver))
        return out

    def run(self, trajectory: Trajectory) -> CourseRun:
        """The whole trajectory; what stops it earlier, Ctrl-C too, is said in the answer."""
        settings, points, euler = self.settings, trajectory.points, trajectory.euler
        q = self.machine.checked("start", trajectory.start).copy()
        if euler is None:
            euler = np.tile(euler_angles(self.machine.place(q)[1]), (len(points), 1))
        log, aims, fresh, loops = _StepLog([q]), list(zip(points, euler, strict=True)), 0, 0
        while (k := len(log.steps)) < len(aims):
            try:
                self._follow(log, aims, k + 1)
                v = log.path[-1] - log.path[-2]
                if settings.loop_back and k >= fresh and np.abs(v).max() >= settings.step_limit * (1 - 1e-9):
                    fresh = min(k + BACK, len(aims))
                    loops += self._loop_back(log, aims, k, fresh, int(np.argmax(np.abs(v))))
            except WbcError as error:
                return log.run(_reason(error), str(error), loops)
            except KeyboardInterrupt:
                return log.run(Stop.INTERRUPTED, f"after {k} of {len(aims)} points", loops)
        full = Stop.TRUNCATED if trajectory.dropped else Stop.DONE
        message = f"{trajectory.dropped} points left out" if trajectory.dropped else ""
        return log.run(full if aims else Stop.NOTHING, message, loops)

    def _follow(self, log: _StepLog, aims: list[tuple[Array, Array]], last: int, held: Sequence[int] = ()) -> None:
        """Steps to the aims that the log has not, up to a number."""
        for k in range(len(log.steps), last):
            began, q = time.perf_counter(), log.path[-1]
            before = None if self.settings.feedback or not k else aims[k - 1]
            driver = next(driver for first, driver in reversed(self._phases) if first <= k + 1)
            driver.last = q - log.path[-2] if k else 0.0 * q
            v, found = driver.step(q, *aims[k], held, before)
            driver._done(log, q, v, found, aims[k], began)

    def _loop_back(self, log: _StepLog, aims: list[tuple[Array, Array]], k: int, last: int, joint: int) -> bool:
        """From step k on to another, or back by :data:`BACK` steps and on with a joint at rest: what misses less."""
        first = max(0, k - BACK)
        other = _StepLog(log.path[: first + 1], log.steps[:first])
        self._follow(log, aims, last)
        try:
            self._follow(other, aims, last, (joint,))
        except WbcError:
            return False
        better = bool(other.steps[-1][1] < log.steps[-1][1])
        if better:
            log.path[:], log.steps[:] = other.path, other.steps
        return better

    def operate(
        self, source: Any, start: Any = None, *, seconds: float = math.inf, dt: float = 0.02, realtime: bool = False
    ) -> CourseRun:
        """By an operator's rates, as the published joysticks: of :data:`PAIRS` that of the latest order.

        Args:
            source: a :class:`wbc.teleop.Source`: a file of rates, a keyboard, a program. dt: of a step [s].
            realtime: wait for the clock.

        Raises:
            RangeError: the stack as resolver. WbcError: a bad order.
        """
        if self._stack is not None:
            raise RangeError("resolver", "stack", "an operator drives by FSP or the pseudo-inverse")
        if self.settings.switches:
            raise RangeError("switches", len(self.settings.switches), "an operator's rates switch by their pair")
        pairs = PAIRS if self.machine.base != "none" else {"tool": PAIRS["tool"]}
        oriented, placed = copy.copy(self), copy.copy(self)
        oriented.settings, placed.settings = (replace(self.settings, rows=rows) for rows in (AXES, AXES[:3]))
        q = self.machine.checked("start", self.machine.home if start is None else start).copy()
        log, active, rates, began = _StepLog([q]), "tool", np.zeros(6), time.perf_counter()
        place, rotation = self.machine.place(q)
        point, euler = place.copy(), euler_angles(rotation)
        while len(log.steps) * dt < seconds:
            now = time.perf_counter()
            try:
                order = source.order(len(log.steps) * dt, tuple(pairs), active, pairs[active])
                if order is not None:
                    active = validation.one_of("pair", order.pair or active, pairs)
                    rates = np.zeros(6)
                    rates[: len(order.rates)] = () if order.stop else order.rates
                point, rows = point + rates[:3] * dt, NO_ROWS
                if active == "tool":
                    driver, euler = oriented, euler + rates[3:] * dt
                else:
                    names, axes = ("platform x", "platform y", "platform turn"), np.eye(3, len(q), len(q) - 3)
                    driver, euler = placed, euler_angles(self.machine.place(q)[1])
                    rows = tuple(EqualityRow(*row) for row in zip(names, axes, rates[3:] * dt, strict=True))
                driver.last = q - log.path[-2] if log.steps else 0.0 * q
                v, found = driver.step(q, point, euler, commanded=rows)
            except StopIteration:
                return log.run(Stop.DONE)
            except KeyboardInterrupt:
                return log.run(Stop.INTERRUPTED, f"after {len(log.steps) * dt:g} s")
            except WbcError as error:
                if error.field in ("pair", "rates"):
                    raise
                return log.run(_reason(error), str(error))
            q = driver._done(log, q, v, found, (point, euler), now)
            if realtime:
                time.sleep(max(0.0, began + len(log.steps) * dt - time.perf_counter()))
        return log.run(Stop.DONE)

    def step(
        self, q: Array, point: Array, euler: Array, held: Sequence[int] = (),
        before: tuple[Array, Array] | None = None, commanded: tuple[EqualityRow, ...] = NO_ROWS,
    ) -> tuple[Array, Optimum]:  # fmt: skip
        """The step of the columns towards a point; ``held``: columns at rest, ``commanded``: rows beside the task.

        Raises:
            WbcError: there is none.
        """
        settings, machine, still = self.settings, self.machine, np.zeros(len(q))
        if self._stack is not None:
            v = self._stack.step(q, point, rotation_of(euler))
            return v, Optimum(v, np.zeros(0), self._stack.binding)
        J, x = self.task(q, point, euler, before)
        J[:, self.still] = 0.0
        criterion = self._criterion(q)
        if settings.damping:
            x = J @ np.linalg.solve(J.T @ J + settings.damping**2 * np.eye(len(q)), J.T @ x)
        rows = [*(EqualityRow("wheels", row, 0.0) for row in machine.slide(q)), *commanded]
        if settings.plain:
            whole = RateProblem(np.vstack((J, *(r.a for r in rows))), np.concatenate((x, [r.value for r in rows])))
            whole.task[:, self.still] = 0.0
            v = PseudoInverse(criterion.weight).resolve(whole)
            found = Optimum(v, np.zeros(0))
        else:
            space = self._space(J, x, held)
            acts = not (settings.two_step or settings.ahead)
            now = broken(machine, settings, q, still, self.spheres, self.polygons) if acts else []
            found = self._best(space, criterion, q, [*rows, *now])
            after = q + found.v
            if settings.two_step and (late := broken(machine, settings, after, still, self.spheres, self.polygons)):
                # The vectors of the same rates, of which the second step takes the self-motions
                space = self._space(self.task(after, point, euler, None)[0], x, held, project=True)
                space = replace(space, x=0.0 * x, vectors=np.vstack((still, space.directions)))
                rest = [EqualityRow(row.name, row.a, 0.0) for row in rows]
                second = best(space, Criterion(criterion.weight), [*rest, *late], in_order=True)
                found = replace(second, v=found.v + second.v)
        return found.v * min(1.0, settings.step_limit / max(float(np.abs(found.v).max()), 1e-300)), found

    def task(self, q: Array, point: Array, euler: Array, before: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """Rows of the Jacobian and what they shall do, from where the tool is, or from where it should have been.

        Raises:
            RangeError: Euler angles at a pitch of a right angle.
        """
        place, rotation = self.machine.place(q)
        if before is not None:
            place, rotation = before[0], rotation_of(before[1])
        J, x = self.machine.jacobian(q).copy(), np.concatenate((point - place, np.zeros(3)))
        angles = [r for r in self.settings.rows if r in AXES[3:]]
        if len(angles) == 3 and not self.settings.euler:
            x[3:] = pin.log3(rotation_of(euler) @ rotation.T)
        elif angles:
            now = euler_angles(rotation)
            if math.cos(now[1]) < GIMBAL:
                raise RangeError("euler", now, "the pitch is a right angle: yaw and roll cannot be told apart")
            axes = pin.rpy.computeRpyJacobian(now[::-1], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:, ::-1]
            J[3:], x[3:] = np.linalg.solve(axes, J[3:]), turned(euler - now)
        chosen = [AXES.index(r) for r in self.settings.rows]
        return J[chosen], x[chosen]

    def _done(
        self, log: _StepLog, q: Array, v: Array, found: Optimum, aim: tuple[Array, Array], began: float
    ) -> Array:  # fmt: skip
        """The columns after a step, which goes to the log."""
        after = q + v
        miss = float(np.abs(self.task(after, *aim, None)[1]).max())
        near = gaps(self.machine, after, self.spheres, polygons=self.polygons)
        clear = min((gap.size for gap in near), default=math.inf)
        norm, seconds = math.degrees(1.0) ** 2 * float(v @ v), time.perf_counter() - began
        log.steps.append((norm, miss, clear, seconds, found.kept, found.left_out))
        log.path.append(after)
        return after

    def _space(self, J: Array, x: Array, held: Sequence[int], project: bool = False) -> SolutionSpace:
        project, held = project or bool(held), (*held, *self.still)
        if self.settings.generator == "blocked":
            return blocked(J, x, held=held, project=project)
        return orthogonal(J, x, held=held, free=True, project=project)

    def _best(self, space: SolutionSpace, criterion: Criterion, q: Array, rows: list[EqualityRow]) -> Optimum:
        """In one shot; ahead, constraints that a step would break act on it, the first broken first."""
        found = best(space, criterion, rows, in_order=True)
        if self.machine.base == "car":
            # The front wheels are turned first, to where the step without them would go, as far as they go
            ahead, most = np.array([math.cos(q[-1]), math.sin(q[-1]), 0.0]), math.tan(STEERING) / WHEEL_BASE
            speed = float(ahead @ found.v[-3:])
            bend = float(np.clip(found.v[-1] / speed, -most, most)) if abs(speed) > 1e-12 else 0.0
            row = np.concatenate((np.zeros(len(q) - 3), [-bend * ahead[0], -bend * ahead[1], 1.0]))
            rows = [*rows[:1], EqualityRow("steering", row, 0.0), *rows[1:]]
            found = best(space, criterion, rows, in_order=True)
        for _ in range(space.span if self.settings.ahead else 0):
            names = {row.name for row in rows}
            worst = broken(self.machine, self.settings, q, found.v, self.spheres, self.polygons)
            more = [row for row in worst if row.name not in names]
            if not more:
                break
            rows = [*rows, more[0]]
            found = best(space, criterion, rows, in_order=True)
        return found


def _reason(error: WbcError) -> Stop:
    if "no joint moves" in str(error) or "all joints are blocked" in str(error):
        return Stop.NO_COLUMN
    return Stop.INCONSISTENT if error.field == "x" else Stop.NO_STEP
