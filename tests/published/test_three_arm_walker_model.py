"""Published facts about the arm and the holds of the three-armed walker (M. R. Patterson's thesis).

Table II, equations (3-4) to (3-12), section 4.2.2 and the grid of the listings; lengths in inches.
"""

from __future__ import annotations

from math import cos, hypot, pi, radians, sin

import numpy as np
import pinocchio as pin
import pytest

from wbc.climb.grids import cylinder_grid, grid_angle, grid_pose
from wbc.climb.scene import FLIP
from wbc.robots import walker
from wbc.robots.walker_data import INCH

WALKER = walker()
DATA = WALKER.arm_data
SCENE = cylinder_grid()


def hand(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(position of the first arm's hand in inches, its rotation) in the arm's base; angles [rad]."""
    model, arm = WALKER.robot.model, WALKER.arms[0]
    data, q = model.createData(), WALKER.robot.neutral.copy()
    q[7:13] = angles
    pin.framesForwardKinematics(model, data, q)
    body = data.oMi[1]
    pose = (body * arm.base).actInv(data.oMf[model.getFrameId(arm.hand)])
    return pose.translation / INCH, pose.rotation


def wrist(angles: np.ndarray) -> np.ndarray:
    """The wrist in inches, 6 in before the hand."""
    position, rotation = hand(angles)
    return np.asarray(position - 6.0 * rotation[:, 2])


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


def test_1_zero_posture_and_initial_posture() -> None:
    position, rotation = hand(np.zeros(6))
    np.testing.assert_allclose(position, [0, 6, 66], atol=1e-4)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    initial = np.array(DATA.initial_posture)
    np.testing.assert_allclose(np.degrees(initial), [0, 90, -85, 0, -5, 0], atol=1e-12)
    position, rotation = hand(initial)
    np.testing.assert_allclose(position, [18.4816, 6, 48.9353], atol=1e-4)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(wrist(initial), [18.4816, 6, 42.9353], atol=1e-4)


def test_joint_limits_of_table_I() -> None:
    degrees = np.degrees(WALKER.robot.limits.position_upper[6:12])
    np.testing.assert_allclose(degrees, [160, 165, 135, 135, 105, 270], rtol=1e-13)


def test_4_the_artificial_limits_cost_little_reach() -> None:
    data = DATA
    bent = hypot(
        data.upper_arm_length + data.forearm_length * cos(data.elbow_limit), data.forearm_length * sin(data.elbow_limit)
    )
    lost = (data.upper_arm_length + data.forearm_length - bent) / INCH
    assert lost < 0.01
    assert lost == pytest.approx(0.0013, abs=5e-5)
    # The wrist at the shoulder limit with the arm as long as it gets, against the shoulder's offset
    q = np.array([0.0, -data.elbow_limit / 2 + data.shoulder_limit, data.elbow_limit, 0.0, 0.0, 0.0])
    assert np.hypot(*wrist(q)[:2]) - 6 == pytest.approx(0.0293, abs=5e-5)


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


def test_there_are_25_by_24_holds_at_radius_100() -> None:
    assert len(SCENE.footholds) == 600
    assert [SCENE.footholds[k].id for k in (0, -1)] == ["1,1", "25,24"]
    np.testing.assert_allclose(np.hypot(*SCENE.positions[:, :2].T) / INCH, 100.0, rtol=1e-14)
