"""Motors of third order under the arm, and the published controllers on robots of today."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg

import wbc
from tests.published.newton_euler_arm import ARM, DT, TASK, tip_error
from tests.refusals import assert_refused
from wbc.errors import RangeError, UnsupportedJointError
from wbc.motion_control.comparison import TrialCondition, compare, swing
from wbc.published.newton_euler import DriveTrain, Linearised, Motor, Nominal, Rigid, simulate
from wbc.published.newton_euler.comparison import PUBLISHED, scenario_with_published
from wbc.published.newton_euler.three_link import CONSTANT, ELECTRIC, HYDRAULIC, MOTOR, RESISTANCE
from wbc.validation import Array


def slider(mass: float) -> pin.Model:
    """A mass on a horizontal rail."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return model


class Pull:
    """A torque that changes from step to step."""

    def command(self, time: float, q: Array, v: Array) -> Array:
        return np.array([0.3 + np.sin(40.0 * time)])


@pytest.mark.parametrize("motor", [replace(MOTOR, gear=3.0), ELECTRIC, replace(ELECTRIC, gear=7.0), HYDRAULIC])
def test_a_mass_on_a_rail_moves_as_the_linear_system_does(motor: Motor) -> None:
    """Motor and mass are a linear system, solved exactly from the voltages; what z gives after a step is what was asked
    for, as far as the rate does not change within it.
    """
    mass, drive = 5.0, DriveTrain([motor])
    run = simulate(
        slider(mass), Pull(), lambda t: (np.zeros(1),) * 3, dt=0.004, steps=60, plant="motor", drive=drive, substeps=8
    )
    A, B, p = drive.combined(Rigid(slider(mass)).equations(np.zeros(1), np.zeros(1)))
    m = len(A)
    both = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, m + 1))]]) * 0.004)
    x = np.zeros(m)
    assert not p.any()
    for k, u in enumerate(run.voltages):
        x = both[:m, :m] @ x + both[:m, m] * u
        np.testing.assert_allclose(motor.gear * run.q[k + 1], x[:1], atol=1e-7 * max(1.0, abs(x[0])))
    # An endless mass stands still, and the torque that moves it is the one that was asked for
    heavy = DriveTrain([motor])
    model = Rigid(slider(1e9)).equations(np.zeros(1), np.zeros(1))
    z = np.zeros(m - 2)
    asked = np.array([0.7])
    u = heavy.voltage(model, np.zeros(1), np.zeros(1), asked, z, 0.004)
    A, B, _ = heavy.combined(model)
    moved = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, m + 1))]]) * 0.004) @ np.append(np.zeros(m), u)
    acceleration = (A @ moved[:m] + B @ u)[1]
    np.testing.assert_allclose(1e9 * acceleration / motor.gear, asked, rtol=1e-5)


def test_stall_and_free_run() -> None:
    """What catalogues print: torque of a motor that is held, rate of one without load, at a constant input."""
    k, loss, store, inertia, friction, inflow, u = 0.05, 0.4, 1e-3, 2e-5, 1e-4, 3.0, 12.0
    motor = Motor.third_order(k, loss, store, inertia, friction, inflow)
    held = motor.A[2, 2:] @ [inflow * u / loss] + motor.b[2] * u
    assert abs(held) < 1e-9 * motor.b[2] * u
    torque = k * inflow * u / loss
    assert motor.A[1, 2] * inflow * u / loss + motor.f[1] * torque == pytest.approx(0.0, abs=1e-9 * torque / inertia)
    rate = k * inflow * u / (k**2 + loss * friction)
    x = np.array([0.0, rate, friction * rate / k])
    moved = motor.A @ x + motor.b * u
    np.testing.assert_allclose(moved, [rate, 0.0, 0.0], atol=1e-8 * np.abs(motor.A[1:] * x).max())


def test_the_linearised_controller_on_motors_of_third_order() -> None:
    """Under 1 mm on both, where nothing but the nominal torques leaves the line by 66 and 92 mm."""
    for motor, wanted in ((ELECTRIC, (0.462e-3, 65.6e-3)), (HYDRAULIC, (0.711e-3, 92.0e-3))):
        for law, off in zip((Linearised(ARM, TASK, DT), Nominal(ARM, TASK)), wanted, strict=True):
            run = simulate(ARM.model, law, TASK, plant="motor", drive=DriveTrain([motor] * 3), substeps=6)
            assert tip_error(run) == pytest.approx(off, rel=0.02)


