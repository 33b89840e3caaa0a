"""Closed loops are the last to give way: linkages stay within limits where they can, and closed where they cannot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, SPECIAL, random_linkage, with_motors, within
from tests.loops.test_long_runs import bounded
from tests.loops.test_torques import moving, rows_at
from tests.repeats import repeats
from wbc.robot import Robot
from wbc.robot.shortest_steps import DEPENDENT
from wbc.validation import Array

DT = 0.005
#: A joint limit is passed by no more than rounding
ROUNDED = 1e-9


def controller_of(robot: Robot, command: str = "velocity", solver: str = "daqp") -> wbc.Controller:
    """Towards a posture within limits."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    return stack.compile(command=command, backend="vm", solver=solver)


def ways(robot: Robot, q: Array) -> Array:
    """Motions that the loops leave [motions, nv]."""
    _, sizes, motions = np.linalg.svd(rows_at(robot, q))
    return np.asarray(motions[int((sizes > DEPENDENT * sizes.max()).sum()) :])


#: Linkage 27, of three motions, as configuration, velocity and posture that is wanted. Ahead of the first it turned to
#: where it bends more than it can slow down for: 73 ticks gave way, open by 1e-2 m. At the others two sets of bounds
#: took turns in the corrections of a tick, each open by what the other left, 6e-8 m
TURNING = (
    (-0.04362178, 0.168869054, 0.042331063, 0.233978379, -0.332230581, -0.239620793),
    (1.316417759, -0.423694535, -0.692697, 0.137908636, 0.931177006, -0.072993967),
    (1.317299, -2.248991, 0.986557, 1.72117, 3.874447, -3.596577),
)
FIRST_TURNS = (
    (0.824664175, -0.59186037, -0.665411102, 0.593415916, 0.659543184, -0.032307155),
    (-0.831518006, -0.251443124, 0.297204626, -0.638464954, -0.68976765, 0.572236471),
    (1.697629, 0.053422, -1.688166, -2.344011, -2.08061, 3.02588),
)
SECOND_TURNS = (
    (0.788678793, -0.494317753, 0.044761165, 0.015552825, 0.039100132, 0.309073944),
    (-0.524988694, 0.041434267, -0.152203987, -0.754443714, 0.473924836, 0.519304198),
    (0.447669, 0.689581, -1.474263, -0.466614, 0.414519, 1.952351),
)


@pytest.mark.parametrize("state", [TURNING, FIRST_TURNS, SECOND_TURNS])
def test_a_linkage_of_three_motions(state: tuple[Array, Array, Array]) -> None:
    robot = bounded(wbc.robots.load(random_linkage(27), shapes="none"), 27)
    controller, q, v = controller_of(robot), robot.closed(state[0]), np.array(state[1])
    controller.reset(q)
    controller["posture"].target = state[2]
    for k in range(60):
        step = controller.step(q, v)
        assert step.status == "solved", (k, step)
        assert (np.abs(step.v - v) <= robot.limits.acceleration * DT * (1.0 + 1e-9)).all()
        q, v = pin.integrate(robot.model, q, step.v * DT), np.array(step.v)
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k


