"""Every robot of the table against stored answers of Pinocchio, to 1e-12 of the largest number, without it too."""

from __future__ import annotations

import numpy as np
import pytest

import wbc.robots
from tests.multibody.answers import FILE, summary
from tests.multibody.own import own_model
from wbc.multibody import PINOCCHIO, own

STORED = np.load(FILE)
ALIKE = 1e-12


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", wbc.robots.names())
def test_kinematics_and_dynamics(name: str) -> None:
    robot = wbc.robots.load(name, shapes="none")
    model = own_model(robot.model) if PINOCCHIO else robot.model
    q, v, expected = np.split(STORED[name], [robot.nq, robot.nq + robot.nv])
    for key, value in summary(own, model, q, v).items():
        there, expected = np.split(expected, [len(value)])
        np.testing.assert_allclose(value, there, rtol=0.0, atol=ALIKE * max(1.0, np.abs(there).max()), err_msg=key)
    assert not len(expected)


def test_every_robot_has_an_answer() -> None:
    assert set(STORED.files) == set(wbc.robots.names())
