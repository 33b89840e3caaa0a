"""The slack of contacts by scipy's linear program on the whole problem, from the kinds' cones as they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog

from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.climb.world import held_pose
from wbc.validation import Array


def slack_by_scipy(robot: Climber, scene: ClimbScene, contacts: Sequence[int], q: Array) -> float:
    """See :class:`wbc.climb.balance.Equilibrium`; moments about the world's origin, no row left out."""
    gravity, center = np.asarray(scene.gravity), robot.center_of_mass(q)
    load = robot.mass * gravity
    weight = float(np.linalg.norm(load)) or 1.0
    sums, sides, slacks, ends = [], [], [], []
    for limb, row in enumerate(contacts):
        if row < 0:
            continue
        kind, hold = robot.limbs[limb].contact, scene.footholds[row]
        A, b = kind.cone()
        if np.isfinite(hold.friction) and hasattr(kind, "friction"):
            A, b = type(kind)(**{**vars(kind), "friction": min(kind.friction, hold.friction)}).cone()
        pose = held_pose(robot, scene, limb, row, q)
        turn, p = pose.rotation, pose.translation
        cross = np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])
        sums.append(np.block([[turn, np.zeros((3, 3))], [cross @ turn, turn]]))
        forces, moments = np.linalg.norm(A[:, :3], axis=1), np.linalg.norm(A[:, 3:], axis=1)
        tied = np.array(
            [
                any(np.allclose(a, -c) and abs(d + e) < 1e-12 for c, e in zip(A, b, strict=True))
                for a, d in zip(A, b, strict=True)
            ]
        )
        pure = (forces < 1e-12) & ~tied
        lever = (
            (b[pure] / moments[pure]).min() / (b[~pure & ~tied] / forces[~pure & ~tied]).max() if pure.any() else 0.0
        )
        sides.append(A)
        slacks.append(np.where(tied, 0.0, np.where(pure, lever * moments, forces)) * weight)
        ends.append(b)
    if not sums:
        return -np.inf
    G = np.hstack(sums)
    spans = np.hstack([block @ _kernel(A[np.isclose(s, 0.0)]) for block, A, s in zip(sums, sides, slacks, strict=True)])
    if np.linalg.matrix_rank(spans, 1e-9) < 6:
        return -np.inf
    count = G.shape[1]
    A = np.zeros((sum(map(len, sides)), count + 1))
    at = 0
    for k, (block, slack) in enumerate(zip(sides, slacks, strict=True)):
        A[at : at + len(block), 6 * k : 6 * k + 6], A[at : at + len(block), -1] = block, slack
        at += len(block)
    cost = np.zeros(count + 1)
    cost[-1] = -1.0
    wanted = -np.concatenate([load, np.cross(center, load)])
    scale = np.concatenate([np.full(count, weight), [1.0]])
    answer = linprog(
        cost, A * scale / weight, np.concatenate(ends) / weight, np.hstack([G, np.zeros((6, 1))]) * scale / weight,
        wanted / weight, [(None, None)] * count + [(None, 1.0)], method="highs",
    )  # fmt: skip
    if answer.status != 0:
        return -np.inf
    if not gravity.any():
        return np.inf if answer.x[-1] > 1e-9 else -np.inf
    return float(answer.x[-1])


def _kernel(rows: Array) -> Array:
    """A basis of what rows map to zero ``(6, k)``."""
    _, sizes, basis = np.linalg.svd(np.vstack([rows, np.zeros((1, 6))]))
    return np.asarray(basis[(sizes > 1e-12).sum() :].T)