def too_fast(seed: int) -> tuple[Robot, wbc.Controller, Array, Array]:
    """(a linkage, its controller, a configuration, a velocity that its loops allow and from which no joint brakes)."""
    rng, every = np.random.default_rng(seed), [*NAMED.values(), *SPECIAL.values()]
    text = random_linkage(seed) if seed % 3 else every[seed // 3 % len(every)]
    acceleration = float(rng.choice([1.0, 3.0]))
    robot = within(wbc.robots.load(text, shapes="none"), 1.0).with_limits(velocity=3.0, acceleration=acceleration)
    q = robot.closed(pin.integrate(robot.model, robot.neutral, 0.2 * rng.normal(size=robot.nv)))
    v = ways(robot, q).T @ rng.normal(size=len(ways(robot, q)))
    v *= rng.uniform(1.0, 3.0) / np.abs(v).max()
    controller = controller_of(robot)
    controller.reset(q)
    controller["posture"].target = pin.integrate(robot.model, q, rng.normal(size=robot.nv))
    return robot, controller, q, v


def named(robot: Robot, step: wbc.Step, v: Array) -> None:
    """Loops have not given way; limits of acceleration that have are in ``relaxed``."""
    assert not [given for given in step.relaxed if given.item == "mechanism"]
    beyond = np.maximum(np.abs(step.v - v) - robot.limits.acceleration * DT, 0.0)
    limits = {given.row for given in step.relaxed if given.item == "joint_limits"}
    assert {robot.dof_names[i] for i in np.flatnonzero(beyond > 1e-8)} <= limits
    assert (step.status != "solved") >= bool(limits)


@pytest.mark.parametrize("seed", range(repeats(12)))
def test_loops_stay_closed_where_joints_cannot_follow(seed: int) -> None:
    """Velocities are measured from which no joint brakes: limits of acceleration give way, and are named."""
    robot, controller, q, v = too_fast(seed)
    for k in range(60):
        step = controller.step(q, v)
        assert step.status in ("solved", "relaxed")
        named(robot, step, v)
        q, v = pin.integrate(robot.model, q, step.v * DT), np.array(step.v)
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k


@pytest.mark.parametrize("seed", range(repeats(3)))
@pytest.mark.parametrize("solver", ["python", "osqp"])
def test_other_solvers_keep_the_order(seed: int, solver: str) -> None:
    """Ticks are relaxed where native ones are, or by another solver in place of one without an answer."""
    robot, controller, q, v = too_fast(seed)
    other = controller_of(robot, solver=solver)
    other.reset(q)
    other["posture"].target = controller["posture"].target
    for k in range(20):
        step, own = other.step(q, v), controller.step(q, v)
        assert step.status in (own.status, *["recovered"] * (solver == "osqp")), k
        named(robot, step, v)
        assert max(robot.loop_gaps(pin.integrate(robot.model, q, step.v * DT)).values()) <= 1e-9, k
        q, v = pin.integrate(robot.model, q, own.v * DT), np.array(own.v)


def between_stops(free: Robot, q: Array, rng: np.random.Generator, rooms: Sequence[float]) -> Robot:
    """A linkage of one motion with a joint that has so much room one way, and another with so much the other way."""
    (way,), index = ways(free, q), free.position_index
    low, high = free.limits.position_lower.copy(), free.limits.position_upper.copy()
    joints = rng.choice(np.flatnonzero(np.abs(way) > 1e-3), 2, replace=False)
    for k, sign, room in zip(joints, (1.0, -1.0), rooms, strict=True):
        if sign * way[k] > 0.0:
            low[k], high[k] = min(low[k], q[index[k]] - 1.0), q[index[k]] + room
        else:
            low[k], high[k] = q[index[k]] - room, max(high[k], q[index[k]] + 1.0)
    return free.with_limits(position_lower=low, position_upper=high)


def driven(robot: Robot, command: str, q: Array, rng: np.random.Generator, ticks: int) -> Iterator[Array]:
    """Where ticks towards random postures lead, all of them solved and within the limits of position."""
    low, high, index = robot.limits.position_lower, robot.limits.position_upper, robot.position_index
    controller, v = controller_of(robot, command), np.zeros(robot.nv)
    controller.reset(q)
    for k in range(ticks):
        if k % 40 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, rng.normal(size=robot.nv))
        step = controller.step(q, v)
        assert step.status == "solved", (k, step)
        v = np.array(step.v)
        q = pin.integrate(robot.model, q, v * DT) if command == "velocity" else np.array(step.q_next)
        assert (q[index] >= low - ROUNDED).all()
        assert (q[index] <= high + ROUNDED).all()
        yield q


#: Linkages with one motion
ONE_WAY = ("four_bar", "jansen", "hoekens", "bennett", "parallelogram", "gripper", "43")


@pytest.mark.parametrize("command", ["velocity", "acceleration"])
@pytest.mark.parametrize("seed", range(repeats(16)))
def test_a_linkage_between_two_stops_stands(seed: int, command: str) -> None:
    """One joint is at its limit one way, another the other way, by rounding: the tick is solved, and nothing moves."""
    rng, name = np.random.default_rng(seed), ONE_WAY[seed % len(ONE_WAY)]
    text = random_linkage(int(name)) if name.isdigit() else {**NAMED, **SPECIAL}[name]
    free = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=float(rng.choice([1.0, 5.0, 100.0])))
    q, _ = moving(free, rng)
    rooms = [0.0 if rng.random() < 0.5 else 10.0 ** rng.uniform(-13.0, -9.0) for _ in range(2)]
    robot = between_stops(free, q, rng, rooms)
    low, high, index = robot.limits.position_lower, robot.limits.position_upper, robot.position_index
    q = pin.integrate(robot.model, q, 3e-11 * rng.normal(size=robot.nv))
    q[index] = np.clip(q[index], low, high)
    reached = list(driven(robot, command, q, rng, 120))
    assert max(max(robot.loop_gaps(there).values()) for there in reached) <= 1e-9
    assert np.abs(robot.difference(q, reached[-1])).max() < 1e-4


