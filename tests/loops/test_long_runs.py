"""Random ticks within limits of position, velocity and acceleration, of velocities, accelerations and torques; with
``REPEATS=400`` 10^5 of each mechanism and linkage.
"""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.polynomial import polynomial

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, SPECIAL, random_linkage, with_motors, within
from tests.loops.test_reading import CASSIE
from tests.loops.test_torques import linkage, needed, rows_at
from tests.repeats import repeats
from wbc.robot import Robot
from wbc.robot.shortest_steps import DEPENDENT
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.validation import Array

DT = 0.005
#: Mechanisms by name
EVERY = {**NAMED, **SPECIAL}
#: Ticks of a mechanism
TICKS = repeats(250)
#: Linkages that are drawn, at most 48
LINKAGES = min(repeats(6), 48)
#: Ticks from one start towards random postures
EPISODE = 2000
#: What loops are open by where a tick begins, all rows together [m, rad]
LEFT = 1e-9
#: Changes of joints below this are rounding [m, rad]
ROUNDED = 1e-14
#: Changes count for so much more, as loops bend on their way
CURVED = 1.1
#: Times within a tick at which residuals are looked at, as parts of it: five powers of time
TIMES = np.linspace(0.0, 1.0, 6)
#: Of so many ticks MuJoCo looks at the torques of one
SPARSE = 8


def bounded(robot: Robot, seed: int) -> Robot:
    """Of 3 rad/s, of accelerations that are drawn, and of positions within the file's and 1 rad of neutral."""
    acceleration = float(np.random.default_rng(seed).choice([5.0, 20.0, 100.0]))
    return within(robot, 1.0).with_limits(velocity=3.0, acceleration=acceleration)


