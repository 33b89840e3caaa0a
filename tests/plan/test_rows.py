"""Rows that hold on whole paths: level cups, trays in two hands, cones, planar bases, mimic joints and closed loops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED
from tests.plan.scenes import CoalJudge, at, base_with_a_body, mechanism, tray
from tests.repeats import repeats
from wbc.errors import InfeasibleError
from wbc.plan import MotionPlanner, PlannedPath
from wbc.shapes import Box

DOWN = pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0)


def behind_a_wall(*items: tuple[str, object]) -> wbc.Stack:
    """A Panda whose hand goes from one side of a wall to the other."""
    stack = wbc.Stack(wbc.robots.load("panda"), dt=0.01)
    stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.Obstacle(Box((0.3, 0.05, 0.5)), pose=at(0.5, 0.0, 0.25), margin=0.003), name="wall")
    for name, item in items:
        stack.add(item, name=name)
    return stack


def samples(path: PlannedPath, count: int = 400) -> np.ndarray:
    """Configurations all along the smooth path."""
    smooth = path.smooth
    return path.coordinates.configuration(smooth.evaluate(np.linspace(smooth.knots[0], smooth.knots[-1], count)))


def across(stack: wbc.Stack, keep: tuple[str, ...] = (), seed: int = 0) -> tuple[MotionPlanner, PlannedPath]:
    planner = stack.planner(keep=keep)
    free = behind_a_wall().planner()
    start = free.plan(stack.robot.neutral, {"hand": pin.SE3(DOWN, np.array([0.5, 0.3, 0.25]))}).q[-1]
    return planner, planner.plan(start, {"hand": pin.SE3(DOWN, np.array([0.5, -0.3, 0.2]))}, seed=seed)


def test_a_cup_stays_level() -> None:
    """The task's error is 0 on the whole spline, which is clear by Coal."""
    stack = behind_a_wall(("cup", wbc.tasks.AxisAlign("panda_hand_tcp", axis=(0, 0, -1))))
    planner, path = across(stack, ("cup",))
    judge = CoalJudge(stack)
    for q in samples(path):
        assert stack.robot.pose(q, "panda_hand_tcp").rotation[2, 2] == pytest.approx(-1.0, abs=1e-9)
        assert judge.margin(q) > -1.1e-4
    assert path.law().certificate.satisfied
    with pytest.raises(InfeasibleError, match=r"goal: no configuration that meets hand"):
        planner.plan(path.q[0], {"hand": pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.5]))})


def test_a_cup_stays_within_a_cone_and_a_box() -> None:
    cone = wbc.tasks.AxisCone("panda_hand_tcp", axis=(0, 0, -1), half_angle=0.05)
    box = wbc.tasks.WorkspaceBox("panda_hand_tcp", lower=(0.2, -0.4, 0.1), upper=(0.6, 0.4, 0.75))
    stack = behind_a_wall(("cup", cone), ("box", box))
    _, path = across(stack)
    for q in samples(path):
        pose = stack.robot.pose(q, "panda_hand_tcp")
        assert np.arccos(min(1.0, -pose.rotation[2, 2])) < 0.05 + 1e-6
        assert (pose.translation > np.array([0.2, -0.4, 0.1]) - 1e-6).all()
        assert (pose.translation < np.array([0.6, 0.4, 0.75]) + 1e-6).all()


@pytest.mark.parametrize("seed", range(repeats(1)))
def test_a_tray_stays_between_two_hands(seed: int) -> None:
    planner, hands = tray()
    robot = planner.stack.robot
    grasp = robot.pose(robot.neutral, hands[0]).actInv(robot.pose(robot.neutral, hands[1]))
    place = robot.pose(robot.neutral, hands[0]).translation
    path = planner.plan(robot.neutral, {"left": place + np.array([0.1, 0.1, 0.15])}, seed=seed)
    assert np.linalg.norm(robot.pose(path.q[-1], hands[0]).translation - place - [0.1, 0.1, 0.15]) < 1e-6
    for q in samples(path):
        held = robot.pose(q, hands[0]).actInv(robot.pose(q, hands[1]))
        assert np.linalg.norm(pin.log6(grasp.actInv(held)).vector) < 1e-5


def test_a_planar_base_drives_round_a_wall() -> None:
    robot = base_with_a_body()
    frame = robot.frames["base"]
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector(frame, kind="position"), name="base")
    stack.add(wbc.tasks.Obstacle(Box((0.1, 2.0, 1.0)), pose=at(1.0, 0.0, 0.5), margin=0.02), name="wall")
    goal = robot.pose(robot.neutral, frame).translation + np.array([2.0, 0.0, 0.0])
    path = stack.plan(robot.neutral, {"base": goal})
    assert np.abs(path.points[:, 1]).max() > 1.0
    judge = CoalJudge(stack)
    assert judge.least(path, 0.01) > -1.1e-4
    q, v = path.configurations(path.law(), np.linspace(0.0, 1.0, 9))
    later, _ = path.configurations(path.law(), np.linspace(0.0, 1.0, 9) + 1e-6)
    for one, rate, other in zip(q, v, later, strict=True):
        np.testing.assert_allclose(robot.difference(one, other) / 1e-6, rate, atol=1e-4)


