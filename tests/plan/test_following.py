"""Laws of planned paths, what follows them while obstacles move, and the command line."""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

import wbc
from tests.plan.scenes import CoalJudge, at, panda, reaching
from wbc.cli.app import app
from wbc.errors import InfeasibleError
from wbc.plan import PathFollower
from wbc.trajectory import load

POST = ((0.1, 0.1, 0.8), (0.5, 0.0, 0.4))


def test_a_law_keeps_its_limits_and_is_clear_between_its_samples() -> None:
    stack = panda(POST)
    robot, judge = stack.robot, CoalJudge(stack)
    start, goal = (robot.neutral + np.array([a, 0.5, 0, 0.3, 0, 0, 0]) for a in (-0.7, 0.7))
    path = stack.plan(start, goal)
    assert len(path.points) > 2
    for law in (path.law(), path.law(velocity=0.5, acceleration=1.0)):
        assert law.certificate.satisfied
        q, v = path.configurations(law, np.linspace(0.0, law.duration, 500))
        np.testing.assert_allclose(q[[0, -1]], [start, goal], atol=1e-9)
        np.testing.assert_allclose(v[[0, -1]], 0.0, atol=1e-9)
        assert (np.abs(v) <= robot.limits.velocity * (1.0 + 1e-6)).all()
        assert min(judge.margin(x) for x in q) > -1.1e-4
    assert np.abs(v).max() <= 0.5 * (1.0 + 1e-6)


def test_a_controller_follows_and_arrives() -> None:
    stack = panda(POST)
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-2)
    robot = stack.robot
    start, goal = (robot.neutral + np.array([a, 0.5, 0, 0.3, 0, 0, 0]) for a in (-0.7, 0.7))
    planner = stack.planner()
    follower = PathFollower(planner, planner.plan(start, goal), goal)
    driven = wbc.Stack(robot, dt=0.01).add(wbc.tasks.Posture(gain=10.0), name="posture").add(wbc.tasks.JointLimits())
    controller, q, judge = driven.compile(), start.copy(), CoalJudge(stack)
    while not (state := follower.advance(0.01)).arrived:
        controller["posture"].set(target=state.q, feedforward=state.v)
        q = robot.integrate(q, controller.step(q).v, 0.01)
        assert judge.margin(state.q) > -1.1e-4
    assert np.abs(state.q - goal).max() < 1e-9
    assert np.abs(q - goal).max() < 0.05


def test_an_obstacle_that_moves_into_the_path_makes_it_brake_and_plan_anew() -> None:
    stack = panda(((0.1, 0.1, 0.8), (0.5, 1.5, 0.4)))
    robot = stack.robot
    start, goal = (robot.neutral + np.array([a, 0.5, 0, 0.3, 0, 0, 0]) for a in (-0.9, 0.9))
    planner = stack.planner()
    follower = PathFollower(planner, planner.plan(start, goal), goal)
    before, braked, states = start, False, []
    for tick in range(2000):
        state = follower.advance(0.005)
        states.append(state)
        fastest = np.abs(state.q - before).max() / 0.005
        assert fastest <= robot.limits.velocity.max() * 1.01
        before = state.q
        if tick == 20:
            assert follower.check()
            planner["box0"].pose = at(*POST[1])
            assert not follower.check()
        braked |= state.braking
        if state.arrived:
            break
    assert braked
    assert states[-1].arrived
    np.testing.assert_allclose(states[-1].q, goal, atol=1e-9)
    moved = CoalJudge(stack, {"box0": at(*POST[1])})
    assert min(moved.margin(state.q) for state in states[21:]) > -1.1e-4


