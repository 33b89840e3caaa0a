"""What a program moves: hands by their items of the stack, and grippers."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.api import Controller
from wbc.program.reference import HandReference
from wbc.tasks import EndEffector
from wbc.tasks.frames import frame_pose
from wbc.validation import Array


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
        item, base = self._item, frame_pose(self._robot, self._item.relative_to, self._q)
        pose = base.actInv(frame_pose(self._robot, item.frame, self._q))
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
