"""Dead points: they are named from afar, and linkages slow down before them, so that no tick gives way."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, SPECIAL, random_linkage, with_motors, within
from tests.loops.test_torques import moving, rows_at
from tests.repeats import covering, repeats
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.motion import MotionExpressions
from wbc.symbolic.tracer import Tracer
from wbc.tasks._linkage_speed import LinkageSpeed, bend_of
from wbc.validation import Array

DT = 0.005


def limited(text: str, acceleration: float, room: float = np.inf) -> Robot:
    """Of at most 3 rad/s, with limits of acceleration, and within a room about neutral."""
    return within(wbc.robots.load(text, shapes="none").with_limits(velocity=3.0, acceleration=acceleration), room)


def ticks(robot: Robot, command: str, count: int, seed: int) -> Iterator[tuple[wbc.Step, Array, Array]]:
    """(step, the configuration that it leads to, the change of velocity) of ticks towards postures drawn every 60."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, rng = stack.compile(command=command), np.random.default_rng(seed)
    q, v = robot.neutral, np.zeros(robot.nv)
    controller.reset(q)
    for k in range(count):
        if k % 60 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, 2.0 * rng.normal(size=robot.nv))
        step = controller.step(q) if command == "velocity" else controller.step(q, v)
        if command == "velocity":
            q = pin.integrate(robot.model, q, step.v * DT)
        else:
            q = robot.closed(pin.integrate(robot.model, q, (v + 0.5 * DT * step.a) * DT))
        yield step, q, np.array(step.v) - v
        v = np.array(step.v)


@pytest.mark.parametrize("seed", range(repeats(4)))
@pytest.mark.parametrize(
    ("command", "acceleration", "room"), covering(["velocity", "acceleration"], [5.0, 20.0], [np.inf, 0.5])
)
def test_no_tick_gives_way(command: str, acceleration: float, room: float, seed: int) -> None:
    """Linkages of which some stood open by centimetres when their joints could not follow them."""
    robot = limited(random_linkage(seed + 2), acceleration, room)
    speeds = []
    for step, q, change in ticks(robot, command, 200, seed):
        assert step.status == "solved", step
        assert max(robot.loop_gaps(q).values()) < 1e-9
        assert np.abs(change).max() <= acceleration * DT * (1.0 + 1e-9)
        speeds.append(np.abs(step.v).max())
    assert max(speeds) > 0.1, "nothing moved"


#: A delta at 2e-3 rad from its dead point
STRETCHED = (
    (-0.232703544986, 0.000379579776, 0.162257463238, 0.738189961128, -0.235519671012, 0.043515018359)
    + (-0.370371168085, 0.897475417822, -1.912754444782, -0.198422051658, 0.841120044341, 0.495772246058)
    + (0.085765030535, -1.910059474211, -0.4349964297, -0.660919075523, 0.309434730459, -0.527460168491)
)


@pytest.mark.parametrize("command", ["acceleration", "torque"])
def test_a_linkage_at_rest_next_to_its_dead_point_sets_off_as_slowly_as_loops_stay_closed(command: str) -> None:
    """The first tick may lead beyond the dead point where limits of acceleration are wide."""
    text = with_motors(NAMED["delta"], MOTORS["delta"])
    robot = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=200.0)
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, q = stack.compile(command=command, backend="vm"), robot.closed(STRETCHED)
    assert robot.dead_points(q, within=1.0)[0].distance < 3e-3
    for seed in range(6):
        controller.reset(q)
        change = 3.0 * np.random.default_rng(seed).normal(size=robot.nv)
        controller["posture"].target = pin.integrate(robot.model, q, change)
        step = controller.step(q, np.zeros(robot.nv))
        assert step.status == "solved"
        assert max(robot.loop_gaps(step.q_next).values()) < 1e-9
        assert np.abs(step.a).max() <= 200.0 * (1.0 + 1e-9)
        assert np.abs(step.v).max() > 0.05, "nothing moved"


def test_a_last_correction_opens_no_loop_that_branches() -> None:
    """At 1e-4 rad from the branch rows hardly say what it changes: it opened the loops by 2e-7."""
    text = with_motors(SPECIAL["sarrus"], MOTORS["sarrus"])
    robot = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=200.0)
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller = stack.compile(command="torque", backend="vm")
    q = np.array([0.643517721921, -1.287035443842, 0.643517721921, 0.643517721911, -1.287035443823])
    controller.reset(q)
    controller["posture"].target = [0.83, -2.78, -1.2, -0.27, -0.85]
    step = controller.step(q, [-0.024109683427, 0.048219366854, -0.024109683427, -0.02410969744, 0.048219394881])
    assert max(robot.loop_gaps(step.q_next).values()) < 1e-9


def test_a_dead_point_is_named_from_afar() -> None:
    """The distance falls as the crank turns, and from the threshold on steps and explanations say so."""
    robot = wbc.robots.load(NAMED["four_bar"], actuated=["heel"], velocity=3.0, acceleration=20.0)
    q, told = robot.neutral, []
    for _ in range(13):
        told += robot.dead_points(q, within=1.0)
        rates = robot.motor_jacobian(q)[:, 0]
        q = robot.integrate(q, 0.1 * rates / np.abs(rates).max())
    falls = -np.diff([point.distance for point in told])
    assert ((falls > 0.05) & (falls < 0.25)).all()
    assert {(point.linkage, point.branches) for point in told} == {("pin", False)}
    assert told[-1].distance < 0.2
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture()).add(wbc.tasks.JointLimits())
    step = stack.compile().step(q)
    assert [point.linkage for point in step.dead_points] == ["pin"]
    explanation = step.explain()
    assert explanation.dead_points == step.dead_points
    assert f"{step.dead_points[0]}." in str(explanation)
    assert "rad from its dead point, where its motors do not move knee" in str(explanation)


