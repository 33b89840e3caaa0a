"""Bases whose wheels must not slip: paths by turns and drives that keep the rows, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wbc
from tests.plan.rolling_bases import rolling_problem, rolling_stack, slip_rows, urdf
from tests.plan.scenes import CoalJudge, at
from tests.repeats import repeats
from wbc.errors import CommandError
from wbc.plan import PathFollower, PlannedPath
from wbc.robot import Robot
from wbc.shapes import Box

#: What a proof leaves open [m]
OPEN = 1.1e-4


def slip(robot: Robot, path: PlannedPath, wheels: tuple[str, ...], samples: int = 500) -> float:
    """The greatest speed of what touches the ground, by Pinocchio, along a law [m/s]."""
    law, data = path.law(), robot.model.createData()
    q, v = path.configurations(law, np.linspace(0.0, law.duration, samples))
    dofs = [robot.dofs(f"{wheel}_joint").start for wheel in wheels]
    return max(np.abs(slip_rows(robot, data, a, dof) @ b).max() for a, b in zip(q, v, strict=True) for dof in dofs)


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_a_base_with_any_axle_and_an_arm_goes_where_there_is_a_way(seed: int, tmp_path: Path) -> None:
    """Clear by Coal, without slip by Pinocchio, and wheels have turned by what the law says of their rates."""
    file = tmp_path / "base.urdf"
    file.write_text(urdf(seed))
    problem = rolling_problem(seed, file)
    stack, robot, wheels = problem.stack, problem.stack.robot, ("wheel0", "wheel1")
    path, judge = stack.plan(problem.start, problem.goal, seed=seed), CoalJudge(problem.stack)
    off = robot.difference(path.q[-1], problem.goal)
    turning = [robot.dofs(f"{wheel}_joint").start for wheel in wheels]
    assert np.abs(np.delete(off, turning)).max() < 1e-9
    assert judge.least(path, 0.02) > -OPEN
    assert slip(robot, path, wheels) < 1e-6
    law = path.law()
    t = np.linspace(0.0, law.duration, 300)
    q, v = path.configurations(law, t)
    assert min(judge.margin(x) for x in q[::5]) > -OPEN
    later, _ = path.configurations(law, t + 1e-4)
    for a, b, rate in zip(q[:-1], later[:-1], v[:-1], strict=True):
        np.testing.assert_allclose(robot.difference(a, b) / 1e-4, rate, atol=2e-3)


def test_what_a_differential_base_plans_its_controller_does() -> None:
    """Round a wall, by the tick with its row against sideways motion; the follower ends where the path ends."""
    robot = wbc.robots.load("tiago", shapes="fit").with_limits(velocity={"root_joint": [0.5, 0.5, 0.5]})
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.Posture(robot.joint_names, gain=20.0), name="posture")
    stack.add(wbc.tasks.JointLimits(acceleration=False))
    stack.add(wbc.tasks.Obstacle(Box((0.1, 2.0, 1.0)), pose=at(1.2, 0.0, 0.5), margin=0.02), name="wall")
    goal = robot.integrate(robot.neutral, 2.5 * np.eye(robot.nv)[0])
    planner, controller = stack.planner(), stack.compile()
    path = planner.plan(robot.neutral, goal)
    assert np.abs(path.points[:, 1]).max() > 1.0
    follower, q, last = PathFollower(planner, path, goal), robot.neutral, robot.neutral
    for _ in range(5000):
        state = follower.advance(stack.dt)
        controller["posture"].set(target=last, feedforward=robot.difference(last, state.q) / stack.dt)
        step, last = controller.step(q), state.q
        assert step.status == "solved"
        assert abs(step.v[1]) < 1e-6
        q = robot.integrate(q, step.v, stack.dt)
        assert np.abs(robot.difference(q, state.q)).max() < 1e-3
        if state.arrived:
            break
    np.testing.assert_allclose(robot.difference(q, goal), 0.0, atol=2e-3)


def test_a_level_cup_is_carried_on_wheels() -> None:
    """Equalities of the arm are projected onto, while the base goes as it must."""
    robot = wbc.robots.load("tiago", shapes="none")
    hand = robot.frames["tip"]
    stack = wbc.Stack(robot, dt=0.01)
    up = robot.pose(robot.neutral, hand).rotation[2]
    stack.add(wbc.tasks.AxisAlign(hand, axis=tuple(up)), name="cup")
    stack.add(wbc.tasks.EndEffector(hand, kind="position"), name="hand")
    stack.add(wbc.tasks.JointLimits())
    target = robot.pose(robot.neutral, hand).translation + np.array([0.8, -0.6, 0.05])
    path = stack.planner(keep=("cup",)).plan(robot.neutral, {"hand": target})
    law = path.law()
    q, v = path.configurations(law, np.linspace(0.0, law.duration, 400))
    assert np.abs(v[:, 1]).max() < 1e-6
    assert max(np.abs(robot.pose(x, hand).rotation[2] - up).max() for x in q) < 1e-5


def test_a_base_on_omni_wheels_drives_any_way_and_turns(tmp_path: Path) -> None:
    """What its wheels turn by is what their rollers leave: the speed along each roller's axis is 0."""
    file = tmp_path / "omni.urdf"
    file.write_text(urdf(1, tuple(np.arange(3) * 2.0 * np.pi / 3.0)))
    robot = wbc.robots.load(file, base="planar")
    wheels = tuple(f"wheel{k}" for k in range(3))
    stack = rolling_stack(robot, *wheels, roller=0.0)
    goal = robot.integrate(robot.neutral, np.array([1.0, 2.0, 2.0, *np.zeros(robot.nv - 3)]))
    path = stack.plan(robot.neutral, goal)
    law, data, forwards = path.law(), robot.model.createData(), 0.0
    q, v = path.configurations(law, np.linspace(0.0, law.duration, 200))
    for a, b in zip(q, v, strict=True):
        for wheel in wheels:
            axis = robot.pose(a, wheel).rotation[:2, 2]
            slip_now = slip_rows(robot, data, a, robot.dofs(f"{wheel}_joint").start) @ b
            forwards = max(forwards, abs(axis[1] * slip_now[0] - axis[0] * slip_now[1]))
    assert forwards < 1e-6
    assert np.abs(v[:, [robot.dofs(f"{wheel}_joint").start for wheel in wheels]]).max() > 0.5
    np.testing.assert_allclose(robot.difference(path.q[-1], goal)[:3], 0.0, atol=1e-9)


def test_what_is_not_steered_so_is_refused_by_name(tmp_path: Path) -> None:
    """A car, and wheels that no base carries; without the row there is a path."""
    file = tmp_path / "car.urdf"
    file.write_text(urdf(0, steered=True))
    for base, wheels, says in (
        ("planar", ("wheel0", "wheel1", "front"), "steered"),
        ("fixed", ("front",), "fixed base"),
    ):
        robot = wbc.robots.load(file, base=base)
        planner = rolling_stack(robot, *wheels).planner()
        with pytest.raises(CommandError, match=f"wheels: .*{says}"):
            planner.plan(robot.neutral, robot.neutral)
        planner["wheels"].enabled = False
        assert planner.plan(robot.neutral, robot.neutral).length == 0.0