def test_a_joint_that_is_fixed_no_longer_moves_again() -> None:
    planner = behind_a_wall(("still", wbc.tasks.Fixed(["panda_joint1"]))).planner()
    start = planner.stack.robot.neutral
    goal = start + np.eye(len(start))[0] * 0.3
    with pytest.raises(InfeasibleError, match="panda_joint1 is beyond its limit"):
        planner.plan(start, goal)
    planner["still"].enabled = False
    assert np.allclose(planner.plan(start, goal).q[-1], goal)


def test_fingers_that_mimic_follow() -> None:
    robot = wbc.robots.load("panda", lock=())
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.JointLimits())
    c, index, goal = robot.couplings[0], robot.position_index, robot.neutral.copy()
    goal[index[0]] += 0.5
    goal[index[c.leader]] += 0.02
    goal[index[c.follower]] = c.ratio * goal[index[c.leader]] + c.offset
    path = stack.plan(robot.neutral, goal)
    np.testing.assert_allclose(path.q[-1], goal, atol=1e-9)
    np.testing.assert_allclose(
        path.q[:, index[c.follower]], c.ratio * path.q[:, index[c.leader]] + c.offset, atol=1e-12
    )
    goal[index[c.follower]] += 0.002
    for what, start, end in (("goal", robot.neutral, goal), ("q0", goal, robot.neutral)):
        with pytest.raises(InfeasibleError, match=rf"{what}: panda_finger_joint2 follows .*joint1 and is 0.002 m from"):
            stack.plan(start, end)


def test_a_slow_follower_slows_its_leader() -> None:
    robot = wbc.robots.load("panda", lock=())
    c, goal = robot.couplings[0], robot.neutral.copy()
    goal[[robot.position_index[dof] for dof in (c.leader, c.follower)]] += (0.03, 0.03 * c.ratio)
    slow = {robot.dof_names[c.follower]: 0.01}
    for limits in ({"velocity": slow}, {"acceleration": slow}):
        path = wbc.Stack(robot.with_limits(**limits), dt=0.01).add(wbc.tasks.JointLimits()).plan(robot.neutral, goal)
        for law in (path.law(), path.law(jerk=True)):
            rates = path.configurations(law, np.linspace(0.0, law.duration, 500))[1][:, c.follower]
            rates = np.diff(rates) / law.duration * 499.0 if "acceleration" in limits else rates
            assert 0.0099 < np.abs(rates).max() < 0.01 * (1.0 + 1e-6)


@pytest.mark.filterwarnings("error:divide")
def test_a_follower_that_stands_still_limits_nothing(tmp_path: Path) -> None:
    joints = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="l{k}"/>'
        f'<axis xyz="0 0 1"/><limit lower="0" upper="1" velocity="1" effort="1"/>{mimic}</joint>'
        for k, parent, mimic in ((0, "base", ""), (1, "l0", '<mimic joint="j0" multiplier="0"/>'))
    )
    file = tmp_path / "two.urdf"
    file.write_text(f'<robot name="two"><link name="base"/>{joints}</robot>')
    stack = wbc.Stack(wbc.robots.load(file), dt=0.01)
    stack.add(wbc.tasks.JointLimits())
    assert stack.plan(np.zeros(2), np.array([0.5, 0.0])).q[-1].tolist() == [0.5, 0.0]


def test_without_a_compiler_rows_run_on_the_virtual_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same path, from the same expressions."""
    stack = behind_a_wall(("cup", wbc.tasks.AxisAlign("panda_hand_tcp", axis=(0, 0, -1))))
    _, compiled = across(stack, ("cup",))
    monkeypatch.setattr("wbc.native.toolchain.available", lambda: False)
    _, interpreted = across(stack, ("cup",))
    np.testing.assert_allclose(interpreted.points, compiled.points, atol=1e-6)


@pytest.mark.parametrize("name", list(NAMED))
@pytest.mark.parametrize("seed", range(repeats(2)))
def test_closed_loops_stay_closed(name: str, seed: int) -> None:
    """To a configuration that the mechanism can be moved to by small steps."""
    stack, start, goal = mechanism(name, np.random.default_rng(seed))
    robot = stack.robot
    assert np.linalg.norm(robot.difference(start, goal)) > 0.1
    path = stack.plan(start, goal, seed=seed)
    for end, wanted in ((path.q[0], start), (path.q[-1], goal)):
        np.testing.assert_allclose(robot.difference(end, wanted), 0.0, atol=1e-9)
    law = path.law()
    timed, _ = path.configurations(law, np.linspace(0.0, law.duration, 50))
    straight = [(1.0 - s) * path.points[:-1] + s * path.points[1:] for s in (0.25, 0.5)]
    for q in (*samples(path, 100), *timed, *path.coordinates.configuration(np.concatenate(straight))):
        assert max(robot.loop_gaps(q).values()) < 1e-6
