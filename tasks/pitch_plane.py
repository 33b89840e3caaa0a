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

    With points s, e, w of the three frames and u = (w - s) / |w - s|:

    **Three-point form**, ``PitchPlane(shoulder, elbow, wrist, reference=)``: the error [rad] is

        e = wrap(psi - target),    psi = atan2(b(u).(e - s), a(u).(e - s)),    wrap to (-pi, pi],

    where a(u), b(u) are the stereographic reference directions of :class:`wbc.tasks.PlaneReference` (Elias and
    Wen, arXiv:2307.13122). psi counts right-handed about u.

    **Axis form**, ``PitchPlane(shoulder, elbow, wrist, axis=joint)``, for arms whose pitch axes are parallel and
    offset along each other: the plane is perpendicular to the joint's axis y, the line is r = (w - s) - y (y.(w - s)),
    the common normal of the shoulder and wrist pitch axes, and the row is the rate

        alpha = (r / |r|).omega [rad/s],    alpha = feedforward + gain target,

    omega being the angular velocity relative to ``base`` of the body that carries the joint (E. Dupuis, PhD thesis,
    McGill 2001, eqs. 4.5-4.7, 4.38). alpha is not the derivative of any angle, its integral depends on the path;
    so ``feedforward`` [rad/s] commands the rate and ``target`` [rad] (default 0) is counted from where the plane
    is now: error = -target.

    **Axis form with** ``reference=``: the angle of that same plane, e = wrap(psi - target) with the plane direction
    u x y in place of e - s, u = r / |r|. Its exact rate is

        d psi / dt = alpha + p.(u x du/dt) / (1 + p.u),    p the pole,

    so both agree wherever the line keeps its direction, and only this form can be held without drift.

    Singular sets: |w - s| = 0 (axis form: r = 0, pitch axes coaxial); the elbow on the line (three-point form
    only: straight or folded arm); u = -pole (angles only). The row's weight is multiplied by a factor that is 1 outside
    the widths below, falls in a twice differentiable way and is 0 below a tenth of them; a row with a factor
    below 1 is reported as faded.

    It cannot: hold an angle on a singular set; tell psi from psi + 2 pi (no turns are counted); approach a target
    exactly opposite, e = pi, in a defined sense of rotation; act on an arm whose frames move rigidly together.

    Inputs:
        target: psi [rad]; in the axis form without ``reference`` an angle from wherever the plane is now, default 0.
        feedforward: rate of the target, or of the plane [rad/s]. Default 0.

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
