"""Random arms with random coordinates, and a judge of their ranks that shares no code with the analysis.

The judge builds Jacobians of declared rows from the chain of joint placements of the Pinocchio model, many
configurations at once, and looks for places of lost rank from random starts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.analysis import BodyRows, JointRows, PitchPlaneRows, Rows
from wbc.robot import DHRow, Robot
from wbc.robots import from_dh
from wbc.validation import Array

#: Steps towards a null vector, and what counts as reached
STEPS, REACHED = 80, 1e-13


@dataclass(frozen=True)
class Case:
    """An arm, its task and constraints."""

    robot: Robot
    task: tuple[Rows, ...]
    constraints: tuple[Rows, ...]

    @property
    def rows(self) -> tuple[Rows, ...]:
        return (*self.task, *self.constraints)


def random_arm(rng: np.random.Generator, joints: int, right_angles: bool = True) -> Robot:
    """Turning joints, lengths of two digits or zero, twists by right angles, a frame ``point<k>`` off each link."""
    rows = []
    for _ in range(joints):
        a, d = (0.0 if rng.random() < 0.4 else round(float(rng.uniform(-1.0, 1.0)), 2) for _ in "ad")
        alpha = rng.choice([-1, 0, 1, 1, -1, 2]) * np.pi / 2 if right_angles else rng.uniform(-np.pi, np.pi)
        rows.append(DHRow(a=a, d=d, alpha=float(alpha), theta=float(rng.integers(0, 4) * np.pi / 2)))
    tool = pin.SE3(np.eye(3), np.round(rng.uniform(-0.5, 0.5, 3), 1))
    robot = from_dh(rows, tool=tool)
    for k in range(1, joints):
        place = np.round(rng.uniform(-0.5, 0.5, 3), 1) * (rng.random(3) < 0.5)
        robot = robot.with_frame(f"point{k}", f"link{k}", pin.SE3(np.eye(3), place))
    return robot


def some(rng: np.random.Generator, least: int, most: int) -> tuple[int, ...]:
    """Some of 0, 1, 2."""
    count = int(rng.integers(least, most + 1))
    return tuple(sorted(int(i) for i in rng.choice(3, count, replace=False)))


def random_task(rng: np.random.Generator, joints: int) -> tuple[Rows, ...]:
    """Rows of the tip's twist, at most as many as joints: whole, position, orientation or parts in some axes."""
    kind = rng.random()
    if joints >= 6 and kind < 0.6:
        return (BodyRows("tip"),)
    if kind < 0.75:
        return (BodyRows("tip", rotation=()),)
    if kind < 0.85:
        return (BodyRows("tip", translation=()),)
    axes = str(rng.choice(["world", "tip", f"link{rng.integers(1, joints)}"]))
    linear, angular = some(rng, 1, 3), some(rng, 0, min(3, joints - 3))
    return (BodyRows("tip", expressed=axes, translation=linear, rotation=angular),)


def random_constraint(rng: np.random.Generator, joints: int) -> Rows:
    """A lock, a point along the arm, a pitch plane, a component of a link's turn, or a relative velocity."""
    k = int(rng.integers(1, joints))
    kind = rng.random()
    if kind < 0.35:
        return JointRows(f"joint{rng.integers(1, joints + 1)}")
    if kind < 0.65:
        return BodyRows(str(rng.choice([f"link{k}", f"point{k}"])), rotation=())
    if kind < 0.75:
        above = int(rng.integers(k + 1, joints + 1)) if k < joints else joints
        return PitchPlaneRows(f"link{k}", str(rng.choice([f"link{above}", "tip"])))
    if kind < 0.9:
        axes = f"link{rng.integers(1, joints + 1)}"
        return BodyRows(f"link{k}", expressed=axes, translation=(), rotation=some(rng, 1, 1))
    return BodyRows(f"point{k}", base=str(rng.choice(["tip", "link1"])), rotation=())


def height(rows: Rows) -> int:
    """Number of rows."""
    return len(rows.translation) + len(rows.rotation) if isinstance(rows, BodyRows) else 1


def random_case(rng: np.random.Generator, joints: int, right_angles: bool = True) -> Case:
    """Constraints are added until there are as many rows as joints, and now and then more."""
    robot, task = random_arm(rng, joints, right_angles), random_task(rng, joints)
    constraints: list[Rows] = []
    spare = int(rng.choice([0, 0, 1, 2, 3]))
    while not constraints or sum(map(height, (*task, *constraints))) < joints + spare:
        extra = random_constraint(rng, joints)
        if extra not in constraints:
            constraints.append(extra)
    return Case(robot, task, tuple(constraints))


