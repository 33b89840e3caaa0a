"""Derivatives of paths of poses against differences of their poses; rotations stay rotations; both sides of knots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from tests.trajectory.path_checks import off_orthonormal, random_poses, steps_at_knots, worst_derivative
from wbc.trajectory import Path, arc_path, arc_through, geodesic_path, pose_polyline, pose_spline

START = random_poses(1, 1)[0]


def placed(rotation: pin.SE3, place: pin.SE3) -> pin.SE3:
    return pin.SE3(rotation.rotation, place.translation)


PATHS: dict[str, Callable[[int], Path]] = {
    "geodesic": lambda seed: geodesic_path(*random_poses(seed, 2)),
    "polyline": lambda seed: pose_polyline(random_poses(seed, 5), 0.05),
    "polyline of one radius": lambda seed: pose_polyline(random_poses(seed, 5), 10.0, 10.0, radius=2.0),
    "turns on the spot": lambda seed: pose_polyline([placed(p, START) for p in random_poses(seed, 4)], 0.1),
    "places without turns": lambda seed: pose_polyline([placed(START, p) for p in random_poses(seed, 4)], 0.1),
    "arc, carried": lambda seed: arc_path(random_poses(seed, 1)[0], [1.0, 2.0, 3.0], [0.3, 4.0, -1.0]),
    "arc, kept": lambda seed: arc_path(random_poses(seed, 1)[0], [1.0, 2.0, 3.0], [0.3, 4.0, -1.0], "kept"),
    "arc on its axis": lambda seed: arc_path(random_poses(seed, 1)[0], START.translation, [0.3, 2.0, -1.0]),
    "arc through": lambda seed: arc_through(random_poses(seed, 2)[0], [1.0, 2.0, 3.0], random_poses(seed, 2)[1]),
    "spline": lambda seed: pose_spline(random_poses(seed, 5)),
    "spline, clamped": lambda seed: pose_spline(random_poses(seed, 5), "clamped"),
    "spline, natural": lambda seed: pose_spline(random_poses(seed, 5), "natural"),
    "spline of two, clamped": lambda seed: pose_spline(random_poses(seed, 2), "clamped"),
}


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", PATHS)
def test_derivatives(name: str, seed: int) -> None:
    path = PATHS[name](seed)
    for order in (1, 2, 3):
        size = np.abs(path.evaluate(np.linspace(path.knots[0], path.knots[-1], 50), order)).max()
        if size < 1e-9:
            continue
        assert worst_derivative(path, order) < 2e-6


@pytest.mark.parametrize("name", PATHS)
def test_rotations_stay_rotations(name: str) -> None:
    for seed in range(5):
        assert off_orthonormal(PATHS[name](seed)) < 4e-15


@pytest.mark.parametrize("name", PATHS)
def test_pose_twist_and_its_derivative_are_continuous(name: str) -> None:
    for seed in range(5):
        path = PATHS[name](seed)
        for order, scale in ((0, 1e-14), (1, 1e-13), (2, 1e-12)):
            size = np.abs(path.evaluate(np.linspace(path.knots[0], path.knots[-1], 50), order)).max()
            assert steps_at_knots(path, order) < scale * (1.0 + size)


@pytest.mark.parametrize("name", PATHS)
def test_speeds_are_those_of_metres_and_radians_together(name: str) -> None:
    path = PATHS[name](3)
    radius = 2.0 if name == "polyline of one radius" else 0.5
    twist = path.evaluate(np.linspace(path.knots[0], path.knots[-1], 4001), 1)
    speed = np.linalg.norm(twist[:, :3], axis=1) + radius * np.linalg.norm(twist[:, 3:], axis=1)
    assert np.isfinite(speed).all()
    if "spline" in name:
        assert speed.max() < 10.0
    elif "polyline" in name or name in ("turns on the spot", "places without turns"):
        assert speed.max() < 1.0 + 1e-12
    else:
        np.testing.assert_allclose(speed, 1.0, atol=1e-12)
