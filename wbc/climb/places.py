"""Places of a scene by text, and where a climber's body is over them."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, radians

import numpy as np

from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.grids import RADIUS, cylinder_grid, grid_place, grid_pose
from wbc.climb.scene import FLIP, ClimbScene, frame_along
from wbc.climb.scenes import placed
from wbc.errors import ShapeError, WbcError
from wbc.multibody import pin
from wbc.validation import Array

#: Places nearer to each other than this give no direction [m]
SAME = 1e-6


def body_frames(climber: Climber, scene: ClimbScene, places: Sequence[str]) -> list[pin.SE3]:
    """Poses of the body in the world over places of :func:`surface_frames`, at the climber's height.

    Raises:
        What :func:`surface_frames` raises.
    """
    return [body_over(climber, frame) for frame in surface_frames(scene, places)]


def body_over(climber: Climber, frame: pin.SE3) -> pin.SE3:
    """Pose of the body over a frame on a surface: as :func:`wbc.climb.scenes.placed`, at the climber's height."""
    body, normal = climber.body_pose(placed(climber, frame)), frame.rotation[:, 2]
    lack = climber.height - (body.translation - frame.translation) @ normal if climber.height > 0.0 else 0.0
    return pin.SE3(body.rotation, body.translation + lack * normal)


def surface_frames(scene: ClimbScene, places: Sequence[str]) -> list[pin.SE3]:
    """Frames on the surface at places, z outwards.

    A place is the id of a foothold. x of the first is towards the next place, and from place to place the frame turns
    by the smallest rotation that takes one normal to the other. ``ID,DEGREES`` is the foothold's own frame turned
    about its normal. On ``cylinder_grid`` places are ``T,A`` or ``T,A,DEGREES``, fractions allowed, with or without a
    foothold there: x along +A, turned towards +T.

    Raises:
        ShapeError: no places, or a text that is none. UnknownNameError: no such foothold. RangeError: beside the grid.
    """
    names = validation.strings("places", places)
    if not names:
        raise ShapeError("places", places, "expected one place or more")
    if scene.name == cylinder_grid.__name__:
        grid = [grid_place(f"place {k + 1}", name) for k, name in enumerate(names)]
        return [grid_pose(place.t, place.a, RADIUS, place.heading) * FLIP for place in grid]
    found = [_foothold(scene, name) for name in names]
    points = [pose.translation for pose, _ in found]
    ahead = next((p - points[0] for p in points[1:] if np.linalg.norm(p - points[0]) > SAME), np.zeros(3))
    out = list[pin.SE3]()
    for pose, heading in found:
        normal = pose.rotation[:, 2]
        if heading is not None:
            turn = pose.rotation @ pin.utils.rotate("z", heading)
        elif out:
            turn = pin.Quaternion.FromTwoVectors(out[-1].rotation[:, 2], normal).matrix() @ out[-1].rotation
        else:
            turn = facing(pose, ahead)
        out.append(pin.SE3(turn, pose.translation))
    return out


def _foothold(scene: ClimbScene, name: str) -> tuple[pin.SE3, float | None]:
    """A foothold's pose and the heading [rad] that is asked for with it."""
    known = {foothold.id: foothold.pose for foothold in scene.footholds}
    head, _, degrees = name.rpartition(",")
    if name not in known and head in known:
        try:
            heading = radians(float(degrees))
        except ValueError:
            heading = np.nan
        if not isfinite(heading):
            raise ShapeError("place", name, f"expected an angle [deg] after {head!r}")
        return known[head], heading
    return scene.footholds[scene.row(name)].pose, None


def facing(pose: pin.SE3, ahead: Array) -> Array:
    """A rotation with the z axis of a pose and x towards a direction, or the pose's where that is along z."""
    try:
        return np.array(frame_along("place", np.zeros(3), pose.rotation[:, 2], ahead).rotation)
    except WbcError:
        return np.array(pose.rotation)
