"""The same steps by a stack: the task, then least motion, limits and obstacles as inequalities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from wbc import tasks
from wbc.api import Stack
from wbc.errors import InfeasibleError, RangeError
from wbc.multibody import pin
from wbc.published.ikor.legacy import LegacyHermies
from wbc.published.ikor.machines import ArmMachine
from wbc.published.ikor.settings import DT, Settings
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.tasks.base import Constraint, Row, Rows, SacrificeOrder
from wbc.validation import Array

#: Links are capsules of this radius [m]
RADIUS = 1e-6


@dataclass(frozen=True)
class _FixedAxle(Constraint):
    """-sin(turn) dx/dt + cos(turn) dy/dt = 0 of a platform with joints x, y and turn."""

    abstract: ClassVar[bool] = True
    order: ClassVar[SacrificeOrder] = SacrificeOrder.HOLD

    def rows(self, robot: Any) -> tuple[Row, ...]:
        return (Row("sideways", "m/s"),)

    def velocity_rows(self, robot: Any, kin: Any, inputs: Any, dt: ca.SX) -> Rows:
        turn = kin.joint("turn")
        row = ca.SX(1, robot.nv)
        row[0, 0], row[0, 1] = -ca.sin(turn), ca.cos(turn)
        return Rows(row, ca.SX(0), ca.SX(0))


class StackSteps:
    """A compiled stack, asked for one step at a time.

    Raises:
        RangeError: one or two Euler angles alone, or a car, which no item of a stack states.
    """

    def __init__(self, machine: ArmMachine, settings: Settings, spheres: Array) -> None:
        angles = [r for r in settings.rows if r in ("yaw", "pitch", "roll")]
        if len(angles) not in (0, 3) or not {"x", "y", "z"} <= set(settings.rows):
            raise RangeError("rows", settings.rows, "a stack takes x, y and z, and all three angles or none")
        if isinstance(machine, LegacyHermies):
            raise RangeError(
                "resolver", "stack", "a stack has no defects of the printed norms; take consistent kinematics"
            )
        if machine.base == "car":
            raise RangeError("base", machine.base, "a stack takes a holonomic or differential platform")
        if settings.loop_back:
            raise RangeError("loop_back", True, "a stack keeps the limit of its steps and needs no loop back")
        if settings.switches:
            raise RangeError("switches", len(settings.switches), "a stack keeps its rows and joints")
        self.machine, self.pose = machine, bool(angles)
        self.binding: tuple[str, ...] = ()
        robot = machine.robot
        if np.isfinite(settings.step_limit):
            robot = robot.with_limits(velocity=settings.step_limit / DT)
        bounds = np.sort(machine.spread @ np.stack((machine.lower, machine.upper), axis=1), axis=1)
        robot = robot.with_limits(position_lower=bounds[:, 0], position_upper=bounds[:, 1])
        if settings.obstacles and len(spheres):
            robot = robot.with_shapes(_shapes(machine))
        # A margin may vanish within the longest tick that a stack takes, twice its own
        stack = Stack(robot, DT / 2.0, damping=max(1e-12, settings.damping**2), length=1.0, calm=False)
        stack.add(tasks.EndEffector("tip", kind="pose" if self.pose else "position", gain=1.0 / DT), name="tool")
        slaved = _slaved(machine)
        if slaved:
            stack.add(tasks.JointCoupling(slaved, gain=1.0 / DT), name="slaved")
        # A slaved joint is no column of its own, and costs nothing
        own = (machine.spread != 0.0).sum(axis=1) == 1
        weights = np.where(own, np.abs(machine.spread) @ machine.weights**2, 0.0)
        stack.add(tasks.Damping(weights=tuple(weights)), name="least", level=1)
        stack.add(tasks.JointLimits(position=settings.limits, acceleration=False, return_rate=1.0 / DT), name="limits")
        for k, (x, y, z, radius) in enumerate(spheres if settings.obstacles else ()):
            pose = pin.SE3(np.eye(3), np.array([x, y, z]))
            stack.add(tasks.Obstacle(Sphere(radius), margin=settings.margin, pose=pose), name=f"sphere {k + 1}")
        if machine.base == "differential":
            stack.add(_FixedAxle(), name="wheels")
        self.controller = stack.compile()
        for k in range(len(spheres) if settings.obstacles else 0):
            self.controller[f"sphere {k + 1}"].rate = 1.0 / DT

    def step(self, q: Array, point: Array, rotation: Array) -> Array:
        """The step of the columns.

        Raises:
            InfeasibleError: the rows contradict each other, by the stack's explanation.
        """
        tool = self.controller["tool"]
        tool.target = pin.SE3(rotation, point) if self.pose else point
        found = self.controller.step(self.machine.of_robot(q), dt=DT)
        if found.relaxed:
            raise InfeasibleError("stack", [str(s) for s in found.relaxed], str(found.explain()))
        self.binding = tuple(str(b) for b in found.binding)
        return np.linalg.pinv(self.machine.spread) @ found.v * DT


def _slaved(machine: ArmMachine) -> list[dict[str, float]]:
    """Relations of the robot's joints that its columns imply: of AIRARM the wrist that stays level."""
    u, sigma, _ = np.linalg.svd(machine.spread)
    rank = int((sigma > 1e-9).sum())
    names = machine.robot.dof_names
    return [{n: float(c) for n, c in zip(names, row, strict=True) if abs(c) > 1e-9} for row in u[:, rank:].T]


def _shapes(machine: ArmMachine) -> dict[str, list[PlacedShape]]:
    """A thin capsule for each link that has a length, and the platform's disc as a ball."""
    points, out = machine.points(machine.home), dict[str, list[PlacedShape]]()
    data = machine.robot.model.createData()
    pin.forwardKinematics(machine.robot.model, data, machine.of_robot(machine.home))
    for (joint, _), a, b in zip(machine.ends[1:], points, points[1:], strict=False):
        way = b - a
        length = float(np.linalg.norm(way))
        if joint == 0 or length < 1e-9:
            continue
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way / length).matrix()
        placed = data.oMi[joint].actInv(pin.SE3(turn, (a + b) / 2.0))
        out.setdefault(f"link{joint}", []).append(PlacedShape(Capsule(RADIUS, length), placed))
    if machine.base != "none":
        out["link3"] = [PlacedShape(Sphere(machine.plate), pin.SE3.Identity())]
    return out
