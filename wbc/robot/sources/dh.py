"""Robots from Denavit-Hartenberg rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, DuplicateNameError, RangeError, ShapeError
from wbc.multibody import own, pin, to_pin
from wbc.quick_dataclasses import dataclass
from wbc.robot.sources.description import Description, with_base

CONVENTIONS = ("standard", "modified")
JOINTS = ("revolute", "prismatic")


@dataclass(frozen=True)
class DHRow:
    """One joint and the four numbers of its link.

    ``standard`` (Denavit and Hartenberg 1955; Siciliano et al., Robotics, eq. 2.52):
        T = Rz(theta) Tz(d) Tx(a) Rx(alpha)
    ``modified`` (Craig, Introduction to Robotics, eq. 3.6; a and alpha are those of the link before):
        T = Rx(alpha) Tx(a) Rz(theta) Tz(d)
    The joint's coordinate q is added to ``theta`` (revolute) or to ``d`` (prismatic).

    Attributes:
        a, d: [m].
        alpha, theta: [rad].
        joint: ``revolute`` or ``prismatic``.
        convention: ``standard`` or ``modified``.
        lower, upper: limits of q [rad or m]; infinite for none.
        velocity, acceleration, effort: largest magnitudes, SI; infinite for none.
        name: of the joint; default ``joint1``, ``joint2``, ...

    Raises:
        UnknownNameError, NotFiniteError, RangeError, BoundsError: numbers that make no row.
    """

    a: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    joint: str = "revolute"
    convention: str = "standard"
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    acceleration: float = np.inf
    effort: float = np.inf
    name: str = ""

    def __post_init__(self) -> None:
        validation.own_scalars(self, "a", "alpha", "d", "theta")
        if not isinstance(self.name, str) or self.name:
            validation.name("DHRow.name", self.name)
        validation.one_of("DHRow.joint", self.joint, JOINTS)
        validation.one_of("DHRow.convention", self.convention, CONVENTIONS)
        for key in ("lower", "upper", "velocity", "acceleration", "effort"):
            value = float(validation.real_array(f"DHRow.{key}", getattr(self, key), (), finite=False))
            if np.isnan(value) or (key not in ("lower", "upper") and value < 0):
                raise RangeError(f"DHRow.{key}", value, "expected a number >= 0" if value < 0 else "NaN is no limit")
            object.__setattr__(self, key, value)
        if self.lower > self.upper:
            raise BoundsError("DHRow.lower", self.lower, f"above upper = {self.upper}")

    def before(self) -> pin.SE3:
        """The fixed part of T before the joint."""
        return to_pin(self.parts()[0])

    def after(self) -> pin.SE3:
        """The fixed part of T after the joint. (Rz and Tz commute, so the joint may stand between them.)"""
        return to_pin(self.parts()[1])

    def parts(self) -> tuple[own.SE3, own.SE3]:
        """:meth:`before` and :meth:`after` as this package's own poses."""
        turn = _turn_z(self.theta)
        if self.convention == "standard":
            return turn, _shift(0.0, self.d) * _shift(self.a, 0.0) * _turn_x(self.alpha)
        return _turn_x(self.alpha) * _shift(self.a, 0.0) * turn * _shift(0.0, self.d), own.SE3.Identity()


def read_dh(rows: Sequence[DHRow], base: str | None = None, tool: Any = None) -> Description:
    """A serial chain: frames ``link1`` ... are the Denavit-Hartenberg frames, ``tip`` is the last one times ``tool``.

    It has no masses, so it serves kinematics only.

    Raises:
        ShapeError: no rows, or something that is no :class:`DHRow`.
        DuplicateNameError: two joints of one name.
    """
    rows = validation.items("rows", rows, "DHRow")
    if not rows or not all(isinstance(row, DHRow) for row in rows):
        raise ShapeError("rows", rows, "expected a non-empty sequence of DHRow")
    model = own.Model()
    model.name = "dh_chain"
    model.addFrame(own.Frame("link0", 0, 0, own.SE3.Identity(), own.FrameType.BODY))
    parent, tail, acceleration = 0, own.SE3.Identity(), {}
    frame = model.getFrameId("link0")
    for number, row in enumerate(rows, start=1):
        name = row.name or f"joint{number}"
        if model.existJointName(name):
            raise DuplicateNameError("rows", name, "two joints of this name")
        kind = own.JointModelRZ() if row.joint == "revolute" else own.JointModelPZ()
        limits = [np.array([x]) for x in (row.effort, row.velocity, row.lower, row.upper)]
        before, after = row.parts()
        parent = model.addJoint(parent, kind, tail * before, name, *limits)
        joint_frame = model.addJointFrame(parent, frame)
        tail = after
        frame = model.addFrame(own.Frame(f"link{number}", parent, joint_frame, tail, own.FrameType.BODY))
        if np.isfinite(row.acceleration):
            acceleration[name] = row.acceleration
    end = tail if tool is None else tail * validation.own_pose("tool", tool)
    model.addFrame(own.Frame("tip", parent, frame, end, own.FrameType.OP_FRAME))
    whole, kind_of_base = with_base(model, base)
    notes = {"inertia": "Denavit-Hartenberg rows carry no masses: kinematics only"}
    return Description(whole, kind_of_base, acceleration=acceleration, notes=notes)


def _turn_z(angle: float) -> own.SE3:
    return own.SE3(own.utils.rotate("z", angle), np.zeros(3))


def _turn_x(angle: float) -> own.SE3:
    return own.SE3(own.utils.rotate("x", angle), np.zeros(3))


def _shift(x: float, z: float) -> own.SE3:
    return own.SE3(np.eye(3), np.array([x, 0.0, z]))
