"""Laws of least time along paths of poses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.errors import UnknownNameError
from wbc.trajectory import geodesic_path, pose_spline, time_optimal


def pose(seed):
    rng = np.random.default_rng(seed)
    return pin.SE3(pin.exp3(rng.uniform(-1.0, 1.0, 3)), rng.uniform(-0.5, 0.5, 3))


def test_straight_line_without_turning_has_the_closed_form():
    start, end = pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    law = time_optimal(geodesic_path(start, end), acceleration=1.0, velocity=np.inf)
    assert law.space == "poses"
    assert law.duration == pytest.approx(2.0, rel=1e-3)
    np.testing.assert_allclose(law.at(law.duration).position, end.homogeneous, atol=1e-9)


def test_speeds_of_the_origin_and_of_turning_are_kept():
    path = pose_spline([pose(k) for k in range(4)])
    law = time_optimal(path, acceleration=5.0, cartesian_speed={"linear": 0.4, "angular": 0.9})
    assert law.certificate.worst["cartesian_speed"].kind == "sampled"
    assert law.certificate.worst["acceleration"].ratio <= 1.0 + 1e-6
    assert law.certificate.satisfied
    state = law.at(np.linspace(0.0, law.duration, 2001))
    linear = np.linalg.norm(state.velocity[:, :3], axis=1).max() / 0.4
    angular = np.linalg.norm(state.velocity[:, 3:], axis=1).max() / 0.9
    assert 0.95 < max(linear, angular) <= 1.0 + 1e-6
    assert np.abs(state.acceleration).max() <= 5.0 * (1.0 + 1e-6)
    for end in (0.0, law.duration):
        assert not law.at(end).velocity.round(9).any()


def test_parts_of_a_pose_are_linear_and_angular():
    with pytest.raises(UnknownNameError) as caught:
        time_optimal(geodesic_path(pose(0), pose(1)), 1.0, 1.0, cartesian_speed={"tip": 1.0})
    assert caught.value.field == "cartesian_speed"
    assert caught.value.choices[0] in ("linear", "angular")


def test_a_turn_of_nearly_nothing_between_two_others() -> None:
    """Its law is slowed until the samples of the slower one find nothing beyond its limits."""
    turns = (0.0, 0.5, 0.5 + 1e-5, 0.9)
    places = ([0.0, 0.0, 0.0], [0.5, 0.2, 0.0], [0.5, 0.2, 0.0], [0.8, 0.0, 0.1])
    poses = [(p, [0.0, 0.0, np.sin(a / 2), np.cos(a / 2)]) for p, a in zip(places, turns, strict=True)]
    assert time_optimal(pose_spline(poses), 1.0, 2.0).certificate.satisfied
