"""Why a task does not converge: random cases whose reason is known by construction."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares

import wbc.robots
from tests.constraints.robots import robot as limited_robot
from tests.repeats import ALL, MORE, covering
from wbc.api import Controller, Stack
from wbc.controller import Policy, Step
from wbc.explain.reason import Reason
from wbc.robot import Robot
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, Expression, JointLimits, Obstacle, Posture, WorkspaceBox

ARMS = ("panda", "ur5", "kinova", "z1")
DT = 0.005


@cache
def arm(name: str) -> tuple[Robot, str, Controller]:
    """Robot, tip, and a position task without limits."""
    robot = wbc.robots.load(name)
    tip = robot.frames["tip"]
    stack = Stack(robot, DT).add(EndEffector(tip, kind="position"), name="hand")
    return robot, tip, stack.add(Posture(), name="posture", weight=1e-3).compile(backend="vm")


def farthest(robot: Robot, tip: str, along: np.ndarray, seed: int) -> np.ndarray:
    """A configuration where d.p of the tip is as large as it can be: Newton's method from a few starts."""
    found, eye = [], 1e-6 * np.eye(robot.nv)
    for start in range(3):
        q = robot.random(100 * seed + start)
        for _ in range(100):
            slope = robot.jacobian(q, tip)[:3].T @ along
            if np.linalg.norm(slope) < 1e-11:
                break
            ends = [robot.jacobian(robot.integrate(q, x), tip)[:3].T @ along for x in eye]
            second = (np.array(ends) - slope) * 1e6
            values, vectors = np.linalg.eigh(0.5 * (second + second.T))
            step = vectors @ ((vectors.T @ slope) / np.maximum(np.abs(values), 1e-3))
            q = robot.integrate(q, step * min(1.0, 0.5 / np.abs(step).max()))
        found.append((float(robot.pose(q, tip).translation @ along), q))
    return max(found, key=lambda each: each[0])[1]


def reason(step: Step, task: str = "hand") -> Reason:
    return next(each for each in step.explain().reasons if each.task == task)


@pytest.mark.parametrize(("name", "seed"), covering(ARMS, [0, 1]))
def test_a_stretched_arm_is_singular_towards_itself_and_out_of_reach_beyond(name: str, seed: int) -> None:
    robot, tip, tick = arm(name)
    random = np.random.default_rng(seed)
    along = random.normal(size=3)
    along /= np.linalg.norm(along)
    q = farthest(robot, tip, along, seed)
    end, by = robot.pose(q, tip).translation, float(random.uniform(0.02, 0.15))
    tick.reset(q)

    tick["hand"].target = end - by * along
    found = reason(tick.step(q))
    assert found.kind == "singular"
    assert found.singular < 1e-5
    direction = np.array([dict(found.direction).get(label, 0.0) for label in "xyz"])
    assert abs(direction @ along) == pytest.approx(1.0, abs=1e-6)
    assert found.lost[0] == (pytest.approx(by, rel=1e-6), "m")
    assert f"hand is singular: no joint moves it along ({direction[0]:+.2g} x" in str(found)
    assert f"moving {found.restores} begins it" in str(found)
    # what it says: both small motions along that joint's way out come nearer
    assert found.restores in robot.dof_names

    tick["hand"].target = end + by * along
    found = reason(tick.step(q))
    assert found.kind == "reach"
    assert found.beyond[0] == (pytest.approx(by, rel=1e-4), "m")
    assert found.place == pytest.approx(end, abs=5e-3)
    assert f"hand is out of reach by {1e3 * by:.3g} mm" in str(found)

    tick["hand"].target = end
    found = reason(tick.step(q))
    assert found.kind == "done"
    assert "hand has nothing to do" in str(found)


@pytest.mark.parametrize("name", ARMS)
def test_far_beyond_reach_the_distance_is_that_of_the_nearest_pose_from_anywhere(name: str) -> None:
    """From a configuration that can still come nearer; far away the support function gives the distance."""
    robot, tip, tick = arm(name)
    random = np.random.default_rng(7)
    along = random.normal(size=3)
    along /= np.linalg.norm(along)
    best = robot.pose(farthest(robot, tip, along, 7), tip).translation
    tick["hand"].target = best + 2.0 * along
    q = robot.random(3)
    tick.reset(q)
    found = reason(tick.step(q))
    assert found.kind == "reach"
    assert found.beyond[0][0] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e7, 1e9])