@pytest.mark.parametrize("seed", [1, 2, 3, 24, 48, 56])
def test_a_linkage_turns_back_between_two_stops(seed: int) -> None:
    """Of accelerations, between stops up to 1e-3 apart: what holds it before one limit lets it turn before another."""
    rng = np.random.default_rng(100 + seed)
    text = {**NAMED, **SPECIAL}[("jansen", "four_bar", "gripper", "hoekens")[seed % 4]]
    free = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=100.0)
    q, _ = moving(free, rng)
    robot = between_stops(free, q, rng, 10.0 ** rng.uniform((-13.0, -5.0), (-11.0, -3.0)))
    assert len(list(driven(robot, "acceleration", q, rng, 400))) == 400


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_limits_that_closed_loops_pass_give_way(seed: int) -> None:
    """Next to stops, of loops that are open by rounding: what closes them keeps limits of acceleration, or the tick
    names those.
    """
    rng, text = np.random.default_rng(seed), (random_linkage(60), NAMED["gripper"], NAMED["ankle"])[seed % 3]
    free = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=20.0)
    begin, _ = moving(free, rng)
    low, high = free.limits.position_lower.copy(), free.limits.position_upper.copy()
    for k in np.flatnonzero((free.position_index >= 0) & (rng.random(free.nv) < 0.5)):
        (low if rng.random() < 0.5 else high)[k] = begin[free.position_index[k]]
    robot = free.with_limits(position_lower=low, position_upper=high)
    controller, solved = controller_of(robot, "acceleration"), 0
    for _ in range(100):
        near = pin.integrate(robot.model, begin, 10.0 ** rng.uniform(-11.0, -1.0) * rng.normal(size=robot.nv))
        q = free.closed(near)
        q = pin.integrate(robot.model, q, 10.0 ** rng.uniform(-13.0, -9.0) * rng.normal(size=robot.nv))
        v = ways(robot, q).T @ rng.normal(size=len(ways(robot, q)))
        v *= 10.0 ** rng.uniform(-6.0, 0.4) / np.abs(v).max()
        controller.reset(q)
        controller["posture"].target = pin.integrate(
            robot.model, q, 10.0 ** rng.uniform(-6.0, 0.3) * rng.normal(size=robot.nv)
        )
        for _ in range(4):
            step = controller.step(q, v)
            beyond = np.abs(step.v - v) / DT - robot.limits.acceleration
            limits = {given.row for given in step.relaxed if given.item == "joint_limits"}
            assert {robot.dof_names[i] for i in np.flatnonzero(beyond > 1e-7)} <= limits, step
            assert (step.status != "solved") >= bool(limits)
            solved += step.status == "solved"
            q, v = np.array(step.q_next), np.array(step.v)
    assert solved > 100


def test_a_gripper_at_rest_returns_to_its_limit() -> None:
    """Torques: a joint that is beyond its limit by rounding goes back, though nothing says which way it came."""
    text = with_motors(NAMED["gripper"], MOTORS["gripper"])
    free = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=20.0)
    knuckle = free.dof_names.index("left_knuckle")
    q = free.neutral
    robot = free.with_limits(position_upper={"left_knuckle": float(q[free.position_index[knuckle]])})
    controller, v = controller_of(robot, "torque"), 1e-18 * ways(robot, q)[0]
    for sign in (-1.0, 1.0):
        start = free.closed(pin.integrate(robot.model, q, 4e-13 * np.eye(robot.nv)[knuckle]))
        controller.reset(start)
        controller["posture"].target = pin.integrate(robot.model, q, np.eye(robot.nv)[knuckle])
        step = controller.step(start, sign * v)
        assert step.status == "solved", step
        assert np.abs(step.a).max() < 1e-3
