"""What a servo does where a robot cannot follow, what it refuses, and what its parts say of themselves."""

from __future__ import annotations

import logging

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.refusals import assert_refused
from tests.servo.plants import DT, HOME, Drives, arm, controller
from tests.servo.test_following import follow
from wbc.api import Controller
from wbc.errors import BoundsError, NotFiniteError, RangeError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.servo import Following, Response, Servo, identify
from wbc.servo.laws import Feedback
from wbc.simulation import Command, CommandKind

KINDS = [str(kind) for kind in CommandKind]


@pytest.mark.parametrize("kind", KINDS)
def test_a_blocked_robot_slows_its_reference_and_then_stops_it_for_good(control: Controller, kind: str) -> None:
    drives = Drives(control.stack.robot, CommandKind(kind), lag=0.05, blocked=True)
    servo = Servo(control, kind, divergence=(0.02, 0.06))
    servo.reset(HOME)
    start, most, speeds, how = control.stack.robot.pose(HOME, "tip").translation, 0.0, [np.zeros(3)], []
    drives.reset(HOME)
    for _ in range(300):
        control["tip"].target = pin.SE3(np.eye(3), start + [0.0, 0.3, 0.0])
        before = servo.reference
        step = servo.step(HOME, np.zeros(3))
        drives.apply(step.command)
        speeds.append((servo.reference - before) / DT)
        how.append(step.following)
        most = max(most, float(np.abs(step.error).max()))
    assert how == sorted(how, key=[*Following].index)  # close, then slowed, then stopped
    assert set(how) == set(Following)
    assert most < 0.06 + 2.0**2 / 20.0  # beyond the stop by v^2 / (2 a) at most
    assert np.abs(np.diff(speeds, axis=0)).max() <= 10.0 * DT * (1 + 1e-6)  # braked within the limits
    assert not speeds[-1].any()
    assert servo.step(servo.reference).following is Following.STOPPED
    servo.reset(HOME)
    assert servo.step(HOME).following is Following.CLOSE


@pytest.mark.parametrize("kind", ["velocity", "torque"])
def test_a_joint_of_the_wrong_sign_does_not_run_away(
    control: Controller, caplog: pytest.LogCaptureFixture, kind: str
) -> None:
    class Crossed(Drives):
        def apply(self, command: Command) -> None:
            super().apply(Command(command.kind, command.values * [1.0, 1.0, -1.0]))

    drives = Crossed(control.stack.robot, CommandKind(kind), lag=0.02, friction=1.0 if kind == "torque" else 0.0)
    servo = Servo(control, kind)
    with caplog.at_level(logging.WARNING, "wbc"):
        *_, seen, how = follow(servo, drives)
    assert how[-1] == Following.STOPPED
    assert caplog.text.count("joint3 runs away") == 1
    # Without feedback the wrong torque of its weight is left
    assert kind == "torque" or np.abs(seen[-1]).max() < 0.01


def test_a_reading_far_off_does_not_push_harder_than_the_divergence(control: Controller) -> None:
    control["tip"].target = control.stack.robot.pose(HOME, "tip")
    control["tip"].feedforward = np.zeros(6)
    servo = Servo(control, "torque", divergence=(0.02, 0.06))
    servo.reset(HOME)
    rest = servo.step(HOME, np.zeros(3)).command.values
    far = servo.step(HOME + 1e3, np.full(3, 1e9)).command.values
    near = Servo(control, "torque", divergence=(0.02, 0.06))
    near.reset(HOME)
    near.step(HOME, np.zeros(3))
    w = 1.0 / (10 * DT)
    bounded = near.step(HOME + 0.02, np.full(3, 0.02 * w)).command.values
    assert (np.abs(far - rest) <= np.abs(bounded - rest) * (1.0 + 1e-6)).all()
    assert (np.abs(far - rest) > 0.0).any()
    assert np.isfinite([rest, far]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_again_after_a_reset(control: Controller, kind: str) -> None:
    drives = Drives(control.stack.robot, CommandKind(kind), lag=0.05)
    servo = Servo(control, kind, response=Response(lag=0.05))
    first = follow(servo, drives, 50)[1]
    assert (follow(servo, drives, 50)[1] == first).all()


def test_what_was_found_is_kept_and_can_be_told(control: Controller) -> None:
    servo = Servo(control, "position")
    follow(servo, Drives(control.stack.robot, CommandKind.POSITION, lag=0.08), 1500)
    found = servo.response
    servo.reset(HOME)
    assert servo.response is found
    assert found.lag == pytest.approx(np.full(3, 0.08), rel=0.15)
    assert Servo(control, "position", response=found).response is found


@pytest.mark.parametrize(
    ("q", "v", "error"),
    [
        (np.zeros(4), None, ShapeError),
        ([0.0, np.nan, 0.0], None, NotFiniteError),
        ([0.0, 1e300, 0.0], None, RangeError),
        (HOME, [0.0, np.inf, 0.0], NotFiniteError),
        (HOME, np.zeros(2), ShapeError),
    ],
)
def test_a_bad_reading_is_refused_and_changes_nothing(
    control: Controller, q: object, v: object, error: type[wbc.WbcError]
) -> None:
    servo, other = (Servo(control.clone(), "velocity") for _ in range(2))
    for one in (servo, other):
        one.reset(HOME)
        one.controller["tip"].target = pin.SE3(np.eye(3), np.array([0.5, 0.1, 0.2]))
        one.step(HOME)
    assert_refused(lambda: servo.step(q, v), error, "q" if v is None else "v")
    assert (servo.step(HOME).command.values == other.step(HOME).command.values).all()


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"kind": "postion"}, UnknownNameError, "did you mean 'position'"),
        ({"divergence": (0.3, 0.1)}, BoundsError, "divergence"),
        ({"divergence": (0.0, 0.1)}, BoundsError, "divergence"),
        ({"armature": -1.0}, RangeError, "armature"),
        ({"damping": [1.0, 2.0]}, ShapeError, "damping"),
        ({"response": Response(lag=[0.1, 0.1])}, ShapeError, "response.lag"),
        ({"response": Response(delay=0.2)}, RangeError, "response.delay"),
        ({"response": 0.1}, ShapeError, "response"),
    ],
)
def test_what_makes_no_sense_is_refused(control: Controller, options: dict[str, object], error: type[wbc.WbcError],
                                        text: str) -> None:  # fmt: skip
    assert_refused(lambda: Servo(control, **{"kind": "velocity", **options}), error, text)


