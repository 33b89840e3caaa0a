"""A point that presses on a surface without slipping."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import casadi as ca

from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.tasks._contact import Cone, Contact, Pressing, force_row
from wbc.tasks.base import Row, Values


@dataclass(frozen=True)
class PointContact(Pressing, Contact):
    """A point on a surface does not move, J v = -gain e as for ``Hold`` with ``kind="position"``. Its force f, in the
    axes of the frame, whose z axis is the normal of the surface, towards the robot, keeps

        least <= f_z <= most,      d_k' f <= cos(pi / edges) friction f_z,      k = 1 ... edges      [N]

    d_k are unit vectors across z, evenly spread from x on. This is the largest pyramid with ``edges`` faces inside of
    Coulomb's cone |(f_x, f_y)| <= friction f_z; it leaves out at most the share 1 - cos(pi / edges) of a tangential
    force, 29 % for 4 and 8 % for 8 edges. Compiled for velocities it is a ``Hold`` of a position; for torques
    (docs/torque.md) its force stays within the pyramid.

    Attributes:
        friction: first value of the input.
        edges: faces of the pyramid, 4 or more.
        others: as in :class:`wbc.tasks.SurfaceContact`.

    Inputs:
        target: position in the world, 3 numbers [m], or a pose. Default: where it is at the first step.
        friction: Coulomb's coefficient [1].
        others: as in :class:`wbc.tasks.SurfaceContact`.

    What it cannot do: slide, roll or bear a torque. It does not know whether the ground is there. z of the frame is
    the normal: a foot whose frame turns with the leg needs a frame of its own, along the ground.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("anymal_c"), dt=0.002)
        >>> for leg in ("LF", "RF", "LH", "RH"):
        ...     stack.add(wbc.tasks.PointContact(f"{leg}_FOOT", friction=0.7), name=f"{leg} foot")
        >>> stack.add(wbc.tasks.Posture())

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    axes: ClassVar[tuple[int, ...]] = (0, 1, 2)
    part: ClassVar[Literal["", "position"]] = "position"

    friction: float = 0.5
    least: float = 0.0
    most: float = math.inf
    edges: int = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.edges, bool) or not isinstance(self.edges, int) or self.edges < 4:
            raise RangeError("PointContact.edges", self.edges, "expected an integer >= 4")

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        return (
            force_row(robot, "normal"),
            *[force_row(robot, f"friction {k}") for k in range(1, self.edges + 1)],
        )

    def cone(self, inputs: Values) -> Cone:
        slope = math.cos(math.pi / self.edges) * inputs["friction"]
        angles = [2.0 * math.pi * k / self.edges for k in range(self.edges)]
        faces = [ca.horzcat(-math.cos(x), -math.sin(x), slope) for x in angles]
        matrix = ca.vertcat(ca.SX([[0.0, 0.0, 1.0]]), *faces)
        lower = ca.vertcat(inputs["least"], ca.SX.zeros(self.edges))
        return Cone(ca.sparsify(matrix), lower, ca.vertcat(inputs["most"], ca.SX.inf(self.edges)))
