"""Published facts about the holds of the three-armed walker (M. R. Patterson's thesis), lengths in inches: section
4.2.2 and the grid of the listings. Its arm is in test_three_arm_walker_arms.py and tests/robots/test_walker.py.
"""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

from wbc.climb.grids import cylinder_grid, grid_angle, grid_pose
from wbc.climb.scene import FLIP
from wbc.robots.walker_data import INCH

SCENE = cylinder_grid()


def zyz(alpha: float, beta: float, gamma: float) -> np.ndarray:
    """(2-5), as printed."""
    sa, ca, sb, cb, sg, cg = sin(alpha), cos(alpha), sin(beta), cos(beta), sin(gamma), cos(gamma)
    return np.array(
        [
            [ca * cb * cg - sa * sg, -ca * cb * sg - sa * cg, ca * sb],
            [sa * cb * cg + ca * sg, -sa * cb * sg + ca * cg, sa * sb],
            [-sb * cg, sb * sg, cb],
        ]
    )


@pytest.mark.parametrize(
    ("hold", "position"),
    [("13,12", (0, 100, -111)), ("1,1", (-86.6025, 50, -9.25)), ("25,24", (86.6025, 50, -222))],
)
def test_6_holds_of_the_cylinder(hold: str, position: tuple[float, float, float]) -> None:
    place = SCENE.footholds[SCENE.row(hold)].pose * FLIP
    np.testing.assert_allclose(place.translation / INCH, position, atol=1e-4)
    inward = -np.array([*place.translation[:2], 0.0]) / np.linalg.norm(place.translation[:2])
    np.testing.assert_allclose(place.rotation[:, 2], inward, atol=1e-12)
    np.testing.assert_allclose(place.rotation[:, 0], [0, 0, -1], atol=1e-12)


def test_6_the_nominal_frame_is_a_zyz_matrix_and_back() -> None:
    np.testing.assert_allclose(grid_pose(13, 12).rotation, [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], atol=1e-12)
    for t, a, heading in ((1, 1, 0.0), (7.3, 20.1, 0.4), (25, 24, -1.2)):
        angle = grid_angle(t)
        assert angle == pytest.approx(radians(25 + 5 * t))
        rotation = grid_pose(t, a, heading=heading).rotation
        np.testing.assert_allclose(rotation, zyz(-angle, pi / 2, heading), atol=1e-12)
        # Back: alpha and gamma from the third column and row, beta = 90 degrees
        assert np.arctan2(rotation[1, 2], rotation[0, 2]) == pytest.approx(-angle)
        assert np.arctan2(rotation[2, 1], -rotation[2, 0]) == pytest.approx(heading)
