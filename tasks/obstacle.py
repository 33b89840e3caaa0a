"""Keeping links clear of an obstacle, at rest or moving."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import casadi as ca

from wbc import validation
from wbc.errors import MissingShapeError, RangeError, ShapeError
from wbc.multibody import pin
from wbc.proximity import OBSTACLE, Body, PairSensor
from wbc.robot import Robot
from wbc.shapes import Capsule, Convex, Shape, Solid, Sphere
from wbc.symbolic.kinematics import joint_of
from wbc.symbolic.tracer import Tracer
from wbc.tasks import _bodies as bodies, _gap as gap
from wbc.tasks._ball import BallRow
from wbc.tasks._selection import selection
from wbc.tasks.base import Constraint, Input, Numbers, Row, SacrificeOrder, Sensor, Values


@dataclass(frozen=True)
class Obstacle(Constraint):
    """Links keep clear of a sphere, capsule, box, cylinder, ellipsoid, convex hull, mesh, half-space or height map, at
    rest or moving (a body of what is climbed is a ``wbc.climb.SceneBody``):

        h = (signed distance between a shape of a link and the obstacle) - margin >= 0     [m]

    A pair of shapes has rows of its own in every tick, or is *sensed*: measured before every tick, with ``closest``
    rows in all for the pairs that need one (see ``SelfCollision``). By shape of the link (down) and of the obstacle
    (across):

                   sphere   capsule        box            cylinder       hull     half-space
        sphere     1        1              1              1              sensed   1
        capsule    1        5              2 and sensed   2 and sensed   sensed   2, ends
        box        1        2 and sensed   sensed         sensed         sensed   8, corners
        cylinder   1        2 and sensed   sensed         sensed         sensed   2, lowest points of the rims
        hull       sensed   sensed         sensed         sensed         sensed   vertices to 12; 1 to 64; else sensed

    Ellipsoids and height maps are sensed. A half-space has the points with z <= 0 of its frame. A mesh is a list of its
    convex parts. Rows of shape i are ``link[i]`` with a suffix where there are several, sensed rows ``closest[k]``;
    ``controller.pairs(name)`` says which pairs they were about.

    Choose ``margin`` to cover the curvature of a point's path over one tick: some millimetres at 10 ms on an arm at
    full speed, more for boxes and hulls, whose nearest points jump when they rock. From an overlap the rows push apart
    at -rate h at least; where the joints cannot follow, the step is ``relaxed``.

    Attributes:
        shape: a shape of :mod:`wbc.shapes`, or several :class:`wbc.shapes.Convex`, the parts of a mesh.
        links: link frames whose ``robot.shapes`` keep clear; None: all that have shapes and can move.
        margin: initial value of the input [m].
        pose: initial value of the input; None: the identity.
        closest: how many of the sensed pairs have rows at a time; no more than there are such pairs. A pair without one
            is checked at the command, see :class:`wbc.tasks.SelfCollision`.
        corners: further rows of each of them while it is near, for corners and ends: what nearest points jump to.

    Inputs:
        pose: of the obstacle in the world [m, rad]. Set it here or in the declaration before the first step.
        velocity: twist of the obstacle: linear [m/s], angular [rad/s]; world axes, at its origin. Default 0.
        margin: what is kept between the shapes [m].

    What it cannot do: see what the link shapes do not cover. An obstacle that crosses a link within a tick is not seen.
    A link that hardly moves, or is inside two parts of a mesh that push in opposite directions, may have no direction
    out.

    Example:
        >>> import numpy as np
        >>> import pinocchio as pin
        >>> import wbc
        >>> from wbc.shapes import Box, Convex, HalfSpace, Sphere
        >>> stack = wbc.Stack(wbc.robots.load("ur5"), dt=0.005)
        >>> stack.add(wbc.tasks.Obstacle(Sphere(0.1), margin=0.02), name="ball")
        >>> stack.add(wbc.tasks.Obstacle(HalfSpace(), links=["wrist_3_link"], pose=pin.SE3.Identity()), name="floor")
        >>> table = pin.SE3(np.eye(3), np.array([0.9, 0.0, 0.2]))
        >>> stack.add(wbc.tasks.Obstacle(Box((0.8, 1.2, 0.04)), margin=0.01, pose=table), name="table")
        >>> wedge = Convex(np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0.2, 0.2, 0], [0, 0, 0.1], [0, 0.2, 0.1]]))
        >>> stack.add(wbc.tasks.Obstacle([wedge], pose=table), name="wedge")

    Raises:
        ShapeError, RangeError, NotFiniteError, RotationError, DuplicateNameError: on construction.
        UnknownNameError, MissingShapeError, RangeError: in :meth:`validate`.
    """

    order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN

    shape: Shape | Sequence[Convex]
    links: tuple[str, ...] | None = None
    margin: float = 0.0
    pose: pin.SE3 | None = None
    closest: int = 16
    corners: int = 4

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", _checked_shape(self.shape))
        validation.own_scalars(self, "margin", low=0.0, unit="m")
        object.__setattr__(self, "closest", bodies.checked_count("Obstacle.closest", self.closest))
        object.__setattr__(self, "corners", bodies.checked_count("Obstacle.corners", self.corners, least=0))
        if self.links is not None:
            object.__setattr__(self, "links", selection("Obstacle.links", self.links))
        if self.pose is not None:
            object.__setattr__(self, "pose", validation.pose("Obstacle.pose", self.pose))

    @cached_property
    def parts(self) -> tuple[Shape, ...]:
        """The obstacle's shapes: one, or the parts of a mesh."""
        return self.shape if isinstance(self.shape, tuple) else (self.shape,)

    def validate(self, robot: Robot) -> None:
        """Check the links.

        Raises:
            UnknownNameError: no such frame.
            MissingShapeError: a link without shapes, or a robot without any.
            RangeError: a link that no joint moves, or more pairs than a sensor measures.
        """
        available = _available(robot)
        if self.links is None and not available:
            reason = "no moving link of this robot has collision shapes"
            raise MissingShapeError("Obstacle.links", None, reason + bodies.meshes_instead(robot))
        for link in self.links or ():
            bodies.check_shaped(robot, "Obstacle.links", link, available)
            if not joint_of(robot.tree, link):
                raise RangeError("Obstacle.links", link, "no joint moves this link, so it cannot keep clear")
        own = [placed.shape for _, _, placed in self.pairs(robot)]
        bodies.check_distances("Obstacle.shape", itertools.product(own, self.parts))
        bodies.check_sensed("Obstacle.shape", len(own) * len(self.parts))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        start = pin.SE3.Identity() if self.pose is None else self.pose
        return (
            Input("pose", "pose", unit="m, rad", default=start, rate="velocity"),
            Input("velocity", unit="m/s, rad/s", size=6, default=[0.0] * 6),
            Input("margin", unit="m", default=self.margin, low=0.0),
        )

    def pairs(self, robot: Robot) -> tuple[bodies.LinkShape, ...]:
        """(link, number of the shape within the link, shape) of every link shape that keeps clear."""
        return bodies.shapes_of(robot, _available(robot) if self.links is None else self.links)

    def sensed_pairs(self, robot: Robot) -> tuple[tuple[Body, Body], ...]:
        """Pairs that a sensor measures: a link's shape and the obstacle, or a part of it."""
        name = {1: OBSTACLE}.get(len(self.parts))
        parts = [Body(name or f"part[{k}]", OBSTACLE, pin.SE3.Identity(), s) for k, s in enumerate(self.parts)]
        out: list[tuple[Body, Body]] = []
        for link, k, placed in self.pairs(robot):
            others = [part for part in parts if gap.is_sensed(placed.shape, part.shape)]
            own = bodies.body(link, k, placed)
            out += [(own, part) for part in others]
        return tuple(out)

    def sensed_rows(self, robot: Robot) -> int:
        return self._nearest(robot) * (1 + self.corners)

    def sensor(self, robot: Robot, numbers: Numbers) -> Sensor:
        return PairSensor(robot, self.sensed_pairs(robot), self._nearest(robot), numbers, corners=self.corners)

    def _nearest(self, robot: Robot) -> int:
        return min(self.closest, len(self.sensed_pairs(robot)))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """``link[i]`` for shape i of a link, with suffixes where it has several; ``closest[k]``,
        then ``closest[k].corner[i]``.
        """
        own = [
            Row(bodies.label(link, k) + suffix, "m")
            for link, k, placed in self.pairs(robot)
            for suffix in self._suffixes(placed.shape)
        ]
        return (*own, *bodies.sensed_labels(self.sensed_rows(robot), self.corners))

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        rows, drifts = [], [ca.SX(0, 1)]
        for link, _, placed in self.pairs(robot):
            if not self._suffixes(placed.shape):
                continue
            obstacle = gap.in_world(self.parts[0], inputs["pose"])
            for row in gap.gaps(gap.on_link(kin, link, placed), obstacle):
                rows.append(row)
                drifts.append(gap.drift(kin, row, obstacle))
        own = kin.gaps(rows) + ca.vertcat(*drifts) - inputs["margin"] if rows else ca.SX(0, 1)
        return ca.vertcat(own, bodies.sensed_margins(inputs, self.sensed_rows(robot)))

    def ball_rows(self, robot: Robot) -> tuple[BallRow, ...]:
        ball, pairs = self.parts[0], self.pairs(robot)
        if not isinstance(gap.core(ball), Sphere) or not all(
            isinstance(p.shape, (Sphere, Capsule)) for _, _, p in pairs
        ):
            return ()
        assert isinstance(ball, (Sphere, Capsule))
        return tuple(BallRow(link, k, placed, ball.radius) for link, k, placed in pairs)

    def _suffixes(self, solid: Solid) -> tuple[str, ...]:
        """Names of the rows of a link's shape against the obstacle; none if it is sensed."""
        return gap.pair_rows(solid, self.parts[0])


def _available(robot: Robot) -> tuple[str, ...]:
    return tuple(name for name, shapes in robot.shapes.items() if shapes and joint_of(robot.tree, name))


def _checked_shape(shape: object) -> Shape | tuple[Convex, ...]:
    """A shape, or the parts of a mesh as a tuple."""
    if isinstance(shape, Shape):
        return shape
    if isinstance(shape, (list, tuple)) and shape and all(isinstance(part, Convex) for part in shape):
        return tuple(shape)
    from wbc.shapes.names import names_of_shapes

    raise ShapeError("Obstacle.shape", shape, "expected a shape, or the Convex parts of a mesh", names_of_shapes())
