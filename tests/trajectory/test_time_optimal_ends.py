"""Laws of least time that begin or end in motion, and what is said when they cannot."""

from __future__ import annotations

import re

import numpy as np
import pytest

from wbc.errors import InfeasibleError, RangeError
from wbc.trajectory import spline_path, time_optimal

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


def test_moving_starts_are_quicker():
    waypoints, velocity, acceleration = problem(5)
    times = [time_optimal(waypoints, velocity, acceleration, start_speed=v).duration for v in (0.0, 0.5, 1.0)]
    assert times[0] > times[1] > times[2]


def test_constant_speed_along_a_line_is_kept_all_the_way():
    law = time_optimal([[0.0, 0.0], [3.0, 4.0]], [0.6, 0.8], 1.0, start_speed=1.0, end_speed=1.0)
    assert law.duration == pytest.approx(5.0, rel=1e-6)
    assert worst(law) <= CLAIM


def named(error):
    return float(re.search(r"is ([0-9.eE+-]+) \(got", str(error)).group(1))


def test_a_start_that_is_too_slow_names_the_end_speed():
    with pytest.raises(InfeasibleError) as caught:
        time_optimal([[0.0], [0.5]], 10.0, 1.0, start_speed=0.2, end_speed=2.0)
    assert caught.value.field == "end_speed"
    assert named(caught.value) == pytest.approx(np.sqrt(0.04 + 1.0), rel=1e-4)


def test_a_path_that_goes_nowhere_cannot_be_in_motion():
    with pytest.raises(InfeasibleError) as caught:
        time_optimal([[1.0], [1.0]], 1.0, 1.0, end_speed=0.1)
    assert caught.value.field == "end_speed"


def test_duration_is_for_motion_from_rest_to_rest():
    with pytest.raises(RangeError) as caught:
        time_optimal([[0.0], [1.0]], 1.0, 1.0, start_speed=0.1, duration=5.0)
    assert caught.value.field == "duration"
    with pytest.raises(InfeasibleError, match="shortest that satisfies the limits is 2") as late:
        time_optimal([[0.0], [1.0]], 1.0, 1.0, duration=1.9)
    assert late.value.field == "duration"
