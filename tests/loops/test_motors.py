"""What motors behind linkages have to brake by: Pinocchio says what they carry."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, SPECIAL, with_motors, within
from tests.loops.test_torques import linkage, moving
from wbc.stack.motors import decelerations
from wbc.symbolic.dynamics import Dynamics
from wbc.symbolic.kinematics import Kinematics

EVERY = {**NAMED, **SPECIAL}


@pytest.mark.parametrize("name", ["four_bar", "ankle", "gripper", "jansen", "desk_lamp", 1, 3])
def test_motors_brake_all_that_their_joints_take_along(name: str | int) -> None:
    """(T - |G'h|) / (G'M G), with Pinocchio's M and h and the columns of the motors' Jacobian G."""
    text = linkage(name)[0] if isinstance(name, int) else with_motors(EVERY[name], MOTORS[name])
    robot, rng = wbc.robots.load(text, shapes="none"), np.random.default_rng(0)
    robot = robot.with_limits(effort=dict(zip(robot.motor_names, 50.0 + np.arange(len(robot.motors)), strict=True)))
    kin = Kinematics(robot.model)
    dynamics, motors = Dynamics(kin), list(robot.motors)
    limits = {dof: ca.SX(float(robot.limits.effort[dof])) for dof in motors}
    found = decelerations(robot, kin, dynamics.mass_matrix, dynamics.nonlinear_effects, limits)
    look = ca.Function("look", [kin.q, kin.v], [ca.vertcat(*[found[dof] for dof in motors])])
    for _ in range(4):
        q, v = moving(robot, rng)
        data = robot.model.createData()
        mass = np.triu(pin.crba(robot.model, data, q))
        mass += np.triu(mass, 1).T
        ways = robot.motor_jacobian(q)
        carried = ways.T @ pin.nonLinearEffects(robot.model, data, q, v)
        most = robot.limits.effort[motors]
        left = np.maximum(most - np.abs(carried), 0.1 * most) / np.diag(ways.T @ mass @ ways)
        assert np.array(look(q, v)).ravel() == pytest.approx(left, rel=1e-4)


def test_a_weak_motor_brakes_a_leg_before_its_limits() -> None:
    """Without limits of acceleration: by the inertia of the crank alone 166 of these ticks gave way."""
    robot = within(wbc.robots.load(with_motors(NAMED["jansen"], MOTORS["jansen"]), shapes="none", velocity=3.0), 0.4)
    robot = robot.with_limits(effort={"motor": 15.0})
    stack = wbc.Stack(robot, 0.005).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller = stack.add(wbc.tasks.TorqueLimits()).compile(command="torque", backend="vm")
    rng, relaxed = np.random.default_rng(0), 0
    for k in range(1500):
        if k % 300 == 0:
            q, v = robot.neutral, np.zeros(robot.nv)
            controller.reset(q)
        if k % 60 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, rng.normal(size=robot.nv))
        step = controller.step(q, v)
        relaxed += step.status != "solved"
        q, v = np.array(step.q_next), np.array(step.v)
    assert relaxed < 20
