"""The published driver: a trajectory, step by step with position feedback; what it lacked is there as settings."""

from __future__ import annotations

import enum
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RangeError, WbcError
from wbc.published.ikor.files import Trajectory
from wbc.published.ikor.machines import STEERING, WHEEL_BASE, ArmMachine
from wbc.published.ikor.settings import AXES, Method, Settings
from wbc.published.ikor.stack_steps import StackSteps
from wbc.resolvers import PseudoInverse, RateProblem
from wbc.resolvers.fsp import (
    Criterion,
    EqualityRow,
    Optimum,
    SolutionSpace,
    best,
    blocked,
    joint_row,
    orthogonal,
    point_row,
)
from wbc.validation import Array

#: Of a line that is created: [m], [rad], as the published program shows them
INCREMENTS = 0.01, math.radians(1.0)
#: Smallest cosine of the pitch at which yaw and roll are told apart
GIMBAL = 1e-6
#: Steps that a loop back goes back by, and holds its joint beyond the step that was too long
BACK = 8


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


@dataclass(frozen=True, eq=False)
class Run:
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


def straight(machine: ArmMachine, step: Any, count: int, start: Any = None, turn: Any = None) -> Trajectory:
    """A line in equal steps from where the tool is; ``turn``: of yaw, pitch, roll a step [rad]."""
    q = machine.home if start is None else machine.checked("start", start)
    place, rotation = machine.place(q)
    ways = np.arange(1, count + 1)[:, None]
    euler = euler_angles(rotation) + ways * (np.zeros(3) if turn is None else np.asarray(turn))
    return Trajectory(q, place + ways * validation.ordinary_array("step", step, (3,)), euler)


def line_to(machine: ArmMachine, point: Any, euler: Any = None, start: Any = None) -> Trajectory:
    """A line from where the tool is to a point [m], turning to yaw, pitch, roll [rad] on the way, in equal steps of at
    most :data:`INCREMENTS`.

    Raises:
        ShapeError, NotFiniteError: no point or angles.
    """
    q = machine.home if start is None else machine.checked("start", start)
    place, rotation = machine.place(q)
    way = validation.ordinary_array("point", point, (3,)) - place
    first = euler_angles(rotation)
    turn = np.zeros(3)
    if euler is not None:
        turn = (validation.ordinary_array("euler", euler, (3,)) - first + math.pi) % (2.0 * math.pi) - math.pi
    count = max(1, math.ceil(max(np.linalg.norm(way) / INCREMENTS[0], np.abs(turn).max() / INCREMENTS[1]) - 1e-9))
    return straight(machine, way / count, count, q, turn / count)


def euler_angles(rotation: Array) -> Array:
    """Yaw, pitch, roll of Rz Ry Rx; yaw 0 where the pitch is a right angle."""
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if math.cos(pitch) < GIMBAL:
        sign = math.copysign(1.0, pitch)
        return np.array([0.0, pitch, sign * math.atan2(rotation[0, 1], rotation[1, 1])])
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return np.array([yaw, pitch, math.atan2(rotation[2, 1], rotation[2, 2])])


def rotation_of(euler: Array) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    yaw, pitch, roll = euler
    turn = pin.utils.rotate
    return np.asarray(turn("z", yaw) @ turn("y", pitch) @ turn("x", roll))


def intrusions(machine: ArmMachine, q: Array, spheres: Array, margin: float = 0.0, whole: bool = True) -> list[Any]:
    """(gap, link, point, normal, sphere) of every link and sphere: the nearest point of the link, where it goes to get
    away, and by how much it is clear, less than 0 within the sphere. ``whole``: tool and platform, too; link -1 is the
    platform, a disc.
    """
    points, out = machine.points(q), []
    for number, (x, y, z, radius) in enumerate(spheres):
        centre = np.array([x, y, z])
        for link in range(len(points) - (1 if whole else 2)):
            a, b = points[link], points[link + 1]
            way = b - a
            share = float(np.clip((centre - a) @ way / max(way @ way, 1e-300), 0.0, 1.0))
            out.append((*_away(a + share * way, centre, radius + margin, way), link, number))
        if whole and machine.base != "none":
            middle = np.array([q[-3], q[-2], z])
            if abs(z) <= radius + margin:
                out.append(
                    (*_away(middle, centre, radius + margin + machine.plate, np.array([0.0, 0.0, 1.0])), -1, number)
                )
    return [(gap, link, point, normal, number) for gap, point, normal, link, number in out]


def _away(point: Array, centre: Array, radius: float, along: Array) -> tuple[float, Array, Array]:
    """(gap, point, normal): across the link where its point is the centre, which has no normal of its own."""
    off = point - centre
    size = float(np.linalg.norm(off))
    if size > 1e-9:
        return size - radius, point, off / size
    side = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    return -radius, point, side / np.linalg.norm(side)


