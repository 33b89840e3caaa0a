"""What a link touches the ground with: balls and corners of its collision bodies."""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.retarget.clip import Array
from wbc.robot import Robot
from wbc.robot.geometry.bodies import Raw, RawBox, RawCylinder, RawEllipsoid, bodies_of
from wbc.robot.geometry.meshes import Mesh, hull_mesh
from wbc.shapes import Capsule, Sphere

log = logging.getLogger("wbc")

#: Corners about the rim of a cylinder
RIM = 16
#: So many corners are kept as they are, of more only those of their hull
FEW_CORNERS = 32


@dataclass(frozen=True)
class LinkBalls:
    """LinkBalls whose hull is what a link touches with; corners of meshes have the radius 0.

    Attributes:
        centers: in the frame of the joint that carries them [balls, 3] [m]. radii: [balls] [m].
    """

    centers: Array
    radii: Array

    def lowest(self, pose: pin.SE3) -> float:
        """Height of the lowest point where the joint has this pose [m]."""
        heights = self.centers @ np.asarray(pose.rotation)[2] + float(pose.translation[2]) - self.radii
        return float(heights.min())


def balls_of_joints(robot: Robot, joints: Collection[int]) -> dict[int, LinkBalls]:
    """LinkBalls by number of the joint that carries them, of the links' shapes and of collision bodies in the file."""
    model = robot.model
    frames = {str(frame.name): frame for frame in model.frames}
    links = {name for name, frame in frames.items() if int(frame.parentJoint) in joints}
    found: dict[int, list[tuple[Array, Array]]] = {}

    def add(link: str, placement: pin.SE3, centers: Array, radii: Array) -> None:
        frame = frames.get(link)
        if frame is not None and int(frame.parentJoint) in joints and len(centers):
            pose = np.asarray((frame.placement * placement).homogeneous)
            found.setdefault(int(frame.parentJoint), []).append((centers @ pose[:3, :3].T + pose[:3, 3], radii))

    for link, shapes in robot.shapes.items():
        for placed in shapes:
            if isinstance(placed.shape, (Sphere, Capsule)):
                a, b, radius = placed.shape.capsule()
                add(link, placed.placement, np.array([a, b]), np.full(2, radius))
    try:
        bodies = bodies_of(robot)
    except WbcError:
        bodies = []
    for body in bodies:
        if body.link not in links or (robot.shapes.get(body.link) and not body.mesh):
            continue
        try:
            centers, radii = _balls(body.read())
        except WbcError as error:
            log.info("%s", error)
            continue
        add(body.link, body.placement, centers, radii)
    return {
        joint: _hull(np.concatenate([centers for centers, _ in parts]), np.concatenate([radii for _, radii in parts]))
        for joint, parts in found.items()
    }


def _hull(centers: Array, radii: Array) -> LinkBalls:
    """The same hull of fewer balls."""
    corners = np.flatnonzero(radii == 0.0)
    if len(corners) <= FEW_CORNERS:
        return LinkBalls(centers, radii)
    outer = np.unique(hull_mesh(centers[corners]).triangles)
    kept = np.append(corners[outer] if len(outer) else corners, np.flatnonzero(radii > 0.0))
    return LinkBalls(centers[kept], radii[kept])


def _balls(body: Raw) -> tuple[Array, Array]:
    """Centres and radii of a body in its own frame."""
    if isinstance(body, Mesh):
        points = np.asarray(body.vertices, dtype=float)
        return points, np.zeros(len(points))
    if isinstance(body, (Sphere, Capsule)):
        a, b, radius = body.capsule()
        return np.array([a, b]), np.full(2, radius)
    if isinstance(body, RawBox):
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * body.half
        return corners, np.zeros(8)
    if isinstance(body, RawCylinder):
        angles = np.linspace(0.0, 2.0 * np.pi, RIM, endpoint=False)
        ring = body.radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(RIM)], axis=1)
        offset = np.array([0.0, 0.0, body.half])
        return np.concatenate([ring + offset, ring - offset]), np.zeros(2 * RIM)
    if isinstance(body, RawEllipsoid):
        radius = float(np.min(body.radii))
        return np.diag(body.radii - radius)[[0, 0, 1, 1, 2, 2]] * np.array([1, -1] * 3)[:, None], np.full(6, radius)
    return np.zeros((0, 3)), np.zeros(0)
