"""What needs none of Pinocchio, Coal, toppra and ruckig: from a file to ticks, a law along a path, and a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wbc
from tests.multibody.own import own_pose
from wbc.extras import MissingPackageError
from wbc.multibody import PINOCCHIO, own, pin

LINK = (
    '<link name="{0}"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="0 0 0.3" rpy="0.3 0 0.2"/>'
    '<axis xyz="{4}"/><limit lower="-2" upper="2" effort="50" velocity="2"/></joint>'
)


def arm(folder: Path) -> Path:
    """Four joints: two that turn, one without end, one that slides."""
    kinds = (("revolute", "0 0 1"), ("continuous", "0 -1 0"), ("revolute", "0.6 0 0.8"), ("prismatic", "1 0 0"))
    parts = [LINK.format("link0")]
    for k, (kind, axis) in enumerate(kinds):
        parts += [LINK.format(f"link{k + 1}"), JOINT.format(f"joint{k + 1}", kind, f"link{k}", f"link{k + 1}", axis)]
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return path


@pytest.mark.parametrize("base", ["fixed", "floating", "planar"])
def test_ticks_reach_a_target_and_are_recorded(tmp_path: Path, base: str) -> None:
    robot = wbc.robots.load(arm(tmp_path), base=base)
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector("link4"), name="hand")
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
    controller = stack.compile(backend="vm")
    q, goal = robot.neutral, robot.integrate(robot.neutral, np.full(robot.nv, 0.2))
    target = controller["hand"].target = robot.pose(goal, "link4")
    with controller.record(tmp_path / "ticks.npz"):
        for _ in range(400):
            step = controller.step(q)
            q = robot.integrate(q, step.v, stack.dt)
    assert step.status.name.lower() == "solved"
    # The posture pulls a little
    assert np.linalg.norm(robot.pose(q, "link4").translation - target.translation) < 2e-3
    assert len(wbc.Recording(tmp_path / "ticks.npz").time) == 400


def test_a_law_along_a_path(tmp_path: Path) -> None:
    robot = wbc.robots.load("ur5", shapes="none")
    path = wbc.trajectory.spline_path(robot.neutral + np.outer([0.0, 0.2, 0.5], np.ones(6)))
    law = wbc.trajectory.jerk_limited_along(path, velocity=1.0, acceleration=2.0, jerk=20.0, cells=50)
    state = law.at(law.duration / 2)
    assert np.abs(state.velocity).max() <= 1.0 + 1e-9


def test_what_only_pinocchio_has_is_said_by_name() -> None:
    with pytest.raises(MissingPackageError, match=r"pinocchio: .*constraintDynamics.* pip install pin"):
        own.constraintDynamics  # noqa: B018  # a name of the module
    with pytest.raises(AttributeError, match="pip install pin"):
        own.Inertia.Zero().toPseudoInertia()
    if not PINOCCHIO:
        with pytest.raises(MissingPackageError, match="pip install coal"):
            wbc.robots.fit_shapes(wbc.robots.load("ur5", shapes="none"), ["forearm_link"])


def test_the_poses_of_robots_are_those_of_the_package() -> None:
    robot = wbc.robots.load("panda", shapes="none")
    pose = robot.pose(robot.neutral, "panda_hand_tcp")
    assert isinstance(pose, pin.SE3)
    assert own_pose(pose) == own.SE3(pose.homogeneous)
