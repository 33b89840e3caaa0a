"""What a program moves: hands by their items of the stack, and grippers."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from wbc import validation
from wbc.api import Controller
from wbc.multibody import pin
from wbc.tasks import EndEffector
from wbc.trajectory import online
from wbc.validation import Array

#: Accelerations along each axis [m/s^2, rad/s^2]
ACCELERATION = (1.0, 5.0)
#: Jerks along each axis [m/s^3, rad/s^3]
JERK = (20.0, 100.0)
#: Share of the speed that an axis has along which a straight motion from rest does not lead, so that it is not used
ACROSS = 1e-3
#: The same where the motion begins from another motion: it takes the hand back to the line
ACROSS_MOVING = 0.3
#: Angle after which a drift takes the orientation of the moment for R_0 [rad]
FARTHEST = 2.0
#: Step of a difference along x [s]
_SMALL = 1e-6


class HandReference:
    """A pose (R, p) in a reference frame b and its twist there:

        p = x_1..3,   R = R_0 exp(x_4..6),   omega = R_0 Jl(x_4..6) dx_4..6 / dt

    x follows its aims with bounded velocity, acceleration and jerk. Every aim takes the orientation of the moment as
    R_0, so that x_4..6 stays below pi.

    Attributes:
        pose: in b. twist: (linear; angular) along the axes of b [m/s, rad/s].
    """

    def __init__(self, pose: pin.SE3, dt: float) -> None:
        self.pose, self.twist = pose.copy(), np.zeros(6)
        self._change, self._anchor = np.zeros(6), pose.rotation.copy()
        self._drift: tuple[Array, tuple[float, float]] | None = None
        self._fresh = False
        acceleration, jerk = (np.repeat(pair, 3) for pair in (ACCELERATION, JERK))
        self._filter = online(6, dt, velocity=1.0, acceleration=acceleration, jerk=jerk, synchronisation="phase")
        self._limit = acceleration
        self._filter.reset(np.append(pose.translation, np.zeros(3)))

    @property
    def arrived(self) -> bool:
        """Whether the last aim is reached."""
        return not self._fresh and self._filter.status == "reached"

    def aim(self, pose: pin.SE3, speed: tuple[float, float]) -> None:
        """Go straight to a pose; speed: along the line and about the axis [m/s, rad/s]."""
        change = np.append(pose.translation - self.pose.translation, pin.log3(self.pose.rotation.T @ pose.rotation))
        least = ACROSS_MOVING if self.twist.any() else ACROSS
        self._begin(np.concatenate([_along(change[:3], speed[0], least), _along(change[3:], speed[1], least)]))
        self._filter.target(np.append(pose.translation, change[3:]))

    def drift(self, twist: Any, speed: tuple[float, float]) -> None:
        """Go on with a twist (linear; angular) along the axes of b, scaled where it is faster than ``speed``."""
        rate = np.array(twist, dtype=np.float64)
        if self._drift is not None and self._drift[1] == speed and np.array_equal(self._drift[0], rate):
            return
        self._begin(np.repeat(speed, 3))
        self._drift = rate.copy(), speed
        sizes = float(np.linalg.norm(rate[:3])), float(np.linalg.norm(rate[3:]))
        rate *= min(fastest / max(size, fastest) for fastest, size in zip(speed, sizes, strict=True))
        self._filter.target_velocity(np.append(rate[:3], self.pose.rotation.T @ rate[3:]))

    def stop(self) -> None:
        """Come to rest as soon as the limits allow."""
        self._drift = None
        self._filter.stop()

    def tick(self) -> None:
        """Pose and twist one period later."""
        self._fresh = False
        x, rate, change = self._filter.step()
        rates = self._rates(x[3:])
        bent = (self._rates(x[3:] + _SMALL * rate[3:]) - rates) / _SMALL @ rate[3:]
        self.pose = pin.SE3(self._anchor @ pin.exp3(x[3:]), x[:3])
        self.twist = np.append(rate[:3], rates @ rate[3:])
        self._change = np.append(change[:3], rates @ change[3:] + bent)
        if self._drift is not None and x[3:] @ x[3:] > FARTHEST**2:
            (twist, speed), self._drift = self._drift, None
            self.drift(twist, speed)

    def _rates(self, x: Array) -> Array:
        """omega of dx/dt."""
        out: Array = self._anchor @ pin.exp3(x) @ pin.Jexp3(x)
        return out

    def _begin(self, fastest: Array) -> None:
        """Take the orientation of the moment for R_0, and limits of the velocity."""
        turn = self.pose.rotation.T
        rate = np.append(self.twist[:3], turn @ self.twist[3:])
        change = np.append(self._change[:3], turn @ self._change[3:])
        self._filter.limits(velocity=np.maximum(fastest, np.abs(rate)))
        self._anchor = self.pose.rotation.copy()
        state = np.append(self.pose.translation, np.zeros(3))
        self._filter.reset(state, rate, np.clip(change, -self._limit, self._limit))
        self._filter.limits(velocity=fastest)
        self._drift, self._fresh = None, True


def _along(change: Array, speed: float, least: float) -> Array:
    """Limits of the velocities along three axes that sum up to a speed along a line."""
    length = float(np.linalg.norm(change))
    if length == 0.0:
        return np.full(3, speed)
    return np.maximum(np.abs(change) / length, least) * speed


class Gripper(Protocol):
    """What a program needs of a gripper."""

    @property
    def state(self) -> str:
        """``"open"``, ``"closed"`` around something, or anything else while it is neither."""

    def close(self) -> None:
        """Begin to close."""

    def open(self) -> None:
        """Begin to open."""


class ProgramHand:
    """A hand of a program: its item, the pose that it is told to follow, and an operator's twist.

    Attributes:
        target: what the controller is told for this tick. order: last twist of an operator (linear; angular).
        ordered: when it came [s].
    """

    def __init__(self, controller: Controller, name: str, dt: float) -> None:
        entry = controller.stack[name]
        item = validation.instance(f"hand {name!r}", entry.item, EndEffector, "an EndEffector")
        self._item, self._handle, self._robot, self._dt = item, controller[name], controller.stack.robot, dt
        self._frame = controller[entry.frame] if entry.frame else None
        self.reference, self.target = HandReference(pin.SE3.Identity(), dt), pin.SE3.Identity()
        self.order, self.ordered, self._q = np.zeros(6), -np.inf, np.zeros(0)

    def start(self, q: Array) -> None:
        """Stand where the hand is."""
        self._q = q
        self.reference = HandReference(self.pose(), self._dt)

    def look(self, q: Array) -> None:
        """Remember a measured configuration."""
        self._q = q

    def pose(self) -> pin.SE3:
        """Of the hand in its reference frame, measured; a moving one stands where the controller was told last."""
        item = self._item
        pose = self._robot.pose(self._q, item.frame, item.relative_to)
        if self._frame is not None:
            pose = pin.SE3(self._frame.pose).actInv(pose)
        # What the item does not command stands still
        if item.kind == "position":
            pose.rotation = np.eye(3)
        elif item.kind == "orientation":
            pose.translation = np.zeros(3)
        return pose

    def off(self, goal: pin.SE3) -> tuple[float, float]:
        """Distance [m] and angle [rad] from a pose, of what the item commands."""
        here = self.pose()
        distance = float(np.linalg.norm(goal.translation - here.translation))
        angle = float(np.linalg.norm(pin.log3(goal.rotation.T @ here.rotation)))
        return distance * (self._item.kind != "orientation"), angle * (self._item.kind != "position")

    def write(self) -> None:
        """Where the hand is to be now, into the controller, and its mean twist over the tick that begins."""
        pose, before = self.reference.pose, self.reference.twist
        self.reference.tick()
        self.target, twist = pose, 0.5 * (before + self.reference.twist)
        if self._item.kind == "pose":
            self._handle.target, self._handle.feedforward = pose, twist
        elif self._item.kind == "position":
            self._handle.target, self._handle.feedforward = pose.translation, twist[:3]
        else:
            self._handle.target, self._handle.feedforward = pose.rotation, twist[3:]
