"""What links touch the ground with: balls and corners of their collision bodies, and of what is drawn of them."""

from __future__ import annotations

import contextlib
import logging

import numpy as np

from wbc.errors import WbcError
from wbc.multibody import pin, to_pin
from wbc.retarget.clip import Array
from wbc.robot import Robot
from wbc.robot.geometry.bodies import Raw, bodies_of
from wbc.robot.geometry.hull import Hull
from wbc.robot.geometry.link_balls import LinkBalls
from wbc.robot.geometry.meshes import Mesh
from wbc.robot.geometry.styles import polyhedron
from wbc.shapes.solid import Solid
from wbc.track.scene import link_meshes

log = logging.getLogger("wbc")


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
            add(link, LinkBalls.of(placed.shape), placed.placement)
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
        every = LinkBalls.joined(parts)
        # The same hull of fewer corners
        round_ = every.radii > 0.0
        corners = Hull(every.centers[~round_]).vertices
        own = LinkBalls(corners, np.zeros(len(corners))), LinkBalls(every.centers[round_], every.radii[round_])
        out[joint] = LinkBalls.joined(own)
    return out


def surface_points(robot: Robot) -> dict[str, Array]:
    """Corners of the convex hulls of what is drawn of links, in their frames: no other point is ever lowest [m]."""
    corners: dict[str, list[Array]] = {}
    for link, triangles in link_meshes(robot):
        corners.setdefault(link, []).append(triangles.reshape(-1, 3))
    return {link: Hull(np.concatenate(parts)).vertices for link, parts in corners.items()}


def _balls(body: Raw) -> LinkBalls:
    """Of a body in its own frame; of what is not round corners of a polyhedron around it."""
    if isinstance(body, Solid):
        return LinkBalls.of(body)
    corners = (body if isinstance(body, Mesh) else polyhedron(body)[0]).vertices
    return LinkBalls(corners, np.zeros(len(corners)))
