"""Bodies: shapes fixed to a frame of the robot, to the world, or to an obstacle that moves by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from wbc import validation
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.multibody import pin
from wbc.shapes import Shape
from wbc.shapes.names import names_of_shapes
from wbc.shapes.solid import why_apart
from wbc.symbolic.kinematics import WORLD, joint_of

if TYPE_CHECKING:
    from wbc.robot import Robot

#: The frame of bodies that move with a pose given from outside.
OBSTACLE = "obstacle"

#: More pairs than this are refused: every tick bounds all of them.
MAX_PAIRS = 10_000


@dataclass(frozen=True, eq=False)
class Body:
    """A shape fixed to a frame.

    Attributes:
        name: for reports.
        frame: a frame of the robot; ``"world"`` for a body at rest; :data:`OBSTACLE` for one that moves with a pose
            given from outside.
        placement: pose of the shape in that frame.
        shape: any shape of :mod:`wbc.shapes`. A mesh is several bodies, a :class:`wbc.shapes.Convex` each.

    Raises:
        ShapeError: no name, or no shape.
        RotationError, NotFiniteError: a placement that is no pose.
    """

    name: str
    frame: str
    placement: pin.SE3
    shape: Shape

    def __post_init__(self) -> None:
        for field in ("name", "frame"):
            if not isinstance(getattr(self, field), str):
                raise ShapeError(f"Body.{field}", getattr(self, field), "expected a name")
        if not isinstance(self.shape, Shape):
            raise ShapeError("Body.shape", self.shape, "this is no shape", names_of_shapes())
        object.__setattr__(self, "placement", validation.pose("Body.placement", self.placement))


#: Two bodies, A and B; normals point from A to B.
Pair = tuple[Body, Body]


def checked_pairs(field: str, robot: Robot, pairs: Any, moving: frozenset[str]) -> list[Pair]:
    """The pairs as a list, with every frame known.

    Raises:
        ShapeError: not pairs of bodies, a body with itself, or neither of the two a convex solid.
        UnknownNameError: a frame that neither the robot has nor moves from outside.
        RangeError: more than :data:`MAX_PAIRS`.
        DuplicateNameError: a name of something that moves from outside is also a frame of the robot.
    """
    if isinstance(pairs, (str, bytes)) or not isinstance(pairs, Sequence):
        raise ShapeError(field, pairs, "expected a sequence of pairs of bodies")
    if len(pairs) > MAX_PAIRS:
        raise RangeError(field, len(pairs), f"at most {MAX_PAIRS} pairs: leave out those that cannot meet")
    frames = {WORLD, *robot.frame_names}
    out: list[Pair] = []
    for k, pair in enumerate(pairs):
        where = f"{field}[{k}]"
        if not (isinstance(pair, (tuple, list)) and len(pair) == 2 and all(isinstance(b, Body) for b in pair)):
            raise ShapeError(where, pair, "expected two bodies")
        first, second = pair
        if first is second:
            raise ShapeError(where, first.name, "a body has no distance to itself")
        if reason := why_apart(first.shape, second.shape):
            raise ShapeError(where, (first.name, second.name), reason)
        for body in (first, second):
            if body.frame in moving and body.frame in frames:
                raise DuplicateNameError(f"{where}.frame", body.frame, "the robot has a frame of this name")
            if body.frame not in moving and body.frame not in frames:
                raise UnknownNameError(f"{where}.frame", body.frame, [*robot.frame_names, *sorted(moving)])
        out.append((first, second))
    return out


def carrier_of(robot: Robot, body: Body, moving: frozenset[str]) -> int:
    """Number of the joint that carries the body; 0 for one that no joint of the robot moves."""
    return 0 if body.frame in moving else joint_of(robot.model, body.frame)
