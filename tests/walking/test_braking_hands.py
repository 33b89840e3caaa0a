"""A hand whose elbow is nearly straight is pulled no more than it can brake, and comes to rest at its aim."""

from __future__ import annotations

from math import copysign, inf, sqrt

import numpy as np
import pytest

import wbc
from wbc.walking.arms.puma import limb_of
from wbc.walking.loop.hand_command import BRAKING, LEAST_BEND, braking
from wbc.walking.loop.stack import DT, SWING_GAIN


@pytest.mark.parametrize("elbow", [-2.2, -1.0, -0.3, 0.4])
def test_the_lever_is_that_of_joint_3_on_the_distance_from_shoulder_to_wrist(elbow: float) -> None:
    walker = wbc.robots.walker()
    limb, (q, change) = limb_of(walker), (np.zeros((2, 6)), 1e-6)
    q[:, 2] = elbow - change, elbow + change
    _, _, shoulder, _, wrist, _ = np.moveaxis(limb.points(q), 1, 0)
    lever = abs(float(np.diff(np.linalg.norm(wrist - shoulder, axis=1))[0])) / (2.0 * change)
    found = braking(walker.arm_data, elbow, 10.0)
    assert found == pytest.approx(2.0 * BRAKING * lever * walker.arm_data.joint_accelerations[2] / 100.0, rel=1e-5)


def test_a_straight_elbow_leaves_a_little() -> None:
    data = wbc.robots.walker().arm_data
    assert braking(data, 0.0, 1.0) == pytest.approx(2.0 * BRAKING * LEAST_BEND * data.joint_accelerations[2])


def overshoot(elbow: float, brakes: float, begin: float) -> float:
    """How far a hand goes beyond its aim that follows with the gain of swings and a limited acceleration [m]."""
    data = wbc.robots.walker().arm_data
    most = braking(data, elbow, 1.0) / (2.0 * BRAKING) * DT
    off, speed, beyond = begin, 0.0, 0.0
    for _ in range(200):
        wanted = copysign(SWING_GAIN * min(abs(off), sqrt(min(brakes, 1e3) * abs(off))), off)
        speed += min(max(wanted - speed, -most), most)
        off -= speed * DT
        beyond = max(beyond, -off)
    assert abs(off) < 1e-4
    return beyond


@pytest.mark.parametrize("elbow", [-0.5, -0.25, -0.1])
def test_a_hand_that_can_brake_does_not_go_beyond_its_aim(elbow: float) -> None:
    brakes = braking(wbc.robots.walker().arm_data, elbow, SWING_GAIN)
    assert overshoot(elbow, brakes, 0.01) < 0.0003 < 0.001 < overshoot(elbow, inf, 0.01)
