"""What links touch the ground with: balls and corners of their collision bodies, and of what is drawn of them."""

from __future__ import annotations

import contextlib
import logging
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from wbc.errors import WbcError
from wbc.multibody import pin, to_pin
from wbc.retarget.clip import Array
from wbc.robot import Robot
from wbc.robot.geometry.bodies import Raw, RawBox, RawCylinder, RawEllipsoid, bodies_of
from wbc.robot.geometry.hull import Hull
from wbc.robot.geometry.meshes import Mesh, box_mesh, spread_directions
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
        ways = spread_directions(DIRECTIONS) * np.array([1.0, -1.0, 1.0])
        far = (self.centers @ ways.T + self.radii[:, None]).argmax(axis=0)
        points = self.centers[far] + ways * self.radii[far, None]
        # All corners and what stands out of them of the balls, where that is not too much
        every = np.unique(np.concatenate([self.centers[self.radii == 0.0], points[self.radii[far] > 0.0]]), axis=0)
        chosen = every
        with contextlib.suppress(QhullError):
            while len(chosen) > count:
                chosen, exact = every[ConvexHull(every, qhull_options=f"W{exact}").vertices], COARSER * exact
        return chosen


def balls_of_joints(robot: Robot) -> dict[int, LinkBalls]:
    """Balls of links' shapes, collision bodies and what is drawn, by number of the joint that carries them."""
    frames = {str(frame.name): frame for frame in robot.model.frames}
    found: dict[int, list[LinkBalls]] = {}

    def add(link: str, balls: LinkBalls, placement: pin.SE3) -> None:
        frame = frames.get(link)
        if frame is not None and int(frame.parentJoint) > 0 and len(balls.radii):
            found.setdefault(int(frame.parentJoint), []).append(balls.moved(frame.placement * placement))

    for link, shapes in robot.shapes.items():
        for placed in shapes:
            if isinstance(placed.shape, (Sphere, Capsule)):
                add(link, _balls(placed.shape), placed.placement)
    with contextlib.suppress(WbcError):
        for body in bodies_of(robot):
            if body.mesh or not robot.shapes.get(body.link):
                try:
                    add(body.link, _balls(body.read()), to_pin(body.placement))
                except WbcError as error:
                    log.info("%s", error)
    for link, corners in surface_points(robot).items():
        add(link, LinkBalls(corners, np.zeros(len(corners))), pin.SE3.Identity())
    out = {}
    for joint, parts in found.items():
        centers, radii = np.concatenate([p.centers for p in parts]), np.concatenate([p.radii for p in parts])
        # The same hull of fewer corners
        corners, round_ = Hull(centers[radii == 0.0]).vertices, radii > 0.0
        radii = np.append(np.zeros(len(corners)), radii[round_])
        out[joint] = LinkBalls(np.concatenate([corners, centers[round_]]), radii)
    return out


def surface_points(robot: Robot) -> dict[str, Array]:
    """Corners of the convex hulls of what is drawn of links, in their frames: no other point is ever lowest [m]."""
    corners: dict[str, list[Array]] = {}
    for link, triangles in link_meshes(robot):
        corners.setdefault(link, []).append(triangles.reshape(-1, 3))
    return {link: Hull(np.concatenate(parts)).vertices for link, parts in corners.items()}


def _balls(body: Raw) -> LinkBalls:
    """Of a body in its own frame."""
    centers, radius = np.zeros((0, 3)), 0.0
    if isinstance(body, (Sphere, Capsule)):
        *ends, radius = body.capsule()
        centers = np.array(ends)
    elif isinstance(body, RawEllipsoid):
        radius = float(np.min(body.radii))
        centers = np.diag(body.radii - radius)[[0, 0, 1, 1, 2, 2]] * np.array([1, -1] * 3)[:, None]
    elif isinstance(body, RawCylinder):
        angles, z = np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False), np.repeat([body.half, -body.half], RIM)
        centers = np.stack([*np.tile(body.radius * np.array([np.cos(angles), np.sin(angles)]), 2), z], axis=1)
    elif isinstance(body, (RawBox, Mesh)):
        centers = np.asarray((box_mesh(body.half) if isinstance(body, RawBox) else body).vertices, dtype=float)
    return LinkBalls(centers, np.full(len(centers), radius))
