"""Figures of a robot's motion, measured from its configurations and its links' surfaces alone."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from wbc.multibody import pin
from wbc.retarget.clip import Array, Marks, intervals
from wbc.retarget.poses import frame_poses
from wbc.retarget.solids import surface_points
from wbc.robot import Robot

#: A limit counts as kept up to this much beyond it, as a share of the limit and in rad or m
TOLERANCE = 1e-6
#: Points of a foot this near to its lowest one are its sole [m]
SOLE_HEIGHT = 0.01
#: A joint that accelerates more from frame to frame jumps [rad/s^2, m/s^2]
JUMP = 500.0


def motion_figures(
    robot: Robot,
    rate: float,
    q: Array,
    stance: Mapping[str, Marks],
    *,
    ground: float | None = 0.0,
    balls: Collection[str] = (),
) -> dict[str, Any]:
    """What a motion keeps and what it does not, as plain data.

    Args:
        rate: frames a second [Hz]. q: configurations [frames, nq].
        stance: frame of the robot -> whether it stands [frames]; names that are no frames are left out.
        ground: height of a level ground [m]; None: there is none.
        balls: those of the frames in ``stance`` that are centres of balls, such as hands: they may turn as they stand.

    Returns:
        ``frames``, ``rate``; ``position_breaches``, ``velocity_breaches``, ``acceleration_breaches``: frames in which a
        joint is beyond its limit, the base left out; ``jumps``: frames at which a joint's acceleration, from frame to
        frame, is beyond :data:`JUMP`; ``fastest`` and ``quickest``: largest velocity and acceleration as shares of
        their limits; ``penetration``: deepest point below the ground [m]; ``penetration_frames``: with more than 1 mm
        of it; ``slide``: largest motion along the ground of a point of a sole while it stands [m]; ``slides``: by foot.
    """
    model, first, limits = robot.model, robot.base_nv, robot.limits
    steps = np.array([pin.difference(model, a, b) for a, b in itertools.pairwise(q)]).reshape(-1, robot.nv)
    velocity = steps[:, first:] * rate
    acceleration = np.diff(velocity, axis=0) * rate
    known = np.flatnonzero(robot.position_index[first:] >= 0) + first
    values = q[:, robot.position_index[known]]
    low, high = limits.position_lower[known] - TOLERANCE, limits.position_upper[known] + TOLERANCE
    outside = ((values < low) | (values > high)).any(axis=1)
    out: dict[str, Any] = {"frames": len(q), "rate": rate, "position_breaches": int(outside.sum())}
    for name, moves, limit, share in (
        ("velocity", velocity, limits.velocity[first:], "fastest"),
        ("acceleration", acceleration, limits.acceleration[first:], "quickest"),
    ):
        part = np.abs(moves) / np.where(limit > 0.0, limit, np.inf)
        out[f"{name}_breaches"] = int((part > 1.0 + TOLERANCE).any(axis=1).sum())
        out[share] = float(part.max(initial=0.0))
    out["jumps"] = int((np.abs(acceleration) > JUMP).any(axis=1).sum())
    surfaces, feet = surface_points(robot), [frame for frame in stance if frame in robot.frame_names]
    names = tuple({*surfaces, *feet})
    turns, places = frame_poses(robot, names, q)
    poses = {name: (turns[:, k], places[:, k]) for k, name in enumerate(names)}
    slides: dict[str, float] = {}
    on = {name: model.frames[model.getFrameId(name)].parentJoint for name in names}
    for foot in feet:
        # Of a sole all that its joint moves
        own = [link for link in surfaces if on[link] == on[foot] and foot not in balls]
        points = {link: surfaces[link] for link in own} or {foot: np.zeros((1, 3))}
        tracks = [at @ np.swapaxes(poses[k][0], 1, 2) + poses[k][1][:, None] for k, at in points.items()]
        slides[foot] = _slide(np.concatenate(tracks, axis=1), np.asarray(stance[foot]))
    out |= {"slide": max(slides.values(), default=0.0), "slides": slides}
    if ground is not None and surfaces:
        heights = [(poses[k][0][:, 2] @ own.T).min(axis=1) + poses[k][1][:, 2] for k, own in surfaces.items()]
        depth = np.maximum(0.0, ground - np.min(heights, axis=0))
        out |= {"penetration": float(depth.max()), "penetration_frames": int((depth > 1e-3).sum())}
    return out


def _slide(track: Array, stands: Marks) -> float:
    """Largest motion along the ground of a point of a sole from where its stance began [m]."""
    worst = 0.0
    for start, stop in intervals(stands):
        heights = track[start, :, 2]
        sole = track[start:stop, heights <= heights.min() + SOLE_HEIGHT, :2]
        worst = max(worst, float(np.linalg.norm(sole - sole[0], axis=2).max()))
    return worst
