"""Linear programs have an answer, also where presolving gives up."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from wbc.climb.contacts import PointFoot
from wbc.linear_program import INFEASIBLE, UNBOUNDED, least
from wbc.multibody import pin

#: Points at which three feet of a quadruped touch, nearly on a rectangle [m]
FEET = np.array(
    [
        [1.589020298367, 0.083789845747, -0.010863257018],
        [1.421440606561, 0.083789845554, -0.010863257207],
        [1.421440606147, -0.083789846298, -0.010863256945],
    ]
)
#: Its centre of mass [m]
CENTER = np.array([1.446378070244, -0.049604106513, 0.0])


def test_a_stance_that_presolving_gives_up_on_is_borne() -> None:
    a, b = PointFoot(friction=0.6, radius=0.02).cone()
    slack = np.append(np.linalg.norm(a[:9], axis=1), np.zeros(6))
    rows = np.hstack([np.kron(np.eye(3), a), np.tile(slack, 3)[:, None]])
    balance = np.hstack([np.block([[np.eye(3), np.zeros((3, 3))], [pin.skew(foot), np.eye(3)]]) for foot in FEET])
    wanted = np.append([0.0, 0.0, 1.0], np.cross(CENTER, [0.0, 0.0, 1.0]))
    cost = np.append(np.zeros(18), -1.0)
    program = cost, rows, np.tile(b, 3), np.hstack([balance, np.zeros((6, 1))]), wanted
    bounds = [(None, None)] * 18 + [(None, 10.0)]
    by_interior_points = linprog(*program, bounds, method="highs-ipm").fun
    assert least(*program, bounds).fun == pytest.approx(by_interior_points) == pytest.approx(-0.026756, abs=1e-6)


def test_that_there_is_no_answer_is_one() -> None:
    one = np.ones((1, 1))
    assert least(np.ones(1), one, np.zeros(1)).status == UNBOUNDED
    assert least(np.ones(1), one, np.zeros(1), one, np.ones(1)).status == INFEASIBLE