def test_out_of_reach_is_said_whatever_a_row_is_counted_in(scale: float) -> None:
    robot, tip, _ = arm("ur5")
    z = np.array([0.0, 0.0, 1.0])
    short = 3.0 - float(robot.pose(farthest(robot, tip, z, 7), tip).translation @ z)
    height = Expression(lambda kin, p: scale * (kin.position(tip)[2] - 3.0), units="m")
    tick = Stack(robot, DT).add(height, name="hand").compile(backend="vm")
    found = reason(tick.step(robot.random(3)))
    assert found.kind == "reach"
    assert found.beyond[0][0] == pytest.approx(short * scale, rel=1e-3)


def test_the_nearest_pose_is_the_least_of_several_minima() -> None:
    """A target beside the waist of a Z1, whose limits leave three minima; the first four searches end in the second."""
    robot = wbc.robots.load("z1", shapes="none")
    tip, q = robot.frames["tip"], robot.random(9)
    stack = Stack(robot, DT).add(EndEffector(tip, kind="position"), name="hand").add(JointLimits())
    tick = stack.compile(backend="vm")
    target = np.array([-0.4333, -0.0540, -0.0195])
    tick.reset(q)
    tick["hand"].target = target
    found = reason(tick.step(q))
    random, limits = np.random.default_rng(0), robot.limits
    lower, upper = limits.position_lower, limits.position_upper
    best = min(
        least_squares(
            lambda x: robot.pose(x, tip).translation - target, random.uniform(lower, upper), bounds=(lower, upper)
        ).cost
        for _ in range(12)
    )
    assert found.kind == "reach"
    assert found.beyond[0][0] == pytest.approx(np.sqrt(2.0 * best), rel=1e-3)


@pytest.mark.parametrize("name", ARMS)
def test_a_task_that_is_served_is_as_slow_as_its_gain(name: str) -> None:
    robot, tip, tick = arm(name)
    random = np.random.default_rng(1)
    q = robot.random(11)
    goal = robot.pose(robot.integrate(q, 0.05 * random.normal(size=robot.nv)), tip).translation
    gain = float(random.uniform(0.1, 5.0))
    tick["hand"].target, tick["hand"].gain = goal, gain
    tick.reset(q)
    step = tick.step(q)
    found = reason(step)
    tick["hand"].gain = 0.0
    still = reason(tick.step(q))
    tick["hand"].gain = 2.0
    off = float(np.linalg.norm(goal - robot.pose(q, tip).translation))
    assert found.kind == "slow"
    assert found.error[0] == (pytest.approx(off, rel=1e-9), "m")
    assert found.rate[0] == (pytest.approx(gain * off, rel=0.1), "m")
    assert f"as its gain of {gain:.3g} 1/s asks" in str(found)
    assert "because its gain is 0 1/s" in str(still)


@cache
def walled() -> Controller:
    robot = limited_robot("panda")
    stack = Stack(robot, DT).add(EndEffector("panda_hand_tcp", kind="position"), name="hand")
    stack.add(JointLimits(), name="limits").add(
        WorkspaceBox("panda_hand_tcp", lower=[-9.0] * 3, upper=[9.0] * 3), name="box"
    )
    return stack.add(Obstacle(Sphere(0.05)), name="ball").compile(backend="vm")


def fresh(q: np.ndarray) -> Controller:
    tick = walled()
    tick["box"].lower, tick["box"].upper = [-9.0] * 3, [9.0] * 3
    tick["ball"].pose = np.array([0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 1.0])
    tick["limits"].velocity_scale = 1.0
    tick.reset(q)
    return tick


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_wall_between_hand_and_target_is_named(axis: int) -> None:
    robot = limited_robot("panda")
    q = robot.neutral
    tick, here = fresh(q), robot.pose(q, "panda_hand_tcp").translation
    upper = np.full(3, 9.0)
    upper[axis] = here[axis]
    tick["box"].upper = upper
    tick["hand"].target = here + 0.05 * np.eye(3)[axis]
    found = reason(tick.step(q, np.zeros(7)))
    assert found.kind == "minimum"
    assert any(name.startswith("box/") for name in found.by)
    assert "hand is at a local minimum, 50 mm off" in str(found)


def test_a_ball_between_hand_and_target_is_named() -> None:
    robot = limited_robot("panda")
    q = robot.neutral
    tick, here = fresh(q), robot.pose(q, "panda_hand_tcp").translation
    tick["ball"].pose = np.array([*(here + [0.3, 0.0, 0.0]), 0.0, 0.0, 0.0, 1.0])
    before = float(tick["ball"].margin)
    spare = float(min(tick.step(q).margins["ball"]))
    tick["ball"].margin = before + spare
    tick.reset(q)
    tick["hand"].target = here + [0.5, 0.0, 0.0]
    found = reason(tick.step(q, np.zeros(7)))
    tick["ball"].margin = before
    assert found.kind in ("minimum", "held")
    assert any(name.startswith("ball/") for name in found.by)


