"""The stack of a walking body: held hands exactly, the body's pose, the swinging hand, wrists and joint limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wbc import tasks
from wbc.controller.controller import Controller
from wbc.controller.stack import Stack
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.structure import Structure

#: Control period [s]
DT = 0.01
#: Weights: the body does not give way to a swing, a swing not to postures
BODY, SWING, AXIS, WRIST = 1e4, 10.0, 3.0, 1e-3
#: Gains [1/s] of body, swinging hand, its axis and the wrists; holds: 1 / (5 dt)
BODY_GAIN, SWING_GAIN, AXIS_GAIN, WRIST_GAIN, HOLD_TICKS = 12.0, 15.0, 12.0, 12.0, 5
#: On the way the wrist follows its postures; near the next hold its axis counts
FREE_AXIS, FREE_WRIST, RESTING = 1e-6, 40.0, 0.1


#: Of joints 4 and 5
Pair = tuple[float, float]


class WalkStack:
    """A compiled stack with items for each arm that holds and for each that swings; the state of the hand switches.

    Args:
        collisions: keep the links clear of each other (compiles longer and costs time in every tick).
        backend: as of ``Stack.compile``.
    """

    def __init__(
        self, walker: Walker, structure: Structure, dt: float = DT, *, collisions: bool = True, backend: str = "auto"
    ) -> None:
        self.walker, self.structure, self.dt = walker, structure, dt
        stack = Stack(walker.robot, dt=dt, calm=False)
        stack.add(tasks.EndEffector("body"), name="body", weight=BODY)
        for arm in walker.arms:
            stack.add(tasks.Hold(arm.hand, kind="axis", gain=1.0 / (HOLD_TICKS * dt)), name=f"{arm.name} hold")
            stack.add(tasks.EndEffector(arm.hand, kind="position"), name=f"{arm.name} swing", weight=SWING)
            stack.add(tasks.AxisAlign(arm.hand), name=f"{arm.name} axis", weight=AXIS)
        stack.add(tasks.Posture(), name="posture", weight=WRIST)
        stack.add(tasks.JointLimits(), name="limits")
        if collisions:
            margin = walker.data.clearance  # type: ignore[union-attr]
            stack.add(tasks.SelfCollision(margin=margin), name="links")
        self.stack = stack
        self.controller: Controller = stack.compile(backend=backend)
        self._posture = np.array(walker.robot.neutral)
        self._mask = np.full(walker.robot.nv - 6, RESTING)
        self._turning = np.zeros(walker.robot.nv)
        self._near = (-1, False)
        items: Any = self.controller
        self._body, self._rest = items["body"], items["posture"]
        self._holds, self._swings, self._axes = (
            [items[f"{arm.name} {kind}"] for arm in walker.arms] for kind in ("hold", "swing", "axis")
        )
        self._body.gain, self._rest.gain = BODY_GAIN, WRIST_GAIN
        for swing, axis in zip(self._swings, self._axes, strict=True):
            swing.gain, axis.gain = SWING_GAIN, AXIS_GAIN

    def hold(self, arm: int, hold: int) -> None:
        """A closed hand: its hold is exact, nothing else is asked of it."""
        self._switch(arm, True)
        self._holds[arm].target = pin.SE3(self.structure.frames[hold])
        self._mask[self._joints(arm)] = RESTING
        self._still(arm)
        self._rest.mask = self._mask

    def release(self, arm: int) -> None:
        """An open hand, which follows aims."""
        self._switch(arm, False)
        self._near = (-1, False)

    def rest(self, arm: int, place: Array, axis: Array) -> None:
        """A free hand that stays where it is."""
        swing, aligned = self._swings[arm], self._axes[arm]
        swing.target, swing.feedforward = place, np.zeros(3)
        aligned.target, aligned.feedforward, aligned.weight = axis, np.zeros(3), AXIS
        self._near = (-1, False)
        self._still(arm)

    def body(self, pose: pin.SE3, rate: Array) -> None:
        """The pose that the body goes to, and its rate in the structure's axes [m/s, rad/s]."""
        self._body.target, self._body.feedforward = pose, rate

    def swing(self, arm: int, hand: tuple[Array, Array], wrist: tuple[Pair, Pair], axis: Array | None) -> None:
        """What a free hand follows.

        Args:
            hand: its position [m] and velocity [m/s]. wrist: joints 4 and 5 [rad] and their rates [rad/s].
            axis: that of the hand at its hold, which then counts and not the wrist; None on the way.
        """
        near, resting = axis is not None, self._rest
        swing, aligned = self._swings[arm], self._axes[arm]
        swing.target, swing.feedforward = hand
        if axis is not None:
            aligned.target, aligned.feedforward = axis, np.zeros(3)
        joints = self._joints(arm)
        if self._near != (arm, near):
            aligned.weight = AXIS if near else FREE_AXIS
            self._mask[joints][:3] = 0.0
            self._mask[joints][3:5] = 1.0 if near else FREE_WRIST
            resting.mask = self._mask
            self._near = arm, near
        self._posture[7:][joints][3:5], self._turning[6:][joints][3:5] = wrist
        resting.target, resting.feedforward = self._posture, self._turning

    def _still(self, arm: int) -> None:
        """Joints 4 and 5 of an arm that does not swing have no rates of their own."""
        self._turning[6:][self._joints(arm)] = 0.0
        self._rest.feedforward = self._turning

    def _joints(self, arm: int) -> slice:
        of = self.walker.arms[arm].v
        return slice(of.start - 6, of.stop - 6)

    def _switch(self, arm: int, held: bool) -> None:
        self._holds[arm].enabled = held
        self._swings[arm].enabled = self._axes[arm].enabled = not held
