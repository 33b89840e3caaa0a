"""Inverse kinematics: Pinocchio as the referee of poses, scipy of what is nearest, and how searches end."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

import wbc
from tests.distances import coal_distance
from tests.models import placement
from wbc.api import Stack
from wbc.controller import core_of
from wbc.ik import Ending, InverseKinematics
from wbc.ik.timeless import searching, timeless
from wbc.robot import Robot
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, Hold, JointLimits, Obstacle, Posture
from wbc.validation import Array

TIPS = {"panda": "panda_hand_tcp", "kinova": "j2s6s200_end_effector", "ur5": "tool0"}


@cache
def arm(name: str) -> Robot:
    return wbc.robots.load(name)


def stack(name: str = "panda", kind: str = "pose") -> Stack:
    out = Stack(arm(name), 0.005)
    out.add(EndEffector(TIPS[name], kind=kind), name="hand")  # type: ignore[arg-type]
    out.add(JointLimits(), name="limits")
    return out


@cache
def solver(name: str = "panda", backend: str = "auto", kind: str = "pose") -> InverseKinematics:
    """Solvers are kept: each test sets all that it depends on."""
    return stack(name, kind).inverse_kinematics(backend=backend)


def outside(robot: Robot, q: Array) -> float:
    """By how much q passes its limits."""
    dofs = np.flatnonzero(robot.position_index >= 0)
    here = q[robot.position_index[dofs]]
    low, high = robot.limits.position_lower[dofs], robot.limits.position_upper[dofs]
    return float(np.maximum(low - here, here - high).max())


@pytest.mark.parametrize("name", TIPS)
def test_reachable_poses_are_reached_within_the_limits(name: str) -> None:
    robot, rng, ik = arm(name), np.random.default_rng(5), solver(name)
    for _ in range(100):
        goal = placement(robot, TIPS[name], robot.random(rng))
        ik["hand"].target = goal
        solution = ik.solve(robot.neutral, budget=None)
        assert solution.status == "solved", solution
        off = goal.actInv(placement(robot, TIPS[name], solution.q))
        assert np.abs(off.translation).max() < 1.8e-5
        assert np.abs(pin.log3(off.rotation)).max() < 1.8e-5
        assert solution.error <= 1e-5
        assert outside(robot, solution.q) <= 0.0
        assert pin.isNormalized(robot.model, solution.q, 1e-9)


def test_the_tolerance_is_kept() -> None:
    robot, ik = arm("panda"), solver()
    goal = placement(robot, TIPS["panda"], robot.random(2))
    ik["hand"].target = goal
    for tolerance in (1e-2, 1e-5, 1e-9):
        assert ik.solve(robot.neutral, budget=None, tolerance=tolerance).error <= tolerance


def test_one_seed_gives_one_answer() -> None:
    robot, ik = arm("panda"), solver()
    found = {}
    for k in range(30):
        ik["hand"].target = placement(robot, TIPS["panda"], robot.random(k))
        first = ik.solve(robot.neutral, budget=None, seed=3)
        again = ik.solve(robot.neutral, budget=None, seed=3, restarts=50)
        np.testing.assert_array_equal(first.q, again.q)
        found[k] = (first.descents, ik.solve(robot.neutral, budget=None, seed=4).q, first.q)
    restarted = [f for f in found.values() if f[0] > 1]
    assert restarted
    assert any((f[1] != f[2]).any() for f in restarted)


@pytest.mark.parametrize("kind", ["position", "pose"])
def test_out_of_reach_the_nearest_configuration_is_found(kind: str) -> None:
    robot, ik = arm("panda"), solver(kind=kind)
    data, frame = robot.model.createData(), robot.model.getFrameId(TIPS["panda"])
    low, high = robot.limits.position_lower, robot.limits.position_upper
    goal = pin.SE3(pin.rpy.rpyToMatrix(0.3, 2.0, 1.0), np.array([0.9, 0.5, 0.9]))

    def cost(q: Array) -> float:
        pin.framesForwardKinematics(robot.model, data, q)
        here = data.oMf[frame]
        turn = pin.log3(here.rotation @ goal.rotation.T) if kind == "pose" else np.zeros(3)
        return float(np.sum(((here.translation - goal.translation) / robot.characteristic_length) ** 2) + turn @ turn)

    ik["hand"].target = goal if kind == "pose" else goal.translation
    solution = ik.solve(robot.neutral, budget=None, restarts=20)
    assert solution.status == Ending.UNREACHABLE
    rng = np.random.default_rng(1)
    starts = [rng.uniform(low, high) for _ in range(20)]
    bounds = list(zip(low, high, strict=True))
    best = min(minimize(cost, s, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-15}).fun for s in starts)
    length = robot.characteristic_length
    assert length * np.sqrt(cost(solution.q)) < length * np.sqrt(best) + 1e-3
    here = placement(robot, TIPS["panda"], solution.q).translation
    assert solution.residuals["hand"].norm("m") == pytest.approx(np.linalg.norm(here - goal.translation), abs=1e-9)
    assert outside(robot, solution.q) <= 0.0
    assert "unreachable" in solution.explain()
    assert "hand off by" in solution.explain()


def test_goals_that_contradict_each_other_are_told_from_those_out_of_reach() -> None:
    robot = arm("panda")
    both = stack(kind="position").add(EndEffector("panda_link7", kind="position"), name="wrist")
    ik = both.inverse_kinematics()
    q = robot.random(4)
    ik["hand"].target = placement(robot, TIPS["panda"], q).translation
    ik["wrist"].target = placement(robot, "panda_link7", q).translation
    assert ik.solve(robot.neutral, budget=None).status == "solved"
    ik["wrist"].target = placement(robot, "panda_link7", robot.neutral).translation
    assert ik.solve(robot.neutral, budget=None, restarts=10).status == "contradictory"
    ik["wrist"].target = (3.0, 0.0, 0.0)
    assert ik.solve(robot.neutral, budget=None, restarts=10).status == "unreachable"


@pytest.mark.parametrize("backend", ["native", "vm"])
def test_constraints_that_no_configuration_keeps(backend: str) -> None:
    robot = arm("panda")
    declared = stack(kind="position").add(Hold("panda_link7", kind="position"), name="hold")
    held = declared.inverse_kinematics(backend=backend)
    held["hold"].target = pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0]))
    solution = held.solve(robot.neutral, budget=None, restarts=3)
    assert solution.status == "contradictory"
    assert solution.step.relaxed


def test_wishes_are_followed_where_they_cost_nothing() -> None:
    robot, name = arm("panda"), TIPS["panda"]
    low, high = robot.limits.position_lower, robot.limits.position_upper
    ik = stack().add(Posture(), name="posture", weight=1e-3).inverse_kinematics()
    assert ik.goals == ("hand",)
    for seed in range(6):
        goal = placement(robot, name, robot.random(seed))
        ik["hand"].target, ik["posture"].target = goal, robot.neutral
        solution = ik.solve(robot.neutral, budget=None)
        assert solution.solved
        assert solution.error <= 1e-5

        def pose(q: Array, goal: pin.SE3 = goal) -> Array:
            off = goal.actInv(placement(robot, name, q))
            return np.concatenate([off.translation, pin.log3(off.rotation)])

        better = minimize(
            lambda q: float(np.sum((q - robot.neutral) ** 2)),
            solution.q,
            method="SLSQP",
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "eq", "fun": pose},
            options={"maxiter": 300, "ftol": 1e-12},
        )
        mine = float(np.sum((solution.q - robot.neutral) ** 2))
        assert not better.success or np.abs(pose(better.x)).max() > 1e-6 or mine < better.fun + 0.01


def test_obstacles_are_respected() -> None:
    robot = arm("panda")
    ball = stack().add(Obstacle(Sphere(0.15), margin=0.02), name="ball")
    ik, plain, rng = ball.inverse_kinematics(), solver(), np.random.default_rng(9)
    hit = 0
    for _ in range(25):
        q = robot.random(rng)
        goal = placement(robot, TIPS["panda"], q)
        place = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.5]) + 0.1 * rng.standard_normal(3))
        ik["hand"].target = plain["hand"].target = goal
        ik["ball"].pose = place
        solution = ik.solve(robot.neutral, budget=None, restarts=30)
        assert solution.status != "out of time"
        if solution.status in ("solved", "unreachable"):
            assert nearest(robot, solution.q, place) > 0.02 - 1e-8
            assert min(solution.margins["ball"]) > -1e-8
        hit += nearest(robot, plain.solve(robot.neutral, budget=None).q, place) < 0.02
    assert hit > 3, "no obstacle was in the way"


def nearest(robot: Robot, q: Array, ball: pin.SE3) -> float:
    """Distance [m] of the shapes of moving links to the ball, by Coal."""
    data, least = robot.model.createData(), np.inf
    pin.framesForwardKinematics(robot.model, data, q)
    for link, shapes in robot.shapes.items():
        frame = robot.model.getFrameId(link)
        for placed in shapes if robot.model.frames[frame].parentJoint > 0 else ():
            where = data.oMf[frame] * placed.placement
            least = min(least, coal_distance(placed.shape, where, Sphere(0.15), ball))
    return least


def test_a_controller_is_compiled_without_the_search() -> None:
    assert not hasattr(core_of(stack().compile(backend="native")).tick._library, "wbc_tick_converge")
    assert hasattr(core_of(searching(timeless(stack()), "native")).tick._library, "wbc_tick_converge")
