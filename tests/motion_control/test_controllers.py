"""Controllers of this package in closed loops, and the steps at which they still work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.refusals import assert_refused
from wbc.errors import RangeError, ShapeError, UnsupportedJointError
from wbc.motion_control import (
    AdaptiveControl,
    ComputedTorque,
    Impedance,
    OneStepPerturbation,
    StackTracking,
    largest_step,
    loaded,
    run_trial,
)
from wbc.motion_control.comparison import swing
from wbc.robot import Robot
from wbc.robots import load
from wbc.simulation import Command, CommandKind, PinocchioPlant


def two_links(gravity: float = 9.81, base: str = "fixed") -> Robot:
    """Two links of 1 kg and 0.5 m in a vertical plane, on a wall or on a floating body of 5 kg."""
    model = pin.Model()
    parent = 0
    if base == "floating":
        parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        model.appendBodyToJoint(parent, pin.Inertia.FromBox(5.0, 0.4, 0.3, 0.2), pin.SE3.Identity())
    for k in range(2):
        place = pin.SE3(np.eye(3), np.array([0.5 * k, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{k}")
        at = pin.SE3(np.eye(3), np.array([0.25, 0.0, 0.0]))
        model.appendBodyToJoint(parent, pin.Inertia.FromBox(1.0, 0.5, 0.05, 0.05), at)
    model.addFrame(pin.Frame("tip", parent, 0, pin.SE3(np.eye(3), np.array([0.5, 0, 0])), pin.FrameType.OP_FRAME))
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    model.name = "two_links"
    return load(model, base=base)


def still(robot: Robot):  # type: ignore[no-untyped-def]
    q, none = robot.neutral + 0.3 * (np.arange(robot.nq) >= robot.nq - 2), np.zeros(robot.nv)
    return lambda t: (q, none, none)


def sway(robot: Robot):  # type: ignore[no-untyped-def]
    return swing(robot, 2.0)


LAWS = {
    "computed torque": lambda r, m, dt: ComputedTorque(r, m, dt, stiffness=625.0, damping=50.0),
    "adaptive": lambda r, m, dt: AdaptiveControl(r, m, dt, stiffness=25.0, damping=25.0),
    "impedance": lambda r, m, dt: Impedance(r, m, dt, frequency=25.0),
    "one step": OneStepPerturbation,
    "stack": lambda r, m, dt: StackTracking(r, m, dt, stiffness=625.0, damping=50.0, backend="vm"),
}


@pytest.mark.parametrize("name", LAWS)
def test_an_exact_model_is_followed(name: str) -> None:
    robot, dt = two_links(), 0.01
    trial = run_trial(PinocchioPlant(robot, 0.005), robot, LAWS[name](robot, sway(robot), dt), sway(robot), dt, 0.5)
    assert not trial.away
    assert trial.tip.max() < 1e-3


@pytest.mark.parametrize("name", ["computed torque", "adaptive"])
def test_a_base_that_floats_freely(name: str) -> None:
    """Without gravity: joints follow, no torque acts on the base, momentum stays zero."""
    robot, dt = two_links(0.0, "floating"), 0.01
    plant = PinocchioPlant(robot, 0.005)
    trial = run_trial(plant, robot, LAWS[name](robot, sway(robot), dt), sway(robot), dt, 0.5)
    assert np.abs(trial.errors).max() < 2e-3
    assert not trial.torques[:, :6].any()
    assert np.abs(plant.momentum).max() < 1e-7
    assert np.linalg.norm(trial.q[-1, :7] - trial.q[0, :7]) > 1e-3


@pytest.mark.parametrize(("gravity", "base"), [(9.81, "fixed"), (0.0, "floating")])
def test_a_payload_is_learned(gravity: float, base: str) -> None:
    """1 kg at the tip: its mass within 1 % in a second, and the estimate is a body at every tick."""
    robot, dt = two_links(gravity, base), 0.005
    law = AdaptiveControl(robot, sway(robot), dt, stiffness=25.0, damping=25.0)
    plain = ComputedTorque(robot, sway(robot), dt, stiffness=625.0, damping=50.0)
    plant = PinocchioPlant(loaded(robot, 1.0, frame="tip"), 0.005)
    seconds = 1.0 if base == "fixed" else 1.5
    least: list[float] = []

    def watch() -> None:
        least.append(
            float(np.linalg.eigvalsh(pin.PseudoInertia.FromDynamicParameters(law.body("joint1")).toMatrix())[0])
        )

    trial = run_trial(plant, robot, law, sway(robot), dt, seconds, tick=watch)
    before = run_trial(plant, robot, plain, sway(robot), dt, seconds)
    assert np.abs(trial.errors[-10:]).max() < 0.1 * np.abs(before.errors[-10:]).max()
    assert law.mass("joint1")[0] == pytest.approx(1.0, rel=0.01 if base == "fixed" else 0.15)
    assert min(least) > 0.0


def test_what_a_motion_does_not_show_is_not_claimed() -> None:
    """The same motion ten times slower: without gravity nothing is known of a mass, with gravity it is."""
    found = {}
    for gravity in (0.0, 9.81):
        for pace in (1.0, 0.1):
            robot = two_links(gravity)
            fast = sway(robot)

            def motion(t: float, fast=fast, pace=pace):  # type: ignore[no-untyped-def]
                q, v, a = fast(pace * t)
                return q, pace * v, pace**2 * a

            law = AdaptiveControl(robot, motion, 0.05, stiffness=5.0, damping=5.0)
            for k in range(40):
                q, v, _ = motion(0.05 * k)
                law.command(0.05 * k, q, v)
            found[gravity, pace] = law.mass("joint1")[1]
    # Inertial torques fall with the square of the pace
    assert found[0.0, 0.1] > 50.0 * found[0.0, 1.0]
    assert found[9.81, 0.1] < 0.1 * found[0.0, 0.1]
    assert np.isinf(AdaptiveControl(two_links(), sway(two_links()), 0.01, stiffness=5, damping=5).mass("joint1")[1])


def test_the_spring_of_an_impedance() -> None:
    """A push of 5 N moves the tip by 5 N / 500 N/m, along the push; the plant is another's."""
    robot, dt = two_links(), 0.005
    motion = still(robot)
    law = Impedance(robot, motion, dt, frequency=20.0, frame="tip", stiffness=[500.0, 500.0, 500.0, 1.0, 1.0, 1.0])
    plant = PinocchioPlant(robot, dt)
    q, _, _ = motion(0.0)
    plant.reset(q, 0.0)
    start, push = robot.pose(q, "tip").translation, np.array([0.0, 0.0, -5.0])
    for k in range(400):
        state = plant.read()
        torque = law.command(k * dt, state.q, state.v) + robot.jacobian(state.q, "tip")[:3].T @ push
        plant.apply(Command(CommandKind.TORQUE, torque))
        plant.advance(dt)
    moved = robot.pose(plant.read().q, "tip").translation - start
    # The arm is planar: the stiffness against turning of 1 N m/rad adds a little
    np.testing.assert_allclose(moved, push / 500.0, atol=1e-3)


