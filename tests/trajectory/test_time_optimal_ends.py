"""Laws of least time that begin or end in motion, bad input by name, and no words on the log."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from wbc.errors import BoundsError, InfeasibleError
from wbc.trajectory import MotionLimits, spline_path, time_optimal

CLAIM = 1.0 + 1e-6


def problem(seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2.0, 2.0, (5, 7)), rng.uniform(10.0, 30.0, 7), rng.uniform(10.0, 20.0, 7)


def worst(law):
    return max(law.certificate.worst[name].ratio for name in ("velocity", "acceleration"))


@pytest.mark.parametrize(("start", "end"), [(1.0, 0.0), (0.0, 1.5), (1.0, 2.0)])
def test_speeds_at_the_ends_are_met_within_limits(start, end):
    for seed in range(3):
        waypoints, velocity, acceleration = problem(seed)
        path = spline_path(waypoints)
        law = time_optimal(path, velocity, acceleration, start_speed=start, end_speed=end)
        assert law.certificate.worst["acceleration"].kind == "exact"
        assert worst(law) <= CLAIM
        tangents = path.evaluate(path.knots[[0, -1]], 1)
        reached = law.at([0.0, law.duration]).velocity
        np.testing.assert_allclose(reached, tangents * np.array([[start], [end]]), atol=1e-9)


def test_constant_speed_along_a_line_is_kept_all_the_way():
    law = time_optimal([[0.0, 0.0], [3.0, 4.0]], [0.6, 0.8], 1.0, start_speed=1.0, end_speed=1.0)
    assert law.duration == pytest.approx(5.0, rel=1e-6)
    assert worst(law) <= CLAIM


LINE = np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 1.0]])


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
