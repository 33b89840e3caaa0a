"""Largest load and speed of a motion under limits of the motors, by Pinocchio row by row and by simulated motors."""

from __future__ import annotations

from math import inf

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.repeats import repeats
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.motion_control import Actuator, ActuatorSizing
from wbc.motion_control.comparison import swing
from wbc.motion_control.motion import Motion
from wbc.published.newton_euler import DriveTrain, Linearised, OneStep, simulate
from wbc.published.newton_euler.comparison import published_scenario
from wbc.published.newton_euler.three_link import CONSTANT, MOTOR, RESISTANCE, arm
from wbc.robot import Robot
from wbc.validation import Array

MOTORS = Actuator(1.0, 48.0, 0.05, 0.4, gear=100.0, inertia=3e-5, friction=1e-5)


def needs(robot: Robot, motion: Motion, times: Array, motors: list[Actuator], speed: float, payload: float) -> Array:
    """The largest part of a limit, by Pinocchio's inverse dynamics of the loaded robot at s v and s^2 a."""
    model = robot.model.copy()
    frame = model.frames[model.getFrameId(robot.frames["tip"])]
    load = pin.Inertia(payload, frame.placement.translation, np.zeros((3, 3)))
    if payload:
        model.inertias[frame.parentJoint] = model.inertias[frame.parentJoint] + load
    model.armature = np.zeros(model.nv)
    data, most = model.createData(), 0.0
    for t in times:
        q, v, a = motion(t)
        tau = pin.rnea(model, data, q, speed * v, speed**2 * a)
        for m, load_torque, rate, change in zip(motors, tau, speed * v, speed**2 * a, strict=True):
            torque = m.inertia * m.gear * change + m.friction * m.gear * rate + load_torque / m.gear
            volts = m.resistance * torque / m.constant + m.constant * m.gear * rate
            most = max(most, abs(torque) / m.torque, abs(volts) / m.voltage)
    return np.float64(most)


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_bounds_are_where_pinocchio_has_them(seed: int) -> None:
    """Just below a bound all limits are kept, at every lower speed too, and just above it one is passed."""
    rng = np.random.default_rng(seed)
    robot = wbc.robots.load(("ur5", "panda", "kinova")[seed % 3])
    motion = swing(robot, 2.0, seed)
    motors = [
        Actuator(rng.uniform(1.0, 4.0), rng.uniform(12.0, 60.0), rng.uniform(0.03, 0.1), rng.uniform(0.1, 1.0),
                 rng.uniform(60.0, 160.0), rng.uniform(0.0, 5e-5), rng.uniform(0.0, 1e-4))
        for _ in range(robot.nv)
    ]  # fmt: skip
    sizing = ActuatorSizing(robot, motion, 2.0, dict(zip(robot.dof_names, motors, strict=True)), samples=41)
    load, speed = sizing.largest_load(0.5), sizing.largest_speed(0.2)
    for value, part, held in ((load, 0.5, None), (speed, None, 0.2)):
        assert 0.0 < value.value < inf
        for factor, kept in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
            mass = factor * value.value if held is None else held
            rate = factor * value.value if part is None else part
            assert (needs(robot, motion, sizing.times, motors, rate, mass) <= 1.0) == kept
    for slower in np.linspace(0.0, 0.999 * speed.value, 7):
        assert needs(robot, motion, sizing.times, motors, float(slower), 0.2) <= 1.0
    used = sizing.used(speed.value, 0.2)
    k = int(np.abs(sizing.times - speed.time).argmin())
    there = used[k, robot.dof_names.index(speed.joint), ("torque", "voltage").index(speed.row)]
    assert abs(there) == pytest.approx(1.0)


