"""Straight segments joined by parabolic blends, with rotations in step: the via-point generator of a grasping walker.

Source: M. R. Patterson's thesis on a three-armed walking robot, section 4.3 and the routines ARMPTH and SETPTH of its
listing. What it prints is followed but where it contradicts what it promises:

    speeds at corners    also bounded by ``speed`` (4-28 does not, and points on a line would be passed too fast)
    4-31, lowering       until nothing is over, not until 1e-4; all is over where no straight part is left
    short pieces         cruises below 1e-6 s and rotations below 1e-6 rad are kept, near half turns are not rounded
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from wbc import validation
from wbc.rotations import matrices
from wbc.trajectory.jerk.joined_courses import STILL
from wbc.trajectory.jerk.via_speeds import SpeedBounds, ViaCorners, corner_speeds
from wbc.trajectory.laws.law import Law
from wbc.trajectory.laws.limits import MotionLimits
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths.path import PolynomialPath
from wbc.trajectory.paths.pose_path import PosePath
from wbc.trajectory.paths.pose_paths import placed_poses, standing_pose
from wbc.trajectory.paths.turning import TwoTurns, turn_between
from wbc.validation import Array

#: Segments below this length are rotations on the spot [m]
LEAST_LENGTH = 1e-12

#: Pieces below this share of the whole time are left out: the clock would not show them
LEAST_PIECE = 1e-14

#: A piece of motion along a direction or about an axis: (duration, acceleration)
Piece = tuple[float, float]


def via_points(
    poses: Sequence[Any],
    *,
    speed: float,
    acceleration: float,
    angular_acceleration: float,
    deviation: float,
    angular_speed: float | None = None,
) -> Law:
    """From rest at the first pose past all others to rest at the last.

    Between poses the origin moves on straight segments. Corners are rounded by blends of constant acceleration, which
    begin r before the corner, end r behind it and pass it at distance r cos(b / 2) / 2 <= deviation, b being the angle
    between the segments. Each segment turns about one axis from one orientation to the next, half the time with
    constant angular acceleration, half with its negative, in exactly the time of its straight part; blends do not
    turn. The slower of both, moving or turning, decides (4-44 to 4-48). Motion stops at a pose that is repeated, and
    at both ends of a rotation on the spot.

    Args:
        poses: at least two, each a ``pin.SE3``, a 4 x 4 matrix or (position, quaternion x, y, z, w).
        speed, acceleration: largest size of the origin's [m/s, m/s^2].
        angular_acceleration: largest [rad/s^2]. angular_speed: largest [rad/s]; none as published.
        deviation: largest distance from a pose at the middle of its blend [m]; 0 stops there.

    Returns:
        A law in the space of poses, with an exact certificate; it stands for 1e-6 s where all poses are the same.

    Raises:
        ShapeError, NotFiniteError, RotationError: what is no pose; less than two.
        RangeError: a bound that is not positive.
    """
    bounds = SpeedBounds(
        validation.scalar("speed", speed, low=0.0, open_low=True, unit="m/s"),
        validation.scalar("acceleration", acceleration, low=0.0, open_low=True, unit="m/s^2"),
        validation.scalar("deviation", deviation, low=0.0, unit="m"),
    )
    turning = validation.scalar("angular_acceleration", angular_acceleration, low=0.0, open_low=True, unit="rad/s^2")
    turn_speed = np.inf
    if angular_speed is not None:
        turn_speed = validation.scalar("angular_speed", angular_speed, low=0.0, open_low=True, unit="rad/s")
    points, quaternions = placed_poses("poses", poses)
    limits = MotionLimits(
        velocity=np.repeat([bounds.speed, turn_speed], 3), acceleration=np.repeat([bounds.acceleration, turning], 3)
    )
    path = _path(points, quaternions, bounds, turning, turn_speed)
    return Law(path, Timing.identity(STILL if path.degree == 0 else path.length), limits)


def _path(points: Array, quaternions: Array, bounds: SpeedBounds, turning: float, turn_speed: float) -> PosePath:
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    lengths[lengths < LEAST_LENGTH] = 0.0
    directions = np.where(lengths[:, None] > 0.0, steps / np.where(lengths > 0.0, lengths, 1.0)[:, None], 0.0)
    rotations = matrices(quaternions)
    vectors = np.array([turn_between(a, b) for a, b in pairwise(quaternions)])
    angles = np.linalg.norm(vectors, axis=1)
    axes = vectors / np.where(angles > 0.0, angles, 1.0)[:, None]
    # Half the time up and half the time down (4-44), or with a part at the largest speed between
    ramps = np.minimum(np.sqrt(angles / turning), turn_speed / turning)
    turns = ramps + np.divide(angles, turning * ramps, out=np.zeros_like(angles), where=ramps > 0.0)
    corners = corner_speeds(lengths, directions, turns, bounds)
    times, tops = corners.least_times(bounds.speed)
    spans = np.maximum(times, turns)
    if not spans.sum() > 0.0:
        return standing_pose(points[0], rotations[:1])
    build = _Build(LEAST_PIECE * float(spans.sum()))
    reaches, speeds = corners.reaches, np.sqrt(corners.squares)
    for i, span in enumerate(spans):
        if reaches[i] > 0.0:
            blend = 2.0 * reaches[i] / speeds[i]
            push = speeds[i] / blend * (directions[i] - directions[i - 1])
            start = points[i] - reaches[i] * directions[i - 1]
            build.add(blend, (push, speeds[i] * directions[i - 1], start), rotations[i])
        if turns[i] <= times[i]:
            along = _quick(corners, i, float(times[i]), float(tops[i]))
        else:
            along = _slowed(corners, i, float(turns[i]), bounds)
        # 4-45: the same rotation in more time
        slower = turns[i] / span if span > 0.0 else 1.0
        rate = turning * slower**2
        ramp = ramps[i] / slower if turns[i] > 0.0 else 0.0
        about = [(ramp, rate), (span - 2.0 * ramp, 0.0), (ramp, -rate)]
        line = points[i] + reaches[i] * directions[i], directions[i]
        build.segment(line, float(speeds[i]), along, (rotations[i], axes[i]), about)
    return build.path()


def _quick(corners: ViaCorners, i: int, time: float, top: float) -> list[Piece]:
    """Step 8(a), the least time: match the speeds, up, cruise, down."""
    a, fast = corners.acceleration, float(corners.fast[i])
    matching = (fast - float(corners.slow[i])) / a
    ramp = (top - fast) / a
    match = _rise(corners, i) * a
    first, last = (matching, 0.0) if match > 0.0 else (0.0, matching)
    return [(first, match), (ramp, a), (time - matching - 2.0 * ramp, 0.0), (ramp, -a), (last, match)]


def _slowed(corners: ViaCorners, i: int, time: float, bounds: SpeedBounds) -> list[Piece]:
    """Step 8(c): the straight part in the time of its rotation, by the mean speed that is left to it (4-48).

    Five cases: above half-way from the higher corner speed to the largest speed; above the higher; between both;
    above half the lower; below it, where the hand stops.
    """
    a, slow, fast = corners.acceleration, float(corners.slow[i]), float(corners.fast[i])
    matching = (fast - slow) / a
    rest = time - matching
    mean = float(corners.free[i]) / rest
    match = _rise(corners, i) * a
    early = [matching, 0.0] if match > 0.0 else [0.0, matching]
    late = early[::-1]
    if slow <= mean <= fast:
        start, end = np.sqrt(corners.squares[i : i + 2])
        return [(abs(mean - start) / a, match), (rest, 0.0), (abs(mean - end) / a, match)]
    if mean > fast:
        ramp, change = 0.5 * rest, 2.0 * (mean - fast)
        if mean > 0.5 * (bounds.speed + fast):
            ramp, change = rest * (bounds.speed - mean) / (bounds.speed - fast), bounds.speed - fast
        first, last = early
    else:
        ramp, change = 0.5 * rest, -2.0 * (slow - mean)
        if mean < 0.5 * slow:
            ramp, change = rest * mean / slow, -slow
        first, last = late
    push = change / ramp
    return [(first, match), (ramp, push), (rest - 2.0 * ramp, 0.0), (ramp, -push), (last, match)]


def _rise(corners: ViaCorners, i: int) -> float:
    """1 where the speed at the end of a segment is at least that at its beginning, else -1."""
    return 1.0 if corners.squares[i + 1] >= corners.squares[i] else -1.0


class _Build:
    """Pieces of a path over time, one after the other."""

    def __init__(self, least: float) -> None:
        self.least = least
        self.spans: list[float] = []
        self.origins: list[Array] = []
        self.rotations: list[Array] = []
        self.axes: list[Array] = []
        self.angles: list[list[float]] = []

    def add(
        self,
        span: float,
        motion: tuple[Array, Array, Array],
        rotation: Array,
        axis: Array | None = None,
        angle: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """One piece, unless the clock would not show it."""
        if span <= self.least:
            return
        self.spans.append(span)
        self.origins.append(np.array([0.5 * motion[0], *motion[1:]]))
        self.rotations.append(rotation)
        self.axes.append(np.zeros(3) if axis is None else axis)
        self.angles.append(list(angle))

    def segment(
        self,
        line: tuple[Array, Array],
        speed: float,
        along: list[Piece],
        turn: tuple[Array, Array],
        about: list[Piece],
    ) -> None:
        """A straight part with its rotation: a new piece wherever one of both changes its acceleration."""
        (origin, direction), (rotation, axis) = line, turn
        moving, turning = _table(along, speed), _table(about, 0.0)
        breaks = np.sort(np.concatenate([moving[:, 0], turning[:, 0], [sum(span for span, _ in along)]]))
        kept = [0.0]
        for time in breaks:
            if time - kept[-1] > self.least:
                kept.append(float(time))
        for begin, end in pairwise(kept):
            middle = 0.5 * (begin + end)
            push, v, travelled = _moved(moving, middle, begin)
            twist, w, angle = _moved(turning, middle, begin)
            motion = push * direction, v * direction, origin + travelled * direction
            self.add(end - begin, motion, rotation, axis, (0.5 * twist, w, angle))

    def path(self) -> PosePath:
        knots = np.concatenate([[0.0], np.cumsum(self.spans)])
        axes = np.array(self.axes)
        angles = np.zeros((3, len(axes), 2))
        angles[:, :, 0] = np.array(self.angles).T
        position = PolynomialPath(knots, np.array(self.origins).transpose(1, 0, 2))
        return PosePath(
            position, TwoTurns(PolynomialPath(knots, angles), axes, np.zeros_like(axes), np.array(self.rotations))
        )


def _table(pieces: list[Piece], speed: float) -> Array:
    """Rows (start, acceleration, speed, travelled) of pieces of constant acceleration."""
    rows, time, travelled = [], 0.0, 0.0
    for span, push in pieces:
        rows.append((time, push, speed, travelled))
        travelled += span * (speed + 0.5 * push * span)
        speed += push * span
        time += span
    return np.array(rows)


def _moved(table: Array, within: float, time: float) -> tuple[float, float, float]:
    """(acceleration, speed, travelled) at a time, of the piece that ``within`` lies in."""
    row = table[max(int(np.searchsorted(table[:, 0], within, side="right")) - 1, 0)]
    start, push, speed, travelled = (float(x) for x in row)
    e = time - start
    return push, speed + push * e, travelled + e * (speed + 0.5 * push * e)
