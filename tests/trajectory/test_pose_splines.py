"""Splines of poses: through every pose, smooth, ends as asked; repeated poses dropped, wild ones refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.trajectory.path_checks import off_orthonormal, random_poses
from wbc.errors import RangeError
from wbc.trajectory import geodesic_path, pose_spline

ENDS = ("not-a-knot", "clamped", "natural")


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("count", [2, 3, 4, 9])
def test_every_pose_is_met(ends: Any, count: int) -> None:
    poses = random_poses(count, count)
    path = pose_spline(poses, ends)
    found = path.evaluate(path.knots)
    np.testing.assert_allclose(found, [pose.homogeneous for pose in poses], atol=1e-13)


def test_ends() -> None:
    poses = random_poses(3, 5)
    clamped, natural = pose_spline(poses, "clamped"), pose_spline(poses, "natural")
    assert np.abs(clamped.evaluate(clamped.knots[[0, -1]], 1)).max() < 1e-13
    assert np.abs(natural.evaluate(natural.knots[[0, -1]], 2)[:, :3]).max() < 1e-13
    assert np.abs(clamped.evaluate(clamped.knots[[0, -1]], 2)).max() > 0.1


def test_two_poses_are_a_geodesic_unless_clamped() -> None:
    a, b = random_poses(4, 2)
    path, straight = pose_spline([a, b]), geodesic_path(a, b)
    s = np.linspace(0.0, path.length, 20)
    np.testing.assert_array_equal(path.evaluate(s), straight.evaluate(s))
    clamped = pose_spline([a, b], "clamped")
    turn = pin.log3(b.rotation @ a.rotation.T)
    w = clamped.evaluate(s, 1)[1:-1, 3:]
    np.testing.assert_allclose(np.cross(w, turn), 0.0, atol=1e-13)


def test_turns_about_one_axis_stay_on_it() -> None:
    axis = np.array([0.0, 0.6, 0.8])
    poses = [pin.SE3(pin.exp3(angle * axis), np.array([angle, 0.0, 0.0])) for angle in (0.0, 1.0, 2.5, 4.0, 6.5, 8.0)]
    path = pose_spline(poses)
    s = np.linspace(0.0, path.length, 500)
    w = path.evaluate(s, 1)[:, 3:]
    np.testing.assert_allclose(np.cross(w, axis), 0.0, atol=1e-13)
    # More than a whole turn: not undone by the signs of quaternions
    assert np.trapezoid(w @ axis, s) == pytest.approx(8.0, rel=1e-3)


@pytest.mark.parametrize("scale", [1e-8, 1e-3, 1e3])
def test_scales(scale: float) -> None:
    rng = np.random.default_rng(6)
    poses = [
        pin.SE3(pin.exp3(min(scale, 0.5) * rng.normal(size=3)), 1.0 + scale * rng.normal(size=3)) for _ in range(6)
    ]
    path = pose_spline(poses)
    assert off_orthonormal(path) < 4e-15
    twist = path.evaluate(np.linspace(0.0, path.length, 500), 1)
    assert np.linalg.norm(twist[:, :3], axis=1).max() < 4.0
    assert np.linalg.norm(twist[:, 3:], axis=1).max() < 8.0


def test_repeated_poses_are_dropped_and_equal_ones_stand() -> None:
    poses = random_poses(7, 4)
    repeated = [pose for pose in poses for _ in range(2)]
    np.testing.assert_allclose(pose_spline(repeated).knots, pose_spline(poses).knots, rtol=1e-14)
    standing = pose_spline([poses[0]] * 3)
    assert standing.degree == 0
    assert not standing.evaluate(np.array([0.5]), 1).any()


def test_orientations_that_change_too_unevenly_are_refused() -> None:
    # There and back by nearly half a turn, over short ways behind a long one: the spline of quaternions comes within
    # 0.08 to 0.11 of zero
    back, again = [-1.5, -2.1, 1.2], [1.6, 2.1, -1.2]
    turns = [[0.2, -1.8, 2.3], [1.5, 2.2, -1.2], back, again, again, back]
    poses = [pin.SE3.Identity()]
    for turn, step in zip(turns, (0.4, 10.0, 70.0, 0.03, 0.2, 0.9), strict=True):
        poses.append(pin.SE3(pin.exp3(np.array(turn)) @ poses[-1].rotation, poses[-1].translation + step))
    for ends in ENDS:
        with pytest.raises(RangeError, match=r"too unevenly here.*between 5 and 6"):
            pose_spline(poses, ends, 1e-3)
    assert np.isfinite(pose_spline(poses[:5], "natural", 1e-3).evaluate(np.array([1.0]), 1)).all()
