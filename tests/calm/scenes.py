"""Robots, stacks and loops of the tests on targets out of reach, walls and corners."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import wbc
from tests.models import placement
from wbc.api import Controller
from wbc.robot import Robot
from wbc.shapes import HalfSpace, Sphere
from wbc.tasks import EndEffector, JointLimits, Obstacle, Posture

Array = NDArray[np.float64]

TIPS = {"panda": "panda_hand_tcp", "ur5": "tool0", "talos_left_arm": "gripper_left_base_link"}

#: Weight of the posture against the hand
POSTURE = 1e-3


@cache
def machine(name: str, accelerations: bool = True) -> Robot:
    """The robot with accelerations of its table, or 10 rad/s^2 where that has none; or without any."""
    robot = wbc.robots.load(name)
    if not accelerations:
        return robot.with_limits(acceleration=np.inf)
    known = robot.limits.acceleration
    return robot.with_limits(acceleration=np.where(np.isfinite(known), known, 10.0))


def tip_pose(robot: Robot, q: Array, name: str) -> pin.SE3:
    """Pose of the hand."""
    return pin.SE3(placement(robot, TIPS[name], q))


@dataclass(frozen=True, eq=False)
class Run:
    """Configurations [n + 1, nq], commands [n, nv], what the joints did [n, nv], least margins [n], unsolved ticks."""

    q: Array
    v: Array
    moved: Array
    margin: Array
    unsolved: int
    dt: float

    @property
    def acceleration(self) -> Array:
        """Of the commands, from rest."""
        return np.diff(np.vstack((np.zeros(self.v.shape[1]), self.v)), axis=0) / self.dt

    def flips(self, last: int, above: float) -> int:
        """Changes of sign between neighbouring commands that are both above a speed."""
        v = self.v[-last:]
        both = np.minimum(np.abs(v[1:]), np.abs(v[:-1])) > above
        return int(((v[1:] * v[:-1] < 0.0) & both).sum())


@cache
def built(
    name: str, dt: float, accelerations: bool = True, kind: str = "pose", calm: bool = True, scene: str = "free"
) -> Controller:
    """Hand, posture and joint limits; obstacles of a scene keep the hand's link clear."""
    stack = wbc.Stack(machine(name, accelerations), dt, calm=calm)
    stack.add(EndEffector(TIPS[name], kind=kind), name="hand")  # type: ignore[arg-type]
    stack.add(Posture(), name="posture", weight=POSTURE).add(JointLimits())
    for key, (shape, pose) in SCENES[scene].items():
        links = None if scene == "passing" else ("panda_hand",)
        stack.add(Obstacle(shape, links=links, pose=pose, margin=MARGINS.get(scene, 0.0)), name=key)
    return stack.compile()


def wall(normal: tuple[float, float, float], place: tuple[float, float, float]) -> tuple[HalfSpace, pin.SE3]:
    """A half-space with this outward normal through a point."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(normal))
    return HalfSpace(), pin.SE3(turn.matrix(), np.array(place))


def ball(x: float, y: float, z: float) -> tuple[Sphere, pin.SE3]:
    """A sphere of 0.15 m."""
    return Sphere(0.15), pin.SE3(np.eye(3), np.array([x, y, z]))


SCENES: Mapping[str, Mapping[str, tuple[Any, pin.SE3]]] = {
    "free": {},
    "wall": {"front": wall((-1.0, 0.0, 0.0), (0.5, 0.0, 0.0))},
    "corner": {
        "front": wall((-1.0, 0.0, 0.0), (0.5, 0.0, 0.0)),
        "side": wall((0.0, -1.0, 0.0), (0.0, 0.25, 0.0)),
    },
    "passing": {"ball": (Sphere(0.1), pin.SE3.Identity())},
    "between": {"left": ball(0.5, 0.22, 0.45), "right": ball(0.5, -0.22, 0.45)},
}


#: Asked beyond contact [m]
MARGINS: Mapping[str, float] = {"passing": 0.02}


def run(
    controller: Controller,
    gain: float,
    target: Callable[[float], tuple[Any, Array]],
    ticks: int,
    lag: float = 0.0,
    noise: float = 0.0,
    start: Array | None = None,
) -> Run:
    """``target(t)`` gives the hand's target and its rate.

    Args:
        lag: time constant of the joints' servos [s]. noise: standard deviation of the measured angles [rad].
    """
    robot, dt = controller.stack.robot, controller.stack.dt
    hand, rng = controller["hand"], np.random.default_rng(0)
    q = robot.neutral.copy() if start is None else start.copy()
    controller.reset(q)
    controller["posture"].target = robot.neutral
    hand.gain = gain
    obstacles = [e.name for e in controller.stack.constraints if isinstance(e.item, Obstacle)]
    qs, vs, moves, margins = [q], [], [], []
    moved, unsolved = np.zeros(robot.nv), 0
    follow = 1.0 if lag == 0.0 else 1.0 - np.exp(-dt / lag)
    for k in range(ticks):
        hand.target, hand.feedforward = target(k * dt)
        seen = q + noise * rng.normal(size=robot.nv) if noise else q
        step = controller.step(seen)
        moved = moved + follow * (step.v - moved)
        q = pin.integrate(robot.model, q, dt * moved)
        unsolved += step.status != "solved"
        qs.append(q)
        vs.append(step.v)
        moves.append(moved)
        margins.append(min((float(step.margins[o].min()) for o in obstacles), default=np.inf))
    return Run(np.array(qs), np.array(vs), np.array(moves), np.array(margins), unsolved, dt)


def still(value: Any, rows: int = 6) -> Callable[[float], tuple[Any, Array]]:
    """A target that does not move."""
    return lambda t: (value, np.zeros(rows))
