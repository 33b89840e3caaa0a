"""Keeping links clear of an obstacle: a sphere or a half-space, at rest or moving."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import pinocchio as pin

from wbc import validation
from wbc.errors import MissingShapeError, RangeError, ShapeError, nearest
from wbc.shapes import Capsule, HalfSpace, PlacedShape, Sphere
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD, Pose, frame_index
from wbc.symbolic.tracer import Tracer
from wbc.tasks._selection import selection
from wbc.tasks.base import Constraint, Input, Order, Row, Values

if TYPE_CHECKING:
    from wbc.robot import Robot

#: Points closer than this [m] have no usable direction between them; see :func:`distance`.
COINCIDENT = 1e-10


@dataclass(frozen=True)
class Obstacle(Constraint):
    """h = (signed distance between a shape of a link and the obstacle) - margin >= 0  [m], a row a pair:

        link sphere,  sphere      |c - o| - r - r_o
        link capsule, sphere      |o - nearest point of the segment| - r - r_o
        link sphere,  half-space  n'(c - o) - r
        link capsule, half-space  n'(end - o) - r, a row for each end, so that rows are smooth

    o and n are the origin and the z axis of ``pose``; c, r, r_o are centre and radii.

    Attributes:
        shape: :class:`wbc.shapes.Sphere` or :class:`wbc.shapes.HalfSpace`.
        links: link frames whose ``robot.shapes`` keep clear; None: all that have shapes and can move.
        margin: initial value of the input [m].
        pose: initial value of the input; None: the identity. Set one of them before the first step.

    Inputs: ``pose`` of the obstacle in the world, its ``velocity`` (twist: linear m/s; angular rad/s; world axes, at
    the obstacle's origin) and ``margin`` >= 0 [m]; ``rate`` as every margin has.

    The rows hold dh/dt >= -rate h, hence h(t + dt) >= (1 - rate dt) h up to the curvature of h over one tick. The
    distance itself is convex in the relative position, which only helps; what remains is the bend of the point's
    path, at most (1/2) rho w^2 dt^2 for a point within rho of joint axes that turn at w in all. Measured on a Panda at
    its full joint speed and dt = 5 ms: see the documentation page.

    It cannot see what the link shapes do not cover, nor contacts between two ticks of a fast obstacle (speed times dt
    must stay well below the sizes involved), nor plan a way round: a robot may stop in front of the obstacle. At a
    distance of exactly zero between a centre and a core segment the direction out is taken as the z axis of the link
    (sphere obstacle). Where an obstacle comes faster than the joints may move, actuator limits come first.
    """

    order: ClassVar[Order] = Order.MARGIN

    shape: Sphere | HalfSpace
    links: tuple[str, ...] | None = None
    margin: float = 0.0
    pose: pin.SE3 | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.shape, (Sphere, HalfSpace)):
            raise ShapeError("Obstacle.shape", self.shape, "this shape is no obstacle yet", ("Sphere", "HalfSpace"))
        object.__setattr__(self, "margin", validation.scalar("Obstacle.margin", self.margin, low=0.0, unit="m"))
        if self.links is not None:
            object.__setattr__(self, "links", selection("Obstacle.links", self.links))
        if self.pose is not None:
            object.__setattr__(self, "pose", validation.pose("Obstacle.pose", self.pose))

    def validate(self, robot: Robot) -> None:
        """Check the links.

        Raises:
            UnknownNameError: no such frame.
            MissingShapeError: a link without shapes, or a robot without any.
            RangeError: a link that no joint moves.
        """
        available = [name for name, shapes in robot.shapes.items() if shapes and _moves(robot, name)]
        if self.links is None and not available:
            raise MissingShapeError("Obstacle.links", None, "no moving link of this robot has collision shapes")
        for link in self.links or ():
            robot.check_frame("Obstacle.links", link)
            if not robot.shapes.get(link):
                reason = "this link has no collision shapes (give it some with robot.with_shapes)"
                raise MissingShapeError("Obstacle.links", link, reason, nearest(link, available))
            if not _moves(robot, link):
                raise RangeError("Obstacle.links", link, "no joint moves this link, so it cannot keep clear")

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        """``pose``, ``velocity`` and ``margin``."""
        start = pin.SE3.Identity() if self.pose is None else self.pose
        return (
            Input("pose", "pose", unit="m, rad", default=start, rate="velocity"),
            Input("velocity", unit="m/s, rad/s", size=6, default=[0.0] * 6),
            Input("margin", unit="m", default=self.margin, low=0.0),
        )

    def pairs(self, robot: Robot) -> tuple[tuple[str, int, PlacedShape], ...]:
        """(link, number of the shape within the link, shape) of every link shape that keeps clear."""
        links = self.links
        if links is None:
            links = tuple(name for name in robot.shapes if _moves(robot, name))
        return tuple((link, k, placed) for link in links for k, placed in enumerate(robot.shapes.get(link, ())))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """``link[i]`` for shape i of a link; ``link[i].start`` and ``.end`` for a capsule and a half-space."""
        out: list[Row] = []
        for link, k, placed in self.pairs(robot):
            two = isinstance(self.shape, HalfSpace) and _length(placed) > 0.0
            out += [Row(f"{link}[{k}]{suffix}", "m") for suffix in ((".start", ".end") if two else ("",))]
        return tuple(out)

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        """See the class."""
        obstacle: Pose = inputs["pose"]
        margins: list[ca.SX] = []
        for link, _, placed in self.pairs(robot):
            pose = kin.pose(link)
            if isinstance(self.shape, Sphere):
                gap = _to_sphere(pose, placed, obstacle) - self.shape.radius
                margins.append(gap - inputs["margin"])
            else:
                margins += [height - inputs["margin"] for height in _above_plane(pose, placed, obstacle)]
        return ca.vertcat(*margins)


def distance(offset: ca.SX) -> ca.SX:
    """|offset| of a 3-vector [m] with a unit gradient everywhere.

    Within :data:`COINCIDENT` of zero, where the norm has no derivative, 2 COINCIDENT is added to z: the value is then
    off by at most 3 COINCIDENT, and the direction is about z instead of NaN or zero.
    """
    near = ca.dot(offset, offset) < COINCIDENT**2
    x, y, z = offset[0], offset[1], offset[2] + ca.if_else(near, 2 * COINCIDENT, 0)
    return ca.sqrt(x * x + y * y + z * z)


def _to_sphere(link: Pose, placed: PlacedShape, obstacle: Pose) -> ca.SX:
    """Distance from a link shape's surface to the origin of the obstacle.

    Worked in the link's frame, where the core segment is constant. The nearest point's parameter is clamped; by the
    envelope theorem its derivative does not count, so the gradient is continuous where the clamp sets in.
    """
    start, end = placed.ends()
    offset = link.inverse_point(obstacle.position) - rot.constant((start + end) / 2)
    length = _length(placed)
    if length > 0.0:
        axis = rot.constant((end - start) / length)
        along = ca.fmin(ca.fmax(ca.dot(axis, offset), -length / 2), length / 2)
        offset = offset - along * axis
    return distance(offset) - placed.shape.radius


def _above_plane(link: Pose, placed: PlacedShape, obstacle: Pose) -> list[ca.SX]:
    """Height of a link shape's ends above the obstacle's plane, less its radius."""
    normal = obstacle.rotation[:, 2]
    height = ca.dot(normal, link.position - obstacle.position)
    local = link.rotation.T @ normal
    ends = placed.ends() if _length(placed) > 0.0 else placed.ends()[:1]
    return [height + ca.dot(rot.constant(end), local) - placed.shape.radius for end in ends]


def _length(placed: PlacedShape) -> float:
    return placed.shape.length if isinstance(placed.shape, Capsule) else 0.0


def _moves(robot: Robot, link: str) -> bool:
    """Whether any joint moves a frame of the model in the world."""
    return link != WORLD and int(robot.model.frames[frame_index(robot.model, link)].parentJoint) > 0
