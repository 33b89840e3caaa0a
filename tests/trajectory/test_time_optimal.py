"""Laws of least time: closed forms, random joint paths against toppra, small moves, and paths that go nowhere."""

from __future__ import annotations

import numpy as np
import pytest
import toppra
import toppra.algorithm
import toppra.constraint

from wbc.trajectory import Law, PolynomialPath, Timing, blend_path, time_optimal

CLAIM = 1.0 + 1e-6


def ratios(law: Law) -> list[float]:
    worst = law.certificate.worst
    assert all(worst[name].kind == "exact" for name in ("velocity", "acceleration"))
    return [worst[name].ratio for name in ("velocity", "acceleration")]


@pytest.mark.parametrize(("distance", "expected"), [(1.0, 2.0), (4.0, 5.0), (0.25, 1.0)])
def test_straight_moves_take_the_time_of_the_closed_form(distance, expected):
    law = time_optimal([[0.0], [distance]], 1.0, 1.0)
    assert law.duration == pytest.approx(expected, rel=5e-6)
    assert law.duration >= expected * (1.0 - 1e-12)
    assert max(ratios(law)) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(law.at([0.0, law.duration]).position, [[0.0], [distance]], atol=1e-12)
    np.testing.assert_allclose(law.at([0.0, law.duration]).velocity, 0.0, atol=1e-9)


def random_problem(rng, count):
    return rng.uniform(-2.0, 2.0, (count, 7)), rng.uniform(10.0, 30.0, 7), rng.uniform(10.0, 20.0, 7)


@pytest.mark.parametrize("count", [5, 10])
def test_random_paths_of_seven_joints_keep_limits_exactly(count):
    rng = np.random.default_rng(count)
    for _ in range(8):
        waypoints, velocity, acceleration = random_problem(rng, count)
        law = time_optimal(waypoints, velocity, acceleration)
        assert max(ratios(law)) <= CLAIM
        assert law.certificate.worst["jerk"].kind == "unbounded"
        # From outside, at times that are no places of the grid
        state = law.at(np.linspace(0.0, law.duration, 4001))
        assert np.abs(state.velocity / velocity).max() <= CLAIM
        assert np.abs(state.acceleration / acceleration).max() <= CLAIM
        # Something is always used up
        assert max(ratios(law)) > 1.0 - 1e-6


@pytest.mark.parametrize("count", [5, 10])
def test_duration_is_within_a_hundredth_of_a_fine_grid_of_toppra(count):
    rng = np.random.default_rng(40 + count)
    for _ in range(2):
        waypoints, velocity, acceleration = random_problem(rng, count)
        law = time_optimal(waypoints, velocity, acceleration)
        s = law.path.knots
        grid = np.linspace(0.0, s[-1], 6401)
        limits = [
            toppra.constraint.JointVelocityConstraint(velocity),
            toppra.constraint.JointAccelerationConstraint(acceleration),
        ]
        raw = toppra.algorithm.TOPPRA(limits, toppra.SplineInterpolator(s, waypoints), gridpoints=grid)
        _, speed, _ = raw.compute_parameterization(0.0, 0.0)
        fine = Timing.accelerations(grid, speed).duration
        assert fine * 0.999 < law.duration < fine * 1.01


@pytest.mark.parametrize("size", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8])
def test_small_straight_moves_never_fail(size):
    rng = np.random.default_rng(3)
    for _ in range(15):
        start, step = rng.uniform(-2.0, 2.0, 6), rng.standard_normal(6)
        step *= size / np.linalg.norm(step)
        velocity, acceleration = rng.uniform(0.5, 3.0, 6), rng.uniform(1.0, 10.0, 6)
        law = time_optimal([start, start + step], velocity, acceleration, intervals=50)
        assert max(ratios(law)) <= CLAIM
        step = (start + step) - start  # what is left of it in the numbers
        pull = np.min(acceleration / np.abs(step))  # largest acceleration along the line, per length
        assert law.duration == pytest.approx(2.0 / np.sqrt(pull), rel=2e-3)


@pytest.mark.parametrize("asked", [None, 2.5])
def test_nowhere_to_go_stands(asked):
    law = time_optimal([[0.3, -0.2], [0.3, -0.2]], 1.0, 1.0, duration=asked)
    assert law.duration == (asked or 1e-3)
    state = law.at(np.linspace(0.0, law.duration, 5))
    np.testing.assert_array_equal(state.position, np.tile([0.3, -0.2], (5, 1)))
    assert not state.velocity.any()
    assert not state.acceleration.any()
    assert law.certificate.ratio == 0.0


def test_motion_stops_where_the_tangent_jumps():
    knots = np.array([0.0, 1.0, 2.0])
    path = PolynomialPath(knots, [[[1.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [1.0, 0.0]]])
    law = time_optimal(path, 1.0, 1.0)
    assert law.duration == pytest.approx(4.0, rel=1e-6)
    middle = law.at(0.5 * law.duration)
    np.testing.assert_allclose(middle.position, [1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(middle.velocity, 0.0, atol=1e-6)
    assert max(ratios(law)) <= CLAIM


@pytest.mark.parametrize("deviation", [1e-1, 1e-3, 1e-5, 1e-7])
def test_small_roundings_are_passed_slowly(deviation):
    law = time_optimal(blend_path([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], deviation), 1.0, 1.0)
    assert max(ratios(law)) <= CLAIM
    assert 2.0 < law.duration < 4.0 + 1e-3


@pytest.mark.parametrize(("velocity", "acceleration"), [(1e-3, 10.0), (1e3, 1e-3), (1e-6, 1e6), (1.0, np.inf)])
def test_limits_of_very_different_sizes(velocity, acceleration):
    waypoints = random_problem(np.random.default_rng(9), 4)[0]
    per_joint = np.full(7, acceleration)
    per_joint[0] = min(acceleration, 1e3)
    law = time_optimal(waypoints, velocity, per_joint)
    assert max(ratios(law)) <= CLAIM
    assert max(ratios(law)) > 1.0 - 1e-6


def test_finer_grids_are_never_much_slower():
    waypoints, velocity, acceleration = random_problem(np.random.default_rng(13), 5)
    times = [time_optimal(waypoints, velocity, acceleration, intervals=n).duration for n in (100, 400, 1600)]
    assert times[0] > times[1] > times[2]
    assert times[0] < 1.03 * times[2]
