"""What the pitch-plane task and the pitch-plane limit share: the declaration and the plane's geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import casadi as ca

from wbc import validation
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import WORLD, Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks import _stereographic as stereo
from wbc.tasks._stereographic import PlaneReference, Triple
from wbc.tasks.base import Item

ORIGIN: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Plane:
    """Shoulder-wrist line and plane of an arm as expressions.

    Attributes:
        line: unit vector from shoulder to wrist in the base's axes (axis form: without its part along the axis).
        direction: unit vector in the plane, perpendicular to the line, in the base's axes.
        line_square: (length of the line / length of the arm)^2.
        elbow_square: (distance of the elbow from the line / length of the arm)^2.
    """

    line: ca.SX
    direction: ca.SX
    line_square: ca.SX
    elbow_square: ca.SX


@lru_cache(maxsize=32)
def _angle(item: PlaneItem, robot: Robot) -> SingleState:
    """q -> the angle of a plane; kept, since every reset of a controller asks for it."""
    kin = Tracer(Kinematics(robot.tree))
    return SingleState(ca.Function("angle", [kin.q], [kin.expand(item._turned(kin, ca.SX(0)))]))


@dataclass(frozen=True)
class PlaneItem(Item):
    """Fields and expressions of everything that speaks of a pitch plane; see :class:`wbc.tasks.PitchPlane`."""

    abstract: ClassVar[bool] = True

    shoulder: str
    elbow: str
    wrist: str
    reference: PlaneReference | None = None
    axis: str | None = None
    base: str = WORLD
    shoulder_offset: Triple = ORIGIN
    elbow_offset: Triple = ORIGIN
    wrist_offset: Triple = ORIGIN
    line_width: float = 0.05
    elbow_width: float = 0.05
    reference_width: float = 0.1

    def __post_init__(self) -> None:
        for name in ("shoulder_offset", "elbow_offset", "wrist_offset"):
            given = validation.real_array(name, getattr(self, name), (3,))
            object.__setattr__(self, name, stereo.triple(given))
        limits = {"line_width": 1.0, "elbow_width": 1.0, "reference_width": math.pi}
        for name, high in limits.items():
            unit = "rad" if name == "reference_width" else "of the arm"
            width = validation.scalar(name, getattr(self, name), low=0.0, high=high, open_low=True, unit=unit)
            object.__setattr__(self, name, width)
        if self.reference is not None and not isinstance(self.reference, PlaneReference):
            raise validation.ShapeError("reference", self.reference, "expected a PlaneReference or None")

    def validate(self, robot: Robot) -> None:
        """Check frames, the axis joint and that shoulder and wrist are two points.

        Raises:
            UnknownNameError: no such frame, or ``axis`` is no revolute joint of the robot.
            RangeError: shoulder and wrist are one point, or nothing that moves carries the axis.
        """
        for name in ("shoulder", "elbow", "wrist", "base"):
            robot.check_frame(name, getattr(self, name))
        if (self.shoulder, self.shoulder_offset) == (self.wrist, self.wrist_offset):
            raise RangeError("wrist", self.wrist, "expected a point other than the shoulder")
        if self.axis is None:
            return
        validation.one_of("axis", self.axis, _revolute(robot))
        kinematics = Kinematics(robot.tree)
        if not any(self._turning(kinematics)):
            raise RangeError("axis", self.axis, f"no joint between {self.base!r} and this joint can turn the plane")

    def angle(self, robot: Robot, q: Any) -> float:
        """The plane's angle [rad] in (-pi, pi] at a configuration, 0 where it is singular.

        Builds the expression when it is first asked on a robot: for set-up and inspection, not for a control loop.
        """
        q = robot.configuration("q", q)
        return float(_angle(self, robot)(q)[0][0, 0])

    def _against(self) -> PlaneReference:
        return self.reference if self.reference is not None else PlaneReference()

    def _turned(self, kin: Tracer, target: ca.SX) -> ca.SX:
        """Angle of the plane minus ``target``, wrapped."""
        plane = self._plane(kin)
        return stereo.turned(*stereo.coordinates(plane.line, plane.direction, self._against()), target)

    def _fading(self, kin: Tracer, *, with_reference: bool) -> ca.SX:
        """Product of the fading factors of every singular set that the form has."""
        plane = self._plane(kin)
        factor = stereo.fade(plane.line_square, self.line_width)
        if self.axis is None:
            factor = factor * stereo.fade(plane.elbow_square, self.elbow_width)
        if with_reference:
            factor = factor * stereo.half_line_fade(plane.line, self._against(), self.reference_width)
        return factor

    def _plane(self, kin: Tracer) -> Plane:
        shoulder = kin.position(self.shoulder, self.shoulder_offset)
        elbow = kin.position(self.elbow, self.elbow_offset)
        wrist = kin.position(self.wrist, self.wrist_offset)
        upper, line = elbow - shoulder, wrist - shoulder
        arm = stereo.length(upper) + stereo.length(wrist - elbow)
        axis = None if self.axis is None else self._axis_in_world(kin)
        if axis is not None:
            line = line - axis * ca.dot(axis, line)
        along = stereo.unit(line)
        off = upper - along * ca.dot(along, upper)
        direction = stereo.unit(off) if axis is None else ca.cross(along, axis)
        line_square, elbow_square = stereo.square(line) / arm**2, stereo.square(off) / arm**2
        if self.base != WORLD:
            turn = kin.rotation(self.base).T
            along, direction = turn @ along, turn @ direction
        return Plane(along, direction, line_square, elbow_square)

    def _axis_in_world(self, kin: Tracer) -> ca.SX:
        return kin.joint_axis(int(kin.kinematics.model.getJointId(str(self.axis))))

    def _turning(self, kinematics: Kinematics) -> tuple[list[int], list[int]]:
        """Joints whose turning counts for the body that carries the axis, relative to the base: plus and minus."""
        carrier = kinematics.support(kinematics.parents[int(kinematics.model.getJointId(str(self.axis)))])
        base = kinematics.support(kinematics.frame(self.base)[0])
        return [j for j in carrier if j not in base], [j for j in base if j not in carrier]

    def _rate_row(self, kin: Tracer) -> ca.SX:
        """alpha: the part along the line of the angular velocity of the axis' carrier relative to the base, 1 x nv."""
        kinematics = kin.kinematics
        shoulder = kin.position(self.shoulder, self.shoulder_offset)
        line = kin.position(self.wrist, self.wrist_offset) - shoulder
        axis = self._axis_in_world(kin)
        along = stereo.unit(line - axis * ca.dot(axis, line))
        plus, minus = self._turning(kinematics)
        if kin.carrier is not None:
            along = kin.carrier.pose.rotation @ along
        blocks = [(j, along.T @ kinematics.joint_twist(j)[1]) for j in plus]
        blocks += [(j, -along.T @ kinematics.joint_twist(j)[1]) for j in minus]
        row = kinematics.columns(1, blocks)
        if kin.carrier is not None and self.base == WORLD:
            row = ca.horzcat(row, -along.T @ kin.carrier.twist[3:])
        return kin.expand(row)


def _revolute(robot: Robot) -> list[str]:
    units = robot.dof_units
    dofs = {name: robot.dofs(name) for name in robot.joint_names}
    return [n for n, s in dofs.items() if s.stop - s.start == 1 and units[s.start] == "rad"]
