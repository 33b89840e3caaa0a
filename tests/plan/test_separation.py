"""Goals that no path leads to are said to be so, with what is in the way; goals that a path leads to never are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.plan.rolling_bases import rolling_problem, urdf
from tests.plan.scenes import SHELF, at, base_with_a_body, panda, reaching
from tests.repeats import repeats
from wbc.plan import MotionPlanner, NoPathError
from wbc.shapes import Box, Cylinder

#: Radius of the body of :func:`base_with_a_body` [m]
RADIUS = 0.3


def said(planner: MotionPlanner, start: np.ndarray, goal: np.ndarray) -> str:
    """What separates two configurations."""
    native, of = planner.native(start), planner.coordinates.of_configuration
    return native.scene.separation(native.low, native.high, of(start), of(goal, of(start)))


def room(seed: int, door: float) -> wbc.Stack:
    """Four walls about a base, turned anyhow, of any thickness, with a door in the middle of one."""
    rng = np.random.default_rng(seed)
    stack, half, thick = wbc.Stack(base_with_a_body(), dt=0.01), rng.uniform(0.6, 1.5), rng.uniform(0.002, 0.1)
    yaw, middle = rng.uniform(-np.pi, np.pi), rng.uniform(-0.2, 0.2, 2)
    for k in range(4):
        for side in (-1.0, 1.0) if k == 0 else (0.0,):
            wide = 2.0 * half + thick if k else half - 0.5 * door + 0.5 * thick
            turn = pin.exp3(np.array([0.0, 0.0, yaw + 0.5 * np.pi * k]))
            place = turn @ np.array([half, side * 0.5 * (half + 0.5 * door + 0.5 * thick), 0.3]) + np.r_[middle, 0.0]
            wall = wbc.tasks.Obstacle(Box((thick, wide, 0.6)), pose=pin.SE3(turn, place), margin=0.01)
            stack.add(wall, name=f"wall{k}{side:+.0f}")
    return stack


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_a_base_leaves_a_room_by_a_door_that_is_wide_enough(seed: int) -> None:
    narrow, wide = (room(seed, 2.0 * RADIUS * share) for share in (0.8, 1.2))
    start = narrow.robot.neutral
    goal = narrow.robot.integrate(start, np.array([4.0, 0.0, 0.0]))
    for ends in ((start, goal), (goal, start)):
        with pytest.raises(NoPathError, match=r"no path leads to any of 1 goals: .* cannot get past wall0.*wall3"):
            narrow.plan(*ends)
    assert said(wide.planner(), start, goal) == ""
    assert len(wide.plan(start, goal, seed=seed).points) > 1


@pytest.mark.parametrize("seed", range(3))
def test_what_flies_does_not_leave_a_box(seed: int) -> None:
    rod = '<freejoint name="base"/><geom name="rod" type="capsule" size="0.05" fromto="-0.1 0 0 0.1 0 0" mass="1"/>'
    robot = wbc.robots.load(f'<mujoco><worldbody><body name="rod">{rod}</body></worldbody></mujoco>')
    turn, sides = pin.exp3(np.random.default_rng(seed).normal(size=3)), np.array([0.5, 0.6, 0.7])
    start, goal = robot.neutral.copy(), robot.neutral.copy()
    goal[0] = 2.0
    for lid in (True, False):
        stack = wbc.Stack(robot, dt=0.01)
        for k in range(6 if lid else 5):
            axis, size = np.eye(3)[k % 3], sides + 0.01
            size[k % 3] = 0.01
            place = (1.0 if k < 3 else -1.0) * 0.5 * sides * axis
            stack.add(wbc.tasks.Obstacle(Box(tuple(size)), pose=pin.SE3(turn, turn @ place)), name=f"side{k}")
        assert ("side0, side1, side2, side3, side4, side5" in said(stack.planner(), start, goal)) == lid


@pytest.mark.parametrize("second", [0.0, 0.25])
def test_a_joint_does_not_turn_past_a_post(second: float) -> None:
    """Whatever the joints beyond it do; where the post is within reach of these alone nothing is proven."""
    arm = '<geom type="capsule" size="0.05" fromto="0.1 0 0 0.5 0 0" mass="1"/>'
    fore = '<geom type="capsule" size="0.04" fromto="0.1 0 0 0.4 0 0" mass="1"/>'
    hinge = '<joint name="elbow" axis="0 0 1" range="-2.5 2.5"/>'
    body = f'<joint name="shoulder" axis="0 0 1" range="-2 2"/>{arm}<body pos="0.5 0 0">{hinge}{fore}</body>'
    text = f'<mujoco><compiler angle="radian"/><worldbody><body>{body}</body></worldbody></mujoco>'
    stack = wbc.Stack(wbc.robots.load(text), dt=0.01)
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.Obstacle(Cylinder(0.03, 1.0), pose=at(0.5 + second, 0.0, 0.0)), name="post")
    start, goal = np.array([-1.5, 0.0]), np.array([1.5, 0.0])
    if second:
        assert said(stack.planner(), start, goal) == ""
        assert stack.plan(start, goal).length > 3.0
        return
    with pytest.raises(NoPathError, match="cannot get past post, from the"):
        stack.plan(start, goal)


def test_nothing_is_said_of_what_a_path_leads_to(tmp_path: Path) -> None:
    """In a shelf, and of bases among things."""
    shelf = panda(*SHELF).planner()
    ends = [
        shelf.plan(shelf.stack.robot.neutral, {"hand": reaching(0.6, y, z)}).q[-1]
        for y, z in ((0.22, 0.22), (-0.22, 0.57))
    ]
    assert said(shelf, *ends) == ""
    for seed in range(repeats(1)):
        file = tmp_path / f"{seed}.urdf"
        file.write_text(urdf(seed))
        problem = rolling_problem(seed, file)
        planner = problem.stack.planner()
        planner.plan(problem.start, problem.goal)
        assert said(planner, problem.start, problem.goal) == ""