def braked(wait: bool) -> PathFollower:
    """A follower that an obstacle has made brake a moment ago; the plan from where it will rest is made."""
    stack = panda(((0.1, 0.1, 0.8), (0.5, 1.5, 0.4)))
    start, goal = (stack.robot.neutral + np.array([a, 0.5, 0, 0.3, 0, 0, 0]) for a in (-0.9, 0.9))
    planner = stack.planner()
    follower = PathFollower(planner, planner.plan(start, goal), goal, wait=wait)
    follower.advance(0.1)
    planner["box0"].pose = at(*POST[1])
    assert not follower.check()
    return follower


def test_a_path_is_planned_anew_while_it_brakes() -> None:
    """From where it will rest; it stands where the plan takes longer, and does not wait."""
    follower = braked(wait=False)
    assert follower._next is not None
    path, law = follower._next.result()
    assert follower.time == 0.0
    rest, _ = follower.path.configurations(follower.law, follower.law.duration)
    np.testing.assert_allclose(path.q[0], rest, atol=1e-12)
    planned, follower._next = follower._next, Future()
    state = follower.advance(follower.law.duration)
    for _ in range(3):
        state = follower.advance(0.01)
        np.testing.assert_allclose(state.q, rest, atol=1e-9)
        assert (state.braking, state.arrived) == (True, False)
    follower._next = planned
    assert not follower.advance(0.01).braking
    assert follower.law is law


def test_a_new_path_that_is_blocked_before_it_begins_is_planned_again() -> None:
    follower = braked(wait=True)
    assert follower._next is not None
    path, law = follower._next.result()
    planner = follower._planner
    # In the way, but clear of both ends
    for share in np.linspace(0.3, 0.7, 9):
        q, _ = path.configurations(law, share * law.duration)
        place = planner.stack.robot.pose(q, "panda_hand").translation + np.array([0.05, 0.0, 0.3])
        judge = CoalJudge(planner.stack, {"box0": at(*place)})
        if judge.margin(q) < -0.01 and min(judge.margin(end) for end in path.q[[0, -1]]) > 0.02:
            break
    else:
        raise AssertionError("no place is in the way of the path alone")
    planner["box0"].pose = at(*place)
    state = follower.advance(follower.law.duration)
    assert follower.path is not path
    while not state.arrived:
        state = follower.advance(0.02)
        assert judge.margin(state.q) > -1.1e-4


def test_what_cannot_stop_in_time_says_so() -> None:
    stack = panda(((0.1, 0.1, 0.8), (0.5, 1.5, 0.4)))
    robot = stack.robot
    start, goal = (robot.neutral + np.array([a, 0.5, 0, 0.3, 0, 0, 0]) for a in (-0.9, 0.9))
    planner = stack.planner()
    follower = PathFollower(planner, planner.plan(start, goal), goal)
    state = follower.advance(0.5 * follower.law.duration)
    planner["box0"].pose = at(*robot.pose(state.q, "panda_hand").translation)
    with pytest.raises(InfeasibleError, match=r"cannot come to rest before .*box0"):
        follower.check()
    assert follower.braking


def test_the_command_line(tmp_path: Path) -> None:
    runner, law = CliRunner(), tmp_path / "law.npz"
    box = ["--box", "0.55,0,0.35,0.2,0.1,0.7"]
    reach = reaching(0.45, -0.45, 0.3)
    x, y, z, w = pin.Quaternion(reach.rotation).coeffs()
    target = ["--target", f"0.45,-0.45,0.3,{x},{y},{z},{w}"]
    start = ["--start", "0.8,0.3,0,-2,0,2.3,0.8"]
    done = runner.invoke(app, ["plan", "panda", *start, *target, *box, "--out", str(law)])
    assert done.exit_code == 0, done.output
    assert "configurations" in done.output
    q = load(law).at(10.0).position
    assert np.linalg.norm(wbc.robots.load("panda").pose(q, "panda_hand_tcp").translation - reach.translation) < 1e-6
    bad = runner.invoke(app, ["plan", "panda", *start, "--target", "0.55,0,0.35", *box])
    assert bad.exit_code != 0
    assert "--to" in runner.invoke(app, ["plan", "panda", *start]).output
