"""Random shapes, poses and machines for the tests of clearances, and Coal as the judge of distances."""

from __future__ import annotations

import numpy as np

# isort: split
import pinocchio as pin

# isort: split

from tests.distances import coal_distance
from tests.random_robots import Drawn, random_model, random_pose
from wbc.clearance import Motion, Tree
from wbc.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, Solid, Sphere
from wbc.validation import Array


def solids(rng: np.random.Generator) -> list[Solid]:
    """One of every kind, sizes from 1 cm to 3 m."""

    def size() -> float:
        return float(10 ** rng.uniform(-2.0, 0.5))

    hull = rng.normal(size=(12, 3)) * [size(), size(), size()]
    return [
        Sphere(size()), Capsule(size(), size()), Capsule(size(), 0.0), Capsule(0.0, size()),
        Box((size(), size(), size())), Cylinder(size(), size()), Convex(hull), Ellipsoid((size(), size(), size())),
    ]  # fmt: skip


def judged(a: Solid, at: pin.SE3, b: Solid, there: pin.SE3) -> float:
    """The signed distance that Coal finds [m]."""
    return coal_distance(a, at, b, there, 1e-9)


def numbers(pose: pin.SE3) -> Array:
    """Position and quaternion."""
    return np.array(pin.SE3ToXYZQUAT(pose))


def free_tree() -> Tree:
    """One free base, and nothing on it."""
    return Tree.of_model(pin.Model(), floating=True)


def still(pose: pin.SE3) -> Motion:
    """A base that stays somewhere."""
    return Motion.linear(free_tree(), [0.0, 1.0], np.zeros((2, 0)), np.tile(numbers(pose), (2, 1)))


def random_arms(rng: np.random.Generator, arms: int = 2, joints: int = 4) -> pin.Model:
    """Arms of turning and sliding joints on one base, links "a0_link" to "b3_link"."""
    kinds = {"aligned": 3.0, "turning": 1.0, "sliding": 1.0, "endless": 1.0}
    drawn = Drawn(limbs=(arms, arms), joints=(joints, joints), kinds=kinds, far=(0.1, 0.8), turned=True, reach=None)
    return random_model(rng, drawn)


def configuration(model: pin.Model, scalars: Array) -> Array:
    """q of a model from one scalar a joint: joints without end have cosine and sine."""
    q = np.zeros(model.nq)
    for joint, x in enumerate(scalars, start=1):
        at = model.idx_qs[joint]
        if model.nqs[joint] == 2:
            q[at], q[at + 1] = np.cos(x), np.sin(x)
        else:
            q[at] = x
    return q


def random_motion(rng: np.random.Generator, tree: Tree, knots: int, cubic: bool = False) -> tuple[Motion, Array, Array]:
    """A motion with a base, and the numbers it was made of: q and poses (rows) at the knots."""
    times = np.cumsum(rng.uniform(0.01, 0.3, knots))
    q = np.cumsum(rng.normal(size=(knots, len(tree.coordinates))) * 0.15, axis=0)
    pose, rows = random_pose(rng, 0.2), []
    for _ in range(knots):
        pose = pose * pin.exp6(pin.Motion(0.05 * rng.normal(size=3), 0.1 * rng.normal(size=3)))
        rows.append(numbers(pose))
    poses = np.array(rows)
    if cubic:
        return Motion.cubic(tree, times, q, rng.normal(size=q.shape), poses), q, poses
    return Motion.linear(tree, times, q, poses), q, poses
