"""Linkages stop on their way within limits of position, also where slow joints take fast ones along."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import random_linkage, within
from tests.loops.test_torques import moving
from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks._linkage_speed import STOP, LinkageSpeed, bend_of
from wbc.tasks.base import Rows
from wbc.validation import Array

DT = 0.005
ACCELERATION = 5.0

#: A spatial linkage of ten joints whose third is next to its limit, its velocity, and a posture that is wanted; where
#: each joint only brakes in time on its own, no velocity is within all limits 47 ticks later
NEAR = (-0.54618, 0.603636, 1.0, 0.374401, -0.586189, -0.016647, 0.241222, -0.263215, -0.075862, 0.141892)
RATES = (-0.091477, -0.175394, 0.0, -0.070141, -0.238539, -0.279897, 0.48834, -0.070695, 0.135366, 0.056651)
WANTED = (-1.36107, 1.844615, 1.779694, -0.1701, -1.084301, -1.812027, 5.849886, 0.102587, 1.969444, -2.092089)


def limited(seed: int) -> Robot:
    """A random linkage that accelerates slowly, in a room of 1 rad."""
    robot = wbc.robots.load(random_linkage(seed), shapes="none")
    return within(robot, 1.0).with_limits(velocity=3.0, acceleration=ACCELERATION)


def test_joints_that_push_each_other_to_their_limits_brake_in_time() -> None:
    robot = limited(4)
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, q, v = stack.compile(backend="vm"), robot.closed(NEAR), np.array(RATES)
    controller.reset(q)
    controller["posture"].target = WANTED
    for k in range(60):
        step = controller.step(q, v)
        assert step.status == "solved", (k, step)
        q, v = pin.integrate(robot.model, q, step.v * DT), np.array(step.v)


@pytest.mark.parametrize("seed", [1, 4, 5])
def test_the_row_of_a_joint_says_where_it_stops(seed: int) -> None:
    """Sides and slopes of q + v (dt + t) + c t^2 / 2, with t and c of a velocity by their definitions."""
    robot, rng = limited(seed), np.random.default_rng(seed)
    kin = Tracer(Kinematics(robot.model))
    (linkage,) = robot.loops.linkages
    rows = LinkageSpeed(wbc.tasks.JointLimits()).velocity_rows(robot, kin, {}, ca.SX(DT))
    assert isinstance(rows, Rows)
    bend = bend_of(robot, kin, linkage, np.full(len(linkage.dofs), ACCELERATION)).asked
    look = ca.Function("rows", [kin.q, kin.v], [rows.matrix, rows.lower, rows.upper, bend])
    q, v = moving(robot, rng)
    v *= 0.1
    matrix, lower, upper, bent = (np.array(part) for part in look(q, v))

    def stop(velocity: Array, share: float) -> tuple[Array, float]:
        """Where joints stop whose bend is that of v, but for its speed, and the time that they count on."""
        speed = float((np.abs(velocity / ACCELERATION) ** 4).sum()) ** 0.25
        time = DT + 0.5 * speed / STOP
        return q + velocity * time + 0.5 * share * bent.ravel() * (time - DT) ** 2, time

    reached, time = stop(v, 1.0)
    kept = robot.limits
    assert matrix[1:] @ v - upper[1:, 0] == pytest.approx((reached - kept.position_upper) / time, abs=1e-9)
    assert matrix[1:] @ v - lower[1:, 0] == pytest.approx((reached - kept.position_lower) / time, abs=1e-9)
    h = 1e-6
    for unit in np.eye(robot.nv):
        ends = []
        for way in (h, -h):
            other = v + way * unit
            grown = float(((other**4).sum() / (v**4).sum()) ** 0.25)
            ends.append(stop(other, grown**2)[0])
        assert matrix[1:] @ unit == pytest.approx((ends[0] - ends[1]) / (2.0 * h * time), abs=1e-6)
