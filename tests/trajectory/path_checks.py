"""Derivatives of paths against differences of the paths themselves, on both sides of every knot; Pinocchio's logarithm
judges angular velocities.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.trajectory.paths.path import Index, Path
from wbc.validation import Array

#: Central differences of order 4: f'(x) h is near the sum of weight f(x + step h)
STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))

#: Places within each piece, both ends among them: there a piece goes on as if the knot were not there
SHARES = np.linspace(0.0, 1.0, 7)


def worst_derivative(path: Path, order: int, step: float = 2e-3) -> float:
    """Largest difference between a derivative and differences of the one below it, over the largest derivative."""
    spans = np.diff(path.knots)
    s, h = (path.knots[:-1, None] + spans[:, None] * SHARES).ravel(), np.repeat(step * spans, len(SHARES))
    at = np.repeat(np.arange(len(spans)), len(SHARES))
    exact, here = path.evaluate(s, order, at), path.evaluate(s, order - 1, at)
    found = sum(weight * _step(path, s + k * h, here, order - 1, at) for k, weight in STENCIL) / h[:, None]
    # What differences can tell: rounding of what they are made of, over h
    return float(np.abs(found - exact).max() / max(1e-300, np.abs(exact).max()))


def _step(path: Path, s: Array, here: Array, order: int, at: Index) -> Array:
    """How far a derivative goes from what it is here to s; of poses as a motion in world axes."""
    there = path.evaluate(s, order, at)
    if order or path.space == "joints":
        return there - here
    turns = [pin.log3(a[:3, :3] @ b[:3, :3].T) for a, b in zip(there, here, strict=True)]
    return np.hstack([there[:, :3, 3] - here[:, :3, 3], np.array(turns)])


def steps_at_knots(path: Path, order: int) -> float:
    """Largest difference between the two sides of inner knots."""
    inner, pieces = path.knots[1:-1], np.arange(len(path.knots) - 2)
    if not len(inner):
        return 0.0
    return float(np.abs(path.evaluate(inner, order, pieces) - path.evaluate(inner, order, pieces + 1)).max())


def off_orthonormal(path: Path, count: int = 500) -> float:
    """Largest entry of R'R - 1 and of the last rows' difference from 0, 0, 0, 1."""
    poses = path.evaluate(np.linspace(path.knots[0], path.knots[-1], count))
    turned = poses[:, :3, :3].transpose(0, 2, 1) @ poses[:, :3, :3]
    off = float(np.abs(turned - np.eye(3)).max())
    return max(off, float(np.abs(poses[:, 3] - np.array([0.0, 0.0, 0.0, 1.0])).max()))


def random_poses(seed: int, count: int) -> list[pin.SE3]:
    """Poses with turns of up to some two radians between neighbours."""
    rng = np.random.default_rng(seed)
    poses = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))]
    for _ in range(count - 1):
        turn = pin.exp3(rng.uniform(-1.2, 1.2, size=3))
        poses.append(pin.SE3(turn @ poses[-1].rotation, poses[-1].translation + rng.normal(size=3)))
    return poses