def test_bad_motors() -> None:
    for name in ("constant", "loss", "store", "inertia"):
        with pytest.raises(RangeError, match=name):
            Motor.third_order(**{"constant": 1.0, "loss": 1.0, "store": 1.0, "inertia": 1.0, name: 0.0})
    with pytest.raises(RangeError, match="expected the rate alone"):
        Motor(np.array([[0.0, 2.0], [0.0, -1.0]]), MOTOR.b, MOTOR.f)
    with pytest.raises(RangeError, match="does not move"):
        Motor(ELECTRIC.A * [[1, 1, 1], [1, 1, 0], [1, 1, 1]], ELECTRIC.b, ELECTRIC.f)
    fast = DriveTrain([Motor.third_order(CONSTANT, RESISTANCE, 1e-4 * RESISTANCE, 1.0 / 29.0)] * 3)
    with pytest.raises(RangeError, match=r"at least 4[01]"):
        simulate(ARM.model, Nominal(ARM, TASK), TASK, plant="motor", drive=fast)
    with pytest.raises(RangeError, match="dt"):
        fast.voltage(Rigid(ARM.model).equations(*TASK(0.0)[:2]), *TASK(0.0)[:2], np.zeros(3))


@pytest.mark.parametrize("name", ["kinova", "ur5"])
def test_the_linear_model_of_any_robot(name: str) -> None:
    """By finite differences of Pinocchio's forward dynamics; joints without ends are in it."""
    robot, rng, h = wbc.robots.load(name), np.random.default_rng(3), 1e-6
    model, data, n = robot.model, robot.model.createData(), robot.nv
    q, (v, a) = pin.randomConfiguration(model, robot.neutral - 1.0, robot.neutral + 1.0), rng.normal(size=(2, n))
    dynamics = Rigid(model)
    found = dynamics.linear_model(q, v, a)
    tau = found.torque(a)
    np.testing.assert_allclose(tau, pin.rnea(model, data, q, v, a), atol=1e-10)
    A, _ = found.system
    for k, e in enumerate(np.eye(n)):
        for column, move in ((k, (h * e, 0 * e)), (n + k, (0 * e, h * e))):
            sides = [pin.aba(model, data, pin.integrate(model, q, s * move[0]), v + s * move[1], tau) for s in (1, -1)]
            np.testing.assert_allclose(A[n:, column], (sides[0] - sides[1]) / (2 * h), atol=2e-5 * np.abs(A).max())
    np.testing.assert_allclose(dynamics.error(pin.integrate(model, q, v), q), v, atol=1e-12)


def test_published_controllers_on_a_robot_of_today() -> None:
    """On a UR5 the order of the thesis holds as well; controller 2 lags by (2 / omega - T) q' on every joint."""
    scenario = scenario_with_published(wbc.robots.load("ur5"))
    names = ("nominal torque", "1 linearised", "1 with stiff weights", "2 on all joints", "3 adaptive")
    assert names == tuple(PUBLISHED)
    found = {one.name: one for one in compare(scenario, TrialCondition(rate=100.0), names)}
    assert not any(one.trial.away for one in found.values())
    assert found["1 with stiff weights"].largest < found["1 linearised"].largest < found["2 on all joints"].largest
    assert found["3 adaptive"].largest < 0.1 * found["nominal torque"].largest
    fast = next(iter(compare(scenario, TrialCondition(rate=1000.0), ["2 on all joints"]))).trial
    rates = np.array([scenario.motion(t)[1] for t in fast.times])
    lag = (2.0 / 100.0 - 0.01) * rates
    assert np.abs(fast.errors - lag)[200:].max() < 0.15 * np.abs(lag).max()


def test_published_controllers_need_a_fixed_base() -> None:
    robot = wbc.robots.load("ur5", base="floating")
    scenario = scenario_with_published(robot)
    assert not set(PUBLISHED) & set(scenario.names())
    assert_refused(lambda: scenario.names(["3 adaptive"]), UnsupportedJointError, "fixed base")
    assert_refused(lambda: PUBLISHED["3 adaptive"](robot, swing(robot, 1.0), 0.01), UnsupportedJointError, "")