class Judge:
    """Jacobians of declared rows of a serial arm whose joints turn about z [many, rows, joints]."""

    def __init__(self, robot: Robot) -> None:
        self.model = robot.model
        self._steps = [self.model.jointPlacements[j] for j in range(1, self.model.njoints)]

    def value(self, rows: tuple[Rows, ...], q: Array) -> Array:
        """At configurations [many, joints]."""
        chain = self._chain(q)
        return np.concatenate([self._rows(r, q, chain) for r in rows], axis=1)

    def _chain(self, q: Array) -> list[tuple[Array, Array]]:
        """(R, p) of the world and of each joint."""
        out = [(np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3)))]
        for k, step in enumerate(self._steps):
            R, p = out[-1]
            c, s, o, one = np.cos(q[:, k]), np.sin(q[:, k]), np.zeros(len(q)), np.ones(len(q))
            turn = np.stack((c, -s, o, s, c, o, o, o, one), axis=1).reshape(-1, 3, 3)
            out.append((R @ step.rotation @ turn, p + R @ step.translation))
        return out

    def _frame(self, name: str, chain: list[tuple[Array, Array]]) -> tuple[int, Array, Array]:
        """(joint that carries it, R, p)."""
        if name == "world":
            return 0, *chain[0]
        frame = self.model.frames[self.model.getFrameId(name)]
        R, p = chain[frame.parentJoint]
        return int(frame.parentJoint), R @ frame.placement.rotation, p + R @ frame.placement.translation

    def _twist(self, joint: int, p: Array, chain: list[tuple[Array, Array]]) -> tuple[Array, Array]:
        """(v of the point p of the body, omega), columns of the joints."""
        many, size = len(p), len(self._steps)
        v, omega = np.zeros((2, many, 3, size))
        for k in range(joint):
            R, o = chain[k + 1]
            (x, y, z), (a, b, c) = R[:, :, 2].T, (p - o).T
            omega[:, :, k] = R[:, :, 2]
            v[:, 0, k], v[:, 1, k], v[:, 2, k] = y * c - z * b, z * a - x * c, x * b - y * a
        return v, omega

    def _rows(self, rows: Rows, q: Array, chain: list[tuple[Array, Array]]) -> Array:
        if isinstance(rows, JointRows):
            unit = np.zeros(len(self._steps))
            unit[self.model.getJointId(rows.joint) - 1] = 1.0
            return np.broadcast_to(unit, (len(q), 1, len(unit)))
        if isinstance(rows, BodyRows):
            joint, _, p = self._frame(rows.frame, chain)
            base, _, _ = self._frame(rows.base, chain)
            above, below = self._twist(joint, p, chain), self._twist(base, p, chain)
            _, axes, _ = self._frame(rows.expressed or "world", chain)
            seen = [axes.transpose(0, 2, 1) @ (a - b) for a, b in zip(above, below, strict=True)]
            return np.concatenate((seen[0][:, list(rows.translation)], seen[1][:, list(rows.rotation)]), axis=1)
        joint, _, s = self._frame(rows.shoulder, chain)
        _, _, w = self._frame(rows.wrist, chain)
        y = chain[joint][0][:, :, 2]
        r = (w - s) - y * np.einsum("mi,mi->m", y, w - s)[:, None]
        return np.einsum("mi,mij->mj", r, self._twist(joint, s, chain)[1])[:, None]

    def least(self, rows: tuple[Rows, ...], q: Array) -> Array:
        """The smallest of as many singular values as rows or joints, whatever is less."""
        return np.asarray(np.linalg.svd(self.value(rows, q), compute_uv=False)[:, -1])

    def lost(self, rows: tuple[Rows, ...], rng: np.random.Generator, starts: int = 60) -> Array:
        """Configurations where J v = 0 was solved for |v| = 1, by Gauss and Newton steps from random ones."""
        size = len(self._steps)
        q = rng.uniform(-np.pi, np.pi, (20 * starts, size))
        # multiples of right angles are where special things happen
        q[::4] = np.round(q[::4] / (np.pi / 2)) * np.pi / 2 + rng.normal(size=q[::4].shape) * 0.05
        q = np.concatenate((q[np.argsort(self.least(rows, q))][: starts // 2], q[: starts // 2]))
        v = np.linalg.svd(self.value(rows, q))[2][:, -1]
        for _ in range(STEPS):
            J = self.value(rows, q)
            by_q = self._slope(rows, q, v)
            residual = np.concatenate(((J @ v[:, :, None])[:, :, 0], (v * v).sum(1, keepdims=True) - 1.0), axis=1)
            below = np.concatenate((np.zeros_like(q), 2.0 * v), axis=1)[:, None]
            M = np.concatenate((np.concatenate((by_q, J), axis=2), below), axis=1)
            damping = (1e-14 + 0.1 * (residual**2).sum(1))[:, None, None] * np.eye(2 * size)
            T = M.transpose(0, 2, 1)
            step = np.linalg.solve(T @ M + damping, T @ residual[:, :, None])[:, :, 0]
            q, v = q - step[:, :size], v - step[:, size:]
        q = np.remainder(q + np.pi, 2.0 * np.pi) - np.pi
        scale = np.linalg.svd(self.value(rows, q), compute_uv=False)[:, 0]
        return np.asarray(q[self.least(rows, q) < REACHED * scale])

    def _slope(self, rows: tuple[Rows, ...], q: Array, v: Array) -> Array:
        """d (J v) / dq [many, rows, joints], by central differences."""
        many, size = q.shape
        h = 1e-5 * np.eye(size)[:, None]
        around = self.value(rows, np.concatenate((q + h, q - h)).reshape(-1, size)).reshape(2, size, many, -1, size)
        both = ((around[0] - around[1]) @ v[:, :, None])[..., 0] / 2e-5
        return np.asarray(both.transpose(1, 2, 0))
