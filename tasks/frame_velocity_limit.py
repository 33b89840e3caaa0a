"""A box limit on the velocity of a frame."""

from __future__ import annotations

from typing import Any, ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks._stereographic import Triple
from wbc.tasks.base import Constraint, Input, Row, Rows, SacrificeOrder, Values


@dataclass(frozen=True)
class FrameVelocityLimit(Constraint):
    """The velocity of a frame's origin stays in a box:

        -linear  <= C' J_lin v <= linear      [m/s]
        -angular <= C' J_ang v <= angular     [rad/s]

    C is the rotation of ``axes`` in the world. With ``relative_to`` = r the velocity is that seen from the moving
    frame r: J_lin - J_lin,r - w_r x (p - p_r) in place of J_lin, and J_ang - J_ang,r in place of J_ang.

    Attributes:
        frame: name of the frame.
        linear, angular: initial values of the inputs: one number for all three axes, three numbers, or None for no
            limit. inf in place of a number: this axis has no limit and no row.
        axes: name of the frame whose axes the rows are in.
        relative_to: frame that the velocity is relative to, the robot's or a moving one.

    Inputs:
        linear: one number a limited axis [m/s].
        angular: one number a limited axis [rad/s].

    What it cannot do: limit the norm: along a diagonal the speed may be sqrt(3) times the limit. Other points of the
    body may be faster. A limit that drops suddenly is broken while the joints brake. For a frame that stands still use
    ``Hold``.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.005)
        >>> slow = wbc.tasks.FrameVelocityLimit("panda_hand", linear=0.25, angular=(1.0, 1.0, float("inf")))
        >>> stack.add(slow, name="slow hand")
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to", "axes")

    order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN

    frame: str
    linear: float | Triple | None = None
    angular: float | Triple | None = None
    axes: str = WORLD
    relative_to: str = WORLD

    def __post_init__(self) -> None:
        for name in ("linear", "angular"):
            object.__setattr__(self, name, _box(f"FrameVelocityLimit.{name}", getattr(self, name)))
        if not self._limits():
            raise ShapeError("FrameVelocityLimit", (self.linear, self.angular), "expected a limit, linear or angular")

    def _limits(self) -> list[tuple[str, int, float]]:
        """(input, axis, initial limit) of each row."""
        return [
            (name, axis, limit)
            for name, box in (("linear", self.linear), ("angular", self.angular))
            if isinstance(box, tuple)
            for axis, limit in enumerate(box)
            if limit < np.inf
        ]

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        out = []
        for name, unit in (("linear", "m/s"), ("angular", "rad/s")):
            values = [limit for input_name, _, limit in self._limits() if input_name == name]
            if values:
                out.append(Input(name, unit=unit, size=len(values), default=values, low=0.0, each=True))
        return tuple(out)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        labels = {"linear": ("x", "y", "z"), "angular": ("rx", "ry", "rz")}
        units = {"linear": "m/s", "angular": "rad/s"}
        return tuple(Row(labels[name][axis], units[name]) for name, axis, _ in self._limits())

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        jacobian = kin.frame_jacobian(self.frame)
        if self.relative_to != WORLD:
            base = kin.frame_jacobian(self.relative_to)
            arm = kin.position(self.frame) - kin.position(self.relative_to)
            carried = ca.vertcat(base[:3, :] - ca.skew(arm) @ base[3:, :], base[3:, :])
            jacobian = jacobian - carried
        turn = kin.rotation(self.axes).T
        parts = {"linear": turn @ jacobian[:3, :], "angular": turn @ jacobian[3:, :]}
        matrix = ca.vertcat(*[parts[name][axis, :] for name, axis, _ in self._limits()])
        limit = ca.vertcat(*[inputs[declared.name] for declared in self.inputs(robot)])
        return Rows(matrix, -limit, limit)


def _box(field: str, value: Any) -> Triple | None:
    """Three limits out of None, one number or three."""
    if value is None:
        return None
    numbers = validation.real_array(field, value, finite=False)
    if numbers.shape not in ((), (3,)):
        raise ShapeError(field, value, "expected one number or three")
    if np.isnan(numbers).any():
        raise NotFiniteError(field, value, "NaN is no limit; use inf for none")
    if (numbers < 0).any():
        raise RangeError(field, value, "expected limits >= 0")
    x, y, z = (float(n) for n in np.broadcast_to(numbers, 3))
    return (x, y, z)
