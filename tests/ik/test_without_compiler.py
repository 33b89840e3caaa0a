"""Inverse kinematics without a C compiler: the same searches to the same answers, and no budget goes into set-up."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import wbc
from tests.models import placement
from tests.repeats import repeats
from wbc.tasks import EndEffector, JointLimits, Posture

pytestmark = pytest.mark.compiled

ROBOTS = {"panda": "panda_hand_tcp", "ur5": "tool0"}


def kinematics(robot: wbc.Robot, frame: str, backend: str) -> wbc.InverseKinematics:
    stack = wbc.Stack(robot, dt=0.005).add(EndEffector(frame), name="hand")
    return stack.add(Posture(), name="posture", weight=1e-3).add(JointLimits()).inverse_kinematics(backend=backend)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_same_searches(name: str) -> None:
    """Of random poses, of which every third is out of reach."""
    robot, rng = wbc.robots.load(name), np.random.default_rng(7)
    both = [kinematics(robot, ROBOTS[name], backend) for backend in ("native", "vm")]
    solved = 0
    for k in range(repeats(6)):
        q = rng.uniform(np.maximum(robot.limits.position_lower, -3.0), np.minimum(robot.limits.position_upper, 3.0))
        pose = placement(robot, ROBOTS[name], q)
        far = k % 3 == 2
        pose.translation = (3.0 if far else 1.0) * pose.translation
        answers = []
        for each in both:
            each["hand"].target = pose
            answers.append(each.solve(robot.neutral, restarts=10 if far else 100))
        one, two = answers
        assert (one.status, one.descents, one.ticks) == (two.status, two.descents, two.ticks)
        np.testing.assert_allclose(two.q, one.q, atol=1e-8)
        solved += one.solved
    assert solved >= repeats(6) // 2


SCRIPT = """
import sys
import wbc
from wbc.tasks import EndEffector

robot = wbc.robots.load("ur5")
stack = wbc.Stack(robot, dt=0.005).add(EndEffector("tool0", kind="position"), name="hand")
kinematics = stack.inverse_kinematics()
loaded = set(sys.modules)
kinematics["hand"].target = [0.3, 0.3, 0.5]
print(kinematics.backend, kinematics.solve(robot.neutral, budget=30.0).status, *set(sys.modules) - loaded)
print(stack.solve(robot.neutral, {"hand": [0.4, 0.2, 0.5]}).status)
"""


def without(*command: str) -> str:
    """What a command prints on a machine without a compiler."""
    environment = {**os.environ, "WBC_CC": ""}
    done = subprocess.run([sys.executable, *command], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_nothing_is_loaded_while_the_time_runs() -> None:
    assert without("-c", SCRIPT).split("\n")[:2] == ["vm solved", "solved"]


def test_the_first_command_of_the_readme() -> None:
    command = "from wbc.cli.app import app; app(['ik', 'panda', '--target', '0.4,0.2,0.5'])"
    assert "solved" in without("-c", command)
