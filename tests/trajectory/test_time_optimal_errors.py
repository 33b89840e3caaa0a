"""Bad input of laws of least time: typed errors that name what was wrong; and no words on the log."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from wbc.errors import BoundsError, InfeasibleError, NotFiniteError, RangeError, ShapeError
from wbc.trajectory import MotionLimits, time_optimal

LINE = np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 1.0]])

CASES = [
    ({"path": LINE * np.nan}, NotFiniteError, "path.waypoints"),
    ({"path": LINE[0]}, ShapeError, "path.waypoints"),
    ({"path": "line"}, ShapeError, "path.waypoints"),
    ({"velocity": 0.0}, RangeError, "velocity"),
    ({"velocity": [1.0, -1.0]}, RangeError, "velocity"),
    ({"velocity": [1.0, np.nan]}, RangeError, "velocity"),
    ({"acceleration": [1.0, 1.0, 1.0]}, ShapeError, "acceleration"),
    ({"acceleration": "much"}, ShapeError, "acceleration"),
    ({"acceleration": None}, RangeError, "path"),
    ({"acceleration": np.inf}, RangeError, "path"),
    ({"acceleration": [np.inf, 1.0], "path": [[0.0, 0.0], [1.0, 0.0]]}, RangeError, "path"),
    ({"limits": MotionLimits(velocity=np.ones(3))}, ShapeError, "limits"),
    ({"limits": MotionLimits(jerk=np.ones(2))}, RangeError, "limits.jerk"),
    ({"torque": 10.0}, ShapeError, "robot"),
    ({"cartesian_speed": {"tip": 1.0}}, ShapeError, "robot"),
    ({"inequality": (1, 2)}, ShapeError, "inequality"),
    ({"start_speed": -1.0}, RangeError, "start_speed"),
    ({"end_speed": np.nan}, NotFiniteError, "end_speed"),
    ({"duration": 0.0}, RangeError, "duration"),
    ({"intervals": 1}, RangeError, "intervals"),
    ({"intervals": 10.5}, RangeError, "intervals"),
    ({"intervals": "many"}, ShapeError, "intervals"),
]


@pytest.mark.parametrize(("change", "kind", "field"), CASES)
def test_bad_input(change, kind, field):
    arguments = {"path": LINE, "velocity": 1.0, "acceleration": 1.0} | change
    with pytest.raises(kind) as caught:
        time_optimal(**arguments)
    assert type(caught.value) is kind
    assert caught.value.field == field


def test_paths_beyond_position_limits_are_refused_with_joint_and_place():
    # The parabola through 0, 1, 0 over s = 0, 1, 2 peaks at s = 1
    limits = MotionLimits(lower=[-1.0, -1.0], upper=[1.0, 0.9])
    with pytest.raises(BoundsError, match=r"joint 1 .* at s = 1") as caught:
        time_optimal([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]], 1.0, 1.0, limits=limits)
    assert caught.value.value == pytest.approx(1.0)


def test_paths_that_touch_position_limits_are_welcome():
    limits = MotionLimits([-1.0, -1.0], [1.0, 0.9], np.ones(2), np.ones(2))
    law = time_optimal([[0.0, 0.0], [0.0, 0.9], [0.0, 0.0]], limits=limits)
    assert law.certificate.worst["position"].ratio == pytest.approx(1.0, abs=1e-9)
    assert law.certificate.satisfied


def test_arguments_go_before_limits():
    limits = MotionLimits(velocity=np.ones(2), acceleration=np.ones(2))
    law = time_optimal(LINE, acceleration=4.0, limits=limits)
    np.testing.assert_array_equal(law.limits.velocity, [1.0, 1.0])
    np.testing.assert_array_equal(law.limits.acceleration, [4.0, 4.0])


def test_nothing_is_logged_where_toppra_would_complain(caplog):
    with caplog.at_level(logging.DEBUG), pytest.raises(InfeasibleError):
        time_optimal(LINE, 1.0, 1.0, start_speed=50.0)
    time_optimal(LINE, 1.0, 1.0)
    assert not [r for r in caplog.records if r.levelno >= logging.INFO]