@pytest.mark.parametrize("seed", range(4))
def test_a_target_behind_a_joint_limit_names_the_joint(seed: int) -> None:
    """Joints may move by 0.1 rad only; the target is the pose where one of them moves by 0.4."""
    robot = wbc.robots.load("ur5")
    random = np.random.default_rng(seed)
    q, joint = robot.random(seed), int(random.integers(0, 5))
    narrow = robot.with_limits(position_lower=q - 0.1, position_upper=q + 0.1)
    tick = Stack(narrow, DT).add(EndEffector("tool0"), name="hand").add(JointLimits()).compile(backend="vm")
    goal = q.copy()
    goal[joint] += 0.4
    tick.reset(q)
    tick["hand"].target = robot.pose(goal, "tool0")
    found = reason(tick.step(q))
    assert found.kind == "reach"
    assert robot.dof_names[joint] in found.without[0]
    assert "it is within reach without the position limits of" in str(found)


def test_speed_limits_are_named() -> None:
    robot = limited_robot("panda")
    q = robot.neutral
    tick = fresh(q)
    tick["limits"].velocity_scale = 0.01
    tick["hand"].target = robot.pose(q, "panda_hand_tcp").translation + [0.0, 0.05, 0.0]
    found = reason(tick.step(q, np.zeros(7)))
    assert found.kind == "limited"
    assert "slowed by limits/panda_joint1 (velocity limit" in str(found)


@pytest.mark.parametrize("name", ARMS)
def test_an_escape_leaves_a_singular_start_and_arrives(name: str) -> None:
    """Without it a stretched arm stays; with it the target on its own line is reached, the same way each time.

    The second time on one arm, and with ``REPEATS=3`` on all.
    """
    robot, tip, tick = arm(name)
    along = np.array([0.3, -0.4, 0.5]) / np.sqrt(0.5)
    start = farthest(robot, tip, along, 2)
    goal = robot.pose(start, tip).translation - 0.1 * along
    ends = []
    again = name == ARMS[0] or MORE >= ALL
    for policy in (Policy(), *[Policy(escape=True)] * (2 if again else 1)):
        tick.policy, q = policy, start
        tick.reset(q)
        tick["hand"].target, tick["hand"].gain = goal, 10.0
        answered = set()
        for _ in range(20 if not policy.escape else 250):
            step = tick.step(q, dt=2 * DT)
            answered.add(step.answered_by)
            q = robot.integrate(q, step.v * 2 * DT)
        off = float(np.linalg.norm(robot.pose(q, tip).translation - goal))
        ends.append(q)
        assert answered == ({"", "escape"} if policy.escape else {""})
        assert off < 5e-3 if policy.escape else off > 0.09
    tick.policy, tick["hand"].gain = Policy(), 2.0
    np.testing.assert_array_equal(ends[1], ends[-1])


def test_a_wall_that_stops_a_moving_target_is_named() -> None:
    """The hand is where its target is, which goes on at 0.1 m/s into the wall."""
    robot = limited_robot("panda")
    q = robot.neutral
    tick, here = fresh(q), robot.pose(q, "panda_hand_tcp").translation
    tick["box"].upper = [9.0, 9.0, here[2]]
    tick["hand"].target, tick["hand"].feedforward = here + [0.0, 0.0, 1e-5], [0.0, 0.0, 0.1]
    found = reason(tick.step(q, np.zeros(7)))
    tick["hand"].feedforward = np.zeros(3)
    assert (found.kind, found.follows) == ("held", pytest.approx(0.0, abs=0.01))
    assert any(name.startswith("box/") for name in found.by)
    assert "hand follows its moving target at" in str(found)


def test_of_many_that_hold_a_task_the_names_are_told() -> None:
    many = tuple(f"grip/{axis} (exactly 1 um/s)" for axis in "xyz")
    found = Reason("hand", "held", ((0.1, "m"),), ((0.0, "m"),), 1.0, by=(*many, "posture", "box/x (at most 0 m/s)"))
    assert str(found).endswith("held back by grip (x, y, z), posture, box (x).")
    assert str(replace(found, by=many)).endswith(f"held back by {', '.join(many)}.")
