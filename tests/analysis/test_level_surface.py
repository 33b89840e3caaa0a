"""Surfaces of relations as triangles."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.analysis.loci.pictures import zero_surface
from wbc.errors import ShapeError

TICKS = np.linspace(-1.0, 1.0, 41)
X, Y, Z = np.meshgrid(TICKS, TICKS, TICKS, indexing="ij")


def areas(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2


def test_a_sphere_has_its_area_its_volume_and_its_outside() -> None:
    triangles = zero_surface(X * X + Y * Y + Z * Z - 0.8**2, TICKS)
    assert np.abs(np.linalg.norm(triangles, axis=2) - 0.8).max() < 2e-3
    area = areas(triangles)
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(4 * np.pi * 0.8**2, rel=2e-3)
    # each triangle points outward, so the signed cones add up to the ball
    assert np.einsum("ij,ij->", area, triangles.mean(axis=1)) / 3 == pytest.approx(4 / 3 * np.pi * 0.8**3, rel=4e-3)
    # closed: every edge belongs to two triangles
    ends = np.round(triangles, 9)
    seen: dict[frozenset[tuple[float, ...]], int] = {}
    for a, b, c in ends[np.linalg.norm(area, axis=1) > 0]:
        for pair in ((a, b), (b, c), (c, a)):
            edge = frozenset(tuple(p.tolist()) for p in pair)
            seen[edge] = seen.get(edge, 0) + 1
    assert set(seen.values()) == {2}


def test_a_plane_is_exact() -> None:
    triangles = zero_surface(X + 2 * Y - 0.33, TICKS)
    assert np.abs(triangles[..., 0] + 2 * triangles[..., 1] - 0.33).max() < 1e-12
    area = areas(triangles)
    assert (area @ [1.0, 2.0, 0.0] >= 0.0).all()
    # x goes all the way from -1 to 1, and y half as far
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(2 * 2 * np.sqrt(5) / 2, rel=1e-9)


def test_no_zero_no_triangle_and_a_grid_of_another_size_is_refused() -> None:
    assert zero_surface(np.ones((41, 41, 41)), TICKS).shape == (0, 3, 3)
    with pytest.raises(ShapeError, match="expected shape"):
        zero_surface(np.ones((41, 41, 40)), TICKS)