def test_the_published_arm_at_its_bound_uses_the_voltage_that_there_is() -> None:
    """At the largest speed under 20 V the simulated motors are given 20 V, and at 1.1 of it more."""
    scenario = published_scenario()
    motor = Actuator(200.0, 20.0, CONSTANT, RESISTANCE, inertia=1.0 / 29.0)
    bound = ActuatorSizing(scenario.robot, scenario.motion, 1.0, motor, scenario.frame).largest_speed()
    assert (bound.joint, bound.row) == ("joint3", "voltage")
    for factor in (1.0, 1.1):
        s = factor * bound.value

        def faster(t: float, s: float = s) -> tuple[Array, Array, Array]:
            q, v, a = scenario.motion(s * t)
            return q, s * v, s**2 * a

        dt = 1.0 / s / 100
        law = Linearised(arm(), faster, dt, OneStep(3, np.diag([1e5 / dt**2] * 3 + [1e5] * 3)))
        run = simulate(arm().model, law, faster, dt=dt, plant="motor", drive=DriveTrain([MOTOR] * 3), substeps=4)
        most = np.abs(run.voltages).max()
        assert most == pytest.approx(20.0, rel=0.01) if factor == 1.0 else most > 20.5


def test_what_cannot_be_is_said_with_the_joint() -> None:
    robot = wbc.robots.load("ur5")
    motion = swing(robot, 2.0)
    weak = ActuatorSizing(robot, motion, 2.0, Actuator(0.05, 48.0, 0.05, 0.4, gear=100.0), samples=21)
    with pytest.raises(RangeError, match=r"shoulder_lift_joint needs .* N m at .* s and has 0.05 N m"):
        weak.largest_speed()
    with pytest.raises(RangeError, match="shoulder_lift_joint"):
        weak.largest_load()
    strong = ActuatorSizing(robot, motion, 2.0, MOTORS, samples=21)
    assert strong.largest_load(0.0).value > strong.largest_load(1.0).value > strong.largest_load(1.5).value > 0.0
    assert strong.largest_speed(0.0).value > strong.largest_speed(2.0).value
    resting = ActuatorSizing(robot, lambda t: (robot.neutral, np.zeros(6), np.zeros(6)), 1.0, MOTORS, samples=2)
    assert resting.largest_speed().value == inf
    for wrong in (-1.0, inf):
        with pytest.raises((RangeError, NotFiniteError)):
            strong.largest_load(wrong)
        with pytest.raises((RangeError, NotFiniteError)):
            strong.largest_speed(wrong)
    with pytest.raises(RangeError, match=r"Actuator\.torque"):
        Actuator(0.0, 1.0, 1.0, 1.0)
    with pytest.raises(UnknownNameError, match="elbow_joint"):
        ActuatorSizing(robot, motion, 2.0, {"elbow": MOTORS})
    with pytest.raises(RangeError, match="shoulder_pan_joint"):
        ActuatorSizing(robot, motion, 2.0, {"elbow_joint": MOTORS})
    with pytest.raises(ShapeError, match="an Actuator"):
        ActuatorSizing(robot, motion, 2.0, dict.fromkeys(robot.dof_names, 3.0))  # type: ignore[arg-type]
    with pytest.raises(RangeError, match="no joint moves it"):
        ActuatorSizing(robot, motion, 2.0, MOTORS, frame="base_link")
    floating = wbc.robots.load("ur5", base="floating")
    with pytest.raises(UnsupportedJointError):
        ActuatorSizing(floating, swing(floating, 2.0), 2.0, MOTORS)


def test_a_swing_takes_no_more_effort_than_there_is() -> None:
    """Of the Space Station arm too, whose joints are weak for its 1262 kg."""
    for name in ("ssrms", "ur5", "panda"):
        robot = wbc.robots.load(name)
        motion, data = swing(robot, 2.0), robot.model.createData()
        needed = [np.abs(pin.rnea(robot.model, data, *motion(t))) for t in np.linspace(0.0, 2.0, 41)]
        assert (np.max(needed, axis=0) <= robot.limits.effort).all()
    arm = wbc.robots.load("ssrms")
    free = swing(arm.with_limits(effort=1e9), 2.0)
    assert np.abs(pin.rnea(arm.model, arm.model.createData(), *free(1.0))).max() > 5000.0