@pytest.mark.parametrize("angle", [0.64350069, 0.6435, 0.64349, 0.643502])
def test_velocities_keep_loops_closed_next_to_where_they_branch(angle: float) -> None:
    """Sarrus' linkage stretched out: its rows turn so fast there that those of a step before do not close it."""
    fold = np.array([1.0, -2.0, 1.0, 1.0, -2.0])
    robot = wbc.robots.load(with_motors(SPECIAL["sarrus"], MOTORS["sarrus"]), velocity=3.0, acceleration=200.0)
    stack = wbc.Stack(robot, dt=0.005).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, q = stack.compile(command="torque", backend="vm"), robot.closed(angle * fold)
    controller.reset(q)
    controller["posture"].target = np.array([3.11, -1.47, 0.84, -0.43, -2.71])
    v = 0.39 * fold
    v -= np.linalg.pinv(rows_at(robot, q), 1e-9) @ rows_at(robot, q) @ v
    step = controller.step(q, v)
    assert step.status == "solved"
    assert np.abs(rows_at(robot, step.q_next) @ step.v).max() < 1e-10


def test_a_linkage_that_branches_is_named() -> None:
    """A parallelogram whose bars are in line may go on as one or as its crossed twin."""
    robot = wbc.robots.load(NAMED["parallelogram"], shapes="none")
    flat = robot.closed(robot.neutral + np.pi / 2.0 * np.array([1.0, -1.0, 1.0, 1.0]))
    assert robot.dead_points(robot.neutral) == ()
    (point,) = robot.dead_points(flat)
    assert point.branches
    assert point.distance < 1e-6
    assert "its loops leave" in str(point)


def test_a_tick_that_gives_way_at_a_branch_names_the_linkage() -> None:
    """Bars that lie in line and turn apart ask for what no velocity is."""
    robot = limited(NAMED["parallelogram"], 20.0)
    flat = robot.closed(robot.neutral + np.pi / 2.0 * np.array([1.0, -1.0, 1.0, 1.0]))
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller = stack.compile(backend="vm")
    controller.reset(flat)
    step = controller.step(flat, np.array([1.0, 0.5, -1.0, 2.0]))
    assert step.status == "relaxed"
    assert np.isfinite(step.v).all()
    assert "The linkage of loop1, loop2 is at its dead point, where its loops leave tilt two ways" in repr(step)
    assert "dead point" not in repr(controller.step(robot.neutral))


def test_a_tree_has_none_and_bad_input_is_refused() -> None:
    robot = wbc.robots.load(NAMED["four_bar"])
    assert robot.with_loops().dead_points([0.0, 0.0, 0.0]) == ()
    assert robot.with_loops().loop_gaps([0.0, 0.0, 0.0]) == {}
    with pytest.raises(RangeError, match="within"):
        robot.dead_points(robot.neutral, within=-1.0)


def test_gaps_are_told_by_loop() -> None:
    robot = wbc.robots.load(NAMED["ankle"])
    q = robot.neutral.copy()
    q[robot.position_index[robot.dofs("left_motor").start]] += 0.1
    gaps = robot.loop_gaps(q)
    assert gaps["left"] > 1e-3
    assert gaps["right"] < 1e-9


@pytest.mark.parametrize("name", ["four_bar", "ankle", "delta"])
def test_how_fast_the_forces_of_a_bend_grow(name: str) -> None:
    """Half of the logarithm's rate is a difference of |y| on the way."""
    robot, rng, h, most = limited(NAMED[name], 20.0), np.random.default_rng(0), 1e-6, 20.0
    kin = Tracer(Kinematics(robot.model))
    (linkage,) = robot.loops.linkages
    bend = bend_of(robot, kin, linkage, np.full(len(linkage.dofs), most))
    asked, error = ca.SX.zeros(robot.nv), robot.loops.error(kin)
    asked[list(linkage.dofs)] = bend.asked
    bias = kin.second(error, MotionExpressions(kin.kinematics))[1]
    look = ca.Function("bend", [kin.q, kin.v], [asked, bend.rate, bias])
    q, v = moving(robot, rng)
    c = np.array(look(q, v)[0]).ravel()

    def force(along: float) -> float:
        there, then = pin.integrate(robot.model, q, along * v), v + along * c
        rows = rows_at(robot, there)
        return float(np.linalg.norm(np.linalg.solve(rows @ rows.T * most**2, np.array(look(there, then)[2]))))

    found = (np.log(force(h)) - np.log(force(-h))) / (4.0 * h)
    assert float(look(q, v)[1]) == pytest.approx(found, rel=1e-4)


def test_only_linkages_with_limits_of_acceleration_are_slowed() -> None:
    robot = limited(NAMED["four_bar"], 20.0)
    limits = wbc.tasks.JointLimits()
    names = [entry.name for entry in wbc.Stack(robot, DT).add(limits).entries]
    assert names == ["mechanism", "joint_limits", "joint_limits linkages"]
    for one, other in ((robot, wbc.tasks.JointLimits(acceleration=False)), (robot.with_loops(), limits)):
        items = [type(entry.item) for entry in wbc.Stack(one, DT).add(other).entries]
        assert LinkageSpeed not in items