def run(robot: Robot, count: int, seed: int) -> None:
    """Every tick is solved, moves within limits, and leaves the loops closed."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, rng, index = stack.compile(), np.random.default_rng(seed), robot.position_index
    has, limits, moved = index >= 0, robot.limits, 0.0
    q, v = robot.neutral, np.zeros(robot.nv)
    for k in range(count):
        if k % EPISODE == 0:
            q, v = robot.neutral if k == 0 else robot.closed(robot.neutral), np.zeros(robot.nv)
            controller.reset(q)
        if k % 60 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, 2.0 * rng.normal(size=robot.nv))
        step = controller.step(q)
        assert step.status == "solved", (k, step)
        assert np.isfinite(step.v).all()
        assert (np.abs(step.v) <= limits.velocity * (1.0 + 1e-9)).all()
        assert (np.abs(step.v - v) <= limits.acceleration * DT * (1.0 + 1e-9) + 1e-12).all()
        q, v = pin.integrate(robot.model, q, step.v * DT), np.array(step.v)
        at = q[index[has]]
        assert (at >= limits.position_lower[has] - 1e-9).all()
        assert (at <= limits.position_upper[has] + 1e-9).all()
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k
        moved = max(moved, float(np.abs(step.v).max()))
    assert moved > 0.1, "nothing moved"


@pytest.mark.parametrize("name", [*EVERY, "cassie"])
def test_mechanisms(name: str) -> None:
    robot = wbc.robots.load(CASSIE / "cassie_v2.sdf" if name == "cassie" else EVERY[name], shapes="none")
    run(bounded(robot, 2), TICKS, 0)


@pytest.mark.parametrize("seed", range(LINKAGES))
def test_random_linkages(seed: int) -> None:
    run(bounded(wbc.robots.load(random_linkage(seed), shapes="none"), seed), TICKS, seed)


@cache
def residuals_of(robot: Robot) -> ca.Function:
    """q -> residuals of the loops."""
    kin = Tracer(Kinematics(robot.model))
    return ca.Function("residuals", [kin.q], [kin.expand(ca.densify(robot.loops.error(kin)))])


def truncated(robot: Robot, q: Array, v: Array, a: Array, change: Array) -> None:
    """What loops are open by where v and a lead, and the shortest change that closes them, are of third order: with
    J v = 0 and d2e/dt2 = 0 where the tick begins,

        |e| <= dt^3 / 6 max |d3e/dt3|,      |change| <= |e| / sigma,

    the third derivative along q (+) (v t + a t^2 / 2), sigma the least singular value of rows of joints that change.
    """
    ways = [pin.integrate(robot.model, q, (v + 0.5 * part * DT * a) * part * DT) for part in TIMES]
    opened = np.array([np.array(residuals_of(robot)(way)).ravel() for way in ways])
    third = polynomial.polyder(polynomial.polyfit(TIMES, opened, len(TIMES) - 1), 3)
    bound = float(np.linalg.norm(polynomial.polyval(TIMES, third), axis=0).max()) / 6.0 + LEFT
    assert np.linalg.norm(opened[-1]) <= bound
    units = np.where(np.array(robot.dof_units) == "m", robot.characteristic_length, 1.0)
    free = np.abs(change) > ROUNDED
    if free.any():
        sizes = np.linalg.svd(rows_at(robot, ways[-1])[:, free] * units[free])[1]
        assert np.linalg.norm(change / units) <= CURVED * bound / sizes[sizes > DEPENDENT * sizes.max()].min()


def run_second_order(robot: Robot, text: str, command: str, count: int, seed: int) -> None:
    """Every tick is solved and leads to where loops are closed, by a velocity that keeps them closed, within limits,
    positions within 1 rad of neutral; torques are those that MuJoCo says its accelerations need.
    """
    robot = within(robot, 1.0)
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, rng, limits, moved = stack.compile(command=command), np.random.default_rng(seed), robot.limits, 0.0
    motors, q, v = list(robot.motors), robot.neutral, np.zeros(robot.nv)
    index, has = robot.position_index, robot.position_index >= 0
    for k in range(count):
        if k % EPISODE == 0:
            q, v = robot.neutral, np.zeros(robot.nv)
            controller.reset(q)
        if k % 60 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, 2.0 * rng.normal(size=robot.nv))
        step = controller.step(q, v)
        assert step.status == "solved", (k, step)
        assert np.isfinite(step.a).all()
        assert (np.abs(step.v) <= limits.velocity * (1.0 + 1e-9)).all(), k
        assert (np.abs(step.a) <= limits.acceleration * (1.0 + 1e-9)).all(), k
        assert (np.abs(step.v - v) <= limits.acceleration * DT * (1.0 + 1e-9)).all(), k
        if command == "torque" and k % SPARSE == 0:
            torques, missing = needed(robot, text, q, v, step.a)
            size = max(1.0, float(np.abs(torques).max()))
            assert np.abs(missing).max() < 1e-6 * size, k
            assert np.abs(step.torque[motors] - torques).max() < 1e-6 * size, k
        before, speed, reached = q, v, pin.integrate(robot.model, q, (v + 0.5 * DT * step.a) * DT)
        q, v = np.array(step.q_next), np.array(step.v)
        if k % SPARSE == 0:
            truncated(robot, before, speed, step.a, robot.difference(reached, q))
        at = q[index[has]]
        assert (at >= limits.position_lower[has] - 1e-9).all(), k
        assert (at <= limits.position_upper[has] + 1e-9).all(), k
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k
        assert np.abs(rows_at(robot, q) @ v).max() <= 1e-9, k
        moved = max(moved, float(np.abs(step.v).max()))
    assert moved > 0.1, "nothing moved"


@pytest.mark.parametrize("command", ["acceleration", "torque"])
@pytest.mark.parametrize("name", EVERY)
def test_mechanisms_of_second_order(name: str, command: str) -> None:
    text = with_motors(EVERY[name], MOTORS[name])
    robot = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=200.0)
    run_second_order(robot, text, command, TICKS if name in NAMED else TICKS // 4, 0)


@pytest.mark.parametrize("command", ["acceleration", "torque"])
def test_cassie_of_second_order(command: str) -> None:
    """Its pelvis held; the springs of its shins count as motors, as nothing else keeps these within their limits."""
    robot = wbc.robots.load(CASSIE / "cassie_v2.sdf", shapes="none", base="fixed", velocity=3.0, acceleration=200.0)
    motors = [name for name in robot.joint_names if name.endswith(("-op", "-knee-shin-joint"))]
    run_second_order(robot.with_actuated(motors), "", command, TICKS, 0)


@pytest.mark.parametrize("seed", range(min(repeats(3), 24)))
def test_random_linkages_of_second_order(seed: int) -> None:
    text, robot = linkage(seed)
    run_second_order(robot, text, "torque" if seed % 2 else "acceleration", TICKS, seed)
