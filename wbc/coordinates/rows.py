"""Rows of coordinates besides those of :mod:`wbc.analysis.rows`: axes, angles of planes, points on curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from wbc import validation
from wbc.analysis.kept_hash import keeps_hash
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows
from wbc.coordinates.point_sets import PointSet
from wbc.errors import ShapeError
from wbc.symbolic.kinematics import WORLD
from wbc.tasks import PitchPlane, PlaneReference
from wbc.tasks._stereographic import Triple, triple

#: The reference of a plane's angle where none is given
UPRIGHT = PlaneReference()


@keeps_hash
@dataclass(frozen=True)
class AxisRows:
    """Rotation rate of a frame's body about an axis: a.(omega - omega_base)                          [rad/s]

    Attributes:
        frame: of the body that turns. base: of the body that it turns against.
        axis: direction in the axes of ``attached``, kept as a unit vector.
        attached: frame that carries the axis; ``"world"`` for one fixed in space.
        name: how reports call the row.
    """

    frame: str
    axis: Triple
    attached: str = WORLD
    base: str = WORLD
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", triple(validation.unit_vector("AxisRows.axis", self.axis)))

    def __str__(self) -> str:
        return self.name or f"{self.frame} about an axis"


@keeps_hash
@dataclass(frozen=True)
class PlaneAngleRows:
    """The angle psi of a pitch plane against a stereographic reference, see :class:`wbc.tasks.PitchPlane`      [rad]

    Unlike the rate alpha of :class:`wbc.analysis.PitchPlaneRows` it is the derivative of something, so it can be held
    without drift and taken to a value.

    Attributes:
        shoulder, elbow, wrist: frames of the arm. axis: joint across which the plane stands; None: the plane of three
            points. reference: where psi is 0.
        name: how reports call the row.
    """

    shoulder: str
    elbow: str
    wrist: str
    axis: str | None = None
    reference: PlaneReference = UPRIGHT
    name: str = field(default="psi", compare=False)

    @property
    def task(self) -> PitchPlane:
        """The task with the same angle."""
        return PitchPlane(self.shoulder, self.elbow, self.wrist, reference=self.reference, axis=self.axis)

    def __str__(self) -> str:
        return self.name


@keeps_hash
@dataclass(frozen=True)
class PointRows:
    """A point on a curve or surface: f(x) = 0 for the origin x of a frame, seen from a base frame      [m]

    Attributes:
        frame: whose origin (``robot.with_frame`` makes one anywhere). on: the curve or surface, as seen from ``base``.
        name: how reports call the rows.
    """

    frame: str
    on: PointSet
    base: str = WORLD
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not callable(getattr(self.on, "values", None)) or not isinstance(getattr(self.on, "count", None), int):
            raise ShapeError("PointRows.on", self.on, "expected a curve or surface: OnPlane, OnLine, ...")

    def __str__(self) -> str:
        return self.name or f"{self.frame} on {type(self.on).__name__.removeprefix('On').lower()}"


Coordinate: TypeAlias = BodyRows | JointRows | PitchPlaneRows | AxisRows | PlaneAngleRows | PointRows
KINDS = (BodyRows, JointRows, PitchPlaneRows, AxisRows, PlaneAngleRows, PointRows)


def coordinates(field_name: str, rows: Any) -> tuple[Coordinate, ...]:
    """Declarations as a tuple, from one or several.

    Raises:
        ShapeError: something else, or none.
    """
    found = tuple(rows) if isinstance(rows, Sequence) and not isinstance(rows, str) else (rows,)
    if not found or not all(isinstance(r, KINDS) for r in found):
        names = ", ".join(kind.__name__ for kind in KINDS)
        raise ShapeError(field_name, rows, f"expected one or several of {names}")
    return found
