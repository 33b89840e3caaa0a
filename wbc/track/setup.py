"""What is to be done: robot, path, obstacles and commands, and the stack that does it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from wbc import shapes, tasks, validation
from wbc.api import Stack
from wbc.errors import ShapeError, WbcError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.track.path import TimedPath, smooth_step
from wbc.validation import Array

#: Angle 0 of the elbow plane is "elbow up" for an arm that reaches forward: the plane is vertical, the elbow above.
REFERENCE = tasks.PlaneReference(pole=(1.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))

#: What of the hand follows a path
KINDS = ("pose", "position")
#: Weights of the tasks: the plane costs far less than the hand and the posture far less than the plane, so that
#: what cannot all be had is lost in that order.
WEIGHTS = {"hand": 1.0, "plane": 1e-4, "posture": 1e-6}


@dataclass(frozen=True, eq=False)
class MovingObstacle:
    """An obstacle: a shape, at a place at t = 0, with a constant linear velocity [m/s]."""

    shape: shapes.Shape
    pose: pin.SE3
    velocity: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        if not isinstance(self.shape, shapes.Shape):
            raise ShapeError("MovingObstacle.shape", self.shape, "expected a shape of wbc.shapes")
        object.__setattr__(self, "pose", validation.pose("MovingObstacle.pose", self.pose))
        velocity = validation.ordinary_array("MovingObstacle.velocity", self.velocity, (3,))
        object.__setattr__(self, "velocity", velocity)

    def at(self, t: float) -> pin.SE3:
        """Pose at time t [s]."""
        t = validation.scalar("t", t, unit="s")
        return pin.SE3(self.pose.rotation, self.pose.translation + t * self.velocity)


@dataclass(frozen=True)
class ElbowSwing:
    """A commanded angle of the elbow plane:

        psi(t) = psi_0 + amplitude w(t) sin(2 pi cycles t / T),    w the quintic step, up and down in T / 8,

    psi_0 being the angle at the start. Amplitude 0 holds it.
    """

    amplitude: float = 0.5
    cycles: float = 2.0

    def at(self, t: float, duration: float) -> tuple[float, float]:
        """psi - psi_0 [rad] and its rate [rad/s]."""
        ramp = duration / 8.0
        up, up_rate = smooth_step(t, ramp)
        down, down_rate = smooth_step(duration - t, ramp)
        speed = 2.0 * math.pi * self.cycles / duration
        sine, cosine = math.sin(speed * t), math.cos(speed * t)
        window, rate = up * down, up_rate * down - up * down_rate
        return self.amplitude * window * sine, self.amplitude * (rate * sine + window * speed * cosine)


@dataclass(frozen=True, eq=False)
class PathRun:
    """A run before it is done.

    Attributes:
        robot: the robot.
        frame: the frame that follows the path.
        path: where to.
        label: name of the path, for titles and the log.
        start: first configuration; the robot is at rest there.
        dt: time between commands [s].
        obstacles: name -> obstacle; every link with shapes keeps clear of it by ``margin`` [m].
        margin: see ``obstacles``.
        approach: rate of the obstacles' rows [1/s]; a lower one brakes earlier. Cut to what ``dt`` allows.
        plane: command of the elbow plane, or None for none.
        holds: frames that must not move (the feet of a humanoid).
        gain: of the hand [1/s]. kind: "pose", or "position" for a hand that may turn as it likes.
        solver, backend: see :meth:`wbc.Stack.compile`.
    """

    robot: Robot
    frame: str
    path: TimedPath
    label: str
    start: Array
    dt: float = 0.005
    obstacles: dict[str, MovingObstacle] = field(default_factory=dict)
    margin: float = 0.02
    approach: float = 10.0
    plane: ElbowSwing | None = None
    holds: tuple[str, ...] = ()
    gain: float = 10.0
    kind: Literal["pose", "position"] = "pose"
    solver: str = "daqp"
    backend: str = "auto"

    def __post_init__(self) -> None:
        checked_robot(self.robot).check_frame("frame", self.frame)
        if not callable(getattr(self.path, "sample", None)) or not hasattr(self.path, "duration"):
            raise ShapeError("path", self.path, "expected a path: duration, and sample(t)")
        for name, one in validation.mapping("obstacles", self.obstacles, "names to Movings").items():
            validation.instance(f"obstacles[{name}]", one, MovingObstacle, "a MovingObstacle")
        if self.plane is not None:
            validation.instance("plane", self.plane, ElbowSwing, "a ElbowSwing")
        for frame in validation.items("holds", self.holds, "frames"):
            self.robot.check_frame("holds", frame)
        object.__setattr__(self, "label", validation.name("label", self.label))
        validation.one_of("kind", self.kind, KINDS)
        validation.scalar("dt", self.dt, low=0.0, open_low=True, unit="s")
        validation.scalar("margin", self.margin, low=0.0, unit="m")
        validation.scalar("approach", self.approach, low=0.0, open_low=True, unit="1/s")
        object.__setattr__(self, "start", self.robot.configuration("start", self.start))

    @property
    def ticks(self) -> int:
        """Commands in the whole run."""
        return max(1, math.ceil(self.path.duration / self.dt - 1e-9))

    def stack(self) -> Stack:
        """The stack of the run.

        Raises:
            WbcError: something does not fit the robot (no link shapes, no frames of an elbow plane).
        """
        robot = self.robot
        stack = Stack(robot, dt=self.dt)
        hand = tasks.EndEffector(self.frame, kind=self.kind, gain=self.gain)
        stack.add(hand, name="hand", weight=WEIGHTS["hand"])
        if self.plane is not None:
            stack.add(plane_task(robot), name="plane", weight=WEIGHTS["plane"])
        stack.add(tasks.Posture(), name="posture", weight=WEIGHTS["posture"])
        stack.add(tasks.JointLimits(), name="limits")
        for frame in self.holds:
            stack.add(tasks.Hold(frame), name=f"hold {frame}")
        for name, obstacle in self.obstacles.items():
            stack.add(tasks.Obstacle(obstacle.shape, margin=self.margin, pose=obstacle.pose), name=name)
        return stack


def plane_task(robot: Robot) -> tasks.PitchPlane:
    """The elbow plane of a robot whose table knows shoulder, elbow and wrist.

    Raises:
        WbcError: it does not know them.
    """
    roles = [robot.frames.get(role) for role in ("shoulder", "elbow", "wrist")]
    if None in roles:
        raise WbcError("plane", robot.name, "the table knows no shoulder, elbow and wrist of this robot", ("off",))
    shoulder, elbow, wrist = (str(role) for role in roles)
    return tasks.PitchPlane(shoulder, elbow, wrist, reference=REFERENCE, gain=5.0)
