"""Distances between one ball and segments of links, as data: rows for a loop instead of an expression each."""

from __future__ import annotations

import casadi as ca

from wbc.quick_dataclasses import dataclass
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks._nearest import SHIFT


@dataclass(frozen=True)
class BallRow:
    """The distance between a ball and a link's sphere or capsule.

    Attributes:
        link, number: the frame that carries the shape, and which of its shapes it is.
        placed: the shape.
        radius: of the ball [m].
    """

    link: str
    number: int
    placed: PlacedShape
    radius: float

    @property
    def length(self) -> float:
        """Of the shape's core segment, 0 for a sphere [m]."""
        return self.placed.shape.length if isinstance(self.placed.shape, Capsule) else 0.0

    @property
    def reach(self) -> float:
        """Distance of the core to the ball's centre at contact [m]."""
        assert isinstance(self.placed.shape, (Sphere, Capsule))
        return self.placed.shape.radius + self.radius

    @property
    def segment_key(self) -> tuple[str, int, float]:
        """The same for rows that have the same segment."""
        return self.link, self.number, 0.0 if self.size else self.radius

    @property
    def size(self) -> float:
        """Of the link's shape [m]."""
        assert isinstance(self.placed.shape, (Sphere, Capsule))
        return self.length + self.placed.shape.radius

    def segment(self, kin: Tracer) -> ca.SX:
        """(middle; axis) of the core in the world, 6. The middle is moved as :mod:`wbc.tasks._gap` declares, so that a
        ball whose centre is on it has a direction to leave in.
        """
        fixed = self.placed.placement
        pose = kin.pose(self.link).times(Pose(rot.constant(fixed.rotation), rot.constant(fixed.translation)))
        if self.length:
            middle = pose.position + SHIFT * self.size * pose.rotation[:, 0]
        else:
            middle = pose.position + ca.SX(ca.DM([0.0, 0.0, SHIFT * (self.size or self.radius or 1.0)]))
        return ca.vertcat(middle, pose.rotation[:, 2])
