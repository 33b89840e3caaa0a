"""PitchPlane: the angle, or the rate, of an arm's plane about its shoulder-wrist line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._plane import PlaneItem
from wbc.tasks.base import Input, Row, Task, Values


@dataclass(frozen=True)
class PitchPlane(PlaneItem, Task):
    """The plane of shoulder, elbow and wrist turns about the shoulder-wrist line to an angle, or at a rate. One row:

        e = wrap(psi - target)                 the angle psi of three points, or of the plane across an axis    [rad]
        alpha = feedforward + gain target      the rate alpha of the plane across an axis                       [rad/s]

    s, e, w are the points of the three frames, u = (w - s) / |w - s|, and wrap is to (-pi, pi].

    **Three-point form**, ``PitchPlane(shoulder, elbow, wrist, reference=)``: psi = atan2(b(u).(e - s), a(u).(e - s)),
    right-handed about u, with the stereographic directions a(u), b(u) of :class:`wbc.tasks.PlaneReference` (Elias and
    Wen, arXiv:2307.13122).

    **Axis form**, ``PitchPlane(shoulder, elbow, wrist, axis=joint)``, for arms whose pitch axes are parallel and
    offset: the plane is perpendicular to the joint's axis y, the line is r = (w - s) - y (y.(w - s)), and alpha = (r /
    |r|).omega is the rate of the body that carries the joint, relative to ``base`` (E. Dupuis, PhD thesis, McGill 2001,
    eqs. 4.5-4.7, 4.38). alpha is not the derivative of any angle and drifts; ``target`` is counted from where the plane
    is now. **With** ``reference=`` the row is the angle of the same plane, with u x y in place of e - s, and can be
    held.

    Rows fade, and are reported as faded, near |w - s| = 0 (axis form: r = 0), where the elbow is on the line
    (three-point form), and near u = -pole (angles): from the widths below to a tenth of them.

    Attributes:
        shoulder, elbow, wrist: frames whose origins (plus offsets) are s, e, w. In the axis form the elbow only
            measures the arm's length |e - s| + |w - e|.
        reference: where psi is 0; None is ``PlaneReference()`` in the three-point form and the rate in the axis form.
        axis: name of the revolute joint whose axis is normal to the plane; None for the three-point form.
        base: frame in whose axes ``reference`` is given and relative to which rates count.
        shoulder_offset, elbow_offset, wrist_offset: points in the axes of their frames [m].
        line_width: |w - s| (axis form |r|) at which fading begins, as a part of the arm's length.
        elbow_width: distance of the elbow from the line at which fading begins, as a part of the arm's length.
        reference_width: angle between u and -pole at which fading begins [rad].

    Inputs:
        target: psi [rad]; in the axis form without ``reference`` an angle from wherever the plane is now, default 0.
        feedforward: rate of the target, or of the plane [rad/s]. Default 0.

    What it cannot do: hold an angle on a singular set, count turns, or control the line itself (a hand task does). With
    alpha as the seventh row of a seven-joint arm some states are singular although the hand's Jacobian is not. On a
    Panda the origin of ``panda_link4`` crosses the line at q4 = -0.467 rad, where the three-point plane flips; take
    ``panda_link3`` or ``axis="panda_joint4"``.

    Example:
        >>> import wbc
        >>> from wbc.tasks import EndEffector, PitchPlane, PlaneReference
        >>> robot = wbc.robots.load("panda")
        >>> arm = "panda_link2", "panda_link3", "panda_link6"
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(PitchPlane(*arm), name="plane", weight=0.1)  # angle of three points
        >>> stack.add(PitchPlane(*arm, axis="panda_joint4"), name="rate", weight=0)  # rate of turning
        >>> reference = PlaneReference(pole=(1, 0, 0), direction=(0, 0, 1))  # 0 is "elbow up"
        >>> angle = PitchPlane(*arm, axis="panda_joint4", reference=reference)  # angle of that plane
        >>> stack.add(angle, name="angle", weight=0)
        >>> controller = stack.compile(backend="vm")
        >>> controller["plane"].target = 0.3

    Raises:
        UnknownNameError, RangeError, ShapeError, NotFiniteError: a bad field.
    """

    @property
    def commands_rate(self) -> bool:
        """True for the axis form without a reference, whose row is alpha."""
        return self.axis is not None and self.reference is None

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        default = 0.0 if self.commands_rate else None
        return (
            Input("target", unit="rad", default=default, rate="feedforward"),
            Input("feedforward", unit="rad/s", default=0.0),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("plane", "rad"),)

    def initial(self, robot: Robot, q: np.ndarray) -> dict[str, Any]:
        return {} if self.commands_rate else {"target": self.angle(robot, q)}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        if self.commands_rate:
            return ca.SX(-inputs["target"])
        return self._turned(kin, inputs["target"])

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        return self._rate_row(kin) if self.commands_rate else None

    def row_factor(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return self._fading(kin, with_reference=not self.commands_rate)
