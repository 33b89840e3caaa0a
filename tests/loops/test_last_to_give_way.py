"""Closed loops are the last to give way: linkages stay within limits where they can, and closed where they cannot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED, SPECIAL, random_linkage, within
from tests.loops.test_long_runs import bounded
from tests.loops.test_torques import moving, rows_at
from tests.repeats import repeats
from wbc.robot import Robot
from wbc.robot.shortest_steps import DEPENDENT
from wbc.validation import Array

DT = 0.005
#: A joint limit is passed by no more than rounding
ROUNDED = 1e-9


def controller_of(robot: Robot) -> wbc.Controller:
    """Towards a posture within limits."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    return stack.compile(backend="vm")


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


@pytest.mark.parametrize("seed", range(repeats(12)))
def test_loops_stay_closed_where_joints_cannot_follow(seed: int) -> None:
    """Velocities are measured from which no joint brakes: limits of acceleration give way, and are named."""
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
    for k in range(60):
        step = controller.step(q, v)
        assert step.status in ("solved", "relaxed")
        assert not [given for given in step.relaxed if given.item == "mechanism"]
        beyond = np.maximum(np.abs(step.v - v) - acceleration * DT, 0.0)
        named = {given.row for given in step.relaxed if given.item == "joint_limits"}
        assert {robot.dof_names[i] for i in np.flatnonzero(beyond > 1e-8)} <= named, k
        assert (step.status == "relaxed") >= bool(named)
        q, v = pin.integrate(robot.model, q, step.v * DT), np.array(step.v)
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k


#: Linkages with one motion
ONE_WAY = ("four_bar", "jansen", "hoekens", "bennett", "parallelogram", "gripper", "43")


@pytest.mark.parametrize("seed", range(repeats(16)))
def test_a_linkage_between_two_stops_stands(seed: int) -> None:
    """One joint is at its limit one way, another the other way, by rounding: the tick is solved, and nothing moves."""
    rng, name = np.random.default_rng(seed), ONE_WAY[seed % len(ONE_WAY)]
    text = random_linkage(int(name)) if name.isdigit() else {**NAMED, **SPECIAL}[name]
    free = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=float(rng.choice([1.0, 5.0, 100.0])))
    q, _ = moving(free, rng)
    (way,), index = ways(free, q), free.position_index
    i, j = rng.choice(np.flatnonzero(np.abs(way) > 1e-3), 2, replace=False)
    low, high = free.limits.position_lower.copy(), free.limits.position_upper.copy()
    for k, sign in ((i, 1.0), (j, -1.0)):
        room = 0.0 if rng.random() < 0.5 else 10.0 ** rng.uniform(-13.0, -9.0)
        if sign * way[k] > 0.0:
            low[k], high[k] = min(low[k], q[index[k]] - 1.0), q[index[k]] + room
        else:
            low[k], high[k] = q[index[k]] - room, max(high[k], q[index[k]] + 1.0)
    robot = free.with_limits(position_lower=low, position_upper=high)
    q = pin.integrate(robot.model, q, 3e-11 * rng.normal(size=robot.nv))
    q[index] = np.clip(q[index], low, high)
    start, controller = q, controller_of(robot)
    controller.reset(q)
    for k in range(120):
        if k % 40 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, rng.normal(size=robot.nv))
        step = controller.step(q)
        assert step.status == "solved", (k, step)
        q = pin.integrate(robot.model, q, step.v * DT)
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k
        assert (q[index] >= low - ROUNDED).all()
        assert (q[index] <= high + ROUNDED).all()
    assert np.abs(robot.difference(start, q)).max() < 1e-4