@pytest.mark.parametrize(("stiffness", "damping"), [(625.0, 50.0), (1e4, 20.0), (10.0, 100.0)])
def test_the_largest_step_is_the_largest(stiffness: float, damping: float) -> None:
    """Just below it an error dies away, just above it grows; above it is refused with its value."""
    robot, most = two_links(0.0), largest_step(stiffness, damping)

    def slowest(factor: float) -> float:
        dt = factor * most
        step = [[1.0 - stiffness * dt**2 / 2, dt - damping * dt**2 / 2], [-stiffness * dt, 1.0 - damping * dt]]
        return float(np.abs(np.linalg.eigvals(step)).max())

    assert slowest(0.98) < 1.0 < slowest(1.02)
    motion = still(robot)
    ComputedTorque(robot, motion, 0.99 * most, stiffness=stiffness, damping=damping)
    assert_refused(
        lambda: ComputedTorque(robot, motion, 1.01 * most, stiffness=stiffness, damping=damping),
        RangeError,
        f"below {most:.4g} s",
    )


def test_the_largest_step_in_a_closed_loop() -> None:
    robot = two_links(0.0)
    motion, most = still(robot), largest_step(625.0, 50.0)
    q = motion(0.0)[0]
    ends = []
    for factor in (0.9, 1.1):
        dt = factor * most
        law = ComputedTorque(robot, motion, 0.5 * most, stiffness=625.0, damping=50.0)
        plant = PinocchioPlant(robot, dt / 8)
        plant.reset(q + 1e-4, 0.0)
        for k in range(25):
            state = plant.read()
            plant.apply(Command(CommandKind.TORQUE, law.command(k * dt, state.q, state.v)))
            plant.advance(dt)
        ends.append(float(np.abs(plant.read().q - q).max()))
    assert ends[0] < 1e-4 < ends[1]


def test_torques_stay_within_their_limits() -> None:
    """Of the perturbation and of the stack; without the limits they would be above."""
    robot = two_links()
    free, motion = OneStepPerturbation(robot, still(robot), 0.01), still(robot)
    q, v = motion(0.0)[0] + 0.1, np.zeros(2)
    limit = 0.7 * np.abs(free.command(0.0, q, v))
    bounded = robot.with_limits(effort=limit)
    one = OneStepPerturbation(bounded, motion, 0.01).command(0.0, q, v)
    stack = StackTracking(bounded, motion, 0.01, stiffness=625.0, damping=50.0, backend="vm")
    for torque in (one, stack.command(0.0, q, v)):
        assert (np.abs(torque) <= limit + 1e-9).all()


def test_what_is_refused() -> None:
    robot = two_links()
    motion = still(robot)
    for gains in ({"stiffness": -1.0, "damping": 10.0}, {"stiffness": 1.0, "damping": 0.0}):
        with pytest.raises(RangeError):
            ComputedTorque(robot, motion, 0.01, **gains)

    def changed(inertia: pin.Inertia) -> Robot:
        model = robot.model.copy()
        model.inertias[2] = inertia
        return replace(robot, model=model)

    light = changed(pin.Inertia(-1.0, np.zeros(3), np.eye(3)))
    nothing = changed(pin.Inertia.Zero())
    odd = changed(pin.Inertia(1.0, np.zeros(3), np.diag([1.0, 1.0, 3.0])))
    for wrong, said in ((light, "joint1'].mass"), (nothing, "singular: nothing that weighs"), (odd, "no body")):
        assert_refused(lambda wrong=wrong: LAWS["computed torque"](wrong, motion, 0.01), RangeError, said)
    with pytest.raises(ShapeError):
        ComputedTorque(robot, still(two_links(base="floating")), 0.01, stiffness=1.0, damping=1.0)
    floating = two_links(base="floating")
    for name in ("impedance", "one step"):
        with pytest.raises(UnsupportedJointError):
            LAWS[name](floating, still(floating), 0.01)
    with pytest.raises(RangeError):
        AdaptiveControl(robot, motion, 0.01, stiffness=1.0, damping=1.0, rate=2.0)
    with pytest.raises(wbc.errors.UnknownNameError):
        AdaptiveControl(robot, motion, 0.01, stiffness=1.0, damping=1.0, learn=("elbow",))
