"""What links touch the ground with: balls and corners of their collision bodies, and of what is drawn of them."""

from __future__ import annotations

import contextlib
import itertools
import logging
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from wbc.errors import WbcError
from wbc.multibody import pin, to_pin
from wbc.retarget.clip import Array
from wbc.robot import Robot
from wbc.robot.geometry.bodies import Raw, RawBox, RawCylinder, RawEllipsoid, bodies_of
from wbc.robot.geometry.meshes import Mesh
from wbc.shapes import Capsule, Sphere
from wbc.track.scene import link_meshes

log = logging.getLogger("wbc")

#: Corners about the rim of a cylinder
RIM = 16
#: Directions in which balls of links are sampled [1]
DIRECTIONS = 1500
#: How much less exact than the one before a hull is tried that has too many corners [1]
COARSER = 1.5


@dataclass(frozen=True)
class LinkBalls:
    """Balls whose hull is what a link touches with; corners of meshes have the radius 0.

    Attributes:
        centers: in the frame of the joint that carries them [balls, 3] [m]. radii: [balls] [m].
    """

    centers: Array
    radii: Array

    @property
    def middle(self) -> Array:
        """Of the box around them."""
        radii = self.radii[:, None]
        return np.asarray(0.5 * ((self.centers - radii).min(axis=0) + (self.centers + radii).max(axis=0)))

    def moved(self, placement: pin.SE3) -> LinkBalls:
        """The same in another frame, in which this one is placed so."""
        return LinkBalls(self.centers @ np.asarray(placement.rotation).T + placement.translation, self.radii)

    def corners(self, count: int, exact: float) -> Array:
        """Points whose hull is that of the balls; at most ``count``, to ``exact`` [m] where so many can be."""
        # Evenly over the sphere: along a spiral by the golden angle
        rank = np.arange(DIRECTIONS) + 0.5
        z, turn = 1.0 - 2.0 * rank / DIRECTIONS, np.pi * (3.0 - np.sqrt(5.0)) * rank
        across = np.sqrt(1.0 - z * z)
        ways = np.stack([across * np.cos(turn), across * np.sin(turn), z])
        reach = self.centers @ ways + self.radii[:, None]
        far = reach.argmax(axis=0)
        points = self.centers[far] + ways.T * self.radii[far, None]
        # All corners and what stands out of them of the balls, where that is not too much
        every = np.unique(np.concatenate([self.centers[self.radii == 0.0], points[self.radii[far] > 0.0]]), axis=0)
        chosen = every
        with contextlib.suppress(QhullError):
            while len(chosen) > count:
                chosen, exact = every[ConvexHull(every, qhull_options=f"W{exact}").vertices], COARSER * exact
        return chosen


def balls_of_joints(robot: Robot) -> dict[int, LinkBalls]:
    """Balls of links' shapes, collision bodies and what is drawn, by number of the joint that carries them."""
    model = robot.model
    frames = {str(frame.name): frame for frame in model.frames}
    found: dict[int, list[tuple[Array, Array]]] = {}

    def add(link: str, placement: pin.SE3, centers: Array, radii: Array) -> None:
        frame = frames.get(link)
        if frame is not None and int(frame.parentJoint) > 0 and len(centers):
            pose = np.asarray((frame.placement * placement).homogeneous)
            found.setdefault(int(frame.parentJoint), []).append((centers @ pose[:3, :3].T + pose[:3, 3], radii))

    for link, shapes in robot.shapes.items():
        for placed in shapes:
            if isinstance(placed.shape, (Sphere, Capsule)):
                a, b, radius = placed.shape.capsule()
                add(link, placed.placement, np.array([a, b]), np.full(2, radius))
    with contextlib.suppress(WbcError):
        for body in bodies_of(robot):
            if body.mesh or not robot.shapes.get(body.link):
                try:
                    add(body.link, to_pin(body.placement), *_balls(body.read()))
                except WbcError as error:
                    log.info("%s", error)
    for link, corners in surface_points(robot).items():
        add(link, pin.SE3.Identity(), corners, np.zeros(len(corners)))
    return {joint: _hull(*map(np.concatenate, zip(*parts, strict=True))) for joint, parts in found.items()}


def surface_points(robot: Robot) -> dict[str, Array]:
    """Corners of the convex hulls of what is drawn of links, in their frames: no other point is ever lowest [m]."""
    corners: dict[str, list[Array]] = {}
    for link, triangles in link_meshes(robot):
        corners.setdefault(link, []).append(triangles.reshape(-1, 3))
    return {link: _hull_corners(np.concatenate(parts)) for link, parts in corners.items()}


def _hull_corners(points: Array) -> Array:
    points = np.unique(points, axis=0)
    with contextlib.suppress(QhullError):
        return np.asarray(points[ConvexHull(points).vertices] if len(points) > 4 else points)
    return points


def _hull(centers: Array, radii: Array) -> LinkBalls:
    """The same hull of fewer balls."""
    corners = _hull_corners(centers[radii == 0.0])
    round_ = radii > 0.0
    return LinkBalls(np.concatenate([corners, centers[round_]]), np.append(np.zeros(len(corners)), radii[round_]))


def _balls(body: Raw) -> tuple[Array, Array]:
    """Centres and radii of a body in its own frame."""
    if isinstance(body, Mesh):
        return np.asarray(body.vertices, dtype=float), np.zeros(len(body.vertices))
    if isinstance(body, (Sphere, Capsule)):
        a, b, radius = body.capsule()
        return np.array([a, b]), np.full(2, radius)
    if isinstance(body, RawBox):
        return body.half * np.array([*itertools.product((-1, 1), repeat=3)]), np.zeros(8)
    if isinstance(body, RawCylinder):
        angles, z = (
            np.tile(np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False), 2),
            np.repeat([body.half, -body.half], RIM),
        )
        return np.stack([body.radius * np.cos(angles), body.radius * np.sin(angles), z], axis=1), np.zeros(2 * RIM)
    if isinstance(body, RawEllipsoid):
        radius = float(np.min(body.radii))
        return np.diag(body.radii - radius)[[0, 0, 1, 1, 2, 2]] * np.array([1, -1] * 3)[:, None], np.full(6, radius)
    return np.zeros((0, 3)), np.zeros(0)
