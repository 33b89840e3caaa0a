"""Joints stay near a configuration."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import DuplicateNameError, ShapeError
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import checked_weights

STARTS = ("first", "neutral")


@dataclass(frozen=True)
class Posture(Task):
    """The chosen joints follow a configuration, on the manifold:

        e = S (q (-) target)              [rad or m, as each degree of freedom]

    where target (+) e = q along the shortest way and S picks the degrees of freedom of the chosen joints. For a
    revolute or prismatic joint that is q - target; for an unbounded joint the angle in (-pi, pi]; for a
    floating base the logarithm of the relative pose (linear; angular, in base axes).

    Attributes:
        joints: names of joints, in the order of the rows; None: every joint but a moving base.
        weights: one number >= 0 a row, None: 1 each.
        start: the target until one is set: ``"first"``, the configuration of the first step, or ``"neutral"``, the
            robot's own.

    Inputs:
        target: a configuration, nq numbers, or those of the chosen joints alone, in their order.
            Default: see ``start``.
        feedforward: velocity of the target in its tangent space, nv numbers, or those of the chosen joints
            [rad/s, m/s]. Default 0.

    What it cannot do: know limits (``JointLimits`` stops the joint there), or count turns. With a weight it shifts the
    other tasks by about its weight over theirs; at a later level it does not.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(wbc.tasks.Posture(start="neutral"), name="posture", weight=1e-3)
        >>> stack.add(wbc.tasks.Posture(("panda_joint1", "panda_joint3"), weights=(1, 0.2)), name="front", weight=1e-3)

    Raises:
        UnknownNameError, DuplicateNameError, ShapeError, NotFiniteError, RangeError: on construction or in
            :meth:`validate`.
    """

    stands_in_world: ClassVar[bool] = False

    joints: tuple[str, ...] | None = None
    weights: tuple[float, ...] | None = None
    start: Literal["first", "neutral"] = "first"

    def __post_init__(self) -> None:
        validation.one_of("Posture.start", self.start, STARTS)
        joints: Any = self.joints
        if joints is not None:
            object.__setattr__(self, "joints", validation.items("Posture.joints", joints, "joint names"))
        object.__setattr__(self, "weights", checked_weights("Posture.weights", self.weights))

    def validate(self, robot: Robot) -> None:
        names = self._names(robot)
        for name in names:
            robot.dofs(name, "Posture.joints")
        if len(set(names)) != len(names):
            raise DuplicateNameError("Posture.joints", names, "a joint is named twice")
        count = len(self._dofs(robot))
        if count == 0:
            raise ShapeError("Posture.joints", names, "no joint is left to hold")
        checked_weights("Posture.weights", self.weights, count)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        default = robot.neutral.copy() if self.start == "neutral" else None
        return (
            Input("target", "configuration", unit="rad, m", default=default, rate="feedforward", joints=self.joints),
            Input("feedforward", "tangent", unit="rad/s, m/s", default=np.zeros(robot.nv), joints=self.joints),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(robot.dof_names[k], robot.dof_units[k]) for k in self._dofs(robot))

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        return {"target": np.array(q, dtype=np.float64)}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return kin.kinematics.difference(inputs["target"], kin.q, self._dofs(robot))

    def _names(self, robot: Robot) -> tuple[str, ...]:
        if self.joints is not None:
            return self.joints
        return robot.joint_names if robot.base == "fixed" else robot.joint_names[1:]

    def _dofs(self, robot: Robot) -> list[int]:
        return [k for name in self._names(robot) for k in range(*robot.dofs(name).indices(robot.nv))]
