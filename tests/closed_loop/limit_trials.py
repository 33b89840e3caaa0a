"""Trials of limits on frames and tasks: run-time values, and margins as Pinocchio sees them.

A trial is chosen so that the robot begins within and the goal lies beyond. Every second one moves what can move: walls,
targets, cones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from tests.closed_loop.constraints import bend
from tests.closed_loop.eyes import Array, Eyes, cross, length
from tests.closed_loop.loop import Loop
from tests.random_robots import unit
from tests.tasks.robots import Frames

POINT = (0.1, -0.2, 0.05)
NORMALS = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, -1.0], [-1.0, 1.0, 0.5], [-0.5, -1.0, -1.0]])
AXIS = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])

#: Speeds of what moves [m/s, rad/s]
SPEED = 0.05

#: Least change of the quantity from start to goal [m, rad]
CHANGE = 0.1


@dataclass(frozen=True, eq=False)
class Trial:
    """Run-time values at a time, margins at a configuration and a time, what a tick's curvature may take, and whether a
    configuration is away from where the item fades.
    """

    values: Callable[[float], dict[str, Any]]
    margins: Callable[[Array, float], Array]
    curvature: Callable[[Array, Array, Array], float]
    clear: Callable[[Array], bool] = lambda q: True


#: Makes the trial of a loop, a start, a goal, and whether anything moves; None where they are no use
Maker = Callable[[Loop, Array, Array, np.random.Generator, bool], Trial | None]


def angle(a: Array, b: Array) -> float:
    """Angle between two vectors [rad]."""
    return math.atan2(length(cross(a, b)), float(a @ b))


def cone(theta: float, alpha: float) -> float:
    """Margin of an angle against a half angle, as the classes state it [rad]."""
    return alpha - theta if theta > alpha else (alpha * alpha - theta * theta) / (2 * alpha)


def point(eyes: Eyes, q: Array, frame: str, offset: Any, reference: str) -> Array:
    """A point of a frame as seen from another."""
    base, own = eyes.poses(q, reference, frame)
    return np.array(base.actInv(own.act(np.array(offset))))


def sides(rng: np.random.Generator, start: Array, goal: Array, open_share: float) -> tuple[Array, Array] | None:
    """Limits that the start keeps and the goal passes by half of its change; a share of the others infinite."""
    change = goal - start
    if np.abs(change).max() < CHANGE:
        return None
    room = rng.uniform(0.02, 0.2, start.size)
    far = np.where(rng.random(start.size) < open_share, np.inf, room)
    passed = np.abs(change) / 2 + 0.01
    return start - np.where(change < 0, passed, far), start + np.where(change > 0, passed, far)


def sided(
    measure: Callable[[Eyes, Frames, Array], Array],
    curvature: Callable[[Loop, Array, Array, Array], float] | None = None,
    *,
    aimed: bool = False,
    upper: bool = True,
    open_share: float = 0.3,
    usable: Callable[[Eyes, Frames, Array], bool] = lambda eyes, f, q: True,
    **others: Any,
) -> Maker:
    """Trials of lower <= y - target <= upper; what moves is the target, where there is one, or else both limits.

    ``others`` are run-time values that stay.
    """

    def trial(loop: Loop, q: Array, goal: Array, rng: np.random.Generator, moving: bool) -> Trial | None:
        eyes, f = loop.eyes, loop.frames
        if not (usable(eyes, f, q) and usable(eyes, f, goal)):
            return None
        first = measure(eyes, f, q)
        found = sides(rng, first, measure(eyes, f, goal), open_share)
        if found is None or (not upper and (measure(eyes, f, goal) > found[0]).all()):
            return None
        low, high = found
        shift = rng.uniform(-1.0, 1.0, first.size) if aimed else np.zeros(first.size)
        rate = rng.uniform(-SPEED, SPEED, first.size) * moving

        def values(t: float) -> dict[str, Any]:
            walls = {"lower": low - shift, "lower_rate": 0 * rate, "upper": high - shift, "upper_rate": 0 * rate}
            if aimed:
                walls |= {"target": shift + rate * t, "feedforward": rate}
            else:
                walls |= {"lower": low + rate * t, "lower_rate": rate, "upper": high + rate * t, "upper_rate": rate}
            return others | (walls if upper else {k: v for k, v in walls.items() if not k.startswith("upper")})

        def margins(x: Array, t: float) -> Array:
            y = measure(eyes, f, x) - rate * t
            return np.concatenate([y - low, high - y]) if upper else y - low

        def bent(before: Array, after: Array, v: Array) -> float:
            return bend(loop, v) if curvature is None else curvature(loop, before, after, v)

        return Trial(values, margins, bent, lambda x: usable(eyes, f, x))

    return trial


def walls(loop: Loop, q: Array, goal: Array, rng: np.random.Generator, moving: bool) -> Trial | None:
    """Planes fixed to a body at a random pose, which turns and slides, and each moves along its normal."""
    eyes, f = loop.eyes, loop.frames
    normals = NORMALS / np.linalg.norm(NORMALS, axis=1)[:, None]
    here, there = (point(eyes, x, f.tip, POINT, "world") for x in (q, goal))
    place = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), here + rng.uniform(-0.3, 0.3, 3))
    twist, rate = rng.uniform(-SPEED, SPEED, 6) * moving, rng.uniform(-SPEED, SPEED, len(normals)) * moving
    start, end = (normals @ place.actInv(x) for x in (here, there))
    if (end - start).min() > -CHANGE:
        return None
    offsets = np.where(end < start, (start + end) / 2 - 0.01, start - rng.uniform(0.02, 0.2, start.size))
    offsets = np.where((end > start) & (rng.random(start.size) < 0.3), -np.inf, offsets)

    def pose(t: float) -> pin.SE3:
        return pin.SE3(pin.exp3(t * twist[3:]) @ place.rotation, place.translation + t * twist[:3])

    def values(t: float) -> dict[str, Any]:
        return {"offsets": offsets + rate * t, "offsets_rate": rate, "pose": pose(t), "velocity": twist}

    def margins(x: Array, t: float) -> Array:
        return normals @ pose(t).actInv(point(eyes, x, f.tip, POINT, "world")) - offsets - rate * t

    return Trial(values, margins, lambda before, after, v: bend(loop, v, length(twist[3:])))


def axis_cone(reference: Callable[[Frames], str]) -> Maker:
    """An axis within a cone about a direction that turns, while the cone narrows or widens."""

    def trial(loop: Loop, q: Array, goal: Array, rng: np.random.Generator, moving: bool) -> Trial | None:
        eyes, f = loop.eyes, loop.frames

        def seen(x: Array) -> Array:
            base, own = eyes.poses(x, reference(f), f.tip)
            return np.array(base.rotation.T @ own.rotation @ AXIS)

        first = seen(q)
        aside = cross(first, unit(rng))
        center = pin.exp3(rng.uniform(0.0, 0.3) * aside / length(aside)) @ first
        theta, beyond = angle(first, center), angle(seen(goal), center)
        if beyond - theta < CHANGE:
            return None
        alpha, rate = (theta + beyond) / 2, rng.uniform(-SPEED, SPEED) * moving
        spin = rng.uniform(-SPEED, SPEED, 3) * moving

        def direction(t: float) -> Array:
            return np.array(pin.exp3(t * spin) @ center)

        def values(t: float) -> dict[str, Any]:
            d = direction(t)
            turn = {"direction": 3.0 * d, "direction_rate": cross(spin, d)}
            return turn | {"half_angle": alpha + rate * t, "half_angle_rate": rate}

        def margins(x: Array, t: float) -> Array:
            return np.array([cone(angle(seen(x), direction(t)), alpha + rate * t)])

        def bent(before: Array, after: Array, v: Array) -> float:
            turn = float(np.abs(v[3:] if loop.robot.base == "floating" else v).sum()) + length(spin) + abs(rate)
            return (1 + 1 / alpha) * (turn * loop.dt) ** 2 / 2

        return Trial(values, margins, bent)

    return trial


def gaze(frame: Callable[[Frames], str], carrier: Callable[[Frames], str]) -> Maker:
    """A point that moves, in the world or on another frame, within a cone that narrows or widens."""

    def trial(loop: Loop, q: Array, goal: Array, rng: np.random.Generator, moving: bool) -> Trial | None:
        eyes, f = loop.eyes, loop.frames
        aside = cross(AXIS, unit(rng))
        ahead = pin.exp3(rng.uniform(0.0, 0.3) * aside / length(aside)) @ AXIS * rng.uniform(0.5, 1.0)
        camera, holder = eyes.poses(q, frame(f), carrier(f))
        place = holder.actInv(camera.act(np.array(POINT) + ahead))
        speed, rate = rng.uniform(-SPEED, SPEED, 3) * moving, rng.uniform(-SPEED, SPEED) * moving

        def ray(x: Array, t: float) -> Array:
            camera, holder = eyes.poses(x, frame(f), carrier(f))
            return np.array(camera.actInv(holder.act(place + speed * t))) - np.array(POINT)

        theta, beyond = angle(ray(q, 0.0), AXIS), angle(ray(goal, 0.0), AXIS)
        if beyond - theta < CHANGE or length(ray(goal, 0.0)) < 0.3:
            return None
        alpha = (theta + beyond) / 2

        def values(t: float) -> dict[str, Any]:
            moved = {"point": place + speed * t, "point_velocity": speed}
            return moved | {"half_angle": alpha + rate * t, "half_angle_rate": rate}

        def margins(x: Array, t: float) -> Array:
            r = ray(x, t)
            return np.array([length(r) * cone(angle(r, AXIS), alpha + rate * t)])

        def bent(before: Array, after: Array, v: Array) -> float:
            # |dh/dr| < 1 + alpha / 2 and |d2h/dr2| < (1 / alpha + alpha + 1) / |r|; here only |r| is not chosen
            r = ray(before, 0.0)
            shift = length(ray(after, 0.0) - r) + (length(speed) + length(r) * abs(rate)) * loop.dt
            own = (1 / alpha + alpha + 1) * shift**2 / max(length(r) - shift, 1e-3) / 2
            return own + (1 + alpha / 2) * bend(loop, v)

        return Trial(values, margins, bent)

    return trial
