"""Numbers of joints out of configurations, and back: joints without end and ball joints, by Pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbc import robots
from wbc.robot import Robot
from wbc.robot.joint_values import beyond_limits, joint_values, with_joint_values

#: A slide and a hinge with limits behind a ball joint, on a base that floats or not
BALL = """<mujoco><compiler angle="radian"/><worldbody><body name="a">{}<geom size="0.1"/><body name="b">
<joint name="ball" type="ball"/><geom size="0.1"/><body name="c"><joint name="slide" type="slide" range="-1 1"
limited="true"/><geom size="0.1"/><body name="d"><joint name="hinge" axis="0 1 0" range="-1 1" limited="true"/>
<geom size="0.1"/></body></body></body></body></worldbody></mujoco>"""


def made(kind: str, folder: Path) -> Robot:
    if kind.startswith("kinova"):
        return robots.load("kinova", base=kind.removeprefix("kinova "))
    file = folder / "ball.xml"
    file.write_text(BALL.format("<freejoint/>" if kind == "floating ball" else ""))
    return robots.load(str(file))


@pytest.mark.parametrize("kind", ["kinova floating", "kinova fixed", "floating ball", "fixed ball"])
def test_joints_have_numbers_and_configurations_come_back(kind: str, tmp_path: Path) -> None:
    robot, rng = made(kind, tmp_path), np.random.default_rng(2)
    model, first = robot.model, robot.base_nv
    ball = kind.endswith("ball")
    # Joints without end go on beyond a turn; rotations of balls are below half a turn
    steps = np.outer(np.arange(30), rng.uniform(-0.03 if ball else -0.4, 0.03 if ball else 0.4, robot.nv))
    q = np.array([pin.integrate(model, pin.neutral(model), step) for step in steps])
    values = joint_values(robot, q)
    np.testing.assert_allclose(values, steps[:, first:], atol=1e-12)
    other = np.array([pin.integrate(model, row, np.r_[np.zeros(first), np.ones(robot.nv - first)]) for row in q])
    back = with_joint_values(robot, other, values)
    assert max(np.abs(pin.difference(model, a, b)).max() for a, b in zip(q, back, strict=True)) < 1e-12


def test_the_joint_that_is_furthest_beyond_its_limits_is_named(tmp_path: Path) -> None:
    robot = made("fixed ball", tmp_path)
    q = np.tile(robot.neutral, (3, 1))
    assert beyond_limits(robot, q) is None
    q[1, -2:] = 1.2, -1.5
    assert beyond_limits(robot, q) == ("hinge", pytest.approx(0.5))
