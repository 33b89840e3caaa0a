"""Arcs: on their circles, as far round as asked; three points fix one; what is no circle is refused."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, strategies as st

from tests.trajectory.path_checks import random_poses
from wbc.trajectory import Path, arc_path, arc_through
from wbc.validation import Array


def places(path: Path, count: int = 2001) -> Array:
    return path.evaluate(np.linspace(0.0, path.length, count))[:, :3, 3]


@pytest.mark.parametrize("turn", [[0.0, 0.0, 1.0], [0.3, -4.0, 1.0], [0.0, 9.0, 9.0], [1e-8, 0.0, 0.0]])
def test_round_an_axis(turn: list[float]) -> None:
    center = np.array([1.0, 2.0, 3.0])
    for seed in range(5):
        start = random_poses(seed, 1)[0]
        carried, kept = (arc_path(start, center, turn, how) for how in ("carried", "kept"))
        for share in (0.0, 0.3, 1.0):
            rotation = pin.exp3(share * np.array(turn))
            place = center + rotation @ (start.translation - center)
            for path, turned in ((carried, rotation @ start.rotation), (kept, start.rotation)):
                pose = path.evaluate(np.array([share * path.length]))[0]
                np.testing.assert_allclose(pose[:3, 3], place, atol=1e-13)
                np.testing.assert_allclose(pose[:3, :3], turned, atol=1e-13)
        axis = np.array(turn) / np.linalg.norm(turn)
        arm = start.translation - center
        travel = np.linalg.norm(arm - axis * (axis @ arm)) * np.linalg.norm(turn)
        assert kept.length == pytest.approx(travel, rel=1e-12)
        assert carried.length == pytest.approx(travel + 0.5 * np.linalg.norm(turn), rel=1e-12)


def test_on_the_axis_it_turns_on_the_spot() -> None:
    start = random_poses(3, 1)[0]
    turn = np.array([0.0, 0.0, 2.0])
    path = arc_path(start, start.translation + np.array([0.0, 0.0, 7.0]), turn)
    np.testing.assert_allclose(places(path), np.tile(start.translation, (2001, 1)), atol=1e-15)
    assert path.length == pytest.approx(1.0)
    assert path.degree == 1
    assert arc_path(start, start.translation, turn, "kept").degree == 0
    assert arc_path(start, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]).degree == 0


@given(st.integers(0, 10**6), st.sampled_from([1e-6, 1.0, 1e4]))
def test_through_three_points(seed: int, scale: float) -> None:
    start, end = random_poses(seed, 2)
    rng = np.random.default_rng(seed)
    start.translation, end.translation = scale * start.translation, scale * end.translation
    middle, normal = scale * rng.normal(size=3), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    x = np.cross(normal, rng.normal(size=3))
    angles = np.cumsum(rng.uniform(0.3, 3.0, size=2))
    points = [middle + scale * pin.exp3(angle * normal) @ x for angle in (0.0, *angles)]
    start.translation, end.translation = points[0], points[2]
    path = arc_through(start, points[1], end)
    reach = scale * float(np.linalg.norm(x))
    assert np.abs(np.linalg.norm(places(path) - middle, axis=1) - reach).max() < 1e-9 * reach
    np.testing.assert_allclose(path.evaluate(path.knots)[0], start.homogeneous, atol=1e-11 * (1.0 + scale))
    np.testing.assert_allclose(path.evaluate(path.knots)[-1], end.homogeneous, atol=1e-11 * (1.0 + scale))
    # The way round on which the point between lies: passed after its share of the arc
    between = path.evaluate(np.array([path.length * angles[0] / angles[1]]))[0]
    np.testing.assert_allclose(between[:3, 3], points[1], atol=1e-9 * reach)
    turn = np.linalg.norm(pin.log3(end.rotation @ start.rotation.T))
    assert path.length == pytest.approx(reach * angles[1] + 0.5 * turn, rel=1e-8)
