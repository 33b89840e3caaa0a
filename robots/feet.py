"""What a foot stands on, from the shapes about its frame: the ball whose centre that is, or the sole of its links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog, minimize_scalar
from scipy.spatial import ConvexHull, QhullError

from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.geometry.link_balls import LinkBalls
from wbc.validation import Array

#: A frame no farther from a ball's centre than this is it, as descriptions place them [radii]
CENTRAL = 0.25
#: Points no farther above the plane below them are of the sole [m]
SOLE = 4e-3
#: Largest angle of a sole's normal from straight down, where the robot is at ``neutral``: 45 degrees, its cosine
DOWN = 0.7
#: Faces of a hull are one where their normals differ by less, 0.6 degrees, as its cosine
ALIKE = 0.99995
#: A sole is at least this long and wide [m]
LEAST = 0.02


@dataclass(frozen=True, eq=False)
class Sole:
    """The largest rectangle of a sole along its longer side.

    Attributes:
        placement: of its middle in the foot's frame: z up, out of the ground, and x along the body's x axis, or across
            it, whichever is nearer. half_lengths: along x and y [m].
    """

    placement: pin.SE3
    half_lengths: tuple[float, float]


def ball_radius(robot: Robot, frame: str) -> float:
    """Radius of the largest ball, or round end, that moves with a frame and is about its origin [m]; 0: there is none.

    Raises:
        UnknownNameError: no such frame.
    """
    robot.check_frame("frame", frame)
    origin = robot.model.frames[robot.model.getFrameId(frame)].placement.translation
    balls = _balls(robot, frame)
    central = np.linalg.norm(balls.centers - origin, axis=1) <= CENTRAL * balls.radii
    return float(balls.radii[central].max(initial=0.0))


def sole_of(robot: Robot, frame: str) -> Sole:
    """The sole of the links that move with a frame: of the faces of the hull of their shapes that look down where the
    robot is at ``neutral``, the largest, with all that is within 4 mm of its plane.

    Raises:
        UnknownNameError: no such frame. ShapeError: no shapes, or a sole that is no rectangle to stand on.
    """
    robot.check_frame("frame", frame)
    balls = _balls(robot, frame)
    if not len(balls.radii):
        raise ShapeError("sole", frame, "no collision body moves with this frame, so nothing says where its sole is")
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.neutral)
    at = model.frames[model.getFrameId(frame)]
    body = data.oMi[1].rotation if robot.base == "floating" else np.eye(3)
    down, ahead = (data.oMi[at.parentJoint].rotation.T @ body @ way for way in (-np.eye(3)[2], np.eye(3)[0]))
    normal = down
    for _ in range(3):
        points = balls.centers + balls.radii[:, None] * normal
        normal = _facing(points, down)
    points = balls.centers + balls.radii[:, None] * normal
    depth = float((points @ normal).max())
    flat = points[points @ normal >= depth - SOLE]
    x = ahead - (ahead @ normal) * normal
    if np.linalg.norm(x) < 1e-3:
        raise ShapeError("sole", frame, "its normal is along the body's x axis, so nothing says what is ahead of it")
    x /= np.linalg.norm(x)
    turn = np.column_stack([x, np.cross(-normal, x), -normal])
    outline = flat @ turn[:, :2]
    angle = _angle(outline)
    turn = turn @ pin.utils.rotate("z", angle)
    middle, half = _rectangle(flat @ turn[:, :2])
    if 2.0 * half.min() < LEAST:
        size = f"{1e3 * 2.0 * half[0]:.3g} by {1e3 * 2.0 * half[1]:.3g} mm"
        reason = f"what it stands on, {len(flat)} points within {1e3 * SOLE:g} mm of a plane, has a rectangle of {size}"
        raise ShapeError("sole", frame, f"{reason}, and a flat foot has {1e3 * LEAST:g} mm at least")
    place = turn @ np.array([*middle, -depth])
    return Sole(at.placement.inverse() * pin.SE3(turn, place), (float(half[0]), float(half[1])))


def _balls(robot: Robot, frame: str) -> LinkBalls:
    """Balls whose hull is that of the shapes that move with a frame, in the axes of its joint."""
    frames, parts = robot.model.frames, list[LinkBalls]()
    joint = frames[robot.model.getFrameId(frame)].parentJoint
    for link, shapes in robot.shapes.items():
        on = frames[robot.model.getFrameId(link)]
        if on.parentJoint == joint:
            parts += [LinkBalls.of(placed.shape).moved(on.placement * placed.placement) for placed in shapes]
    return LinkBalls.joined(parts)


def _facing(points: Array, down: Array) -> Array:
    """Outward normal of the face of the points' hull with the most area across ``down``; that where there is none."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return down
    corners, normals = points[hull.simplices], hull.equations[:, :3]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    below = np.flatnonzero(normals @ down > DOWN)
    if not len(below):
        return down
    whole = (normals[below] @ normals[below].T > ALIKE) @ areas[below]
    return np.asarray(normals[below[int(np.argmax(whole * (normals[below] @ down)))]])


def _angle(outline: Array) -> float:
    """By how much the sides of the least rectangle around points are turned, within 45 degrees [rad]; 0 of a line."""
    try:
        ring = outline[ConvexHull(outline).vertices]
    except (QhullError, ValueError):
        return 0.0
    sides = np.roll(ring, -1, axis=0) - ring
    angles = np.mod(np.arctan2(sides[:, 1], sides[:, 0]) + 0.25 * np.pi, 0.5 * np.pi) - 0.25 * np.pi
    turns = np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]])
    area = np.ptp(np.einsum("ni,ijk->nkj", ring, turns), axis=0).prod(axis=1)
    return float(angles[int(np.argmin(area.round(9) + 1e-9 * np.abs(angles)))])


def _rectangle(outline: Array) -> tuple[Array, Array]:
    """Middle and half sides x and y of the largest rectangle along the axes in the hull of points; 0 of a line.

    max x y  with  n m + |n_x| x + |n_y| y <= d  of every side, which has one maximum over y / x.
    """
    try:
        sides = ConvexHull(outline).equations
    except (QhullError, ValueError):
        return outline.mean(axis=0), np.zeros(2)

    def widest(angle: float) -> Array:
        """Middle, x and y of the largest one with a diagonal along an angle."""
        way = np.array([np.cos(angle), np.sin(angle)])
        rows = np.column_stack([sides[:, :2], np.abs(sides[:, :2]) @ way])
        found = linprog([0.0, 0.0, -1.0], rows, -sides[:, 2], bounds=[(None, None)] * 3, method="highs").x
        return np.concatenate([found[:2], found[2] * way])

    best = minimize_scalar(lambda angle: -widest(angle)[2:].prod(), bounds=(0.01, 1.56), options={"xatol": 1e-7})
    found = widest(best.x)
    return found[:2], found[2:]
