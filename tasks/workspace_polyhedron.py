"""A point of a frame stays on the allowed side of planes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import NotFiniteError, ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD, Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks._stereographic import Triple
from wbc.tasks.base import Constraint, Input, Row, Values
from wbc.tasks.frames import point_in


@dataclass(frozen=True)
class WorkspacePolyhedron(Constraint):
    """A point x of a frame (R, p) stays in an intersection of k half-spaces, whose planes are fixed to a body W:

        h_i = n_i' x - d_i >= 0,    x = R_W' (R_b' (p + R offset - p_b) - p_W)        [m]

    That is a polyhedron in H-representation, bounded or not; one row a plane. (R_W, p_W) is the input ``pose``, given
    in a reference frame b. Normals are in the compiled code, offsets and the pose are inputs. A row a'x >= b is the
    normal a and the offset b / |a|.

    Attributes:
        normals: k x 3 directions to the allowed side, in the axes of W, of any length; kept at unit length.
        offsets: first values of the input: k numbers, or one for all.
        pose: first value of the input; None: the identity.
        others: as in :class:`wbc.tasks.WorkspaceBox`.

    Inputs:
        offsets: k numbers d_i [m], the distance of each plane from the origin of W along its normal; -inf: no plane.
        offsets_rate: their rates [m/s]. Default 0.
        pose: of W in the reference frame.
        velocity: twist of W (linear m/s; angular rad/s) in the axes of the reference, at the origin of W. Default 0.

    What it cannot do: guard the body around the point (``Obstacle`` with half-spaces does), or have a re-entrant
    corner. Planes that leave no point between them are not refused: the rows then give way.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("ur5")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("tool0"), name="tool")
        >>> normals = [(0, 0, 1), (-1, 0, 0), (0, 1, 1)]
        >>> planes = wbc.tasks.WorkspacePolyhedron("tool0", normals=normals, offsets=[0.1, -1.2, -0.5])
        >>> stack.add(planes, name="cell")
        >>> stack.add(wbc.tasks.JointLimits())
        >>> controller = stack.compile(backend="vm")
        >>> controller["cell"].offsets_rate = [0.05, 0.0, 0.0]

    Raises:
        RangeError: a normal without length, or no joint moves the frame against the reference.
        UnknownNameError, ShapeError, NotFiniteError, RotationError: a bad field.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to")

    initial_only: ClassVar[tuple[str, ...]] = ("offsets", "pose")

    frame: str
    normals: tuple[Triple, ...]
    offsets: float | tuple[float, ...] = 0.0
    relative_to: str = WORLD
    offset: Triple = (0.0, 0.0, 0.0)
    pose: pin.SE3 | None = None

    def __post_init__(self) -> None:
        owner = "WorkspacePolyhedron"
        normals = _normals(f"{owner}.normals", self.normals)
        object.__setattr__(self, "normals", normals)
        offsets = validation.real_array(f"{owner}.offsets", self.offsets, finite=False)
        if offsets.shape not in ((), (len(normals),)):
            raise ShapeError(f"{owner}.offsets", self.offsets, f"expected one number or {len(normals)}, one a normal")
        if not (np.isfinite(offsets) | (offsets == -math.inf)).all():
            raise NotFiniteError(f"{owner}.offsets", self.offsets, "expected finite numbers, or -inf for no plane")
        object.__setattr__(self, "offsets", tuple(np.broadcast_to(offsets, len(normals)).tolist()))
        offset = validation.real_array(f"{owner}.offset", self.offset, (3,))
        object.__setattr__(self, "offset", tuple(offset.tolist()))
        if self.pose is not None:
            object.__setattr__(self, "pose", validation.pose(f"{owner}.pose", self.pose))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        count, start = len(self.normals), pin.SE3.Identity() if self.pose is None else self.pose
        return (
            Input("offsets", "vector", "m", count, self.offsets, "offsets_rate", infinite=-math.inf, each=True),
            Input("offsets_rate", "vector", "m/s", count, np.zeros(count), each=True),
            Input("pose", "pose", unit="m, rad", default=start, rate="velocity"),
            Input("velocity", unit="m/s, rad/s", size=6, default=np.zeros(6)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"plane[{k}]", "m") for k in range(len(self.normals)))

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        walls: Pose = inputs["pose"]
        point = walls.inverse_point(point_in(kin, self.frame, self.offset, self.relative_to))
        offsets: ca.SX = inputs["offsets"]
        return rot.constant(np.array(self.normals)) @ point - offsets


def _normals(field: str, value: Any) -> tuple[Triple, ...]:
    rows = list(validation.items(field, value, "vectors"))
    if not rows:
        raise ShapeError(field, value, "expected normals of three numbers each, one at least")
    out: list[Triple] = []
    for k, row in enumerate(rows):
        x, y, z = validation.unit_vector(f"{field}[{k}]", row).tolist()
        out.append((x, y, z))
    return tuple(out)
