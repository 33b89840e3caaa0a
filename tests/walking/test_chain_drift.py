"""A body that moves beside its command because of microns at its hands is brought back to it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pinocchio as pin
import pytest

from wbc.rotations import quaternion
from wbc.walking.loop.chain_drift import ChainDrift

DT = 0.01
#: What the chain adds to the body's twist (linear; angular), in the structure [m/s, rad/s]
ADDED = np.array([0.03, -0.01, 0.0, 0.0, 0.02, -0.01])


class Chain:
    """A body that moves as commanded, and by ADDED, less what its hands are told."""

    def __init__(self) -> None:
        self.q = np.array([0.1, -0.2, 1.3, 0.0, 0.0, 0.0, 1.0])
        self.v = np.array([0.05, 0.02, -0.01, 0.01, 0.0, 0.02])
        self.dt, self.lag, self.fixed, self.held = DT, 0.0, False, {0: 4, 2: 7}
        self.chain = SimpleNamespace(origins=np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-0.5, 0.8, 0.0]]))
        self.told = np.zeros((3, 6))

    def lead(self, arm: int, linear: np.ndarray, angular: np.ndarray) -> None:
        self.told[arm] = *linear, *angular

    def move(self) -> tuple[np.ndarray, np.ndarray]:
        """A tick; the configuration before it, and the twist beside the command."""
        before, turn = self.q, pin.XYZQUATToSE3(self.q).rotation
        body = turn @ pin.exp3(0.5 * DT * self.v[3:])
        away = self.told[2]
        own = away[:3] - np.cross(away[3:], self.chain.origins[2] - self.q[:3])
        beside = ADDED - np.concatenate([own, away[3:]])
        turned = pin.exp3(DT * (turn @ self.v[3:] + beside[3:])) @ turn
        self.q = np.concatenate([before[:3] + DT * (body @ self.v[:3] + beside[:3]), quaternion(turned)])
        return before, beside


def test_what_the_chain_adds_is_taken_back_and_forgotten_with_other_holds() -> None:
    it = Chain()
    drift = ChainDrift(cast("Any", it), cast("Any", it))
    left = []
    for _ in range(14):
        before, beside = it.move()
        drift.go(before)
        left.append(float(np.linalg.norm(beside)))
    assert left[0] == pytest.approx(np.linalg.norm(ADDED))
    assert left[-1] < 0.01 * left[0]
    assert (it.told[1] == 0.0).all()
    it.held, it.told = {0: 4, 1: 5, 2: 7}, np.zeros((3, 6))
    drift.go(it.move()[0])
    assert (it.told == 0.0).all()


def test_joints_that_lag_and_bodies_that_do_as_told_are_left_alone() -> None:
    for lag, added in ((0.02, ADDED), (0.0, np.zeros(6))):
        it = Chain()
        it.lag = lag
        drift = ChainDrift(cast("Any", it), cast("Any", it))
        for _ in range(4):
            before, q = it.q, pin.XYZQUATToSE3(it.q)
            next_ = q * pin.exp6(DT * it.v)
            it.q = pin.SE3ToXYZQUAT(next_)
            it.q[:3] += DT * added[:3]
            drift.go(before)
        assert (it.told == 0.0).all()
