"""Configurations that a search starts again from."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

# At import, and not at the first search: numpy loads it when it is first named
from numpy.random import default_rng

from wbc.robot import Robot
from wbc.validation import Array


class Starts:
    """Random configurations within limits, deterministic for a seed.

    Joints that are ``moved`` get a uniform value between their limits, those without limits any angle; bases, ball
    joints and joints that are not moved stay where a search began, which ``chosen`` says for each coordinate of q.
    Followers of mimic joints follow.
    """

    def __init__(self, robot: Robot, lower: Array, upper: Array, moved: np.ndarray) -> None:
        self._robot = robot
        model, index = robot.model, robot.position_index
        #: (first coordinate, how many, lower, upper) of every joint that is chosen
        self._joints: list[tuple[int, int, float, float]] = []
        for j in range(1, model.njoints):
            q, width, dof = int(model.idx_qs[j]), int(model.nqs[j]), int(model.idx_vs[j])
            if int(model.nvs[j]) != 1 or not moved[dof]:
                continue
            low, high = float(lower[dof]), float(upper[dof])
            middle = float(robot.neutral[q]) if index[dof] >= 0 else 0.0
            low = low if np.isfinite(low) else min(middle, high) - np.pi
            high = high if np.isfinite(high) else max(middle, low) + np.pi
            self._joints.append((q, width, low, high))
        leaders = {c.follower: c for c in robot.couplings}
        self._couplings = [c for c in leaders.values() if moved[c.leader] and index[c.leader] >= 0]
        self.chosen = np.zeros(robot.nq)
        for q, width, _, _ in self._joints:
            self.chosen[q : q + width] = 1.0
        for c in self._couplings:
            self.chosen[index[c.follower]] = 1.0

    def table(self, count: int, seed: int) -> Array:
        """count x nq numbers; the first ones do not depend on the count."""
        random = default_rng(seed)
        out = np.tile(np.asarray(pin.neutral(self._robot.model)), (count, 1))
        share = random.random((count, len(self._joints)))
        for k, (q, width, low, high) in enumerate(self._joints):
            value = low + share[:, k] * (high - low)
            out[:, q] = np.cos(value) if width == 2 else value
            if width == 2:
                out[:, q + 1] = np.sin(value)
        index = self._robot.position_index
        for c in self._couplings:
            out[:, index[c.follower]] = c.ratio * out[:, index[c.leader]] + c.offset
        return out
