"""dv/d(inputs) through the active set against differences of whole ticks."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import FRAMES, arm, robot
from tests.models import placement
from tests.repeats import repeats
from wbc.api import Controller
from wbc.errors import SolverError, UnknownNameError
from wbc.tasks import EndEffector, Hold, JointLimits

#: Displacement of whole ticks
STEP = 1e-5


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def tick(request: pytest.FixtureRequest) -> Controller:
    stack = arm(posture=0.1).add(Hold(FRAMES["panda"].tip, kind="position"), name="hold")
    controller = stack.compile(**way(request.param))
    controller.reset(robot("panda").neutral)
    place = pin.SE3(pin.exp3(np.array([0.4, 0.2, 0.1])), np.array([0.5, 0.2, 0.4]))
    controller["hand"].target = place
    controller["hand"].gain = 0.12
    controller["ball"].pose = pin.SE3(np.eye(3), np.array([0.0, 0.0, 3.0]))
    controller["hold"].target = tip(Q)
    controller["limits"].velocity_scale = 0.015
    return controller


Q, V = robot("panda").neutral + 0.02, np.array([0.01, 0.01, -0.01, 0.0, 0.01, 0.0, 0.01])


def tip(q: np.ndarray) -> pin.SE3:
    bot = robot("panda")
    return placement(bot, FRAMES["panda"].tip, q)


def shifted(kind: str, value: object, k: int, by: float) -> object:
    """A value displaced along its k-th direction."""
    if kind == "pose":
        turn = pin.exp3(by * np.eye(6)[k][3:])
        return pin.SE3(turn @ value.rotation, value.translation + by * np.eye(6)[k][:3])
    if kind == "number":
        return value + by
    return value + by * np.eye(len(value))[k]


def measured(tick: Controller, item: str, name: str, kind: str, k: int) -> np.ndarray:
    value, ends = getattr(tick[item], name), []
    for sign in (STEP, -STEP):
        setattr(tick[item], name, shifted(kind, value, k, sign))
        ends.append(tick.step(Q, V).v)
    setattr(tick[item], name, value)
    return (ends[0] - ends[1]) / (2 * STEP)


@pytest.mark.parametrize(
    ("item", "name", "kind", "count"),
    [
        ("hand", "target", "pose", 6),
        ("hand", "feedforward", "vector", 6),
        ("hand", "gain", "number", 1),
        ("posture", "target", "vector", 7),
        ("hold", "target", "pose", 3),
        ("limits", "velocity_scale", "number", 1),
    ],
)
def test_inputs(tick: Controller, item: str, name: str, kind: str, count: int) -> None:
    step = tick.step(Q, V)
    assert step.status == "solved"
    assert {b.item for b in step.binding} == {"hold", "limits"}
    found = step.derivative(item, name)
    for k in range(count):
        assert found[:, k] == pytest.approx(measured(tick, item, name, kind, k), abs=2e-5), k
    assert np.abs(found).max() > 1e-3


def test_configuration_velocity_and_weight(tick: Controller) -> None:
    step = tick.step(Q, V)
    for k in range(7):
        e = STEP * np.eye(7)[k]
        by_q = (tick.step(Q + e, V).v - tick.step(Q - e, V).v) / (2 * STEP)
        by_v = (tick.step(Q, V + e).v - tick.step(Q, V - e).v) / (2 * STEP)
        assert step.derivative("q")[:, k] == pytest.approx(by_q, abs=2e-5), k
        assert step.derivative("v")[:, k] == pytest.approx(by_v, abs=2e-5), k
    ends = []
    for factor in (np.exp(STEP), np.exp(-STEP)):
        tick["posture"].weight = 0.1 * factor
        ends.append(tick.step(Q, V).v)
    tick["posture"].weight = 0.1
    assert step.derivative("posture", "weight")[:, 0] == pytest.approx((ends[0] - ends[1]) / (2 * STEP), abs=1e-6)


def test_what_has_no_derivative_is_refused(tick: Controller) -> None:
    step = tick.step(Q, V)
    with pytest.raises(UnknownNameError, match="did you mean 'hand'"):
        step.derivative("hnd", "target")
    with pytest.raises(UnknownNameError, match="did you mean 'target'"):
        step.derivative("hand", "traget")
    with pytest.raises(UnknownNameError):
        step.derivative("hand")
    with pytest.raises(UnknownNameError):
        step.derivative("hold", "weight")
    target = tick["hold"].target
    tick["hold"].target = pin.SE3(target.rotation, target.translation + [3.0, 0.0, 0.0])
    relaxed = tick.step(Q, V)
    tick["hold"].target = target
    assert relaxed.status == "relaxed"
    with pytest.raises(SolverError, match="every row holds"):
        relaxed.derivative("q")


@pytest.mark.parametrize("seed", range(repeats(3)))
def test_directions_that_only_damping_decides(seed: int) -> None:
    """A position at a weight of 1000 beside a damping of 1e-8, against differences of fourth order of whole ticks."""
    bot, frame = wbc.robots.load("panda"), FRAMES["panda"].tip
    stack = wbc.Stack(bot, dt=0.005).add(EndEffector(frame, kind="position"), name="hand", weight=1e3)
    controller, still = stack.add(JointLimits(), name="limits").compile(backend="vm"), np.zeros(bot.nv)
    q = bot.integrate(bot.neutral, np.random.default_rng(seed).uniform(-0.4, 0.4, bot.nv))
    controller.reset(q)
    controller["hand"].target = bot.pose(q, frame).translation + [2e-3, -1e-3, 3e-3]

    def changed(direction: np.ndarray) -> np.ndarray:
        return np.asarray(
            np.subtract(*(controller.step(bot.integrate(q, x), still).v for x in (direction, -direction)))
        )

    far = 1e-3
    due = np.transpose([(8.0 * changed(far * e) - changed(2.0 * far * e)) / (12.0 * far) for e in np.eye(bot.nv)])
    near = pytest.approx(due, abs=2e-4 * np.abs(due).max())
    assert controller.step(q, still).derivative("q") == near
    assert controller.batch(2).step(np.stack([q, q]), np.zeros((2, bot.nv))).derivative("q")[1] == near
