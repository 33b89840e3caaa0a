"""Figures of a motion find what was put into it."""

from __future__ import annotations

import numpy as np

from tests.retarget.fake import humanoid
from wbc import robots
from wbc.multibody import pin
from wbc.retarget.figures import motion_figures, surface_points
from wbc.track.scene import link_meshes

ROBOT = humanoid()
FOOT = "l_ankle"


def standing(frames: int = 20) -> np.ndarray:
    """The robot at neutral with its lowest point on the ground."""
    q = np.tile(ROBOT.neutral, (frames, 1))
    q[:, 2] -= lowest(ROBOT.neutral)
    return q


def lowest(q: np.ndarray) -> float:
    """Height of the lowest corner of all triangles."""
    data = ROBOT.model.createData()
    pin.framesForwardKinematics(ROBOT.model, data, q)
    heights = []
    for link, triangles in link_meshes(ROBOT):
        pose = data.oMf[ROBOT.model.getFrameId(link)]
        heights.append((triangles @ pose.rotation.T + pose.translation)[..., 2].min())
    return float(min(heights))


def test_a_robot_that_stands_has_nothing_to_say() -> None:
    figures = motion_figures(ROBOT, 50.0, standing(), {FOOT: np.ones(20, dtype=bool)})
    assert figures["slide"] == 0.0
    assert figures["penetration"] < 1e-12
    assert figures["jumps"] == figures["velocity_breaches"] == figures["acceleration_breaches"] == 0


def test_depth_is_that_of_the_lowest_corner() -> None:
    random = np.random.default_rng(2)
    q = standing()
    for frame in range(len(q)):
        q[frame] = pin.integrate(ROBOT.model, q[frame], random.normal(0.0, 0.2, ROBOT.nv))
    deepest = max(0.0, *(-lowest(row) for row in q))
    figures = motion_figures(ROBOT, 50.0, q, {})
    assert abs(figures["penetration"] - deepest) < 1e-9
    assert sum(map(len, surface_points(ROBOT).values())) < sum(3 * len(t) for _, t in link_meshes(ROBOT))


def test_slides_count_in_stances_alone() -> None:
    q = standing()
    q[:, 0] += np.linspace(0.0, 0.19, 20)
    stands = np.zeros(20, dtype=bool)
    stands[5:11] = True
    assert abs(motion_figures(ROBOT, 50.0, q, {FOOT: stands})["slide"] - 0.05) < 1e-9
    assert motion_figures(ROBOT, 50.0, q, {FOOT: ~np.ones(20, dtype=bool)})["slide"] == 0.0
    # Up is no slide
    q = standing()
    q[:, 2] += np.linspace(0.0, 0.1, 20)
    assert motion_figures(ROBOT, 50.0, q, {FOOT: stands})["slide"] < 1e-12


def test_limits_and_jumps() -> None:
    q = standing()
    joint = ROBOT.nv - 5
    limit = ROBOT.limits.velocity[joint]
    place = int(ROBOT.position_index[joint])
    q[10:, place] += 1.5 * limit / 50.0
    figures = motion_figures(ROBOT, 50.0, q, {})
    assert figures["velocity_breaches"] == 1
    assert abs(figures["fastest"] - 1.5) < 1e-6
    assert figures["jumps"] == (2 if 1.5 * limit > 10.0 else 0)
    q = standing()
    q[3:5, place] = ROBOT.limits.position_upper[joint] + 0.01
    assert motion_figures(ROBOT, 1.0, q, {})["position_breaches"] == 2


def test_a_ball_may_turn_about_its_centre() -> None:
    robot, name = robots.load("g1", base="floating"), "left_ankle_roll_link"
    q = np.tile(robot.neutral, (20, 1))
    for frame in range(20):
        # About the foot's frame, with the robot as one body
        foot, base = robot.pose(q[0], name), pin.XYZQUATToSE3(q[0, :7])
        turn = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.02 * frame])), np.zeros(3))
        middle = pin.SE3(np.eye(3), foot.translation)
        q[frame, :7] = pin.SE3ToXYZQUAT(middle * turn * middle.inverse() * base)
    stands = {name: np.ones(20, dtype=bool)}
    assert motion_figures(robot, 50.0, q, stands)["slide"] > 0.01
    assert motion_figures(robot, 50.0, q, stands, balls={name})["slide"] < 1e-12