class Driver:
    """A machine on its way.

    Raises:
        WbcError: settings that the machine cannot have.
    """

    def __init__(self, machine: ArmMachine, settings: Settings | None = None, spheres: Any = ()) -> None:
        self.machine, self.settings = machine, settings or Settings()
        spheres = validation.ordinary_array("spheres", np.asarray(spheres, dtype=float).reshape(-1, 4))
        self.spheres = spheres[spheres[:, 3] > 0.0]
        self._b = machine.weights
        self._stack = StackSteps(machine, self.settings, self.spheres) if self.settings.resolver == "stack" else None

    def run(self, trajectory: Trajectory) -> Run:
        """The whole trajectory; what stops it earlier is said in the answer."""
        machine, settings = self.machine, self.settings
        q = machine.checked("start", trajectory.start).copy()
        euler = trajectory.euler
        if euler is None:
            euler = np.tile(euler_angles(machine.place(q)[1]), (len(trajectory.points), 1))
        out: list[Any] = []
        path, k, loops, stop, message = [q], 0, 0, Stop.DONE, ""
        held: dict[int, int] = {}
        tried: set[int] = set()
        if not len(trajectory.points):
            stop = Stop.NOTHING
        while k < len(trajectory.points):
            began = time.perf_counter()
            before = None if settings.feedback or not k else (trajectory.points[k - 1], euler[k - 1])
            try:
                v, found = self.step(q, trajectory.points[k], euler[k], tuple(held), before)
            except WbcError as error:
                stop, message = _reason(error), str(error)
                break
            if settings.loop_back and np.abs(v).max() >= settings.step_limit * (1 - 1e-9) and k not in tried:
                # Back by some steps, then on with the joint at rest that would have moved most
                tried.add(k)
                worst, loops = int(np.argmax(np.abs(v))), loops + 1
                held = {worst: k + BACK}
                k = max(0, k - BACK)
                q, path, out = path[k], path[: k + 1], out[:k]
                continue
            q = q + v
            norm = math.degrees(1.0) ** 2 * float(v @ v)
            miss = self._miss(q, trajectory.points[k], euler[k])
            clear = min((i[0] for i in intrusions(machine, q, self.spheres)), default=math.inf)
            out.append((norm, miss, clear, time.perf_counter() - began, found.kept, found.left_out))
            path.append(q)
            k += 1
            held = {joint: last for joint, last in held.items() if k <= last}
        if stop is Stop.DONE and trajectory.dropped:
            stop = Stop.TRUNCATED
        columns: Any = zip(*out, strict=True) if out else ((),) * 6
        norms, misses, gaps, seconds, acted, given_up = columns
        code = Code.OK if stop in (Stop.DONE, Stop.NOTHING) else Code.PARTIAL
        norms, misses, gaps, seconds = (np.array(column, dtype=float) for column in (norms, misses, gaps, seconds))
        return Run(np.array(path), norms, misses, gaps, seconds, acted, given_up, code, stop, message, loops)

    def step(
        self, q: Array, point: Array, euler: Array, held: Sequence[int] = (), before: tuple[Array, Array] | None = None
    ) -> tuple[Array, Optimum]:
        """The step of the columns towards a point.

        Raises:
            WbcError: there is none.
        """
        settings = self.settings
        if self._stack is not None:
            v = self._stack.step(q, point, rotation_of(euler))
            return v, Optimum(v, np.zeros(0), self._stack.binding)
        J, x = self.task(q, point, euler, before)
        if settings.damping:
            x = J @ np.linalg.solve(J.T @ J + settings.damping**2 * np.eye(len(q)), J.T @ x)
        if settings.resolver == "pseudo_inverse" or settings.method is Method.PSEUDO_INVERSE:
            v = PseudoInverse(None if (self._b == 1.0).all() else self._b**2).resolve(RateProblem(J, x))
            found = Optimum(v, np.zeros(0))
        else:
            space = self._space(J, x, held)
            slide = [EqualityRow(f"wheels {k}", row, 0.0) for k, row in enumerate(self.machine.slide(q))]
            now = [] if settings.two_step else self._broken(q, np.zeros(len(q)), ahead=False)
            found = self._best(space, q, slide, now)
            if settings.two_step:
                after = q + found.v
                late = self._broken(after, np.zeros(len(q)), ahead=False)
                if late:
                    still = self._space(self.task(after, point, euler, None)[0], np.zeros(len(x)), held)
                    second = best(still, self._criterion(), [*slide, *late], in_order=True)
                    found = Optimum(found.v + second.v, found.t, second.kept, second.redundant, second.left_out)
        longest = float(np.abs(found.v).max())
        share = min(1.0, settings.step_limit / longest) if longest > 0.0 else 1.0
        return found.v * share, found

    def task(self, q: Array, point: Array, euler: Array, before: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """Rows of the Jacobian and what they shall do, from where the tool is, or from where it should have been."""
        place, rotation = self.machine.place(q)
        if before is not None:
            place, rotation = before[0], rotation_of(before[1])
        J = self.machine.jacobian(q).copy()
        x = np.concatenate((point - place, np.zeros(3)))
        angles = [r for r in self.settings.rows if r in AXES[3:]]
        if len(angles) == 3 and not self.settings.euler:
            x[3:] = pin.log3(rotation_of(euler) @ rotation.T)
        elif angles:
            yaw, pitch, _ = now = euler_angles(rotation)
            turn = pin.utils.rotate("z", yaw)
            axes = np.column_stack(((0.0, 0.0, 1.0), turn[:, 1], turn @ pin.utils.rotate("y", pitch)[:, 0]))
            if math.cos(pitch) < GIMBAL:
                raise RangeError("euler", now, "the pitch is a right angle: yaw and roll cannot be told apart")
            J[3:] = np.linalg.solve(axes, J[3:])
            x[3:] = (euler - now + math.pi) % (2.0 * math.pi) - math.pi
        chosen = [AXES.index(r) for r in self.settings.rows]
        return J[chosen], x[chosen]

    def _miss(self, q: Array, point: Array, euler: Array) -> float:
        return float(np.abs(self.task(q, point, euler, None)[1]).max())

    def _space(self, J: Array, x: Array, held: Sequence[int]) -> SolutionSpace:
        if self.settings.generator == "blocked":
            return blocked(J, x, held=held, project=bool(held))
        return orthogonal(J, x, held=held, free=True, project=bool(held))

    def _criterion(self) -> Criterion:
        return Criterion(None if (self._b == 1.0).all() else self._b**2)

    def _best(self, space: SolutionSpace, q: Array, slide: list[EqualityRow], now: list[EqualityRow]) -> Optimum:
        """In one shot; ahead, constraints that a step would break act on it, the first broken first."""
        settings = self.settings
        if self.machine.base == "car":
            # The front wheels are turned first, to where the step without them would go, as far as they go
            wanted = best(space, self._criterion(), [*slide, *now], in_order=True).v
            ahead = np.array([math.cos(q[-1]), math.sin(q[-1]), 0.0])
            speed = float(ahead @ wanted[-3:])
            most = math.tan(STEERING) / WHEEL_BASE
            bend = float(np.clip(wanted[-1] / speed, -most, most)) if abs(speed) > 1e-12 else 0.0
            row = np.zeros(len(q))
            row[-3:] = [-bend * ahead[0], -bend * ahead[1], 1.0]
            slide = [*slide, EqualityRow("steering", row, 0.0)]
        rows = [*slide, *now]
        found = best(space, self._criterion(), rows, in_order=True)
        for _ in range(space.span if settings.ahead else 0):
            names = {row.name for row in rows}
            more = [row for row in self._broken(q, found.v, ahead=True) if row.name not in names]
            if not more:
                break
            rows.append(more[0])
            found = best(space, self._criterion(), rows, in_order=True)
        return found

    def _broken(self, q: Array, v: Array, ahead: bool) -> list[EqualityRow]:
        """Constraints that q + v breaks, the worst first: back by all of it in one step."""
        settings, machine, out = self.settings, self.machine, []
        if ahead is not settings.ahead and not settings.two_step:
            return []
        if settings.limits:
            low, high = machine.lower - q, machine.upper - q
            for joint in np.flatnonzero((v > high + 1e-12) | (v < low - 1e-12)):
                step = float(high[joint] if v[joint] > high[joint] else low[joint])
                row = joint_row(f"joint {joint + 1}", int(joint), len(q), step)
                out.append((abs(step - float(v[joint])), row))
        if settings.obstacles:
            for gap, link, point, normal, number in intrusions(
                machine, q, self.spheres, settings.margin, settings.ahead
            ):
                if gap > np.abs(v).sum() * 10.0 if ahead else gap >= 0.0:
                    continue
                J = machine.point_jacobian(q, link, point) if link >= 0 else _plate_jacobian(machine, q)
                row = point_row(
                    f"{f'link {link + 1}' if link >= 0 else 'platform'}, sphere {number + 1}", J, normal, -gap
                )
                if float(row.a @ v) < -gap - 1e-12:
                    out.append((-gap - float(row.a @ v), row))
        return [row for _, row in sorted(out, key=lambda one: -one[0])]


def _plate_jacobian(machine: ArmMachine, q: Array) -> Array:
    J = np.zeros((3, len(q)))
    J[0, -3] = J[1, -2] = 1.0
    return J


def _reason(error: WbcError) -> Stop:
    if "no joint moves" in str(error) or "all joints are blocked" in str(error):
        return Stop.NO_COLUMN
    return Stop.INCONSISTENT if error.field == "x" else Stop.NO_STEP
