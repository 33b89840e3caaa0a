"""A walk's rates, followed by torques on a robot with masses."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import tasks, validation
from wbc.controller.controller import Controller
from wbc.controller.stack import Stack
from wbc.errors import RangeError, ShapeError
from wbc.robots import HoldRating, Walker, hold_rating
from wbc.simulation import Command, CommandKind, GripKind, GrippingPlant, Plant, PlantState
from wbc.validation import Array
from wbc.walking.torque.grasps import GRASPS

#: Period of the torques [s]
PERIOD = 0.001
#: Weights: the body's pose counts most, as the walk's does
BODY = 100.0
#: How fast errors of the reference decay [1/s], twice; how fast the reference comes to where the robot is [1/s]
BANDWIDTH, LEAK = 40.0, 2.0
#: How fast the drift of closed hands decays [1/s]
GRIP_GAIN = 20.0


@dataclass(frozen=True)
class Gains:
    """Of the loop.

    Attributes:
        bandwidth: omega of  a = da_ref + 2 omega (v_ref - v) + omega^2 (q_ref - q)  [1/s].
        leak: how fast q_ref comes to q, so that it does not wander where closed chains let nothing move [1/s].
        grip: how fast the drift of closed hands decays [1/s].
    """

    bandwidth: float = BANDWIDTH
    leak: float = LEAK
    grip: float = GRIP_GAIN


class TorqueStack:
    """The compiled stack: all coordinates follow a reference, closed hands bear wrenches within their rating.

    Args:
        walker: with masses, as :func:`wbc.robots.with_masses` gives it; its torque limits.
        kinds: how holds may be held. rating: of every hold. backend: as of ``Stack.compile``.

    Raises:
        RangeError: a robot without masses or limits of torque.
    """

    def __init__(
        self,
        walker: Walker,
        kinds: Iterable[GripKind],
        *,
        rating: HoldRating | None = None,
        period: float = PERIOD,
        backend: str = "auto",
    ) -> None:
        robot, rating = walker.robot, rating or hold_rating()
        if min(float(i.mass) for i in robot.model.inertias[1:]) <= 0.0:
            raise RangeError("walker", robot.name, "torques need masses: wbc.robots.with_masses(walker)")
        self.walker, self.kinds, self.rating = walker, tuple(dict.fromkeys(kinds)), rating
        stack = Stack(robot, dt=period, calm=False)
        weights = np.where(np.arange(robot.nv) < robot.base_nv, BODY, 1.0)
        follow = tasks.Posture(joints=robot.joint_names, weights=tuple(weights.tolist()))
        stack.add(follow, name="reference")
        stack.add(tasks.JointLimits(), name="limits").add(tasks.TorqueLimits(), name="torques")
        for arm in walker.arms:
            for kind in self.kinds:
                torque = None if kind is GripKind.POSITION else rating.torque
                stack.add(GRASPS[kind](arm.hand, force=rating.force, torque=torque), name=f"{arm.hand} {kind}")
        self.controller: Controller = stack.compile(command="torque", backend=backend)


class TorqueLoop:
    """A plant that takes the velocities of a walk, and drives one that takes torques.

        plant = PinocchioPlant(walker.robot)                       # walker = wbc.robots.with_masses(wbc.robots.walker())
        Walk(walker, structure, plan, plant=TorqueLoop(TorqueStack(walker, [GripKind.AXIS]), plant))

    Within a period of the walk the reference goes from the last velocity to the new one in a straight line; q_ref is its
    integral. Every millisecond the stack finds torques for da_ref + 2 omega (v_ref - v) + omega^2 (q_ref - q) and for
    what the closed hands bear. Nothing of the walk, its planner or its stack is changed.

    Args:
        stack: compiled. plant: takes torques, and grasps. gains: of the reference.

    Attributes:
        step: of the last torques.
        slip: farthest that a closed hand has been from its hold [m]. peak: largest components of wrenches that the plant
            had, as parts of the rating; of plants that have wrenches.

    Raises:
        ShapeError: a plant that takes no torques, or grasps nothing.
    """

    commands: Collection[CommandKind] = (CommandKind.VELOCITY,)

    def __init__(self, stack: TorqueStack, plant: Plant, gains: Gains | None = None) -> None:
        if CommandKind.TORQUE not in plant.commands:
            raise ShapeError("plant", type(plant).__name__, "expected a plant that takes torques")
        if not isinstance(plant, GrippingPlant):
            raise ShapeError("plant", type(plant).__name__, "expected a plant that can grasp")
        self.stack, self.plant, self.grips = stack, plant, plant
        self.nq, self.nv = plant.nq, plant.nv
        self.time_step = stack.controller.stack.dt
        items: Any = stack.controller
        self._model, self._reference = stack.walker.robot.model, items["reference"]
        self._items = {(arm.hand, kind): items[f"{arm.hand} {kind}"] for arm in stack.walker.arms for kind in stack.kinds}
        self._gains = gains or Gains()
        self._command = Command(CommandKind.TORQUE, np.zeros(self.nv))
        self._closed: dict[str, GripKind] = {}

    def reset(self, q: Array, time: float) -> None:
        """At rest, nothing grasped."""
        self.plant.reset(q, time)
        gains, controller = self._gains, self.stack.controller
        controller.reset(q)
        self._reference.set(stiffness=gains.bandwidth**2, damping=2.0 * gains.bandwidth)
        for item in self._items.values():
            item.enabled, item.gain = False, gains.grip
        self._closed = {}
        self._q = np.array(q)
        self._v, self._next = np.zeros((2, self.nv))

    def read(self) -> PlantState:
        """The plant's."""
        return self.plant.read()

    def apply(self, command: Command) -> None:
        """Take velocities, for the next period."""
        self._next = validation.real_array("command.values", command.values, (self.nv,))

    def grasp(self, frame: str, pose: pin.SE3, kind: GripKind) -> None:
        """The plant's hand closes, and the stack counts on it."""
        kind = GripKind(validation.one_of("kind", str(kind), [str(k) for k in self.stack.kinds]))
        self.grips.grasp(frame, pose, kind)
        item = self._items[frame, kind]
        item.target, item.enabled = pose, True
        self._closed[frame] = kind

    def release(self, frame: str) -> None:
        """The plant's hand opens, and the stack does without it."""
        self._items[frame, self._closed.pop(frame)].enabled = False
        self.grips.release(frame)

    def advance(self, dt: float) -> None:
        """A period of the walk: as many of torques as go into it."""
        count = max(round(dt / self.time_step), 1)
        ramp = (self._next - self._v) / count
        acceleration = ramp / self.time_step
        plant, reference, command, controller = self.plant, self._reference, self._command, self.stack.controller
        reference.acceleration = acceleration
        for _ in range(count):
            state = plant.read()
            reference.target, reference.feedforward = self._q, self._v
            self.step = controller.step(state.q, state.v)
            command.values[:] = self.step.torque
            plant.apply(command)
            plant.advance(self.time_step)
            ahead = self._v + 0.5 * ramp
            self._q = pin.integrate(self._model, self._q, ahead * self.time_step)
            self._v = self._v + ramp
        off = pin.difference(self._model, self._q, plant.read().q)
        self._q = pin.integrate(self._model, self._q, min(self._gains.leak * dt, 1.0) * off)
