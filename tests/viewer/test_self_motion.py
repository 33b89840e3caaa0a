"""Self-motion: the hand stays, joints keep their limits, and it ends where it began."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.viewer.self_motion import STAYS, STEP, self_motion


@pytest.mark.parametrize(("name", "rows"), [("panda", 6), ("panda", 3), ("ur5", 3)])
def test_the_hand_stays_while_joints_move(name: str, rows: int) -> None:
    robot = wbc.robots.load(name)
    frame, q0 = robot.frames["tip"], robot.random(3)
    way = self_motion(robot, frame, q0, rows)
    home = robot.pose(q0, frame)
    assert len(way) > 10
    assert (way[-1] == q0).all()
    for before, q in zip([q0, *way], way, strict=False):
        off = home.actInv(robot.pose(q, frame))
        assert np.linalg.norm(off.translation) < 2 * STAYS
        assert rows == 3 or np.linalg.norm(pin.log3(off.rotation)) < 2 * STAYS
        assert (q >= robot.limits.position_lower).all()
        assert (q <= robot.limits.position_upper).all()
        assert np.abs(q - before).max() < 3 * STEP
    assert max(np.abs(q - q0).max() for q in way) > 5 * STEP


def test_an_arm_without_a_joint_to_spare_has_none() -> None:
    robot = wbc.robots.load("ur5")
    assert self_motion(robot, robot.frames["tip"], robot.random(3), 6) == []
