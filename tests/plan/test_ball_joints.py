"""Ball joints and floating bases: turns as coordinates, proofs between them, and a humanoid that stands on its feet."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED, numbers
from tests.plan.scenes import CoalJudge, at, standing_g1
from tests.repeats import repeats
from wbc.plan.coordinates import PlanningCoordinates
from wbc.robot import Robot
from wbc.shapes import Box, Sphere


def flyer(seed: int) -> Robot:
    """A capsule that floats, with two limbs of a ball joint and a hinge each."""
    rng = np.random.default_rng(seed)
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
    limbs = ""
    for k, sign in enumerate((-1.0, 1.0)):
        capsule = f'<geom type="capsule" size="0.03" fromto="0 0 0.05 {numbers(rng.uniform(0.0, 0.3, 3))}"/>'
        hinge = f'<joint name="hinge{k}" axis="{numbers(rng.normal(size=3))}" range="-2 2"/>'
        hand = f'<body name="hand{k}" pos="{numbers(rng.uniform(0.1, 0.3, 3))}">{hinge}{inertia}{capsule}</body>'
        arm = f'<joint name="ball{k}" type="ball"/>{inertia}{capsule}{hand}'
        limbs += f'<body name="arm{k}" pos="{numbers(np.array([0.35 * sign, 0.0, 0.0]))}">{arm}</body>'
    trunk = f'<freejoint name="base"/>{inertia}<geom type="capsule" size="0.05" fromto="-0.2 0 0 0.2 0 0"/>{limbs}'
    text = f'<worldbody><body name="trunk">{trunk}</body></worldbody>'
    return wbc.robots.load(f'<mujoco model="flyer"><compiler angle="radian"/>{text}</mujoco>')


@pytest.mark.parametrize("name", ["flyer", "delta", "g1"])
def test_coordinates_are_those_of_pinocchio(name: str) -> None:
    """Configurations at any attitude come back, and rates are velocities on the manifold."""
    robot = flyer(0) if name == "flyer" else wbc.robots.load(NAMED.get(name, name), shapes="none")
    rng, coordinates, changed = np.random.default_rng(1), PlanningCoordinates.of(robot, 0.7), 0
    for _ in range(repeats(40)):
        q = pin.randomConfiguration(robot.model, -np.ones(robot.nq), np.ones(robot.nq))
        if not coordinates.suits(q):
            coordinates, changed = PlanningCoordinates.of(robot, 0.7, q), changed + 1
        assert coordinates.suits(q)
        near, rate, h = 5.0 * rng.normal(size=coordinates.count), rng.normal(size=coordinates.count), 1e-6
        x = coordinates.of_configuration(q, near)
        np.testing.assert_allclose(robot.difference(q, coordinates.configuration(x)), 0.0, atol=1e-9)
        for ball in coordinates.balls:
            assert np.linalg.norm((x - near)[ball.span]) < 2.0 * np.pi
        ends = coordinates.configuration(np.array([x - h * rate, x + h * rate]))
        velocity = coordinates.velocity(np.array([x, x]), np.array([rate, rate]))[1]
        np.testing.assert_allclose(robot.difference(*ends) / (2.0 * h), velocity, atol=1e-6)
        most = rng.uniform(1.0, 2.0, robot.nv)
        fastest = coordinates.velocity(x, np.sign(rate) * coordinates.rates(most))
        assert (np.abs(fastest) <= most + 1e-12).all()
        symbol = ca.SX.sym("x", coordinates.count)
        expression = ca.Function("q", [symbol], [coordinates.expression(symbol)])
        np.testing.assert_allclose(np.asarray(expression(x)).ravel(), coordinates.configuration(x), atol=1e-12)
    assert changed > 0


def test_two_turns_about_one_axis_are_still_a_configuration() -> None:
    robot = flyer(0)
    coordinates = PlanningCoordinates.of(robot, 1.0)
    q = robot.neutral.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.4, 0.5 * np.pi, -0.3)).coeffs()
    for near in (np.zeros(coordinates.count), np.full(coordinates.count, 4.0)):
        x = coordinates.of_configuration(q, near)
        np.testing.assert_allclose(robot.difference(q, coordinates.configuration(x)), 0.0, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_an_edge_of_turns_that_is_proven_is_clear_by_coal(seed: int) -> None:
    """And those that have some room are proven."""
    rng, robot = np.random.default_rng(seed), flyer(seed)
    stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.SelfCollision(margin=0.0), name="self")
    for k in range(4):
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-0.7, 0.7, 3))
        stack.add(wbc.tasks.Obstacle((Sphere(0.1), Box((0.1, 0.2, 0.3)))[k % 2], pose=place), name=f"thing{k}")
    planner, judge = stack.planner(), CoalJudge(stack)
    native, coordinates = planner.native(robot.neutral), planner.coordinates
    proven = missed = 0
    for _ in range(repeats(80)):
        one = rng.uniform(-1.0, 1.0, coordinates.count)
        other = one + rng.normal(size=coordinates.count) * rng.choice([0.02, 0.1, 0.3])
        between = [coordinates.configuration(one + share * (other - one)) for share in np.linspace(0.0, 1.0, 60)]
        margins = [judge.margin(q) for q in between]
        if native.free(one) and native.free(other) and native.edge(one, other):
            proven += 1
            assert min(margins) > -1.1e-4
        else:
            missed += min(margins) > 1e-3 and native.free(one) and native.free(other)
    assert proven > 5
    assert missed == 0


@pytest.mark.parametrize("pitch", [0.0, 0.5 * np.pi])
def test_a_rod_turns_to_fly_through_a_slot(pitch: float) -> None:
    """At any attitude of the start; what is straight hits the wall, and there is no way round it."""
    rod = '<freejoint name="base"/><geom name="rod" type="capsule" size="0.03" fromto="-0.3 0 0 0.3 0 0" mass="1"/>'
    text = f'<mujoco><worldbody><body name="rod">{rod}</body></worldbody></mujoco>'
    robot = wbc.robots.load(text)
    stack = wbc.Stack(robot, dt=0.01)
    box = wbc.tasks.WorkspaceBox("rod", lower=(-1.0, -0.8, -0.8), upper=(2.0, 0.8, 0.8))
    stack.add(box, name="room")
    for k, side in enumerate((-1.0, 1.0)):
        stack.add(wbc.tasks.Obstacle(Box((0.1, 2.0, 4.0)), pose=at(0.5, 1.1 * side, 0.0)), name=f"wall{k}")
    start, goal = robot.neutral.copy(), robot.neutral.copy()
    turn = pin.rpy.rpyToMatrix(0.0, pitch, 0.0) if pitch else pin.rpy.rpyToMatrix(0.0, 0.0, 0.5 * np.pi)
    start[3:7] = goal[3:7] = pin.Quaternion(turn).coeffs()
    start[1], goal[:2] = -0.4, (1.2, 0.4)
    path, judge = stack.plan(start, goal), CoalJudge(stack)
    assert len(path.points) > 2
    np.testing.assert_allclose(robot.difference(path.q[-1], goal), 0.0, atol=1e-8)
    assert judge.least(path) > -1.1e-4
    q, v = path.configurations(path.law(), np.linspace(0.0, path.law().duration, 50))
    assert min(judge.margin(one) for one in q) > -1.1e-4
    np.testing.assert_allclose(v[[0, -1]], 0.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(repeats(1)))
def test_a_humanoid_reaches_under_and_over_a_table_on_both_feet(seed: int) -> None:
    """The feet stay, the centre of mass stays over them, and all bodies are clear of the table and of each other."""
    stack, start, targets = standing_g1(seed)
    robot, planner, judge = stack.robot, stack.planner(), CoalJudge(stack)
    feet = [robot.frames[f"{side}_foot"] for side in ("left", "right")]
    stand = [robot.pose(start, foot) for foot in feet]
    data, q = robot.model.createData(), start
    for target in targets:
        path = planner.plan(q, {"hand": target}, seed=seed)
        smooth = path.smooth
        for x in smooth.evaluate(np.linspace(smooth.knots[0], smooth.knots[-1], 60)):
            q = path.coordinates.configuration(x)
            for foot, pose in zip(feet, stand, strict=True):
                assert np.linalg.norm(pin.log6(pose.actInv(robot.pose(q, foot))).vector) < 1e-5
            middle = pin.centerOfMass(robot.model, data, q)
            assert -0.05 + 0.01 - 1e-6 < middle[0] - stand[0].translation[0] < 0.1 - 0.01 + 1e-6
            assert judge.margin(q) > -1.1e-4
        assert np.linalg.norm(robot.pose(q, robot.frames["right_hand"]).translation - target) < 1e-6