def test_a_base_that_moves_is_refused() -> None:
    stack = wbc.Stack(wbc.robots.load("talos"), dt=DT)
    stack.add(wbc.tasks.Posture(), name="posture")
    assert_refused(lambda: Servo(stack.compile(backend="vm"), "position"), UnsupportedJointError, "floating")


def test_a_reference_without_acceleration_limits_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "wbc"):
        Servo(controller(arm(np.inf)), "velocity")
    assert "joint1 has no acceleration limit" in caplog.text


def test_a_recording_that_says_nothing_is_refused() -> None:
    still, moving = np.zeros((400, 2)), np.sin(np.linspace(0, 9, 400))[:, None] * [1.0, 0.0]
    assert_refused(lambda: identify(moving, moving, DT), RangeError, "joint 1 hardly moves")
    assert_refused(lambda: identify(still[:5], still[:5], DT), RangeError, "samples")
    assert_refused(lambda: identify(still, still[:, :1], DT), ShapeError, "measured")
    assert_refused(lambda: identify(still * np.nan, still, DT), NotFiniteError, "commands")
    assert_refused(lambda: Response(lag=-0.1), RangeError, "lag")
    assert_refused(lambda: Response(delay=np.nan), NotFiniteError, "delay")


@pytest.mark.parametrize("late", [0, 1, 7])
def test_an_error_ahead_is_what_pending_corrections_make_of_it(late: int) -> None:
    """The prediction inside d, against the error dynamics stepped finely."""
    rng, dt, w = np.random.default_rng(late), 0.002, 20.0
    feedback = Feedback(CommandKind.TORQUE, dt, np.zeros(1), late, w)
    sent, e, rate = rng.normal(size=(late, 1)), 0.3, -0.7
    for d in sent[:, 0]:
        e += dt * rate - dt * dt * d / 2.0
        rate -= dt * d
    found, none = feedback.correction(np.array([0.3]), np.array([-0.7]), np.zeros(1), sent, 10.0)
    assert found[0] == pytest.approx(2.0 * w * rate + w * w * e, rel=2e-3)
    assert not none.any()


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_corrections_cancel_the_response_of_a_servo(kind: str) -> None:
    """What C M d2/dt2 + T d/dt + 1 makes of the error's own dynamics, for a mode exp(s t) of the error."""
    s, w, lag, inertia = 3.0, 20.0, 0.03, 0.004
    feedback = Feedback(CommandKind(kind), 0.002, np.array([lag]), 0, w)
    d, b = feedback.correction(np.ones(1), np.array([s]), np.array([1.0 / s]), np.zeros((0, 1)), 1.0)
    if kind == "position":
        assert d[0] + inertia * b[0] == pytest.approx((inertia * s**2 + lag * s + 1.0) * w / s)
    else:
        assert d[0] + (inertia + lag) * b[0] == pytest.approx(((inertia + lag) * s + 1.0) * (w + 0.25 * w**2 / s))


def test_a_joint_that_goes_round_is_followed() -> None:
    """A continuous joint as (cos, sin), which goes round."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "turn")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    one = np.ones(1)
    robot = wbc.robots.load(model).with_limits(velocity=6.0 * one, acceleration=20.0 * one)
    stack = wbc.Stack(robot, dt=DT)
    stack.add(wbc.tasks.Posture(gain=5.0), name="posture")
    stack.add(wbc.tasks.JointLimits())
    servo = Servo(stack.compile(backend="vm"), "position")
    servo.reset(robot.neutral)
    q, lag = robot.neutral, 0.05
    for k in range(500):
        angle = 4.0 * k * DT
        servo.controller["posture"].target = [np.cos(angle), np.sin(angle)]
        u = servo.step(q).command.values
        q = pin.integrate(model, q, (1 - np.exp(-DT / lag)) * pin.difference(model, q, u))
    assert float(np.abs(pin.difference(model, q, servo.reference))[0]) < 0.01
    assert servo.response.lag == pytest.approx(lag * one, rel=0.3)
